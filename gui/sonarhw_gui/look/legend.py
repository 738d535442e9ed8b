"""The legend above the views. Marks and colours mean the same in all views; tooltips explain each entry."""

from collections.abc import Callable
from functools import partial

import pyqtgraph as pg
from pyqtgraph.graphicsItems.ScatterPlotItem import drawSymbol
from PySide6.QtCore import QMargins, QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QPainter, QPixmap
from PySide6.QtWidgets import QHBoxLayout, QLabel, QWidget
from sonarhw_compare.matching.match import Kind

from sonarhw.readings import Origin
from sonarhw_gui.look.appearance import Look
from sonarhw_gui.look.palette import MARKS, Palette, Unclassed
from sonarhw_gui.parts.flow_layout import FlowLayout
from sonarhw_gui.parts.plain_label import PlainLabel

Picture = Callable[[Palette, float], QPixmap]  # palette, device pixels per pixel
ORIGIN = "ORIGIN"  # in a text, stands for the origin of the readings
_SIZE = 14  # pixels
_LINE = 26  # pixels


class Legend(QWidget):
    """Explains marks, lines and areas."""

    def __init__(self) -> None:
        super().__init__()
        self._pictures: list[tuple[QLabel, Picture]] = []
        self._named: list[tuple[QLabel, str]] = []  # texts with the origin of the readings
        row = FlowLayout(self, QMargins(8, 2, 8, 2), gap=14)
        for kind in Kind:
            if kind in MARKS:
                self._add(row, partial(mark_picture, kind), f"{ORIGIN}: {MARKS[kind].name}", MARKS[kind].meaning)
        for picture, name, meaning in _LINES_AND_PATCHES:
            self._add(row, picture, name, meaning)
        self.show_origin(Origin.MEASURED)

    def show_origin(self, origin: Origin) -> None:
        """Name the readings by their origin."""
        for label, text in self._named:
            label.setText(text.replace(ORIGIN, origin))

    def show_look(self, look: Look) -> None:
        """Use the colours of `look`."""
        for label, picture in self._pictures:
            label.setPixmap(picture(look.palette, self.devicePixelRatioF()))

    def _add(self, row: FlowLayout, picture: Picture, name: str, meaning: str) -> None:
        drawn = PlainLabel()
        self._pictures.append((drawn, picture))
        entry = QWidget()
        entry.setToolTip(meaning)
        pair = QHBoxLayout(entry)
        pair.setContentsMargins(0, 0, 0, 0)
        pair.setSpacing(5)
        named = PlainLabel(name)
        self._named.append((named, name))
        for label in (drawn, named):
            pair.addWidget(label)
        row.addWidget(entry)


def _blank(width: int, height: int, ratio: float) -> QPixmap:
    picture = QPixmap(round(width * ratio), round(height * ratio))
    picture.setDevicePixelRatio(ratio)
    picture.fill(Qt.GlobalColor.transparent)
    return picture


def mark_picture(kind: Kind | Unclassed, colours: Palette, ratio: float) -> QPixmap:
    """Return the mark of a class, for legends and lists."""
    picture = _blank(_SIZE, _SIZE, ratio)
    with QPainter(picture) as painter:
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.translate(QPointF(_SIZE / 2, _SIZE / 2))
        drawSymbol(painter, MARKS[kind].symbol, 10, pg.mkPen(None), pg.mkBrush(colours.of(kind)))
    return picture


def _line_picture(colour: str, style: Qt.PenStyle, colours: Palette, ratio: float) -> QPixmap:
    picture = _blank(_LINE, _SIZE, ratio)
    with QPainter(picture) as painter:
        width = ratio * (1 if style == Qt.PenStyle.DashLine else 2)
        painter.setPen(pg.mkPen(getattr(colours, colour), width=width, style=style))
        painter.drawLine(QPointF(0, _SIZE / 2), QPointF(_LINE, _SIZE / 2))
    return picture


def _patch_picture(colour: str, colours: Palette, ratio: float) -> QPixmap:
    picture = _blank(_SIZE, _SIZE, ratio)
    with QPainter(picture) as painter:
        painter.setPen(QColor(colours.faint))  # a patch without a frame is hardly visible in the dark palette
        painter.setBrush(QColor(getattr(colours, colour)))
        painter.drawRect(QRectF(0.5, 1.5, _SIZE - 1, _SIZE - 3))
    return picture


_SOLID, _DASHED = Qt.PenStyle.SolidLine, Qt.PenStyle.DashLine
_LINES_AND_PATCHES: tuple[tuple[Picture, str, str], ...] = (
    (partial(_line_picture, "measured", _SOLID), f"{ORIGIN} trace", "the received signal that the board recorded"),
    (
        partial(_line_picture, "predicted", _SOLID),
        "predicted",
        "the range or trace that the model predicts; dashed in the trace view",
    ),
    (partial(_line_picture, "threshold", _DASHED), "threshold", "detection threshold; weaker echoes are not detected"),
    (
        partial(_line_picture, "chosen", _SOLID),
        "rays",
        "the path of the selected reading, bounce by bounce; dotted: predicted, not measured",
    ),
    (partial(_patch_picture, "beam"), "beam", "directions with more than half of the power on the axis"),
    (partial(_patch_picture, "blanking"), "blanking", "the board does not detect echoes that arrive within this time"),
)
