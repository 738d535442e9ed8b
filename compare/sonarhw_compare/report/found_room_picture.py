"""Picture of a found room as a matplotlib figure: the echoes, the room found from them, and a known room beside it."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from sonarhw_sim.board.profile import Board
from sonarhw_sim.predict.predicted_scan import standpoints
from sonarhw_sim.room.room import Room

from sonarhw.readings import FloatArray
from sonarhw_compare.fit.values.fit_result import PlacedScan
from sonarhw_compare.map.certainty import headings_and_ranges
from sonarhw_compare.map.rejection import judged_readings
from sonarhw_compare.matching.match import compare_readings
from sonarhw_compare.pictures.colours import EXTRA, LONG, MEASURED, PREDICTED, WALL
from sonarhw_compare.pictures.overlay_picture import mark_sensors
from sonarhw_compare.pictures.picture_text import picture_text
from sonarhw_compare.pictures.points import points_at
from sonarhw_compare.pictures.shown_figure import laid_out, new_figure

_WIDTH, _BESIDE = 5.6, 1.4  # inches: of a plan, and of title, axis and legend
_MARGIN = 0.16  # around the room, of its longer side
_NAME_AWAY, _NAME_SIZE = np.array([0.35, 0.17]), np.array([0.55, 0.17])  # inches
# colour and marker of echoes by how the found room explains them
_DIRECT, _GHOST, _NO_PATH = (MEASURED, "o"), (LONG, "^"), (EXTRA, "x")


def draw_found_room(
    scans: Sequence[PlacedScan],
    room: Room,
    board: Board,
    open_ends: Sequence[tuple[float, float]] = (),
    known: Room | None = None,
) -> Figure:
    """Return a figure with a plan of the echoes and one of the found room with its open ends (m).

    A third plan has the `known` room, the points that sound touched in it, and the found room over it. `scans` are at
    the places of the found room.
    """
    count = 2 if known is None else 3
    sensors = np.array([scan.place.position for scan in scans])
    low, high = _bounds([room, *([known] if known else [])], sensors)
    aspect = float(np.clip((high[1] - low[1]) / (high[0] - low[0]), 0.4, 1.6))
    figure = new_figure(_WIDTH * count, _WIDTH * aspect + _BESIDE, 110)
    plans = figure.subplots(1, count, squeeze=False, sharex=True, sharey=True)[0]
    _draw_echoes(plans[0], scans, room, board)
    _draw_surfaces(plans[1], room, PREDICTED, 2.5, "found wall or post")
    _name_surfaces(plans[1], room, sensors, float(high[0] - low[0]) / _WIDTH)
    if open_ends:
        plans[1].plot(*np.transpose(open_ends), "o", mfc="white", mec=PREDICTED, ms=8, ls="none", label="open end")
    plans[1].set_title("room found from them")
    if known is not None:
        _draw_known(plans[2], scans, room, board, known)
    for axes in plans:
        mark_sensors(axes, sensors)
        axes.set(xlabel="x (m)")
        axes.set_aspect("equal")
        axes.grid(alpha=0.25)
    plans[0].set(ylabel="y (m)")
    plans[0].set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    named = {label: mark for axes in plans for mark, label in zip(*axes.get_legend_handles_labels(), strict=True)}
    figure.legend(handles=named.values(), labels=named.keys(), loc="outside lower center", ncols=4)
    return laid_out(figure)


def _draw_echoes(axes: Axes, scans: Sequence[PlacedScan], room: Room, board: Board) -> None:
    """Draw each echo at its range along its heading, by the kind of path that explains it in the found room."""
    judged = judged_readings(scans, room, board)
    points, direct, explained = [], [], []
    for scan, is_direct, is_explained in zip(scans, judged.direct, judged.explained, strict=True):
        headings, ranges = headings_and_ranges(scan, board)
        points.append(points_at(standpoints(board, scan.place, headings), headings, ranges))
        direct.append(is_direct)
        explained.append(is_explained)
    where, once, found = np.vstack(points), np.concatenate(direct), np.concatenate(explained)
    heard = np.isfinite(where).all(axis=1)
    for (colour, marker), rows, label in (
        (_DIRECT, heard & found & once, "one reflection"),
        (_GHOST, heard & found & ~once, "several reflections"),
        (_NO_PATH, heard & ~found, "no path in the found room"),
    ):
        if rows.any():
            axes.plot(*where[rows].T, marker, color=colour, ms=4, ls="none", label=f"echo: {label}")
    axes.set_title(f"{int(heard.sum())} echoes of {len(scans)} scans, drawn along their headings")


def _draw_known(axes: Axes, scans: Sequence[PlacedScan], room: Room, board: Board, known: Room) -> None:
    _draw_surfaces(axes, known, WALL, 6.0, "wall or post of the room file", 0.35)
    _draw_surfaces(axes, room, PREDICTED, 1.8, "found wall or post")
    touched = np.vstack([_touched(scan, known, board) for scan in scans])
    axes.plot(*touched.T, ".", color=MEASURED, ms=5, ls="none", label="touched by sound on its way to an echo")
    axes.set_title(f"beside {picture_text(known.name)}")


def _touched(scan: PlacedScan, room: Room, board: Board) -> FloatArray:
    """Return where the paths that explain readings touch a room, (n, 2) m."""
    comparison = compare_readings(scan.readings, room, board.faced(scan.place), board)
    paths = comparison.prediction.paths
    points = [paths.outline(row.path)[1:-1] for row in comparison.rows if row.path is not None]
    return np.vstack([np.empty((0, 2)), *points])


def _draw_surfaces(axes: Axes, room: Room, colour: str, width: float, label: str, alpha: float = 1.0) -> None:
    for x0, y0, x1, y1 in room.walls.tolist():
        axes.plot((x0, x1), (y0, y1), "-", color=colour, lw=width, alpha=alpha, solid_capstyle="butt")
    for x, y, radius in room.posts.tolist():
        axes.add_patch(Circle((x, y), radius, fill=False, color=colour, lw=width, alpha=alpha))
    axes.plot([], [], "-", color=colour, lw=width, alpha=alpha, label=label)


def _name_surfaces(axes: Axes, room: Room, sensors: FloatArray, inch: float) -> None:
    """Write names of walls and posts on the side away from the sensors, long walls first; no name over another.

    An inch of the plan is `inch` m.
    """
    walls, middle = room.walls, sensors.mean(axis=0)
    marks = [
        ((wall[:2] + wall[2:]) / 2, _away(wall, middle), name) for wall, name in zip(walls, room.names, strict=False)
    ]
    marks = [marks[row] for row in np.argsort(-np.hypot(*(walls[:, 2:] - walls[:, :2]).T), kind="stable")]
    marks += [(post[:2], np.ones(2), name) for post, name in zip(room.posts, room.names[len(walls) :], strict=True)]
    written: list[FloatArray] = []
    for at, away, name in marks:
        spot = at + inch * _NAME_AWAY * away
        if not any((np.abs(spot - other) < inch * _NAME_SIZE).all() for other in written):
            written.append(spot)
            axes.annotate(picture_text(name), spot.tolist(), ha="center", va="center", fontsize="small")


def _away(wall: FloatArray, sensor: FloatArray) -> FloatArray:
    """Return the unit vector across a wall to the side without the sensor, (2,)."""
    along = wall[2:] - wall[:2]
    normal = np.array([-along[1], along[0]]) / np.hypot(*along)
    return np.asarray(normal if (sensor - wall[:2]) @ normal < 0 else -normal)


def _bounds(rooms: Sequence[Room], sensors: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the corners of the plans, (2,) m each: around the rooms, for many echoes are far outside."""
    parts = [part for room in rooms for part in (room.walls.reshape(-1, 2), room.posts[:, :2])]
    corners = np.vstack([*parts, sensors])
    low, high = corners.min(axis=0), corners.max(axis=0)
    margin = _MARGIN * float((high - low).max())
    return low - margin, high + margin
