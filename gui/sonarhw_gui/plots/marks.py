"""The predicted outline and the marks of measured readings, with the same shapes and colours in every view."""

from collections.abc import Callable

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import QRectF, Qt
from PySide6.QtGui import QPainter, QPen, QPolygonF

from sonarhw.readings import FloatArray
from sonarhw_gui.look.palette import LIGHT, MARKS, Class, Palette
from sonarhw_gui.plots.plot_look import cosmetic_pen
from sonarhw_gui.plots.spots import PlotLine, Spots, TipSpots
from sonarhw_gui.shown.shown import ClassPoints

_SIZE, _SMALL = 9, 7  # pixels
_RING = 16
_CROWDED = 720  # readings; above, marks are small and have no outline, because outlines would cover their neighbours
NO_POSITIONS = np.empty((0, 2))
NO_POINTS = ClassPoints((), np.empty(0), np.empty(0))
_MOST_MARKS = 2000  # of one class; more are drawn as dots, because each mark takes time at every repaint
_DOT = 3  # pixels
Placed = tuple[ClassPoints, FloatArray]
_LOWEST = 10  # z value of the lowest of dots, scatters and ring
ABOVE_MARKS = _LOWEST + 2 * len(MARKS) - 0.5  # z value above dots and scatters, below the ring
NO_MARKS: Placed = (NO_POINTS, NO_POSITIONS)


class Outline(PlotLine):
    """The predicted ranges: points and a thin line, broken where no echo is predicted."""

    def __init__(self) -> None:
        super().__init__(connect="finite")
        self._points = Spots(size=3, symbol="o", pen=None)
        self._points.setParentItem(self)

    def set_look(self, colours: Palette) -> None:
        """Use the colour of predictions."""
        self.setPen(cosmetic_pen(colours.predicted, width=1))
        self._points.setBrush(colours.predicted)

    def draw(self, positions: FloatArray) -> None:
        """Draw the outline at `positions`, (n, 2) float; NaN where no echo is predicted."""
        self.setData(*positions.T)
        self._points.setData(*positions[~np.isnan(positions).any(axis=1)].T)


class Dots(pg.GraphicsObject):  # type: ignore[misc]  # pyqtgraph has no types
    """Tens of thousands of points, drawn in one call."""

    def __init__(self) -> None:
        super().__init__()
        self._pen = pg.mkPen(None)
        self._polygon = QPolygonF()
        self._bounds = QRectF()
        self.setVisible(False)

    def set_pen(self, pen: QPen) -> None:
        """Set the pen; its width is the size of a dot."""
        pen.setCapStyle(Qt.PenCapStyle.FlatCap)  # seven times as fast as round caps
        self._pen = pen
        self.update()

    def set_positions(self, positions: FloatArray) -> None:
        """Draw dots at `positions`, (n, 2) float."""
        self.setVisible(len(positions) > 0)  # an empty item still takes time at every repaint
        if not len(positions) and self._polygon.isEmpty():
            return
        self.prepareGeometryChange()
        self._polygon = (
            pg.functions.arrayToQPolygonF(*np.ascontiguousarray(positions.T)) if len(positions) else QPolygonF()
        )
        self._bounds = self._polygon.boundingRect()
        self.update()

    def boundingRect(self) -> QRectF:
        """Return the area of the dots."""
        return self._bounds

    def dataBounds(self, axis: int, frac: float = 1.0, orthoRange: object = None) -> tuple[float, float] | None:
        """Return their extent along an axis, for automatic zoom."""
        if self._polygon.isEmpty():
            return None
        along_x = (self._bounds.left(), self._bounds.right())
        return along_x if axis == 0 else (self._bounds.top(), self._bounds.bottom())

    def paint(self, painter: QPainter, *_: object) -> None:
        """Draw the dots."""
        painter.setRenderHint(QPainter.RenderHint.Antialiasing, False)
        painter.setPen(self._pen)
        painter.drawPoints(self._polygon)


class ReadingMarks:
    """One scatter for each class, and a ring around the selected reading."""

    def __init__(self, plot: pg.PlotItem, tip: Callable[[int], str]) -> None:
        self.placed: dict[Class, Placed] = {}
        self.scatters = {kind: TipSpots(size=_SIZE, symbol=MARKS[kind].symbol, tip=tip) for kind in MARKS}
        self._crowded = False
        self._colours = LIGHT
        self._ring = Spots(size=_RING, symbol="o", brush=None)
        self._dots = {kind: Dots() for kind in MARKS}
        items: tuple[pg.GraphicsObject, ...] = (*self._dots.values(), *self.scatters.values(), self._ring)
        for z, item in enumerate(items):
            item.setZValue(_LOWEST + z)
            plot.addItem(item)
        for scatter in self.scatters.values():
            scatter.setVisible(False)

    def set_look(self, colours: Palette) -> None:
        """Use these colours."""
        self._colours = colours
        self._style_scatters()
        for kind, dots in self._dots.items():
            dots.set_pen(cosmetic_pen(colours.of(kind), width=_DOT))
        self._ring.setPen(cosmetic_pen(colours.chosen, width=2))

    def draw(self, placed: dict[Class, Placed]) -> None:
        """Draw the readings of each class at their positions, (n, 2) float in plot coordinates."""
        crowded = sum(len(positions) for _, positions in placed.values()) > _CROWDED
        if crowded is not self._crowded:
            self._crowded = crowded
            self._style_scatters()
        for kind, scatter in self.scatters.items():
            before, (points, positions) = self.placed.get(kind, NO_MARKS), placed.get(kind, NO_MARKS)
            known = _unchanged_count(before, (points, positions))
            if known == len(positions) == len(before[1]):
                continue
            few = 0 < len(positions) <= _MOST_MARKS
            self._dots[kind].set_positions(NO_POSITIONS if few else positions)
            scatter.setVisible(few)
            if not few or not known:
                scatter.clear()
            if few:  # draw only new points of a growing scan; each added point takes time
                new = positions[known:]
                scatter.addPoints(new[:, 0], new[:, 1], points.readings[known:])
        self.placed = placed

    def _style_scatters(self) -> None:
        for kind, scatter in self.scatters.items():
            colour = self._colours.of(kind)
            if MARKS[kind].hollow:
                scatter.setPen(cosmetic_pen(colour, width=1))
                scatter.setBrush(None)
            else:
                scatter.setPen(pg.mkPen(None) if self._crowded else cosmetic_pen(self._colours.paper, width=1))
                scatter.setBrush(pg.mkBrush(colour))
            scatter.setSize(_SMALL if self._crowded else _SIZE)

    def ring(self, chosen: int | None) -> None:
        """Draw the ring around one reading; remove it if the reading is not drawn."""
        position = self.position_of(chosen)
        if position is None:
            self._ring.clear()
        else:
            self._ring.setData(*position[:, None])

    def position_of(self, reading: int | None) -> FloatArray | None:
        """Return the position of a reading, (2,) float in plot coordinates; None if it is not drawn."""
        for points, positions in self.placed.values():
            if reading in points.readings:
                return np.asarray(positions[points.readings.index(reading)])
        return None


def _unchanged_count(before: Placed, now: Placed) -> int:
    """Return how many readings are drawn already if the new ones only extend them; otherwise 0."""
    count = len(before[1])
    same = before[0].readings == now[0].readings[:count] and np.array_equal(before[1], now[1][:count])
    return count if same else 0
