"""The trace of the selected reading: curves over time, the gain, and every echo with its path.

It reads a stored trace from its log and computes the predicted one, so it runs in a thread.
"""

from dataclasses import dataclass

import numpy as np
from sonarhw_compare.pictures import envelope_of, floor_of, in_db
from sonarhw_sim.air import Air, Receiver
from sonarhw_sim.board.profile import Board
from sonarhw_sim.board.signal import Signal, is_stepped, path_loss_db, stepped_gain_db
from sonarhw_sim.predict.predicted_scan import Echo, PredictedScan
from sonarhw_sim.predict.prediction import predict_scan

from sonarhw.readings import FloatArray, Reading, Trace
from sonarhw_gui.scene.scene import Scene
from sonarhw_gui.scene.scene_edit import room_and_place

_RF_POINTS = 8  # samples per period of the carrier, without a measured trace
_ENOUGH_SAMPLES = 2.5  # samples per period; with fewer the carrier is undersampled
_GAIN_POINTS = 600


@dataclass(frozen=True)
class Curve:
    """Values over time."""

    times: FloatArray  # s since the start of transmission
    values: FloatArray


@dataclass(frozen=True)
class TraceCurves:
    """One trace as its envelope and with its carrier."""

    envelope: Curve  # dB of full scale, not below the floor
    rf: Curve | None  # of full scale; None if only the envelope was recorded
    rate: float  # Hz, of `rf`
    undersampled: bool = False  # whether `rf` is sampled too slowly for the carrier, and folded (aliased)


@dataclass(frozen=True)
class NamedEcho:
    """One predicted echo."""

    time: float  # s
    range: float  # m, as the board reports it
    level_db: float  # of full scale, after the receiver's gain
    via: str
    detectable: bool  # after blanking
    first: bool  # the echo that the board reports
    summed: bool  # whether the level is that of all arrivals within one wavelength


@dataclass(frozen=True)
class Gain:
    """The gain of the receiver, which compensates the loss along the path."""

    curve: Curve  # dB
    stepped: bool


@dataclass(frozen=True)
class ChosenTrace:
    """The content of the trace view."""

    heading: float  # rad in the room
    speed: float  # speed of sound of the reading, m/s
    measured: TraceCurves | None
    predicted: TraceCurves | None
    echo_times: FloatArray  # s, as reported by the board
    echoes: tuple[NamedEcho, ...]
    gain: Gain
    blanking: float  # s
    threshold_db: float
    floor_db: float  # end of the level axis
    duration: float  # s

    def range_at(self, time: float) -> float:
        """Return the range of an echo at `time`, m."""
        return self.speed * time / 2

    def time_at(self, distance: float) -> float:
        """Return the time of an echo at this range (m), s."""
        return 2 * distance / self.speed


def chosen_trace(scene: Scene, reading: Reading | None, prediction: PredictedScan | None, index: int) -> ChosenTrace:
    """Return the trace of a reading, if any, and the predicted trace at heading `index` of a prediction.

    Raises NotALog if the log of the trace can no longer be read.
    """
    board, floor = scene.board, floor_of(scene.board)
    air = scene.room.air if scene.room else Air()
    speed = air.speed_of_sound if reading is None else reading.speed_of_sound
    recorded = None if reading is None else reading.trace
    duration = _duration(scene, recorded, speed)
    receiver = prediction.receiver if prediction else scene.options.receiver_of(scene.board)
    predicted, heading = None, scene.pose.heading + (0.0 if reading is None else board.turned(reading.angle))
    if prediction is not None:
        predicted = _predicted(prediction.ping(index).signal(duration), recorded, board, floor)
        heading = heading if reading is not None else float(prediction.headings[index])
    return ChosenTrace(
        heading=heading,
        speed=speed,
        measured=None if recorded is None else _measured(recorded, floor),
        predicted=predicted,
        echo_times=np.array(() if reading is None else reading.echo_times, dtype=np.float64),
        echoes=() if prediction is None else _echoes(prediction, index, receiver),
        gain=_gain(board, receiver, air.speed_of_sound, duration),
        blanking=board.blanking_end,
        threshold_db=board.threshold_db,
        floor_db=floor,
        duration=duration,
    )


def _duration(scene: Scene, trace: Trace | None, speed: float) -> float:
    if trace is None or not len(trace.samples):
        return 2 * scene.board.max_range / speed
    return float(trace.times[-1])


