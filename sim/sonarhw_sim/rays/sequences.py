"""Exact solution of sequences of surfaces: the path that touches exactly these, in this order, if it exists."""

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray
from sonarhw_sim.compiled import array_part, compiled, compiled_part, inlined, rows_in_parts
from sonarhw_sim.rays.fan import Fan, PathTable, Targets, check_size, fill_rows
from sonarhw_sim.rays.passing import Climbs, Passing, fits_a_climb, room_for_fitting
from sonarhw_sim.room.grid import IntArray, Surfaces, advance, enter, listed
from sonarhw_sim.room.room import Room

# Where sound touches posts: on the shortest way by walls and posts in turn. Compiled by numba.
#
# Walls are unfolded: among posts mirrored in the walls before them, sound goes straight from post to post. Its way
# there is the shortest of those that touch every post from outside, so Newton's method finds it without a ray to
# begin with.


ComplexArray = NDArray[np.complex128]

_MOST_STEPS = 64
_LARGEST_TURN = 0.3  # rad, of a normal in one step
_SMALLEST_SHARE = 0.01  # of a step that makes the way longer
_SETTLED = 1e-10  # m: after a smaller step, the error is that of rounding


class Unfolded(NamedTuple):
    """Room for the posts of a sequence, one row each; row 0 is the start of the way, the one after the posts its end.

    The point z of the plane, as a complex number, is mirrored to `turns` z plus a shift, or so is its conjugate.
    """

    circles: FloatArray  # (p, 3), m: centre and radius of each post, mirrored in all walls before
    turns: ComplexArray  # (p,)
    conjugated: NDArray[np.bool_]  # (p,)
    normals: FloatArray  # (p, 2): from the centre to the point that sound touches
    earlier: FloatArray  # (p, 2): the normals before the last step
    angles: FloatArray  # (p,), rad: by which that step turns them
    cosines: FloatArray  # (p,): of the incidence
    system: FloatArray  # (p, 3): equations for a step: diagonal, right-hand side, the element before the diagonal


@array_part
def room_for_posts(points: int) -> Unfolded:
    """Return room for the posts of paths with up to so many points."""
    circles, system = np.empty((points, 3)), np.empty((points, 3))
    normals, earlier = np.empty((points, 2)), np.empty((points, 2))
    turns, conjugated = np.empty(points, np.complex128), np.empty(points, np.bool_)
    return Unfolded(circles, turns, conjugated, normals, earlier, np.empty(points), np.empty(points), system)


@array_part
def mirrors_of(walls: FloatArray) -> ComplexArray:
    """Return the factors a and b of each wall (n, 4), whose mirror image of z is a times conjugate z plus b, (n, 2)."""
    mirrors = np.empty((walls.shape[0], 2), np.complex128)
    for k in range(walls.shape[0]):
        begin, along = complex(walls[k, 0], walls[k, 1]), complex(walls[k, 2], walls[k, 3])
        along -= begin
        mirrors[k, 0] = along * along / (along.real * along.real + along.imag * along.imag)
        mirrors[k, 1] = begin - mirrors[k, 0] * begin.conjugate()
    return mirrors


@compiled_part
def touch_posts(
    path: FloatArray, sequence: IntArray, mirrors: ComplexArray, posts: FloatArray, longest: float, room: Unfolded
) -> tuple[bool, float]:
    """Fill in the points of a path on posts; return whether there is one up to `longest` (m), and its divergence.

    Walls are endless lines here, and nothing blocks.
    """
    count = _unfold(path, sequence, mirrors, posts, room)
    if _least_length(count, room.circles) > longest or not _find_touches(count, room):
        return False, 1.0
    width, length = _tube(count, room)
    if length > longest:
        return False, 1.0
    row = 0
    for k in range(sequence.shape[0]):
        if sequence[k] >= mirrors.shape[0]:
            row += 1
            # from the mirrored post back to the post
            normal = room.turns[row].conjugate() * complex(room.normals[row, 0], room.normals[row, 1])
            if room.conjugated[row]:
                normal = normal.conjugate()
            post = posts[sequence[k] - mirrors.shape[0]]
            path[k + 1, 0], path[k + 1, 1] = post[0] + post[2] * normal.real, post[1] + post[2] * normal.imag
    return True, width / length


