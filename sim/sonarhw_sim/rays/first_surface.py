"""The first surface that a ray meets, and the ray's direction after its reflection there. Compiled by numba."""

import math

import numpy as np

from sonarhw.readings import FloatArray
from sonarhw_sim.compiled import compiled, compiled_part
from sonarhw_sim.room.grid import Cells, IntArray, Surfaces, advance, enter

_AT_START = 1e-11  # m


@compiled
def first_hit(x: float, y: float, dx: float, dy: float, leaving: int, surfaces: Surfaces) -> tuple[float, int]:
    """Return the distance (m) to the first surface along a ray and its number; (inf, -1) if there is none.

    `leaving` is the surface on which the ray starts, or -1. It is convex or flat, so the ray cannot meet it again.
    """
    walls, posts, cells, (starts, numbers) = surfaces
    # int(): a constant -1 has a type of its own, for which `first_among` would be compiled once more
    return first_among(x, y, dx, dy, int(leaving), walls, posts, cells, starts, numbers)


@compiled_part
def first_among(
    x: float,
    y: float,
    dx: float,
    dy: float,
    leaving: int,
    walls: FloatArray,
    posts: FloatArray,
    cells: Cells,
    starts: IntArray,
    numbers: IntArray,
) -> tuple[float, int]:
    """Return the same as `first_hit`. In inner loops, unpacking a tuple of arrays costs as much as testing a wall."""
    nearest, surface = np.inf, -1
    walk = enter(cells, x, y, dx, dy)
    while walk.inside:
        cell = walk.row * cells.columns + walk.column
        for i in range(starts[cell], starts[cell + 1]):
            k = numbers[i]
            if k != leaving:
                distance = distance_to(x, y, dx, dy, k, walls, posts)
                if distance < nearest:
                    nearest, surface = distance, k
        if nearest <= min(walk.next_column, walk.next_row):
            break
        walk = advance(cells, walk)
    return nearest, surface


@compiled
def distance_to(x: float, y: float, dx: float, dy: float, surface: int, walls: FloatArray, posts: FloatArray) -> float:
    """Return the distance (m) along a ray to a surface; inf if the ray misses it."""
    if surface >= walls.shape[0]:
        near_side = post_distance(x, y, dx, dy, posts[surface - walls.shape[0]])
        return near_side if near_side > 0.0 else np.inf
    ex, ey = walls[surface, 2] - walls[surface, 0], walls[surface, 3] - walls[surface, 1]
    rx, ry = walls[surface, 0] - x, walls[surface, 1] - y
    across = dx * ey - dy * ex
    side = 1.0 if across > 0.0 else -1.0
    along, ahead, across = side * (rx * dy - ry * dx), side * (rx * ey - ry * ex), side * across
    # a second wall flush with the one on which the ray starts is not met
    if (along < -1e-12 * across) | (along > (1.0 + 1e-12) * across) | (ahead <= _AT_START * across):
        return np.inf
    distance: float = ahead / across
    return distance


@compiled_part
def post_distance(x: float, y: float, dx: float, dy: float, post: FloatArray) -> float:
    """Return the distance (m) along a ray to the near side of a post (x, y, radius); inf if the ray misses it."""
    cx, cy = post[0] - x, post[1] - y
    towards = cx * dx + cy * dy
    aside = cx * dy - cy * dx
    inside = post[2] * post[2] - aside * aside
    if towards <= 0.0 or inside <= 0.0:
        return np.inf
    near_side: float = towards - math.sqrt(inside)
    return near_side


@compiled_part
def reflect(
    x: float, y: float, dx: float, dy: float, surface: int, walls: FloatArray, posts: FloatArray
) -> tuple[float, float, float]:
    """Return the direction after reflection at (x, y), and the opening of the tube per metre of its width, 1/m.

    The opening is 0 for a flat wall and 2 / (R cos i) for a post of radius R at incidence i.
    """
    n = walls.shape[0]
    if surface < n:
        wall = walls[surface]
        ex, ey = wall[2] - wall[0], wall[3] - wall[1]
        scale = 2.0 * (dx * ex + dy * ey) / (ex * ex + ey * ey)
        return scale * ex - dx, scale * ey - dy, 0.0
    post = posts[surface - n]
    nx, ny = (x - post[0]) / post[2], (y - post[1]) / post[2]
    inward = dx * nx + dy * ny
    return dx - 2.0 * inward * nx, dy - 2.0 * inward * ny, 2.0 / (post[2] * max(-inward, 1e-9))


@compiled
def distances_ahead(points: FloatArray, headings: FloatArray, surfaces: Surfaces) -> FloatArray:
    """Return the distance from `points` (n, 2) along `headings` (n,) rad to the first surface, or inf, (n,) m."""
    distances = np.empty(headings.shape[0])
    for k in range(headings.shape[0]):
        x, y = math.cos(headings[k]), math.sin(headings[k])
        distances[k] = first_hit(points[k, 0], points[k, 1], x, y, -1, surfaces)[0]
    return distances
