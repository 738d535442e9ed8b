"""Processor cores, and work in parts that threads compute at once: kernels release Python's lock."""

import os
import threading
from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

_Result = TypeVar("_Result")

_threads_run = threading.Lock()
_one_thread = threading.Event()  # set in a process that computes beside others


def core_count() -> int:
    """Return the number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def use_one_thread() -> None:
    """Compute in one thread from now on, because other processes use the other cores."""
    _one_thread.set()


def in_parts(work: Callable[[int, int], _Result], count: int, least: int) -> list[_Result]:
    """Return the results of `work(begin, end)` for consecutive parts of `count` items, in order; at least one part.

    There is a thread for each core, and a part has `least` items or more. It is one part if the cores are busy: while
    another call computes in threads, in a process of a pool, and after `use_one_thread`.
    """
    parts = min(core_count(), count // least)
    if parts < 2 or _one_thread.is_set() or _is_of_a_pool() or not _threads_run.acquire(blocking=False):
        return [work(0, count)]
    bounds, results, errors = [count * k // parts for k in range(parts + 1)], {}, {}

    def run(part: int) -> None:
        try:
            results[part] = work(bounds[part], bounds[part + 1])
        except Exception as error:  # noqa: BLE001 - raised again below
            errors[part] = error

    try:
        # daemon threads, not those of a pool, so that a process can end while they compile a kernel
        threads = [threading.Thread(target=run, args=(part,), daemon=True) for part in range(1, parts)]
        for thread in threads:
            thread.start()
        run(0)
        for thread in threads:
            thread.join()
    finally:
        _threads_run.release()
    if errors:
        raise errors[min(errors)]
    return [results[part] for part in range(parts)]


def _is_of_a_pool() -> bool:
    """Return whether another process started this one to compute."""
    from multiprocessing import parent_process  # takes 10 ms, and the start of a command does without it

    return parent_process() is not None


def rows_in_parts(work: Callable[[int, int], tuple[NDArray[Any], ...]], count: int, least: int) -> list[NDArray[Any]]:
    """Return the arrays of `work(begin, end)` for `count` items, each with the rows of all parts, in order."""
    parts = in_parts(work, count, least)
    # to join them copies them
    return [column[0] if len(parts) == 1 else np.concatenate(column) for column in zip(*parts, strict=True)]
