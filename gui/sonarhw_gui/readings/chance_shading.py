"""Shading of the range view: ranges that the board may report, the more opaque, the more probable."""

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import QRectF
from PySide6.QtGui import QColor

from sonarhw_gui.work.outline_chances import OutlineChances

_BEHIND = -30  # z value, below grid, outline and marks
_LEAST = 0.01  # smaller opacities are not drawn


class ChanceShading(pg.ImageItem):  # type: ignore[misc]  # pyqtgraph has no types
    """An image of probabilities over heading and range in one colour; empty without probabilities."""

    def __init__(self) -> None:
        super().__init__(axisOrder="row-major")
        self.setZValue(_BEHIND)
        self.setVisible(False)

    def draw(self, chances: OutlineChances | None, colour: str) -> None:
        """Draw `chances` in `colour`; None: nothing."""
        self.setVisible(chances is not None)
        if chances is None:
            return
        shading = chances.shading
        count = len(shading.headings)
        # heading 0 again at 360°, so that both ends of the axis are shaded
        opacities = np.vstack((shading.opacities, shading.opacities[:1]))
        opacities = np.where(opacities < _LEAST, 0.0, opacities)
        pixels = np.empty((*opacities.T.shape, 4), dtype=np.uint8)
        shade = QColor(colour)
        pixels[..., :3] = shade.red(), shade.green(), shade.blue()
        pixels[..., 3] = np.round(255 * opacities.T)
        self.setImage(pixels, autoLevels=False)
        step = 360.0 / count
        self.setRect(QRectF(-step / 2, 0.0, 360.0 + step, shading.reach))
