"""Features: walls, corners and edges that arcs from several places agree on.

Takes `Arc`s; hands on `Features`. From one place nobody can tell a wall from a point: an arc fits both. From two, a
wall is the line that touches both arcs, a point is where they cross (Leonard and Durrant-Whyte 1992, ch. 3 and 4). The
hypotheses of all pairs are held against all arcs; the one that most places agree on is taken first.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from sonarhw.readings import FloatArray
from sonarhw_compare.map.arcs import Arc, BoolArray, direction

RANGE_SPREAD = 0.01  # m, standard deviation of an arc's range
_FARTHEST = 3.0  # standard deviations of range and bearing together, beyond which an arc does not belong
_OTHER_PLACE = 0.05  # m: places nearer than this tell nothing new
_WALLS_FIRST = 1.01  # rooms have more walls than corners: where both fit alike it is a wall
_AT_CORNER = 0.08  # m from where two walls meet, a point is their corner
_SHORTEST = 0.1  # m: a wall is drawn at least so long


@dataclass(frozen=True)
class Wall:
    """A straight wall as far as it was touched."""

    start: tuple[float, float]  # m
    end: tuple[float, float]
    normal: float  # rad: direction from the sensors to it
    arcs: tuple[int, ...]


@dataclass(frozen=True)
class Point:
    """A corner, where two found walls meet, or an edge, where they do not."""

    position: tuple[float, float]  # m
    is_corner: bool
    arcs: tuple[int, ...]


@dataclass(frozen=True)
class Features:
    """What arcs of several places agree on."""

    arcs: tuple[Arc, ...]
    walls: tuple[Wall, ...]
    points: tuple[Point, ...]

    @property
    def alone(self) -> tuple[Arc, ...]:
        """Arcs that nothing found explains."""
        members = [feature.arcs for feature in self.walls] + [feature.arcs for feature in self.points]
        taken = {arc for several in members for arc in several}
        return tuple(arc for number, arc in enumerate(self.arcs) if number not in taken)


@dataclass(frozen=True)
class _Columns:
    """Arcs as arrays, (n,) and (n, 2)."""

    centres: FloatArray
    ranges: FloatArray
    bearings: FloatArray
    spreads: FloatArray

    def misfits_of_wall(self, normal: float, distance: float) -> FloatArray:
        """How far each arc is from touching the line n·p = distance, in standard deviations, (n,)."""
        away = (distance - self.centres @ direction(normal) - self.ranges) / RANGE_SPREAD
        return np.hypot(away, _turn(self.bearings, normal) / self.spreads)

    def misfits_of_point(self, point: FloatArray) -> FloatArray:
        """How far each arc is from running through a point (2,), in standard deviations, (n,)."""
        dx, dy = (point - self.centres).T
        away = (np.hypot(dx, dy) - self.ranges) / RANGE_SPREAD
        return np.asarray(np.hypot(away, _turn(self.bearings, np.arctan2(dy, dx)) / self.spreads))


def _turn(one: FloatArray, other: FloatArray | float) -> FloatArray:
    return np.asarray(np.remainder(one - other + np.pi, 2 * np.pi) - np.pi)


def find_features(arcs: Sequence[Arc]) -> Features:
    """What the arcs agree on; an arc belongs to one feature at most, a feature to two places at least."""
    columns = _Columns(
        np.array([arc.centre for arc in arcs], dtype=np.float64).reshape(-1, 2),
        np.array([arc.range for arc in arcs], dtype=np.float64),
        np.array([arc.bearing for arc in arcs], dtype=np.float64),
        np.array([arc.spread for arc in arcs], dtype=np.float64),
    )
    walls, points = [], []
    for is_wall, values, members in _agreed(arcs, columns):
        if is_wall:
            walls.append(_wall(arcs, members, float(values[0]), float(values[1])))
        else:
            points.append((values, members))
    made = tuple(Point((float(at[0]), float(at[1])), _is_corner(at, walls), members) for at, members in points)
    return Features(tuple(arcs), tuple(walls), made)


def _agreed(arcs: Sequence[Arc], columns: _Columns) -> Iterator[tuple[bool, FloatArray, tuple[int, ...]]]:
    """Feature by feature, the best supported first: whether it is a wall, what it is, and its arcs."""
    hypotheses = list(_hypotheses(arcs))
    if not hypotheses:
        return
    misfits = np.array([_misfits(columns, *hypothesis) for hypothesis in hypotheses])
    weights = np.array([_WALLS_FIRST if is_wall else 1.0 for is_wall, _ in hypotheses])
    free = np.ones(len(arcs), dtype=np.bool_)
    # two places can always be made to agree; where there are more, more have to
    least = min(3, _places(columns.centres))
    while (best := _best(misfits, weights, free, columns.centres, least)) is not None:
        is_wall, values = hypotheses[best]
        members = np.flatnonzero(free & (misfits[best] < _FARTHEST))
        fitted = _fitted(columns, is_wall, values, members)
        agreed = np.flatnonzero(free & (_misfits(columns, is_wall, fitted) < _FARTHEST))
        # what its arcs agree on best may let go of one of them
        if _places(columns.centres[agreed]) < least:
            agreed, fitted = members, values
        free[agreed] = False
        yield is_wall, fitted, tuple(agreed.tolist())


def _misfits(columns: _Columns, is_wall: bool, values: FloatArray) -> FloatArray:
    if is_wall:
        return columns.misfits_of_wall(float(values[0]), float(values[1]))
    return columns.misfits_of_point(values)


def _best(misfits: FloatArray, weights: FloatArray, free: BoolArray, centres: FloatArray, least: int) -> int | None:
    """The hypothesis on which free arcs of at least so many places agree best; None: there is none."""
    members = free & (misfits < _FARTHEST)
    support = np.where(members, _FARTHEST**2 - misfits**2, 0.0).sum(axis=1) * weights
    support[members.sum(axis=1) < least] = 0.0
    for row in np.argsort(-support, kind="stable").tolist():
        if support[row] <= 0:
            return None
        if _places(centres[members[row]]) >= least:
            return int(row)
    return None


def _places(centres: FloatArray) -> int:
    """How many places there are among those of arcs (n, 2), no two nearer than 5 cm."""
    apart: list[FloatArray] = []
    for centre in centres:
        if all(math.dist(centre, other) >= _OTHER_PLACE for other in apart):
            apart.append(centre)
    return len(apart)


def _hypotheses(arcs: Sequence[Arc]) -> Iterator[tuple[bool, FloatArray]]:
    """Walls (normal rad, distance m from the origin) and points (x, y) that each two arcs of different places allow."""
    for one, other in combinations(arcs, 2):
        apart = np.subtract(other.centre, one.centre)
        distance = float(np.hypot(*apart))
        if distance < _OTHER_PLACE:
            continue
        towards = math.atan2(apart[1], apart[0])
        # both touched: n·(s₂ - s₁) = r₁ - r₂
        cosine = (one.range - other.range) / distance
        if abs(cosine) <= 1:
            for side in (1, -1):
                normal = towards + side * math.acos(cosine)
                yield True, np.array([normal, float(np.dot(one.centre, direction(normal))) + one.range])
        # both run through: the circles cross
        along = (distance**2 + one.range**2 - other.range**2) / (2 * distance)
        if abs(along) <= one.range:
            for side in (1, -1):
                angle = towards + side * math.acos(along / one.range)
                yield False, np.array(one.centre) + one.range * direction(angle)


def _fitted(columns: _Columns, is_wall: bool, values: FloatArray, members: NDArray[np.intp]) -> FloatArray:
    """The wall or point that its arcs agree on best, (2,)."""
    chosen = _Columns(*(getattr(columns, name)[members] for name in ("centres", "ranges", "bearings", "spreads")))

    def misfits(moved: FloatArray) -> FloatArray:
        return _misfits(chosen, is_wall, moved)

    return np.asarray(least_squares(misfits, values).x)


def _wall(arcs: Sequence[Arc], members: tuple[int, ...], normal: float, distance: float) -> Wall:
    """The stretch of a line from the first to the last point at which arcs touch it."""
    across, along = direction(normal), direction(normal + math.pi / 2)
    touched = [float(np.dot(arcs[member].centre, along)) for member in members]
    low, high = min(touched), max(touched)
    more = max(0.0, _SHORTEST - (high - low)) / 2
    start, end = (distance * across + at * along for at in (low - more, high + more))
    return Wall((float(start[0]), float(start[1])), (float(end[0]), float(end[1])), normal % math.tau, members)


def _is_corner(point: FloatArray, walls: Sequence[Wall]) -> bool:
    """Whether two of the walls, made longer, meet at a point."""
    near = [wall for wall in walls if abs(np.dot(point - wall.start, direction(wall.normal))) < _AT_CORNER]
    return any(abs(math.sin(one.normal - other.normal)) > 0.3 for one, other in combinations(near, 2))
