"""How the process of a window frees memory.

Python's garbage collector runs only in the window's thread, between two events. Otherwise any allocation may trigger
it, in a worker thread or inside Qt while it destroys a window. If it frees a widget there, the program crashes.

The objects of modules and of the window stay until the end, so they are not searched: that would stop a live scan for
0.1 s.
"""

import ctypes
import gc
import sys
from collections.abc import Iterator
from contextlib import contextmanager

from pyqtgraph.util.garbage_collector import GarbageCollector

_INTERVAL = 1.0  # s
_IMPORTED = 10  # modules: an import of so many leaves thousands of objects
_ARENA_MAX, _MMAP_THRESHOLD = -8, -3  # parameters of glibc's mallopt
_LARGE = 128 * 1024  # bytes


class _Collector(GarbageCollector):  # type: ignore[misc]  # pyqtgraph has no types
    """Collects by a timer, without the objects that existed at its start or after a large import."""

    def __init__(self) -> None:
        super().__init__(_INTERVAL)
        self._modules = 0
        self._leave_out()

    def check(self) -> None:
        """Collect garbage if there are many new objects."""
        if len(sys.modules) - self._modules >= _IMPORTED:
            self._leave_out()
        else:
            super().check()

    def _leave_out(self) -> None:
        self._modules = len(sys.modules)
        gc.freeze()


@contextmanager
def collected_between_events() -> Iterator[None]:
    """Collect only by a timer of the event loop; restore automatic collection of all objects at the end."""
    was_complete, collector = gc.get_freeze_count() == 0, _Collector()
    try:
        yield
    finally:
        collector.timer.stop()
        if was_complete:
            gc.unfreeze()
        gc.enable()


def return_large_blocks() -> None:
    """Let glibc return freed blocks above 128 KiB to the system, and keep one heap for all threads.

    By default it raises this limit to the size of the largest freed block, and has a heap for each thread. After 800
    actions of a user, these heaps held 260 MiB of free memory between 180 MiB in use; with one heap, 3 MiB.
    """
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None) if sys.platform == "linux" else None
    if mallopt is not None:
        mallopt(_ARENA_MAX, 1)
        mallopt(_MMAP_THRESHOLD, _LARGE)
