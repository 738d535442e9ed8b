"""The tools of the plan, one class each, with their controller and texts. Points are in metres."""

import math
import time
from collections.abc import Callable
from typing import Any

from pyqtgraph.GraphicsScene.mouseEvents import MouseClickEvent, MouseDragEvent
from PySide6.QtCore import QPointF, Qt
from sonarhw_compare.edits import POST, WALL, Point, corners, free_name
from sonarhw_sim.room.room import Room

from sonarhw.errors import InputError, heading_text
from sonarhw_gui.model import edits
from sonarhw_gui.model.look import LengthUnit
from sonarhw_gui.model.scene import Scene, decibels_text
from sonarhw_gui.model.shown import Cursor, Shown
from sonarhw_gui.views.base import Gestures

# One-line descriptions of the object under the mouse in the plan: sensor, corner, wall, post or plain point.


def text_under_pointer(shown: Shown, grip: edits.Grip | None, point: Point, pixel: float) -> str:
    """Return one line about a point: the part that `grip` would drag, a wall or post, or the position of the point."""
    scene, unit = shown.scene, shown.look.unit
    place = point_text(point, unit)
    if grip is not None and grip.part is edits.GripPart.SENSOR:
        return f"sensor, {pose_text(scene, unit)}; drag to move it"
    if grip is not None and grip.part is edits.GripPart.BEAM:
        if shown.asked is not None:
            return f"beam of the question at {heading_text(shown.asked)}; drag to ask another heading"
        return f"beam, {pose_text(scene, unit)}; drag to turn it"
    if grip is not None and grip.part is edits.GripPart.CORNER:
        return f"corner, {place}; drag to move it"
    room = scene.room
    surface = edits.surface_at(room, point, pixel) if room else None
    if room is not None and surface is not None:
        return surface_text(room, surface)
    middle = scene.pose.position
    away = f"{unit.text(math.dist(middle, point))} at {heading_text(edits.bearing(middle, point))} from the sensor"
    return f"{place} · {away}"


def surface_text(room: Room, surface: int) -> str:
    """Return name, material, reflectance and loss of a wall or post."""
    mirrored = float(room.reflectances[surface])
    loss = f" ({decibels_text(20 * math.log10(mirrored))})" if mirrored > 0 else ""
    power = mirrored**2 + float(room.scattered[surface]) ** 2
    scatters = f", scatters {float(room.scattered[surface]) ** 2 / power:.0%}" if room.scattered[surface] else ""
    material = room.materials[surface]
    upto = "up to " if material in room.tables else ""
    return f"{room.names[surface]} · {material}, reflectance {upto}{math.sqrt(power):.2f}{scatters}{loss}"


def point_text(point: Point, unit: LengthUnit) -> str:
    """Return the coordinates of a point in `unit`."""
    return f"x {unit.text(point[0])}, y {unit.text(point[1])}"


def pose_text(scene: Scene, unit: LengthUnit) -> str:
    """Return position and heading of the sensor, and whether it is outside the walls."""
    place = scene.pose
    outside = ", outside the walls" if scene.room and scene.room.is_outside(place.position) else ""
    return f"{point_text(place.position, unit)}{outside}, step 0 at {heading_text(place.heading)}"


# The tools of the plan, one class each. A tool keeps the state of one drag only; points are in metres.


_SHORTEST = 0.005  # m, of a wall or a radius; a shorter drag is ignored
_SNAP = 9.0  # pixels


