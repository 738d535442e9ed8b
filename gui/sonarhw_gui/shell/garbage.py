"""Python's collector of cycles, kept to the window's thread and to the time between two of its events.

Left to itself it runs wherever an allocation sets it off: in a thread that predicts, or inside Qt while that takes a
window apart. What it frees there may be a widget, and that ends the program.
"""

import gc
from collections.abc import Iterator
from contextlib import contextmanager

from pyqtgraph.util.garbage_collector import GarbageCollector

_INTERVAL = 1.0  # s


@contextmanager
def collected_between_events() -> Iterator[None]:
    """Collect by a timer of the event loop and nowhere else; afterwards as ever."""
    collector = GarbageCollector(_INTERVAL)
    try:
        yield
    finally:
        collector.timer.stop()
        gc.enable()
