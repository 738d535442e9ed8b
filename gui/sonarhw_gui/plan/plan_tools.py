"""The tools of the plan, one class each. A tool keeps the state of one drag only; points are in metres."""

import math
from collections.abc import Callable
from typing import Protocol

from PySide6.QtCore import Qt
from sonarhw_compare.edits import POST, WALL, Point, add_post, add_wall, corners, free_name
from sonarhw_compare.scans import heading_text

from sonarhw_gui.look.appearance import LengthUnit
from sonarhw_gui.plan.plan_texts import point_text, pose_text
from sonarhw_gui.scene.grips import Grip, GripPart, room_grip, sensor_grip
from sonarhw_gui.scene.scene import Scene
from sonarhw_gui.scene.scene_edit import Edit, bearing, dragged, on_grid, room_and_place, with_room
from sonarhw_gui.shown.shown import Shown

_SHORTEST = 0.005  # m, of a wall or a radius; a shorter drag is ignored
_SNAP = 9.0  # pixels


class ToolContext(Protocol):
    """The interface of the plan for a tool."""

    @property
    def shown(self) -> Shown:
        """What is drawn."""

    @property
    def scene(self) -> Scene:
        """The scene with all edits, including those not drawn yet."""

    @property
    def handle_at(self) -> Point | None:
        """Where the beam can be dragged, m."""

    @property
    def pixel(self) -> float:
        """The length of a pixel, m."""

    def change(self, edit: Callable[[Scene], Edit], scene: Scene, gesture: object) -> bool:
        """Apply an edit to the scene from before the gesture; return whether it was accepted."""

    def drop(self, gesture: object) -> None:
        """Undo the edits of an unfinished gesture."""

    def choose_surface(self, name: str | None) -> None:
        """Select the wall or post that keys and panel act on."""

    def measure(self, start: Point, end: Point, text: str) -> None:
        """Draw the ruler."""

    def ask(self, at: Point) -> None:
        """Explain the heading from the sensor to a point."""

    def show_message(self, text: str) -> None:
        """Show one line of text beside the tools."""


class Tool:
    """A tool that uses no drag, so that every drag pans the plan."""

    name, key, tip = "", "", ""
    shape = Qt.CursorShape.ArrowCursor
    edits = False  # whether it drags or adds walls and posts
    asks = False  # whether a click explains a heading

    def __init__(self, context: ToolContext) -> None:
        self._context = context

    @property
    def gesture(self) -> object:
        """The identity of the current drag's edits; None if the tool does not edit."""
        return None

    def press(self, at: Point) -> bool:
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

    def click(self, at: Point) -> bool:
        """Use a click; return whether the tool uses clicks."""
        return False

    def grip(self, at: Point) -> Grip | None:
        """Return the part that a drag from there would move."""
        return None


class Hand(Tool):
    """Moves and turns the sensor; any other drag pans."""

    name, key = "Hand", "H"
    tip = "Drag the sensor or the handle on its beam. Drag elsewhere to pan. Click a reading to select it"

    def __init__(self, context: ToolContext) -> None:
        super().__init__(context)
        self._held: tuple[Grip, Scene] | None = None  # and the scene when the drag began

    @property
    def gesture(self) -> object:
        """The part being dragged, with the scene when the drag began."""
        return self._held

    def grip(self, at: Point) -> Grip | None:
        """Return the sensor or the beam, if it is there."""
        context = self._context
        return sensor_grip(context.scene, context.handle_at, at, context.pixel)

    def press(self, at: Point) -> bool:
        """Begin to drag the part that is there."""
        grip = self.grip(at)
        self._held = None if grip is None else (grip, self._context.scene)
        return grip is not None

    def drag(self, to: Point) -> None:
        """Move the part with the mouse."""
        if self._held is not None:
            grip, before = self._held
            if grip.part is GripPart.BEAM and self._context.shown.asked is not None:
                self._context.ask(to)  # the beam of a question turns without the turntable
                return
            if grip.part is GripPart.CORNER:
                to = snapped(self._context, to, ignored=grip.at, scene=before)
            if self._context.change(lambda scene: dragged(scene, grip, to), before, self._held):
                self._context.show_message(self._where(grip, to))

    def _where(self, grip: Grip, to: Point) -> str:
        unit = self._context.shown.look.unit
        if grip.part in (GripPart.SENSOR, GripPart.BEAM):
            return pose_text(self._context.scene, unit)
        return point_text(to, unit)


class Asker(Tool):
    """Turns the beam to any heading and explains it; the turntable stays."""

    name, key = "Ask", "Q"
    tip = "Click or drag to explain any heading without a scan; [ and ] turn by 1°. Esc returns to the readings"
    shape = Qt.CursorShape.CrossCursor
    asks = True

    def press(self, at: Point) -> bool:
        """Ask the heading of this point."""
        self._context.ask(at)
        return True

    def drag(self, to: Point) -> None:
        """Turn the beam with the mouse."""
        self._context.ask(to)


