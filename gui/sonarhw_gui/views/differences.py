"""The view "Differences": how much two scans differ, by heading, and which differences noise does not explain."""

import math

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import QPointF, Qt, Slot
from PySide6.QtGui import QTextOption
from PySide6.QtWidgets import QGraphicsTextItem, QVBoxLayout, QWidget
from sonarhw_compare.match import Kind
from sonarhw_compare.two_scans import HeadingSeries, ScanChange, ScanDifference, scan_difference

from sonarhw.errors import InputError
from sonarhw_gui.model.look import Look, Palette
from sonarhw_gui.model.shown import SHOWN, Cursor, Shown
from sonarhw_gui.model.theme import text_font
from sonarhw_gui.views import base
from sonarhw_gui.views.marks import Spots
from sonarhw_gui.widgets import PlainLabel, arranged

# A sentence in the middle of a plot that has nothing to draw, instead of its axes.


_WIDTH = 0.8  # of the plot


class PlotMessage(QGraphicsTextItem):
    """The sentence. As a part of the drawing it needs no space in the layout of the window."""

    def __init__(self, plot: pg.PlotItem) -> None:
        super().__init__(plot.vb)
        self._plot = plot
        self.document().setDefaultTextOption(QTextOption(Qt.AlignmentFlag.AlignCenter))
        plot.vb.sigResized.connect(self._place)

    def set_look(self, look: Look) -> None:
        """Use the colours and the text size of `look`."""
        self.setFont(text_font(look))
        self.setDefaultTextColor(look.palette.ink)
        self._place()

    def show_text(self, text: str) -> None:
        """Show `text` and hide the axes; the other way round if it is empty."""
        self.setPlainText(text)
        self.setVisible(bool(text))
        for side in ("left", "bottom"):
            self._plot.showAxis(side, not text)
        self._place()

    @Slot()
    def _place(self) -> None:
        box = self._plot.vb.rect()
        self.setTextWidth(_WIDTH * box.width())
        self.setPos(box.center() - self.boundingRect().center())


_HINT = "No scan to compare with: add a log, or keep this scan, in the panel Scans (F12)."
_SYMBOLS = {
    ScanChange.SAME: "o",
    ScanChange.NEARER: "t",
    ScanChange.FARTHER: "t1",
    ScanChange.FELL_SILENT: "x",
    ScanChange.APPEARED: "s",
}
_SIZE = 8  # pixels
_LEAST = 0.05  # m, half of the height of the scale


