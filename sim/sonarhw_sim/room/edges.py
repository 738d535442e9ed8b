"""Edges: the wall ends and corners that diffract sound, one `Edges` row for each wedge of air at a vertex.

A wedge whose angle divides 180°, such as an inner right angle, reflects and does not diffract: Keller's coefficient
is 0.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray
from sonarhw_sim.room.grid import IntArray, Listing, Surfaces, lay_grid, listed_at
from sonarhw_sim.room.room_file import MEETING

_DIVIDES = 1e-6  # largest distance of 180° / angle from a whole number
_FLUSH = 1e-9  # rad
_AT_ONCE = 1024  # vertices at a time: all of a large room would need gigabytes


@dataclass(frozen=True)
class Edges:
    """Diffracting wedges, one row each; a vertex may have several."""

    points: FloatArray  # (n, 2), m
    starts: FloatArray  # (n,), rad: direction of the wedge's first face
    openings: FloatArray  # (n,), rad: angle of the air, counter-clockwise from the first face
    names: tuple[str, ...]  # as in `via`

    def __len__(self) -> int:
        return len(self.names)


def inside_wedge(direction: FloatArray, start: FloatArray, opening: FloatArray) -> NDArray[np.bool_]:
    """Return whether directions (rad) lie inside wedges, (n,) bool; sound along a face is not diffracted."""
    turned = np.mod(direction - start, math.tau)
    return np.asarray((turned > _FLUSH) & (turned < opening - _FLUSH))


class _Faces(NamedTuple):
    """The faces of walls at vertices, one row each; a wall that continues beyond a vertex has two there."""

    vertices: IntArray  # (f,), numbers, in order
    directions: FloatArray  # (f,), rad, from the vertex along the wall, 0..2π, in order within a vertex
    walls: IntArray  # (f,), numbers


def find_edges(walls: FloatArray, names: tuple[str, ...]) -> Edges:
    """Return the diffracting wedges of walls (n, 4) whose meeting ends have equal coordinates."""
    vertices = np.unique(walls.reshape(-1, 2), axis=0)
    faces = _faces_at(vertices, lay_grid(walls, np.empty((0, 3))))
    following = _following(faces.vertices)
    openings = np.mod(faces.directions[following] - faces.directions, math.tau)
    # a single face has 360° of air
    openings[openings == 0] = math.tau
    rows = np.flatnonzero(_diffracts(openings))
    beside = zip(faces.walls[rows].tolist(), faces.walls[following[rows]].tolist(), strict=True)
    return Edges(
        vertices[faces.vertices[rows]],
        faces.directions[rows],
        openings[rows],
        tuple(_edge_name(first, second, names) for first, second in beside),
    )


def edges_on_walls(edges: Edges, surfaces: Surfaces) -> Listing:
    """Return, for each wall, the edges that lie on it."""
    faces = _faces_at(edges.points, surfaces)
    wall, edge = np.unique(np.column_stack((faces.walls, faces.vertices)), axis=0).T
    starts = np.searchsorted(wall, np.arange(len(surfaces.walls) + 1)).astype(np.int32)
    return Listing(starts, np.ascontiguousarray(edge))


def _faces_at(vertices: FloatArray, surfaces: Surfaces) -> _Faces:
    parts = [
        _list_faces(np.arange(first, min(first + _AT_ONCE, len(vertices))), vertices, surfaces)
        for first in range(0, len(vertices) or 1, _AT_ONCE)
    ]
    vertex, direction, wall = (np.concatenate(column) for column in zip(*parts, strict=True))
    # of flush walls, the first is the face
    order = np.lexsort((wall, np.round(direction / _FLUSH), vertex))
    vertex, direction, wall = vertex[order], direction[order], wall[order]
    own = np.ones(len(order), dtype=np.bool_)
    own[1:] = (vertex[1:] != vertex[:-1]) | (direction[1:] - direction[:-1] > _FLUSH)
    return _Faces(vertex[own].astype(np.int32), direction[own], wall[own])


def _list_faces(
    chosen: NDArray[np.intp], vertices: FloatArray, surfaces: Surfaces
) -> tuple[NDArray[np.intp], FloatArray, IntArray]:
    """Return the faces at some vertices, in any order: number of the vertex, direction (rad) and number of the wall."""
    row, wall = listed_at(surfaces, vertices[chosen])
    vertex = chosen[row]
    are_walls = wall < len(surfaces.walls)
    vertex, wall = vertex[are_walls], wall[are_walls]
    start, end = surfaces.walls[wall, :2], surfaces.walls[wall, 2:]
    along, there = end - start, vertices[vertex] - start
    length = np.hypot(along[:, 0], along[:, 1])
    at = (there[:, 0] * along[:, 0] + there[:, 1] * along[:, 1]) / length
    aside = (along[:, 0] * there[:, 1] - along[:, 1] * there[:, 0]) / length
    on = (np.abs(aside) <= MEETING) & (at >= -MEETING) & (at <= length + MEETING)
    ahead, back = np.flatnonzero(on & (at < length - MEETING)), np.flatnonzero(on & (at > MEETING))
    rows = np.concatenate((ahead, back))
    forward = np.arctan2(along[rows, 1], along[rows, 0])
    forward[len(ahead) :] += math.pi
    return vertex[rows], np.mod(forward, math.tau), wall[rows]


def _following(vertices: IntArray) -> NDArray[np.intp]:
    """Return, for each face, the next one around its vertex, (f,)."""
    following = np.arange(1, len(vertices) + 1)
    last = np.flatnonzero(np.append(vertices[1:] != vertices[:-1], True)[: len(vertices)])
    # the last face of a vertex is followed by its first one, which is listed after the last of the vertex before
    following[last] = np.append(0, last + 1)[: len(last)]
    return following


def _diffracts(openings: FloatArray) -> NDArray[np.bool_]:
    times = math.pi / openings
    return np.asarray((openings > 1e-6) & (np.abs(times - np.round(times)) > _DIVIDES))


def _edge_name(first: int, second: int, names: tuple[str, ...]) -> str:
    if first == second:
        return f"{names[first]}/"
    lower, upper = sorted((first, second))
    return f"{names[lower]}/{names[upper]}"
