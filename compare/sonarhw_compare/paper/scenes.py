"""What an exhibit of the paper is: its rooms and places, its claims, and how its parts are drawn."""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise
from typing import Literal, TypeAlias

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from sonarhw_sim.air import EdgeStrength, Model, Receiver, Unit
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.predict.predicted_scan import PredictedScan
from sonarhw_sim.predict.prediction import PredictionOptions, predict_with
from sonarhw_sim.room.room import load_room

from sonarhw.readings import ScanOrder, headings_between, points_at
from sonarhw_compare.drawings import draw_room, mark_sensors
from sonarhw_compare.pictures import MEASURED, PREDICTED, WALL

# A scene: one predicted scan of one figure, described by the options of the command line.
#
# A scene names an included room, a place and a board. Its scan is predicted once and cached.


_KEPT = 512  # scans that are cached; the claims and figures, with those of the tests, have about 300


@dataclass(frozen=True)
class PredictedReading:
    """The reading of the board at one heading."""

    degrees: float
    range: float | None  # m; None: no echo
    via: tuple[str, ...]  # walls, posts and edges on the path of the sound


@dataclass(frozen=True)
class PaperScene:
    """The room, place, headings, board and options of one scan."""

    room: str  # a file of rooms/, without its suffix
    place: str  # a name in the room, or X,Y
    degrees: tuple[float, float, float]  # from, to, step
    board: str = "paper"
    unit: Unit = Unit.PASS
    receiver: Receiver | None = None  # None: that of the board
    model: Model = Model.RAY_FOLLOWING
    edge_strength: EdgeStrength | None = None  # None: that of the board
    seed: int | None = None
    noise: float = 0.0  # of the trace, root mean square; 1 is full scale
    reach: float | None = None  # largest range, m; None: that of the board

    @property
    def scan(self) -> PredictedScan:
        """The predicted scan."""
        return _scan(self)

    @property
    def readings(self) -> tuple[PredictedReading, ...]:
        """The predicted readings, in order of heading."""
        return _readings(self)

    @property
    def command(self) -> str:
        """The command that predicts the same scan."""
        start, stop, step = self.degrees
        words = ["sonarhw simulate", f"rooms/{self.room}.toml", f"--place {self.place}", f"--board {self.board}"]
        words.append(f"--from {start:g} --to {stop:g} --step {step:g}")
        for option, value, default in (
            ("unit", self.unit, Unit.PASS),
            ("receiver", self.receiver, None),
            ("edge-strength", self.edge_strength, None),
            ("model", self.model, Model.RAY_FOLLOWING),
            ("seed", self.seed, None),
        ):
            if value != default:
                words.append(f"--{option} {value}")
        if self.reach is not None:
            words.append(f"  # here only to {self.reach:g} m")
        return " ".join(words)

    def at(self, degrees: float) -> PredictedReading:
        """Return the reading at one of the headings."""
        return next(reading for reading in self.readings if math.isclose(reading.degrees, degrees, abs_tol=1e-6))

    def readings_via(self, *via: str) -> list[PredictedReading]:
        """Return the readings whose path touches exactly these things in this order."""
        return [reading for reading in self.readings if reading.via == via]


@lru_cache(maxsize=_KEPT)
def _scan(scene: PaperScene) -> PredictedScan:
    room, board = load_room(scene.room), load_board(scene.board)
    if scene.reach is not None:
        board = replace(board, max_range=scene.reach)
    start, stop, step = scene.degrees
    order = ScanOrder(math.radians(start), math.radians(step), headings_between(start, stop, step))
    options = PredictionOptions(
        unit=scene.unit,
        edge_strength=scene.edge_strength,
        receiver=scene.receiver,
        noise=scene.noise,
        seed=scene.seed,
    )
    return predict_with(scene.model, room, room.place(scene.place), board, order.angles(), options)


@lru_cache(maxsize=_KEPT)
def _readings(scene: PaperScene) -> tuple[PredictedReading, ...]:
    scan = scene.scan
    rows = zip(scan.headings, scan.ranges, scan.winners, strict=True)
    return tuple(
        PredictedReading(
            round(math.degrees(heading), 6),
            None if math.isnan(distance) else float(distance),
            scan.paths.via(int(winner), scan.room) if winner >= 0 else (),
        )
        for heading, distance, winner in rows
    )


def ranges(readings: Iterable[PredictedReading]) -> list[float]:
    """Return the ranges of the readings that have an echo, m."""
    return [reading.range for reading in readings if reading.range is not None]


def span(readings: Sequence[PredictedReading]) -> str:
    """Return the first and last heading of the readings as text."""
    if not readings:
        return "no heading"
    first, last = readings[0].degrees, readings[-1].degrees
    return f"{first:g}°" if first == last else f"{first:g} to {last:g}°"


# An exhibit: one figure of the paper, drawn again, with the claims of its text.
#
# A claim is checked by a function of scenes; the scenes of the figure are its defaults. It returns what the model
# shows and whether the claim holds. With other scenes (another unit, another place) the claim can fail, which the
# tests check.


