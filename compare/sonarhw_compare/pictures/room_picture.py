"""Picture of a room with its places and with numbered marks where something is probably wrong."""

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from sonarhw_sim.check.finding import Finding
from sonarhw_sim.room.model import Room

from sonarhw_compare.pictures.colours import MEASURED, PREDICTED
from sonarhw_compare.pictures.overlay_picture import draw_heading, draw_room
from sonarhw_compare.pictures.picture_text import picture_text
from sonarhw_compare.pictures.shown_figure import laid_out, new_figure

_MOST_MARKS = 50  # more would hide the room
_ARROW = 0.06  # length, of the room's longer side


def draw_checked_room(room: Room, findings: Sequence[Finding] = ()) -> Figure:
    """Return a figure of a room with its places, and the number of each finding at the point where it is.

    The arrow of a place is its heading, the direction of turntable step 0.
    """
    figure = new_figure(8, 7, 120)
    axes = figure.add_subplot()
    draw_room(axes, room)
    # a room may consist of posts only
    corners = np.concatenate((room.walls.reshape(-1, 2), room.posts[:, :2]))
    length = _ARROW * float(np.ptp(corners, axis=0).max()) if len(corners) else 1.0
    for place in room.places.values():
        x, y = place.position
        axes.plot(x, y, "o", color=PREDICTED, ms=7)
        draw_heading(axes, place.position, place.heading, length, PREDICTED)
        beside = (6, 6) if math.sin(place.heading) < 0.1 else (6, -14)  # points; not over the arrow
        axes.annotate(picture_text(place.name), (x, y), beside, textcoords="offset points")
    for number, finding in enumerate(findings[:_MOST_MARKS], 1):
        _mark(axes, number, finding)
    axes.set(xlabel="x (m)", ylabel="y (m)", title=picture_text(room.name))
    axes.set_aspect("equal", adjustable="datalim")
    axes.grid(alpha=0.25)
    if any(finding.at for finding in findings):
        axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.1), fontsize="small")
    return laid_out(figure)


def _mark(axes: Axes, number: int, finding: Finding) -> None:
    if finding.at:
        label = picture_text(f"{number}: {finding.where}: {finding.kind}")
        axes.plot(*np.array(finding.at).T, "o", ms=16, mfc="none", mec=MEASURED, mew=2, label=label)
        axes.annotate(str(number), finding.at[0], (10, 10), textcoords="offset points", color=MEASURED, weight="bold")
