"""The eye of a layer in a list: open while the layer is visible, struck out while it is hidden."""

from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QPainter, QPainterPath, QPen

EYE_WIDTH = 13.0  # pixels, with the gap beside it
_HALF, _LID = 5.0, 4.6  # pixels, half of its width and height of the lids' control points


def draw_eye(painter: QPainter, colour: str, middle: float, visible: bool) -> None:
    """Draw an eye at the left edge, with its middle at height `middle`."""
    centre = QPointF(_HALF + 0.5, middle)
    left, right = centre - QPointF(_HALF, 0), centre + QPointF(_HALF, 0)
    lids = QPainterPath(left)
    lids.quadTo(centre - QPointF(0, 2 * _LID - 2), right)
    lids.quadTo(centre + QPointF(0, 2 * _LID - 2), left)
    painter.setPen(QPen(QColor(colour), 1.0))
    painter.setBrush(Qt.BrushStyle.NoBrush)
    painter.drawPath(lids)
    painter.setBrush(QColor(colour))
    painter.drawEllipse(QRectF(centre.x() - 1.3, centre.y() - 1.3, 2.6, 2.6))
    if not visible:
        painter.drawLine(centre + QPointF(-4.0, 4.5), centre + QPointF(4.0, -4.5))
