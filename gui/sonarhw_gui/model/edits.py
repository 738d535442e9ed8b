"""Edits of a scene, each with its label for undo: sensor, surfaces, materials, air, board.

An impossible edit raises InputError.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import Enum, auto
from typing import Any

import numpy as np
from sonarhw_compare import edits as room_edits
from sonarhw_sim.board.profile import Board
from sonarhw_sim.room.room import Place, Room, wall_distances
from sonarhw_sim.room.room_file import MAX_COORDINATE
from sonarhw_sim.room.room_writing import materials, with_air, with_material, with_place

from sonarhw.errors import InputError
from sonarhw_gui.model.scene import Scene, dragged_places, position_name

# The parts of the plan that the mouse can drag, and which of them is under the pointer.
#
# Small parts have priority: sensor and beam handle, then corners and rims of posts, then walls and posts.


REACH = 9.0  # pixels
_SENSOR_REACH = 11.0  # it is drawn larger


class GripPart(Enum):
    """The part of the plan that a grip moves."""

    SENSOR = auto()
    BEAM = auto()  # the handle on the beam, which turns the sensor
    CORNER = auto()
    RIM = auto()  # of a post
    WALL = auto()
    POST = auto()


@dataclass(frozen=True)
class Grip:
    """One part that can be dragged."""

    part: GripPart
    point: room_edits.Point  # m; of a corner: the corner itself, else the point where the drag began
    surface: int | None = None  # number of the wall or post


def sensor_grip(scene: Scene, handle: room_edits.Point | None, point: room_edits.Point, pixel: float) -> Grip | None:
    """Return the sensor or its beam handle if one is within reach of a point; `pixel` is the size of a pixel, m."""
    if scene.place is None:
        return None
    if math.dist(scene.pose.position, point) <= _SENSOR_REACH * pixel:
        return Grip(GripPart.SENSOR, point)
    if handle is not None and math.dist(handle, point) <= _SENSOR_REACH * pixel:
        return Grip(GripPart.BEAM, point)
    return None


def room_grip(room: Room, point: room_edits.Point, pixel: float) -> Grip | None:
    """Return the corner, rim, wall or post within reach of a point."""
    reach = REACH * pixel
    ends = room_edits.corners(room)
    away = np.hypot(*(np.array(ends) - point).T)
    nearest = int(np.argmin(away))
    if away[nearest] <= reach:
        return Grip(GripPart.CORNER, ends[nearest])
    surface = surface_at(room, point, pixel)
    if surface is None:
        return None
    if surface < len(room.walls):
        return Grip(GripPart.WALL, point, surface)
    x, y, radius = room.posts[surface - len(room.walls)]
    on_rim = math.dist((x, y), point) >= max(radius - reach, radius / 2)
    return Grip(GripPart.RIM if on_rim else GripPart.POST, point, surface)


def surface_at(room: Room, point: room_edits.Point, pixel: float) -> int | None:
    """Return the number of the nearest wall or post within reach of a point; inside a post, of this post."""
    walls = wall_distances(np.array([point]), room.walls)[0]
    posts = np.maximum(np.hypot(*(room.posts[:, :2] - point).T) - room.posts[:, 2], 0.0)
    distances = np.concatenate((posts, walls))
    nearest = int(np.argmin(distances))
    if distances[nearest] > REACH * pixel:
        return None
    return nearest - len(posts) if nearest >= len(posts) else len(walls) + nearest


GRID = 0.001  # m; the mouse is not more precise, and files stay readable
_SMALLEST_RADIUS = 0.002  # m
_NEW = 0.9  # reflectance of a new material, as an amplitude ratio
Edit = tuple[Scene, str]  # the new scene, and the label of the edit


def dragged(scene: Scene, grip: Grip, to: room_edits.Point) -> Edit:
    """Return the scene with the gripped part dragged to a point. Raises InputError if it cannot be there."""
    room, place = room_and_place(scene)
    by = to[0] - grip.point[0], to[1] - grip.point[1]
    if grip.part is GripPart.SENSOR:
        return sensor_at(scene, _sum(place.position, by))
    if grip.part is GripPart.BEAM:
        return sensor_turned(scene, bearing(place.position, to) - bearing(place.position, grip.point))
    if grip.surface is None:
        return with_room(scene, room_edits.move_corner(room, grip.point, on_grid(to))), "moving a corner"
    name = room.names[grip.surface]
    if grip.part is GripPart.WALL:
        return with_room(scene, room_edits.move_wall(room, grip.surface, on_grid(by))), f"moving {name}"
    x, y, radius = map(float, room.posts[grip.surface - len(room.walls)])
    if grip.part is GripPart.POST:
        return with_room(scene, room_edits.move_post(room, grip.surface, on_grid(_sum((x, y), by)))), f"moving {name}"
    radius += math.dist((x, y), to) - math.dist((x, y), grip.point)
    radius = max(_SMALLEST_RADIUS, on_grid((radius, 0.0))[0])
    return with_room(scene, room_edits.resize_post(room, grip.surface, radius)), f"resizing {name}"


def sensor_at(scene: Scene, position: room_edits.Point) -> Edit:
    """Return the scene with the sensor at a position and its heading unchanged. Raises InputError inside a post."""
    _, place = room_and_place(scene)
    position = on_grid(position)
    if max(map(abs, position)) > MAX_COORDINATE:
        raise InputError(f"the sensor can be at most {MAX_COORDINATE:g} m from the origin, in x and in y")
    return with_sensor_at(scene, position, place.heading), "moving the sensor"


def sensor_turned(scene: Scene, by: float) -> Edit:
    """Return the scene with the turntable's step 0 turned counter-clockwise by an angle, rad."""
    _, place = room_and_place(scene)
    return sensor_facing(scene, place.heading + by)


