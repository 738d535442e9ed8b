"""A grid of square cells that lists the surfaces in each, so that a large room costs little more than a small one.

`Surfaces` is the input of every kernel that follows rays: walls, posts and grid. Compiled by numba.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray
from sonarhw_sim.compiled import compiled

IntArray = NDArray[np.int32]

_MOST_CELLS = 1 << 20
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
    corners = np.vstack((walls[:, :2], walls[:, 2:], posts[:, :2] - posts[:, 2:], posts[:, :2] + posts[:, 2:]))
    # a section of a room may be empty
    low, high = (corners.min(axis=0), corners.max(axis=0)) if len(corners) else (np.zeros(2), np.zeros(2))
    count = max(1, min(len(walls) + len(posts), _MOST_CELLS))
    width, height = np.maximum(high - low, 1e-3)
    # a long narrow room has a single row of square cells
    side = max(math.sqrt(width * height / count), max(width, height) / count)
    columns, rows = math.ceil(width / side) + 1, math.ceil(height / side) + 1
    cells = Cells(float(low[0] - side / 2), float(low[1] - side / 2), float(side), columns, rows)
    return Surfaces(walls, posts, cells, _list_surfaces(cells, walls, posts))


@compiled
def list_points(cells: Cells, points: FloatArray, reach: float) -> Listing:
    """Return, for each cell, the points (n, 2) within `reach` (m) of it."""
    boxes = np.empty((points.shape[0], 4))
    for k in range(points.shape[0]):
        _set_box(boxes, k, points[k, 0], points[k, 1], reach)
    return _list_boxes(cells, boxes, boxes[:0])


@compiled
def _set_box(boxes: FloatArray, k: int, x: float, y: float, reach: float) -> None:
    boxes[k, 0], boxes[k, 1], boxes[k, 2], boxes[k, 3] = x - reach, y - reach, x + reach, y + reach


def listed_at(surfaces: Surfaces, points: FloatArray) -> tuple[NDArray[np.intp], IntArray]:
    """Return the surfaces in the cell of each point (p, 2): the row of the point and the surface, (k,) each.

    The points must be within the extent of the surfaces.
    """
    cells, (starts, numbers) = surfaces.cells, surfaces.listing
    column = ((points[:, 0] - cells.left) / cells.side).astype(np.intp)
    cell = ((points[:, 1] - cells.bottom) / cells.side).astype(np.intp) * cells.columns + column
    counts = starts[cell + 1] - starts[cell]
    rows = np.repeat(np.arange(len(points)), counts)
    first = np.cumsum(counts) - counts
    return rows, numbers[np.arange(len(rows)) + np.repeat(starts[cell] - first, counts)]


@compiled
def _list_surfaces(cells: Cells, walls: FloatArray, posts: FloatArray) -> Listing:
    boxes = np.empty((walls.shape[0] + posts.shape[0], 4))
    for k in range(walls.shape[0]):
        boxes[k, 0], boxes[k, 2] = min(walls[k, 0], walls[k, 2]), max(walls[k, 0], walls[k, 2])
        boxes[k, 1], boxes[k, 3] = min(walls[k, 1], walls[k, 3]), max(walls[k, 1], walls[k, 3])
    for k in range(posts.shape[0]):
        _set_box(boxes, walls.shape[0] + k, posts[k, 0], posts[k, 1], posts[k, 2])
    return _list_boxes(cells, boxes, walls)


@compiled
def _list_boxes(cells: Cells, boxes: FloatArray, walls: FloatArray) -> Listing:
    """Return the boxes in each cell; boxes (n, 4) are x, y of the lower left and of the upper right corner.

    The first boxes are those of `walls` (w, 4), which are listed only in the cells that the wall itself crosses.
    """
    counts = np.zeros(cells.columns * cells.rows + 1, np.int32)
    numbers = np.empty(0, np.int32)
    for filling in (False, True):
        if filling:
            for cell in range(1, counts.shape[0]):
                counts[cell] += counts[cell - 1]
            numbers = np.empty(counts[-1], np.int32)
        for k in range(boxes.shape[0]):
            first, last = _span(cells.left, cells.side, cells.columns, boxes[k, 0], boxes[k, 2])
            for column in range(first, last + 1):
                low, high = boxes[k, 1], boxes[k, 3]
                if k < walls.shape[0]:
                    low, high = _within_column(cells, column, walls[k], low, high)
                lowest, highest = _span(cells.bottom, cells.side, cells.rows, low, high)
                for row in range(lowest, highest + 1):
                    cell = row * cells.columns + column
                    if filling:
                        # filled backwards, so that each end becomes a start
                        counts[cell] -= 1
                        numbers[counts[cell]] = k
                    else:
                        counts[cell] += 1
    return Listing(counts, numbers)


@compiled
def _span(start: float, side: float, count: int, low: float, high: float) -> tuple[int, int]:
    """Return the first and last of `count` cells between two coordinates; if there is none, last < first."""
    first = math.floor((low - start - _MARGIN) / side)
    last = math.floor((high - start + _MARGIN) / side)
    return max(first, 0), min(last, count - 1)


@compiled
def _within_column(cells: Cells, column: int, wall: FloatArray, low: float, high: float) -> tuple[float, float]:
    """Return the lowest and highest coordinate of a wall inside a column."""
    across, up = wall[2] - wall[0], wall[3] - wall[1]
    if abs(across) <= _MARGIN:
        return low, high
    left = cells.left + column * cells.side - _MARGIN
    right = left + cells.side + 2 * _MARGIN
    one, other = wall[1] + up * (left - wall[0]) / across, wall[1] + up * (right - wall[0]) / across
    return max(low, min(one, other)), min(high, max(one, other))


@compiled
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


@compiled
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


@compiled
def listed(cells: Cells, listing: Listing, walk: Walk) -> IntArray:
    """Return the objects in the cell of the ray."""
    cell = walk.row * cells.columns + walk.column
    return listing.numbers[listing.starts[cell] : listing.starts[cell + 1]]


@compiled
def _ahead(at: float, along: float, low: float, high: float) -> float:
    """Return the distance along a ray until its coordinate is between two bounds; 0 if it is there, inf if never."""
    if low <= at <= high:
        return 0.0
    bound = low if at < low else high
    if along == 0.0 or (bound - at) / along < 0.0:
        return np.inf
    return (bound - at) / along


@compiled
def _crossings(at: float, along: float, start: float, side: float, cell: int) -> tuple[float, float, int]:
    """Return the distance along a ray to the next grid line and between grid lines, and the step of the cell number."""
    if along > 0.0:
        return (start + (cell + 1) * side - at) / along, side / along, 1
    if along < 0.0:
        return (start + cell * side - at) / along, -side / along, -1
    return np.inf, np.inf, 0
