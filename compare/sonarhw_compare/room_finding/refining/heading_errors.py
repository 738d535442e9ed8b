"""The error of the heading of a scan in a draft, from the likelihood of its readings at headings near the present one.

An echo begins and ends at headings that depend on its level, so the readings at both sides of all echoes determine a
heading ten times better than the middles of the echoes do.
"""

import math

import numpy as np
from scipy.special import softmax
from sonarhw_sim.room.model import Room

from sonarhw_compare.fit.values.parameters import free_parameters
from sonarhw_compare.matching.regions import mean_run
from sonarhw_compare.room_finding.draft import RoomDraft
from sonarhw_compare.room_finding.evidence import ROUGH, Evidence, with_offset

_TURNS = np.radians(np.arange(-6.0, 6.01, 0.25))  # rad, that are tried
_LEAST = math.radians(0.2)  # least standard deviation


def heading_error(evidence: Evidence, draft: RoomDraft, room: Room, scan: int) -> tuple[float, float]:
    """Return the angle by which the heading of a scan is too small (rad), and its standard deviation.

    `room` is that of the draft. Neighbouring readings of one echo count as one.
    """
    board, place = with_offset(evidence.problems[scan].board, draft), draft.places[scan]
    problem = evidence.of_draft(draft, room, scan, free_parameters(("heading",), ("",), room, board))
    values = np.tile(problem.with_noise(np.array([place.heading]), ROUGH), (len(_TURNS), 1))
    values[:, 0] += _TURNS
    arrays = problem.scans[0]
    likelihoods = problem.near(values[0] - [_TURNS[0], *np.zeros(problem.size - 1)]).many(values)
    weights = softmax(likelihoods / mean_run(arrays.angles, arrays.ranges[:, 0]))
    error = float(weights @ _TURNS)
    return error, math.hypot(math.sqrt(float(weights @ (_TURNS - error) ** 2)), _LEAST)
