"""Rims, the level ends of walls and posts, and the ways by which sound can reach them."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray
from sonarhw_sim.compiled import compiled, compiled_part, inlined
from sonarhw_sim.rays.fan import Targets, all_rays, fan, fill_rows, follow_fan
from sonarhw_sim.rays.passing import pass_low, room_for_passages
from sonarhw_sim.rays.paths import SLACK, Paths, PathSearch
from sonarhw_sim.rays.sequences import ON_WALL, first_of_kind, mirrored, path_is_free, unfold
from sonarhw_sim.room.edges import Edges
from sonarhw_sim.room.grid import IntArray, Surfaces, whole_numbers
from sonarhw_sim.room.room import Room
from sonarhw_sim.room.room_file import MEETING
from sonarhw_sim.space.folding import BoolArray, Folded, Obstacles, Plan, Rise, Ways, can_take, loudest_at, with_levels
from sonarhw_sim.space.levels import Levels, LevelSequence, level_sequences

# Approaches: the sequences of walls by which sound from a place can reach parts of each wall that has a rim.
#
# The walls of a sequence, mirrored in those that follow, are windows through which the mirrored place is visible from
# a part of the wall.


_FEWER = 4  # times as few rays as usual, because a wall is wider than a point
_PIECE = 0.25  # m: the longest part of a wall that an approach leads to
_EDGE = 1e-9  # of a window: where its sight would not end


class Approaches(NamedTuple):
    """Sequences of walls that lead to a part of a wall, or to a post, one row each."""

    walls: IntArray  # (n,): the wall or post
    surfaces: IntArray  # (n, b): those touched before, in order, padded with -1
    bounces: IntArray  # (n,)
    images: FloatArray  # (n, 2), m: the place mirrored in all of them
    gains: FloatArray  # (n,)
    lows: FloatArray  # (n,), m along the wall: where the part begins
    highs: FloatArray  # (n,), m

    def select(self, rows: NDArray[np.intp]) -> "Approaches":
        """Return only these rows, in this order."""
        return Approaches._make(column[rows] for column in self)


def approaches_to(
    plan: Plan, surfaces: IntArray, place: FloatArray, other: FloatArray, climbs: FloatArray, search: PathSearch
) -> Approaches:
    """Return the approaches from `place` (2,) to walls and posts (w,), of paths that continue to `other` (2,).

    `climbs` (c,) m are those of the ways to the rims, negative if they first go down. A post is one part. Sound that
    posts reflect is not followed to rims, because a post has no mirror image.
    """
    room = plan.room
    target, before, bounces = _towards(plan, surfaces, place, other, climbs, search)
    kept = (before < len(room.walls)).all(axis=1)
    to, before, bounces = surfaces[target[kept]], before[kept], bounces[kept]
    gains, images = np.append(room.reflectances, 1.0)[before].prod(axis=1), images_of(place, before, room.walls)
    whole = np.zeros(len(to))
    all_ = Approaches(to, before, bounces, images, gains, whole, whole)
    posts, walls = np.flatnonzero(to >= len(room.walls)), np.flatnonzero(to < len(room.walls))
    to_walls = all_.select(walls)
    seen = np.empty((len(walls), 2))
    _look(to_walls.images, to_walls.surfaces, to_walls.bounces, to_walls.walls, room.walls, seen)
    parts: list[tuple[NDArray[Any], ...]] = [
        _in_pieces(to_walls._replace(lows=seen[:, 0], highs=seen[:, 1])),
        all_.select(posts),
    ]
    return Approaches._make(np.concatenate(columns) for columns in zip(*parts, strict=True))


def _towards(
    plan: Plan, surfaces: IntArray, place: FloatArray, other: FloatArray, climbs: FloatArray, search: PathSearch
) -> tuple[NDArray[np.intp], IntArray, IntArray]:
    """Return which of these walls and posts rays come near to, the surfaces touched before, (n, b), and how many."""
    room, first_post = plan.room, len(plan.room.walls)
    assert plan.passing is not None
    walls, posts = (
        room.walls[surfaces[surfaces < first_post]],
        room.posts[surfaces[surfaces >= first_post] - first_post],
    )
    points = np.vstack((other, (walls[:, :2] + walls[:, 2:]) / 2, posts[:, :2]))
    radii = np.concatenate(([0.0], np.hypot(*(walls[:, 2:] - walls[:, :2]).T) / 2, posts[:, 2]))
    away = np.maximum(np.hypot(*(points - other).T) - radii, 0.0)
    targets = Targets(points, np.append(0.0, search.max_length + SLACK - away[1:]), radii)
    directions = fan(max(16, search.rays // _FEWER), None if search.axes is None else search.axes.leaving[0])
    detectable = all_rays(len(directions), 1, len(points), search.faintest_diffraction)
    with_climbs = replace(plan.passing, climbs=climbs)
    followed = follow_fan(room, place[None], directions, targets, search.max_bounces, detectable, with_climbs)
    ray, bounces, target = followed.candidates[followed.candidates[:, 2] > 0].T
    most = int(bounces.max(initial=0))
    before = np.where(np.arange(most) < bounces[:, None], followed.touched[ray, :most], -1).astype(np.int32)
    return target - 1, before, bounces.astype(np.int32)


@compiled
def images_of(place: FloatArray, surfaces: IntArray, walls: FloatArray) -> FloatArray:
    """Return a place mirrored in sequences of walls (n, b), padded with -1, (n, 2) m."""
    images = np.empty((surfaces.shape[0], 2))
    for row in range(surfaces.shape[0]):
        x, y = place
        for step in range(surfaces.shape[1]):
            if surfaces[row, step] >= 0:
                x, y = mirrored(x, y, walls[surfaces[row, step]])
        images[row, 0], images[row, 1] = x, y
    return images


@compiled
def _look(
    images: FloatArray, surfaces: IntArray, bounces: IntArray, wall: IntArray, walls: FloatArray, parts: FloatArray
) -> None:
    """Fill in the part of each wall (n,) from which an image (n, 2) is visible through its windows, (n, 2) m along it.

    An end before a begin: none.
    """
    windows = np.empty((surfaces.shape[1], 4))
    for row in range(wall.shape[0]):
        for step in range(bounces[row]):
            mirror = walls[surfaces[row, step]]
            for earlier in range(step):
                begin, end = windows[earlier, :2], windows[earlier, 2:]
                begin[0], begin[1] = mirrored(begin[0], begin[1], mirror)
                end[0], end[1] = mirrored(end[0], end[1], mirror)
            for k in range(4):
                windows[step, k] = mirror[k]
        parts[row, 0], parts[row, 1] = _visible(images[row], walls[wall[row]], windows, bounces[row])


@compiled_part
def _visible(image: FloatArray, wall: FloatArray, windows: FloatArray, count: int) -> tuple[float, float]:
    """Return the part of a wall from which an image (2,) is visible through the first `count` windows, m along it."""
    along_x, along_y = wall[2] - wall[0], wall[3] - wall[1]
    length = math.hypot(along_x, along_y)
    along_x, along_y = along_x / length, along_y / length
    x, y = image[0] - wall[0], image[1] - wall[1]
    axial, aside = x * along_x + y * along_y, y * along_x - x * along_y
    lowest, highest = -np.inf, np.inf
    # a window is no limit for an image on the wall
    for k in range(count if abs(aside) > _EDGE else 0):
        begin_x, begin_y = windows[k, 0] - wall[0], windows[k, 1] - wall[1]
        end_x, end_y = windows[k, 2] - wall[0], windows[k, 3] - wall[1]
        begin, end = begin_x * along_x + begin_y * along_y, end_x * along_x + end_y * along_y
        # distance from the wall over that of the image: sound passes a window between both
        near = (begin_y * along_x - begin_x * along_y) / aside
        far = (end_y * along_x - end_x * along_y) / aside
        slope = far - near if abs(far - near) > _EDGE else _EDGE
        first, last = (_EDGE - near) / slope, (1.0 - _EDGE - near) / slope
        low, high = max(min(first, last), 0.0), min(max(first, last), 1.0)
        if low > high:
            return 0.0, -np.inf
        enter = _seen_at(begin, end, near, far, low, axial)
        leave = _seen_at(begin, end, near, far, high, axial)
        lowest, highest = max(lowest, min(enter, leave)), min(highest, max(enter, leave))
    return max(lowest - _EDGE, -_EDGE), min(highest + _EDGE, length + _EDGE)


@inlined
def _seen_at(begin: float, end: float, near: float, far: float, share: float, axial: float) -> float:
    """Return where along a wall the image is visible through the point at a share of a window, m."""
    ahead = 1.0 - min(max(near + share * (far - near), 0.0), 1.0 - _EDGE)
    position: float = axial + (begin + share * (end - begin) - axial) / ahead
    return position


def _in_pieces(approaches: Approaches) -> Approaches:
    """Return the approaches divided into short parts; those without any part are omitted."""
    approaches = approaches.select(np.flatnonzero(approaches.highs > approaches.lows))
    widths = approaches.highs - approaches.lows
    pieces = np.ceil(widths / _PIECE).astype(np.intp)
    row, piece = whole_numbers(np.zeros(len(widths), np.intp), pieces - 1)
    width = (widths / pieces)[row]
    begins = approaches.lows[row] + piece * width
    return approaches.select(row)._replace(lows=begins, highs=begins + width)


# Rims: the level ends of walls that bend sound, as straight edges in space.


_ASIDE = 1e-5  # m: on one side of a wall, no lid ends so near to it
_ABOVE, _BELOW = math.pi / 2, 3 * math.pi / 2


@dataclass(frozen=True)
class Rims:
    """Parts of the ends of walls, one row each.

    Angles are those about the rim, seen along it: 0 to the left of its wall, π/2 upwards.
    """

    walls: FloatArray  # (r, 4): x, y of start and end, m
    owners: IntArray  # (r,): number of the wall
    wedges: Edges  # their wedges of air in the upright plane across, where the height is the second coordinate
    surfaces: IntArray  # (r, 2): surface of the first and of the last face
    edges: IntArray  # (r,): their numbers in the room

    def __len__(self) -> int:
        return len(self.owners)


def find_rims(room: Room, levels: Levels) -> Rims:
    """Return the rims of a room's walls that sound between these levels can reach."""
    rims = [
        rim
        for wall in np.flatnonzero(np.isfinite(room.heights[: len(room.walls)]).any(axis=1)).tolist()
        for rim in _rims_of(room, wall, levels)
    ]
    surfaces = np.array([[rim.first, rim.last] for rim in rims], dtype=np.int32).reshape(-1, 2)
    return Rims(
        np.array([rim.ends for rim in rims]).reshape(-1, 4),
        np.array([rim.owner for rim in rims], dtype=np.int32),
        Edges(
            np.array([(0.0, rim.height) for rim in rims]).reshape(-1, 2),
            np.array([rim.start for rim in rims]),
            np.array([rim.opening for rim in rims]),
            _sides(room, surfaces),
            tuple(room.edge_name(room.edge_between(rim.owner, rim.other)) for rim in rims),
        ),
        surfaces,
        np.array([room.edge_between(rim.owner, rim.other) for rim in rims], dtype=np.int32),
    )


