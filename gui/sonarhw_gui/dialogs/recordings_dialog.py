"""The dialog that lists, searches and opens recordings. Not modal."""

import time
from pathlib import Path

from PySide6.QtCore import QModelIndex, Qt, QTimer, Signal, Slot
from PySide6.QtWidgets import (
    QAbstractItemView,
    QDialog,
    QDialogButtonBox,
    QHeaderView,
    QLineEdit,
    QTableWidget,
    QTableWidgetItem,
    QVBoxLayout,
    QWidget,
)

from sonarhw_gui.parts.plain_label import PlainLabel, plain_tip
from sonarhw_gui.store.recording_list import RecordingList, RecordingRow, Recordings

_COLUMNS = ("date", "room", "place", "readings", "traces", "file", "condition")
_PATH = Qt.ItemDataRole.UserRole
_TICK = 50  # ms


class RecordingsDialog(QDialog):
    """Dialog to open a recording."""

    chosen = Signal(str)  # path
    failed = Signal(str)

    def __init__(self, folder: Path, parent: QWidget) -> None:
        super().__init__(parent)
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self.setWindowTitle("Recordings")
        self._recordings = Recordings(folder)
        self.search = QLineEdit(clearButtonEnabled=True, placeholderText="date, room, place or file")
        self.table = _recording_table()
        self.summary = PlainLabel(wordWrap=True)
        self.buttons = QDialogButtonBox()
        self.open_button = self.buttons.addButton("Open", QDialogButtonBox.ButtonRole.AcceptRole)
        self.buttons.addButton(QDialogButtonBox.StandardButton.Close)
        column = QVBoxLayout(self)
        for part in (self.search, self.table, self.summary, self.buttons):
            column.addWidget(part)
        self.resize(860, 420)
        self._timer = QTimer(self, interval=_TICK)
        self._timer.timeout.connect(self._take)
        self._timer.start()
        self.search.textChanged.connect(self._filter)
        self.table.itemSelectionChanged.connect(self._update_button)
        self.table.doubleClicked.connect(self._choose)
        self.buttons.accepted.connect(self._choose)
        self.buttons.rejected.connect(self.reject)
        self._draw(self._recordings.listed)

    @Slot()
    def _take(self) -> None:
        if self._recordings.take():
            self._draw(self._recordings.listed)
        for message in self._recordings.failures:
            self.failed.emit(message)
        self._recordings.failures.clear()

    def _draw(self, listed: RecordingList) -> None:
        chosen = self._chosen()
        self.table.setRowCount(len(listed.rows))
        for number, row in enumerate(listed.rows):
            for column, text in enumerate(_texts(row)):
                item = QTableWidgetItem(text)
                item.setToolTip(plain_tip(str(row.path)))
                item.setData(_PATH, str(row.path))
                self.table.setItem(number, column, item)
            if str(row.path) == chosen:
                self.table.selectRow(number)
        if listed.rows and not chosen:
            self.table.selectRow(0)
        self.summary.setText(_summary(listed))
        self._filter()

    @Slot()
    def _filter(self) -> None:
        """Hide the rows that do not contain every word."""
        words = self.search.text().lower().split()
        for number in range(self.table.rowCount()):
            cells = (self.table.item(number, column) for column in range(len(_COLUMNS)))
            text = " ".join(cell.text() for cell in cells if cell is not None).lower()
            self.table.setRowHidden(number, not all(word in text for word in words))
        self._update_button()

    def _chosen(self) -> str:
        """Return the path of the selected visible row; empty without one."""
        found = [item for item in self.table.selectedItems() if not self.table.isRowHidden(item.row())]
        return str(found[0].data(_PATH)) if found else ""

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
        """End the thread when the dialog closes in any way."""
        self._timer.stop()
        self._recordings.close()
        super().done(result)


def _recording_table() -> QTableWidget:
    table = QTableWidget(0, len(_COLUMNS))
    table.setHorizontalHeaderLabels(_COLUMNS)
    table.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
    table.setSelectionMode(QAbstractItemView.SelectionMode.SingleSelection)
    table.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
    table.verticalHeader().hide()
    table.horizontalHeader().setSectionResizeMode(QHeaderView.ResizeMode.ResizeToContents)
    table.horizontalHeader().setStretchLastSection(True)
    return table


def _texts(row: RecordingRow) -> tuple[str, ...]:
    date = time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(row.began))
    return date, row.room, row.place, str(row.readings), "yes" if row.traces else "no", row.path.name, row.condition


def _summary(listed: RecordingList) -> str:
    if not listed.files:
        return f"{listed.folder}: no recordings yet; every scan in the window is recorded"
    reading = "" if listed.complete else f", {len(listed.rows)} read"
    return f"{listed.folder}: {listed.files} recordings{reading}"
