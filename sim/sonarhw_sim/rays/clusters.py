"""Paths by clusters of small walls: ways to their centres and back, joined by the wave that the cluster scatters.

They replace the paths that reflect or bend at the walls of the cluster alone. What a free-standing cluster hides stays
hidden as by any walls: sound that hardly turns there belongs to the path past it.
"""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray
from sonarhw_sim.compiled import compiled
from sonarhw_sim.rays import fan
from sonarhw_sim.rays.diffraction import EdgeDiffraction, by_separation
from sonarhw_sim.rays.sequences import FEWEST_POINTS, PartialPaths, surfaces_and_points
from sonarhw_sim.rays.small_waves import SmallWalls
from sonarhw_sim.room.grid import IntArray
from sonarhw_sim.room.room import Room
from sonarhw_sim.room.small_things import Cluster, Followed

_AT_CENTRE = 1e-6  # m
_TURN, _LEAST_TURNS, _LARGEST_TURN = 0.06, 1.2, 0.5  # of `passing_share`: rad; half shadows; rad
_NARROW = 0.06  # rad: half width of a part; of a wider one, the mirrored sound is a path of its own
_LOUDEST = 2.0  # amplitude: no cluster returns more
_BEYOND_WALL = 1.35  # amplitude: the most that a strip returns, relative to an endless wall


def numbered(paths: PartialPaths, followed: Followed, room: Room) -> PartialPaths:
    """Return paths in the room that rays follow with surfaces and edges numbered as in the `room` itself."""
    base, joined = followed.room, followed.joined
    if base is room:
        return paths
    shift = len(room.walls) - len(base.walls)
    first = np.array([rows[0] for rows in joined] + [0] * len(base.posts) + [-1], dtype=np.int32)
    first[len(joined) : -1] = np.arange(len(base.posts)) + len(base.walls) + shift
    surfaces = np.where(paths.surfaces < 0, -1, first[paths.surfaces])
    several = np.array([len(rows) > 1 for rows in joined] + [False] * (len(base.posts) + 1))
    row, touch = np.nonzero(several[paths.surfaces]) if several.any() else np.empty((2, 0), np.intp)
    point = touch + 1 + ((paths.edges[row] >= 0) & (touch >= paths.bends[row]))
    for wall in np.unique(paths.surfaces[row, touch]).tolist():
        touches = np.flatnonzero(paths.surfaces[row, touch] == wall)
        rows = np.array(joined[wall])
        nearest = _nearest(paths.points[row[touches], point[touches]], room.walls[rows])
        surfaces[row[touches], touch[touches]] = rows[nearest]
    edges = np.append(followed.edges, -1)[paths.edges].astype(np.int32)
    return replace(paths, surfaces=surfaces.astype(np.int32), edges=edges)


def _nearest(points: FloatArray, walls: FloatArray) -> NDArray[np.intp]:
    """Return which wall (n, 4) of one line each point (m, 2) on it is nearest to, (m,)."""
    middles, halves = (walls[:, :2] + walls[:, 2:]) / 2, np.hypot(*(walls[:, 2:] - walls[:, :2]).T) / 2
    away = np.hypot(*np.moveaxis(points[:, None] - middles, -1, 0)) - halves
    return np.asarray(away.argmin(axis=1))


