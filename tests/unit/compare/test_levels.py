"""Envelopes of traces in pictures."""

import numpy as np
import pytest
from scipy.signal import hilbert
from sonarhw_compare.pictures import envelope_of

from sonarhw.readings import Trace


@pytest.mark.parametrize("count", [200, 201])
def test_the_envelope_of_a_carrier_is_the_magnitude_of_its_analytic_signal(count: int) -> None:
    samples = 0.3 * np.random.default_rng(1).standard_normal(count).clip(-2, 2)
    trace = Trace(samples, 200_000.0, 0.0, carrier=True)
    assert envelope_of(trace) == pytest.approx(np.abs(hilbert(samples)).clip(max=1.0))
