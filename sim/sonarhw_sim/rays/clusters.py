"""Paths by clusters of small walls: ways to their centres and back, joined by the wave that the cluster scatters.

They replace the paths that reflect or bend at the walls of the cluster alone. What a free-standing cluster hides stays
hidden as by any walls: sound that hardly turns there belongs to the path past it.
"""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray
from sonarhw_sim.board.beam import ComplexArray
from sonarhw_sim.rays import fan
from sonarhw_sim.rays.diffraction import EdgeDiffraction
from sonarhw_sim.rays.sequences import FEWEST_POINTS, PartialPaths, surfaces_and_points
from sonarhw_sim.rays.small_waves import SmallWalls
from sonarhw_sim.room.room import Room
from sonarhw_sim.room.small_things import Cluster, Followed

_AT_CENTRE = 1e-6  # m
_TURN, _LEAST_TURNS, _LARGEST_TURN = 0.06, 1.2, 0.5  # of `passing_share`: rad; half shadows; rad
_LOUDEST = 2.0  # amplitude: no cluster returns more
_BEYOND_WALL = 1.35  # amplitude: the most that a strip returns, relative to an endless wall


def numbered(paths: PartialPaths, followed: Followed, room: Room) -> PartialPaths:
    """Return paths in the room that rays follow with surfaces and edges numbered as in the `room` itself."""
    base, joined = followed.room, followed.joined
    shift = len(room.walls) - len(base.walls)
    first = np.array([rows[0] for rows in joined] + [0] * len(base.posts) + [-1], dtype=np.int32)
    first[len(joined) : -1] = np.arange(len(base.posts)) + len(base.walls) + shift
    surfaces = np.where(paths.surfaces < 0, -1, first[paths.surfaces])
    several = np.array([len(rows) > 1 for rows in joined] + [False] * (len(base.posts) + 1))
    row, touch = np.nonzero(several[paths.surfaces] & (paths.surfaces >= 0))
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


def without_clusters(paths: PartialPaths, followed: Followed, room: Room) -> PartialPaths:
    """Return paths (numbered as in the `room`) without those by walls of solved clusters.

    Sound that bends at their edges and hardly turns keeps its share; it belongs to what is behind.
    """
    owner = np.full(len(room.walls) + len(room.posts) + 1, -1)
    for number, cluster in enumerate(followed.clusters):
        owner[list(cluster.walls)] = number
    touched = (owner[paths.surfaces] >= 0) & (paths.surfaces >= 0)
    gains = np.where(touched.any(axis=1), 0.0, paths.gains)
    bent = np.flatnonzero(paths.edges >= 0)
    own = owner[room.edges.faces[paths.edges[bent]]].max(axis=1)
    bent, own = bent[own >= 0], own[own >= 0]
    if len(bent):
        radii = np.array([cluster.radius for cluster in followed.clusters])[own]
        before, at, after = (paths.points[bent, paths.bends[bent] + step] for step in (0, 1, 2))
        legs = np.hypot(*np.moveaxis(np.diff(paths.points[bent], axis=1), -1, 0))
        first = np.nansum(np.where(np.arange(legs.shape[1]) <= paths.bends[bent, None], legs, 0.0), axis=1)
        turns = _angles(at - before, after - at)
        gains[bent] *= passing_share(turns, radii, first, np.nansum(legs, axis=1) - first)
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
    others = [cluster for k, cluster in enumerate(followed.clusters) if k != number and not cluster.on_wall]
    walls = room.walls[[row for cluster in others for row in cluster.walls]].reshape(-1, 4)
    ways = ways.select(np.flatnonzero(~_blocked(ways.points, walls)))
    bare = replace(followed, room=followed.bare, joined=_walls_of_bare(followed))
    return replace(numbered(replace(ways, edges=np.full(len(ways), -1, np.int32)), bare, room), edges=ways.edges)


def _walls_of_bare(followed: Followed) -> tuple[tuple[int, ...], ...]:
    alone = {row for cluster in followed.clusters if not cluster.on_wall for row in cluster.walls}
    return tuple(rows for rows in followed.joined if not alone.intersection(rows))


def _blocked(points: FloatArray, walls: FloatArray) -> NDArray[np.bool_]:
    """Return which paths (n, p, 2) cross a wall (m, 4), (n,)."""
    start, along = points[:, :-1, None], np.diff(points, axis=1)[:, :, None]
    wall, away = walls[:, 2:] - walls[:, :2], walls[:, :2] - start
    with np.errstate(divide="ignore", invalid="ignore"):
        area = along[..., 0] * wall[:, 1] - along[..., 1] * wall[:, 0]
        ahead = (away[..., 0] * wall[:, 1] - away[..., 1] * wall[:, 0]) / area
        share = (away[..., 0] * along[..., 1] - away[..., 1] * along[..., 0]) / area
    crossed = (ahead > 0) & (ahead < 1) & (share >= 0) & (share <= 1)
    return np.asarray(crossed.any(axis=(1, 2)))


