"""The same rays followed with NumPy alone, all rays and all walls at once, for comparison of speed."""

import numpy as np
from sonarhw_sim.rays.kernel import ALLOWANCE

from sonarhw.readings import FloatArray


def follow_with_numpy(
    place: FloatArray, directions: FloatArray, walls: FloatArray, max_length: float, max_bounces: int
) -> set[tuple[int, ...]]:
    """Return the walls touched before every arrival near `place` (2,), as in `kernel.follow_fan`."""
    spacing = directions[1] - directions[0]
    along = walls[:, 2:] - walls[:, :2]
    at = np.tile(place, (len(directions), 1))
    heading = np.column_stack((np.cos(directions), np.sin(directions)))
    travelled = np.zeros(len(directions))
    leaving = np.full(len(directions), -1)
    touched = np.full((len(directions), max_bounces + 1), -1)
    arrivals: set[tuple[int, ...]] = set()
    for bounces in range(max_bounces + 1):
        # find the next wall of every ray
        distance, wall = _first_hits(at, heading, leaving, walls, along)
        reach = np.minimum(distance, max_length - travelled)

        # note rays that pass the place
        if bounces:
            ahead = ((place - at) * heading).sum(axis=1)
            aside = np.abs(_cross(place - at, heading))
            near = ALLOWANCE * spacing * (travelled + np.maximum(ahead, 0))
            passes = (-near <= ahead) & (ahead <= reach + near) & (aside <= near)
            arrivals.update(map(tuple, touched[passes & (travelled <= max_length), :bounces].tolist()))

        # reflect
        travelled = travelled + distance
        at = at + np.where(np.isfinite(distance), distance, 0.0)[:, None] * heading
        surface = along[wall]
        scale = 2 * (heading * surface).sum(axis=1) / (surface**2).sum(axis=1)
        heading = scale[:, None] * surface - heading
        leaving, touched[:, bounces] = wall, wall
    return arrivals


def _first_hits(
    at: FloatArray, heading: FloatArray, leaving: FloatArray, walls: FloatArray, along: FloatArray
) -> tuple[FloatArray, FloatArray]:
    across = heading[:, :1] * along[:, 1] - heading[:, 1:] * along[:, 0]
    x, y = walls[:, 0] - at[:, :1], walls[:, 1] - at[:, 1:]
    with np.errstate(divide="ignore", invalid="ignore"):
        share = (x * heading[:, 1:] - y * heading[:, :1]) / across
        distance = (x * along[:, 1] - y * along[:, 0]) / across
    distance[~((share >= 0) & (share <= 1) & (distance > 1e-11))] = np.inf
    rows = np.flatnonzero(leaving >= 0)
    distance[rows, leaving[rows]] = np.inf
    wall = distance.argmin(axis=1)
    return distance[np.arange(len(at)), wall], wall


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
