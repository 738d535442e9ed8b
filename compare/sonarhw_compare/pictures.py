"""Parts of pictures without Matplotlib: B-scans, colours, shading, points and levels of traces."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from sonarhw_sim.air import ROOM_TOLERANCE
from sonarhw_sim.board.profile import Board
from sonarhw_sim.predict.predicted_scan import PredictedScan
from sonarhw_sim.predict.prediction import PredictionOptions
from sonarhw_sim.predict.probability import PossibleReading, possible_readings, scan_with_fainter_paths

from sonarhw.errors import harmless, shortened
from sonarhw.readings import FloatArray, Reading, Trace, angle_difference

# The palette of Okabe and Ito: each meaning has one colour, on paper and in the window.


PREDICTED = "#0072B2"
MEASURED = "#D55E00"
WALL = "#555555"
SHORT = "#A0578A"
LONG = "#009E73"
EXTRA = "#E69F00"
MISSED = "#56B4E9"
OWN_BODY = "#999999"


# Names of rooms and places as text in a picture. matplotlib interprets text between dollar signs as a formula.


_MOST = 100  # characters, so that the plot is not squeezed


def picture_text(name: str) -> str:
    """Return a name as matplotlib must get it to draw it as it is; of a long name the begin and the end."""
    return shortened(harmless(name), _MOST).replace("$", r"\$")


# Shading of the ranges that a board may report: the more opaque, the more probable.


_CELLS = 400  # along the range
_UNLIKELY = 0.02  # less probable ranges may be beyond the image
_COLUMNS = 360  # headings in a picture


@dataclass(frozen=True)
class RangeShading:
    """Opacities by heading and range; at the middle of a possible echo, the opacity is its probability."""

    headings: FloatArray  # (n,), rad, evenly spaced all round
    opacities: FloatArray  # (n, m), 0 to 1; columns are cells of range from 0 up to `reach`
    reach: float  # m


def shading_around(
    prediction: PredictedScan,
    options: PredictionOptions | None = None,
    *,
    pings: int = 1,
    room_tolerance: float = ROOM_TOLERANCE,
) -> RangeShading:
    """Return the shading all round the sensor of a prediction with `options`.

    Readings are medians of an odd number of `pings`. `room_tolerance` (m) is the standard deviation of the position of
    each wall. Raises InputError.
    """
    headings = np.arange(_COLUMNS) * 2 * np.pi / _COLUMNS
    scan = scan_with_fainter_paths(prediction.room, prediction.place, prediction.board, headings, options)
    return shading_of([possible_readings(scan, index, pings, room_tolerance) for index in range(_COLUMNS)], headings)


def shading_of(possible: Sequence[Sequence[PossibleReading]], headings: FloatArray) -> RangeShading:
    """Return the shading of the possible readings at each of `headings` (n,), rad, evenly spaced all round."""
    far = [
        reading.range
        for readings in possible
        for reading in readings
        if reading.range and reading.probability > _UNLIKELY
    ]
    reach = 1.05 * max(far, default=1.0)  # slightly beyond all that are likely
    middles = (np.arange(_CELLS) + 0.5) * reach / _CELLS
    return RangeShading(headings, np.array([_opacities(readings, middles) for readings in possible]), reach)


def _opacities(readings: Sequence[PossibleReading], middles: FloatArray) -> FloatArray:
    """Return the opacity of cells with these `middles` (m,), m: bells as high as their probability."""
    cell = middles[1] - middles[0]
    opacities = np.zeros(len(middles))
    for reading in readings:
        if reading.range is not None:
            away = (middles - reading.range) / max(reading.spread, cell)
            opacities += reading.probability * np.exp(-(away**2) / 2)
    return np.asarray(np.minimum(opacities, 1.0))


# Levels of traces for pictures: envelopes, in dB of full scale.


_BELOW_THRESHOLD_DB = 12.0  # lower end of level axes; the noise of an 8-bit converter is above it


def floor_of(board: Board) -> float:
    """Return the lower end of level axes, dB of full scale."""
    return board.threshold_db - _BELOW_THRESHOLD_DB


def in_db(amplitudes: FloatArray, floor_db: float) -> FloatArray:
    """Return amplitudes in dB of full scale, at least `floor_db`; NaN stays NaN."""
    return np.asarray(20 * np.log10(np.maximum(np.abs(amplitudes), 10 ** (floor_db / 20))))


def envelope_of(trace: Trace) -> FloatArray:
    """Return the envelope of a trace, (n,) float, 0..1, NaN if lost; of a carrier, that of its analytic signal."""
    if not trace.carrier:
        return trace.samples
    from scipy.fftpack import hilbert  # slow to load; scipy.signal also has it, but takes longer

    lost = np.isnan(trace.samples)
    samples = np.where(lost, 0.0, trace.samples)
    envelope = np.hypot(samples, hilbert(samples))
    return np.where(lost, np.nan, np.minimum(envelope, 1.0))


# The B-scan as arrays: levels by heading and range, one row for each heading.


CELLS = 600  # of range, at most; finer ones would not be visible
SAME_HEADING = math.radians(0.25)  # closer headings share a row; every beam is wider
MOST_READINGS = 3600  # only the newest are drawn, because an hour of traces does not fit into memory
_WIDEST = math.radians(60.0)  # largest width of a row
_LONE = math.radians(5.0)  # width of a row with no neighbour
_HAIR = 1.01  # least width of a cell in samples, so that no cell is empty by rounding


@dataclass(frozen=True)
class RangeCells:
    """The range axis: cells of equal width, from 0."""

    width: float  # m
    count: int

    @property
    def reach(self) -> float:
        """The end of the last cell, m."""
        return self.width * self.count

    @property
    def middles(self) -> FloatArray:
        """The middle of each cell, (count,) float, m."""
        return np.asarray((np.arange(self.count) + 0.5) * self.width)

    def loudest(self, ranges: FloatArray, levels: FloatArray) -> FloatArray:
        """Return the highest of the levels (k,) in each cell, (count,) float; NaN in empty cells."""
        row = np.full(self.count, np.nan)
        cells = np.floor(ranges / self.width).astype(np.intp)
        inside = (cells >= 0) & (cells < self.count)
        np.fmax.at(row, cells[inside], levels[inside])
        return row


def cells_for(reach: float, sample: float) -> RangeCells:
    """Return cells up to `reach` m, none narrower than the spacing of samples, `sample` m."""
    count = max(1, min(CELLS, math.floor(reach / (sample * _HAIR))))
    return RangeCells(reach / count, count)


@dataclass(frozen=True)
class BScan:
    """Levels by heading and range."""

    headings: FloatArray  # (n,) rad in the room, in [0, 2π), ascending
    cells: RangeCells
    levels: FloatArray  # (n, cells.count), amplitude, 1 is full scale; NaN if unknown
    spacing: float  # rad, width of a row; headings outside all rows are gaps

    def row_at(self, heading: float) -> int | None:
        """Return the row of a heading (rad); None in a gap."""
        rows = self.rows_at(np.array([heading]))
        return int(rows[0]) if rows[0] >= 0 else None

    def level_at(self, heading: float, distance: float) -> float | None:
        """Return the amplitude at a heading (rad) and range (m); None if unknown."""
        row, cell = self.row_at(heading), math.floor(distance / self.cells.width)
        if row is None or not 0 <= cell < self.cells.count or math.isnan(self.levels[row, cell]):
            return None
        return float(self.levels[row, cell])

    def rows_at(self, headings: FloatArray) -> NDArray[np.intp]:
        """Return the row nearest to each heading, (k,) int; -1 in a gap."""
        if not len(self.headings):
            return np.full(len(headings), -1, dtype=np.intp)
        round_ = np.concatenate((self.headings[-1:] - math.tau, self.headings, self.headings[:1] + math.tau))
        wanted = np.mod(headings, math.tau)
        above = np.searchsorted(round_, wanted).clip(1, len(round_) - 1)
        below = above - 1
        nearest = np.where(wanted - round_[below] <= round_[above] - wanted, below, above)
        rows = (nearest - 1) % len(self.headings)
        return np.where(np.abs(round_[nearest] - wanted) <= self.spacing / 2 + SAME_HEADING / 2, rows, -1)


def bscan_of(rows: Mapping[int, FloatArray], cells: RangeCells, spacing: float | None = None) -> BScan:
    """Return rows by `heading_key` as an image; their width is by default that of most steps."""
    keys = sorted(rows)
    headings = np.array(keys) * SAME_HEADING
    levels = np.array([rows[key] for key in keys]).reshape(len(keys), cells.count)
    return BScan(headings, cells, levels, row_width(headings) if spacing is None else spacing)


def heading_key(heading: float) -> int:
    """Return the number of the row of a heading (rad)."""
    return round(heading / SAME_HEADING) % round(math.tau / SAME_HEADING)


def row_width(headings: FloatArray) -> float:
    """Return the usual step between headings (n,), rad; a few missing headings do not change it."""
    steps = np.diff(np.sort(headings))
    return min(float(np.quantile(steps, 0.75)), _WIDEST) if len(steps) else _LONE


def newest_by_heading(readings: Sequence[Reading], board: Board, zero: float) -> dict[int, Reading]:
    """Return the newest reading of each heading; `zero` (rad) is the heading of step 0. Old readings are ignored."""
    return {heading_key(zero + board.turned(reading.angle)): reading for reading in readings[-MOST_READINGS:]}


def trace_row(trace: Trace, speed_of_sound: float, cells: RangeCells) -> FloatArray:
    """Return the maximum of a trace in each cell, (cells.count,) float; NaN outside it and where samples were lost."""
    return cells.loudest(trace.times * speed_of_sound / 2, envelope_of(trace))


def echo_row(ranges: Iterable[float], cells: RangeCells) -> FloatArray:
    """Return a row for a reading without trace, (cells.count,) float: 1 in the cells of echoes, NaN in all others."""
    echoes = np.array([*ranges], dtype=np.float64)
    return cells.loudest(echoes, np.ones(len(echoes)))


def predicted_row(scan: PredictedScan, heading: float, cells: RangeCells) -> FloatArray:
    """Return the predicted trace along a heading (rad) in the form of `trace_row`.

    If each heading has its own paths, it is the trace of the nearest heading of the scan.
    """
    speed = scan.room.air.speed_of_sound
    if scan.only_at is None:
        ping = replace(scan, headings=np.array([heading])).ping(0)
    else:
        ping = scan.ping(int(np.abs(angle_difference(scan.headings, heading)).argmin()))
    return trace_row(ping.signal(2 * cells.reach / speed).envelope(), speed, cells)


def difference(measured: BScan, predicted: BScan, floor_db: float | None) -> BScan:
    """Return measured minus predicted levels at every measured heading with a prediction.

    They are in dB, with levels below `floor_db` (of full scale) raised to it. Without a floor, they are amplitudes.
    """
    rows = predicted.rows_at(measured.headings)
    filled = np.flatnonzero(rows >= 0)
    levels, expected = measured.levels[filled], predicted.levels[rows[filled]]
    if floor_db is not None:
        levels, expected = in_db(levels, floor_db), in_db(expected, floor_db)
    return BScan(measured.headings[filled], measured.cells, levels - expected, measured.spacing)
