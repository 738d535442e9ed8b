"""Picture of the plan of a room with measured over predicted readings, as a matplotlib figure."""

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Patch
from matplotlib.text import Annotation
from sonarhw_sim.predict.predicted_scan import PredictedScan, standpoints
from sonarhw_sim.room.room import Place, Room

from sonarhw.readings import FloatArray, Origin
from sonarhw_compare.pictures.colours import MEASURED, OWN_BODY, PREDICTED, WALL
from sonarhw_compare.pictures.picture_text import picture_text
from sonarhw_compare.pictures.points import points_at
from sonarhw_compare.pictures.range_shading import RangeShading
from sonarhw_compare.pictures.shown_figure import laid_out, new_figure

_SHADE_OF_LEGEND = 0.4  # opacity of the shading's sample
_LIMITED, _LOWER, _HIGHER = "limited height", "lower than the transducer", "higher than the transducer"
_LINES = {"": "-", _LIMITED: ":", _LOWER: ":", _HIGHER: "-."}  # of walls and posts
_MOVED = 1e-3  # m, more than the rounding of a room file


def draw_plan(
    scan: PredictedScan,
    measured: Sequence[tuple[float, float]] = (),
    title: str = "",
    origin: Origin = Origin.MEASURED,
    own_body: Sequence[tuple[float, float]] = (),
    shading: RangeShading | None = None,
    changed: Room | None = None,
) -> Figure:
    """Return a figure of the room with predicted points, and `measured` (heading rad, range m) over them.

    `origin` names the measured points in the legend. `own_body` are measured points of the carrier of the sensor.
    `shading` is drawn behind everything else. Of `changed`, what the room does not have is drawn as found.
    """
    figure = new_figure(8, 7, 120)
    axes = figure.add_subplot()
    draw_room(axes, scan.room, scan.place)
    predicted = points_at(scan.standpoints, scan.headings, scan.ranges)
    axes.plot(*predicted.T, "o", mfc="none", mec=PREDICTED, ms=7, label="predicted")
    drawn = ((measured, ".", MEASURED, 6, origin.value), (own_body, "D", OWN_BODY, 4, "own body"))
    for readings, marker, colour, size, label in drawn:
        if readings:
            headings, ranges = np.array(readings).T
            sensors = standpoints(scan.board, scan.place, headings)
            axes.plot(*points_at(sensors, headings, ranges).T, marker, color=colour, ms=size, ls="none", label=label)
    if changed is not None:
        _draw_found(axes, scan.room, changed)
    mark_sensors(axes, scan.place.position)
    named = picture_text(title or f"{scan.room.name}, place {scan.place.name}")
    axes.set(xlabel="x (m)", ylabel="y (m)", title=named)
    axes.set_aspect("equal")
    axes.grid(alpha=0.25)
    # of the figure: the layout reserves too little space for a legend of axes of equal scale
    handles, _ = axes.get_legend_handles_labels()
    if shading is not None:
        _draw_shading(axes, scan, shading)
        handles.append(Patch(color=PREDICTED, alpha=_SHADE_OF_LEGEND, label="probability of a range"))
    figure.legend(handles=handles, loc="outside right upper")
    return laid_out(figure)


def _draw_found(axes: Axes, room: Room, changed: Room) -> None:
    """Draw the walls and posts of the changed room that are new or have moved."""
    known = dict(zip(room.names, (*room.walls, *room.posts), strict=False))
    walls = [
        wall
        for name, wall in zip(changed.names, changed.walls, strict=False)
        if name not in known or _has_moved(known[name], wall)
    ]
    posts = [
        post
        for name, post in zip(changed.names[len(changed.walls) :], changed.posts, strict=False)
        if name not in known
    ]
    for x0, y0, x1, y1 in walls:
        axes.plot((x0, x1), (y0, y1), "--", color=PREDICTED, lw=2.5)
    for x, y, radius in posts:
        axes.add_patch(Circle((x, y), radius, fill=False, color=PREDICTED, lw=2, ls="--"))
        axes.plot(x, y, "+", color=PREDICTED, ms=14, mew=2)  # a post may be smaller than a pixel
    if walls or posts:
        axes.plot([], [], "--", color=PREDICTED, lw=2.5, label="found wall or post")


