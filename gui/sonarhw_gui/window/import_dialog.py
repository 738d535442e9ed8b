"""The dialog that asks how to read a CSV scan, and shows its first lines as they would be imported. Not modal."""

import math
from collections.abc import Sequence
from pathlib import Path

from PySide6 import QtWidgets
from PySide6.QtCore import Qt, Signal, Slot
from sonarhw_compare.foreign_csv import CsvColumns, CsvHead, Meaning, likely_columns, likely_unit, read_head

from sonarhw.errors import InputError
from sonarhw.readings import Reading
from sonarhw_gui.jobs.files import read_csv
from sonarhw_gui.jobs.jobs import Jobs
from sonarhw_gui.model.look import LengthUnit
from sonarhw_gui.widgets import NumberField, PlainLabel, cell, text_table

_LINES = 8  # in the preview
_READING = "read CSV"
_UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "ft": 0.3048, "in": 0.0254}
_TURNS = {"counter-clockwise": 1.0, "clockwise": -1.0}
_NO_TIME = "(none: 0.1 s apart)"


class ImportDialog(QtWidgets.QDialog):
    """Reads the file again in a thread after each change; an error is shown where the values are typed."""

    accepted_as = Signal(object, object)  # the path, the readings

    def __init__(self, path: Path, unit: LengthUnit, jobs: Jobs, parent: QtWidgets.QWidget) -> None:
        """`unit`: of the ranges in the preview."""
        super().__init__(parent)
        self.setWindowTitle(f"Import {path.name}")
        self._path, self._unit, self._jobs = path, unit, jobs
        self._head = CsvHead((), (), False)
        # of the file as the values say; None while it is read, or if one is wrong
        self._readings: Sequence[Reading] | None = None
        self._likely_no_echo: float | None = None  # a range, in the unit of the file
        self.heading, self.distance, self.time = QtWidgets.QComboBox(), QtWidgets.QComboBox(), QtWidgets.QComboBox()
        self.turn, self.unit = QtWidgets.QComboBox(), QtWidgets.QComboBox()
        self.turn.addItems(list(_TURNS))
        self.unit.addItems(list(_UNITS))
        self.zero = NumberField(-360.0, 360.0, 3, "°")
        self.zero.setKeyboardTracking(True)  # the preview follows every key
        self.no_echo = QtWidgets.QLineEdit(placeholderText="none")
        self.silence = QtWidgets.QPushButton()
        self.decimal_comma = QtWidgets.QCheckBox("Decimal commas; semicolons or tabs between columns")
        self.preview = text_table()
        self.preview.setAccessibleName("First lines as they are read")
        self.preview.setSelectionMode(QtWidgets.QAbstractItemView.SelectionMode.NoSelection)
        self.preview.horizontalHeader().setSectionResizeMode(QtWidgets.QHeaderView.ResizeMode.ResizeToContents)
        self.preview.horizontalHeader().setStretchLastSection(False)
        self.note = PlainLabel(wordWrap=True)
        self.buttons = QtWidgets.QDialogButtonBox()
        self.import_button = self.buttons.addButton("Import", QtWidgets.QDialogButtonBox.ButtonRole.AcceptRole)
        self.buttons.addButton(QtWidgets.QDialogButtonBox.StandardButton.Cancel)
        self._lay_out()
        self._begin()
        self._connect()

    def _lay_out(self) -> None:
        form = QtWidgets.QGridLayout()
        for row, fields in enumerate(
            (
                (("Heading column", self.heading), ("Headings increase", self.turn)),
                (("Range column", self.distance), ("Unit of the range", self.unit)),
                (("Time column", self.time), ("Turntable angle at heading 0", self.zero)),
                (("Range that means no echo", self.no_echo),),
            )
        ):
            for column, (name, field) in enumerate(fields):
                field.setAccessibleName(name)
                form.addWidget(PlainLabel(name), row, 2 * column)
                form.addWidget(field, row, 2 * column + 1)
        form.addWidget(self.silence, 3, 2, 1, 2)
        form.addWidget(self.decimal_comma, 4, 0, 1, 4)
        form.setColumnStretch(1, 1)
        form.setColumnStretch(3, 1)
        below = QtWidgets.QHBoxLayout()
        below.addWidget(self.note, stretch=1)
        below.addWidget(self.buttons, alignment=Qt.AlignmentFlag.AlignBottom)
        page = QtWidgets.QVBoxLayout(self)
        page.addLayout(form)
        page.addWidget(self.preview, stretch=1)
        page.addLayout(below)
        self.silence.hide()
        self.import_button.setDefault(True)
        self.resize(760, 480)

    def _begin(self) -> None:
        """Guess how the file is written, and its columns."""
        try:
            read_head(self._path, 0)
        except InputError:
            try:
                read_head(self._path, 0, decimal_comma=True)
                self.decimal_comma.setChecked(True)
            except InputError:
                pass  # reported by the next reading
        self._read_head()

    def _connect(self) -> None:
        self.decimal_comma.toggled.connect(self._read_head)
        self.distance.currentTextChanged.connect(self._guess_unit)
        for list_ in (self.heading, self.distance, self.time, self.turn, self.unit):
            list_.currentIndexChanged.connect(self._read_again)
        self.zero.valueChanged.connect(self._read_again)
        self.no_echo.textChanged.connect(self._read_again)
        self.silence.clicked.connect(self._take_silence)
        self.buttons.accepted.connect(self.accept)
        self.buttons.rejected.connect(self.reject)

    @Slot()
    def _read_head(self) -> None:
        """Read the first lines, and list the columns."""
        try:
            self._head = read_head(self._path, _LINES, self.decimal_comma.isChecked())
        except InputError as error:
            self._jobs.cancel(_READING)
            self._head, self._readings = CsvHead((), (), False), None
            self._list_columns()
            self._report(str(error))
            return
        self._list_columns()
        self._guess_unit(self.distance.currentText())
        self._read_again()

    def _list_columns(self) -> None:
        header = self._head.header
        for list_, guessed, first in zip(
            (self.heading, self.distance, self.time), likely_columns(header), ("", "", _NO_TIME), strict=True
        ):
            list_.blockSignals(True)
            list_.clear()
            list_.addItem(first, None)
            for name in header:
                list_.addItem(name, name)
            list_.setCurrentIndex(0 if guessed is None else 1 + header.index(guessed))
            list_.blockSignals(False)
        self._show_lines(())

    @Slot(str)
    def _guess_unit(self, column: str) -> None:
        metres = likely_unit(column)
        if metres is not None:
            self.unit.setCurrentText(next(name for name, value in _UNITS.items() if value == metres))

    @Slot()
    def _take_silence(self) -> None:
        if self._readings is not None and self._likely_no_echo is not None:
            self.no_echo.setText(f"{self._likely_no_echo:g}")
            self.no_echo.setFocus()

    @Slot()
    def _read_again(self) -> None:
        """Read the whole file with the values typed."""
        self._jobs.cancel(_READING)  # a value has changed since
        self._readings = None
        self.import_button.setEnabled(False)
        try:
            self._jobs.run(_READING, read_csv, self._path, *self._typed(), then=self._show_read, failed=self._report)
            self.note.setText("reading …")
        except InputError as error:
            self._report(str(error))

    def _typed(self) -> tuple[CsvColumns, Meaning]:
        """Return what the values say. Raises InputError if one is missing or wrong."""
        heading, distance, time = (list_.currentData() for list_ in (self.heading, self.distance, self.time))
        if not heading or not distance:
            raise InputError(f"choose the column of the {'range' if heading else 'heading'}")
        columns = CsvColumns(heading, distance, time, self._head.decimal_comma)
        sign, scale = _TURNS[self.turn.currentText()], _UNITS[self.unit.currentText()]
        return columns, Meaning(scale, sign, self.zero.value(), self._typed_no_echo())

    def _typed_no_echo(self) -> float | None:
        text = self.no_echo.text().strip()
        if not text:
            return None
        try:
            return float(text.replace(",", ".") if self._head.decimal_comma else text)
        except ValueError:
            raise InputError(f"range that means no echo: {text!r}; expected a number, or nothing") from None

    def _show_read(self, read: tuple[Sequence[Reading], tuple[float, int] | None]) -> None:
        self._readings, likely = read
        self.import_button.setEnabled(True)
        self._show_lines(self._readings)
        self.note.setText(self._summary(self._readings))
        self.silence.setVisible(likely is not None)
        self._likely_no_echo, count = likely or (None, 0)
        if likely is not None:
            self.silence.setText(f"{self._likely_no_echo:g} means no echo ({count} readings)")
            self.silence.setToolTip("Enter this value as the range that means no echo")

    def _report(self, problem: str) -> None:
        """Show what is wrong in place of the summary."""
        self._show_lines(())
        self.silence.hide()
        self.import_button.setEnabled(False)
        self.note.setText(f"⚠ {problem}")

    def _show_lines(self, readings: Sequence[Reading]) -> None:
        """Show the first lines: their fields as written, then angle and range as they are read."""
        header, table = self._head.header, self.preview
        table.setColumnCount(len(header) + 2)
        table.setHorizontalHeaderLabels([*header, "turntable angle", "range"])
        table.setRowCount(len(self._head.rows))
        for row, fields in enumerate(self._head.rows):
            read = self._texts(readings[row]) if row < len(readings) else ("", "")
            padded = [*fields, *[""] * len(header)][: len(header)]
            for column, text in enumerate((*padded, *read)):
                item = cell(text)
                if column >= len(header):
                    font = item.font()
                    font.setBold(True)
                    item.setFont(font)
                table.setItem(row, column, item)

    def _texts(self, reading: Reading) -> tuple[str, str]:
        range_ = "no echo" if reading.range is None else self._unit.text(reading.range)
        return f"{math.degrees(reading.angle):z.1f}°", range_

    def _summary(self, readings: Sequence[Reading]) -> str:
        ranges = [reading.range for reading in readings if reading.range is not None]
        angles = [math.degrees(reading.angle) for reading in readings]
        between = f", {self._unit.text(min(ranges))} to {self._unit.text(max(ranges))}" if ranges else ""
        turned = f"turntable angles {min(angles):z.1f}° to {max(angles):z.1f}°"
        return f"{len(readings)} readings, {len(readings) - len(ranges)} without an echo; {turned}{between}"

    def accept(self) -> None:
        """Import what the preview shows."""
        if self._readings is not None:
            self.accepted_as.emit(self._path, self._readings)
            super().accept()

    def done(self, result: int) -> None:
        """Read no more when the dialog closes in any way."""
        self._jobs.cancel(_READING)
        super().done(result)
