"""Sequences of reflections by levels, which turn the height of sound around.

Sound that rises or falls with one slope along its way in the plan has the height that it would have without levels,
folded at each of them (image sources).
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate, pairwise

from sonarhw_sim.vertical.reflecting_levels import Levels

_CLOSE = 1e-9  # m: heights that differ less are equal


@dataclass(frozen=True)
class LevelSequence:
    """The levels that sound touches between its departure at one height and its arrival at another."""

    levels: tuple[int, ...]  # rows of `Levels`
    heights: tuple[float, ...]  # m: of the departure, of each level, and of the arrival

    @cached_property
    def climbs(self) -> tuple[float, ...]:
        """Up and down travelled until each of the heights, m."""
        return (0.0, *accumulate(abs(after - before) for before, after in pairwise(self.heights)))

    @property
    def climb(self) -> float:
        """Up and down travelled in all, m."""
        return self.climbs[-1]

    @property
    def signs(self) -> tuple[float, float]:
        """The signs of the elevation at departure and of that from which sound arrives."""
        start, first, *_ = self.heights
        *_, last, end = self.heights
        return float((first > start) - (first < start)), float((last > end) - (last < end))


def level_sequences(
    levels: Levels, start: float, end: float, longest: float, most: int, lids: int
) -> Iterator[LevelSequence]:
    """Yield the sequences from one height to another, m, with a climb up to `longest` (m).

    They touch one level or more, up to `most`, and up to `lids` that are limited. Those that first go down come first.
    """
    kernel = levels.kernel
    each = [*zip(kernel.heights.tolist(), kernel.facing.tolist(), kernel.limited.tolist(), strict=True)]
    for going in (-1, 1):
        yield from _continued(each, (), (start,), 0.0, going, end, longest, most, lids)


def _continued(
    each: list[tuple[float, int, bool]],
    begun: tuple[int, ...],
    heights: tuple[float, ...],
    climb: float,
    going: int,
    end: float,
    longest: float,
    most: int,
    lids: int,
) -> Iterator[LevelSequence]:
    """Yield the sequences that continue one; `each` level has its height (m), facing, and whether it is limited."""
    for level, (height, facing, limited) in enumerate(each if most > 0 else []):
        gap = (height - heights[-1]) * going
        if facing != -going or gap <= _CLOSE or limited > lids or climb + gap > longest:
            continue
        rows, touched = (*begun, level), (*heights, height)
        if (end - height) * -going > _CLOSE and climb + gap + abs(end - height) <= longest:
            yield LevelSequence(rows, (*touched, end))
        yield from _continued(each, rows, touched, climb + gap, -going, end, longest, most - 1, lids - limited)
