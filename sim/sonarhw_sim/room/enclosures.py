"""Enclosures: closed chains of walls, and the edges that no sound from a place can reach because they are beyond one.

A closed room has an outer edge at every corner. The search of paths to these would take as long as all the rest.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray
from sonarhw_sim.room.edges import Edges
from sonarhw_sim.room.outside import wall_distances
from sonarhw_sim.room.room_file import MEETING

BoolArray = NDArray[np.bool_]

_MOST_CORNERS = 2000  # of a chain: the test of inside and outside takes quadratic time
_BESIDE = 1e-6  # of a wall's length: distance from a corner at which its air is tested


@dataclass(frozen=True)
class Enclosures:
    """The closed chains of a room, and the edges at their corners."""

    walls: FloatArray  # (w, 4): one chain after the other
    starts: NDArray[np.intp]  # (c,): first row of each chain in `walls`
    edges: NDArray[np.intp]  # (e,): rows in the room's edges
    chains: NDArray[np.intp]  # (e,): the chain of each
    inside: BoolArray  # (e,): whether the air of each lies inside its chain
    count: int  # of the room's edges

    def separated_from(self, point: FloatArray) -> BoolArray:
        """Return which edges have their air on the other side of their chain than `point` (2,), (count,) bool."""
        shut = np.zeros(self.count, dtype=np.bool_)
        if len(self.starts):
            within = np.add.reduceat(_passed(point[None], self.walls)[0].astype(np.intp), self.starts) % 2 == 1
            # a point on a wall is on both sides
            apart = np.minimum.reduceat(wall_distances(point[None], self.walls)[0], self.starts) > MEETING
            shut[self.edges] = apart[self.chains] & (self.inside != within[self.chains])
        return shut

    def is_outside_of_all(self, point: FloatArray, walls: FloatArray) -> bool:
        """Return whether `point` (2,) is in no chain, and one chain encloses all `walls` (n, 4) of the room."""
        ends, chains = walls.reshape(-1, 2), self._chains()
        round_all = any(
            (chain.reshape(-1, 2).min(axis=0) <= ends.min(axis=0) + MEETING).all()
            and (chain.reshape(-1, 2).max(axis=0) >= ends.max(axis=0) - MEETING).all()
            for chain in chains
        )
        return round_all and not any(
            inside(point[None], chain)[0] or wall_distances(point[None], chain).min() <= MEETING for chain in chains
        )

    def chains_around(self, point: FloatArray) -> list[FloatArray]:
        """Return the walls (n, 4) of each closed chain that contains `point` (2,)."""
        return [chain for chain in self._chains() if inside(point[None], chain)[0]]

    def _chains(self) -> list[FloatArray]:
        return np.split(self.walls, self.starts[1:]) if len(self.starts) else []


def find_enclosures(walls: FloatArray, edges: Edges) -> Enclosures:
    """Return the closed chains of walls (n, 4) whose meeting ends have equal coordinates, two walls at each corner."""
    corners, at = np.unique(walls.reshape(-1, 2), axis=0, return_inverse=True)
    chains = [chain for chain in _closed_chains(at.reshape(-1, 2), len(corners)) if len(chain) <= _MOST_CORNERS]
    lengths = np.array([len(chain) for chain in chains], dtype=np.intp)
    of_corner = {
        corner: number for number, chain in enumerate(chains) for corner in map(tuple, walls[chain, :2].tolist())
    } | {corner: number for number, chain in enumerate(chains) for corner in map(tuple, walls[chain, 2:].tolist())}
    rows = [
        (row, of_corner[corner]) for row, corner in enumerate(map(tuple, edges.points.tolist())) if corner in of_corner
    ]
    at_corners, chain_of = np.array(rows, dtype=np.intp).reshape(-1, 2).T
    return Enclosures(
        walls[np.array([wall for chain in chains for wall in chain], dtype=np.intp)].reshape(-1, 4),
        np.cumsum(lengths) - lengths,
        at_corners,
        chain_of,
        _air_inside(walls, chains, edges, at_corners, chain_of),
        len(edges),
    )


def _air_inside(
    walls: FloatArray,
    chains: list[list[int]],
    edges: Edges,
    rows: NDArray[np.intp],
    chain_of: NDArray[np.intp],
) -> BoolArray:
    middle = edges.starts[rows] + edges.openings[rows] / 2
    aside = np.column_stack((np.cos(middle), np.sin(middle)))
    within = np.zeros(len(rows), dtype=np.bool_)
    # rows grouped by chain
    order = np.argsort(chain_of, kind="stable")
    bounds = np.searchsorted(chain_of[order], np.arange(len(chains) + 1))
    for number, chain in enumerate(chains):
        here = order[bounds[number] : bounds[number + 1]]
        around = walls[chain]
        shortest = np.hypot(around[:, 2] - around[:, 0], around[:, 3] - around[:, 1]).min()
        within[here] = inside(edges.points[rows[here]] + _BESIDE * shortest * aside[here], around)
    return within


def inside(points: FloatArray, walls: FloatArray) -> BoolArray:
    """Return which points (m, 2) a closed chain of walls (k, 4) encloses an odd number of times, (m,) bool."""
    return np.asarray(_passed(points, walls).sum(axis=1) % 2 == 1)


def _passed(points: FloatArray, walls: FloatArray) -> BoolArray:
    """Return which walls (k, 4) a ray from each point (m, 2) along x passes, (m, k) bool."""
    x, y = points[:, :1], points[:, 1:]
    x0, y0, x1, y1 = walls.T
    crosses = (y0 > y) != (y1 > y)
    rise = np.where(y1 == y0, 1.0, y1 - y0)
    return np.asarray(crosses & (x < x0 + (y - y0) / rise * (x1 - x0)))


def _closed_chains(ends: NDArray[np.intp], corners: int) -> Iterator[list[int]]:
    """Yield the walls of each closed chain, in order; `ends` (n, 2) are the corners that each wall joins."""
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


@dataclass(frozen=True)
class Lid:
    """The upper or lower end of a closed chain of walls, or of a post."""

    upper: bool
    span: tuple[float, float]  # m: heights of both ends of the solid
    sides: range  # numbers of its walls, or of its post
    corners: FloatArray  # (k, 2), m: of the outline, in order; of a round one the centre
    radius: float = 0.0  # m, of a round one

    @property
    def height(self) -> float:
        """Its height, m."""
        return self.span[int(self.upper)]

    @property
    def box(self) -> tuple[float, float, float, float]:
        """Least x, least y, largest x, largest y, m."""
        (left, bottom), (right, top) = self.corners.min(axis=0) - self.radius, self.corners.max(axis=0) + self.radius
        return float(left), float(bottom), float(right), float(top)

    def covers(self, points: FloatArray) -> NDArray[np.bool_]:
        """Return whether points (n, 2) m are within its outline, (n,) bool."""
        if self.radius > 0.0:
            return np.asarray(np.hypot(*(points - self.corners[0]).T) < self.radius)
        x, y = points.T[..., None]
        (x0, y0), (x1, y1) = self.corners.T, np.roll(self.corners, -1, axis=0).T
        beside = (y0 > y) != (y1 > y)
        rise = np.where(y1 == y0, 1.0, y1 - y0)
        crossed = beside & (x < x0 + (y - y0) / rise * (x1 - x0))
        return np.asarray(crossed.sum(axis=1) % 2 == 1)

    def surrounds(self, x: float, y: float, height: float) -> bool:
        """Return whether a point in space (m) is inside of the solid that it closes."""
        return self.span[0] < height < self.span[1] and bool(self.covers(np.array([[x, y]]))[0])
