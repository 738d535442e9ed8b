"""The legend: one line over all views, for the marks mean the same in each.

Takes the palette; a hand held over an entry says more.
"""

import pyqtgraph as pg
from pyqtgraph.graphicsItems.ScatterPlotItem import drawSymbol
from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QPainter, QPixmap
from PySide6.QtWidgets import QHBoxLayout, QLabel, QWidget

from compare.match import Kind
from gui.palette import BEAM, BLANKING, CHOSEN, MARKS, MEASURED, PREDICTED, THRESHOLD, Mark

_SIZE = 14  # pixels
_LINE = 26  # pixels


class Legend(QWidget):
    """What the marks and lines mean."""

    def __init__(self) -> None:
        super().__init__()
        row = QHBoxLayout(self)
        row.setContentsMargins(8, 2, 8, 2)
        row.setSpacing(5)
        for kind in Kind:
            if kind in MARKS:
                mark = MARKS[kind]
                _add(row, _mark_picture(mark, self.devicePixelRatioF()), f"measured: {mark.name}", mark.meaning)
        row.addStretch(1)
        for colour, style, name, meaning in _LINES:
            _add(row, _line_picture(colour, style, self.devicePixelRatioF()), name, meaning)
        for colour, name, meaning in _PATCHES:
            _add(row, _patch_picture(colour, self.devicePixelRatioF()), name, meaning)


_LINES = (
    (MEASURED, Qt.PenStyle.SolidLine, "measured trace", "the receive signal that the board recorded"),
    (PREDICTED, Qt.PenStyle.SolidLine, "predicted", "what the model says the board reports; in the trace view dashed"),
    (THRESHOLD, Qt.PenStyle.DashLine, "threshold", "echoes fainter than this are not heard"),
    (CHOSEN, Qt.PenStyle.SolidLine, "rays", "the path of the chosen reading by bounce; dotted: expected, not measured"),
)

_PATCHES = (
    (BEAM, "beam", "within it the sound has over half its power"),
    (BLANKING, "blanking", "what arrives so early the board cannot hear"),
)


def _add(row: QHBoxLayout, picture: QPixmap, name: str, meaning: str) -> None:
    for label in (QLabel(pixmap=picture), QLabel(name)):
        label.setToolTip(meaning)
        row.addWidget(label)
    row.addSpacing(9)


def _blank(width: int, height: int, ratio: float) -> QPixmap:
    picture = QPixmap(round(width * ratio), round(height * ratio))
    picture.setDevicePixelRatio(ratio)
    picture.fill(Qt.GlobalColor.transparent)
    return picture


def _mark_picture(mark: Mark, ratio: float) -> QPixmap:
    picture = _blank(_SIZE, _SIZE, ratio)
    with QPainter(picture) as painter:
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.translate(QPointF(_SIZE / 2, _SIZE / 2))
        drawSymbol(painter, mark.symbol, 10, pg.mkPen(None), pg.mkBrush(mark.colour))
    return picture


def _line_picture(colour: str, style: Qt.PenStyle, ratio: float) -> QPixmap:
    picture = _blank(_LINE, _SIZE, ratio)
    with QPainter(picture) as painter:
        painter.setPen(pg.mkPen(colour, width=1 if style == Qt.PenStyle.DashLine else 2, style=style))
        painter.drawLine(QPointF(0, _SIZE / 2), QPointF(_LINE, _SIZE / 2))
    return picture


def _patch_picture(colour: str, ratio: float) -> QPixmap:
    picture = _blank(_SIZE, _SIZE, ratio)
    with QPainter(picture) as painter:
        painter.fillRect(QRectF(0, 1, _SIZE, _SIZE - 2), QColor(colour))
    return picture
