"""The ranges of a whole room in a table: predicted once at many positions and headings, then looked up in nanoseconds.

An entry has the range and how it changes with the position. Near an entry, the range of one echo is a plane within
millimetres, so a reading is looked up at the nearest entry and moved along this plane. Where another echo becomes the
first one, the table is wrong by up to half of its spacing and step.
"""

import hashlib
import math
import zipfile
import zlib
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sonarhw_sim.air import DEFAULT_BOARD
from sonarhw_sim.board.profile import ON_AXIS, Board
from sonarhw_sim.compiled import compiled, rows_in_parts
from sonarhw_sim.predict.batch import (
    BOARD,
    POSES,
    ROOM,
    Sensors,
    angles_of,
    loaded_board,
    loaded_room,
    predict_ranges,
    sensors_of,
)
from sonarhw_sim.room.room import Room

from sonarhw import arguments
from sonarhw.errors import InputError
from sonarhw.files import atomic_file, open_input
from sonarhw.readings import FloatArray
from sonarhw_compare.free_space import FreeSpace, find_free_space

_NOT_COMPUTED = -1.0  # m: the entry of a position that no sensor can have
_STEEPEST = 1.02  # change of a range by that of the position; more is another echo
_PARTS = 100  # of 1: slopes are stored as whole numbers of this part
_AT_ONCE = 256  # positions between two calls of `progress`
_LEAST_POSES = 64  # fewer take about as long as a thread needs to begin
_NEAR = 0.005  # m
_TRIED = 200  # random poses by which the error is stated, with 16 headings each
_MOST_ENTRIES = 500_000_000  # 3 GB
_MOST_BYTES = 4 << 30  # of a file


@dataclass(frozen=True, eq=False, repr=False)
class RangeTable:
    """The ranges that one sensor of a board reports in a room, at positions in a square grid and headings all round."""

    room: Room
    board: Board
    corner: tuple[float, float]  # m, of the grid: x and y of its first cell
    spacing: float  # m, side of a cell
    distances: NDArray[np.float32]  # (rows, columns, headings), m, of the true detection; NaN: no echo
    slopes: NDArray[np.int8]  # (rows, columns, headings, 2), hundredths: change with x and y
    within_5mm: float  # share of readings at random poses that are within 5 mm of `predict_ranges`, or both silent

    def __repr__(self) -> str:
        rows, columns, headings = self.distances.shape
        return (
            f"RangeTable({self.room.name!r}, {self.board.name!r}, {columns} x {rows} positions, {headings} headings, "
            f"{self.within_5mm:.1%} within 5 mm)"
        )

    def ranges(self, poses: ArrayLike, headings: ArrayLike | None = None, *, degrees: bool = False) -> FloatArray:
        """Return the ranges of `predict_ranges` at poses (n, 3) and headings (m,), by the table, (n, m) float, m.

        NaN is no echo, and every position without an entry near it. Raises InputError.
        """
        rows = arguments.rows("poses", poses, (2, 3), POSES)
        turns = arguments.in_radians("poses", rows[:, 2], degrees) if rows.shape[1] == 3 else np.zeros(len(rows))
        angles = angles_of(headings, self.board, degrees)
        senders, _, aims = _single(self.room, self.board, angles).at(np.column_stack((rows[:, :2], turns)))
        return self.board.reported(self._distances(senders, aims)).reshape(len(rows), len(angles))

    def _distances(self, positions: FloatArray, headings: FloatArray) -> FloatArray:
        """Return the true distances at positions (n, 2) m and headings (n, m) rad, (n, m), NaN for none."""

        def looked_up(begin: int, end: int) -> tuple[FloatArray]:
            cells = (positions[begin:end] - self.corner) / self.spacing - 0.5  # whole numbers at the entries
            distances = np.empty((end - begin, headings.shape[1]))
            _look_up(cells, headings[begin:end], self.spacing, self.distances, self.slopes, distances)
            return (distances,)

        (distances,) = rows_in_parts(looked_up, len(positions), _LEAST_POSES)
        return distances

    def save(self, file: Path | str) -> None:
        """Write the table to a file (*.npz). `load_range_table` reads it. Raises OutputError."""
        with atomic_file(Path(file)) as stream:
            np.savez_compressed(
                stream,
                of=np.array(_digest(self.room, self.board)),
                grid=np.array([*self.corner, self.spacing, self.within_5mm]),
                distances=self.distances,
                slopes=self.slopes,
            )


