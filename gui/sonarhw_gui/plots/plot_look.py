"""How plots look: axes, grid and labels in the palette, unit and text size of a look.

Takes a plot and a `Look`; changes the plot. What is drawn in it stays in metres: only its axes are written in the unit.
"""

from typing import cast

import pyqtgraph as pg
from PySide6.QtCore import Qt
from PySide6.QtGui import QGuiApplication, QPen
from PySide6.QtWidgets import QGraphicsItem

from sonarhw_gui.look.appearance import Look
from sonarhw_gui.look.theme import text_font

_AXES = ("left", "bottom", "right", "top")
# figures and grid take a third of a repaint, and change only with the zoom
_CACHED = QGraphicsItem.CacheMode.DeviceCoordinateCache


def cosmetic_pen(colour: str, width: float = 1.0, style: Qt.PenStyle = Qt.PenStyle.SolidLine) -> QPen:
    """A pen whose `width` stays while one zooms: in pixels of a usual screen, more of them on a finer one."""
    ratio = cast(QGuiApplication, QGuiApplication.instance()).devicePixelRatio()
    pen: QPen = pg.mkPen(colour, width=width * ratio, style=style)
    return pen


def style_plot(plot: pg.PlotItem, look: Look, grid: bool = True) -> None:
    """Give axes, their figures and the grid the colours and text size of a look."""
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


def label_axis(axis: pg.AxisItem, text: str) -> None:
    """A label of the axis in the colour that it was dressed in; its figures are written as they are."""
    # before prefixes are switched off they are worked out once more, and that would stay
    axis.setSIPrefixEnableRanges(())
    axis.enableAutoSIPrefix(False)
    axis.setLabel(text, siPrefixEnableRanges=(), **axis.labelStyle)


def label_length(axis: pg.AxisItem, what: str, look: Look) -> None:
    """An axis over metres, written in the look's unit."""
    axis.setScale(look.unit.per_metre)
    label_axis(axis, f"{what} ({look.unit.label})")
