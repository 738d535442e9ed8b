"""How well walls found in scans of a random room agree with its true walls."""

import math
from dataclasses import dataclass
from itertools import product

import numpy as np
from sonarhw_compare.map import CertaintyGrid
from sonarhw_compare.match import compare_readings
from sonarhw_compare.rooms.refinement import Move
from sonarhw_compare.rooms.search import FoundRoom
from sonarhw_sim.board.profile import Board

from benchmarks.cases.random_rooms import RandomRoom
from sonarhw.readings import FloatArray

_NEAR, _TURNED = 0.01, math.radians(1)  # m, rad, of a found wall
_INVENTED = 0.05  # m: a part of a found wall that is farther than this from every true surface
_LEAST = 3  # echoes that touched a wall
_STEP = 0.01  # m along walls
_SAME, _SAME_TURN = 0.1, math.radians(8)  # m, rad, between a found wall and the true one
_Z95 = 1.96  # standard deviations to each side of a 95 % interval
_OCCUPIED = 0.5  # certainty of a cell of the grid


def seen_parts(case: RandomRoom, board: Board) -> list[tuple[int, float, float]]:
    """Return wall, first and last touch (m from its start) of each true wall that three recorded echoes touched."""
    room = case.room
    touched: list[list[float]] = [[] for _ in room.walls]
    for scan in case.scans:
        comparison = compare_readings(scan.readings, room, scan.place, board)
        for row in comparison.rows:
            if row.path is None:
                continue
            for point in comparison.prediction.paths.outline(row.path)[1:-1]:
                for wall, (x, y, x2, y2) in enumerate(room.walls.tolist()):
                    length = math.hypot(x2 - x, y2 - y)
                    along = np.array([x2 - x, y2 - y]) / length
                    away = point - (x, y)
                    at = float(away @ along)
                    if abs(float(away[0] * along[1] - away[1] * along[0])) < 1e-6 and -1e-6 <= at <= length + 1e-6:
                        touched[wall].append(at)
    return [(wall, min(at), max(at)) for wall, at in enumerate(touched) if len(at) >= _LEAST]


@dataclass(frozen=True)
class Lengths:
    """Lengths of walls, m; of a grid, cells instead of the last two."""

    seen: float  # of the true walls, between their outermost touches
    found: float  # of them, within 1 cm and 1°; of a grid, with an occupied cell, in any direction
    whole: float  # of the found walls
    invented: float  # of them, where nothing is

    def __add__(self, other: "Lengths") -> "Lengths":
        """Return the sum."""
        sums = (getattr(self, name) + getattr(other, name) for name in ("seen", "found", "whole", "invented"))
        return Lengths(*sums)

    @property
    def shares(self) -> str:
        """What share of the walls was found, and what share of the found walls was invented."""
        return f"{self.found / max(self.seen, 1e-9):6.1%} {self.invented / max(self.whole, 1e-9):6.1%}"


def lengths_found(case: RandomRoom, parts: list[tuple[int, float, float]], segments: FloatArray) -> Lengths:
    """Return how much of the `parts` (`seen_parts`) found walls (n, 4) m cover, and how much of them is invented."""
    seen = correct = whole = invented = 0.0
    for points, angle in _points_of(case, parts):
        hit = np.zeros(len(points), np.bool_)
        for segment in segments:
            if abs(math.remainder(_angle(segment) - angle, math.pi)) <= _TURNED:
                hit |= _distances(points, segment) <= _NEAR
        seen, correct = seen + len(points) * _STEP, correct + float(hit.sum()) * _STEP
    for x, y, x2, y2 in segments.tolist():
        length = math.hypot(x2 - x, y2 - y)
        points = np.array([x, y]) + np.arange(0, length, _STEP)[:, None] / length * [x2 - x, y2 - y]
        away = _from_surfaces(case, points)
        whole, invented = whole + length, invented + float((away > _INVENTED).sum()) * _STEP
    return Lengths(seen, correct, whole, invented)


def lengths_in_grid(case: RandomRoom, parts: list[tuple[int, float, float]], grid: CertaintyGrid) -> Lengths:
    """Return how much of the `parts` has an occupied cell within 1 cm, and how many occupied cells are invented."""
    rows, columns = np.nonzero(grid.certainty > _OCCUPIED)
    cells = np.column_stack((grid.left + (columns + 0.5) * grid.cell, grid.bottom + (rows + 0.5) * grid.cell))
    seen = correct = 0.0
    around = np.array(list(product((-_NEAR, 0.0, _NEAR), repeat=2)))
    for points, _ in _points_of(case, parts):
        beside = [grid.at(points + away) > _OCCUPIED for away in around]
        seen, correct = seen + len(points) * _STEP, correct + float(np.any(beside, axis=0).sum()) * _STEP
    return Lengths(seen, correct, len(cells), float((_from_surfaces(case, cells) > _INVENTED).sum()))


def truth_held(case: RandomRoom, found: FoundRoom) -> list[tuple[bool, bool]]:
    """Return for each found wall that exists whether its 95 % intervals hold the true offset, and the true direction.

    The offset is that of the middle of the found wall. A wall exists if a true one is within 10 cm and 8°.
    """
    held = []
    for key in found.draft.walls:
        error = _error(case, found.draft.segment(key))
        if error is not None:
            offset, turn = (
                abs(away) <= _Z95 * found.deviations[Move("wall", key, part)] for part, away in enumerate(error)
            )
            held.append((offset, turn))
    return held


def _error(case: RandomRoom, segment: FloatArray) -> tuple[float, float] | None:
    """Return distance (m) and angle (rad) of a found wall from the nearest true one; None without one."""
    middle, errors = (segment[:2] + segment[2:]) / 2, []
    for wall in case.room.walls:
        along = (wall[2:] - wall[:2]) / np.hypot(*(wall[2:] - wall[:2]))
        turn = math.remainder(_angle(segment) - _angle(wall), math.pi)
        offset = float((middle - wall[:2]) @ np.array([-along[1], along[0]]))
        at = float((middle - wall[:2]) @ along)
        beside = -_SAME < at < float((wall[2:] - wall[:2]) @ along) + _SAME
        if beside and abs(turn) < _SAME_TURN and abs(offset) < _SAME:
            errors.append((offset, turn))
    return min(errors, key=lambda error: abs(error[0]), default=None)


def _points_of(case: RandomRoom, parts: list[tuple[int, float, float]]) -> list[tuple[FloatArray, float]]:
    """Return points (n, 2) m along each part of a wall, and the direction of the wall, rad."""
    found = []
    for wall, first, last in parts:
        angle = _angle(case.room.walls[wall])
        at = np.arange(first, last, _STEP) + _STEP / 2
        found.append((case.room.walls[wall][:2] + at[:, None] * [math.cos(angle), math.sin(angle)], angle))
    return found


def _from_surfaces(case: RandomRoom, points: FloatArray) -> FloatArray:
    """Return the distance of points (n, 2) from the nearest true surface, (n,) m."""
    away = np.min([_distances(points, wall) for wall in case.room.walls], axis=0)
    for x, y, radius in case.room.posts.tolist():
        away = np.minimum(away, np.abs(np.hypot(*(points - (x, y)).T) - radius))
    return np.asarray(away)


def _angle(segment: FloatArray) -> float:
    return math.atan2(segment[3] - segment[1], segment[2] - segment[0])


def _distances(points: FloatArray, wall: FloatArray) -> FloatArray:
    start, along = wall[:2], wall[2:] - wall[:2]
    share = np.clip((points - start) @ along / (along @ along), 0, 1)
    return np.asarray(np.hypot(*(start + share[:, None] * along - points).T))
