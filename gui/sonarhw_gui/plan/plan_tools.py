"""The tools of the plan: what a hand does in it. One class a tool; a tool holds nothing but the gesture it is in.

Takes points on the plan (m); hands on edits, words and a sketch through the `ToolContext` that it works on.
"""

import math
from collections.abc import Callable
from typing import Protocol

from PySide6.QtCore import Qt
from sonarhw_compare.headings import heading_text

from sonarhw_gui.look.appearance import LengthUnit
from sonarhw_gui.plan.plan_texts import point_text, pose_text
from sonarhw_gui.scene.grips import Grip, GripPart, room_grip, sensor_grip
from sonarhw_gui.scene.room_edit import POST, WALL, Point, add_post, add_wall, corners, free_name
from sonarhw_gui.scene.scene import Scene
from sonarhw_gui.scene.scene_edit import Edit, bearing, dragged, on_grid, room_and_place, with_room
from sonarhw_gui.shown.shown import Shown

_SHORTEST = 0.005  # m: of a wall or a radius; less is a slip of the hand
_SNAP = 9.0  # pixels


class ToolContext(Protocol):
    """What a tool works on."""

    @property
    def shown(self) -> Shown:
        """What lies there."""

    @property
    def scene(self) -> Scene:
        """The scene with all edits, those that are not shown yet as well."""

    @property
    def handle_at(self) -> Point | None:
        """Where the beam can be taken hold of, m."""

    @property
    def pixel(self) -> float:
        """How long one is, m."""

    def change(self, edit: Callable[[Scene], Edit], scene: Scene, gesture: object) -> bool:
        """Do an edit to the scene as it was when the gesture began; whether it was allowed."""

    def choose_surface(self, name: str | None) -> None:
        """Let a wall or post be the one that keys and panel are about."""

    def measure(self, start: Point, end: Point, text: str) -> None:
        """Lay the ruler."""

    def show_message(self, text: str) -> None:
        """Say something beside the tools."""


class Tool:
    """Does nothing, and so lets the hand move the paper."""

    name, key, tip = "", "", ""
    shape = Qt.CursorShape.ArrowCursor
    edits = False  # walls and posts are taken hold of

    def __init__(self, context: ToolContext) -> None:
        self._context = context

    @property
    def gesture(self) -> object:
        """What the edits of a drag under way are known by; None where it edits nothing."""
        return None

    def press(self, at: Point) -> bool:
        """The hand goes down; whether the tool takes the gesture. If not, it moves the paper."""
        return False

    def drag(self, to: Point) -> None:
        """The hand moves."""

    def grip(self, at: Point) -> Grip | None:
        """What it would take hold of there."""
        return None


class Hand(Tool):
    """Moves and turns the sensor; anywhere else it moves the paper."""

    name, key = "Hand", "H"
    tip = "Drag the sensor or the handle on its beam; anywhere else, the paper. A click asks about a reading"

    def __init__(self, context: ToolContext) -> None:
        super().__init__(context)
        self._held: tuple[Grip, Scene] | None = None  # and the scene when it was taken

    @property
    def gesture(self) -> object:
        """What is held."""
        return self._held

    def grip(self, at: Point) -> Grip | None:
        """Sensor or beam."""
        context = self._context
        return sensor_grip(context.scene, context.handle_at, at, context.pixel)

    def press(self, at: Point) -> bool:
        """Take hold of what is there."""
        grip = self.grip(at)
        self._held = None if grip is None else (grip, self._context.scene)
        return grip is not None

    def drag(self, to: Point) -> None:
        """Have it follow."""
        if self._held is not None:
            grip, before = self._held
            if grip.part is GripPart.CORNER:
                to = snapped(self._context, to, besides=grip.at, scene=before)
            if self._context.change(lambda scene: dragged(scene, grip, to), before, self._held):
                self._context.show_message(self._where(grip, to))

    def _where(self, grip: Grip, to: Point) -> str:
        unit = self._context.shown.look.unit
        if grip.part in (GripPart.SENSOR, GripPart.BEAM):
            return pose_text(self._context.scene, unit)
        return point_text(to, unit)


