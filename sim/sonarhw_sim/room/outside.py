"""Test whether walls enclose a point, even if they do not meet at their ends.

Each wall gets the angle from the point to its start; along the wall this angle changes continuously. Where two walls
touch, their angles differ by a whole number of turns. If whole turns can be added to the walls so that all these
differences vanish, nothing encloses the point. Otherwise a closed path along walls turns around it.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray
from sonarhw_sim.room.room_file import MEETING

_MOST_WALLS = 500  # the test takes quadratic time


def walls_enclose(walls: FloatArray, point: tuple[float, float]) -> bool:
    """Return whether `point` (m) is on one of the walls (n, 4), or a closed path along them encloses it.

    With more than 500 walls the result is always False.
    """
    if not 0 < len(walls) <= _MOST_WALLS:
        return False
    if wall_distances(np.array([point]), walls).min() <= MEETING:
        return True
    one, other, contacts = _contacts(walls)
    before = walls[:, :2] - point

    def direction(rows: NDArray[np.intp]) -> FloatArray:
        start, there = before[rows], contacts - point
        turned = np.arctan2(_cross(start, there), (start * there).sum(axis=1))
        return np.asarray(np.arctan2(start[:, 1], start[:, 0]) + turned)

    turns = np.rint((direction(one) - direction(other)) / math.tau).astype(np.intp)
    return not _agree(len(walls), list(zip(one.tolist(), other.tolist(), turns.tolist(), strict=True)))


def _contacts(walls: FloatArray) -> tuple[NDArray[np.intp], NDArray[np.intp], FloatArray]:
    """Return all pairs of walls that touch or cross, (m,) rows each, and their contacts, (m, 2) m."""
    ends = walls.reshape(-1, 2, 2)
    start, along = ends[:, 0], ends[:, 1] - ends[:, 0]
    found = []
    for end in (0, 1):
        one, other = np.nonzero(wall_distances(ends[:, end], walls) <= MEETING)
        found.append((one, other, ends[one, end]))
    with np.errstate(divide="ignore", invalid="ignore"):
        share = _cross(start - start[:, None], along) / _cross(along[:, None], along)
        one, other = np.nonzero((share > 0) & (share < 1) & (share.T > 0) & (share.T < 1))
    found.append((one, other, start[one] + share[one, other, None] * along[one]))
    one, other, points = (np.concatenate(column) for column in zip(*found, strict=True))
    return one[one != other], other[one != other], points[one != other]


def wall_distances(points: FloatArray, walls: FloatArray) -> FloatArray:
    """Return the distance from each point (p, 2) to each wall (n, 4), (p, n) m."""
    start, along = walls[:, :2], walls[:, 2:] - walls[:, :2]
    share = ((points[:, None] - start) * along).sum(axis=2) / (along**2).sum(axis=1)
    foot = start + np.clip(share, 0.0, 1.0)[:, :, None] * along
    return np.asarray(np.hypot(*(points[:, None] - foot).transpose(2, 0, 1)))


def _cross(one: FloatArray, other: FloatArray) -> FloatArray:
    return np.asarray(one[..., 0] * other[..., 1] - one[..., 1] * other[..., 0])


def _agree(count: int, contacts: Sequence[tuple[int, int, int]]) -> bool:
    """Return whether `count` walls can be given whole turns that differ at each contact by its number of turns."""
    neighbours: list[list[tuple[int, int]]] = [[] for _ in range(count)]
    for one, other, turns in contacts:
        neighbours[one].append((other, turns))
        neighbours[other].append((one, -turns))
    given: dict[int, int] = {}
    for first in range(count):
        waiting = [] if first in given else [first]
        given.setdefault(first, 0)
        while waiting:
            one = waiting.pop()
            for other, turns in neighbours[one]:
                if other not in given:
                    given[other] = given[one] + turns
                    waiting.append(other)
                elif given[other] != given[one] + turns:
                    return False
    return True
