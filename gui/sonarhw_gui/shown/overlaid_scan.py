"""A scan that is drawn over the one shown."""

from dataclasses import dataclass

import numpy as np
from sonarhw_compare.pictures.points import points_at
from sonarhw_compare.two_scans.heading_series import heading_series
from sonarhw_compare.two_scans.scan_difference import HeadingSeries
from sonarhw_sim.predict.by_heading import standpoints

from sonarhw.readings import FloatArray, Reading
from sonarhw_gui.scene.scene import Scene

SHOWN = -1  # in a pair: the readings shown


@dataclass(frozen=True)
class ScanPair:
    """Numbers in the list of two scans that are compared; SHOWN: the readings shown."""

    first: int
    second: int


@dataclass(frozen=True, eq=False)
class OverlaidScan:
    """The echoes of one scan, with its colour and whether it is visible."""

    name: str
    series: HeadingSeries
    points: FloatArray  # (n, 2), m, in the plan; NaN without an echo
    style: int  # number of its colour and symbol
    visible: bool = True


def overlaid(name: str, readings: tuple[Reading, ...], scene: Scene, style: int) -> OverlaidScan:
    """Return readings that were made in a scene as a scan to draw over another one."""
    place = scene.pose
    series = heading_series(readings, scene.board, scene.place.heading if scene.place else 0.0)
    sensors = standpoints(scene.board, place, series.headings) if len(readings) else np.empty((0, 2))
    return OverlaidScan(name, series, points_at(sensors, series.headings, series.ranges), style)