def _has_moved(before: FloatArray, after: FloatArray) -> bool:
    """Return whether an end of a wall is beside its former line. The neighbour of a moved wall only gets longer."""
    along = before[2:] - before[:2]
    across = np.array([-along[1], along[0]]) / np.hypot(*along)
    return bool(np.abs((after.reshape(2, 2) - before[:2]) @ across).max() > _MOVED)


def _draw_shading(axes: Axes, scan: PredictedScan, shading: RangeShading) -> None:
    """Draw the shading around the sensor of `scan`. Likely ranges outside the limits of `axes` are not drawn."""
    count = len(shading.headings)
    edges = shading.headings[0] + (np.arange(count + 1) - 0.5) * 2 * np.pi / count
    ranges = np.linspace(0.0, shading.reach, shading.opacities.shape[1] + 1)
    sensors = standpoints(scan.board, scan.place, edges)[:, None]
    corners = sensors + ranges[:, None] * np.column_stack((np.cos(edges), np.sin(edges)))[:, None]
    # as pixels also in SVG and PDF: 144 000 polygons make large files
    mesh = QuadMesh(corners, array=shading.opacities, rasterized=True, zorder=0)
    mesh.set_cmap(LinearSegmentedColormap.from_list("opacity", [(PREDICTED, 0.0), (PREDICTED, 1.0)]))
    mesh.set_clim(0.0, 1.0)
    axes.add_collection(mesh, autolim=False)


def mark_sensors(
    axes: Axes, positions: FloatArray | tuple[float, float], label: str = "sensor", color: str = "black"
) -> None:
    """Mark the positions of sensors, (n, 2) m or one, by dots. A dot states no heading: a scan has many."""
    x, y = np.transpose(positions)
    axes.plot(x, y, "o", color=color, mec="white", ms=8, ls="none", label=label, zorder=5)


def draw_heading(axes: Axes, position: tuple[float, float], heading: float, length: float, color: str) -> Annotation:
    """Draw an arrow of `length` m from `position` (m) in the direction `heading` (rad), and return it."""
    x, y = position
    tip = x + length * math.cos(heading), y + length * math.sin(heading)
    arrow = {"arrowstyle": "-|>", "color": color, "lw": 2, "shrinkA": 0, "shrinkB": 0}
    axes.update_datalim([tip])  # no arrow is drawn whose tip is outside of the axes
    return axes.annotate("", tip, (x, y), arrowprops=arrow)


def draw_room(axes: Axes, room: Room, place: Place | None = None) -> None:
    """Draw walls and posts, with another line and an entry in the legend for those of limited height.

    With a `place`, these are those above or below its transducer: none without a height, since none has an effect then.
    """
    heights = _named_heights(room, place)
    for (x0, y0, x1, y1), name in zip(room.walls, heights, strict=False):
        axes.plot((x0, x1), (y0, y1), _LINES[name], color=WALL, lw=2)
    for (x, y, radius), name in zip(room.posts, heights[len(room.walls) :], strict=True):
        axes.add_patch(Circle((x, y), radius, color=WALL, ls=_LINES[name], lw=2 if name else 1, fill=not name))
    for name in sorted(set(heights) - {""}):
        axes.plot([], [], _LINES[name], color=WALL, lw=2, label=name)


def _named_heights(room: Room, place: Place | None) -> list[str]:
    """Return what the legend says about the height of each wall and post; empty: nothing."""
    lower, upper = room.heights[: room.levels.start].T
    if place is None:
        levels = {room.names[k]: room.heights[k, 0] for k in room.levels}
        limited = (lower > levels.get("floor", -math.inf)) | (upper < levels.get("ceiling", math.inf))
        return [*np.where(limited, _LIMITED, "").tolist()]
    height = math.nan if place.height is None else place.height
    return [*np.select([upper < height, lower > height], [_LOWER, _HIGHER], "").tolist()]
