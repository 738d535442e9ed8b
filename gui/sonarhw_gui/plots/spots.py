"""Points of equal look, and lines, fast enough for 30 repaints per second.

A scatter of pyqtgraph gives each of its points a symbol, a pen and a row of a table. With those, new points took longer
than their drawing.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pyqtgraph as pg
from numpy.typing import ArrayLike, NDArray
from pyqtgraph.graphicsItems.ScatterPlotItem import renderSymbol
from pyqtgraph.GraphicsScene.mouseEvents import HoverEvent
from pyqtgraph.Qt.internals import PrimitiveArray
from PySide6.QtCore import QPointF, QRectF
from PySide6.QtGui import QPainter, QPainterPath, QPen, QPixmap, QTransform
from PySide6.QtWidgets import QStyleOptionGraphicsItem, QWidget

from sonarhw.readings import FloatArray

_NONE: FloatArray = np.empty(0)
_DIAGONAL = 0.7072  # from the middle of a symbol to its corner, share of its size
_FAR = 2.0**30  # pixels; Qt crashes beyond
_FIELDS = 10  # of a pixmap fragment: x, y, source x, y, width, height, scale x, y, rotation, opacity
_MOST_TIPS = 3


class Spots(pg.GraphicsObject):  # type: ignore[misc]  # pyqtgraph has no types
    """Points with one symbol, size, pen and brush, in pixels."""

    def __init__(self, size: float, symbol: str | QPainterPath, pen: object = "d", brush: object = None) -> None:
        """`symbol`: a name of pyqtgraph, or a path within a square of length 1. `pen`, `brush`: None for none."""
        super().__init__()
        self._size, self._symbol = size, symbol
        self._pen, self._brush = pg.mkPen(pen), pg.mkBrush(brush)
        self._x, self._y = _NONE, _NONE
        self._extent: QRectF | None = None  # of the points, without their size; None until it is needed
        self._around: QRectF | None = None  # likewise, with their size
        self._symbol_pixels: tuple[float, QPixmap] | None = None  # device pixels per pixel, and the symbol
        self._fragments = PrimitiveArray(QPainter.PixmapFragment, _FIELDS)
        self._placed: tuple[QTransform, float] | None = None  # for which the fragments are placed
        self._show_contents(False)

    def setData(self, x: ArrayLike = (), y: ArrayLike = ()) -> None:
        """Draw points at these coordinates, (n,) each."""
        x, y = np.asarray(x, float), np.asarray(y, float)
        if len(x) or len(self._x):
            self._set(x, y)

    def addPoints(self, x: ArrayLike, y: ArrayLike) -> None:
        """Draw more points."""
        self._set(np.concatenate((self._x, x)), np.concatenate((self._y, y)))

    def clear(self) -> None:
        """Draw no point."""
        self.setData()

    def getData(self) -> tuple[FloatArray, FloatArray]:
        """Return the coordinates of the points, (n,) each, in units of the axes."""
        return self._x, self._y

    def setPen(self, pen: QPen) -> None:
        """Draw the outlines with another pen."""
        self._pen = pen
        self._restyle()

    def setBrush(self, brush: object) -> None:
        """Fill the symbols with another brush or colour; None: not at all."""
        self._brush = pg.mkBrush(brush)
        self._restyle()

    def setSize(self, size: float) -> None:
        """Draw the symbols in another size, pixels."""
        self._size = size
        self._restyle()

    def boundingRect(self) -> QRectF:
        """Return the area of the spots, including their size in pixels."""
        if self._around is None:
            across, along = (0.0 if vector is None else vector.length() for vector in self.pixelVectors())
            padding = self.pixelPadding()
            across, along = across * padding, along * padding
            self._around = self._bounds.adjusted(-across, -along, across, along)
        return self._around

    def paint(self, painter: QPainter, option: QStyleOptionGraphicsItem, widget: QWidget | None) -> None:
        """Draw the spots, at the places of the last time if nothing has moved."""
        placing, ratio = painter.transform(), 1.0 if widget is None else widget.devicePixelRatioF()
        pixels = self._pixels(ratio)
        if self._placed != (placing, ratio):
            self._place(placing, ratio, pixels)
            self._placed = placing, ratio
        painter.resetTransform()
        painter.drawPixmapFragments(*self._fragments.drawargs(), pixels)  # type: ignore[call-arg]  # of C++

    # for the automatic zoom of pyqtgraph

    def dataBounds(self, axis: int, frac: float = 1.0, orthoRange: object = None) -> tuple[float | None, float | None]:
        """Return the extent along an axis."""
        if not len(self._x):
            return None, None
        bounds = self._bounds
        return (bounds.left(), bounds.right()) if axis == 0 else (bounds.top(), bounds.bottom())

    def pixelPadding(self) -> float:
        """Return how far a symbol reaches from its point, pixels."""
        return float(_DIAGONAL * (self._size + max(self._pen.widthF(), 1.0)))

    def viewTransformChanged(self) -> None:
        """Note that a pixel has another size."""
        self.prepareGeometryChange()
        super().viewTransformChanged()
        self._around = None

    def under(self, at: QPointF) -> NDArray[np.intp]:
        """Return the points whose symbols cover a place, the topmost first."""
        width, height = self.boundingRect().width(), self.boundingRect().height()
        bounds = self._bounds
        half = 0.5 / _DIAGONAL
        across, along = (width - bounds.width()) / 2 * half, (height - bounds.height()) / 2 * half
        near = (np.abs(self._x - at.x()) < across) & (np.abs(self._y - at.y()) < along)
        return np.flatnonzero(near)[::-1]

    @property
    def _bounds(self) -> QRectF:
        if self._extent is None:
            known = np.isfinite(self._x) & np.isfinite(self._y)
            x, y = self._x[known], self._y[known]
            self._extent = QRectF(QPointF(x.min(), y.min()), QPointF(x.max(), y.max())) if len(x) else QRectF()
        return self._extent

    def _set(self, x: FloatArray, y: FloatArray) -> None:
        self.prepareGeometryChange()
        self._x, self._y, self._extent, self._around, self._placed = x, y, None, None, None
        self._show_contents(len(x) > 0)
        self.informViewBoundsChanged()
        self.update()

    def _show_contents(self, any_point: bool) -> None:
        """Let Qt skip an item without points, which would take time at every repaint."""
        flag = self.GraphicsItemFlag.ItemHasNoContents
        if bool(self.flags() & flag) is any_point:
            self.setFlag(flag, not any_point)

    def _restyle(self) -> None:
        self.prepareGeometryChange()
        self._symbol_pixels, self._around, self._placed = None, None, None
        self.update()

    def _pixels(self, ratio: float) -> QPixmap:
        """Return the symbol for a screen of `ratio` device pixels per pixel."""
        if self._symbol_pixels is None or self._symbol_pixels[0] != ratio:
            image = renderSymbol(self._symbol, self._size, self._pen, self._brush, dpr=ratio)
            image.setDevicePixelRatio(1.0)  # fragments are in pixels of the image
            self._symbol_pixels = ratio, QPixmap.fromImage(image)
        return self._symbol_pixels[1]

    def _place(self, placing: QTransform, ratio: float, pixels: QPixmap) -> None:
        """Compute where the symbols are on the screen."""
        x = placing.m11() * self._x + placing.m21() * self._y + placing.dx()
        y = placing.m12() * self._x + placing.m22() * self._y + placing.dy()
        drawn = (np.abs(x) < _FAR) & (np.abs(y) < _FAR)  # false for NaN too
        x, y = x[drawn], y[drawn]
        self._fragments.resize(len(x))
        table = self._fragments.ndarray()
        table[:, 0], table[:, 1] = x, y
        table[:, 2:] = 0.0, 0.0, pixels.width(), pixels.height(), 1 / ratio, 1 / ratio, 0.0, 1.0


class TipSpots(Spots):
    """Spots, each with a text or number, whose tooltip is that of the spots under the mouse."""

    def __init__(self, size: float, symbol: str, tip: Callable[[Any], str] = str, **style: object) -> None:
        """`tip` returns the tooltip for what belongs to a spot."""
        super().__init__(size, symbol, **style)
        self.about: Sequence[Any] = ()  # what belongs to each spot
        self._tip = tip
        self._tells = False  # whether the tooltip of the plot is that of these spots

    def setData(self, x: ArrayLike = (), y: ArrayLike = (), about: Sequence[Any] = ()) -> None:
        """Draw points at these coordinates, (n,) each; `about`: what belongs to each."""
        self.about = tuple(about)
        super().setData(x, y)

    def addPoints(self, x: ArrayLike, y: ArrayLike, about: Sequence[Any] = ()) -> None:
        """Draw more points."""
        self.about = (*self.about, *about)
        super().addPoints(x, y)

    def hoverEvent(self, event: HoverEvent) -> None:
        """Set the tooltip of the plot while the mouse is on a spot."""
        box, under = self.getViewBox(), () if event.exit else self.under(event.pos())
        if box is None or not (len(under) or self._tells):
            return
        tips = [self._tip(self.about[k]) for k in under[:_MOST_TIPS]]
        if len(under) > _MOST_TIPS:
            tips.append(f"({len(under) - _MOST_TIPS} others...)")
        box.setToolTip("\n\n".join(tips))
        self._tells = bool(tips)


class PlotLine(pg.PlotCurveItem):  # type: ignore[misc]  # pyqtgraph has no types
    """A curve. Qt skips it at repaints while it has no points, and setting no points again has no effect."""

    def __init__(self, **style: object) -> None:
        super().__init__(np.empty(0), np.empty(0), **style)
        self.setFlag(self.GraphicsItemFlag.ItemHasNoContents)

    def setData(self, x: ArrayLike = (), y: ArrayLike = (), **style: object) -> None:
        """Draw a line through these points, (n,) each."""
        count, before = np.size(x), None if self.xData is None else len(self.xData)
        if count or style or before != 0:
            super().setData(np.asarray(x, float), np.asarray(y, float), **style)
        if bool(count) is not bool(before):
            self.setFlag(self.GraphicsItemFlag.ItemHasNoContents, not count)
