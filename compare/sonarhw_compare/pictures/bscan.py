"""The B-scan as arrays: levels by heading and range, one row for each heading."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from sonarhw_sim.board.profile import Board
from sonarhw_sim.predict.predicted_scan import PredictedScan

from sonarhw.readings import FloatArray, Reading, Trace
from sonarhw_compare.pictures.trace_levels import envelope_of, in_db

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
    apart = np.diff(np.sort(headings))
    return min(float(np.quantile(apart, 0.75)), _WIDEST) if len(apart) else _LONE


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
        ping = scan.ping(int(np.abs(np.angle(np.exp(1j * (scan.headings - heading)))).argmin()))
    return trace_row(ping.signal(2 * cells.reach / speed).envelope(), speed, cells)


def difference(measured: BScan, predicted: BScan, floor_db: float | None) -> BScan:
    """Return measured minus predicted levels at every measured heading with a prediction.

    They are in dB, with levels below `floor_db` (of full scale) raised to it. Without a floor, they are amplitudes.
    """
    rows = predicted.rows_at(measured.headings)
    known = np.flatnonzero(rows >= 0)
    levels, expected = measured.levels[known], predicted.levels[rows[known]]
    if floor_db is not None:
        levels, expected = in_db(levels, floor_db), in_db(expected, floor_db)
    return BScan(measured.headings[known], measured.cells, levels - expected, measured.spacing)
