"""The levels between which sound goes up and down, seen from one place: floor, ceiling and lids."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray
from sonarhw_sim.compiled import compiled_part
from sonarhw_sim.room.enclosures import Lid
from sonarhw_sim.room.grid import IntArray
from sonarhw_sim.room.model import Place, Room
from sonarhw_sim.room.room_file import MEETING


class KernelLevels(NamedTuple):
    """Levels for kernels, one row each."""

    heights: FloatArray  # (l,), m
    facing: IntArray  # (l,): 1 reflects sound from above, -1 from below
    limited: NDArray[np.bool_]  # (l,): whether it ends at an outline
    boxes: FloatArray  # (l, 4), m: least x, least y, largest x, largest y of the outline
    radii: FloatArray  # (l,), m: of a round outline about its only corner; 0: a polygon
    starts: IntArray  # (l + 1,): rows of the corners of each
    corners: FloatArray  # (c, 2), m


@dataclass(frozen=True)
class Levels:
    """Levels that sound from a place can touch."""

    surfaces: IntArray  # (l,): their numbers in the room
    lids: tuple[Lid | None, ...]  # (l,): outlines; None: without limit
    kernel: KernelLevels

    @property
    def floor(self) -> float:
        """Height below which there is no sound, m."""
        return float(self._ends(1).max(initial=-math.inf))

    @property
    def ceiling(self) -> float:
        """Height above which there is no sound, m."""
        return float(self._ends(-1).min(initial=math.inf))

    def _ends(self, facing: int) -> FloatArray:
        of_it = ~self.kernel.limited & (self.kernel.facing == facing)
        return np.asarray(self.kernel.heights[of_it])


def levels_of(room: Room, place: Place, height: float) -> Levels:
    """Return the levels around a place at a height, m. Lids beyond floor and ceiling are omitted."""
    ends = [k for k in room.levels if room.lid(k) is None]
    floor = max((float(room.heights[k, 0]) for k in ends if room.heights[k, 0] < height), default=-math.inf)
    ceiling = min((float(room.heights[k, 0]) for k in ends if room.heights[k, 0] >= height), default=math.inf)
    inside = [k for k in room.levels if floor + MEETING < room.heights[k, 0] < ceiling - MEETING]
    chosen = [*ends, *inside]
    lids = tuple(room.lid(k) for k in chosen)
    corners = [np.empty((0, 2)) if lid is None else lid.corners for lid in lids]
    facing = [
        (1 if room.heights[k, 0] < height else -1) if lid is None else _facing(lid, place, height)
        for k, lid in zip(chosen, lids, strict=True)
    ]
    kernel = KernelLevels(
        np.array([room.heights[k, 0] for k in chosen], dtype=np.float64),
        np.array(facing, dtype=np.int32),
        np.array([lid is not None for lid in lids], dtype=np.bool_),
        np.array([(0.0,) * 4 if lid is None else lid.box for lid in lids], dtype=np.float64).reshape(-1, 4),
        np.array([0.0 if lid is None else lid.radius for lid in lids], dtype=np.float64),
        np.append(0, np.cumsum([len(rows) for rows in corners])).astype(np.int32),
        np.ascontiguousarray(np.vstack((*corners, np.empty((0, 2))))),
    )
    return Levels(np.array(chosen, dtype=np.int32), lids, kernel)


def _facing(lid: Lid, place: Place, height: float) -> int:
    outward = 1 if lid.upper else -1
    return -outward if lid.surrounds(*place.position, height) else outward


@compiled_part
def is_within(x: float, y: float, level: int, levels: KernelLevels) -> bool:
    """Return whether a point (m) is within the outline of a level that has one."""
    first, last = levels.starts[level], levels.starts[level + 1]
    if levels.radii[level] > 0.0:
        inside: bool = math.hypot(x - levels.corners[first, 0], y - levels.corners[first, 1]) < levels.radii[level]
        return inside
    within = False
    x0, y0 = levels.corners[last - 1]
    for k in range(first, last):
        x1, y1 = levels.corners[k]
        if (y0 > y) != (y1 > y) and x < x0 + (y - y0) / (y1 - y0) * (x1 - x0):
            within = not within
        x0, y0 = x1, y1
    return within
