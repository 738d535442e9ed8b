"""Sound that bends past edges on the way to a wall and again on the way back: what is heard behind an obstacle.

Sound to a wall behind an obstacle and back passes the obstacle twice. Once bent, it has a path of its own, by the edge
(`rays.diffraction`). What is bent twice is added here to the path by the wall itself, whether that is free or hidden.
A product of two edges is wrong near their shadows, so both bends are one integral of Fresnel over two half planes.
"""

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray
from sonarhw_sim.board.beam import ComplexArray
from sonarhw_sim.compiled import array_part, compiled, compiled_part
from sonarhw_sim.rays.fan import Fan, Targets
from sonarhw_sim.rays.posts import THIN, equal_pairs
from sonarhw_sim.rays.sequences import ON_WALL, PartialPaths, hashes_of, path_is_free, solve_candidates, unfold
from sonarhw_sim.room.grid import IntArray, Listing, Surfaces, advance, enter, listed
from sonarhw_sim.room.room import Room

_REACH = 12.0  # beyond, two bends leave less than -58 dB
_CLIPPED = 0.86  # wavelengths: a leg to an edge may pass through the next corner of the same solid, this near to it
_AT_ENDS = 1e-8  # m: a wall that a leg touches so near to its end does not block it
_CONVEX = 1e-6  # rad, by which the air of an edge is more than 180°
_IN_LINE = 1e-9  # rad: sound that turns less at an edge is blocked by it, so it is in its shadow
_MOST_SITES = 32  # edges beside one path
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(24)
_FARTHEST = 7.0  # standard deviations


class _Silhouettes(NamedTuple):
    """The outer edges of a room, and those on each wall; for kernels."""

    points: FloatArray  # (e, 2), m
    faces: IntArray  # (e, 2): walls
    along: FloatArray  # (e, 4): unit vectors from the edge along both faces
    on_walls: Listing  # for each wall


class _Pairs(NamedTuple):
    """Ways that bend at two edges, one row each."""

    paths: NDArray[np.intp]  # (m,): row of the path by walls only
    legs: FloatArray  # (m, 3), m: to the first edge, to the second one, and from there
    turns: FloatArray  # (m, 2), rad: to the left, as if walls were unfolded
    shadowed: NDArray[np.bool_]  # (m, 2): whether each turns towards the wall of the edge


@dataclass(frozen=True)
class TwiceBent:
    """Paths by walls only, and what sound that bends twice adds to each."""

    paths: PartialPaths  # as if nothing blocked them
    added: ComplexArray  # (n,), relative to the sound of the path
    free: NDArray[np.bool_]  # (n,): whether nothing blocks it


def with_shadows(
    room: Room,
    reflected: PartialPaths,
    sources: FloatArray,
    ends: FloatArray,
    longest: float,
    most: int,
    limits: tuple[float, float],
) -> PartialPaths:
    """Return reflected paths with the sound that bends past edges twice, and those that only this sound follows.

    Paths by up to `most` reflections and `longest` m, from `sources` to `ends`, (n, 2) each; `limits` are the
    wavelength (m) and the gain of the faintest path to add.
    """
    wavelength, faintest = limits
    found = _twice_bent(room, sources, ends, longest, most, wavelength)
    if found is None:
        return reflected
    factors = np.ones(len(reflected), np.complex128)
    rows, added = _equal_rows(reflected, found)
    np.add.at(factors, rows, added)
    reflected = replace(reflected, gains=reflected.gains * np.abs(factors), phases=reflected.phases + np.angle(factors))
    gains = found.paths.gains * np.abs(found.added)
    hidden = replace(found.paths, gains=gains, phases=np.angle(found.added))
    return PartialPaths.join([reflected, hidden.select(np.flatnonzero(~found.free & (gains >= faintest)))])


def _equal_rows(paths: PartialPaths, found: TwiceBent) -> tuple[NDArray[np.intp], ComplexArray]:
    """Return the rows of paths (k,) that have the surfaces of one that is free, and what is added to each."""
    rows = np.flatnonzero((paths.edges < 0) & (paths.bends <= 2))
    few = np.full((len(rows), 2), -1, np.int32)
    few[:, : paths.surfaces.shape[1]] = paths.surfaces[rows, :2]
    free = np.flatnonzero(found.free)
    hashes = hashes_of(np.column_stack((found.paths.places[free], found.paths.surfaces[free])))
    order = np.argsort(hashes, kind="stable")
    sought = hashes_of(np.column_stack((paths.places[rows], few)))
    row, number = equal_pairs(sought, hashes[order])
    return rows[row], found.added[free[order[number]]]


