"""The dialog that imports a scan of another program: how it is read, why, and its points in the room. Not modal."""

import math
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from PySide6 import QtWidgets
from PySide6.QtCore import QMargins, QSignalBlocker, QSize, Qt, Signal, Slot
from sonarhw_compare.import_formats import FORMATS, ImportFormat, takes_option

from sonarhw.errors import InputError, shortened
from sonarhw.readings import Origin, Reading
from sonarhw.text.tables import Columns, columns_of
from sonarhw.text.words import ANGLE_UNITS, RANGE_UNITS, STEP
from sonarhw_gui.jobs.files import SHOWN_LINES, LookedAt, look_at_scan
from sonarhw_gui.jobs.jobs import Jobs
from sonarhw_gui.model.shown import Shown
from sonarhw_gui.views.base import Gestures
from sonarhw_gui.views.plan import PlanDrawing
from sonarhw_gui.widgets import FlowLayout, NumberField, PlainLabel, cell, short_list, stacked, text_table

_READING = "read a scan"
_RECOGNISED = "as recognised"
_TURNS = {_RECOGNISED: "", "counter-clockwise": "ccw", "clockwise": "cw"}
_AXES = {_RECOGNISED: "", "rows": "rows", "columns": "columns"}
_ZERO = "Turntable angle at heading 0"
_MOST_DRAWN = 3000  # readings
_LONGEST = 70  # characters of a line
_SIZE = QSize(1220, 640)
_FORM_WIDTH = 560


@dataclass(frozen=True)
class _Option:
    """A field of the dialog: an option of `ImportOptions`."""

    key: str
    label: str
    tip: str
    choices: dict[str, Any] | None = None  # texts and values of a list; None: typed
    number: bool = True  # whether a typed text is a number


def _chosen_of(values: Iterable[str], first: str = _RECOGNISED) -> dict[str, Any]:
    return {first: "", **{value: value for value in values}}


_OPTIONS = (
    _Option(
        "format",
        "Format",
        "Format of the file, instead of that of its content",
        _chosen_of((kind.name for kind in FORMATS), "by content"),
    ),
    _Option("heading", "Heading column", "Column of the turntable angle", {}),
    _Option("range", "Range column", "Column of the range; an empty cell means no echo", {}),
    _Option("time", "Time column", "Column of the time; its name may state the unit, else seconds", {}),
    _Option("pattern", "Pattern", "What a reading looks like, such as Angle: {deg} Dist: {cm}", number=False),
    _Option("unit", "Unit of the range", "Unit of the ranges", _chosen_of(RANGE_UNITS)),
    _Option("angle", "Unit of the angle", "Unit of the angles", _chosen_of((*ANGLE_UNITS, STEP))),
    _Option("turn", "Headings increase", "Direction in which the angles of the file grow", _TURNS),
    _Option("no_echo", "Range that means no echo", "This number in place of a range means no echo"),
    _Option("step", "Step, degrees", "Angle from one reading, sensor or trace to the next, or of one step"),
    _Option("rate", "Sampling rate, Hz", "Sampling rate of the traces; a WAV file contains it"),
    _Option("full_scale", "Full scale", "The largest number of the receiver, such as volts"),
    _Option("axis", "Pings are the", "Whether the rows or the columns of the array are pings", _AXES),
    _Option("variable", "Variable", "The array to read, also in a structure: data.signal", number=False),
    _Option("threshold", "Threshold of an echo", "Share of full scale, 0 to 1; empty: traces have no echo"),
    _Option("blanking", "Blanking, s", "Earlier samples of a trace are no echo; needs a threshold"),
    _Option("speed_of_sound", "Speed of sound, m/s", "Empty: that of air at 20 °C; in water about 1500"),
    _Option("topic", "Topic", "The only topic to read; empty: all with ranges", number=False),
)
_COLUMNS = ("heading", "range", "time")
_LABELS = {option.key: option.label for option in _OPTIONS}
_CHOICES = {option.key: option.choices for option in _OPTIONS if option.choices}


