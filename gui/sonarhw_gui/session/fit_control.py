"""Starts, observes and cancels the fit, which runs in a thread; at most one at a time."""

from dataclasses import dataclass

from PySide6.QtCore import QObject, Signal, Slot

from sonarhw.readings import Reading
from sonarhw_gui.scene.scene import Scene
from sonarhw_gui.work.fit_request import FitFound, FitProgress, FitRequest, FitSettings
from sonarhw_gui.work.worker import Failure, Worker

_MOST_READINGS = 720  # the newest ones; more readings of one place do not improve the fit


@dataclass(frozen=True)
class FitState:
    """State of the fit: none, running, or finished."""

    running: bool = False
    share: float = 0.0
    step: str = ""
    found: FitFound | None = None


class FitControl(QObject):
    """At most one fit at a time."""

    changed = Signal(object)  # FitState
    failed = Signal(str)

    def __init__(self, parent: QObject) -> None:
        super().__init__(parent)
        self.state = FitState()
        self._progress: FitProgress | None = None
        self._worker: Worker | None = None

    def start(self, settings: FitSettings, scene: Scene, readings: tuple[Reading, ...]) -> None:
        """Start a fit; a running one is cancelled."""
        self.forget()
        if self._worker is None:
            self._worker = Worker("fit")
        self._progress = FitProgress()
        self._worker.submit(FitRequest(scene, readings[-_MOST_READINGS:], settings, self._progress))
        self._set_state(FitState(running=True, step=self._progress.step))

    @Slot()
    def forget(self) -> None:
        """Cancel a running fit, and discard a result."""
        if self._progress is not None:
            self._progress.cancel()
        self._progress = None
        self._set_state(FitState())

    def tick(self) -> None:
        """Emit progress and result."""
        if self._worker is None:
            return
        for answer in self._worker.take():
            self._accept(answer)
        if self._progress is not None:
            self._set_state(FitState(running=True, share=self._progress.share, step=self._progress.step))

    def close(self) -> None:
        """End the thread."""
        self.forget()
        if self._worker is not None:
            self._worker.close()

    def _accept(self, answer: FitFound | Failure) -> None:
        request = answer.request
        if not isinstance(request, FitRequest) or request.progress is not self._progress:
            return  # cancelled in the meantime
        if isinstance(answer, FitFound):
            self._progress = None
            self._set_state(FitState(found=answer))
        else:
            self.forget()
            self.failed.emit(answer.message)

    def _set_state(self, state: FitState) -> None:
        if state != self.state:
            self.state = state
            self.changed.emit(state)
