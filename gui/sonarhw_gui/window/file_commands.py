"""The commands for files: open by dialog, from the recent files or by drag and drop, and save rooms."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import count
from pathlib import Path

from PySide6.QtCore import QMimeData, QObject, Qt, Slot
from PySide6.QtGui import QAction, QGuiApplication, QImage
from PySide6.QtWidgets import QFileDialog, QMainWindow, QMenu, QWidget
from sonarhw_compare.film_file import FILMS
from sonarhw_compare.sound import PlayedPing
from sonarhw_sim.room.room import room_names

from sonarhw.export import FORMATS, export_suffixes
from sonarhw_gui.jobs.files import (
    HTML,
    JSON,
    PNG,
    SVG,
    Content,
    Data,
    FilmOfSound,
    Picture,
    ReportPage,
    WatchedFile,
    can_open,
)
from sonarhw_gui.session.session import WindowSession
from sonarhw_gui.session.source import Replay
from sonarhw_gui.session.status import link_figures
from sonarhw_gui.views.base import View, png_pixels, svg_text
from sonarhw_gui.widgets import plain_tip
from sonarhw_gui.window.commands import Commands
from sonarhw_gui.window.dialogs import RecordingsDialog, close_dialogs
from sonarhw_gui.window.import_dialog import ImportDialog


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
        self._session.open_room(action.text())

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
        self.importing = dialog = ImportDialog(
            Path(path), self._session.shown.look.unit, self._session.jobs, self._window
        )
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
            self.recordings = dialog = RecordingsDialog(
                self._session.live.settings.folder, self._session.jobs, self._window
            )
            dialog.chosen.connect(self._session.open_file)
            dialog.destroyed.connect(self._forget_recordings)
        close_dialogs(self._window, but=self.recordings)
        self.recordings.show()
        self.recordings.raise_()

    @Slot()
    def close_dialogs(self) -> None:
        """Close the open dialog."""
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


# The commands that save pictures of views, data and the report. Each opens a file dialog, which is not modal.


_FILTERS = {
    PNG: "Picture (*.png)",
    SVG: "Vector graphics (*.svg)",
    **{known.suffix: f"{known.title} (*{known.suffix})" for known in FORMATS},
    JSON: "Summary of the comparison (*.json)",
    HTML: "Report (*.html)",
    ".gif": "Animation (*.gif)",
    ".mp4": "Video (*.mp4)",
    ".webm": "Video (*.webm)",
}
PICTURES, DATA, REPORT, WINDOW = (PNG, SVG), (*export_suffixes(), JSON), (HTML,), (PNG,)


@dataclass(frozen=True)
class Subject:
    """What to save."""

    name: str
    endings: tuple[str, ...]
    view: QWidget | None = None  # for a picture
    ping: PlayedPing | None = None  # for a film


class SaveCommands(QObject):
    """Asks for a file name, and saves."""

    def __init__(
        self,
        commands: Commands,
        session: WindowSession,
        window: QWidget,
        large_view: Callable[[], View],
        beside: Sequence[View],
    ) -> None:
        """`large_view`: returns the visible large view; `beside`: the views beside it."""
        super().__init__(window)
        self._session, self._window, self._large_view = session, window, large_view
        self._subject = Subject("", ())
        self.dialog: QFileDialog | None = None
        commands.save_view.triggered.connect(self._save_view)
        for view in beside:
            if view.entry.name in commands.save_beside:
                commands.save_beside[view.entry.name].triggered.connect(partial(self._save_picture, view))
        commands.save_window.triggered.connect(self._save_window)
        commands.export_data.triggered.connect(self._export_data)
        commands.copy_view.triggered.connect(self._copy_view)
        commands.save_film.triggered.connect(self._save_film)
        commands.report.triggered.connect(self._save_report)

    @Slot()
    def _save_view(self) -> None:
        self._save_picture(self._large_view())

    @Slot()
    def _copy_view(self) -> None:
        image = self.image()
        if image is not None:
            QGuiApplication.clipboard().setImage(image)

    def image(self) -> QImage | None:
        """Return the picture of the large view, with title and legend; None if it has none."""
        view, shown = self._large_view(), self._session.shown
        widget = view.picture()
        if widget is None:
            return None
        pixels = png_pixels(widget, f"{shown.scene.title} · {view.entry.name.lower()}", shown)
        height, width = pixels.shape[:2]
        image = QImage(pixels.data, width, height, 4 * width, QImage.Format.Format_RGBA8888)
        return image.copy()  # the pixels belong to the array

    def _save_picture(self, view: View) -> None:
        self._ask(Subject(view.entry.name, PICTURES, view.picture()))

    @Slot()
    def _save_window(self) -> None:
        self._ask(Subject("Window", WINDOW, self._window))

    @Slot()
    def _save_film(self) -> None:
        state, question = self._session.sound.state, self._session.shown.question
        ping = state.ping if state is not None else None if question is None else PlayedPing(*question)
        if ping is None:
            self._session.notices.warn("there is no sound to film; select a reading, or click the predicted outline")
        else:
            self._ask(Subject("Sound", FILMS, ping=ping))

    @Slot()
    def _export_data(self) -> None:
        if self._has_readings():
            self._ask(Subject("Readings", DATA))

    @Slot()
    def _save_report(self) -> None:
        if self._session.shown.scene.room is None:
            self._session.notices.warn("a report needs a room to compare with; open a room file")
        elif self._has_readings():
            self._ask(Subject("Report", REPORT))

    def _has_readings(self) -> bool:
        if self._session.source.recorded is None:
            self._session.notices.warn("there are no readings to save; scan, or open a log")
        return self._session.source.recorded is not None

    def _ask(self, subject: Subject) -> None:
        self._subject = subject
        if self.dialog is not None:
            self.dialog.destroyed.disconnect(self._forget)
        close_dialogs(self._window)
        folder = self._session.documents.folder(self._session.log_file)
        self.dialog = dialog = QFileDialog(self._window, f"Save {subject.name.lower()}", str(folder))
        dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        dialog.setAcceptMode(QFileDialog.AcceptMode.AcceptSave)
        dialog.setNameFilters([_FILTERS[ending] for ending in subject.endings])
        dialog.setDefaultSuffix(subject.endings[0])
        dialog.selectFile(f"{self._stem()}_{subject.name.lower().replace(' ', '-')}{subject.endings[0]}")
        dialog.filterSelected.connect(self._choose_ending)
        dialog.fileSelected.connect(self._write)
        dialog.destroyed.connect(self._forget)
        dialog.show()

    @Slot()
    def _forget(self) -> None:
        self.dialog = None

    @Slot(str)
    def _choose_ending(self, chosen: str) -> None:
        """Change the extension of the file name to the chosen file type."""
        if self.dialog is None:
            return
        ending = next(ending for ending, name in _FILTERS.items() if name == chosen)
        self.dialog.setDefaultSuffix(ending)
        for name in self.dialog.selectedFiles():
            self.dialog.selectFile(Path(name).with_suffix(ending).name)

    @Slot(str)
    def _write(self, name: str) -> None:
        path = Path(name)
        self._session.documents.saved_in = path.parent
        content = self._content(path.suffix.lower())
        if content is not None:
            self._session.save(content, path, overwrite=True)  # the dialog has asked the user

    def _content(self, ending: str) -> Content | None:
        subject, session = self._subject, self._session
        scene, recorded = session.shown.scene, session.source.recorded
        if subject.view is not None:
            return self._picture(subject.view, ending)
        if subject.ping is not None:
            return FilmOfSound(subject.ping)
        if recorded is None:
            return None
        if subject.endings == DATA:
            return Data(recorded, scene, notes=session.showing.pinned_notes)
        link = session.live.link
        live = link is not None and session.replay is None
        facts = [(name, value) for name, value, _ in link_figures(link)] if live else []
        return ReportPage(self._log_name(), recorded, scene, facts, session.showing.pinned_notes)

    def _picture(self, view: QWidget, ending: str) -> Picture:
        shown = self._session.shown
        title = "" if view is self._window else f"{shown.scene.title} · {self._subject.name.lower()}"
        if ending == SVG:
            return Picture(None, svg_text(view, title, shown))
        return Picture(png_pixels(view, title, shown), endings=self._subject.endings)

    def _log_name(self) -> str:
        source = self._session.source
        return source.name if isinstance(source, Replay) else source.path.name if source.path is not None else ""

    def _stem(self) -> str:
        return Path(self._log_name()).stem or self._session.shown.scene.pose.name or "sonarhw"
