"""How kernels are compiled: once for all runs, kept on disk, dividing as NumPy does, and without holding Python's lock.

Without the lock a window goes on while a thread of its own follows rays.
"""

from collections.abc import Callable
from typing import Any, TypeVar, cast

from numba import njit

_Kernel = TypeVar("_Kernel", bound=Callable[..., Any])


def compiled(kernel: _Kernel) -> _Kernel:
    """`kernel`, compiled at its first call with arguments of a type."""
    return cast(_Kernel, njit(cache=True, error_model="numpy", nogil=True)(kernel))
