"""A scatter plot that is fast enough for 30 repaints per second.

It caches bounds and screen positions between repaints, because computing them takes longer than drawing.
"""

import pyqtgraph as pg
from PySide6.QtCore import QRectF
from PySide6.QtGui import QPainter, QTransform
from PySide6.QtWidgets import QStyleOptionGraphicsItem, QWidget


class Spots(pg.ScatterPlotItem):  # type: ignore[misc]  # pyqtgraph has no types
    """A scatter with cached bounds. pyqtgraph replaces the list `bounds` when spots, their style or the zoom change."""

    def __init__(self, *args: object, **options: object) -> None:
        self._around: tuple[object, QRectF] = (None, QRectF())  # with the `bounds` it was computed for
        self._painted: tuple[object, QTransform | None] = (None, None)  # likewise
        super().__init__(*args, **options)

    def boundingRect(self) -> QRectF:
        """Return the area of the spots, including their size in pixels."""
        if self._around[0] is not self.bounds:
            self._around = self.bounds, super().boundingRect()
        return self._around[1]

    def paint(self, painter: QPainter, option: QStyleOptionGraphicsItem, widget: QWidget | None) -> None:
        """Draw the spots, from the cache if nothing has moved."""
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
