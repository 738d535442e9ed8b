"""Edits of a scene, each with its label for undo: sensor, surfaces, materials, air, board.

An edit that is not possible raises InputError and changes nothing.
"""

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from sonarhw_sim.board.profile import Board
from sonarhw_sim.room.model import Place, Room
from sonarhw_sim.room.room_file import MAX_COORDINATE
from sonarhw_sim.room.room_writing import materials, with_air, with_material, with_place

from sonarhw.errors import InputError
from sonarhw_gui.scene.grips import Grip, GripPart
from sonarhw_gui.scene.room_edit import (
    Point,
    move_corner,
    move_post,
    move_wall,
    remove_surface,
    resize_post,
    set_material,
    split_wall,
)
from sonarhw_gui.scene.scene import Scene

GRID = 0.001  # m: a hand is no more exact, and files stay readable
_SMALLEST_RADIUS = 0.002  # m
_NEW = 0.9  # reflectance of a new material
Edit = tuple[Scene, str]  # the scene afterwards, and what was done


def dragged(scene: Scene, grip: Grip, to: Point) -> Edit:
    """The scene with what was gripped dragged to a point. Raises InputError where it cannot be there."""
    room, place = room_and_place(scene)
    by = to[0] - grip.at[0], to[1] - grip.at[1]
    if grip.part is GripPart.SENSOR:
        return sensor_at(scene, _sum(place.position, by))
    if grip.part is GripPart.BEAM:
        return sensor_turned(scene, bearing(place.position, to) - bearing(place.position, grip.at))
    if grip.surface is None:
        return with_room(scene, move_corner(room, grip.at, on_grid(to))), "moving a corner"
    name = room.names[grip.surface]
    if grip.part is GripPart.WALL:
        return with_room(scene, move_wall(room, grip.surface, on_grid(by))), f"moving {name}"
    x, y, radius = map(float, room.posts[grip.surface - len(room.walls)])
    if grip.part is GripPart.POST:
        return with_room(scene, move_post(room, grip.surface, on_grid(_sum((x, y), by)))), f"moving {name}"
    radius += math.dist((x, y), to) - math.dist((x, y), grip.at)
    radius = max(_SMALLEST_RADIUS, on_grid((radius, 0.0))[0])
    return with_room(scene, resize_post(room, grip.surface, radius)), f"resizing {name}"


def sensor_at(scene: Scene, position: Point) -> Edit:
    """The scene with the sensor elsewhere, looking as before. Raises InputError inside a post."""
    _, place = room_and_place(scene)
    position = on_grid(position)
    if max(map(abs, position)) > MAX_COORDINATE:
        raise InputError(f"the sensor can stand no farther than {MAX_COORDINATE:g} m off")
    return with_sensor_at(scene, position, place.heading), "moving the sensor"


def sensor_turned(scene: Scene, by: float) -> Edit:
    """The scene with the turntable's step 0 turned counter-clockwise by an angle, rad."""
    _, place = room_and_place(scene)
    return sensor_facing(scene, place.heading + by)


def sensor_facing(scene: Scene, heading: float) -> Edit:
    """The scene with the turntable's step 0 at a heading, rad, to a tenth of a degree."""
    _, place = room_and_place(scene)
    heading = math.radians(round(math.degrees(heading) % 360, 1))
    return with_sensor_at(scene, place.position, heading), "turning the sensor"


def with_named_place(scene: Scene, name: str) -> Edit:
    """The scene with the place where the sensor stands in the room by a name, in the place of one of that name."""
    room, place = room_and_place(scene)
    kept = with_place(room, replace(place, name=name))
    return replace(scene, room=kept, place=kept.places[name]), f"keeping place {name}"


def without_surface(scene: Scene, surface: int) -> Edit:
    """The scene without a wall or a post."""
    room, _ = room_and_place(scene)
    return with_room(scene, remove_surface(room, surface)), f"removing {room.names[surface]}"


def with_corner(scene: Scene, wall: int, at: Point) -> Edit:
    """The scene with one more corner, in a wall."""
    room, _ = room_and_place(scene)
    return with_room(scene, split_wall(room, wall, on_grid(at))), f"a corner in {room.names[wall]}"


def with_surface_material(scene: Scene, surface: int, material: str) -> Edit:
    """The scene with a surface made of another material."""
    room, _ = room_and_place(scene)
    return with_room(scene, set_material(room, surface, material)), f"{room.names[surface]} of {material}"


def with_material_values(scene: Scene, material: str, shares: Mapping[str, float] | None = None) -> Edit:
    """The scene with another `reflectance` (amplitude ratio) or `scatter` (share of power) of a material.

    A material that there is not yet is made, with a reflectance of 0.9.
    """
    room, _ = room_and_place(scene)
    known = materials(room).get(material)
    values = {**(known.model_dump() if known else {"reflectance": _NEW, "scatter": 0.0}), **(shares or {})}
    return with_room(scene, with_material(room, material, **values)), f"changing {material}"


def with_air_state(scene: Scene, **state: float) -> Edit:
    """The scene in air of another `temperature_c`, `relative_humidity` or `pressure_kpa`."""
    room, _ = room_and_place(scene)
    return with_room(scene, with_air(room, replace(room.air, **state))), "changing the air"


def with_options(scene: Scene, **options: Any) -> Edit:
    """The scene with the sound followed and received by other `PredictionOptions`."""
    return replace(scene, options=replace(scene.options, **options)), "changing how it is heard"


def with_board(scene: Scene, board: Board) -> Edit:
    """The scene with another board, and the receiver that it is used with."""
    options = replace(scene.options, receiver=board.receiver)
    return replace(scene, board=board, options=options), f"board {board.name}"


def with_room(scene: Scene, room: Room) -> Scene:
    """The scene in the changed room. Raises InputError where the sensor would then be inside a post."""
    _, place = room_and_place(scene)
    _check_free(room, place)
    return replace(scene, room=room)


def room_and_place(scene: Scene) -> tuple[Room, Place]:
    """Room and place of a scene. Raises InputError where it has none."""
    if scene.room is None or scene.place is None:
        raise InputError("without a room there is nothing to change; open a room file")
    return scene.room, scene.place


def bearing(middle: Point, at: Point) -> float:
    """Direction from one point to another, rad."""
    return math.atan2(at[1] - middle[1], at[0] - middle[0])


def on_grid(point: Point) -> Point:
    """The nearest point of whole millimetres."""
    x, y = (round(value / GRID) * GRID for value in point)
    return round(x, 6), round(y, 6)


def _sum(one: Point, other: Point) -> Point:
    return one[0] + other[0], one[1] + other[1]


def with_sensor_at(scene: Scene, position: Point, heading: float) -> Scene:
    """The scene with the sensor at a point (m), its step 0 at a heading (rad). Raises InputError inside a post."""
    room, before = room_and_place(scene)
    # a place of its own, named as `--place X,Y` would be: those that the file names stay where they are
    place = Place(f"{position[0]:g},{position[1]:g}", position, heading, before.height)
    _check_free(room, place)
    return replace(scene, place=place)


def _check_free(room: Room, place: Place) -> None:
    for post in room.posts_at(place.position):
        low, high = room.heights[post]
        if place.height is None or low <= place.height <= high:
            raise InputError(f"the sensor cannot stand inside {room.names[post]}: sound could not leave it")
