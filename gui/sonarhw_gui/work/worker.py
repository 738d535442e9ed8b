"""A thread that answers requests; requests and answers are frozen values, and the thread loads no Qt.

Of several waiting requests of one type only the newest is kept.
"""

import threading
from collections import deque
from typing import Any, Protocol

from sonarhw.errors import SonarError

_MOST_ANSWERS = 64


class Request(Protocol):
    """Something to work out; a frozen value."""

    def answer(self) -> Any:
        """The answer, a frozen value too; runs in the worker's thread and touches nothing but the request."""


class Failure:
    """The answer to a request that could not be met."""

    def __init__(self, request: Request, error: Exception) -> None:
        self.request = request
        self.error = error

    @property
    def message(self) -> str:
        """What to tell the person; raises what is no error of this project, for that is a defect."""
        if not isinstance(self.error, SonarError):
            raise self.error
        return str(self.error)


class Worker:
    """One thread that answers one request after another."""

    def __init__(self, name: str) -> None:
        self._wake = threading.Condition()
        self._waiting: dict[type, Request] = {}
        self._working = False
        self._closing = False
        self._answers: deque[Any] = deque(maxlen=_MOST_ANSWERS)
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    @property
    def busy(self) -> bool:
        """Whether there is an answer still to come."""
        with self._wake:
            return self._working or bool(self._waiting) or bool(self._answers)

    def submit(self, request: Request) -> None:
        """Have `request` answered; one of its type that still waits is forgotten."""
        with self._wake:
            self._waiting.pop(type(request), None)
            self._waiting[type(request)] = request
            self._wake.notify()

    def take(self) -> list[Any]:
        """The answers since the last call, `Failure` for a request that could not be met."""
        with self._wake:
            answers = list(self._answers)
            self._answers.clear()
        return answers

    def close(self) -> None:
        """Forget what waits and end the thread; what it works on is finished first."""
        with self._wake:
            self._closing = True
            self._waiting.clear()
            self._wake.notify()
        self._thread.join()

    def _run(self) -> None:
        while (request := self._next()) is not None:
            try:
                answer = request.answer()
            except Exception as error:  # noqa: BLE001 - handed to whoever fetches the answers
                answer = Failure(request, error)
            with self._wake:
                self._working = False
                self._answers.append(answer)

    def _next(self) -> Request | None:
        with self._wake:
            while not self._waiting and not self._closing:
                self._wake.wait()
            if self._closing:
                return None
            self._working = True
            return self._waiting.pop(next(iter(self._waiting)))
