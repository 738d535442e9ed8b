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
from sonarhw_sim.vertical.plan import Plan
from sonarhw_sim.vertical.reflecting_levels import Levels
from sonarhw_sim.vertical.rims.approaches import Approaches, approaches_to
from sonarhw_sim.vertical.rims.rim_halves import are_possible, halves_of
from sonarhw_sim.vertical.rims.rim_pairs import Halves, pairs_of
from sonarhw_sim.vertical.rims.rim_table import Rims
from sonarhw_sim.vertical.rims.rim_ways import Bends, End, RimSequences, paths_by, sequences_to
from sonarhw_sim.vertical.ways import BoolArray
from sonarhw_sim.wedges.narrow_walls import Arriving, along_narrow_walls

MOST_REFLECTIONS = 8  # before and after the rim together
_ON_RIM = 1e-9  # m: beyond its end


class _End(NamedTuple):
    """The ways from sender or receiver to rims."""

    position: FloatArray  # (2,)
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
    joined = _joined(plan, rims, sequences, out, back, search)
    bends, first, second = _bends(plan, rims, (out.halves, back.halves), joined, search)
    one = End(sender, out.approaches, *_ways_of(out.halves, first))
    other = End(receiver, back.approaches, *_ways_of(back.halves, second))
    return paths_by(plan, levels, sequences, (one, other), bends, search)


def _ways_of(halves: Halves, rows: NDArray[np.intp]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    return halves.approaches[rows].astype(np.intp), halves.sequences[rows].astype(np.intp)


def _joined(
    plan: Plan, rims: Rims, sequences: RimSequences, out: _End, back: _End, search: PathSearch
) -> tuple[NDArray[np.intp], NDArray[np.intp], FloatArray]:
    """Return the rows (m,) of both halves of paths that sound may take, and where on their rim they join, (m,) m."""
    limits = search.wavelength, search.max_length + SLACK, search.faintest_diffraction, search.max_bounces
    strength = [*EdgeStrength].index(search.edge_strength)
    first, second, at = pairs_of(out.halves, back.halves, rims.wedges.openings / math.pi, limits, strength)
    possible = _possible(plan, sequences, out, first)
    # between one place and itself, each pair is listed in both orders
    kept = possible[first] & (possible if back is out else _possible(plan, sequences, back, second))[second]
    return first[kept], second[kept], at[kept]


def _possible(plan: Plan, sequences: RimSequences, end: _End, rows: NDArray[np.intp]) -> BoolArray:
    """Return which halves of an end are among these rows and can be taken by sound, (h,)."""
    possible = np.zeros(len(end.halves.rims), np.bool_)
    possible[rows] = True
    some = np.flatnonzero(possible)
    possible[some] = are_possible(plan, end.position, end.approaches, sequences, *_ways_of(end.halves, some))
    return possible


def _bends(
    plan: Plan,
    rims: Rims,
    halves: tuple[Halves, Halves],
    joined: tuple[NDArray[np.intp], NDArray[np.intp], FloatArray],
    search: PathSearch,
) -> tuple[Bends, NDArray[np.intp], NDArray[np.intp]]:
    """Return where sound may bend, loud enough, and the rows (m,) of both halves."""
    (out, back), (first, second, at) = halves, joined
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
    return _End(position, approaches, halves_of(plan, levels, rims, sequences, approaches, position, search))


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
