"""Kernels are called by Python, their parts by kernels only."""

import gc

import numpy as np
import pytest
from sonarhw_sim.compiled import compiled, compiled_part

from sonarhw.readings import FloatArray


@compiled_part
def _half(value: float) -> float:
    return value / 2


@compiled
def _sum_of_halves(values: FloatArray) -> float:
    total = 0.0
    for value in values:
        total += _half(value)
    return total


def test_a_part_is_called_by_kernels_and_refuses_calls_by_python() -> None:
    with pytest.raises(TypeError, match="_half can be called by kernels only"):
        _half(3.0)
    assert _sum_of_halves(np.array([1.0, 2.0])) == 1.5
    with pytest.raises(TypeError, match="_half can be called by kernels only"):
        _half(3.0)


def test_the_garbage_collector_runs_after_a_compilation() -> None:
    @compiled
    def kernel(value: float) -> float:
        return value * 3

    assert kernel(2.0) == 6.0
    assert gc.isenabled()
