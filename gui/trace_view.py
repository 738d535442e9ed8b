"""The trace of the chosen heading: measured over predicted, blanking, threshold, and every predicted echo by name.

Takes what is shown; hands on nothing.
"""

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import Qt

from gui.chosen_trace import FLOOR_DB, ChosenTrace, Curve, NamedEcho, chosen_trace, degrees_text
from gui.echo_names import EchoNames
from gui.palette import BLANKING, GRID_ALPHA, MEASURED, PREDICTED, THRESHOLD
from gui.shown import Shown

_TOP_DB = 5.0
_MARK_DB = 2.5  # where echoes are marked
_MARGIN = 1.15  # beyond the last echo


class TraceView(pg.PlotWidget):
    """Draws the trace of the chosen reading."""

    def __init__(self) -> None:
        super().__init__()
        self._drawn: tuple[object, object] | None = None
        self.setLabel("bottom", "range (m)")
        self.setLabel("left", "level (dB below full scale)")
        self.showGrid(x=True, y=True, alpha=GRID_ALPHA)
        self.hideButtons()
        self.setMouseEnabled(x=True, y=False)
        self.setYRange(FLOOR_DB, _TOP_DB, padding=0)
        self._blanking = pg.LinearRegionItem(movable=False, brush=pg.mkBrush(BLANKING), pen=pg.mkPen(BLANKING))
        self._blanking.setZValue(-20)
        self._blanked = pg.InfLineLabel(self._blanking.lines[1], "blanking", position=0.06, anchors=[(1.05, 0.5)] * 2)
        self._threshold = pg.InfiniteLine(
            angle=0,
            pen=pg.mkPen(THRESHOLD, width=1, style=Qt.PenStyle.DashLine),
            label="threshold",
            labelOpts={"position": 0.97, "anchors": [(1, 1), (1, 1)], "color": THRESHOLD},
        )
        self._stems = pg.PlotCurveItem(pen=pg.mkPen(PREDICTED, width=1, style=Qt.PenStyle.DotLine), connect="pairs")
        self._predicted = pg.PlotCurveItem(pen=pg.mkPen(PREDICTED, width=1, style=Qt.PenStyle.DashLine))
        self._measured = pg.PlotCurveItem(pen=pg.mkPen(MEASURED, width=1))
        self._echoes = pg.ScatterPlotItem(
            size=8, symbol="t", pen=None, brush=pg.mkBrush(PREDICTED), hoverable=True, tip=_tip
        )
        items = (self._blanking, self._threshold, self._stems, self._predicted, self._measured, self._echoes)
        for item in items:
            self.addItem(item, ignoreBounds=True)
        self._names = EchoNames(self.plotItem.vb, _TOP_DB - _MARK_DB)

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
        _draw_curve(self._measured, trace and trace.measured)
        _draw_curve(self._predicted, trace and trace.predicted)
        echoes = trace.echoes if trace else ()
        self._draw_echoes(echoes)
        if trace is not None:
            self._blanking.setRegion((0.0, trace.blanking))
            self._threshold.setValue(trace.threshold_db)
            self.setLimits(xMin=0.0, xMax=trace.reach, yMin=FLOOR_DB, yMax=_TOP_DB)
            self.setXRange(0.0, trace.reach, padding=0)

    def _draw_echoes(self, echoes: tuple[NamedEcho, ...]) -> None:
        ranges = np.array([echo.range for echo in echoes])
        self._echoes.setData(ranges, np.full(len(ranges), _MARK_DB), data=echoes)
        tops = np.array([max(echo.level_db, FLOOR_DB) for echo in echoes])
        self._stems.setData(np.repeat(ranges, 2), np.column_stack((np.full(len(tops), _MARK_DB), tops)).ravel())
        self._names.draw(echoes)


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


def _tip(x: float, y: float, data: NamedEcho) -> str:
    state = "reported" if data.first else "heard later" if data.heard else "within blanking"
    return f"{data.via}\n{data.range:.3f} m, {data.level_db:.1f} dB, {state}"
