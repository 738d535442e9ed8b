"""Upper bounds on the amplitude of rays, so that the ray kernel drops rays that no receiver can detect.

Every bound errs on the loud side: a path is lost only if it is fainter than `TransducerAxes.faintest`. A search for all
headings at once has no `TransducerAxes` and drops nothing.
"""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from sonarhw.readings import FloatArray
from sonarhw_sim.board.transducer import beam_gain

_ANGLES = 1441  # from 0 to π at which beams are looked up
# By how much the exact path may be off the ray that found it. Rays are a sixteenth of a degree apart, but past a post
# the tube between two of them opens wide, and a path along its rim is louder than the ray in its middle.
_ASIDE = math.radians(1.0)
_LOUDER = 2.0  # 6 dB


class Detectable(NamedTuple):
    """How loud rays leave, and how loud they must come to be of use."""

    leaving: FloatArray  # (n,): amplitude with which each ray leaves, at most
    least: FloatArray  # (t,): amplitude that a way to each target must have more of
    axis_x: float  # where the receiver points
    axis_y: float
    receiving: FloatArray  # (a,): the most it hears of sound so far or farther aside, evenly from 0 to π


@dataclass(frozen=True)
class TransducerAxes:
    """Where sender and receiver point; wanted is what leaves and comes back in front of them, loud enough."""

    leaving: float  # rad
    arriving: float  # rad
    ka: float  # of both
    faintest: float  # amplitude, with beams, reflectances and curvature; fainter paths may be left out

    @property
    def reversed(self) -> "TransducerAxes":
        """The same for paths gone backwards."""
        return TransducerAxes(self.arriving, self.leaving, self.ka, self.faintest)

    def detectable(self, directions: FloatArray, onward: FloatArray) -> Detectable:
        """For rays in those directions (n,) rad and targets that leave `onward` (t,) of a way's amplitude at most."""
        loudest = _loudest_aside(self.ka)
        aside = np.abs(directions - self.leaving)
        return Detectable(
            loudest[(aside / math.pi * (_ANGLES - 1)).astype(np.intp)],
            self.faintest / _LOUDER / onward,
            math.cos(self.arriving),
            math.sin(self.arriving),
            loudest,
        )


def all_rays(rays: int, targets: int) -> Detectable:
    """For a search that drops nothing but what has no sound left at all."""
    return Detectable(np.ones(rays), np.zeros(targets), 1.0, 0.0, np.ones(1))


@lru_cache(maxsize=16)
def _loudest_aside(ka: float) -> FloatArray:
    """The most that a beam leaves one way of sound so far or farther aside, less a degree, (1441,) for 0 to π."""
    angles = np.linspace(0, math.pi, _ANGLES)
    loudest = np.maximum.accumulate(beam_gain(np.maximum(angles - _ASIDE, 0.0), ka)[::-1])[::-1]
    loudest.flags.writeable = False
    return loudest
