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
from sonarhw_sim.compiled import array_part, compiled, compiled_part, inlined
from sonarhw_sim.rays import path_table
from sonarhw_sim.rays.passing import Passages, pass_low, room_for_passages
from sonarhw_sim.rays.paths import SLACK, Paths, PathSearch
from sonarhw_sim.room.grid import IntArray, Surfaces
from sonarhw_sim.vertical.reflecting_levels import KernelLevels, is_within

BoolArray = NDArray[np.bool_]

_ON_END = 1e-9  # m: a surface is touched this far beyond its upper or lower end
_CLOSE = 1e-9  # m: heights that differ less are equal
_NEARLY = 1e-8  # m: nearer to the end of a surface, only the exact heights decide


class Obstacles(NamedTuple):
    """What sound in space touches and passes, for kernels."""

    surfaces: Surfaces  # with a listing of the low ones
    spans: FloatArray  # (s, 2), m: lower and upper end of walls and posts
    low: BoolArray  # (s,): which of them sound may pass
    bounds: FloatArray  # (b,), m: heights between which the same edges exist
    at_bands: BoolArray  # (e, b + 1): whether each edge exists below, between and above the bounds
    levels: KernelLevels


class Rise(NamedTuple):
    """What sound that touches a sequence of levels goes up and down."""

    heights: FloatArray  # (k,), m: of the departure, of each level, and of the arrival
    climbs: FloatArray  # (k,), m: up and down travelled until there
    levels: IntArray  # (k,): these levels
    number: int  # of these levels; what follows them has no meaning


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
    at = np.empty(paths.points.shape[:2])
    met, lasts = np.empty(at.shape, np.int32), np.empty(len(paths), np.int32)
    points = np.ascontiguousarray(paths.points)
    _fill_ways(points, paths.surfaces, paths.edges, paths.bends, at, met, lasts)
    return Ways(points, at, met, lasts, paths.edges, paths.bends)


@compiled
def _fill_ways(
    points: FloatArray,
    surfaces: IntArray,
    edges: IntArray,
    bends: IntArray,
    at: FloatArray,
    met: IntArray,
    lasts: IntArray,
) -> None:
    """Fill in the columns `at`, `met` and `lasts` of ways; the others are those of paths."""
    for row in range(points.shape[0]):
        last, at[row, 0], met[row] = 0, 0.0, -1
        for k in range(1, points.shape[1]):
            leg = math.hypot(points[row, k, 0] - points[row, k - 1, 0], points[row, k, 1] - points[row, k - 1, 1])
            at[row, k] = at[row, k - 1] + leg
            # what follows the last point is NaN
            last += int(at[row, k] == at[row, k])
        lasts[row] = last
        for touch in range(surfaces.shape[1]):
            if surfaces[row, touch] >= 0:
                met[row, touch + 1 + int(edges[row] >= 0 and touch >= bends[row])] = surfaces[row, touch]


