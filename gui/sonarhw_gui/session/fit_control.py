"""The fit of the window: started, watched and cancelled in a thread of its own, at most one at a time."""

from dataclasses import dataclass

from PySide6.QtCore import QObject, Signal, Slot

from sonarhw.readings import Reading
from sonarhw_gui.scene.scene import Scene
from sonarhw_gui.work.fit_request import FitFound, FitProgress, FitRequest, FitSettings
from sonarhw_gui.work.worker import Failure, Worker

_MOST_READINGS = 720  # the newest: more readings add nothing about one place


@dataclass(frozen=True)
class FitState:
    """How it stands: nothing asked for, at work, or done."""

    running: bool = False
    share: float = 0.0
    doing: str = ""
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
        """Begin; one that is at work is given up."""
        self.forget()
        if self._worker is None:
            self._worker = Worker("fit")
        self._progress = FitProgress()
        self._worker.submit(FitRequest(scene, readings[-_MOST_READINGS:], settings, self._progress))
        self._set_state(FitState(running=True, doing=self._progress.doing))

    @Slot()
    def forget(self) -> None:
        """Give up what is at work, and put away what was found."""
        if self._progress is not None:
            self._progress.cancel()
        self._progress = None
        self._set_state(FitState())

    def tick(self) -> None:
        """Tell what has happened."""
        if self._worker is None:
            return
        for answer in self._worker.take():
            self._take(answer)
        if self._progress is not None:
            self._set_state(FitState(running=True, share=self._progress.share, doing=self._progress.doing))

    def close(self) -> None:
        """End the thread."""
        self.forget()
        if self._worker is not None:
            self._worker.close()

    def _take(self, answer: FitFound | Failure) -> None:
        request = answer.request
        if not isinstance(request, FitRequest) or request.progress is not self._progress:
            return  # given up meanwhile
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
