"""Decorators of kernels: numba compiles them with NumPy's rules for division, without the GIL, and stores the code.

Without the GIL, the window stays responsive while another thread follows rays. The first call of a kernel imports
numba, not its decorator, because the import takes 0.2 s: the window is painted before it, and a command that predicts
nothing does without it.

Kernels may have more parameters than other functions: arrays for results are arguments, and in an inner loop, to unpack
a tuple of arrays can take as long as the work itself.
"""

from collections.abc import Callable
from functools import update_wrapper
from threading import RLock
from typing import Any, TypeVar, cast

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
            from sonarhw_sim.kernels.compiler import dispatcher_of

            with _lock:
                if self._dispatcher is None:
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
