"""The layers of the plan: room, sensor with its beam, rays of one path, cursor and ruler."""

import math

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QPainterPath
from PySide6.QtWidgets import QGraphicsPathItem
from sonarhw_compare.edits import Point, corners
from sonarhw_compare.pictures import points_at
from sonarhw_sim.room.room import Room

from sonarhw.readings import FloatArray
from sonarhw_gui.look.appearance import Look
from sonarhw_gui.look.palette import ViewLayer
from sonarhw_gui.look.theme import text_font
from sonarhw_gui.plots.plot_look import cosmetic_pen
from sonarhw_gui.plots.spots import PlotLine, Spots
from sonarhw_gui.scene.plan_geometry import beam_wedge, bounce_labels, half_power_angle, wall_lines
from sonarhw_gui.shown.bounces import chosen_path
from sonarhw_gui.shown.shown import Shown

_BEAM_LENGTH, _HANDLE, _ZERO = 0.3, 0.12, 0.05  # shares of the room's diagonal
_MOST_LABELLED = 9  # points; more labels would hide the rays
_AFTER, _BEFORE, _ABOVE, _BELOW = -0.1, 1.1, 1.3, -0.3  # anchors of labels, in units of their size
_ROWS = 4  # rows tried above and below a point for its label
_SENSOR = 14  # pixels
_NOTHING = np.empty((0, 2))


class RoomLayer:
    """Walls and posts, the selected one thicker, and handles at the corners."""

    def __init__(self, plot: pg.PlotItem) -> None:
        self._walls = PlotLine(connect="pairs")
        self._posts, self._chosen_post = QGraphicsPathItem(), QGraphicsPathItem()
        self._posts.setPen(pg.mkPen(None))
        self._chosen_wall = PlotLine()
        self._corners = Spots(size=8, symbol="s", brush=None)
        self._corners.setZValue(20)  # over readings
        for item in (self._walls, self._posts, self._chosen_wall, self._chosen_post, self._corners):
            plot.addItem(item, ignoreBounds=item in (self._chosen_wall, self._chosen_post))

    def set_look(self, look: Look) -> None:
        """Use the colours and sizes of `look`."""
        colours = look.palette
        self._walls.setPen(cosmetic_pen(colours.wall, width=2))
        self._posts.setBrush(pg.mkBrush(colours.wall))
        self._chosen_wall.setPen(cosmetic_pen(colours.chosen, width=5))
        self._chosen_post.setPen(cosmetic_pen(colours.chosen, width=4))
        self._corners.setPen(cosmetic_pen(colours.ink, width=1))

    def draw(self, room: Room | None, name: str | None, handles: bool) -> None:
        """Draw a room, with the surface `name` highlighted and, if `handles`, its corners."""
        chosen = room.names.index(name) if room and name in room.names else None
        self._walls.setData(*(wall_lines(room) if room else _NOTHING).T)
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


