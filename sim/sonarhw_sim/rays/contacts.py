"""Where sound touches posts: on the shortest way by walls and posts in turn. Compiled by numba.

Walls are unfolded: among posts mirrored in the walls before them, sound goes straight from post to post. Its way there
is the shortest of those that touch every post from outside, so Newton's method finds it without a ray to begin with.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray
from sonarhw_sim.compiled import array_part, compiled_part, inlined
from sonarhw_sim.room.grid import IntArray

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
        moved = _solve(count, room)
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
def _solve(count: int, room: Unfolded) -> float:
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
