"""The dialogs of the window: commands, connect, help and recordings. None is modal, and one is open at a time."""

import time
from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import TypeVar

from PySide6 import QtWidgets
from PySide6.QtCore import QEvent, QModelIndex, QObject, QSize, Qt, Signal, Slot
from PySide6.QtGui import QAction, QKeyEvent, QKeySequence

from sonarhw_gui.jobs.files import RecordingRow, list_recordings
from sonarhw_gui.jobs.jobs import Jobs
from sonarhw_gui.model.look import MARKS, Look
from sonarhw_gui.session.scanner import PortRow, ScannerChoice
from sonarhw_gui.views.legend import mark_picture
from sonarhw_gui.widgets import NumberField, PlainLabel, cell, show_alone, stacked, text_table

_Dialog = TypeVar("_Dialog", bound=QtWidgets.QDialog)
_SIZE = 420, 360  # pixels, of the palette
_WIDTH = 420  # pixels, of a dialog for a note
_NEW_ROOM = 4.0, 3.0  # m, width and depth that are proposed
_STEPS = (Qt.Key.Key_Up, Qt.Key.Key_Down, Qt.Key.Key_PageUp, Qt.Key.Key_PageDown)


def open_dialog(window: QtWidgets.QWidget, kind: type[_Dialog]) -> _Dialog | None:
    """Return the open dialog of a kind; None without one."""
    return next((dialog for dialog in window.findChildren(kind) if dialog.isVisible()), None)


def ask_text(
    window: QtWidgets.QWidget, title: str, label: str, text: str = "", longest: int | None = None
) -> QtWidgets.QInputDialog:
    """Open and return a dialog for one line of text, of at most `longest` characters."""
    dialog = QtWidgets.QInputDialog(window)
    dialog.setWindowTitle(title)
    dialog.setLabelText(label)
    dialog.setTextValue(text)
    field = dialog.findChild(QtWidgets.QLineEdit)
    if longest is not None and field is not None:
        field.setMaxLength(longest)
        field.setAccessibleName(title.split()[-1].capitalize())
        dialog.resize(_WIDTH, dialog.sizeHint().height())
    show_alone(dialog)
    return dialog


class NewRoomDialog(QtWidgets.QDialog):
    """Asks for name and size of a new room, which is empty. Not modal."""

    accepted_as = Signal(str, float, float)  # name, width and depth, m

    def __init__(self, parent: QtWidgets.QWidget) -> None:
        super().__init__(parent)
        self.setWindowTitle("New room")
        self.name = QtWidgets.QLineEdit("My room")
        self.width_field, self.depth_field = NumberField(0.1, 100.0, 2, " m"), NumberField(0.1, 100.0, 2, " m")
        self.width_field.setValue(_NEW_ROOM[0])
        self.depth_field.setValue(_NEW_ROOM[1])
        form = QtWidgets.QFormLayout()
        form.addRow("Name", self.name)
        form.addRow("Width, along x", self.width_field)
        form.addRow("Depth, along y", self.depth_field)
        self.buttons = QtWidgets.QDialogButtonBox()
        self.buttons.addButton("Create", QtWidgets.QDialogButtonBox.ButtonRole.AcceptRole)
        self.buttons.addButton(QtWidgets.QDialogButtonBox.StandardButton.Cancel)
        hint = PlainLabel(
            "Four walls. In the plan, Edit (E) moves corners, and its double click on a wall adds one. Wall (W) and "
            "Post (P) draw more."
        )
        hint.setWordWrap(True)
        stacked(self, form, hint, self.buttons)
        self.buttons.accepted.connect(self._choose)
        self.buttons.rejected.connect(self.close)
        self.name.selectAll()

    @Slot()
    def _choose(self) -> None:
        self.close()
        self.accepted_as.emit(self.name.text().strip() or "room", self.width_field.value(), self.depth_field.value())


