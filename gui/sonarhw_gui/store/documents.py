"""The files of the window: opened in a thread, rooms saved, and the list of recent files."""

import os
from pathlib import Path

from sonarhw_sim.board.profile import Board
from sonarhw_sim.room.model import Room
from sonarhw_sim.room.room_writing import save_room

from sonarhw.errors import InputError, SonarError
from sonarhw_gui.store.open_requests import LogOpened, Opened, OpenRequest, request_for
from sonarhw_gui.store.recent_names import with_newest
from sonarhw_gui.work.worker import Failure, Worker


class Documents:
    """Opens one file after another; of several that wait the newest."""

    def __init__(self, folder: Path) -> None:
        """`folder`: where scans that are imported are kept as logs."""
        self.recent: tuple[str, ...] = ()
        self.messages: list[str] = []
        self.saved_in: Path | None = None
        self._folder = folder
        self._worker = Worker("open files")

    def folder(self, shown: str = "") -> Path:
        """Where to offer to save: where one did so last, else where the file that is shown or was opened last lies.

        Recordings lie where nobody looks, and some rooms where nobody may write: then it is home.
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
        """Have a file opened; a room for that board."""
        try:
            self._worker.submit(request_for(path, board, self._folder))
        except InputError as error:
            self.messages.append(str(error))

    def submit(self, request: OpenRequest) -> None:
        """Have a file opened as it is asked for there."""
        self._worker.submit(request)

    def take(self) -> list[Opened]:
        """What has been opened since the last call."""
        opened: list[Opened] = []
        for answer in self._worker.take():
            if isinstance(answer, Failure):
                self.messages.append(answer.message)
            else:
                opened.append(answer)
                self.recent = with_newest(self.recent, str(answer.path.absolute()))
                if isinstance(answer, LogOpened) and answer.notice:
                    self.messages.append(answer.notice)
        return opened

    def save_room(self, room: Room | None, path: Path) -> bool:
        """Write a room; whether it has been written. The dialog has asked about overwriting."""
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
