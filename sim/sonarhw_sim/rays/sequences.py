"""Exact solution of a sequence of surfaces: the path that touches exactly these, in this order, if it exists.

Walls are solved with image sources. With a post in the sequence there is no finite image, so Newton's method finds the
points on posts first (`rays.contacts`). A path is valid if every reflection point is on its surface and no leg is
blocked. Compiled by numba.
"""

import math

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray
from sonarhw_sim.compiled import compiled, compiled_part, inlined
from sonarhw_sim.cores import rows_in_parts
from sonarhw_sim.rays.candidate_table import Fan
from sonarhw_sim.rays.contacts import mirrors_of, room_for_posts, touch_posts
from sonarhw_sim.rays.kernel import Targets
from sonarhw_sim.rays.passing import Climbs, fits_a_climb, no_climbs, room_for_fitting
from sonarhw_sim.room.grid import IntArray, Surfaces, advance, enter, listed

BoolArray = NDArray[np.bool_]

ON_WALL = 1e-9  # m: a wall may be touched this far beyond its end; a vertex is on both its walls
_LEAST_PART = 500  # candidates: fewer take about as long as a thread needs to begin
_LEG_ENDS = 1e-8  # m: a surface that touches a leg this near to its end is the one on which it starts or ends


def solve_candidates(
    source: FloatArray,
    fan: Fan,
    targets: Targets,
    surfaces: Surfaces,
    to_receiver: Climbs | None = None,
    beyond_ends: float = ON_WALL,
) -> tuple[BoolArray, FloatArray, FloatArray, FloatArray]:
    """Solve the candidates of a fan (c, 3); those to target 0 only if one of the climbs `to_receiver` is possible.

    A path may touch a wall up to `beyond_ends` m beyond its end.

    Returns whether each is a valid path not longer than allowed to its target, (c,) bool, and for each of the r valid
    ones: its points from the source to the target, (r, b + 3, 2) m, padded with NaN, for up to b reflections;
    its length (r,) m; its divergence (r,), the width of its ray tube over its length, 1 without posts.
    """
    most = int(fan.candidates[:, 1].max(initial=0))
    climbs = to_receiver or no_climbs(surfaces)

    def solved(begin: int, end: int) -> tuple[BoolArray, FloatArray, FloatArray, FloatArray]:
        # most candidates are no paths, and the system gives memory only to rows that are filled
        count = end - begin
        real, points = np.zeros(count, dtype=np.bool_), np.empty((count, most + 3, 2))
        lengths, divergences = np.empty(count), np.empty(count)
        found = _solve(
            source,
            fan.touched,
            fan.candidates[begin:end],
            targets.points,
            targets.longest,
            surfaces,
            climbs,
            beyond_ends,
            real,
            points,
            lengths,
            divergences,
        )
        return real, points[:found], lengths[:found], divergences[:found]

    real, points, lengths, divergences = rows_in_parts(solved, len(fan.candidates), _LEAST_PART)
    return real, points, lengths, divergences


@compiled
def _solve(
    source: FloatArray,
    touched: IntArray,
    candidates: IntArray,
    targets: FloatArray,
    longest: FloatArray,
    surfaces: Surfaces,
    to_receiver: Climbs,
    beyond_ends: float,
    real: BoolArray,
    points: FloatArray,
    lengths: FloatArray,
    divergences: FloatArray,
) -> int:
    """Fill in the results of `solve_candidates`, and return the number of paths."""
    walls, posts = surfaces.walls, surfaces.posts
    found, width = 0, points.shape[1]
    mirrors, unfolded = mirrors_of(walls), room_for_posts(width)
    images, room = np.empty((width, 2)), room_for_fitting(width, to_receiver)
    for c in range(candidates.shape[0]):
        ray, bounces, target = candidates[c]
        sequence = touched[ray, :bounces]
        path = points[found, : bounces + 2]
        path[0, 0], path[0, 1] = source[0], source[1]
        path[bounces + 1, 0], path[bounces + 1, 1] = targets[target, 0], targets[target, 1]
        divergence = 1.0
        if _touches_post(sequence, walls.shape[0]):
            solved, divergence = touch_posts(path, sequence, mirrors, posts, longest[target], unfolded)
            if not solved:
                continue
        if not _unfold_between_posts(path, sequence, walls, beyond_ends, images):
            continue
        length = _length(path)
        if length > longest[target]:
            continue
        # `bounces`: there is no edge
        if target == 0 and not fits_a_climb(path, sequence, bounces, length, to_receiver, room):
            continue
        if not path_is_free(path, surfaces):
            continue
        for k in range(bounces + 2, width):
            points[found, k, 0], points[found, k, 1] = np.nan, np.nan
        real[c], lengths[found], divergences[found] = True, length, divergence
        found += 1
    return found


@inlined
def _touches_post(sequence: IntArray, walls: int) -> bool:
    for surface in sequence:  # noqa: SIM110  numba compiles no generators
        if surface >= walls:
            return True
    return False


