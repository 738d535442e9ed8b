"""Paths that one or two rims bend: both halves of each, joined and solved."""

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray
from sonarhw_sim.air import EdgeStrength
from sonarhw_sim.board.beam import ComplexArray
from sonarhw_sim.compiled import compiled, compiled_part, inlined
from sonarhw_sim.rays import fan
from sonarhw_sim.rays.diffraction import Arriving, along_narrow_walls, edge_amplitudes, most_of_edge
from sonarhw_sim.rays.paths import SLACK, Paths, PathSearch
from sonarhw_sim.room.edges import inside_wedge
from sonarhw_sim.room.grid import IntArray
from sonarhw_sim.room.room import Room
from sonarhw_sim.room.room_file import MEETING
from sonarhw_sim.space.folding import BoolArray, Plan
from sonarhw_sim.space.levels import Levels
from sonarhw_sim.space.rims import (
    Approaches,
    Bends,
    End,
    Rims,
    RimSequences,
    approaches_to,
    images_of,
    paths_by,
    sequences_to,
    ways_to,
)

# Pairs of a way to a rim and a way back from it that join at a point of the rim. Compiled by numba.


_FEWEST_POINTS = 3  # of a path


class Halves(NamedTuple):
    """Ways from a place to rims, in order of rim, of reflections and of the begin of the part; one row each.

    The place, mirrored in all that the way touches, is a point in space, here in coordinates about the rim.
    """

    rims: IntArray  # (h,)
    axial: FloatArray  # (h,), m along the rim
    lows: FloatArray  # (h,), m along the rim: where the part begins to which the way leads
    highs: FloatArray  # (h,), m
    radial: FloatArray  # (h,), m from the line of the rim
    angles: FloatArray  # (h,), rad from the first face of the wedge
    gains: FloatArray  # (h,): reflectances
    beams: FloatArray  # (h,): the most that the beam leaves at any heading
    bounces: IntArray  # (h,)
    approaches: IntArray  # (h,): row
    sequences: IntArray  # (h,): row


def pairs_of(
    out: Halves,
    back: Halves,
    wedges: FloatArray,
    limits: tuple[float, float, float, int],
    strength: int,
) -> tuple[NDArray[np.intp], NDArray[np.intp], FloatArray]:
    """Return the rows of `out` and `back` (m,) that may form a path, and where on their rim it bends, (m,) m.

    `wedges` (r,) are the openings of the rims over π; `limits` are the wavelength, the longest
    path, the faintest amplitude and the most reflections. Raises InputError if these are too many for the memory.
    """
    # most halves have many reflections, and few fit to those
    kinds = np.arange(len(wedges) * (limits[3] + 1) + 1)
    starts = np.searchsorted(back.rims * (limits[3] + 1) + back.bounces, kinds)
    widest = float((back.highs - back.lows).max(initial=0.0))
    most = fan.MOST_POINTS // _FEWEST_POINTS
    count = fan.ROOM_FOR_PAIRS
    while True:
        rows, bends = np.empty((count, 2), np.intp), np.empty(count)
        count = _pair(out, back, back is out, starts, widest, wedges, limits, strength, most, rows, bends)
        fan.check_size(count, _FEWEST_POINTS)
        if count <= len(rows):
            first, second = rows[:count].T
            # nearest first
            ends = (back, second), (out, first)
            keys = [key[rows] for half, rows in ends for key in (half.sequences, half.approaches, half.radial)]
            order = np.lexsort((*keys, out.rims[first]))
            return first[order], second[order], bends[order]