@inlined
def _unfold(path: FloatArray, sequence: IntArray, mirrors: ComplexArray, posts: FloatArray, room: Unfolded) -> int:
    """Fill in the mirrored posts of a sequence, and both ends of the path; return the number of posts."""
    row, last = 0, sequence.shape[0]
    turn, shift, conjugated = complex(1.0, 0.0), complex(0.0, 0.0), False
    room.circles[0, 0], room.circles[0, 1], room.circles[0, 2] = path[0, 0], path[0, 1], 0.0
    for k in range(last + 1):
        if k < last and sequence[k] < mirrors.shape[0]:
            factor, more = mirrors[sequence[k], 0], mirrors[sequence[k], 1]
            if conjugated:
                factor, more = factor.conjugate(), more.conjugate()
            turn, shift, conjugated = turn * factor, turn * more + shift, not conjugated
            continue
        x, y, radius = path[last + 1, 0], path[last + 1, 1], 0.0
        if k < last:
            post = posts[sequence[k] - mirrors.shape[0]]
            x, y, radius = post[0], post[1], post[2]
        image = turn * complex(x, -y if conjugated else y) + shift
        row += 1
        room.circles[row, 0], room.circles[row, 1], room.circles[row, 2] = image.real, image.imag, radius
        room.turns[row], room.conjugated[row] = turn, conjugated
    return row - 1


@inlined
def _least_length(count: int, circles: FloatArray) -> float:
    """Return a length that no way by so many posts falls below, m."""
    least = 0.0
    for k in range(count + 1):
        dx, dy = circles[k + 1, 0] - circles[k, 0], circles[k + 1, 1] - circles[k, 1]
        least += math.sqrt(dx * dx + dy * dy) - 2.0 * circles[k, 2]
    return least


@inlined
def _find_touches(count: int, room: Unfolded) -> bool:
    """Turn the normals to where sound touches the posts; return whether there is a way that touches all."""
    if count == 1:
        return _face_ends(room.circles, room.normals) and _settle(1, room)
    # a post nearly on the straight line between its neighbours may be touched on the other side: begin there, too
    for other in range(count + 1):
        _face_neighbours(count, other, room.circles, room.normals)
        if _settle(count, room):
            return True
    return False


@inlined
def _face_ends(circles: FloatArray, normals: FloatArray) -> bool:
    """Turn the normal of a single post to the straight line between both ends; return whether the post is beside it."""
    dx, dy = circles[2, 0] - circles[0, 0], circles[2, 1] - circles[0, 1]
    cx, cy = circles[1, 0] - circles[0, 0], circles[1, 1] - circles[0, 1]
    share = min(max((cx * dx + cy * dy) / max(dx * dx + dy * dy, 1e-300), 0.0), 1.0)
    ax, ay = share * dx - cx, share * dy - cy
    aside = math.sqrt(ax * ax + ay * ay)
    normals[1, 0], normals[1, 1] = ax / aside, ay / aside
    beside: bool = aside > circles[1, 2]
    return beside


@inlined
def _face_neighbours(count: int, other: int, circles: FloatArray, normals: FloatArray) -> None:
    """Turn each normal between the directions to the circles before and behind, that of post `other` away from them."""
    dx, dy = _unit(circles[1, 0] - circles[0, 0], circles[1, 1] - circles[0, 1])
    for k in range(1, count + 1):
        next_x, next_y = _unit(circles[k + 1, 0] - circles[k, 0], circles[k + 1, 1] - circles[k, 1])
        side = -1.0 if k == other else 1.0
        normals[k, 0], normals[k, 1] = _unit(side * (next_x - dx), side * (next_y - dy))
        dx, dy = next_x, next_y


