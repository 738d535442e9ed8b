"""Arcs: regions of constant depth around the position of their scan.

The target is a wall that touches the arc, or a corner or edge on it.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from sonarhw_sim.board.profile import Board
from sonarhw_sim.predict.predicted_scan import standpoints

from sonarhw.readings import BoolArray, FloatArray
from sonarhw_compare.fit.values.fit_result import PlacedScan
from sonarhw_compare.map.certainty import headings_and_ranges
from sonarhw_compare.matching.regions import regions_of

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


def direction(angle: float) -> FloatArray:
    """Return the unit vector at an angle (rad), (2,)."""
    return np.array([math.cos(angle), math.sin(angle)])


def arcs_of(scans: Sequence[PlacedScan], board: Board, kept: Sequence[BoolArray]) -> tuple[Arc, ...]:
    """Return the arcs of all scans, from the readings that are `kept` ((n,) bool for each scan)."""
    found = []
    for number, (scan, wanted) in enumerate(zip(scans, kept, strict=True)):
        headings, ranges = headings_and_ranges(scan, board)
        for region in regions_of(headings, np.where(wanted, ranges, np.nan)):
            (centre,) = standpoints(board, board.faced(scan.place), np.array([region.bearing])).tolist()
            half = region.width / 2
            found.append(Arc(number, region.rows, (centre[0], centre[1]), region.range, region.bearing, half))
    return tuple(found)
