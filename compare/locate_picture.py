"""The picture of where a scan may have been taken: how well each position agrees, and the most probable poses.

Takes a `Located`; hands on a matplotlib figure that the caller saves.
"""

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from compare.colours import MEASURED, PREDICTED
from compare.locate import Located, Pose
from compare.picture import draw_room
from compare.points import points_at

_DEEPEST = 12.0  # of the logarithm: what is less probable by more is drawn as if it were that
_MOST_POSES = 5
_ARROW = 0.09  # of the room's longer side


def draw_located(located: Located) -> Figure:
    """A figure of the room: the lattice shaded by its posterior, the poses as arrows, the scan laid over the best."""
    figure = Figure(figsize=(8, 7), dpi=120, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    _shade(axes, figure, located)
    draw_room(axes, located.room)
    for name, place in located.room.places.items():
        axes.annotate(name, place.position, color="black", alpha=0.6, ha="center", va="center")
    best = located.poses[0]
    heard = [reading for reading in located.readings if reading.range is not None]
    headings = np.array([located.board.heading_at(reading.angle, best.heading) for reading in heard])
    ranges = np.array([float(reading.range or 0) + best.offset for reading in heard])
    axes.plot(*points_at(best.position, headings, ranges).T, ".", color=MEASURED, ms=6, label="scan, at the best pose")
    for pose in located.poses[:_MOST_POSES]:
        _draw_pose(axes, pose, _ARROW * float(np.ptp(located.room.walls.reshape(-1, 2), axis=0).max()))
    axes.set(xlabel="x (m)", ylabel="y (m)", title=f"{located.room.name}: where the scan was taken")
    axes.set_aspect("equal")
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.08))
    return figure


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


def _draw_pose(axes: Axes, pose: Pose, length: float) -> None:
    x, y = pose.position
    tip = x + length * math.cos(pose.heading), y + length * math.sin(pose.heading)
    arrow = {"arrowstyle": "-|>", "color": PREDICTED, "lw": 2, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", tip, (x, y), arrowprops=arrow)
    axes.plot(x, y, "^", color=PREDICTED, ms=8)
    axes.annotate(f"{pose.probability:.0%}", (x, y), (6, -12), textcoords="offset points", color=PREDICTED)
