"""Starts, observes and cancels the fit, which runs in a thread; at most one at a time."""

from collections.abc import Callable
from dataclasses import dataclass

from PySide6.QtCore import QObject, Slot

from sonarhw_gui.fitting.fit_request import FitFound, FitRequest, FitSettings
from sonarhw_gui.run_control import RunControl
from sonarhw_gui.shown.shown import Shown
from sonarhw_gui.work.run_progress import RunProgress

_MOST_READINGS = 720  # the newest ones; more readings of one place do not improve the fit


@dataclass(frozen=True)
class FitState:
    """State of the fit: none, running, or finished."""

    running: bool = False
    share: float = 0.0
    step: str = ""
    found: FitFound | None = None


class FitControl(RunControl):
    """At most one fit at a time."""

    def __init__(self, shown: Callable[[], Shown], parent: QObject) -> None:
        """`shown`: returns what the window shows."""
        super().__init__("fit", FitState(), parent)
        self._shown = shown

    @Slot(object)
    def start(self, settings: FitSettings) -> None:
        """Fit to the readings shown; a running fit is cancelled."""
        shown = self._shown()
        request = FitRequest(shown.scene, shown.readings[-_MOST_READINGS:], settings, RunProgress())
        self._run(request, self._running(request.progress))

    def _running(self, progress: RunProgress) -> FitState:
        return FitState(running=True, share=progress.share, step=progress.step)

    def _finished(self, answer: FitFound) -> FitState:
        return FitState(found=answer)
