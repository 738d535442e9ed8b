"""A grid of square cells that lists the surfaces in each, so that a large room costs little more than a small one.

`Surfaces` is the input of every kernel that follows rays: walls, posts and grid. Walking along a ray is compiled by
numba.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray
from sonarhw_sim.compiled import compiled_part, inlined

IntArray = NDArray[np.int32]

_MOST_CELLS = 1 << 20
_MOST_LISTED = 1 << 20  # or 16 for each surface, if that is more
_AT_ONCE = 4096  # boxes, so that memory does not grow with the number of cells that they cross
_ONE_CELL = 9  # surfaces: to test so many takes less time than a walk from cell to cell
_MARGIN = 3e-6  # m: a surface that ends on the line between two cells is listed in both


class Cells(NamedTuple):
    """Square cells, row by row from the lower left corner."""

    left: float  # m
    bottom: float  # m
    side: float  # m
    columns: int
    rows: int


class Listing(NamedTuple):
    """The objects in each cell: those of cell c are numbers[starts[c] : starts[c + 1]]."""

    starts: IntArray
    numbers: IntArray


class Surfaces(NamedTuple):
    """All walls and posts with their grid; surfaces are numbered walls first, then posts."""

    walls: FloatArray  # (n, 4): x, y of start and end, m
    posts: FloatArray  # (m, 3): x, y of the centre, radius, m
    cells: Cells
    listing: Listing


class Walk(NamedTuple):
    """The cell of a ray, and the distances to the next cells."""

    inside: bool  # whether it is in a cell
    column: int
    row: int
    column_step: int
    row_step: int
    next_column: float  # m along the ray to the next column
    next_row: float
    per_column: float  # m along the ray from column to column
    per_row: float


def lay_grid(walls: FloatArray, posts: FloatArray) -> Surfaces:
    """Return walls (n, 4) and posts (m, 3) with a grid of about one cell for each."""
    rim = posts[:, 2:]
    boxes = np.vstack((_boxes_of(walls), np.hstack((posts[:, :2] - rim, posts[:, :2] + rim))))
    return Surfaces(walls, posts, *_grid_around(boxes.reshape(-1, 2), boxes, walls))


def only(surfaces: Surfaces, chosen: NDArray[np.bool_]) -> Surfaces:
    """Return surfaces with a grid that lists only the chosen ones, (s,) bool."""
    starts, numbers = surfaces.listing
    kept = chosen[numbers]
    before = np.append(0, np.cumsum(kept)).astype(np.int32)
    return surfaces._replace(listing=Listing(before[starts], numbers[kept]))


def lay_wall_grid(points: FloatArray, walls: FloatArray) -> tuple[Cells, Listing]:
    """Return a grid that covers `points` (p, 2), with the walls (n, 4) that cross each cell."""
    return _grid_around(points, _boxes_of(walls), walls)


def _grid_around(points: FloatArray, boxes: FloatArray, walls: FloatArray) -> tuple[Cells, Listing]:
    """Return about one cell for each of the boxes, but fewer if most boxes cross many cells."""
    count = min(len(boxes), _MOST_CELLS)
    most = max(_MOST_LISTED, 16 * len(boxes))  # the fewest cells are four, so there is always a grid
    while True:
        cells = _cells_around(points, count)
        listing = _list_boxes(cells, boxes, walls, most)
        if listing is not None:
            return cells, listing
        count //= 8


def _cells_around(points: FloatArray, count: int) -> Cells:
    # a section of a room may be empty
    low, high = (points.min(axis=0), points.max(axis=0)) if len(points) else (np.zeros(2), np.zeros(2))
    width, height = np.maximum(high - low, 1e-3)
    if count <= _ONE_CELL:
        side = 2 * max(width, height)
        return Cells(float(low[0] - side / 4), float(low[1] - side / 4), float(side), 1, 1)
    # a long narrow room has a single row of square cells
    count = max(1, count)
    side = max(math.sqrt(width * height / count), max(width, height) / count)
    columns, rows = math.ceil(width / side) + 1, math.ceil(height / side) + 1
    return Cells(float(low[0] - side / 2), float(low[1] - side / 2), float(side), columns, rows)


def list_points(cells: Cells, points: FloatArray, reach: float | FloatArray) -> Listing:
    """Return, for each cell, the points (n, 2) within `reach` of it: m, or (n, 1) m, one for each point."""
    listing = _list_boxes(cells, np.hstack((points - reach, points + reach)), np.empty((0, 4)), math.inf)
    assert listing is not None
    return listing


def cells_at(cells: Cells, points: FloatArray) -> NDArray[np.intp]:
    """Return the number of the cell of each point (p, 2), which must be within the extent of the cells."""
    column = ((points[:, 0] - cells.left) / cells.side).astype(np.intp)
    return np.asarray(((points[:, 1] - cells.bottom) / cells.side).astype(np.intp) * cells.columns + column)


def _boxes_of(walls: FloatArray) -> FloatArray:
    return np.hstack((np.minimum(walls[:, :2], walls[:, 2:]), np.maximum(walls[:, :2], walls[:, 2:])))


def _list_boxes(cells: Cells, boxes: FloatArray, walls: FloatArray, most: float) -> Listing | None:
    """Return the boxes in each cell; boxes (n, 4) are x, y of the lower left and of the upper right corner.

    The first boxes are those of `walls` (w, 4), which are listed only in the cells that the wall itself crosses. The
    result is None if more than `most` numbers would be listed.
    """
    parts, count = [], 0
    for first in range(0, len(boxes) or 1, _AT_ONCE):
        chosen = np.arange(first, min(first + _AT_ONCE, len(boxes)))
        parts.append(_cells_of(cells, chosen, boxes, walls))
        count += len(parts[-1][0])
        if count > most:
            return None
    # of surfaces at equal distances, the one listed first is hit: the last
    cell, number = (np.concatenate(column)[::-1] for column in zip(*parts, strict=True))
    starts = np.zeros(cells.columns * cells.rows + 1, np.int32)
    np.cumsum(np.bincount(cell, minlength=len(starts) - 1), out=starts[1:])
    return Listing(starts, number[np.argsort(cell, kind="stable")])


def _cells_of(
    cells: Cells, chosen: NDArray[np.intp], boxes: FloatArray, walls: FloatArray
) -> tuple[IntArray, IntArray]:
    """Return the cells of the boxes with these numbers, and the number of the box of each."""
    first, last = _span(cells.left, cells.side, cells.columns, boxes[chosen, 0], boxes[chosen, 2])
    row, column = whole_numbers(first, last)
    number = chosen[row]
    low, high = boxes[number, 1], boxes[number, 3]
    of_walls = slice(0, int(np.searchsorted(number, len(walls))))
    inside = _within_columns(cells, column[of_walls], walls[number[of_walls]], low[of_walls], high[of_walls])
    low[of_walls], high[of_walls] = inside
    row, cell_row = whole_numbers(*_span(cells.bottom, cells.side, cells.rows, low, high))
    return (cell_row * cells.columns + column[row]).astype(np.int32), number[row].astype(np.int32)


def _span(
    start: float, side: float, count: int, low: FloatArray, high: FloatArray
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the first and last of `count` cells between two coordinates; if there is none, last < first."""
    first = np.floor((low - start - _MARGIN) / side)
    last = np.floor((high - start + _MARGIN) / side)
    return np.clip(first, 0, count).astype(np.intp), np.clip(last, -1, count - 1).astype(np.intp)


