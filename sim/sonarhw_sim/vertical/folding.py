"""Folding: which sequences of levels sound can touch along a way of the plan. Compiled by numba."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray
from sonarhw_sim.compiled import array_part, compiled, compiled_part, inlined
from sonarhw_sim.rays import path_table
from sonarhw_sim.rays.passing import Passages, pass_low, room_for_passages
from sonarhw_sim.rays.paths import SLACK, PathSearch
from sonarhw_sim.room.grid import IntArray
from sonarhw_sim.vertical.reflecting_levels import KernelLevels
from sonarhw_sim.vertical.ways import CLOSE, Obstacles, Rise, Ways, can_take

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
    found, least = 0, _least_climb(height, obstacles.levels)
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
        found = _fold_along(ways, row, height, limits, obstacles, work, folded, found)
    return found


@compiled_part
def _fold_along(
    ways: Ways,
    row: int,
    height: float,
    limits: _Limits,
    obstacles: Obstacles,
    work: _Work,
    folded: Folded,
    found: int,
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
                if found < folded.rows.shape[0]:
                    _enter(row, total, depth, work, folded, found)
                found += 1
    return found


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
    last, found = ways.lasts[row], 0
    for k in range(1, last):
        surface = ways.met[row, k]
        if surface >= 0 and obstacles.low[surface]:
            touches.shares[found] = max(ways.at[row, k], CLOSE) / ways.at[row, last]
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
                if abs(step) <= CLOSE:
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