def sensor_facing(scene: Scene, heading: float) -> Edit:
    """Return the scene with the turntable's step 0 at a heading, rad, rounded to a tenth of a degree."""
    _, place = room_and_place(scene)
    heading = math.radians(round(math.degrees(heading) % 360, 1))
    return with_sensor_at(scene, place.position, heading), "turning the sensor"


def with_named_place(scene: Scene, name: str) -> Edit:
    """Return the scene with the sensor's place added to the room under a name; a place of this name is replaced.

    Its place without a name is removed.
    """
    room, place = room_and_place(scene)
    kept = with_place(room, replace(place, name=name), set(dragged_places(room)) - {name})
    return replace(scene, room=kept, place=kept.places[name]), f"adding place {name}"


def with_wall(scene: Scene, start: room_edits.Point, end: room_edits.Point) -> Edit:
    """Return the scene with an additional wall, of the material of the first one."""
    room, _ = room_and_place(scene)
    return with_room(scene, room_edits.add_wall(room, start, end, room.materials[0])), "adding a wall"


def with_post(scene: Scene, centre: room_edits.Point, radius: float) -> Edit:
    """Return the scene with an additional post, of the material of the first wall."""
    room, _ = room_and_place(scene)
    return with_room(scene, room_edits.add_post(room, centre, radius, room.materials[0])), "adding a post"


def without_surface(scene: Scene, surface: int) -> Edit:
    """Return the scene without a wall or a post."""
    room, _ = room_and_place(scene)
    return with_room(scene, room_edits.remove_surface(room, surface)), f"removing {room.names[surface]}"


def with_corner(scene: Scene, wall: int, point: room_edits.Point) -> Edit:
    """Return the scene with an additional corner in a wall, at its point nearest to `point`."""
    room, _ = room_and_place(scene)
    return with_room(scene, room_edits.split_wall(room, wall, point)), f"adding a corner in {room.names[wall]}"


def with_surface_material(scene: Scene, surface: int, material: str) -> Edit:
    """Return the scene with another material of a surface."""
    room, _ = room_and_place(scene)
    return with_room(
        scene, room_edits.set_material(room, surface, material)
    ), f"setting {room.names[surface]} to {material}"


def with_material_values(scene: Scene, material: str, shares: Mapping[str, float] | None = None) -> Edit:
    """Return the scene with another `reflectance` (amplitude ratio) or `scatter` (share of power) of a material.

    An unknown material is created, with a reflectance of 0.9.
    """
    room, _ = room_and_place(scene)
    before = materials(room).get(material)
    # a reflectance of None keeps a table
    reflectance, scatter = (before.reflectance, before.scatter) if before else (_NEW, 0.0)
    shares = shares or {}
    reflectance, scatter = shares.get("reflectance", reflectance), shares.get("scatter", scatter)
    return with_room(scene, with_material(room, material, reflectance, scatter)), f"changing {material}"


def with_air_state(scene: Scene, **state: float) -> Edit:
    """Return the scene with another `temperature_c`, `relative_humidity` or `pressure_kpa` of the air."""
    room, _ = room_and_place(scene)
    return with_room(scene, with_air(room, replace(room.air, **state))), "changing the air"


def with_options(scene: Scene, **options: Any) -> Edit:
    """Return the scene with other `PredictionOptions`."""
    return replace(scene, options=replace(scene.options, **options)), "changing the prediction options"


def with_board(scene: Scene, board: Board) -> Edit:
    """Return the scene with another board, and with the receiver and the edge strength that its profile names."""
    options = replace(scene.options, receiver=None, edge_strength=None)
    return replace(scene, board=board, options=options), f"choosing board {board.name}"


def with_room(scene: Scene, room: Room) -> Scene:
    """Return the scene with another room. Raises InputError if the sensor would be inside a post."""
    _, place = room_and_place(scene)
    _check_free(room, place)
    return replace(scene, room=room)


def room_and_place(scene: Scene) -> tuple[Room, Place]:
    """Return the room and the place of a scene. Raises InputError if it has none."""
    if scene.room is None or scene.place is None:
        raise InputError("the scene has no room; open a room file")
    return scene.room, scene.place


def bearing(middle: room_edits.Point, point: room_edits.Point) -> float:
    """Return the direction from one point to another, rad."""
    return math.atan2(point[1] - middle[1], point[0] - middle[0])


def on_grid(point: room_edits.Point) -> room_edits.Point:
    """Return the point rounded to whole millimetres."""
    x, y = (round(value / GRID) * GRID for value in point)
    return round(x, 6), round(y, 6)


def _sum(point: room_edits.Point, by: room_edits.Point) -> room_edits.Point:
    return point[0] + by[0], point[1] + by[1]


def with_sensor_at(scene: Scene, position: room_edits.Point, heading: float) -> Scene:
    """Return the scene with the sensor at a point (m) and its step 0 at a heading (rad).

    Raises InputError inside a post.
    """
    room, before = room_and_place(scene)
    # a new place, named as by `--place X,Y`: the places of the file do not change
    place = Place(position_name(position), position, heading, before.height)
    _check_free(room, place)
    return replace(scene, place=place)


def _check_free(room: Room, place: Place) -> None:
    for post in room.posts_at(place.position):
        low, high = room.heights[post]
        if place.height is None or low <= place.height <= high:
            raise InputError(f"the sensor cannot be inside {room.names[post]}: no sound could leave it")
