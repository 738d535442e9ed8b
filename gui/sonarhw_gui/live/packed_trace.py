"""Traces kept as the bytes of the wire, so that an hour of a live scan with traces fits into memory.

The samples are computed on access.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray, Reading, Trace

_FORMS = np.uint8, np.uint16  # of samples on the wire
_SAME = 1e-12
_IN_STEPS: FloatArray = np.empty(0)  # in place of the samples


class PackedTrace(Trace):
    """A trace of whole steps of a converter."""

    def __init__(self, steps: NDArray[np.unsignedinteger], like: Trace) -> None:
        super().__init__(_IN_STEPS, like.rate, like.start, like.carrier)
        self._steps = steps

    @property
    def samples(self) -> FloatArray:
        """The samples as they were before."""
        levels = self._steps / np.float64(np.iinfo(self._steps.dtype).max)
        return 2 * levels - 1 if self.carrier else levels


def with_packed_trace(reading: Reading) -> Reading:
    """The same reading, its trace packed."""
    return reading if reading.trace is None else replace(reading, trace=packed(reading.trace))


def packed(trace: Trace) -> Trace:
    """The trace in an eighth or a quarter of its memory; itself where samples are lost or finer than the wire's."""
    levels = (trace.samples + 1) / 2 if trace.carrier else trace.samples
    for form in _FORMS:
        full = np.iinfo(form).max
        steps = np.round(levels * full)
        if (np.abs(steps / full - levels) < _SAME).all() and ((steps >= 0) & (steps <= full)).all():
            return PackedTrace(steps.astype(form), trace)
    return trace
