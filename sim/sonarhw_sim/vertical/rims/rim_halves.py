"""Halves of paths past rims: each way from a place to a rim, with each sequence of levels, before it is solved."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray
from sonarhw_sim.compiled import compiled, inlined
from sonarhw_sim.rays.paths import PathSearch
from sonarhw_sim.room.edges import inside_wedge
from sonarhw_sim.room.grid import IntArray
from sonarhw_sim.vertical.plan import Plan
from sonarhw_sim.vertical.reflecting_levels import Levels
from sonarhw_sim.vertical.rims.approaches import Approaches
from sonarhw_sim.vertical.rims.rim_pairs import Halves
from sonarhw_sim.vertical.rims.rim_table import Rims
from sonarhw_sim.vertical.rims.rim_ways import RimSequences, ways_to
from sonarhw_sim.vertical.ways import BoolArray

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
    """Return every approach from `position` (2,) to the wall of each rim together with every sequence of levels.

    Those that sound cannot take are omitted if they have up to half of the reflections of the search.
    """
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
    # few halves fit to those with many reflections, which are most: they are tested after they are joined
    few = rows[2 * bounces[rows] <= search.max_bounces]
    possible = are_possible(plan, position, approaches, sequences, way[few], sequence[few])
    rows = np.concatenate((few[possible], rows[2 * bounces[rows] > search.max_bounces]))
    rows = rows[np.lexsort((lows[rows], bounces[rows], rim[rows]))]
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
            axial, aside, length = _about(rims.walls[rim], approaches.images[way])
            low = max(approaches.lows[way] - rims.begins[rim], -_ON_RIM)
            high = min(approaches.highs[way] - rims.begins[rim], length + _ON_RIM)
            if high <= low:
                continue
            farthest = math.hypot(max(abs(axial), abs(axial - length)), aside)
            for sequence in range(rims.sequences[rim, 0], rims.sequences[rim, 1]):
                climb, bounces = rims.climbs[sequence], approaches.bounces[way] + rims.bounces[sequence]
                # the first test leaves few for the others
                if bounces > max_bounces:
                    continue
                radial = math.hypot(aside, climb)
                if radial > max_length:
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


@inlined
def _about(wall: FloatArray, image: FloatArray) -> tuple[float, float, float]:
    """Return where an image (2,) is along a wall and aside of it, and the length of the wall, m."""
    along_x, along_y = wall[2] - wall[0], wall[3] - wall[1]
    length = math.hypot(along_x, along_y)
    along_x, along_y = along_x / length, along_y / length
    away_x, away_y = image[0] - wall[0], image[1] - wall[1]
    return away_x * along_x + away_y * along_y, along_x * away_y - along_y * away_x, length


def are_possible(
    plan: Plan,
    position: FloatArray,
    approaches: Approaches,
    sequences: RimSequences,
    rows: NDArray[np.integer],
    chosen: NDArray[np.integer],
) -> BoolArray:
    """Return whether sound can take these rows of approaches with a sequence of levels each, (h,) bool.

    It can if it reaches one of three points of the part of the wall.
    """
    possible, walls = np.zeros(len(rows), np.bool_), plan.room.walls[approaches.walls]
    # several sequences in turn for one way take less time
    by_way = np.argsort(rows, kind="stable")
    along = walls[:, 2:] - walls[:, :2]
    sizes = np.hypot(*along.T)
    for share in _TRIED:
        left = by_way[~possible[by_way]]
        way = rows[left]
        on = (approaches.lows[way] + share * (approaches.highs[way] - approaches.lows[way])) / sizes[way]
        to = walls[way, :2] + on[:, None] * along[way]
        possible[left] = ways_to(plan, position, approaches, way, sequences, chosen[left], to)[0]
    return possible
