"""Assignment of the measured regions of constant depth to the predicted ones, with the differences of each pair."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment
from sonarhw_sim.rays.paths import Paths

from sonarhw_compare.matching.match import TOLERANCE, Comparison, Kind
from sonarhw_compare.matching.regions import Region, regions_of


@dataclass(frozen=True)
class RegionPair:
    """One region found in both scans."""

    measured: Region
    predicted: Region

    @property
    def farther(self) -> float:
        """Measured range minus predicted, m."""
        return self.measured.range - self.predicted.range

    @property
    def turned(self) -> float:
        """Measured bearing minus predicted, rad, -π..π."""
        return math.remainder(self.measured.bearing - self.predicted.bearing, math.tau)

    @property
    def wider(self) -> float:
        """Measured width minus predicted, rad."""
        return self.measured.width - self.predicted.width


@dataclass(frozen=True)
class RegionMatch:
    """The regions of two scans."""

    pairs: tuple[RegionPair, ...]
    parts: tuple[RegionPair, ...]  # further regions that overlap a region of a pair: a reflector detected in pieces
    only_measured: tuple[Region, ...]
    only_predicted: tuple[Region, ...]

    def by_bearing(self) -> list[tuple[Region | None, Region | None]]:
        """Return each region as measured and as predicted, None if missing in that scan, counter-clockwise."""
        rows: list[tuple[float, Region | None, Region | None]] = []
        rows += [(pair.measured.bearing, pair.measured, pair.predicted) for pair in self.pairs + self.parts]
        rows += [(region.bearing, region, None) for region in self.only_measured]
        rows += [(region.bearing, None, region) for region in self.only_predicted]
        return [(measured, predicted) for _, measured, predicted in sorted(rows, key=lambda one: one[0])]


def compare_regions(comparison: Comparison) -> RegionMatch:
    """Return the regions of a measured scan and of its prediction, at the headings of the readings.

    Readings of different predicted paths are in different regions, even if two walls are equally far away.
    Echoes of the carrier's own body are in none.
    """
    prediction = comparison.prediction
    of_room = [None if row.kind is Kind.OWN_BODY else row.measured for row in comparison.rows]
    ranges = np.array([math.nan if measured is None else measured for measured in of_room])
    measured = [_mirror(prediction.paths, row.path) for row in comparison.rows]
    winners = [_mirror(prediction.paths, int(winner)) for winner in prediction.winners]
    return match_regions(
        regions_of(prediction.headings, ranges, mirrors=measured),
        regions_of(prediction.headings, prediction.ranges, mirrors=winners),
    )


def _mirror(paths: Paths, path: int | None) -> tuple[int, ...] | None:
    """Return the edge and surfaces of a path, equal for both directions; None without a path."""
    if path is None or path < 0:
        return None
    return int(paths.edges[path]), *sorted(paths.surfaces[path].tolist())


def match_regions(measured: Sequence[Region], predicted: Sequence[Region]) -> RegionMatch:
    """Assign regions within 5 cm in range so that the headings in common are as many as possible."""
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
    """Return the overlap of two regions, rad; 0 if their ranges differ."""
    if abs(one.range - other.range) > TOLERANCE:
        return 0.0
    apart = abs(math.remainder(one.bearing - other.bearing, math.tau))
    return max(0.0, min(one.width, other.width, (one.width + other.width) / 2 - apart))
