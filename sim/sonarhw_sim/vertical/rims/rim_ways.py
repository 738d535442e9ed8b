"""Ways to rims, each with its sequence of levels, solved in the plan and checked at its heights; paths of two ways."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray
from sonarhw_sim.compiled import compiled, compiled_part
from sonarhw_sim.rays.partial_paths import first_of_kind
from sonarhw_sim.rays.passing import pass_low, room_for_passages
from sonarhw_sim.rays.path_table import fill_rows
from sonarhw_sim.rays.paths import SLACK, Paths, PathSearch
from sonarhw_sim.rays.sequences import ON_WALL, path_is_free, unfold
from sonarhw_sim.room.grid import IntArray, Surfaces
from sonarhw_sim.vertical.folding import Folded
from sonarhw_sim.vertical.in_space import loudest_at, with_levels
from sonarhw_sim.vertical.level_sequences import LevelSequence, level_sequences
from sonarhw_sim.vertical.plan import Plan
from sonarhw_sim.vertical.reflecting_levels import Levels
from sonarhw_sim.vertical.rims.approaches import Approaches
from sonarhw_sim.vertical.ways import BoolArray, Obstacles, Rise, Ways, can_take

_SAME_ANGLE = 1e-7  # rad


class RimSequences(NamedTuple):
    """Sequences of levels on the way to a rim, one row each."""

    levels: IntArray  # (q, k), padded with -1
    heights: FloatArray  # (q, k + 2), m: of the departure, of each level, and of the rim
    climbs: FloatArray  # (q, k + 2), m: up and down travelled until there
    totals: FloatArray  # (q,), m
    signs: FloatArray  # (q, 2): of the elevation at departure, and of that from which sound arrives
    of_rims: IntArray  # (r, 2): the first row for each rim, and the first behind


class Bends(NamedTuple):
    """Points at which sound bends, one row each."""

    edges: IntArray  # (m,): number of the rim in the room
    points: FloatArray  # (m, 2), m
    lengths: FloatArray  # (m,), m: of the path
    gains: FloatArray  # (m,)
    phases: FloatArray  # (m,), rad


class End(NamedTuple):
    """Sender or receiver, its approaches, and for each bend the row of them and of the sequences of levels."""

    position: FloatArray  # (2,)
    approaches: Approaches
    rows: NDArray[np.intp]  # (m,)
    sequences: NDArray[np.intp]  # (m,)


class _Solved(NamedTuple):
    """Ways from sender or receiver to points of rims, one row each."""

    departures: FloatArray  # (m,), rad
    elevations: FloatArray  # (m,), rad
    surfaces: IntArray  # (m, b)
    touches: IntArray  # (m,): number of surfaces
    points: FloatArray  # (m, b + 3, 2)


def sequences_to(levels: Levels, heights: FloatArray, height: float, search: PathSearch) -> RimSequences:
    """Return the sequences of levels from a height to rims at `heights` (r,), m, with at most one lid among them."""
    rim_heights, which = np.unique(heights, return_inverse=True)
    longest, most = search.max_length + SLACK, search.max_bounces
    found: list[LevelSequence] = []
    ranges = []
    for end in rim_heights.tolist():
        begin = len(found)
        found += [LevelSequence((), (height, end)), *level_sequences(levels, height, end, longest, most, 1)]
        ranges.append((begin, len(found)))
    width = max((len(sequence.levels) for sequence in found), default=0)
    missing = [width - len(sequence.levels) for sequence in found]
    rows = [(*sequence.levels, *[-1] * few) for sequence, few in zip(found, missing, strict=True)]
    at = [(*sequence.heights, *[0.0] * few) for sequence, few in zip(found, missing, strict=True)]
    climbs = [(*sequence.climbs, *[0.0] * few) for sequence, few in zip(found, missing, strict=True)]
    return RimSequences(
        np.array(rows, dtype=np.int32).reshape(len(rows), width),
        np.array(at).reshape(len(rows), width + 2),
        np.array(climbs).reshape(len(rows), width + 2),
        np.array([sequence.climb for sequence in found]),
        np.array([sequence.signs for sequence in found]).reshape(-1, 2),
        np.array(ranges, dtype=np.int32).reshape(-1, 2)[which.ravel()],
    )


def ways_to(
    plan: Plan,
    position: FloatArray,
    approaches: Approaches,
    rows: NDArray[np.integer],
    sequences: RimSequences,
    chosen: NDArray[np.integer],
    to: FloatArray,
) -> tuple[BoolArray, Ways]:
    """Return the ways of these rows (m,) of approaches to points (m, 2), and which of them sound can take, (m,).

    `chosen` (m,) are their rows of `sequences`. The ways that sound cannot take are not filled in.
    """
    assert plan.passing is not None
    count, width = len(rows), approaches.surfaces.shape[1] + 3
    bounces = approaches.bounces[rows]
    ways = Ways(
        np.full((count, width, 2), np.nan),
        np.full((count, width), np.nan),
        np.full((count, width), -1, np.int32),
        bounces + 1,
        np.full(count, -1, np.int32),
        bounces,
    )
    clear, blocking = np.zeros(count, np.bool_), plan.passing.blocking
    which = rows.astype(np.intp), chosen.astype(np.intp)
    _find(position, approaches, sequences, which, to, plan.room.walls, blocking, plan.obstacles, ways, clear)
    return clear, ways


@compiled
def _find(
    position: FloatArray,
    approaches: Approaches,
    sequences: RimSequences,
    which: tuple[NDArray[np.intp], NDArray[np.intp]],
    to: FloatArray,
    walls: FloatArray,
    blocking: Surfaces,
    obstacles: Obstacles,
    ways: Ways,
    clear: BoolArray,
) -> None:
    """Fill in the results of `ways_to`; `which` are the rows of approaches and of sequences, (m,) each."""
    passages, images = room_for_passages(ways.at.shape[1], obstacles.low), np.empty((ways.at.shape[1], 2))
    free, passed = False, 0
    for k in range(to.shape[0]):
        row, chosen = which[0][k], which[1][k]
        # often, several sequences in turn are for one way
        if k > 0 and row == which[0][k - 1] and to[k, 0] == to[k - 1, 0] and to[k, 1] == to[k - 1, 1]:
            if free:
                ways.points[k], ways.at[k], ways.met[k] = ways.points[k - 1], ways.at[k - 1], ways.met[k - 1]
        else:
            free = _fill_in(position, to[k], approaches, row, walls, blocking, images, ways, k)
            if free:
                passed = pass_low(ways.points[k], ways.at[k], ways.lasts[k], obstacles.surfaces, passages)
        if free:
            levels, count = sequences.levels[chosen], 0
            while count < levels.shape[0] and levels[count] >= 0:
                count += 1
            rise = Rise(sequences.heights[chosen], sequences.climbs[chosen], levels, count)
            clear[k] = can_take(ways, k, passages, passed, rise, obstacles)


@compiled_part
def _fill_in(
    position: FloatArray,
    to: FloatArray,
    approaches: Approaches,
    row: int,
    walls: FloatArray,
    blocking: Surfaces,
    images: FloatArray,
    ways: Ways,
    k: int,
) -> bool:
    """Fill in row `k` of the ways with that of an approach to a point, and return whether it is one in the plan."""
    bounces = approaches.bounces[row]
    path, sequence = ways.points[k, : bounces + 2], approaches.surfaces[row, :bounces]
    path[0, 0], path[0, 1], path[bounces + 1, 0], path[bounces + 1, 1] = position[0], position[1], to[0], to[1]
    if not unfold(path, sequence, walls, ON_WALL, images) or not path_is_free(path, blocking):
        return False
    ways.at[k, 0] = 0.0
    for j in range(bounces + 1):
        ways.at[k, j + 1] = ways.at[k, j] + math.hypot(path[j + 1, 0] - path[j, 0], path[j + 1, 1] - path[j, 1])
        if j < bounces:
            ways.met[k, j + 1] = sequence[j]
    return True


def paths_by(
    plan: Plan, levels: Levels, sequences: RimSequences, ends: tuple[End, End], bends: Bends, search: PathSearch
) -> Paths:
    """Return the paths past these bends that sound can take, loud enough, shortest first."""
    (free, there), (also_free, on) = (
        ways_to(plan, end.position, end.approaches, end.rows, sequences, end.sequences, bends.points) for end in ends
    )
    clear = np.flatnonzero(free & also_free)
    one, other = (
        _solved(levels, sequences, end.sequences[clear], Ways._make(column[clear] for column in ways))
        for end, ways in zip(ends, (there, on), strict=True)
    )
    return _audible(_joined(Bends._make(column[clear] for column in bends), one, other), search)


def _solved(levels: Levels, sequences: RimSequences, chosen: NDArray[np.intp], ways: Ways) -> _Solved:
    """Return the ways (m,) with all that they touch; `chosen` (m,) are their sequences of levels."""
    rows, touched = np.arange(len(chosen)), sequences.levels[chosen]
    climbs = np.where(touched >= 0, sequences.climbs[chosen, 1:-1], np.nan)
    surfaces, count, points = with_levels(ways, levels, Folded(rows, touched, climbs, sequences.totals[chosen]))
    away = ways.points[:, 1] - ways.points[:, 0]
    lengths = ways.at[rows, ways.lasts]
    return _Solved(
        np.arctan2(away[:, 1], away[:, 0]),
        np.arctan2(sequences.totals[chosen], lengths) * sequences.signs[chosen, 0],
        surfaces,
        count,
        points,
    )


def _joined(bends: Bends, one: _Solved, other: _Solved) -> Paths:
    """Return the paths past bends from both of their ways."""
    rows, count = np.arange(len(bends.edges)), one.touches + other.touches
    most = int(count.max(initial=0))
    surfaces, points = np.full((len(rows), most), -1, np.int32), np.full((len(rows), most + 3, 2), np.nan)
    fill_rows(surfaces, one.surfaces, rows, one.touches, other.surfaces, rows, other.touches)
    fill_rows(points, one.points, rows, one.touches + 2, other.points, rows, other.touches + 1)
    return Paths(
        lengths=bends.lengths,
        departures=one.departures,
        arrivals=other.departures,
        gains=bends.gains,
        phases=bends.phases,
        spreads=np.zeros(len(rows)),
        surfaces=surfaces,
        edges=bends.edges,
        bends=one.touches,
        elevations=np.column_stack((one.elevations, other.elevations)),
        points=points,
    )


def _audible(paths: Paths, search: PathSearch) -> Paths:
    """Return the paths that are loud enough at some heading, each once, shortest first."""
    # of equal paths, the one with the fewest touches first: another one touches a wall at the rim itself
    paths = paths.select(np.lexsort((paths.bounces, np.round(paths.lengths, 9))))
    rising, falling = paths.elevations.T
    heard = paths.gains * np.sqrt(loudest_at(rising, search) * loudest_at(falling, search))
    # sound that neither rises nor falls stays in the horizontal section, which has the whole wall
    kept = (heard >= search.faintest_diffraction) & ((rising != 0.0) | (falling != 0.0))
    paths = paths.select(np.flatnonzero(kept))
    # through a vertex, several sequences describe one path
    angles = np.round(paths.elevations / _SAME_ANGLE)
    _, kind = np.unique(np.column_stack((paths.edges, angles)), axis=0, return_inverse=True)
    return paths.select(np.flatnonzero(first_of_kind(paths.lengths, kind.ravel(), paths.points)))
