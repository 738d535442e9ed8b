"""Traces stored in the sample format of the wire, so that an hour of a live scan with traces fits into memory.

The samples are computed on access.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray, Reading, Trace

_FORMS = np.uint8, np.uint16  # sample formats of the wire
_SAME = 1e-12
_NO_SAMPLES: FloatArray = np.empty(0)  # stored by the base class; the property computes the samples


class PackedTrace(Trace):
    """A trace that stores the integer steps of the converter."""

    def __init__(self, steps: NDArray[np.unsignedinteger], like: Trace) -> None:
        super().__init__(_NO_SAMPLES, like.rate, like.start, like.carrier)
        self._steps = steps

    @property
    def samples(self) -> FloatArray:
        """The samples as floats, equal to those before packing."""
        levels = self._steps / np.float64(np.iinfo(self._steps.dtype).max)
        return 2 * levels - 1 if self.carrier else levels


def with_packed_trace(reading: Reading) -> Reading:
    """Return the reading with a packed trace."""
    return reading if reading.trace is None else replace(reading, trace=packed(reading.trace))


def packed(trace: Trace) -> Trace:
    """Return the trace in 1/8 or 1/4 of its memory; unchanged if samples are lost or finer than on the wire."""
    levels = (trace.samples + 1) / 2 if trace.carrier else trace.samples
    for form in _FORMS:
        full = np.iinfo(form).max
        steps = np.round(levels * full)
        if (np.abs(steps / full - levels) < _SAME).all() and ((steps >= 0) & (steps <= full)).all():
            return PackedTrace(steps.astype(form), trace)
    return trace
