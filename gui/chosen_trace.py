"""The trace of the chosen reading as the trace view draws it: curves over range, in dB of full scale, and echoes.

Takes what is shown; hands on a frozen `ChosenTrace`, or None where nothing is chosen.
"""

import math
from dataclasses import dataclass

import numpy as np

from gui.scene import Scene
from gui.shown import Shown
from sim.air import Air
from sim.predicted_scan import Echo, PredictedScan
from sonarhw.readings import FloatArray, Reading, Trace

_BELOW_THRESHOLD_DB = 12.0  # the axis ends there; the noise of a converter of 8 bits lies above


@dataclass(frozen=True)
class Curve:
    """One trace."""

    ranges: FloatArray  # m
    levels: FloatArray  # dB of full scale, not under the floor


@dataclass(frozen=True)
class NamedEcho:
    """One predicted echo."""

    range: float  # m
    level_db: float
    via: str
    heard: bool  # not within blanking
    first: bool  # the one the board reports


@dataclass(frozen=True)
class ChosenTrace:
    """Everything in the trace view."""

    heading: float  # rad in the room
    measured: Curve | None
    predicted: Curve | None
    echoes: tuple[NamedEcho, ...]
    blanking: float  # m
    threshold_db: float
    floor_db: float  # end of the level axis
    reach: float  # m, end of the range axis


def chosen_trace(shown: Shown) -> ChosenTrace | None:
    """The trace of the chosen reading; summing the predicted one takes a millisecond or so."""
    reading, row, prediction, scene = shown.chosen_reading, shown.chosen_row, shown.prediction, shown.scene
    if reading is None:
        return None
    floor = scene.board.threshold_db - _BELOW_THRESHOLD_DB
    measured = None if reading.trace is None else _curve(reading.trace, reading.speed_of_sound, floor)
    reach = _reach(scene, reading)
    predicted: Curve | None = None
    echoes: tuple[NamedEcho, ...] = ()
    if row is not None and prediction is not None:
        speed = prediction.room.air.speed_of_sound
        predicted = _curve(prediction.signal_at(row.index, 2 * reach / speed).envelope(), speed, floor)
        echoes = _echoes(prediction, row.index)
    return ChosenTrace(
        heading=scene.standing.heading + reading.angle,
        measured=measured,
        predicted=predicted,
        echoes=echoes,
        blanking=scene.board.blanked_range(scene.room.air if scene.room else Air()),
        threshold_db=scene.board.threshold_db,
        floor_db=floor,
        reach=reach,
    )


def _reach(scene: Scene, reading: Reading) -> float:
    if reading.trace is None or not len(reading.trace.samples):
        return scene.board.max_range
    return float(reading.trace.times[-1]) * reading.speed_of_sound / 2


def _curve(trace: Trace, speed_of_sound: float, floor: float) -> Curve:
    with np.errstate(divide="ignore"):
        levels = 20 * np.log10(np.abs(trace.samples))
    return Curve(trace.times * speed_of_sound / 2, np.maximum(levels, floor))


def _echoes(prediction: PredictedScan, index: int) -> tuple[NamedEcho, ...]:
    heard, blanked = prediction.echoes(index), prediction.blanked_echoes(index)
    named = [_named(prediction, echo, True, echo is heard[0]) for echo in heard]
    return tuple(named + [_named(prediction, echo, False, False) for echo in blanked])


def _named(prediction: PredictedScan, echo: Echo, heard: bool, first: bool) -> NamedEcho:
    via = ">".join(prediction.paths.via(echo.path, prediction.room))
    return NamedEcho(echo.range, echo.level_db, via, heard, first)


def degrees_text(heading: float) -> str:
    """A heading as people read it."""
    return f"{math.degrees(heading) % 360:.1f}°"
