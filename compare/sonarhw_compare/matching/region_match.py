"""Regions of constant depth of two scans held against one another, measured against predicted.

Takes regions of both; hands on which are the same surface, and how far they differ in range, bearing and width.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment
from sonarhw_sim.rays.paths import Paths

from sonarhw_compare.matching.match import TOLERANCE, Comparison
from sonarhw_compare.matching.regions import Region, regions_of


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
    parts: tuple[RegionPair, ...]  # one of the two lies in a region that is paired already: a mirror heard in pieces
    only_measured: tuple[Region, ...]
    only_predicted: tuple[Region, ...]

    def in_turn(self) -> list[tuple[Region | None, Region | None]]:
        """Each region as measured and as predicted, None where it is in one scan only, counter-clockwise."""
        told: list[tuple[float, Region | None, Region | None]] = []
        told += [(pair.measured.bearing, pair.measured, pair.predicted) for pair in self.pairs + self.parts]
        told += [(region.bearing, region, None) for region in self.only_measured]
        told += [(region.bearing, None, region) for region in self.only_predicted]
        return [(measured, predicted) for _, measured, predicted in sorted(told, key=lambda one: one[0])]


def compare_regions(comparison: Comparison) -> RegionMatch:
    """The regions of a measured scan and of its prediction, both at the headings of the readings.

    Each is of one mirror, so far as the model knows it: two walls that are as far are two regions.
    """
    prediction = comparison.prediction
    ranges = np.array([math.nan if row.measured is None else row.measured for row in comparison.rows])
    measured = [_mirror(prediction.paths, row.path) for row in comparison.rows]
    winners = [_mirror(prediction.paths, int(winner)) for winner in prediction.winners]
    return match_regions(
        regions_of(prediction.headings, ranges, mirrors=measured),
        regions_of(prediction.headings, prediction.ranges, mirrors=winners),
    )


def _mirror(paths: Paths, path: int | None) -> tuple[int, ...] | None:
    """What a path touched, either way round; None where there is none."""
    if path is None or path < 0:
        return None
    return int(paths.edges[path]), *sorted(paths.surfaces[path].tolist())


def match_regions(measured: Sequence[Region], predicted: Sequence[Region]) -> RegionMatch:
    """Which regions are one: within 5 cm in range and with headings in common, as many of those as can be."""
    cells = np.array([[_shared(one, other) for other in predicted] for one in measured], dtype=np.float64)
    shared = cells.reshape(len(measured), len(predicted))
    rows, columns = linear_sum_assignment(shared, maximize=True)
    chosen = [(int(k), int(j)) for k, j in zip(rows, columns, strict=True) if shared[k, j] > 0]
    of_measured = set(range(len(measured))) - {k for k, _ in chosen}
    of_predicted = set(range(len(predicted))) - {j for _, j in chosen}
    parts = [(k, int(shared[k].argmax())) for k in sorted(of_measured) if shared[k].any()]
    parts += [(int(shared[:, j].argmax()), j) for j in sorted(of_predicted) if shared[:, j].any()]
    return RegionMatch(
        tuple(RegionPair(measured[k], predicted[j]) for k, j in chosen),
        tuple(RegionPair(measured[k], predicted[j]) for k, j in parts),
        tuple(measured[k] for k in sorted(of_measured) if not shared[k].any()),
        tuple(predicted[j] for j in sorted(of_predicted) if not shared[:, j].any()),
    )


def _shared(one: Region, other: Region) -> float:
    """How much of their headings two regions share, rad; 0 where their ranges differ."""
    if abs(one.range - other.range) > TOLERANCE:
        return 0.0
    apart = abs(math.remainder(one.bearing - other.bearing, math.tau))
    return max(0.0, min(one.width, other.width, (one.width + other.width) / 2 - apart))
