"""Halves of paths past rims: each way from a place to a rim, with each sequence of levels, before it is solved."""

import math
from typing import NamedTuple

import numpy as np

from sonarhw.readings import FloatArray
from sonarhw_sim.compiled import compiled, compiled_part
from sonarhw_sim.rays.passing import Passages, pass_low, room_for_passages
from sonarhw_sim.rays.paths import PathSearch
from sonarhw_sim.rays.sequences import ON_WALL, path_is_free, unfold
from sonarhw_sim.room.edges import inside_wedge
from sonarhw_sim.room.grid import IntArray, Surfaces
from sonarhw_sim.vertical.folding import BoolArray, Obstacles, Ways, can_take
from sonarhw_sim.vertical.plan import Plan
from sonarhw_sim.vertical.reflecting_levels import Levels
from sonarhw_sim.vertical.rims.approaches import Approaches
from sonarhw_sim.vertical.rims.rim_pairs import Halves
from sonarhw_sim.vertical.rims.rim_table import Rims
from sonarhw_sim.vertical.rims.rim_ways import RimSequences

_ON_RIM = 1e-9  # m: beyond its end
_TRIED = (0.5, 1e-3, 1 - 1e-3)  # shares of a part of a wall: points to which ways are tried


class _KernelRims(NamedTuple):
    """Rims and the sequences of levels to them, for kernels."""

    owners: IntArray  # (r,)
    walls: FloatArray  # (r, 4), m
    begins: FloatArray  # (r,), m: where each begins along its wall, of which it may be a part
    sequences: IntArray  # (r, 2): the first row of those to it, and the first behind
    climbs: FloatArray  # (q,), m
    signs: FloatArray  # (q,): of the elevation from which sound arrives
    gains: FloatArray  # (q,)
    bounces: IntArray  # (q,)


def halves_of(
    plan: Plan,
    levels: Levels,
    rims: Rims,
    sequences: RimSequences,
    approaches: Approaches,
    position: FloatArray,
    search: PathSearch,
) -> Halves:
    """Return every approach from `position` (2,) to the wall of each rim together with every sequence of levels."""
    along = rims.walls[:, 2:] - rims.walls[:, :2]
    along /= np.hypot(*along.T)[:, None]
    kernel = _KernelRims(
        rims.owners,
        rims.walls,
        ((rims.walls[:, :2] - plan.room.walls[rims.owners, :2]) * along).sum(axis=1),
        sequences.of_rims,
        sequences.totals,
        np.ascontiguousarray(sequences.signs[:, 1]),
        np.append(plan.room.reflectances[levels.surfaces], 1.0)[sequences.levels].prod(axis=1),
        (sequences.levels >= 0).sum(axis=1).astype(np.int32),
    )
    of_walls = np.bincount(approaches.walls, minlength=len(plan.room.walls))
    most = int((of_walls[rims.owners] * np.diff(sequences.of_rims).ravel()).sum())
    columns, numbers = np.empty((7, most)), np.empty((4, most), np.int32)
    # the system gives memory only to what is filled
    limits = search.max_length, max(search.faintest_diffraction, 1e-300), search.max_bounces
    table = np.sqrt(search.loudest_by_elevation)
    found = _list(kernel, approaches, table, limits, columns, numbers)
    axial, lows, highs, radial, directions, gains, beams = columns[:, :found]
    rim, way, sequence, bounces = numbers[:, :found]
    rows = np.flatnonzero(inside_wedge(directions, rims.wedges.starts[rim], rims.wedges.openings[rim]))
    rows = rows[_possible(plan, position, approaches, sequences, way[rows], sequence[rows])]
    rows = rows[np.lexsort((radial[rows], rim[rows]))]
    angles = np.mod(directions[rows] - rims.wedges.starts[rim[rows]], math.tau)
    before, behind = (rim, axial, lows, highs, radial), (gains, beams, bounces, way, sequence)
    return Halves._make((*(column[rows] for column in before), angles, *(column[rows] for column in behind)))


@compiled
def _list(
    rims: _KernelRims,
    approaches: Approaches,
    beams: FloatArray,
    limits: tuple[float, float, int],
    columns: FloatArray,
    numbers: IntArray,
) -> int:
    """Fill in the halves that are loud and short enough, and return how many there are.

    `beams` are the most that the beam leaves, by elevation; `limits` the longest path, the faintest gain and the most
    reflections. The `columns` (7, n) are as in `Halves`, with directions about the rim (rad); the `numbers` (4, n) are
    rim, approach, sequence and reflections.
    """
    (max_length, faintest, max_bounces), found = limits, 0
    # the rims of one wall in turn, because an approach is solved once for all of them
    for way in range(approaches.walls.shape[0]):
        for rim in range(rims.owners.shape[0]):
            if approaches.walls[way] != rims.owners[rim]:
                continue
            x, y = rims.walls[rim, 0], rims.walls[rim, 1]
            along_x, along_y = rims.walls[rim, 2] - x, rims.walls[rim, 3] - y
            length = math.hypot(along_x, along_y)
            along_x, along_y = along_x / length, along_y / length
            low = max(approaches.lows[way] - rims.begins[rim], -_ON_RIM)
            high = min(approaches.highs[way] - rims.begins[rim], length + _ON_RIM)
            if high <= low:
                continue
            away_x, away_y = approaches.images[way, 0] - x, approaches.images[way, 1] - y
            axial, aside = away_x * along_x + away_y * along_y, along_x * away_y - along_y * away_x
            farthest = math.hypot(max(abs(axial), abs(axial - length)), aside)
            for sequence in range(rims.sequences[rim, 0], rims.sequences[rim, 1]):
                climb, bounces = rims.climbs[sequence], approaches.bounces[way] + rims.bounces[sequence]
                radial = math.hypot(aside, climb)
                if radial > max_length or bounces > max_bounces:
                    continue
                gain = approaches.gains[way] * rims.gains[sequence]
                beam = beams[int(math.atan2(climb, farthest) / (math.pi / 2) * (beams.shape[0] - 1))]
                if gain * beam < faintest:
                    continue
                # what comes from above has its image above
                direction = math.atan2(climb * rims.signs[sequence], aside)
                columns[0, found], columns[1, found], columns[2, found] = axial, low, high
                columns[3, found], columns[4, found] = radial, direction
                columns[5, found], columns[6, found] = gain, beam
                numbers[0, found], numbers[1, found], numbers[2, found] = rim, way, sequence
                numbers[3, found] = bounces
                found += 1
    return found