@dataclass(frozen=True)
class Claim:
    """A statement of the paper, what the model shows, and whether they agree."""

    says: str
    measured: str
    holds: bool


@dataclass(frozen=True)
class Exhibit:
    """A figure of the paper."""

    name: str  # of its picture, without the suffix
    title: str
    setting: str  # the setup, and which parts of it are from the paper
    scenes: tuple[PaperScene, ...]  # the scans in the picture
    draw: Callable[[], Figure]
    claims: tuple[Callable[[], Claim], ...]


# Drawing functions that the pictures share: figures, colours, and a scan in the plan of its room.
#
# The colours are those of all other pictures, by Okabe and Ito.


GREEN = "#009E73"
ORANGE = "#E69F00"
Bounds: TypeAlias = tuple[float, float, float, float]  # left, right, bottom, top, m
Corner: TypeAlias = Literal["upper left", "upper center", "upper right", "lower left", "center left"]


def sheet(width: float, height: float) -> Figure:
    """Return an empty figure; width and height in inches."""
    figure = Figure(figsize=(width, height), dpi=110, layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def plan(axes: Axes, scene: PaperScene, title: str, bounds: Bounds, legend: Corner = "upper left") -> None:
    """Draw the room within `bounds` (left, right, bottom, top; m), the sensor, and the scan over it."""
    draw_room(axes, scene.scan.room)
    points(axes, scene, "predicted")
    mark_sensors(axes, scene.scan.place.position)
    finish_plan(axes, title, bounds, legend)


def points(
    axes: Axes, scene: PaperScene, label: str, colour: str = PREDICTED, marker: str = "o", size: float = 4.5
) -> None:
    """Draw each reading at its range along its heading, and join neighbours with the same path."""
    scan = scene.scan
    where = points_at(scan.standpoints, scan.headings, scan.ranges)
    axes.plot(*where.T, marker, mfc="none", mec=colour, ms=size, label=label)
    for here, there in pairwise(range(len(where))):
        if scan.winners[here] == scan.winners[there] >= 0 or _same_wall(scene, here, there):
            axes.plot(*where[[here, there]].T, "-", color=colour, lw=1.0)


def _same_wall(scene: PaperScene, index: int, other: int) -> bool:
    first, second = scene.readings[index], scene.readings[other]
    return first.via == second.via != () and first.range == second.range


def mark_silence(axes: Axes, scene: PaperScene, radius: float) -> None:
    """Mark headings without an echo by ticks around the sensor at `radius` (m)."""
    scan = scene.scan
    silent = scan.headings[np.isnan(scan.ranges)]
    away = np.full(len(silent), radius)
    ends = [points_at(scan.place.position, silent, away * part) for part in (0.85, 1.0)]
    for k, (inner, outer) in enumerate(zip(*ends, strict=True)):
        label = "heading without an echo" if k == 0 else None
        axes.plot(*np.array([inner, outer]).T, "-", color=MEASURED, lw=1.2, label=label)


def finish_plan(axes: Axes, title: str, bounds: Bounds, legend: Corner) -> None:
    """Set scale, labels and legend of a plan; `legend` is a location in matplotlib's terms."""
    left, right, bottom, top = bounds
    axes.set(xlabel="x (m)", ylabel="y (m)", xlim=(left, right), ylim=(bottom, top))
    axes.set_title(title, fontsize=11)
    axes.set_aspect("equal")
    axes.grid(alpha=0.25)
    axes.legend(loc=legend, fontsize=8, framealpha=0.9)


def note(axes: Axes, text: str, point: tuple[float, float], beside: tuple[float, float]) -> None:
    """Write text beside a point of a picture, with a line to the point; data units."""
    axes.annotate(
        text,
        point,
        beside,
        fontsize=9,
        ha="center",
        va="center",
        arrowprops={"arrowstyle": "-", "lw": 0.8, "color": "black"},
        bbox={"boxstyle": "round,pad=0.2", "fc": "white", "ec": "none", "alpha": 0.85},
        zorder=6,
    )


def label_walls(axes: Axes, scene: PaperScene, names: Sequence[str], with_reflectance: bool = False) -> None:
    """Write names along walls, on the side away from the sensor."""
    room, sensor = scene.scan.room, np.array(scene.scan.place.position)
    for name in names:
        row = room.names.index(name)
        start, end = room.walls[row].reshape(2, 2)
        along = (end - start) / np.hypot(*(end - start))
        aside = np.array([-along[1], along[0]])
        if aside @ (sensor - start) > 0:
            aside = -aside
        tilt = (np.degrees(np.arctan2(along[1], along[0])) + 90) % 180 - 90
        text = f"{name}, reflectance {room.reflectances[row]:g}" if with_reflectance else name
        middle = (start + end) / 2
        axes.annotate(
            text,
            middle,
            xytext=tuple(aside * 14),
            textcoords="offset points",
            rotation=tilt,
            fontsize=9,
            color=WALL,
            ha="center",
            va="center",
        )