def _twice_bent(
    room: Room, sources: FloatArray, ends: FloatArray, longest: float, most: int, wavelength: float
) -> TwiceBent | None:
    """Return the paths to which sound that bends twice adds something; None if there are none."""
    silhouettes = _silhouettes(room)
    if not len(silhouettes.points) or most < 1:
        return None
    wavenumber, surfaces = math.tau / wavelength, room.blocking(THIN * wavelength)
    sequences, points, lengths, places = _by_walls(room, sources, ends, longest, min(most, 2))
    counts = (sequences >= 0).sum(axis=1)
    pairs = _pairs_of(surfaces, silhouettes, sequences, points, wavenumber)
    if not len(pairs.paths):
        return None
    added = np.zeros(len(lengths), np.complex128)
    np.add.at(added, pairs.paths, _amplitudes(pairs, lengths[pairs.paths], wavenumber))
    rows = np.unique(pairs.paths)
    free = np.empty(len(rows), np.bool_)
    _fill_free(points[rows], counts[rows], surfaces, free)
    gains = np.append(room.reflectances, 1.0)[sequences[rows]].prod(axis=1)
    no_edge = np.full(len(rows), -1, np.int32)
    bends = counts[rows].astype(np.int32)
    none = np.zeros(len(rows))
    paths = PartialPaths(lengths[rows], gains, none, sequences[rows], no_edge, bends, points[rows], places[rows])
    return TwiceBent(paths, added[rows], free)