def _possible(
    plan: Plan,
    position: FloatArray,
    approaches: Approaches,
    sequences: RimSequences,
    rows: IntArray,
    chosen: IntArray,
) -> BoolArray:
    """Return whether sound can take these rows of approaches with a sequence of levels each, (h,) bool."""
    assert plan.passing is not None
    possible, width = np.zeros(len(rows), np.bool_), approaches.surfaces.shape[1] + 3
    points, at, met = np.empty((1, width, 2)), np.empty((1, width)), np.empty((1, width), np.int32)
    way = Ways(points, at, met, np.empty(1, np.int32), np.full(1, -1, np.int32), np.zeros(1, np.int32))
    walls, blocking = plan.room.walls, plan.passing.blocking
    _try(position, approaches, sequences, rows, chosen, walls, blocking, plan.obstacles, way, possible)
    return possible


@compiled
def _try(
    position: FloatArray,
    approaches: Approaches,
    sequences: RimSequences,
    rows: IntArray,
    chosen: IntArray,
    walls: FloatArray,
    blocking: Surfaces,
    obstacles: Obstacles,
    way: Ways,
    possible: BoolArray,
) -> None:
    """Fill in whether each way is possible: it leads to the middle or to one of both ends of the part of the wall."""
    passages, images = room_for_passages(way.at.shape[1], obstacles.low), np.empty((way.at.shape[1], 2))
    begin = 0
    for k in range(rows.shape[0]):
        if k + 1 == rows.shape[0] or rows[k + 1] != rows[k]:
            some = chosen[begin : k + 1], possible[begin : k + 1]
            _try_part(position, approaches, sequences, rows[k], some, walls, blocking, obstacles, way, passages, images)
            begin = k + 1


@compiled_part
def _try_part(
    position: FloatArray,
    approaches: Approaches,
    sequences: RimSequences,
    row: int,
    some: tuple[IntArray, BoolArray],
    walls: FloatArray,
    blocking: Surfaces,
    obstacles: Obstacles,
    way: Ways,
    passages: Passages,
    images: FloatArray,
) -> None:
    """Fill in the result of `_try` for one approach with `some` sequences."""
    (chosen, possible), wall = some, walls[approaches.walls[row]]
    length = math.hypot(wall[2] - wall[0], wall[3] - wall[1])
    for trial in range(3):
        share = _TRIED[trial]
        on = (approaches.lows[row] + share * (approaches.highs[row] - approaches.lows[row])) / length
        x, y = wall[0] + on * (wall[2] - wall[0]), wall[1] + on * (wall[3] - wall[1])
        if not _fill_in(position, x, y, approaches, row, walls, blocking, images, way):
            continue
        passed = pass_low(way.points[0], way.at[0], way.lasts[0], obstacles.surfaces, passages)
        for k in range(possible.shape[0]):
            which = chosen[k]
            heights, climbs, levels = sequences.heights[which], sequences.climbs[which], sequences.levels[which]
            if not possible[k]:
                possible[k] = can_take(way, 0, passages, passed, heights, climbs, levels, obstacles)


@compiled_part
def _fill_in(
    position: FloatArray,
    x: float,
    y: float,
    approaches: Approaches,
    row: int,
    walls: FloatArray,
    blocking: Surfaces,
    images: FloatArray,
    way: Ways,
) -> bool:
    """Fill in the only row of `way` with that of an approach to a point, and return whether it is one in the plan."""
    bounces = approaches.bounces[row]
    path, sequence = way.points[0, : bounces + 2], approaches.surfaces[row, :bounces]
    path[0, 0], path[0, 1], path[bounces + 1, 0], path[bounces + 1, 1] = position[0], position[1], x, y
    if not unfold(path, sequence, walls, ON_WALL, images) or not path_is_free(path, blocking):
        return False
    way.lasts[0], way.at[0, 0], way.met[0, 0], way.met[0, bounces + 1] = bounces + 1, 0.0, -1, -1
    for k in range(bounces + 1):
        way.at[0, k + 1] = way.at[0, k] + math.hypot(path[k + 1, 0] - path[k, 0], path[k + 1, 1] - path[k, 1])
        if k < bounces:
            way.met[0, k + 1] = sequence[k]
    return True
