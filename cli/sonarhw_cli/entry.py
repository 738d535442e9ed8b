"""The entry point of the `sonarhw` command. Ctrl-C ends it at any time, without a traceback and with status 130.

KeyboardInterrupt alone does not ensure this. It may be raised during an import, and libraries that compile or unpickle
wrap it in other errors, print it or swallow it. This module therefore stores that Ctrl-C was pressed, and treats every
later error as its consequence. It imports almost nothing, so that its handler is installed before other modules load.
"""

import _thread  # threading takes locks, which the interrupted code may hold
import os
import signal
import sys
import time
from collections.abc import Callable
from types import FrameType

INTERRUPTED = 130
UNWINDING = 3.0  # s for cleaning up after Ctrl-C; only a library that swallowed the KeyboardInterrupt takes longer


class Interrupt:
    """Handler of Ctrl-C outside `console.interruption`. The first Ctrl-C unwinds the command, the second exits."""

    def __init__(self) -> None:
        self.received = False
        self.started = False  # whether there may be something to clean up
        self._threads: list[_thread.LockType] = []  # each is free once its thread runs

    def __call__(self, _number: int, _frame: FrameType | None) -> None:
        """Handle a signal."""
        if self.received or not self.started:
            os._exit(INTERRUPTED)
        self.received = True
        # errors in destructors and callbacks are consequences of Ctrl-C: do not print them
        sys.unraisablehook = lambda _: None
        sys.excepthook = lambda *_: None
        self._threads = [_started(_end_later), _started(_end_at_next, _next_signal())]
        raise KeyboardInterrupt

    def wait_for_threads(self) -> None:
        """Wait until the threads of the handler run: Python can crash if it exits while one is starting."""
        for thread in self._threads:
            thread.acquire()


def _started(function: Callable[..., None], *arguments: int) -> _thread.LockType:
    """Call `function` in a thread. Return a lock that the thread releases first."""
    running = _thread.allocate_lock()
    running.acquire()

    def run() -> None:
        running.release()
        function(*arguments)

    _thread.start_new_thread(run, ())
    return running


def _next_signal() -> int:
    """Return a file descriptor that becomes readable at the next signal.

    Python does not call signal handlers while a library call is running, or in a sleep that starts just as the signal
    arrives.
    """
    reader, writer = os.pipe()
    if hasattr(os, "set_blocking"):  # missing on Windows before Python 3.12, and not needed there
        os.set_blocking(writer, False)
    signal.set_wakeup_fd(writer)
    return reader


def _end_at_next(signal_pipe: int) -> None:
    os.read(signal_pipe, 1)
    os._exit(INTERRUPTED)


def _end_later() -> None:
    time.sleep(UNWINDING)
    os._exit(INTERRUPTED)


def main() -> None:
    """Run the `sonarhw` command and exit with its status."""
    interrupt = Interrupt()
    # respect an inherited SIG_IGN
    handled = signal.getsignal(signal.SIGINT) != signal.SIG_IGN
    if handled:
        signal.signal(signal.SIGINT, interrupt)
    status = _run(interrupt)
    if handled:
        # the work is complete: a late Ctrl-C must not change the status
        signal.signal(signal.SIGINT, signal.SIG_IGN)
    interrupt.wait_for_threads()
    sys.exit(INTERRUPTED if interrupt.received else status)


def _run(interrupt: Interrupt) -> int:
    from sonarhw_cli.app import run

    try:
        interrupt.started = True
        return run()
    except BaseException:
        if not interrupt.received:
            raise
        return INTERRUPTED
