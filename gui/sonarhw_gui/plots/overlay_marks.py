"""The marks of scans that are drawn over the one shown: a colour and an outlined shape for each."""

from functools import cached_property

import numpy as np
import pyqtgraph as pg

from sonarhw.readings import FloatArray
from sonarhw_gui.look.palette import OVERLAYS
from sonarhw_gui.plots.plot_look import cosmetic_pen
from sonarhw_gui.plots.spots import Spots

_SIZE = 9  # pixels
_BELOW_MARKS = 5  # z value


class OverlayMarks:
    """One scatter for each style, from the first scan on: empty items take time at each move of the mouse."""

    def __init__(self, plot: pg.PlotItem) -> None:
        self._plot = plot

    @cached_property
    def scatters(self) -> list[Spots]:
        """The scatters, by style."""
        scatters = [Spots(size=_SIZE, symbol=overlay.symbol, brush=None) for overlay in OVERLAYS]
        for scatter, overlay in zip(scatters, OVERLAYS, strict=True):
            scatter.setZValue(_BELOW_MARKS)
            scatter.setPen(cosmetic_pen(overlay.colour, width=1.5))
            self._plot.addItem(scatter, ignoreBounds=True)
        return scatters

    @property
    def _made(self) -> bool:
        return "scatters" in vars(self)

    def set_look(self) -> None:
        """Use the width of lines of the screen."""
        if self._made:
            for scatter, overlay in zip(self.scatters, OVERLAYS, strict=True):
                scatter.setPen(cosmetic_pen(overlay.colour, width=1.5))

    def draw(self, points: dict[int, FloatArray]) -> None:
        """Draw the points of each style, (n, 2) in plot coordinates; NaN is not drawn."""
        for style, scatter in enumerate(self.scatters if points or self._made else ()):
            at = points.get(style, np.empty((0, 2)))
            at = at[np.isfinite(at).all(axis=1)]
            scatter.setData(*at.T)
            scatter.setVisible(len(at) > 0)
