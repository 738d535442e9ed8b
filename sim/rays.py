"""The ray kernel: a fan of rays followed round the room, noting where each comes near the sensor or an edge.

Takes walls, posts and a fan of directions; hands on the surfaces each ray touched and the candidates: "ray r, after its
first b reflections, passes near target t". `sim.sequences` solves every candidate exactly, so nearness may be generous.
Compiled by numba; plain arrays only.
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from sonarhw.readings import FloatArray

IntArray = NDArray[np.int32]

# How near, in ray spacings, a ray must pass to be a candidate. A path midway between two rays is half a spacing from
# both; what lies beyond that finds paths seen through gaps narrower than the spacing.
ALLOWANCE = 1.5
_STANDING = 1e-11  # m


@njit(cache=True)
def first_hit(
    x: float, y: float, dx: float, dy: float, leaving: int, walls: FloatArray, posts: FloatArray
) -> tuple[float, int]:
    """Distance (m) to the first surface along a ray and its number; (inf, -1) where there is none.

    `leaving` is the surface the ray starts from, -1 for none: it is convex or flat, so the ray cannot meet it again.
    """
    nearest, surface = np.inf, -1
    for k in range(walls.shape[0]):
        wall = walls[k]
        ex, ey = wall[2] - wall[0], wall[3] - wall[1]
        across = dx * ey - dy * ex
        if k == leaving or across == 0.0:
            continue
        rx, ry = wall[0] - x, wall[1] - y
        along = (rx * dy - ry * dx) / across
        if along < -1e-12 or along > 1.0 + 1e-12:
            continue
        distance = (rx * ey - ry * ex) / across
        # where the ray stands it has just been: a second wall flush with the one it leaves is not met again
        if _STANDING < distance < nearest:
            nearest, surface = distance, k
    for k in range(posts.shape[0]):
        post = posts[k]
        if walls.shape[0] + k == leaving:
            continue
        distance = post_distance(x, y, dx, dy, post)
        if 0.0 < distance < nearest:
            nearest, surface = distance, walls.shape[0] + k
    return nearest, surface


@njit(cache=True)
def post_distance(x: float, y: float, dx: float, dy: float, post: FloatArray) -> float:
    """Distance (m) along a ray to the near side of a post (x, y, radius); inf where it misses."""
    cx, cy = post[0] - x, post[1] - y
    towards = cx * dx + cy * dy
    aside = cx * dy - cy * dx
    inside = post[2] * post[2] - aside * aside
    if towards <= 0.0 or inside <= 0.0:
        return np.inf
    near_side: float = towards - math.sqrt(inside)
    return near_side


@njit(cache=True)
def reflect(
    x: float, y: float, dx: float, dy: float, surface: int, walls: FloatArray, posts: FloatArray
) -> tuple[float, float, float]:
    """Direction after reflection at (x, y), and by how much a reflected tube opens per metre of its width, 1/m.

    A flat wall opens it by nothing, a post of radius R at incidence i by 2 / (R cos i).
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


@njit(cache=True)
def follow_fan(
    place: FloatArray,
    directions: FloatArray,
    walls: FloatArray,
    posts: FloatArray,
    targets: FloatArray,
    max_length: float,
    max_bounces: int,
) -> tuple[IntArray, IntArray]:
    """Follow every ray until its path is longer than `max_length`.

    `directions` (n,) rad, evenly spaced; `targets` (t, 2): row 0 the sensor, the others edges. Hands on the surfaces
    touched (n, max_bounces) int32, and candidates (c, 3) int32: ray, reflections before the target, row of the target.
    """
    spacing = directions[1] - directions[0]
    touched = np.full((directions.shape[0], max_bounces), -1, np.int32)
    candidates = np.empty((4096, 3), np.int32)
    found = 0
    for ray in range(directions.shape[0]):
        x, y = place[0], place[1]
        dx, dy = math.cos(directions[ray]), math.sin(directions[ray])
        length, width, opening, surface = 0.0, 0.0, 1.0, -1
        for bounces in range(max_bounces + 1):
            # find the next surface
            distance, following = first_hit(x, y, dx, dy, surface, walls, posts)
            reach = min(distance, max_length - length)

            # note every target that this leg passes; the first leg only leaves the sensor
            for target in range(targets.shape[0] if bounces else 0):
                tx, ty = targets[target, 0] - x, targets[target, 1] - y
                ahead = tx * dx + ty * dy
                near = ALLOWANCE * spacing * (width + opening * max(ahead, 0.0))
                if -near <= ahead <= reach + near and abs(tx * dy - ty * dx) <= near:
                    if found == candidates.shape[0]:
                        candidates = np.concatenate((candidates, np.empty_like(candidates)))
                    candidates[found] = ray, bounces, target
                    found += 1

            # stop where the path is long enough or leaves the room
            length += distance
            if length > max_length or bounces == max_bounces:
                break

            # reflect, and let the tube between this ray and the next grow
            x, y = x + distance * dx, y + distance * dy
            width += opening * distance
            dx, dy, curvature = reflect(x, y, dx, dy, following, walls, posts)
            opening += curvature * width
            surface = following
            touched[ray, bounces] = following
    return touched, candidates[:found]


def fan(rays: int) -> FloatArray:
    """Directions of `rays` evenly spaced rays all round, (rays,) float, rad.

    Turned by a fraction of the spacing that no symmetric room has, so that no ray runs straight into a vertex.
    """
    return (np.arange(rays, dtype=np.float64) + (math.sqrt(5) - 1) / 2) * (math.tau / rays)