class Tool:
    """A tool that uses no drag, so that every drag pans the plan."""

    name, key, tip = "", "", ""
    picture = ""  # of its button: an SVG path in a square of 24 units
    shape = Qt.CursorShape.ArrowCursor
    can_edit = False  # whether it drags or adds walls and posts
    asks = False  # whether a click explains a heading

    def __init__(self, context: "PlanController") -> None:
        self._context = context

    @property
    def gesture(self) -> object:
        """The identity of the current drag's edits; None if the tool does not edit."""
        return None

    def press(self, point: Point) -> bool:
        """Begin a drag; return whether the tool uses it. If not, the drag pans the plan."""
        return False

    def drag(self, to: Point) -> None:
        """Continue the drag."""

    @property
    def waiting(self) -> bool:
        """Whether the tool waits for a second click."""
        return False

    def pause(self) -> None:
        """Remove what is drawn before the second click: the mouse has left the plan."""

    def click(self, point: Point) -> bool:
        """Use a click; return whether the tool uses clicks."""
        return False

    def grip(self, point: Point) -> edits.Grip | None:
        """Return the part that a drag from there would move."""
        return None


class Hand(Tool):
    """Moves and turns the sensor; any other drag pans."""

    name, key = "Hand", "H"
    picture = "M12 3V21M3 12H21M9 6L12 3 15 6M9 18L12 21 15 18M6 9L3 12 6 15M18 9L21 12 18 15"
    tip = "Drag the sensor or the handle on its beam. Drag elsewhere to pan. Click a reading to select it"

    def __init__(self, context: "PlanController") -> None:
        super().__init__(context)
        self._held: tuple[edits.Grip, Scene] | None = None  # and the scene when the drag began

    @property
    def gesture(self) -> object:
        """The part being dragged, with the scene when the drag began."""
        return self._held

    def grip(self, point: Point) -> edits.Grip | None:
        """Return the sensor or the beam, if it is there."""
        context = self._context
        return edits.sensor_grip(context.scene, context.handle_at, point, context.pixel)

    def press(self, point: Point) -> bool:
        """Begin to drag the part that is there."""
        grip = self.grip(point)
        self._held = None if grip is None else (grip, self._context.scene)
        return grip is not None

    def drag(self, to: Point) -> None:
        """Move the part with the mouse."""
        if self._held is not None:
            grip, before = self._held
            if grip.part is edits.GripPart.BEAM and self._context.shown.asked is not None:
                self._context.ask(to)  # the beam of a question turns without the turntable
                return
            if grip.part is edits.GripPart.CORNER:
                to = snapped(self._context, to, ignored=grip.point, scene=before)
            self._context.change(
                lambda scene: edits.dragged(scene, grip, to), before, self._held, lambda: self._where(grip, to)
            )

    def _where(self, grip: edits.Grip, to: Point) -> str:
        unit = self._context.shown.look.unit
        if grip.part in (edits.GripPart.SENSOR, edits.GripPart.BEAM):
            return pose_text(self._context.scene, unit)
        return point_text(to, unit)


class Asker(Tool):
    """Turns the beam to any heading and explains it; the turntable stays."""

    name, key = "Ask", "Q"
    picture = "M9 9A3 3 0 1 1 13.4 12.2Q12 13 12 15M12 18.4V18.6M12 3A9 9 0 1 0 12 21 9 9 0 1 0 12 3"
    tip = "Click or drag to explain any heading without a scan; [ and ] turn by 1°. Esc returns to the readings"
    shape = Qt.CursorShape.CrossCursor
    asks = True

    def press(self, point: Point) -> bool:
        """Ask the heading of this point."""
        self._context.ask(point)
        return True

    def drag(self, to: Point) -> None:
        """Turn the beam with the mouse."""
        self._context.ask(to)


class Pencil(Hand):
    """Also moves corners, walls and posts."""

    name, key = "Edit", "E"
    picture = "M4 20L5.2 15 16 4.2 19.8 8 9 18.8ZM13.4 6.8L17.2 10.6"
    tip = "Drag corners, walls, posts or rims. Click to select, Del to remove, double-click a wall to add a corner"
    can_edit = True

    def grip(self, point: Point) -> edits.Grip | None:
        """Return the sensor or beam, or else the part of the room that is there."""
        scene = self._context.scene
        over = super().grip(point)
        return over or (edits.room_grip(scene.room, point, self._context.pixel) if scene.room else None)

    def press(self, point: Point) -> bool:
        """Begin to drag the part that is there, and select its wall or post."""
        taken = super().press(point)
        room, surface = self._context.scene.room, self._held[0].surface if self._held else None
        if room is not None and surface is not None:
            self._context.choose_surface(room.names[surface])
        return taken


