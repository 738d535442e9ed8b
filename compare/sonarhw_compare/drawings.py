"""Figures for Matplotlib: rooms with measured points, comparisons, calibrations, poses, maps and found rooms."""

import math
from collections.abc import Iterable, Sequence
from io import BytesIO
from pathlib import Path
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import QuadMesh
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Ellipse, Patch
from matplotlib.patheffects import withStroke
from matplotlib.text import Annotation
from matplotlib.ticker import MaxNLocator
from matplotlib.transforms import Bbox
from sonarhw_sim.board.profile import Board
from sonarhw_sim.check import Finding
from sonarhw_sim.predict.predicted_scan import PredictedScan, standpoints
from sonarhw_sim.room.room import Place, Room

from sonarhw import arguments
from sonarhw.readings import FloatArray, Origin, points_at
from sonarhw_compare import pictures
from sonarhw_compare.arcs import Arc, direction, headings_and_ranges
from sonarhw_compare.calibration.room import RoomCalibration
from sonarhw_compare.fit.result import PlacedScan
from sonarhw_compare.locate import Located, Pose
from sonarhw_compare.map import Layer, RoomMap, reflections_of
from sonarhw_compare.match import Comparison, Kind, compare_readings
from sonarhw_compare.track import Track
from sonarhw_compare.two_scans import ScanChange, ScanDifference

# Texts at points of a picture: one for all names at a position, and none over another.


Point = tuple[float, float]  # m
_MOST = 40  # characters of a line
_BESIDE, _ABOVE = 8, 10  # points, from a mark to its text
# where a text may be: points from the mark, and the alignment there; the first that is free is used
_SIDES = [
    ((_BESIDE, _BESIDE), "left", "bottom"),
    ((_BESIDE, -_BESIDE), "left", "top"),
    ((-_BESIDE, _BESIDE), "right", "bottom"),
    ((-_BESIDE, -_BESIDE), "right", "top"),
    ((0, _ABOVE), "center", "bottom"),
    ((0, -_ABOVE), "center", "top"),
    ((_ABOVE, 0), "left", "center"),
    ((-_ABOVE, 0), "right", "center"),
]


def names_by_position(places: Iterable[Place]) -> dict[Point, str]:
    """Return the text for each position (m) of places: the names there, in the order of the places."""
    by_position: dict[Point, list[str]] = {}
    for place in places:
        by_position.setdefault(place.position, []).append(pictures.picture_text(place.name))
    return {position: fill(", ".join(names), _MOST) for position, names in by_position.items()}


def set_apart(figure: Figure, labels: Sequence[Annotation], kept: Sequence[Artist]) -> None:
    """Move each label of a figure that is laid out to where it covers no earlier one, and nothing that is `kept`.

    A label that covers something everywhere stays at the first side.
    """
    taken = [label.get_window_extent() for label in kept]
    for label in labels:
        boxes = [_put(label, side) for side in range(len(_SIDES))]
        free = [side for side, box in enumerate(boxes) if not any(box.overlaps(other) for other in taken)]
        taken.append(_put(label, free[0] if free else 0))


def _put(label: Annotation, side: int) -> Bbox:
    """Put a label on a side of its point, and return where it then is, in pixels."""
    label.xyann, horizontal, vertical = _SIDES[side]
    label.set(ha=horizontal, va=vertical)
    return label.get_window_extent()


# Matplotlib figures that a Jupyter notebook shows without pyplot and without `%matplotlib inline`.


class ShownFigure(Figure):
    """A figure with its own canvas. Jupyter shows other figures only after pyplot has been used."""

    def _repr_png_(self) -> bytes:
        file = BytesIO()
        self.savefig(file, format="png", dpi=self.dpi)
        return file.getvalue()


