"""Ranges that are means of several pings, with no echo as a number, as some programs record them.

Where the nearest echo changes, such a mean lies between the two ranges, where nothing is. A mean of five pings between
0.51 and 2.14 m is 0.84, 1.16, 1.49 or 1.81 m, and means with no echo look like ranges too. Ranges that a sensor has
measured are rarely just there.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from sonarhw.readings import BoolArray, FloatArray

MOST_PINGS = 8
_STEADY = 5  # neighbouring readings, at least, that have one range
_LONGEST = 16  # most readings from one such range to the next
_APART = 12  # units, least difference of two ranges whose means can be recognised
_ERROR = 1.0 + 1e-6  # units, of a mean of whole units, rounded or cut off
_AT_ENDS = 2.0  # units; a reading as near to one of the two ranges is no mean
_DECIMALS = 3  # most, of the unit of a file
_WHOLE = 1e-3  # units, of a whole number
_CHANCE = 1e-4  # that measured ranges have as many likely means


@dataclass(frozen=True)
class _Between:
    """A reading between two steady ranges."""

    row: int
    range: float  # in units, like the next two
    before: float
    after: float
    is_first: bool  # of neighbouring readings with this range, which prove no more than one

    def is_mean_of(self, pings: int) -> bool:
        """Return whether the range is a mean of so many pings, some with the range before and some with that after."""
        return bool(self._are_means(np.array([self.range]), pings)[0])

    def chance_of(self, pings: int) -> float:
        """Return the share of such means among all whole ranges between the two."""
        low, high = sorted((self.before, self.after))
        return float(self._are_means(np.arange(low + _AT_ENDS + 1, high - _AT_ENDS), pings).mean())

    def _are_means(self, ranges: FloatArray, pings: int) -> BoolArray:
        shares = np.arange(1, pings) / pings
        means = self.before + shares * (self.after - self.before)
        return np.asarray((np.abs(ranges[:, None] - means) <= _ERROR).any(axis=1))


def likely_pings(scans: Sequence[FloatArray], unit: float) -> int | None:
    """Return the number of pings that each range of scans is likely a mean of; None if nothing shows such means.

    A scan has ranges (n,) in the order of its angles, m, whole multiples of `unit` (m), with the number that stands for
    no echo. Scans are of one program.
    """
    pairs = [pair for ranges in scans for pair in _all_between(np.round(ranges / unit)) if pair.is_first]
    if not pairs:
        return None
    chances = {pings: _chance(pairs, pings) for pings in range(2, MOST_PINGS + 1)}
    likely = min(chances, key=chances.__getitem__)
    return likely if chances[likely] < _CHANCE else None


def are_means(ranges: FloatArray, unit: float, pings: int) -> BoolArray:
    """Return which ranges (n,) of a scan, as in `likely_pings`, are means of two different ranges, (n,)."""
    means = np.zeros(len(ranges), np.bool_)
    means[[pair.row for pair in _all_between(np.round(ranges / unit)) if pair.is_mean_of(pings)]] = True
    return means


def unit_of(ranges: FloatArray, scale: float) -> float:
    """Return the unit of ranges (n,), m, NaN for none: `scale` (m), or its first decimal in which all are whole."""
    metres = ranges[~np.isnan(ranges)] / scale
    for decimals in range(_DECIMALS):
        if np.allclose(metres, np.round(metres, decimals), rtol=0.0, atol=_WHOLE * 10.0**-decimals):
            return float(scale * 10.0**-decimals)
    return float(scale * 10.0**-_DECIMALS)


def _chance(pairs: Sequence[_Between], pings: int) -> float:
    """Return the probability that measured ranges look like at least as many means."""
    from scipy.stats import binomtest  # takes a second

    means = sum(pair.is_mean_of(pings) for pair in pairs)
    expected = float(np.mean([pair.chance_of(pings) for pair in pairs]))
    return float(binomtest(means, len(pairs), expected, alternative="greater").pvalue)


def _all_between(ranges: FloatArray) -> Iterator[_Between]:
    """Yield the readings between one steady range and the next, in units."""
    steps = np.flatnonzero(np.abs(np.diff(ranges)) > _ERROR) + 1
    runs = [run for run in np.split(np.arange(len(ranges)), steps) if len(run) >= _STEADY]
    for one, other in pairwise(runs):
        before, after = float(ranges[one[-1]]), float(ranges[other[0]])
        low, high = min(before, after) + _AT_ENDS, max(before, after) - _AT_ENDS
        if abs(after - before) < _APART or other[0] - one[-1] > _LONGEST:
            continue
        for row in range(int(one[-1]) + 1, int(other[0])):
            if low < ranges[row] < high:
                yield _Between(row, float(ranges[row]), before, after, ranges[row] != ranges[row - 1])
