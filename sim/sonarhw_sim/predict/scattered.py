"""Sound of rough surfaces at one heading: the mean power of all patches that the burst covers, or a speckle.

The phases of patches are random, so their powers add up. The mean power does not depend on the size of patches. One
particular surface has a grain: its phases give a speckle, whose amplitude has a Rayleigh distribution.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray
from sonarhw_sim.board.traces import Patches
from sonarhw_sim.board.transducer import ComplexArray

_PARTS_OF_BURST = 8  # least number of scatterers of a grain along the burst


class Grain(NamedTuple):
    """Scatterers with random phase and strength in place of patches."""

    rows: NDArray[np.intp]  # (g,), their patches
    lengths: FloatArray  # (g,), m
    factors: ComplexArray  # (g,), to multiply the amplitude of their patches with


@dataclass(frozen=True)
class ScatteredSound:
    """The patches that one heading receives, and what the burst covers."""

    patches: Patches  # in order of their lengths
    rows: NDArray[np.intp]  # (k,), of the patches among all paths
    burst: float  # m, by how much the lengths of paths differ that are received at one instant
    grain: Grain | None  # one particular surface; None: the mean power of all

    def at(self, lengths: FloatArray) -> ComplexArray:
        """Return the amplitude received at the instants of these path lengths (m), same shape; real for the mean."""
        if self.grain is None:
            return np.sqrt(self.patches.power_between(lengths - self.burst, lengths)).astype(np.complex128)
        amplitudes = self.patches.amplitudes[self.grain.rows] * self.grain.factors
        return _sums_between(self.grain.lengths, amplitudes, lengths - self.burst, lengths)

    def level_from(self, begin: float) -> float:
        """Return the level that this sound reaches within one burst from the path length `begin` (m) on, dB."""
        lengths = self._changes(begin, begin + self.burst)
        return 20 * math.log10(max(float(np.abs(self.at(lengths)).max()), 1e-300))

    def reaches(self, level_db: float, before: float) -> float:
        """Return the path length (m) at which this sound last came up to a level, `before` another one."""
        lengths = self._changes(before - self.burst, before)
        levels = np.abs(self.at(lengths)) ** 2
        wanted = 10 ** (level_db / 10)
        fainter = np.flatnonzero(levels < wanted)
        if not len(fainter) or fainter[-1] == len(levels) - 1:
            return before
        last = int(fainter[-1])
        if self.grain is not None:
            return float(lengths[last + 1])
        return float(np.interp(wanted, levels[last : last + 2], lengths[last : last + 2]))

    def _changes(self, begin: float, end: float) -> FloatArray:
        """Return the path lengths (m) from `begin` to `end` between which the power of this sound changes evenly."""
        half = self.patches.spreads / 2
        changes = np.concatenate((self.patches.lengths - half, self.patches.lengths + half))
        if self.grain is not None:
            changes = self.grain.lengths
        lengths = np.concatenate((changes, changes + self.burst, [begin, end]))
        return np.sort(lengths[(lengths >= begin) & (lengths <= end)])

    def loudest_at(self, lengths: FloatArray) -> NDArray[np.intp]:
        """Return the row of the loudest patch at these instants, same shape."""
        in_order = np.argsort(np.abs(self.patches.amplitudes), kind="stable")
        ranks = np.empty(len(in_order) + 1, dtype=np.intp)
        ranks[in_order], ranks[-1] = np.arange(len(in_order)), -1
        begins = np.searchsorted(self.patches.lengths, lengths - self.burst)
        ends = np.searchsorted(self.patches.lengths, lengths, side="right")
        best = np.maximum.reduceat(ranks, np.column_stack((begins, ends)).ravel())[::2]
        return np.asarray(self.rows[in_order[best]])

    def added_to(
        self, sums: FloatArray, loudest: NDArray[np.intp], lengths: FloatArray
    ) -> tuple[FloatArray, NDArray[np.intp]]:
        """Return amplitudes and loudest rows of arrivals together with this sound.

        `sums` (n,) are those of the other paths, `loudest` (n,) their rows.
        """
        sound = self.at(lengths)
        both = np.hypot(sums, np.abs(sound)) if self.grain is None else np.abs(sums + sound)
        return both, np.where(np.abs(sound) > sums, self.loudest_at(lengths), loudest)

    def responsible_at(self, length: float, coherent: float) -> int:
        """Return the row of the loudest patch if this sound is louder than `coherent` at that instant, else -1."""
        at = np.array([length])
        return int(self.loudest_at(at)[0]) if abs(self.at(at)[0]) > coherent else -1


def scattered_sound(
    lengths: FloatArray,
    spreads: FloatArray,
    amplitudes: FloatArray,
    rows: NDArray[np.intp],
    burst: float,
    seed: tuple[int, ...],
) -> ScatteredSound:
    """Return the sound of patches (k,), in order of length; `rows` are theirs among all paths.

    An empty `seed` selects the mean power.
    """
    grain = _grain_of(lengths, spreads, burst, seed) if seed else None
    return ScatteredSound(Patches(lengths, spreads, amplitudes), rows, burst, grain)


def _grain_of(lengths: FloatArray, spreads: FloatArray, burst: float, seed: tuple[int, ...]) -> Grain:
    """Return scatterers that have the mean power of the patches (k,); `burst` is the result of `covered_by_burst`.

    Each has a complex normal amplitude. Sums of several are then such amplitudes too, for patches of any size.
    """
    counts = np.ceil(spreads / burst * _PARTS_OF_BURST).astype(np.intp)
    rows = np.repeat(np.arange(len(lengths)), counts)
    within = np.arange(len(rows)) - np.repeat(np.cumsum(counts) - counts, counts)
    shares = (within + 0.5) / counts[rows] - 0.5
    normal = np.random.default_rng(seed).standard_normal((len(rows), 2)).view(np.complex128)[:, 0]
    return Grain(rows, lengths[rows] + shares * spreads[rows], normal / np.sqrt(2.0 * counts[rows]))


def _sums_between(lengths: FloatArray, amplitudes: ComplexArray, begins: FloatArray, ends: FloatArray) -> ComplexArray:
    """Return the sum of the amplitudes (g,) of lengths over `begins` and up to `ends`, same shape as these."""
    order = np.argsort(lengths, kind="stable")
    until = np.append(0.0, np.cumsum(amplitudes[order]))
    first, last = (np.searchsorted(lengths[order], limits, side="right") for limits in (begins, ends))
    return np.asarray(until[last] - until[first])
