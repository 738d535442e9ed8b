"""Arrows at the edge of the plan towards readings outside the visible part, with their distance from the sensor.

Each arrow lies on the line from the sensor to its reading, so the arrow of the selected reading lies on the beam.
"""

from dataclasses import dataclass

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import QPointF, QRectF, QSizeF, Qt
from PySide6.QtGui import QColor, QFont, QFontMetricsF, QPainter, QPen, QPolygonF
from sonarhw_compare.scans import heading_text

from sonarhw.readings import FloatArray
from sonarhw_gui.look.appearance import Look
from sonarhw_gui.look.palette import Class
from sonarhw_gui.look.theme import text_font
from sonarhw_gui.plots.marks import Placed

_INSET = 9.0  # pixels, from the edge to the middle of an arrow
_ARROW, _HALF_WIDTH, _GAP = 8.0, 5.5, 3.0  # pixels: half of its length and width, and the gap before its text
_APART = 72.0  # pixels between two arrows at least; readings between them share one
_PICK = 16.0  # pixels
PixelPoint = tuple[float, float]


@dataclass(frozen=True)
class EdgeArrow:
    """One arrow: the nearest of its readings, or the selected one."""

    reading: int
    kind: Class
    at: PixelPoint  # of its middle, from the upper left corner of the plot
    towards: PixelPoint  # unit vector
    distance: float  # m, from the sensor
    heading: float  # rad, from the sensor
    count: int  # readings that share it


def edge_arrows(
    placed: dict[Class, Placed], seen: QRectF, size: PixelPoint, sensor: PixelPoint, chosen: int | None
) -> list[EdgeArrow]:
    """Return arrows towards the readings outside the area `seen`, m, of a plot of `size` pixels."""
    if not placed or min(size) <= 4 * _INSET:
        return []
    kinds = [kind for kind, (points, _) in placed.items() for _ in points.readings]
    numbers = np.array([number for points, _ in placed.values() for number in points.readings])
    places = np.vstack([positions for _, positions in placed.values()])
    scale = size[0] / seen.width(), size[1] / seen.height()
    pixels = np.column_stack(((places[:, 0] - seen.left()) * scale[0], (seen.bottom() - places[:, 1]) * scale[1]))
    outside = np.flatnonzero(~((pixels >= 0) & (pixels <= size)).all(axis=1))
    if not len(outside):
        return []
    origin = (sensor[0] - seen.left()) * scale[0], (seen.bottom() - sensor[1]) * scale[1]
    at, towards = _at_edge(pixels[outside], np.array(size), np.array(origin))
    along = places[outside] - sensor
    away, headings = np.hypot(*along.T), np.arctan2(along[:, 1], along[:, 0])
    order = np.lexsort((away, numbers[outside] != chosen))  # the selected reading first, then the nearest ones
    arrows: list[EdgeArrow] = []
    taken = np.full(len(outside), False)
    for k in order.tolist():
        if taken[k]:
            continue
        near = ~taken & (np.hypot(*(at - at[k]).T) < _APART)
        taken |= near
        index = int(outside[k])
        arrows.append(
            EdgeArrow(
                int(numbers[index]),
                kinds[index],
                tuple(at[k]),
                tuple(towards[k]),
                float(away[k]),
                float(headings[k]),
                int(near.sum()),
            )
        )
    return arrows


