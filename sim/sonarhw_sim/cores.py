"""Processor cores, and work in parts that threads compute at once: kernels release Python's lock."""

import os
import threading
from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

_Result = TypeVar("_Result")

_threads_run = threading.Lock()


def core_count() -> int:
    """Return the number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def in_parts(work: Callable[[int, int], _Result], count: int, least: int) -> list[_Result]:
    """Return the results of `work(begin, end)` for consecutive parts of `count` items, in order; at least one part.

    There is a thread for each core, and a part has `least` items or more. It is one part if the cores are busy: while
    another call computes in threads, and in a process of a pool.
    """
    parts = min(core_count(), count // least)
    if parts < 2 or not _threads_run.acquire(blocking=False):
        return [work(0, count)]
    try:
        # these imports take 20 ms, and most searches of tests and single headings are small
        from concurrent.futures import ThreadPoolExecutor
        from multiprocessing import parent_process

        if parent_process() is not None:
            return [work(0, count)]
        bounds = [count * k // parts for k in range(parts + 1)]
        with ThreadPoolExecutor(parts) as pool:
            return list(pool.map(work, bounds[:-1], bounds[1:]))
    finally:
        _threads_run.release()


def rows_in_parts(work: Callable[[int, int], tuple[NDArray[Any], ...]], count: int, least: int) -> list[NDArray[Any]]:
    """Return the arrays of `work(begin, end)` for `count` items, each with the rows of all parts, in order."""
    parts = in_parts(work, count, least)
    # to join them copies them
    return [column[0] if len(parts) == 1 else np.concatenate(column) for column in zip(*parts, strict=True)]
