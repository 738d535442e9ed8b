"""Walls and posts that might exist, from regions of constant depth.

An arc of one place fits a wall perpendicular to its bearing, two arcs fit the lines that touch both and the posts on
both (`map.features` explains this). Candidates are ranked by the unexplained readings of the arcs that agree.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from sonarhw_sim.board.profile import Board, without_own_body
from sonarhw_sim.predict.predicted_scan import standpoints

from sonarhw.readings import FloatArray
from sonarhw_compare.fit.values.fit_result import PlacedScan
from sonarhw_compare.map.arcs import Arc, direction
from sonarhw_compare.map.certainty import headings_and_ranges
from sonarhw_compare.matching.regions import regions_of
from sonarhw_compare.room_finding.draft import DraftEnd, DraftPost, DraftWall

_ONE_DEPTH = 0.06  # m, largest difference of ranges in one region; 1 cm of noise spreads 10 readings over 3 cm
_LEAST_WIDTH = math.radians(4)
_RANGE = 0.015  # m, standard deviation of the range of an arc
_FARTHEST = 3.0  # standard deviations of range and bearing together
_OTHER_PLACE = 0.05  # m
_BEYOND = 0.1  # m, by which a wall is longer than its outermost touches
_SAME_LINE, _SAME_TURN = 0.03, math.radians(4)  # m, rad, between candidates that count as one
_THROUGH = 0.1  # m, by which an echo is farther than a post before it
_CONTRADICTION = 2.0  # readings, the weight of such an echo against the post
_SAME_POINT = 0.05  # m
RADII = (0.03, 0.09)  # m, of posts that are tried


@dataclass(frozen=True)
class ArcTable:
    """Arcs as arrays, (n,) and (n, 2)."""

    scans: FloatArray
    centres: FloatArray  # m
    ranges: FloatArray  # m
    bearings: FloatArray  # rad
    spreads: FloatArray  # rad
    rows: tuple[tuple[int, ...], ...]  # of the readings of each arc

    def misfits(self, distances: FloatArray, bearings: FloatArray) -> FloatArray:
        """Return the misfit of each arc to a target at `distances` and `bearings` (n,), in standard deviations."""
        turned = np.remainder(self.bearings - bearings + np.pi, 2 * np.pi) - np.pi
        return np.asarray(np.hypot((distances - self.ranges) / _RANGE, turned / self.spreads))

    def behind(self, distances: FloatArray, bearings: FloatArray) -> NDArray[np.bool_]:
        """Return which arcs are seen through a post at `distances` and `bearings` (n,), (n,)."""
        turned = np.remainder(self.bearings - bearings + np.pi, 2 * np.pi) - np.pi
        return np.asarray((self.ranges > distances + _THROUGH) & (np.abs(turned) < self.spreads))


def arcs_of_scans(scans: Sequence[PlacedScan], board: Board) -> tuple[Arc, ...]:
    """Return the arcs of all readings of the room. `rows` count without those of the carrier's own body."""
    found = []
    for number, scan in enumerate(scans):
        of_room = replace(scan, readings=without_own_body(board.own_body, scan.readings))
        headings, ranges = headings_and_ranges(of_room, board)
        for region in regions_of(headings, ranges, _ONE_DEPTH, _LEAST_WIDTH):
            (centre,) = standpoints(board, scan.place, np.array([region.bearing])).tolist()
            found.append(
                Arc(number, region.rows, (centre[0], centre[1]), region.range, region.bearing, region.width / 2)
            )
    return tuple(found)


def table_of(arcs: Sequence[Arc]) -> ArcTable:
    """Return arcs as arrays."""
    return ArcTable(
        np.array([arc.scan for arc in arcs]),
        np.array([arc.centre for arc in arcs], dtype=np.float64).reshape(-1, 2),
        np.array([arc.range for arc in arcs], dtype=np.float64),
        np.array([arc.bearing for arc in arcs], dtype=np.float64),
        np.array([arc.spread for arc in arcs], dtype=np.float64),
        tuple(arc.rows for arc in arcs),
    )


def wall_candidates(
    arcs: Sequence[Arc], unexplained: Sequence[FloatArray], most: int, common: float | None = None
) -> list[DraftWall]:
    """Return the `most` best supported walls; `unexplained` is the weight of each reading, 0..1, by scan.

    Lines at right angles to a wall at the angle `common` (rad) are among them where they fit an arc.
    """
    table = table_of(arcs)
    weights = _weights(table, unexplained)
    squared = () if common is None else _squared_lines(arcs, common)
    lines = np.array([*_lines(tuple(arcs)), *squared], dtype=np.float64).reshape(-1, 2)
    if not len(lines):
        return []
    supports, members = np.empty(len(lines)), np.empty((len(lines), len(arcs)), np.bool_)
    for row, (normal, distance) in enumerate(lines.tolist()):
        away = distance - table.centres @ direction(normal)
        misfits = table.misfits(away, np.full(len(arcs), normal))
        members[row] = misfits < _FARTHEST
        supports[row] = (weights * np.maximum(1 - (misfits / _FARTHEST) ** 2, 0.0)).sum()
    found: list[DraftWall] = []
    taken: list[FloatArray] = []
    for row in np.argsort(-supports, kind="stable").tolist():
        if len(found) == most or supports[row] < 1.0:
            break
        if not any(_same_line(lines[row], other) for other in taken):
            taken.append(lines[row])
            found.append(_wall(lines[row], table.centres[members[row]]))
    return found


