"""Errors of the readings that a draft explains, and their derivatives by its walls, posts and places.

If the points that a path touches move, its length changes to first order by the sum of their moves, each times the
difference of the unit vectors of the legs that meet there (Fermat's principle). No path is therefore searched again.
A heading follows from bearings only: neighbouring readings of one echo are centred about the direction of its path.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from sonarhw_sim.predict.predicted_scan import PredictedScan
from sonarhw_sim.predict.prediction import predict_scan
from sonarhw_sim.room.room import Room

from sonarhw.readings import FloatArray
from sonarhw_compare.matching.match import TOLERANCE
from sonarhw_compare.room_finding.draft import RoomDraft
from sonarhw_compare.room_finding.evidence import FOLLOWED, REFLECTANCE, Evidence, as_found
from sonarhw_compare.room_finding.refining.heading_errors import heading_error
from sonarhw_compare.room_finding.refining.moves import Move

RANGE = 0.01  # m, standard deviation of a range
BEARING = math.radians(2)  # standard deviation of the mean heading of the readings of one path
_LEAST_READINGS = 3  # of a path, for a bearing
_ON = 1e-6  # m


@dataclass(frozen=True)
class RangeErrors:
    """Errors of n ranges, bearings and headings, in standard deviations, and their derivatives by m moves."""

    errors: FloatArray  # (n,), measured minus predicted; ranges by scan and reading, then bearings, then headings
    slopes: FloatArray  # (n, m), of the predictions, by m or rad
    of_range: int  # the first so many rows are ranges
    of_heading: int  # the last so many rows are headings


@dataclass(frozen=True)
class _Shifts:
    """Derivatives of walls and posts by each move."""

    segments: FloatArray  # (w, 4) m, of the draft
    posts: FloatArray  # (p, 3) m
    of_segments: FloatArray  # (m, w, 4)
    of_posts: FloatArray  # (m, p, 3)
    turns: FloatArray  # (m, w), of the direction of each wall

    def of_point(self, point: FloatArray) -> FloatArray | None:
        """Return the derivative of a point of a wall or post, (m, 2); None if it lies on none of them."""
        wall, at = self.wall_at(point)
        if wall is not None:
            moved = self.of_segments[:, wall]
            return np.asarray((1 - at) * moved[:, :2] + at * moved[:, 2:])
        for row, (x, y, radius) in enumerate(self.posts.tolist()):
            away = point - (x, y)
            if abs(math.hypot(*away) - radius) < _ON:
                return np.asarray(self.of_posts[:, row, :2] + self.of_posts[:, row, 2:] * (away / radius))
        return None

    def wall_at(self, point: FloatArray) -> tuple[int | None, float]:
        """Return the wall on which a point lies, and at which share of its length; None if it lies on none."""
        if not len(self.segments):
            return None, 0.0
        along, away = self.segments[:, 2:] - self.segments[:, :2], point - self.segments[:, :2]
        squares = (along**2).sum(axis=1)
        at = (away * along).sum(axis=1) / squares
        beside = np.abs(away[:, 0] * along[:, 1] - away[:, 1] * along[:, 0]) / np.sqrt(squares)
        beyond = np.maximum(np.abs(at - 0.5) - 0.5, 0.0) * np.sqrt(squares)
        wall = int(np.argmin(beside + beyond))
        return (wall, float(at[wall])) if beside[wall] + beyond[wall] < _ON else (None, 0.0)


def range_errors(
    evidence: Evidence, draft: RoomDraft, moves: Sequence[Move], with_headings: bool = False
) -> RangeErrors:
    """Return the errors of the readings within 5 cm of their predicted echo, and if wanted those of the headings."""
    with_headings = with_headings and evidence.has_free_headings
    shifts = _shifts(draft, moves)
    parts = evidence.in_processes(_of_scans, range(len(evidence.problems)), draft, moves, shifts, with_headings)
    ranges, bearings, headings = ([one for part in parts for one in part[kind]] for kind in range(3))
    rows = [*ranges, *bearings, *headings]
    errors = np.array([error for error, _ in rows])
    slopes = np.array([slope for _, slope in rows]).reshape(len(rows), len(moves))
    return RangeErrors(errors, slopes, len(ranges), len(headings))


Row = tuple[float, FloatArray]  # an error and its derivatives


def _of_scans(
    evidence: Evidence,
    scans: Sequence[int],
    draft: RoomDraft,
    moves: Sequence[Move],
    shifts: _Shifts,
    with_headings: bool,
) -> list[tuple[list[Row], list[Row], list[Row]]]:
    """Return the errors of ranges, of bearings and of the heading of each scan."""
    room, found = draft.room(REFLECTANCE, evidence.air), []
    for scan in scans:
        ranges, bearings, turns = _of_scan(evidence, draft, scan, room, moves, shifts)
        headings = [_of_heading(heading_error(evidence, draft, room, scan), turns)] if with_headings and turns else []
        found.append((ranges, bearings, headings))
    return found


def _of_scan(
    evidence: Evidence, draft: RoomDraft, scan: int, room: Room, moves: Sequence[Move], shifts: _Shifts
) -> tuple[list[Row], list[Row], list[FloatArray]]:
    """Return the errors of ranges, those of bearings, and the derivatives of the bearing of each reading."""
    board, arrays = as_found(evidence.problems[scan].board, draft), evidence.problems[scan].scans[0]
    place = board.faced(draft.places[scan])
    headings = np.asarray(place.heading + board.turned(arrays.angles))
    predicted = predict_scan(room, place, board, headings, FOLLOWED)
    measured = np.where(arrays.counts > 0, arrays.ranges[:, 0], np.nan)
    residuals = measured - predicted.ranges
    of_offset = np.array([float(move.what == "offset") for move in moves])
    explained = np.abs(residuals) <= TOLERANCE  # False where there is no echo
    slopes: dict[int, FloatArray] = {}
    bearings: list[Row] = []
    of_heading = np.array([float(move.is_of("place", scan) and move.part == 2) for move in moves])
    turns: list[FloatArray] = []
    for path in np.unique(predicted.winners[explained]).tolist():
        outline = predicted.paths.outline(path)
        ends = _end_shifts(draft, scan, moves, outline)
        slopes[path] = (_length_slope(outline, ends, shifts) / 2 + of_offset) / RANGE
        turned = _bearing_slope(predicted, path, ends[0], shifts)
        away = np.remainder(headings - predicted.paths.departures[path] + np.pi, math.tau) - np.pi
        own = explained & (predicted.winners == path)
        mean = None if turned is None else _middle(away, own, measured)
        if turned is not None:
            turned = turned - of_heading
            turns += [turned] * int(own.sum())
            bearings += [] if mean is None else [(mean / BEARING, turned / BEARING)]
    rows = np.flatnonzero(explained)
    ranges = [(float(residuals[row]) / RANGE, slopes[int(predicted.winners[row])]) for row in rows]
    return ranges, bearings, turns


def _of_heading(error: tuple[float, float], turns: Sequence[FloatArray]) -> Row:
    """Return the error of a heading, whose deviation is known, with the mean derivative of its bearings."""
    away, deviation = error
    return -away / deviation, np.asarray(np.mean(turns, axis=0) / deviation)


def _middle(away: FloatArray, own: NDArray[np.bool_], measured: FloatArray) -> float | None:
    """Return the mean angle (rad) between the `own` readings and the direction of their path, from -π..π `away` (n,).

    Where a nearer echo ends these readings, they are not centred about that direction: the answer is None.
    """
    if own.sum() < _LEAST_READINGS:
        return None
    order = np.argsort(away)
    rows = np.flatnonzero(own[order])
    beside = order[[rows[0] - 1, (rows[-1] + 1) % len(order)]]
    if (measured[beside] < np.median(measured[own]) + TOLERANCE).any():  # False where there is no echo
        return None
    return float(away[own].mean())


def _length_slope(outline: FloatArray, ends: tuple[FloatArray, FloatArray], shifts: _Shifts) -> FloatArray:
    """Return the derivative of the length of a path by each move, (m,)."""
    legs = np.diff(outline, axis=0)
    # two reflections in a corner are one point, which moves with the corner
    apart = np.append(True, np.hypot(*legs.T) > _ON)
    outline, legs = outline[apart], legs[apart[1:]]
    units = legs / np.hypot(*legs.T)[:, None]
    slope = ends[1] @ units[-1] - ends[0] @ units[0]
    for point, before, behind in zip(outline[1:-1], units[:-1], units[1:], strict=True):
        moved = shifts.of_point(point)
        if moved is not None:
            slope = slope + moved @ (before - behind)
    return np.asarray(slope)


def _bearing_slope(predicted: PredictedScan, path: int, start: FloatArray, shifts: _Shifts) -> FloatArray | None:
    """Return the derivative of the departure of a path by each move, (m,); None if it touches more than one point."""
    outline, paths = predicted.paths.outline(path), predicted.paths
    if len(outline) != 3:
        return None
    source, point = outline[0], outline[1]
    wall, _ = shifts.wall_at(point)
    if wall is not None and paths.edges[path] < 0:
        return shifts.turns[:, wall]
    moved = shifts.of_point(point)
    if moved is None:
        return None
    away = point - source
    if wall is None:  # the centre of a post, in the same direction
        row = int(np.argmin(np.abs(np.hypot(*(shifts.posts[:, :2] - point).T) - shifts.posts[:, 2])))
        moved, away = shifts.of_posts[:, row, :2], shifts.posts[row, :2] - source
    return np.asarray((moved - start) @ np.array([-away[1], away[0]]) / float(away @ away))


def _end_shifts(
    draft: RoomDraft, scan: int, moves: Sequence[Move], outline: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the derivatives of both ends of a path, of which the transducer has one or two, (m, 2) each."""
    ends = []
    for point in (outline[0], outline[-1]):
        away = point - draft.places[scan].position
        own = np.array([[1.0, 0.0], [0.0, 1.0], [-away[1], away[0]]])
        ends.append(np.array([own[move.part] if move.is_of("place", scan) else np.zeros(2) for move in moves]))
    return ends[0], ends[1]


