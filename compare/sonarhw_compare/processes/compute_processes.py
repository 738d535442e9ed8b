"""Processes that call functions for this one, each with a part of the arguments.

They are started with the interpreter, not with `multiprocessing`: a script that calls the library then needs no
`if __name__ == "__main__"`, and Ctrl-C, which a terminal sends to all of its processes, reaches this one only.
"""

import os
import pickle
import subprocess
import sys
from collections.abc import Callable, Sequence
from typing import Any

from sonarhw.errors import WorkersLost

# of numeric libraries, so that each process uses one core
ONE_THREAD = dict.fromkeys(("NUMBA_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
_RUN = "import sys; sys.path[:] = {!r}; from sonarhw_compare.processes.compute_loop import run; run()"


class ComputeProcesses:
    """Processes with one thread each. They end with `close`, and when this process ends for any reason."""

    def __init__(self, count: int, kept: Any) -> None:
        """Start `count` processes, and send `kept` to each, the first argument of every function."""
        self._processes: list[subprocess.Popen[bytes]] = []
        try:
            for _ in range(count):
                self._processes.append(_started())
            self._send([kept] * count)
        except BaseException:
            self.close()
            raise

    def __len__(self) -> int:
        return len(self._processes)

    def results(self, function: Callable[..., Any], parts: Sequence[tuple[Any, ...]]) -> list[Any]:
        """Return `function(kept, *part)` for each part, computed at once; at most one part for each process.

        Raises the first error that the function raised, and WorkersLost if a process was killed.
        """
        self._send([(function, part) for part in parts])
        answers = [self._answer(process) for process in self._processes[: len(parts)]]
        for succeeded, answer in answers:
            if not succeeded:
                raise answer
        return [answer for _, answer in answers]

    def close(self) -> None:
        """End the processes at once, also while they compute."""
        for process in self._processes:
            process.kill()
        for process in self._processes:
            process.communicate()  # closes the pipes, and waits
        self._processes = []

    def _send(self, objects: Sequence[Any]) -> None:
        try:
            for process, one in zip(self._processes, objects, strict=False):
                assert process.stdin is not None
                pickle.dump(one, process.stdin)
                process.stdin.flush()
        except BrokenPipeError as error:
            raise _lost() from error

    def _answer(self, process: "subprocess.Popen[bytes]") -> tuple[bool, Any]:
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
