"""The marks of one view, the outline and a scatter for every class: same mark, same colour, everywhere.

Takes a plot; hands on the scatters in it, and their tooltips.
"""

from collections.abc import Callable

import numpy as np
import pyqtgraph as pg
from pyqtgraph.GraphicsScene.mouseEvents import HoverEvent
from PySide6.QtCore import QRectF, Qt
from PySide6.QtGui import QPainter, QPen, QPolygonF
from sonarhw_compare.matching.match import Kind

from sonarhw.readings import FloatArray
from sonarhw_gui.look.palette import MARKS, Palette, Unclassed
from sonarhw_gui.plots.plot_look import cosmetic_pen
from sonarhw_gui.plots.spots import Spots
from sonarhw_gui.shown.shown import ClassPoints

_SIZE = 9
_RING = 16
NOWHERE = np.empty((0, 2))
NO_POINTS = ClassPoints((), np.empty(0), np.empty(0))
_MOST_MARKS = 2000  # of one class; more are dots, for each mark takes time at every repaint
_DOT = 3  # pixels
Placed = tuple[ClassPoints, FloatArray]
_LOWEST = 10  # of the marks one upon the other: dots, scatters, ring
ABOVE_MARKS = _LOWEST + 2 * len(MARKS) - 0.5  # and below the ring
NO_MARKS: Placed = (NO_POINTS, NOWHERE)


class Outline(pg.PlotCurveItem):  # type: ignore[misc]  # pyqtgraph has no types
    """What is predicted: points and a thin line, broken where no echo is predicted."""

    def __init__(self) -> None:
        super().__init__(connect="finite")
        self._points = Spots(size=3, symbol="o", pen=None)
        self._points.setParentItem(self)

    def set_look(self, colours: Palette) -> None:
        """Draw in the colour of what is predicted."""
        self.setPen(cosmetic_pen(colours.predicted, width=1))
        self._points.setBrush(colours.predicted)

    def draw(self, places: FloatArray) -> None:
        """Draw it there, (n, 2); NaN where no echo is predicted."""
        self.setData(*places.T)
        self._points.setData(*places[~np.isnan(places).any(axis=1)].T)


class Dots(pg.GraphicsObject):  # type: ignore[misc]  # pyqtgraph has no types
    """Points by the ten thousand, drawn at one go."""

    def __init__(self) -> None:
        super().__init__()
        self._pen = pg.mkPen(None)
        self._polygon = QPolygonF()
        self._bounds = QRectF()
        self.setVisible(False)

    def set_pen(self, pen: QPen) -> None:
        """Draw with this pen; its width is that of a dot."""
        pen.setCapStyle(Qt.PenCapStyle.FlatCap)  # seven times as quick as round ones
        self._pen = pen
        self.update()

    def set_places(self, places: FloatArray) -> None:
        """Draw dots there, (n, 2)."""
        self.setVisible(len(places) > 0)  # empty ones still take time at every repaint
        if not len(places) and self._polygon.isEmpty():
            return
        self.prepareGeometryChange()
        self._polygon = pg.functions.arrayToQPolygonF(*np.ascontiguousarray(places.T)) if len(places) else QPolygonF()
        self._bounds = self._polygon.boundingRect()
        self.update()

    def boundingRect(self) -> QRectF:
        """Where the dots are."""
        return self._bounds

    def dataBounds(self, axis: int, frac: float = 1.0, orthoRange: object = None) -> tuple[float, float] | None:
        """From where to where they go along an axis, for the view's own zoom."""
        if self._polygon.isEmpty():
            return None
        along_x = (self._bounds.left(), self._bounds.right())
        return along_x if axis == 0 else (self._bounds.top(), self._bounds.bottom())

    def paint(self, painter: QPainter, *_: object) -> None:
        """Draw them."""
        painter.setRenderHint(QPainter.RenderHint.Antialiasing, False)
        painter.setPen(self._pen)
        painter.drawPoints(self._polygon)


class ReadingMarks:
    """One scatter a class, and a ring round the chosen reading."""

    def __init__(self, plot: pg.PlotItem, tip: Callable[[int], str]) -> None:
        self.placed: dict[Kind | Unclassed, Placed] = {}
        self.scatters = {kind: _scatter(kind, tip) for kind in MARKS}
        self._ring = Spots(size=_RING, symbol="o", brush=None)
        self._dots = {kind: Dots() for kind in MARKS}
        items: tuple[pg.GraphicsObject, ...] = (*self._dots.values(), *self.scatters.values(), self._ring)
        for z, item in enumerate(items):
            item.setZValue(_LOWEST + z)
            plot.addItem(item)
        for scatter in self.scatters.values():
            scatter.setVisible(False)

    def set_look(self, colours: Palette) -> None:
        """Draw in these colours from now on."""
        for kind, scatter in self.scatters.items():
            scatter.setPen(cosmetic_pen(colours.paper, width=1))
            scatter.setBrush(pg.mkBrush(colours.of(kind)))
            self._dots[kind].set_pen(cosmetic_pen(colours.of(kind), width=_DOT))
        self._ring.setPen(cosmetic_pen(colours.chosen, width=2))

    def draw(self, placed: dict[Kind | Unclassed, Placed]) -> None:
        """Draw the readings of each class at their places, (n, 2) in the plot's coordinates."""
        for kind, scatter in self.scatters.items():
            before, (points, places) = self.placed.get(kind, NO_MARKS), placed.get(kind, NO_MARKS)
            known = _known(before, (points, places))
            if known == len(places) == len(before[1]):
                continue
            few = 0 < len(places) <= _MOST_MARKS
            self._dots[kind].set_places(NOWHERE if few else places)
            scatter.setVisible(few)
            if not few or not known:
                scatter.clear()
            if few:  # a scan grows at its end, and each point that is added takes time
                scatter.addPoints(*places[known:].T, data=points.readings[known:])
        self.placed = placed

    def ring(self, chosen: int | None) -> None:
        """Draw the ring round one reading; none where that is not drawn."""
        place = self.place_of(chosen)
        if place is None:
            self._ring.clear()
        else:
            self._ring.setData(*place[:, None])

    def place_of(self, reading: int | None) -> FloatArray | None:
        """Where a reading is drawn, (2,) in the plot's coordinates; None where it is not."""
        for points, places in self.placed.values():
            if reading in points.readings:
                return np.asarray(places[points.readings.index(reading)])
        return None


def _known(before: Placed, now: Placed) -> int:
    """How many of the readings placed now were placed the same before, where those were no others; else 0."""
    count = len(before[1])
    same = before[0].readings == now[0].readings[:count] and np.array_equal(before[1], now[1][:count])
    return count if same else 0


def _scatter(kind: Kind | Unclassed, tip: Callable[[int], str]) -> Spots:
    return _Scatter(size=_SIZE, symbol=MARKS[kind].symbol, hoverable=True, tip=lambda x, y, data: tip(data))


class _Scatter(Spots):
    """Looks for a mark under the hand before it makes an object of every mark, which takes milliseconds."""

    def hoverEvent(self, ev: HoverEvent) -> None:
        if not self._toolTipCleared or (not ev.exit and self._maskAt(ev.pos()).any()):
            super().hoverEvent(ev)
