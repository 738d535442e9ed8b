"""The entry point of the `sonarhw` command. Ctrl-C ends it at any time, without a traceback and with status 130.

SIGTERM and SIGHUP do the same, so that files which are being written are removed.

KeyboardInterrupt alone does not ensure this. It may be raised during an import, and libraries that compile or unpickle
wrap it in other errors, print it or swallow it. This module therefore stores that a signal has arrived, and treats
every later error as its consequence. It imports almost nothing, so that its handler is installed before other modules
load.
"""

import _thread  # threading takes locks, which the interrupted code may hold
import os
import signal
import sys
import time
from collections.abc import Callable
from io import TextIOWrapper
from types import FrameType

from sonarhw_cli.interruption import SIGNALS

INTERRUPTED = 130  # ExitStatus.INTERRUPTED, which is not imported before the handler is installed
UNWINDING = 3.0  # s for cleaning up after Ctrl-C; only a library that swallowed the KeyboardInterrupt takes longer


class Interrupt:
    """Handler of SIGNALS outside `console.interruption`. The first signal unwinds the command, the second exits."""

    def __init__(self) -> None:
        self.received = False
        self.started = False  # whether there may be something to clean up
        self._threads: list[_thread.LockType] = []  # each is free once its thread runs

    def __call__(self, number: int, frame: FrameType | None) -> None:
        """Handle a signal."""
        if self.received or not self.started:
            _exit_at_once()
        if _in_result_of_kernel(frame):
            self._threads.append(_started(_repeat, number))
            return
        self.received = True
        # errors in destructors and callbacks are consequences of the signal: do not print them
        sys.unraisablehook = lambda _: None
        sys.excepthook = lambda *_: None
        self._threads += [_started(_end_later), _started(_end_at_next, _next_signal())]
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


def _in_result_of_kernel(frame: FrameType | None) -> bool:
    """Return whether numba is converting the result of a kernel.

    It looks up types in Python, does not check for an error there, and crashes (numba 0.68). A signal that arrives
    while a kernel runs is handled just then.
    """
    while frame is not None and frame.f_code.co_name != "_numba_unpickle":
        frame = frame.f_back
    return frame is not None


def _repeat(number: int) -> None:
    time.sleep(0.001)
    _thread.interrupt_main(signal.Signals(number))


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
    _exit_at_once()


def _end_later() -> None:
    time.sleep(UNWINDING)
    _exit_at_once()


def _exit_at_once() -> None:
    """Exit without unwinding. Unfinished files are removed, if the module that writes them is loaded."""
    remove = getattr(sys.modules.get("sonarhw.files"), "remove_unfinished", None)
    if remove is not None:
        remove()
    os._exit(INTERRUPTED)


def _occupy_closed_streams() -> None:
    """Open the null device in place of standard streams that the shell has closed.

    Otherwise a file that is opened later would get the number of a standard stream, and what libraries print.
    """
    while (number := os.open(os.devnull, os.O_RDONLY)) <= 2:
        pass
    os.close(number)


def main() -> None:
    """Run the `sonarhw` command and exit with its status."""
    _occupy_closed_streams()
    interrupt = Interrupt()
    # respect an inherited SIG_IGN, such as that of nohup
    handled = [number for number in SIGNALS if signal.getsignal(number) != signal.SIG_IGN]
    for number in handled:
        signal.signal(number, interrupt)
    status = _run(interrupt)
    for number in handled:
        # the work is complete: a late signal must not change the status
        signal.signal(number, signal.SIG_IGN)
    interrupt.wait_for_threads()
    sys.exit(INTERRUPTED if interrupt.received else status)


def _run(interrupt: Interrupt) -> int:
    from sonarhw_cli.app import run

    if isinstance(sys.stdout, TextIOWrapper):
        # a terminal with few characters shows the others as escapes
        sys.stdout.reconfigure(errors="backslashreplace")
    try:
        interrupt.started = True
        return run()
    except BaseException:
        if not interrupt.received:
            raise
        return INTERRUPTED
