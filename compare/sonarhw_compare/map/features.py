"""Walls, corners and edges that arcs from several places agree on.

An arc from one place fits a wall and a point equally well. With two places, a wall is the line that touches both arcs,
and a point is where they cross (Leonard and Durrant-Whyte 1992, ch. 3 and 4). The hypotheses of all pairs are compared
with all arcs, and the best supported ones are accepted first.
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from sonarhw.readings import BoolArray, FloatArray
from sonarhw_compare.map.arcs import Arc, direction

RANGE_SPREAD = 0.01  # m, standard deviation of an arc's range
CONFIRMING = 3  # places that must agree on a feature; two places always agree on something
_FARTHEST = 3.0  # standard deviations of range and bearing together, for an arc that belongs to a feature
_OTHER_PLACE = 0.05  # m, between places that count as different
_WALLS_FIRST = 1.01  # weight of walls, which win if both fit equally well, because rooms have more walls
_AT_CORNER = 0.08  # m, largest distance of a corner from its walls
_SHORTEST = 0.1  # m, least length of a wall


@dataclass(frozen=True)
class Wall:
    """A straight wall between the outermost points at which arcs touch it."""

    start: tuple[float, float]  # m
    end: tuple[float, float]
    normal: float  # rad, direction from the sensors to the wall
    arcs: tuple[int, ...]
    possible: bool = False  # a scan contradicts it, although three places agree on it


@dataclass(frozen=True)
class Point:
    """A corner, where two found walls meet, or an edge, where they do not."""

    position: tuple[float, float]  # m
    is_corner: bool
    arcs: tuple[int, ...]


@dataclass(frozen=True)
class Features:
    """The features that arcs from several places agree on."""

    arcs: tuple[Arc, ...]
    walls: tuple[Wall, ...]
    points: tuple[Point, ...]

    @property
    def confirmed(self) -> bool:
        """Whether three places agree on each feature. If only two places have arcs, agreement may be chance."""
        return count_places(arc.centre for arc in self.arcs) >= CONFIRMING

    @property
    def alone(self) -> tuple[Arc, ...]:
        """The arcs that belong to no feature."""
        members = [feature.arcs for feature in self.walls] + [feature.arcs for feature in self.points]
        taken = {arc for several in members for arc in several}
        return tuple(arc for number, arc in enumerate(self.arcs) if number not in taken)


@dataclass(frozen=True)
class _ArcArrays:
    """Arcs as arrays, (n,) and (n, 2)."""

    centres: FloatArray
    ranges: FloatArray
    bearings: FloatArray
    spreads: FloatArray

    def of(self, members: NDArray[np.intp]) -> "_ArcArrays":
        """Return some of the arcs."""
        return _ArcArrays(self.centres[members], self.ranges[members], self.bearings[members], self.spreads[members])


@dataclass(frozen=True)
class _Line:
    """A wall on the line n·p = distance."""

    values: FloatArray  # (2,): direction of n, rad, and distance, m
    weight: ClassVar[float] = _WALLS_FIRST

    def misfits(self, arcs: _ArcArrays) -> FloatArray:
        """Return the misfit of each arc to touching the line, in standard deviations, (n,)."""
        normal, distance = self.values.tolist()
        away = (distance - arcs.centres @ direction(normal) - arcs.ranges) / RANGE_SPREAD
        return np.asarray(np.hypot(away, _turn(arcs.bearings, normal) / arcs.spreads))


@dataclass(frozen=True)
class _Spot:
    """A point."""

    values: FloatArray  # (2,), m
    weight: ClassVar[float] = 1.0

    def misfits(self, arcs: _ArcArrays) -> FloatArray:
        """Return the misfit of each arc to passing through the point, in standard deviations, (n,)."""
        dx, dy = (self.values - arcs.centres).T
        away = (np.hypot(dx, dy) - arcs.ranges) / RANGE_SPREAD
        return np.asarray(np.hypot(away, _turn(arcs.bearings, np.arctan2(dy, dx)) / arcs.spreads))


def _turn(one: FloatArray, other: FloatArray | float) -> FloatArray:
    return np.asarray(np.remainder(one - other + np.pi, 2 * np.pi) - np.pi)


def find_features(arcs: Sequence[Arc]) -> Features:
    """Return the features of arcs; an arc belongs to at most one feature, and a feature needs at least two places."""
    columns = _ArcArrays(
        np.array([arc.centre for arc in arcs], dtype=np.float64).reshape(-1, 2),
        np.array([arc.range for arc in arcs], dtype=np.float64),
        np.array([arc.bearing for arc in arcs], dtype=np.float64),
        np.array([arc.spread for arc in arcs], dtype=np.float64),
    )
    walls, points = [], []
    for found, members in _agreed(arcs, columns):
        if isinstance(found, _Line):
            walls.append(_wall(arcs, members, *found.values.tolist()))
        else:
            points.append((found.values, members))
    made = tuple(Point((float(at[0]), float(at[1])), _is_corner(at, walls), members) for at, members in points)
    return Features(tuple(arcs), tuple(walls), made)


def _agreed(arcs: Sequence[Arc], columns: _ArcArrays) -> Iterator[tuple[_Line | _Spot, tuple[int, ...]]]:
    """Yield features with the rows of their arcs, best supported first."""
    hypotheses = list(_hypotheses(arcs))
    if not hypotheses:
        return
    misfits = np.array([hypothesis.misfits(columns) for hypothesis in hypotheses])
    weights = np.array([hypothesis.weight for hypothesis in hypotheses])
    free = np.ones(len(arcs), dtype=np.bool_)
    least = min(CONFIRMING, count_places(columns.centres))
    while (best := _best(misfits, weights, free, columns.centres, least)) is not None:
        members = np.flatnonzero(free & (misfits[best] < _FARTHEST))
        fitted = _fitted(columns.of(members), hypotheses[best])
        agreed = np.flatnonzero(free & (fitted.misfits(columns) < _FARTHEST))
        # after the fit, an arc may no longer belong
        if count_places(columns.centres[agreed]) < least:
            agreed, fitted = members, hypotheses[best]
        free[agreed] = False
        yield fitted, tuple(agreed.tolist())


def _best(misfits: FloatArray, weights: FloatArray, free: BoolArray, centres: FloatArray, least: int) -> int | None:
    """Return the hypothesis with the best support by free arcs of at least `least` places; None without one."""
    members = free & (misfits < _FARTHEST)
    support = np.where(members, _FARTHEST**2 - misfits**2, 0.0).sum(axis=1) * weights
    support[members.sum(axis=1) < least] = 0.0
    for row in np.argsort(-support, kind="stable").tolist():
        if support[row] <= 0:
            return None
        if count_places(centres[members[row]]) >= least:
            return int(row)
    return None


def count_places(centres: Iterable[Sequence[float]] | FloatArray) -> int:
    """Return the number of different places among positions (m), at least 5 cm apart."""
    apart: list[Sequence[float] | FloatArray] = []
    for centre in centres:
        if all(math.dist(centre, other) >= _OTHER_PLACE for other in apart):
            apart.append(centre)
    return len(apart)


def _hypotheses(arcs: Sequence[Arc]) -> Iterator[_Line | _Spot]:
    """Yield the lines and points of each pair of arcs."""
    for one, other in combinations(arcs, 2):
        apart = np.subtract(other.centre, one.centre)
        distance = float(np.hypot(*apart))
        if distance < _OTHER_PLACE:
            continue
        towards = math.atan2(apart[1], apart[0])
        # a line that touches both: n·(s₂ - s₁) = r₁ - r₂
        cosine = (one.range - other.range) / distance
        if abs(cosine) <= 1:
            for side in (1, -1):
                normal = towards + side * math.acos(cosine)
                yield _Line(np.array([normal, float(np.dot(one.centre, direction(normal))) + one.range]))
        # a point on both: the circles cross
        along = (distance**2 + one.range**2 - other.range**2) / (2 * distance)
        if abs(along) <= one.range:
            for side in (1, -1):
                angle = towards + side * math.acos(along / one.range)
                yield _Spot(np.array(one.centre) + one.range * direction(angle))


def _fitted(arcs: _ArcArrays, start: _Line | _Spot) -> _Line | _Spot:
    """Return the line or point with the smallest misfit to arcs."""

    def misfits(values: FloatArray) -> FloatArray:
        return replace(start, values=values).misfits(arcs)

    return replace(start, values=least_squares(misfits, start.values).x)


def _wall(arcs: Sequence[Arc], members: tuple[int, ...], normal: float, distance: float) -> Wall:
    """Return the part of a line from the first to the last point at which arcs touch it."""
    across, along = direction(normal), direction(normal + math.pi / 2)
    touched = [float(np.dot(arcs[member].centre, along)) for member in members]
    low, high = min(touched), max(touched)
    more = max(0.0, _SHORTEST - (high - low)) / 2
    start, end = (distance * across + at * along for at in (low - more, high + more))
    return Wall((float(start[0]), float(start[1])), (float(end[0]), float(end[1])), normal % math.tau, members)


def _is_corner(point: FloatArray, walls: Sequence[Wall]) -> bool:
    """Report whether two of the walls, extended, meet at a point."""
    near = [wall for wall in walls if abs(np.dot(point - wall.start, direction(wall.normal))) < _AT_CORNER]
    return any(abs(math.sin(one.normal - other.normal)) > 0.3 for one, other in combinations(near, 2))
