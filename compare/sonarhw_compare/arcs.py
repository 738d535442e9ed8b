"""Arcs: regions of constant depth around the places of scans, and the walls and posts that two arcs have in common.

The target of an arc is a wall that touches it, or a corner, an edge or a post on it. An arc from one place fits a wall
and a point equally well. With two places, a wall is the line that touches both arcs, and a point is where they cross
(Leonard and Durrant-Whyte 1992, ch. 3 and 4).
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from sonarhw_sim.board.profile import Board, of_own_body, without_own_body
from sonarhw_sim.predict.predicted_scan import standpoints

from sonarhw.errors import InputError
from sonarhw.readings import BoolArray, FloatArray, angle_difference
from sonarhw_compare.fit.result import PlacedScan, check_given_once
from sonarhw_compare.regions import LEAST, TOLERANCE, angles_and_ranges, regions_of

FARTHEST = 3.0  # standard deviations of range and bearing together, for an arc that belongs to a wall or point
OTHER_PLACE = 0.05  # m, between places that count as different
_SURE = math.radians(2)  # smallest standard deviation of a bearing


@dataclass(frozen=True)
class Arc:
    """One region of constant depth."""

    scan: int
    rows: tuple[int, ...]  # of the scan's readings
    centre: tuple[float, float]  # m, position of the sensor
    range: float  # m
    bearing: float  # rad in the room, of its middle
    half_width: float  # rad

    @property
    def middle(self) -> FloatArray:
        """The point in the middle of the arc, (2,) m."""
        return np.array(self.centre) + self.range * direction(self.bearing)

    @property
    def spread(self) -> float:
        """Standard deviation of the bearing of the target, rad; wide, because a nearer target may hide one side."""
        return max(_SURE, self.half_width)

    def touches(self, normal: float) -> tuple[float, float]:
        """Return the line that touches the arc in a direction (rad): this direction, and its distance from 0, 0 (m)."""
        return normal, float(np.dot(self.centre, direction(normal))) + self.range

    def is_near(self, bearing: float) -> bool:
        """Report whether the target may have a bearing (rad)."""
        return abs(math.remainder(self.bearing - bearing, math.tau)) < FARTHEST * self.spread


def direction(angle: float) -> FloatArray:
    """Return the unit vector at an angle (rad), (2,)."""
    return np.array([math.cos(angle), math.sin(angle)])


def headings_and_ranges(scan: PlacedScan, board: Board) -> tuple[FloatArray, FloatArray]:
    """Return the heading of each reading, rad in the room, and its range, m, NaN for no echo of the room; (n,) each."""
    angles, ranges = angles_and_ranges(scan.readings)
    ranges[of_own_body(board.own_body, scan.readings)] = np.nan
    return board.heading_at(angles, scan.place.heading), board.true_ranges(ranges)


def mappable(scans: Sequence[PlacedScan], board: Board) -> list[PlacedScan]:
    """Return scans for a map, without readings of the carrier's own body.

    Raises InputError if no reading has an echo, a scan is given twice or the board is a ring.
    """
    if board.ring is not None:
        raise InputError(f"board {board.name!r} is a ring of sensors; a map needs a turntable")
    scans = [replace(scan, readings=without_own_body(board.own_body, scan.readings)) for scan in scans]
    if all(reading.range is None for scan in scans for reading in scan.readings):
        raise InputError("nothing to map: no reading has an echo")
    check_given_once(scans)
    return scans


class ArcRule(NamedTuple):
    """Which readings make an arc, and how well it is known."""

    tolerance: float  # m, largest difference of its ranges
    least_width: float  # rad
    deviation: float  # m, standard deviation of its range; larger where an arc may have ranges that differ more


CERTAIN = ArcRule(TOLERANCE, LEAST, 0.010)  # for a map, whose features nothing else judges
# for candidates, which the likelihood judges; 1 cm of noise spreads 10 readings over 3 cm. With a deviation of 0.010,
# a room of the benchmark is found worse (docs/explanation/fit_method.md)
POSSIBLE = ArcRule(0.06, math.radians(4), 0.015)


def arcs_of(
    scans: Sequence[PlacedScan], board: Board, rule: ArcRule, kept: Sequence[BoolArray] | None = None
) -> tuple[Arc, ...]:
    """Return the arcs of all scans, from all readings or those `kept` ((n,) bool for each scan)."""
    arcs = []
    for number, scan in enumerate(scans):
        headings, ranges = headings_and_ranges(scan, board)
        if kept is not None:
            ranges[~kept[number]] = np.nan
        for region in regions_of(headings, ranges, rule.tolerance, rule.least_width):
            ((x, y),) = standpoints(board, board.faced(scan.place), np.array([region.bearing])).tolist()
            arcs.append(Arc(number, region.rows, (x, y), region.range, region.bearing, region.width / 2))
    return tuple(arcs)


@dataclass(frozen=True)
class ArcTable:
    """Arcs as arrays, (n,) and (n, 2)."""

    centres: FloatArray  # m
    ranges: FloatArray  # m
    bearings: FloatArray  # rad
    spreads: FloatArray  # rad
    deviation: float  # m, of all ranges

    def of(self, members: NDArray[np.intp]) -> "ArcTable":
        """Return some of the arcs."""
        centres, ranges = self.centres[members], self.ranges[members]
        return ArcTable(centres, ranges, self.bearings[members], self.spreads[members], self.deviation)

    def to_line(self, normal: float, distance: float) -> tuple[FloatArray, float]:
        """Return how far each place is from a line, (n,) m, and the direction from it to the line, rad."""
        return distance - self.centres @ direction(normal), normal

    def to_post(self, x: float, y: float, radius: float = 0.0) -> tuple[FloatArray, FloatArray]:
        """Return how far each place is from a post, (n,) m, and the bearing of the post, (n,) rad."""
        dx, dy = (np.array([x, y]) - self.centres).T
        return np.hypot(dx, dy) - radius, np.arctan2(dy, dx)

    def misfits(self, distances: FloatArray, bearings: FloatArray | float) -> FloatArray:
        """Return the misfit of each arc to a target at `distances` and `bearings` (n,), in standard deviations."""
        turned = angle_difference(self.bearings, bearings)
        return np.asarray(np.hypot((distances - self.ranges) / self.deviation, turned / self.spreads))


def table_of(arcs: Sequence[Arc], rule: ArcRule) -> ArcTable:
    """Return arcs as arrays."""
    return ArcTable(
        np.array([arc.centre for arc in arcs], dtype=np.float64).reshape(-1, 2),
        np.array([arc.range for arc in arcs], dtype=np.float64),
        np.array([arc.bearing for arc in arcs], dtype=np.float64),
        np.array([arc.spread for arc in arcs], dtype=np.float64),
        rule.deviation,
    )


def common_lines(one: Arc, other: Arc) -> Iterator[tuple[float, float]]:
    """Yield the lines that touch two arcs: normal (rad) and distance from 0, 0 (m); none if they have one place."""
    distance, towards = _from_one(one, other)
    # n·(s₂ - s₁) = r₁ - r₂
    cosine = (one.range - other.range) / distance if distance >= OTHER_PLACE else math.inf
    if abs(cosine) <= 1:
        for side in (1, -1):
            yield one.touches(towards + side * math.acos(cosine))


def common_points(one: Arc, other: Arc, radius: float = 0.0) -> Iterator[tuple[float, float]]:
    """Yield the centres (m) of posts of a radius (m) on two arcs; none if they have one place."""
    distance, towards = _from_one(one, other)
    if distance < OTHER_PLACE:
        return
    first, second = one.range + radius, other.range + radius
    along = (distance**2 + first**2 - second**2) / (2 * distance)
    if abs(along) <= first:
        for side in (1, -1):
            x, y = (np.array(one.centre) + first * direction(towards + side * math.acos(along / first))).tolist()
            yield x, y


def _from_one(one: Arc, other: Arc) -> tuple[float, float]:
    """Return the distance of the places of two arcs, m, and the direction from the first to the second, rad."""
    between = np.subtract(other.centre, one.centre)
    return float(np.hypot(*between)), math.atan2(between[1], between[0])


def place_numbers(positions: Iterable[Sequence[float]] | FloatArray) -> NDArray[np.intp]:
    """Return the number of the place of each position (m), (n,): that of the first one within 5 cm."""
    firsts: list[Sequence[float] | FloatArray] = []
    numbers = []
    for position in positions:
        near = (number for number, first in enumerate(firsts) if math.dist(position, first) < OTHER_PLACE)
        numbers.append(next(near, len(firsts)))
        if numbers[-1] == len(firsts):
            firsts.append(position)
    return np.array(numbers, dtype=np.intp)


def count_places(positions: Iterable[Sequence[float]] | FloatArray) -> int:
    """Return the number of different places among positions (m)."""
    return int(place_numbers(positions).max(initial=-1)) + 1
