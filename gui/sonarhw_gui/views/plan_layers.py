"""The layers of the plan: room, sensor, rays, readings, sound, found rooms and proposals."""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import QPointF, QRectF, QSizeF, Qt
from PySide6.QtGui import QColor, QFont, QFontMetricsF, QPainter, QPainterPath, QPen, QPolygonF
from PySide6.QtWidgets import QGraphicsPathItem
from sonarhw_compare.edits import Point, corners
from sonarhw_compare.sound import Pulse, counted_position, moment_at
from sonarhw_sim.room.room import Room

from sonarhw.errors import heading_text
from sonarhw.readings import FloatArray, points_at
from sonarhw_gui.model.look import Class, Look, ViewLayer
from sonarhw_gui.model.scene import beam_wedge, bounce_labels, half_power_angle, surface_outlines, wall_lines
from sonarhw_gui.model.shown import NO_POINTS, NOT_FOUND, FoundDrawing, Shown, TrackDrawing, chosen_path
from sonarhw_gui.model.theme import text_font
from sonarhw_gui.views.base import PlotLayer, cosmetic_pen, with_gaps
from sonarhw_gui.views.marks import Placed, PlotLine, Spots

if TYPE_CHECKING:
    from sonarhw_compare.rooms.outcome import NextPlace

# The layers of the plan: room, sensor with its beam, rays of one path, cursor and ruler.


_BEAM_LENGTH, _HANDLE, _ZERO = 0.3, 0.12, 0.05  # shares of the room's diagonal
_MOST_LABELLED = 9  # points; more labels would hide the rays
_AFTER, _BEFORE, _ABOVE, _BELOW = -0.1, 1.1, 1.3, -0.3  # anchors of labels, in units of their size
_ROWS = 4  # rows tried above and below a point for its label
_SENSOR = 14  # pixels
_NOTHING = np.empty((0, 2))


class RoomLayer(PlotLayer):
    """Walls and posts, the selected one thicker, and handles at the corners."""

    def __init__(self, plot: pg.PlotItem) -> None:
        super().__init__(plot)
        self.walls = self._add(PlotLine(connect="pairs"), pen="wall", width=2, bounds=True)
        self._posts = self._add(QGraphicsPathItem(), brush="wall", bounds=True)
        self._posts.setPen(pg.mkPen(None))
        self._chosen_wall = self._add(PlotLine(), pen="chosen", width=5)
        self._chosen_post = self._add(QGraphicsPathItem(), pen="chosen", width=4)
        over_readings = 20
        self._corners = self._add(Spots(size=8, symbol="s", brush=None), over_readings, "ink", bounds=True)

    def draw(self, room: Room | None, name: str | None, handles: bool) -> None:
        """Draw a room, with the surface `name` highlighted and, if `handles`, its corners."""
        chosen = room.names.index(name) if room and name in room.names else None
        self.walls.setData(*(wall_lines(room) if room else _NOTHING).T)
        self._posts.setPath(_posts_path(room.posts if room else np.empty((0, 3))))
        self._corners.setData(*(np.array(corners(room)) if room and handles else _NOTHING).T)
        self._corners.setVisible(handles)
        wall, post = _NOTHING, np.empty((0, 3))
        if room and chosen is not None and chosen < len(room.walls):
            wall = room.walls[chosen].reshape(2, 2)
        elif room and chosen is not None and chosen not in room.levels:
            post = room.posts[chosen - len(room.walls)][None]
        self._chosen_wall.setData(*wall.T)
        self._chosen_post.setPath(_posts_path(post))


