"""Refinement of a draft: walls, posts and uncertain places move to where they explain the ranges best.

Each step is one of least squares with Cauchy weights (Holland and Welsch 1977), so that false echoes and wrong paths
count little. The likelihood is too rough for its gradients: it decides between the drafts on the way.
"""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sonarhw.readings import FloatArray
from sonarhw_compare.fit.likelihood.echo_likelihood import ReadingNoise
from sonarhw_compare.room_finding.draft import DraftEnd, RoomDraft
from sonarhw_compare.room_finding.evidence import Evidence, Scored
from sonarhw_compare.room_finding.refining.moves import Move, moves_of
from sonarhw_compare.room_finding.refining.range_errors import range_errors
from sonarhw_compare.room_finding.right_angles import pulls

UNKNOWN, UNKNOWN_TURN = 0.3, math.radians(5)  # m, rad: standard deviations of what no range determines
_MOST, _MOST_TURN = 0.03, math.radians(3)  # m, rad: by which a value moves at once
# deviations by those of the least squares: for wrong paths; chosen in ten rooms (docs/explanation/room_search.md)
_WIDER = 1.2
_TUNING = 2.385  # of Cauchy weights: 95 % efficient for normal errors
_HALVINGS = 3  # of a step that makes a wall too short
_SETTLED = 0.1  # standard deviations; smaller steps end the refinement


def refined(
    evidence: Evidence, draft: RoomDraft, noise: ReadingNoise, steps: int, with_headings: bool = False
) -> Scored:
    """Return the most likely draft of those after up to `steps` steps; walls turn about their middles.

    `with_headings`: the likelihood at other headings counts, too. The room has to be almost complete for this.
    """
    draft = centred(draft)
    best = Scored(draft, evidence.log_likelihood(draft, noise))
    moves = moves_of(evidence, draft)
    for _ in range(steps):
        information, slopes = _normal_equations(evidence, draft, moves, with_headings)
        step = np.linalg.solve(information, slopes)
        if (np.abs(step) < _SETTLED / np.sqrt(np.diag(information))).all():
            break
        moved = _moved(draft, moves, np.asarray(step, dtype=np.float64))
        if moved is None:
            break
        draft = moved
        score = evidence.log_likelihood(draft, noise)
        if score > best.score:
            best = Scored(draft, score)
    return replace(best, draft=centred(best.draft))


def deviations_of(evidence: Evidence, draft: RoomDraft) -> dict[Move, float]:
    """Return the standard deviation of each value of a draft, m or rad; all other values are unknown, too."""
    moves = moves_of(evidence, draft)
    information, _ = _normal_equations(evidence, draft, moves, True)
    deviations = _WIDER * np.sqrt(np.diag(np.linalg.inv(information)))
    return dict(zip(moves, deviations.tolist(), strict=True))


def centred(draft: RoomDraft) -> RoomDraft:
    """Return the same draft with the point about which each wall turns at its middle."""
    walls = {}
    for key, wall in draft.walls.items():
        middle = sum(draft.extent(key)) / 2
        x, y = (np.array(wall.middle) + middle * wall.along).tolist()
        ends = [DraftEnd(end.at - middle, end.meets) for end in wall.ends]
        walls[key] = replace(wall, middle=(x, y), ends=(ends[0], ends[1]))
    return replace(draft, walls=walls)


def _normal_equations(
    evidence: Evidence, draft: RoomDraft, moves: Sequence[Move], with_headings: bool
) -> tuple[FloatArray, FloatArray]:
    """Return the information matrix (m, m) of the values, and the slope of the log-posterior, (m,)."""
    found = range_errors(evidence, draft, moves, with_headings)
    ranges = found.errors[: found.of_range]
    # larger than assumed if the errors are
    scale = max(1.0, 1.4826 * float(np.median(np.abs(ranges)))) if len(ranges) else 1.0
    errors, slopes = found.errors / scale, found.slopes / scale
    weights = 1 / (1 + (errors / _TUNING) ** 2)
    weights[len(errors) - found.of_heading :] = 1.0  # a wrong first heading is no false echo
    weighted = weights[:, None] * slopes
    information = weighted.T @ slopes + np.diag([_known(move) for move in moves])
    ascent = weighted.T @ errors
    for row, move in enumerate(moves):
        if move.what == "place":
            away, spread = evidence.pose_errors(draft, move.which)[move.part]
            information[row, row] += 1 / spread**2
            ascent[row] -= away / spread**2
        elif move.what == "offset":
            information[row, row] += 1 / evidence.offset_spread**2
            ascent[row] -= draft.offset / evidence.offset_spread**2
    rows = {move.which: row for row, move in enumerate(moves) if move.what == "wall" and move.is_turn}
    for key, common, away, weight in pulls(draft):
        turned = np.zeros(len(moves))
        turned[rows[key]], turned[rows[common]] = 1.0, -1.0
        information += weight * np.outer(turned, turned)
        ascent -= weight * away * turned
    return information, ascent


def _known(move: Move) -> float:
    """Return the information about a value that no range determines."""
    return 1 / (UNKNOWN_TURN if move.is_turn else UNKNOWN) ** 2


def _moved(draft: RoomDraft, moves: Sequence[Move], step: FloatArray) -> RoomDraft | None:
    """Return the draft after a step, or a part of it; None if a wall would be too short."""
    most = np.array([_MOST_TURN if move.is_turn else _MOST for move in moves])
    for halving in range(_HALVINGS):
        moved = draft
        for move, by in zip(moves, (np.clip(step, -most, most) / 2**halving).tolist(), strict=True):
            moved = move.of(moved, by)
        if moved.is_sound:
            return moved
    return None
