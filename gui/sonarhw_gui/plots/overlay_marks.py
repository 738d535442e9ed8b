"""The marks of scans that are drawn over the one shown: a colour and an outlined shape for each."""

import numpy as np
import pyqtgraph as pg

from sonarhw.readings import FloatArray
from sonarhw_gui.look.palette import OVERLAYS
from sonarhw_gui.plots.plot_look import cosmetic_pen
from sonarhw_gui.plots.spots import Spots

_SIZE = 9  # pixels
_BELOW_MARKS = 5  # z value


class OverlayMarks:
    """One scatter for each style."""

    def __init__(self, plot: pg.PlotItem) -> None:
        self.scatters = [Spots(size=_SIZE, symbol=overlay.symbol, brush=None) for overlay in OVERLAYS]
        for scatter in self.scatters:
            scatter.setZValue(_BELOW_MARKS)
            plot.addItem(scatter, ignoreBounds=True)

    def set_look(self) -> None:
        """Use the width of lines of the screen."""
        for scatter, overlay in zip(self.scatters, OVERLAYS, strict=True):
            scatter.setPen(cosmetic_pen(overlay.colour, width=1.5))

    def draw(self, points: dict[int, FloatArray]) -> None:
        """Draw the points of each style, (n, 2) in plot coordinates; NaN is not drawn."""
        for style, scatter in enumerate(self.scatters):
            at = points.get(style, np.empty((0, 2)))
            at = at[np.isfinite(at).all(axis=1)]
            scatter.setData(*at.T)
            scatter.setVisible(len(at) > 0)
