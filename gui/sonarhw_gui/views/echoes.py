"""The view "Echoes": the echoes at one heading that might be reported."""

from dataclasses import dataclass
from functools import cached_property

from PySide6.QtCore import QEvent, QObject, Qt, Slot
from PySide6.QtGui import QBrush, QColor, QFontMetrics
from PySide6.QtWidgets import QHBoxLayout, QTableWidget, QTableWidgetItem, QVBoxLayout, QWidget
from sonarhw_compare.explain import RankedEcho, outcome_text, ranked_echoes, remedy, remedy_text, runner_up
from sonarhw_sim.predict.predicted_scan import PredictedScan

from sonarhw.errors import heading_text
from sonarhw_gui.model.look import LengthUnit
from sonarhw_gui.model.scene import decibels_text
from sonarhw_gui.model.shown import Shown, is_same_question
from sonarhw_gui.model.theme import text_font
from sonarhw_gui.views.base import Gestures, ViewEntry
from sonarhw_gui.widgets import ElidedLabel, PlainLabel, arranged, plain_tip, text_table

COLUMNS = ("½ path", "level", "what becomes of it", "path")


@dataclass(frozen=True)
class EchoList:
    """All echoes at one heading of a prediction, ranked."""

    prediction: PredictedScan
    index: int
    unit: LengthUnit

    @cached_property
    def echoes(self) -> tuple[RankedEcho, ...]:
        """The echoes, that of the winner first."""
        return ranked_echoes(self.prediction, self.index)

    def cells(self, row: int) -> tuple[str, ...]:
        """Return the texts of one row, one for each of `COLUMNS`."""
        echo = self.echoes[row]
        via = ">".join(self.prediction.paths.via(echo.path, self.prediction.room))
        level = decibels_text(echo.level_db)
        return self.unit.text(echo.half), level, outcome_text(echo, self.unit.text), via

    def is_out(self, row: int) -> bool:
        """Return whether the board cannot detect an echo: it is blanked or too weak."""
        return (self.echoes[row].blanked or self.echoes[row].too_weak) and not self.echoes[row].wins

    def note(self, row: int | None) -> str:
        """Return what would let the echo in a row win; without a row, or for the winner, the runner-up."""
        if row is not None and not self.echoes[row].wins:
            return self._would_win(self.echoes[row], "this echo")
        best = runner_up(self.echoes)
        if best is None:
            return "no other echo within 20 dB of the threshold"
        return self._would_win(best, "the runner-up")

    @property
    def title(self) -> str:
        """The heading and the number of echoes."""
        count = len(self.echoes)
        return f"{heading_text(float(self.prediction.headings[self.index]))} · {count} echo{'es' * (count != 1)}"

    def _would_win(self, echo: RankedEcho, name: str) -> str:
        how = remedy_text(remedy(self.prediction, self.index, echo), self.unit.text)
        if not how:
            return f"{name} ({self.unit.text(echo.half)}): no small change lets it win"
        return f"{name} ({self.unit.text(echo.half)}) would win with {how}"


# The view "Echoes": every echo at the beam's heading, what becomes of it, and what would let it win.
#
# The plan draws the path of the echo under the mouse, or of the current row.


_WIDEST = ("00.000 m", "−00.0 dB", "00.0 dB too weak, 0.000 m behind")
_HALF_TIP = "half of the path of the sound; the range that the board reports also contains what its receiver adds"
_BESIDE = 14  # pixels, margins of a cell
_AT_RIGHT = Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter
_NO_ROOM, _NOTHING_YET = "open a room to list its echoes", "select a reading, or click the predicted outline"


