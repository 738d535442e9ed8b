"""The trace of the selected reading with every echo and its path, and the B-scan as pixels, both for background jobs.

The rows of a B-scan are computed in slices of time, so that newer jobs do not wait.
"""

import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from sonarhw_compare import pictures
from sonarhw_sim.air import Air, Receiver
from sonarhw_sim.board.profile import Board, path_loss_db, stepped_gain_db
from sonarhw_sim.board.signal import Signal, is_stepped
from sonarhw_sim.predict.predicted_scan import Echo, PredictedScan, arm
from sonarhw_sim.predict.prediction import predict_scan

from sonarhw.errors import SonarError
from sonarhw.readings import FloatArray, Reading, Trace, angle_difference
from sonarhw_gui.model.edits import room_and_place
from sonarhw_gui.model.look import Palette
from sonarhw_gui.model.scene import Scene

if TYPE_CHECKING:
    from matplotlib.colors import Colormap

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
class ChosenTrace:
    """The content of the trace view."""

    heading: float  # rad in the room
    speed: float  # speed of sound of the reading, m/s
    measured: TraceCurves | None
    predicted: TraceCurves | None
    echo_times: FloatArray  # s, as reported by the board
    echoes: tuple[NamedEcho, ...]
    gain: Curve  # of the receiver, dB: it compensates the loss along the path
    stepped_gain: bool  # whether the gain has steps
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
    board, floor = scene.board, pictures.floor_of(scene.board)
    air = scene.room.air if scene.room else Air()
    speed = air.speed_of_sound if reading is None else reading.speed_of_sound
    recorded = None if reading is None else reading.trace
    duration = _duration(scene, recorded, speed)
    receiver = prediction.receiver if prediction else scene.options.receiver_of(scene.board)
    predicted, heading = None, scene.pose.heading + (0.0 if reading is None else board.turned(reading.angle))
    if prediction is not None:
        predicted = _predicted(prediction.ping(index).signal(duration), recorded, board, floor)
        if reading is None or prediction.poses is not None:
            heading = float(prediction.headings[index])
    return ChosenTrace(
        heading=heading,
        speed=speed,
        measured=None if recorded is None else _measured(recorded, floor),
        predicted=predicted,
        echo_times=np.array(() if reading is None else reading.echo_times, dtype=np.float64),
        echoes=() if prediction is None else _echoes(prediction, index, receiver),
        gain=_gain(board, receiver, air.speed_of_sound, duration),
        stepped_gain=is_stepped(board, receiver),
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
    envelope = Curve(trace.times, pictures.in_db(pictures.envelope_of(trace), floor))
    return TraceCurves(envelope, Curve(trace.times, trace.samples) if trace.carrier else None, trace.rate)


def _predicted(signal: Signal, measured: Trace | None, board: Board, floor: float) -> TraceCurves:
    """Return the predicted trace; its carrier is sampled as the measured one, if there is one."""
    whole = signal.envelope()
    envelope = Curve(whole.times, pictures.in_db(whole.samples, floor))
    carrier = measured is not None and measured.carrier
    rate = measured.rate if measured is not None and carrier else _RF_POINTS * board.frequency
    undersampled = rate < _ENOUGH_SAMPLES * board.frequency
    samples = signal.sampled(rate) if undersampled else signal.rf(rate)
    return TraceCurves(envelope, Curve(np.arange(len(samples)) / rate, samples), rate, undersampled)


def _gain(board: Board, receiver: Receiver, speed: float, duration: float) -> Curve:
    if is_stepped(board, receiver):
        ends = np.array([0.0, *(time for time in board.gain_steps if time < duration), duration])
        levels = stepped_gain_db((ends[:-1] + ends[1:]) / 2, board)
        return Curve(np.repeat(ends, 2)[1:-1], np.repeat(levels, 2))
    times = np.linspace(duration / _GAIN_POINTS, duration, _GAIN_POINTS)
    return Curve(times, path_loss_db(times * speed, board))


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


def trace_at(scene: Scene, outline: PredictedScan, heading: float) -> tuple[PredictedScan, ChosenTrace]:
    """Predict one heading (rad in the room) of a scene with a room from its outline; return that and its trace.

    The nearest sensor answers if the board is a ring. This takes some milliseconds, with a mount or a blocking face
    seconds.
    """
    room, _ = room_and_place(scene)
    headings = np.array([heading])
    if scene.board.ring is not None:
        sensors = scene.board.ring.headings(scene.pose)
        headings = sensors[[np.argmin(np.abs(angle_difference(sensors, heading)))]]
    prediction = predict_scan(room, scene.pose, scene.board, headings, scene.options, outline.paths)
    return prediction, chosen_trace(scene, None, prediction, 0)


_SAMPLE = 0.004  # m between samples of a predicted envelope, in warm air


@dataclass(frozen=True)
class BScanRows:
    """The rows computed so far, by `heading_key`."""

    board: Board
    cells: pictures.RangeCells
    traced: bool  # whether measured rows come from traces; else from echo times
    outline: PredictedScan | None  # the prediction of the predicted rows
    measured: Mapping[int, tuple[Reading, FloatArray]] = field(default_factory=dict)  # the levels are (cells,)
    predicted: Mapping[int, FloatArray] = field(default_factory=dict)
    done: float = 0.0  # share of all rows
    unreadable: str = ""  # error of the last unreadable trace

    def images(self) -> tuple[pictures.BScan, pictures.BScan]:
        """Return the measured and the predicted B-scan."""
        measured = pictures.bscan_of({key: levels for key, (_, levels) in self.measured.items()}, self.cells)
        # until all rows are there, those of a coarse picture are as wide as the gaps between them
        spacing = None if self.outline is None or self.done < 1.0 else pictures.row_width(self.outline.headings)
        return measured, pictures.bscan_of(self.predicted, self.cells, spacing)


def more_rows(
    scene: Scene, readings: tuple[Reading, ...], outline: PredictedScan | None, before: BScanRows | None, slice_: float
) -> BScanRows:
    """Return the rows of `before` that are still valid, and new rows computed within `slice_` s, at least one.

    A trace that cannot be read leaves a gap.
    """
    until = time.monotonic() + slice_
    zero = scene.pose.heading
    wanted = pictures.newest_by_heading(readings, scene.board, zero)
    rows = _still_valid(before, scene.board, wanted, outline)
    rows = _measured_rows(rows, wanted, until)
    headings = {} if outline is None else _predicted_headings(outline, wanted, zero)
    if outline is not None:
        rows = _predicted_rows(rows, outline, headings, until)
    expected = len(wanted) + len(headings)
    return replace(rows, done=(len(rows.measured) + len(rows.predicted)) / expected if expected else 1.0)


def _still_valid(
    before: BScanRows | None, board: Board, wanted: Mapping[int, Reading], outline: PredictedScan | None
) -> BScanRows:
    traced = next((reading for reading in wanted.values() if reading.trace is not None), None)
    if before is None or before.board is not board or before.traced != (traced is not None):
        return BScanRows(board, _cells(board, traced), traced is not None, outline)
    if before.outline is not outline:
        return replace(before, outline=outline, predicted={})
    return before


def _cells(board: Board, traced: Reading | None) -> pictures.RangeCells:
    """Return cells up to the end of the traces; without traces, up to the maximum range of the board."""
    if traced is None or traced.trace is None:
        return pictures.cells_for(board.max_range, _SAMPLE)
    try:
        metres = traced.speed_of_sound / 2
        return pictures.cells_for(float(traced.trace.times[-1]) * metres, max(_SAMPLE, metres / traced.trace.rate))
    except SonarError:
        return pictures.cells_for(board.max_range, _SAMPLE)


def _predicted_headings(outline: PredictedScan, wanted: Mapping[int, Reading], zero: float) -> dict[int, float]:
    """Return the headings to predict, rad, by key: those of the outline, and those of the readings if possible."""
    along = (
        {}
        if outline.only_at is not None
        else {key: zero + outline.board.turned(reading.angle) for key, reading in wanted.items()}
    )
    return {pictures.heading_key(heading): heading for heading in outline.headings.tolist()} | along


def _measured_rows(rows: BScanRows, wanted: Mapping[int, Reading], until: float) -> BScanRows:
    before = ((key, rows.measured.get(key)) for key in wanted)
    computed = {key: row for key, row in before if row is not None and row[0] is wanted[key]}
    unreadable = rows.unreadable
    for key in _coarse_first([key for key in wanted if key not in computed]):
        try:
            levels = _measured_row(wanted[key], rows)
        except SonarError as error:
            levels, unreadable = pictures.echo_row((), rows.cells), str(error)
        computed[key] = wanted[key], levels
        if time.monotonic() > until:
            break
    return replace(rows, measured=computed, unreadable=unreadable)


def _measured_row(reading: Reading, rows: BScanRows) -> FloatArray:
    if rows.traced:
        trace = reading.trace
        return (
            pictures.echo_row((), rows.cells)
            if trace is None
            else pictures.trace_row(trace, reading.speed_of_sound, rows.cells)
        )
    return pictures.echo_row(reading.echo_ranges, rows.cells)


def _predicted_rows(rows: BScanRows, outline: PredictedScan, headings: Mapping[int, float], until: float) -> BScanRows:
    computed = {key: rows.predicted[key] for key in headings if key in rows.predicted}
    for key in _coarse_first([key for key in headings if key not in computed]):
        if time.monotonic() > until:
            break
        computed[key] = pictures.predicted_row(outline, headings[key], rows.cells)
    return replace(rows, predicted=computed)


def _coarse_first(keys: Sequence[int]) -> list[int]:
    """Return row keys (n,) in an order of which every beginning is spread evenly: halves, quarters, eighths …"""
    digits = len(keys).bit_length()
    order = sorted(range(len(keys)), key=lambda k: f"{k:0{digits}b}"[::-1])
    in_order = sorted(keys)
    return [in_order[k] for k in order]


BScanPixels = NDArray[np.uint8]  # (height, width, 4), lowest row first; transparent where there is no value
COLOURS = 256
SLICE = 0.1  # s
_SIDE = 1200  # pixels of a polar picture
_TURN = round(math.tau / pictures.SAME_HEADING)  # columns of a rectangular picture
_DIFFERENCE_DB = 30.0
_DIFFERENCE = 0.5  # of full scale


class Pane(Enum):
    """What a B-scan shows."""

    MEASURED = "Recorded"  # by a scanner or a program: the origin is in the legend
    PREDICTED = "Predicted"
    DIFFERENCE = "Difference"


@dataclass(frozen=True)
class BScanSettings:
    """The panes of the B-scan that are visible, and how they are drawn."""

    panes: tuple[Pane, ...]
    polar: bool
    decibels: bool


@dataclass(frozen=True)
class ColourScale:
    """The colours of the levels from `low` to `high`."""

    colours: NDArray[np.uint8]  # (COLOURS, 4)
    low: float
    high: float
    label: str  # with its unit

    def of(self, values: FloatArray) -> NDArray[np.uint32]:
        """Return the colour of every value, same shape, RGBA in one integer; 0 (transparent) for NaN."""
        steps = (values - self.low) * ((COLOURS - 1) / (self.high - self.low))
        unknown = np.isnan(steps)
        rows = np.where(unknown, 0.0, steps).clip(0, COLOURS - 1).astype(np.intp)
        return np.asarray(np.where(unknown, np.uint32(0), self.colours.view(np.uint32)[rows, 0]))


@dataclass(frozen=True)
class BScans:
    """The part of the B-scan that is computed so far."""

    settings: BScanSettings
    rows: BScanRows
    measured: pictures.BScan
    predicted: pictures.BScan
    pictures: Mapping[Pane, tuple[BScanPixels, ColourScale]]


@lru_cache(maxsize=16)
def colour_scale(pane: Pane, decibels: bool, floor_db: float, palette: Palette) -> ColourScale:
    """Return the colours of one pane; those of the difference go from predicted over the background to measured."""
    # the import takes half a second, so it waits for the first picture
    from matplotlib import colormaps
    from matplotlib.colors import LinearSegmentedColormap

    if pane is not Pane.DIFFERENCE:
        colours = _bytes(colormaps["cividis"])
        if decibels:
            return ColourScale(colours, floor_db, 0.0, "dB of full scale")
        return ColourScale(colours, 0.0, 1.0, "of full scale")
    named = [palette.predicted, palette.paper, palette.measured]
    colours = _bytes(LinearSegmentedColormap.from_list("difference", named))
    if decibels:
        return ColourScale(colours, -_DIFFERENCE_DB, _DIFFERENCE_DB, "difference (dB)")
    return ColourScale(colours, -_DIFFERENCE, _DIFFERENCE, "difference (of full scale)")


def _bytes(colours: "Colormap") -> NDArray[np.uint8]:
    return np.asarray(colours(np.linspace(0, 1, COLOURS), bytes=True), dtype=np.uint8)


@dataclass(frozen=True)
class Arm:
    """Geometry of a polar picture: the transducer is mounted on an arm that turns about the place."""

    ahead: float = 0.0  # m, in front of the axis
    left: float = 0.0  # m, to the left of the axis

    def reach(self, range_: float) -> float:
        """Return the distance of a range from the axis, m."""
        return math.hypot(self.ahead + range_, self.left)

    def points(self, headings: FloatArray, ranges: FloatArray) -> FloatArray:
        """Return the points at these headings and ranges, relative to the axis, (n, 2) float, m."""
        cosines, sines, along = np.cos(headings), np.sin(headings), self.ahead + ranges
        return np.column_stack((along * cosines - self.left * sines, along * sines + self.left * cosines))

    def headings_and_ranges(self, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return headings, rad, and ranges, m, of points x, y (m) relative to the axis, of the same shape.

        NaN for a point that no heading covers.
        """
        with np.errstate(invalid="ignore"):
            along = np.sqrt(x**2 + y**2 - self.left**2)
        return np.arctan2(y, x) - np.arctan2(self.left, along), along - self.ahead


def draw_bscan(bscan: pictures.BScan, scale: ColourScale, floor_db: float | None, polar: Arm | None) -> BScanPixels:
    """Return the picture of one pane: a full turn of headings by range, or polar with heading 0 to the right.

    The colour of each level is looked up before the pixels are placed, so half a million pixels take milliseconds.
    """
    coloured = scale.of(bscan.levels if floor_db is None else pictures.in_db(bscan.levels, floor_db))
    rows = bscan.rows_at(pictures.SAME_HEADING * np.arange(_TURN, dtype=np.float64))
    # an additional transparent row for gaps: index -1 selects it
    coloured = np.vstack((coloured, np.zeros((1, bscan.cells.count), dtype=np.uint32)))
    if polar is not None:
        headings, cells = _polar_lookup(bscan.cells, polar)
        beyond = np.concatenate((rows, [-1])) % len(coloured)
        pixels = np.take(coloured.reshape(-1), np.take(beyond * bscan.cells.count, headings) + cells)
        pixels = pixels.reshape(_SIDE, _SIDE)
    else:
        pixels = coloured[rows].T
    return np.ascontiguousarray(pixels).view(np.uint8).reshape(*pixels.shape, 4)


@lru_cache(maxsize=1)  # 11 MB
def _polar_lookup(cells: pictures.RangeCells, arm: Arm) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Return column (0 to _TURN - 1, or _TURN outside) and cell of every pixel of a polar picture, both flattened."""
    along = ((np.arange(_SIDE) + 0.5) / _SIDE * 2 - 1) * arm.reach(cells.reach)
    directions, ranges = arm.headings_and_ranges(*np.meshgrid(along, along))
    drawn = (ranges >= 0) & (ranges < cells.reach)
    headings = np.full(drawn.shape, _TURN, dtype=np.int32)
    headings[drawn] = np.round(np.mod(directions[drawn], math.tau) / pictures.SAME_HEADING) % _TURN
    number = np.zeros(drawn.shape, dtype=np.int32)
    number[drawn] = (ranges[drawn] / cells.width).clip(0, cells.count - 1)
    return headings.ravel(), number.ravel()


def flat_area(cells: pictures.RangeCells) -> tuple[float, float, float, float]:
    """Return the area of a rectangular picture (left, bottom, width, height): left and width in degrees, else m."""
    return -180.0 / _TURN, 0.0, 360.0, cells.reach


def polar_area(cells: pictures.RangeCells, middle: tuple[float, float], arm: Arm) -> tuple[float, float, float, float]:
    """Return the area of a polar picture around `middle` in the room (left, bottom, width, height), m."""
    reach = arm.reach(cells.reach)
    return middle[0] - reach, middle[1] - reach, 2 * reach, 2 * reach


def bscan_slice(
    scene: Scene,
    readings: tuple[Reading, ...],
    outline: PredictedScan | None,
    settings: BScanSettings,
    palette: Palette,
    before: BScanRows | None,
) -> BScans:
    """Compute rows for `SLICE` s after those computed before for this scan, and draw all rows so far."""
    rows = more_rows(scene, readings, outline, before, SLICE)
    measured, predicted = rows.images()
    drawn = {pane: _drawn(scene.board, pane, settings, palette, measured, predicted) for pane in settings.panes}
    return BScans(settings, rows, measured, predicted, drawn)


def _drawn(
    board: Board,
    pane: Pane,
    settings: BScanSettings,
    palette: Palette,
    measured: pictures.BScan,
    predicted: pictures.BScan,
) -> tuple[BScanPixels, ColourScale]:
    floor = pictures.floor_of(board)
    scale = colour_scale(pane, settings.decibels, floor, palette)
    floor_db = floor if settings.decibels else None
    polar = Arm(*arm(board)) if settings.polar else None
    if pane is Pane.DIFFERENCE:
        return draw_bscan(pictures.difference(measured, predicted, floor_db), scale, None, polar), scale
    image = measured if pane is Pane.MEASURED else predicted
    return draw_bscan(image, scale, floor_db, polar), scale
