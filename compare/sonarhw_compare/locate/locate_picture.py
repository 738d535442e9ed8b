"""Picture of the posterior over positions and of the most probable poses, as a matplotlib figure."""

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke
from sonarhw_sim.predict.predicted_scan import standpoints
from sonarhw_sim.room.room import Place

from sonarhw_compare.locate.poses import NEAR, Located, Pose
from sonarhw_compare.pictures.colours import MEASURED, PREDICTED
from sonarhw_compare.pictures.labels import names_by_position
from sonarhw_compare.pictures.overlay_picture import draw_heading, draw_room, mark_sensors
from sonarhw_compare.pictures.picture_text import picture_text
from sonarhw_compare.pictures.points import points_at
from sonarhw_compare.pictures.shown_figure import laid_out, new_figure

_DEEPEST = 12.0  # of the logarithm, lower end of the shading
_MOST_POSES = 5
_MARGIN = 0.05  # around the room, of the axes
_ARROW = 0.09  # of the room's longer side
_BESIDE, _ABOVE = 8, 14  # points, from a mark to its text: beside it, and above or below it


def draw_located(located: Located) -> Figure:
    """Return a figure of the room with the posterior of the lattice, the poses as arrows, and the scan at the best."""
    figure = new_figure(8, 7, 120)
    axes = figure.add_subplot()
    _shade(axes, figure, located)
    draw_room(axes, located.room)
    best = located.poses[0]
    echoes = [reading for reading in located.readings if reading.range is not None]
    board, place = located.board, Place("", best.position, best.heading)
    headings = np.array([board.heading_at(reading.angle, best.heading) for reading in echoes])
    sensors = standpoints(board, board.faced(place), headings)
    ranges = np.array([float(reading.range or 0) + best.offset for reading in echoes])
    axes.plot(*points_at(sensors, headings, ranges).T, ".", color=MEASURED, ms=6, label="scan, at the best pose")
    _draw_places(axes, located)
    for pose in located.poses[:_MOST_POSES]:
        _draw_pose(axes, pose, _ARROW * float(np.ptp(located.room.walls.reshape(-1, 2), axis=0).max()))
    mark_sensors(axes, np.empty((0, 2)), color=PREDICTED, label="probable pose, turntable step 0 along the arrow")
    axes.set(xlabel="x (m)", ylabel="y (m)", title=f"{picture_text(located.room.name)}: where the scan was taken")
    axes.set_aspect("equal")
    # the image would limit the axes to the walls
    axes.use_sticky_edges = False
    axes.margins(_MARGIN)
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.08))
    return laid_out(figure)


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
    figure.colorbar(shown, ax=axes, shrink=0.7, label="natural logarithm of the probability, best position 0")


def _draw_places(axes: Axes, located: Located) -> None:
    """Draw the places of the room, each with its name behind the arrow of the pose found there."""
    label = "place"
    for position, names in names_by_position(located.room.places.values()).items():
        at = [pose for pose in located.poses[:_MOST_POSES] if math.dist(pose.position, position) <= NEAR]
        axes.plot(*position, "+", color="black", alpha=0.6, ms=6, label=label)
        label = ""  # one entry in the legend
        _write_beside(axes, names, position, at[0].heading + math.pi if at else math.pi, "black")


def _write_beside(axes: Axes, text: str, position: tuple[float, float], towards: float, color: str) -> None:
    right, up = math.cos(towards), math.sin(towards)
    side = "center" if abs(right) < 0.5 else "left" if right > 0 else "right"
    shift = (_BESIDE * right, _ABOVE * up)
    halo = [withStroke(linewidth=2.5, foreground="white")]
    axes.annotate(
        text, position, shift, textcoords="offset points", color=color, ha=side, va="center", path_effects=halo
    )


def _draw_pose(axes: Axes, pose: Pose, length: float) -> None:
    draw_heading(axes, pose.position, pose.heading, length, PREDICTED)
    mark_sensors(axes, pose.position, label="", color=PREDICTED)
    _write_beside(axes, f"{pose.probability:.0%}", pose.position, pose.heading - math.pi / 2, PREDICTED)