def _single(room: Room, board: Board, angles: FloatArray) -> Sensors:
    """Return the sensors at turntable angles (m,) rad. Raises InputError if they hear the pings of others."""
    sensors = sensors_of(room, board, angles)
    if sensors is None or sensors.receivers is not None:
        raise InputError(
            f"board {board.name!r}: expected sensors that hear only their own pings; a table has one sensor by itself"
        )
    return sensors


@arguments.checked(
    room=ROOM,
    board=BOARD,
    spacing=arguments.number(0.005, 1.0, "m"),
    step=arguments.number(math.radians(0.1), math.radians(30.0), "rad"),
    progress=arguments.function,
)
def range_table(
    room: Room | Path | str,
    board: Board | Path | str = DEFAULT_BOARD,
    *,
    spacing: float = 0.05,
    step: float = math.radians(1.0),
    progress: Callable[[float], None] = lambda _share: None,
) -> RangeTable:
    """Return the table of a board in a room: predicted on all cores, each `spacing` (m) and each `step` (rad).

    Entries are at the middles of the cells of the room's free space. `progress` receives the completed share, 0..1, and
    may end the work by an exception. The body of a ring, and other sensors, are left out of the table. The table states
    its error: the share of readings at random poses that are within 5 mm of `predict_ranges`. Raises InputError if a
    sensor hears the pings of others or has a separate receiver, and for a table of over 500 million entries.
    """
    room, board = loaded_room(room), loaded_board(board)
    _single(room, board, np.zeros(1) if board.ring is None else angles_of(None, board, False))
    space = find_free_space(room, spacing)
    steps = max(1, round(math.tau / step))
    headings = np.linspace(0.0, math.tau, steps, endpoint=False)
    entries = space.free.size * len(headings)
    if entries > _MOST_ENTRIES:
        raise InputError(
            f"the table needs {entries:.2g} entries, at most {_MOST_ENTRIES:.0e} are possible; choose a larger spacing "
            "or step"
        )
    distances = _computed(room, board, space, headings, progress)
    table = RangeTable(
        room, board, (space.left, space.bottom), spacing, distances, _slopes_of(distances, spacing), math.nan
    )
    table = replace(table, within_5mm=_share_within(table, space))
    progress(1.0)
    return table


def _computed(
    room: Room, board: Board, space: FreeSpace, headings: FloatArray, progress: Callable[[float], None]
) -> NDArray[np.float32]:
    """Return the true distances at all free cells and headings, (rows, columns, h) m."""
    # one sensor on its axis, whose readings are not rounded
    bare = replace(board, mount=ON_AXIS, ring=None, axis_x=0.0, axis_y=0.0, turntable_scale=1.0, home_angle_deg=0.0)
    bare = replace(bare, range_offset=0.0, clock_error=0.0, rounding=0.0, own_body=())
    distances = np.full((*space.free.shape, len(headings)), _NOT_COMPUTED, np.float32)
    middles, (rows, columns) = space.middles, np.nonzero(space.free)
    for begin in range(0, len(rows), _AT_ONCE):
        progress(begin / len(rows))
        some = slice(begin, begin + _AT_ONCE)
        distances[rows[some], columns[some]] = predict_ranges(room, middles[some], headings, bare)
    return distances


def _slopes_of(distances: NDArray[np.float32], spacing: float) -> NDArray[np.int8]:
    """Return how each distance changes with x and with y, hundredths, (rows, columns, h, 2).

    It is the mean of the differences from both neighbours, or that from the one with an echo of the same surface.
    """
    slopes = np.zeros((*distances.shape, 2), np.int8)
    for part, axis in enumerate((1, 0)):
        steps = np.diff(distances, axis=axis) / spacing
        ends = np.delete(distances, -1, axis), np.delete(distances, 0, axis)
        # comparisons with NaN are false: silence has no slope
        same = (np.abs(steps) <= _STEEPEST) & (ends[0] >= 0) & (ends[1] >= 0)
        steps = np.where(same, steps, 0.0)
        edge = np.zeros_like(np.take(distances, [0], axis))
        sums = np.concatenate((edge, steps), axis) + np.concatenate((steps, edge), axis)
        counts = np.concatenate((edge, same), axis) + np.concatenate((same, edge), axis)
        slopes[..., part] = np.round(_PARTS * sums / np.maximum(counts, 1))
    return slopes


