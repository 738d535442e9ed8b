"""What a fit has chosen, put into a scene: the sensor's place, its range offset, the air, the materials. No widgets.

Takes a scene and fitted values; hands on the scene with them, in room and profile as text too, so that they can be
saved and recorded.
"""

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import tomlkit
from sonarhw_sim.board.profile import Board
from sonarhw_sim.room.model import Room
from sonarhw_sim.room.room_writing import materials, with_air, with_material

from sonarhw_gui.scene.scene import Scene
from sonarhw_gui.scene.scene_edit import Edit, furnished, standing_at

if TYPE_CHECKING:
    from sonarhw_compare.fit import Parameter  # what it loads takes half a second

FITTED = "finding where I stood"  # behind Undo
_DIGITS = 4  # of lengths in m
_DIGITS_DEG = 2

_X, _Y, _HEADING, _OFFSET, _TEMPERATURE, _REFLECTANCE = "x", "y", "heading", "offset", "temperature", "reflectance"


def fitted(scene: Scene, values: "Mapping[Parameter, float]", board: Board) -> Edit:
    """The scene with those values; offsets count from `board`, the one that was fitted with.

    Raises InputError where the room cannot take them.
    """
    room, _ = furnished(scene)
    changed = replace(scene, room=_room(room, values), board=_board(scene.board, board, values))
    return _stood(changed, {parameter.kind.value: value for parameter, value in values.items()}), FITTED


def _stood(scene: Scene, of: Mapping[str, float]) -> Scene:
    _, place = furnished(scene)
    if not of.keys() & {_X, _Y, _HEADING}:
        return scene
    x, y = (round(of.get(kind, before), _DIGITS) for kind, before in zip((_X, _Y), place.position, strict=True))
    degrees = round(math.degrees(of.get(_HEADING, place.heading)), _DIGITS_DEG)
    return standing_at(scene, (x, y), math.radians(degrees % 360))


def _room(room: Room, values: "Mapping[Parameter, float]") -> Room:
    for parameter, value in values.items():
        if parameter.kind == _TEMPERATURE:
            room = with_air(room, replace(room.air, temperature_c=round(value, 2)))
        elif parameter.kind == _REFLECTANCE:
            before = materials(room)[parameter.of]
            room = with_material(room, parameter.of, round(value, _DIGITS), before.scatter)
    return room


def _board(board: Board, fitted_with: Board, values: "Mapping[Parameter, float]") -> Board:
    offsets = [value for parameter, value in values.items() if parameter.kind == _OFFSET]
    if not offsets:
        return board
    told = round(fitted_with.range_offset - offsets[0], _DIGITS)
    profile = tomlkit.parse(board.text)
    profile["range_offset"] = told
    return replace(board, range_offset=told, text=tomlkit.dumps(profile))