def post_candidates(
    arcs: Sequence[Arc], unexplained: Sequence[FloatArray], most: int, radii: Sequence[float] = RADII
) -> list[DraftPost]:
    """Return the `most` best supported posts, each of several radii (m)."""
    table = table_of(arcs)
    weights = _weights(table, unexplained)
    found: list[tuple[float, DraftPost]] = []
    for radius in radii:
        for point in _points(tuple(arcs), radius):
            dx, dy = (np.array(point) - table.centres).T
            misfits = table.misfits(np.hypot(dx, dy) - radius, np.arctan2(dy, dx))
            support = float((weights * np.maximum(1 - (misfits / _FARTHEST) ** 2, 0.0)).sum())
            if radius > 0:  # the echo of a corner can be too faint to hide what is behind it
                support -= _CONTRADICTION * float(table.behind(np.hypot(dx, dy) - radius, np.arctan2(dy, dx)).sum())
            if support >= 1.0:
                found.append((support, DraftPost(point, radius)))
    found.sort(key=lambda one: -one[0])
    kept: list[DraftPost] = []
    for _, post in found:
        if len(kept) < most and not any(
            post.radius == other.radius and math.dist(post.center, other.center) < _SAME_POINT for other in kept
        ):
            kept.append(post)
    return kept


def _weights(table: ArcTable, unexplained: Sequence[FloatArray]) -> FloatArray:
    """Return the unexplained readings of each arc, (n,)."""
    return np.array(
        [float(unexplained[int(scan)][list(rows)].sum()) for scan, rows in zip(table.scans, table.rows, strict=True)]
    )


@lru_cache(maxsize=4)  # growth asks for the same arcs after each wall
def _lines(arcs: tuple[Arc, ...]) -> tuple[tuple[float, float], ...]:
    """Return normal (rad) and distance from the origin (m) of lines that touch one arc or two."""
    return tuple(_lines_of(arcs))


def _squared_lines(arcs: Sequence[Arc], common: float) -> Iterator[tuple[float, float]]:
    """Yield the lines, as in `_lines`, that touch an arc within its width and are at right angles to a direction (rad).

    An arc is often not centred about the normal of its wall, because a nearer echo ends it on one side.
    """
    quarter = math.pi / 2
    for arc in arcs:
        away = math.remainder(arc.bearing - common, quarter)
        if abs(away) <= arc.spread:
            normal = arc.bearing - away
            yield normal, float(np.dot(arc.centre, direction(normal))) + arc.range


def _lines_of(arcs: Sequence[Arc]) -> Iterator[tuple[float, float]]:
    for arc in arcs:
        yield arc.bearing, float(np.dot(arc.centre, direction(arc.bearing))) + arc.range
    for one, other in combinations(arcs, 2):
        apart = np.subtract(other.centre, one.centre)
        distance = float(np.hypot(*apart))
        cosine = (one.range - other.range) / distance if distance >= _OTHER_PLACE else 2.0
        if abs(cosine) > 1:
            continue
        towards = math.atan2(apart[1], apart[0])
        for side in (1, -1):
            normal = towards + side * math.acos(cosine)
            if _near(one, normal) and _near(other, normal):
                yield normal, float(np.dot(one.centre, direction(normal))) + one.range


@lru_cache(maxsize=8)
def _points(arcs: tuple[Arc, ...], radius: float) -> tuple[tuple[float, float], ...]:
    """Return the centres (m) of posts of this radius on two arcs; behind the middle of each, if all have one place."""
    return tuple(_points_of(arcs, radius))


def _points_of(arcs: Sequence[Arc], radius: float) -> Iterator[tuple[float, float]]:
    if len({arc.scan for arc in arcs}) == 1:
        for arc in arcs:
            x, y = (np.array(arc.centre) + (arc.range + radius) * direction(arc.bearing)).tolist()
            yield x, y
    for one, other in combinations(arcs, 2):
        apart = np.subtract(other.centre, one.centre)
        distance = float(np.hypot(*apart))
        if distance < _OTHER_PLACE:
            continue
        first, second = one.range + radius, other.range + radius
        along = (distance**2 + first**2 - second**2) / (2 * distance)
        if abs(along) > first:
            continue
        towards = math.atan2(apart[1], apart[0])
        for side in (1, -1):
            bearing = towards + side * math.acos(along / first)
            x, y = (np.array(one.centre) + first * direction(bearing)).tolist()
            if _near(one, bearing) and _near(other, math.atan2(y - other.centre[1], x - other.centre[0])):
                yield x, y


def _near(arc: Arc, bearing: float) -> bool:
    return abs(math.remainder(arc.bearing - bearing, math.tau)) < _FARTHEST * arc.spread


def _same_line(one: FloatArray, other: FloatArray) -> bool:
    return bool(abs(one[1] - other[1]) < _SAME_LINE and abs(math.remainder(one[0] - other[0], math.tau)) < _SAME_TURN)


def _wall(line: FloatArray, centres: FloatArray) -> DraftWall:
    """Return the part of a line between the outermost touches from these places, and a little more."""
    normal, along = direction(float(line[0])), direction(float(line[0]) - math.pi / 2)
    touched = centres @ along
    middle = float((touched.min() + touched.max()) / 2)
    half = float(touched.max() - touched.min()) / 2 + _BEYOND
    x, y = (line[1] * normal + middle * along).tolist()
    return DraftWall((x, y), float(line[0]) - math.pi / 2, (DraftEnd(-half), DraftEnd(half)))
