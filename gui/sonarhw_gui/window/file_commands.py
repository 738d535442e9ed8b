"""The commands for files: open by dialog, from the recent files or by drag and drop, and save rooms."""

from collections.abc import Callable, Sequence
from functools import partial
from itertools import count
from pathlib import Path
from typing import BinaryIO

from PySide6.QtCore import QBuffer, QByteArray, QIODevice, QMimeData, QObject, Qt, Slot
from PySide6.QtGui import QAction, QGuiApplication, QIcon, QImage, QPixmap
from PySide6.QtWidgets import QFileDialog, QInputDialog, QMainWindow, QMenu, QWidget
from sonarhw_compare.picture_file import FILMS
from sonarhw_compare.room_import.inputs import METRES
from sonarhw_compare.sound import PlayedPing
from sonarhw_sim.room.room import room_names

from sonarhw.export import FORMATS
from sonarhw_gui.jobs import files
from sonarhw_gui.model.scene import Scene
from sonarhw_gui.session.scanner import name_part
from sonarhw_gui.session.session import WindowSession
from sonarhw_gui.session.source import Replay
from sonarhw_gui.session.status import link_figures
from sonarhw_gui.views.base import View, ViewEntry, pdf_bytes, png_pixels, svg_text
from sonarhw_gui.views.plan import PlanDrawing
from sonarhw_gui.widgets import plain_tip, show_alone
from sonarhw_gui.window.bars import PICTURE
from sonarhw_gui.window.dialogs import RecordingsDialog, open_dialog
from sonarhw_gui.window.import_dialog import ImportDialog
from sonarhw_gui.window.views import ViewArea

_STATED = "as stated in the file"
_ANY_SCAN = "Scans of other programs (*)"


