"""A thread that answers requests, without Qt; requests and answers are frozen values.

Only the newest waiting request of each type is kept.
"""

import threading
from collections import deque
from typing import Any, Protocol

from sonarhw.errors import SonarError

_MOST_ANSWERS = 64


class Request(Protocol):
    """Work for a thread; a frozen value."""

    def answer(self) -> Any:
        """Return the answer, also a frozen value; runs in the worker's thread and uses only the request."""


class Failure:
    """The answer to a request that raised an error."""

    def __init__(self, request: Request, error: Exception) -> None:
        self.request = request
        self.error = error

    @property
    def message(self) -> str:
        """The message for the user. Raises any error other than SonarError, because it is a defect."""
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
        """Whether requests or answers are pending."""
        with self._wake:
            return self._working or bool(self._waiting) or bool(self._answers)

    def submit(self, request: Request) -> None:
        """Queue `request`; it replaces a waiting request of the same type."""
        with self._wake:
            self._waiting.pop(type(request), None)
            self._waiting[type(request)] = request
            self._wake.notify()

    def take(self) -> list[Any]:
        """Return the answers since the last call, a `Failure` for each request that raised an error."""
        with self._wake:
            answers = list(self._answers)
            self._answers.clear()
        return answers

    def close(self) -> None:
        """Drop waiting requests and end the thread, after its current request."""
        with self._wake:
            self._closing = True
            self._waiting.clear()
            self._wake.notify()
        self._thread.join()

    def _run(self) -> None:
        while self._answer_next():
            pass

    def _answer_next(self) -> bool:
        """Answer a request; return False at the end. While it waits, it keeps neither requests nor answers."""
        request = self._next()
        if request is None:
            return False
        try:
            answer = request.answer()
        except Exception as error:  # noqa: BLE001 - reported to the caller of `take`
            answer = Failure(request, error)
        with self._wake:
            self._working = False
            self._answers.append(answer)
        return True

    def _next(self) -> Request | None:
        with self._wake:
            while not self._waiting and not self._closing:
                self._wake.wait()
            if self._closing:
                return None
            self._working = True
            return self._waiting.pop(next(iter(self._waiting)))
