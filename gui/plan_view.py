"""The plan: the room to scale, what is predicted and measured in it, the beam, and the rays of the chosen reading.

Takes what is shown; hands on which reading was clicked, where the hand points, and how it changes the scene. What the
hand does is up to the tool it holds (`gui.plan_tools`).
"""

import math
from collections.abc import Callable
from functools import partial

import numpy as np
import pyqtgraph as pg
from pyqtgraph.GraphicsScene.mouseEvents import MouseClickEvent, MouseDragEvent
from PySide6.QtCore import QEvent, QPointF, QRectF, Qt, Signal

from compare.picture import points_at
from gui.grips import Part, surface_at
from gui.look import Look
from gui.marks import WHOLE, ReadingMarks, dress_outline, outline_item
from gui.pick import is_plain_click, nearest_reading
from gui.plan_geometry import outline_points, wall_lines
from gui.plan_layers import CursorLayer, PathLayer, RoomLayer, RulerLayer, SensorLayer
from gui.plan_tools import Hand, Tool
from gui.plan_words import words_at
from gui.plot_look import dress_plot, label_length
from gui.reading_tip import reading_tip
from gui.room_edit import Point, remove_surface, split_wall
from gui.scene import Scene
from gui.scene_edit import Edit, bearing, on_grid, with_room
from gui.shown import Cursor, Shown
from sim.by_heading import standpoints
from sonarhw.errors import InputError

_BEYOND = 0.17  # of the room's longer side
_GRIPPED = {Part.SENSOR: Qt.CursorShape.OpenHandCursor, Part.BEAM: Qt.CursorShape.PointingHandCursor}


class PlanBox(pg.ViewBox):  # type: ignore[misc]  # pyqtgraph has no types
    """Where the plan is drawn: a drag with the left button is offered to the tool before it moves the paper."""

    def __init__(self) -> None:
        super().__init__(enableMenu=False)
        self.offer: Callable[[MouseDragEvent], bool] = lambda event: False

    def mouseDragEvent(self, ev: MouseDragEvent, axis: int | None = None) -> None:
        """Offer it; what nobody takes moves the paper."""
        if axis is None and ev.button() == Qt.MouseButton.LeftButton and self.offer(ev):
            ev.accept()
        else:
            super().mouseDragEvent(ev, axis)


