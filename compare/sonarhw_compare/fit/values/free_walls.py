"""Walls moved along their normals by a fit. Neighbouring walls are stretched, so corners remain closed."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from sonarhw_sim.room.edges import find_edges
from sonarhw_sim.room.model import Room

from sonarhw.readings import FloatArray

_PARALLEL = 1e-3  # sine of the angle between two lines that count as parallel


def left_normals(walls: FloatArray) -> FloatArray:
    """Return unit normals of walls (n, 4), to the left seen from start to end, (n, 2) float."""
    along = walls[:, 2:] - walls[:, :2]
    return np.asarray(np.column_stack((-along[:, 1], along[:, 0])) / np.hypot(*along.T)[:, None])


def with_shifted_walls(room: Room, shifts: Mapping[str, float]) -> Room:
    """Return the room with walls moved to their left (m, by name). A corner moves to where its walls now meet."""
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
    """Return the derivative of a corner (2,) by the shift of each wall to its left, (2, columns) float.

    `columns` maps the number of each movable wall to its column.
    """
    meeting = np.flatnonzero((room.walls.reshape(-1, 2, 2) == point).all(axis=2).any(axis=1))
    normals, moves = left_normals(room.walls[meeting]), np.zeros((2, len(columns)))
    for wall in columns.keys() & set(meeting.tolist()):
        moves[:, columns[wall]] = _corner(point, normals, (meeting == wall).astype(np.float64)) - point
    return moves


def _corner(point: FloatArray, normals: FloatArray, by: FloatArray) -> FloatArray:
    """Return where lines through `point` with normals (k, 2) meet after a shift by `by` (k,): the nearest solution."""
    if abs(np.linalg.det(normals[[0, -1]])) < _PARALLEL:
        return np.asarray(point + normals[0] * by[0])
    return np.asarray(point + np.linalg.lstsq(normals, by, rcond=None)[0])
