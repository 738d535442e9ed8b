"""Which drawn reading a click means.

Takes the readings of a view as points and a click; hands on the index of the nearest reading on the screen.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pyqtgraph as pg
from pyqtgraph.GraphicsScene.mouseEvents import MouseClickEvent
from PySide6.QtCore import QPointF, Qt

from sonarhw.readings import FloatArray
from sonarhw_gui.shown.shown import ClassPoints

REACH = 14.0  # pixels


def nearest_reading(
    view: pg.ViewBox, drawn: Mapping[Any, tuple[ClassPoints, FloatArray]], click: QPointF, reach: float = REACH
) -> int | None:
    """The reading whose point lies nearest to `click` (scene coordinates); None where none is within `reach` pixels.

    `drawn` holds for every class its readings and where they are drawn, (n, 2) in the view's coordinates.
    """
    at = view.mapSceneToView(click)
    size = np.array([abs(length) for length in view.viewPixelSize()])
    best, nearest = None, reach
    for points, places in drawn.values():
        away = np.hypot(*((places - (at.x(), at.y())) / size).T)
        k = int(np.nanargmin(away))
        if away[k] <= nearest:
            best, nearest = points.readings[k], float(away[k])
    return best


def is_plain_click(event: MouseClickEvent) -> bool:
    """Whether a click of pyqtgraph's scene is one with the left button; a mark under it may have taken it already."""
    return bool(event.button() == Qt.MouseButton.LeftButton)