def past_clusters(paths: PartialPaths, followed: Followed, room: Room) -> PartialPaths:
    """Return paths (numbered as in the `room`) with the share of sound that bends at solved clusters and hardly turns.

    It belongs to what is behind; other sound at their edges is part of what the cluster returns.
    """
    owner = np.full(len(room.walls), -1)
    for number, cluster in enumerate(followed.clusters):
        owner[list(cluster.walls)] = number
    bent = np.flatnonzero(paths.edges >= 0)
    own = owner[room.edges.faces[paths.edges[bent]]].max(axis=1)
    bent, own = bent[own >= 0], own[own >= 0]
    if not len(bent):
        return paths
    gains = paths.gains.copy()
    before, at, after = (paths.points[bent, paths.bends[bent] + step] for step in (0, 1, 2))
    turns = _angles(at - before, after - at)
    gains[bent] = 0.0
    little = np.flatnonzero(turns < 2 * _LARGEST_TURN)
    bent, turns = bent[little], turns[little]
    radii = np.array([cluster.radius for cluster in followed.clusters])[own[little]]
    legs = np.hypot(*np.moveaxis(np.diff(paths.points[bent], axis=1), -1, 0))
    first = np.nansum(np.where(np.arange(legs.shape[1]) <= paths.bends[bent, None], legs, 0.0), axis=1)
    gains[bent] = paths.gains[bent] * passing_share(turns, radii, first, np.nansum(legs, axis=1) - first)
    return replace(paths, gains=gains).select(np.flatnonzero(gains > 0.0))


def passing_share(turns: FloatArray, radii: FloatArray, before: FloatArray, after: FloatArray) -> FloatArray:
    """Return the share, 0..1, of sound turned by `turns` (n,) rad that belongs to the path past a thing."""
    reach = np.clip(_LEAST_TURNS * radii * (1.0 / before + 1.0 / after), _TURN, _LARGEST_TURN)
    beyond = np.clip(turns / reach - 1.0, 0.0, 1.0)
    return np.asarray(1.0 - beyond * beyond * (3.0 - 2.0 * beyond))


def _angles(one: FloatArray, other: FloatArray) -> FloatArray:
    across = one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]
    return np.asarray(np.abs(np.arctan2(across, (one * other).sum(axis=1))))


def by_clusters(
    out: PartialPaths,
    back: PartialPaths,
    followed: Followed,
    room: Room,
    diffraction: EdgeDiffraction,
    limits: tuple[float, int],
) -> PartialPaths:
    """Return the paths of ways `out` to the centres of clusters and ways `back` to them, reversed.

    Both are numbered as in `followed.bare`, the results as in `room`. `limits` are the greatest length, m, and the
    number of reflections. If `back` is `out`, each path has its reverse.
    """
    parts = []
    for number, cluster in enumerate(followed.clusters):
        ways = _to_centre(out, number, followed, room)
        returning = ways if back is out else _to_centre(back, number, followed, room)
        for place in np.unique(ways.places).tolist():
            first = ways.select(np.flatnonzero(ways.places == place))
            second = first if back is out else returning.select(np.flatnonzero(returning.places == place))
            if len(first) and len(second):
                parts.append(_joined(first, second, cluster, room, diffraction, limits))
    return PartialPaths.join(parts) if parts else PartialPaths.none()


def _to_centre(ways: PartialPaths, number: int, followed: Followed, room: Room) -> PartialPaths:
    """Return the ways to the centre of one cluster that no other cluster blocks, numbered as in the room."""
    rows = np.flatnonzero(ways.edges == number)
    last = ways.points[rows, ways.bends[rows]] - ways.points[rows, ways.bends[rows] + 1]
    ways = ways.select(rows[np.hypot(*last.T) > _AT_CENTRE])
    own = followed.clusters[number]
    if own.part.centre[1] > 0.0 and own.on_wall:
        # sound from below the wall is that of the image of its source
        ways = ways.select(np.flatnonzero(_sources(ways, own)[:, 1] > 0.0))
    others = [cluster for cluster in followed.clusters if cluster.walls != own.walls and not cluster.on_wall]
    walls = room.walls[[row for cluster in others for row in cluster.walls]].reshape(-1, 4)
    blocked = np.zeros(len(ways), np.bool_)
    _fill_blocked(ways.points, walls, blocked)
    ways = ways.select(np.flatnonzero(~blocked))
    bare = replace(followed, room=followed.bare, joined=_walls_of_bare(followed))
    return replace(numbered(replace(ways, edges=np.full(len(ways), -1, np.int32)), bare, room), edges=ways.edges)


