"""Processes that call functions for this one, each with a part of the arguments.

They are started with the interpreter, not with `multiprocessing`: a script that calls the library then needs no
`if __name__ == "__main__"`, and Ctrl-C, which a terminal sends to all of its processes, reaches this one only.
"""

import os
import pickle
import subprocess
import sys
from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from typing import Any

from sonarhw.errors import WorkersLost

# of numeric libraries, so that each process uses one core
ONE_THREAD = dict.fromkeys(("NUMBA_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
_BETWEEN_CHECKS = 0.05  # s
_RUN = "import sys; sys.path[:] = {!r}; from sonarhw_compare.processes.compute_loop import run; run()"


class ComputeProcesses:
    """Processes with one thread each. They end with `close`, and when this process ends for any reason."""

    def __init__(self, count: int, kept: Any) -> None:
        """Start `count` processes, and send `kept` to each, the first argument of every function."""
        self._processes: list[subprocess.Popen[bytes]] = []
        self._threads = ThreadPoolExecutor(count)  # one waits for each process
        try:
            for _ in range(count):
                self._processes.append(_started())
            self.keep(kept)
        except BaseException:
            self.close()
            raise

    def __len__(self) -> int:
        return len(self._processes)

    def keep(self, kept: Any) -> None:
        """Send another first argument of every function from now on."""
        for process in self._processes:
            _send(process, (None, kept))

    def results(
        self, function: Callable[..., Any], parts: Sequence[tuple[Any, ...]], check: Callable[[], None]
    ) -> list[Any]:
        """Return `function(kept, *part)` for each part; each process takes the next part when it has finished one.

        Raises the first error that the function raised, and WorkersLost if a process was killed. `check` is called
        while the processes compute; after an exception from it, only `close` may be called.
        """
        waiting = deque(enumerate(parts))
        answers: dict[int, tuple[bool, Any]] = {}

        def compute(process: "subprocess.Popen[bytes]") -> None:
            while waiting:
                try:
                    number, part = waiting.popleft()
                except IndexError:  # another thread took the last one
                    return
                _send(process, (function, part))
                answers[number] = _answer(process)
                if not answers[number][0]:
                    waiting.clear()

        working = [self._threads.submit(compute, process) for process in self._processes[: len(parts)]]
        while wait(working, _BETWEEN_CHECKS).not_done:
            check()
        for one in working:
            one.result()  # raises WorkersLost
        for number in sorted(answers):
            succeeded, answer = answers[number]
            if not succeeded:
                raise answer
        return [answers[number][1] for number in range(len(parts))]

    def close(self) -> None:
        """End the processes at once, also while they compute."""
        for process in self._processes:
            process.kill()
        self._threads.shutdown()  # they have read the end of all answers
        for process in self._processes:
            process.communicate()  # closes the pipes, and waits
        self._processes = []


def _send(process: "subprocess.Popen[bytes]", one: Any) -> None:
    assert process.stdin is not None
    try:
        pickle.dump(one, process.stdin)
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
        env=os.environ | ONE_THREAD,
        **hidden,
    )
