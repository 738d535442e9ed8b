"""Files that the window writes: one after another in a thread, each reported when it is written or has failed."""

from collections import deque
from contextlib import suppress
from pathlib import Path

from PySide6.QtCore import QObject, Signal

from sonarhw.errors import SonarError
from sonarhw_gui.store.save_requests import Content, SaveRequest
from sonarhw_gui.work.worker import Failure, Worker


class FileSaver(QObject):
    """Writes one file after another, all that are asked for."""

    saved = Signal(str)  # what to tell
    failed = Signal(str)

    def __init__(self, parent: QObject) -> None:
        super().__init__(parent)
        self._waiting: deque[SaveRequest] = deque()
        self._worker: Worker | None = None

    @property
    def busy(self) -> bool:
        """Whether files are still to be written."""
        return bool(self._waiting) or (self._worker is not None and self._worker.busy)

    def write(self, content: Content, path: Path, overwrite: bool = False) -> None:
        """Have it written; `overwrite`: the person has said so."""
        if self._worker is None:
            self._worker = Worker("keep files")
        self._waiting.append(SaveRequest(content, path, overwrite))
        self._write_next()

    def tick(self) -> None:
        """Tell what has been written."""
        if self._worker is None:
            return
        for answer in self._worker.take():
            if isinstance(answer, Failure):
                self.failed.emit(answer.message)
            else:
                self.saved.emit(f"saved: {answer}")
        self._write_next()

    def close(self) -> None:
        """Write what was asked for, and end the thread."""
        if self._worker is not None:
            self._worker.close()
            for request in self._waiting:
                with suppress(SonarError):  # nobody is there any more to be told
                    request.answer()

    def _write_next(self) -> None:
        if self._waiting and self._worker is not None and not self._worker.busy:
            self._worker.submit(self._waiting.popleft())