def fold(
    ways: Ways, bounces: IntArray, steepest: FloatArray, height: float, search: PathSearch, obstacles: Obstacles
) -> Folded:
    """Return each sequence of levels that sound from a height back to it (m) can touch along each way.

    `bounces` (n,) are the reflections of the ways, `steepest` (n,) the slopes beyond which they need not be followed.
    """
    deepest = _most_levels(obstacles.levels, search)
    capacity = 4 * len(ways.at) + 16
    while True:
        rows, totals = np.empty(capacity, np.intp), np.empty(capacity)
        # the system gives memory only to rows that are filled
        levels, climbs = np.empty((capacity, deepest), np.int32), np.empty((capacity, deepest))
        found = _fold(
            ways,
            bounces,
            steepest,
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


class _Visits(NamedTuple):
    """Room for the levels that a way passes over or under, one row each, in order of level and along the way.

    A level with an outline is listed once for each leg over it, so that a touch of it bounds the slope of sound.
    """

    levels: IntArray  # (v,)
    behind: IntArray  # (v,): the first row of the next level
    enters: FloatArray  # (v,), m along the way: where it enters the box of the outline
    leaves: FloatArray  # (v,), m


class _Touches(NamedTuple):
    """Room for the low surfaces that a way touches, one row each, in order along the way."""

    shares: FloatArray  # (t,): of the length of the way, up to each
    lowers: FloatArray  # (t,), m: lower end of each
    uppers: FloatArray  # (t,), m


class _Work(NamedTuple):
    """Room for one sequence of levels while it grows."""

    heights: FloatArray  # (k,), m: of the departure and of each level so far
    climbs: FloatArray  # (k,), m
    least: FloatArray  # (k,), m: the least climb in all that the levels so far allow
    largest: FloatArray  # (k,), m
    levels: IntArray  # (k,)
    choices: IntArray  # (k,): the next visit to try at each depth
    passed: IntArray  # (1,): number of low surfaces that the way passes; -1: not counted yet


@compiled
def _fold(
    ways: Ways,
    bounces: IntArray,
    steepest: FloatArray,
    height: float,
    max_length: float,
    max_bounces: int,
    obstacles: Obstacles,
    folded: Folded,
) -> int:
    """Fill in `folded` (m,), and return how many rows it should have."""
    deepest, most_visits = folded.levels.shape[1], obstacles.levels.heights.shape[0] * ways.at.shape[1]
    passages, visits = room_for_passages(ways.at.shape[1], obstacles.low), _no_visits(most_visits)
    touches = _no_touches(ways.at.shape[1])
    numbers, choices = np.empty((4, deepest + 2)), np.empty((2, deepest + 2), np.int32)
    work = _Work(numbers[0], numbers[1], numbers[2], numbers[3], choices[0], choices[1], np.empty(1, np.int32))
    found, least = 0, _least_climb(height, obstacles.levels)
    for row in range(ways.at.shape[0]):
        length = ways.at[row, ways.lasts[row]]
        if not _CLOSE < length <= max_length:
            continue
        largest = min(math.sqrt(max_length * max_length - length * length), steepest[row] * length)
        if largest < least - _NEARLY:
            continue
        work.passed[0] = -1
        visited = _visit_levels(ways, row, obstacles.levels, visits)
        touched = _touch_low(ways, row, obstacles, touches)
        most = min(deepest, max_bounces - bounces[row])
        for first in range(2):
            seen = passages, visits, visited, touches, touched
            found = _fold_along(ways, row, first, height, largest, most, seen, obstacles, work, folded, found)
    return found


@compiled_part
def _fold_along(
    ways: Ways,
    row: int,
    first: int,
    height: float,
    largest_climb: float,
    most_levels: int,
    seen: tuple[Passages, _Visits, int, _Touches, int],
    obstacles: Obstacles,
    work: _Work,
    folded: Folded,
    found: int,
) -> int:
    """Add the sequences along one way that first go down (`first` 0) or up (1); return how many rows there are now.

    `seen` is room for the low surfaces that it passes, and what else it passes and touches, with the number of rows.
    """
    (passages, visits, visited, touches, touched), levels = seen, obstacles.levels
    length = ways.at[row, ways.lasts[row]]
    heights, climbs, least, largest, sequence, choice, passed = work
    depth = 0
    heights[0], climbs[0], choice[0] = height, 0.0, 0
    least[0], largest[0] = 0.0, largest_climb
    while depth >= 0:
        # the next level at this depth
        k = choice[depth]
        if k == visited or depth == most_levels:
            depth -= 1
            continue
        level = visits.levels[k]
        choice[depth] = visits.behind[k]
        going = -1.0 if (first + depth) % 2 == 0 else 1.0
        gap = (levels.heights[level] - heights[depth]) * going
        climb = climbs[depth] + gap
        # it has to return from there, with any levels in between
        returned = climb + abs(height - levels.heights[level])
        lower, upper = max(least[depth], returned), largest[depth]
        too_far = returned > upper + 2.0 * _CLOSE
        if levels.facing[level] * going > 0.0 or gap <= _CLOSE or too_far:
            continue
        if levels.limited[level]:
            k = _first_reached(visits, k, climb * length, upper)
            if k == choice[depth]:
                continue
            lower = max(lower, climb * length / max(visits.leaves[k], _CLOSE))
            upper = min(upper, climb * length / max(visits.enters[k], _CLOSE))
        # if this leg is over a level too far along the way, so are the following ones
        if lower > upper + _CLOSE:
            continue
        choice[depth] = k + 1
        sequence[depth] = level
        heights[depth + 1], climbs[depth + 1] = levels.heights[level], climb
        lower, upper = _narrowed(lower, upper, heights, climbs, depth + 1, touches, touched)
        if lower > upper:
            continue
        depth += 1
        least[depth], largest[depth], choice[depth] = lower, upper, 0
        # from here back to the height of departure
        home = (height - heights[depth]) * -going
        total = climb + home
        if home <= 0.0 or not lower - _CLOSE <= total <= upper + _CLOSE:
            continue
        heights[depth + 1], climbs[depth + 1] = height, total
        if passed[0] < 0:
            # on most ways, no sequence comes so far
            passed[0] = pass_low(ways.points[row], ways.at[row], ways.lasts[row], obstacles.surfaces, passages)
        if can_take(ways, row, passages, passed[0], Rise(heights, climbs, sequence, depth), obstacles):
            if found < folded.rows.shape[0]:
                _enter(row, total, depth, work, folded, found)
            found += 1
    return found


@inlined
def _enter(row: int, total: float, depth: int, work: _Work, folded: Folded, found: int) -> None:
    """Enter the first `depth` levels of a sequence as row `found`."""
    folded.rows[found], folded.totals[found] = row, total
    for j in range(folded.levels.shape[1]):
        folded.levels[found, j] = work.levels[j] if j < depth else -1
        folded.climbs[found, j] = work.climbs[j + 1] if j < depth else np.nan


@compiled_part
def _narrowed(
    lower: float, upper: float, heights: FloatArray, climbs: FloatArray, depth: int, touches: _Touches, touched: int
) -> tuple[float, float]:
    """Return the least and the largest climb in all, m, with which sound can touch the low surfaces of its way.

    Sound has touched `depth` levels so far, and further ones are unknown. The first result exceeds the second if sound
    cannot touch all.
    """
    lower, upper, reached = lower - _NEARLY, upper + _NEARLY, 0
    for k in range(touched):
        share = touches.shares[k]
        begin, end = share * lower, share * upper
        if begin > climbs[depth]:
            break
        while climbs[reached + 1] < begin:
            reached += 1
        first, last = np.inf, -np.inf
        for j in range(reached, depth):
            if climbs[j] > end:
                break
            # where on its way up or down it is at the height of the surface
            if heights[j + 1] < heights[j]:
                enters, leaves = heights[j] - touches.uppers[k], heights[j] - touches.lowers[k]
            else:
                enters, leaves = touches.lowers[k] - heights[j], touches.uppers[k] - heights[j]
            enters, leaves = max(enters + climbs[j], climbs[j], begin), min(leaves + climbs[j], climbs[j + 1], end)
            if enters <= leaves:
                first, last = min(first, enters), max(last, leaves)
        if end > climbs[depth]:
            first, last = min(first, climbs[depth]), end
        lower, upper = max(lower, first / share), min(upper, last / share)
        if lower > upper:
            break
    return lower, upper


@inlined
def _first_reached(visits: _Visits, k: int, steepness: float, largest: float) -> int:
    """Return the first visit from row `k` on that the largest climb in all allows; the first of the next level: none.

    `steepness` is the climb at the visit times the length of the way, m².
    """
    behind = visits.behind[k]
    while k < behind and steepness / max(visits.leaves[k], _CLOSE) > largest + _CLOSE:
        k += 1
    return k


@compiled_part
def _least_climb(height: float, levels: KernelLevels) -> float:
    """Return what sound from a height and back to it goes up and down at least to touch a level, m."""
    least = np.inf
    for level in range(levels.heights.shape[0]):
        gap = (height - levels.heights[level]) * levels.facing[level]
        if gap > 0.0:
            least = min(least, 2.0 * gap)
    return least


@array_part
def _no_visits(most: int) -> _Visits:
    return _Visits(np.empty(most, np.int32), np.empty(most, np.int32), np.empty(most), np.empty(most))


@array_part
def _no_touches(most: int) -> _Touches:
    return _Touches(np.empty(most), np.empty(most), np.empty(most))


@compiled_part
def _touch_low(ways: Ways, row: int, obstacles: Obstacles, touches: _Touches) -> int:
    """Fill in the low surfaces that a way touches, and return their number."""
    last, found = ways.lasts[row], 0
    for k in range(1, last):
        surface = ways.met[row, k]
        if surface >= 0 and obstacles.low[surface]:
            touches.shares[found] = max(ways.at[row, k], _CLOSE) / ways.at[row, last]
            lower, upper = obstacles.spans[surface]
            touches.lowers[found], touches.uppers[found] = lower - _NEARLY, upper + _NEARLY
            found += 1
    return found


@compiled_part
def _visit_levels(ways: Ways, row: int, levels: KernelLevels, visits: _Visits) -> int:
    """Fill in the levels that a way passes over or under, and return their number."""
    last, found = ways.lasts[row], 0
    for level in range(levels.heights.shape[0]):
        if not levels.limited[level]:
            visits.levels[found], visits.enters[found], visits.leaves[found] = level, 0.0, ways.at[row, last]
            visits.behind[found] = found + 1
            found += 1
            continue
        first = found
        for leg in range(last):
            at, length = ways.at[row, leg], ways.at[row, leg + 1] - ways.at[row, leg]
            begin, end = 0.0, length
            for axis in range(2):
                start = ways.points[row, leg, axis]
                step = ways.points[row, leg + 1, axis] - start
                low, high = levels.boxes[level, axis] - start, levels.boxes[level, 2 + axis] - start
                if abs(step) <= _CLOSE:
                    if low > 0.0 or high < 0.0:
                        end = -1.0
                    continue
                one, other = low / step * length, high / step * length
                begin, end = max(begin, min(one, other)), min(end, max(one, other))
            if begin <= end:
                visits.levels[found], visits.enters[found], visits.leaves[found] = level, at + begin, at + end
                found += 1
        for k in range(first, found):
            visits.behind[k] = found
    return found


@compiled_part
def can_take(ways: Ways, row: int, passages: Passages, passed: int, rise: Rise, obstacles: Obstacles) -> bool:
    """Return whether sound with this rise touches and passes what its way says, with so many `passages`."""
    last = ways.lasts[row]
    if ways.at[row, last] <= _CLOSE:
        return False
    slope = rise.climbs[rise.number + 1] / ways.at[row, last]
    for k in range(1, last):
        surface = ways.met[row, k]
        if surface >= 0 and obstacles.low[surface]:
            height = _height_at(ways.at[row, k] * slope, rise)
            lower, upper = obstacles.spans[surface]
            if not lower - _ON_END <= height <= upper + _ON_END:
                return False
            if _is_at_rim(ways.at[row, k] * slope, lower, upper, rise, obstacles.levels):
                return False
    if ways.edges[row] >= 0:
        height, band = _height_at(ways.at[row, ways.bends[row] + 1] * slope, rise), 0
        while band < obstacles.bounds.shape[0] and obstacles.bounds[band] < height:
            band += 1
        if not obstacles.at_bands[ways.edges[row], band]:
            return False
    for k in range(passed):
        lower, upper = obstacles.spans[passages.surfaces[k]]
        begin, end = passages.begins[k] * slope, passages.ends[k] * slope
        lowest = highest = _height_at(begin, rise)
        if end > begin:
            last = _height_at(end, rise)
            lowest, highest = min(lowest, last), max(highest, last)
            for j in range(1, rise.number + 1):
                if begin < rise.climbs[j] < end:
                    lowest, highest = min(lowest, rise.heights[j]), max(highest, rise.heights[j])
            # the end of a post may be touched
            lower, upper = lower + _ON_END, upper - _ON_END
        if highest >= lower and lowest <= upper:
            return False
    return _meets_levels(ways, row, rise, slope, obstacles.levels)


@compiled_part
def _is_at_rim(climb: float, lower: float, upper: float, rise: Rise, levels: KernelLevels) -> bool:
    """Return whether sound touches a lid where it touches the end of a wall behind it: an outer edge, no corner."""
    for k in range(rise.number):
        level = rise.levels[k]
        if levels.limited[level] and abs(rise.climbs[k + 1] - climb) <= _CLOSE:
            end = upper if levels.facing[level] > 0 else lower
            if abs(levels.heights[level] - end) <= _CLOSE:
                return True
    return False


@compiled_part
def _meets_levels(ways: Ways, row: int, rise: Rise, slope: float, levels: KernelLevels) -> bool:
    """Return whether sound touches levels within their outlines, and passes beside those that it does not touch."""
    heights, climbs = rise.heights, rise.climbs
    for k in range(rise.number):
        level = rise.levels[k]
        if levels.limited[level] and not _is_over(ways, row, climbs[k + 1] / slope, level, levels):
            return False
    for level in range(levels.heights.shape[0]):
        if not levels.limited[level]:
            continue
        for k in range(rise.number + 1):
            whole, gap = heights[k + 1] - heights[k], levels.heights[level] - heights[k]
            if whole < 0.0:
                whole, gap = -whole, -gap
            if _CLOSE < gap < whole - _CLOSE and _is_over(ways, row, (climbs[k] + gap) / slope, level, levels):
                return False
    return True


@compiled_part
def _is_over(ways: Ways, row: int, along: float, level: int, levels: KernelLevels) -> bool:
    """Return whether a way is over or under a level's outline at a distance along it, m."""
    leg = 0
    while leg < ways.lasts[row] - 1 and ways.at[row, leg + 1] < along:
        leg += 1
    share = (along - ways.at[row, leg]) / max(ways.at[row, leg + 1] - ways.at[row, leg], 1e-300)
    x, y = ways.points[row, leg, 0], ways.points[row, leg, 1]
    end_x, end_y = ways.points[row, leg + 1, 0], ways.points[row, leg + 1, 1]
    return is_within(x + share * (end_x - x), y + share * (end_y - y), level, levels)


@compiled_part
def _height_at(climb: float, rise: Rise) -> float:
    """Return the height (m) after going up and down by `climb` m."""
    k = 0
    while k < rise.number and rise.climbs[k + 1] < climb:
        k += 1
    on = climb - rise.climbs[k]
    height: float = rise.heights[k] + (on if rise.heights[k + 1] >= rise.heights[k] else -on)
    return height
