"""The fit panel: find the pose of the scanner from its readings. An accepted result is one undo step."""

from html import escape

from PySide6.QtCore import Qt, Signal, Slot
from PySide6.QtWidgets import (
    QCheckBox,
    QComboBox,
    QGridLayout,
    QGroupBox,
    QHBoxLayout,
    QLabel,
    QProgressBar,
    QPushButton,
    QVBoxLayout,
    QWidget,
)
from sonarhw_compare.fit.quantities import QUANTITIES, Offer

from sonarhw.errors import InputError
from sonarhw_gui.fitting.fit_control import FitState
from sonarhw_gui.fitting.fit_request import NEAR, FitSettings
from sonarhw_gui.fitting.fit_scene import fitted
from sonarhw_gui.fitting.fit_texts import rows, share_line, solution_line, warnings
from sonarhw_gui.parts.plain_label import PlainLabel
from sonarhw_gui.parts.short_list import short_list
from sonarhw_gui.parts.wheel_filter import ignore_wheel_without_focus
from sonarhw_gui.shown.shown import Shown


class FitPanel(QWidget):
    """Starts a fit and shows its result."""

    edited = Signal(object, str, object)  # Scene, label for Undo, gesture
    requested = Signal(object)  # FitSettings
    cancelled = Signal()  # a running fit is cancelled, or a result is discarded

    def __init__(self) -> None:
        super().__init__()
        self._shown: Shown | None = None
        self._state = FitState()
        self.free = {one.word: _box(one.offer) for one in QUANTITIES if one.offer is not None}
        self.where = short_list()
        self.begin = QPushButton("Find pose")
        self.progress, self.cancel = QProgressBar(), QPushButton("Cancel")
        self.solutions = QComboBox()
        ignore_wheel_without_focus(self.solutions)
        self.solutions.setToolTip("Solutions that fit almost equally well, the best first")
        self.table, self.notes = QLabel(textFormat=Qt.TextFormat.RichText), PlainLabel(wordWrap=True)
        self.accept, self.discard = QPushButton("Accept"), QPushButton("Discard")
        self._refused = PlainLabel(wordWrap=True)
        self._request, self._work, self._result = self._request_group(), self._work_row(), self._result_group()
        column = QVBoxLayout(self)
        for part in (self._request, self._work, self._refused, self._result):
            column.addWidget(part)
        column.addStretch(1)
        self._connect()
        self._draw()

    @property
    def settings(self) -> FitSettings:
        """The selected parameters and search area."""
        free = tuple(word for word, box in self.free.items() if box.isChecked())
        return FitSettings(free, everywhere=self.where.currentIndex() == 1)

    def show_state(self, shown: Shown) -> None:
        """Draw the changes since the last call."""
        before, self._shown = self._shown, shown
        if shown.changed_since(before, "look"):
            unit = shown.look.unit
            self.where.setItemText(0, f"within {unit.of(NEAR):.2g} {unit.label} of here")
            self._draw()
        self._enable()

    @Slot(object)
    def show_fit(self, state: FitState) -> None:
        """Show the progress or the result of the fit."""
        fresh = state.found is not self._state.found or state.running != self._state.running
        self._state = state
        self.progress.setValue(round(100 * state.share))
        self.progress.setFormat(f"{state.step}  %p %")
        if fresh:
            self._draw()

    @Slot()
    def request_fit(self) -> None:
        """Start a fit with the selected settings."""
        if self.begin.isEnabled():
            self.requested.emit(self.settings)

    def _request_group(self) -> QWidget:
        group = QGroupBox("Free parameters")
        column = QVBoxLayout(group)
        for box in self.free.values():
            column.addWidget(box)
        self.where.addItems(["", "in the whole room"])
        self.where.setToolTip("Search area for the position; the whole room takes longer")
        column.addWidget(self.where)
        column.addWidget(self.begin)
        return group

    def _work_row(self) -> QWidget:
        part = QWidget()
        row = QHBoxLayout(part)
        row.setContentsMargins(0, 0, 0, 0)
        row.addWidget(self.progress, stretch=1)
        row.addWidget(self.cancel)
        return part

    def _result_group(self) -> QWidget:
        group = QGroupBox("Result")
        layout = QGridLayout(group)
        self.table.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        for row, part in enumerate((self.solutions, self.table, self.notes)):
            layout.addWidget(part, row, 0, 1, 2)
        layout.addWidget(self.accept, 3, 0)
        layout.addWidget(self.discard, 3, 1)
        self.accept.setToolTip("Move the sensor there; Undo moves it back")
        return group

    def _connect(self) -> None:
        for box in self.free.values():
            box.toggled.connect(self._enable)
        self.begin.clicked.connect(self.request_fit)
        self.cancel.clicked.connect(self.cancelled)
        self.discard.clicked.connect(self.cancelled)
        self.accept.clicked.connect(self._accept)
        self.solutions.activated.connect(self._draw_solution)

    @Slot()
    def _enable(self) -> None:
        shown = self._shown
        ready = shown is not None and shown.scene.room is not None and bool(shown.readings)
        self.begin.setEnabled(ready and bool(self.settings.free) and not self._state.running)
        self.begin.setToolTip("" if ready else "Needs readings and a room")
        self.where.setEnabled(self.free["position"].isChecked())

    def _draw(self) -> None:
        found = self._state.found
        self._work.setVisible(self._state.running)
        self._result.setVisible(found is not None)
        self._refused.hide()
        self._enable()
        if found is not None and self._shown is not None:
            unit = self._shown.look.unit
            chosen = max(self.solutions.currentIndex(), 0)
            self.solutions.clear()
            self.solutions.addItems([solution_line(found, k, unit) for k in range(len(found.solutions))])
            self.solutions.setCurrentIndex(min(chosen, len(found.solutions) - 1))
            self.solutions.setVisible(len(found.solutions) > 1)
            self._draw_solution()

    @Slot()
    def _draw_solution(self) -> None:
        found, shown = self._state.found, self._shown
        if found is None or shown is None:
            return
        solution = self.solutions.currentIndex()
        lines = "".join(
            f"<tr><td>{escape(name)}&nbsp;&nbsp;</td><td align=right>{value}</td><td>&nbsp;&nbsp;{deviation}</td></tr>"
            for name, value, deviation in rows(found, solution, shown.look.unit)
        )
        self.table.setText(f"<table>{lines}</table>")
        warned = [f"⚠ {warning}" for warning in warnings(found)]
        count = f"{len(found.request.readings)} readings; ± is one standard deviation"
        self.notes.setText("\n\n".join((share_line(found, solution), count, *warned)))

    @Slot()
    def _accept(self) -> None:
        found, shown = self._state.found, self._shown
        if found is None or shown is None:
            return
        values = found.solutions[self.solutions.currentIndex()].values
        try:
            scene, label = fitted(shown.scene, values, found.request.scene.board)
        except InputError as error:
            self._refused.setText(f"⚠ {error}")
            self._refused.show()
            return
        self.edited.emit(scene, label, None)
        self.cancelled.emit()


def _box(offer: Offer) -> QCheckBox:
    box = QCheckBox(offer.label)
    box.setToolTip(offer.tip)
    box.setChecked(offer.checked)
    return box
