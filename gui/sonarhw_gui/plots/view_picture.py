"""Pictures of views with title and legend, as pixels or as SVG.

Drawing needs the window's thread. The results are plain arrays and text, which another thread writes to files.
"""

import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from typing import Any

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import QBuffer, QIODevice, QPoint, QRect, QRectF, QSize, Qt
from PySide6.QtGui import QBrush, QColor, QImage, QPainter
from PySide6.QtSvg import QSvgGenerator
from PySide6.QtWidgets import QGraphicsItem, QWidget

from sonarhw_gui.look.appearance import Look
from sonarhw_gui.parts.pixels import Pixels
from sonarhw_gui.parts.plain_label import PlainLabel
from sonarhw_gui.plots.legend import Legend
from sonarhw_gui.shown.bounces import bounces_text
from sonarhw_gui.shown.shown import Shown

_SVG_RESOLUTION = 96  # pixels per inch, the SVG standard
_RATIO = 2  # picture pixels per screen pixel, for print


def png_pixels(widget: QWidget, title: str, shown: Shown) -> Pixels:
    """Return the pixels of the view with title and legend; without a title, the widget alone."""
    with _with_legend(widget, title, shown) as parts:
        size = _size(parts) * _RATIO
        image = QImage(size, QImage.Format.Format_RGBA8888)
        image.fill(QColor(shown.look.palette.paper))
        image.setDevicePixelRatio(_RATIO)
        with QPainter(image) as painter:
            _draw(painter, parts)
    rows = np.frombuffer(image.constBits(), np.uint8).reshape(size.height(), image.bytesPerLine())
    return rows[:, : 4 * size.width()].reshape(size.height(), size.width(), 4).copy()


def svg_text(widget: QWidget, title: str, shown: Shown) -> str:
    """Return the view with title and legend as SVG. `sonarhw_gui.store.svg_strokes` corrects Qt's line widths in it.

    Qt's generator does not clip, so the content of each plot is a nested SVG element.
    """
    boxes = [box for view in _graphics_views(widget) for box in _items(view, pg.ViewBox)]
    with _with_legend(widget, title, shown) as parts, _faded([box.childGroup for box in boxes]):
        size = _size(parts)
        whole = _svg(QRect(QPoint(0, 0), size), shown.look, partial(_draw, parts=parts))
    below = size.height() - widget.height()
    insets = []
    for view in _graphics_views(widget):
        offset = (QPoint(0, 0) if view is widget else view.mapTo(widget, QPoint(0, 0))) + QPoint(0, below)
        with _faded(_items(view, pg.AxisItem)):
            insets += [_inset(view, box, offset) for box in _items(view, pg.ViewBox)]
    return whole.replace("</svg>", "".join((*insets, "</svg>")))


def _inset(view: pg.GraphicsView, box: pg.ViewBox, offset: QPoint) -> str:
    """Return the content of a view box as an element that clips it."""
    seen = view.mapFromScene(box.sceneBoundingRect()).boundingRect()
    drawn = _svg(QRect(QPoint(0, 0), seen.size()), None, lambda painter: _draw_seen(painter, view, seen))
    at = offset + seen.topLeft()
    place = f'x="{at.x()}" y="{at.y()}" width="{seen.width()}" height="{seen.height()}" overflow="hidden"'
    return re.sub(r'<svg width="[^"]*" height="[^"]*"', f"<svg {place}", drawn[drawn.index("<svg") :], count=1)


def _draw_seen(painter: QPainter, view: pg.GraphicsView, seen: QRect) -> None:
    paper = view.backgroundBrush()
    view.setBackgroundBrush(QBrush())  # the grid is drawn below
    try:
        view.render(painter, QRectF(QPoint(0, 0), seen.size()), seen)
    finally:
        view.setBackgroundBrush(paper)


def _svg(area: QRect, look: Look | None, draw: Callable[[QPainter], None]) -> str:
    buffer, generator = QBuffer(), QSvgGenerator()
    buffer.open(QIODevice.OpenModeFlag.WriteOnly)
    generator.setOutputDevice(buffer)
    generator.setSize(area.size())
    generator.setViewBox(area)
    generator.setResolution(_SVG_RESOLUTION)
    with QPainter(generator) as painter:
        if look is not None:
            painter.fillRect(area, QColor(look.palette.paper))
        draw(painter)
    return bytes(buffer.data().data()).decode()


def _graphics_views(widget: QWidget) -> list[pg.GraphicsView]:
    inside = [view for view in widget.findChildren(pg.GraphicsView) if view.isVisibleTo(widget)]
    return [widget, *inside] if isinstance(widget, pg.GraphicsView) else inside


def _items(view: pg.GraphicsView, kind: type[QGraphicsItem]) -> list[Any]:
    return [item for item in view.scene().items() if isinstance(item, kind) and item.isVisible()]


@contextmanager
def _faded(items: Sequence[QGraphicsItem]) -> Iterator[None]:
    """Make items invisible for a while, without signals to their observers."""
    before = [item.opacity() for item in items]
    for item in items:
        item.setOpacity(0.0)
    try:
        yield
    finally:
        for item, opacity in zip(items, before, strict=True):
            item.setOpacity(opacity)


@contextmanager
def _with_legend(widget: QWidget, title: str, shown: Shown) -> Iterator[Sequence[QWidget]]:
    """Return the parts of a picture from top to bottom; those that are not `widget` are deleted afterwards."""
    added = _title_and_legend(title, widget.width(), shown) if title else []
    try:
        yield *added, widget
    finally:
        for part in added:
            part.deleteLater()  # no parent deletes it, and its connections would keep it


def _title_and_legend(title: str, width: int, shown: Shown) -> list[QWidget]:
    head, legend = PlainLabel(title), Legend(shown.hidden, switches=False)
    head.setContentsMargins(8, 6, 8, 2)
    legend.show_state(shown)
    legend.show_look(shown.look)
    parts: list[QWidget] = [head, legend]
    for text in filter(None, (shown.sentence if shown.chosen is not None else "", bounces_text(shown))):
        line = PlainLabel(text, wordWrap=True)
        line.setContentsMargins(8, 2, 8, 2)
        line.resize(width, line.heightForWidth(width))
        parts.append(line)
    head.resize(width, head.sizeHint().height())
    legend.resize(width, legend.heightForWidth(width))
    for part in parts:
        part.setAttribute(Qt.WidgetAttribute.WA_TranslucentBackground)
    return parts


def _size(parts: Sequence[QWidget]) -> QSize:
    return QSize(max(part.width() for part in parts), sum(part.height() for part in parts))


def _draw(painter: QPainter, parts: Sequence[QWidget]) -> None:
    top = 0
    for part in parts:
        painter.save()
        painter.translate(0, top)
        QWidget.render(part, painter, QPoint(0, 0))  # QGraphicsView.render would draw the scene only
        painter.restore()
        top += part.height()