class Pencil(Hand):
    """Moves corners, walls and posts, too."""

    name, key = "Edit", "E"
    tip = "Drag corners, walls, posts and rims; a click chooses, Del takes out, a double click in a wall adds a corner"
    edits = True

    def grip(self, at: Point) -> Grip | None:
        """Sensor or beam, then what belongs to the room."""
        scene = self._context.scene
        over = super().grip(at)
        return over or (room_grip(scene.room, at, self._context.pixel) if scene.room else None)

    def press(self, at: Point) -> bool:
        """Take hold of what is there, and choose it."""
        taken = super().press(at)
        room, surface = self._context.scene.room, self._held[0].surface if self._held else None
        if room is not None and surface is not None:
            self._context.choose_surface(room.names[surface])
        return taken


class Ruler(Tool):
    """Measures."""

    name, key = "Ruler", "M"
    tip = "Drag from one point to another: distance and angle. It finds corners and the sensor by itself"
    shape = Qt.CursorShape.CrossCursor

    def press(self, at: Point) -> bool:
        """One end."""
        self._start = snapped(self._context, at)
        return True

    def drag(self, to: Point) -> None:
        """The other."""
        end = snapped(self._context, to)
        text = ruled(self._start, end, self._context.shown.look.unit)
        self._context.measure(self._start, end, text)
        self._context.show_message(text)


class _Drawing(Tool):
    """Puts something new into the room; the prediction follows while it is drawn."""

    shape = Qt.CursorShape.CrossCursor
    edits = True
    stem = ""  # of the name of what is drawn
    _gesture: object = None

    @property
    def gesture(self) -> object:
        """The drawing of one thing."""
        return self._gesture

    def press(self, at: Point) -> bool:
        """Where it begins."""
        self._before, self._start, self._gesture = self._context.scene, snapped(self._context, at), object()
        return True

    def drag(self, to: Point) -> None:
        """How large it is."""
        end = snapped(self._context, to, scene=self._before)
        if math.dist(self._start, end) < _SHORTEST:
            return
        if self._context.change(lambda scene: self._drawn(scene, end), self._before, self._gesture):
            self._context.show_message(self._size(end))
            if self._before.room is not None:
                self._context.choose_surface(free_name(self._before.room, self.stem))

    def _drawn(self, scene: Scene, end: Point) -> Edit:
        raise NotImplementedError

    def _size(self, end: Point) -> str:
        return ruled(self._start, end, self._context.shown.look.unit)


class WallPencil(_Drawing):
    """Draws a wall."""

    name, key, stem = "Wall", "W", WALL
    tip = "Drag from one end of a new wall to the other; ends that come near a corner meet it"

    def _drawn(self, scene: Scene, end: Point) -> Edit:
        room, _ = room_and_place(scene)
        return with_room(scene, add_wall(room, self._start, end, room.materials[0])), "adding a wall"


class PostPencil(_Drawing):
    """Draws a post."""

    name, key, stem = "Post", "P", POST
    tip = "Drag from the middle of a new post to its rim"

    def _drawn(self, scene: Scene, end: Point) -> Edit:
        room, _ = room_and_place(scene)
        radius = round(math.dist(self._start, end), 3)
        return with_room(scene, add_post(room, self._start, radius, room.materials[0])), "adding a post"

    def _size(self, end: Point) -> str:
        return f"radius {self._context.shown.look.unit.text(math.dist(self._start, end))}"


TOOLS = (Hand, Ruler, Pencil, WallPencil, PostPencil)


def snapped(context: ToolContext, at: Point, besides: Point | None = None, scene: Scene | None = None) -> Point:
    """The corner or sensor near a point, else the point to the millimetre; `besides` is no corner to find."""
    scene = scene or context.scene
    known = [*corners(scene.room), scene.pose.position] if scene.room else [scene.pose.position]
    near = [point for point in known if point != besides and math.dist(point, at) <= _SNAP * context.pixel]
    return min(near, key=lambda point: math.dist(point, at)) if near else on_grid(at)


def ruled(start: Point, end: Point, unit: LengthUnit) -> str:
    """Distance and direction as people read them."""
    return f"{unit.text(math.dist(start, end))} at {heading_text(bearing(start, end))}"
