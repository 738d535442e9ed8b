"""Where sound touches posts on the shortest way by walls and posts in turn, to aim a ray there. Compiled by numba."""

import math

import numpy as np

from sonarhw.readings import FloatArray
from sonarhw_sim.compiled import compiled, compiled_part
from sonarhw_sim.rays.sequences import mirrored
from sonarhw_sim.room.grid import IntArray

_HALVINGS = 34  # of up to half a turn, to 2e-10 rad
_MOST_SWEEPS = 40
_SETTLED = 1e-12  # m


@compiled
def aimed(start: FloatArray, ends: FloatArray, sequences: IntArray, walls: FloatArray, posts: FloatArray) -> FloatArray:
    """Return the directions from `start` (2,) in which the ways by `sequences` (n, b) to `ends` (n, 2) leave, (n,) rad.

    Sequences contain at least one post, and are padded with -1. Walls are endless lines here, and nothing blocks.
    """
    directions, most = np.empty(sequences.shape[0]), sequences.shape[1]
    circles, points = np.empty((most, 3)), np.empty((most + 2, 2))
    for row in range(sequences.shape[0]):
        count = _unfold(sequences[row], ends[row], walls, posts, circles, points)
        points[0, 0], points[0, 1] = start[0], start[1]
        for _ in range(_MOST_SWEEPS):
            moved = 0.0
            for k in range(count):
                moved += _touch(points[k : k + 3], circles[k])
            if count == 1 or moved < _SETTLED:
                break
        directions[row] = math.atan2(points[1, 1] - points[0, 1], points[1, 0] - points[0, 0])
    return directions


@compiled_part
def _unfold(
    sequence: IntArray, end: FloatArray, walls: FloatArray, posts: FloatArray, circles: FloatArray, points: FloatArray
) -> int:
    """Fill in the posts, and their centres and the end as points, mirrored in all walls before; return their number."""
    count, touches = 0, 0
    while touches < sequence.shape[0] and sequence[touches] >= 0:
        surface = sequence[touches]
        if surface >= walls.shape[0]:
            post = posts[surface - walls.shape[0]]
            x, y = _behind(post[0], post[1], sequence[:touches], walls)
            circles[count, 0], circles[count, 1], circles[count, 2] = x, y, post[2]
            points[count + 1, 0], points[count + 1, 1] = x, y
            count += 1
        touches += 1
    points[count + 1, 0], points[count + 1, 1] = _behind(end[0], end[1], sequence[:touches], walls)
    return count


@compiled_part
def _behind(x: float, y: float, before: IntArray, walls: FloatArray) -> tuple[float, float]:
    """Return a point mirrored in the walls of `before`, the last first."""
    for k in range(before.shape[0] - 1, -1, -1):
        if before[k] < walls.shape[0]:
            x, y = mirrored(x, y, walls[before[k]])
    return x, y


@compiled_part
def _touch(points: FloatArray, circle: FloatArray) -> float:
    """Move points[1] to where the way from points[0] by a circle to points[2] is shortest; return by how much (m)."""
    x, y, radius = circle
    # the normal at the contact is between the directions to both points
    fx, fy = _unit(points[0, 0] - x, points[0, 1] - y)
    lx, ly = _unit(points[2, 0] - x, points[2, 1] - y)
    side = 1.0 if fx * ly - fy * lx > 0.0 else -1.0
    nx, ny = fx, fy
    for _ in range(_HALVINGS):
        nx, ny = _unit(fx + lx, fy + ly)
        growth = 0.0
        for k in range(0, 3, 2):
            ax, ay = x + radius * nx - points[k, 0], y + radius * ny - points[k, 1]
            growth += (ay * nx - ax * ny) / math.sqrt(ax * ax + ay * ay)
        if growth * side < 0.0:
            fx, fy = nx, ny
        else:
            lx, ly = nx, ny
    ax, ay = x + radius * nx, y + radius * ny
    moved = math.hypot(ax - points[1, 0], ay - points[1, 1])
    points[1, 0], points[1, 1] = ax, ay
    return moved


@compiled_part
def _unit(x: float, y: float) -> tuple[float, float]:
    length = math.sqrt(x * x + y * y)
    return (x / length, y / length) if length > 0.0 else (1.0, 0.0)