class Ruler(Tool):
    """Measures distance and angle."""

    name, key = "Ruler", "M"
    picture = "M3.5 15.5L15.5 3.5 20.5 8.5 8.5 20.5ZM6.5 12.5L8.5 14.5M9.5 9.5L12 12M12.5 6.5L14.5 8.5"
    tip = "Drag from one point to another to measure distance and angle. Ends snap to corners and to the sensor"
    shape = Qt.CursorShape.CrossCursor

    def press(self, point: Point) -> bool:
        """Set the first end."""
        self._start = snapped(self._context, point)
        return True

    def drag(self, to: Point) -> None:
        """Set the second end."""
        end = snapped(self._context, to)
        text = ruler_text(self._start, end, self._context.shown.look.unit)
        self._context.measure(self._start, end, text)
        self._context.show_message(text)


class WallPencil(Tool):
    """Adds a wall. The prediction is updated during the drag."""

    name, key = "Wall", "W"
    picture = "M6.5 17.5L17.5 6.5M3 19A2 2 0 1 0 7 19 2 2 0 1 0 3 19M17 5A2 2 0 1 0 21 5 2 2 0 1 0 17 5"
    tip = "Click each corner of new walls; Esc ends. Or drag from one end of a wall to the other. Ends snap to corners"
    shape = Qt.CursorShape.CrossCursor
    can_edit = True
    stem = WALL  # first word of the new object's name
    chains = True  # whether the second point is also the first one of the next object

    def __init__(self, context: "PlanController") -> None:
        super().__init__(context)
        self._before: Scene  # these two: the scene and the first point, from the press on
        self._start: Point
        self._gesture: object = None
        self._end: Point | None = None  # the second point, once there is one
        self._waiting = False  # whether the first end was clicked, and the second not yet
        self._expected: Scene | None = None  # the scene while nothing but this tool changes it

    @property
    def gesture(self) -> object:
        """The identity of the current drag."""
        return self._gesture

    @property
    def waiting(self) -> bool:
        """Whether the second end is not set yet."""
        return self._waiting

    def click(self, point: Point) -> bool:
        """Set the first point, or the second one, which a chain goes on from; a click on the same point ends it."""
        if self._waiting and self._context.scene is self._expected:
            if math.dist(self._start, snapped(self._context, point, scene=self._before)) < _SHORTEST:
                self.pause()
                self._waiting = False
                return True
            self.drag(point)
            if not self.chains or self._end is None:
                self._waiting = False
                return True
            point = self._end
        self.press(point)
        self._waiting = True
        self._context.show_message("click again for the other end, or press Esc")
        return True

    def pause(self) -> None:
        """Remove what is drawn before the second click."""
        self._expected, self._end = self._before, None
        self._context.drop(self._gesture)

    def press(self, point: Point) -> bool:
        """Set the first point."""
        self._waiting, self._end = False, None
        self._before, self._start, self._gesture = self._context.scene, snapped(self._context, point), object()
        self._expected = self._before
        return True

    def drag(self, to: Point) -> None:
        """Set the second point. After an undo or another edit, a tool that waits for this point starts again."""
        if self._waiting and self._context.scene is not self._expected:
            self._waiting = False
            return
        end = snapped(self._context, to, scene=self._before)
        if math.dist(self._start, end) < _SHORTEST:
            return
        edit, size = lambda scene: self._drawn(scene, end), lambda: self._size(end)
        if self._context.change(edit, self._before, self._gesture, size):
            self._end, self._expected = end, self._context.scene
            if self._before.room is not None:
                self._context.choose_surface(free_name(self._before.room, self.stem))

    def _drawn(self, scene: Scene, end: Point) -> edits.Edit:
        return edits.with_wall(scene, self._start, end)

    def _size(self, end: Point) -> str:
        return ruler_text(self._start, end, self._context.shown.look.unit)


