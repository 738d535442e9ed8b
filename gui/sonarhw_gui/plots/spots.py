"""Marks of a few pixels at many places, for plots that are painted thirty times a second.

Takes what pyqtgraph's scatter takes, and hands on the same; what has not moved since the last paint is not worked out
again: bounds and places on the screen cost more than drawing.
"""

import pyqtgraph as pg
from PySide6.QtCore import QRectF
from PySide6.QtGui import QPainter, QTransform
from PySide6.QtWidgets import QStyleOptionGraphicsItem, QWidget


class Spots(pg.ScatterPlotItem):  # type: ignore[misc]  # pyqtgraph has no types
    """A scatter that remembers; `bounds` is a new list whenever spots, their look or the zoom have changed."""

    def __init__(self, *args: object, **options: object) -> None:
        self._around: tuple[object, QRectF] = (None, QRectF())  # with the `bounds` that it is of
        self._painted: tuple[object, QTransform | None] = (None, None)  # likewise
        super().__init__(*args, **options)

    def boundingRect(self) -> QRectF:
        """Where the spots are, with the pixels round them."""
        if self._around[0] is not self.bounds:
            self._around = self.bounds, super().boundingRect()
        return self._around[1]

    def paint(self, painter: QPainter, option: QStyleOptionGraphicsItem, widget: QWidget | None) -> None:
        """Draw them, as they were drawn before where nothing has moved."""
        if not len(self.data):
            return
        placing = painter.transform()
        on_screen = widget is not None and widget.devicePixelRatioF() == self.fragmentAtlas.devicePixelRatio()
        if on_screen and self._painted[0] is self.bounds and self._painted[1] == placing:
            painter.resetTransform()
            fragments = self._pixmapFragments.drawargs()
            painter.drawPixmapFragments(*fragments, self.fragmentAtlas.pixmap)  # type: ignore[call-arg]  # of C++
            return
        super().paint(painter, option, widget)
        self._painted = (self.bounds if on_screen else None), placing
