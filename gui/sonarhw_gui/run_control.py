"""A long run in a thread, at most one at a time: the base of the fit, the causes and the room search."""

from typing import Any

from PySide6.QtCore import QObject, Signal, Slot

from sonarhw_gui.work.run_progress import RunRequest
from sonarhw_gui.work.worker import Failure, Worker


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
