"""Ways in the plan, and whether sound at the heights of a rise can take them.

Sound rises or falls with one slope all along its way: what it goes up and down in all, its climb, over its length in
the plan. So its levels fix its height everywhere, and with it what it touches and what it passes. Compiled by numba.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray
from sonarhw_sim.compiled import compiled, compiled_part
from sonarhw_sim.rays.passing import Passages
from sonarhw_sim.rays.paths import Paths
from sonarhw_sim.room.grid import IntArray, Surfaces
from sonarhw_sim.vertical.reflecting_levels import KernelLevels, is_within

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
    on = climb - rise.climbs[k]
    height: float = rise.heights[k] + (on if rise.heights[k + 1] >= rise.heights[k] else -on)
    return height