class EchoListView(QWidget):
    """A ranked table of echoes."""

    entry = ViewEntry("Echoes", is_text=True)

    def __init__(self) -> None:
        super().__init__()
        self.gestures = Gestures(self)
        self.list: EchoList | None = None
        self._shown: Shown | None = None
        self._filling = False
        self.title, self.note = PlainLabel(), ElidedLabel()
        self.table = self._made_table()
        self.table.model().setHeaderData(0, Qt.Orientation.Horizontal, _HALF_TIP, Qt.ItemDataRole.ToolTipRole)
        self.table.cellEntered.connect(self._point)
        self.table.currentCellChanged.connect(self._point)
        self.table.installEventFilter(self)
        head = arranged(QHBoxLayout(), self.title, self.note, rest=self.note, margins=(8, 2, 8, 2), gap=12)
        arranged(QVBoxLayout(self), head, self.table)

    def _made_table(self) -> QTableWidget:
        table = text_table(*COLUMNS)
        table.setAccessibleName("Echoes at this heading")
        table.setMouseTracking(True)
        table.setShowGrid(False)
        table.setWordWrap(False)
        table.setAlternatingRowColors(True)
        table.setTabKeyNavigation(False)
        table.horizontalHeader().setHighlightSections(False)
        return table

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        """Note that the mouse or the focus leaves the table."""
        if event.type() in (QEvent.Type.Leave, QEvent.Type.FocusOut):
            self._leave()
        return super().eventFilter(watched, event)

    def show_state(self, shown: Shown) -> None:
        """List the echoes of another heading, and redraw after a change of the look."""
        before, self._shown = self._shown, shown
        if shown.changed_since(before, lambda new: (new.look,)):
            self._set_look(shown)
        question = shown.question
        if question is None:
            self.list = None
            self.table.setRowCount(0)
            self.title.setText("")
            self.note.setText(_NO_ROOM if shown.scene.room is None else _NOTHING_YET)
            return
        if before is None or before.look != shown.look or not is_same_question(before.question, question):
            self.list = EchoList(*question, shown.look.unit)
            self._fill(self.list, shown)

    def fit(self) -> None:
        """Do nothing: a table has no range."""

    def picture(self) -> None:
        """Return None: only plots are saved as pictures."""

    def _set_look(self, shown: Shown) -> None:
        font = text_font(shown.look, 0.9)
        metrics = QFontMetrics(font)
        self.table.setFont(font)
        self.table.horizontalHeader().setFont(font)
        self.table.verticalHeader().setDefaultSectionSize(metrics.height() + 4)
        for column, widest in enumerate(_WIDEST):
            self.table.setColumnWidth(column, metrics.horizontalAdvance(widest) + _BESIDE)

    def _fill(self, listed: EchoList, shown: Shown) -> None:
        self._filling = True
        self.table.setRowCount(len(listed.echoes))
        faint = QBrush(QColor(shown.look.palette.faint))
        for row in range(len(listed.echoes)):
            for column, text in enumerate(listed.cells(row)):
                item = QTableWidgetItem(text)
                item.setFlags(Qt.ItemFlag.ItemIsSelectable | Qt.ItemFlag.ItemIsEnabled)
                item.setToolTip(plain_tip(text))
                if column < 2:
                    item.setTextAlignment(_AT_RIGHT)
                if listed.is_out(row):
                    item.setForeground(faint)
                self.table.setItem(row, column, item)
        self.table.clearSelection()
        self.table.setCurrentCell(-1, -1)
        self._filling = False
        self.title.setText(listed.title)
        self.note.setText(listed.note(None))

    @Slot(int, int)
    def _point(self, row: int, *_: int) -> None:
        if self._filling or self.list is None or not 0 <= row < len(self.list.echoes):
            return
        self.note.setText(self.list.note(row))
        self.gestures.path_pointed.emit(self.list.echoes[row].path)

    def _leave(self) -> None:
        """Draw the path of the current row again, if the table has the focus."""
        row = self.table.currentRow() if self.table.hasFocus() else -1
        if row >= 0:
            self._point(row)
            return
        self.gestures.path_pointed.emit(None)
        if self.list is not None:
            self.note.setText(self.list.note(None))