class FileCommands(QMenu):
    """Opens files by dialog, from the list of recent files, which is its menu, or by drag and drop; saves rooms."""

    def __init__(self, session: WindowSession, window: QMainWindow) -> None:
        super().__init__("Open recent", window)
        self._session, self._window = session, window
        # queued: a file named on the command line is opened before the window is visible
        session.import_asked.connect(self._ask_how_to_read, Qt.ConnectionType.QueuedConnection)
        self.pictures: dict[str, QByteArray] = {}  # PNG of the plan, by recent file
        self._to_import: list[Path] = []  # scans that wait for the dialog of the one before
        self._importing: ImportDialog | None = None
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
            if path in self.pictures:
                picture = QPixmap()
                picture.loadFromData(self.pictures[path])
                action.setIcon(QIcon(picture))
                action.setIconVisibleInMenu(False)
        self.setToolTipsVisible(True)
        self.setEnabled(bool(paths))

    def keep_picture(self, plan: PlanDrawing) -> None:
        """Keep a small picture of the plan for the newest file, once its readings and its prediction are drawn."""
        shown, recent = self._session.shown, self._session.documents.recent
        drawn = shown.outline is not None and not shown.outdated and plan.isVisible()
        if drawn and recent and recent[0] not in self.pictures:
            small = plan.grab(plan.plot.vb.sceneBoundingRect().toRect()).scaled(  # without the axes
                PICTURE, Qt.AspectRatioMode.KeepAspectRatio, Qt.TransformationMode.SmoothTransformation
            )
            picture = QBuffer()
            picture.open(QIODevice.OpenModeFlag.WriteOnly)
            small.save(picture, "PNG")
            self.pictures = {path: data for path, data in self.pictures.items() if path in recent}
            self.pictures[recent[0]] = picture.data()
            self.show_recent(recent)

    def can_drop(self, dropped: QMimeData) -> bool:
        """Return whether files are dragged; what they contain is looked at when they are opened."""
        return bool(_paths(dropped)) and not self._session.status.scanning

    def drop(self, dropped: QMimeData) -> None:
        """Open the dropped files; rooms last, so that the readings are shown in them."""
        for path in sorted(_paths(dropped), key=lambda path: files.file_kind(path) == "room"):
            self._session.open_file(str(path))

    @Slot(QAction)
    def _open_recent(self, action: QAction) -> None:
        self._session.open_file(action.data())

    @Slot(QAction)
    def _open_shipped(self, action: QAction) -> None:
        self._session.open_room(action.text())

    @Slot()
    def open_log(self) -> None:
        """Ask for a log to replay."""
        self._ask_file("Open log", f"Logs (*.mcap);;{_ANY_SCAN}", self._session.open_file)

    @Slot()
    def import_scan(self) -> None:
        """Ask for scans of another program."""
        dialog = self._ask_file("Import scans", _ANY_SCAN, None)
        dialog.setFileMode(QFileDialog.FileMode.ExistingFiles)
        dialog.filesSelected.connect(self._import_all)

    @Slot(list)
    def _import_all(self, paths: list[str]) -> None:
        for path in paths:
            self._session.import_asked.emit(path)

    @Slot(str)
    def _ask_how_to_read(self, path: str) -> None:
        """Show how a scan is read. Several scans are shown one after another."""
        self._to_import.append(Path(path))
        if self._importing is None:
            self._show_next()

    @Slot()
    def _show_next(self) -> None:
        self._importing = None
        if self._to_import:
            dialog = ImportDialog(self._to_import.pop(0), self._session.shown, self._session.jobs, self._window)
            dialog.imported.connect(self._session.import_scan)
            dialog.finished.connect(self._show_next, Qt.ConnectionType.QueuedConnection)
            self._importing = dialog
            if self._to_import:
                dialog.setWindowTitle(f"{dialog.windowTitle()}, {len(self._to_import)} more to follow")
            show_alone(dialog)

    @Slot()
    def open_room(self) -> None:
        """Ask for a room file."""
        foreign = " ".join(f"*{suffix}" for suffix in files.FOREIGN_ROOMS)
        pattern = f"Rooms (*.toml);;Maps, worlds and drawings ({foreign})"
        self._ask_file("Open room", pattern, self._open_room_file)

    @Slot(str)
    def _open_room_file(self, path: str) -> None:
        """Open a room; ask for the unit of a drawing first."""
        if Path(path).suffix.lower() not in files.DRAWINGS:
            self._session.open_file(path)
            return
        dialog = QInputDialog(self._window)
        dialog.setWindowTitle("Open room")
        dialog.setLabelText(f"Unit of the lengths in {Path(path).name}")
        dialog.setComboBoxItems([_STATED, *METRES])
        dialog.textValueSelected.connect(
            lambda unit: self._session.open_room(Path(path), "" if unit == _STATED else unit)
        )
        show_alone(dialog)

    @Slot()
    def open_board(self) -> None:
        """Ask for a board profile."""
        self._ask_file("Open board profile", "Board profiles (*.toml)", self._session.open_board)

    @Slot()
    def add_scan(self) -> None:
        """Ask for a log that is drawn over the readings shown."""
        self._ask_file("Add log", "Logs (*.mcap)", self._session.scans.open)

    @Slot()
    def show_recordings(self) -> None:
        """List earlier recordings."""
        dialog = open_dialog(self._window, RecordingsDialog)
        if dialog is None:
            dialog = RecordingsDialog(self._session.live.settings.folder, self._session.jobs, self._window)
            dialog.chosen.connect(self._session.open_file)
        show_alone(dialog)

    @Slot()
    def save_room(self) -> None:
        """Save the room in its file; without one, as for a room of a log, ask for a name."""
        if not self._session.save_room_again():
            self.save_room_as()

    @Slot()
    def save_room_as(self) -> None:
        """Ask where to save the room."""
        room, folder = self._session.shown.scene.room, self._session.documents.folder(self._session.log_file)
        dialog = self._ask_file("Save room as", "Rooms (*.toml)", self._session.save_room, folder)
        if room is not None:
            dialog.selectFile(_new_name(self._session.shown.scene, folder))

    def _ask_file(
        self, title: str, pattern: str, chosen: Callable[[str], object] | None, save_in: Path | None = None
    ) -> QFileDialog:
        """Open a dialog for a file to open, or to save in a folder; `chosen` takes its path."""
        recent = self._session.documents.recent
        folder = save_in or (Path(recent[0]).parent if recent else "")
        dialog = QFileDialog(self._window, title, str(folder), pattern)
        if save_in is None:
            dialog.setFileMode(QFileDialog.FileMode.ExistingFile)
        else:
            dialog.setAcceptMode(QFileDialog.AcceptMode.AcceptSave)
            dialog.setDefaultSuffix("toml")
        if chosen is not None:
            dialog.fileSelected.connect(chosen)
        show_alone(dialog)
        return dialog


