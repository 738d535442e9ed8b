"""Paths in space: each path of the plan, together with each sequence of levels that its heights allow.

Walls and posts are upright, floor, ceiling and lids are level. So the plan of a path in space is a path in the plan,
its height folds at levels as between mirrors, and its length is √(plan² + climb²).
"""

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray
from sonarhw_sim.board.transducer import beam_gain
from sonarhw_sim.rays.diffraction import amplitudes_at_edges
from sonarhw_sim.rays.partial_paths import first_of_kind
from sonarhw_sim.rays.paths import SLACK, Paths, PathSearch
from sonarhw_sim.room.grid import IntArray
from sonarhw_sim.room.model import Place, Room
from sonarhw_sim.vertical.folding import Folded, Ways, fold, ways_of
from sonarhw_sim.vertical.level_sequences import LevelSequence
from sonarhw_sim.vertical.plan import Plan
from sonarhw_sim.vertical.reflecting_levels import Levels

_TOGETHER = 1e-9  # m: touches this near to each other in the plan are in the order of the plan


def raised_paths(plan: Plan, levels: Levels, paths: Paths, height: float, search: PathSearch) -> Paths:
    """Return the paths in space from a height (m) back to it, by paths of the plan and levels."""
    ways = ways_of(paths)
    folded = fold(ways, paths.bounces, height, search, plan.obstacles)
    if plan.passing is not None:
        kept = _once(paths, folded)
        folded = Folded._make(column[kept] for column in folded)
    elevations = np.arctan2(folded.totals, paths.lengths[folded.rows])
    gains, phases = _bent(plan.room, paths, folded.rows, elevations, search)
    gains *= np.append(plan.room.reflectances[levels.surfaces], 1.0)[folded.levels].prod(axis=1)
    bent = paths.edges[folded.rows] >= 0
    kept = np.flatnonzero(~bent | (gains * loudest_at(elevations, search) >= search.faintest_diffraction))
    folded, elevations = Folded._make(column[kept] for column in folded), elevations[kept]
    surfaces, bends, points = with_levels(ways, levels, folded)
    count = (folded.levels >= 0).sum(axis=1)
    ends = levels.kernel.heights[folded.levels[np.arange(len(kept))[:, None], np.column_stack((0 * count, count - 1))]]
    return replace(
        paths.select(folded.rows),
        lengths=np.hypot(paths.lengths[folded.rows], folded.totals),
        gains=gains[kept],
        phases=phases[kept],
        surfaces=surfaces,
        bends=bends,
        points=points,
        elevations=elevations[:, None] * np.sign(ends - height),
    )


def _once(paths: Paths, folded: Folded) -> NDArray[np.intp]:
    """Return which of these rows differ in space: through a vertex, several sequences describe one path."""
    rows = folded.rows
    _, sequence = np.unique(folded.levels, axis=0, return_inverse=True)
    kept = np.zeros(len(rows), np.bool_)
    for each in range(int(sequence.max(initial=-1)) + 1):
        of_it = np.flatnonzero(sequence.ravel() == each)
        some = rows[of_it]
        kept[of_it[first_of_kind(paths.lengths[some], paths.edges[some], paths.points[some])]] = True
    return np.flatnonzero(kept)


def _bent(
    room: Room, paths: Paths, rows: NDArray[np.intp], elevations: FloatArray, search: PathSearch
) -> tuple[FloatArray, FloatArray]:
    """Return gains and phases (n,) of rows of paths with these elevations (n,).

    Sound that meets an upright edge at an elevation e is diffracted as in the plan by a wave 1/cos e times as long: the
    field along the edge is a factor exp(jkz sin e).
    """
    gains, phases = paths.gains[rows], paths.phases[rows]
    bent = np.flatnonzero(paths.edges[rows] >= 0)
    if len(bent):
        chosen = rows[bent]
        at_edges = room, paths.edges[chosen], paths.bends[chosen], paths.points[chosen]
        flat = np.full(len(bent), search.wavelength)
        was = amplitudes_at_edges(*at_edges, flat, search.edge_strength)
        now = amplitudes_at_edges(*at_edges, flat / np.cos(elevations[bent]), search.edge_strength)
        gains[bent] *= np.abs(now) / np.maximum(np.abs(was), 1e-300)
        phases[bent] += np.angle(now * was.conj())
    return gains, phases


def loudest_at(elevations: FloatArray, search: PathSearch) -> FloatArray:
    """Return the most that both beams leave of paths with these elevations (n,) at any heading, (n,)."""
    table = loudest_by_elevation(search)
    return table[(np.abs(elevations) / (math.pi / 2) * (len(table) - 1)).astype(np.intp)]


def loudest_by_elevation(search: PathSearch) -> FloatArray:
    """Return the most that both beams leave at any heading, for elevations from 0 to π/2.

    No heading is nearer to a direction than its elevation.
    """
    if search.ka is None or search.axes is not None:
        return np.ones(1)
    angles = np.linspace(0, math.pi / 2, 901)
    return np.asarray(np.maximum.accumulate(beam_gain(angles, search.ka)[::-1])[::-1] ** 2)