def _measured(trace: Trace, floor: float) -> TraceCurves:
    envelope = Curve(trace.times, in_db(envelope_of(trace), floor))
    return TraceCurves(envelope, Curve(trace.times, trace.samples) if trace.carrier else None, trace.rate)


def _predicted(signal: Signal, measured: Trace | None, board: Board, floor: float) -> TraceCurves:
    """Return the predicted trace; its carrier is sampled as the measured one, if there is one."""
    whole = signal.envelope()
    envelope = Curve(whole.times, in_db(whole.samples, floor))
    carrier = measured is not None and measured.carrier
    rate = measured.rate if measured is not None and carrier else _RF_POINTS * board.frequency
    undersampled = rate < _ENOUGH_SAMPLES * board.frequency
    samples = signal.sampled(rate) if undersampled else signal.rf(rate)
    return TraceCurves(envelope, Curve(np.arange(len(samples)) / rate, samples), rate, undersampled)


def _gain(board: Board, receiver: Receiver, speed: float, duration: float) -> Gain:
    if is_stepped(board, receiver):
        ends = np.array([0.0, *(time for time in board.gain_steps if time < duration), duration])
        levels = stepped_gain_db((ends[:-1] + ends[1:]) / 2, board)
        return Gain(Curve(np.repeat(ends, 2)[1:-1], np.repeat(levels, 2)), True)
    times = np.linspace(duration / _GAIN_POINTS, duration, _GAIN_POINTS)
    return Gain(Curve(times, path_loss_db(times * speed, board)), False)


def _echoes(prediction: PredictedScan, index: int, receiver: Receiver) -> tuple[NamedEcho, ...]:
    ping, reported = prediction.ping(index), int(prediction.winners[index])
    named = [_named(prediction, echo, receiver, True, echo.path == reported) for echo in ping.echoes]
    return tuple(named + [_named(prediction, echo, receiver, False, False) for echo in ping.blanked_echoes])


def _named(prediction: PredictedScan, echo: Echo, receiver: Receiver, detectable: bool, first: bool) -> NamedEcho:
    board, length = prediction.board, float(prediction.apparent_lengths[echo.path])
    time, level = length / prediction.room.air.speed_of_sound, echo.level_db
    if is_stepped(board, receiver):
        # the prediction's levels include the ideal gain
        level += float(stepped_gain_db(np.array([time]), board)[0] - path_loss_db(np.array([length]), board)[0])
    via = ">".join(prediction.paths.via(echo.path, prediction.room))
    return NamedEcho(time, echo.range, level, via, detectable, first, board.sum_arrivals)


@dataclass(frozen=True)
class TraceFound:
    """The traces of a reading."""

    generation: int
    trace: ChosenTrace


@dataclass(frozen=True)
class TraceRequest:
    """Read the trace of a reading and predict it."""

    generation: int
    scene: Scene
    reading: Reading
    prediction: PredictedScan | None
    index: int  # among the prediction's headings

    def answer(self) -> TraceFound:
        """Read and predict the trace; this takes some milliseconds."""
        return TraceFound(self.generation, chosen_trace(self.scene, self.reading, self.prediction, self.index))


@dataclass(frozen=True)
class HeadingAnswered:
    """The prediction at one heading, and its trace."""

    generation: int
    prediction: PredictedScan  # at one heading
    trace: ChosenTrace


@dataclass(frozen=True)
class HeadingAsked:
    """Predict one heading, without a reading."""

    generation: int
    scene: Scene  # with a room
    outline: PredictedScan  # of this scene
    heading: float  # rad in the room; the nearest sensor answers if the board is a ring

    def answer(self) -> HeadingAnswered:
        """Predict; this takes some milliseconds, with a mount or a blocking face seconds."""
        scene, heading = self.scene, np.array([self.heading])
        room, _ = room_and_place(scene)
        if scene.board.ring is not None:
            sensors = scene.board.ring.headings(scene.pose)
            heading = sensors[[np.argmin(np.abs(np.angle(np.exp(1j * (sensors - self.heading)))))]]
        prediction = predict_scan(room, scene.pose, scene.board, heading, scene.options, self.outline.paths)
        return HeadingAnswered(self.generation, prediction, chosen_trace(scene, None, prediction, 0))
