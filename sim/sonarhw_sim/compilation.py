"""Reports the compilation of kernels to a program that shows it, such as the command line. Imports nothing slow."""

import warnings


class Watcher:
    """Shows no progress, and a Python warning if compiled kernels cannot be stored. Subclasses show more."""

    def compiling(self, done: int, known: int) -> None:
        """Show that kernels are being compiled, and how many of the `known` kernels are."""

    def compiled(self) -> None:
        """Show that compilation has ended, at least until the next call of `compiling`."""

    def not_stored(self, reason: str) -> None:
        """Show that compiled kernels cannot be stored."""
        warnings.warn(reason, RuntimeWarning, stacklevel=2)


_watcher = Watcher()


def watch_compilation(watcher: Watcher) -> None:
    """Report to `watcher` from now on, from the thread that compiles."""
    global _watcher
    _watcher = watcher


def watcher() -> Watcher:
    """Return the object to which compilation is reported."""
    return _watcher


_count = 0


def count_kernel() -> None:
    """Count a kernel that is compiled by itself."""
    global _count
    _count += 1


def kernel_count() -> int:
    """Return the number of known kernels, compiled or not."""
    return _count
