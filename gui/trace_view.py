"""The trace of the chosen heading: measured over predicted, blanking, threshold, and every predicted echo by name.

Takes what is shown; hands on nothing.
"""

import pyqtgraph as pg
from PySide6.QtCore import Qt, Signal

from gui.chosen_trace import ChosenTrace, Curve, chosen_trace, degrees_text
from gui.echo_names import EchoNames
from gui.look import Look
from gui.marks import WHOLE
from gui.plot_look import dress_plot, label_axis, label_length
from gui.shown import Shown

_FLOOR_DB = -52.0  # of the empty axes


class _LevelAxis(pg.AxisItem):  # type: ignore[misc]  # pyqtgraph has no types
    """Levels up to full scale; above it are names, not levels."""

    def tickStrings(self, values: list[float], scale: float, spacing: float) -> list[str]:
        return [f"{value:.0f}" if value <= 0 else "" for value in values]


class TraceView(pg.PlotWidget):  # type: ignore[misc]
    """Draws the trace of the chosen reading."""

    pointed = Signal(object)  # Cursor or None

    def __init__(self) -> None:
        super().__init__(axisItems={"left": _LevelAxis("left")})
        self.setViewportUpdateMode(WHOLE)
        self._drawn: tuple[object, ...] | None = None
        self._look: Look | None = None
        self._reach = 0.0
        self.hideButtons()
        self.setMouseEnabled(x=True, y=False)
        self._blanking = pg.LinearRegionItem(movable=False)
        self._blanking.setZValue(-20)
        self._threshold = pg.InfiniteLine(angle=0)
        self._predicted = pg.PlotCurveItem()
        self._measured = pg.PlotCurveItem()
        for item in (self._blanking, self._threshold, self._measured, self._predicted):
            self.addItem(item, ignoreBounds=True)
        self._names = EchoNames(self.plotItem.vb)

    def show_state(self, shown: Shown) -> None:
        """Draw the trace of the chosen reading, where it is another one."""
        if self._look != shown.look:
            self._look = shown.look
            self._dress(shown.look)
        wanted = (shown.chosen_reading, shown.chosen_row, shown.look)
        if self._drawn is not None and all(a is b for a, b in zip(wanted, self._drawn, strict=True)):
            return
        self._drawn = wanted
        self._draw(chosen_trace(shown))

    def _dress(self, look: Look) -> None:
        colours = look.palette
        self.setBackground(colours.paper)
        dress_plot(self.plotItem, look)
        label_length(self.getAxis("bottom"), "range", look)
        label_axis(self.getAxis("left"), "level (dB of full scale)")
        self._blanking.setBrush(colours.blanking)
        for line in self._blanking.lines:
            line.setPen(colours.blanking)
        self._threshold.setPen(pg.mkPen(colours.threshold, width=1, style=Qt.PenStyle.DashLine))
        self._predicted.setPen(pg.mkPen(colours.predicted, width=1.5, style=Qt.PenStyle.DashLine))
        self._measured.setPen(pg.mkPen(colours.measured, width=1))
        self._names.dress(look)

    def _draw(self, trace: ChosenTrace | None) -> None:
        self.setTitle(_title(trace), size="10pt", color=self._look.palette.ink if self._look else None)
        for item in (self._blanking, self._threshold):
            item.setVisible(trace is not None)
        _draw_curve(self._measured, trace.measured if trace else None)
        _draw_curve(self._predicted, trace.predicted if trace else None)
        if trace is None:
            self._names.draw((), _FLOOR_DB)
        else:
            self._blanking.setRegion((0.0, trace.blanking))
            self._threshold.setValue(trace.threshold_db)
            self._names.draw(trace.echoes, trace.floor_db)
            if self._reach != trace.reach:  # a zoom lasts from one reading to the next
                self._reach = trace.reach
                self.setLimits(xMin=0.0, xMax=trace.reach)
                self.setXRange(0.0, trace.reach, padding=0)


def _draw_curve(item: pg.PlotCurveItem, curve: Curve | None) -> None:
    if curve is None:
        item.setData([], [])
    else:
        item.setData(curve.ranges, curve.levels)


def _title(trace: ChosenTrace | None) -> str:
    if trace is None:
        return "Trace: no reading yet"
    measured = "" if trace.measured else " · no trace recorded"
    predicted = "" if trace.predicted else " · no prediction"
    return f"Trace at {degrees_text(trace.heading)}{measured}{predicted}"
