"""Regions of constant depth of two scans held against one another, measured against predicted.

Takes regions of both; hands on which are the same surface, and how far they differ in range, bearing and width.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from compare.match import TOLERANCE, Comparison
from compare.regions import Region, regions_of


@dataclass(frozen=True)
class RegionPair:
    """One region found in both scans."""

    measured: Region
    predicted: Region

    @property
    def farther(self) -> float:
        """Measured range less predicted, m."""
        return self.measured.range - self.predicted.range

    @property
    def turned(self) -> float:
        """Measured bearing less predicted, rad, -π..π."""
        return math.remainder(self.measured.bearing - self.predicted.bearing, math.tau)

    @property
    def wider(self) -> float:
        """Measured width less predicted, rad."""
        return self.measured.width - self.predicted.width


@dataclass(frozen=True)
class RegionMatch:
    """The regions of two scans."""

    pairs: tuple[RegionPair, ...]
    only_measured: tuple[Region, ...]
    only_predicted: tuple[Region, ...]


def compare_regions(comparison: Comparison) -> RegionMatch:
    """The regions of a measured scan and of its prediction, both at the headings of the readings."""
    prediction = comparison.prediction
    ranges = np.array([math.nan if row.measured is None else row.measured for row in comparison.rows])
    return match_regions(regions_of(prediction.headings, ranges), regions_of(prediction.headings, prediction.ranges))


def match_regions(measured: Sequence[Region], predicted: Sequence[Region]) -> RegionMatch:
    """Which regions are one: within 5 cm in range and with headings in common, as many of those as can be."""
    shared = np.array([[_shared(one, other) for other in predicted] for one in measured], dtype=np.float64)
    rows, columns = linear_sum_assignment(shared.reshape(len(measured), len(predicted)), maximize=True)
    chosen = [(int(k), int(j)) for k, j in zip(rows, columns, strict=True) if shared[k, j] > 0]
    of_measured, of_predicted = {k for k, _ in chosen}, {j for _, j in chosen}
    return RegionMatch(
        tuple(RegionPair(measured[k], predicted[j]) for k, j in chosen),
        tuple(region for k, region in enumerate(measured) if k not in of_measured),
        tuple(region for j, region in enumerate(predicted) if j not in of_predicted),
    )


def _shared(one: Region, other: Region) -> float:
    """How much of their headings two regions share, rad; 0 where their ranges differ."""
    if abs(one.range - other.range) > TOLERANCE:
        return 0.0
    apart = abs(math.remainder(one.bearing - other.bearing, math.tau))
    return max(0.0, min(one.width, other.width, (one.width + other.width) / 2 - apart))
