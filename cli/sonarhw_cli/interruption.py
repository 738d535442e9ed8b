"""Handling of Ctrl-C, SIGTERM and SIGHUP during work that must be completed or cleaned up, such as a recording.

It imports little, because `entry` needs SIGNALS before it imports other modules.
"""

import signal
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from types import FrameType

# Windows has no SIGHUP
SIGNALS = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]
LAST_WORDS: list[Callable[[], str]] = []  # lines for standard error if the process exits without unwinding


class Interruption:
    """Signal handler: the first signal calls `stop`, the second raises KeyboardInterrupt at once."""

    def __init__(self, stop: Callable[[], None]) -> None:
        self.wanted = False
        self._stop = stop
        self._at_once = False

    def __call__(self, _number: int, _frame: FrameType | None) -> None:
        """Handle a signal."""
        if self.wanted or self._at_once:
            self.wanted = True
            raise KeyboardInterrupt
        self.wanted = True
        self._stop()

    @contextmanager
    def at_once(self) -> Iterator[None]:
        """Let every signal raise KeyboardInterrupt. For code that may block and that is safe to interrupt."""
        self._at_once = True
        try:
            yield
        finally:
            self._at_once = False


@contextmanager
def interruption(stop: Callable[[], None]) -> Iterator[Interruption]:
    """Let any of SIGNALS call `stop`, and then raise KeyboardInterrupt at the end of the block."""
    handler = Interruption(stop)
    with handled_by(handler):
        try:
            yield handler
        finally:
            if handler.wanted:
                # other errors are consequences of the interruption
                raise KeyboardInterrupt from None


@contextmanager
def sigterm_exits() -> Iterator[None]:
    """Let SIGTERM and SIGHUP end a server with exit status 0, cleaned up."""
    received = False

    def unwind(_number: int, _frame: FrameType | None) -> None:
        nonlocal received
        received = True
        raise SystemExit

    with handled_by(unwind, [number for number in SIGNALS if number != signal.SIGINT]):
        try:
            yield
        except Exception:
            if received:  # a library that compiles wraps the error in another one
                raise SystemExit from None
            raise


@contextmanager
def handled_by(handler: Callable[[int, FrameType | None], object], signals: Sequence[int] = SIGNALS) -> Iterator[None]:
    """Install `handler` for `signals` until the block ends. A SIGHUP that nohup ignores stays ignored."""
    hangup = getattr(signal, "SIGHUP", None)
    taken = [number for number in signals if number != hangup or signal.getsignal(number) != signal.SIG_IGN]
    before = {number: signal.signal(number, handler) for number in taken}
    try:
        yield
    finally:
        for number, old in before.items():
            signal.signal(number, old)
