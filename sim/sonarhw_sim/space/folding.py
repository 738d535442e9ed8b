"""Folding: which sequences of levels sound can touch along a way of the plan, and the path of each in space."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray
from sonarhw_sim.board.beam import ComplexArray
from sonarhw_sim.compiled import array_part, compiled, compiled_part, inlined
from sonarhw_sim.rays import fan
from sonarhw_sim.rays.diffraction import amplitudes_at_edges
from sonarhw_sim.rays.passing import Passages, Passing, pass_low, room_for_passages
from sonarhw_sim.rays.paths import SLACK, Paths, PathSearch
from sonarhw_sim.rays.sequences import first_of_kind, hashes_of
from sonarhw_sim.room.edges import Edges
from sonarhw_sim.room.grid import IntArray, Surfaces, only
from sonarhw_sim.room.room import Place, Room, find_enclosures
from sonarhw_sim.room.room_file import Span
from sonarhw_sim.space.levels import KernelLevels, Levels, LevelSequence, is_within

# Ways in the plan, and whether sound at the heights of a rise can take them.
#
# Sound rises or falls with one slope all along its way: what it goes up and down in all, its climb, over its length
# in the plan. So its levels fix its height everywhere, and with it what it touches and what it passes. Compiled by
# numba.


BoolArray = NDArray[np.bool_]

CLOSE = 1e-9  # m: heights that differ less are equal
_ON_END = 1e-9  # m: a surface is touched this far beyond its upper or lower end


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


def ways_of(paths: Paths) -> Ways:
    """Return the ways of paths in the plan."""
    distances = np.empty(paths.points.shape[:2])
    met, lasts = np.empty(distances.shape, np.int32), np.empty(len(paths), np.int32)
    points = np.ascontiguousarray(paths.points)
    _fill_ways(points, paths.surfaces, paths.edges, paths.bends, distances, met, lasts)
    return Ways(points, distances, met, lasts, paths.edges, paths.bends)


@compiled
def _fill_ways(
    points: FloatArray,
    surfaces: IntArray,
    edges: IntArray,
    bends: IntArray,
    distances: FloatArray,
    met: IntArray,
    lasts: IntArray,
) -> None:
    """Fill in the columns `distances`, `met` and `lasts` of ways; the others are those of paths."""
    for row in range(points.shape[0]):
        last, distances[row, 0], met[row] = 0, 0.0, -1
        for k in range(1, points.shape[1]):
            leg = math.hypot(points[row, k, 0] - points[row, k - 1, 0], points[row, k, 1] - points[row, k - 1, 1])
            distances[row, k] = distances[row, k - 1] + leg
            # what follows the last point is NaN
            last += int(distances[row, k] == distances[row, k])
        lasts[row] = last
        for touch in range(surfaces.shape[1]):
            if surfaces[row, touch] >= 0:
                met[row, touch + 1 + int(edges[row] >= 0 and touch >= bends[row])] = surfaces[row, touch]


@compiled_part
def can_take(ways: Ways, row: int, passages: Passages, passed: int, rise: Rise, obstacles: Obstacles) -> bool:
    """Return whether sound with this rise touches and passes what its way says, with so many `passages`."""
    last = ways.lasts[row]
    if ways.at[row, last] <= CLOSE:
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
        if levels.limited[level] and abs(rise.climbs[k + 1] - climb) <= CLOSE:
            end = upper if levels.facing[level] > 0 else lower
            if abs(levels.heights[level] - end) <= CLOSE:
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
            if CLOSE < gap < whole - CLOSE and _is_over(ways, row, (climbs[k] + gap) / slope, level, levels):
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
    rest = climb - rise.climbs[k]
    height: float = rise.heights[k] + (rest if rise.heights[k + 1] >= rise.heights[k] else -rest)
    return height


# Folding: which sequences of levels sound can touch along a way of the plan. Compiled by numba.


_NEARLY = 1e-8  # m: nearer to the end of a surface, only the exact heights decide


class Folded(NamedTuple):
    """Sequences of levels along ways, one row each."""

    rows: NDArray[np.intp]  # (m,): the way
    levels: IntArray  # (m, k): levels touched, in order, padded with -1
    climbs: FloatArray  # (m, k), m: up and down travelled until each level, padded with NaN
    totals: FloatArray  # (m,), m: up and down travelled in all


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
        count = _fold(
            ways,
            bounces,
            steepest,
            height,
            search.max_length + SLACK,
            search.max_bounces,
            obstacles,
            Folded(rows, levels, climbs, totals),
        )
        fan.check_size(count, ways.at.shape[1] + deepest)
        if count <= capacity:
            used = max(1, int((levels[:count] >= 0).sum(axis=1).max(initial=0)))
            return Folded(rows[:count], levels[:count, :used], climbs[:count, :used], totals[:count])
        capacity = count


def _most_levels(levels: KernelLevels, search: PathSearch) -> int:
    """Return how many levels a path may touch at most."""
    lower, upper = levels.heights[levels.facing > 0], levels.heights[levels.facing < 0]
    gaps = upper[:, None] - lower
    least = float(gaps[gaps > CLOSE].min(initial=search.max_length))
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
    """Room for what one way passes and touches, and for one sequence of levels while it grows."""

    passages: Passages
    visits: _Visits
    touches: _Touches
    heights: FloatArray  # (k,), m: of the departure and of each level so far
    climbs: FloatArray  # (k,), m
    least: FloatArray  # (k,), m: the least climb in all that the levels so far allow
    largest: FloatArray  # (k,), m
    levels: IntArray  # (k,)
    choices: IntArray  # (k,): the next visit to try at each depth


class _Limits(NamedTuple):
    """What limits the sequences along one way."""

    largest: float  # m, of the climb in all
    most: int  # levels
    visits: int  # rows that are filled in
    touches: int


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
    deepest, points = folded.levels.shape[1], ways.at.shape[1]
    numbers, choices = np.empty((4, deepest + 2)), np.empty((2, deepest + 2), np.int32)
    work = _Work(
        room_for_passages(points, obstacles.low),
        _no_visits(obstacles.levels.heights.shape[0] * points),
        _no_touches(points),
        numbers[0],
        numbers[1],
        numbers[2],
        numbers[3],
        choices[0],
        choices[1],
    )
    count, least = 0, _least_climb(height, obstacles.levels)
    for row in range(ways.at.shape[0]):
        length = ways.at[row, ways.lasts[row]]
        if not CLOSE < length <= max_length:
            continue
        largest = min(math.sqrt(max_length * max_length - length * length), steepest[row] * length)
        if largest < least - _NEARLY:
            continue
        visits = _visit_levels(ways, row, obstacles.levels, work.visits)
        touches = _touch_low(ways, row, obstacles, work.touches)
        limits = _Limits(largest, min(deepest, max_bounces - bounces[row]), visits, touches)
        count = _fold_along(ways, row, height, limits, obstacles, work, folded, count)
    return count


@compiled_part
def _fold_along(
    ways: Ways,
    row: int,
    height: float,
    limits: _Limits,
    obstacles: Obstacles,
    work: _Work,
    folded: Folded,
    count: int,
) -> int:
    """Add the sequences along one way, first those that go down first; return how many rows there are now."""
    heights, climbs, passed = work.heights, work.climbs, -1
    heights[0], climbs[0] = height, 0.0
    work.least[0], work.largest[0] = 0.0, limits.largest
    for first in (-1.0, 1.0):
        depth, going = 0, first
        work.choices[0] = 0
        while depth >= 0:
            if work.choices[depth] == limits.visits or depth == limits.most:
                depth, going = depth - 1, -going
                continue
            lower, upper = _touch_next(ways, row, depth, going, limits, obstacles.levels, work)
            if lower > upper:
                continue
            depth, going = depth + 1, -going
            work.least[depth], work.largest[depth], work.choices[depth] = lower, upper, 0
            # from here back to the height of departure
            home = (height - heights[depth]) * going
            total = climbs[depth] + home
            if home <= 0.0 or not lower - CLOSE <= total <= upper + CLOSE:
                continue
            heights[depth + 1], climbs[depth + 1] = height, total
            if passed < 0:
                # on most ways, no sequence comes so far
                passed = pass_low(ways.points[row], ways.at[row], ways.lasts[row], obstacles.surfaces, work.passages)
            if can_take(ways, row, work.passages, passed, Rise(heights, climbs, work.levels, depth), obstacles):
                if count < folded.rows.shape[0]:
                    _enter(row, total, depth, work, folded, count)
                count += 1
    return count


@inlined
def _touch_next(
    ways: Ways, row: int, depth: int, going: float, limits: _Limits, levels: KernelLevels, work: _Work
) -> tuple[float, float]:
    """Continue a sequence of `depth` levels by the next one to try; return the least and largest climb in all, m.

    Sound goes there up (`going` 1) or down (-1). The first result exceeds the second if it cannot touch this level.
    """
    heights, climbs, visits, height = work.heights, work.climbs, work.visits, work.heights[0]
    k, length = work.choices[depth], ways.at[row, ways.lasts[row]]
    level = visits.levels[k]
    work.choices[depth] = visits.behind[k]
    gap = (levels.heights[level] - heights[depth]) * going
    climb = climbs[depth] + gap
    # it has to return from there, with any levels in between
    returned = climb + abs(height - levels.heights[level])
    lower, upper = max(work.least[depth], returned), work.largest[depth]
    if levels.facing[level] * going > 0.0 or gap <= CLOSE or returned > upper + 2.0 * CLOSE:
        return 1.0, 0.0
    if levels.limited[level]:
        k = _first_reached(visits, k, climb * length, upper)
        if k == work.choices[depth]:
            return 1.0, 0.0
        lower = max(lower, climb * length / max(visits.leaves[k], CLOSE))
        upper = min(upper, climb * length / max(visits.enters[k], CLOSE))
    # if this leg is over a level too far along the way, so are the following ones
    if lower > upper + CLOSE:
        return 1.0, 0.0
    work.choices[depth] = k + 1
    work.levels[depth] = level
    heights[depth + 1], climbs[depth + 1] = levels.heights[level], climb
    return _narrowed(lower, upper, heights, climbs, depth + 1, work.touches, limits.touches)


@inlined
def _enter(row: int, total: float, depth: int, work: _Work, folded: Folded, row_of_sequence: int) -> None:
    """Enter the first `depth` levels of a sequence as row `row_of_sequence`."""
    folded.rows[row_of_sequence], folded.totals[row_of_sequence] = row, total
    for j in range(folded.levels.shape[1]):
        folded.levels[row_of_sequence, j] = work.levels[j] if j < depth else -1
        folded.climbs[row_of_sequence, j] = work.climbs[j + 1] if j < depth else np.nan


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
    while k < behind and steepness / max(visits.leaves[k], CLOSE) > largest + CLOSE:
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
    last, count = ways.lasts[row], 0
    for k in range(1, last):
        surface = ways.met[row, k]
        if surface >= 0 and obstacles.low[surface]:
            touches.shares[count] = max(ways.at[row, k], CLOSE) / ways.at[row, last]
            lower, upper = obstacles.spans[surface]
            touches.lowers[count], touches.uppers[count] = lower - _NEARLY, upper + _NEARLY
            count += 1
    return count


@compiled_part
def _visit_levels(ways: Ways, row: int, levels: KernelLevels, visits: _Visits) -> int:
    """Fill in the levels that a way passes over or under, and return their number."""
    last, count = ways.lasts[row], 0
    for level in range(levels.heights.shape[0]):
        if not levels.limited[level]:
            visits.levels[count], visits.enters[count], visits.leaves[count] = level, 0.0, ways.at[row, last]
            visits.behind[count] = count + 1
            count += 1
            continue
        first = count
        for leg in range(last):
            passed, length = ways.at[row, leg], ways.at[row, leg + 1] - ways.at[row, leg]
            begin, end = 0.0, length
            for axis in range(2):
                start = ways.points[row, leg, axis]
                step = ways.points[row, leg + 1, axis] - start
                low, high = levels.boxes[level, axis] - start, levels.boxes[level, 2 + axis] - start
                if abs(step) <= CLOSE:
                    if low > 0.0 or high < 0.0:
                        end = -1.0
                    continue
                enter, leave = low / step * length, high / step * length
                begin, end = max(begin, min(enter, leave)), min(end, max(enter, leave))
            if begin <= end:
                visits.levels[count], visits.enters[count], visits.leaves[count] = level, passed + begin, passed + end
                count += 1
        for k in range(first, count):
            visits.behind[k] = count
    return count


# The plan of a room with heights: walls, posts and edges of all heights, with the heights at which each exists.


@dataclass(frozen=True)
class Plan:
    """A room as seen from above."""

    room: Room  # with the edges of all heights
    passing: Passing | None  # None: no surface is low
    obstacles: Obstacles
    edges: IntArray  # (e + 1,): number of each edge in the given room; the last, for row -1, is -1


def plan_of(room: Room, height: float, levels: Levels, reach: Span, climbs: FloatArray, search: PathSearch) -> Plan:
    """Return the plan for a place at a height (m), and sound that stays between the heights `reach` (m).

    `climbs` (c,) m are what the paths to find go up and down, negative if they first go down.
    """
    spans = room.heights[: room.levels.start]
    low = (spans[:, 0] > reach[0]) | (spans[:, 1] < reach[1])
    surfaces = room.surfaces
    if not low.any():
        edges = np.append(np.arange(len(room.edges)), -1).astype(np.int32)
        everywhere = np.ones((len(room.edges), 1), np.bool_)
        obstacles = Obstacles(only(surfaces, low), spans, low, np.empty(0), everywhere, levels.kernel)
        return Plan(room, None, obstacles, edges)
    lids = bool(levels.kernel.limited.any())
    passing = Passing(surfaces, spans, low, height, levels.floor, levels.ceiling, climbs, search.max_length, lids)
    bounds, edges_at_all, at_bands = room.edges_by_height
    plan = replace(room, edges=edges_at_all)
    plan.__dict__["surfaces"] = surfaces
    plan.__dict__["enclosures"] = find_enclosures(room.walls[~low[: len(room.walls)]], edges_at_all)
    obstacles = Obstacles(passing.passable, spans, low, bounds, at_bands, levels.kernel)
    return Plan(plan, passing, obstacles, edge_numbers(edges_at_all, room, range(len(room.walls))))


def edge_numbers(edges: Edges, room: Room, walls: Sequence[int]) -> IntArray:
    """Return the numbers in a room of edges of some of its `walls`, (e + 1,); the last, for row -1, is -1."""
    rows = {corner: row for row, corner in enumerate(_corners(room.edges))}
    numbers = [
        rows.get(corner, room.edge_between(*sorted((walls[first], walls[last]))))
        for corner, (first, last) in zip(_corners(edges), edges.faces.tolist(), strict=True)
    ]
    return np.array([*numbers, -1], dtype=np.int32)


def _corners(edges: Edges) -> list[tuple[float, float, str]]:
    return [(x, y, name) for (x, y), name in zip(edges.points.tolist(), edges.names, strict=True)]


# Paths in space: each path of the plan, together with each sequence of levels that its heights allow.
#
# Walls and posts are upright, floor, ceiling and lids are level. So the plan of a path in space is a path in the
# plan, its height folds at levels as between mirrors, and its length is √(plan² + climb²).


_TOGETHER = 1e-9  # m: touches this near to each other in the plan are in the order of the plan


def raised_paths(plan: Plan, levels: Levels, paths: Paths, height: float, search: PathSearch) -> Paths:
    """Return the paths in space from a height (m) back to it, by paths of the plan and levels."""
    ways, at_edges = ways_of(paths), _at_edges(plan.room, paths, search)
    folded = fold(ways, paths.bounces, _steepest(paths, at_edges, search), height, search, plan.obstacles)
    if plan.passing is not None:
        kept = _once(paths, folded)
        folded = Folded._make(column[kept] for column in folded)
    elevations = np.arctan2(folded.totals, paths.lengths[folded.rows])
    gains, phases = _bent(plan.room, paths, at_edges, folded.rows, elevations, search)
    gains *= np.append(plan.room.reflectances[levels.surfaces], 1.0)[folded.levels].prod(axis=1)
    bent = paths.edges[folded.rows] >= 0
    kept = np.flatnonzero(~bent | (gains * loudest_at(elevations, search) >= search.faintest_diffraction))
    folded, elevations = Folded._make(column[kept] for column in folded), elevations[kept]
    surfaces, bends, points = with_levels(ways, levels, folded)
    count = (folded.levels >= 0).sum(axis=1)
    ends = levels.kernel.heights[folded.levels[np.arange(len(kept))[:, None], np.column_stack((0 * count, count - 1))]]
    return replace(
        paths.select(folded.rows),
        lengths=np.hypot(paths.lengths[folded.rows], folded.totals),
        gains=gains[kept],
        phases=phases[kept],
        surfaces=surfaces,
        bends=bends,
        points=points,
        elevations=elevations[:, None] * np.sign(ends - height),
    )


def _once(paths: Paths, folded: Folded) -> NDArray[np.intp]:
    """Return which of these rows differ in space: through a vertex, several sequences describe one path."""
    rows = folded.rows
    kinds = hashes_of(np.column_stack((folded.levels, paths.edges[rows])))
    return np.flatnonzero(first_of_kind(paths.lengths, kinds, paths.points, rows=rows))


def _at_edges(room: Room, paths: Paths, search: PathSearch) -> ComplexArray:
    """Return the amplitudes of the edges of paths in the plan, (n,); 1 without an edge."""
    amplitudes = np.ones(len(paths), np.complex128)
    bent = np.flatnonzero(paths.edges >= 0)
    if len(bent):
        amplitudes[bent] = _amplitudes(room, paths, bent, np.full(len(bent), search.wavelength), search)
    return amplitudes


def _amplitudes(
    room: Room, paths: Paths, rows: NDArray[np.intp], wavelengths: FloatArray, search: PathSearch
) -> ComplexArray:
    """Return the amplitudes of the edges of these rows (m,) of paths, for wavelengths (m,), m."""
    at_edges = paths.edges[rows], paths.bends[rows], paths.points[rows]
    return amplitudes_at_edges(room, *at_edges, wavelengths, search.edge_strength)


def _steepest(paths: Paths, at_edges: ComplexArray, search: PathSearch) -> FloatArray:
    """Return the slopes beyond which the edges of paths are too faint, (n,); inf without an edge."""
    table = search.loudest_by_elevation
    # no edge has an amplitude over 1
    most = paths.gains / np.maximum(np.abs(at_edges), 1e-300)
    loud = np.searchsorted(-table, -search.faintest_diffraction / np.maximum(most, 1e-300), side="right")
    # the last value of the table is that of upright sound only
    limited = (paths.edges >= 0) & (loud < len(table) - 1)
    slopes = np.tan(math.pi / 2 * np.where(limited, loud, 0) / max(len(table) - 1, 1))
    return np.where(limited, slopes, np.inf)


def _bent(
    room: Room,
    paths: Paths,
    at_edges: ComplexArray,
    rows: NDArray[np.intp],
    elevations: FloatArray,
    search: PathSearch,
) -> tuple[FloatArray, FloatArray]:
    """Return gains and phases (m,) of rows (m,) of paths with these elevations (m,).

    Sound that meets an upright edge at an elevation e is diffracted as in the plan by a wave 1/cos e times as long: the
    field along the edge is a factor exp(jkz sin e). `at_edges` (n,) are the amplitudes in the plan.
    """
    gains, phases = paths.gains[rows], paths.phases[rows]
    bent = np.flatnonzero(paths.edges[rows] >= 0)
    if len(bent):
        was = at_edges[rows[bent]]
        now = _amplitudes(room, paths, rows[bent], search.wavelength / np.cos(elevations[bent]), search)
        gains[bent] *= np.abs(now) / np.maximum(np.abs(was), 1e-300)
        phases[bent] += np.angle(now * was.conj())
    return gains, phases


def loudest_at(elevations: FloatArray, search: PathSearch) -> FloatArray:
    """Return the most that both beams leave of paths with these elevations (n,) at any heading, (n,)."""
    table = search.loudest_by_elevation
    return table[(np.abs(elevations) / (math.pi / 2) * (len(table) - 1)).astype(np.intp)]


def with_levels(ways: Ways, levels: Levels, folded: Folded) -> tuple[IntArray, IntArray, FloatArray]:
    """Return surfaces (n, b), bends (n,) and points (n, b + 3, 2) of paths with touches of levels among the others."""
    count = len(folded.rows)
    most = int((ways.lasts[folded.rows] - 1 + (folded.levels >= 0).sum(axis=1)).max(initial=0))
    surfaces, points = np.full((count, most), -1, np.int32), np.full((count, most + 3, 2), np.nan)
    bends = np.empty(count, np.int32)
    _merge(ways, levels.surfaces, folded, surfaces, bends, points)
    return surfaces, bends, points


@compiled
def _merge(
    ways: Ways, numbers: IntArray, folded: Folded, surfaces: IntArray, bends: IntArray, points: FloatArray
) -> None:
    """Fill in the result of `with_levels`, which is all -1 and NaN before; `numbers` (l,) are those of the levels."""
    for k in range(folded.rows.shape[0]):
        row = folded.rows[k]
        last, length, total = ways.lasts[row], ways.at[row, ways.lasts[row]], max(folded.totals[k], 1e-300)
        leg, level, touches, point_count = 0, 0, 0, 1
        points[k, 0] = ways.points[row, 0]
        bends[k] = -1
        while True:
            reached = level == folded.levels.shape[1] or folded.levels[k, level] < 0
            along = length if reached else length * folded.climbs[k, level] / total
            # levels first: they are so in a right-angled corner of level and wall, touched at one point
            if leg + 1 < last and (reached or round(ways.at[row, leg + 1] / _TOGETHER) < round(along / _TOGETHER)):
                leg += 1
                points[k, point_count] = ways.points[row, leg]
                surface = ways.met[row, leg]
            elif reached:
                break
            else:
                size = ways.at[row, leg + 1] - ways.at[row, leg]
                share = (along - ways.at[row, leg]) / (size if size > 0.0 else 1.0)
                for axis in range(2):
                    begin = ways.points[row, leg, axis]
                    points[k, point_count, axis] = begin + share * (ways.points[row, leg + 1, axis] - begin)
                surface = numbers[folded.levels[k, level]]
                level += 1
            point_count += 1
            if surface >= 0:
                surfaces[k, touches] = surface
                touches += 1
            else:
                # the edge is the one point between source and receiver without a surface
                bends[k] = touches
        points[k, point_count] = ways.points[row, last]
        if bends[k] < 0:
            bends[k] = ways.bends[row] + level


def straight_paths(room: Room, place: Place, levels: Levels, height: float, search: PathSearch) -> list[Paths]:
    """Return the paths that only go up and down between the levels, one table each."""
    lower, upper = room.heights[room.posts_at(place.position)].T
    return [
        _straight(room, place, levels, sequence)
        for sequence in _up_and_down(levels, place, height, search)
        # no post stands in the way
        if not ((lower < max(sequence.heights)) & (upper > min(sequence.heights))).any()
    ]


def _up_and_down(levels: Levels, place: Place, height: float, search: PathSearch) -> Iterator[LevelSequence]:
    """Yield the sequences between the nearest levels below and above a place."""
    here, heights = np.array([place.position]), levels.kernel.heights
    covers = np.array([lid is None or bool(lid.covers(here)[0]) for lid in levels.lids], dtype=np.bool_)
    below = np.flatnonzero(covers & (heights < height) & (levels.kernel.facing > 0))
    above = np.flatnonzero(covers & (heights > height) & (levels.kernel.facing < 0))
    nearest = below[np.argsort(-heights[below])[:1]].tolist(), above[np.argsort(heights[above])[:1]].tolist()
    for first, second in (nearest, nearest[::-1]):
        rows: tuple[int, ...] = ()
        while len(rows) < search.max_bounces and (following := (first, second)[len(rows) % 2]):
            rows = (*rows, *following)
            sequence = LevelSequence(rows, (height, *heights[list(rows)].tolist(), height))
            if sequence.climb > search.max_length + SLACK:
                break
            yield sequence


def _straight(room: Room, place: Place, levels: Levels, sequence: LevelSequence) -> Paths:
    count, whole = len(sequence.levels), np.array([-1], np.int32)
    surfaces = levels.surfaces[[list(sequence.levels)]]
    up, down = sequence.signs
    return Paths(
        lengths=np.array([sequence.climb]),
        departures=np.zeros(1),
        arrivals=np.zeros(1),
        gains=room.reflectances[surfaces].prod(axis=1),
        phases=np.zeros(1),
        spreads=np.zeros(1),
        surfaces=surfaces,
        edges=whole,
        bends=np.array([count], np.int32),
        elevations=np.array([[up * math.pi / 2, down * math.pi / 2]]),
        points=np.concatenate((np.tile(place.position, (1, count + 2, 1)), np.full((1, 1, 2), np.nan)), axis=1),
    )
