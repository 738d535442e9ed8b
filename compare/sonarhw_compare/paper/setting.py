"""A scene: one predicted scan of one figure, described by the options of the command line.

A scene names an included room, a place and a board. Its scan is predicted once and cached.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

from sonarhw_sim.air import EdgeStrength, Model, Receiver, Unit
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.predict.predicted_scan import PredictedScan
from sonarhw_sim.predict.prediction import PredictionOptions, predict_with
from sonarhw_sim.room.room import load_room

from sonarhw.readings import ScanOrder, headings_between

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
        if self.noise:
            words.append(f"  # here with noise of {self.noise:g} in the trace")
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