def _shifts(draft: RoomDraft, moves: Sequence[Move]) -> _Shifts:
    of_segments, of_posts = [], []
    for move in moves:
        ahead, behind = (
            draft if move.what in ("place", "offset") else move.of(draft, by) for by in (move.step, -move.step)
        )
        moved = np.zeros((len(draft.walls), 4))
        for row, key in enumerate(draft.walls):
            if _moves_with(draft, key, move):
                moved[row] = (ahead.segment(key) - behind.segment(key)) / (2 * move.step)
        of_segments.append(moved)
        of_posts.append((_posts(ahead) - _posts(behind)) / (2 * move.step))
    turns = [[float(move.is_of("wall", key) and move.part == 1) for key in draft.walls] for move in moves]
    shape = len(moves), len(draft.walls)
    return _Shifts(
        draft.segments,
        _posts(draft),
        np.array(of_segments).reshape(*shape, 4),
        np.array(of_posts).reshape(len(moves), len(draft.posts), 3),
        np.array(turns).reshape(shape),
    )


def _moves_with(draft: RoomDraft, key: int, move: Move) -> bool:
    """Return whether a move changes an end of a wall: it is of this wall, or of one that an end meets."""
    return move.what == "wall" and move.which in (key, *(end.meets for end in draft.walls[key].ends))


def _posts(draft: RoomDraft) -> FloatArray:
    return np.array([(*post.center, post.radius) for post in draft.posts], dtype=np.float64).reshape(-1, 3)


class LengthSlopes:
    """Derivatives of the lengths of paths at a fixed place by moves of a draft."""

    def __init__(self, draft: RoomDraft, moves: Sequence[Move]) -> None:
        self._shifts = _shifts(draft, moves)
        self.count = len(moves)
        self._still = np.zeros((self.count, 2))

    def of(self, outline: FloatArray) -> FloatArray:
        """Return the derivative of the length of a path with these points, (k, 2) m, by each move, (m,)."""
        return _length_slope(outline, (self._still, self._still), self._shifts)
