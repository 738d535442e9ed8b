"""Small pictures of marks, lines and areas, for the legend, lists and the help page."""

from collections.abc import Callable

import pyqtgraph as pg
from pyqtgraph.graphicsItems.ScatterPlotItem import drawSymbol
from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QBrush, QColor, QPainter, QPainterPath, QPen, QPixmap

from sonarhw_gui.look.note_symbol import NOTE_SIZE, note_symbol
from sonarhw_gui.look.palette import MARKS, Class, Palette
from sonarhw_gui.parts.eye import EYE_WIDTH, draw_eye

Picture = Callable[[Palette, float], QPixmap]  # palette, device pixels per pixel
_SIZE = 14  # pixels
_LINE = 26  # pixels
_MIDDLE = QPointF(_SIZE / 2, _SIZE / 2)
_NOTE_AT = QPointF(-2.3, 15.7)  # the symbol is in the upper right quarter of its square
SWITCH_SIZE = QSize(round(EYE_WIDTH) + _SIZE, _SIZE)  # of `switch_picture` with a mark
_FADED = 0.4  # opacity


def switch_picture(picture: Picture, colours: Palette, ratio: float, visible: bool) -> QPixmap:
    """Return an eye, open or struck out, beside the mark or line that it shows or hides."""
    drawn = picture(colours, ratio)
    width, height = drawn.deviceIndependentSize().width(), _SIZE
    both = _blank(round(EYE_WIDTH + width), height, ratio)
    with QPainter(both) as painter:
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        draw_eye(painter, colours.ink if visible else colours.faint, height / 2, visible)
        painter.setOpacity(1.0 if visible else _FADED)
        painter.drawPixmap(QPointF(EYE_WIDTH, 0.0), drawn)
    return both


def no_picture(colours: Palette, ratio: float) -> QPixmap:
    """Return an empty picture, for a class without a mark."""
    return _blank(1, _SIZE, ratio)


def mark_picture(kind: Class, colours: Palette, ratio: float) -> QPixmap:
    """Return the mark of a class."""
    colour, mark = colours.of(kind), MARKS[kind]
    pen, brush = (pg.mkPen(colour, width=1.3), None) if mark.hollow else (None, colour)
    return _symbol(mark.symbol, 10, pg.mkPen(pen), pg.mkBrush(brush), ratio)


def filled_picture(symbol: str, colours: Palette, ratio: float) -> QPixmap:
    """Return a symbol in the colour of text."""
    return _symbol(symbol, 11, pg.mkPen(None), pg.mkBrush(colours.ink), ratio)


def outline_picture(symbol: str, size: int, colour: str, width: float, colours: Palette, ratio: float) -> QPixmap:
    """Return the outline of a symbol; `colour` is a field of the palette."""
    return _symbol(symbol, size, pg.mkPen(getattr(colours, colour), width=width), pg.mkBrush(None), ratio)


def note_picture(colours: Palette, ratio: float) -> QPixmap:
    """Return the symbol of a note."""
    pen = pg.mkPen(colours.note_ink, width=1)
    return _symbol(note_symbol(), NOTE_SIZE, pen, pg.mkBrush(colours.note_paper), ratio, _NOTE_AT)


def line_picture(colour: str, style: Qt.PenStyle, width: float, colours: Palette, ratio: float) -> QPixmap:
    """Return a piece of a line; `colour` is a field of the palette."""
    picture = _blank(_LINE, _SIZE, ratio)
    with QPainter(picture) as painter:
        painter.setPen(pg.mkPen(getattr(colours, colour), width=ratio * width, style=style))
        painter.drawLine(QPointF(0, _SIZE / 2), QPointF(_LINE, _SIZE / 2))
    return picture


def tick_picture(colours: Palette, ratio: float) -> QPixmap:
    """Return the short line at the sensor."""
    picture = _blank(_SIZE, _SIZE, ratio)
    with QPainter(picture) as painter:
        painter.setPen(pg.mkPen(colours.ink, width=2.5 * ratio))
        painter.drawLine(QPointF(1, _SIZE / 2), QPointF(_SIZE - 1, _SIZE / 2))
    return picture


def patch_picture(colour: str, colours: Palette, ratio: float) -> QPixmap:
    """Return a piece of an area; `colour` is a field of the palette."""
    picture = _blank(_SIZE, _SIZE, ratio)
    with QPainter(picture) as painter:
        painter.setPen(QColor(colours.faint))  # a patch without a frame is hardly visible in the dark palette
        painter.setBrush(QColor(getattr(colours, colour)))
        painter.drawRect(QRectF(0.5, 1.5, _SIZE - 1, _SIZE - 3))
    return picture


def _symbol(
    symbol: str | QPainterPath, size: int, pen: QPen, brush: QBrush, ratio: float, middle: QPointF = _MIDDLE
) -> QPixmap:
    picture = _blank(_SIZE, _SIZE, ratio)
    with QPainter(picture) as painter:
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.translate(middle)
        drawSymbol(painter, symbol, size, pen, brush)
    return picture


def _blank(width: int, height: int, ratio: float) -> QPixmap:
    picture = QPixmap(round(width * ratio), round(height * ratio))
    picture.setDevicePixelRatio(ratio)
    picture.fill(Qt.GlobalColor.transparent)
    return picture
