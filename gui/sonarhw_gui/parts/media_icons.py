"""Icons of the replay bar. Not every font has these symbols, and Qt's own icons are dark on dark."""

from collections.abc import Sequence

from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QIcon, QPainter, QPixmap, QPolygonF

_SIZE = 16  # pixels
Shape = Sequence[tuple[float, ...]]  # two corners of a bar, or three of a triangle, in sixteenths

PLAY: Shape = ((4, 2, 4, 14, 14, 8),)
PAUSE: Shape = ((3, 2, 6.5, 14), (9.5, 2, 13, 14))
STEP_FORTH: Shape = ((2, 3, 4.5, 13), (6.5, 3, 6.5, 13, 14, 8))
STEP_BACK: Shape = ((11.5, 3, 14, 13), (9.5, 3, 9.5, 13, 2, 8))
NEXT_SCAN: Shape = ((1, 3, 1, 13, 7, 8), (7, 3, 7, 13, 13, 8), (13, 3, 15, 13))
PREVIOUS_SCAN: Shape = ((15, 3, 15, 13, 9, 8), (9, 3, 9, 13, 3, 8), (1, 3, 3, 13))


def media_icon(shape: Shape, colour: str, faint: str, ratio: float) -> QIcon:
    """Return an icon in `colour`, and in `faint` when disabled; `ratio`: device pixels per pixel."""
    icon = QIcon(_drawn(shape, colour, ratio))
    icon.addPixmap(_drawn(shape, faint, ratio), QIcon.Mode.Disabled)
    return icon


def _drawn(shape: Shape, colour: str, ratio: float) -> QPixmap:
    picture = QPixmap(round(_SIZE * ratio), round(_SIZE * ratio))
    picture.setDevicePixelRatio(ratio)
    picture.fill(Qt.GlobalColor.transparent)
    with QPainter(picture) as painter:
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(QColor(colour))
        for part in shape:
            corners = [QPointF(*part[k : k + 2]) for k in range(0, len(part), 2)]
            if len(corners) == 2:
                painter.drawRect(QRectF(*corners))
            else:
                painter.drawPolygon(QPolygonF(corners))
    return picture
