"""Decorators of kernels, which numba compiles with NumPy's rules for division and without the GIL, and threads.

Without the GIL, the window stays responsive while another thread follows rays. The first call of a kernel imports
numba, not its decorator, because the import takes 0.2 s: the window is painted before it, and a command that predicts
nothing does without it.

Kernels may have more parameters than other functions: arrays for results are arguments, and in an inner loop, to unpack
a tuple of arrays can take as long as the work itself.
"""

import os
import threading
from collections.abc import Callable
from functools import update_wrapper
from threading import RLock
from typing import Any, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from sonarhw_sim.compilation import count_kernel

_Function = TypeVar("_Function", bound=Callable[..., Any])
_lock = RLock()  # threads may call a kernel for the first time at the same time


class Kernel:
    """A function that numba compiles at its first call for each combination of argument types."""

    def __init__(self, function: Callable[..., Any], options: dict[str, object]) -> None:
        """`options` are those of numba's compiler."""
        self.py_func = function
        self._options = options
        self._dispatcher: Any = None
        update_wrapper(self, function)

    def __call__(self, *arguments: Any) -> Any:
        """Call the compiled function. Raises TypeError if only kernels may call it."""
        return (self._dispatcher or self.dispatcher)(*arguments)

    @property
    def dispatcher(self) -> Any:
        """The object of numba that compiles the function and contains the compiled code."""
        if self._dispatcher is None:
            with _lock:
                if self._dispatcher is None:
                    from sonarhw_sim.compiler import dispatcher_of

                    self._dispatcher = dispatcher_of(self.py_func, self._options)
        return self._dispatcher

    @property
    def _numba_type_(self) -> Any:
        """The type that numba uses where a kernel calls this one."""
        return self.dispatcher._numba_type_

    @property
    def targetoptions(self) -> Any:
        """The compiler options, in which numba finds whether this kernel becomes a part of its caller."""
        return self.dispatcher.targetoptions


def compiled(kernel: _Function) -> _Function:
    """Return `kernel` with compilation at its first call for each combination of argument types."""
    return _counted(kernel)


def compiled_part(kernel: _Function) -> _Function:
    """Return `kernel`, for calls by other kernels only: compilation takes a fifth less time without calls by Python.

    It makes and returns no array, so it counts no references: for tuples of arrays, that takes up to half of the time.
    A call by Python raises TypeError.
    """
    return _counted(kernel, no_cpython_wrapper=True, _nrt=False)


def array_part(kernel: _Function) -> _Function:
    """Return `kernel` like `compiled_part`, but it may make and return arrays."""
    return _counted(kernel, no_cpython_wrapper=True)


def inlined(kernel: _Function) -> _Function:
    """Return `kernel`, for calls by one other kernel: it becomes a part of that one and is not compiled by itself.

    A call by Python raises TypeError.
    """
    return cast(_Function, Kernel(kernel, {"inline": "always"}))


def _counted(kernel: _Function, **options: object) -> _Function:
    count_kernel()
    # without the wrapper for calls by C, which nothing uses
    options["no_cfunc_wrapper"] = True
    return cast(_Function, Kernel(kernel, {"error_model": "numpy", "nogil": True, **options}))


# work in parts that threads compute at once: kernels release Python's lock


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