@compiled
def _pair(
    out: Halves,
    back: Halves,
    same: bool,
    starts: NDArray[np.intp],
    widest: float,
    wedges: FloatArray,
    limits: tuple[float, float, float, int],
    strength: int,
    most: int,
    rows: NDArray[np.intp],
    bends: FloatArray,
) -> int:
    """Return how many pairs there are, more than `most` not all counted; fill in the first `rows` (m, 2) and `bends`.

    `starts` are the first rows of `back` for each rim and number of reflections, `widest` (m) is its longest part. With
    `same`, `back` is `out`, and each pair is tested once for both of its orders.
    """
    max_bounces, count, heard = limits[3], 0, back.gains * back.beams
    for i in range(out.rims.shape[0]):
        kind = out.rims[i] * (max_bounces + 1)
        for bounces in range(out.bounces[i] if same else 0, max_bounces - out.bounces[i] + 1):
            first, last = starts[kind + bounces], starts[kind + bounces + 1]
            if same and bounces == out.bounces[i]:
                first = i
            # two parts that do not overlap have no point in common
            for j in range(_first_from(back.lows, first, last, out.lows[i] - widest), last):
                if back.lows[j] >= out.highs[i]:
                    break
                if back.highs[j] <= out.lows[i] or out.gains[i] * out.beams[i] * heard[j] < limits[2]:
                    continue
                point = _joined_at(out, back, i, j, wedges, limits, strength)
                if math.isnan(point):
                    continue
                if count < rows.shape[0]:
                    rows[count, 0], rows[count, 1], bends[count] = i, j, point
                count += 1
                if same and j > i:
                    if count < rows.shape[0]:
                        rows[count, 0], rows[count, 1], bends[count] = j, i, _bend(back, out, j, i)
                    count += 1
        if count > most:
            break
    return count


@compiled_part
def _first_from(lows: FloatArray, first: int, last: int, low: float) -> int:
    """Return the first row from `first` on, `last` if there is none, that begins at `low` or behind."""
    while first < last:
        middle = (first + last) // 2
        if lows[middle] < low:
            first = middle + 1
        else:
            last = middle
    return first


@inlined
def _bend(out: Halves, back: Halves, i: int, j: int) -> float:
    """Return where on the rim two halves join, m."""
    both = max(out.radial[i] + back.radial[j], 1e-300)
    point: float = out.axial[i] + (back.axial[j] - out.axial[i]) * out.radial[i] / both
    return point


@compiled_part
def _joined_at(
    out: Halves,
    back: Halves,
    i: int,
    j: int,
    wedges: FloatArray,
    limits: tuple[float, float, float, int],
    strength: int,
) -> float:
    """Return where on their rim two halves join, m; NaN if they do not, or if the path is too long or too faint."""
    wavelength, max_length, faintest, _ = limits
    radial, axial = out.radial[i] + back.radial[j], back.axial[j] - out.axial[i]
    point = _bend(out, back, i, j)
    if radial > max_length or not max(out.lows[i], back.lows[j]) <= point < min(out.highs[i], back.highs[j]):
        return np.nan
    length = math.hypot(axial, radial)
    if length > max_length:
        return np.nan
    # Keller's cone: seen along the rim, the wave is longer
    longer = wavelength * length / max(radial, 1e-300)
    near, far, opening = out.radial[i], back.radial[j], wedges[out.rims[i]]
    edge = most_of_edge(out.angles[i], back.angles[j], opening, near, far, longer, strength)
    heard = out.gains[i] * out.beams[i] * back.gains[j] * back.beams[j]
    return point if heard * edge >= faintest else np.nan


# Halves of paths past rims: each way from a place to a rim, with each sequence of levels, before it is solved.


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
    count = _list(kernel, approaches, table, limits, columns, numbers)
    axial, lows, highs, radial, directions, gains, beams = columns[:, :count]
    rim, way, sequence, bounces = numbers[:, :count]
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
    (max_length, faintest, max_bounces), count = limits, 0
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
                columns[0, count], columns[1, count], columns[2, count] = axial, low, high
                columns[3, count], columns[4, count] = radial, direction
                columns[5, count], columns[6, count] = gain, beam
                numbers[0, count], numbers[1, count], numbers[2, count] = rim, way, sequence
                numbers[3, count] = bounces
                count += 1
    return count


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
        along_wall = (approaches.lows[way] + share * (approaches.highs[way] - approaches.lows[way])) / sizes[way]
        to = walls[way, :2] + along_wall[:, None] * along[way]
        possible[left] = ways_to(plan, position, approaches, way, sequences, chosen[left], to)[0]
    return possible


