"""Rims: the level ends of walls that bend sound, as straight edges in space."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray
from sonarhw_sim.room.edges import Edges
from sonarhw_sim.room.grid import IntArray
from sonarhw_sim.room.model import Room
from sonarhw_sim.room.room_file import MEETING
from sonarhw_sim.vertical.reflecting_levels import Levels

_ASIDE = 1e-5  # m: on one side of a wall, no lid ends so near to it
_ABOVE, _BELOW = math.pi / 2, 3 * math.pi / 2


@dataclass(frozen=True)
class Rims:
    """Parts of the ends of walls, one row each.

    Angles are those about the rim, seen along it: 0 to the left of its wall, π/2 upwards.
    """

    walls: FloatArray  # (r, 4): x, y of start and end, m
    owners: IntArray  # (r,): number of the wall
    wedges: Edges  # their wedges of air in the upright plane across, where the height is the second coordinate
    surfaces: IntArray  # (r, 2): surface of the first and of the last face
    edges: IntArray  # (r,): their numbers in the room

    def __len__(self) -> int:
        return len(self.owners)


def find_rims(room: Room, levels: Levels) -> Rims:
    """Return the rims of a room's walls that sound between these levels can reach."""
    found = [
        rim
        for wall in np.flatnonzero(np.isfinite(room.heights[: len(room.walls)]).any(axis=1)).tolist()
        for rim in _rims_of(room, wall, levels)
    ]
    surfaces = np.array([[rim.first, rim.last] for rim in found], dtype=np.int32).reshape(-1, 2)
    return Rims(
        np.array([rim.ends for rim in found]).reshape(-1, 4),
        np.array([rim.owner for rim in found], dtype=np.int32),
        Edges(
            np.array([(0.0, rim.height) for rim in found]).reshape(-1, 2),
            np.array([rim.start for rim in found]),
            np.array([rim.opening for rim in found]),
            _sides(room, surfaces),
            tuple(room.edge_name(room.edge_between(rim.owner, rim.other)) for rim in found),
        ),
        surfaces,
        np.array([room.edge_between(rim.owner, rim.other) for rim in found], dtype=np.int32),
    )


def _sides(room: Room, surfaces: IntArray) -> IntArray:
    """Return the faces of wedges, with numbers of their own for lids: sound along a lid is not followed."""
    apart = len(room.names) + np.arange(surfaces.size).reshape(surfaces.shape)
    return np.where(surfaces < len(room.walls), surfaces, apart).astype(np.int32)


@dataclass(frozen=True)
class _Rim:
    ends: tuple[float, float, float, float]
    height: float
    owner: int  # the wall
    other: int  # the surface that it meets here; itself if it ends free
    first: int  # surfaces of the wedge
    last: int
    start: float  # rad
    opening: float  # rad


def _rims_of(room: Room, wall: int, levels: Levels) -> Iterator[_Rim]:
    start, end = room.walls[wall, :2], room.walls[wall, 2:]
    length = float(np.hypot(*(end - start)))
    along = (end - start) / length
    flush, begins, stops = _flush(room.walls, start, along, length)
    for height in room.heights[wall].tolist():
        if not levels.floor + MEETING < height < levels.ceiling - MEETING:
            continue
        cuts = np.unique(np.clip(np.concatenate(([0.0, length], begins, stops)), 0.0, length))
        for low, high in zip(cuts[:-1].tolist(), cuts[1:].tolist(), strict=True):
            if high - low <= MEETING:
                continue
            middle = (low + high) / 2
            here = flush[(begins < middle) & (middle < stops)]
            at_end = (np.abs(room.heights[here] - height) <= MEETING).any(axis=1)
            # walls on one line have one rim
            if here[at_end].min() == wall:
                faces = dict(_faces(room, here, start + middle * along, along, height))
                ends = (*(start + low * along).tolist(), *(start + high * along).tolist())
                yield from _wedges(ends, height, wall, faces)


def _flush(
    walls: FloatArray, start: FloatArray, along: FloatArray, length: float
) -> tuple[NDArray[np.intp], FloatArray, FloatArray]:
    """Return the walls on one line with a wall, and where along it they begin and end, m."""
    away = walls.reshape(-1, 2, 2) - start
    aside = np.abs(away[..., 0] * along[1] - away[..., 1] * along[0]).max(axis=1)
    at = away @ along
    begins, ends = at.min(axis=1), at.max(axis=1)
    on = np.flatnonzero((aside <= MEETING) & (ends > MEETING) & (begins < length - MEETING))
    return on, begins[on], ends[on]


def _faces(
    room: Room, walls: NDArray[np.intp], point: FloatArray, along: FloatArray, height: float
) -> Iterator[tuple[float, int]]:
    """Yield angle (rad) and number of the surfaces that meet at a height at a point of some walls on one line."""
    lower, upper = room.heights[walls].T
    for side, at in ((_ABOVE, height + 2 * MEETING), (_BELOW, height - 2 * MEETING)):
        there = walls[(lower < at) & (at < upper)]
        if len(there):
            yield side, int(there[0])
    left = np.array([-along[1], along[0]])
    for surface in room.levels:
        lid = room.lid(surface)
        if lid is None or abs(lid.height - height) > MEETING or not set(lid.sides) & set(walls.tolist()):
            continue
        on_left, on_right = lid.covers(point + _ASIDE * np.vstack((left, -left)))
        if on_left != on_right:
            yield (0.0 if on_left else math.pi), surface


def _wedges(
    ends: tuple[float, float, float, float], height: float, owner: int, faces: dict[float, int]
) -> Iterator[_Rim]:
    """Yield the wedge of air between these faces that bends sound, if there is one."""
    angles = sorted(faces)
    for k, angle in enumerate(angles):
        following = angles[(k + 1) % len(angles)]
        opening = math.fmod(following - angle + math.tau, math.tau) or math.tau
        if opening > math.pi + 1.0:
            first, last = faces[angle], faces[following]
            other = faces.get(0.0, faces.get(math.pi, owner))
            yield _Rim(ends, height, owner, other, first, last, angle, opening)
