"""The hint of the first start: what is measured, what is predicted, and where to click. It goes away by itself."""

from PySide6.QtCore import QMargins, QTimer, Signal, Slot
from PySide6.QtWidgets import QFrame, QHBoxLayout, QToolButton, QWidget

from sonarhw.readings import Origin
from sonarhw_gui.look.appearance import Look
from sonarhw_gui.parts.flow_layout import FlowLayout
from sonarhw_gui.parts.plain_label import PlainLabel
from sonarhw_gui.shown.shown import Shown

_LASTS = 120_000  # ms
_MARKS = {
    Origin.MEASURED: "Orange marks: measured by the sonar.",
    Origin.FAKE: "Orange marks: from a fake scanner, which hides one post.",
    Origin.SIMULATED: "Orange marks: simulated readings.",
    Origin.IMPORTED: "Orange marks: readings imported from a CSV file.",
}
_NO_MARKS = "Orange marks: readings. There are none yet."
_LINE, _NO_LINE = "Blue line: predicted by the model.", "Blue line: a prediction. It needs a room (Ctrl+R)."
_CLICK = "Click {}: the sentence below says why."
_COLOURS = "measured", "predicted", "chosen"  # of the steps


class Hint(QFrame):
    """Three steps in one line. Hidden until `begin`; ends when a reading is selected, or after two minutes."""

    ended = Signal()

    def __init__(self) -> None:
        super().__init__()
        self.setObjectName("hint")
        steps = QWidget()
        row = FlowLayout(steps, QMargins(6, 2, 6, 2), gap=18)
        self.labels = [PlainLabel() for _ in _COLOURS]
        for label in self.labels:
            row.addWidget(label)
        self.close_button = QToolButton(autoRaise=True)
        self.close_button.setText("×")
        self.close_button.setToolTip("Close this hint; Help > First steps shows it again")
        self.close_button.clicked.connect(self.end)
        line = QHBoxLayout(self)
        line.setContentsMargins(4, 0, 6, 0)
        line.addWidget(steps, stretch=1)
        line.addWidget(self.close_button)
        self.timer = QTimer(self, singleShot=True, interval=_LASTS)
        self.timer.timeout.connect(self.end)
        self._open = self._gives_way = False
        self.hide()

    def show_state(self, shown: Shown) -> None:
        """Name what made the marks; without readings, and without a room, say that something is missing."""
        empty, room = not shown.readings and shown.origin is Origin.MEASURED, shown.scene.room is not None
        marks = _NO_MARKS if empty else _MARKS[shown.origin]
        click = _CLICK.format("the blue line" if empty and room else "a mark")
        for number, text in enumerate((marks, _LINE if room else _NO_LINE, click)):
            self.labels[number].setText(f"{number + 1}  {text}")

    def show_look(self, look: Look) -> None:
        """Give each step the colour of what it describes."""
        for label, colour in zip(self.labels, _COLOURS, strict=True):
            label.setStyleSheet(f"color: {getattr(look.palette, colour)}; font-weight: bold")

    @Slot()
    def begin(self) -> None:
        """Show the hint."""
        self.timer.start()
        self._open = True
        self.setVisible(not self._gives_way)

    @Slot()
    def end(self) -> None:
        """Hide the hint."""
        self.timer.stop()
        if self._open:
            self._open = False
            self.hide()
            self.ended.emit()

    def give_way(self, wanted: bool) -> None:
        """Hide the hint for as long as a message needs its place."""
        self._gives_way = wanted
        self.setVisible(self._open and not wanted)
