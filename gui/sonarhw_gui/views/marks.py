"""Marks of readings in all plots: points, notes, overlaid scans and tooltips, fast enough for 30 repaints a second."""

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pyqtgraph as pg
from numpy.typing import ArrayLike, NDArray
from pyqtgraph.graphicsItems.ScatterPlotItem import drawSymbol, renderSymbol
from pyqtgraph.GraphicsScene.mouseEvents import HoverEvent
from pyqtgraph.Qt.internals import PrimitiveArray
from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QPaintEngine, QPainter, QPainterPath, QPen, QPixmap, QPolygonF, QTransform
from PySide6.QtWidgets import QStyleOptionGraphicsItem, QWidget

from sonarhw.errors import heading_text
from sonarhw.readings import FloatArray
from sonarhw_gui.model.look import LIGHT, MARKS, OVERLAYS, Class, LengthUnit, Look
from sonarhw_gui.model.scene import NoteTexts
from sonarhw_gui.model.shown import ClassPoints, Shown
from sonarhw_gui.model.theme import NOTE_SIZE, note_symbol
from sonarhw_gui.views.base import cosmetic_pen

# Points of equal look, and lines, fast enough for 30 repaints per second of a whole window.
#
# A scatter of pyqtgraph gives each of its points a symbol, a pen and a row of a table. With those, new points took
# longer than their drawing.


_NONE: FloatArray = np.empty(0)
_DIAGONAL = 0.7072  # from the middle of a symbol to its corner, share of its size
_FAR = 2.0**30  # pixels; Qt crashes beyond
_OF_SHAPES = QPaintEngine.Type.SVG, QPaintEngine.Type.Pdf
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
            finite = np.isfinite(self._x) & np.isfinite(self._y)
            x, y = self._x[finite], self._y[finite]
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
        """Draw the spots, at the places of the last time if nothing has moved; as shapes in a file of shapes."""
        if painter.paintEngine().type() in _OF_SHAPES:
            self._draw_shapes(painter)
            return
        placing, ratio = painter.transform(), 1.0 if widget is None else widget.devicePixelRatioF()
        pixels = self._pixels(ratio)
        if self._placed != (placing, ratio):
            self._place(placing, ratio, pixels)
            self._placed = placing, ratio
        painter.resetTransform()
        painter.drawPixmapFragments(*self._fragments.drawargs(), pixels)  # type: ignore[call-arg]  # of C++

    def _draw_shapes(self, painter: QPainter) -> None:
        placing = painter.transform()
        for x, y in zip(self._x.tolist(), self._y.tolist(), strict=True):
            if math.isfinite(x) and math.isfinite(y):
                painter.resetTransform()
                painter.translate(placing.map(QPointF(x, y)))
                drawSymbol(painter, self._symbol, self._size, self._pen, self._brush)
        painter.setTransform(placing)

    def pixelPadding(self) -> float:
        """Return how far a symbol reaches from its point, pixels."""
        return float(_DIAGONAL * (self._size + max(self._pen.widthF(), 1.0)))

    def under(self, place: QPointF) -> NDArray[np.intp]:
        """Return the points whose symbols cover a place, the topmost first."""
        width, height = self.boundingRect().width(), self.boundingRect().height()
        bounds = self._bounds
        half = 0.5 / _DIAGONAL
        across, along = (width - bounds.width()) / 2 * half, (height - bounds.height()) / 2 * half
        near = (np.abs(self._x - place.x()) < across) & (np.abs(self._y - place.y()) < along)
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


# The predicted outline and the marks of measured readings, with the same shapes and colours in every view.


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

    def set_look(self, look: Look) -> None:
        """Use the colour of predictions."""
        self.setPen(cosmetic_pen(look.palette.predicted, width=1))
        self._points.setBrush(look.palette.predicted)

    def draw(self, positions: FloatArray) -> None:
        """Draw the outline at `positions`, (n, 2) float; NaN where no echo is predicted."""
        self.setData(*positions.T)
        self._points.setData(*positions[~np.isnan(positions).any(axis=1)].T)


class Dots(_Points):
    """Tens of thousands of points, drawn in one call. The width of the pen is the size of a dot."""

    def __init__(self) -> None:
        super().__init__(None, None)
        self._polygon: QPolygonF | None = None  # None until it is painted

    def setPen(self, pen: QPen) -> None:
        """Draw dots with another pen."""
        pen.setCapStyle(Qt.PenCapStyle.FlatCap)  # seven times as fast as round caps
        super().setPen(pen)

    def paint(self, painter: QPainter, *_: object) -> None:
        """Draw the dots."""
        if self._polygon is None:
            self._polygon = pg.functions.arrayToQPolygonF(self._x, self._y)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing, False)
        painter.setPen(self._pen)
        painter.drawPoints(self._polygon)

    def pixelPadding(self) -> float:
        """Return 0: the automatic zoom neglects the size of a dot."""
        return 0.0

    def _set(self, x: FloatArray, y: FloatArray) -> None:
        self._polygon = None
        super()._set(x, y)