@lru_cache(maxsize=4)
def _silhouettes(room: Room) -> _Silhouettes:
    edges = room.edges
    rows = np.flatnonzero(edges.openings > math.pi + _CONVEX)
    directions = np.column_stack((edges.starts[rows], edges.starts[rows] + edges.openings[rows]))
    along = np.column_stack(
        (np.cos(directions[:, 0]), np.sin(directions[:, 0]), np.cos(directions[:, 1]), np.sin(directions[:, 1]))
    )
    faces = edges.faces[rows]
    order = np.argsort(faces.ravel(), kind="stable")
    starts = np.searchsorted(faces.ravel()[order], np.arange(len(room.walls) + 1)).astype(np.int32)
    return _Silhouettes(edges.points[rows], faces, along, Listing(starts, (order // 2).astype(np.int32)))


def _by_walls(
    room: Room, sources: FloatArray, ends: FloatArray, longest: float, most: int
) -> tuple[IntArray, FloatArray, FloatArray, IntArray]:
    """Return the paths by one wall, or two walls that meet: surfaces (n, 2), points (n, 4, 2), lengths (n,), places.

    Nothing blocks them. The places are rows of `sources`.
    """
    sequences = np.full((len(room.walls), 2), -1, np.int32)
    sequences[:, 0] = np.arange(len(room.walls))
    if most > 1:
        sequences = np.vstack((sequences, _corners(room)))
    counts = (sequences >= 0).sum(axis=1)
    places = np.repeat(np.arange(len(sources), dtype=np.int32), len(sequences))
    numbers = np.tile(np.arange(len(sequences), dtype=np.int32), len(sources))
    candidates = np.column_stack((numbers, counts[numbers].astype(np.int32), places))
    surfaces = room.surfaces
    nothing = surfaces._replace(listing=Listing(np.zeros_like(surfaces.listing.starts), surfaces.listing.numbers[:0]))
    targets = Targets.at(ends, np.full(len(ends), longest))
    real, points, lengths, _ = solve_candidates(sources, Fan(sequences, candidates), targets, nothing)
    padded = np.full((len(points), 5, 2), np.nan)
    padded[:, : points.shape[1]] = points
    # kernels are compiled for one layout only
    return sequences[numbers[real]], np.ascontiguousarray(padded[:, :4]), lengths, places[real]


@lru_cache(maxsize=4)
def _corners(room: Room) -> IntArray:
    """Return the pairs of walls that meet at their ends, in both orders, (p, 2)."""
    _, vertex = np.unique(room.walls.reshape(-1, 2), axis=0, return_inverse=True)
    order = np.argsort(vertex.ravel(), kind="stable")
    vertex, wall = vertex.ravel()[order], order // 2
    meet = np.flatnonzero(vertex[1:] == vertex[:-1])
    pairs = np.column_stack((wall[meet], wall[meet + 1]))
    return np.vstack((pairs, pairs[:, ::-1])).astype(np.int32)


def _pairs_of(
    surfaces: Surfaces, silhouettes: _Silhouettes, sequences: IntArray, points: FloatArray, wavenumber: float
) -> _Pairs:
    count = 256
    while True:
        paths, legs = np.empty(count, np.intp), np.empty((count, 3))
        turns, shadowed = np.empty((count, 2)), np.empty((count, 2), np.bool_)
        total = _fill_pairs(sequences, points, silhouettes, surfaces, wavenumber, paths, legs, turns, shadowed)
        if total <= count:
            return _Pairs(paths[:total], legs[:total], turns[:total], shadowed[:total])
        count = total


@compiled
def _fill_pairs(
    sequences: IntArray,
    points: FloatArray,
    silhouettes: _Silhouettes,
    surfaces: Surfaces,
    wavenumber: float,
    paths: NDArray[np.intp],
    legs: FloatArray,
    turns: FloatArray,
    shadowed: NDArray[np.bool_],
) -> int:
    """Fill in the columns of `_Pairs` for these paths, and return the number of pairs, which may be too many."""
    total = 0
    sites, images, way = _room_for_sites()
    clipped = _CLIPPED * math.tau / wavenumber
    for row in range(sequences.shape[0]):
        count = 1 if sequences[row, 1] < 0 else 2
        path, sequence = points[row, : count + 2], sequences[row, :count]
        length = 0.0
        for leg in range(count + 1):
            length += math.hypot(path[leg + 1, 0] - path[leg, 0], path[leg + 1, 1] - path[leg, 1])
        if not _may_be_heard(path, length, silhouettes, surfaces, wavenumber):
            continue
        found = _find_sites(path, length, sequence, silhouettes, wavenumber, sites)
        for first in range(found):
            for second in range(first + 1, found):
                if sites[first, 0] == sites[second, 0]:
                    continue
                if not _lay_way(
                    path, sequence, sites[first], sites[second], clipped, silhouettes, surfaces, images, way
                ):
                    continue
                if total < paths.shape[0]:
                    paths[total] = row
                    _measure(way, count, sites[first], sites[second], legs[total], turns[total], shadowed[total])
                total += 1
    return total


@array_part
def _room_for_sites() -> tuple[FloatArray, FloatArray, FloatArray]:
    return np.empty((_MOST_SITES, 4)), np.empty((4, 2)), np.empty((6, 2))


@compiled_part
def _reach(along: float, length: float, wavenumber: float) -> float:
    """Return how far beside a path (m) an edge may be, `along` of its `length`."""
    return _REACH / math.sqrt(wavenumber * length / max(along * (length - along), 1e-9))


@compiled_part
def _may_be_heard(
    path: FloatArray, length: float, silhouettes: _Silhouettes, surfaces: Surfaces, wavenumber: float
) -> bool:
    """Return whether only walls with an edge near enough block a path (k, 2)."""
    before = 0.0
    for leg in range(path.shape[0] - 1):
        x, y = path[leg, 0], path[leg, 1]
        size = math.hypot(path[leg + 1, 0] - x, path[leg + 1, 1] - y)
        if size <= 2 * _AT_ENDS:
            continue
        dx, dy = (path[leg + 1, 0] - x) / size, (path[leg + 1, 1] - y) / size
        walk = enter(surfaces.cells, x, y, dx, dy)
        while walk.inside:
            for k in listed(surfaces.cells, surfaces.listing, walk):
                if k >= surfaces.walls.shape[0]:
                    post = surfaces.posts[k - surfaces.walls.shape[0]]
                    ahead = (post[0] - x) * dx + (post[1] - y) * dy
                    ahead = min(max(ahead, 0.0), size)
                    if math.hypot(x + ahead * dx - post[0], y + ahead * dy - post[1]) < post[2] - 1e-7:
                        return False
                    continue
                crossing = _crossing(x, y, dx, dy, size, surfaces.walls[k])
                if crossing < 0.0:
                    continue
                reach = _reach(before + crossing, length, wavenumber)
                if not _has_edge(x + crossing * dx, y + crossing * dy, k, reach, silhouettes):
                    return False
            if min(walk.next_column, walk.next_row) > size:
                break
            walk = advance(surfaces.cells, walk)
        before += size
    return True


@compiled_part
def _crossing(x: float, y: float, dx: float, dy: float, size: float, wall: FloatArray) -> float:
    """Return where a leg crosses a wall, m; -1 if it does not."""
    ex, ey = wall[2] - wall[0], wall[3] - wall[1]
    across = dx * ey - dy * ex
    if across == 0.0:
        return -1.0
    rx, ry = wall[0] - x, wall[1] - y
    ahead, share = (rx * ey - ry * ex) / across, (rx * dy - ry * dx) / across
    if _AT_ENDS < ahead < size - _AT_ENDS and -1e-12 <= share <= 1.0 + 1e-12:
        return float(ahead)
    return -1.0


@compiled_part
def _has_edge(x: float, y: float, wall: int, reach: float, silhouettes: _Silhouettes) -> bool:
    """Return whether an outer edge of a wall is within `reach` m."""
    for k in range(silhouettes.on_walls.starts[wall], silhouettes.on_walls.starts[wall + 1]):
        point = silhouettes.points[silhouettes.on_walls.numbers[k]]
        if math.hypot(point[0] - x, point[1] - y) <= reach:
            return True
    return False


@compiled_part
def _find_sites(
    path: FloatArray,
    length: float,
    sequence: IntArray,
    silhouettes: _Silhouettes,
    wavenumber: float,
    sites: FloatArray,
) -> int:
    """Fill in the edges beside a path, in order of its legs; return their number.

    A site is the leg, the edge, the side of its walls (1: left, -1: right) and how deep the leg is in their shadow.
    """
    count, before = 0, 0.0
    for leg in range(path.shape[0] - 1):
        begin, x, y = count, path[leg, 0], path[leg, 1]
        size = math.hypot(path[leg + 1, 0] - x, path[leg + 1, 1] - y)
        if size <= 2 * _AT_ENDS:
            continue
        dx, dy = (path[leg + 1, 0] - x) / size, (path[leg + 1, 1] - y) / size
        for edge in range(silhouettes.points.shape[0]):
            cx, cy = silhouettes.points[edge, 0] - x, silhouettes.points[edge, 1] - y
            ahead, aside = cx * dx + cy * dy, cy * dx - cx * dy
            if ahead <= _AT_ENDS or ahead >= size - _AT_ENDS:
                continue
            reach = _reach(before + ahead, length, wavenumber)
            if abs(aside) > reach:
                continue
            side = _side(dx, dy, silhouettes.along[edge])
            if side == 0.0 or _is_touched(edge, leg, sequence, silhouettes):
                continue
            count = _enter_site(begin, count, leg, edge, side, -side * aside / reach, silhouettes, sites)
        before += size
    return count


@compiled_part
def _side(dx: float, dy: float, along: FloatArray) -> float:
    """Return on which side of a direction both faces of an edge are: 1 left, -1 right, 0 on both."""
    first, last = dx * along[1] - dy * along[0], dx * along[3] - dy * along[2]
    if first >= -1e-9 and last >= -1e-9 and max(first, last) > 1e-9:
        return 1.0
    if first <= 1e-9 and last <= 1e-9 and min(first, last) < -1e-9:
        return -1.0
    return 0.0


@compiled_part
def _is_touched(edge: int, leg: int, sequence: IntArray, silhouettes: _Silhouettes) -> bool:
    """Return whether a leg begins or ends at a wall of an edge."""
    for wall in silhouettes.faces[edge]:
        if (leg > 0 and wall == sequence[leg - 1]) or (leg < sequence.shape[0] and wall == sequence[leg]):
            return True
    return False


@compiled_part
def _enter_site(
    begin: int,
    count: int,
    leg: int,
    edge: int,
    side: float,
    depth: float,
    silhouettes: _Silhouettes,
    sites: FloatArray,
) -> int:
    """Enter an edge unless another one of the same wall casts a deeper shadow; return the number of sites."""
    for k in range(begin, count):
        if sites[k, 2] == side and _share_wall(int(sites[k, 1]), edge, silhouettes):
            if depth > sites[k, 3]:
                sites[k, 1], sites[k, 3] = edge, depth
            return count
    if count < sites.shape[0]:
        sites[count, 0], sites[count, 1], sites[count, 2], sites[count, 3] = leg, edge, side, depth
        count += 1
    return count


@compiled_part
def _share_wall(edge: int, other: int, silhouettes: _Silhouettes) -> bool:
    for wall in silhouettes.faces[edge]:
        for other_wall in silhouettes.faces[other]:
            if wall == other_wall:
                return True
    return False


@compiled_part
def _lay_way(
    path: FloatArray,
    sequence: IntArray,
    first: FloatArray,
    second: FloatArray,
    clipped: float,
    silhouettes: _Silhouettes,
    surfaces: Surfaces,
    images: FloatArray,
    way: FloatArray,
) -> bool:
    """Fill in the way (k + 2, 2) by two edges at legs of a path (k, 2); return whether sound can take it."""
    last, leg, other_leg = path.shape[0] - 1, int(first[0]), int(second[0])
    edge, other = int(first[1]), int(second[1])
    way[0, 0], way[0, 1] = path[0, 0], path[0, 1]
    way[leg + 1, 0], way[leg + 1, 1] = silhouettes.points[edge, 0], silhouettes.points[edge, 1]
    way[other_leg + 2, 0], way[other_leg + 2, 1] = silhouettes.points[other, 0], silhouettes.points[other, 1]
    way[last + 2, 0], way[last + 2, 1] = path[last, 0], path[last, 1]
    if not unfold(way[: leg + 2], sequence[:leg], surfaces.walls, ON_WALL, images):
        return False
    if not unfold(way[leg + 1 : other_leg + 3], sequence[leg:other_leg], surfaces.walls, ON_WALL, images):
        return False
    if not unfold(way[other_leg + 2 : last + 3], sequence[other_leg:], surfaces.walls, ON_WALL, images):
        return False
    for k in range(last + 2):
        begins = edge if k <= other_leg + 1 else other
        ends = other if k > leg else edge
        if not _leg_is_free(way[k], way[k + 1], begins, ends, clipped, silhouettes, surfaces):
            return False
    return True


@compiled_part
def _leg_is_free(
    start: FloatArray,
    end: FloatArray,
    edge: int,
    other: int,
    clipped: float,
    silhouettes: _Silhouettes,
    surfaces: Surfaces,
) -> bool:
    """Return whether nothing blocks a leg, but for corners that it clips beside the edges where it begins and ends."""
    size = math.hypot(end[0] - start[0], end[1] - start[1])
    if size <= 2 * _AT_ENDS:
        return True
    x, y, dx, dy = start[0], start[1], (end[0] - start[0]) / size, (end[1] - start[1]) / size
    walk = enter(surfaces.cells, x, y, dx, dy)
    while walk.inside:
        for k in listed(surfaces.cells, surfaces.listing, walk):
            if k >= surfaces.walls.shape[0]:
                post = surfaces.posts[k - surfaces.walls.shape[0]]
                ahead = min(max((post[0] - x) * dx + (post[1] - y) * dy, 0.0), size)
                if math.hypot(x + ahead * dx - post[0], y + ahead * dy - post[1]) < post[2] - 1e-7:
                    return False
                continue
            crossing = _crossing(x, y, dx, dy, size, surfaces.walls[k])
            if crossing >= 0.0 and not _is_clipped(
                x + crossing * dx, y + crossing * dy, k, edge, other, clipped, silhouettes
            ):
                return False
        if min(walk.next_column, walk.next_row) > size:
            break
        walk = advance(surfaces.cells, walk)
    return True


@compiled_part
def _is_clipped(
    x: float, y: float, wall: int, edge: int, other: int, clipped: float, silhouettes: _Silhouettes
) -> bool:
    """Return whether a wall is crossed beside an edge that is one of two edges, or joined to it by a wall."""
    for k in range(silhouettes.on_walls.starts[wall], silhouettes.on_walls.starts[wall + 1]):
        near = silhouettes.on_walls.numbers[k]
        if math.hypot(silhouettes.points[near, 0] - x, silhouettes.points[near, 1] - y) > clipped:
            continue
        if _share_wall(near, edge, silhouettes) or _share_wall(near, other, silhouettes):
            return True
    return False


@compiled_part
def _measure(
    way: FloatArray,
    count: int,
    first: FloatArray,
    second: FloatArray,
    legs: FloatArray,
    turns: FloatArray,
    shadowed: NDArray[np.bool_],
) -> None:
    """Fill in lengths, turns, and whether they lead into the shadow, of a way by two edges."""
    at, other_at = int(first[0]) + 1, int(second[0]) + 2
    legs[0] = legs[1] = legs[2] = 0.0
    for k in range(count + 3):
        part = 0 if k < at else 1 if k < other_at else 2
        legs[part] += math.hypot(way[k + 1, 0] - way[k, 0], way[k + 1, 1] - way[k, 1])
    for number in range(2):
        k, site = (at, first) if number == 0 else (other_at, second)
        ux, uy = way[k, 0] - way[k - 1, 0], way[k, 1] - way[k - 1, 1]
        vx, vy = way[k + 1, 0] - way[k, 0], way[k + 1, 1] - way[k, 1]
        turn = math.atan2(ux * vy - uy * vx, ux * vx + uy * vy)
        if abs(turn) < _IN_LINE:
            turn = _IN_LINE * site[2]
        shadowed[number] = turn * site[2] > 0.0
        # an odd number of reflections before turns left into right
        turns[number] = turn if int(site[0]) % 2 == 0 else -turn


@compiled
def _fill_free(points: FloatArray, counts: NDArray[np.intp], surfaces: Surfaces, free: NDArray[np.bool_]) -> None:
    for row in range(points.shape[0]):
        free[row] = path_is_free(points[row, : counts[row] + 2], surfaces)


def _amplitudes(pairs: _Pairs, lengths: FloatArray, wavenumber: float) -> ComplexArray:
    """Return the amplitude of each way, relative to a path of `lengths` (m,) m that nothing blocks, (m,)."""
    a, b, c = pairs.legs.T
    bends = np.abs(2.0 * np.sin(0.5 * pairs.turns)).T
    first, second = bends * np.sqrt(wavenumber * np.stack((a * b / (a + b), b * c / (b + c))))
    correlation = np.sign(pairs.turns).prod(axis=1) * np.sqrt(a * c / ((a + b) * (b + c)))
    signs = np.where(pairs.shadowed, 0.5, -0.5).prod(axis=1)
    return np.asarray(signs * two_edges(first, second, correlation) * np.exp(-1j * wavenumber * (a + b + c - lengths)))


def two_edges(first: FloatArray, second: FloatArray, correlation: FloatArray) -> ComplexArray:
    """Return the transition function of two edges in turn, (m,): 1 + 2 asin(ρ)/π where both are in line.

    `first` and `second` (m,), from 0 on, are √(k L) times the bend at each edge, L = s s′/(s + s′); ρ (m,) is the
    correlation √(s s″/((s + s′)(s′ + s″))) of legs s, s′ and s″, negative for bends to different sides. For ρ = 0 it is
    the product of the transition functions of both edges. It is the Fresnel integral over a quarter of the plane,
    (2/π) √(1 - ρ²) ∬ exp(-(x² - 2 ρ x y + y²)/2 - √j (G₁ x + G₂ y)) dx dy, along the path of steepest descent.
    """
    angle = (math.pi / 4) * (_NODES + 1)
    cosine, sine = np.cos(angle), np.sin(angle)
    spread = np.sqrt(1.0 - correlation[:, None] * np.sin(2 * angle))
    slope = first[:, None] * cosine + second[:, None] * sine
    scale = _FARTHEST / (spread + 0.3 * slope)
    radius = scale[:, :, None] * 0.5 * (_NODES + 1)
    exponent = -0.5 * (spread[:, :, None] * radius) ** 2 - np.sqrt(1j) * slope[:, :, None] * radius
    # sums of rows, not products with a matrix: those depend on the number of rows in the last bit
    inner = (np.exp(exponent) * radius * _WEIGHTS).sum(axis=2) * 0.5 * scale
    return np.asarray(0.5 * np.sqrt(1.0 - correlation**2) * (inner * _WEIGHTS).sum(axis=1))
