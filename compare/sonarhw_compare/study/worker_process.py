"""The first moments of a worker process.

Takes one end of a pipe; the process that began this one holds the other open. Not part of a package that computes, so
that a worker can be told to end while it still loads that.
"""

import os
import signal
import threading
from multiprocessing.connection import Connection, wait


def begin_worker(listener: Connection) -> None:
    """Leave Ctrl-C to the process that began this one, and end when that closes its end of the pipe or is gone."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with, args=(listener,), daemon=True).start()


def _end_with(listener: Connection) -> None:
    # nothing is ever sent: it is ready when the other end is closed
    wait([listener])
    os._exit(1)
