"""Appearance of plots: axes, grid and labels in the palette, unit and text size of a look.

Plot coordinates stay in metres; only the tick values of the axes use the unit.
"""

from typing import cast

import pyqtgraph as pg
from PySide6.QtCore import QRectF, Qt
from PySide6.QtGui import QGuiApplication, QPen
from PySide6.QtWidgets import QGraphicsItem, QGraphicsSceneMoveEvent, QGraphicsSceneResizeEvent

from sonarhw_gui.look.appearance import Look
from sonarhw_gui.look.theme import text_font

_AXES = ("left", "bottom", "right", "top")
# tick values and grid take a third of a repaint, and change only with the zoom
_CACHED = QGraphicsItem.CacheMode.DeviceCoordinateCache


class PlotAxis(pg.AxisItem):  # type: ignore[misc]  # pyqtgraph has no types
    """An axis that computes its area only when it may have changed: Qt asks for it seven times in each repaint."""

    def __init__(self, side: str) -> None:
        self._area: QRectF | None = None
        super().__init__(side)

    def boundingRect(self) -> QRectF:
        """Return the area of axis and grid."""
        if self._area is None:
            self._area = super().boundingRect()
        return self._area

    def prepareGeometryChange(self) -> None:
        """Note a change of grid or style."""
        self._area = None
        super().prepareGeometryChange()

    def resizeEvent(self, ev: QGraphicsSceneResizeEvent | None = None) -> None:
        """Note another size."""
        self._area = None
        super().resizeEvent(ev)

    def moveEvent(self, event: QGraphicsSceneMoveEvent) -> None:
        """Note another position, relative to that of the grid."""
        self._area = None
        super().moveEvent(event)

    def linkedViewChanged(self, view: pg.ViewBox, newRange: object = None) -> None:
        """Note another size of the grid."""
        self._area = None
        super().linkedViewChanged(view, newRange)


def cosmetic_pen(colour: str, width: float = 1.0, style: Qt.PenStyle = Qt.PenStyle.SolidLine) -> QPen:
    """Return a pen whose `width` does not depend on the zoom; in pixels, scaled on high-resolution screens."""
    ratio = cast(QGuiApplication, QGuiApplication.instance()).devicePixelRatio()
    pen: QPen = pg.mkPen(colour, width=width * ratio, style=style)
    return pen


def style_plot(plot: pg.PlotItem, look: Look, grid: bool = True) -> None:
    """Use the colours and text size of a look for axes, tick values and grid."""
    font = text_font(look, 0.9)
    for name in _AXES:
        axis = plot.getAxis(name)
        axis.setCacheMode(_CACHED)
        axis.setPen(cosmetic_pen(look.palette.ink))
        axis.setTextPen(look.palette.ink)
        axis.setStyle(tickFont=font)
        axis.label.setFont(font)
        axis.labelStyle = {"color": look.palette.ink}
    plot.showGrid(x=grid, y=grid, alpha=look.palette.grid_alpha)


def remove_prefixes(plot: pg.PlotItem) -> None:
    """Remove SI prefixes from all axes: they would scale tick values, and lay out a label with every change of zoom."""
    for name in _AXES:
        axis = plot.getAxis(name)
        # disabling the prefixes computes one last prefix, which would stay; without ranges there is none
        axis.setSIPrefixEnableRanges(())
        axis.enableAutoSIPrefix(False)


def label_axis(axis: pg.AxisItem, text: str) -> None:
    """Set the label of an axis, without SI prefixes."""
    axis.setLabel(text, siPrefixEnableRanges=(), **axis.labelStyle)


def label_length(axis: pg.AxisItem, what: str, look: Look) -> None:
    """Label an axis over metres in the unit of the look."""
    axis.setScale(look.unit.per_metre)
    label_axis(axis, f"{what} ({look.unit.label})")