def whole_numbers(first: NDArray[np.intp], last: NDArray[np.intp]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return all whole numbers from `first` to `last` (n,) of each row: the row and the number, (k,) each."""
    counts = np.maximum(last - first + 1, 0)
    row = np.repeat(np.arange(len(first)), counts)
    return row, np.arange(len(row)) + np.repeat(first - (np.cumsum(counts) - counts), counts)


def _within_columns(
    cells: Cells, columns: NDArray[np.intp], walls: FloatArray, low: FloatArray, high: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the lowest and highest coordinate of walls (n, 4) inside columns (n,) of cells."""
    x, y, end_x, end_y = walls.T
    across, up = end_x - x, end_y - y
    steep = np.abs(across) <= _MARGIN
    across = np.where(steep, 1.0, across)
    left = cells.left + columns * cells.side - _MARGIN
    enters, leaves = y + up * (left - x) / across, y + up * (left + cells.side + 2 * _MARGIN - x) / across
    lowest, highest = np.maximum(low, np.minimum(enters, leaves)), np.minimum(high, np.maximum(enters, leaves))
    return np.where(steep, low, lowest), np.where(steep, high, highest)


@compiled_part
def enter(cells: Cells, x: float, y: float, dx: float, dy: float) -> Walk:
    """Return a ray from (x, y) along the unit vector (dx, dy) in its first cell."""
    right, top = cells.left + cells.columns * cells.side, cells.bottom + cells.rows * cells.side
    start = max(0.0, _ahead(x, dx, cells.left, right), _ahead(y, dy, cells.bottom, top))
    within_x = cells.left - _MARGIN <= x + start * dx <= right + _MARGIN
    within_y = cells.bottom - _MARGIN <= y + start * dy <= top + _MARGIN
    if not (within_x and within_y):
        return Walk(False, 0, 0, 0, 0, 0.0, 0.0, 0.0, 0.0)
    column = min(max(int((x + start * dx - cells.left) / cells.side), 0), cells.columns - 1)
    row = min(max(int((y + start * dy - cells.bottom) / cells.side), 0), cells.rows - 1)
    next_column, per_column, column_step = _crossings(x, dx, cells.left, cells.side, column)
    next_row, per_row, row_step = _crossings(y, dy, cells.bottom, cells.side, row)
    return Walk(True, column, row, column_step, row_step, next_column, next_row, per_column, per_row)


@compiled_part
def advance(cells: Cells, walk: Walk) -> Walk:
    """Return the ray in its next cell."""
    inside, column, row, column_step, row_step, next_column, next_row, per_column, per_row = walk
    if next_column < next_row:
        column += column_step
        next_column += per_column
        inside = 0 <= column < cells.columns
    else:
        row += row_step
        next_row += per_row
        inside = 0 <= row < cells.rows
    return Walk(inside, column, row, column_step, row_step, next_column, next_row, per_column, per_row)


@inlined
def listed(cells: Cells, listing: Listing, walk: Walk) -> IntArray:
    """Return the objects in the cell of the ray."""
    cell = walk.row * cells.columns + walk.column
    return listing.numbers[listing.starts[cell] : listing.starts[cell + 1]]


@compiled_part
def _ahead(start: float, along: float, low: float, high: float) -> float:
    """Return the distance along a ray until its coordinate is between two bounds; 0 if it is there, inf if never."""
    if low <= start <= high:
        return 0.0
    bound = low if start < low else high
    if along == 0.0 or (bound - start) / along < 0.0:
        return np.inf
    return (bound - start) / along


@compiled_part
def _crossings(position: float, along: float, start: float, side: float, cell: int) -> tuple[float, float, int]:
    """Return the distance along a ray to the next grid line and between grid lines, and the step of the cell number."""
    if along > 0.0:
        return (start + (cell + 1) * side - position) / along, side / along, 1
    if along < 0.0:
        return (start + cell * side - position) / along, -side / along, -1
    return np.inf, np.inf, 0
