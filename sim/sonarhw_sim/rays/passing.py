"""Surfaces that sound may pass over or under, and the slopes of rays that find the ways past them.

A ray with a slope has one height at each distance in the plan, so it either touches such a surface or passes it. Rays
only find which surfaces sound may touch in which order: the heights of the exact paths are checked later.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray
from sonarhw_sim.compiled import compiled, compiled_part
from sonarhw_sim.room.grid import IntArray, Listing, Surfaces

BoolArray = NDArray[np.bool_]

SLOPES = 8  # of the rays in each direction, of each kind
_NEARLY = 1e-6  # m: a path this near to the end of a surface is not omitted here; its exact heights are checked later
_FLUSH = 1e-9  # m: walls this near to one line touch sound at one point


class KernelHeights(NamedTuple):
    """KernelHeights for kernels; m."""

    low: BoolArray  # (s,): surfaces to which heights apply; to others, sound has any height
    spans: FloatArray  # (s, 2): lower and upper end
    flush: Listing  # for each surface, the other walls on its line
    start: float  # of the transducer
    floor: float  # -inf: none
    ceiling: float  # inf: none


class Climbs(NamedTuple):
    """What sound goes up and down on the way to the receiver, to test its heights; for kernels."""

    climbs: FloatArray  # (c,), m, negative if it first goes down; none: heights are not tested
    low: BoolArray  # (s,): surfaces that have a height
    spans: FloatArray  # (s, 2), m: lower and upper end
    start: float  # m, of the transducer
    floor: float  # m; -inf: none
    ceiling: float  # m; inf: none
    longest: float  # m, of a path in space


@dataclass(frozen=True)
class Passing:
    """Walls and posts with their heights, and where sound may be in between."""

    surfaces: Surfaces
    spans: FloatArray  # (s, 2), m: lower and upper end of walls and posts
    low: BoolArray  # (s,): those that sound may pass
    height: float  # m, of the transducer
    floor: float  # m; -inf: none
    ceiling: float  # m; inf: none
    climbs: FloatArray  # (c,), m: up and down travelled by the paths to find, negative if these first go down
    max_length: float  # m
    lids: bool  # whether sound may turn at levels other than floor and ceiling

    @property
    def to_receiver(self) -> Climbs:
        """What the paths to find go up and down, for kernels; none if sound may turn at a lid."""
        climbs = self.climbs[:0] if self.lids else self.climbs
        return Climbs(climbs, self.low, self.spans, self.height, self.floor, self.ceiling, self.max_length)

    @property
    def blocking(self) -> Surfaces:
        """The surfaces with a grid that lists only those that no sound passes."""
        return only(self.surfaces, ~self.low)

    @property
    def heights(self) -> KernelHeights:
        """The same for kernels, with the walls flush with a low one among the low ones."""
        flush = self._flush()
        low = self.low.copy()
        low[[one for one, _ in flush]] = True
        starts = np.searchsorted([one for one, _ in flush], np.arange(len(low) + 1)).astype(np.int32)
        others = Listing(starts, np.array([other for _, other in flush], dtype=np.int32))
        return KernelHeights(low, self.spans, others, self.height, self.floor, self.ceiling)

    def _flush(self) -> list[tuple[int, int]]:
        """Return the pairs of walls on one line that overlap there, one of them low, in both orders, sorted."""
        walls = self.surfaces.walls
        along = walls[:, 2:] - walls[:, :2]
        lengths = np.hypot(*along.T)
        pairs = set()
        for one in np.flatnonzero(self.low[: len(walls)]).tolist():
            away = walls.reshape(-1, 2, 2) - walls[one, :2]
            aside = np.abs(away[..., 0] * along[one, 1] - away[..., 1] * along[one, 0]).max(axis=1) / lengths[one]
            on = (away @ along[one]) / lengths[one]
            overlap = np.minimum(on.max(axis=1), lengths[one]) - np.maximum(on.min(axis=1), 0.0)
            for other in np.flatnonzero((aside <= _FLUSH) & (overlap > _FLUSH)).tolist():
                pairs |= {(one, other), (other, one)} if other != one else set()
        return sorted(pairs)

    def slopes(self, directions: FloatArray) -> FloatArray:
        """Return slopes (n, k) of rays in each of these directions (n,).

        Half of them are those of paths with the climbs of this room, at lengths in the plan that are the more frequent
        the longer they are. The others are spread from flat to steep. Neighbouring rays have different slopes, so that
        together they leave smaller gaps.
        """
        turned = (np.arange(len(directions)) * (math.sqrt(5) - 1) / 2) % 1.0
        share = np.minimum((np.arange(SLOPES) + turned[:, None]) / SLOPES, 1 - 1e-6)
        longest = np.sqrt(np.maximum(self.max_length**2 - self.climbs**2, 1e-12))
        bounds = np.append(0.0, np.cumsum(longest**2)) / (longest**2).sum()
        which = np.searchsorted(bounds, share, side="right") - 1
        within = (share - bounds[which]) / (bounds[which + 1] - bounds[which])
        of_climbs = self.climbs[which] / (longest[which] * np.sqrt(np.maximum(within, 1e-6)))
        return np.hstack((of_climbs, np.sign(of_climbs) * np.tan(math.pi / 2 * share**2)))


def only(surfaces: Surfaces, chosen: BoolArray) -> Surfaces:
    """Return surfaces with a grid that lists only the chosen ones, (s,) bool."""
    starts, numbers = surfaces.listing
    kept = chosen[numbers]
    before = np.append(0, np.cumsum(kept)).astype(np.int32)
    return surfaces._replace(listing=Listing(before[starts], numbers[kept]))


def no_climbs() -> Climbs:
    """Return the climbs with which heights are not tested."""
    return Climbs(np.empty(0), np.empty(0, np.bool_), np.empty((0, 2)), 0.0, 0.0, 0.0, 0.0)


def no_heights(surfaces: int) -> KernelHeights:
    """Return the heights for a search in which sound passes none of so many surfaces."""
    nothing = Listing(np.zeros(surfaces + 1, np.int32), np.empty(0, np.int32))
    return KernelHeights(np.zeros(surfaces, np.bool_), np.empty((0, 2)), nothing, 0.0, 0.0, 0.0)


@compiled_part
def surface_at(x: float, y: float, climb: float, surface: int, heights: KernelHeights, walls: FloatArray) -> int:
    """Return the surface that sound touches where it meets `surface` at (x, y) m, after a `climb` (m); -1: none."""
    height = _folded(heights.start + climb, heights.floor, heights.ceiling)
    if heights.spans[surface, 0] <= height <= heights.spans[surface, 1]:
        return surface
    for k in range(heights.flush.starts[surface], heights.flush.starts[surface + 1]):
        other = heights.flush.numbers[k]
        wall = walls[other]
        ex, ey = wall[2] - wall[0], wall[3] - wall[1]
        along = (x - wall[0]) * ex + (y - wall[1]) * ey
        if 0.0 <= along <= ex * ex + ey * ey and heights.spans[other, 0] <= height <= heights.spans[other, 1]:
            return int(other)
    return -1


@compiled
def at_heights(
    points: FloatArray, surfaces: IntArray, bends: IntArray, lengths: FloatArray, climbs: Climbs
) -> BoolArray:
    """Return which paths past edges one of the climbs leads to the height of all that they touch, (n,) bool.

    Columns as in `rays.paths.Paths`.
    """
    fit = np.empty(lengths.shape[0], np.bool_)
    at, low = np.empty(surfaces.shape[1]), np.empty(surfaces.shape[1], np.int32)
    for row in range(lengths.shape[0]):
        fit[row] = touches_at_height(points[row], surfaces[row], int(bends[row]), lengths[row], climbs, at, low)
    return fit


@compiled_part
def touches_at_height(
    path: FloatArray,
    sequence: IntArray,
    bend: int,
    length: float,
    climbs: Climbs,
    at: FloatArray,
    touched: IntArray,
) -> bool:
    """Return whether one of the climbs leads a path (k, 2) of a length (m) to the height of all that it touches.

    The path touches `sequence`, padded with -1, and passes an edge after the first `bend` of its surfaces. `at` and
    `touched`, as long as that, are overwritten.
    """
    if not climbs.climbs.shape[0]:
        return True
    # only low surfaces matter
    count, along = 0, 0.0
    for k in range(path.shape[0] - 1):
        along += math.hypot(path[k + 1, 0] - path[k, 0], path[k + 1, 1] - path[k, 1])
        if math.isnan(along):
            break
        touch = k if k < bend else k - 1
        if k != bend and touch < sequence.shape[0] and sequence[touch] >= 0 and climbs.low[sequence[touch]]:
            at[count], touched[count] = along / length, sequence[touch]
            count += 1
    for climb in climbs.climbs:
        if climb * climb + length * length > climbs.longest * climbs.longest + _NEARLY:
            continue
        fits = 0
        while fits < count:
            height = _folded(climbs.start + climb * at[fits], climbs.floor, climbs.ceiling)
            lower, upper = climbs.spans[touched[fits]]
            if not lower - _NEARLY <= height <= upper + _NEARLY:
                break
            fits += 1
        if fits == count:
            return True
    return False


@compiled_part
def _folded(height: float, floor: float, ceiling: float) -> float:
    """Return the height (m) of sound that floor and ceiling reflect and that would otherwise reach `height`."""
    if height < floor and ceiling == np.inf:
        return 2.0 * floor - height
    if height > ceiling and floor == -np.inf:
        return 2.0 * ceiling - height
    if floor <= height <= ceiling:
        return height
    up, both = height - floor, 2.0 * (ceiling - floor)
    # a call of the remainder takes longer than all else here
    up -= math.floor(up / both) * both
    return floor + min(up, both - up)
