"""Picture of a map as a matplotlib figure: all echoes beside those without several reflections."""

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Patch
from sonarhw_sim.room.room import Room

from sonarhw.readings import FloatArray
from sonarhw_compare.map.arcs import Arc, direction
from sonarhw_compare.map.room_map import Layer, RoomMap
from sonarhw_compare.pictures.colours import MEASURED, PREDICTED, WALL
from sonarhw_compare.pictures.overlay_picture import mark_sensors
from sonarhw_compare.pictures.shown_figure import laid_out, new_figure

_ARC_STEPS = 20
_MARGIN = 0.08  # around the features, of their longer side
_SHADES = "Greys"  # empty is white, unknown grey, occupied black


def draw_map(found: RoomMap, room: Room | None = None) -> Figure:
    """Return a figure of the plan with grid, arcs, walls and points; `room` is drawn dashed over it.

    A second plan leaves out the echoes by several reflections, where that is determined.
    """
    if not isinstance(found, RoomMap):
        raise TypeError(f"draw_map: expected the RoomMap that map_scans returns, got {type(found).__name__}")
    direct = f"all echoes, interpreted as direct: {found.echoes}"
    if found.followed_room is None:
        layers = [(found.plain, f"{direct}\nnot determined which came by several reflections")]
    else:
        without = f"without {found.rejected} echoes by several reflections; {found.undetermined} not determined"
        layers = [(found.plain, direct), (found.direct, without)]
    figure = new_figure(7 * len(layers), 7.5, 110)
    plans = figure.subplots(1, len(layers), squeeze=False, sharex=True, sharey=True)[0]
    sensors = np.array([scan.place.position for scan in found.scans])
    for axes, (layer, title) in zip(plans, layers, strict=True):
        _draw_layer(axes, layer)
        if room is not None:
            _draw_outline(axes, room)
        mark_sensors(axes, sensors)
        axes.set(xlabel="x (m)", ylabel="y (m)", title=title)
        axes.set_aspect("equal")
    outline = [] if room is None else [room.walls.reshape(-1, 2)]
    _zoom(plans[0], [*(mark for layer, _ in layers for mark in _marks(layer)), sensors, *outline])
    named = {label: mark for axes in plans for mark, label in zip(*axes.get_legend_handles_labels(), strict=True)}
    shades = [
        Patch(facecolor=colormaps[_SHADES](share), edgecolor=WALL, label=name)
        for share, name in ((0.0, "empty"), (0.5, "unknown"), (1.0, "occupied"))
    ]
    figure.legend(handles=[*named.values(), *shades], loc="outside lower center", ncols=4 * len(layers))
    return laid_out(figure)


def _draw_outline(axes: Axes, room: Room) -> None:
    """Draw walls and posts of a room, dashed."""
    for x0, y0, x1, y1 in room.walls:
        axes.plot((x0, x1), (y0, y1), "--", color=WALL, lw=1.2)
    for x, y, radius in room.posts:
        axes.add_patch(Circle((x, y), radius, fill=False, ls="--", color=WALL, lw=1.2))
    axes.plot([], [], "--", color=WALL, lw=1.2, label="room file")


def _draw_layer(axes: Axes, layer: Layer) -> None:
    axes.set_facecolor(colormaps[_SHADES](0.5))
    axes.imshow(layer.grid.certainty, origin="lower", extent=layer.grid.extent, cmap=_SHADES, vmin=-1.0, vmax=1.0)
    features = layer.features
    for arc in features.arcs:
        axes.plot(*_outline(arc), "-", color=MEASURED, lw=1, alpha=0.7)
    if features.arcs:
        axes.plot([], [], "-", color=MEASURED, lw=1, label="region of constant depth")
    # features that fewer than three places agree on are dotted and hollow: they may be chance
    line, fill, edge, maybe = (
        ("-", PREDICTED, "white", "") if features.confirmed else (":", "none", PREDICTED, "possible ")
    )
    for wall in features.walls:
        style, name = (":", "possible wall") if wall.possible else (line, f"{maybe}wall")
        axes.plot(*np.transpose((wall.start, wall.end)), style, color=PREDICTED, lw=3, label=name)
    for is_corner, mark, name in ((True, "s", "corner"), (False, "o", "edge")):
        at = [point.position for point in features.points if point.is_corner == is_corner]
        if at:
            axes.plot(*np.transpose(at), mark, mfc=fill, mec=edge, ms=9, ls="none", label=f"{maybe}{name}")


def _marks(layer: Layer) -> list[FloatArray]:
    """Return points of everything that is drawn over the grid, (k, 2) m each."""
    features = layer.features
    points = [np.array([point.position]) for point in features.points]
    return (
        [_outline(arc).T for arc in features.arcs]
        + [np.array((wall.start, wall.end)) for wall in features.walls]
        + points
    )


def _zoom(axes: Axes, shown: list[FloatArray]) -> None:
    """Crop the plan to the features; cones may end far behind them."""
    points = np.vstack(shown)
    low, high = points.min(axis=0), points.max(axis=0)
    margin = _MARGIN * float((high - low).max())
    axes.set(xlim=(low[0] - margin, high[0] + margin), ylim=(low[1] - margin, high[1] + margin))


def _outline(arc: Arc) -> FloatArray:
    """Return the points of an arc, (2, k) m."""
    angles = np.linspace(arc.bearing - arc.half_width, arc.bearing + arc.half_width, _ARC_STEPS)
    points = [np.array(arc.centre) + arc.range * direction(float(angle)) for angle in angles]
    return np.asarray(np.transpose(points))