def _sides(room: Room, surfaces: IntArray) -> IntArray:
    """Return the faces of wedges, with numbers of their own for lids: sound along a lid is not followed."""
    numbers = len(room.names) + np.arange(surfaces.size).reshape(surfaces.shape)
    return np.where(surfaces < len(room.walls), surfaces, numbers).astype(np.int32)


@dataclass(frozen=True)
class _Rim:
    ends: tuple[float, float, float, float]
    height: float
    owner: int  # the wall
    other: int  # the surface that it meets here; itself if it ends free
    first: int  # surfaces of the wedge
    last: int
    start: float  # rad
    opening: float  # rad


def _rims_of(room: Room, wall: int, levels: Levels) -> Iterator[_Rim]:
    start, end = room.walls[wall, :2], room.walls[wall, 2:]
    length = float(np.hypot(*(end - start)))
    along = (end - start) / length
    flush, begins, stops = _flush(room.walls, start, along, length)
    for height in room.heights[wall].tolist():
        if not levels.floor + MEETING < height < levels.ceiling - MEETING:
            continue
        cuts = np.unique(np.clip(np.concatenate(([0.0, length], begins, stops)), 0.0, length))
        for low, high in zip(cuts[:-1].tolist(), cuts[1:].tolist(), strict=True):
            if high - low <= MEETING:
                continue
            middle = (low + high) / 2
            here = flush[(begins < middle) & (middle < stops)]
            at_end = (np.abs(room.heights[here] - height) <= MEETING).any(axis=1)
            # walls on one line have one rim
            if here[at_end].min() == wall:
                faces = dict(_faces(room, here, start + middle * along, along, height))
                ends = (*(start + low * along).tolist(), *(start + high * along).tolist())
                yield from _wedges(ends, height, wall, faces)


