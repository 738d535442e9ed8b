"""The plan of a room with heights: walls, posts and edges of all heights, with the heights at which each exists."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sonarhw.readings import FloatArray
from sonarhw_sim.rays.passing import Passing, only
from sonarhw_sim.rays.paths import PathSearch
from sonarhw_sim.room.edges import Edges, find_edges
from sonarhw_sim.room.enclosures import find_enclosures
from sonarhw_sim.room.grid import IntArray
from sonarhw_sim.room.model import Room
from sonarhw_sim.room.room_file import Span
from sonarhw_sim.vertical.folding import BoolArray, Obstacles
from sonarhw_sim.vertical.reflecting_levels import Levels


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
    bounds = np.unique(spans[np.isfinite(spans)])
    middles = np.concatenate((bounds[:1] - 1, (bounds[:-1] + bounds[1:]) / 2, bounds[-1:] + 1))
    edges_at_all, at_bands = _edges_of_bands(room, spans, middles)
    plan = replace(room, edges=edges_at_all)
    plan.__dict__["surfaces"] = surfaces
    plan.__dict__["enclosures"] = find_enclosures(room.walls[~low[: len(room.walls)]], edges_at_all)
    obstacles = Obstacles(passing.passable, spans, low, bounds, at_bands, levels.kernel)
    return Plan(plan, passing, obstacles, edge_numbers(edges_at_all, room, range(len(room.walls))))


def _edges_of_bands(room: Room, spans: FloatArray, middles: FloatArray) -> tuple[Edges, BoolArray]:
    """Return all edges that exist in bands with these middle heights, and in which each exists, (e, b) bool."""
    found: dict[tuple[object, ...], tuple[Edges, int]] = {}
    bands: dict[tuple[object, ...], list[int]] = {}
    for band, height in enumerate(middles.tolist()):
        walls = np.flatnonzero((spans[: len(room.walls), 0] < height) & (height < spans[: len(room.walls), 1]))
        here = find_edges(room.walls[walls], tuple(room.names[wall] for wall in walls.tolist()))
        here = replace(here, faces=walls[here.faces].astype(np.int32))
        for row, bare in enumerate(_bare(here).tolist()):
            key = (*here.points[row].tolist(), here.starts[row], here.openings[row], *here.faces[row].tolist(), *bare)
            found.setdefault(key, (here, row))
            bands.setdefault(key, []).append(band)
    exists = np.zeros((len(found), len(middles)), np.bool_)
    for row, of_edge in enumerate(bands.values()):
        exists[row, of_edge] = True
    return _joined(list(found.values())), exists


def _joined(rows: list[tuple[Edges, int]]) -> Edges:
    return Edges(
        np.array([edges.points[row] for edges, row in rows]).reshape(-1, 2),
        np.array([edges.starts[row] for edges, row in rows]),
        np.array([edges.openings[row] for edges, row in rows]),
        np.array([edges.faces[row] for edges, row in rows], dtype=np.int32).reshape(-1, 2),
        tuple(edges.names[row] for edges, row in rows),
        np.array([_bare(edges)[row] for edges, row in rows]).reshape(-1, 2),
    )


def _bare(edges: Edges) -> FloatArray:
    return np.full((len(edges), 2), np.inf) if edges.bare is None else edges.bare


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
