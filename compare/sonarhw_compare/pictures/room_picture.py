"""Picture of a room with its places and with numbered marks where something is probably wrong."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.text import Annotation
from sonarhw_sim.check import Finding
from sonarhw_sim.room.room import Room

from sonarhw_compare.pictures.colours import MEASURED, PREDICTED
from sonarhw_compare.pictures.labels import names_by_position, set_apart
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
    arrows = []
    for place in room.places.values():
        axes.plot(*place.position, "o", color=PREDICTED, ms=7)
        arrows.append(draw_heading(axes, place.position, place.heading, length, PREDICTED))
    labels = [_label(axes, text, at, "black") for at, text in names_by_position(room.places.values()).items()]
    labels += _mark(axes, findings[:_MOST_MARKS])
    axes.set(xlabel="x (m)", ylabel="y (m)", title=picture_text(room.name))
    axes.set_aspect("equal", adjustable="datalim")
    axes.grid(alpha=0.25)
    if axes.get_legend_handles_labels()[0]:
        axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.1), fontsize="small")
    set_apart(laid_out(figure), labels, arrows)
    return figure


def _mark(axes: Axes, findings: Sequence[Finding]) -> list[Annotation]:
    """Draw a circle at each point of findings; return the numbers, one text for all at a point."""
    numbers: dict[tuple[float, float], list[str]] = {}
    for number, finding in enumerate(findings, 1):
        if finding.at:
            label = picture_text(f"{number}: {finding.where}: {finding.kind}")
            axes.plot(*np.array(finding.at).T, "o", ms=16, mfc="none", mec=MEASURED, mew=2, label=label)
            numbers.setdefault(finding.at[0], []).append(str(number))
    return [_label(axes, ", ".join(there), at, MEASURED, "bold") for at, there in numbers.items()]


def _label(axes: Axes, text: str, at: tuple[float, float], color: str, weight: str = "normal") -> Annotation:
    return axes.annotate(text, at, (0, 0), textcoords="offset points", color=color, weight=weight)