def _at_edge(pixels: FloatArray, size: FloatArray, origin: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return where the lines from `origin` to `pixels` (n, 2) leave the plot, and their directions.

    If `origin` is not in the plot, the lines begin in its middle.
    """
    if not ((origin > _INSET) & (origin < size - _INSET)).all():
        origin = size / 2
    along = pixels - origin
    room = np.where(along > 0, size - _INSET - origin, origin - _INSET)
    share = (room / np.maximum(np.abs(along), 1e-9)).min(axis=1)
    return origin + share[:, None] * along, along / np.hypot(*along.T)[:, None]


def _beside(at: PixelPoint, size: QSizeF, whole: QRectF) -> tuple[QRectF, QRectF]:
    """Return the areas on both sides of an arrow for a text of this size.

    They lie along the edge, in the margin around the room: farther inwards the text would cover walls and readings.
    """
    (x, y), width, height = at, size.width(), size.height()
    right, below = whole.width() - width - 1, whole.height() - height - 1
    apart = _ARROW + _GAP
    if min(x, whole.width() - x) < min(y, whole.height() - y):
        left = 1.0 if x < whole.width() / 2 else right
        return QRectF(QPointF(left, y + apart), size), QRectF(QPointF(left, y - apart - height), size)
    top = 1.0 if y < whole.height() / 2 else below
    return QRectF(QPointF(x + apart, top), size), QRectF(QPointF(x - apart - width, top), size)


class EdgeArrows(pg.GraphicsObject):  # type: ignore[misc]  # pyqtgraph has no types
    """Draws the arrows in front of a view box, in pixels."""

    def __init__(self, box: pg.ViewBox) -> None:
        super().__init__()
        self.arrows: list[EdgeArrow] = []
        self._box = box
        self._look = Look()
        self._font = QFont()
        self._placed: dict[Class, Placed] = {}
        self._sensor: PixelPoint = (0.0, 0.0)
        self._chosen: int | None = None
        self.setParentItem(box)
        self.setZValue(1000)
        box.sigRangeChanged.connect(self._lay_out)
        box.sigResized.connect(self._lay_out)

    def set_look(self, look: Look) -> None:
        """Use the colours, unit and text size of `look`."""
        self._look, self._font = look, text_font(look, 0.8)
        self.update()

    def draw(self, placed: dict[Class, Placed], sensor: PixelPoint, chosen: int | None) -> None:
        """Draw the arrows of these readings."""
        self._placed, self._sensor, self._chosen = placed, sensor, chosen
        self._lay_out()

    def reading_at(self, position: QPointF) -> int | None:
        """Return the reading of the arrow at a point in scene coordinates; None if there is none."""
        at = self.mapFromScene(position)
        near = [(abs(at.x() - x) + abs(at.y() - y), arrow.reading) for arrow in self.arrows for x, y in (arrow.at,)]
        away, reading = min(near, default=(_PICK + 1, None))
        return reading if away <= _PICK else None

    def text(self, arrow: EdgeArrow) -> str:
        """Return the text beside an arrow."""
        unit = self._look.unit
        distance = f"{unit.of(arrow.distance):.{max(unit.decimals - 2, 0)}f} {unit.label}"  # short: it covers the plan
        at = f"{heading_text(arrow.heading)}: " if arrow.reading == self._chosen else ""
        return f"{at}{distance}" if arrow.count == 1 else f"{at}{distance} ×{arrow.count}"

    def boundingRect(self) -> QRectF:
        """Return the area of the plot."""
        return QRectF(0, 0, self._box.width(), self._box.height())

    def text_areas(self) -> list[tuple[EdgeArrow, QRectF]]:
        """Return the arrows with a text, and its area. Texts overlap neither texts nor arrows; the first arrow wins."""
        metrics, whole = QFontMetricsF(self._font), self.boundingRect()
        taken = [QRectF(x - _ARROW, y - _ARROW, 2 * _ARROW, 2 * _ARROW) for x, y in (one.at for one in self.arrows)]
        found = []
        for arrow in self.arrows:
            size = metrics.boundingRect(self.text(arrow)).size() + QSizeF(4, 0)
            for area in _beside(arrow.at, size, whole):
                if whole.contains(area) and not any(map(area.intersects, taken)):
                    taken.append(area)
                    found.append((arrow, area))
                    break
        return found

    def paint(self, painter: QPainter, *_: object) -> None:
        """Draw the arrows, and the texts that do not overlap; the selected reading comes first."""
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setFont(self._font)
        for arrow in self.arrows:
            self._paint_arrow(painter, arrow)
        for arrow, area in self.text_areas():
            painter.fillRect(area, QColor(self._look.palette.paper))
            painter.setPen(QColor(self._look.palette.ink))
            painter.drawText(area, Qt.AlignmentFlag.AlignCenter, self.text(arrow))

    def _paint_arrow(self, painter: QPainter, arrow: EdgeArrow) -> None:
        colours, along = self._look.palette, QPointF(*arrow.towards)
        across, tip = QPointF(-along.y(), along.x()) * _HALF_WIDTH, QPointF(*arrow.at) + along * _ARROW
        back = tip - along * 2 * _ARROW
        chosen = arrow.reading == self._chosen
        painter.setPen(QPen(QColor(colours.chosen if chosen else colours.paper), 2.0 if chosen else 1.0))
        painter.setBrush(QColor(colours.of(arrow.kind)))
        painter.drawPolygon(QPolygonF([tip, back + across, back - across]))

    def _lay_out(self) -> None:
        (left, right), (low, high) = self._box.viewRange()
        seen = QRectF(left, low, right - left, high - low)
        self.arrows = edge_arrows(
            self._placed, seen, (self._box.width(), self._box.height()), self._sensor, self._chosen
        )
        self.setVisible(bool(self.arrows))
        self.update()
