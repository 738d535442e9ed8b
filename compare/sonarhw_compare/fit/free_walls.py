"""Walls moved along their normals by a fit. Neighbouring walls are stretched, so corners and T-junctions stay closed.

A gap of a tenth of a millimetre, or an end behind the wall that it should touch, would diffract as a free end does.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from sonarhw_sim.room.edges import find_edges
from sonarhw_sim.room.room import Room, wall_distances
from sonarhw_sim.room.room_file import MEETING
from sonarhw_sim.room.room_writing import with_corners

from sonarhw.readings import FloatArray

_PARALLEL = 1e-3  # sine of the angle between two lines that count as parallel


def left_normals(walls: FloatArray) -> FloatArray:
    """Return unit normals of walls (n, 4), to the left seen from start to end, (n, 2) float."""
    along = walls[:, 2:] - walls[:, :2]
    return np.asarray(np.column_stack((-along[:, 1], along[:, 0])) / np.hypot(*along.T)[:, None])


def with_shifted_walls(room: Room, shifts: Mapping[str, float]) -> Room:
    """Return the room with walls moved to their left (m, by name).

    A corner moves to where its walls now meet. A wall that ends on another one still ends on it.
    """
    walls = _shifted(room, shifts)
    return replace(room, walls=walls, edges=find_edges(walls, room.names[: len(walls)]))


def can_shift(room: Room, shifts: Mapping[str, float]) -> bool:
    """Return whether all walls keep a length and their directions if some are moved to their left (m, by name)."""
    before, after = (walls[:, 2:] - walls[:, :2] for walls in (room.walls, _shifted(room, shifts)))
    return bool(((before * after).sum(axis=1) > MEETING * np.hypot(*before.T)).all())


def _shifted(room: Room, shifts: Mapping[str, float]) -> FloatArray:
    """Return the walls of `with_shifted_walls`, (n, 4) m."""
    by = np.array([shifts.get(name, 0.0) for name in room.names[: len(room.walls)]])
    normals = left_normals(room.walls)
    ends = room.walls.reshape(-1, 2, 2) + (by[:, None] * normals)[:, None, :]
    for point in np.unique(room.walls.reshape(-1, 2), axis=0):
        for wall, end in np.argwhere((room.walls.reshape(-1, 2, 2) == point).all(axis=2)):
            meeting = _meeting(room.walls, normals, point, wall)
            ends[wall, end] = _corner(point, normals[meeting], by[meeting])
    return np.ascontiguousarray(ends.reshape(-1, 4))


def with_written_walls(room: Room, shifts: Mapping[str, float], digits: int) -> Room:
    """Return the room as `with_shifted_walls` does, rounded to so many decimals, also in the text of its file."""
    shifted = with_shifted_walls(room, shifts).walls.round(digits)
    ends = zip(room.walls.reshape(-1, 2).tolist(), shifted.reshape(-1, 2).tolist(), strict=True)
    return with_corners(room, {(x, y): (new_x, new_y) for (x, y), (new_x, new_y) in ends})


def corner_moves(room: Room, point: FloatArray, columns: Mapping[int, int]) -> FloatArray:
    """Return the derivative of an edge at `point` (2,) by the shift of each wall to its left, (2, columns) float.

    `columns` maps the number of each movable wall to its column.
    """
    normals, moves = left_normals(room.walls), np.zeros((2, len(columns)))
    meeting = _meeting(room.walls, normals, point)
    for wall in columns.keys() & set(meeting.tolist()):
        moves[:, columns[wall]] = _corner(point, normals[meeting], (meeting == wall).astype(np.float64)) - point
    return moves


def _meeting(walls: FloatArray, normals: FloatArray, point: FloatArray, ending: int | None = None) -> NDArray[np.intp]:
    """Return the numbers of the walls (n, 4) that determine where a corner is: those that end there.

    At a T-junction, they are the one that ends there, `ending` or else any, and the other one. A wall that lies flush
    with one that ends there makes no T-junction.
    """
    ends = np.flatnonzero((walls.reshape(-1, 2, 2) == point).all(axis=2).any(axis=1))
    through = np.setdiff1d(np.flatnonzero(wall_distances(point[None], walls)[0] <= MEETING), ends)
    sines = np.abs(normals[through, 0, None] * normals[ends, 1] - normals[through, 1, None] * normals[ends, 0])
    if not len(through) or (sines < _PARALLEL).any():
        return ends
    first = ends[:1] if ending is None else [ending]
    return np.array([*first, *through])


def _corner(point: FloatArray, normals: FloatArray, by: FloatArray) -> FloatArray:
    """Return where lines through `point` with normals (k, 2) meet after a shift by `by` (k,): the nearest solution."""
    if abs(np.linalg.det(normals[[0, -1]])) < _PARALLEL:
        return np.asarray(point + normals[0] * by[0])
    return np.asarray(point + np.linalg.lstsq(normals, by, rcond=None)[0])
