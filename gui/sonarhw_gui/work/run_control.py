"""A long run in a thread, at most one at a time: its progress, its cancellation, and the base of its controls."""

import threading
from typing import Any, Protocol

from PySide6.QtCore import QObject, Signal, Slot

from sonarhw_gui.work.worker import Failure, Request, Worker


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

    def _run(self, request: RunRequest) -> None:
        """Start a run; a running one is cancelled."""
        self.cancel()
        if self._worker is None:
            self._worker = Worker(self._thread)
        self._progress = request.progress
        self._worker.submit(request)

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
