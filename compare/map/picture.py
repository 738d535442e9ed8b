"""The picture of a map: what all readings say, beside what is left without those of several reflections.

Takes a `RoomMap` and, where one is known, the room to hold it against; hands on a matplotlib figure that the caller
saves.
"""

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from compare.colours import MEASURED, PREDICTED, WALL
from compare.map.arcs import Arc, direction
from compare.map.made import Layer, RoomMap
from sim.room import Room

_ARC_STEPS = 20
_SHADES = "Greys"  # empty is white, unknown grey, occupied black


def draw_map(found: RoomMap, room: Room | None = None) -> Figure:
    """A figure of two plans: certainty grid, arcs, walls and points; `room` is drawn dotted over both."""
    figure = Figure(figsize=(14, 7.5), dpi=110, layout="constrained")
    FigureCanvasAgg(figure)
    for axes, layer, title in zip(
        figure.subplots(1, 2, sharex=True, sharey=True), (found.plain, found.direct), _titles(found), strict=True
    ):
        _draw_layer(axes, layer)
        if room is not None:
            for x0, y0, x1, y1 in room.walls:
                axes.plot((x0, x1), (y0, y1), ":", color=WALL, lw=1.2)
        stands = np.array([scan.place.position for scan in found.scans])
        axes.plot(*stands.T, "^", color="black", ms=7, ls="none", label="sensor")
        axes.set(xlabel="x (m)", ylabel="y (m)", title=title)
        axes.set_aspect("equal")
    handles, _ = figure.axes[0].get_legend_handles_labels()
    shades = [
        Patch(facecolor=colormaps[_SHADES](share), edgecolor=WALL, label=name)
        for share, name in ((0.0, "empty"), (0.5, "unknown"), (1.0, "occupied"))
    ]
    figure.legend(handles=[*handles, *shades], loc="outside lower center", ncols=9)
    return figure


def _titles(found: RoomMap) -> tuple[str, str]:
    echoes = sum(reading.range is not None for scan in found.scans for reading in scan.readings)
    if found.believed is None:
        left = "the same: no walls were found to follow sound round"
    elif found.rejected:
        left = f"direct ones: {echoes - found.rejected}; by several reflections, left out: {found.rejected}"
    else:
        left = "the same: no echo came by several reflections"
    return f"all echoes taken for direct ones: {echoes}", left


def _draw_layer(axes: Axes, layer: Layer) -> None:
    axes.set_facecolor(colormaps[_SHADES](0.5))
    axes.imshow(layer.grid.certainty, origin="lower", extent=layer.grid.extent, cmap=_SHADES, vmin=-1.0, vmax=1.0)
    features = layer.features
    for arc in features.arcs:
        axes.plot(*_outline(arc), "-", color=MEASURED, lw=1, alpha=0.7)
    axes.plot([], [], "-", color=MEASURED, lw=1, label="region of constant depth")
    for wall in features.walls:
        axes.plot(*np.transpose((wall.start, wall.end)), "-", color=PREDICTED, lw=3)
    axes.plot([], [], "-", color=PREDICTED, lw=3, label="wall")
    for is_corner, mark, name in ((True, "s", "corner"), (False, "o", "edge")):
        at = np.array([point.position for point in features.points if point.is_corner == is_corner]).reshape(-1, 2)
        axes.plot(*at.T, mark, color=PREDICTED, mec="white", ms=9, ls="none", label=name)


def _outline(arc: Arc) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    """The points of an arc, (2, k) m."""
    angles = np.linspace(arc.bearing - arc.half_width, arc.bearing + arc.half_width, _ARC_STEPS)
    points = [np.array(arc.centre) + arc.range * direction(float(angle)) for angle in angles]
    return np.transpose(points)