class CommandPalette(QtWidgets.QDialog):
    """Lists the enabled commands with all typed words: first those with the words in their names. Not modal."""

    def __init__(self, actions: Sequence[QAction], parent: QtWidgets.QWidget) -> None:
        super().__init__(parent)
        self.setWindowTitle("sonarhw — commands")
        self._actions = {plain_name(action): action for action in actions if action.isEnabled() and action.text()}
        self.words, self.list = QtWidgets.QLineEdit(placeholderText="part of a command"), QtWidgets.QListWidget()
        self.words.setAccessibleName("Part of a command")
        self.list.setAccessibleName("Commands")
        self.list.setFocusPolicy(Qt.FocusPolicy.NoFocus)  # the arrow keys work while the words have the focus
        self.words.textChanged.connect(self._filter)
        self.words.returnPressed.connect(self._run)
        self.list.itemClicked.connect(self._run)
        self.words.installEventFilter(self)
        stacked(self, self.words, self.list)
        self.resize(*_SIZE)
        self._filter("")

    @property
    def names(self) -> list[str]:
        """The names listed."""
        return [self.list.item(row).data(Qt.ItemDataRole.UserRole) for row in range(self.list.count())]

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        """Let the arrow keys move in the list."""
        if event.type() is QEvent.Type.KeyPress and isinstance(event, QKeyEvent) and event.key() in _STEPS:
            self.list.event(event)
            return True
        return super().eventFilter(watched, event)

    @Slot(str)
    def _filter(self, text: str) -> None:
        self.list.clear()
        words = text.casefold().split()
        listed = [command for command in self._actions.items() if _has(f"{command[0]} {command[1].toolTip()}", words)]
        for name, action in sorted(listed, key=lambda command: not _has(command[0], words)):
            item = QtWidgets.QListWidgetItem(f"{name}    {action.shortcut().toString()}".rstrip())
            item.setData(Qt.ItemDataRole.UserRole, name)
            self.list.addItem(item)
        self.list.setCurrentRow(0)

    @Slot()
    def _run(self) -> None:
        item = self.list.currentItem()
        if item is None:
            return
        action = self._actions[item.data(Qt.ItemDataRole.UserRole)]
        self.close()
        action.trigger()


def _has(text: str, words: Sequence[str]) -> bool:
    return all(word in text.casefold() for word in words)


def plain_name(action: QAction) -> str:
    """Return the name of a command without its symbols."""
    return action.text().replace("&", "").strip("▶■● …")


# The connect dialog: the ports of this computer and a field for any other URL. Not modal.


_EXAMPLES = (
    "/dev/ttyUSB0, COM3, socket://HOST:PORT, rfc2217://HOST:PORT, fake:ROOM?place=NAME, "
    "or lines:PORT?preset=arduino-radar"
)


