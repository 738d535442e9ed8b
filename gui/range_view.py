"""Range against heading, measured and predicted, and below it what is left between them.

Takes what is shown; hands on which reading was clicked.
"""

import math

import numpy as np
import pyqtgraph as pg
from pyqtgraph.GraphicsScene.mouseEvents import MouseClickEvent
from PySide6.QtCore import QPointF, Qt, Signal

from compare.match import TOLERANCE, Kind
from gui.look import Look
from gui.marks import WHOLE, Placed, ReadingMarks, dress_outline, outline_item
from gui.palette import Unclassed
from gui.pick import is_plain_click, nearest_reading
from gui.plan_geometry import outline_ranges
from gui.plot_look import dress_plot, label_axis, label_length
from gui.reading_tip import reading_tip
from gui.shown import Shown
from sonarhw.readings import FloatArray

_MOST_RESIDUAL = 25.0  # cm; what is farther off is drawn at the edge
_AXIS_WIDTH = 48  # pixels, so that both plots begin at one line
_ROW_REACH = 1e6  # pixels: a click beside all points means the nearest one


class RangeView(pg.GraphicsLayoutWidget):  # type: ignore[misc]  # pyqtgraph has no types
    """Draws ranges and residuals over heading."""

    picked = Signal(int)  # a reading
    pointed = Signal(object)  # Cursor or None

    def __init__(self) -> None:
        super().__init__()
        self.setViewportUpdateMode(WHOLE)
        self._shown: Shown | None = None
        self.ranges = self._plot(0)
        self.residuals = self._plot(1)
        self.residuals.setXLink(self.ranges)
        self.residuals.setYRange(-_MOST_RESIDUAL, _MOST_RESIDUAL, padding=0.08)
        self.residuals.setToolTip("measured less predicted; what is beyond ±25 cm is drawn at the edge")
        self.ranges.getAxis("bottom").setStyle(showValues=False)
        self.ci.layout.setRowStretchFactor(0, 3)
        self.ci.layout.setRowStretchFactor(1, 2)
        self._outline = outline_item()
        self.ranges.addItem(self._outline)
        self._tolerance = self._add_tolerance()
        self._marks = tuple(ReadingMarks(plot, self._tip) for plot in (self.ranges, self.residuals))
        self._cursors = [self._add_cursor(plot) for plot in (self.ranges, self.residuals)]
        self.ranges.setXRange(0, 360, padding=0.01)
        self.scene().sigMouseClicked.connect(self._click)

    def show_state(self, shown: Shown) -> None:
        """Draw what has changed since the last call."""
        before, self._shown = self._shown, shown
        if before is None or before.look != shown.look:
            self._dress(shown.look)
        if before is None or before.outline is not shown.outline:
            self._draw_outline(shown)
        if before is None or not shown.same_readings(before):
            self._marks[0].draw(_ranges(shown))
            self._marks[1].draw(_residuals(shown))
        for marks in self._marks:
            marks.ring(shown.chosen)
        for cursor in self._cursors:
            cursor.setVisible(shown.chosen is not None)
            if shown.chosen is not None:
                cursor.setValue(math.degrees(shown.heading(shown.chosen)) % 360)

    def _dress(self, look: Look) -> None:
        self.setBackground(look.palette.paper)
        for plot in (self.ranges, self.residuals):
            dress_plot(plot, look)
        label_length(self.ranges.getAxis("left"), "range", look)
        label_axis(self.residuals.getAxis("left"), "residual (cm)")
        label_axis(self.residuals.getAxis("bottom"), "heading in the room (°)")
        dress_outline(self._outline, look.palette)
        self._tolerance.setBrush(look.palette.tolerance)
        for line in self._tolerance.lines:
            line.setPen(look.palette.tolerance)
        for marks in self._marks:
            marks.dress(look.palette)
        for cursor in self._cursors:
            cursor.setPen(pg.mkPen(look.palette.chosen, width=1, style=Qt.PenStyle.DotLine))

    def _plot(self, row: int) -> pg.PlotItem:
        plot = self.addPlot(row=row, col=0)
        plot.getAxis("left").setWidth(_AXIS_WIDTH)
        plot.getAxis("bottom").setTickSpacing(90, 30)
        plot.hideButtons()
        return plot

    def _add_tolerance(self) -> pg.LinearRegionItem:
        band = pg.LinearRegionItem(
            (-100 * TOLERANCE, 100 * TOLERANCE),
            orientation="horizontal",
            movable=False,
        )
        band.setZValue(-20)
        self.residuals.addItem(band, ignoreBounds=True)
        return band

    def _add_cursor(self, plot: pg.PlotItem) -> pg.InfiniteLine:
        line = pg.InfiniteLine(angle=90)
        plot.addItem(line, ignoreBounds=True)
        return line

    def _draw_outline(self, shown: Shown) -> None:
        if shown.outline is None:
            self._outline.setData([], [])
            return
        headings, ranges = outline_ranges(shown.outline).T
        self._outline.setData(np.degrees(headings), ranges)

    def _tip(self, index: int) -> str:
        return reading_tip(self._shown, index) if self._shown else ""

    def _click(self, event: MouseClickEvent) -> None:
        if self._shown is None or not is_plain_click(event):
            return
        index = self._under(event.scenePos())
        if index is not None:
            event.accept()
            self.picked.emit(index)

    def _under(self, click: QPointF) -> int | None:
        for plot, marks in zip((self.ranges, self.residuals), self._marks, strict=True):
            if plot.sceneBoundingRect().contains(click):
                return nearest_reading(plot.vb, marks.placed, click, _ROW_REACH)
        return None


def _over_heading(headings: FloatArray, values: FloatArray) -> FloatArray:
    return np.column_stack((np.degrees(headings) % 360, values))


def _ranges(shown: Shown) -> dict[Kind | Unclassed, Placed]:
    return {kind: (points, _over_heading(points.headings, points.ranges)) for kind, points in shown.classes.items()}


def _residuals(shown: Shown) -> dict[Kind | Unclassed, Placed]:
    """Measured less predicted of the readings that have both, cm, at the edge where they are beyond it."""
    placed: dict[Kind | Unclassed, Placed] = {}
    for kind in (Kind.MATCH, Kind.SHORT, Kind.LONG):
        points = shown.classes.get(kind)
        if points is not None:
            apart = np.array([100 * _residual(shown, index) for index in points.readings])
            placed[kind] = points, _over_heading(points.headings, np.clip(apart, -_MOST_RESIDUAL, _MOST_RESIDUAL))
    return placed


def _residual(shown: Shown, index: int) -> float:
    row = shown.row(index)
    return math.nan if row is None or row.residual is None else row.residual
