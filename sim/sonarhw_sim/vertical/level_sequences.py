"""Sequences of reflections by floor and ceiling, which turn the height of sound around.

Sound that rises or falls with one slope along its way in the plan has the height that it would have without levels,
folded at each of them (image sources).
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from sonarhw.readings import FloatArray
from sonarhw_sim.room.model import Room


@dataclass(frozen=True)
class LevelSequence:
    """The levels that sound touches between its departure at a height and its return to it."""

    surfaces: tuple[int, ...]
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

    def heights_at(self, climbed: FloatArray) -> FloatArray:
        """Return the height (m) after going up and down by `climbed` m, same shape."""
        return np.interp(climbed, self.climbs, self.heights)


def level_sequences(room: Room, height: float, longest: float, most: int) -> Iterator[LevelSequence]:
    """Yield the sequences from a height back to it, with a climb up to `longest` (m) and up to `most` levels."""
    below = [level for level in room.levels if room.heights[level, 0] < height]
    above = [level for level in room.levels if room.heights[level, 0] > height]
    for first, second in ((below, above), (above, below)):
        surfaces: tuple[int, ...] = ()
        while len(surfaces) < most and (following := (first, second)[len(surfaces) % 2]):
            surfaces = (*surfaces, *following)
            between = [float(room.heights[level, 0]) for level in surfaces]
            sequence = LevelSequence(surfaces, np.array([height, *between, height]))
            if sequence.climb > longest:
                break
            yield sequence


def straight_up_and_down(sequence: LevelSequence) -> tuple[float, float]:
    """Return the elevations (rad) of the path that only goes up and down."""
    up, down = sequence.signs
    return up * math.pi / 2, down * math.pi / 2
