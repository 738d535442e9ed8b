"""The symbol of notes: a sheet of paper with a folded corner, in the upper right quarter of its square.

The mark of the reading is in the middle of the square.
"""

from PySide6.QtCore import QPointF
from PySide6.QtGui import QPainterPath, QPolygonF

NOTE_SIZE = 30  # pixels, of the square
_SHEET = (0.14, -0.48), (0.36, -0.48), (0.48, -0.36), (0.48, -0.1), (0.14, -0.1), (0.14, -0.48)
_FOLD = (0.36, -0.48), (0.36, -0.36), (0.48, -0.36)


def note_symbol() -> QPainterPath:
    """Return the symbol, in a square of side 1 about the origin."""
    path = QPainterPath()
    for corners in (_SHEET, _FOLD):
        path.addPolygon(QPolygonF([QPointF(*corner) for corner in corners]))
    return path
