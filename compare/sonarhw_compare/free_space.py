"""Free space of a room: the positions that a sensor can have.

It consists of all cells that are connected to a place of the room without crossing a wall. In a room without places, it
is the largest connected area.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from sonarhw_sim.rays.fan import distances_ahead
from sonarhw_sim.room.room import Room, wall_distances

from sonarhw.errors import InputError
from sonarhw.readings import BoolArray, FloatArray

_EXACTLY = 1e-9  # m; a wall through the middles of cells separates them in spite of rounding
_CELLS = 120  # along the longer side of the room, by default
TRIES = 100_000  # to draw a position
_MANY = 1_000  # of them, after which it is worth computing whether there is one


@dataclass(frozen=True)
class FreeSpace:
    """The free part of a room, as square cells."""

    room: Room
    left: float  # m
    bottom: float  # m
    spacing: float  # m, side of a cell
    free: BoolArray  # (rows, columns), whether the middle of a cell is free

    @property
    def middles(self) -> FloatArray:
        """Middles of the free cells, (n, 2) float, m."""
        rows, columns = np.nonzero(self.free)
        return np.column_stack((self.left + (columns + 0.5) * self.spacing, self.bottom + (rows + 0.5) * self.spacing))

    def holds(self, point: FloatArray, clearance: float = 0.0) -> bool:
        """Report whether `point` (2,) m is free and at least `clearance` (m) from every wall and post."""
        cell = np.floor((point - (self.left, self.bottom)) / self.spacing).astype(int)
        column, row = np.clip(cell, 0, np.array(self.free.shape[::-1]) - 1)
        middle = np.array([self.left + (column + 0.5) * self.spacing, self.bottom + (row + 0.5) * self.spacing])
        away = middle - point
        seen = distances_ahead(point[None], np.array([math.atan2(away[1], away[0])]), self.room.surfaces)[0]
        is_clear = distances_to(self.room, point[None])[0] > clearance
        return bool(self.free[row, column] and seen >= np.hypot(*away) and is_clear)

    def draw(self, random: np.random.Generator, clearance: float = 0.0) -> tuple[float, float]:
        """Return a random position, m, uniform over the free space.

        Raises InputError if hardly any position is at least `clearance` (m) from every wall and post.
        """
        rows, columns = self.free.shape
        size = np.array([columns * self.spacing, rows * self.spacing])
        for tries in range(TRIES):
            if tries == _MANY and self._widest() <= clearance:
                break
            point = np.array([self.left, self.bottom]) + random.random(2) * size
            if self.holds(point, clearance):
                return float(point[0]), float(point[1])
        raise InputError(
            f"room {self.room.name!r}: no place is {clearance:g} m from every wall and post; use a smaller clearance"
        )

    def _widest(self) -> float:
        """Return a distance from every wall and post that no free position exceeds, m."""
        from_middle = self.spacing / math.sqrt(2)  # to the corner of a cell
        return float(distances_to(self.room, self.middles).max(initial=-math.inf)) + from_middle


def find_free_space(room: Room, spacing: float | None = None) -> FreeSpace:
    """Return the free space of a room, in cells of `spacing` (m); by default 120 cells along its longer side."""
    low, high = _bounds(room)
    spacing = float((high - low).max()) / _CELLS if spacing is None else spacing
    columns, rows = np.maximum(1, np.ceil((high - low) / spacing - 1e-9)).astype(int)
    x = low[0] + (np.arange(columns) + 0.5) * spacing
    y = low[1] + (np.arange(rows) + 0.5) * spacing
    middles = np.column_stack((np.tile(x, rows), np.repeat(y, columns)))
    pieces = _pieces(room, middles, (int(rows), int(columns)), spacing)
    in_posts = (_post_distances(room, middles) <= 0).reshape(rows, columns)
    free = np.isin(pieces, _areas_with_places(room, pieces, low, spacing)) & ~in_posts
    return FreeSpace(room, float(low[0]), float(low[1]), spacing, free)


def _bounds(room: Room) -> tuple[FloatArray, FloatArray]:
    """Return the lower left and upper right corner of walls, posts and places, (2,) m each."""
    posts = [room.posts[:, :2] - room.posts[:, 2:], room.posts[:, :2] + room.posts[:, 2:]]
    places = [np.array([place.position]) for place in room.places.values()]
    points = np.vstack((room.walls.reshape(-1, 2), *posts, *places))
    return points.min(axis=0), points.max(axis=0)


def _pieces(room: Room, middles: FloatArray, shape: tuple[int, int], spacing: float) -> NDArray[np.int32]:
    """Return the number of the connected area of each cell, `shape` int. Walls and posts separate areas."""
    numbers = np.arange(len(middles)).reshape(shape)
    clear = [
        (distances_ahead(middles, np.full(len(middles), angle), room.surfaces) > spacing + _EXACTLY).reshape(shape)
        for angle in (0.0, math.pi / 2)
    ]
    aside, above = clear[0][:, :-1], clear[1][:-1]
    starts = np.concatenate((numbers[:, :-1][aside], numbers[:-1][above]))
    ends = np.concatenate((numbers[:, 1:][aside], numbers[1:][above]))
    links = coo_array((np.ones(len(starts)), (starts, ends)), shape=(len(middles), len(middles)))
    return np.asarray(connected_components(links, directed=False)[1], dtype=np.int32).reshape(shape)


def _areas_with_places(room: Room, pieces: NDArray[np.int32], low: FloatArray, spacing: float) -> NDArray[np.int32]:
    """Return the numbers of the areas with places of the room; without places, of the largest area."""
    if room.places:
        positions = np.array([place.position for place in room.places.values()])
        last = np.array(pieces.shape[::-1]) - 1
        columns, rows = np.clip(np.floor((positions - low) / spacing).astype(int), 0, last).T
        return np.unique(pieces[rows, columns])
    return np.array([np.bincount(pieces.ravel()).argmax()], dtype=np.int32)


def _post_distances(room: Room, points: FloatArray) -> FloatArray:
    """Return the distances of points (n, 2) from the nearest post, (n,) m; infinite without one."""
    away = np.hypot(*(points[:, None] - room.posts[:, :2]).transpose(2, 0, 1)) - room.posts[:, 2]
    return np.asarray(away.min(axis=1, initial=math.inf))


def distances_to(room: Room, points: FloatArray) -> FloatArray:
    """Return the distances of points (n, 2) from the nearest wall or post, (n,) m; negative inside a post."""
    return np.asarray(np.minimum(wall_distances(points, room.walls).min(axis=1), _post_distances(room, points)))
