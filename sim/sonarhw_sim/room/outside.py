"""Outside: whether walls go all round a point, wherever along one another they meet.

Takes walls and a point; hands on yes or no. Seen from the point, the direction to a wall's points changes steadily
along it, and where two walls touch, both see the contact in one direction but for whole turns. Where no choice of turns
lets all contacts agree, a way along walls comes back a turn later: it went round the point.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray
from sonarhw_sim.room.room_file import MEETING

_MOST_WALLS = 500  # telling takes the square of them


def walls_enclose(walls: FloatArray, point: tuple[float, float]) -> bool:
    """Whether `point` (m) lies on one of the walls (n, 4) or a closed way along them goes round it.

    Of more than 500 walls it is not told: False.
    """
    if not 0 < len(walls) <= _MOST_WALLS:
        return False
    if _distances(np.array([point]), walls).min() <= MEETING:
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
    """Every two walls that touch or cross, (m,) rows each, and a point where they do, (m, 2) m."""
    ends = walls.reshape(-1, 2, 2)
    start, along = ends[:, 0], ends[:, 1] - ends[:, 0]
    found = []
    for end in (0, 1):
        one, other = np.nonzero(_distances(ends[:, end], walls) <= MEETING)
        found.append((one, other, ends[one, end]))
    with np.errstate(divide="ignore", invalid="ignore"):
        share = _cross(start - start[:, None], along) / _cross(along[:, None], along)
        one, other = np.nonzero((share > 0) & (share < 1) & (share.T > 0) & (share.T < 1))
    found.append((one, other, start[one] + share[one, other, None] * along[one]))
    one, other, points = (np.concatenate(column) for column in zip(*found, strict=True))
    return one[one != other], other[one != other], points[one != other]


def _distances(points: FloatArray, walls: FloatArray) -> FloatArray:
    """From each point (p, 2) to each wall (n, 4), (p, n) m."""
    start, along = walls[:, :2], walls[:, 2:] - walls[:, :2]
    share = ((points[:, None] - start) * along).sum(axis=2) / (along**2).sum(axis=1)
    foot = start + np.clip(share, 0.0, 1.0)[:, :, None] * along
    return np.asarray(np.hypot(*(points[:, None] - foot).transpose(2, 0, 1)))


def _cross(one: FloatArray, other: FloatArray) -> FloatArray:
    return np.asarray(one[..., 0] * other[..., 1] - one[..., 1] * other[..., 0])


def _agree(count: int, contacts: Sequence[tuple[int, int, int]]) -> bool:
    """Whether whole turns can be given to `count` walls so that each contact's two differ by what it says."""
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