def _share_within(table: RangeTable, space: FreeSpace) -> float:
    random = np.random.default_rng(0)
    positions = np.array([space.draw(random) for _ in range(_TRIED)])
    poses = np.column_stack((positions, random.uniform(0.0, math.tau, _TRIED)))
    angles = math.tau / 16 * np.arange(16) if table.board.ring is None else None
    exact, looked_up = predict_ranges(table.room, poses, angles, table.board), table.ranges(poses, angles)
    same = (np.abs(exact - looked_up) <= _NEAR) | (np.isnan(exact) & np.isnan(looked_up))
    return float(same.mean())


@compiled
def _look_up(
    cells: FloatArray,
    headings: FloatArray,
    spacing: float,
    distances: NDArray[np.float32],
    slopes: NDArray[np.int8],
    looked_up: FloatArray,
) -> None:
    """Fill in the distances (n, m) at positions (n, 2), in cells from the first entry, and headings (n, m) rad."""
    rows, columns, steps = distances.shape
    for place in range(cells.shape[0]):
        x, y = cells[place, 0], cells[place, 1]
        best, column, row = math.inf, -1, -1
        # the nearest entry of the four around the position
        for near in range(4):
            i, j = math.floor(x) + near % 2, math.floor(y) + near // 2
            away = (x - i) ** 2 + (y - j) ** 2
            if 0 <= i < columns and 0 <= j < rows and away < best and distances[j, i, 0] != _NOT_COMPUTED:
                best, column, row = away, i, j
        for k in range(headings.shape[1]):
            looked_up[place, k] = math.nan
            if column < 0:
                continue
            heading = math.floor(headings[place, k] / math.tau * steps + 0.5) % steps
            dx, dy = (x - column) * spacing / _PARTS, (y - row) * spacing / _PARTS
            slope = slopes[row, column, heading]
            looked_up[place, k] = distances[row, column, heading] + slope[0] * dx + slope[1] * dy


def _digest(room: Room, board: Board) -> str:
    """Return a text that is the same for rooms and boards with the same content only."""
    digest = hashlib.sha256()
    for part in (room.walls, room.posts, room.reflectances, room.scattered, room.heights):
        digest.update(np.ascontiguousarray(part).tobytes() + b"|")
    numbers = [getattr(board, field.name) for field in fields(board) if field.name != "text"]
    digest.update(repr((room.air, room.tables, *numbers)).encode())
    return digest.hexdigest()


@arguments.checked(
    file=arguments.file_name,
    room=ROOM,
    board=BOARD,
)
def load_range_table(
    file: Path | str, room: Room | Path | str, board: Board | Path | str = DEFAULT_BOARD
) -> RangeTable:
    """Return the table that `RangeTable.save` wrote. Raises InputError if it is of another room or board."""
    room, board = loaded_room(room), loaded_board(board)
    path = Path(file)
    try:
        with open_input(path, _MOST_BYTES) as stream, np.load(stream, allow_pickle=False) as parts:
            digest, grid, distances, slopes = (parts[name] for name in ("of", "grid", "distances", "slopes"))
        left, bottom, spacing, within = grid.tolist()
        is_whole = (distances.dtype, slopes.dtype) == (np.float32, np.int8)
        is_whole = is_whole and distances.ndim == 3 and slopes.shape == (*distances.shape, 2) and distances.size > 0
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile, zlib.error) as error:
        raise InputError(f"{path}: {error}; expected a table that `RangeTable.save` wrote (*.npz)") from error
    if not is_whole:
        raise InputError(f"{path}: expected a table that `RangeTable.save` wrote (*.npz), found other arrays")
    if str(digest) != _digest(room, board):
        raise InputError(
            f"{path}: is the table of another room or board than {room.name!r} and {board.name!r}; make it again with "
            "`sonarhw.range_table(room, board)`"
        )
    return RangeTable(room, board, (left, bottom), spacing, distances, slopes, within)
