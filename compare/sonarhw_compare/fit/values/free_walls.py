"""Walls moved by a fit: each along its normal, its neighbours stretched so that corners stay corners.

Takes a room and by how much named walls move; hands on the room with walls and edges as they then are.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from sonarhw_sim.room.edges import find_edges
from sonarhw_sim.room.model import Room

from sonarhw.readings import FloatArray

_PARALLEL = 1e-3  # sine of the angle below which two lines have no corner worth the name


def left_normals(walls: FloatArray) -> FloatArray:
    """Unit normals to the left of walls (n, 4) seen from start to end, (n, 2) float."""
    along = walls[:, 2:] - walls[:, :2]
    return np.asarray(np.column_stack((-along[:, 1], along[:, 0])) / np.hypot(*along.T)[:, None])


def with_shifted_walls(room: Room, shifts: Mapping[str, float]) -> Room:
    """The room with walls moved to their left (m, by name); a corner of two walls is where their lines now meet."""
    by = np.array([shifts.get(name, 0.0) for name in room.names[: len(room.walls)]])
    normals = left_normals(room.walls)
    ends = room.walls.reshape(-1, 2, 2) + (by[:, None] * normals)[:, None, :]
    for point in np.unique(room.walls.reshape(-1, 2), axis=0):
        meeting = np.argwhere((room.walls.reshape(-1, 2, 2) == point).all(axis=2))
        corner = _corner(point, normals[meeting[:, 0]], by[meeting[:, 0]])
        for wall, end in meeting:
            ends[wall, end] = corner
    walls = np.ascontiguousarray(ends.reshape(-1, 4))
    return replace(room, walls=walls, edges=find_edges(walls, room.names[: len(walls)]))


def corner_moves(room: Room, point: FloatArray, columns: Mapping[int, int]) -> FloatArray:
    """By how much a corner (2,) moves for every metre that each wall moves to its left, (2, columns) float.

    `columns`: those of the walls, by number, that move.
    """
    meeting = np.flatnonzero((room.walls.reshape(-1, 2, 2) == point).all(axis=2).any(axis=1))
    normals, moves = left_normals(room.walls[meeting]), np.zeros((2, len(columns)))
    for wall in columns.keys() & set(meeting.tolist()):
        moves[:, columns[wall]] = _corner(point, normals, (meeting == wall).astype(np.float64)) - point
    return moves


def _corner(point: FloatArray, normals: FloatArray, by: FloatArray) -> FloatArray:
    """Where lines through `point` with normals (k, 2) meet once each has moved by `by` (k,); the least move does."""
    if abs(np.linalg.det(normals[[0, -1]])) < _PARALLEL:
        return np.asarray(point + normals[0] * by[0])
    return np.asarray(point + np.linalg.lstsq(normals, by, rcond=None)[0])