class ConnectDialog(QtWidgets.QDialog):
    """Dialog to choose a scanner."""

    def __init__(self, scanners: ScannerChoice, parent: QtWidgets.QWidget) -> None:
        super().__init__(parent)
        self._scanners = scanners
        self.setWindowTitle("Connect a scanner")
        self._rows: tuple[PortRow, ...] = ()
        self.ports = text_table("port", "device", "answer")
        for column in (0, 1):
            self.ports.horizontalHeader().setSectionResizeMode(
                column, QtWidgets.QHeaderView.ResizeMode.ResizeToContents
            )
        self.none = PlainLabel(
            "No serial port found. Plug in the scanner and press Refresh, or enter a URL.", wordWrap=True
        )
        self.refresh, self.probe_all = QtWidgets.QPushButton("Refresh"), QtWidgets.QPushButton("Check all ports")
        self.probe_all.setToolTip("Opening a port may reset the device on it")
        self.listen = QtWidgets.QPushButton("Listen for text")
        self.listen.setToolTip("Find out what an Arduino radar or another device prints at the port below")
        self.field = QtWidgets.QLineEdit(placeholderText=_EXAMPLES)
        self.url = QtWidgets.QComboBox(editable=True, insertPolicy=QtWidgets.QComboBox.InsertPolicy.NoInsert)
        self.url.setToolTip(_EXAMPLES)
        self.url.setLineEdit(self.field)
        # with selected text, Return would replace a proposed URL by an earlier one
        self.url.setCompleter(None)  # type: ignore[arg-type]  # the stub does not know that None is allowed
        self.buttons = QtWidgets.QDialogButtonBox()
        # made here: PySide may take a button that Qt made for one deleted before, if a reference is kept
        self.connect_button = QtWidgets.QPushButton("Connect")
        self.buttons.addButton(self.connect_button, QtWidgets.QDialogButtonBox.ButtonRole.AcceptRole)
        self.buttons.addButton(QtWidgets.QDialogButtonBox.StandardButton.Cancel)
        buttons = self.refresh, self.probe_all, self.listen, None
        self.of_url = PlainLabel()
        stacked(self, self.none, self.ports, buttons, self.of_url, self.url, self.buttons)
        self._connect()
        self.resize(640, 340)
        self._update_button()
        self.show_ports(())
        scanners.list_ports()

    def show_ports(self, rows: Sequence[PortRow]) -> None:
        """List the ports; the selection does not change."""
        self._rows, chosen = tuple(rows), self.url.currentText()
        self.ports.setRowCount(len(rows))
        for k, row in enumerate(rows):
            for column, text in enumerate((row.device, row.description, row.answer)):
                self.ports.setItem(k, column, cell(text))
        self.none.setVisible(not rows)
        self.ports.setVisible(bool(rows))
        self.probe_all.setEnabled(any(row.answer == "not checked" for row in rows))
        proposed = {row.device: row.proposed_url for row in rows if row.proposed_url}
        answered = [url for row in rows for url in row.answered_urls if url != row.proposed_url]
        self.of_url.setText(f"Port or URL{'; the list has the URL of each answer' if answered else ''}")
        if chosen in proposed or not self.url.count():  # else the user may be typing
            self.url.clear()
            self.url.addItems([*answered, *self._scanners.urls])
            self.url.setEditText(proposed.get(chosen, chosen))
        answering = [row.device for row in rows if row.answers]
        if not chosen and len(answering) == 1:
            self.url.setEditText(answering[0])
        self._select(self.url.currentText(), rows)

    def _select(self, url: str, rows: Sequence[PortRow]) -> None:
        row = next((k for k, row in enumerate(rows) if url in (row.device, row.proposed_url)), -1)
        if row >= 0:
            self.ports.selectRow(row)

    def _connect(self) -> None:
        self.ports.clicked.connect(self._take_row)
        self.ports.doubleClicked.connect(self._choose_row)
        self.url.editTextChanged.connect(self._update_button)
        self._scanners.ports_changed.connect(self.show_ports)
        self.refresh.clicked.connect(self._scanners.list_ports)
        self.probe_all.clicked.connect(self._scanners.probe_all)
        self.listen.clicked.connect(self._listen)
        self.buttons.accepted.connect(self._choose)
        self.buttons.rejected.connect(self.close)

    @Slot(QModelIndex)
    def _take_row(self, index: QModelIndex) -> None:
        row = self._rows[index.row()]
        self.url.setEditText(row.proposed_url or row.device)

    @Slot(QModelIndex)
    def _choose_row(self, index: QModelIndex) -> None:
        self._take_row(index)
        self._choose()

    @Slot()
    def _choose(self) -> None:
        url = self.url.currentText().strip()
        if url:
            self.close()
            self._scanners.choose(url)

    @Slot()
    def _listen(self) -> None:
        self._scanners.listen(self.url.currentText().strip())

    @Slot()
    def _update_button(self) -> None:
        url = self.url.currentText().strip()
        self.connect_button.setEnabled(bool(url))
        self.listen.setEnabled(bool(url) and "://" not in url and "?" not in url)
        self.connect_button.setDefault(True)


# The help page: a short introduction, every key, and the classes of readings, on one screen. Not modal.


_COLUMNS = 3
_CLASS_WIDTH = 250  # pixels
_ABOUT = (
    "The window shows a scan over its prediction. <b>Click a reading</b> in the plan, the range view or the table: the "
    "sentence explains it, the plan shows the path of its sound, and the trace names every echo. "
    "<b>Drag the sensor</b> to move it, or its beam to turn it: the prediction follows. Esc cancels the drag. "
    "<b>Drop a file</b> on the window to open it: a log, a room, or a scan of another program. "
    "<b>Point at a name in the legend</b> to read what it means."
)


