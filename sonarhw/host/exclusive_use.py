"""Exclusive use of a scanner: one thread, and one action at a time."""

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext

from sonarhw.errors import DeviceError


class ExclusiveUse:
    """Excludes other threads during a sequence of actions, and other actions during an action."""

    def __init__(self, url: str, at_end: Callable[[], None] = lambda: None) -> None:
        """`url` is for errors. `at_end` is called at the end of each sequence, before another one can begin."""
        self.stop_wanted = False  # not an Event: a signal handler may run while the lock of an Event is held
        self._url = url
        self._at_end = at_end
        self._lock = threading.Lock()
        self._sequence_of: int | None = None  # the thread for which the lock is held
        self._acting = False

    @contextmanager
    def sequence(self) -> Iterator[None]:
        """Combine the actions of this thread in a block. Raises DeviceError while another sequence runs."""
        if not self.claim():
            raise self._busy()
        self.stop_wanted, self._sequence_of = False, threading.get_ident()
        try:
            yield
        finally:
            try:
                self._at_end()
            finally:
                self._sequence_of = None
                self.release()

    @contextmanager
    def action(self) -> Iterator[None]:
        """Enclose an action, in a sequence of its own if there is none. Raises DeviceError during another action."""
        with nullcontext() if self._sequence_of == threading.get_ident() else self.sequence():
            if self._acting:
                raise self._busy()
            self._acting = True
            try:
                yield
            finally:
                self._acting = False

    def claim(self) -> bool:
        """Prevent sequences until `release`, and return True; return False if one runs."""
        return self._lock.acquire(blocking=False)

    def release(self) -> None:
        """Allow sequences again."""
        self._lock.release()

    def _busy(self) -> DeviceError:
        return DeviceError(f"{self._url}: is busy; stop it or wait until it has finished")
