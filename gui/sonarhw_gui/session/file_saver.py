"""Writes files one after another in a thread, and reports each success or failure."""

from collections import deque
from contextlib import suppress
from pathlib import Path

from PySide6.QtCore import QObject, Signal

from sonarhw.errors import SonarError
from sonarhw_gui.store.save_requests import Content, SaveRequest
from sonarhw_gui.work.worker import Failure, Worker


class FileSaver(QObject):
    """Writes all requested files, one after another."""

    saved = Signal(str)  # message
    failed = Signal(str)

    def __init__(self, parent: QObject) -> None:
        super().__init__(parent)
        self._waiting: deque[SaveRequest] = deque()
        self._worker: Worker | None = None

    @property
    def busy(self) -> bool:
        """Whether files are waiting or being written."""
        return bool(self._waiting) or (self._worker is not None and self._worker.busy)

    def write(self, content: Content, path: Path, overwrite: bool = False) -> None:
        """Queue a file; `overwrite`: the user has agreed to overwrite it."""
        if self._worker is None:
            self._worker = Worker("save files")
        self._waiting.append(SaveRequest(content, path, overwrite))
        self._write_next()

    def tick(self) -> None:
        """Emit `saved` or `failed` for each finished file."""
        if self._worker is None:
            return
        for answer in self._worker.take():
            if isinstance(answer, Failure):
                self.failed.emit(answer.message)
            else:
                self.saved.emit(f"saved: {answer}")
        self._write_next()

    def close(self) -> None:
        """Write the waiting files, and end the thread."""
        if self._worker is not None:
            self._worker.close()
            for request in self._waiting:
                with suppress(SonarError):  # the window is closed: no place to report it
                    request.answer()

    def _write_next(self) -> None:
        if self._waiting and self._worker is not None and not self._worker.busy:
            self._worker.submit(self._waiting.popleft())
