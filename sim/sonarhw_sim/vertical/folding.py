"""Folding: which sequences of levels sound can touch along a path of the plan, at the heights that it then has.

Sound rises or falls with one slope all along its way: what it goes up and down in all, its climb, over its length in
the plan. So a sequence of levels fixes its height everywhere, and with it what it touches and what it passes. Compiled
by numba.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray
from sonarhw_sim.compiled import compiled, compiled_part
from sonarhw_sim.rays import path_table
from sonarhw_sim.rays.paths import SLACK, Paths, PathSearch
from sonarhw_sim.room.grid import IntArray, Surfaces, advance, enter, listed
from sonarhw_sim.vertical.reflecting_levels import KernelLevels, is_within

BoolArray = NDArray[np.bool_]

_AT_END = 1e-8  # m: a surface that touches a leg this near to its end is the one on which it starts or ends
_INSIDE = 1e-7  # m: a leg this deep in a post crosses it
_ON_END = 1e-9  # m: a surface is touched this far beyond its upper or lower end
_CLOSE = 1e-9  # m: heights that differ less are equal


class Obstacles(NamedTuple):
    """What sound in space touches and passes, for kernels."""

    surfaces: Surfaces  # with a listing of the low ones
    spans: FloatArray  # (s, 2), m: lower and upper end of walls and posts
    low: BoolArray  # (s,): which of them sound may pass
    bounds: FloatArray  # (b,), m: heights between which the same edges exist
    at_bands: BoolArray  # (e, b + 1): whether each edge exists below, between and above the bounds
    levels: KernelLevels


class Ways(NamedTuple):
    """Ways in the plan, one row each."""

    points: FloatArray  # (n, p, 2), m, then NaN
    at: FloatArray  # (n, p), m: length in the plan up to each point
    met: IntArray  # (n, p): the surface touched at each point; -1: none
    lasts: IntArray  # (n,): number of the last point
    edges: IntArray  # (n,): upright edge; -1: none
    bends: IntArray  # (n,): number of touches before the edge


class Folded(NamedTuple):
    """Sequences of levels along ways, one row each."""

    rows: NDArray[np.intp]  # (m,): the way
    levels: IntArray  # (m, k): levels touched, in order, padded with -1
    climbs: FloatArray  # (m, k), m: up and down travelled until each level, padded with NaN
    totals: FloatArray  # (m,), m: up and down travelled in all


def ways_of(paths: Paths) -> Ways:
    """Return the ways of paths in the plan."""
    legs = np.hypot(*np.moveaxis(np.diff(paths.points, axis=1), -1, 0))
    at = np.hstack((np.zeros((len(paths), 1)), np.cumsum(legs, axis=1)))
    met = np.full(at.shape, -1, np.int32)
    row, touch = np.nonzero(paths.surfaces >= 0)
    met[row, touch + 1 + ((paths.edges[row] >= 0) & (touch >= paths.bends[row]))] = paths.surfaces[row, touch]
    lasts = np.isfinite(at).sum(axis=1).astype(np.int32) - 1
    return Ways(np.ascontiguousarray(paths.points), at, met, lasts.astype(np.int32), paths.edges, paths.bends)


def fold(ways: Ways, bounces: IntArray, height: float, search: PathSearch, obstacles: Obstacles) -> Folded:
    """Return each sequence of levels that sound from a height back to it (m) can touch along each way.

    `bounces` (n,) are the reflections of the ways.
    """
    deepest = _most_levels(obstacles.levels, search)
    capacity = 4 * len(ways.at) + 16
    while True:
        rows, totals = np.empty(capacity, np.intp), np.empty(capacity)
        levels, climbs = np.full((capacity, deepest), -1, np.int32), np.full((capacity, deepest), np.nan)
        found = _fold(
            ways,
            bounces,
            height,
            search.max_length + SLACK,
            search.max_bounces,
            obstacles,
            Folded(rows, levels, climbs, totals),
        )
        path_table.check_size(found, ways.at.shape[1] + deepest)
        if found <= capacity:
            used = max(1, int((levels[:found] >= 0).sum(axis=1).max(initial=0)))
            return Folded(rows[:found], levels[:found, :used], climbs[:found, :used], totals[:found])
        capacity = found


def _most_levels(levels: KernelLevels, search: PathSearch) -> int:
    """Return how many levels a path may touch at most."""
    lower, upper = levels.heights[levels.facing > 0], levels.heights[levels.facing < 0]
    gaps = upper[:, None] - lower
    least = float(gaps[gaps > _CLOSE].min(initial=search.max_length))
    return max(1, min(search.max_bounces, math.ceil(search.max_length / least) + 2))


@compiled
def _fold(
    ways: Ways,
    bounces: IntArray,
    height: float,
    max_length: float,
    max_bounces: int,
    obstacles: Obstacles,
    folded: Folded,
) -> int:
    """Fill in `folded` (m,), and return how many rows it should have; its levels are all -1, its climbs all NaN."""
    levels, found = obstacles.levels, 0
    deepest = folded.levels.shape[1]
    heights, climbs = np.empty(deepest + 2), np.empty(deepest + 2)
    sequence, choice = np.empty(deepest + 1, np.int32), np.empty(deepest + 2, np.int32)
    # the least and the largest climb in all that the levels so far allow
    least, largest = np.empty(deepest + 2), np.empty(deepest + 2)
    for row in range(ways.at.shape[0]):
        way = _way(ways, row)
        length = way.at[way.last]
        if length <= _CLOSE or length > max_length:
            continue
        most_levels = min(deepest, max_bounces - bounces[row])
        passages = _passages(way, obstacles)
        visited, enters, leaves = _visits(way, levels)
        for first in range(2):
            depth = 0
            heights[0], climbs[0], choice[0] = height, 0.0, 0
            least[0], largest[0] = 0.0, math.sqrt(max_length * max_length - length * length)
            while depth >= 0:
                # the next level at this depth
                k = choice[depth]
                choice[depth] += 1
                if k == visited.shape[0] or depth == most_levels:
                    depth -= 1
                    continue
                level = visited[k]
                going = -1.0 if (first + depth) % 2 == 0 else 1.0
                gap = (levels.heights[level] - heights[depth]) * going
                if levels.facing[level] * going > 0.0 or gap <= _CLOSE:
                    continue
                climb = climbs[depth] + gap
                lower, upper = max(least[depth], climb), largest[depth]
                if levels.limited[level]:
                    lower = max(lower, climb * length / max(leaves[k], _CLOSE))
                    upper = min(upper, climb * length / max(enters[k], _CLOSE))
                if lower > upper + _CLOSE:
                    continue
                sequence[depth] = level
                depth += 1
                heights[depth], climbs[depth] = levels.heights[level], climb
                least[depth], largest[depth], choice[depth] = lower, upper, 0
                # from here back to the height of departure
                home = (height - heights[depth]) * -going
                total = climb + home
                if home <= 0.0 or not lower - _CLOSE <= total <= upper + _CLOSE:
                    continue
                heights[depth + 1], climbs[depth + 1] = height, total
                if _is_clear(way, passages, heights, climbs, sequence, depth, obstacles):
                    if found < folded.rows.shape[0]:
                        folded.rows[found], folded.totals[found] = row, total
                        for j in range(depth):
                            folded.levels[found, j], folded.climbs[found, j] = sequence[j], climbs[j + 1]
                    found += 1
    return found


@compiled
def are_clear(
    ways: Ways,
    rows: NDArray[np.intp],
    which: NDArray[np.intp],
    heights: FloatArray,
    climbs: FloatArray,
    sequences: IntArray,
    obstacles: Obstacles,
) -> BoolArray:
    """Return whether sound can take these rows (n,) of ways with a given sequence of levels each, (n,) bool.

    `which` (n,) are their rows in `sequences` (q, k) of levels, padded with -1, and in `heights` and `climbs` (q, k +
    2), m, which are those of the departure, of each level, and of the arrival.
    """
    clear = np.empty(rows.shape[0], np.bool_)
    if not rows.shape[0]:
        return clear
    way = _way(ways, rows[0])
    passages = _passages(way, obstacles)
    for row in range(rows.shape[0]):
        q, count = which[row], 0
        while count < sequences.shape[1] and sequences[q, count] >= 0:
            count += 1
        # often, several sequences in turn are for one way
        if row > 0 and rows[row] != rows[row - 1]:
            way = _way(ways, rows[row])
            passages = _passages(way, obstacles)
        clear[row] = way.at[way.last] > _CLOSE and _is_clear(
            way, passages, heights[q], climbs[q], sequences[q], count, obstacles
        )
    return clear


class _Way(NamedTuple):
    """A row of `Ways`."""

    points: FloatArray
    at: FloatArray
    met: IntArray
    last: int
    edge: int
    bend: int


class _Passages(NamedTuple):
    """Low surfaces that a way crosses in the plan, one row each."""

    surfaces: IntArray  # (c,)
    begins: FloatArray  # (c,), m along the way
    ends: FloatArray  # (c,), m


@compiled_part
def _way(ways: Ways, row: int) -> _Way:
    return _Way(
        ways.points[row], ways.at[row], ways.met[row], int(ways.lasts[row]), int(ways.edges[row]), int(ways.bends[row])
    )


@compiled_part
def _passages(way: _Way, obstacles: Obstacles) -> _Passages:
    surfaces, capacity, count = obstacles.surfaces, 16, 0
    passed, begins, ends = np.empty(capacity, np.int32), np.empty(capacity), np.empty(capacity)
    if surfaces.listing.numbers.shape[0] == 0:
        return _Passages(passed[:0], begins[:0], ends[:0])
    for leg in range(way.last):
        x, y = way.points[leg, 0], way.points[leg, 1]
        length = way.at[leg + 1] - way.at[leg]
        if length <= 2 * _AT_END:
            continue
        dx, dy = (way.points[leg + 1, 0] - x) / length, (way.points[leg + 1, 1] - y) / length
        before = count
        walk = enter(surfaces.cells, x, y, dx, dy)
        while walk.inside:
            for k in listed(surfaces.cells, surfaces.listing, walk):
                begin, end = _crossing(x, y, dx, dy, length, k, surfaces)
                known = begin < 0.0
                # a surface is listed in several cells
                for earlier in range(before, count):
                    known = known or passed[earlier] == k
                if known:
                    continue
                if count == capacity:
                    capacity *= 2
                    more, more_begins, more_ends = np.empty(capacity, np.int32), np.empty(capacity), np.empty(capacity)
                    more[:count], more_begins[:count], more_ends[:count] = passed, begins, ends
                    passed, begins, ends = more, more_begins, more_ends
                passed[count], begins[count], ends[count] = k, way.at[leg] + begin, way.at[leg] + end
                count += 1
            if min(walk.next_column, walk.next_row) > length:
                break
            walk = advance(surfaces.cells, walk)
    return _Passages(passed[:count], begins[:count], ends[:count])


@compiled_part
def _crossing(
    x: float, y: float, dx: float, dy: float, length: float, surface: int, surfaces: Surfaces
) -> tuple[float, float]:
    """Return where along a leg it enters and leaves a surface, m; (-1, -1) if it does not cross it."""
    if surface >= surfaces.walls.shape[0]:
        post = surfaces.posts[surface - surfaces.walls.shape[0]]
        cx, cy = post[0] - x, post[1] - y
        ahead, aside = cx * dx + cy * dy, cx * dy - cy * dx
        nearest = min(max(ahead, 0.0), length)
        if math.hypot(ahead - nearest, aside) >= post[2] - _INSIDE:
            return -1.0, -1.0
        half = math.sqrt(post[2] * post[2] - aside * aside)
        return max(ahead - half, 0.0), min(ahead + half, length)
    wall = surfaces.walls[surface]
    ex, ey = wall[2] - wall[0], wall[3] - wall[1]
    rx, ry = wall[0] - x, wall[1] - y
    across = dx * ey - dy * ex
    if across == 0.0:
        return -1.0, -1.0
    ahead, share = (rx * ey - ry * ex) / across, (rx * dy - ry * dx) / across
    if _AT_END < ahead < length - _AT_END and -1e-12 <= share <= 1.0 + 1e-12:
        return ahead, ahead
    return -1.0, -1.0


@compiled_part
def _visits(way: _Way, levels: KernelLevels) -> tuple[IntArray, FloatArray, FloatArray]:
    """Return the levels that a way passes over or under: number, and where it enters and leaves the outline's box, m.

    A level with an outline is listed once for each leg over it, so that a touch of it bounds the slope of sound.
    """
    count = levels.heights.shape[0]
    visited = np.empty(count * (way.last + 1), np.int32)
    enters, leaves = np.empty(visited.shape[0]), np.empty(visited.shape[0])
    found = 0
    for level in range(count):
        if not levels.limited[level]:
            visited[found], enters[found], leaves[found] = level, 0.0, way.at[way.last]
            found += 1
            continue
        for leg in range(way.last):
            length = way.at[leg + 1] - way.at[leg]
            begin, end = 0.0, length
            for axis in range(2):
                start, step = way.points[leg, axis], way.points[leg + 1, axis] - way.points[leg, axis]
                low, high = levels.boxes[level, axis] - start, levels.boxes[level, 2 + axis] - start
                if abs(step) <= _CLOSE:
                    if low > 0.0 or high < 0.0:
                        end = -1.0
                    continue
                one, other = low / step * length, high / step * length
                begin, end = max(begin, min(one, other)), min(end, max(one, other))
            if begin <= end:
                visited[found], enters[found], leaves[found] = level, way.at[leg] + begin, way.at[leg] + end
                found += 1
    return visited[:found], enters[:found], leaves[:found]


@compiled_part
def _is_clear(
    way: _Way,
    passages: _Passages,
    heights: FloatArray,
    climbs: FloatArray,
    sequence: IntArray,
    count: int,
    obstacles: Obstacles,
) -> bool:
    """Return whether sound that touches the first `count` levels of a sequence touches and passes what its way says."""
    slope = climbs[count + 1] / way.at[way.last]
    for k in range(1, way.last):
        surface = way.met[k]
        if surface >= 0 and obstacles.low[surface]:
            height = _height_at(way.at[k] * slope, heights, climbs, count)
            lower, upper = obstacles.spans[surface]
            if not lower - _ON_END <= height <= upper + _ON_END:
                return False
            if _is_at_rim(way.at[k] * slope, lower, upper, climbs, sequence, count, obstacles.levels):
                return False
    if way.edge >= 0:
        height, band = _height_at(way.at[way.bend + 1] * slope, heights, climbs, count), 0
        while band < obstacles.bounds.shape[0] and obstacles.bounds[band] < height:
            band += 1
        if not obstacles.at_bands[way.edge, band]:
            return False
    for k in range(passages.surfaces.shape[0]):
        lower, upper = obstacles.spans[passages.surfaces[k]]
        begin, end = passages.begins[k] * slope, passages.ends[k] * slope
        lowest = highest = _height_at(begin, heights, climbs, count)
        if end > begin:
            last = _height_at(end, heights, climbs, count)
            lowest, highest = min(lowest, last), max(highest, last)
            for j in range(1, count + 1):
                if begin < climbs[j] < end:
                    lowest, highest = min(lowest, heights[j]), max(highest, heights[j])
            # the end of a post may be touched
            lower, upper = lower + _ON_END, upper - _ON_END
        if highest >= lower and lowest <= upper:
            return False
    return _meets_levels(way, heights, climbs, sequence, count, slope, obstacles.levels)


@compiled_part
def _is_at_rim(
    climb: float,
    lower: float,
    upper: float,
    climbs: FloatArray,
    sequence: IntArray,
    count: int,
    levels: KernelLevels,
) -> bool:
    """Return whether sound touches a lid where it touches the end of a wall behind it: an outer edge, no corner."""
    for k in range(count):
        level = sequence[k]
        if levels.limited[level] and abs(climbs[k + 1] - climb) <= _CLOSE:
            end = upper if levels.facing[level] > 0 else lower
            if abs(levels.heights[level] - end) <= _CLOSE:
                return True
    return False


@compiled_part
def _meets_levels(
    way: _Way,
    heights: FloatArray,
    climbs: FloatArray,
    sequence: IntArray,
    count: int,
    slope: float,
    levels: KernelLevels,
) -> bool:
    """Return whether sound touches levels within their outlines, and passes beside those that it does not touch."""
    for k in range(count):
        level = sequence[k]
        if levels.limited[level] and not _is_over(way, climbs[k + 1] / slope, level, levels):
            return False
    for level in range(levels.heights.shape[0]):
        if not levels.limited[level]:
            continue
        for k in range(count + 1):
            rise, gap = heights[k + 1] - heights[k], levels.heights[level] - heights[k]
            if rise < 0.0:
                rise, gap = -rise, -gap
            if _CLOSE < gap < rise - _CLOSE and _is_over(way, (climbs[k] + gap) / slope, level, levels):
                return False
    return True


@compiled_part
def _is_over(way: _Way, along: float, level: int, levels: KernelLevels) -> bool:
    """Return whether a way is over or under a level's outline at a distance along it, m."""
    leg = 0
    while leg < way.last - 1 and way.at[leg + 1] < along:
        leg += 1
    share = (along - way.at[leg]) / max(way.at[leg + 1] - way.at[leg], 1e-300)
    (x, y), (end_x, end_y) = way.points[leg], way.points[leg + 1]
    return is_within(x + share * (end_x - x), y + share * (end_y - y), level, levels)


@compiled_part
def _height_at(climb: float, heights: FloatArray, climbs: FloatArray, count: int) -> float:
    """Return the height (m) after going up and down by `climb` m, past the first `count` levels."""
    k = 0
    while k < count and climbs[k + 1] < climb:
        k += 1
    on = climb - climbs[k]
    height: float = heights[k] + (on if heights[k + 1] >= heights[k] else -on)
    return height