class HelpPage(QtWidgets.QDialog):
    """The help page."""

    def __init__(
        self, groups: Mapping[str, Sequence[QAction]], look: Look, parent: QtWidgets.QWidget | None, max_size: QSize
    ) -> None:
        """`max_size`: larger content gets a scroll bar."""
        super().__init__(parent)
        self.setWindowTitle("sonarhw — help")
        self.area = QtWidgets.QScrollArea(widgetResizable=True)
        self.area.setFrameShape(QtWidgets.QScrollArea.Shape.NoFrame)
        bar = self.area.verticalScrollBar().sizeHint().width()
        for columns in range(_COLUMNS, 0, -1):
            page = _page(_in_columns(groups, columns), look)
            if page.minimumSizeHint().width() + bar <= max_size.width():
                break
        self.area.setWidget(page)
        layout = QtWidgets.QVBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.addWidget(self.area)
        width = page.minimumSizeHint().width()
        whole = QSize(width, page.heightForWidth(width))
        self.resize((whole + QSize(bar, 0)).boundedTo(max_size))


def _page(columns: Sequence[Sequence[tuple[str, Sequence[QAction]]]], look: Look) -> QtWidgets.QWidget:
    page = QtWidgets.QWidget()
    about = QtWidgets.QLabel(_ABOUT)
    about.setWordWrap(True)
    keys = QtWidgets.QGridLayout()
    keys.setHorizontalSpacing(28)
    for column, part in enumerate(columns):
        label = QtWidgets.QLabel("".join(_table(name, actions, look) for name, actions in part))
        label.setAlignment(Qt.AlignmentFlag.AlignTop)
        keys.addWidget(label, 0, column)
    beside = QtWidgets.QHBoxLayout()
    beside.setSpacing(28)
    beside.addLayout(keys)
    beside.addLayout(_classes(look), stretch=1)
    layout = QtWidgets.QVBoxLayout(page)
    layout.setContentsMargins(18, 14, 18, 14)
    layout.addWidget(about)
    layout.addLayout(beside)
    return page


def _classes(look: Look) -> QtWidgets.QGridLayout:
    """Return the mark of each class of readings beside its meaning."""
    grid = QtWidgets.QGridLayout()
    grid.setSpacing(8)
    grid.setColumnMinimumWidth(1, round(_CLASS_WIDTH * look.scale))
    grid.addWidget(QtWidgets.QLabel(_heading("Classes of readings", look)), 0, 0, 1, 2)
    for row, (kind, mark) in enumerate(MARKS.items(), start=1):
        symbol = QtWidgets.QLabel(
            pixmap=mark_picture(kind, look.palette, QtWidgets.QApplication.primaryScreen().devicePixelRatio())
        )
        text = QtWidgets.QLabel(
            f"<b>{mark.name}</b>: {mark.meaning}. {mark.hint}{'.' if mark.hint else ''}", wordWrap=True
        )
        for column, part in enumerate((symbol, text)):
            part.setAlignment(Qt.AlignmentFlag.AlignTop)
            grid.addWidget(part, row, column)
    grid.setRowStretch(grid.rowCount(), 1)
    return grid


def _in_columns(
    groups: Mapping[str, Sequence[QAction]], most_columns: int
) -> list[list[tuple[str, Sequence[QAction]]]]:
    """Distribute the groups over columns of similar height, in order."""
    heights = {name: len(actions) + 2 for name, actions in groups.items()}
    most = sum(heights.values()) / most_columns
    columns: list[list[tuple[str, Sequence[QAction]]]] = [[]]
    height = 0.0
    for name, actions in groups.items():
        if columns[-1] and height + heights[name] / 2 > most and len(columns) < most_columns:
            columns.append([])
            height = 0.0
        columns[-1].append((name, actions))
        height += heights[name]
    return columns


def _table(name: str, actions: Sequence[QAction], look: Look) -> str:
    rows = "".join(
        f"<tr><td><b>{escape(keys)}</b>&nbsp;&nbsp;</td><td>{escape(plain_name(action))}</td></tr>"
        for action in actions
        if (keys := _keys(action))
    )
    return f"{_heading(name, look)}<table>{rows}</table>"


def _heading(name: str, look: Look) -> str:
    return f'<p style="color: {look.palette.predicted}; margin: 4px 0 2px 0">{escape(name)}</p>'


def _keys(action: QAction) -> str:
    return ", ".join(key.toString(QKeySequence.SequenceFormat.NativeText) for key in action.shortcuts())


# The dialog that lists, searches and opens recordings. Not modal.