def _walls_of_bare(followed: Followed) -> tuple[tuple[int, ...], ...]:
    alone = {row for cluster in followed.clusters if not cluster.on_wall for row in cluster.walls}
    return tuple(rows for rows in followed.joined if not alone.intersection(rows))


@compiled
def _fill_blocked(points: FloatArray, walls: FloatArray, blocked: NDArray[np.bool_]) -> None:
    """Fill in which paths (n, p, 2) cross a wall (m, 4), (n,)."""
    for k in range(points.shape[0]):
        for leg in range(points.shape[1] - 1):
            x, y = points[k, leg]
            dx, dy = points[k, leg + 1, 0] - x, points[k, leg + 1, 1] - y
            for m in range(walls.shape[0]):
                along, across = walls[m, 2] - walls[m, 0], walls[m, 3] - walls[m, 1]
                area = dx * across - dy * along
                ahead = ((walls[m, 0] - x) * across - (walls[m, 1] - y) * along) / area
                share = ((walls[m, 0] - x) * dy - (walls[m, 1] - y) * dx) / area
                # the rest of the points is NaN
                if 0.0 < ahead < 1.0 and 0.0 <= share <= 1.0:
                    blocked[k] = True


def _joined(
    first: PartialPaths,
    second: PartialPaths,
    cluster: Cluster,
    room: Room,
    diffraction: EdgeDiffraction,
    limits: tuple[float, int],
) -> PartialPaths:
    """Return the paths by a cluster of each of the `first` ways and each of the `second`, reversed."""
    pairs, legs = _loud_pairs(first, second, cluster, diffraction, limits)
    small = SmallWalls(cluster.local, diffraction.wavelength, cluster.openings, cluster.on_wall, cluster.part)
    points, both = _sources(first, cluster), pairs
    if second is not first:
        points, both = np.concatenate((points, _sources(second, cluster))), pairs + np.array([0, len(first)])
    rows, mirrors = _with_mirrors(small, points, both, first.bends[pairs[:, 0]] + second.bends[pairs[:, 1]])
    pairs, both, legs = pairs[rows], both[rows], legs[rows]
    sound = small.sound(points, both, mirrors)
    loud = np.flatnonzero(legs * np.abs(sound) >= diffraction.faintest)
    factors = sound[loud] * _strengths(points[both[loud]], cluster, room)
    kept = loud[still := legs[loud] * np.abs(factors) >= diffraction.faintest]
    # the delay is part of the length, and the phase is that of the wave
    delays = small.delays(points, both[kept], sound[kept], mirrors[kept])
    delays = np.clip(delays, -2 * cluster.radius, 2 * cluster.radius)
    pairs, mirrors, factors = pairs[kept], mirrors[kept], factors[still]
    if second is first:
        # and their reverses
        back = np.flatnonzero(pairs[:, 0] != pairs[:, 1])
        pairs, mirrors = np.append(pairs, pairs[back, ::-1], axis=0), np.append(mirrors, mirrors[back], axis=0)
        factors, delays = np.append(factors, factors[back]), np.append(delays, delays[back])
    one, other = pairs.T
    gains = first.gains[one] * second.gains[other] * np.abs(factors)
    surfaces, points = surfaces_and_points(first, second, one, other)
    moved = np.flatnonzero(mirrors[:, 2] > 0.0)
    points[moved, 1] = _in_room(mirrors[moved, :2], cluster)
    phases = np.angle(factors) + math.tau / diffraction.wavelength * delays + (first.phases[one] + second.phases[other])
    edges = np.full(len(one), _edge_of(cluster, room), np.int32)
    lengths = (first.lengths[one] + second.lengths[other]) + delays
    return PartialPaths(lengths, gains, phases, surfaces, edges, first.bends[one], points, first.places[one])


