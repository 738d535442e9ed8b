"""The files of the window: opens files in a thread, saves rooms, and lists recent files."""

import os
from pathlib import Path

from sonarhw_sim.board.profile import Board
from sonarhw_sim.room.room import Room
from sonarhw_sim.room.room_writing import save_room

from sonarhw.errors import InputError, SonarError
from sonarhw_gui.store.csv_preview import ReadCsvRequest
from sonarhw_gui.store.open_requests import LogGrown, LogOpened, OpenCsvRequest, Opened, OpenRequest, request_for
from sonarhw_gui.store.recent_names import with_newest
from sonarhw_gui.work.worker import Failure, Worker


class Documents:
    """Opens one file at a time. A new request replaces a waiting request of the same kind."""

    def __init__(self, folder: Path) -> None:
        """`folder`: of recordings, where imported scans are stored as logs."""
        self.recent: tuple[str, ...] = ()
        self.messages: list[str] = []
        self.saved_in: Path | None = None
        self._folder = folder
        self._worker = Worker("open files")

    def folder(self, shown: str = "") -> Path:
        """Return the folder for a save dialog: the last one used, else that of the file shown or opened last.

        The folder of recordings and folders without write permission are skipped; the default is the home folder.
        """
        if self.saved_in is not None:
            return self.saved_in
        folders = (Path(name).parent for name in (shown, *self.recent) if name)
        fit = (folder for folder in folders if folder != self._folder and os.access(folder, os.W_OK))
        return next(fit, Path.home())

    @property
    def busy(self) -> bool:
        """Whether a file is being opened."""
        return self._worker.busy

    def open(self, path: Path, board: Board) -> None:
        """Start to open a file; a room is opened with this board."""
        try:
            self._worker.submit(request_for(path, board))
        except InputError as error:
            self.messages.append(str(error))

    def import_csv(self, source: ReadCsvRequest) -> None:
        """Start to import a CSV scan as a log in the folder of recordings, and to open the log."""
        self._worker.submit(OpenCsvRequest(source, self._folder))

    def submit(self, request: OpenRequest) -> None:
        """Start to open a file by a request."""
        self._worker.submit(request)

    def take(self) -> list[Opened]:
        """Return what was opened since the last call."""
        opened: list[Opened] = []
        for answer in self._worker.take():
            if isinstance(answer, Failure):
                self.messages.append(answer.message)
            else:
                opened.append(answer)
                if isinstance(answer, LogGrown) or answer.path is None:
                    continue
                self.recent = with_newest(self.recent, str(answer.path.absolute()))
                if isinstance(answer, LogOpened) and answer.notice:
                    self.messages.append(answer.notice)
        return opened

    def save_room(self, room: Room | None, path: Path) -> bool:
        """Write a room and return whether that succeeded. An existing file is overwritten."""
        try:
            if room is None:
                raise InputError("there is no room to save; open a room file")
            save_room(room, path, overwrite=True)
        except SonarError as error:
            self.messages.append(str(error))
            return False
        self.recent = with_newest(self.recent, str(path.absolute()))
        self.saved_in = path.absolute().parent
        return True

    def close(self) -> None:
        """End the thread."""
        self._worker.close()
