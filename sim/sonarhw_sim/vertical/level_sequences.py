"""Sequences of reflections by levels, which turn the height of sound around.

Sound that rises or falls with one slope along its way in the plan has the height that it would have without levels,
folded at each of them (image sources).
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from sonarhw.readings import FloatArray
from sonarhw_sim.vertical.reflecting_levels import Levels

_CLOSE = 1e-9  # m: heights that differ less are equal


@dataclass(frozen=True)
class LevelSequence:
    """The levels that sound touches between its departure at one height and its arrival at another."""

    levels: tuple[int, ...]  # rows of `Levels`
    heights: FloatArray  # (k + 2,), m: of the departure, of each level, and of the arrival

    @cached_property
    def climbs(self) -> FloatArray:
        """Up and down travelled until each of the heights, (k + 2,) m."""
        return np.append(0.0, np.cumsum(np.abs(np.diff(self.heights))))

    @property
    def climb(self) -> float:
        """Up and down travelled in all, m."""
        return float(self.climbs[-1])

    @property
    def signs(self) -> tuple[float, float]:
        """The signs of the elevation at departure and of that from which sound arrives."""
        return float(np.sign(self.heights[1] - self.heights[0])), float(np.sign(self.heights[-2] - self.heights[-1]))


def level_sequences(
    levels: Levels, start: float, end: float, longest: float, most: int, lids: int
) -> Iterator[LevelSequence]:
    """Yield the sequences from one height to another, m, with a climb up to `longest` (m).

    They touch one level or more, up to `most`, and up to `lids` that are limited. Those that first go down come first.
    """
    for going in (-1, 1):
        yield from _continued(levels, LevelSequence((), np.array([start])), going, end, longest, most, lids)


def _continued(
    levels: Levels, begun: LevelSequence, going: int, end: float, longest: float, most: int, lids: int
) -> Iterator[LevelSequence]:
    at, kernel = float(begun.heights[-1]), levels.kernel
    ahead = (kernel.facing == -going) & ((kernel.heights - at) * going > _CLOSE)
    for level in np.flatnonzero(ahead).tolist() if most > 0 else []:
        left = lids - int(kernel.limited[level])
        height = float(kernel.heights[level])
        touched = LevelSequence((*begun.levels, level), np.append(begun.heights, height))
        if left < 0 or touched.climb > longest:
            continue
        whole = LevelSequence(touched.levels, np.append(touched.heights, end))
        if (end - height) * -going > _CLOSE and whole.climb <= longest:
            yield whole
        yield from _continued(levels, touched, -going, end, longest, most - 1, left)