class SensorLayer:
    """The sensor, the zero of its turntable, the beam of the selected reading, and the turntable's direction now."""

    def __init__(self, plot: pg.PlotItem) -> None:
        self.handle_at: Point | None = None
        self._beam = PlotLine(pen=None, filled=True)
        self._axis, self._turntable, self._zero = PlotLine(), PlotLine(), PlotLine()
        self._handle = Spots(size=11, symbol="o")
        self._sensor = Spots(size=_SENSOR, symbol="d")
        for z, item in (
            (-10, self._beam),
            (-9, self._axis),
            (-9, self._turntable),
            (20, self._zero),
            (21, self._handle),
            (22, self._sensor),
        ):
            item.setZValue(z)
            plot.addItem(item, ignoreBounds=item is not self._sensor)

    def set_look(self, look: Look) -> None:
        """Use the colours and sizes of `look`."""
        colours = look.palette
        self._beam.setBrush(colours.beam)
        self._axis.setPen(cosmetic_pen(colours.ink, width=1, style=Qt.PenStyle.DashLine))
        self._turntable.setPen(cosmetic_pen(colours.faint, width=1, style=Qt.PenStyle.DotLine))
        self._zero.setPen(cosmetic_pen(colours.ink, width=2.5))
        self._handle.setPen(cosmetic_pen(colours.paper))  # filled: the ring of the selected reading is hollow
        self._handle.setBrush(colours.ink)
        self._sensor.setPen(cosmetic_pen(colours.paper))
        self._sensor.setBrush(pg.mkBrush(colours.ink))

    def draw(self, shown: Shown) -> None:
        """Draw the beam at the heading of the selected reading, and a dotted line at the newest heading.

        Without readings, the beam is at step 0.
        """
        scene, room = shown.scene, shown.scene.room
        self._sensor.setData(*np.array([scene.pose.position]).T)
        wedge, axis, turntable, zero, self.handle_at = _NOTHING, _NOTHING, _NOTHING, _NOTHING, None
        if room is not None:
            newest = shown.heading(len(shown.readings) - 1) if shown.readings else scene.pose.heading
            heading = newest if shown.due_heading is None else shown.due_heading
            size = math.hypot(*np.ptp(room.walls.reshape(-1, 2), axis=0))
            length, handle = _BEAM_LENGTH * size, _HANDLE * size
            wedge = beam_wedge(scene.pose, heading, half_power_angle(scene.board, room), length)
            axis = points_at(scene.pose.position, np.full(3, heading), np.array([0.0, handle, length]))
            self.handle_at = float(axis[1, 0]), float(axis[1, 1])
            zero = points_at(scene.pose.position, np.full(2, scene.pose.heading), np.array([0.0, _ZERO * size]))
            if newest != heading:
                turntable = points_at(scene.pose.position, np.full(2, newest), np.array([0.0, handle]))
        self._beam.setData(*wedge.T)
        self._beam.setVisible(shown.draws(ViewLayer.BEAM))
        self._axis.setData(*axis.T)
        self._turntable.setData(*turntable.T)
        self._zero.setData(*zero.T)
        self._handle.setData(*axis[1:2].T)


class PathLayer:
    """The path that explains the selected reading, numbered by bounce, and the path pointed at in a list."""

    def __init__(self, plot: pg.PlotItem) -> None:
        self._rays, self._pointed = PlotLine(), PlotLine()
        self._pointed.setZValue(28)
        self._labels = [_label() for _ in range(_MOST_LABELLED)]
        self._texts: list[tuple[str, FloatArray]] = []
        self._sensor: Point = (0.0, 0.0)
        self._colour = "k"
        self._drawn_with: tuple[str, Qt.PenStyle] | None = None  # colour and style of the rays
        for item in (self._rays, self._pointed, *self._labels):
            plot.addItem(item)
        plot.vb.sigRangeChanged.connect(self._lay_out)

    def set_look(self, look: Look) -> None:
        """Use the colours and sizes of `look`."""
        self._colour, self._drawn_with = look.palette.chosen, None  # the width depends on the screen
        self._pointed.setPen(cosmetic_pen(look.palette.predicted, width=3))
        for label in self._labels:
            label.setColor(look.palette.paper)
            label.fill = pg.mkBrush(look.palette.chosen)
            label.setFont(text_font(look, 0.8))

    def draw(self, shown: Shown) -> None:
        """Draw the path that explains the reading as a solid line, or else the predicted path as a dotted line."""
        path = chosen_path(shown) if shown.draws(ViewLayer.RAYS) else None
        points = _NOTHING if path is None else path.corners
        style = Qt.PenStyle.SolidLine if path is not None and path.explains else Qt.PenStyle.DotLine
        if (self._colour, style) != self._drawn_with:
            self._drawn_with = self._colour, style
            self._rays.setPen(cosmetic_pen(self._colour, width=1.5, style=style))
        self._rays.setData(*points.T)
        self._texts, self._sensor = bounce_labels(points), shown.scene.pose.position
        for k, label in enumerate(self._labels):
            label.setVisible(k < len(self._texts))
            if k < len(self._texts):
                label.setText(self._texts[k][0])
        question, pointed = shown.question, shown.pointed_path
        drawn = _NOTHING if question is None or pointed is None else question[0].paths.outline(pointed)
        self._pointed.setData(*drawn.T)
        self._lay_out()

    def _lay_out(self) -> None:
        """Place the labels without overlap. Their distance on the screen depends on the zoom."""
        taken = [_sensor_box(self._labels[0].getViewBox(), self._sensor)]
        for label, (_, at) in zip(self._labels, self._texts, strict=False):
            _set_beside(label, at, taken)


