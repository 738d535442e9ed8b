"""Upper bounds on the amplitude of rays, so that the ray kernel drops rays that no receiver can detect.

No bound is below the true amplitude, so a path is lost only if it is fainter than `TransducerAxes.faintest`. A search
for all headings at once has no `TransducerAxes` and drops nothing.
"""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from sonarhw.readings import FloatArray
from sonarhw_sim.board.transducer import beam_gain

_ANGLES = 1441  # from 0 to π at which the beam is tabulated
# Allowance for the distance between the exact path and the ray that found it. Rays are a sixteenth of a degree apart,
# but behind a post the tube between two rays widens, and a path at its rim is louder than the ray at its centre.
_ASIDE = math.radians(1.0)
_LOUDER = 2.0  # 6 dB


class Detectable(NamedTuple):
    """Amplitude of each ray at departure, and the least amplitude at each target."""

    leaving: FloatArray  # (n,): upper bound of the amplitude of each ray at departure
    least: FloatArray  # (t,): a path to a target must exceed this amplitude
    axis_x: float  # unit vector of the receiver's axis
    axis_y: float
    receiving: FloatArray  # (a,): upper bound of the receiver's beam at or beyond each angle, evenly from 0 to π


@dataclass(frozen=True)
class TransducerAxes:
    """Axes of sender and receiver, for a search of paths that leave and arrive in front of them, loud enough."""

    leaving: float  # rad
    arriving: float  # rad
    ka: float  # of both
    faintest: float  # amplitude, with beams, reflectances and curvature; fainter paths may be omitted

    @property
    def reversed(self) -> "TransducerAxes":
        """The axes for reversed paths."""
        return TransducerAxes(self.arriving, self.leaving, self.ka, self.faintest)

    def detectable(self, directions: FloatArray, onward: FloatArray) -> Detectable:
        """Return the limits for rays in these directions (n,) rad, and targets with a gain of at most `onward` (t,)."""
        return Detectable(
            self.departing(directions),
            self.faintest / _LOUDER / onward,
            math.cos(self.arriving),
            math.sin(self.arriving),
            _loudest_aside(self.ka),
        )

    def departing(self, directions: FloatArray) -> FloatArray:
        """Return an upper bound of the amplitude of rays that leave in these directions (n,) rad, (n,)."""
        aside = np.abs((directions - self.leaving + math.pi) % math.tau - math.pi)
        return np.asarray(_loudest_aside(self.ka)[(aside / math.pi * (_ANGLES - 1)).astype(np.intp)])


def all_rays(rays: int, targets: int, faintest: float = 0.0) -> Detectable:
    """Return the limits for a search that drops only rays without any sound left.

    Paths to targets but the first may be omitted if they are fainter than `faintest`.
    """
    least = np.append(0.0, np.full(targets - 1, faintest / _LOUDER))
    return Detectable(np.ones(rays), least, 1.0, 0.0, _for_kernels(np.ones(1)))


@lru_cache(maxsize=16)
def _loudest_aside(ka: float) -> FloatArray:
    """Return the largest beam factor, for one pass, at or beyond each angle minus one degree, (1441,) for 0 to π."""
    angles = np.linspace(0, math.pi, _ANGLES)
    return _for_kernels(np.maximum.accumulate(beam_gain(np.maximum(angles - _ASIDE, 0.0), ka)[::-1])[::-1])


def _for_kernels(receiving: FloatArray) -> FloatArray:
    """Return a contiguous, read-only array. For an array of another kind, the kernels would be compiled once more."""
    receiving = np.ascontiguousarray(receiving)
    receiving.flags.writeable = False
    return receiving