class ImportDialog(QtWidgets.QDialog):
    """Reads the file again in a thread after each change; an error is shown where the values are typed."""

    imported = Signal(object, object, bool)  # the path, the scan, whether to find its pose

    def __init__(self, path: Path, shown: Shown, jobs: Jobs, parent: QtWidgets.QWidget | None) -> None:
        """`shown`: what the window shows; the points are drawn in its room, at its place."""
        super().__init__(parent)
        self.setWindowTitle(f"Import {path.name}")
        self._path, self._shown, self._jobs = path, shown, jobs
        self._seen: LookedAt | None = None  # None while the file is read
        self.fields: dict[str, QtWidgets.QComboBox | QtWidgets.QLineEdit] = {}
        self.labels = {option.key: PlainLabel(option.label) for option in _OPTIONS}
        self.zero = NumberField(-360.0, 360.0, 3, "°")
        self.zero.setKeyboardTracking(True)  # the preview follows every key
        self.zero.setAccessibleName(_ZERO)
        self._zero_label = PlainLabel(_ZERO)
        self.answers = QtWidgets.QWidget()  # buttons, each of which answers what is doubtful
        self._answer_row = FlowLayout(self.answers, QMargins(), gap=4)
        self.decimal_comma = QtWidgets.QCheckBox("Commas are decimal commas, not between columns")
        self.note = PlainLabel(wordWrap=True)
        self.preview = text_table("line", "turntable angle", "range")
        self.preview.setAccessibleName("First lines as they are read")
        self.preview.setSelectionMode(QtWidgets.QAbstractItemView.SelectionMode.NoSelection)
        self.plan = PlanDrawing(Gestures(), predicted=False)
        self.plan.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        self.plan.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self.buttons = QtWidgets.QDialogButtonBox()
        accept = QtWidgets.QDialogButtonBox.ButtonRole.AcceptRole
        self.import_button = QtWidgets.QPushButton("Import")
        self.buttons.addButton(self.import_button, accept)
        self.pose_button = QtWidgets.QPushButton("Import and find pose")
        self.buttons.addButton(self.pose_button, accept)
        self.pose_button.setToolTip("Import, then search the whole room for the place of the scanner")
        self.buttons.addButton(QtWidgets.QDialogButtonBox.StandardButton.Cancel)
        self._left = QtWidgets.QWidget(self)
        self._make_fields()
        self._lay_out()
        self._connect()
        self._draw(())
        self._read_again()

    def _make_fields(self) -> None:
        for option in _OPTIONS:
            field: QtWidgets.QComboBox | QtWidgets.QLineEdit
            if option.choices is None:
                field = QtWidgets.QLineEdit()
                field.textChanged.connect(self._read_again)
            else:
                field = short_list()
                for text, value in option.choices.items():
                    field.addItem(text, value)
                field.currentIndexChanged.connect(self._read_again)
            for part in (field, self.labels[option.key]):
                part.setParent(self._left)  # one without a parent becomes a window of its own when it is shown
            field.setAccessibleName(option.label)
            field.setToolTip(option.tip)
            self.fields[option.key] = field
        self._show_fields(None, False)

    def _lay_out(self) -> None:
        self._form = QtWidgets.QGridLayout()
        self._form.setColumnStretch(1, 1)
        self._form.setColumnStretch(3, 1)
        self._place_fields()
        left = QtWidgets.QVBoxLayout()
        left.addLayout(self._form)
        left.addWidget(self.decimal_comma)
        scroll = QtWidgets.QScrollArea(widgetResizable=True)
        scroll.setFrameShape(QtWidgets.QFrame.Shape.NoFrame)
        said = QtWidgets.QWidget()
        stacked(said, self.note, self.answers, None).setContentsMargins(0, 0, 0, 0)
        scroll.setWidget(said)
        scroll.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        left.addWidget(scroll, stretch=2)
        left.addWidget(self.preview, stretch=3)
        self._left.setLayout(left)
        self._left.setMinimumWidth(_FORM_WIDTH)
        left.setContentsMargins(0, 0, 0, 0)
        middle = QtWidgets.QHBoxLayout()
        middle.addWidget(self._left, stretch=6)
        middle.addWidget(self.plan, stretch=5)
        page = QtWidgets.QVBoxLayout(self)
        page.addLayout(middle, stretch=1)
        page.addWidget(self.buttons)
        self.note.setAlignment(Qt.AlignmentFlag.AlignTop)
        self.import_button.setDefault(True)
        self.preview.horizontalHeader().setSectionResizeMode(0, QtWidgets.QHeaderView.ResizeMode.Stretch)
        self.resize(_SIZE.boundedTo(self.screen().availableSize()))

    def _place_fields(self) -> None:
        """Put the visible fields into the form, two in a row; the columns of a table stay together."""
        while self._form.takeAt(0) is not None:
            pass
        shown: list[tuple[PlainLabel, QtWidgets.QWidget]] = [
            (self.labels[key], field) for key, field in self.fields.items() if not field.isHidden()
        ]
        shown.append((self._zero_label, self.zero))
        for place, (label, field) in enumerate(shown):
            row, column = divmod(place, 2)
            self._form.addWidget(label, row, 2 * column)
            self._form.addWidget(field, row, 2 * column + 1)

    def _connect(self) -> None:
        self.decimal_comma.toggled.connect(self._read_again)
        self.zero.valueChanged.connect(self._read_again)
        self.import_button.clicked.connect(lambda: self._import(find_pose=False))
        self.pose_button.clicked.connect(lambda: self._import(find_pose=True))
        self.buttons.rejected.connect(self.reject)

    # reading

    @Slot()
    def _read_again(self) -> None:
        """Read the whole file with the values typed."""
        self._jobs.cancel(_READING)  # a value has changed since
        self._enable(None)
        try:
            options = self._typed()
        except InputError as error:
            self._report(str(error))
            return
        self.note.setText("reading …")
        self._jobs.run(_READING, look_at_scan, self._path, options, then=self._show, failed=self._report)

    def _typed(self) -> dict[str, Any]:
        """Return what the values state. Raises InputError if one is wrong."""
        stated: dict[str, Any] = {"heading_zero": self.zero.value()}
        for option in _OPTIONS:
            field = self.fields[option.key]
            if field.isHidden():
                continue
            value = field.currentData() if isinstance(field, QtWidgets.QComboBox) else field.text().strip()
            if value and option.choices is None and option.number:
                value = _number(option.label, str(value))
            if value not in ("", None):
                stated[option.key] = value
        if stated.keys() & set(_COLUMNS):
            stated = self._recognised_columns | stated
            stated["decimal_comma"] = self.decimal_comma.isChecked()
        return stated

    @property
    def _recognised_columns(self) -> dict[str, str]:
        """The columns of heading and range by their names, which fill in for one that is not chosen."""
        table = self._seen.table if self._seen else None
        columns = columns_of(table.names) if table else None
        if table is None or not isinstance(columns, Columns):
            return {}
        return {"heading": table.names[columns.heading], "range": table.names[columns.ranges[0]]}

    # display

    def _show(self, seen: LookedAt) -> None:
        first, self._seen = self._seen is None, seen
        self._show_fields(seen.kind, seen.table is not None)
        self._list_columns(seen)
        self._place_fields()
        self._enable(seen)
        self._show_lines(seen)
        self._draw(seen.readings)
        self._offer(_answers(seen))
        self.note.setText("\n".join(_described(seen, self._shown.look.unit.text)))
        if first and seen.problem:
            self._ask(seen.problem)

    def _show_fields(self, kind: ImportFormat | None, is_table: bool) -> None:
        """Show the fields that apply to a format."""
        for option in _OPTIONS:
            applies = kind is not None and takes_option(kind, option.key)
            if option.key in _COLUMNS:
                applies = applies and is_table
            if option.key == "pattern":
                applies = applies and not is_table
            visible = applies or option.key in ("format", "turn")
            self.fields[option.key].setVisible(visible)
            self.labels[option.key].setVisible(visible)
        self.decimal_comma.setVisible(is_table)

    def _list_columns(self, seen: LookedAt) -> None:
        names = () if seen.table is None else seen.table.names
        recognised = self._recognised_columns
        for key in _COLUMNS:
            field = self.fields[key]
            assert isinstance(field, QtWidgets.QComboBox)
            first = f"{recognised[key]} (found)" if key in recognised else _RECOGNISED
            listed = [first, *names]
            if [field.itemText(k) for k in range(field.count())] == listed:
                continue
            chosen = field.currentData()
            with QSignalBlocker(field):
                field.clear()
                field.addItem(first, "")
                for name in names:
                    field.addItem(name, name)
                field.setCurrentIndex(1 + names.index(chosen) if chosen in names else 0)

    def _enable(self, seen: LookedAt | None) -> None:
        possible = seen is not None and seen.scan is not None
        self.import_button.setEnabled(possible)
        self.pose_button.setEnabled(possible and self._shown.scene.room is not None)

    def _report(self, problem: str) -> None:
        """Show what is wrong in place of the summary."""
        self._offer(())
        self._enable(None)
        self.note.setText(f"⚠ {_with_labels(problem)}")

    def _ask(self, problem: str) -> None:
        """Go to the field that decides the question."""
        key = next((key for key in self.fields if re.search(rf"\b{key}=", problem)), None)
        if key is not None and not self.fields[key].isHidden():
            self.fields[key].setFocus()

    def _show_lines(self, seen: LookedAt) -> None:
        """Show the first lines as written, and the readings in each; without lines, the first readings."""
        first = 0
        lines = seen.lines or tuple(("", 1) for _ in seen.readings[:SHOWN_LINES])
        self.preview.setRowCount(len(lines))
        for row, (line, readings) in enumerate(lines):
            texts = ("", "")
            if readings and first < len(seen.readings):
                texts = self._texts(seen.readings[first], readings)
            first += readings
            for column, text in enumerate((shortened(line, _LONGEST), *texts)):
                self.preview.setItem(row, column, cell(text, line if column == 0 else ""))

    def _texts(self, reading: Reading, count: int) -> tuple[str, str]:
        range_ = "no echo" if reading.range is None else self._shown.look.unit.text(reading.range)
        return f"{math.degrees(reading.angle):z.1f}°", range_ if count == 1 else f"{range_}, {count - 1} more"

    def _draw(self, readings: tuple[Reading, ...]) -> None:
        scene, look = self._shown.scene, self._shown.look
        self.plan.show_state(Shown(scene, readings=readings[:_MOST_DRAWN], origin=Origin.IMPORTED, look=look))
        self.plan.fit_everything()

    # actions

    def _offer(self, answers: Iterable[tuple[str, str]]) -> None:
        """Show a button for each answer: the key of a field, and the value that it enters."""
        while (item := self._answer_row.takeAt(0)) is not None:
            item.widget().deleteLater()
        for key, value in dict.fromkeys(answers):
            name = _name_of(key, value)
            text = f"{name} means no echo" if key == "no_echo" else f"{_LABELS[key]}: {name}"
            button = QtWidgets.QPushButton(text, autoDefault=False)
            button.setToolTip(f"Enter {name} as “{_LABELS[key]}”")
            button.clicked.connect(partial(self._answer, key, value))
            self._answer_row.addWidget(button)

    def _answer(self, key: str, value: str) -> None:
        field = self.fields[key]
        field.setFocus()
        if isinstance(field, QtWidgets.QLineEdit):
            field.setText(value)
        else:
            field.setCurrentIndex(field.findData(value))

    def _import(self, find_pose: bool) -> None:
        """Import what the preview shows."""
        if self._seen is not None and self._seen.scan is not None:
            self.imported.emit(self._path, self._seen.scan, find_pose)
            self.accept()

    def done(self, result: int) -> None:
        """Read no more when the dialog closes in any way."""
        self._jobs.cancel(_READING)
        super().done(result)


