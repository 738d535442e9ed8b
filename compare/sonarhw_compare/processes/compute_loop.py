"""The loop of a process that computes for another one: it reads calls from standard input until that is closed."""

import os
import pickle
import sys
import traceback
from typing import Any, BinaryIO

from sonarhw_sim.compiled import use_one_thread


def run() -> None:
    """Answer each call with its result, or with the error that it raised; end with the process that calls."""
    calls, answers = sys.stdin.buffer, sys.stdout.buffer
    sys.stdout = sys.stderr  # what a function prints is not an answer
    use_one_thread()
    try:
        compute(calls, answers)
    except (EOFError, BrokenPipeError):
        os._exit(0)  # the process that calls has ended: no one reads the rest of an answer


def compute(calls: BinaryIO, answers: BinaryIO) -> None:
    """Answer pickled calls, `(function, arguments)`, each with `(succeeded, result or error)`.

    `(None, kept)` has no answer: `kept` is the first argument of every function from then on. Raises EOFError at the
    end of `calls`.
    """
    kept: Any = None
    while True:
        function, arguments = pickle.load(calls)
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
