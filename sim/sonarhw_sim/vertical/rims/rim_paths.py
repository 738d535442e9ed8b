"""Paths that rims bend: from the place by walls and levels to a rim, and by walls and levels to the receiver.

Mirrored in all that it touches before the rim, the place is a point in space, and so is the receiver, mirrored in what
sound touches behind. The point of the rim with the shortest way between both is a closed form (Keller's cone). Each way
is solved in the plan, and its heights are checked.
"""

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray
from sonarhw_sim.board.transducer import ComplexArray
from sonarhw_sim.choices import EdgeStrength
from sonarhw_sim.rays.diffraction import edge_amplitudes
from sonarhw_sim.rays.paths import SLACK, Paths, PathSearch
from sonarhw_sim.room.edges import inside_wedge
from sonarhw_sim.vertical.in_space import loudest_at
from sonarhw_sim.vertical.plan import Plan
from sonarhw_sim.vertical.reflecting_levels import Levels
from sonarhw_sim.vertical.rims.approaches import Approaches, approaches_to
from sonarhw_sim.vertical.rims.rim_pairs import Halves, pairs_of
from sonarhw_sim.vertical.rims.rim_table import Rims
from sonarhw_sim.vertical.rims.rim_ways import Bends, End, RimSequences, paths_by, sequences_to, ways_are_clear, ways_to
from sonarhw_sim.wedges.narrow_walls import Arriving, along_narrow_walls

MOST_REFLECTIONS = 8  # before and after the rim together
_ON_RIM = 1e-9  # m: beyond its end


class _End(NamedTuple):
    """The ways from sender or receiver to rims."""

    approaches: Approaches
    halves: Halves


def rim_paths(
    plan: Plan, levels: Levels, rims: Rims, ends: tuple[FloatArray, FloatArray], height: float, search: PathSearch
) -> Paths:
    """Return the paths by rims between `ends`, the positions (2,) of sender and receiver at a height, m."""
    search = replace(search, max_bounces=min(search.max_bounces, MOST_REFLECTIONS))
    sequences = sequences_to(levels, rims.wedges.points[:, 1], height, search)
    sender, receiver = ends
    out = _end(plan, levels, rims, sequences, sender, receiver, search)
    back = out if receiver is sender else _end(plan, levels, rims, sequences, receiver, sender, search)
    bends, first, second = _bends(plan, rims, (out.halves, back.halves), search)
    one = End(sender, out.approaches, *_ways_of(out.halves, first))
    other = End(receiver, back.approaches, *_ways_of(back.halves, second))
    return paths_by(plan, levels, sequences, (one, other), bends, search)