# Paths that rims bend: from the place by walls and levels to a rim, and by walls and levels to the receiver.
#
# Mirrored in all that it touches before the rim, the place is a point in space, and so is the receiver, mirrored in
# what sound touches behind. The point of the rim with the shortest way between both is a closed form (Keller's cone).
# Each way is solved in the plan, and its heights are checked.


MOST_REFLECTIONS = 8  # before and after the rim together


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
    sending = End(sender, out.approaches, *_ways_of(out.halves, first))
    receiving = End(receiver, back.approaches, *_ways_of(back.halves, second))
    return paths_by(plan, levels, sequences, (sending, receiving), bends, search)


def _ways_of(halves: Halves, rows: NDArray[np.intp]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    return halves.approaches[rows].astype(np.intp), halves.sequences[rows].astype(np.intp)


def _joined(
    plan: Plan, rims: Rims, sequences: RimSequences, out: _End, back: _End, search: PathSearch
) -> tuple[NDArray[np.intp], NDArray[np.intp], FloatArray]:
    """Return the rows (m,) of both halves of paths that sound may take, and where on their rim they join, (m,) m."""
    limits = search.wavelength, search.max_length + SLACK, search.faintest_diffraction, search.max_bounces
    strength = [*EdgeStrength].index(search.edge_strength)
    first, second, bends = pairs_of(out.halves, back.halves, rims.wedges.openings / math.pi, limits, strength)
    possible = _possible(plan, sequences, out, first)
    # between one place and itself, each pair is listed in both orders
    kept = possible[first] & (possible if back is out else _possible(plan, sequences, back, second))[second]
    return first[kept], second[kept], bends[kept]


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
    (out, back), (first, second, distances) = halves, joined
    amplitudes = _amplitudes(plan, rims, halves, (first, second), search)
    gains = out.gains[first] * back.gains[second] * np.abs(amplitudes)
    rim = out.rims[first]
    along = rims.walls[rim, 2:] - rims.walls[rim, :2]
    points = rims.walls[rim, :2] + (distances / np.hypot(*along.T))[:, None] * along
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
    before, after = out.radial[first], back.radial[second]
    longer = search.wavelength * np.hypot(
        1.0, (out.axial[first] - back.axial[second]) / np.maximum(before + after, 1e-300)
    )
    angles, wedges = (out.angles[first], back.angles[second]), rims.wedges.openings[rim] / math.pi
    amplitudes = edge_amplitudes(*angles, wedges, faces[rim], before, after, longer, search.edge_strength)
    if search.edge_strength is not EdgeStrength.UNIFORM:
        return amplitudes
    arriving = Arriving(out.rims, out.angles, out.radial)
    leaving = arriving if back is out else Arriving(back.rims, back.angles, back.radial)
    amplitudes += along_narrow_walls((arriving, leaving), rows, rims.wedges, faces, search.wavelength)
    loudest, sizes = faces[rim].max(axis=1), np.abs(amplitudes)
    return np.asarray(amplitudes * np.minimum(1.0, loudest / np.maximum(sizes, 1e-300)))


# Paths that the round rim of a low post bends, straight back in the plan: the ends of the post are level.
#
# Before and behind the rim, sound touches the same walls, so that it meets the rim where it is nearest. The rim is an
# outer right angle, and its curvature spreads the sound (Kouyoumjian and Pathak 1974, the caustic distance of an
# edge).


_STEPS = 6  # of Newton's method
_RIGHT_ANGLE = 1.5  # air around the rim, over π


def round_rims(room: Room, levels: Levels) -> list[tuple[int, int]]:
    """Return the ends of posts that sound can reach: number of the post, and 0 for the lower or 1 for the upper end."""
    first = len(room.walls)
    rows, ends = np.nonzero(
        (room.heights[first : room.levels.start] > levels.floor + MEETING)
        & (room.heights[first : room.levels.start] < levels.ceiling - MEETING)
    )
    return list(zip((first + rows).tolist(), ends.tolist(), strict=True))


def round_rim_paths(
    plan: Plan,
    levels: Levels,
    rims: list[tuple[int, int]],
    ends: tuple[FloatArray, FloatArray],
    height: float,
    search: PathSearch,
) -> Paths:
    """Return the paths by these rims between `ends`, the positions (2,) of sender and receiver at a height, m."""
    search = replace(search, max_bounces=min(search.max_bounces, MOST_REFLECTIONS))
    room, (sender, receiver) = plan.room, ends
    heights = np.array([room.heights[rim] for rim in rims], dtype=np.float64)
    sequences = sequences_to(levels, heights, height, search)
    climbs = sequences.totals * np.where(sequences.signs[:, 0] < 0, -1.0, 1.0)
    posts = np.unique([post for post, _ in rims]).astype(np.int32)
    approaches = approaches_to(plan, posts, sender, receiver, climbs, search)
    rim, way, first, second = _combined(rims, approaches.walls, sequences)
    bounces = 2 * approaches.bounces[way] + (sequences.levels >= 0).sum(axis=1)[np.array([first, second])].sum(axis=0)
    few = np.flatnonzero(bounces <= search.max_bounces)
    rim, way, first, second = rim[few], way[few], first[few], second[few]
    images = approaches.images, images_of(receiver, approaches.surfaces, room.walls)
    circles = room.posts[np.array([post for post, _ in rims]) - len(room.walls)][rim]
    rises = [sequences.totals[chosen] * sequences.signs[chosen, 1] for chosen in (first, second)]
    sources, receivers = (
        np.column_stack((image[way], heights[rim] + rise)) for image, rise in zip(images, rises, strict=True)
    )
    points, lengths, amplitudes = _bent(room, rims, rim, circles, sources, receivers, heights[rim], search)
    of_levels = np.append(room.reflectances[levels.surfaces], 1.0)[sequences.levels].prod(axis=1)
    gains = approaches.gains[way] ** 2 * of_levels[first] * of_levels[second] * np.abs(amplitudes)
    bends = Bends(_edges(room, rims)[rim], points, lengths, gains, np.angle(amplitudes))
    loud = np.flatnonzero((lengths <= search.max_length + SLACK) & (gains >= search.faintest_diffraction))
    bends = Bends._make(column[loud] for column in bends)
    both = End(sender, approaches, way[loud], first[loud]), End(receiver, approaches, way[loud], second[loud])
    return paths_by(plan, levels, sequences, both, bends, search)


def _combined(
    rims: list[tuple[int, int]], posts: IntArray, sequences: RimSequences
) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp], NDArray[np.intp]]:
    """Return rim, approach, and the sequences of levels before and behind, for all that fit together, (m,) each."""
    parts = []
    for row, (begin, behind) in enumerate(sequences.of_rims.tolist()):
        grid = np.meshgrid(np.flatnonzero(posts == rims[row][0]), *[np.arange(begin, behind)] * 2, indexing="ij")
        parts.append((np.full(grid[0].size, row), *(axis.ravel() for axis in grid)))
    rim, way, first, second = (np.concatenate(column) for column in zip(*parts, strict=True))
    return rim, way, first, second


