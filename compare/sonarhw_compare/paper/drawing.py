"""Drawing functions that the pictures share: figures, colours, and a scan in the plan of its room.

The colours are those of all other pictures, by Okabe and Ito.
"""

from collections.abc import Sequence
from itertools import pairwise
from typing import Literal, TypeAlias

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from sonarhw_compare.paper.setting import PaperScene
from sonarhw_compare.pictures.colours import MEASURED, PREDICTED, WALL
from sonarhw_compare.pictures.overlay_picture import draw_room, mark_sensors
from sonarhw_compare.pictures.points import points_at

GREEN = "#009E73"
ORANGE = "#E69F00"
Bounds: TypeAlias = tuple[float, float, float, float]  # left, right, bottom, top, m
Corner: TypeAlias = Literal["upper left", "upper center", "upper right", "lower left", "center left"]
__all__ = ["GREEN", "MEASURED", "ORANGE", "PREDICTED", "WALL"]


def sheet(width: float, height: float) -> Figure:
    """Return an empty figure; width and height in inches."""
    figure = Figure(figsize=(width, height), dpi=110, layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def plan(axes: Axes, scene: PaperScene, title: str, bounds: Bounds, legend: Corner = "upper left") -> None:
    """Draw the room within `bounds` (left, right, bottom, top; m), the sensor, and the scan over it."""
    draw_room(axes, scene.scan.room)
    points(axes, scene, "predicted")
    mark_sensors(axes, scene.scan.place.position)
    finish_plan(axes, title, bounds, legend)


def points(
    axes: Axes, scene: PaperScene, label: str, colour: str = PREDICTED, marker: str = "o", size: float = 4.5
) -> None:
    """Draw each reading at its range along its heading, and join neighbours with the same path."""
    scan = scene.scan
    where = points_at(scan.standpoints, scan.headings, scan.ranges)
    axes.plot(*where.T, marker, mfc="none", mec=colour, ms=size, label=label)
    for here, there in pairwise(range(len(where))):
        if scan.winners[here] == scan.winners[there] >= 0 or _same_wall(scene, here, there):
            axes.plot(*where[[here, there]].T, "-", color=colour, lw=1.0)


def _same_wall(scene: PaperScene, here: int, there: int) -> bool:
    first, second = scene.readings[here], scene.readings[there]
    return first.via == second.via != () and first.range == second.range


def mark_silence(axes: Axes, scene: PaperScene, radius: float) -> None:
    """Mark headings without an echo by ticks around the sensor at `radius` (m)."""
    scan = scene.scan
    silent = scan.headings[np.isnan(scan.ranges)]
    away = np.full(len(silent), radius)
    ends = [points_at(scan.place.position, silent, away * part) for part in (0.85, 1.0)]
    for k, (inner, outer) in enumerate(zip(*ends, strict=True)):
        label = "heading without an echo" if k == 0 else None
        axes.plot(*np.array([inner, outer]).T, "-", color=MEASURED, lw=1.2, label=label)


def finish_plan(axes: Axes, title: str, bounds: Bounds, legend: Corner) -> None:
    """Set scale, labels and legend of a plan; `legend` is a location in matplotlib's terms."""
    left, right, bottom, top = bounds
    axes.set(xlabel="x (m)", ylabel="y (m)", xlim=(left, right), ylim=(bottom, top))
    axes.set_title(title, fontsize=11)
    axes.set_aspect("equal")
    axes.grid(alpha=0.25)
    axes.legend(loc=legend, fontsize=8, framealpha=0.9)


def note(axes: Axes, text: str, at: tuple[float, float], beside: tuple[float, float]) -> None:
    """Write text beside a point of a picture, with a line to the point; data units."""
    axes.annotate(
        text,
        at,
        beside,
        fontsize=9,
        ha="center",
        va="center",
        arrowprops={"arrowstyle": "-", "lw": 0.8, "color": "black"},
        bbox={"boxstyle": "round,pad=0.2", "fc": "white", "ec": "none", "alpha": 0.85},
        zorder=6,
    )


def label_walls(axes: Axes, scene: PaperScene, names: Sequence[str], with_reflectance: bool = False) -> None:
    """Write names along walls, on the side away from the sensor."""
    room, sensor = scene.scan.room, np.array(scene.scan.place.position)
    for name in names:
        row = room.names.index(name)
        start, end = room.walls[row].reshape(2, 2)
        along = (end - start) / np.hypot(*(end - start))
        aside = np.array([-along[1], along[0]])
        if aside @ (sensor - start) > 0:
            aside = -aside
        tilt = (np.degrees(np.arctan2(along[1], along[0])) + 90) % 180 - 90
        text = f"{name}, reflectance {room.reflectances[row]:g}" if with_reflectance else name
        middle = (start + end) / 2
        axes.annotate(
            text,
            middle,
            xytext=tuple(aside * 14),
            textcoords="offset points",
            rotation=tilt,
            fontsize=9,
            color=WALL,
            ha="center",
            va="center",
        )
