"""The trace of the chosen heading: measured over predicted, blanking, threshold, and every predicted echo by name.

Takes what is shown; hands on nothing.
"""

import pyqtgraph as pg
from PySide6.QtCore import Qt

from gui.chosen_trace import ChosenTrace, Curve, chosen_trace, degrees_text
from gui.echo_names import EchoNames
from gui.marks import WHOLE
from gui.palette import BLANKING, GRID_ALPHA, MEASURED, PREDICTED, THRESHOLD
from gui.shown import Shown

_FLOOR_DB = -52.0  # of the empty axes


class _LevelAxis(pg.AxisItem):  # type: ignore[misc]  # pyqtgraph has no types
    """Levels up to full scale; above it are names, not levels."""

    def tickStrings(self, values: list[float], scale: float, spacing: float) -> list[str]:
        return [f"{value:.0f}" if value <= 0 else "" for value in values]


class TraceView(pg.PlotWidget):  # type: ignore[misc]
    """Draws the trace of the chosen reading."""

    def __init__(self) -> None:
        super().__init__(axisItems={"left": _LevelAxis("left")})
        self.setViewportUpdateMode(WHOLE)
        self._drawn: tuple[object, object] | None = None
        self._reach = 0.0
        self.setLabel("bottom", "range (m)")
        self.setLabel("left", "level (dB of full scale)")
        self.showGrid(x=True, y=True, alpha=GRID_ALPHA)
        self.hideButtons()
        self.setMouseEnabled(x=True, y=False)
        self._blanking = pg.LinearRegionItem(movable=False, brush=pg.mkBrush(BLANKING), pen=pg.mkPen(BLANKING))
        self._blanking.setZValue(-20)
        self._threshold = pg.InfiniteLine(angle=0, pen=pg.mkPen(THRESHOLD, width=1, style=Qt.PenStyle.DashLine))
        self._predicted = pg.PlotCurveItem(pen=pg.mkPen(PREDICTED, width=1.5, style=Qt.PenStyle.DashLine))
        self._measured = pg.PlotCurveItem(pen=pg.mkPen(MEASURED, width=1))
        for item in (self._blanking, self._threshold, self._measured, self._predicted):
            self.addItem(item, ignoreBounds=True)
        self._names = EchoNames(self.plotItem.vb)

    def show_state(self, shown: Shown) -> None:
        """Draw the trace of the chosen reading, where it is another one."""
        wanted = (shown.chosen_reading, shown.chosen_row)
        if self._drawn is not None and all(a is b for a, b in zip(wanted, self._drawn, strict=True)):
            return
        self._drawn = wanted
        self._draw(chosen_trace(shown))

    def _draw(self, trace: ChosenTrace | None) -> None:
        self.setTitle(_title(trace), size="10pt")
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