def _ways_of(halves: Halves, rows: NDArray[np.intp]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    return halves.approaches[rows].astype(np.intp), halves.sequences[rows].astype(np.intp)


def _bends(
    plan: Plan, rims: Rims, halves: tuple[Halves, Halves], search: PathSearch
) -> tuple[Bends, NDArray[np.intp], NDArray[np.intp]]:
    """Return where sound may bend, loud enough, and the rows (m,) of both halves."""
    out, back = halves
    limits = search.wavelength, search.max_length + SLACK, search.faintest_diffraction, search.max_bounces
    strength = [*EdgeStrength].index(search.edge_strength)
    first, second, at = pairs_of(out, back, rims.wedges.openings / math.pi, limits, strength)
    amplitudes = _amplitudes(plan, rims, halves, (first, second), search)
    gains = out.gains[first] * back.gains[second] * np.abs(amplitudes)
    rim = out.rims[first]
    along = rims.walls[rim, 2:] - rims.walls[rim, :2]
    points = rims.walls[rim, :2] + (at / np.hypot(*along.T))[:, None] * along
    lengths = np.hypot(out.axial[first] - back.axial[second], out.radial[first] + back.radial[second])
    bends = Bends(rims.edges[rim], points, lengths, gains, np.angle(amplitudes))
    loud = np.flatnonzero(gains >= search.faintest_diffraction)
    return Bends._make(column[loud] for column in bends), first[loud], second[loud]


def _end(
    plan: Plan,
    levels: Levels,
    rims: Rims,
    sequences: RimSequences,
    position: FloatArray,
    other: FloatArray,
    search: PathSearch,
) -> _End:
    """Return the ways from `position` (2,) to the rims, of paths that continue to `other` (2,)."""
    climbs = sequences.totals * np.where(sequences.signs[:, 0] < 0, -1.0, 1.0)
    approaches = approaches_to(plan, np.unique(rims.owners), position, other, climbs, search)
    return _End(approaches, _halves(plan, levels, rims, sequences, approaches, position, search))


def _halves(
    plan: Plan,
    levels: Levels,
    rims: Rims,
    sequences: RimSequences,
    approaches: Approaches,
    position: FloatArray,
    search: PathSearch,
) -> Halves:
    """Return every approach to the wall of each rim together with every sequence of levels."""
    parts = []
    for row, (first, behind) in enumerate(sequences.of_rims.tolist()):
        ways = np.flatnonzero(approaches.walls == rims.owners[row])
        way, sequence = np.repeat(ways, behind - first), np.tile(np.arange(first, behind), len(ways))
        parts.append((np.full(len(way), row), way, sequence))
    rim, way, sequence = (np.concatenate(column) for column in zip(*parts, strict=True))
    start, along = rims.walls[rim, :2], rims.walls[rim, 2:] - rims.walls[rim, :2]
    length = np.hypot(*along.T)
    along /= length[:, None]
    away = approaches.images[way] - start
    axial, aside = (away * along).sum(axis=1), along[:, 0] * away[:, 1] - along[:, 1] * away[:, 0]
    # a rim may be a part of a wall
    before = ((start - plan.room.walls[rims.owners[rim], :2]) * along).sum(axis=1)
    lows = np.maximum(approaches.lows[way] - before, -_ON_RIM)
    highs = np.minimum(approaches.highs[way] - before, length + _ON_RIM)
    # what comes from above has its image above
    climb = sequences.totals[sequence]
    rise = climb * sequences.signs[sequence, 1]
    radial, direction = np.hypot(aside, rise), np.arctan2(rise, aside)
    farthest = np.hypot(np.maximum(np.abs(axial), np.abs(axial - length)), aside)
    beams = np.sqrt(loudest_at(np.arctan2(climb, farthest), search))
    of_levels = np.append(plan.room.reflectances[levels.surfaces], 1.0)[sequences.levels].prod(axis=1)
    gains = approaches.gains[way] * of_levels[sequence]
    bounces = approaches.bounces[way] + (sequences.levels >= 0).sum(axis=1)[sequence]
    kept = inside_wedge(direction, rims.wedges.starts[rim], rims.wedges.openings[rim])
    kept &= (radial <= search.max_length) & (bounces <= search.max_bounces) & (highs > lows)
    kept &= gains * beams >= max(search.faintest_diffraction, 1e-300)
    rows = np.flatnonzero(kept)
    rows = rows[_possible(plan, position, approaches, sequences, way[rows], sequence[rows])]
    rows = rows[np.lexsort((radial[rows], rim[rows]))]
    angles = np.mod(direction - rims.wedges.starts[rim], math.tau)
    return Halves(
        rim[rows].astype(np.int32),
        axial[rows],
        lows[rows],
        highs[rows],
        radial[rows],
        angles[rows],
        gains[rows],
        beams[rows],
        bounces[rows].astype(np.int32),
        way[rows].astype(np.int32),
        sequence[rows].astype(np.int32),
    )


def _possible(
    plan: Plan,
    position: FloatArray,
    approaches: Approaches,
    sequences: RimSequences,
    rows: NDArray[np.intp],
    chosen: NDArray[np.intp],
) -> NDArray[np.bool_]:
    """Return whether sound can take these rows of approaches with a sequence of levels each, (h,) bool.

    This is so if it can lead to one of three points, both ends and the middle of the part of the wall.
    """
    wall = plan.room.walls[approaches.walls]
    along = wall[:, 2:] - wall[:, :2]
    along /= np.hypot(*along.T)[:, None]
    possible = np.zeros(len(rows), np.bool_)
    for share in (0.5, 1e-3, 1 - 1e-3):
        at = approaches.lows + share * (approaches.highs - approaches.lows)
        to = wall[:, :2] + at[:, None] * along
        real, ways = ways_to(plan, position, approaches, np.arange(len(at)), to)
        left = np.flatnonzero(~possible & real[rows])
        possible[left] = ways_are_clear(plan, ways, rows[left], sequences, chosen[left])
    return possible


def _amplitudes(
    plan: Plan,
    rims: Rims,
    halves: tuple[Halves, Halves],
    rows: tuple[NDArray[np.intp], NDArray[np.intp]],
    search: PathSearch,
) -> ComplexArray:
    """Return the amplitude of the rim for each pair of rows of the halves, (m,).

    Along a rim, the field is a factor, as along an upright edge: seen along it, the wave is longer.
    """
    (out, back), (first, second) = halves, rows
    rim, faces = out.rims[first], plan.room.reflectances[rims.surfaces]
    there, on = out.radial[first], back.radial[second]
    longer = search.wavelength * np.hypot(1.0, (out.axial[first] - back.axial[second]) / np.maximum(there + on, 1e-300))
    angles, wedges = (out.angles[first], back.angles[second]), rims.wedges.openings[rim] / math.pi
    amplitudes = edge_amplitudes(*angles, wedges, faces[rim], there, on, longer, search.edge_strength)
    if search.edge_strength is not EdgeStrength.UNIFORM:
        return amplitudes
    arriving = Arriving(out.rims, out.angles, out.radial)
    leaving = arriving if back is out else Arriving(back.rims, back.angles, back.radial)
    amplitudes += along_narrow_walls((arriving, leaving), rows, rims.wedges, faces, search.wavelength)
    loudest, sizes = faces[rim].max(axis=1), np.abs(amplitudes)
    return np.asarray(amplitudes * np.minimum(1.0, loudest / np.maximum(sizes, 1e-300)))
