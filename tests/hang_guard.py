"""The time after which tests report that something hangs. No test depends on its length."""

import threading
import time
from collections.abc import Callable

HANG = 600.0  # s; longer than any step of a test, also if eight processes share each core
_LOOK = 0.01  # s between two checks


def wait_until(done: Callable[[], object]) -> None:
    """Wait until `done` returns a true value; fail after HANG."""
    deadline = time.monotonic() + HANG
    while not done():
        assert time.monotonic() < deadline, f"not done within {HANG:g} s"
        threading.Event().wait(_LOOK)
