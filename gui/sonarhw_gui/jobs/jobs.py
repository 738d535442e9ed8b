"""Threads that answer requests for the window, their progress, and one long run at a time."""

import threading
from collections import deque
from typing import Any, Protocol

from PySide6.QtCore import QObject, Signal, Slot

from sonarhw.errors import SonarError

# A thread that answers requests, without Qt; requests and answers are frozen values.
#
# Only the newest waiting request of each type is kept.


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


# Progress and cancellation of a long run in a thread, without Qt.


class RunProgress:
    """Progress of a run, and its cancellation; shared by the thread of the run and its caller."""

    def __init__(self) -> None:
        self.share, self.step = 0.0, "beginning"
        self._stop = threading.Event()

    def report(self, share: float, step: str = "") -> None:
        """Store the share that is done and the current step."""
        self.share, self.step = share, step

    def cancel(self) -> None:
        """Ask the run to end."""
        self._stop.set()

    @property
    def cancelled(self) -> bool:
        """Whether the run should end."""
        return self._stop.is_set()


class RunRequest(Request, Protocol):
    """Work of a run. Its answer has the request as `request`."""

    @property
    def progress(self) -> RunProgress:
        """Progress of the run, and its cancellation."""


# A long run in a thread, at most one at a time: the base of the fit, the causes and the room search.


class RunControl(QObject):
    """Starts, observes and cancels one run at a time. `state` is a frozen value of the subclass."""

    changed = Signal(object)  # the new state
    failed = Signal(str)

    def __init__(self, thread: str, state: Any, parent: QObject) -> None:
        """`thread` is the name of the thread, `state` the state without a run and without a result."""
        super().__init__(parent)
        self.state = self._empty = state
        self._thread = thread
        self._progress: Any = None
        self._worker: Worker | None = None

    @Slot()
    def cancel(self) -> None:
        """Cancel a run; without one, discard the result."""
        if self._progress is not None:
            self._progress.cancel()
            self._progress = None
        self._set_state(self._idle())

    def tick(self) -> None:
        """Emit progress and result."""
        for answer in self._worker.take() if self._worker is not None else ():
            if answer.request.progress is self._progress:  # not cancelled in the meantime
                self._end(answer)
        if self._progress is not None:
            self._set_state(self._running(self._progress))

    def close(self) -> None:
        """End the thread."""
        self.cancel()
        if self._worker is not None:
            self._worker.close()

    def _run(self, request: RunRequest, state: Any) -> None:
        """Start a run, with this state; a running one is cancelled."""
        self.cancel()
        if self._worker is None:
            self._worker = Worker(self._thread)
        self._progress = request.progress
        self._worker.submit(request)
        self._set_state(state)

    def _end(self, answer: Any) -> None:
        self._progress = None
        if isinstance(answer, Failure):
            self._set_state(self._idle())
            self.failed.emit(answer.message)
        else:
            self._set_state(self._finished(answer))

    def _set_state(self, state: Any) -> None:
        if state != self.state:
            self.state = state
            self.changed.emit(state)

    # for subclasses

    def _idle(self) -> Any:
        """Return the state after a run that was cancelled or has failed."""
        return self._empty

    def _running(self, progress: Any) -> Any:
        """Return the state during a run."""
        raise NotImplementedError

    def _finished(self, answer: Any) -> Any:
        """Return the state after a complete run."""
        raise NotImplementedError
