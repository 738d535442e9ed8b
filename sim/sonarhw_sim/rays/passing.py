"""Surfaces that sound may pass over or under, and the slopes of rays that find the ways past them.

A ray with a slope has one height at each distance in the plan, so it either touches such a surface or passes it. Rays
only find which surfaces sound may touch in which order: the heights of the exact paths are checked later.
"""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray
from sonarhw_sim.compiled import array_part, compiled, compiled_part
from sonarhw_sim.room.grid import IntArray, Listing, Surfaces, advance, enter, listed, only

BoolArray = NDArray[np.bool_]

SLOPES = 8  # of the rays in each direction, of each kind
_NEARLY = 1e-6  # m: a path this near to the end of a surface is not omitted here; its exact heights are checked later
_AT_END = 1e-8  # m: a surface that touches a leg this near to its end is the one on which it starts or ends
_INSIDE = 1e-7  # m: a leg this deep in a post crosses it
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
    passable: Surfaces  # with a grid that lists only these
    spans: FloatArray  # (s, 2), m: lower and upper end
    start: float  # m, of the transducer
    floor: float  # m; -inf: none
    ceiling: float  # m; inf: none
    longest: float  # m, of a path in space


class Passages(NamedTuple):
    """Room for the low surfaces that a way crosses in the plan, one row each."""

    surfaces: IntArray  # (c,)
    begins: FloatArray  # (c,), m along the way
    ends: FloatArray  # (c,), m


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
        return Climbs(
            climbs, self.low, self.passable, self.spans, self.height, self.floor, self.ceiling, self.max_length
        )

    @cached_property
    def blocking(self) -> Surfaces:
        """The surfaces with a grid that lists only those that no sound passes."""
        return only(self.surfaces, ~self.low)

    @cached_property
    def passable(self) -> Surfaces:
        """The surfaces with a grid that lists only those that sound may pass."""
        return only(self.surfaces, self.low)

    @property
    def heights(self) -> KernelHeights:
        """The same for kernels, with the walls flush with a low one among the low ones."""
        flush = self._flush()
        low = self.low.copy()
        low[[wall for wall, _ in flush]] = True
        starts = np.searchsorted([wall for wall, _ in flush], np.arange(len(low) + 1)).astype(np.int32)
        others = Listing(starts, np.array([other for _, other in flush], dtype=np.int32))
        return KernelHeights(low, self.spans, others, self.height, self.floor, self.ceiling)

    def _flush(self) -> list[tuple[int, int]]:
        """Return the pairs of walls on one line that overlap there, one of them low, in both orders, sorted."""
        walls = self.surfaces.walls
        along = walls[:, 2:] - walls[:, :2]
        lengths = np.hypot(*along.T)
        pairs = set()
        for wall in np.flatnonzero(self.low[: len(walls)]).tolist():
            away = walls.reshape(-1, 2, 2) - walls[wall, :2]
            aside = np.abs(away[..., 0] * along[wall, 1] - away[..., 1] * along[wall, 0]).max(axis=1) / lengths[wall]
            shares = (away @ along[wall]) / lengths[wall]
            overlap = np.minimum(shares.max(axis=1), lengths[wall]) - np.maximum(shares.min(axis=1), 0.0)
            for other in np.flatnonzero((aside <= _FLUSH) & (overlap > _FLUSH)).tolist():
                pairs |= {(wall, other), (other, wall)} if other != wall else set()
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


@array_part
def room_for_passages(points: int, low: BoolArray) -> Passages:
    """Return room for all low surfaces that a way with so many points can cross."""
    most = 0
    for is_low in low:  # np.sum in a kernel loads scipy.linalg at every start
        most += points * int(is_low)
    return Passages(np.empty(most, np.int32), np.empty(most), np.empty(most))


