"""Starts, observes and cancels the search for causes, which runs in a thread; at most one at a time."""

from dataclasses import dataclass

from PySide6.QtCore import QObject, Signal, Slot

from sonarhw.readings import Reading
from sonarhw_gui.causes.cause_request import CauseRequest, CausesAnswer
from sonarhw_gui.scene.scene import Scene
from sonarhw_gui.work.fit_request import FitProgress
from sonarhw_gui.work.worker import Failure, Worker

_MOST_READINGS = 360  # the newest ones; the time of a search is proportional to their number


@dataclass(frozen=True)
class CausesState:
    """State of the search: none, running, or finished."""

    running: bool = False
    share: float = 0.0
    answer: CausesAnswer | None = None


class CauseControl(QObject):
    """At most one search at a time."""

    changed = Signal(object)  # CausesState
    failed = Signal(str)

    def __init__(self, parent: QObject) -> None:
        super().__init__(parent)
        self.state = CausesState()
        self._progress: FitProgress | None = None
        self._worker: Worker | None = None

    def start(self, scene: Scene, readings: tuple[Reading, ...]) -> None:
        """Start a search; a running one is cancelled."""
        self.forget()
        if self._worker is None:
            self._worker = Worker("causes")
        self._progress = FitProgress()
        newest = readings[-_MOST_READINGS:]
        self._worker.submit(CauseRequest(scene, newest, len(readings) - len(newest), self._progress))
        self._set_state(CausesState(running=True))

    @Slot()
    def forget(self) -> None:
        """Cancel a running search, and discard a result."""
        if self._progress is not None:
            self._progress.cancel()
        self._progress = None
        self._set_state(CausesState())

    def tick(self) -> None:
        """Emit progress and result."""
        if self._worker is None:
            return
        for answer in self._worker.take():
            self._accept(answer)
        if self._progress is not None:
            self._set_state(CausesState(running=True, share=self._progress.share))

    def close(self) -> None:
        """End the thread."""
        self.forget()
        if self._worker is not None:
            self._worker.close()

    def _accept(self, answer: CausesAnswer | Failure) -> None:
        request = answer.request
        if not isinstance(request, CauseRequest) or request.progress is not self._progress:
            return  # cancelled in the meantime
        if isinstance(answer, CausesAnswer):
            self._progress = None
            self._set_state(CausesState(answer=answer))
        else:
            self.forget()
            self.failed.emit(answer.message)

    def _set_state(self, state: CausesState) -> None:
        if state != self.state:
            self.state = state
            self.changed.emit(state)