class SensorLayer(PlotLayer):
    """The sensor, its zero, beam, direction and trajectory, and a cross at the pointer of another view."""

    def __init__(self, plot: pg.PlotItem) -> None:
        super().__init__(plot)
        self.handle_at: Point | None = None
        self.beam = self._add(PlotLine(pen=None, filled=True), -10, brush="beam")
        self._axis = self._add(PlotLine(), -9, "ink", style=Qt.PenStyle.DashLine)
        self._turntable = self._add(PlotLine(), -9, "faint", style=Qt.PenStyle.DotLine)
        self._trajectory = self._add(PlotLine(), 19, "ink", 1.5, bounds=True)
        self._zero = self._add(PlotLine(), 20, "ink", 2.5)
        self._start = self._add(Spots(size=9, symbol="o"), 20, "paper", brush="ink")  # of the trajectory
        # filled: the ring of the selected reading is hollow
        self._handle = self._add(Spots(size=11, symbol="o"), 21, "paper", brush="ink")
        self.spot = self._add(Spots(size=_SENSOR, symbol="d"), 22, "paper", brush="ink", bounds=True)
        self._cross = self._add(Spots(size=17, symbol="crosshair", brush=None), 25, "chosen")

    def draw(self, shown: Shown) -> None:
        """Draw the beam at the heading of the selected reading, and a dotted line at the newest heading.

        Without readings, the beam is at step 0.
        """
        scene, room, pose = shown.scene, shown.scene.room, shown.sensor
        self.spot.setData(*np.array([pose.position]).T)
        self._trajectory.setData(*(_NOTHING if shown.poses is None else shown.poses[:, :2]).T)
        wedge, axis, turntable, zero, self.handle_at = _NOTHING, _NOTHING, _NOTHING, _NOTHING, None
        if room is not None:
            newest = shown.heading(len(shown.readings) - 1) if shown.readings else pose.heading
            heading = newest if shown.due_heading is None else shown.due_heading
            size = math.hypot(*np.ptp(room.walls.reshape(-1, 2), axis=0))
            length, handle = _BEAM_LENGTH * size, _HANDLE * size
            wedge = beam_wedge(pose, heading, half_power_angle(scene.board, room), length)
            axis = points_at(pose.position, np.full(3, heading), np.array([0.0, handle, length]))
            if shown.poses is None:  # a trajectory is moved at its start
                self.handle_at = float(axis[1, 0]), float(axis[1, 1])
            zero = points_at(pose.position, np.full(2, pose.heading), np.array([0.0, _ZERO * size]))
            if newest != heading:
                turntable = points_at(pose.position, np.full(2, newest), np.array([0.0, handle]))
        self.beam.setData(*wedge.T)
        self.beam.setVisible(shown.draws(ViewLayer.BEAM))
        self._axis.setData(*axis.T)
        self._turntable.setData(*turntable.T)
        self._zero.setData(*zero.T)
        self._handle.setData(*(axis[1:2] if self.handle_at else _NOTHING).T)
        self._start.setData(*(_NOTHING if shown.poses is None else np.array([scene.pose.position])).T)

    def draw_cursor(self, shown: Shown) -> None:
        """Draw the cursor of another view, or hide it if there is none."""
        points, cursor = _NOTHING, shown.cursor
        if cursor is not None:
            points = points_at(shown.sensor.position, np.array([cursor.heading]), np.array([cursor.range]))
        _set(self._cross, points)  # hidden items take no time


