"""The controller of a plan: passes mouse and key events to the active tool, and its edits to the window.

It implements `ToolContext` for the tools and uses the drawing only through `DrawingContext`.
"""

import math
import time
from collections.abc import Callable
from typing import Protocol

from pyqtgraph.GraphicsScene.mouseEvents import MouseClickEvent, MouseDragEvent
from PySide6.QtCore import QPointF, Qt
from sonarhw_compare.edits import Point

from sonarhw.errors import InputError
from sonarhw_gui.plan.plan_texts import text_under_pointer
from sonarhw_gui.plan.plan_tools import Hand, Tool
from sonarhw_gui.scene.grips import Grip, GripPart, surface_at
from sonarhw_gui.scene.scene import Scene
from sonarhw_gui.scene.scene_edit import Edit, bearing, dragged, sensor_turned, with_corner, without_surface
from sonarhw_gui.shown.shown import Cursor, Shown
from sonarhw_gui.view import Gestures

NUDGE, TURN = 0.01, math.radians(1.0)  # m, rad: of one key press
_PAUSE = 1.0  # s: key presses with shorter pauses are one undo step
_GRIPPED = {GripPart.SENSOR: Qt.CursorShape.OpenHandCursor, GripPart.BEAM: Qt.CursorShape.PointingHandCursor}


class DrawingContext(Protocol):
    """The interface of the drawing for its controller."""

    @property
    def shown(self) -> Shown | None:
        """What is drawn; None before the first update."""

    @property
    def handle_at(self) -> Point | None:
        """Where the beam can be dragged, m."""

    @property
    def pixel(self) -> float:
        """The length of a pixel, m."""

    def contains(self, position: QPointF) -> bool:
        """Return whether a point in scene coordinates lies in the plan."""

    def point_at(self, position: QPointF) -> Point:
        """Return the visible plan point, m, nearest to a point in scene coordinates."""

    def draw_room(self) -> None:
        """Draw the room again, after a change of the selected surface or of the tool."""

    def draw_ruler(self, start: Point, end: Point, text: str) -> None:
        """Draw the ruler."""

    def clear_ruler(self) -> None:
        """Remove the ruler."""

    def draw_cursor(self, shape: Qt.CursorShape) -> None:
        """Change the shape of the mouse cursor."""

    def show_message(self, text: str) -> None:
        """Show one line of text beside the tools."""

    def pick(self, event: MouseClickEvent) -> bool:
        """Select the reading under a click; return whether there is one."""

    def on_outline(self, at: Point) -> bool:
        """Return whether a point lies on the predicted outline."""


