"""Apply the values of a fit to a scene: place, range offset, air and materials.

The texts of the room and the board change too, so that the result can be saved and recorded.
"""

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import tomlkit
from sonarhw_sim.board.profile import Board

from sonarhw_gui.scene.scene import Scene
from sonarhw_gui.scene.scene_edit import Edit, room_and_place, with_sensor_at

if TYPE_CHECKING:
    from sonarhw_compare.fit import Parameter  # importing it takes half a second

FITTED = "finding the pose"  # label of Undo
_DIGITS = 4  # of lengths in m
_DIGITS_DEG = 2

_X, _Y, _HEADING = "x", "y", "heading"


def fitted(scene: Scene, values: "Mapping[Parameter, float]", board: Board) -> Edit:
    """Return the scene with the fitted values; offsets are relative to `board`, the board of the fit.

    Raises InputError if the room cannot have these values.
    """
    from sonarhw_compare.fit.fitting import fitted_room

    room, _ = room_and_place(scene)
    changed = replace(scene, room=fitted_room(room, values, ()), board=_board(scene.board, board, values))
    return _at_fitted_place(changed, {parameter.quantity.name: value for parameter, value in values.items()}), FITTED


def _at_fitted_place(scene: Scene, values: Mapping[str, float]) -> Scene:
    _, place = room_and_place(scene)
    if not values.keys() & {_X, _Y, _HEADING}:
        return scene
    x, y = (round(values.get(kind, before), _DIGITS) for kind, before in zip((_X, _Y), place.position, strict=True))
    degrees = round(math.degrees(values.get(_HEADING, place.heading)), _DIGITS_DEG)
    return with_sensor_at(scene, (x, y), math.radians(degrees % 360))


def _board(board: Board, fitted_with: Board, values: "Mapping[Parameter, float]") -> Board:
    from sonarhw_compare.fit.fitting import board_values, table_and_key

    profile: Any = tomlkit.parse(board.text)
    for _, quantity, value in board_values(fitted_with, values):
        table, key = table_and_key(profile, quantity)
        table[key] = value
        board = quantity.write(board, value)
    return replace(board, text=tomlkit.dumps(profile))
