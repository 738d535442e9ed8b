"""The trace of the chosen reading: curves over time, the gain, and every echo with its path.

A stored trace is read from its log and the predicted one is summed, so this runs in a thread.
"""

from dataclasses import dataclass

import numpy as np
from sonarhw_compare.pictures.trace_levels import envelope_of, floor_of, in_db
from sonarhw_sim.air import Air
from sonarhw_sim.board.gain import path_loss_db, stepped_gain_db
from sonarhw_sim.board.profile import Board
from sonarhw_sim.board.traces import Signal
from sonarhw_sim.choices import Receiver
from sonarhw_sim.predict.predicted_scan import Echo, PredictedScan

from sonarhw.readings import FloatArray, Reading, Trace
from sonarhw_gui.scene.scene import Scene

_RF_POINTS = 8  # a period of the carrier, where nothing measured says how many
_CAN_FOLLOW = 2.5  # samples a period; a converter with fewer undersamples
_GAIN_POINTS = 600


@dataclass(frozen=True)
class Curve:
    """Something over time."""

    times: FloatArray  # s since the start of transmission
    values: FloatArray


@dataclass(frozen=True)
class TraceCurves:
    """One trace in both forms."""

    envelope: Curve  # dB of full scale, not under the floor
    rf: Curve | None  # of full scale; None where only the envelope is known
    rate: float  # Hz, of `rf`
    undersampled: bool = False  # `rf` is what a converter too slow for the carrier sees


@dataclass(frozen=True)
class NamedEcho:
    """One predicted echo."""

    time: float  # s
    range: float  # m, as the board would report it
    level_db: float  # of full scale, after the receiver's gain
    via: str
    detectable: bool  # not within blanking
    first: bool  # the one the board reports


@dataclass(frozen=True)
class Gain:
    """What the receiver gives back of what the way takes."""

    curve: Curve  # dB
    stepped: bool


@dataclass(frozen=True)
class ChosenTrace:
    """Everything in the trace view."""

    heading: float  # rad in the room
    speed: float  # m/s, of sound as the reading has it
    measured: TraceCurves | None
    predicted: TraceCurves | None
    echo_times: FloatArray  # s: what the board reported
    echoes: tuple[NamedEcho, ...]
    gain: Gain
    blanking: float  # s
    threshold_db: float
    floor_db: float  # end of the level axis
    duration: float  # s

    def range_at(self, time: float) -> float:
        """The range of an echo that comes at `time`, m."""
        return self.speed * time / 2

    def time_at(self, distance: float) -> float:
        """When an echo of that range (m) comes, s."""
        return 2 * distance / self.speed


def chosen_trace(scene: Scene, reading: Reading, prediction: PredictedScan | None, index: int) -> ChosenTrace:
    """The trace of a reading beside the predicted one at heading `index` of a prediction.

    Raises NotALog where the log that holds the trace can no longer be read.
    """
    board, floor = scene.board, floor_of(scene.board)
    duration = _duration(scene, reading)
    receiver = prediction.receiver if prediction else scene.options.receiver
    air = scene.room.air if scene.room else Air()
    predicted = None
    if prediction is not None:
        predicted = _predicted(prediction.signal_at(index, duration), reading.trace, board, floor)
    return ChosenTrace(
        heading=scene.pose.heading + reading.angle,
        speed=reading.speed_of_sound,
        measured=None if reading.trace is None else _measured(reading.trace, floor),
        predicted=predicted,
        echo_times=np.array(reading.echo_times, dtype=np.float64),
        echoes=() if prediction is None else _echoes(prediction, index, receiver),
        gain=_gain(board, receiver, air.speed_of_sound, duration),
        blanking=board.blanking_end,
        threshold_db=board.threshold_db,
        floor_db=floor,
        duration=duration,
    )


def _duration(scene: Scene, reading: Reading) -> float:
    if reading.trace is None or not len(reading.trace.samples):
        return 2 * scene.board.max_range / reading.speed_of_sound
    return float(reading.trace.times[-1])


def _measured(trace: Trace, floor: float) -> TraceCurves:
    envelope = Curve(trace.times, in_db(envelope_of(trace), floor))
    return TraceCurves(envelope, Curve(trace.times, trace.samples) if trace.carrier else None, trace.rate)


def _predicted(signal: Signal, measured: Trace | None, board: Board, floor: float) -> TraceCurves:
    """The predicted trace; where the carrier was measured, its carrier as the same converter sees it."""
    whole = signal.envelope()
    envelope = Curve(whole.times, in_db(whole.samples, floor))
    carrier = measured is not None and measured.carrier
    rate = measured.rate if measured is not None and carrier else _RF_POINTS * board.frequency
    undersampled = rate < _CAN_FOLLOW * board.frequency
    samples = signal.sampled(rate) if undersampled else signal.rf(rate)
    return TraceCurves(envelope, Curve(np.arange(len(samples)) / rate, samples), rate, undersampled)


def _gain(board: Board, receiver: Receiver, speed: float, duration: float) -> Gain:
    if is_stepped(board, receiver):
        ends = np.array([0.0, *(time for time in board.gain_steps if time < duration), duration])
        levels = stepped_gain_db((ends[:-1] + ends[1:]) / 2, board)
        return Gain(Curve(np.repeat(ends, 2)[1:-1], np.repeat(levels, 2)), True)
    times = np.linspace(duration / _GAIN_POINTS, duration, _GAIN_POINTS)
    return Gain(Curve(times, path_loss_db(times * speed, board)), False)


def is_stepped(board: Board, receiver: Receiver) -> bool:
    """Whether the gain of that receiver rises in steps; else it is the ideal one."""
    return receiver is Receiver.BOARD and bool(board.gain_steps)


def _echoes(prediction: PredictedScan, index: int, receiver: Receiver) -> tuple[NamedEcho, ...]:
    heard, blanked = prediction.echoes(index), prediction.blanked_echoes(index)
    reported = int(prediction.winners[index])
    named = [_named(prediction, echo, receiver, True, echo.path == reported) for echo in heard]
    return tuple(named + [_named(prediction, echo, receiver, False, False) for echo in blanked])


def _named(prediction: PredictedScan, echo: Echo, receiver: Receiver, detectable: bool, first: bool) -> NamedEcho:
    board, length = prediction.board, float(prediction.apparent_lengths[echo.path])
    time, level = length / prediction.room.air.speed_of_sound, echo.level_db
    if is_stepped(board, receiver):
        # levels are told after the ideal gain
        level += float(stepped_gain_db(np.array([time]), board)[0] - path_loss_db(np.array([length]), board)[0])
    via = ">".join(prediction.paths.via(echo.path, prediction.room))
    return NamedEcho(time, echo.range, level, via, detectable, first)