def _with_mirrors(
    small: SmallWalls, points: FloatArray, pairs: NDArray[np.intp], bends: IntArray
) -> tuple[NDArray[np.intp], FloatArray]:
    """Return all rows of pairs, those with a mirror twice, and the mirror (n, 3) of each.

    Only sound that is not reflected before, `bends`, may come from so near that one direction for a part is not enough.
    """
    rows, mirrors = np.arange(len(pairs)), np.full((len(pairs), 3), math.nan)
    nearest = np.hypot(*np.moveaxis(points[pairs], -1, 0)).min(axis=1)
    wide = np.flatnonzero((bends == 0) & (small.reach > _NARROW * nearest))
    mirrors[wide] = small.mirrors(points, pairs[wide])
    seen = wide[~np.isnan(mirrors[wide, 0])]
    return np.append(rows, seen), np.append(mirrors, mirrors[seen] * (1.0, 1.0, -1.0), axis=0)


def _loud_pairs(
    first: PartialPaths,
    second: PartialPaths,
    cluster: Cluster,
    diffraction: EdgeDiffraction,
    limits: tuple[float, int],
) -> tuple[NDArray[np.intp], FloatArray]:
    """Return the pairs of ways, (p, 2), that are short enough, and that a cluster of this width may make loud enough.

    Also their gains at the best heading with a perfect cluster, (p,). If both are the same ways, each pair is listed in
    one order only.
    """
    bounds = (*limits, cluster.width / math.sqrt(diffraction.wavelength), diffraction.faintest)
    columns = [(ways.lengths, ways.bends, ways.gains, _departures(ways)) for ways in (first, second)]
    count = fan.ROOM_FOR_PAIRS
    while True:
        pairs, legs = np.empty((count, 2), np.intp), np.empty(count)
        count = _fill_loud_pairs(*columns[0], *columns[1], second is first, bounds, diffraction.beams, pairs, legs)
        fan.check_size(count, FEWEST_POINTS)
        if count <= len(pairs):
            return pairs[:count], legs[:count]


def _departures(ways: PartialPaths) -> FloatArray:
    away = ways.points[:, 1] - ways.points[:, 0]
    return np.arctan2(away[:, 1], away[:, 0])


@compiled
def _fill_loud_pairs(
    lengths: FloatArray,
    bends: IntArray,
    gains: FloatArray,
    departures: FloatArray,
    other_lengths: FloatArray,
    other_bends: IntArray,
    other_gains: FloatArray,
    other_departures: FloatArray,
    symmetric: bool,
    limits: tuple[float, int, float, float],
    beams: FloatArray,
    pairs: NDArray[np.intp],
    legs: FloatArray,
) -> int:
    """Return the number of pairs of ways that may be loud enough, and fill in the first `pairs` and `legs`.

    `limits` are the greatest length, the number of reflections, the width over the root of the wavelength, and the
    faintest gain.
    """
    longest, most_bends, width, faintest = limits
    loudest, count = other_gains.max(), 0
    for i in range(lengths.shape[0]):
        if gains[i] * loudest * _LOUDEST < faintest:
            continue
        for j in range(i if symmetric else 0, other_lengths.shape[0]):
            if lengths[i] + other_lengths[j] > longest or bends[i] + other_bends[j] > most_bends:
                continue
            both = gains[i] * other_gains[j]
            # the simplest bound first, because most pairs are too faint
            if both * _LOUDEST < faintest:
                continue
            # a plate of the width, straight ahead, returns half of this
            most = min(2.0 * width * math.sqrt(1.0 / lengths[i] + 1.0 / other_lengths[j]), _LOUDEST)
            if both * most < faintest:
                continue
            both *= by_separation(departures[i], other_departures[j], beams)
            if both * most < faintest:
                continue
            if count < pairs.shape[0]:
                pairs[count, 0], pairs[count, 1], legs[count] = i, j, both
            count += 1
    return count


