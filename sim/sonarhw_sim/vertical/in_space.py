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
from sonarhw_sim.board.transducer import ComplexArray
from sonarhw_sim.compiled import compiled
from sonarhw_sim.rays.diffraction import amplitudes_at_edges
from sonarhw_sim.rays.partial_paths import first_of_kind, hashes_of
from sonarhw_sim.rays.paths import SLACK, Paths, PathSearch
from sonarhw_sim.room.grid import IntArray
from sonarhw_sim.room.model import Place, Room
from sonarhw_sim.vertical.folding import Folded, fold
from sonarhw_sim.vertical.level_sequences import LevelSequence
from sonarhw_sim.vertical.plan import Plan
from sonarhw_sim.vertical.reflecting_levels import Levels
from sonarhw_sim.vertical.ways import Ways, ways_of

_TOGETHER = 1e-9  # m: touches this near to each other in the plan are in the order of the plan


def raised_paths(plan: Plan, levels: Levels, paths: Paths, height: float, search: PathSearch) -> Paths:
    """Return the paths in space from a height (m) back to it, by paths of the plan and levels."""
    ways, at_edges = ways_of(paths), _at_edges(plan.room, paths, search)
    folded = fold(ways, paths.bounces, _steepest(paths, at_edges, search), height, search, plan.obstacles)
    if plan.passing is not None:
        kept = _once(paths, folded)
        folded = Folded._make(column[kept] for column in folded)
    elevations = np.arctan2(folded.totals, paths.lengths[folded.rows])
    gains, phases = _bent(plan.room, paths, at_edges, folded.rows, elevations, search)
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
    kinds = hashes_of(np.column_stack((folded.levels, paths.edges[rows])))
    return np.flatnonzero(first_of_kind(paths.lengths, kinds, paths.points, rows=rows))


def _at_edges(room: Room, paths: Paths, search: PathSearch) -> ComplexArray:
    """Return the amplitudes of the edges of paths in the plan, (n,); 1 without an edge."""
    amplitudes = np.ones(len(paths), np.complex128)
    bent = np.flatnonzero(paths.edges >= 0)
    if len(bent):
        amplitudes[bent] = _amplitudes(room, paths, bent, np.full(len(bent), search.wavelength), search)
    return amplitudes


def _amplitudes(
    room: Room, paths: Paths, rows: NDArray[np.intp], wavelengths: FloatArray, search: PathSearch
) -> ComplexArray:
    """Return the amplitudes of the edges of these rows (m,) of paths, for wavelengths (m,), m."""
    at_edges = paths.edges[rows], paths.bends[rows], paths.points[rows]
    return amplitudes_at_edges(room, *at_edges, wavelengths, search.edge_strength)


def _steepest(paths: Paths, at_edges: ComplexArray, search: PathSearch) -> FloatArray:
    """Return the slopes beyond which the edges of paths are too faint, (n,); inf without an edge."""
    table = search.loudest_by_elevation
    # no edge has an amplitude over 1
    most = paths.gains / np.maximum(np.abs(at_edges), 1e-300)
    loud = np.searchsorted(-table, -search.faintest_diffraction / np.maximum(most, 1e-300), side="right")
    # the last value of the table is that of upright sound only
    limited = (paths.edges >= 0) & (loud < len(table) - 1)
    slopes = np.tan(math.pi / 2 * np.where(limited, loud, 0) / max(len(table) - 1, 1))
    return np.where(limited, slopes, np.inf)