def new_figure(width: float, height: float, dpi: int) -> Figure:
    """Return an empty figure of this size, inches, with `dpi` pixels an inch."""
    figure = ShownFigure(figsize=(width, height), dpi=dpi, layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def _named_marks(plans: Iterable[Axes]) -> dict[str, Any]:
    """Return a mark for each name in the legends of plans."""
    return {name: mark for axes in plans for mark, name in zip(*axes.get_legend_handles_labels(), strict=True)}


def laid_out(figure: Figure) -> Figure:
    """Return the figure after a first layout.

    The layout reserves space for the tick labels that axes of equal scale have before they are resized. In a second
    layout, at drawing, these are the final ones.
    """
    figure.draw_without_rendering()
    return figure


# Picture of the plan of a room with measured over predicted readings, as a matplotlib figure.


_SHADE_OF_LEGEND = 0.4  # opacity of the shading's sample
_LIMITED, _LOWER, _HIGHER = "limited height", "lower than the transducer", "higher than the transducer"
_LINES = {"": "-", _LIMITED: ":", _LOWER: ":", _HIGHER: "-."}  # of walls and posts
_PLAN = 7.0  # inches, the longer side of the plan
_LINE = 0.25  # inches, of a line of a legend
_MARGIN = 0.05  # around what a plan shows, of its longer side
_POSE_ARROW = 0.09  # of the longer side of the plan, arrow of turntable step 0
_MOVED = 1e-3  # m, more than the rounding of a room file


@arguments.checked(
    scan=arguments.instance(PredictedScan, "the result of `predict`"),
    title=arguments.text,
    origin=arguments.choice(Origin),
)
def draw_plan(
    scan: PredictedScan,
    measured: Sequence[tuple[float, float]] = (),
    title: str = "",
    origin: Origin = Origin.MEASURED,
    own_body: Sequence[tuple[float, float]] = (),
    shading: pictures.RangeShading | None = None,
    changed: Room | None = None,
) -> Figure:
    """Return a figure of the room with predicted points, and `measured` (heading rad, range m) over them.

    `origin` names the measured points in the legend. `own_body` are measured points of the carrier of the sensor.
    `shading` is drawn behind everything else. Of `changed`, what the room does not have is drawn as found.
    """
    measured_points, own_points = (
        points_at(standpoints(scan.board, scan.place, headings), headings, ranges)
        for headings, ranges in (np.reshape(readings, (-1, 2)).T for readings in (measured, own_body))
    )
    return _drawn_plan(scan, measured_points, title, origin, own_points, shading, changed)


def _drawn_plan(
    scan: PredictedScan,
    measured: FloatArray,
    title: str,
    origin: Origin,
    own_body: FloatArray,
    shading: pictures.RangeShading | None,
    changed: Room | None,
) -> Figure:
    """Return the figure of `draw_plan` with measured points (n, 2) m."""
    figure = new_figure(8, 7, 120)
    axes = figure.add_subplot()
    predicted = points_at(scan.standpoints, scan.headings, scan.ranges)
    shown = [_corners(scan.room), measured, own_body, scan.standpoints, _corners(changed or scan.room)]
    # echoes by several reflections appear far outside; without measured points, they are the subject
    low, high = _around([*shown, *(() if len(measured) else (predicted,))], _MARGIN)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    draw_room(axes, scan.room, scan.place)
    outside = int(((predicted < low) | (predicted > high)).any(axis=1).sum())
    name = f"predicted ({outside} more outside)" if outside else "predicted"
    axes.plot(*predicted.T, "o", mfc="none", mec=pictures.PREDICTED, ms=7, label=name)
    drawn = ((measured, ".", pictures.MEASURED, 6, origin.value), (own_body, "D", pictures.OWN_BODY, 4, "own body"))
    for points, marker, colour, size, label in drawn:
        if len(points):
            axes.plot(*points.T, marker, color=colour, ms=size, ls="none", label=label)
    if changed is not None:
        _draw_found(axes, scan.room, changed)
    if scan.poses is not None:
        draw_trajectory(axes, scan.poses, "sensor", "black")
    else:
        draw_sensor(axes, scan)
    named = pictures.picture_text(title or f"{scan.room.name}, {scan.where}")
    axes.set(xlabel="x (m)", ylabel="y (m)")
    axes.set_title(named, wrap=True)
    axes.grid(alpha=0.25)
    handles, _ = axes.get_legend_handles_labels()
    if shading is not None:
        _draw_shading(axes, scan, shading)
        handles.append(Patch(color=pictures.PREDICTED, alpha=_SHADE_OF_LEGEND, label="probability of a range"))
    return _sized(figure, axes, handles)


def _corners(room: Room) -> FloatArray:
    """Return the ends of walls and the sides of posts, (k, 2) m."""
    sides = room.posts[:, None, :2] + room.posts[:, None, 2:] * np.array([[1, 0], [-1, 0], [0, 1], [0, -1]])
    return np.vstack((room.walls.reshape(-1, 2), sides.reshape(-1, 2)))


def _sized(figure: Figure, axes: Axes, handles: Sequence[Any], beside: float = 0.0) -> Figure:
    """Return the figure with the size that a plan within the limits of its axes needs, and with its legend below.

    `beside` is the width of what is beside the plan, inches.
    """
    width, height = (float(np.ptp(limits)) for limits in (axes.get_xlim(), axes.get_ylim()))
    scale = _PLAN / max(width, height)
    axes.set_aspect("equal")
    figure.set_size_inches(
        1 + beside + max(_PLAN / 2, width * scale), 1.2 + _LINE * len(handles) / 2 + max(_PLAN / 4, height * scale)
    )
    # of the figure: the layout reserves too little space for a legend of axes of equal scale
    for columns in range(min(4, len(handles)), 0, -1):
        legend = figure.legend(handles=handles, loc="outside lower center", ncols=columns)
        if columns == 1 or legend.get_window_extent().width <= figure.bbox.width:
            break
        legend.remove()
    return laid_out(figure)


def _draw_found(axes: Axes, room: Room, changed: Room) -> None:
    """Draw the walls and posts of the changed room that are new or have moved."""
    surfaces = dict(zip(room.names, (*room.walls, *room.posts), strict=False))
    walls = [
        wall
        for name, wall in zip(changed.names, changed.walls, strict=False)
        if name not in surfaces or _has_moved(surfaces[name], wall)
    ]
    posts = [
        post
        for name, post in zip(changed.names[len(changed.walls) :], changed.posts, strict=False)
        if name not in surfaces
    ]
    for x0, y0, x1, y1 in walls:
        axes.plot((x0, x1), (y0, y1), "--", color=pictures.PREDICTED, lw=2.5)
    for x, y, radius in posts:
        axes.add_patch(Circle((x, y), radius, fill=False, color=pictures.PREDICTED, lw=2, ls="--"))
        axes.plot(x, y, "+", color=pictures.PREDICTED, ms=14, mew=2)  # a post may be smaller than a pixel
    if walls or posts:
        axes.plot([], [], "--", color=pictures.PREDICTED, lw=2.5, label="found wall or post")


def _has_moved(before: FloatArray, after: FloatArray) -> bool:
    """Return whether an end of a wall is beside its former line. The neighbour of a moved wall only gets longer."""
    along = before[2:] - before[:2]
    across = np.array([-along[1], along[0]]) / np.hypot(*along)
    return bool(np.abs((after.reshape(2, 2) - before[:2]) @ across).max() > _MOVED)


def _draw_shading(axes: Axes, scan: PredictedScan, shading: pictures.RangeShading) -> None:
    """Draw the shading around the sensor of `scan`. Likely ranges outside the limits of `axes` are not drawn."""
    count = len(shading.headings)
    edges = shading.headings[0] + (np.arange(count + 1) - 0.5) * 2 * np.pi / count
    ranges = np.linspace(0.0, shading.reach, shading.opacities.shape[1] + 1)
    sensors = standpoints(scan.board, scan.place, edges)[:, None]
    corners = sensors + ranges[:, None] * np.column_stack((np.cos(edges), np.sin(edges)))[:, None]
    # as pixels also in SVG and PDF: 144 000 polygons make large files
    mesh = QuadMesh(corners, array=shading.opacities, rasterized=True, zorder=0)
    mesh.set_cmap(LinearSegmentedColormap.from_list("opacity", [(pictures.PREDICTED, 0.0), (pictures.PREDICTED, 1.0)]))
    mesh.set_clim(0.0, 1.0)
    axes.add_collection(mesh, autolim=False)


def mark_sensors(
    axes: Axes, positions: FloatArray | tuple[float, float], label: str = "sensor", color: str = "black"
) -> list[Line2D]:
    """Mark the positions of sensors, (n, 2) m or one, by dots; return these. A dot states no heading."""
    x, y = np.transpose(positions)
    return axes.plot(x, y, "o", color=color, mec="white", ms=8, ls="none", label=label, zorder=5)


def draw_sensor(axes: Axes, scan: PredictedScan) -> None:
    """Mark the place of a scan, with an arrow along turntable step 0; a ring of sensors has no turntable."""
    if scan.board.ring is not None:
        mark_sensors(axes, scan.place.position)
        return
    longer = float(max(np.ptp(axes.get_xlim()), np.ptp(axes.get_ylim())))
    draw_heading(axes, scan.place.position, scan.place.heading, _POSE_ARROW * longer, "black")
    mark_sensors(axes, scan.place.position, "sensor, step 0 along the arrow")


def draw_trajectory(axes: Axes, poses: FloatArray, label: str, color: str) -> None:
    """Draw poses (n, 3) in their order as a line, with a dot at the first and an arrow at the last."""
    axes.plot(*poses[:, :2].T, "-", color=color, lw=1.5, label=label, zorder=4)
    axes.plot(*poses[0, :2], "o", color=color, mec="white", ms=8, zorder=5)
    size = _ARROW * max(map(float, (np.ptp(axes.get_xlim()), np.ptp(axes.get_ylim()))))
    draw_heading(axes, (float(poses[-1, 0]), float(poses[-1, 1])), float(poses[-1, 2]), size, color)


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
        axes.plot((x0, x1), (y0, y1), _LINES[name], color=pictures.WALL, lw=2)
    for (x, y, radius), name in zip(room.posts, heights[len(room.walls) :], strict=True):
        axes.add_patch(Circle((x, y), radius, color=pictures.WALL, ls=_LINES[name], lw=2 if name else 1, fill=not name))
    for name in sorted(set(heights) - {""}):
        axes.plot([], [], _LINES[name], color=pictures.WALL, lw=2, label=name)


def _named_heights(room: Room, place: Place | None) -> list[str]:
    """Return what the legend says about the height of each wall and post; empty: nothing."""
    lower, upper = room.heights[: room.levels.start].T
    if place is None:
        levels = {room.names[k]: room.heights[k, 0] for k in room.levels}
        limited = (lower > levels.get("floor", -math.inf)) | (upper < levels.get("ceiling", math.inf))
        return [*np.where(limited, _LIMITED, "").tolist()]
    height = math.nan if place.height is None else place.height
    return [*np.select([upper < height, lower > height], [_LOWER, _HIGHER], "").tolist()]


# Picture of a room with its places and with numbered marks where something is probably wrong.


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
        axes.plot(*place.position, "o", color=pictures.PREDICTED, ms=7)
        arrows.append(draw_heading(axes, place.position, place.heading, length, pictures.PREDICTED))
    labels = [_label(axes, text, point, "black") for point, text in names_by_position(room.places.values()).items()]
    labels += _mark(axes, findings[:_MOST_MARKS])
    axes.set(xlabel="x (m)", ylabel="y (m)", title=pictures.picture_text(room.name))
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
            label = pictures.picture_text(f"{number}: {finding.where}: {finding.kind}")
            axes.plot(*np.array(finding.at).T, "o", ms=16, mfc="none", mec=pictures.MEASURED, mew=2, label=label)
            numbers.setdefault(finding.at[0], []).append(str(number))
    return [_label(axes, ", ".join(texts), point, pictures.MEASURED, "bold") for point, texts in numbers.items()]


def _label(axes: Axes, text: str, point: tuple[float, float], color: str, weight: str = "normal") -> Annotation:
    return axes.annotate(text, point, (0, 0), textcoords="offset points", color=color, weight=weight)


# Picture of a scan over its prediction, in the plan of the room.


@arguments.checked(comparison=arguments.instance(Comparison, "the result of `compare`"))
def draw_comparison(
    comparison: Comparison, shading: pictures.RangeShading | None = None, changed: Room | None = None
) -> Figure:
    """Return a figure of the room with the scan over its prediction, and the shading of `shading_around` behind.

    What only `changed` has is drawn as found: the room of `find_causes`.
    """
    prediction = comparison.prediction
    points = points_at(prediction.standpoints, prediction.headings, comparison.measured)
    sounding, own = ~np.isnan(comparison.measured), ~comparison.of_room
    of_room, of_body = points[sounding & ~own], points[sounding & own]
    return _drawn_plan(prediction, of_room, "", comparison.origin, of_body, shading, changed)


# Picture of the trajectory of a robot.


_CERTAIN = 2.0  # standard deviations of the ellipses
_MOST_ELLIPSES = 40
_BEYOND_ROOM = 0.1  # margin, of the longer side


@arguments.checked(track=arguments.instance(Track, "the result of `track`"))
def draw_track(track: Track) -> Figure:
    """Return a figure of a room with a trajectory, ellipses of two standard deviations, the odometry and the echoes."""
    figure = new_figure(8, 7, 120)
    axes = figure.add_subplot()
    draw_room(axes, track.room)
    located, poses = track.located, track.poses
    echoes = []
    for row in np.flatnonzero(located).tolist():
        angles, ranges = track.readings[row]
        headings = track.board.heading_at(angles, float(poses[row, 2]))
        echoes.append(points_at(standpoints(track.board, poses[row : row + 1], headings), headings, ranges))
    if echoes:
        axes.plot(*np.vstack(echoes).T, ".", color=pictures.MEASURED, ms=2, alpha=0.5, label="echoes")
    axes.plot(*track.odometry[:, :2].T, "--", color="#777777", lw=1.2, label="odometry alone")
    for row in np.flatnonzero(located)[:: max(1, int(located.sum()) // _MOST_ELLIPSES)]:
        (x, y), (width, height) = poses[row, :2].tolist(), (2 * _CERTAIN * track.deviations[row, :2]).tolist()
        axes.add_patch(Ellipse((x, y), width, height, color=pictures.PREDICTED, alpha=0.2, lw=0))
    axes.plot(*np.where(located[:, None], poses[:, :2], np.nan).T, "-", color=pictures.PREDICTED, lw=2, label="track")
    if not located.all():
        axes.plot(*poses[~located, :2].T, "x", color=pictures.EXTRA, ms=6, label="not located")
    _limit_to_room(axes, track.room)
    size = _ARROW * float(np.ptp(axes.get_xlim()))
    x, y, heading = poses[-1].tolist()
    draw_heading(axes, (x, y), heading, size, pictures.PREDICTED)
    axes.set(xlabel="x (m)", ylabel="y (m)", title=pictures.picture_text(f"{track.room.name}, {Path(track.scan).name}"))
    axes.set_aspect("equal")
    axes.grid(alpha=0.25)
    figure.legend(loc="outside right upper")
    return laid_out(figure)


def _limit_to_room(axes: Axes, room: Room) -> None:
    corners = np.vstack((room.walls.reshape(-1, 2), room.posts[:, :2]))
    low, high = corners.min(axis=0), corners.max(axis=0)
    beyond = _BEYOND_ROOM * float((high - low).max())
    axes.set(xlim=(low[0] - beyond, high[0] + beyond), ylim=(low[1] - beyond, high[1] + beyond))


# Picture of scans beside their predictions, before and after a calibration.


MOST_SCANS = 8  # in one picture
_SILENT = -0.12  # of the largest range: where readings without an echo are drawn


def draw_calibration(calibration: RoomCalibration) -> Figure:
    """Return a figure with a row for each of the first 8 scans: range by heading, before and after."""
    shown = min(len(calibration.scans), MOST_SCANS)
    figure = new_figure(12, 0.8 + 2.1 * shown, 100)
    axes = figure.subplots(shown, 2, squeeze=False, sharex=True, sharey=True)
    for row in range(shown):
        for column, (when, comparison) in enumerate(
            (("before", calibration.before[row]), ("after", calibration.after[row]))
        ):
            _draw(axes[row, column], comparison)
            summary = comparison.summary()
            share = "no echo" if summary.within_5cm is None else f"{summary.within_5cm:.0%} of echoes within 5 cm"
            silence = summary.no_echo_agreement
            title = f"{calibration.scans[row].name}, {when}: {share}" + (
                "" if silence is None else f", silence {silence:.0%}"
            )
            axes[row, column].set_title(pictures.picture_text(title), fontsize=9, loc="left")
        axes[row, 0].set_ylabel("range (m)")
    axes[0, 0].yaxis.set_major_formatter(lambda value, _: f"{value:g}" if value >= 0 else "")  # shared by all
    for axis in axes[-1]:
        axis.set(xlabel="heading in the room (°)", xlim=(0, 360), xticks=range(0, 361, 45))
    handles = _named_marks(axes.flat)
    figure.legend(handles.values(), handles.keys(), loc="outside upper center", ncols=4, frameon=False)
    return laid_out(figure)


def _draw(axes: Axes, comparison: Comparison) -> None:
    named = f"{comparison.origin.value} (grey band: no echo)"
    quiet = _SILENT * comparison.prediction.board.max_range
    headings = np.degrees(comparison.prediction.headings) % 360
    predicted = comparison.prediction.ranges
    axes.axhspan(2 * quiet, quiet / 2, color="#EEEEEE")
    axes.plot(
        headings, _or(predicted, quiet * 1.4), "o", mfc="none", mec=pictures.PREDICTED, ms=4, mew=0.8, label="predicted"
    )
    for kinds, colour, marker, label in (
        ([kind for kind in Kind if kind is not Kind.OWN_BODY], pictures.MEASURED, ".", named),
        ([Kind.OWN_BODY], pictures.OWN_BODY, "d", "own body"),
    ):
        rows = [row for row in comparison.rows if row.kind in kinds]
        if rows:
            measured = np.array([math.nan if row.measured is None else row.measured for row in rows])
            degrees = np.degrees([row.heading for row in rows]) % 360
            axes.plot(degrees, _or(measured, quiet), marker, color=colour, ms=4, ls="none", label=label)
    axes.grid(alpha=0.25)


def _or(values: np.ndarray, instead: float) -> np.ndarray:
    return np.where(np.isnan(values), instead, values)


# Picture of the posterior over positions and of the most probable poses, as a matplotlib figure.


_DEEPEST = 12.0  # of the logarithm, lower end of the shading
_MOST_POSES = 5
_LEAST_DRAWN = 0.005  # probability; a less probable pose would be stated as 0 %
_ONE_MARK = 0.03  # of the longer side of the plan, between poses that share a text
_COLOUR_BAR = 1.1  # inches, width of the colour bar with its label


@arguments.checked(located=arguments.instance(Located, "the result of `locate`"))
def draw_located(located: Located) -> Figure:
    """Return a figure of the room with the posterior of the lattice, the poses as arrows, and the scan at the best."""
    figure = new_figure(8, 7, 120)
    axes = figure.add_subplot()
    _shade(axes, figure, located)
    draw_room(axes, located.room)
    best = located.chosen
    echoes = [reading for reading in located.readings if reading.range is not None]
    board, place = located.board, Place("", best.position, best.heading)
    headings = np.array([board.heading_at(reading.angle, best.heading) for reading in echoes])
    sensors = standpoints(board, board.faced(place), headings)
    ranges = np.array([float(reading.range or 0) + best.offset for reading in echoes])
    points = points_at(sensors, headings, ranges)
    axes.plot(*points.T, ".", color=pictures.MEASURED, ms=6, label="scan, at the best pose")
    poses = [pose for pose in located.poses[:_MOST_POSES] if pose.probability >= _LEAST_DRAWN] or [best]
    places = names_by_position(located.room.places.values())
    low, high = _around([_corners(located.room), points, np.array([pose.position for pose in poses])], _MARGIN)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), xlabel="x (m)", ylabel="y (m)")
    longer = float((high - low).max())
    taken: list[Artist] = []
    for number, position in enumerate(places):
        taken += axes.plot(*position, "+", color="black", alpha=0.6, ms=6, ls="none", label="" if number else "place")
    for number, pose in enumerate(poses):
        taken.append(draw_heading(axes, pose.position, pose.heading, _POSE_ARROW * longer, pictures.PREDICTED))
        name = "" if number else "probable pose, step 0 along the arrow"
        taken += mark_sensors(axes, pose.position, name, pictures.PREDICTED)
    axes.set_title(f"{pictures.picture_text(located.room.name)}: where the scan was taken", wrap=True)
    labels = [
        *(_label(axes, text, mark, pictures.PREDICTED) for mark, text in _shares(poses, _ONE_MARK * longer).items()),
        *(_label(axes, text, position, "black") for position, text in places.items()),
    ]
    for label in labels:
        label.set_path_effects([withStroke(linewidth=2.5, foreground="white")])
    _sized(figure, axes, axes.get_legend_handles_labels()[0], _COLOUR_BAR)
    set_apart(figure, labels, taken)
    return figure


def _shares(poses: Sequence[Pose], near: float) -> dict[Point, str]:
    """Return the probabilities of poses as text by position; poses within `near` m of an earlier one share its text."""
    shares: dict[Point, list[str]] = {}
    for pose in poses:
        mark = next((point for point in shares if math.dist(point, pose.position) <= near), pose.position)
        shares.setdefault(mark, []).append(f"{pose.probability:.0%}" if pose.probability >= _LEAST_DRAWN else "<1%")
    return {mark: ", ".join(texts) for mark, texts in shares.items()}


def _shade(axes: Axes, figure: Figure, located: Located) -> None:
    scores = located.scores
    columns, rows = (
        np.round((scores.positions[:, k] - scores.positions[:, k].min()) / scores.spacing).astype(int) for k in range(2)
    )
    image = np.full((rows.max() + 1, columns.max() + 1), np.nan)
    image[rows, columns] = np.maximum(located.lattice, -_DEEPEST)
    left, bottom = scores.positions.min(axis=0) - scores.spacing / 2
    extent = (
        float(left),
        float(left + image.shape[1] * scores.spacing),
        float(bottom),
        float(bottom + image.shape[0] * scores.spacing),
    )
    shown = axes.imshow(image, origin="lower", extent=extent, cmap="Greys", vmin=-_DEEPEST, vmax=0.0, alpha=0.7)
    figure.colorbar(shown, ax=axes, shrink=0.9, label="log-probability (best: 0)")


# Picture of a map as a matplotlib figure: all echoes beside those without several reflections.


_ARC_STEPS = 20
_MAP_MARGIN = 0.08  # around the features, of their longer side
_SHADES = "Greys"  # empty is white, unknown grey, occupied black


@arguments.checked(
    found=arguments.instance(RoomMap, "the map of `map_scans`, or `baseline` of the result of `map_room`"),
    room=arguments.instance(Room, "a room"),
)
def draw_map(found: RoomMap, room: Room | None = None) -> Figure:
    """Return a figure of the plan with grid, arcs, walls and points; `room` is drawn dashed over it.

    A second plan leaves out the echoes by several reflections, where that is determined.
    """
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
            _draw_surfaces(axes, room, pictures.WALL, 1.2, "room file", style="--")
        mark_sensors(axes, sensors)
        axes.set(xlabel="x (m)", ylabel="y (m)", title=title)
        axes.set_aspect("equal")
    outline = [] if room is None else [room.walls.reshape(-1, 2)]
    # cones may end far behind the features
    low, high = _around([*(mark for layer, _ in layers for mark in _marks(layer)), sensors, *outline], _MAP_MARGIN)
    plans[0].set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    named = _named_marks(plans)
    shades = [
        Patch(facecolor=colormaps[_SHADES](share), edgecolor=pictures.WALL, label=name)
        for share, name in ((0.0, "empty"), (0.5, "unknown"), (1.0, "occupied"))
    ]
    figure.legend(handles=[*named.values(), *shades], loc="outside lower center", ncols=4 * len(layers))
    return laid_out(figure)


def _draw_layer(axes: Axes, layer: Layer) -> None:
    axes.set_facecolor(colormaps[_SHADES](0.5))
    axes.imshow(layer.grid.certainty, origin="lower", extent=layer.grid.extent, cmap=_SHADES, vmin=-1.0, vmax=1.0)
    features = layer.features
    for arc in features.arcs:
        axes.plot(*_outline(arc), "-", color=pictures.MEASURED, lw=1, alpha=0.7)
    if features.arcs:
        axes.plot([], [], "-", color=pictures.MEASURED, lw=1, label="region of constant depth")
    # features that fewer than three places agree on are dotted and hollow: they may be chance
    line, fill, edge, maybe = (
        ("-", pictures.PREDICTED, "white", "") if features.confirmed else (":", "none", pictures.PREDICTED, "possible ")
    )
    for wall in features.walls:
        style, name = (":", "possible wall") if wall.possible else (line, f"{maybe}wall")
        axes.plot(*np.transpose((wall.start, wall.end)), style, color=pictures.PREDICTED, lw=3, label=name)
    for is_corner, mark, name in ((True, "s", "corner"), (False, "o", "edge")):
        positions = [point.position for point in features.points if point.is_corner == is_corner]
        if positions:
            axes.plot(*np.transpose(positions), mark, mfc=fill, mec=edge, ms=9, ls="none", label=f"{maybe}{name}")


def _marks(layer: Layer) -> list[FloatArray]:
    """Return points of everything that is drawn over the grid, (k, 2) m each."""
    features = layer.features
    points = [np.array([point.position]) for point in features.points]
    return (
        [_outline(arc).T for arc in features.arcs]
        + [np.array((wall.start, wall.end)) for wall in features.walls]
        + points
    )


def _outline(arc: Arc) -> FloatArray:
    """Return the points of an arc, (2, k) m."""
    angles = np.linspace(arc.bearing - arc.half_width, arc.bearing + arc.half_width, _ARC_STEPS)
    points = [np.array(arc.centre) + arc.range * direction(float(angle)) for angle in angles]
    return np.asarray(np.transpose(points))


# Picture of two scans: both ranges against heading, and below them their difference.


# colour and marker of each change; the colours of short, long, extra and missed readings mean the same there
LOOK = {
    ScanChange.SAME: (pictures.WALL, "o"),
    ScanChange.NEARER: (pictures.SHORT, "v"),
    ScanChange.FARTHER: (pictures.LONG, "^"),
    ScanChange.FELL_SILENT: (pictures.MISSED, "x"),
    ScanChange.APPEARED: (pictures.EXTRA, "+"),
}


def draw_difference(difference: ScanDifference) -> Figure:
    """Return a figure of two scans and their differences by heading."""
    figure = new_figure(9, 6.5, 120)
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    headings = np.degrees([row.heading for row in difference.rows])
    marks = (
        (difference.names[0], "o", pictures.PREDICTED, "none", 6),
        (difference.names[1], ".", pictures.MEASURED, pictures.MEASURED, 6),
    )
    for which, (name, marker, colour, face, size) in enumerate(marks):
        medians = [(row.first, row.second)[which].median for row in difference.rows]
        ranges = np.array([math.nan if median is None else median for median in medians])
        above.plot(
            headings, ranges, marker, color=colour, mfc=face, ms=size, ls="none", label=pictures.picture_text(name)
        )
    above.set(ylabel="range (m)", ylim=(0, None))
    _draw_differences(below, difference)
    below.set(xlabel="heading (°)", ylabel="second minus first (cm)")
    below.xaxis.set_major_locator(MaxNLocator(9, steps=(1, 1.5, 3, 4.5, 9, 10)))  # 15°, 30°, 45°, 90°
    for axes in (above, below):
        axes.grid(alpha=0.25)
    figure.legend(loc="outside upper center", ncols=4)
    return laid_out(figure)


def _draw_differences(axes: Axes, difference: ScanDifference) -> None:
    headings = np.degrees([row.heading for row in difference.rows])
    limit = 100 * np.array([row.limit for row in difference.rows])
    axes.fill_between(
        headings, -limit, limit, step="mid", color=pictures.WALL, alpha=0.2, lw=0, label="explained by noise"
    )
    for change, (colour, marker) in LOOK.items():
        rows = [row for row in difference.rows if row.change is change]
        if rows:
            # a heading that is silent in one scan has no difference; its mark is on the axis
            centimetres = [100 * (row.difference or 0.0) for row in rows]
            degrees = np.degrees([row.heading for row in rows])
            axes.plot(degrees, centimetres, marker, color=colour, ms=5, ls="none", label=change.value)


# Picture of a found room as a matplotlib figure: the echoes, the room found from them, and a known room beside it.


_WIDTH, _ROOM_BESIDE = 5.6, 1.4  # inches: of a plan, and of title, axis and legend
_ROOM_MARGIN = 0.16  # around the room, of its longer side
_NAME_AWAY, _NAME_SIZE = np.array([0.35, 0.17]), np.array([0.55, 0.17])  # inches
# colour and marker of echoes by how the found room explains them
_DIRECT, _GHOST, _NO_PATH = (pictures.MEASURED, "o"), (pictures.LONG, "^"), (pictures.EXTRA, "x")


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
    ends = [part for drawn in (room, known) if drawn for part in (drawn.walls.reshape(-1, 2), drawn.posts[:, :2])]
    low, high = _around([*ends, sensors], _ROOM_MARGIN)  # of the rooms, for many echoes are far outside
    aspect = float(np.clip((high[1] - low[1]) / (high[0] - low[0]), 0.4, 1.6))
    figure = new_figure(_WIDTH * count, _WIDTH * aspect + _ROOM_BESIDE, 110)
    plans = figure.subplots(1, count, squeeze=False, sharex=True, sharey=True)[0]
    _draw_echoes(plans[0], scans, room, board)
    _draw_surfaces(plans[1], room, pictures.PREDICTED, 2.5, "found wall or post")
    _name_surfaces(plans[1], room, sensors, float(high[0] - low[0]) / _WIDTH)
    if open_ends:
        plans[1].plot(
            *np.transpose(open_ends), "o", mfc="white", mec=pictures.PREDICTED, ms=8, ls="none", label="open end"
        )
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
    named = _named_marks(plans)
    figure.legend(handles=named.values(), labels=named.keys(), loc="outside lower center", ncols=4)
    return laid_out(figure)


def _draw_echoes(axes: Axes, scans: Sequence[PlacedScan], room: Room, board: Board) -> None:
    """Draw each echo at its range along its heading, by the kind of path that explains it in the found room."""
    reflections, points = np.concatenate(reflections_of(scans, room, board)), []
    for scan in scans:
        headings, ranges = headings_and_ranges(scan, board)
        points.append(points_at(standpoints(board, scan.place, headings), headings, ranges))
    where, once, several = np.vstack(points), reflections <= 1, reflections > 0
    heard = np.isfinite(where).all(axis=1)
    for (colour, marker), rows, label in (
        (_DIRECT, heard & several & once, "one reflection"),
        (_GHOST, heard & several & ~once, "several reflections"),
        (_NO_PATH, heard & ~several, "no path in the found room"),
    ):
        if rows.any():
            axes.plot(*where[rows].T, marker, color=colour, ms=4, ls="none", label=f"echo: {label}")
    axes.set_title(f"{int(heard.sum())} echoes of {len(scans)} scans, drawn along their headings")


def _draw_known(axes: Axes, scans: Sequence[PlacedScan], room: Room, board: Board, known: Room) -> None:
    _draw_surfaces(axes, known, pictures.WALL, 6.0, "wall or post of the room file", 0.35)
    _draw_surfaces(axes, room, pictures.PREDICTED, 1.8, "found wall or post")
    touched = np.vstack([_touched(scan, known, board) for scan in scans])
    axes.plot(*touched.T, ".", color=pictures.MEASURED, ms=5, ls="none", label="touched by sound on its way to an echo")
    axes.set_title(f"beside {pictures.picture_text(known.name)}")


def _touched(scan: PlacedScan, room: Room, board: Board) -> FloatArray:
    """Return where the paths that explain readings touch a room, (n, 2) m."""
    comparison = compare_readings(scan.readings, room, board.faced(scan.place), board)
    paths = comparison.prediction.paths
    points = [paths.outline(row.path)[1:-1] for row in comparison.rows if row.path is not None]
    return np.vstack([np.empty((0, 2)), *points])


def _draw_surfaces(
    axes: Axes, room: Room, colour: str, width: float, label: str, alpha: float = 1.0, style: str = "-"
) -> None:
    """Draw walls and posts of a room, with an entry in the legend."""
    for x0, y0, x1, y1 in room.walls.tolist():
        axes.plot((x0, x1), (y0, y1), style, color=colour, lw=width, alpha=alpha, solid_capstyle="butt")
    for x, y, radius in room.posts.tolist():
        axes.add_patch(Circle((x, y), radius, fill=False, color=colour, lw=width, alpha=alpha, ls=style))
    axes.plot([], [], style, color=colour, lw=width, alpha=alpha, label=label)


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
    for point, away, name in marks:
        spot = point + inch * _NAME_AWAY * away
        if not any((np.abs(spot - other) < inch * _NAME_SIZE).all() for other in written):
            written.append(spot)
            axes.annotate(pictures.picture_text(name), spot.tolist(), ha="center", va="center", fontsize="small")


def _away(wall: FloatArray, sensor: FloatArray) -> FloatArray:
    """Return the unit vector across a wall to the side without the sensor, (2,)."""
    along = wall[2:] - wall[:2]
    normal = np.array([-along[1], along[0]]) / np.hypot(*along)
    return np.asarray(normal if (sensor - wall[:2]) @ normal < 0 else -normal)


def _around(shown: Sequence[FloatArray], margin: float) -> tuple[FloatArray, FloatArray]:
    """Return the corners of a plan of points (k, 2) m, (2,) m each; `margin` is a share of their longer side."""
    points = np.vstack(shown)
    low, high = np.nanmin(points, axis=0), np.nanmax(points, axis=0)
    wider = margin * float((high - low).max())
    return low - wider, high + wider
