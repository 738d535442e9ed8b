"""Find the drawn reading that is nearest to a click."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pyqtgraph as pg
from pyqtgraph.GraphicsScene.mouseEvents import MouseClickEvent
from PySide6.QtCore import QPointF, Qt

from sonarhw.readings import FloatArray
from sonarhw_gui.shown.shown import ClassPoints

PICK_DISTANCE = 14.0  # pixels


def nearest_reading(
    view: pg.ViewBox, drawn: Mapping[Any, tuple[ClassPoints, FloatArray]], click: QPointF, within: float = PICK_DISTANCE
) -> int | None:
    """Return the reading nearest to `click` (scene coordinates); None if no reading is within `within` pixels.

    `drawn` contains the readings of every class and their positions, (n, 2) float in view coordinates.
    """
    at = view.mapSceneToView(click)
    size = np.array([abs(length) for length in view.viewPixelSize()])
    best, nearest = None, within
    for points, positions in drawn.values():
        away = np.hypot(*((positions - (at.x(), at.y())) / size).T)
        k = int(np.nanargmin(away))
        if away[k] <= nearest:
            best, nearest = points.readings[k], float(away[k])
    return best


def is_plain_click(event: MouseClickEvent) -> bool:
    """Return whether the left button was clicked. A mark below may have accepted the event already."""
    return bool(event.button() == Qt.MouseButton.LeftButton)
