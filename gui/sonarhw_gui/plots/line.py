"""A line that takes no time while it is empty."""

import numpy as np
import pyqtgraph as pg
from numpy.typing import ArrayLike


class Line(pg.PlotCurveItem):  # type: ignore[misc]  # pyqtgraph has no types
    """A curve. Qt skips it at repaints while it has no points, and setting no points again has no effect."""

    def __init__(self, **style: object) -> None:
        super().__init__(np.empty(0), np.empty(0), **style)
        self.setFlag(self.GraphicsItemFlag.ItemHasNoContents)

    def setData(self, x: ArrayLike = (), y: ArrayLike = (), **style: object) -> None:
        """Draw a line through these points, (n,) each."""
        count, before = np.size(x), 0 if self.xData is None else len(self.xData)
        if count or before or style:
            super().setData(np.asarray(x, float), np.asarray(y, float), **style)
        if bool(count) is not bool(before):
            self.setFlag(self.GraphicsItemFlag.ItemHasNoContents, not count)