class PostPencil(WallPencil):
    """Adds a post, by its centre and a point of its rim."""

    name, key = "Post", "P"
    picture = "M12 5A7 7 0 1 0 12 19 7 7 0 1 0 12 5M12 11.8V12.2"
    tip = "Drag from the centre of a new post to its rim, or click both"
    stem, chains = POST, False

    def _drawn(self, scene: Scene, end: Point) -> edits.Edit:
        return edits.with_post(scene, self._start, round(math.dist(self._start, end), 3))

    def _size(self, end: Point) -> str:
        return f"radius {self._context.shown.look.unit.text(math.dist(self._start, end))}"


REMOVE = "M5 7H19M9.5 7V4H14.5V7M7 7L8 20H16L17 7M10.3 10.5V16.5M13.7 10.5V16.5"  # the picture of its button
TOOLS = (Hand, Asker, Ruler, Pencil, WallPencil, PostPencil)


def snapped(context: "PlanController", place: Point, ignored: Point | None = None, scene: Scene | None = None) -> Point:
    """Return the corner or sensor near a point, or else the point rounded to 1 mm. `ignored`: a corner to skip."""
    scene = scene or context.scene
    targets = [*corners(scene.room), scene.pose.position] if scene.room else [scene.pose.position]
    near = [point for point in targets if point != ignored and math.dist(point, place) <= _SNAP * context.pixel]
    return min(near, key=lambda point: math.dist(point, place)) if near else edits.on_grid(place)


def ruler_text(start: Point, end: Point, unit: LengthUnit) -> str:
    """Return the text of distance and direction."""
    return f"{unit.text(math.dist(start, end))} at {heading_text(edits.bearing(start, end))}"


# The controller of a plan: passes mouse and key events to the active tool, and its edits to the window.


NUDGE, TURN = 0.01, math.radians(1.0)  # m, rad: of one key press
_PAUSE = 1.0  # s: key presses with shorter pauses are one undo step
_GRIPPED = {
    edits.GripPart.SENSOR: Qt.CursorShape.OpenHandCursor,
    edits.GripPart.BEAM: Qt.CursorShape.PointingHandCursor,
}


