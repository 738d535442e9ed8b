"""The certainty grid: how sure it is that each cell is empty or occupied, after readings taken for cones.

Takes scans from known places; hands on a `CertaintyGrid` (Moravec and Elfes, High Resolution Maps from Wide Angle
Sonar, 1985). A reading makes what lies before its range within ±15° emptier, and what lies at its range fuller; sound
that was reflected on its way makes both where neither is true. Silence says nothing here: a wall at a slant is silent.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from compare.fit.result import PlacedScan
from sim.board import Board
from sim.by_heading import standpoints
from sim.models import CONE_HALF_ANGLE
from sonarhw.readings import FloatArray

BoolArray = NDArray[np.bool_]

CELL = 0.02  # m
DEPTH = 0.05  # m: how far before and behind its range a reading may have met something
_MARGIN = 0.2  # m round the farthest reading
_MOST_CELLS = 1200  # along a side


@dataclass(frozen=True)
class CertaintyGrid:
    """Square cells, row by row from the lower left corner."""

    left: float  # m
    bottom: float  # m
    cell: float  # m
    empty: FloatArray  # (rows, columns): certainty 0..1 that there is nothing
    occupied: FloatArray  # (rows, columns): certainty 0..1 that there is something

    @property
    def certainty(self) -> FloatArray:
        """-1 surely empty .. 0 unknown .. 1 surely occupied, (rows, columns): whichever is surer (their eq. 7)."""
        return np.where(self.occupied >= self.empty, self.occupied, -self.empty)

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """Left, right, bottom and top, m."""
        rows, columns = self.empty.shape
        return self.left, self.left + columns * self.cell, self.bottom, self.bottom + rows * self.cell

    def at(self, points: FloatArray) -> FloatArray:
        """Certainty at points (n, 2) m, (n,); 0 outside."""
        column, row = np.floor((points - (self.left, self.bottom)) / self.cell).astype(int).T
        rows, columns = self.empty.shape
        inside = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
        return np.where(inside, self.certainty[np.clip(row, 0, rows - 1), np.clip(column, 0, columns - 1)], 0.0)


def headings_and_ranges(scan: PlacedScan, board: Board) -> tuple[FloatArray, FloatArray]:
    """Where each reading pointed, rad in the room, and its range, m, NaN where there is no echo; (n,) each."""
    headings = [board.heading_at(reading.angle, scan.place.heading) for reading in scan.readings]
    ranges = [np.nan if reading.range is None else reading.range for reading in scan.readings]
    return np.array(headings, dtype=np.float64), np.array(ranges, dtype=np.float64) - board.range_offset


def certainty_grid(
    scans: Sequence[PlacedScan], board: Board, kept: Sequence[BoolArray], cell: float | None = None
) -> CertaintyGrid:
    """The grid after every reading of the scans that is `kept` ((n,) bool for each), cells of `cell` (m)."""
    stands, headings, ranges = _cones(scans, board, kept)
    ends = stands + ranges[:, None] * np.column_stack((np.cos(headings), np.sin(headings)))
    corners = np.vstack((stands, ends, *(np.array([scan.place.position]) for scan in scans)))
    low, high = corners.min(axis=0) - _MARGIN, corners.max(axis=0) + _MARGIN
    cell = max(CELL, float((high - low).max()) / _MOST_CELLS) if cell is None else cell
    columns, rows = np.ceil((high - low) / cell).astype(int)
    x = low[0] + (np.arange(columns) + 0.5) * cell
    y = low[1] + (np.arange(rows) + 0.5) * cell
    empty, occupied = np.zeros((rows, columns)), np.zeros((rows, columns))
    # all that is empty first: what must be occupied is then looked for in what is left (their section 4)
    for (sx, sy), heading, distance in zip(stands.tolist(), headings.tolist(), ranges.tolist(), strict=True):
        window, away, aside = _cone(x, y, sx, sy, heading, distance)
        before = np.clip(1 - (away / max(distance - DEPTH, 1e-9)) ** 2, 0.0, 1.0) * (away < distance - DEPTH) * aside
        empty[window] += before * (1 - empty[window])
    for (sx, sy), heading, distance in zip(stands.tolist(), headings.tolist(), ranges.tolist(), strict=True):
        window, away, aside = _cone(x, y, sx, sy, heading, distance)
        there = np.clip(1 - ((away - distance) / DEPTH) ** 2, 0.0, 1.0) * aside * (1 - empty[window])
        whole = there.sum()
        if whole > 0:
            # one thing made the echo: certainties along the arc make one together
            there = there / whole
            occupied[window] += there * (1 - occupied[window])
    most = occupied.max(initial=0.0)
    return CertaintyGrid(float(low[0]), float(low[1]), cell, empty, occupied / most if most else occupied)


def _cones(
    scans: Sequence[PlacedScan], board: Board, kept: Sequence[BoolArray]
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Where the readings with an echo were taken (n, 2), where they point (n,), and how far they go (n,)."""
    stands, directions, distances = [], [], []
    for scan, wanted in zip(scans, kept, strict=True):
        headings, ranges = headings_and_ranges(scan, board)
        use = wanted & ~np.isnan(ranges)
        stands.append(standpoints(board, scan.place, headings[use]))
        directions.append(headings[use])
        distances.append(ranges[use])
    return np.vstack(stands), np.concatenate(directions), np.concatenate(distances)


def _cone(
    x: FloatArray, y: FloatArray, sx: float, sy: float, heading: float, distance: float
) -> tuple[tuple[slice, slice], FloatArray, FloatArray]:
    """The window of cells in reach, how far each is away, and how much the cone has there: 1 on its axis, 0 beside."""
    reach = distance + DEPTH
    rows = slice(*np.searchsorted(y, (sy - reach, sy + reach)).tolist())
    columns = slice(*np.searchsorted(x, (sx - reach, sx + reach)).tolist())
    dx, dy = x[columns][None, :] - sx, y[rows][:, None] - sy
    away = np.hypot(dx, dy)
    angle = np.remainder(np.arctan2(dy, dx) - heading + np.pi, 2 * np.pi) - np.pi
    return (rows, columns), away, np.clip(1 - (angle / CONE_HALF_ANGLE) ** 2, 0.0, 1.0)
