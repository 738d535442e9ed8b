"""Start of a worker process: it ignores Ctrl-C and ends with its parent process.

This module imports nothing that computes, so that a worker can end while it still loads those modules.
"""

import os
import signal
import threading
from multiprocessing.connection import Connection, wait


def begin_worker(listener: Connection) -> None:
    """Leave Ctrl-C to the parent process, and end when the parent closes its end of the pipe or no longer exists."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with, args=(listener,), daemon=True).start()


def _end_with(listener: Connection) -> None:
    # nothing is ever sent, so this returns when the other end is closed
    wait([listener])
    os._exit(1)