@compiled_part
def _settle(count: int, room: Unfolded) -> bool:
    """Turn the normals until the way is the shortest; return whether it touches all posts from outside."""
    shortest, share = np.inf, 1.0
    for _ in range(_MOST_STEPS):
        outside, length = _measure(count, room)
        if length > shortest + _SETTLED and share > _SMALLEST_SHARE:
            share /= 2.0
            _turn(count, share, room)
            continue
        shortest, share = length, 1.0
        moved = _solve_contacts(count, room)
        _turn(count, 1.0, room)
        if moved < _SETTLED:
            return outside
    return False


@inlined
def _measure(count: int, room: Unfolded) -> tuple[bool, float]:
    """Fill in the system of equations, from the first and second derivatives of the length of the way.

    The unknowns are steps along the posts, m. Returns whether the way touches all posts from outside, and its length.
    """
    circles, normals, cosines, system = room.circles, room.normals, room.cosines, room.system
    x, y, length, outside = circles[0, 0], circles[0, 1], 0.0, True
    nx, ny, next_nx, next_ny = 0.0, 0.0, 0.0, 0.0
    for k in range(count + 1):
        if k < count:
            next_nx, next_ny = normals[k + 1, 0], normals[k + 1, 1]
        next_x, next_y = (
            circles[k + 1, 0] + circles[k + 1, 2] * next_nx,
            circles[k + 1, 1] + circles[k + 1, 2] * next_ny,
        )
        dx, dy = next_x - x, next_y - y
        distance = math.sqrt(dx * dx + dy * dy)
        near = 1.0 / distance
        dx, dy, length = dx * near, dy * near, length + distance
        leaving, arriving = nx * dx + ny * dy, -next_nx * dx - next_ny * dy
        if k > 0:
            # not negative, so that a step makes the way shorter
            bend = abs(cosines[k] + leaving) / circles[k, 2]
            system[k, 0] += leaving * leaving * near + bend
            system[k, 1] += nx * dy - ny * dx
            outside &= leaving > 0.0
        if k < count:
            system[k + 1, 0], system[k + 1, 2] = arriving * arriving * near, arriving * leaving * near
            system[k + 1, 1] = next_ny * dx - next_nx * dy
            cosines[k + 1] = arriving
            outside &= arriving > 0.0
        x, y, nx, ny = next_x, next_y, next_nx, next_ny
    return outside, length


@inlined
def _solve_contacts(count: int, room: Unfolded) -> float:
    """Solve the system of equations for the angles of a step; return the longest way along a post, m."""
    system = room.system
    for k in range(2, count + 1):
        factor = system[k, 2] / system[k - 1, 0]
        system[k, 0] -= factor * system[k, 2]
        system[k, 1] -= factor * system[k - 1, 1]
    moved, step = 0.0, 0.0
    for k in range(count, 0, -1):
        step = (system[k, 1] - (system[k + 1, 2] * step if k < count else 0.0)) / system[k, 0]
        moved = max(moved, abs(step))
        room.angles[k] = min(max(step / room.circles[k, 2], -_LARGEST_TURN), _LARGEST_TURN)
        room.earlier[k, 0], room.earlier[k, 1] = room.normals[k, 0], room.normals[k, 1]
    return moved


@compiled_part
def _turn(count: int, share: float, room: Unfolded) -> None:
    """Turn the normals from the earlier ones by a share of the angles."""
    for k in range(1, count + 1):
        turn, nx, ny = share * room.angles[k], room.earlier[k, 0], room.earlier[k, 1]
        room.normals[k, 0], room.normals[k, 1] = _unit(nx - turn * ny, ny + turn * nx)


@compiled_part
def _tube(count: int, room: Unfolded) -> tuple[float, float]:
    """Return the width of the tube of a ray at the end of its way, m per radian of departure, and its length, m."""
    x, y = room.circles[0, 0], room.circles[0, 1]
    length, width, opening = 0.0, 0.0, 1.0
    for k in range(1, count + 2):
        next_x, next_y, radius = room.circles[k]
        if k <= count:
            next_x, next_y = next_x + radius * room.normals[k, 0], next_y + radius * room.normals[k, 1]
        distance = math.sqrt((next_x - x) * (next_x - x) + (next_y - y) * (next_y - y))
        length, width = length + distance, width + opening * distance
        if k <= count:
            opening += 2.0 / (radius * room.cosines[k]) * width
        x, y = next_x, next_y
    return width, length


