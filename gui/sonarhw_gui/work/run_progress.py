"""Progress and cancellation of a long run in a thread, without Qt."""

import threading
from typing import Protocol

from sonarhw_gui.work.worker import Request


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