class ReadingMarks:
    """One scatter for each class, a ring around the selected reading, and a small sheet above each one with a note."""

    def __init__(self, plot: pg.PlotItem, tip: Callable[[int], str]) -> None:
        self.placed: dict[Class, Placed] = {}
        self.scatters = {kind: TipSpots(size=_SIZE, symbol=MARKS[kind].symbol, tip=tip) for kind in MARKS}
        self._crowded = False
        self._colours = LIGHT
        self._ring = Spots(size=_RING, symbol="o", brush=None)
        self._dots = {kind: Dots() for kind in MARKS}
        self.notes = Spots(size=NOTE_SIZE, symbol=note_symbol())
        self.notes.setZValue(ABOVE_MARKS)
        plot.addItem(self.notes, ignoreBounds=True)
        items: tuple[pg.GraphicsObject, ...] = (*self._dots.values(), *self.scatters.values(), self._ring)
        for z, item in enumerate(items):
            item.setZValue(_LOWEST + z)
            plot.addItem(item)
        for scatter in self.scatters.values():
            scatter.setVisible(False)

    def set_look(self, look: Look) -> None:
        """Use these colours."""
        self._colours = colours = look.palette
        self._style_scatters()
        for kind, dots in self._dots.items():
            dots.setPen(cosmetic_pen(colours.of(kind), width=_DOT))
        self._ring.setPen(cosmetic_pen(colours.chosen, width=2))
        self.notes.setPen(cosmetic_pen(colours.note_ink))
        self.notes.setBrush(colours.note_paper)

    def draw(self, placed: dict[Class, Placed]) -> None:
        """Draw the readings of each class at their positions, (n, 2) float in plot coordinates."""
        crowded = sum(len(positions) for _, positions in placed.values()) > _CROWDED
        if crowded is not self._crowded:
            self._crowded = crowded
            self._style_scatters()
        for kind, scatter in self.scatters.items():
            before, (points, positions) = self.placed.get(kind, NO_MARKS), placed.get(kind, NO_MARKS)
            unchanged = _unchanged_count(before, (points, positions))
            if unchanged == len(positions) == len(before[1]):
                continue
            few = 0 < len(positions) <= _MOST_MARKS
            self._dots[kind].setData(*(NO_POSITIONS if few else positions).T)
            scatter.setVisible(few)
            if not few or not unchanged:
                scatter.clear()
            if few:  # draw only new points of a growing scan; each added point takes time
                new = positions[unchanged:]
                scatter.addPoints(new[:, 0], new[:, 1], points.readings[unchanged:])
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

    def draw_notes(self, notes: NoteTexts) -> None:
        """Draw the notes on the readings that are drawn."""
        noted = list(notes.by_reading)
        if not noted:
            self.notes.clear()
            return
        drawn = self.placed.values()
        places = np.vstack([NO_POSITIONS, *(places[np.isin(points.readings, noted)] for points, places in drawn)])
        self.notes.setData(*places[np.isfinite(places).all(axis=1)].T)

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


# The marks of scans that are drawn over the one shown: a colour and an outlined shape for each.


_OVERLAY_SIZE = 9  # pixels
_BELOW_MARKS = 5  # z value


class OverlayMarks:
    """One scatter for each style."""

    def __init__(self, plot: pg.PlotItem) -> None:
        self.scatters = [Spots(size=_OVERLAY_SIZE, symbol=symbol, brush=None) for _, symbol in OVERLAYS]
        for scatter in self.scatters:
            scatter.setZValue(_BELOW_MARKS)
            plot.addItem(scatter, ignoreBounds=True)

    def set_look(self, look: Look) -> None:
        """Use the width of lines of the screen."""
        for scatter, (colour, _) in zip(self.scatters, OVERLAYS, strict=True):
            scatter.setPen(cosmetic_pen(colour, width=1.5))

    def draw(self, points: dict[int, FloatArray]) -> None:
        """Draw the points of each style, (n, 2) in plot coordinates; NaN is not drawn."""
        for style, scatter in enumerate(self.scatters):
            positions = points.get(style, np.empty((0, 2)))
            positions = positions[np.isfinite(positions).all(axis=1)]
            scatter.setData(*positions.T)
            scatter.setVisible(len(positions) > 0)


# The tooltip of a reading: number, heading, measured and predicted range, residual and class.


def reading_tip(shown: Shown, index: int) -> str:
    """Return the tooltip of a reading, a few short lines."""
    reading, row = shown.readings[index], shown.row(index)
    lines = [f"reading {index} at {heading_text(shown.heading(index))}"]
    lines.append(f"{shown.origin} {_length(reading.range, shown.look.unit)}")
    if row is not None:
        lines.append(f"predicted {_length(row.predicted, shown.look.unit)}")
        if row.residual is not None:
            unit = shown.look.unit.small
            lines.append(f"residual {unit.signed(row.residual)} {unit.label}")
        if row.kind in MARKS:
            lines.append(f"{MARKS[row.kind].name}: {MARKS[row.kind].meaning}")
    if note := shown.notes.of(index):
        lines.append(f"note: {note}")
    return "\n".join(lines)


def _length(distance: float | None, unit: LengthUnit) -> str:
    return "no echo" if distance is None else unit.text(distance)
