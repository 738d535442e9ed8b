"""The way in: Ctrl-C ends every command quietly with status 130, from its first moment to its last.

KeyboardInterrupt alone does not: it comes amid imports, and in libraries that compile or unpickle it is wrapped into
other errors, printed or lost. So here it is noted that Ctrl-C came, and whatever follows is taken for its
consequence. This module imports next to nothing, so that it stands before all else is loaded.
"""

import _thread  # threading takes locks, which the code that a signal came amid may hold
import os
import signal
import sys
import time
from types import FrameType

INTERRUPTED = 130
UNWINDING = 3.0  # s for a command to tidy up; longer only where a library has lost the KeyboardInterrupt


class Interrupt:
    """What Ctrl-C does outside of `console.interruption`: the first unwinds the command, the second ends it at once."""

    def __init__(self) -> None:
        self.came = False
        self.begun = False  # whether there may be something to tidy up

    def __call__(self, _number: int, _frame: FrameType | None) -> None:
        """Take a signal."""
        if self.came or not self.begun:
            os._exit(INTERRUPTED)
        self.came = True
        # what destructors and callbacks make of it is no news
        sys.unraisablehook = lambda _: None
        sys.excepthook = lambda *_: None
        _thread.start_new_thread(_end_later, ())
        _thread.start_new_thread(_end_at_next, (_next_signal(),))
        raise KeyboardInterrupt


def _next_signal() -> int:
    """A descriptor that has a byte when the next signal comes.

    The handler is called between two steps of Python only: not while a library is busy, and not in a sleep that begins
    just as the signal comes.
    """
    told, tell = os.pipe()
    if hasattr(os, "set_blocking"):  # Windows asks for it from Python 3.12 on, and does not need it
        os.set_blocking(tell, False)
    signal.set_wakeup_fd(tell)
    return told


def _end_at_next(told: int) -> None:
    os.read(told, 1)
    os._exit(INTERRUPTED)


def _end_later() -> None:
    time.sleep(UNWINDING)
    os._exit(INTERRUPTED)


def main() -> None:
    """Entry point of the `sonarhw` command."""
    interrupt = Interrupt()
    # who ignores it for us, as nohup does with SIGHUP, means it
    heeded = signal.getsignal(signal.SIGINT) != signal.SIG_IGN
    if heeded:
        signal.signal(signal.SIGINT, interrupt)
    status = _run(interrupt)
    if heeded:
        # what was to be done is done
        signal.signal(signal.SIGINT, signal.SIG_IGN)
    sys.exit(INTERRUPTED if interrupt.came else status)


def _run(interrupt: Interrupt) -> int:
    from sonarhw_cli.app import run

    try:
        interrupt.begun = True
        return run()
    except BaseException:
        if not interrupt.came:
            raise
        return INTERRUPTED