def _new_name(scene: Scene, folder: Path) -> str:
    """Return an unused file name: that of the room if it has no file yet, else for an edited room."""
    stem = f"{Path(scene.room_file).stem.partition('-edited')[0]}-edited" if scene.room_file else name_part(scene)
    names = (f"{stem}{f'-{k}' if k > 1 else ''}.toml" for k in count(1))
    return next(name for name in names if not (folder / name).exists())


def _paths(dropped: QMimeData) -> list[Path]:
    paths = [Path(url.toLocalFile()) for url in dropped.urls() if url.isLocalFile()]
    return [path for path in paths if path.exists()]


# The commands that save pictures of views, data and the report. Each opens a file dialog, which is not modal.


_FILTERS = {
    files.PNG: "Picture (*.png)",
    files.PDF: "Page (*.pdf)",
    files.SVG: "Vector graphics (*.svg)",
    **{format_.suffix: f"{format_.title} (*{format_.suffix})" for format_ in FORMATS},
    files.JSON: "Summary of the comparison (*.json)",
    files.HTML: "Report (*.html)",
    ".gif": "Animation (*.gif)",
    ".mp4": "Video (*.mp4)",
    ".webm": "Video (*.webm)",
}
_Writer = Callable[[BinaryIO], None]


class SaveCommands(QObject):
    """Saves pictures of views, data and the report. Each opens a file dialog, which is not modal."""

    def __init__(self, session: WindowSession, window: QWidget, views: ViewArea) -> None:
        super().__init__(window)
        self._session, self._window, self._views = session, window, views

    @Slot()
    def save_view(self) -> None:
        """Save a picture of the large view."""
        self._save_picture(self._views.large_view)

    def save_small(self, name: str) -> None:
        """Save a picture of a small view."""
        self._save_picture(next(view for view in self._views.beside if view.entry.name == name))

    @Slot()
    def copy_view(self) -> None:
        """Copy a picture of the large view."""
        image = self.image()
        if image is not None:
            QGuiApplication.clipboard().setImage(image)

    def image(self) -> QImage | None:
        """Return the picture of the large view, with title and legend; None if it has none."""
        view, shown = self._views.large_view, self._session.shown
        widget = view.picture()
        if widget is None:
            return None
        pixels = png_pixels(widget, f"{shown.scene.title} · {view.entry.name.lower()}", shown, view.entry.not_drawn)
        height, width = pixels.shape[:2]
        image = QImage(pixels.data, width, height, 4 * width, QImage.Format.Format_RGBA8888)
        return image.copy()  # the pixels belong to the array

    def _save_picture(self, view: View) -> None:
        self._ask(view.entry.name, files.PICTURES, partial(self._picture, view.entry, view.picture()))

    @Slot()
    def save_window(self) -> None:
        """Save a picture of the window."""
        self._ask("Window", (files.PNG,), partial(self._picture, ViewEntry("Window"), self._window))

    @Slot()
    def save_film(self) -> None:
        """Save the sound that is played, or that of the heading explained, as a film."""
        state, question = self._session.sound.state, self._session.shown.question
        ping = state.ping if state is not None else None if question is None else PlayedPing(*question)
        if ping is None:
            self._session.notices.warn("there is no sound to film; select a reading, or click the predicted outline")
        else:
            self._ask("Sound", FILMS, lambda ending: partial(files.write_sound, ping, ending))

    @Slot()
    def export_data(self) -> None:
        """Save the readings, or the summary."""
        if self._has_readings():
            self._ask("Readings", files.DATA, self._data)

    @Slot()
    def save_report(self) -> None:
        """Save a report."""
        if self._session.shown.scene.room is None:
            self._session.notices.warn("a report needs a room to compare with; open a room file")
        elif self._has_readings():
            self._ask("Report", files.REPORT, self._report)

    def _has_readings(self) -> bool:
        if self._session.source.recorded is None:
            self._session.notices.warn("there are no readings to save; scan, or open a log")
        return self._session.source.recorded is not None

    def _ask(self, subject: str, endings: Sequence[str], writer: Callable[[str], _Writer | None]) -> None:
        """Ask for a file. `writer` then returns what writes it with its extension; None: there is nothing to write."""
        folder, name = self._session.documents.folder(self._session.log_file), subject.lower()
        dialog = QFileDialog(self._window, f"Save {name}", str(folder))
        dialog.setAcceptMode(QFileDialog.AcceptMode.AcceptSave)
        dialog.setNameFilters([_FILTERS[ending] for ending in endings])
        dialog.setDefaultSuffix(endings[0])
        stem = Path(self._log_name()).stem or self._session.shown.scene.pose.name or "sonarhw"
        dialog.selectFile(f"{stem}_{name.replace(' ', '-')}{endings[0]}")
        dialog.filterSelected.connect(partial(_choose_ending, dialog))
        dialog.fileSelected.connect(partial(self._write, endings, writer))
        show_alone(dialog)

    def _write(self, endings: Sequence[str], writer: Callable[[str], _Writer | None], name: str) -> None:
        """Save a file; an existing one is replaced: the dialog has asked the user."""
        path = Path(name)
        self._session.documents.saved_in = path.parent
        write = writer(path.suffix.lower())
        if write is not None:
            self._session.save(write, endings, path, overwrite=True)

    def _picture(self, entry: ViewEntry, view: QWidget | None, ending: str) -> _Writer | None:
        if view is None:
            return None
        shown = self._session.shown
        title = "" if view is self._window else f"{shown.scene.title} · {entry.name.lower()}"
        drawn = view, title, shown, entry.not_drawn
        if ending == files.SVG:
            return partial(files.write_svg, svg_text(*drawn))
        if ending == files.PDF:
            return partial(files.write_pdf, pdf_bytes(*drawn))
        return partial(files.write_png, png_pixels(*drawn))

    def _data(self, ending: str) -> _Writer | None:
        session, recorded = self._session, self._session.source.recorded
        if recorded is None:
            return None
        return partial(files.write_data, recorded, session.shown.scene, session.showing.pinned_notes, ending)

    def _report(self, _: str) -> _Writer | None:
        session, recorded = self._session, self._session.source.recorded
        if recorded is None:
            return None
        link = session.live.link
        live = link is not None and session.replay is None
        facts = [(name, value) for name, value, _ in link_figures(link)] if live else []
        notes = session.showing.pinned_notes
        return partial(files.write_report, self._log_name(), recorded, session.shown.scene, facts, notes)

    def _log_name(self) -> str:
        source = self._session.source
        return source.name if isinstance(source, Replay) else source.path.name if source.path is not None else ""


def _choose_ending(dialog: QFileDialog, chosen: str) -> None:
    """Change the extension of the file name to the chosen file type."""
    ending = next(ending for ending, name in _FILTERS.items() if name == chosen)
    dialog.setDefaultSuffix(ending)
    for name in dialog.selectedFiles():
        dialog.selectFile(Path(name).with_suffix(ending).name)
