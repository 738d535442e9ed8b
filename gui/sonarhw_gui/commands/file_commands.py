"""The commands for files: open by dialog, from the recent files or by drag and drop, and save rooms."""

from collections.abc import Callable, Sequence
from itertools import count
from pathlib import Path

from PySide6.QtCore import QMimeData, Qt, Slot
from PySide6.QtGui import QAction
from PySide6.QtWidgets import QFileDialog, QMainWindow, QMenu
from sonarhw_sim.room.room import room_names

from sonarhw_gui.commands.command_list import Commands
from sonarhw_gui.dialogs.import_dialog import ImportDialog
from sonarhw_gui.dialogs.one_dialog import close_dialogs
from sonarhw_gui.dialogs.recordings_dialog import RecordingsDialog
from sonarhw_gui.parts.plain_label import plain_tip
from sonarhw_gui.session.window_session import WindowSession
from sonarhw_gui.store.file_watch import WatchedFile
from sonarhw_gui.store.open_requests import OpenRoomRequest, can_open


class FileCommands(QMenu):
    """Connects the file commands with the session; it is also the menu of recent files."""

    def __init__(self, commands: Commands, session: WindowSession, window: QMainWindow) -> None:
        super().__init__("Open recent", window)
        self._window = window
        self._session = session
        commands.open_log.triggered.connect(self._ask_log)
        commands.open_room.triggered.connect(self._ask_room)
        self.recordings: RecordingsDialog | None = None
        commands.recordings.triggered.connect(self._show_recordings)
        self.importing: ImportDialog | None = None
        commands.import_scan.triggered.connect(self._ask_scan)
        # queued: a file named on the command line is opened before the window is visible
        session.import_asked.connect(self._ask_how_to_read, Qt.ConnectionType.QueuedConnection)
        commands.save_room.triggered.connect(self._save_room)
        commands.save_room_as.triggered.connect(self._ask_where_to_save_room)
        self.shipped = QMenu("Open shipped room", window)
        for name in room_names():
            self.shipped.addAction(name).setToolTip(f"Show the readings in the shipped room {name}")
        self.shipped.triggered.connect(self._open_shipped)
        self.triggered.connect(self._open_recent)
        session.recent_changed.connect(self.show_recent)
        self.show_recent(session.documents.recent)

    @Slot(object)
    def show_recent(self, paths: Sequence[str]) -> None:
        """List these files, newest first."""
        self.clear()
        for path in paths:
            action = self.addAction(Path(path).name)
            action.setData(path)
            action.setToolTip(plain_tip(path))
        self.setToolTipsVisible(True)
        self.setEnabled(bool(paths))

    def can_drop(self, dropped: QMimeData) -> bool:
        """Return whether the dragged files can be opened, judging by their names."""
        return bool(_paths(dropped)) and not self._session.status.scanning

    def drop(self, dropped: QMimeData) -> None:
        """Open the dropped files; rooms last, so that the readings are shown in them."""
        for path in sorted(_paths(dropped), key=lambda path: path.suffix.lower() == ".toml"):
            self._session.open_file(str(path))

    @Slot(QAction)
    def _open_recent(self, action: QAction) -> None:
        self._session.open_file(action.data())

    @Slot(QAction)
    def _open_shipped(self, action: QAction) -> None:
        self._session.reopen(OpenRoomRequest(action.text(), self._session.shown.scene.board))

    @Slot()
    def _ask_log(self) -> None:
        self._ask_file("Open log", "Logs and scans (*.mcap *.csv)", self._session.open_file)

    @Slot()
    def _ask_scan(self) -> None:
        self._ask_file("Import scan", "Scans of other programs (*.csv)", self._session.import_asked.emit)

    @Slot(str)
    def _ask_how_to_read(self, path: str) -> None:
        """Open the import dialog for a CSV file, in place of any other dialog."""
        close_dialogs(self._window)
        self.importing = dialog = ImportDialog(Path(path), self._session.shown.look.unit, self._window)
        dialog.accepted_as.connect(self._session.import_csv)
        dialog.show()

    @Slot()
    def _ask_room(self) -> None:
        self._ask_file("Open room", "Rooms (*.toml)", self._session.open_file)

    @Slot()
    def ask_board(self) -> None:
        """Open a dialog for a board profile."""
        self._ask_file("Open board profile", "Board profiles (*.toml)", self._session.open_board)

    @Slot()
    def ask_scan(self) -> None:
        """Open a dialog for a log that is drawn over the readings shown."""
        self._ask_file("Add log", "Logs (*.mcap)", self._session.scans.open)

    @Slot()
    def _show_recordings(self) -> None:
        if self.recordings is None:
            self.recordings = dialog = RecordingsDialog(self._session.live.scan_settings.folder, self._window)
            dialog.chosen.connect(self._session.open_file)
            dialog.failed.connect(self._session.failed)
            dialog.destroyed.connect(self._forget_recordings)
        close_dialogs(self._window, but=self.recordings)
        self.recordings.show()
        self.recordings.raise_()

    @Slot()
    def close_dialogs(self) -> None:
        """Close the open dialog, and end its thread."""
        close_dialogs(self._window)

    @Slot()
    def _forget_recordings(self) -> None:
        self.recordings = None

    def _ask_file(self, title: str, pattern: str, chosen: Callable[[str], None]) -> None:
        dialog = self._dialog(title, pattern, chosen)
        dialog.setFileMode(QFileDialog.FileMode.ExistingFile)
        dialog.show()

    @Slot()
    def _save_room(self) -> None:
        """Save the room in its file; without one, as for a room of a log, ask for a name."""
        path = self._session.files.path(WatchedFile.ROOM)
        if path is None:
            self._ask_where_to_save_room()
        else:
            self._session.save_room(str(path))

    @Slot()
    def _ask_where_to_save_room(self) -> None:
        room, folder = self._session.shown.scene.room, self._session.documents.folder(self._session.log_file)
        dialog = self._dialog("Save room as", "Rooms (*.toml)", self._session.save_room)
        dialog.setAcceptMode(QFileDialog.AcceptMode.AcceptSave)
        dialog.setDefaultSuffix("toml")
        dialog.setDirectory(str(folder))
        if room is not None:
            dialog.selectFile(_new_name(Path(self._session.shown.scene.room_file or "room.toml"), folder))
        dialog.show()

    def _dialog(self, title: str, pattern: str, chosen: Callable[[str], None]) -> QFileDialog:
        recent = self._session.documents.recent
        dialog = QFileDialog(self._window, title, str(Path(recent[0]).parent) if recent else "", pattern)
        close_dialogs(self._window)
        dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        dialog.fileSelected.connect(chosen)
        return dialog


def _new_name(file: Path, folder: Path) -> str:
    """Return an unused file name for an edited room."""
    stem = file.stem.partition("-edited")[0]
    names = (f"{stem}-edited{f'-{k}' if k > 1 else ''}.toml" for k in count(1))
    return next(name for name in names if not (folder / name).exists())


def _paths(dropped: QMimeData) -> list[Path]:
    paths = [Path(url.toLocalFile()) for url in dropped.urls() if url.isLocalFile()]
    return [path for path in paths if can_open(path)]