def _strengths(points: FloatArray, cluster: Cluster, room: Room) -> FloatArray:
    """Return the mean reflectance of a cluster, times the share of sound that no path past it has, (p,).

    The sound is between the points of pairs, (p, 2, 2).
    """
    rows = list(cluster.walls)
    lengths = np.hypot(*(room.walls[rows, 2:] - room.walls[rows, :2]).T)
    mean = float((room.reflectances[rows] * lengths).sum() / lengths.sum())
    if cluster.on_wall:
        return np.full(len(points), mean)
    radii, (before, after) = np.full(len(points), cluster.radius), np.hypot(*np.moveaxis(points, -1, 0)).T
    return mean * (1.0 - passing_share(_angles(-points[:, 0], points[:, 1]), radii, before, after))


def _sources(ways: PartialPaths, cluster: Cluster) -> FloatArray:
    """Return where the sound of ways seems to come from, in coordinates of the whole cluster, (n, 2) m."""
    rows = np.arange(len(ways))
    away = ways.points[rows, ways.bends] - np.array(cluster.centre)
    directions = np.arctan2(away[:, 1], away[:, 0]) - cluster.turn
    away = ways.lengths[:, None] * np.column_stack((np.cos(directions), np.sin(directions)))
    return np.asarray(away + cluster.part.centre)


def _in_room(points: FloatArray, cluster: Cluster) -> FloatArray:
    """Return points (n, 2) in coordinates of the whole cluster in those of the room, (n, 2) m."""
    away = (points - np.array(cluster.part.centre)) @ (1.0, 1j) * np.exp(1j * cluster.turn)
    return np.asarray(np.array(cluster.centre) + np.column_stack((away.real, away.imag)))


def _edge_of(cluster: Cluster, room: Room) -> int:
    """Return the edge of a cluster nearest to its centre, which names it; -1 if it has none."""
    own = np.flatnonzero(np.isin(room.edges.faces, cluster.walls).any(axis=1))
    if not len(own):
        return -1
    away = np.hypot(*(room.edges.points[own] - cluster.centre).T)
    return int(own[away.argmin()])


# Clusters that are not solved: a bound.


def bounded(paths: PartialPaths, followed: Followed, room: Room, wavelength: float) -> PartialPaths:
    """Return paths with the sound of each guessed cluster at most that of a plate of its width, straight ahead.

    A plate of width w returns w √(4/(λ L)) of an endless wall with paths of length L, and never more than 1.35.
    """
    gains = paths.gains.copy()
    for cluster in followed.guessed:
        own = np.zeros(len(room.walls) + len(room.posts) + 1, np.bool_)
        own[list(cluster.walls)] = True
        rows = np.flatnonzero((own[paths.surfaces] & (paths.surfaces >= 0)).any(axis=1) | _bend_at(paths, own, room))
        most = np.minimum(cluster.width * np.sqrt(4 / (wavelength * paths.lengths[rows])), _BEYOND_WALL)
        gains[rows] = np.minimum(gains[rows], most)
        phasors = gains[rows] * np.exp(1j * (paths.phases[rows] - math.tau / wavelength * paths.lengths[rows]))
        for begin, end in _together(paths, rows, 2 * cluster.width):
            total = abs(phasors[begin:end].sum())
            gains[rows[begin:end]] *= min(1.0, most[begin] / max(total, 1e-300))
    return replace(paths, gains=gains)


def _bend_at(paths: PartialPaths, own: NDArray[np.bool_], room: Room) -> NDArray[np.bool_]:
    if not len(room.edges):
        return np.zeros(len(paths), np.bool_)
    return np.asarray((paths.edges >= 0) & own[room.edges.faces[paths.edges]].any(axis=1))


def _together(paths: PartialPaths, rows: NDArray[np.intp], window: float) -> list[tuple[int, int]]:
    """Return where sets of paths (rows in order of place and length) of lengths within a window begin and end."""
    sets, begin = [], 0
    for k in range(1, len(rows) + 1):
        if (
            k == len(rows)
            or paths.places[rows[k]] != paths.places[rows[begin]]
            or paths.lengths[rows[k]] - paths.lengths[rows[begin]] > window
        ):
            sets.append((begin, k))
            begin = k
    return sets
