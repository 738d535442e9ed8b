"""A scan that is drawn over the one shown."""

from dataclasses import dataclass, replace

import numpy as np
from sonarhw_compare.pictures import points_at
from sonarhw_compare.two_scans import HeadingSeries, heading_series
from sonarhw_sim.predict.predicted_scan import standpoints

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
    readings: tuple[Reading, ...]
    scene: Scene  # in which it was made; without room and place if they are unknown
    visible: bool = True


def overlaid(
    name: str, readings: tuple[Reading, ...], scene: Scene, style: int, drawn_in: Scene | None = None
) -> OverlaidScan:
    """Return readings that were made in a scene as a scan to draw over another one.

    `drawn_in`: the scene at whose place it is drawn if its own place is unknown.
    """
    at = replace(drawn_in, board=scene.board) if drawn_in is not None and scene.place is None else scene
    series = heading_series(readings, at.board, at.place.heading if at.place else 0.0)
    sensors = standpoints(at.board, at.pose, series.headings) if len(readings) else np.empty((0, 2))
    points = points_at(sensors, series.headings, series.ranges)
    return OverlaidScan(name, series, points, style, readings, scene)