class DifferenceView(QWidget):
    """Draws the second scan minus the first over heading."""

    entry = base.ViewEntry("Differences", is_text=True)

    def __init__(self) -> None:
        super().__init__()
        self.gestures = base.Gestures(self)
        self.plot = base.new_plot()
        self.canvas = base.Canvas(self.plot)
        self.message = PlotMessage(self.plot)  # why there are no differences
        self.summary = PlainLabel(wordWrap=True)
        self.summary.setAlignment(Qt.AlignmentFlag.AlignLeft)
        self.summary.setContentsMargins(8, 2, 8, 2)
        self.difference: ScanDifference | None = None
        self._shown: Shown | None = None
        self._limits = [pg.PlotCurveItem(), pg.PlotCurveItem()]
        self._noise = pg.FillBetweenItem(*self._limits)
        self.marks = {change: Spots(size=_SIZE, symbol=symbol) for change, symbol in _SYMBOLS.items()}
        for item in (self._noise, *self.marks.values()):
            self.plot.addItem(item)
        self.plot.getAxis("bottom").setTickSpacing(90, 30)
        self.canvas.hovered.connect(self._move)
        self.canvas.clicked.connect(lambda event: self._pick(event.scenePos()))
        arranged(QVBoxLayout(self), self.summary, self.canvas, rest=self.canvas)

    def show_state(self, shown: Shown) -> None:
        """Draw the differences of other scans, and redraw after a change of the look."""
        before, self._shown = self._shown, shown
        if shown.changed_since(before, lambda new: (new.look,)):
            self._set_look(shown.look)
        if shown.changed_since(before, lambda new: (new.look, new.overlays, new.pair, new.readings, new.scene)):
            self._draw(shown)

    def fit(self) -> None:
        """Show all headings and differences."""
        self.plot.setXRange(0, 360, padding=0.01)
        rows = self.difference.rows if self.difference else ()
        largest = max((abs(row.difference) for row in rows if row.difference is not None), default=0.0)
        height = max(_LEAST, 1.1 * largest)
        self.plot.setYRange(-height, height, padding=0)

    def picture(self) -> None:
        """Return None: `sonarhw compare --with --plot` draws the picture."""

    def _set_look(self, look: Look) -> None:
        self.canvas.set_look(look)
        self.summary.setFont(text_font(look, 0.9))
        self.message.set_look(look)
        base.label_axis(self.plot.getAxis("bottom"), "heading in the room (°)")
        base.label_length(self.plot.getAxis("left"), "Δ", look)  # short, because the view is often low
        self._noise.setBrush(look.palette.tolerance)
        for change, marks in self.marks.items():
            marks.setPen(base.cosmetic_pen(_colour(change, look.palette), width=1))
            marks.setBrush(pg.mkBrush(_colour(change, look.palette)))

    def _draw(self, shown: Shown) -> None:
        self.canvas.repaint_whole()
        self.difference, text = _difference(shown)
        rows = self.difference.rows if self.difference else ()
        headings = np.degrees([row.heading for row in rows])
        limits = np.array([row.limit for row in rows])
        for sign, curve in zip((-1, 1), self._limits, strict=True):
            curve.setData(headings, sign * limits)
        for change, marks in self.marks.items():
            points = [(math.degrees(row.heading), row.difference or 0.0) for row in rows if row.change is change]
            marks.setData(*np.array(points, dtype=np.float64).reshape(-1, 2).T)
        compared = self.difference is not None
        self.summary.setText(text if compared else "")
        self.summary.setVisible(compared)
        self.message.show_text("" if compared else text)
        self.canvas.setAccessibleDescription(text)
        self.fit()

    def _move(self, place: QPointF | None) -> None:
        """Link the cursor of all views: point at the second scan's reading at this heading."""
        row = self._nearest(place)
        far = None if row is None or self.difference is None else self.difference.rows[row].second.median
        if row is None or far is None or self.difference is None:
            self.gestures.pointed.emit(None)
        else:
            self.gestures.pointed.emit(Cursor(self.difference.rows[row].heading, far))

    def _pick(self, place: QPointF) -> None:
        """Select the reading shown at the heading of a click."""
        row, shown = self._nearest(place), self._shown
        if row is not None and self.difference is not None and shown is not None:
            reading = base.reading_towards(shown, self.difference.rows[row].heading)
            if reading is not None:
                self.gestures.picked.emit(reading)

    def _nearest(self, place: QPointF | None) -> int | None:
        box = self.plot.vb
        if place is None or not self.difference or not box.sceneBoundingRect().contains(place):
            return None
        headings = np.degrees([row.heading for row in self.difference.rows])
        return int(np.argmin(np.abs(headings - box.mapSceneToView(place).x())))


def _difference(shown: Shown) -> tuple[ScanDifference | None, str]:
    """Return the differences of the chosen pair and their summary, or None and the reason."""
    if shown.pair is None:
        return None, _HINT
    (first, first_series), (second, second_series) = (_scan(shown, number) for number in shown.pair)
    try:
        difference = scan_difference(first_series, second_series)
    except InputError as error:
        return None, f"{first} and {second}: {error}"
    counts = ", ".join(f"{count} {change.value}" for change, count in difference.changes.items() if count)
    return difference, f"{second} − {first}: {counts}"


def _scan(shown: Shown, number: int) -> tuple[str, HeadingSeries]:
    if number != SHOWN:
        return shown.overlays[number].name, shown.overlays[number].series
    rows = shown.rows
    return "scan shown", HeadingSeries(np.radians(rows.headings), rows.measured, shown.scene.board.rounding)


def _colour(change: ScanChange, palette: Palette) -> str:
    kinds = {
        ScanChange.NEARER: Kind.SHORT,
        ScanChange.FARTHER: Kind.LONG,
        ScanChange.FELL_SILENT: Kind.MISSED,
        ScanChange.APPEARED: Kind.EXTRA,
    }
    return palette.of(kinds[change]) if change in kinds else palette.faint