def _bent(
    room: Room,
    paths: Paths,
    at_edges: ComplexArray,
    rows: NDArray[np.intp],
    elevations: FloatArray,
    search: PathSearch,
) -> tuple[FloatArray, FloatArray]:
    """Return gains and phases (m,) of rows (m,) of paths with these elevations (m,).

    Sound that meets an upright edge at an elevation e is diffracted as in the plan by a wave 1/cos e times as long: the
    field along the edge is a factor exp(jkz sin e). `at_edges` (n,) are the amplitudes in the plan.
    """
    gains, phases = paths.gains[rows], paths.phases[rows]
    bent = np.flatnonzero(paths.edges[rows] >= 0)
    if len(bent):
        was = at_edges[rows[bent]]
        now = _amplitudes(room, paths, rows[bent], search.wavelength / np.cos(elevations[bent]), search)
        gains[bent] *= np.abs(now) / np.maximum(np.abs(was), 1e-300)
        phases[bent] += np.angle(now * was.conj())
    return gains, phases


def loudest_at(elevations: FloatArray, search: PathSearch) -> FloatArray:
    """Return the most that both beams leave of paths with these elevations (n,) at any heading, (n,)."""
    table = search.loudest_by_elevation
    return table[(np.abs(elevations) / (math.pi / 2) * (len(table) - 1)).astype(np.intp)]


def with_levels(ways: Ways, levels: Levels, folded: Folded) -> tuple[IntArray, IntArray, FloatArray]:
    """Return surfaces (n, b), bends (n,) and points (n, b + 3, 2) of paths with touches of levels among the others."""
    count = len(folded.rows)
    most = int((ways.lasts[folded.rows] - 1 + (folded.levels >= 0).sum(axis=1)).max(initial=0))
    surfaces, points = np.full((count, most), -1, np.int32), np.full((count, most + 3, 2), np.nan)
    bends = np.empty(count, np.int32)
    _merge(ways, levels.surfaces, folded, surfaces, bends, points)
    return surfaces, bends, points


@compiled
def _merge(
    ways: Ways, numbers: IntArray, folded: Folded, surfaces: IntArray, bends: IntArray, points: FloatArray
) -> None:
    """Fill in the result of `with_levels`, which is all -1 and NaN before; `numbers` (l,) are those of the levels."""
    for k in range(folded.rows.shape[0]):
        row = folded.rows[k]
        last, length, total = ways.lasts[row], ways.at[row, ways.lasts[row]], max(folded.totals[k], 1e-300)
        leg, level, touches, found = 0, 0, 0, 1
        points[k, 0] = ways.points[row, 0]
        bends[k] = -1
        while True:
            reached = level == folded.levels.shape[1] or folded.levels[k, level] < 0
            along = length if reached else length * folded.climbs[k, level] / total
            # levels first: they are so in a right-angled corner of level and wall, touched at one point
            if leg + 1 < last and (reached or round(ways.at[row, leg + 1] / _TOGETHER) < round(along / _TOGETHER)):
                leg += 1
                points[k, found] = ways.points[row, leg]
                surface = ways.met[row, leg]
            elif reached:
                break
            else:
                size = ways.at[row, leg + 1] - ways.at[row, leg]
                share = (along - ways.at[row, leg]) / (size if size > 0.0 else 1.0)
                for axis in range(2):
                    begin = ways.points[row, leg, axis]
                    points[k, found, axis] = begin + share * (ways.points[row, leg + 1, axis] - begin)
                surface = numbers[folded.levels[k, level]]
                level += 1
            found += 1
            if surface >= 0:
                surfaces[k, touches] = surface
                touches += 1
            else:
                # the edge is the one point between source and receiver without a surface
                bends[k] = touches
        points[k, found] = ways.points[row, last]
        if bends[k] < 0:
            bends[k] = ways.bends[row] + level


def straight_paths(room: Room, place: Place, levels: Levels, height: float, search: PathSearch) -> list[Paths]:
    """Return the paths that only go up and down between the levels, one table each."""
    lower, upper = room.heights[room.posts_at(place.position)].T
    return [
        _straight(room, place, levels, sequence)
        for sequence in _up_and_down(levels, place, height, search)
        # no post stands in the way
        if not ((lower < max(sequence.heights)) & (upper > min(sequence.heights))).any()
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
            sequence = LevelSequence(rows, (height, *heights[list(rows)].tolist(), height))
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
