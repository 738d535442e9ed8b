"""Edges: the wall ends and corners that diffract sound.

Takes wall segments; hands on one `Edges` row for every wedge of air that meets at a vertex and bends sound. A wedge
whose angle divides 180°, such as an inner right angle, does not diffract, it reflects: Keller's coefficient is 0.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim.grid import Listing, Surfaces, lay_grid, listed_at
from sim.room_file import MEETING
from sonarhw.readings import FloatArray

_DIVIDES = 1e-6  # how near 180° / angle must come to a whole number
_FLUSH = 1e-9  # rad


@dataclass(frozen=True)
class Edges:
    """Diffracting wedges, one row each; a vertex may have several."""

    points: FloatArray  # (n, 2), m
    starts: FloatArray  # (n,), rad: direction of the wedge's first face
    openings: FloatArray  # (n,), rad of air, counter-clockwise from the first face
    names: tuple[str, ...]  # as `via` writes them

    def __len__(self) -> int:
        return len(self.names)


def inside_wedge(direction: FloatArray, start: FloatArray, opening: FloatArray) -> NDArray[np.bool_]:
    """Whether directions (rad) lie inside wedges, (n,) bool; along a face sound grazes past and is not bent."""
    turned = np.mod(direction - start, math.tau)
    return np.asarray((turned > _FLUSH) & (turned < opening - _FLUSH))


class _Face(NamedTuple):
    direction: float  # rad, from the vertex along the wall
    wall: int


def find_edges(walls: FloatArray, names: tuple[str, ...]) -> Edges:
    """The diffracting wedges of walls (n, 4) whose meeting ends have equal coordinates."""
    surfaces = lay_grid(walls, np.empty((0, 3)))
    rows = [
        (vertex, first.direction, opening, _edge_name(first, second, names))
        for vertex in np.unique(walls.reshape(-1, 2), axis=0).tolist()
        for first, second, opening in _wedges(_faces_at(vertex, surfaces))
        if _diffracts(opening)
    ]
    return Edges(
        np.array([row[0] for row in rows], dtype=np.float64).reshape(-1, 2),
        np.array([row[1] for row in rows], dtype=np.float64),
        np.array([row[2] for row in rows], dtype=np.float64),
        tuple(row[3] for row in rows),
    )


def edges_on_walls(edges: Edges, surfaces: Surfaces) -> Listing:
    """For each wall, the edges that lie on it."""
    on = [(face.wall, k) for k, point in enumerate(edges.points.tolist()) for face in _faces_at(point, surfaces)]
    wall, edge = np.array(sorted(set(on)), dtype=np.int32).reshape(-1, 2).T
    starts = np.searchsorted(wall, np.arange(len(surfaces.walls) + 1)).astype(np.int32)
    return Listing(starts, np.ascontiguousarray(edge))


def _faces_at(vertex: list[float], surfaces: Surfaces) -> list[_Face]:
    faces = []
    for k in listed_at(surfaces, *vertex).tolist():
        x0, y0, x1, y1 = surfaces.walls[k].tolist()
        ex, ey, vx, vy = x1 - x0, y1 - y0, vertex[0] - x0, vertex[1] - y0
        length = math.hypot(ex, ey)
        at, aside = (vx * ex + vy * ey) / length, (ex * vy - ey * vx) / length
        if abs(aside) > MEETING or not -MEETING <= at <= length + MEETING:
            continue
        forward = math.atan2(ey, ex)
        if at < length - MEETING:
            faces.append(_Face(forward % math.tau, k))
        if at > MEETING:
            faces.append(_Face((forward + math.pi) % math.tau, k))
    faces.sort()
    # walls flush with one another are one face
    return [face for k, face in enumerate(faces) if k == 0 or face.direction - faces[k - 1].direction > _FLUSH]


def _wedges(faces: list[_Face]) -> list[tuple[_Face, _Face, float]]:
    following = faces[1:] + faces[:1]
    # one face alone has all the air round it
    return [(a, b, (b.direction - a.direction) % math.tau or math.tau) for a, b in zip(faces, following, strict=True)]


def _diffracts(opening: float) -> bool:
    times = math.pi / opening
    return opening > 1e-6 and abs(times - round(times)) > _DIVIDES


def _edge_name(first: _Face, second: _Face, names: tuple[str, ...]) -> str:
    if first.wall == second.wall:
        return f"{names[first.wall]}/"
    lower, upper = sorted((first.wall, second.wall))
    return f"{names[lower]}/{names[upper]}"