class Pencil(Hand):
    """Also moves corners, walls and posts."""

    name, key = "Edit", "E"
    tip = "Drag corners, walls, posts or rims. Click to select, Del to remove, double-click a wall to add a corner"
    edits = True

    def grip(self, at: Point) -> Grip | None:
        """Return the sensor or beam, or else the part of the room that is there."""
        scene = self._context.scene
        over = super().grip(at)
        return over or (room_grip(scene.room, at, self._context.pixel) if scene.room else None)

    def press(self, at: Point) -> bool:
        """Begin to drag the part that is there, and select its wall or post."""
        taken = super().press(at)
        room, surface = self._context.scene.room, self._held[0].surface if self._held else None
        if room is not None and surface is not None:
            self._context.choose_surface(room.names[surface])
        return taken


class Ruler(Tool):
    """Measures distance and angle."""

    name, key = "Ruler", "M"
    tip = "Drag from one point to another to measure distance and angle. Ends snap to corners and to the sensor"
    shape = Qt.CursorShape.CrossCursor

    def press(self, at: Point) -> bool:
        """Set the first end."""
        self._start = snapped(self._context, at)
        return True

    def drag(self, to: Point) -> None:
        """Set the second end."""
        end = snapped(self._context, to)
        text = ruler_text(self._start, end, self._context.shown.look.unit)
        self._context.measure(self._start, end, text)
        self._context.show_message(text)


class _Drawing(Tool):
    """Adds a wall or post. The prediction is updated during the drag."""

    shape = Qt.CursorShape.CrossCursor
    edits = True
    stem = ""  # first word of the new object's name
    chains = False  # whether the second point is also the first one of the next object

    def __init__(self, context: ToolContext) -> None:
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

    def click(self, at: Point) -> bool:
        """Set the first point, or the second one, which a chain goes on from; a click on the same point ends it."""
        if self._waiting and self._context.scene is self._expected:
            if math.dist(self._start, snapped(self._context, at, scene=self._before)) < _SHORTEST:
                self.pause()
                self._waiting = False
                return True
            self.drag(at)
            if not self.chains or self._end is None:
                self._waiting = False
                return True
            at = self._end
        self.press(at)
        self._waiting = True
        self._context.show_message("click again for the other end, or press Esc")
        return True

    def pause(self) -> None:
        """Remove what is drawn before the second click."""
        self._expected, self._end = self._before, None
        self._context.drop(self._gesture)

    def press(self, at: Point) -> bool:
        """Set the first point."""
        self._waiting, self._end = False, None
        self._before, self._start, self._gesture = self._context.scene, snapped(self._context, at), object()
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
        if self._context.change(lambda scene: self._drawn(scene, end), self._before, self._gesture):
            self._end, self._expected = end, self._context.scene
            self._context.show_message(self._size(end))
            if self._before.room is not None:
                self._context.choose_surface(free_name(self._before.room, self.stem))

    def _drawn(self, scene: Scene, end: Point) -> Edit:
        raise NotImplementedError

    def _size(self, end: Point) -> str:
        return ruler_text(self._start, end, self._context.shown.look.unit)


class WallPencil(_Drawing):
    """Adds a wall."""

    name, key, stem = "Wall", "W", WALL
    tip = "Click each corner of new walls; Esc ends. Or drag from one end of a wall to the other. Ends snap to corners"
    chains = True

    def _drawn(self, scene: Scene, end: Point) -> Edit:
        room, _ = room_and_place(scene)
        return with_room(scene, add_wall(room, self._start, end, room.materials[0])), "adding a wall"


class PostPencil(_Drawing):
    """Adds a post."""

    name, key, stem = "Post", "P", POST
    tip = "Drag from the centre of a new post to its rim, or click both"

    def _drawn(self, scene: Scene, end: Point) -> Edit:
        room, _ = room_and_place(scene)
        radius = round(math.dist(self._start, end), 3)
        return with_room(scene, add_post(room, self._start, radius, room.materials[0])), "adding a post"

    def _size(self, end: Point) -> str:
        return f"radius {self._context.shown.look.unit.text(math.dist(self._start, end))}"


TOOLS = (Hand, Asker, Ruler, Pencil, WallPencil, PostPencil)


def snapped(context: ToolContext, at: Point, ignored: Point | None = None, scene: Scene | None = None) -> Point:
    """Return the corner or sensor near a point, or else the point rounded to 1 mm. `ignored`: a corner to skip."""
    scene = scene or context.scene
    known = [*corners(scene.room), scene.pose.position] if scene.room else [scene.pose.position]
    near = [point for point in known if point != ignored and math.dist(point, at) <= _SNAP * context.pixel]
    return min(near, key=lambda point: math.dist(point, at)) if near else on_grid(at)


def ruler_text(start: Point, end: Point, unit: LengthUnit) -> str:
    """Return the text of distance and direction."""
    return f"{unit.text(math.dist(start, end))} at {heading_text(bearing(start, end))}"