def _answers(seen: LookedAt) -> Iterable[tuple[str, str]]:
    """Yield the values that answer a problem or change an assumption: the key of a field, and the value."""
    for text in (seen.problem, *(() if seen.scan is None else seen.scan.read_as)):
        found = re.findall(r"\b(\w+)=(\w+)", text)
        yield from ((key, value) for key, value in found if value in _CHOICES.get(key, {}).values())
    if seen.likely_no_echo is not None:
        yield "no_echo", f"{seen.likely_no_echo:g}"


def _number(label: str, text: str) -> float:
    try:
        return float(text.replace(",", "."))
    except ValueError:
        raise InputError(f"{label}: {text!r}; expected a number, or nothing") from None


def _with_labels(problem: str) -> str:
    """Return a message with the names of fields in place of the keys of options."""
    keys = "|".join(_LABELS)
    listed = "|".join(_CHOICES)
    chosen = re.sub(rf"\badd (?=({listed})=)", "choose ", problem)
    named = re.sub(rf"\b({keys})=(\w*)", lambda key: f"“{_LABELS[key[1]]}” {_name_of(key[1], key[2])}".rstrip(), chosen)
    return re.sub(r"(, | or )(“[^”]*”) ", lambda part: part[1] if part[2] in named[: part.start()] else part[0], named)


def _name_of(key: str, value: str) -> str:
    """Return the text of a value in the list of a field; other values as they are."""
    return next((text for text, data in _CHOICES.get(key, {}).items() if value and data == value), value)


def _described(seen: LookedAt, length: Callable[[float], str]) -> Iterable[str]:
    """Yield what was read and why, and what is doubtful."""
    if seen.problem:
        yield f"⚠ {_with_labels(seen.problem)}"
    if seen.scan is not None:
        ranges = [reading.range for reading in seen.readings if reading.range is not None]
        angles = [math.degrees(reading.angle) for reading in seen.readings]
        between = f", {length(min(ranges))} to {length(max(ranges))}" if ranges else ""
        yield (
            f"{len(angles)} readings, {len(angles) - len(ranges)} without an echo; turntable angles "
            f"{min(angles):z.1f}° to {max(angles):z.1f}°{between}"
        )
        yield from (f"• {_with_labels(fact)}" for fact in seen.scan.read_as)
        yield from (f"⚠ {_with_labels(doubt)}" for doubt in (*seen.scan.damage, *seen.doubts))