def _edges(room: Room, rims: list[tuple[int, int]]) -> IntArray:
    return np.array([room.edge_between(post, _lid_of(room, post, end)) for post, end in rims], dtype=np.int32)


def _lid_of(room: Room, post: int, end: int) -> int:
    """Return the lid at the lower or upper end (0 or 1) of a post; the post itself if there is none."""
    centre = room.posts[post - len(room.walls), :2]
    for surface in room.levels:
        lid = room.lid(surface)
        if lid is None or lid.radius == 0.0 or lid.upper != bool(end):
            continue
        if (lid.corners[0] == centre).all() and lid.height == room.heights[post, end]:
            return surface
    return post


def _bent(
    room: Room,
    rims: list[tuple[int, int]],
    rim: NDArray[np.intp],
    circles: FloatArray,
    source: FloatArray,
    receiver: FloatArray,
    heights: FloatArray,
    search: PathSearch,
) -> tuple[FloatArray, FloatArray, ComplexArray]:
    """Return points (m, 2) m, lengths (m,) m and amplitudes (m,) of bends between points in space (m, 3).

    `circles` (m, 3) and `heights` (m,) m are those of the rims.
    """
    centres, radii = circles[:, :2], circles[:, 2]
    angles = _nearest(source, receiver, circles, heights)
    outward = np.column_stack((np.cos(angles), np.sin(angles)))
    points = centres + radii[:, None] * outward
    bends = np.column_stack((points, heights))
    (aside, up, before), (other_aside, other_up, after) = (
        (((end[:, :2] - points) * outward).sum(axis=1), end[:, 2] - heights, np.sqrt(((end - bends) ** 2).sum(axis=1)))
        for end in (source, receiver)
    )
    near, far = np.hypot(aside, up), np.hypot(other_aside, other_up)
    before, after = np.maximum(before, 1e-12), np.maximum(after, 1e-12)
    lengths = before + after
    cone = np.clip((near + far) / lengths, 1e-6, 1.0)
    upper = np.array([end for _, end in rims], dtype=np.bool_)[rim]
    # the first face is the side of the post below an upper end, or the end itself at a lower one
    begin = np.where(upper, 1.5 * math.pi, math.pi)
    turned = [np.mod(np.arctan2(rise, away) - begin, math.tau) for away, rise in ((aside, up), (other_aside, other_up))]
    faces = np.array([_reflectances(room, post, end) for post, end in rims])[rim]
    wedges = np.full(len(rim), _RIGHT_ANGLE)
    # from the side of the axis, the rim is not visible
    outside = (aside > 0.0) & (other_aside > 0.0)
    wave = search.wavelength / cone
    amplitudes = edge_amplitudes(turned[0], turned[1], wedges, faces, near, far, wave, search.edge_strength)
    curvature = (np.maximum(aside, 0.0) / before + np.maximum(other_aside, 0.0) / after) / (radii * cone**2)
    caustic = 1 / (1 / before + curvature)
    spread = np.sqrt(np.where(outside, caustic * lengths / (before * (caustic + after)), 0.0))
    return points, lengths, amplitudes * spread


