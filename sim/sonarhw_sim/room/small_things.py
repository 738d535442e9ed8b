"""Small walls that sound meets as one thing, and the room without them, in which rays are followed.

Rays hold for edges farther apart than a Fresnel zone, √(λ z) at a distance z. Walls that are nearer to each other, or
meet in short inner corners, are a cluster. A cluster is solved by the wave if it stands alone, or on one wall that
continues at both sides, and is not too large. Also, touching walls on one line are one wall to rays.
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray
from sonarhw_sim.room.edges import Edges, find_edges, wedges_at
from sonarhw_sim.room.grid import IntArray
from sonarhw_sim.room.room import Room, encloses, wall_distances
from sonarhw_sim.room.room_file import MEETING

# in wavelengths
_SHORT = 24.0  # an inner corner with a shorter face: a Fresnel zone at 4 m
_NEAR = 8.0  # things with a narrower gap between them
_LONGEST = 45.0  # a longer wall is part of no cluster
_LARGEST = 90.0  # the outline of a cluster that is solved
_BESIDE = 8.0  # an endless wall continues so far at both sides of a cluster
_LEAST_BESIDE = 1.0  # the same, of a piece of walls that are not solved together
_NARROW = 7.0  # a cluster in one part
_WINDOW, _MOST_WINDOWS = 8.0, 4  # distance and number of windows along a cluster; for near places, half and twice
_NEAR_PLACE = 50.0  # there, 8 wavelengths are 0.16 rad: the beam changes between two windows
_SAMPLES = 64  # points of a wall, to find the windows that contain a part of it
_TOGETHER = 64.0  # sound that makes a detour as long arrives after a burst
_MOST = 1000  # short walls; with more, a room has no clusters
_FLAT = 0.01  # rad, by which a corner differs from a wall that continues
_SAME_WAY = 1e-6  # rad


class SoundPart(NamedTuple):
    """A part of the sound of a cluster, in its own coordinates: that of a window along x and along y."""

    numbers: tuple[tuple[int, int], ...] = ((0, 1), (0, 1))  # along x and y: number and count of windows
    spans: tuple[tuple[float, float], ...] = ((0.0, 0.0), (0.0, 0.0))  # along x and y: first and last window, m

    @property
    def centre(self) -> tuple[float, float]:
        """The middle of the window, m."""
        x, y = (
            low + (high - low) * number / (count - 1) if count > 1 else 0.0
            for (number, count), (low, high) in zip(self.numbers, self.spans, strict=True)
        )
        return x, y

    def share(self, places: FloatArray) -> FloatArray:
        """Return the share of the window in places (u, 2) m, (u,); that of all windows is 1."""
        total = np.ones(len(places))
        for column, ((number, count), (low, high)) in enumerate(zip(self.numbers, self.spans, strict=True)):
            along = np.clip((places[:, column] - low) / max(high - low, MEETING), 0.0, 1.0) * (count - 1)
            # falls linearly to the next window
            total *= np.maximum(1.0 - np.abs(along - number), 0.0)
        return total


WHOLE = SoundPart()


@dataclass(frozen=True)
class Cluster:
    """Small walls that sound meets as one thing."""

    walls: tuple[int, ...]  # rows of the room's walls
    solvable: bool
    centre: tuple[float, float]  # m; on a wall, on its line
    turn: float  # rad, of the x axis of its own coordinates: along the wall
    radius: float  # m, of a circle round the centre with all its walls
    width: float  # m: the largest distance between two of its points
    local: tuple[tuple[float, float, float, float], ...] = ()  # its walls in its own coordinates, m
    openings: tuple[tuple[float, float], ...] = ()  # of the wall on which it stands, from x to x, m
    on_wall: bool = False
    part: SoundPart = WHOLE

    def parts(self, wavelength: float, near: bool) -> "tuple[Cluster, ...]":
        """Return the parts of a wide cluster, each with the centre by which rays follow its sound.

        Between two centres, the beam's factor is interpolated linearly, so for `near` places there are more of them.
        """
        walls = np.array(self.local).reshape(-1, 2, 2)
        openings = np.array([((a, 0.0), (b, 0.0)) for a, b in self.openings]).reshape(-1, 2, 2)
        lines = np.concatenate((walls, openings))
        ends = lines.reshape(-1, 2)
        low, high = ends.min(axis=0), ends.max(axis=0)
        if self.on_wall:
            # rays to a centre below the wall would be blocked
            low[1], high[1] = 0.0, 0.0 if self.openings else max(high[1], 0.0)
        finer = 2 if near else 1
        wide, windows = high - low > _NARROW * wavelength, np.ceil(finer * (high - low) / (_WINDOW * wavelength))
        counts = np.where(wide, np.minimum(1 + windows, finer * _MOST_WINDOWS), 1).astype(int).tolist()
        if counts == [1, 1]:
            return (self,)
        spans = tuple((float(a), float(b)) for a, b in zip(low, high, strict=True))
        along = np.linspace(0.0, 1.0, _SAMPLES)[:, None, None]
        places = (lines[:, 0] + along * (lines[:, 1] - lines[:, 0])).reshape(-1, 2)
        windows_of = (SoundPart(((x, counts[0]), (y, counts[1])), spans) for x, y in np.ndindex(*counts))
        parts = [part for part in windows_of if part.share(places).any()]  # others contain no wall
        turn = np.array([[math.cos(self.turn), math.sin(self.turn)], [-math.sin(self.turn), math.cos(self.turn)]])
        centres = [np.array(self.centre) + np.array(part.centre) @ turn for part in parts]
        return tuple(
            replace(self, centre=(float(x), float(y)), part=part) for part, (x, y) in zip(parts, centres, strict=True)
        )


class Slit(NamedTuple):
    """A narrow gap between two long walls."""

    walls: tuple[int, int]  # rows of the room's walls
    middle: FloatArray  # (2,) m


@dataclass(frozen=True)
class Followed:
    """A room as rays see it."""

    room: Room  # without clusters on walls, and with walls on one line joined
    bare: Room  # without any cluster that is solved; its edges are the centres of these
    clusters: tuple[Cluster, ...]  # parts of solved ones, rows of `bare.edges`
    guessed: tuple[Cluster, ...]  # those that are not solved
    joined: tuple[tuple[int, ...], ...]  # of each wall of `room`, rows of the original walls
    edges: IntArray  # of each edge of `room`, its row in the original edges
    faces: FloatArray  # (e, 2): reflectances at the edges of `room`; its own walls of clusters reflect no rays


def near_clusters(room: Room, wavelength: float, places: FloatArray) -> NDArray[np.bool_]:
    """Return which places (n, 2) are so near to a solved cluster that its parts have to be smaller, (n,)."""
    rows = [row for cluster in clusters_of(room, wavelength) if cluster.solvable for row in cluster.walls]
    if not rows:
        return np.zeros(len(places), np.bool_)
    return np.asarray((wall_distances(places, room.walls[rows]) < _NEAR_PLACE * wavelength).any(axis=1))


@lru_cache(maxsize=8)
def followed(room: Room, wavelength: float, solves: bool, near: bool) -> Followed | None:
    """Return the room that rays follow from places `near` clusters or not; None if it is the room itself.

    Without `solves`, no cluster is solved.
    """
    groups, walls = _on_one_line(room)
    clusters = clusters_of(room, wavelength) if solves else ()
    solved = tuple(cluster for cluster in clusters if cluster.solvable)
    guessed = tuple(cluster for cluster in clusters if not cluster.solvable)
    if len(groups) == len(room.walls) and not clusters:
        return None
    if not solved and len(groups) == len(room.walls):
        everywhere = np.arange(len(room.edges), dtype=np.int32)
        faces = room.reflectances[room.edges.faces]
        return Followed(room, room, (), guessed, tuple(groups), everywhere, faces)
    removed = {row for cluster in solved if cluster.on_wall for row in cluster.walls}
    alone = {row for cluster in solved if not cluster.on_wall for row in cluster.walls}
    for cluster in solved:
        if cluster.openings:
            _close(walls, cluster)
    kept = [k for k, group in enumerate(groups) if not removed.intersection(group)]
    bare = [k for k, group in enumerate(groups) if not (removed | alone).intersection(group)]
    base = _with_walls(room, walls, groups, kept)
    parts = tuple(part for cluster in solved for part in cluster.parts(wavelength, near))
    without = replace(_with_walls(room, walls, groups, bare), edges=_centres(parts))
    joined = tuple(groups[k] for k in kept)
    silent = [row for row, group in enumerate(joined) if alone.intersection(group)]
    edges = find_edges(base.walls, base.names[: len(base.walls)])
    # no sound bends past an inner corner
    inner = np.isin(edges.faces, silent).any(axis=1) & (edges.openings < math.pi)
    edges = edges.select(np.flatnonzero(~inner))
    faces, reflectances = base.reflectances[edges.faces], base.reflectances.copy()
    reflectances[silent] = 0.0
    base = replace(base, edges=edges, reflectances=reflectances)
    return Followed(base, without, parts, guessed, joined, _same_edges(edges, room.edges), faces)


def _with_walls(room: Room, walls: FloatArray, groups: Sequence[tuple[int, ...]], kept: Sequence[int]) -> Room:
    """Return the plan of the room with these walls only."""
    first = np.array([groups[k][0] for k in kept], dtype=np.intp)
    rows = np.concatenate((first, np.arange(len(room.walls), room.levels.start)))
    return replace(
        room,
        walls=walls[list(kept)].reshape(-1, 4),
        reflectances=room.reflectances[rows],
        scattered=room.scattered[rows],
        heights=room.heights[rows],
        names=tuple(room.names[k] for k in rows.tolist()),
        materials=tuple(room.materials[k] for k in rows.tolist()),
        lids=(),
    )


def _centres(clusters: Sequence[Cluster]) -> Edges:
    count = len(clusters)
    points = np.array([cluster.centre for cluster in clusters]).reshape(-1, 2)
    everywhere = np.full(count, math.tau)
    return Edges(points, np.zeros(count), everywhere, np.zeros((count, 2), np.int32), ("",) * count)


def _same_edges(edges: Edges, original: Edges) -> IntArray:
    """Return the original row of each edge."""
    rows = np.zeros(len(edges), np.int32)
    for k in range(len(edges)):
        away = np.hypot(*(original.points - edges.points[k]).T)
        turned = np.abs(np.exp(1j * original.starts) - np.exp(1j * edges.starts[k]))
        rows[k] = int(np.argmin(away + 1e-3 * (turned + np.abs(original.openings - edges.openings[k]))))
    return rows


# Walls on one line.


def _on_one_line(room: Room) -> tuple[list[tuple[int, ...]], FloatArray]:
    """Return the rows of touching walls on one line with equal surfaces, in order, and the wall (4,) of each."""
    walls = room.walls
    first, second = _meeting_in_line(room)
    if not len(first):
        return [(row,) for row in range(len(walls))], walls.copy()
    leads = np.arange(len(walls))
    for one, other in zip(first.tolist(), second.tolist(), strict=True):
        leads[leads == max(leads[one], leads[other])] = min(leads[one], leads[other])
    groups: dict[int, list[int]] = {}
    for row, lead in enumerate(leads.tolist()):
        groups.setdefault(lead, []).append(row)
    rows = [tuple(group) for group in groups.values()]
    return rows, np.array([_joined_wall(walls, group) for group in rows])


def _meeting_in_line(room: Room) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the pairs of walls that meet at their ends, continue each other, and have equal surfaces."""
    walls = room.walls
    _, node = np.unique(walls.reshape(-1, 2), axis=0, return_inverse=True)
    order = np.argsort(node.ravel(), kind="stable")
    node, end = node.ravel()[order], order
    pairs = []
    # where more than two walls meet, those that continue each other need not be neighbours in this order
    for step in (1, 2, 3):
        here = np.flatnonzero(node[step:] == node[:-step]) if len(node) > step else np.empty(0, np.intp)
        pairs.append(np.column_stack((end[here], end[here + step])))
    ends = np.vstack(pairs)
    first, second = ends.T // 2
    # away from the common point
    along, other = ((1 - 2 * (ends[:, k] % 2))[:, None] * _along(walls[ends[:, k] // 2]) for k in (0, 1))
    aside = np.abs(along[:, 0] * other[:, 1] - along[:, 1] * other[:, 0])
    opposite = (along * other).sum(axis=1) < 0
    length = np.minimum(np.hypot(*along.T), np.hypot(*other.T))
    in_line = opposite & (aside <= MEETING * np.maximum(np.hypot(*along.T), np.hypot(*other.T))) & (length > 0)
    tables = {name: number for number, name in enumerate(room.tables)}
    table = np.array([tables.get(name, -1) for name in room.materials])
    alike = (table[first] == table[second]) & (room.reflectances[first] == room.reflectances[second])
    alike &= room.scattered[first] == room.scattered[second]
    alike &= (room.heights[first] == room.heights[second]).all(axis=1) & (first != second)
    return first[in_line & alike], second[in_line & alike]


def _along(walls: FloatArray) -> FloatArray:
    return np.asarray(walls[:, 2:] - walls[:, :2])


def _joined_wall(walls: FloatArray, group: tuple[int, ...]) -> FloatArray:
    """Return the wall (4,) of walls on one line, in the direction of the first."""
    wall: FloatArray = walls[group[0]]
    if len(group) == 1:
        return wall
    ends = walls[list(group)].reshape(-1, 2)
    along = (ends - wall[:2]) @ (wall[2:] - wall[:2])
    return np.asarray(np.concatenate((ends[along.argmin()], ends[along.argmax()])))


# Clusters.


@lru_cache(maxsize=8)
def clusters_of(room: Room, wavelength: float) -> tuple[Cluster, ...]:
    """Return the clusters of a room for sound of this wavelength, m."""
    groups, walls = _on_one_line(room)
    lengths = np.hypot(*_along(walls).T)
    small = np.flatnonzero(lengths <= _LONGEST * wavelength)
    if not 0 < len(small) <= _MOST:
        return ()
    large = np.flatnonzero(lengths > _LONGEST * wavelength)
    clusters = []
    for rows in _components(_gaps(walls[small], walls[small]) < _NEAR * wavelength):
        part = small[rows]
        gaps = _gaps(walls[part], walls[large]).min(axis=0) if len(large) else np.empty(0)
        beside = large[gaps < _NEAR * wavelength]
        if not _is_round_a_place(room, walls[part]) and _is_hard(room, walls, part, beside, wavelength):
            whole = _cluster(walls, groups, part, beside, wavelength)
            clusters += [whole] if whole.solvable else _in_pieces(room, walls, groups, part, wavelength)
    return tuple(clusters)


def _in_pieces(
    room: Room, walls: FloatArray, groups: Sequence[tuple[int, ...]], part: NDArray[np.intp], wavelength: float
) -> list[Cluster]:
    """Return the clusters of walls that are not solved together: each piece that stands on one wall, and the rest.

    What a piece and its neighbours scatter to each other is left out, but not what another wall reflects to it.
    """
    short = np.hypot(*_along(walls[part]).T) <= _SHORT * wavelength
    pieces, rest = [], [part[:0]]
    others = np.setdiff1d(np.arange(len(walls)), part[short])
    for piece in _touching(walls, part[short]):
        solved = [_piece(walls, groups, piece, others, wavelength)]
        if not solved[0]:
            # a short wall that continues another one is what things stand on, as beside a niche near a corner
            continues = _continues_another(walls, piece)
            beside = np.union1d(others, piece[continues])
            own = _touching(walls, piece[~continues])
            solved = [_piece(walls, groups, rows, beside, wavelength) for rows in own]
        if solved and all(solved):
            pieces += [cluster for cluster in solved if cluster]
        else:
            rest.append(piece)
    left = np.concatenate(rest)
    beside = np.setdiff1d(others, left)
    beside = beside[_gaps(walls[left], walls[beside]).min(axis=0) < _NEAR * wavelength] if len(left) else beside
    if len(left) and _is_hard(room, walls, left, beside, wavelength):
        pieces.append(replace(_cluster(walls, groups, left, beside, wavelength), solvable=False))
    return pieces


def _touching(walls: FloatArray, rows: NDArray[np.intp]) -> list[NDArray[np.intp]]:
    """Return these rows of walls, divided into connected parts."""
    return [rows[part] for part in _components(_gaps(walls[rows], walls[rows]) <= MEETING)]


def _piece(
    walls: FloatArray,
    groups: Sequence[tuple[int, ...]],
    piece: NDArray[np.intp],
    others: NDArray[np.intp],
    wavelength: float,
) -> Cluster | None:
    """Return the cluster of a piece that stands on one of the other walls; None if it does not, or is not solved."""
    support = others[_gaps(walls[piece], walls[others]).min(axis=0) <= MEETING]
    cluster = _cluster(walls, groups, piece, support, wavelength, _LEAST_BESIDE) if len(support) else None
    return cluster if cluster is not None and cluster.solvable else None


def _continues_another(walls: FloatArray, rows: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Return which of these rows of walls are on one line with another wall of the room, (n,)."""
    along = _along(walls[rows]) / np.hypot(*_along(walls[rows]).T)[:, None]
    away = walls.reshape(-1, 2, 2) - walls[rows, None, None, :2]
    aside = np.abs(along[:, None, None, 0] * away[..., 1] - along[:, None, None, 1] * away[..., 0])
    return np.asarray((aside <= MEETING).all(axis=2).sum(axis=1) > 1)


def slits_of(room: Room, wavelength: float) -> list[Slit]:
    """Return the narrow gaps between two long walls that no cluster fills; one for each object."""
    groups, walls = _on_one_line(room)
    lengths = np.hypot(*_along(walls).T)
    large = np.flatnonzero(lengths > _LONGEST * wavelength)[:_MOST]
    gaps = _gaps(walls[large], walls[large])
    narrow = np.triu((gaps > MEETING) & (gaps < _NEAR * wavelength))
    for cluster in clusters_of(room, wavelength):
        beside = _gaps(room.walls[list(cluster.walls)], walls[large]).min(axis=0) < _NEAR * wavelength
        narrow &= ~(beside[:, None] & beside)
    slits, touch = [], gaps <= MEETING
    for one, other in np.argwhere(narrow).tolist():
        middle = _between(walls[large[one]], walls[large[other]])
        if narrow[one, other] and _can_be_heard(room, middle):
            slits.append(Slit((groups[large[one]][0], groups[large[other]][0]), middle))
            # one wall of each object is enough
            narrow[one, touch[other]] = narrow[touch[one], other] = False
    return slits


def coupled_to(cluster: Cluster, room: Room, wavelength: float) -> tuple[int, ...]:
    """Return the walls and posts from which sound of a solved cluster may return to it within a burst; empty: none.

    A thing of width w returns most of its sound up to w²/λ away hardly spread. So 2 w w′ > λ d for a detour d to
    another one; with this limit, measured levels of trays before walls without a finding are within 2 dB.
    """
    own, posts = room.walls[list(cluster.walls)], room.posts
    widths, others = np.append(np.hypot(*_along(room.walls).T), 2 * posts[:, 2]), clusters_of(room, wavelength)
    flat = np.column_stack((posts[:, :2], posts[:, :2] + [MEETING, 0.0]))
    gaps = _gaps(own, np.vstack((room.walls, flat)))
    nearest = gaps.min(axis=0) - np.append(np.zeros(len(room.walls)), posts[:, 2])
    # rays follow walls and posts, but not from the cluster back to it
    detours = 2 * nearest
    for other in others:
        widths[list(other.walls)] = other.width
        detours[list(other.walls)] = nearest[list(other.walls)]
    reach = 2 * cluster.width * np.minimum(widths, cluster.width) / wavelength
    near = detours < np.minimum(reach, _TOGETHER * wavelength)
    near[list(cluster.walls)] = False
    if cluster.on_wall:
        near[: len(room.walls)] &= ~_lies(_turned(room.walls, np.array(cluster.centre), cluster.turn))
    surfaces = np.vstack((room.walls, flat))
    return tuple(
        row
        for row in np.flatnonzero(near).tolist()
        if _can_be_heard(room, _between(own[gaps[:, row].argmin()], surfaces[row]))
    )


def _between(wall: FloatArray, other: FloatArray) -> FloatArray:
    """Return the middle of the shortest line between two walls (4,) that do not cross."""
    middles = []
    for ends, across in ((wall, other), (other, wall)):
        for end in (ends[:2], ends[2:]):
            along = across[2:] - across[:2]
            foot = across[:2] + min(max(float((end - across[:2]) @ along / (along @ along)), 0.0), 1.0) * along
            middles.append((math.dist(end, foot), *((end + foot) / 2).tolist()))
    return np.array(min(middles)[1:])


def _gaps(walls: FloatArray, others: FloatArray) -> FloatArray:
    """Return the gap between each wall (n, 4) and each other one (m, 4), (n, m) m; 0 if they cross."""
    gaps = np.minimum.reduce(
        [wall_distances(walls[:, k : k + 2], others) for k in (0, 2)]
        + [wall_distances(others[:, k : k + 2], walls).T for k in (0, 2)]
    )
    one, other = _along(walls), _along(others)
    area = one[:, None, 0] * other[:, 1] - one[:, None, 1] * other[:, 0]
    away = others[:, :2] - walls[:, None, :2]
    with np.errstate(divide="ignore", invalid="ignore"):
        share = (away[..., 0] * other[:, 1] - away[..., 1] * other[:, 0]) / area
        back = (away[..., 0] * one[:, None, 1] - away[..., 1] * one[:, None, 0]) / area
    gaps[(share > 0) & (share < 1) & (back > 0) & (back < 1)] = 0.0
    return np.asarray(gaps)


def _components(near: NDArray[np.bool_]) -> Iterator[NDArray[np.intp]]:
    """Yield the rows that are connected by a symmetric table (n, n)."""
    left = np.ones(len(near), np.bool_)
    while left.any():
        part = np.zeros(len(near), np.bool_)
        part[left.argmax()] = True
        while True:
            grown = part | near[part].any(axis=0)
            if (grown == part).all():
                break
            part = grown
        left &= ~part
        yield np.flatnonzero(part)


def _is_round_a_place(room: Room, walls: FloatArray) -> bool:
    """Return whether a place is between walls (n, 4): a small room is no thing in a room."""
    places = np.array([place.position for place in room.places.values()]).reshape(-1, 2)
    ends = walls.reshape(-1, 2)
    return bool(((places > ends.min(axis=0)) & (places < ends.max(axis=0))).all(axis=1).any())


def _is_hard(
    room: Room, walls: FloatArray, part: NDArray[np.intp], beside: NDArray[np.intp], wavelength: float
) -> bool:
    """Return whether the walls of a part have a narrow gap, or a short inner corner that sound can reach."""
    rows = np.concatenate((part, beside))
    some, count = walls[rows], len(part)
    touch = _gaps(some, some) <= MEETING
    pieces = [piece for piece in _components(touch) if (piece < count).any()]
    alone = [row for row in range(count, len(rows)) if not touch[row, :count].any()]
    if len(pieces) > 1 or alone:
        return True
    lengths = np.hypot(*_along(some).T)
    points = np.unique(some[:count].reshape(-1, 2), axis=0)
    for point, start, opening, first, last in wedges_at(points, some):
        if not _FLAT < opening < math.pi - _FLAT or min(first, last) >= count:
            continue
        middle = start + opening / 2
        inside = point + 1e-3 * min(lengths[first], lengths[last]) * np.array([math.cos(middle), math.sin(middle)])
        if min(lengths[first], lengths[last]) < _SHORT * wavelength and _can_be_heard(room, inside):
            return True
    return False


def _can_be_heard(room: Room, point: FloatArray) -> bool:
    """Return whether a point is in the same closed chains of walls as some place of the room.

    Without named places, one in no chain is heard, and one in the chain round the whole room only.
    """
    around = room.enclosures.chains_around(point)
    if not room.places:
        return not around or (len(around) == 1 and encloses(around[0], room.walls))
    chains = [chain.tobytes() for chain in around]
    places = (np.array(place.position) for place in room.places.values())
    return any([chain.tobytes() for chain in room.enclosures.chains_around(place)] == chains for place in places)


def _cluster(
    walls: FloatArray,
    groups: Sequence[tuple[int, ...]],
    part: NDArray[np.intp],
    beside: NDArray[np.intp],
    wavelength: float,
    continued: float = _BESIDE,
) -> Cluster:
    """Return the cluster of a part of the walls; one they stand on has to continue for some wavelengths."""
    originals = tuple(row for k in part.tolist() for row in groups[k])
    own = walls[part]
    ends = own.reshape(-1, 2)
    lengths = np.hypot(*_along(own).T)
    openings: tuple[tuple[float, float], ...] = ()
    is_small = bool(lengths.sum() <= _LARGEST * wavelength)
    if not len(beside):
        # along its longest wall, so that nothing depends on the axes of the room
        longest = own[int((lengths >= lengths.max() * (1.0 - 1e-9)).argmax())]
        turn = math.atan2(*(longest[2:] - longest[:2])[::-1])
        points = _turned(own, np.zeros(2), turn).reshape(-1, 2)
        middles = np.tile((points.min(axis=0) + points.max(axis=0)) / 2, (1, 2))
        centre = _turned(middles, np.zeros(2), -turn)[0, :2]
        solvable, on_wall = is_small, False
    else:
        longest = walls[beside[np.hypot(*_along(walls[beside]).T).argmax()]]
        turn = math.atan2(*(longest[2:] - longest[:2])[::-1])
        local = _turned(own, longest[:2], turn)
        low, high = float(local[:, 0::2].min()), float(local[:, 0::2].max())
        spans = _spans(_turned(walls[beside], longest[:2], turn))
        solvable = is_small and spans is not None and _continues(spans, low, high, continued * wavelength)
        middle = (low + high) / 2
        centre = longest[:2] + middle * np.array([math.cos(turn), math.sin(turn)])
        openings = () if spans is None else tuple(_openings([*spans, *_flat(local)], low, high, middle))
        on_wall = True
    local = _turned(own, centre, turn)
    local = _split(local, on_wall)
    if on_wall:
        local = local[~_lies(local)]
    radius = float(np.hypot(*(ends - centre).T).max())
    width = float(np.hypot(*np.moveaxis(ends[:, None] - ends, -1, 0)).max())
    coordinates = tuple(map(tuple, np.round(local, 9).tolist()))
    return Cluster(
        originals, solvable, (float(centre[0]), float(centre[1])), turn, radius, width, coordinates, openings, on_wall
    )


def _turned(walls: FloatArray, origin: FloatArray, turn: float) -> FloatArray:
    """Return walls (n, 4) in coordinates with this origin and direction of the x axis."""
    points = (walls.reshape(-1, 2) - origin) @ np.array(
        [[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]]
    )
    return np.asarray(points.reshape(-1, 4))


def _split(local: FloatArray, on_wall: bool) -> FloatArray:
    """Return walls (n, 4) cut where others touch or cross them, and at the x axis if it is a wall, each piece once."""
    pieces: dict[frozenset[int], tuple[float, float, float, float]] = {}
    nodes: list[tuple[float, float]] = []
    axis = [np.array([-1e3, 0.0, 1e3, 0.0])] * on_wall
    for k, wall in enumerate(local):
        along = wall[2:] - wall[:2]
        shares = [0.0, 1.0]
        for other in [*np.delete(local, k, axis=0), *axis]:
            for end in (other[:2], other[2:]):
                share = float((end - wall[:2]) @ along / (along @ along))
                if np.hypot(*(wall[:2] + share * along - end)) <= MEETING:
                    shares.append(share)
            across = along[0] * (other[3] - other[1]) - along[1] * (other[2] - other[0])
            away = other[:2] - wall[:2]
            if abs(across) > 1e-12:
                back = float((away[0] * along[1] - away[1] * along[0]) / across)
                share = float((away[0] * (other[3] - other[1]) - away[1] * (other[2] - other[0])) / across)
                shares += [share] if 0.0 < back < 1.0 else []
        for begin, end in pairwise(sorted({min(max(share, 0.0), 1.0) for share in shares})):
            ends = _snapped(wall[:2] + begin * along, nodes), _snapped(wall[:2] + end * along, nodes)
            if ends[0] != ends[1]:
                pieces.setdefault(frozenset(ends), (*nodes[ends[0]], *nodes[ends[1]]))
    return np.array([*pieces.values()]).reshape(-1, 4)


def _snapped(point: FloatArray, nodes: list[tuple[float, float]]) -> int:
    """Return the number of the node where a point is; the point is added if it is at none."""
    for number, node in enumerate(nodes):
        if math.dist(point, node) <= 2 * MEETING:
            return number
    nodes.append((float(point[0]), float(point[1])))
    return len(nodes) - 1


def _lies(local: FloatArray) -> NDArray[np.bool_]:
    """Return which walls lie on the x axis, (n,)."""
    return np.asarray((np.abs(local[:, 1::2]) <= MEETING).all(axis=1))


def _spans(local: FloatArray) -> list[tuple[float, float]] | None:
    """Return the ends of walls on the x axis; None if one is beside it."""
    if not _lies(local).all():
        return None
    return _flat(local)


def _flat(local: FloatArray) -> list[tuple[float, float]]:
    return [(min(a, b), max(a, b)) for a, b in local[_lies(local)][:, 0::2].tolist()]


def _continues(spans: Iterable[tuple[float, float]], low: float, high: float, beside: float) -> bool:
    """Return whether walls continue beside a cluster from `low` to `high`, with gaps only within it."""
    spans = [*spans]
    left = any(a <= low - beside and b >= low - MEETING for a, b in spans)
    return left and any(b >= high + beside and a <= high + MEETING for a, b in spans)


def _openings(
    spans: Iterable[tuple[float, float]], low: float, high: float, middle: float
) -> Iterator[tuple[float, float]]:
    """Yield what walls on a line leave open between `low` and `high`, seen from `middle`."""
    at = low
    for a, b in sorted(spans):
        if a > at + MEETING and at < high - MEETING:
            yield round(at - middle, 9), round(min(a, high) - middle, 9)
        at = max(at, b)
    if at < high - MEETING:
        yield round(at - middle, 9), round(high - middle, 9)


def _close(walls: FloatArray, cluster: Cluster) -> None:
    """Move the ends of the walls beside a cluster to its centre, so that no opening remains."""
    local = _turned(walls, np.array(cluster.centre), cluster.turn)
    low = min(a for a, _ in cluster.openings)
    high = max(b for _, b in cluster.openings)
    for k in np.flatnonzero(_lies(local)).tolist():
        a, b = local[k, 0], local[k, 2]
        for column, end, other in ((0, a, b), (2, b, a)):
            if low - MEETING <= end <= high + MEETING and not low - MEETING <= other <= high + MEETING:
                walls[k, column : column + 2] = cluster.centre
