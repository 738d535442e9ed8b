"""The B-scan as arrays: traces side by side, one row a heading, in cells of range.

Takes traces, echo times or a prediction; hands on rows of levels and, of many rows, a frozen `BScan` with its axes.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from sonarhw_sim.predict.predicted_scan import PredictedScan

from sonarhw.readings import FloatArray, Reading, Trace
from sonarhw_compare.pictures.trace_levels import envelope_of, in_db

CELLS = 600  # of range at most; finer ones would not be seen
SAME_HEADING = math.radians(0.25)  # headings closer than this share a row; no beam is as narrow
MOST_READINGS = 3600  # the newest are drawn; an hour of traces is more than a memory holds
_WIDEST = math.radians(60.0)  # of a row
_LONE = math.radians(5.0)  # width of a row with no neighbour
_HAIR = 1.01  # wider than a sample, so that no cell is empty by rounding


@dataclass(frozen=True)
class RangeCells:
    """The range axis: cells of one width, from 0 on."""

    width: float  # m
    count: int

    @property
    def reach(self) -> float:
        """Where the last one ends, m."""
        return self.width * self.count

    @property
    def middles(self) -> FloatArray:
        """The middle of each, (count,) float, m."""
        return np.asarray((np.arange(self.count) + 0.5) * self.width)

    def loudest(self, ranges: FloatArray, levels: FloatArray) -> FloatArray:
        """The highest of the levels (k,) in each cell, (count,) float; NaN where none lies."""
        row = np.full(self.count, np.nan)
        cells = np.floor(ranges / self.width).astype(np.intp)
        inside = (cells >= 0) & (cells < self.count)
        np.fmax.at(row, cells[inside], levels[inside])
        return row


def cells_for(reach: float, sample: float) -> RangeCells:
    """Cells up to `reach` m, none narrower than a `sample` is apart from the next, m."""
    count = max(1, min(CELLS, math.floor(reach / (sample * _HAIR))))
    return RangeCells(reach / count, count)


@dataclass(frozen=True)
class BScan:
    """Levels over heading and range."""

    headings: FloatArray  # (n,), rad in the room, from 0 up to below 2π, ascending
    cells: RangeCells
    levels: FloatArray  # (n, cells.count), amplitude, 1 is full scale; NaN where nothing is known
    spacing: float  # rad: how wide a row is; what no row covers is a gap

    def row_at(self, heading: float) -> int | None:
        """The row that covers a heading (rad); None in a gap."""
        rows = self.rows_at(np.array([heading]))
        return int(rows[0]) if rows[0] >= 0 else None

    def level_at(self, heading: float, distance: float) -> float | None:
        """The amplitude at a heading (rad) and range (m); None where nothing is known."""
        row, cell = self.row_at(heading), math.floor(distance / self.cells.width)
        if row is None or not 0 <= cell < self.cells.count or math.isnan(self.levels[row, cell]):
            return None
        return float(self.levels[row, cell])

    def rows_at(self, headings: FloatArray) -> NDArray[np.intp]:
        """The row nearest to each heading, (k,) int; -1 in a gap."""
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
    """Rows by `heading_key` as an image; how wide they are is seen from most of them unless it is given."""
    keys = sorted(rows)
    headings = np.array(keys) * SAME_HEADING
    levels = np.array([rows[key] for key in keys]).reshape(len(keys), cells.count)
    return BScan(headings, cells, levels, row_width(headings) if spacing is None else spacing)


def heading_key(heading: float) -> int:
    """The same number for headings (rad) of one row."""
    return round(heading / SAME_HEADING) % round(math.tau / SAME_HEADING)


def row_width(headings: FloatArray) -> float:
    """How far most headings (n,) are from the next, rad; a few that are missing make no difference."""
    apart = np.diff(np.sort(headings))
    return min(float(np.quantile(apart, 0.75)), _WIDEST) if len(apart) else _LONE


def newest_by_heading(readings: Sequence[Reading], zero: float) -> dict[int, Reading]:
    """The newest reading of each heading among the last of `readings`; `zero` is where step 0 points, rad."""
    return {heading_key(zero + reading.angle): reading for reading in readings[-MOST_READINGS:]}


def trace_row(trace: Trace, speed_of_sound: float, cells: RangeCells) -> FloatArray:
    """The loudest of a trace in each cell, (cells.count,) float; NaN beyond its ends and where samples were lost."""
    return cells.loudest(trace.times * speed_of_sound / 2, envelope_of(trace))


def echo_row(ranges: Iterable[float], cells: RangeCells) -> FloatArray:
    """What is known without a trace, (cells.count,) float: 1 in the cells of echoes, NaN in all others."""
    told = np.array([*ranges], dtype=np.float64)
    return cells.loudest(told, np.ones(len(told)))


def predicted_row(scan: PredictedScan, heading: float, cells: RangeCells) -> FloatArray:
    """The predicted trace along a heading (rad) as `trace_row`: any one, or one of the scan's if each has its paths."""
    speed = scan.room.air.speed_of_sound
    duration = 2 * cells.reach / speed
    if scan.only_at is None:
        signal = replace(scan, headings=np.array([heading])).signal_at(0, duration)
    else:
        signal = scan.signal_at(int(np.abs(np.angle(np.exp(1j * (scan.headings - heading)))).argmin()), duration)
    return trace_row(signal.envelope(), speed, cells)


def difference(measured: BScan, predicted: BScan, floor_db: float | None) -> BScan:
    """Measured less predicted at every measured heading that is predicted too.

    In dB, levels under `floor_db` (of full scale) counting as that; without a floor as amplitudes.
    """
    rows = predicted.rows_at(measured.headings)
    known = np.flatnonzero(rows >= 0)
    heard, expected = measured.levels[known], predicted.levels[rows[known]]
    if floor_db is not None:
        heard, expected = in_db(heard, floor_db), in_db(expected, floor_db)
    return BScan(measured.headings[known], measured.cells, heard - expected, measured.spacing)
