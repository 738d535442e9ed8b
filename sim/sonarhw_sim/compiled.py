"""Compilation of kernels by numba: cached on disk, with NumPy's rules for division, and without the GIL.

Without the GIL, the window stays responsive while another thread follows rays.
"""

from collections.abc import Callable
from contextlib import suppress
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any, TypeVar, cast

from numba import njit
from numba.core.caching import FunctionCache

_Kernel = TypeVar("_Kernel", bound=Callable[..., Any])
_Untyped: Any = FunctionCache


def compiled(kernel: _Kernel) -> _Kernel:
    """Return `kernel` with compilation at its first call for each combination of argument types."""
    dispatcher: Any = njit(error_model="numpy", nogil=True)(kernel)
    dispatcher._cache = _KernelCache(kernel)
    return cast(_Kernel, dispatcher)


class _KernelCache(_Untyped):  # type: ignore[misc]  # numba declares no types for it
    """The compiled code of one kernel on disk, valid for one state of all kernels.

    numba's own cache checks only the file of the kernel itself. After an upgrade it could use code that contains an
    older kernel of another file, and it raises an error if its index names a class that no longer exists.
    """

    def __init__(self, kernel: Callable[..., Any]) -> None:
        super().__init__(kernel)
        file, depth = Path(kernel.__code__.co_filename), kernel.__module__.count(".")
        self._cache_file._source_stamp = _digest(file.parents[depth - 1] if depth else file)

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return the code for a signature; None if it must be compiled. An unreadable cache is deleted."""
        try:
            return super().load_overload(sig, target_context)
        except Exception:  # noqa: BLE001  an index of another version may raise anything while it is unpickled
            try:
                self.flush()
            except OSError:
                self.disable()
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Store the code for a signature. If the disk is not writable, the next run compiles again."""
        with suppress(OSError):
            super().save_overload(sig, data)


@cache
def _digest(sources: Path) -> bytes:
    """Return a digest of all kernels in `sources` (a package folder or a file) and in this package, which they call."""
    files = {*Path(__file__).parent.rglob("*.py"), *(sources.rglob("*.py") if sources.is_dir() else (sources,))}
    texts = (file.read_bytes() for file in sorted(files))
    return sha256(b"".join(text for text in texts if b"@compiled" in text)).digest()
