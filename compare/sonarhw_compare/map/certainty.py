"""Occupancy grid from readings as cones (Moravec and Elfes, High Resolution Maps from Wide Angle Sonar, 1985).

A reading raises the certainty that cells in front of its range within ±15° are empty, and that cells at its range are
occupied. For multipath echoes, both are wrong. Readings without an echo are ignored, because an oblique wall returns
none.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from sonarhw_sim.board.profile import Board, of_own_body
from sonarhw_sim.compiled import compiled, compiled_part
from sonarhw_sim.predict.predicted_scan import standpoints
from sonarhw_sim.predict.prediction import CONE_HALF_ANGLE

from sonarhw.readings import BoolArray, FloatArray
from sonarhw_compare.fit.values.fit_result import PlacedScan

CELL = 0.02  # m
DEPTH = 0.05  # m, uncertainty of the range of a reading, to each side
_MARGIN = 0.2  # m around the farthest reading
_MOST_CELLS = 1200  # along a side
_RIM = math.tan(CONE_HALF_ANGLE)


@dataclass(frozen=True)
class CertaintyGrid:
    """Square cells, row by row from the lower left corner."""

    left: float  # m
    bottom: float  # m
    cell: float  # m
    empty: FloatArray  # (rows, columns), certainty 0..1 that a cell is empty
    occupied: FloatArray  # (rows, columns), certainty 0..1 that a cell is occupied

    @property
    def certainty(self) -> FloatArray:
        """The larger certainty (their eq. 7), (rows, columns): -1 is empty, 0 unknown, 1 occupied."""
        return np.where(self.occupied >= self.empty, self.occupied, -self.empty)

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """Left, right, bottom and top, m."""
        rows, columns = self.empty.shape
        return self.left, self.left + columns * self.cell, self.bottom, self.bottom + rows * self.cell

    def at(self, points: FloatArray) -> FloatArray:
        """Return the certainty at points (n, 2) m, (n,); 0 outside."""
        column, row = np.floor((points - (self.left, self.bottom)) / self.cell).astype(int).T
        rows, columns = self.empty.shape
        inside = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
        return np.where(inside, self.certainty[np.clip(row, 0, rows - 1), np.clip(column, 0, columns - 1)], 0.0)


def headings_and_ranges(scan: PlacedScan, board: Board) -> tuple[FloatArray, FloatArray]:
    """Return the heading of each reading, rad in the room, and its range, m, NaN for no echo of the room; (n,) each."""
    headings = [board.heading_at(reading.angle, scan.place.heading) for reading in scan.readings]
    ranges = np.array([np.nan if reading.range is None else reading.range for reading in scan.readings])
    ranges[of_own_body(board.own_body, scan.readings)] = np.nan
    return np.array(headings, dtype=np.float64), board.true_ranges(ranges)


def certainty_grid(
    scans: Sequence[PlacedScan], board: Board, kept: Sequence[BoolArray], cell: float | None = None
) -> CertaintyGrid:
    """Return the grid from all readings that are `kept` ((n,) bool for each scan), in cells of `cell` (m)."""
    positions, headings, ranges = _cones(scans, board, kept)
    ends = positions + ranges[:, None] * np.column_stack((np.cos(headings), np.sin(headings)))
    corners = np.vstack((positions, ends, *(np.array([scan.place.position]) for scan in scans)))
    low, high = corners.min(axis=0) - _MARGIN, corners.max(axis=0) + _MARGIN
    cell = max(CELL, float((high - low).max()) / _MOST_CELLS) if cell is None else cell
    columns, rows = np.ceil((high - low) / cell).astype(int)
    empty, occupied = np.zeros((rows, columns)), np.zeros((rows, columns))
    # first all empty cells; occupied cells are then among the others (their section 4)
    for mark in (_mark_empty, _mark_occupied):
        for (x, y), heading, distance in zip(
            (positions - low).tolist(), headings.tolist(), ranges.tolist(), strict=True
        ):
            mark(empty, occupied, cell, x, y, heading, distance)
    most = occupied.max(initial=0.0)
    return CertaintyGrid(float(low[0]), float(low[1]), cell, empty, occupied / most if most else occupied)


def _cones(
    scans: Sequence[PlacedScan], board: Board, kept: Sequence[BoolArray]
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return positions (n, 2), headings (n,) and ranges (n,) of the readings with an echo."""
    positions, directions, distances = [], [], []
    for scan, wanted in zip(scans, kept, strict=True):
        headings, ranges = headings_and_ranges(scan, board)
        use = wanted & ~np.isnan(ranges)
        positions.append(standpoints(board, board.faced(scan.place), headings[use]))
        directions.append(headings[use])
        distances.append(ranges[use])
    return np.vstack(positions), np.concatenate(directions), np.concatenate(distances)


@compiled_part
def _window(shape: tuple[int, int], cell: float, x: float, y: float, reach: float) -> tuple[int, int, int, int]:
    """Return first and last row and column of the cells within reach of a point; the last ones are excluded."""
    low_row, high_row = int((y - reach) / cell), int((y + reach) / cell) + 1
    low_column, high_column = int((x - reach) / cell), int((x + reach) / cell) + 1
    return max(0, low_row), min(shape[0], high_row), max(0, low_column), min(shape[1], high_column)


@compiled_part
def _seen(cell: float, row: int, column: int, x: float, y: float, heading: float) -> tuple[float, float]:
    """Return the distance of a cell, m, and the weight of the cone there: 1 on its axis, 0 from its rim on."""
    dx, dy = (column + 0.5) * cell - x, (row + 0.5) * cell - y
    ahead, aside = dx * math.cos(heading) + dy * math.sin(heading), dy * math.cos(heading) - dx * math.sin(heading)
    if ahead <= 0.0 or abs(aside) >= ahead * _RIM:
        return 0.0, 0.0
    return math.hypot(ahead, aside), 1.0 - (math.atan2(aside, ahead) / CONE_HALF_ANGLE) ** 2


@compiled
def _mark_empty(
    empty: FloatArray, _occupied: FloatArray, cell: float, x: float, y: float, heading: float, distance: float
) -> None:
    """Raise the certainty of empty cells in front of the range; x, y are in m from the corner of the grid."""
    before = distance - DEPTH
    first_row, last_row, first_column, last_column = _window(empty.shape, cell, x, y, before)
    for row in range(first_row, last_row):
        for column in range(first_column, last_column):
            away, share = _seen(cell, row, column, x, y, heading)
            if share > 0.0 and away < before:
                empty[row, column] += share * (1.0 - (away / before) ** 2) * (1.0 - empty[row, column])


@compiled
def _mark_occupied(
    empty: FloatArray, occupied: FloatArray, cell: float, x: float, y: float, heading: float, distance: float
) -> None:
    """Raise the certainty of occupied cells at the range. One object made the echo, so its arc adds 1 in all."""
    first_row, last_row, first_column, last_column = _window(empty.shape, cell, x, y, distance + DEPTH)
    there = np.zeros((max(0, last_row - first_row), max(0, last_column - first_column)))
    for row in range(first_row, last_row):
        for column in range(first_column, last_column):
            away, share = _seen(cell, row, column, x, y, heading)
            off = (away - distance) / DEPTH
            if share > 0.0 and abs(off) < 1.0:
                there[row - first_row, column - first_column] = share * (1.0 - off**2) * (1.0 - empty[row, column])
    whole = there.sum()
    if whole > 0.0:
        for row in range(first_row, last_row):
            for column in range(first_column, last_column):
                more = there[row - first_row, column - first_column] / whole
                occupied[row, column] += more * (1.0 - occupied[row, column])
