"""The plan of a room with heights: walls, posts and edges of all heights, with the heights at which each exists."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sonarhw.readings import FloatArray
from sonarhw_sim.rays.passing import Passing, only
from sonarhw_sim.rays.paths import PathSearch
from sonarhw_sim.room.edges import Edges
from sonarhw_sim.room.enclosures import find_enclosures
from sonarhw_sim.room.grid import IntArray
from sonarhw_sim.room.model import Room
from sonarhw_sim.room.room_file import Span
from sonarhw_sim.vertical.reflecting_levels import Levels
from sonarhw_sim.vertical.ways import Obstacles


@dataclass(frozen=True)
class Plan:
    """A room as seen from above."""

    room: Room  # with the edges of all heights
    passing: Passing | None  # None: no surface is low
    obstacles: Obstacles
    edges: IntArray  # (e + 1,): number of each edge in the given room; the last, for row -1, is -1


def plan_of(room: Room, height: float, levels: Levels, reach: Span, climbs: FloatArray, search: PathSearch) -> Plan:
    """Return the plan for a place at a height (m), and sound that stays between the heights `reach` (m).

    `climbs` (c,) m are what the paths to find go up and down, negative if they first go down.
    """
    spans = room.heights[: room.levels.start]
    low = (spans[:, 0] > reach[0]) | (spans[:, 1] < reach[1])
    surfaces = room.surfaces
    if not low.any():
        edges = np.append(np.arange(len(room.edges)), -1).astype(np.int32)
        everywhere = np.ones((len(room.edges), 1), np.bool_)
        obstacles = Obstacles(only(surfaces, low), spans, low, np.empty(0), everywhere, levels.kernel)
        return Plan(room, None, obstacles, edges)
    lids = bool(levels.kernel.limited.any())
    passing = Passing(surfaces, spans, low, height, levels.floor, levels.ceiling, climbs, search.max_length, lids)
    bounds, edges_at_all, at_bands = room.edges_by_height
    plan = replace(room, edges=edges_at_all)
    plan.__dict__["surfaces"] = surfaces
    plan.__dict__["enclosures"] = find_enclosures(room.walls[~low[: len(room.walls)]], edges_at_all)
    obstacles = Obstacles(passing.passable, spans, low, bounds, at_bands, levels.kernel)
    return Plan(plan, passing, obstacles, edge_numbers(edges_at_all, room, range(len(room.walls))))


def edge_numbers(edges: Edges, room: Room, walls: Sequence[int]) -> IntArray:
    """Return the numbers in a room of edges of some of its `walls`, (e + 1,); the last, for row -1, is -1."""
    rows = {corner: row for row, corner in enumerate(_corners(room.edges))}
    numbers = [
        rows.get(corner, room.edge_between(*sorted((walls[first], walls[last]))))
        for corner, (first, last) in zip(_corners(edges), edges.faces.tolist(), strict=True)
    ]
    return np.array([*numbers, -1], dtype=np.int32)


def _corners(edges: Edges) -> list[tuple[float, float, str]]:
    return [(x, y, name) for (x, y), name in zip(edges.points.tolist(), edges.names, strict=True)]
