"""Run Python's garbage collector only in the window's thread, between two events.

Otherwise any allocation may trigger it, in a worker thread or inside Qt while it destroys a window. If it frees a
widget there, the program crashes.
"""

import gc
from collections.abc import Iterator
from contextlib import contextmanager

from pyqtgraph.util.garbage_collector import GarbageCollector

_INTERVAL = 1.0  # s


@contextmanager
def collected_between_events() -> Iterator[None]:
    """Collect only by a timer of the event loop; restore automatic collection at the end."""
    collector = GarbageCollector(_INTERVAL)
    try:
        yield
    finally:
        collector.timer.stop()
        gc.enable()