_RECORDING_COLUMNS = ("date", "room", "place", "readings", "traces", "file", "condition")
_PATH = Qt.ItemDataRole.UserRole
_LISTING = "list recordings"


class RecordingsDialog(QtWidgets.QDialog):
    """Dialog to open a recording."""

    chosen = Signal(str)  # path

    def __init__(self, folder: Path, jobs: Jobs, parent: QtWidgets.QWidget) -> None:
        super().__init__(parent)
        self.setWindowTitle("Recordings")
        self._folder, self._jobs = folder, jobs
        self.search = QtWidgets.QLineEdit(clearButtonEnabled=True, placeholderText="date, room, place or file")
        self.table = text_table(*_RECORDING_COLUMNS)
        self.table.horizontalHeader().setSectionResizeMode(QtWidgets.QHeaderView.ResizeMode.ResizeToContents)
        self.summary = PlainLabel(wordWrap=True)
        self.buttons = QtWidgets.QDialogButtonBox()
        self.open_button = QtWidgets.QPushButton("Open")
        self.buttons.addButton(self.open_button, QtWidgets.QDialogButtonBox.ButtonRole.AcceptRole)
        self.buttons.addButton(QtWidgets.QDialogButtonBox.StandardButton.Close)
        stacked(self, self.search, self.table, self.summary, self.buttons)
        self.resize(860, 420)
        self.search.textChanged.connect(self._filter)
        self.table.itemSelectionChanged.connect(self._update_button)
        self.table.doubleClicked.connect(self._choose)
        self.buttons.accepted.connect(self._choose)
        self.buttons.rejected.connect(self.reject)
        self._draw([], 0)
        self._read([])

    def _read(self, rows: Sequence[RecordingRow]) -> None:
        """Read more than these recordings."""
        self._jobs.run(_LISTING, list_recordings, self._folder, rows, then=self._take)

    def _take(self, listed: tuple[Sequence[RecordingRow], int]) -> None:
        rows, files = listed
        self._draw(rows, files)
        if len(rows) < files:
            self._read(rows)

    def _draw(self, rows: Sequence[RecordingRow], files: int) -> None:
        """List the recordings that were read so far; `files`: number of logs in the folder."""
        chosen = self._chosen()
        self.table.setRowCount(len(rows))
        for number, row in enumerate(rows):
            for column, text in enumerate(_texts(row)):
                item = cell(text, tip=str(row.path))
                item.setData(_PATH, str(row.path))
                self.table.setItem(number, column, item)
            if str(row.path) == chosen:
                self.table.selectRow(number)
        if rows and not chosen:
            self.table.selectRow(0)
        self.summary.setText(_summary(self._folder, len(rows), files))
        self._filter()

    @Slot()
    def _filter(self) -> None:
        """Hide the rows that do not contain every word."""
        words = self.search.text().lower().split()
        for number in range(self.table.rowCount()):
            items = (self.table.item(number, column) for column in range(len(_RECORDING_COLUMNS)))
            text = " ".join(item.text() for item in items if item is not None).lower()
            self.table.setRowHidden(number, not all(word in text for word in words))
        self._update_button()

    def _chosen(self) -> str:
        """Return the path of the selected visible row; empty without one."""
        visible = [item for item in self.table.selectedItems() if not self.table.isRowHidden(item.row())]
        return str(visible[0].data(_PATH)) if visible else ""

    @Slot()
    def _update_button(self) -> None:
        self.open_button.setEnabled(bool(self._chosen()))

    @Slot()
    @Slot(QModelIndex)
    def _choose(self) -> None:
        if path := self._chosen():
            self.chosen.emit(path)
            self.accept()

    def done(self, result: int) -> None:
        """Read no more when the dialog closes in any way."""
        self._jobs.cancel(_LISTING)
        super().done(result)


def _texts(row: RecordingRow) -> tuple[str, ...]:
    date = time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(row.began))
    return date, row.room, row.place, str(row.readings), "yes" if row.traces else "no", row.path.name, row.condition


def _summary(folder: Path, read: int, files: int) -> str:
    if not files:
        return f"{folder}: no recordings yet; every scan in the window is recorded"
    return f"{folder}: {files} recordings{'' if read == files else f', {read} read'}"
