"""Kernels are called by Python, their parts by kernels only."""

import gc
import threading
import time

import numpy as np
import pytest
from numba.core.errors import TypingError
from sonarhw_sim.compiled import array_part, compiled, compiled_part, inlined

from sonarhw.readings import FloatArray


@compiled_part
def _half(value: float) -> float:
    return value / 2


@compiled_part
def _first_of_new(value: float) -> float:
    return float(np.full(1, value)[0])


@array_part
def _doubled(values: FloatArray) -> FloatArray:
    return values + values


@inlined
def _third(value: float) -> float:
    return value / 3


@compiled
def _sum_of_halves(values: FloatArray) -> float:
    total = 0.0
    for value in values:
        total += _half(value)
    return total


@compiled
def _sum_of_thirds(values: FloatArray) -> float:
    total = 0.0
    for value in values:
        total += _third(value)
    return total


def test_a_part_is_called_by_kernels_and_refuses_calls_by_python() -> None:
    with pytest.raises(TypeError, match="_half can be called by kernels only"):
        _half(3.0)
    assert _sum_of_halves(np.array([1.0, 2.0])) == 1.5
    with pytest.raises(TypeError, match="_half can be called by kernels only"):
        _half(3.0)


def test_a_part_that_counts_no_references_may_not_make_arrays() -> None:
    @compiled
    def of_new(value: float) -> float:
        return _first_of_new(value)

    @compiled
    def of_doubled(values: FloatArray) -> float:
        return float(_doubled(values)[0])

    with pytest.raises(TypingError, match="Failed in nopython mode"):
        of_new(1.0)
    assert of_doubled(np.array([1.5])) == 3.0


def test_an_inlined_kernel_is_not_compiled_by_itself_and_refuses_calls_by_python() -> None:
    with pytest.raises(TypeError, match="_third can be called by kernels only"):
        _third(3.0)
    assert _sum_of_thirds(np.array([1.5, 3.0])) == 1.5
    assert not _third.dispatcher.overloads  # type: ignore[attr-defined]
    with pytest.raises(TypeError, match="_third can be called by kernels only"):
        _third(3.0)


@compiled
def _count_until(flag: FloatArray, count: FloatArray, most: float) -> None:
    while count[0] < most and flag[0] == 0.0:
        count[0] += 1.0


def test_other_threads_run_while_a_kernel_runs() -> None:
    flag, count, most = np.zeros(1), np.zeros(1), 1e9
    _count_until(flag, count, 1.0)
    thread = threading.Thread(target=_count_until, args=(flag, count, most))
    thread.start()
    while count[0] <= 1.0:
        time.sleep(0.001)
    flag[0] = 1.0
    thread.join()
    assert count[0] < most


def test_the_garbage_collector_runs_after_a_compilation() -> None:
    @compiled
    def kernel(value: float) -> float:
        return value * 3

    assert kernel(2.0) == 6.0
    assert gc.isenabled()
    gc.collect()
    ring: list[object] = []
    ring.append(ring)
    del ring
    assert gc.collect() == 1