@compiled_part
def _unit(x: float, y: float) -> tuple[float, float]:
    size = max(math.sqrt(x * x + y * y), 1e-300)
    return x / size, y / size


# Exact solution of a sequence of surfaces: the path that touches exactly these, in this order, if it exists.
#
# Walls are solved with image sources. With a post in the sequence there is no finite image, so Newton's method finds
# the points on posts first (`rays.contacts`). A path is valid if every reflection point is on its surface and no leg
# is blocked. Compiled by numba.


BoolArray = NDArray[np.bool_]

ON_WALL = 1e-9  # m: a wall may be touched this far beyond its end; a vertex is on both its walls
_LEAST_PART = 500  # candidates: fewer take about as long as a thread needs to begin
_LEG_ENDS = 1e-8  # m: a surface that touches a leg this near to its end is the one on which it starts or ends


def _no_climbs(surfaces: Surfaces) -> Climbs:
    """Return the climbs with which heights are not tested."""
    return Climbs(np.empty(0), np.empty(0, np.bool_), surfaces, np.empty((0, 2)), 0.0, 0.0, 0.0, 0.0)


def solve_candidates(
    sources: FloatArray,
    fan: Fan,
    targets: Targets,
    surfaces: Surfaces,
    to_receiver: Climbs | None = None,
    beyond_ends: float = ON_WALL,
) -> tuple[BoolArray, FloatArray, FloatArray, FloatArray]:
    """Solve the candidates of a fan (c, 3); those to receivers only if one of the climbs `to_receiver` is possible.

    `targets` are those of each of `sources` (n, 2) in turn, as many for each. A path may touch a wall up to
    `beyond_ends` m beyond its end.

    Returns whether each is a valid path not longer than allowed to its target, (c,) bool, and for each of the r valid
    ones: its points from the source to the target, (r, b + 3, 2) m, padded with NaN, for up to b reflections;
    its length (r,) m; its divergence (r,), the width of its ray tube over its length, 1 without posts.
    """
    most = int(fan.candidates[:, 1].max(initial=0))
    climbs = to_receiver or _no_climbs(surfaces)

    def solved(begin: int, end: int) -> tuple[BoolArray, FloatArray, FloatArray, FloatArray]:
        # most candidates are no paths, and the system gives memory only to rows that are filled
        count = end - begin
        real, points = np.zeros(count, dtype=np.bool_), np.empty((count, most + 3, 2))
        lengths, divergences = np.empty(count), np.empty(count)
        total = _solve(
            sources,
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
        return real, points[:total], lengths[:total], divergences[:total]

    real, points, lengths, divergences = rows_in_parts(solved, len(fan.candidates), _LEAST_PART)
    return real, points, lengths, divergences


@compiled
def _solve(
    sources: FloatArray,
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
    count, width, each = 0, points.shape[1], targets.shape[0] // sources.shape[0]
    mirrors, unfolded = mirrors_of(walls), room_for_posts(width)
    images, room = np.empty((width, 2)), room_for_fitting(width, to_receiver)
    for c in range(candidates.shape[0]):
        ray, bounces, target = candidates[c]
        sequence = touched[ray, :bounces]
        path = points[count, : bounces + 2]
        path[0, 0], path[0, 1] = sources[target // each, 0], sources[target // each, 1]
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
        if target % each == 0 and not fits_a_climb(path, sequence, bounces, length, to_receiver, room):
            continue
        if not path_is_free(path, surfaces):
            continue
        for k in range(bounces + 2, width):
            points[count, k, 0], points[count, k, 1] = np.nan, np.nan
        real[c], lengths[count], divergences[count] = True, length, divergence
        count += 1
    return count


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


# Paths from a place to the receiver or to an edge, each solved exactly, without duplicates.


NEARLY = 1e-9  # m: lengths that differ less, by rounding, are equal
_SAME = 1e-7  # m and rad: paths that differ less in length, departure and arrival are the same path


@dataclass(frozen=True)
class PartialPaths(PathTable):
    """Paths from a place to the receiver or to an edge, or, diffracted, past an edge to the receiver."""

    gains: FloatArray  # (n,)
    phases: FloatArray  # (n,), rad
    surfaces: IntArray  # (n, b)
    edges: IntArray  # (n,): the edge that the path leads to or past; -1: none
    bends: IntArray  # (n,)
    points: FloatArray  # (n, b + 3, 2)
    places: IntArray  # (n,): row of the place where the path begins

    @staticmethod
    def none() -> "PartialPaths":
        """Return an empty table."""
        no = np.empty(0)
        whole = no.astype(np.int32)
        return PartialPaths(no, no, no, np.empty((0, 0), np.int32), whole, whole, np.empty((0, 3, 2)), whole)


FEWEST_POINTS = 3  # of two ways that meet


def surfaces_and_points(
    out: PartialPaths, back: PartialPaths, first: NDArray[np.intp], second: NDArray[np.intp]
) -> tuple[IntArray, FloatArray]:
    """Return surfaces (m, b) and points (m, p, 2) of rows `first` of `out`, each joined to a reversed row of `back`.

    Both lead to the same point. Raises InputError if the tables need too much memory.
    """
    before, after = out.bends[first], back.bends[second]
    most = int((before + after).max(initial=0))
    check_size(len(first), most + FEWEST_POINTS)
    surfaces = np.empty((len(first), most), np.int32)
    points = np.empty((len(first), most + FEWEST_POINTS, 2))
    fill_rows(surfaces, out.surfaces, first, before, back.surfaces, second, after)
    fill_rows(points, out.points, first, before + 2, back.points, second, after + 1)
    return surfaces, points


def solved_paths(
    room: Room,
    places: FloatArray,
    fan: Fan,
    targets: Targets,
    leads_to: IntArray,
    passing: Passing | None,
    passed_below: float = 0.0,
) -> PartialPaths:
    """Return those candidates of the fans from `places` (n, 2) that are real paths.

    `leads_to` (t,) is the edge at each target or -1.

    In the plan, posts of a radius under `passed_below` m block no path.
    """
    blocking = room.blocking(passed_below) if passing is None else passing.blocking
    # the height of a path to an edge is not known yet
    climbs = passing.to_receiver if passing is not None and leads_to[0] < 0 else None
    real, points, lengths, divergences = solve_candidates(places, fan, targets, blocking, climbs)
    # contiguous also if there are several: numba would compile both layouts
    ray, bounces, target = np.ascontiguousarray(fan.candidates[real].T)
    most = points.shape[1] - 3
    surfaces, gains = np.empty((len(ray), most), np.int32), np.empty(len(ray))
    _fill_touched(fan.touched, ray, bounces, room.reflectances, surfaces, gains)
    gains /= np.sqrt(divergences)
    bends = bounces.astype(np.int32)
    begins = (target // (len(targets.points) // len(places))).astype(np.int32)
    paths = PartialPaths(lengths, gains, np.zeros(len(gains)), surfaces, leads_to[target], bends, points, begins)
    return paths if (gains > 0).all() else paths.select(np.flatnonzero(gains > 0))


@compiled
def _fill_touched(
    touched: IntArray,
    rays: IntArray,
    bounces: IntArray,
    reflectances: FloatArray,
    surfaces: IntArray,
    gains: FloatArray,
) -> None:
    """Fill in the surfaces (n, b) of paths, padded with -1, and the products of their reflectances (n,)."""
    for row in range(surfaces.shape[0]):
        gain = 1.0
        for k in range(bounces[row]):
            surfaces[row, k] = touched[rays[row], k]
            gain *= reflectances[surfaces[row, k]]
        surfaces[row, bounces[row] :] = -1
        gains[row] = gain


def shortest_first(paths: PartialPaths) -> PartialPaths:
    """Sort the paths of each place by length and drop duplicates.

    These are paths with equal points: through a vertex, several sequences describe one path.
    """
    order = _in_order(paths)
    kinds = paths.places.astype(np.int64) * (int(paths.edges.max(initial=0)) + 2) + paths.edges
    return paths.select(order[first_of_kind(paths.lengths, kinds, paths.points, order)])


def sequences_once(paths: PartialPaths, both_ways: bool) -> PartialPaths:
    """Sort paths by length and drop those with the surfaces of another one.

    With `both_ways`, paths between one place and itself are listed in the reverse direction, too.
    """
    paths = paths.select(first_of_equal(_sequences(paths)))
    if both_ways:
        paths = PartialPaths.join([paths, missing_reverses(paths)])
    return paths.select(_in_order(paths))


def missing_reverses(paths: PartialPaths) -> PartialPaths:
    """Return the reverses of paths between one place and itself that have the surfaces of none of these paths."""
    count = (paths.surfaces >= 0).sum(axis=1)
    back = np.column_stack((paths.places, paths.edges, _bends_back(paths, count), _turned(paths.surfaces, count)))
    # most reverses are known
    missing = np.flatnonzero(~np.isin(hashes_of(back), hashes_of(_sequences(paths))))
    return _reversed(paths.select(missing))


def _sequences(paths: PartialPaths) -> IntArray:
    """Return what distinguishes each path from the others: its place, edges, bends and surfaces, (p, k)."""
    return np.column_stack((paths.places, paths.edges, paths.bends, paths.surfaces))


def first_of_equal(table: IntArray) -> NDArray[np.intp]:
    """Return the first of each set of equal rows (n, k), in order."""
    hashes = hashes_of(table)
    order = np.argsort(hashes, kind="stable")
    near = np.flatnonzero(np.diff(hashes[order]) == 0)
    repeated = near[(table[order[near]] == table[order[near + 1]]).all(axis=1)] + 1
    return np.sort(np.delete(order, repeated))


def hashes_of(table: IntArray) -> NDArray[np.int64]:
    """Return a hash of each row (n, k): to sort whole rows takes longer than all else."""
    hashes = np.empty(len(table), np.int64)
    _fill_hashes(table, _weights(table.shape[1]), hashes)
    return hashes


@compiled
def _fill_hashes(table: IntArray, weights: NDArray[np.int64], hashes: NDArray[np.int64]) -> None:
    for row in range(table.shape[0]):
        hashes[row] = 0
        for k in range(table.shape[1]):
            hashes[row] += table[row, k] * weights[k]


@lru_cache(maxsize=128)
def _weights(columns: int) -> NDArray[np.int64]:
    """Return the weight of each column in a hash, (columns,)."""
    return np.random.default_rng(0).integers(1, 2**62, columns)


def _reversed(paths: PartialPaths) -> PartialPaths:
    """Return paths between one place and itself in the reverse direction."""
    count = (paths.surfaces >= 0).sum(axis=1)
    points = np.isfinite(paths.points[:, :, 0]).sum(axis=1)
    return replace(
        paths,
        surfaces=_turned(paths.surfaces, count),
        bends=_bends_back(paths, count),
        points=_turned(paths.points, points),
    )


def _bends_back(paths: PartialPaths, count: NDArray[np.intp]) -> IntArray:
    """Return `bends` of the reversed paths, which have `count` (n,) surfaces."""
    return np.asarray(count - np.where(paths.edges < 0, 0, paths.bends), dtype=np.int32)


def _turned(table: NDArray[Any], count: NDArray[np.intp]) -> NDArray[Any]:
    """Return a table with the first `count` (n,) columns of each row in reverse order."""
    turned, rows = np.empty_like(table), np.arange(len(table))
    fill_rows(turned, table, rows, 0 * count, table, rows, count)
    return turned


def _in_order(paths: PartialPaths) -> NDArray[np.intp]:
    """Return the rows by place and length, and those of equal length as in the room file."""
    order = np.lexsort((paths.lengths, paths.places))
    _sort_equals(order, paths.lengths[order], paths.places[order], paths.edges, paths.surfaces)
    return order


@compiled
def _sort_equals(
    order: NDArray[np.intp], lengths: FloatArray, places: IntArray, edges: IntArray, surfaces: IntArray
) -> None:
    """Sort each run of rows of nearly equal `lengths` (n,) m in `order` (n,) by edge, then by surfaces; stable.

    `places` (n,) are those of the rows; a run is of one place.
    """
    begin = 0
    for k in range(1, order.shape[0]):
        if lengths[k] - lengths[k - 1] > NEARLY or places[k] != places[k - 1]:
            begin = k
        row, position = order[k], k
        while position > begin and _comes_before(row, order[position - 1], edges, surfaces):
            order[position] = order[position - 1]
            position -= 1
        order[position] = row


@inlined
def _comes_before(row: int, other: int, edges: IntArray, surfaces: IntArray) -> bool:
    """Return whether the edge and the surfaces of row `row` come before those of the other."""
    if edges[row] != edges[other]:
        return bool(edges[row] < edges[other])
    for k in range(surfaces.shape[1]):
        if surfaces[row, k] != surfaces[other, k]:
            return bool(surfaces[row, k] < surfaces[other, k])
    return False


def first_of_kind(
    lengths: FloatArray,
    kinds: NDArray[np.integer],
    points: FloatArray,
    order: NDArray[np.intp] | None = None,
    rows: NDArray[np.intp] | None = None,
) -> NDArray[np.bool_]:
    """Return which paths have no earlier one of equal length, departure, arrival and kind, in this order, (n,).

    `kinds` (n,) are their edges, or numbers that distinguish more. `lengths` (p,) m and `points` (p, b, 2) m, padded
    with NaN, belong to `rows` (n,) of these tables, by default to all in turn. Without an `order` (n,), paths are in
    order of length.
    """
    each, kept = np.arange(len(kinds)), np.ones(len(kinds), dtype=np.bool_)
    order, rows = (each if chosen is None else chosen for chosen in (order, rows))
    _drop_repeated(order, rows, lengths, kinds.astype(np.int64), points, kept)
    return kept


def last_points(points: FloatArray) -> NDArray[np.intp]:
    """Return the number of the last point of each path (n, p, 2), padded with NaN, (n,)."""
    last = np.empty(len(points), dtype=np.intp)
    _find_last(points, last)
    return last


@compiled
def _find_last(points: FloatArray, last: NDArray[np.intp]) -> None:
    for row in range(points.shape[0]):
        last[row] = _last(points[row])


@compiled
def _drop_repeated(
    order: NDArray[np.intp],
    rows: NDArray[np.intp],
    lengths: FloatArray,
    kinds: NDArray[np.int64],
    points: FloatArray,
    kept: NDArray[np.bool_],
) -> None:
    """Set `kept` (n,) to False where the path is equal to an earlier one in `order` (n,) that is kept."""
    for k in range(order.shape[0]):
        path, before = order[k], k - 1
        row = rows[path]
        # at the next place, lengths begin anew
        while before >= 0 and abs(lengths[row] - lengths[rows[order[before]]]) <= _SAME:
            other = order[before]
            if kept[before] and kinds[path] == kinds[other] and _ends_alike(points[row], points[rows[other]]):
                kept[k] = False
                break
            before -= 1


@compiled_part
def _ends_alike(path: FloatArray, other: FloatArray) -> bool:
    """Return whether the first and the last legs of two paths (p, 2) have the same directions."""
    last = _last(path) - 1, _last(other) - 1
    return _are_parallel(path, 0, other, 0) and _are_parallel(path, last[0], other, last[1])


@compiled_part
def _last(path: FloatArray) -> int:
    """Return the number of the last point of a path (p, 2), padded with NaN."""
    k = path.shape[0] - 1
    while k > 0 and math.isnan(path[k, 0]):
        k -= 1
    return int(k)


@compiled_part
def _are_parallel(path: FloatArray, leg: int, other: FloatArray, other_leg: int) -> bool:
    """Return whether a leg of one path and a leg of another one have the same direction."""
    x, y = path[leg + 1, 0] - path[leg, 0], path[leg + 1, 1] - path[leg, 1]
    other_x = other[other_leg + 1, 0] - other[other_leg, 0]
    other_y = other[other_leg + 1, 1] - other[other_leg, 1]
    both = math.hypot(x, y) * math.hypot(other_x, other_y)
    alike: bool = abs(x * other_y - y * other_x) <= _SAME * both and x * other_x + y * other_y >= 0.0
    return alike
