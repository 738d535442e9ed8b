"""The entry point of the `sonarhw` command. Ctrl-C ends it at any time, without a traceback and with status 130.

SIGTERM and SIGHUP do the same, so that files which are being written are removed.

KeyboardInterrupt alone does not ensure this. It may be raised during an import, and libraries that compile or unpickle
wrap it in other errors, print it or swallow it. This module therefore stores that a signal has arrived, and treats
every later error as its consequence. It imports almost nothing, so that its handler is installed before other modules
load.
"""

import _thread  # threading takes locks, which the interrupted code may hold
import atexit
import os
import signal
import sys
import time
from collections.abc import Callable
from io import TextIOWrapper
from types import FrameType

from sonarhw_cli.interruption import LAST_WORDS, SIGNALS

INTERRUPTED = 130  # ExitStatus.INTERRUPTED, which is not imported before the handler is installed
UNWINDING = 1.5  # s from the first signal, or from the end of the work, until the process exits, whatever still runs
_LAST_WORDS = 0.1  # s for printing what was kept; standard error may accept nothing
_HANGUP = getattr(signal, "SIGHUP", None)  # Windows has none


class Interrupt:
    """Handler of SIGNALS outside `interruption`, and the watch that ends the process.

    The first signal unwinds the command. UNWINDING later, or at the second signal, the process exits without
    unwinding. A second SIGHUP does not count: a closed terminal and its shell both send one.
    """

    def __init__(self) -> None:
        self.received = False
        self.started = False  # whether there may be something to clean up
        self.status: int | None = None  # once the work is complete: a late signal must not change it
        self._repeated = 0  # signals that the handler sends to itself
        self._threads: list[_thread.LockType] = []  # each is free once its thread runs

    def __call__(self, number: int, frame: FrameType | None) -> None:
        """Handle a signal."""
        if not self.started:
            _exit_at_once(INTERRUPTED)
        if self.received or self.status is not None:
            return
        if _in_unsafe_code(frame):
            self._repeated += 1
            self._threads.append(_started(_repeat, number))
            return
        self.received = True
        # errors in destructors and callbacks are consequences of the signal: do not print them
        sys.unraisablehook = lambda _: None
        sys.excepthook = lambda *_: None
        raise KeyboardInterrupt

    def watch(self) -> None:
        """Watch for signals in a thread.

        Python calls no signal handler while the main thread is in a library call, nor while it finalizes.
        """
        reader, writer = os.pipe()
        if hasattr(os, "set_blocking"):  # missing on Windows before Python 3.12, and not needed there
            os.set_blocking(writer, False)
        signal.set_wakeup_fd(writer)
        self._threads.append(_started(self._watch, reader))

    def end_soon(self) -> None:
        """End the process UNWINDING from now: a thread of a library may never end."""
        self._threads.append(_started(self._end_later))

    def end_now(self) -> None:
        """End the process, if the work is complete: libraries need seconds to free their memory on a busy machine."""
        if self.status is not None:
            if sys.stderr is not None:
                sys.stderr.flush()
            os._exit(self.status)

    def wait_for_threads(self) -> None:
        """Wait until the threads of the handler run: Python can crash if it exits while one is starting."""
        for thread in self._threads:
            thread.acquire()

    def _watch(self, signals: int) -> None:
        first = True
        while number := os.read(signals, 1):
            if number[0] not in SIGNALS:
                continue
            if self._repeated:
                self._repeated -= 1
            elif first:
                first = False
                self._threads.append(_started(self._end_later))
            elif number[0] != _HANGUP:
                _exit_at_once(self._exit_status)

    def _end_later(self) -> None:
        time.sleep(UNWINDING)
        _exit_at_once(self._exit_status)

    @property
    def _exit_status(self) -> int:
        return INTERRUPTED if self.status is None else self.status


def _started(function: Callable[..., None], *arguments: object) -> _thread.LockType:
    """Call `function` in a thread. Return a lock that the thread releases first."""
    running = _thread.allocate_lock()
    running.acquire()

    def run() -> None:
        running.release()
        function(*arguments)

    _thread.start_new_thread(run, ())
    return running


def _in_unsafe_code(frame: FrameType | None) -> bool:
    """Return whether numba is converting the result of a kernel, or Qt for Python is being imported.

    Both run Python, do not check for an error there, and crash (numba 0.68, shiboken 6). A signal that arrives while
    a kernel runs is handled just then.
    """
    while frame is not None:
        code = frame.f_code
        if code.co_name == "_numba_unpickle" or "shiboken" in code.co_filename or _imports_qt(frame):
            return True
        frame = frame.f_back
    return False


def _imports_qt(frame: FrameType) -> bool:
    """Return whether a frame is that of Python's import machinery which loads a module of Qt for Python."""
    if "importlib" not in frame.f_code.co_filename:
        return False
    names = (frame.f_locals.get("name"), getattr(frame.f_locals.get("spec"), "name", None))
    return any(isinstance(name, str) and name.partition(".")[0] in ("PySide6", "shiboken6") for name in names)


def _repeat(number: int) -> None:
    time.sleep(0.001)
    _thread.interrupt_main(signal.Signals(number))


def _exit_at_once(status: int) -> None:
    """Exit without unwinding. Unfinished files are removed, if the module that writes them is loaded."""
    remove = getattr(sys.modules.get("sonarhw.files"), "remove_unfinished", None)
    if remove is not None:
        remove()
    printed = _thread.allocate_lock()
    printed.acquire()
    _started(_print_last_words, printed)
    printed.acquire(timeout=_LAST_WORDS)
    os._exit(status)


def _print_last_words(printed: _thread.LockType) -> None:
    try:
        for words in LAST_WORDS:
            os.write(2, f"{words()}\n".encode(errors="backslashreplace"))
    finally:
        printed.release()


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
    atexit.register(interrupt.end_now)  # the first one registered is called last
    # respect an inherited SIG_IGN, such as that of nohup
    handled = [number for number in SIGNALS if signal.getsignal(number) != signal.SIG_IGN]
    for number in handled:
        signal.signal(number, interrupt)
    interrupt.watch()
    try:
        status = _run(interrupt)
        interrupt.status = INTERRUPTED if interrupt.received else status
    except KeyboardInterrupt:  # between two of these lines
        interrupt.status = INTERRUPTED
    # after the threads have ended, which a signal must be able to interrupt
    atexit.register(_ignore, handled)
    interrupt.end_soon()
    interrupt.wait_for_threads()
    sys.exit(interrupt.status)


def _ignore(signals: list[signal.Signals]) -> None:
    for number in signals:
        signal.signal(number, signal.SIG_IGN)


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
