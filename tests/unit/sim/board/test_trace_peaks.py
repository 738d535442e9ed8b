"""The peaks of traces are those of exact waves at every frequency of the burst."""

import numpy as np
import pytest
from sonarhw_sim.air import EdgeStrength

from tests.oracles.exact.exact_traces import peak_by_paths, peak_by_wave, post_at, strip_at, wall_end_at

HERE = np.array([0.0, 1.0])
STRIP = [(-0.005, 0.0, 0.005, 0.0)]


@pytest.mark.parametrize("beyond", [-0.03, 0.003])
def test_the_peak_of_a_wall_end_is_that_of_the_wave(beyond: float) -> None:
    peak = peak_by_paths([(-9.0, 0.0, beyond, 0.0)], 1.0, HERE)
    assert peak == pytest.approx(peak_by_wave(1.0, wall_end_at(beyond, 1.0)), abs=0.3)


def test_the_peak_of_a_strip_is_that_of_the_wave_and_not_with_the_strength_of_the_paper() -> None:
    wave = peak_by_wave(1.0, strip_at(0.01, 1.0))
    assert peak_by_paths(STRIP, 1.0, HERE) == pytest.approx(wave, abs=0.3)
    assert peak_by_paths(STRIP, 1.0, HERE, strength=EdgeStrength.PAPER) > wave + 6.0


def test_the_peak_of_a_wire_is_that_of_the_wave() -> None:
    peak = peak_by_paths([], 1.0, np.zeros(2), [(1.001, 0.0, 0.001)])
    assert peak == pytest.approx(peak_by_wave(1.0, post_at(0.001, 1.0)), abs=0.3)