def _flush(
    walls: FloatArray, start: FloatArray, along: FloatArray, length: float
) -> tuple[NDArray[np.intp], FloatArray, FloatArray]:
    """Return the walls on one line with a wall, and where along it they begin and end, m."""
    away = walls.reshape(-1, 2, 2) - start
    aside = np.abs(away[..., 0] * along[1] - away[..., 1] * along[0]).max(axis=1)
    positions = away @ along
    begins, ends = positions.min(axis=1), positions.max(axis=1)
    rows = np.flatnonzero((aside <= MEETING) & (ends > MEETING) & (begins < length - MEETING))
    return rows, begins[rows], ends[rows]


def _faces(
    room: Room, walls: NDArray[np.intp], point: FloatArray, along: FloatArray, height: float
) -> Iterator[tuple[float, int]]:
    """Yield angle (rad) and number of the surfaces that meet at a height at a point of some walls on one line."""
    lower, upper = room.heights[walls].T
    for side, level in ((_ABOVE, height + 2 * MEETING), (_BELOW, height - 2 * MEETING)):
        present = walls[(lower < level) & (level < upper)]
        if len(present):
            yield side, int(present[0])
    left = np.array([-along[1], along[0]])
    for surface in room.levels:
        lid = room.lid(surface)
        if lid is None or abs(lid.height - height) > MEETING or not set(lid.sides) & set(walls.tolist()):
            continue
        on_left, on_right = lid.covers(point + _ASIDE * np.vstack((left, -left)))
        if on_left != on_right:
            yield (0.0 if on_left else math.pi), surface