class PathLayer(PlotLayer):
    """The path that explains the selected reading, numbered by bounce, and the path pointed at in a list."""

    def __init__(self, plot: pg.PlotItem) -> None:
        super().__init__(plot)
        self.rays = self._add(PlotLine(), bounds=True)
        self.pointed = self._add(PlotLine(), 28, "predicted", 3, bounds=True)
        self.labels = [self._add_label(30, "paper", "chosen", 0.8) for _ in range(_MOST_LABELLED)]
        for label in self.labels:
            label.setVisible(False)
        self._texts: list[tuple[str, FloatArray]] = []
        self._sensor: Point = (0.0, 0.0)
        self._colour = "k"
        self._drawn_with: tuple[str, Qt.PenStyle] | None = None  # colour and style of the rays
        plot.vb.sigRangeChanged.connect(self._lay_out)

    def set_look(self, look: Look) -> None:
        """Use the colours and sizes of `look`."""
        super().set_look(look)
        self._colour, self._drawn_with = look.palette.chosen, None  # the width depends on the screen

    def draw(self, shown: Shown) -> None:
        """Draw the path that explains the reading as a solid line, or else the predicted path as a dotted line."""
        path = chosen_path(shown) if shown.draws(ViewLayer.RAYS) else None
        points = _NOTHING if path is None else path.corners
        style = Qt.PenStyle.SolidLine if path is not None and path.explains else Qt.PenStyle.DotLine
        if (self._colour, style) != self._drawn_with:
            self._drawn_with = self._colour, style
            self.rays.setPen(cosmetic_pen(self._colour, width=1.5, style=style))
        self.rays.setData(*points.T)
        self._texts, self._sensor = bounce_labels(points), shown.sensor.position
        for k, label in enumerate(self.labels):
            label.setVisible(k < len(self._texts))
            if k < len(self._texts):
                label.setText(self._texts[k][0])
        question, pointed = shown.question, shown.pointed_path
        drawn = _NOTHING if question is None or pointed is None else question[0].paths.outline(pointed)
        self.pointed.setData(*drawn.T)
        self._lay_out()

    def _lay_out(self) -> None:
        """Place the labels without overlap. Their distance on the screen depends on the zoom."""
        taken = [_sensor_box(self.labels[0].getViewBox(), self._sensor)]
        for label, (_, point) in zip(self.labels, self._texts, strict=False):
            _set_beside(label, point, taken)


class RulerLayer(PlotLayer):
    """A line between two points, labelled with its length and direction."""

    def __init__(self, plot: pg.PlotItem) -> None:
        super().__init__(plot)
        self._line = self._add(PlotLine(), 40, "ink", 1.5, Qt.PenStyle.DashDotLine)
        self._ends = self._add(Spots(size=13, symbol="crosshair", brush=None), 40, "ink", 1.5)
        self.label = self._add_label(40, "ink", "tip_paper")
        self.clear()

    def draw(self, start: Point, end: Point, text: str) -> None:
        """Draw the ruler from one point to another."""
        ends = np.array([start, end])
        self._line.setData(*ends.T)
        self._ends.setData(*ends.T)
        self.label.setText(text)
        _set_beside(self.label, ends[1], [])
        for item in (self._line, self._ends, self.label):
            item.setVisible(True)

    def clear(self) -> None:
        """Remove the ruler."""
        for item in (self._line, self._ends, self.label):
            item.setVisible(False)


def _posts_path(posts: FloatArray) -> QPainterPath:
    path = QPainterPath()
    for x, y, radius in posts:
        path.addEllipse(QRectF(x - radius, y - radius, 2 * radius, 2 * radius))
    return path


def _set_beside(label: pg.TextItem, target: FloatArray, taken: list[QRectF]) -> None:
    """Put a label beside a point, towards the middle of the view and within it, clear of the areas `taken`."""
    label.setPos(*target)
    box = label.getViewBox()
    if box is None:
        return
    (left, right), (low, high) = box.viewRange()
    across = (_AFTER, _BEFORE) if target[0] < (left + right) / 2 else (_BEFORE, _AFTER)
    along = (_ABOVE, _BELOW) if target[1] < (low + high) / 2 else (_BELOW, _ABOVE)
    point, size = box.mapViewToScene(QPointF(*target)), label.textItem.boundingRect().size()
    beside = [(x, y) for x in across for y in along]
    sides = [(x, y + math.copysign(row, y)) for row in range(_ROWS) for x, y in beside]
    places = [QRectF(QPointF(point.x() - x * size.width(), point.y() - y * size.height()), size) for x, y in sides]
    clear = [k for k, place in enumerate(places) if not any(map(place.intersects, taken))]
    within = [k for k in clear if box.sceneBoundingRect().contains(places[k])]
    free = next(iter(within or clear), 0)
    label.setAnchor(sides[free])
    taken.append(places[free])


def _sensor_box(box: pg.ViewBox, position: Point) -> QRectF:
    middle = box.mapViewToScene(QPointF(*position))
    return QRectF(middle.x() - _SENSOR / 2, middle.y() - _SENSOR / 2, _SENSOR, _SENSOR)