@compiled_part
def pass_low(points: FloatArray, at: FloatArray, last: int, surfaces: Surfaces, passages: Passages) -> int:
    """Fill in the low surfaces that a way crosses, and return their number.

    `points` (p, 2) m are those of the way up to number `last`, `at` (p,) m the length up to each, and `surfaces` list
    the low ones.
    """
    count = 0
    if surfaces.listing.numbers.shape[0] == 0:
        return 0
    for leg in range(last):
        x, y = points[leg, 0], points[leg, 1]
        length = at[leg + 1] - at[leg]
        if length <= 2 * _AT_END:
            continue
        dx, dy = (points[leg + 1, 0] - x) / length, (points[leg + 1, 1] - y) / length
        before = count
        walk = enter(surfaces.cells, x, y, dx, dy)
        while walk.inside:
            for k in listed(surfaces.cells, surfaces.listing, walk):
                begin, end = _crossing(x, y, dx, dy, length, k, surfaces)
                skipped = begin < 0.0
                # a surface is listed in several cells
                for earlier in range(before, count):
                    skipped = skipped or passages.surfaces[earlier] == k
                if not skipped:
                    passages.surfaces[count] = k
                    passages.begins[count], passages.ends[count] = at[leg] + begin, at[leg] + end
                    count += 1
            if min(walk.next_column, walk.next_row) > length:
                break
            walk = advance(surfaces.cells, walk)
    return count


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


class Fitting(NamedTuple):
    """Room for the heights of one path."""

    along: FloatArray  # (p,), m: length up to each point
    at: FloatArray  # (p,), m: length up to each low surface that it touches
    touched: IntArray  # (p,): these surfaces
    passages: Passages


@array_part
def room_for_fitting(points: int, climbs: Climbs) -> Fitting:
    """Return room for the heights of a path with up to so many points."""
    passages = room_for_passages(points, climbs.low)
    return Fitting(np.empty(points), np.empty(points), np.empty(points, np.int32), passages)


@compiled
def at_heights(
    points: FloatArray, surfaces: IntArray, bends: IntArray, lengths: FloatArray, climbs: Climbs
) -> BoolArray:
    """Return which paths past edges one of the climbs leads over and under all that they touch and pass, (n,) bool.

    Columns as in `rays.paths.Paths`.
    """
    fit, room = np.empty(lengths.shape[0], np.bool_), room_for_fitting(points.shape[1], climbs)
    for row in range(lengths.shape[0]):
        fit[row] = fits_a_climb(points[row], surfaces[row], int(bends[row]), lengths[row], climbs, room)
    return fit


@compiled_part
def fits_a_climb(path: FloatArray, sequence: IntArray, bend: int, length: float, climbs: Climbs, room: Fitting) -> bool:
    """Return whether one of the climbs leads a path (k, 2) of a length (m) to the right heights.

    The path touches `sequence`, padded with -1, and passes an edge after the first `bend` of its surfaces.
    """
    if not climbs.climbs.shape[0]:
        return True
    # only low surfaces matter
    count, last, passed = 0, 0, -1
    room.along[0] = 0.0
    for k in range(path.shape[0] - 1):
        leg = math.hypot(path[k + 1, 0] - path[k, 0], path[k + 1, 1] - path[k, 1])
        if math.isnan(leg):
            break
        last = k + 1
        room.along[last] = room.along[k] + leg
        touch = k if k < bend else k - 1
        if k != bend and touch < sequence.shape[0] and sequence[touch] >= 0 and climbs.low[sequence[touch]]:
            room.at[count], room.touched[count] = room.along[last], sequence[touch]
            count += 1
    for climb in climbs.climbs:
        if climb * climb + length * length > climbs.longest * climbs.longest + _NEARLY:
            continue
        if _touches_all(climb / length, count, climbs, room):
            if passed < 0:
                passed = pass_low(path, room.along, last, climbs.passable, room.passages)
            if _passes_all(climb / length, passed, climbs, room.passages):
                return True
    return False


@compiled_part
def _touches_all(slope: float, count: int, climbs: Climbs, room: Fitting) -> bool:
    """Return whether sound with a slope touches each of the first `count` low surfaces within its span."""
    for k in range(count):
        height = _folded(climbs.start + slope * room.at[k], climbs.floor, climbs.ceiling)
        lower, upper = climbs.spans[room.touched[k]]
        if not lower - _NEARLY <= height <= upper + _NEARLY:
            return False
    return True


@compiled_part
def _passes_all(slope: float, passed: int, climbs: Climbs, passages: Passages) -> bool:
    """Return whether sound with a slope is not within the span of a low surface where it enters or leaves that."""
    for k in range(passed):
        lower, upper = climbs.spans[passages.surfaces[k]]
        for distance in (passages.begins[k], passages.ends[k]):
            height = _folded(climbs.start + slope * distance, climbs.floor, climbs.ceiling)
            if lower + _NEARLY <= height <= upper - _NEARLY:
                return False
    return True


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