class CursorLayer:
    """A cross at the position of the pointer in another view."""

    def __init__(self, plot: pg.PlotItem) -> None:
        self._cross = Spots(size=17, symbol="crosshair", brush=None)
        self._cross.setZValue(25)
        plot.addItem(self._cross, ignoreBounds=True)

    def set_look(self, look: Look) -> None:
        """Use the colours and sizes of `look`."""
        self._cross.setPen(cosmetic_pen(look.palette.chosen, width=1))

    def draw(self, shown: Shown) -> None:
        """Draw the cursor, or hide it if there is none."""
        at, cursor = _NOTHING, shown.cursor
        if cursor is not None:
            at = points_at(shown.scene.pose.position, np.array([cursor.heading]), np.array([cursor.range]))
        self._cross.setData(*at.T)
        self._cross.setVisible(cursor is not None)  # hidden items take no time


class RulerLayer:
    """A line between two points, labelled with its length and direction."""

    def __init__(self, plot: pg.PlotItem) -> None:
        self._line = PlotLine()
        self._ends = Spots(size=13, symbol="crosshair", brush=None)
        self.label = pg.TextItem()
        for item in (self._line, self._ends, self.label):
            item.setZValue(40)
            plot.addItem(item, ignoreBounds=True)
        self.clear()

    def set_look(self, look: Look) -> None:
        """Use the colours and sizes of `look`."""
        self._line.setPen(cosmetic_pen(look.palette.ink, width=1.5, style=Qt.PenStyle.DashDotLine))
        self._ends.setPen(cosmetic_pen(look.palette.ink, width=1.5))
        self.label.setColor(look.palette.ink)
        self.label.fill = pg.mkBrush(look.palette.tip_paper)
        self.label.setFont(text_font(look))

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


def _set_beside(label: pg.TextItem, at: FloatArray, taken: list[QRectF]) -> None:
    """Put a label beside a point, towards the middle of the view and within it, clear of the areas `taken`."""
    label.setPos(*at)
    box = label.getViewBox()
    if box is None:
        return
    (left, right), (low, high) = box.viewRange()
    across = (_AFTER, _BEFORE) if at[0] < (left + right) / 2 else (_BEFORE, _AFTER)
    along = (_ABOVE, _BELOW) if at[1] < (low + high) / 2 else (_BELOW, _ABOVE)
    point, size = box.mapViewToScene(QPointF(*at)), label.textItem.boundingRect().size()
    beside = [(x, y) for x in across for y in along]
    sides = [(x, y + math.copysign(row, y)) for row in range(_ROWS) for x, y in beside]
    places = [QRectF(QPointF(point.x() - x * size.width(), point.y() - y * size.height()), size) for x, y in sides]
    clear = [k for k, place in enumerate(places) if not any(map(place.intersects, taken))]
    within = [k for k in clear if box.sceneBoundingRect().contains(places[k])]
    free = next(iter(within or clear), 0)
    label.setAnchor(sides[free])
    taken.append(places[free])


def _sensor_box(box: pg.ViewBox, at: Point) -> QRectF:
    middle = box.mapViewToScene(QPointF(*at))
    return QRectF(middle.x() - _SENSOR / 2, middle.y() - _SENSOR / 2, _SENSOR, _SENSOR)


def _label() -> pg.TextItem:
    item = pg.TextItem()
    item.setZValue(30)
    item.setVisible(False)
    return item