class PlanController:
    """Holds the active tool and the selected wall or post."""

    def __init__(self, drawing: DrawingContext, gestures: Gestures) -> None:
        self._drawing, self._gestures = drawing, gestures
        self.tool: Tool = Hand(self)
        self._busy = False  # during a drag that the tool uses
        self._cancelled = False  # whether to ignore the rest of a cancelled drag
        self.chosen: str | None = None  # name of a wall or post, because indices change
        self._before: str | None = None  # `chosen` when the drag began
        self.clock: Callable[[], float] = time.monotonic
        self._last_key, self._key_gesture = -math.inf, object()
        self._last_edit: tuple[Scene, Shown] | None = None  # scene of the last edit, and what was shown before it

    # the interface `ToolContext`

    @property
    def shown(self) -> Shown:
        """What is drawn."""
        assert self._drawing.shown is not None, "nothing is shown yet"
        return self._drawing.shown

    @property
    def scene(self) -> Scene:
        """The scene with all edits, including those not drawn yet."""
        if self._last_edit is not None and self._last_edit[1] is self.shown:
            return self._last_edit[0]
        return self.shown.scene

    @property
    def handle_at(self) -> Point | None:
        """Where the beam can be dragged, m."""
        return self._drawing.handle_at

    @property
    def pixel(self) -> float:
        """The length of a pixel, m."""
        return self._drawing.pixel

    def change(self, edit: Callable[[Scene], Edit], scene: Scene, gesture: object) -> bool:
        """Apply an edit to the scene from before the gesture. A rejected edit shows its error and returns False."""
        try:
            changed, label = edit(scene)
        except InputError as error:
            self.show_message(f"⚠ {error}")
            return False
        self.show_message("")
        self._last_edit = changed, self.shown
        self._gestures.edited.emit(changed, label, gesture)
        return True

    def drop(self, gesture: object) -> None:
        """Undo the edits of an unfinished gesture."""
        self._last_edit = None
        self._gestures.cancelled.emit(gesture)

    def choose_surface(self, name: str | None) -> None:
        """Select the wall or post that keys and panel act on."""
        if name != self.chosen:
            self.chosen = name
            self._drawing.draw_room()
            self._gestures.surface_chosen.emit(name)

    def measure(self, start: Point, end: Point, text: str) -> None:
        """Draw the ruler."""
        self._drawing.draw_ruler(start, end, text)

    def ask(self, at: Point) -> None:
        """Explain the heading from the sensor to a point."""
        self._gestures.asked.emit(bearing(self.scene.pose.position, at))

    def show_message(self, text: str) -> None:
        """Show one line of text beside the tools."""
        self._drawing.show_message(text)

    # keys and buttons

    @property
    def chosen_surface(self) -> int | None:
        """Index of the selected wall or post, or None."""
        room = self.scene.room if self._drawing.shown else None
        return room.names.index(self.chosen) if room and self.chosen in room.names else None

    def set_tool(self, tool: type[Tool]) -> None:
        """Activate another tool."""
        self.cancel_drag()
        self.tool = tool(self)
        self._drawing.clear_ruler()
        self._drawing.draw_cursor(self.tool.shape)
        self._drawing.draw_room()
        self.show_message("")

    def remove_chosen(self) -> None:
        """Remove the selected wall or post."""
        surface = self.chosen_surface
        if surface is None:
            self.show_message("⚠ Edit (E) selects what to remove")
        elif self.change(lambda scene: without_surface(scene, surface), self.scene, None):
            self.choose_surface(None)

    def nudge(self, right: int, up: int) -> None:
        """Move the sensor by steps of `NUDGE`; with a tool that edits, move the selected wall or post."""
        surface, room = self.chosen_surface, self.scene.room
        by = right * NUDGE, up * NUDGE
        if self.tool.edits and surface is not None and room is not None:
            part = GripPart.WALL if surface < len(room.walls) else GripPart.POST
            self._by_key(lambda scene: dragged(scene, Grip(part, (0.0, 0.0), surface), by))
        else:
            self._by_key(lambda scene: dragged(scene, Grip(GripPart.SENSOR, (0.0, 0.0)), by))

    def turn(self, left: int) -> None:
        """Turn the sensor counter-clockwise by steps of `TURN`."""
        self._by_key(lambda scene: sensor_turned(scene, left * TURN))

    def _by_key(self, edit: Callable[[Scene], Edit]) -> None:
        now = self.clock()
        if now - self._last_key > _PAUSE:
            self._key_gesture = object()
        self._last_key = now
        self.change(edit, self.scene, self._key_gesture)

    # the mouse

    def drag(self, event: MouseDragEvent) -> bool:
        """Offer a drag to the tool; return whether the tool uses it."""
        if self._drawing.shown is None:
            return False
        if event.isStart():
            self._before = self.chosen
            self._busy, self._cancelled = self.tool.press(self._drawing.point_at(event.buttonDownScenePos())), False
        taken = self._busy
        if taken and not self._cancelled:
            self.tool.drag(self._drawing.point_at(event.scenePos()))
        if event.isFinish():
            self._busy = False
        return taken

    def cancel_drag(self) -> bool:
        """Undo the current drag and ignore the rest of it; return whether there was one, or a first click."""
        if self.tool.waiting:
            self.drop(self.tool.gesture)
            self.tool = type(self.tool)(self)  # without the first click
            self.choose_surface(None)
            self.show_message("")
            return True
        if not self._busy or self._cancelled:
            return self._busy
        self._cancelled = True
        self.drop(self.tool.gesture)
        self.choose_surface(self._before)
        self._drawing.clear_ruler()
        self.show_message("")
        return True

    def click(self, event: MouseClickEvent) -> None:
        """Select a surface with a tool that edits; otherwise select a reading, or ask the heading of the outline."""
        if self._drawing.shown is None:
            return
        room, at = self.scene.room, self._drawing.point_at(event.scenePos())
        if room is None or not self.tool.edits:
            if self.tool.asks or (not self._drawing.pick(event) and self._drawing.on_outline(at)):
                self.ask(at)
            return
        if self.tool.click(at):
            return
        surface = surface_at(room, at, self.pixel)
        if event.double() and surface is not None and surface < len(room.walls):
            self.change(lambda scene: with_corner(scene, surface, at), self.scene, None)
        else:
            self.choose_surface(None if surface is None else room.names[surface])

    def hover(self, position: QPointF | None) -> None:
        """Describe the object under the mouse and link the cursor of all views. None: the mouse has left the plan."""
        if position is None:
            self._leave()
            return
        if self._drawing.shown is None or self._busy:
            return
        if not self._drawing.contains(position):
            self._leave()
            return
        at = self._drawing.point_at(position)
        if self.tool.waiting:
            self.tool.drag(at)
            return
        grip = self.tool.grip(at)
        shape = self.tool.shape if grip is None else _GRIPPED.get(grip.part, Qt.CursorShape.SizeAllCursor)
        self._drawing.draw_cursor(shape)
        self.show_message(text_under_pointer(self.shown, grip, at, self.pixel))
        middle = self.shown.scene.pose.position
        self._gestures.pointed.emit(Cursor(bearing(middle, at) % math.tau, math.dist(middle, at)))

    def _leave(self) -> None:
        if self.tool.waiting:
            self.tool.pause()
        self._gestures.pointed.emit(None)
        self.show_message("")