def _wedges(
    ends: tuple[float, float, float, float], height: float, owner: int, faces: dict[float, int]
) -> Iterator[_Rim]:
    """Yield the wedge of air between these faces that bends sound, if there is one."""
    angles = sorted(faces)
    for k, angle in enumerate(angles):
        following = angles[(k + 1) % len(angles)]
        opening = math.fmod(following - angle + math.tau, math.tau) or math.tau
        if opening > math.pi + 1.0:
            first, last = faces[angle], faces[following]
            other = faces.get(0.0, faces.get(math.pi, owner))
            yield _Rim(ends, height, owner, other, first, last, angle, opening)


# Ways to rims, each with its sequence of levels, solved in the plan and checked at its heights; paths of two ways.


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
    sequences: list[LevelSequence] = []
    ranges = []
    for end in rim_heights.tolist():
        begin = len(sequences)
        sequences += [LevelSequence((), (height, end)), *level_sequences(levels, height, end, longest, most, 1)]
        ranges.append((begin, len(sequences)))
    width = max((len(sequence.levels) for sequence in sequences), default=0)
    missing = [width - len(sequence.levels) for sequence in sequences]
    rows = [(*sequence.levels, *[-1] * few) for sequence, few in zip(sequences, missing, strict=True)]
    heights_of_levels = [(*sequence.heights, *[0.0] * few) for sequence, few in zip(sequences, missing, strict=True)]
    climbs = [(*sequence.climbs, *[0.0] * few) for sequence, few in zip(sequences, missing, strict=True)]
    return RimSequences(
        np.array(rows, dtype=np.int32).reshape(len(rows), width),
        np.array(heights_of_levels).reshape(len(rows), width + 2),
        np.array(climbs).reshape(len(rows), width + 2),
        np.array([sequence.climb for sequence in sequences]),
        np.array([sequence.signs for sequence in sequences]).reshape(-1, 2),
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
    (free, before), (also_free, after) = (
        ways_to(plan, end.position, end.approaches, end.rows, sequences, end.sequences, bends.points) for end in ends
    )
    clear = np.flatnonzero(free & also_free)
    sent, received = (
        _solved(levels, sequences, end.sequences[clear], Ways._make(column[clear] for column in ways))
        for end, ways in zip(ends, (before, after), strict=True)
    )
    return _audible(_joined(Bends._make(column[clear] for column in bends), sent, received), search)


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


def _joined(bends: Bends, before: _Solved, after: _Solved) -> Paths:
    """Return the paths past bends from both of their ways."""
    rows, count = np.arange(len(bends.edges)), before.touches + after.touches
    most = int(count.max(initial=0))
    surfaces, points = np.full((len(rows), most), -1, np.int32), np.full((len(rows), most + 3, 2), np.nan)
    fill_rows(surfaces, before.surfaces, rows, before.touches, after.surfaces, rows, after.touches)
    fill_rows(points, before.points, rows, before.touches + 2, after.points, rows, after.touches + 1)
    return Paths(
        lengths=bends.lengths,
        departures=before.departures,
        arrivals=after.departures,
        gains=bends.gains,
        phases=bends.phases,
        spreads=np.zeros(len(rows)),
        surfaces=surfaces,
        edges=bends.edges,
        bends=before.touches,
        elevations=np.column_stack((before.elevations, after.elevations)),
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
