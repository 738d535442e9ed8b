"""How long tests wait before they call something hung. No test asserts anything about this time."""

import threading
import time
from collections.abc import Callable

HANG = 120.0  # s: nothing here takes so long, however busy the machine is
_LOOK = 0.01  # s from one look to the next


def wait_until(done: Callable[[], object]) -> None:
    """Look again and again until `done` is true; fail after HANG."""
    deadline = time.monotonic() + HANG
    while not done():
        assert time.monotonic() < deadline, f"not done within {HANG:g} s"
        threading.Event().wait(_LOOK)
