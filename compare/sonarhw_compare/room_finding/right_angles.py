"""A prior of wall directions: most walls of a room are parallel or at right angles to one of them.

A share of the walls is at right angles to a common wall, with a small spread. The others have any direction. A wall
that the scans determine keeps its direction; one that they hardly determine gets the direction of the others. The
walls of a known room, to which a draft adds some, do not count: what is put into a room can have any direction.
"""

import math
from collections.abc import Iterator

import numpy as np

from sonarhw.readings import FloatArray
from sonarhw_compare.room_finding.draft import RoomDraft

SPREAD = math.radians(1)  # standard deviation of the walls at right angles
SHARE = 0.8  # of the walls of a room that are at right angles
_ANY = 2 / math.pi  # density of the direction of the others, per radian


def log_prior(draft: RoomDraft) -> float:
    """Return the logarithm of the prior of the directions of a draft's walls; 0 if all are at right angles."""
    away = _away(draft)
    return float(_logarithms(away).sum(axis=1).max()) if len(away) else 0.0


def common_angle(draft: RoomDraft) -> float | None:
    """Return the angle of the common wall, rad; None without walls."""
    walls = list(draft.walls.values())
    return walls[_common(_away(draft))].angle if walls else None


def at_right_angles(draft: RoomDraft) -> int:
    """Return the number of walls that are parallel or at right angles to the common wall, with it, within 3°."""
    return len(draft.walls) - len(oblique(draft))


def oblique(draft: RoomDraft) -> list[int]:
    """Return the keys of the walls that are not within 3° of right angles to the common wall."""
    away = _away(draft)
    if not len(away):
        return []
    return [key for key, turned in zip(draft.walls, away[_common(away)], strict=True) if abs(turned) >= 3 * SPREAD]


def pulls(draft: RoomDraft) -> Iterator[tuple[int, int, float, float]]:
    """Yield wall, common wall, angle (rad) by which the first is away from right angles, and the weight of this error.

    The weight is the probability that the wall is at right angles at all, over the variance.
    """
    away, keys = _away(draft), list(draft.walls)
    if len(keys) < 2:
        return
    common = _common(away)
    near = _core(away[common])
    weights = near / (near + (1 - SHARE) * _ANY) / SPREAD**2
    for row, key in enumerate(keys):
        if row != common:
            yield key, keys[common], float(away[common, row]), float(weights[row])


def _away(draft: RoomDraft) -> FloatArray:
    """Return the angle by which each wall (columns) is away from right angles to each one (rows), rad."""
    angles = np.array([wall.angle for wall in draft.walls.values()])
    quarter = math.pi / 2
    return np.asarray(np.remainder(angles - angles[:, None] + quarter / 2, quarter) - quarter / 2)


def _common(away: FloatArray) -> int:
    """Return the row of the wall that makes the directions of all walls most probable."""
    return int(_logarithms(away).sum(axis=1).argmax())


def _core(away: FloatArray) -> FloatArray:
    return np.asarray(SHARE * np.exp(-0.5 * (away / SPREAD) ** 2) / (SPREAD * math.sqrt(math.tau)))


def _logarithms(away: FloatArray) -> FloatArray:
    of_right = float(_core(np.zeros(1))[0]) + (1 - SHARE) * _ANY
    return np.asarray(np.log((_core(away) + (1 - SHARE) * _ANY) / of_right))
