"""Picture of the plan of a room with measured over predicted readings, as a matplotlib figure."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from sonarhw_sim.predict.by_heading import standpoints
from sonarhw_sim.predict.predicted_scan import PredictedScan
from sonarhw_sim.room.model import Room

from sonarhw.readings import Origin
from sonarhw_compare.pictures.colours import MEASURED, OWN_BODY, PREDICTED, WALL
from sonarhw_compare.pictures.picture_text import picture_text
from sonarhw_compare.pictures.points import points_at
from sonarhw_compare.pictures.shown_figure import laid_out, new_figure


def draw_plan(
    scan: PredictedScan,
    measured: Sequence[tuple[float, float]] = (),
    title: str = "",
    origin: Origin = Origin.MEASURED,
    own_body: Sequence[tuple[float, float]] = (),
) -> Figure:
    """Return a figure of the room with predicted points, and `measured` (heading rad, range m) over them.

    `origin` names the measured points in the legend. `own_body` are measured points of the carrier of the sensor.
    """
    figure = new_figure(8, 7, 120)
    axes = figure.add_subplot()
    draw_room(axes, scan.room)
    x, y = scan.place.position
    predicted = points_at(scan.standpoints, scan.headings, scan.ranges)
    axes.plot(*predicted.T, "o", mfc="none", mec=PREDICTED, ms=7, label="predicted")
    drawn = ((measured, ".", MEASURED, 6, origin.value), (own_body, "D", OWN_BODY, 4, "own body"))
    for readings, marker, colour, size, label in drawn:
        if readings:
            headings, ranges = np.array(readings).T
            sensors = standpoints(scan.board, scan.place, headings)
            axes.plot(*points_at(sensors, headings, ranges).T, marker, color=colour, ms=size, ls="none", label=label)
    axes.plot(x, y, "^", color="black", ms=9, label="sensor")
    named = picture_text(title or f"{scan.room.name}, place {scan.place.name}")
    axes.set(xlabel="x (m)", ylabel="y (m)", title=named)
    axes.set_aspect("equal")
    axes.grid(alpha=0.25)
    # of the figure: the layout reserves too little space for a legend of axes of equal scale
    figure.legend(loc="outside right upper")
    return laid_out(figure)


def draw_room(axes: Axes, room: Room) -> None:
    """Draw walls and posts."""
    for x0, y0, x1, y1 in room.walls:
        axes.plot((x0, x1), (y0, y1), "-", color=WALL, lw=2)
    for x, y, radius in room.posts:
        axes.add_patch(Circle((x, y), radius, color=WALL))
