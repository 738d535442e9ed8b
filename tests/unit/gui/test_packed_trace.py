"""Packed traces keep every sample and need an eighth or a quarter of the memory."""

import sys

import numpy as np
import pytest
from sonarhw_gui.session.scanner import PackedTrace, packed, with_packed_trace

from sonarhw.readings import Reading, Trace
from sonarhw.wire.messages import FULL_SCALE

FORMS = {8: (np.uint8, FULL_SCALE), 16: (np.uint16, 257 * FULL_SCALE)}


@pytest.mark.parametrize("bits", FORMS)
@pytest.mark.parametrize("carrier", [False, True])
def test_a_packed_trace_has_the_same_samples(bits: int, carrier: bool) -> None:
    form, full = FORMS[bits]
    steps = np.random.default_rng(1).integers(0, full, 3000, endpoint=True).astype(form)
    levels = steps / full
    trace = Trace(2 * levels - 1 if carrier else levels, 50e3, 0.001, carrier)
    small = packed(trace)
    assert isinstance(small, PackedTrace)
    np.testing.assert_array_equal(small.samples, trace.samples)
    np.testing.assert_array_equal(small.times, trace.times)
    assert (small.rate, small.start, small.carrier) == (50e3, 0.001, carrier)
    assert sys.getsizeof(small.__dict__["_steps"]) < trace.samples.nbytes * bits / 64 + 200


@pytest.mark.parametrize("samples", [[0.1234567], [np.nan, 0.0], [-0.5], [1.5]])
def test_samples_that_are_not_converter_steps_are_not_packed(samples: list[float]) -> None:
    trace = Trace(np.array(samples), 50e3, 0.0)
    assert packed(trace) is trace


def test_a_reading_without_a_trace_is_unchanged() -> None:
    reading = Reading(0, 0, 0, 0.0, 0.0, (), 343.2)
    assert with_packed_trace(reading) is reading
