"""Tables of paths, one row each: the base of `Paths` and `PartialPaths`; and the limit of their size."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from sonarhw.errors import InputError
from sonarhw.readings import FloatArray
from sonarhw_sim.compiled import compiled

# Points of all paths of one table. A search needs about 80 bytes for each, 2.4 GB. The shipped
# rooms have up to 2 million.
MOST_POINTS = 30_000_000
# of two partial paths, for which memory is reserved at first, so that they are rarely counted before they are listed
ROOM_FOR_PAIRS = 1_000_000


@dataclass(frozen=True)
class PathTable:
    """Columns of equal length; each subclass adds its own."""

    lengths: FloatArray  # (n,), m

    def __len__(self) -> int:
        return len(self.lengths)

    def select(self, rows: NDArray[np.intp]) -> Self:
        """Return only these rows, in this order."""
        return type(self)(*[getattr(self, name)[rows] for name in self.__dataclass_fields__])

    @classmethod
    def join(cls, tables: Sequence[Self]) -> Self:
        """Return the rows of all tables, in order; expects at least one table."""
        filled = [table for table in tables if len(table)] or tables[:1]
        if len(filled) == 1:
            return filled[0]
        return cls(*[_joined([getattr(table, name) for table in filled]) for name in cls.__dataclass_fields__])


def check_size(paths: int, points: int) -> None:
    """Raise InputError if a table of so many paths with up to `points` points each needs too much memory."""
    if paths * points > MOST_POINTS:
        raise InputError(
            f"too many paths: {paths} or more, with up to {points} points each: expected at most {MOST_POINTS} points "
            "in all, because of memory; choose a shorter range or fewer reflections"
        )


def _joined(arrays: list[NDArray[Any]]) -> NDArray[Any]:
    """Return the rows of all arrays, padded on the second axis to the longest: -1 for no surface, NaN for no point."""
    if arrays[0].ndim == 1:
        return np.concatenate(arrays)
    count, width = sum(map(len, arrays)), max(array.shape[1] for array in arrays)
    check_size(count, width)
    nothing = -1 if np.issubdtype(arrays[0].dtype, np.integer) else np.nan
    rows = np.empty((count, width, *arrays[0].shape[2:]), np.result_type(*arrays))
    first = 0
    for array in arrays:
        rows[first : first + len(array), : array.shape[1]] = array
        rows[first : first + len(array), array.shape[1] :] = nothing
        first += len(array)
    return rows


def fill_rows(
    table: NDArray[Any],
    one: NDArray[Any],
    first: NDArray[np.intp],
    count: NDArray[np.integer],
    other: NDArray[Any],
    second: NDArray[np.intp],
    other_count: NDArray[np.integer],
) -> None:
    """Fill each row of `table` from the left: `count` columns of a row of `one`, then a row of `other`, reversed.

    `first` and `second` (m,) are these rows, and `other_count` columns of `other` are used. The rest of a row is filled
    with -1, or NaN for points.
    """
    nothing = table.dtype.type(-1 if np.issubdtype(table.dtype, np.integer) else np.nan)
    if table.ndim == 2:
        table, one, other = table[:, :, None], one[:, :, None], other[:, :, None]
    counts = (np.asarray(each, np.int64) for each in (first, count, second, other_count))
    _fill(table, one, other, nothing, *counts)


@compiled
def _fill(
    table: NDArray[Any],
    one: NDArray[Any],
    other: NDArray[Any],
    nothing: Any,
    first: NDArray[np.int64],
    count: NDArray[np.int64],
    second: NDArray[np.int64],
    other_count: NDArray[np.int64],
) -> None:
    """Fill the rows of `table` (m, k, d) as `fill_rows`."""
    for row in range(table.shape[0]):
        total = count[row] + other_count[row]
        for axis in range(table.shape[2]):
            for k in range(count[row]):
                table[row, k, axis] = one[first[row], k, axis]
            for k in range(count[row], total):
                table[row, k, axis] = other[second[row], total - 1 - k, axis]
            for k in range(total, table.shape[1]):
                table[row, k, axis] = nothing