def _reflectances(room: Room, post: int, end: int) -> tuple[float, float]:
    """Return the reflectances of the first and last face at an end of a post; its ends are silent without lids."""
    lid = _lid_of(room, post, end)
    of_end = 0.0 if lid == post else float(room.reflectances[lid])
    side = float(room.reflectances[post])
    return (side, of_end) if end else (of_end, side)


def _nearest(source: FloatArray, receiver: FloatArray, circles: FloatArray, heights: FloatArray) -> FloatArray:
    """Return the angles (m,) rad of the points of circles with the shortest way between two points (m, 3)."""
    away = [end[:, :2] - circles[:, :2] for end in (source, receiver)]
    sum_of = sum(step / np.maximum(np.hypot(*step.T), 1e-300)[:, None] for step in away)
    angles = np.arctan2(*np.asarray(sum_of).T[::-1])
    radii = circles[:, 2]
    for _ in range(_STEPS):
        cosine, sine = np.cos(angles), np.sin(angles)
        slope, bend = np.zeros((2, len(angles)))
        for end, (x, y) in zip((source, receiver), (step.T for step in away), strict=True):
            u, v = radii * cosine - x, radii * sine - y
            distance = np.sqrt(u**2 + v**2 + (end[:, 2] - heights) ** 2)
            along = radii * (v * cosine - u * sine) / distance
            slope += along
            bend += (radii**2 - radii * (u * cosine + v * sine) - along**2) / distance
        angles = angles - slope / np.where(bend > 0.0, bend, np.inf)
    return np.asarray(angles)
