"""The error of the heading of a scan in a draft, from the likelihood of its readings at headings near the present one.

An echo begins and ends at headings that depend on its level, so the readings at both sides of all echoes determine a
heading ten times better than the middles of the echoes do.
"""

import math

import numpy as np
from scipy.special import softmax
from sonarhw_sim.room.room import Room

from sonarhw.readings import FloatArray
from sonarhw_compare.fit.values.parameters import free_parameters
from sonarhw_compare.matching.regions import mean_run
from sonarhw_compare.room_finding.draft import RoomDraft
from sonarhw_compare.room_finding.evidence import ROUGH, Evidence, as_found

_STEP = math.radians(0.25)  # between the headings that are tried
_LEAST_TURN, _MOST_TURN = math.radians(6), math.radians(12)  # to each side
_TURN = 2.0  # to each side, standard deviations of the heading; more is reached in several steps of a refinement
_LEAST = math.radians(0.2)  # least standard deviation


def heading_error(evidence: Evidence, draft: RoomDraft, room: Room, scan: int) -> tuple[float, float]:
    """Return the angle by which the heading of a scan is too small (rad), and its standard deviation.

    `room` is that of the draft. Neighbouring readings of one echo count as one.
    """
    board, place = as_found(evidence.problems[scan].board, draft), draft.places[scan]
    problem = evidence.of_draft(draft, room, scan, free_parameters(("heading",), ("",), room, board))
    turns = _turns(evidence.spreads[scan].heading)
    here = problem.with_noise(np.array([place.heading]), ROUGH)
    values = np.tile(here, (len(turns), 1))
    values[:, 0] += turns
    arrays = problem.scans[0]
    likelihoods = problem.near(here).many(values)
    weights = softmax(likelihoods / mean_run(arrays.angles, arrays.ranges[:, 0]))
    error = float(weights @ turns)
    return error, math.hypot(math.sqrt(float(weights @ (turns - error) ** 2)), _LEAST)


def _turns(spread: float) -> FloatArray:
    """Return the angles (rad) by which a heading with this standard deviation (rad) is turned, (n,)."""
    steps = round(min(max(_LEAST_TURN, _TURN * spread), _MOST_TURN) / _STEP)
    return np.asarray(np.arange(-steps, steps + 1) * _STEP)