# Arrows at the edge of the plan towards readings outside the visible part, with their distance from the sensor.
#
# Each arrow lies on the line from the sensor to its reading, so the arrow of the selected reading lies on the beam.


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
    middle: PixelPoint  # of the arrow, from the upper left corner of the plot
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
    middles, towards = _at_edge(pixels[outside], np.array(size), np.array(origin))
    along = places[outside] - sensor
    away, headings = np.hypot(*along.T), np.arctan2(along[:, 1], along[:, 0])
    order = np.lexsort((away, numbers[outside] != chosen))  # the selected reading first, then the nearest ones
    arrows: list[EdgeArrow] = []
    taken = np.full(len(outside), False)
    for k in order.tolist():
        if taken[k]:
            continue
        near = ~taken & (np.hypot(*(middles - middles[k]).T) < _APART)
        taken |= near
        index = int(outside[k])
        arrows.append(
            EdgeArrow(
                int(numbers[index]),
                kinds[index],
                tuple(middles[k]),
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


def _beside(middle: PixelPoint, size: QSizeF, whole: QRectF) -> tuple[QRectF, QRectF]:
    """Return the areas on both sides of an arrow for a text of this size.

    They lie along the edge: farther inwards the text would cover walls and readings.
    """
    (x, y), width, height = middle, size.width(), size.height()
    right, below = whole.width() - width - 1, whole.height() - height - 1
    distance = _ARROW + _GAP
    if min(x, whole.width() - x) < min(y, whole.height() - y):
        left = 1.0 if x < whole.width() / 2 else right
        return QRectF(QPointF(left, y + distance), size), QRectF(QPointF(left, y - distance - height), size)
    top = 1.0 if y < whole.height() / 2 else below
    return QRectF(QPointF(x + distance, top), size), QRectF(QPointF(x - distance - width, top), size)


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
        self._clear = QRectF()  # m, without texts
        self.setParentItem(box)
        self.setZValue(1000)
        box.sigRangeChanged.connect(self._lay_out)
        box.sigResized.connect(self._lay_out)

    def set_look(self, look: Look) -> None:
        """Use the colours, unit and text size of `look`."""
        self._look, self._font = look, text_font(look, 0.8)
        self.update()

    def keep_clear(self, room: QRectF) -> None:
        """Write no text over a room (m) that is in view as a whole."""
        self._clear = room
        self.update()

    def draw(self, placed: dict[Class, Placed], sensor: PixelPoint, chosen: int | None) -> None:
        """Draw the arrows of these readings."""
        self._placed, self._sensor, self._chosen = placed, sensor, chosen
        self._lay_out()

    def reading_at(self, position: QPointF) -> int | None:
        """Return the reading of the arrow at a point in scene coordinates; None if there is none."""
        point = self.mapFromScene(position)
        near = [
            (abs(point.x() - x) + abs(point.y() - y), arrow.reading)
            for arrow in self.arrows
            for x, y in (arrow.middle,)
        ]
        away, reading = min(near, default=(_PICK + 1, None))
        return reading if away <= _PICK else None

    def text(self, arrow: EdgeArrow) -> str:
        """Return the text beside an arrow."""
        unit = self._look.unit
        distance = f"{unit.of(arrow.distance):.{max(unit.decimals - 2, 0)}f} {unit.label}"  # short: it covers the plan
        heading = f"{heading_text(arrow.heading)}: " if arrow.reading == self._chosen else ""
        return f"{heading}{distance}" if arrow.count == 1 else f"{heading}{distance} ×{arrow.count}"

    def boundingRect(self) -> QRectF:
        """Return the area of the plot."""
        return QRectF(0, 0, self._box.width(), self._box.height())

    def text_areas(self) -> list[tuple[EdgeArrow, QRectF]]:
        """Return the arrows with a text, and its area. Texts overlap neither texts nor arrows; the first arrow wins."""
        metrics, whole = QFontMetricsF(self._font), self.boundingRect()
        taken = [
            QRectF(x - _ARROW, y - _ARROW, 2 * _ARROW, 2 * _ARROW) for x, y in (arrow.middle for arrow in self.arrows)
        ]
        room = self._box.mapFromView(QPolygonF(self._clear)).boundingRect()
        if whole.contains(room):
            taken.append(room)
        areas = []
        for arrow in self.arrows:
            size = metrics.boundingRect(self.text(arrow)).size() + QSizeF(4, 0)
            for area in _beside(arrow.middle, size, whole):
                if whole.contains(area) and not any(map(area.intersects, taken)):
                    taken.append(area)
                    areas.append((arrow, area))
                    break
        return areas

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
        across, tip = QPointF(-along.y(), along.x()) * _HALF_WIDTH, QPointF(*arrow.middle) + along * _ARROW
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


# The search for the room in the plan: dashed walls, readings for and against one of them, the next place to scan.


_CLEARED = 9  # pixels
_REACH = 0.18  # of the diagonal of the found walls: radius of the sectors of the next scan


class SurfaceLayer(PlotLayer):
    """Dashed walls and posts that are not in the room, with rings around the readings that speak for them."""

    def __init__(self, plot: pg.PlotItem, z: float, width: float, cross: float) -> None:
        """`cross`: size of that at a post, which may be smaller than a pixel, pixels."""
        super().__init__(plot)
        self.surfaces = self._add(PlotLine(connect="finite"), z, "predicted", width, Qt.PenStyle.DashLine)
        self._posts = self._add(Spots(size=cross, symbol="+", brush=None), z, "predicted", 2)
        self.rings = self._add(Spots(size=15, symbol="o", brush=None), 34, "predicted", 2)

    def draw_surfaces(self, walls: FloatArray, posts: FloatArray, speaking_for: FloatArray) -> None:
        """Draw walls (n, 4) and posts (m, 3), and rings around points (k, 2), all m."""
        _set(self.surfaces, surface_outlines(walls, posts))
        _set(self._posts, posts[:, :2])
        _set(self.rings, speaking_for)


class FoundLayer(SurfaceLayer):
    """The search for the room: its walls, readings for and against one of them, the next place with its headings."""

    def __init__(self, plot: pg.PlotItem) -> None:
        super().__init__(plot, 4, 3, 16)  # over walls and outline, below readings of all scans
        self.chosen = self._add(PlotLine(connect="finite"), 4.5, "predicted", 5)
        self.sectors = self._add(PlotLine(connect="finite"), 33, "ink", style=Qt.PenStyle.DotLine)
        self.against = self._add(Spots(size=15, symbol="x", brush=None), 34, "long", 3)
        self.next_scan = self._add(Spots(size=20, symbol="star"), 37, "ink", brush="extra")
        self._label = self._add_label(37, "ink", "paper", 0.9, text="scan next", anchor=(0.5, -0.5))
        self.draw(None)

    def set_look(self, look: Look) -> None:
        """Use the colours and sizes of `look`."""
        super().set_look(look)
        # below the dashes, a strip without the outline, which has their colour
        self.surfaces.setShadowPen(cosmetic_pen(look.palette.paper, width=_CLEARED))

    def draw(self, drawing: FoundDrawing | None) -> None:
        """Draw the state of a search; None: nothing."""
        drawing = drawing or NOT_FOUND
        self.draw_surfaces(drawing.walls, drawing.posts, drawing.speaking_for)
        _set(self.chosen, surface_outlines(drawing.chosen_walls, drawing.chosen_posts))
        _set(self.against, drawing.against)
        self._draw_next(drawing.next_scan, drawing.walls)

    def _draw_next(self, place: "NextPlace | None", walls: FloatArray) -> None:
        points = NO_POINTS if place is None else np.array([place.position])
        _set(self.next_scan, points)
        self._label.setVisible(place is not None)
        if place is None:
            _set(self.sectors, NO_POINTS)
            return
        self._label.setPos(*place.position)
        ends = walls.reshape(-1, 2)
        reach = _REACH * float(np.hypot(*np.ptp(ends, axis=0))) if len(ends) else 1.0
        _set(self.sectors, _sectors(place, reach))


class TrackLayer(PlotLayer):
    """The way of a robot by its sonar, and the particles of the last update: where else it may be."""

    def __init__(self, plot: pg.PlotItem) -> None:
        super().__init__(plot)
        self.cloud = self._add(Spots(size=4, symbol="o"), 17, "paper", 0.5, brush="extra")
        self.path = self._add(PlotLine(), 18, "extra", 2.5)

    def draw(self, drawing: TrackDrawing | None) -> None:
        """Draw a track; None: nothing."""
        _set(self.path, _NOTHING if drawing is None else drawing.path)
        _set(self.cloud, _NOTHING if drawing is None else drawing.cloud)


def _set(item: PlotLine | Spots, points: FloatArray) -> None:
    item.setData(*points.T)
    item.setVisible(len(points) > 0)


def _sectors(place: "NextPlace", reach: float) -> FloatArray:
    """Return the outlines of the sectors, (n, 2) m, with NaN between them."""
    middle, arcs = np.array([place.position]), []
    for begin, end in place.sectors:
        angles = np.linspace(begin, end, 25)
        arc = middle + reach * np.column_stack((np.cos(angles), np.sin(angles)))
        arcs.append(np.vstack((middle, arc, middle)))
    return with_gaps(arcs)


# The layer of the plan that draws sound on its paths, what the board does not detect yet, and what it would report.


_CIRCLE = np.linspace(0, 2 * np.pi, 73)


class SoundLayer(PlotLayer):
    """The burst of each path with its wavefront, the disc of blanking, and the range counted so far."""

    def __init__(self, plot: pg.PlotItem) -> None:
        super().__init__(plot)
        dashed, dotted = Qt.PenStyle.DashLine, Qt.PenStyle.DotLine
        self._deaf = self._add(PlotLine(filled=True), -12, "faint", 1, dashed, brush="blanking")
        self._ways = self._add(PlotLine(connect="finite"), 26, "faint")
        self._others = self._add(PlotLine(connect="finite"), 27, "faint", 4)
        self.winner = self._add(PlotLine(connect="finite"), 28, "predicted", 5)
        self._fronts = self._add(PlotLine(connect="finite"), 28, "predicted", 1.5)
        self._counting = self._add(PlotLine(), 26, "measured", 1, dotted)
        self.counted = self._add(Spots(size=12, symbol="o"), 29, "measured", 2)
        lines = self._deaf, self._ways, self._others, self.winner, self._fronts, self._counting
        self._items = (*lines, self.counted)
        for item in self._items:
            item.setVisible(False)

    def draw(self, shown: Shown) -> None:
        """Draw one moment, or hide everything."""
        sound = shown.sound
        for item in self._items:
            item.setVisible(sound is not None)
        if sound is None or sound.ping is None:
            return
        ping, pulses = sound.ping, moment_at(sound.ping, sound.time)
        sensor = ping.prediction.standpoints[ping.index]
        deaf = ping.prediction.board.blanked_range(ping.prediction.room.air)
        self._deaf.setData(*(sensor + deaf * np.column_stack((np.cos(_CIRCLE), np.sin(_CIRCLE)))).T)
        self._deaf.setOpacity(1.0 if sound.time < ping.blanking else 0.45)
        self._ways.setData(*with_gaps([way.points for way in ping.ways]).T)
        self._others.setData(*_trails(pulses, wins=False).T)
        self.winner.setData(*_trails(pulses, wins=True).T)
        self._fronts.setData(*with_gaps([pulse.front for pulse in pulses]).T)
        here = counted_position(ping, sound.time)
        self._counting.setData(*np.array([sensor, here]).T)
        reported = ping.detected is not None and sound.time >= ping.detected
        self.counted.setBrush(pg.mkBrush(shown.look.palette.measured if reported else None))
        self.counted.setData(*here[:, None])


def _trails(pulses: tuple[Pulse, ...], wins: bool) -> FloatArray:
    return with_gaps([pulse.trail for pulse in pulses if pulse.way.echo.wins is wins])
