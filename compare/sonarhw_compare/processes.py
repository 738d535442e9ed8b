"""Processes that call functions for this one, each with a part of the arguments.

They are started with the interpreter, not with `multiprocessing`: a script that calls the library then needs no `if
__name__ == "__main__"`, and Ctrl-C, which a terminal sends to all of its processes, reaches this one only.
"""

import os
import pickle
import subprocess
import sys
import threading
import time
import traceback
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import FIRST_COMPLETED, ThreadPoolExecutor, wait
from contextlib import AbstractContextManager
from pathlib import Path
from queue import SimpleQueue
from typing import Any, BinaryIO, TypeVar, cast

from sonarhw_sim.compiled import core_count, use_one_thread

from sonarhw.errors import InputError, SonarError, WorkersLost
from sonarhw.files import MOST_FOREIGN, open_input

# of numeric libraries, so that each process uses one core
_ONE_THREAD = dict.fromkeys(("NUMBA_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
_BETWEEN_CHECKS = 0.05  # s
_RUN = "import sys; sys.path[:] = {!r}; from sonarhw_compare.processes import run; run()"


T = TypeVar("T")


class Processes(AbstractContextManager["Processes"]):
    """Processes with one thread each. They end with the context, and when this process ends for any reason."""

    def __init__(self, count: int, kept: Any) -> None:
        """Start `count` processes, and send `kept` to each, the first argument of every function."""
        self._processes: list[subprocess.Popen[bytes]] = []
        self._idle: SimpleQueue[subprocess.Popen[bytes]] = SimpleQueue()
        self._threads = ThreadPoolExecutor(count)  # one waits for each process
        try:
            for _ in range(count):
                self._processes.append(_started())
                self._idle.put(self._processes[-1])
            self.keep(kept)
        except BaseException:
            self.close()
            raise

    def __exit__(self, *_: object) -> None:
        self.close()

    def __len__(self) -> int:
        return len(self._processes)

    def keep(self, kept: Any) -> None:
        """Send another first argument of every function from now on."""
        idle = [self._idle.get() for _ in self._processes]  # waits for calls in progress
        for process in idle:
            self._idle.put(process)
            _send(process, (None, kept))

    def answers(
        self,
        function: Callable[..., Any],
        parts: Sequence[tuple[Any, ...]],
        check: Callable[[], None] = lambda: None,
    ) -> Generator[tuple[int, Any], None, None]:
        """Yield the number of each part with `function(kept, *part)`, as soon as it is complete.

        Each process takes the next part when it has finished one. Raises the first error that the function raised, and
        WorkersLost if a process was killed. `check` is called while the processes compute. After an exception from it,
        or if the answers are not taken to the end, only `close` may be called.
        """
        calls = {self._threads.submit(self._call, function, part): number for number, part in enumerate(parts)}
        waiting = set(calls)
        try:
            while waiting:
                done, waiting = wait(waiting, _BETWEEN_CHECKS, FIRST_COMPLETED)
                check()
                for call in sorted(done, key=lambda call: calls[call]):
                    yield calls[call], call.result()
        finally:
            for call in waiting:
                call.cancel()

    def results(
        self, function: Callable[..., Any], parts: Sequence[tuple[Any, ...]], check: Callable[[], None]
    ) -> list[Any]:
        """Return all `answers`, in the order of their parts."""
        answers = dict(self.answers(function, parts, check))
        return [answers[number] for number in range(len(parts))]

    def close(self) -> None:
        """End the processes at once, also while they compute."""
        for process in self._processes:
            process.kill()
        self._threads.shutdown(cancel_futures=True)  # they have read the end of all answers
        for process in self._processes:
            process.communicate()  # closes the pipes, and waits
        self._processes = []

    def _call(self, function: Callable[..., Any], part: tuple[Any, ...]) -> Any:
        process = self._idle.get()  # there is one, because there are as many threads as processes
        try:
            _send(process, (function, part))
            succeeded, answer = _answer(process)
        finally:
            self._idle.put(process)
        if not succeeded:
            raise answer
        return answer


def _send(process: "subprocess.Popen[bytes]", call: object) -> None:
    assert process.stdin is not None
    try:
        pickle.dump(call, process.stdin)
        process.stdin.flush()
    except BrokenPipeError as error:
        raise _lost() from error


def _answer(process: "subprocess.Popen[bytes]") -> tuple[bool, Any]:
    assert process.stdout is not None
    try:
        succeeded, answer = pickle.load(process.stdout)
    except (EOFError, pickle.UnpicklingError) as error:
        raise _lost() from error
    return succeeded, answer


def _lost() -> WorkersLost:
    return WorkersLost("a process that computes was killed, perhaps because memory was short; start again")


def _started() -> "subprocess.Popen[bytes]":
    hidden: dict[str, Any] = {"start_new_session": True}
    if sys.platform == "win32":
        hidden = {"creationflags": subprocess.CREATE_NO_WINDOW}
    return subprocess.Popen(
        [sys.executable, "-c", _RUN.format(sys.path)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        env=os.environ | _ONE_THREAD,
        **hidden,
    )


# One call of foreign code, such as a parser, with limits: it can crash, loop or need all memory.


_MOST_MEMORY = 4 * 2**30  # bytes of address space


class Unfinished(Exception):
    """A call in a process of its own crashed, took too long or needed too much memory; the text is a clause."""


def call_apart(function: Callable[..., T], *arguments: Any, within: float) -> T:
    """Return `function(*arguments)` from a process of its own.

    Raises what the function raises, and Unfinished after `within` s, with more than 4 GiB of memory (not on Windows),
    or if the process crashes.
    """
    until = time.monotonic() + within

    def check() -> None:
        if time.monotonic() > until:
            raise Unfinished(f"takes more than {within:.0f} s")

    try:
        with Processes(1, None) as processes:
            ((_, result),) = processes.answers(_call_in_limits, [(function, arguments)], check)
    except WorkersLost as error:
        raise Unfinished("crashes its parser, or needs too much memory") from error
    except MemoryError as error:
        raise Unfinished(f"needs more than {_MOST_MEMORY / 2**30:g} GiB of memory") from error
    return cast(T, result)


def _call_in_limits(kept: None, function: Callable[..., T], arguments: tuple[Any, ...]) -> T:
    if sys.platform != "win32":
        import resource

        _, most = resource.getrlimit(resource.RLIMIT_AS)
        limit = _MOST_MEMORY if most == resource.RLIM_INFINITY else min(most, _MOST_MEMORY)
        resource.setrlimit(resource.RLIMIT_AS, (limit, most))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    return function(*arguments)


# Parsers that are not ours read a file in a process of its own: a damaged file can crash them, or let them compute
# without end.


_PARSED_WITHIN = 30.0  # s
_SLOWEST = 5e6  # bytes/s beyond that


def parse_apart(parse: Callable[..., T], file: Path, expected: str, *arguments: object) -> T:
    """Return `parse(file, *arguments)` from a process of its own. `file` may be a folder. Raises InputError."""
    try:
        size = sum(_size(part) for part in (sorted(file.iterdir()) if file.is_dir() else [file]))
        return call_apart(parse, file, *arguments, within=_PARSED_WITHIN + size / _SLOWEST)
    except SonarError:
        raise
    except OSError as error:
        raise InputError(f"{file}: cannot be read: {error.strerror or error}; expected {expected}") from error
    except Unfinished as error:
        raise InputError(f"{file}: is not {expected}: it {error}; the file is probably damaged") from error
    except Exception as error:  # parsers raise anything for damaged files
        # without the advice of later sentences
        first = str(error).partition("\n")[0].partition(". ")[0] or type(error).__name__
        raise InputError(f"{file}: is not {expected}: {first}") from error


def _size(file: Path) -> int:
    """Return the size of a regular file, bytes. Raises OSError for what is none."""
    with open_input(file, MOST_FOREIGN) as opened_file:
        return os.fstat(opened_file.fileno()).st_size


class LateProcesses(AbstractContextManager["LateProcesses"]):
    """Processes for work of unknown size: they start once `least` units of it are done, so that more is likely."""

    def __init__(self, most: int, least: int) -> None:
        """At most `most` processes, and one for each core; none on one core."""
        self._count, self._least, self._done = min(most, core_count()), least, 0
        self._started: Processes | None = None
        self._owner: object = None  # of what the processes keep

    def __exit__(self, *_: object) -> None:
        if self._started is not None:
            self._started.close()

    def for_work(self, units: int, owner: object, kept: Callable[[], Any]) -> Processes | None:
        """Return the processes for so many more units of work; None if it is still too little.

        `kept` returns what the processes receive when the owner of the work is another one (`Processes`).
        """
        if self._started is None and self._count > 1 and self._done >= self._least:
            self._started, self._owner = Processes(self._count, kept()), owner
        self._done += units
        if self._started is not None and self._owner is not owner:
            self._started.keep(kept())
            self._owner = owner
        return self._started


# What each of the processes executes.


def run() -> None:
    """Answer each call with its result, or with the error that it raised; end with the process that calls."""
    calls, answers = sys.stdin.buffer, sys.stdout.buffer
    sys.stdout = sys.stderr  # what a function prints is not an answer
    use_one_thread()
    received: SimpleQueue[tuple[Any, Any]] = SimpleQueue()
    threading.Thread(target=_receive, args=(calls, received), daemon=True).start()
    try:
        _compute(received, answers)
    except BrokenPipeError:
        os._exit(0)  # the process that calls has ended: nothing reads the rest of an answer


def _receive(calls: BinaryIO, received: "SimpleQueue[tuple[Any, Any]]") -> None:
    """Pass the pickled calls on. End this process at the end of `calls`, also while it computes."""
    try:
        while True:
            received.put(pickle.load(calls))
    except (EOFError, pickle.UnpicklingError):
        os._exit(0)
    except Exception:  # noqa: BLE001 - a call that cannot be read: this process ends, with its reason
        traceback.print_exc()
        os._exit(1)


def _compute(received: "SimpleQueue[tuple[Any, Any]]", answers: BinaryIO) -> None:
    """Answer calls, `(function, arguments)`, each with a pickled `(succeeded, result or error)`.

    `(None, kept)` has no answer: `kept` is the first argument of every function from then on.
    """
    kept: Any = None
    while True:
        function, arguments = received.get()
        if function is None:
            kept = arguments
            continue
        try:
            answer = True, function(kept, *arguments)
        except Exception as error:  # noqa: BLE001 - raised again by the process that calls
            error.add_note(traceback.format_exc())  # the frames of this process
            answer = False, error
        pickle.dump(answer, answers)
        answers.flush()
