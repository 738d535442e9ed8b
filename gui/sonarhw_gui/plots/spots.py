"""Points of equal look, and lines, fast enough for 30 repaints per second of a whole window.

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
from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QPainter, QPainterPath, QPen, QPixmap, QTransform
from PySide6.QtWidgets import QStyleOptionGraphicsItem, QWidget

from sonarhw.readings import FloatArray

_NONE: FloatArray = np.empty(0)
_DIAGONAL = 0.7072  # from the middle of a symbol to its corner, share of its size
_FAR = 2.0**30  # pixels; Qt crashes beyond
_FIELDS = 10  # of a pixmap fragment: x, y, source x, y, width, height, scale x, y, rotation, opacity
_MOST_TIPS = 3


class _Points(pg.GraphicsObject):  # type: ignore[misc]  # pyqtgraph has no types
    """Points in units of the axes; what is drawn at them reaches some pixels around them."""

    def __init__(self, pen: object, brush: object) -> None:
        super().__init__()
        self._pen, self._brush = pg.mkPen(pen), pg.mkBrush(brush)
        self._x, self._y = _NONE, _NONE
        self._extent: QRectF | None = None  # of the points alone; None until it is needed
        self._around: QRectF | None = None  # likewise, with the pixels around them
        self._pixel: tuple[float, float] | None = None  # width and height in units of the axes; None until needed
        self._show_contents(False)

    def getData(self) -> tuple[FloatArray, FloatArray]:
        """Return the coordinates of the points, (n,) each, in units of the axes."""
        return self._x, self._y

    def setData(self, x: ArrayLike = (), y: ArrayLike = ()) -> None:
        """Draw these points, (n,) each."""
        x, y = np.asarray(x, float), np.asarray(y, float)
        if len(x) or len(self._x):
            self._set(x, y)

    def clear(self) -> None:
        """Draw no point."""
        self.setData()

    def setPen(self, pen: QPen) -> None:
        """Draw outlines or lines with another pen."""
        self._pen = pen
        self._restyle()

    def setBrush(self, brush: object) -> None:
        """Fill with another brush or colour; None: not at all."""
        self._brush = pg.mkBrush(brush)
        self._restyle()

    def boundingRect(self) -> QRectF:
        """Return the area that is drawn."""
        if self._around is None:
            padding, (width, height) = self.pixelPadding(), self._pixel_size()
            across, along = width * padding, height * padding
            self._around = self._bounds.adjusted(-across, -along, across, along)
        return self._around

    # for the automatic zoom of pyqtgraph

    def dataBounds(self, axis: int, frac: float = 1.0, orthoRange: object = None) -> tuple[float | None, float | None]:
        """Return the extent along an axis."""
        if not np.isfinite(self._x + self._y).any():
            return None, None
        bounds = self._bounds
        return (bounds.left(), bounds.right()) if axis == 0 else (bounds.top(), bounds.bottom())

    def pixelPadding(self) -> float:
        """Return how far the drawing reaches from a point, pixels."""
        raise NotImplementedError

    def viewTransformChanged(self) -> None:
        """Note that a pixel has another size."""
        self.prepareGeometryChange()
        super().viewTransformChanged()
        self._around = self._pixel = None

    def _pixel_size(self) -> tuple[float, float]:
        """Return width and height of a pixel; 0 while the item is in no view."""
        if self._pixel is None:
            across, along = self.pixelVectors()
            if across is None or along is None:
                return 0.0, 0.0
            self._pixel = across.length(), along.length()
        return self._pixel

    @property
    def _bounds(self) -> QRectF:
        if self._extent is None:
            known = np.isfinite(self._x) & np.isfinite(self._y)
            x, y = self._x[known], self._y[known]
            self._extent = QRectF(QPointF(x.min(), y.min()), QPointF(x.max(), y.max())) if len(x) else QRectF()
        return self._extent

    def _set(self, x: FloatArray, y: FloatArray) -> None:
        self.prepareGeometryChange()
        self._x, self._y, self._extent, self._around = x, y, None, None
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
        self._around = None
        self.update()


class Spots(_Points):
    """Points with one symbol, size, pen and brush, in pixels."""

    def __init__(self, size: float, symbol: str | QPainterPath, pen: object = "d", brush: object = None) -> None:
        """`symbol`: a name of pyqtgraph, or a path within a square of length 1. `pen`, `brush`: None for none."""
        super().__init__(pen, brush)
        self._size, self._symbol = size, symbol
        self._symbol_pixels: tuple[float, QPixmap] | None = None  # device pixels per pixel, and the symbol
        self._fragments = PrimitiveArray(QPainter.PixmapFragment, _FIELDS)
        self._placed: tuple[QTransform, float] | None = None  # for which the fragments are placed

    def addPoints(self, x: ArrayLike, y: ArrayLike) -> None:
        """Draw more points."""
        self._set(np.concatenate((self._x, x)), np.concatenate((self._y, y)))

    def setSize(self, size: float) -> None:
        """Draw the symbols in another size, pixels."""
        self._size = size
        self._restyle()

    def paint(self, painter: QPainter, option: QStyleOptionGraphicsItem, widget: QWidget | None) -> None:
        """Draw the spots, at the places of the last time if nothing has moved."""
        placing, ratio = painter.transform(), 1.0 if widget is None else widget.devicePixelRatioF()
        pixels = self._pixels(ratio)
        if self._placed != (placing, ratio):
            self._place(placing, ratio, pixels)
            self._placed = placing, ratio
        painter.resetTransform()
        painter.drawPixmapFragments(*self._fragments.drawargs(), pixels)  # type: ignore[call-arg]  # of C++

    def pixelPadding(self) -> float:
        """Return how far a symbol reaches from its point, pixels."""
        return float(_DIAGONAL * (self._size + max(self._pen.widthF(), 1.0)))

    def under(self, at: QPointF) -> NDArray[np.intp]:
        """Return the points whose symbols cover a place, the topmost first."""
        width, height = self.boundingRect().width(), self.boundingRect().height()
        bounds = self._bounds
        half = 0.5 / _DIAGONAL
        across, along = (width - bounds.width()) / 2 * half, (height - bounds.height()) / 2 * half
        near = (np.abs(self._x - at.x()) < across) & (np.abs(self._y - at.y()) < along)
        return np.flatnonzero(near)[::-1]

    def _set(self, x: FloatArray, y: FloatArray) -> None:
        self._placed = None
        super()._set(x, y)

    def _restyle(self) -> None:
        self._symbol_pixels, self._placed = None, None
        super()._restyle()

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


class PlotLine(_Points):
    """A line through points, or lines between pairs of them.

    A curve of pyqtgraph does the same with many options, and took three times as long.
    """

    def __init__(self, connect: str = "all", pen: object = "d", filled: bool = False) -> None:
        """`connect`: "all", "finite" (a gap at each NaN) or "pairs". `filled`: fill the enclosed area."""
        super().__init__(pen, None)
        self._connect, self._filled = connect, filled
        self._cleared: QPen | None = None
        self._path: QPainterPath | None = None  # None until it is painted

    def setShadowPen(self, pen: QPen) -> None:
        """Draw the line with this pen first, so that it stands out from what is below."""
        self._cleared = pen
        self._restyle()

    def paint(self, painter: QPainter, *_: object) -> None:
        """Draw the line."""
        if self._path is None:
            self._path = pg.arrayToQPath(self._x, self._y, connect=self._connect)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        if self._cleared is not None:
            painter.strokePath(self._path, self._cleared)
        painter.setPen(self._pen)
        painter.setBrush(self._brush if self._filled else Qt.BrushStyle.NoBrush)
        painter.drawPath(self._path)

    def pixelPadding(self) -> float:
        """Return how far the line reaches from its points, pixels."""
        return float(_DIAGONAL * max(pen.widthF() for pen in (self._pen, self._cleared) if pen is not None))

    def _set(self, x: FloatArray, y: FloatArray) -> None:
        self._path = None
        super()._set(x, y)