def with_levels(ways: Ways, levels: Levels, folded: Folded) -> tuple[IntArray, IntArray, FloatArray]:
    """Return surfaces (n, b), bends (n,) and points (n, b + 3, 2) of paths with touches of levels among the others."""
    rows, most = folded.rows, folded.levels.shape[1]
    at, row = ways.at[rows], np.arange(len(folded.rows))
    lengths = at[row, ways.lasts[rows]]
    touches = lengths[:, None] * folded.climbs / np.maximum(folded.totals, 1e-300)[:, None]
    # levels first: they are so in a right-angled corner of level and wall, where sound touches both at one point
    points = np.concatenate((_along(ways, rows, touches), ways.points[rows]), axis=1)
    met = np.hstack((np.append(levels.surfaces, -1).astype(np.int32)[folded.levels], ways.met[rows]))
    where = np.nan_to_num(np.round(np.hstack((touches, at)) / _TOGETHER), nan=np.inf)
    # source first, receiver last
    where[:, most] = -1.0
    where[row, most + ways.lasts[rows]] = np.round(lengths / _TOGETHER) + 1
    order = np.argsort(where, axis=1, kind="stable")
    met = np.take_along_axis(met, order, axis=1)
    points = np.take_along_axis(points, order[..., None], axis=1)
    # the edge is the one point between source and receiver without a surface
    count = (folded.levels >= 0).sum(axis=1)
    bends = np.where(ways.edges[rows] >= 0, (met[:, 1:] < 0).argmax(axis=1), ways.bends[rows] + count).astype(np.int32)
    surfaces = np.take_along_axis(met, np.argsort(met < 0, axis=1, kind="stable"), axis=1)
    return surfaces[:, : points.shape[1] - 3], bends, points


def _along(ways: Ways, rows: NDArray[np.intp], lengths: FloatArray) -> FloatArray:
    """Return the points (m, k, 2) at `lengths` (m, k) m along these rows of ways, NaN where a length is NaN."""
    at, points = ways.at[rows], ways.points[rows]
    leg = (at[:, None, :] <= lengths[..., None]).sum(axis=2) - 1
    leg = np.clip(leg, 0, ways.lasts[rows][:, None] - 1)
    row = np.arange(len(rows))[:, None]
    start, end = points[row, leg], points[row, leg + 1]
    begin, size = at[row, leg], at[row, leg + 1] - at[row, leg]
    share = (lengths - begin) / np.where(size > 0, size, 1.0)
    return np.asarray(start + share[..., None] * (end - start))


def straight_paths(room: Room, place: Place, levels: Levels, height: float, search: PathSearch) -> list[Paths]:
    """Return the paths that only go up and down between the levels, one table each."""
    lower, upper = room.heights[room.posts_at(place.position)].T
    return [
        _straight(room, place, levels, sequence)
        for sequence in _up_and_down(levels, place, height, search)
        # no post stands in the way
        if not ((lower < sequence.heights.max()) & (upper > sequence.heights.min())).any()
    ]


def _up_and_down(levels: Levels, place: Place, height: float, search: PathSearch) -> Iterator[LevelSequence]:
    """Yield the sequences between the nearest levels below and above a place."""
    here, heights = np.array([place.position]), levels.kernel.heights
    covers = np.array([lid is None or bool(lid.covers(here)[0]) for lid in levels.lids], dtype=np.bool_)
    below = np.flatnonzero(covers & (heights < height) & (levels.kernel.facing > 0))
    above = np.flatnonzero(covers & (heights > height) & (levels.kernel.facing < 0))
    nearest = below[np.argsort(-heights[below])[:1]].tolist(), above[np.argsort(heights[above])[:1]].tolist()
    for first, second in (nearest, nearest[::-1]):
        rows: tuple[int, ...] = ()
        while len(rows) < search.max_bounces and (following := (first, second)[len(rows) % 2]):
            rows = (*rows, *following)
            sequence = LevelSequence(rows, np.array([height, *heights[list(rows)], height]))
            if sequence.climb > search.max_length + SLACK:
                break
            yield sequence


def _straight(room: Room, place: Place, levels: Levels, sequence: LevelSequence) -> Paths:
    count, whole = len(sequence.levels), np.array([-1], np.int32)
    surfaces = levels.surfaces[[list(sequence.levels)]]
    up, down = sequence.signs
    return Paths(
        lengths=np.array([sequence.climb]),
        departures=np.zeros(1),
        arrivals=np.zeros(1),
        gains=room.reflectances[surfaces].prod(axis=1),
        phases=np.zeros(1),
        spreads=np.zeros(1),
        surfaces=surfaces,
        edges=whole,
        bends=np.array([count], np.int32),
        elevations=np.array([[up * math.pi / 2, down * math.pi / 2]]),
        points=np.concatenate((np.tile(place.position, (1, count + 2, 1)), np.full((1, 1, 2), np.nan)), axis=1),
    )