class PlanController:
    """Holds the active tool and the selected wall or post."""

    def __init__(self, drawing: Any, gestures: Gestures) -> None:
        """`drawing`: the `PlanDrawing`, which has this controller."""
        self._drawing, self._gestures = drawing, gestures
        self.tool: Tool = Hand(self)
        self._busy = False  # during a drag that the tool uses
        self._cancelled = False  # whether to ignore the rest of a cancelled drag
        self.chosen: str | None = None  # name of a wall or post, because indices change
        self._before: str | None = None  # `chosen` when the drag began
        self.clock: Callable[[], float] = time.monotonic
        self._last_key, self._key_gesture = -math.inf, object()
        self._last_edit: tuple[Scene, Shown] | None = None  # scene of the last edit, and what was shown before it

    # for the tools

    @property
    def shown(self) -> Shown:
        """What is drawn."""
        shown: Shown | None = self._drawing.shown
        assert shown is not None, "nothing is shown yet"
        return shown

    @property
    def scene(self) -> Scene:
        """The scene with all edits, including those not drawn yet."""
        if self._last_edit is not None and self._last_edit[1] is self.shown:
            return self._last_edit[0]
        return self.shown.scene

    @property
    def handle_at(self) -> Point | None:
        """Where the beam can be dragged, m."""
        handle: Point | None = self._drawing.sensor.handle_at
        return handle

    @property
    def pixel(self) -> float:
        """The length of a pixel, m."""
        return float(self._drawing.pixel)

    def change(
        self, edit: Callable[[Scene], edits.Edit], scene: Scene, gesture: object, message: Callable[[], str] = str
    ) -> bool:
        """Apply an edit to the scene from before the gesture, and show `message` of what is now there.

        A rejected edit shows its error and returns False.
        """
        try:
            changed, label = edit(scene)
        except InputError as error:
            self.show_message(f"⚠ {error}")
            return False
        self._last_edit = changed, self.shown
        self._gestures.edited.emit(changed, label, gesture)
        self.show_message(message())
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
        self._drawing.ruler.draw(start, end, text)

    def ask(self, point: Point) -> None:
        """Explain the heading from the sensor to a point."""
        self._gestures.asked.emit(edits.bearing(self.scene.pose.position, point))

    def show_message(self, text: str) -> None:
        """Show one line of text beside the tools."""
        self._drawing.message_changed.emit(text)

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
        self._drawing.ruler.clear()
        self._drawing.setCursor(self.tool.shape)
        self._drawing.draw_room()
        self.show_message("")

    def remove_chosen(self) -> None:
        """Remove the selected wall or post."""
        surface = self.chosen_surface
        if surface is None:
            self.show_message("⚠ Edit (E) selects what to remove")
        elif self.change(lambda scene: edits.without_surface(scene, surface), self.scene, None):
            self.choose_surface(None)

    def nudge(self, right: int, up: int) -> None:
        """Move the sensor by steps of `NUDGE`; with a tool that edits, move the selected wall or post."""
        surface, room = self.chosen_surface, self.scene.room
        by = right * NUDGE, up * NUDGE
        if self.tool.can_edit and surface is not None and room is not None:
            part = edits.GripPart.WALL if surface < len(room.walls) else edits.GripPart.POST
            self._by_key(lambda scene: edits.dragged(scene, edits.Grip(part, (0.0, 0.0), surface), by))
        else:
            self._by_key(lambda scene: edits.dragged(scene, edits.Grip(edits.GripPart.SENSOR, (0.0, 0.0)), by))

    def turn(self, left: int) -> None:
        """Turn the sensor counter-clockwise by steps of `TURN`."""
        self._by_key(lambda scene: edits.sensor_turned(scene, left * TURN))

    def _by_key(self, edit: Callable[[Scene], edits.Edit]) -> None:
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
            if self._busy:
                self._gestures.pointed.emit(None)  # it does not follow a drag
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
        self._drawing.ruler.clear()
        self.show_message("")
        return True

    def click(self, event: MouseClickEvent) -> None:
        """Select a surface with a tool that edits; otherwise select a reading, or ask the heading of the outline."""
        if self._drawing.shown is None:
            return
        room, point = self.scene.room, self._drawing.point_at(event.scenePos())
        if room is None or not self.tool.can_edit:
            if self.tool.asks or (not self._drawing.pick(event) and self._drawing.on_outline(point)):
                self.ask(point)
            return
        if self.tool.click(point):
            return
        surface = edits.surface_at(room, point, self.pixel)
        if event.double() and surface is not None and surface < len(room.walls):
            self.change(lambda scene: edits.with_corner(scene, surface, point), self.scene, None)
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
        point = self._drawing.point_at(position)
        if self.tool.waiting:
            self.tool.drag(point)
            return
        grip = self.tool.grip(point)
        shape = self.tool.shape if grip is None else _GRIPPED.get(grip.part, Qt.CursorShape.SizeAllCursor)
        self._drawing.setCursor(shape)
        self.show_message(text_under_pointer(self.shown, grip, point, self.pixel))
        middle = self.shown.scene.pose.position
        self._gestures.pointed.emit(Cursor(edits.bearing(middle, point) % math.tau, math.dist(middle, point)))

    def _leave(self) -> None:
        if self.tool.waiting:
            self.tool.pause()
        self._gestures.pointed.emit(None)
        self.show_message("")