class PlanView(pg.PlotWidget):  # type: ignore[misc]  # pyqtgraph has no types
    """Draws the plan of what is shown; a `Table` for the tools."""

    picked = Signal(int)  # a reading
    pointed = Signal(object)  # Cursor or None
    edited = Signal(object, str, object)  # Scene, what was done, gesture
    chosen = Signal(object)  # number of a wall or post, or None
    told = Signal(str)  # what lies under the hand, or what it measures

    def __init__(self, measured: bool = True, predicted: bool = True) -> None:
        super().__init__(viewBox=PlanBox())
        self.setViewportUpdateMode(WHOLE)
        self.shown: Shown | None = None
        self._measured, self._predicted = measured, predicted
        self._surface: str | None = None  # the chosen wall or post, by name: numbers change
        self.setAspectLocked(True)
        self.hideButtons()
        self.room, self.sensor = RoomLayer(self.plotItem), SensorLayer(self.plotItem)
        self._outline = outline_item()
        self.addItem(self._outline)
        self.path, self.cursor_mark = PathLayer(self.plotItem), CursorLayer(self.plotItem)
        self._marks = ReadingMarks(self.plotItem, self._tip)
        self.ruler = RulerLayer(self.plotItem)
        self._layers = (self.room, self.sensor, self.path, self.cursor_mark, self.ruler)
        self._tool: Tool = Hand(self)
        self._busy = False  # a tool is in a gesture
        self.plotItem.vb.offer = self._drag
        self.scene().sigMouseClicked.connect(self._click)
        self.scene().sigMouseMoved.connect(self._hover)

    def show_state(self, shown: Shown) -> None:
        """Draw what has changed since the last call."""
        before, self.shown = self.shown, shown
        fresh = before is None or before.look != shown.look
        if fresh:
            self._dress(shown.look)
        if fresh or before.scene is not shown.scene:
            self._draw_room()
        if before is None or before.outline is not shown.outline:
            points = outline_points(shown.outline) if shown.outline and self._predicted else np.empty((0, 2))
            self._outline.setData(*points.T)
        if self._measured and (before is None or not shown.same_readings(before)):
            self._draw_readings(shown)
        self.sensor.draw(shown)
        if self._measured:
            self._marks.ring(shown.chosen)
        if self._predicted:
            self.path.draw(shown)
        self.cursor_mark.draw(shown)
        if before is None or _another_room(before, shown) or (not before.readings and not shown.scene.room):
            self.fit()

    def fit(self) -> None:
        """Show the room and some way beyond, where echoes by several walls seem to lie; without a room everything."""
        room = self.shown.scene.room if self.shown else None
        if room is None:
            self.plotItem.vb.autoRange(padding=0.05)
            return
        ends = wall_lines(room)
        (left, bottom), (right, top) = ends.min(axis=0), ends.max(axis=0)
        beyond = _BEYOND * max(right - left, top - bottom)
        area = QRectF(left - beyond, bottom - beyond, right - left + 2 * beyond, top - bottom + 2 * beyond)
        self.plotItem.vb.setRange(area, padding=0)

    def hold(self, tool: type[Tool]) -> None:
        """Take another tool in the hand."""
        self._tool = tool(self)
        self.ruler.clear()
        self.setCursor(self._tool.shape)
        if self.shown is not None:
            self._draw_room()
        self.tell("")

    # the table of the tools

    @property
    def beam_end(self) -> Point | None:
        """Where the beam can be taken hold of, m."""
        return self.sensor.beam_end

    @property
    def pixel(self) -> float:
        """How long one is, m."""
        return float(abs(self.plotItem.vb.viewPixelSize()[0]))

    def change(self, edit: Callable[[Scene], Edit], scene: Scene, gesture: object) -> bool:
        """Do an edit to the scene as it was when the gesture began; what cannot be is told and not done."""
        try:
            changed, label = edit(scene)
        except InputError as error:
            self.tell(f"⚠ {error}")
            return False
        self.tell("")
        self.edited.emit(changed, label, gesture)
        return True

    def choose_surface(self, surface: int | None) -> None:
        """Let a wall or post be the one that keys and panel are about."""
        room = self.shown.scene.room
        self._surface = None if room is None or surface is None else room.names[surface]
        self._draw_room()
        self.chosen.emit(surface)

    def measure(self, start: Point, end: Point, text: str) -> None:
        """Lay the ruler."""
        self.ruler.draw(start, end, text)

    def tell(self, text: str) -> None:
        """Say something beside the tools."""
        self.told.emit(text)

    # keys

    def remove_chosen(self) -> None:
        """Take out the chosen wall or post."""
        surface = self.chosen_surface
        if surface is None:
            self.tell("click a wall or a post with Edit (E) first")
        elif self.change(lambda scene: _without(scene, surface), self.shown.scene, None):
            self.choose_surface(None)

    @property
    def chosen_surface(self) -> int | None:
        """Number of the chosen wall or post."""
        room = self.shown.scene.room if self.shown else None
        return room.names.index(self._surface) if room and self._surface in room.names else None

    # drawing

    def _dress(self, look: Look) -> None:
        self.setBackground(look.palette.paper)
        dress_plot(self.plotItem, look)
        for side, what in (("bottom", "x"), ("left", "y")):
            label_length(self.getAxis(side), what, look)
        for layer in self._layers:
            layer.dress(look)
        dress_outline(self._outline, look.palette)
        self._marks.dress(look.palette)

    def _draw_room(self) -> None:
        self.room.draw(self.shown.scene.room, self.chosen_surface, self._tool.edits)

    def _draw_readings(self, shown: Shown) -> None:
        stands = partial(standpoints, shown.scene.board, shown.scene.standing)
        self._marks.draw(
            {
                kind: (points, points_at(stands(points.headings), points.headings, points.ranges))
                for kind, points in shown.classes.items()
            }
        )

    def _tip(self, index: int) -> str:
        return reading_tip(self.shown, index) if self.shown else ""

    # the mouse

    def leaveEvent(self, event: QEvent) -> None:
        """Nothing is pointed at any more."""
        self.pointed.emit(None)
        self.tell("")
        super().leaveEvent(event)

    def _at(self, position: QPointF) -> Point:
        """A point of the plan under the mouse; none that cannot be seen."""
        box = self.plotItem.vb
        seen = box.mapSceneToView(position)
        (left, right), (low, high) = box.viewRange()
        return min(max(seen.x(), left), right), min(max(seen.y(), low), high)

    def _drag(self, event: MouseDragEvent) -> bool:
        if self.shown is None:
            return False
        if event.isStart():
            self._busy = self._tool.press(self._at(event.buttonDownScenePos()))
        taken = self._busy
        if taken:
            self._tool.drag(self._at(event.scenePos()))
        if event.isFinish():
            self._busy = False
        return taken

    def _click(self, event: MouseClickEvent) -> None:
        if self.shown is None or not is_plain_click(event):
            return
        if self._tool.edits and self.shown.scene.room is not None:
            self._click_on_room(event)
            return
        index = nearest_reading(self.plotItem.vb, self._marks.placed, event.scenePos())
        if index is not None:
            event.accept()
            self.picked.emit(index)

    def _click_on_room(self, event: MouseClickEvent) -> None:
        at, room = self._at(event.scenePos()), self.shown.scene.room
        surface = surface_at(room, at, self.pixel)
        if event.double() and surface is not None and surface < len(room.walls):
            self.change(lambda scene: _with_corner(scene, surface, at), self.shown.scene, None)
        else:
            self.choose_surface(surface)

    def _hover(self, position: QPointF) -> None:
        if self.shown is None or self._busy or not self.plotItem.vb.sceneBoundingRect().contains(position):
            return
        at, grip = self._at(position), self._tool.grip(self._at(position))
        self.setCursor(self._tool.shape if grip is None else _GRIPPED.get(grip.part, Qt.CursorShape.SizeAllCursor))
        self.tell(words_at(self.shown, grip, at, self.pixel))
        middle = self.shown.scene.standing.position
        self.pointed.emit(Cursor(bearing(middle, at) % math.tau, math.dist(middle, at)))


def _another_room(before: Shown, shown: Shown) -> bool:
    was, now = before.scene, shown.scene
    if was.room is None or now.room is None:
        return was.room is not now.room
    return (was.room_file, was.room.name) != (now.room_file, now.room.name)


def _without(scene: Scene, surface: int) -> Edit:
    return with_room(scene, remove_surface(scene.room, surface)), f"removing {scene.room.names[surface]}"


def _with_corner(scene: Scene, wall: int, at: Point) -> Edit:
    return with_room(scene, split_wall(scene.room, wall, on_grid(at))), f"a corner in {scene.room.names[wall]}"
