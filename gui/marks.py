"""The marks of one view, the outline and a scatter for every class: same mark, same colour, everywhere.

Takes a plot; hands on the scatters in it, and their tooltips.
"""

from collections.abc import Callable

import pyqtgraph as pg
from PySide6.QtWidgets import QGraphicsView

from compare.match import Kind
from gui.palette import MARKS, Palette, Unclassed
from gui.shown import ClassPoints
from sonarhw.readings import FloatArray

_SIZE = 9
# scatters tell Qt less of what they leave than of what they draw: repainting by parts would let old points stand
WHOLE = QGraphicsView.ViewportUpdateMode.FullViewportUpdate
_RING = 16
Placed = tuple[ClassPoints, FloatArray]


def outline_item() -> pg.PlotDataItem:
    """What is predicted: points and a thin line, broken where no echo is predicted."""
    return pg.PlotDataItem(symbol="o", symbolSize=3, symbolPen=None, connect="finite")


def dress_outline(outline: pg.PlotDataItem, colours: Palette) -> None:
    """Draw an outline in the colour of what is predicted."""
    outline.setPen(pg.mkPen(colours.predicted, width=1))
    outline.setSymbolBrush(colours.predicted)


class ReadingMarks:
    """One scatter a class, and a ring round the chosen reading."""

    def __init__(self, plot: pg.PlotItem, tip: Callable[[int], str]) -> None:
        self.placed: dict[Kind | Unclassed, Placed] = {}
        self._scatters = {kind: _scatter(kind, tip) for kind in MARKS}
        self._ring = pg.ScatterPlotItem(size=_RING, symbol="o", brush=None)
        for z, scatter in enumerate((*self._scatters.values(), self._ring)):
            scatter.setZValue(10 + z)
            plot.addItem(scatter)

    def dress(self, colours: Palette) -> None:
        """Draw in these colours from now on."""
        for kind, scatter in self._scatters.items():
            scatter.setPen(pg.mkPen(colours.paper, width=1))
            scatter.setBrush(pg.mkBrush(colours.of(kind)))
        self._ring.setPen(pg.mkPen(colours.chosen, width=2))

    def draw(self, placed: dict[Kind | Unclassed, Placed]) -> None:
        """Draw the readings of each class at their places, (n, 2) in the plot's coordinates."""
        for kind, scatter in self._scatters.items():
            if kind in placed:
                points, places = placed[kind]
                scatter.setData(*places.T, data=points.readings)
            else:
                scatter.clear()
        self.placed = placed

    def ring(self, chosen: int | None) -> None:
        """Draw the ring round one reading; none where that is not drawn."""
        for points, places in self.placed.values():
            if chosen in points.readings:
                self._ring.setData(*places[[points.readings.index(chosen)]].T)
                return
        self._ring.clear()


def _scatter(kind: Kind | Unclassed, tip: Callable[[int], str]) -> pg.ScatterPlotItem:
    return pg.ScatterPlotItem(size=_SIZE, symbol=MARKS[kind].symbol, hoverable=True, tip=lambda x, y, data: tip(data))