@compiled_part
def _unfold_between_posts(
    path: FloatArray, sequence: IntArray, walls: FloatArray, beyond_ends: float, images: FloatArray
) -> bool:
    """Do the same as `unfold`, for a path on which the points on posts are filled in."""
    begin, last = 0, sequence.shape[0]
    for k in range(last + 1):
        if k == last or sequence[k] >= walls.shape[0]:
            if not unfold(path[begin : k + 2], sequence[begin:k], walls, beyond_ends, images):
                return False
            begin = k + 1
    return True


@compiled_part
def unfold(path: FloatArray, sequence: IntArray, walls: FloatArray, beyond_ends: float, images: FloatArray) -> bool:
    """Fill in the points between path[0] and path[-1] with image sources; return whether each is on its wall.

    Up to `beyond_ends` m beyond the end of a wall is on it. `images` (b + 1, 2) or more rows are overwritten.
    """
    bounces = sequence.shape[0]
    x, y = path[bounces + 1, 0], path[bounces + 1, 1]
    for k in range(bounces - 1, -1, -1):
        x, y = mirrored(x, y, walls[sequence[k]])
        images[k, 0], images[k, 1] = x, y
    x, y = path[0, 0], path[0, 1]
    for k in range(bounces):
        wall = walls[sequence[k]]
        ex, ey = wall[2] - wall[0], wall[3] - wall[1]
        dx, dy = images[k, 0] - x, images[k, 1] - y
        across = dx * ey - dy * ex
        if across == 0.0:
            return False
        rx, ry = wall[0] - x, wall[1] - y
        ahead, along = (rx * ey - ry * ex) / across, (rx * dy - ry * dx) / across
        if ahead < -1e-9 or ahead > 1.0 + 1e-9:
            return False
        if along < 0.0 or along > 1.0:
            slack = beyond_ends / math.hypot(ex, ey)
            if along < -slack or along > 1.0 + slack:
                return False
        x, y = x + ahead * dx, y + ahead * dy
        path[k + 1, 0], path[k + 1, 1] = x, y
    return True


@inlined
def mirrored(x: float, y: float, wall: FloatArray) -> tuple[float, float]:
    """Return a point mirrored in the endless line of a wall."""
    ex, ey = wall[2] - wall[0], wall[3] - wall[1]
    aside = ((x - wall[0]) * ey - (y - wall[1]) * ex) / (ex * ex + ey * ey)
    return x - 2.0 * aside * ey, y + 2.0 * aside * ex


@compiled_part
def _length(path: FloatArray) -> float:
    """Return the length of a path (k, 2), m."""
    length = 0.0
    for k in range(path.shape[0] - 1):
        length += math.hypot(path[k + 1, 0] - path[k, 0], path[k + 1, 1] - path[k, 1])
    return length


@compiled_part
def path_is_free(path: FloatArray, surfaces: Surfaces) -> bool:
    """Return whether no surface blocks any leg of a path (k, 2), apart from surfaces at its points."""
    for k in range(path.shape[0] - 1):  # noqa: SIM110  numba compiles no generators
        if not _is_free(path[k], path[k + 1], surfaces):
            return False
    return True


@compiled
def leg_is_free(start: FloatArray, end: FloatArray, surfaces: Surfaces) -> bool:
    """Return whether the straight line from `start` to `end`, (2,) each, is free, apart from surfaces at its ends."""
    return _is_free(start, end, surfaces)


@compiled_part
def _is_free(start: FloatArray, end: FloatArray, surfaces: Surfaces) -> bool:
    length = math.hypot(end[0] - start[0], end[1] - start[1])
    if length <= 2 * _LEG_ENDS:
        return True
    dx, dy = (end[0] - start[0]) / length, (end[1] - start[1]) / length
    walk = enter(surfaces.cells, start[0], start[1], dx, dy)
    while walk.inside:
        for k in listed(surfaces.cells, surfaces.listing, walk):
            if k < surfaces.walls.shape[0]:
                blocked = _crosses_wall(start, dx, dy, length, surfaces.walls[k])
            else:
                blocked = _crosses_post(start, dx, dy, length, surfaces.posts[k - surfaces.walls.shape[0]])
            if blocked:
                return False
        if min(walk.next_column, walk.next_row) > length:
            break
        walk = advance(surfaces.cells, walk)
    return True


@inlined
def _crosses_wall(start: FloatArray, dx: float, dy: float, length: float, wall: FloatArray) -> bool:
    ex, ey = wall[2] - wall[0], wall[3] - wall[1]
    across = dx * ey - dy * ex
    if across == 0.0:
        return False
    rx, ry = wall[0] - start[0], wall[1] - start[1]
    ahead = (rx * ey - ry * ex) / across
    along = (rx * dy - ry * dx) / across
    crosses: bool = _LEG_ENDS < ahead < length - _LEG_ENDS and -1e-12 <= along <= 1.0 + 1e-12
    return crosses


@inlined
def _crosses_post(start: FloatArray, dx: float, dy: float, length: float, post: FloatArray) -> bool:
    ahead = (post[0] - start[0]) * dx + (post[1] - start[1]) * dy
    ahead = min(max(ahead, 0.0), length)
    gap = math.hypot(start[0] + ahead * dx - post[0], start[1] + ahead * dy - post[1])
    inside: bool = gap < post[2] - 1e-7
    return inside