def _joined(
    first: PartialPaths,
    second: PartialPaths,
    cluster: Cluster,
    room: Room,
    diffraction: EdgeDiffraction,
    limits: tuple[float, int],
) -> PartialPaths:
    """Return the paths by a cluster of each of the `first` ways and each of the `second`, reversed."""
    one, other = _loud_pairs(first, second, cluster, diffraction, limits)
    # most ways are too long or too faint for any pair
    if first is second:
        used = np.unique(np.append(one, other))
        first = second = first.select(used)
        one, other = np.searchsorted(used, one), np.searchsorted(used, other)
    else:
        (used, one), (again, other) = (np.unique(rows, return_inverse=True) for rows in (one, other))
        first, second = first.select(used), second.select(again)
    factors, delays = _factors(first, second, (one, other), cluster, room, diffraction.wavelength)
    gains = first.gains[one] * second.gains[other] * np.abs(factors)
    kept = np.flatnonzero(gains * _best_heading(first, second, one, other, diffraction.beams) >= diffraction.faintest)
    one, other, gains, factors, delays = one[kept], other[kept], gains[kept], factors[kept], delays[kept]
    surfaces, points = surfaces_and_points(first, second, one, other)
    # the delay is part of the length, and the phase is that of the wave
    delay = np.clip(delays, -2 * cluster.radius, 2 * cluster.radius)
    phases = np.angle(factors) + math.tau / diffraction.wavelength * delay + first.phases[one] + second.phases[other]
    edges = np.full(len(one), _edge_of(cluster, room), np.int32)
    lengths = first.lengths[one] + second.lengths[other] + delay
    return PartialPaths(lengths, gains, phases, surfaces, edges, first.bends[one], points, first.places[one])


def _loud_pairs(
    first: PartialPaths,
    second: PartialPaths,
    cluster: Cluster,
    diffraction: EdgeDiffraction,
    limits: tuple[float, int],
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the pairs of ways that are short enough, and that a cluster of this width may make loud enough."""
    parts = [(np.empty(0, np.intp), np.empty(0, np.intp))]
    seconds = np.arange(len(second))
    for row in range(len(first)):
        short = first.lengths[row] + second.lengths <= limits[0]
        short &= first.bends[row] + second.bends <= limits[1]
        other = seconds[short]
        one = np.full(len(other), row)
        # a plate of the width, straight ahead, returns half of this
        inverse = 1.0 / first.lengths[row] + 1.0 / second.lengths[other]
        most = np.minimum(2.0 * cluster.width * np.sqrt(inverse / diffraction.wavelength), _LOUDEST)
        bounds = first.gains[row] * second.gains[other] * most
        loud = bounds >= diffraction.faintest
        one, other, bounds = one[loud], other[loud], bounds[loud]
        bounds = bounds * _best_heading(first, second, one, other, diffraction.beams)
        loud = bounds >= diffraction.faintest
        parts.append((one[loud], other[loud]))
    fan.check_size(sum(len(one) for one, _ in parts), FEWEST_POINTS)
    return np.concatenate([one for one, _ in parts]), np.concatenate([other for _, other in parts])


def _best_heading(
    first: PartialPaths,
    second: PartialPaths,
    one: NDArray[np.intp],
    other: NDArray[np.intp],
    beams: FloatArray,
) -> FloatArray:
    """Return both beam factors at the best heading for pairs of ways, (p,)."""
    away, back = first.points[one, 1] - first.points[one, 0], second.points[other, 1] - second.points[other, 0]
    return np.asarray(beams[(_angles(away, back) / math.pi * (len(beams) - 1)).astype(np.intp)])


def _factors(
    first: PartialPaths,
    second: PartialPaths,
    pairs: tuple[NDArray[np.intp], NDArray[np.intp]],
    cluster: Cluster,
    room: Room,
    wavelength: float,
) -> tuple[ComplexArray, FloatArray]:
    """Return what the cluster scatters from the first to the second ways of pairs (p,), and its delay, (p,) m."""
    small = SmallWalls(cluster.local, wavelength, cluster.openings, cluster.on_wall)
    sources = _sources(first, cluster)
    receivers = None if second is first else _sources(second, cluster)
    factors, delays = small.factors(sources, receivers, pairs)
    rows = list(cluster.walls)
    lengths = np.hypot(*(room.walls[rows, 2:] - room.walls[rows, :2]).T)
    factors = factors * float((room.reflectances[rows] * lengths).sum() / lengths.sum())
    if not cluster.on_wall:
        one, other = sources[pairs[0]], (sources if receivers is None else receivers)[pairs[1]]
        before, after = first.lengths[pairs[0]], second.lengths[pairs[1]]
        radii = np.full(len(before), cluster.radius)
        factors = factors * (1.0 - passing_share(_angles(-one, other), radii, before, after))
    return factors, delays


def _sources(ways: PartialPaths, cluster: Cluster) -> FloatArray:
    """Return where the sound of ways seems to come from, in coordinates of the cluster, (n, 2) m."""
    rows = np.arange(len(ways))
    away = ways.points[rows, ways.bends] - np.array(cluster.centre)
    directions = np.arctan2(away[:, 1], away[:, 0]) - cluster.turn
    return np.asarray(ways.lengths[:, None] * np.column_stack((np.cos(directions), np.sin(directions))))


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
