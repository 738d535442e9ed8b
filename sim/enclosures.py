"""Enclosures: closed chains of walls, and the edges that no sound from a place can reach for lying beyond one.

Takes walls and edges; hands on `Enclosures`, once a room. A closed room has an edge outside at every corner, and ways
to those would be sought for as long as all the rest.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim.edges import Edges
from sim.room_file import MEETING
from sonarhw.readings import FloatArray

BoolArray = NDArray[np.bool_]

_MOST_CORNERS = 2000  # of a chain: telling inside from outside takes the square of it
_BESIDE = 1e-6  # of a wall's length: how far from a corner its air is looked at


@dataclass(frozen=True)
class Chain:
    """One closed chain of walls and the edges at its corners."""

    walls: FloatArray  # (k, 4)
    edges: NDArray[np.intp]  # (e,): rows in the room's edges
    inside: BoolArray  # (e,): whether the air of each lies inside


@dataclass(frozen=True)
class Enclosures:
    """The closed chains of a room."""

    chains: tuple[Chain, ...]
    edges: int  # how many the room has

    def shut_off(self, point: FloatArray) -> BoolArray:
        """Which of the room's edges have their air on the other side of a chain than `point` (2,), (edges,) bool."""
        shut = np.zeros(self.edges, dtype=np.bool_)
        for chain in self.chains:
            # on a wall there is no telling
            if _distance(point, chain.walls) > MEETING:
                shut[chain.edges] |= chain.inside != inside(point[None], chain.walls)[0]
        return shut


def find_enclosures(walls: FloatArray, edges: Edges) -> Enclosures:
    """The closed chains of walls (n, 4) whose meeting ends have equal coordinates, each corner of two walls."""
    corners, at = np.unique(walls.reshape(-1, 2), axis=0, return_inverse=True)
    ends = at.reshape(-1, 2)
    chains = [walls[chain] for chain in _closed_chains(ends, len(corners)) if len(chain) <= _MOST_CORNERS]
    return Enclosures(tuple(_with_edges(chain, edges) for chain in chains), len(edges))


def inside(points: FloatArray, walls: FloatArray) -> BoolArray:
    """Which points (m, 2) a closed chain of walls (k, 4) goes round an odd number of times, (m,) bool."""
    x, y = points[:, :1], points[:, 1:]
    x0, y0, x1, y1 = walls.T
    crosses = (y0 > y) != (y1 > y)
    rise = np.where(y1 == y0, 1.0, y1 - y0)
    return np.asarray((crosses & (x < x0 + (y - y0) / rise * (x1 - x0))).sum(axis=1) % 2 == 1)


def _closed_chains(ends: NDArray[np.intp], corners: int) -> Iterator[list[int]]:
    """The walls of each closed chain, in order; `ends` (n, 2) are the corners that each wall joins."""
    meeting: list[list[int]] = [[] for _ in range(corners)]
    for wall, (start, end) in enumerate(ends.tolist()):
        meeting[start].append(wall)
        meeting[end].append(wall)
    seen: set[int] = set()
    for first in range(len(ends)):
        chain, corner, wall = [], int(ends[first, 0]), first
        while wall not in seen:
            seen.add(wall)
            chain.append(wall)
            corner = int(ends[wall].sum()) - corner
            if len(meeting[corner]) != 2:
                break
            wall = sum(meeting[corner]) - wall
        if len(chain) > 2 and wall == first and corner == ends[first, 0]:
            yield chain


def _with_edges(walls: FloatArray, edges: Edges) -> Chain:
    corners = {(x, y) for x, y in walls[:, :2].tolist()} | {(x, y) for x, y in walls[:, 2:].tolist()}
    rows = np.array([k for k, (x, y) in enumerate(edges.points.tolist()) if (x, y) in corners], dtype=np.intp)
    shortest = np.hypot(walls[:, 2] - walls[:, 0], walls[:, 3] - walls[:, 1]).min()
    middle = edges.starts[rows] + edges.openings[rows] / 2
    beside = edges.points[rows] + _BESIDE * shortest * np.column_stack((np.cos(middle), np.sin(middle)))
    return Chain(walls, rows, inside(beside, walls))


def _distance(point: FloatArray, walls: FloatArray) -> float:
    starts, along = walls[:, :2], walls[:, 2:] - walls[:, :2]
    share = np.clip(((point - starts) * along).sum(axis=1) / (along**2).sum(axis=1), 0.0, 1.0)
    return float(np.hypot(*(starts + share[:, None] * along - point).T).min(initial=math.inf))
