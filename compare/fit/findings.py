"""What a fit has found, as files: the room with its places, materials, walls and air, the board with its profile.

Takes the room or board that a fit began with and its values; hands on room and board whose text says what was found,
comments and layout as they were. What was not free stays as it is.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import tomlkit

from compare.fit.parameters import OF_PLACE, Kind, Parameter, temperature_at
from compare.fit.walls import with_shifted_walls
from sim.board import Board, parse_board
from sim.room import Place, Room
from sim.room_writing import materials, with_air, with_corners, with_material, with_place

OF_ROOM = (*OF_PLACE, Kind.TEMPERATURE, Kind.SPEED, Kind.REFLECTANCE, Kind.WALL)
OF_BOARD = (Kind.OFFSET, Kind.AHEAD, Kind.ASIDE, Kind.THRESHOLD, Kind.APERTURE)
_LENGTH = 5  # digits behind the point, of m
_APERTURE = 6
_SHARE = 4  # of a reflectance
_DEGREES = 3
_DECIBELS = _KELVINS = 2

Values = Mapping[Parameter, float]


def found_room(room: Room, values: Values, places: Sequence[Place]) -> Room:
    """The room with those values; `places` are those of the scans, found and named as the room shall name them.

    Raises InputError where that is no room: a place inside a post, a wall of no length.
    """
    shifts = {parameter.of: value for parameter, value in values.items() if parameter.kind is Kind.WALL}
    if shifts:
        room = _with_walls(room, with_shifted_walls(room, shifts))
    for parameter, value in values.items():
        if parameter.kind is Kind.TEMPERATURE:
            room = with_air(room, replace(room.air, temperature_c=round(value, _KELVINS)))
        elif parameter.kind is Kind.SPEED:
            room = with_air(room, replace(room.air, temperature_c=round(temperature_at(value, room.air), _KELVINS)))
        elif parameter.kind is Kind.REFLECTANCE:
            scatter = materials(room)[parameter.of].scatter
            room = with_material(room, parameter.of, round(value, _SHARE), scatter)
    if any(parameter.kind in OF_PLACE for parameter in values):
        for place in places:
            room = with_place(room, _rounded(place))
    return room


def _with_walls(room: Room, shifted: Room) -> Room:
    ends = zip(
        room.walls.reshape(-1, 2).tolist(), np.round(shifted.walls, _LENGTH).reshape(-1, 2).tolist(), strict=True
    )
    return with_corners(room, {(x, y): (new_x, new_y) for (x, y), (new_x, new_y) in ends})


def _rounded(place: Place) -> Place:
    x, y = (round(at, _LENGTH) for at in place.position)
    return replace(place, position=(x, y), heading=math.radians(round(math.degrees(place.heading), _DEGREES) % 360))


def found_board(board: Board, values: Values, name: str) -> Board:
    """The board with those values under another name. Raises InputError where no profile has such."""
    profile: Any = tomlkit.parse(board.text)
    profile["name"] = name
    for parameter, value in values.items():
        match parameter.kind:
            case Kind.OFFSET:
                profile["range_offset"] = round(board.range_offset - value, _LENGTH)
            case Kind.THRESHOLD:
                profile["threshold_db"] = round(value, _DECIBELS)
            case Kind.APERTURE:
                profile["aperture_radius"] = round(value, _APERTURE)
            case Kind.AHEAD | Kind.ASIDE:
                profile.setdefault("mount", tomlkit.table())[parameter.kind.value] = round(value, _LENGTH)
    return parse_board(tomlkit.dumps(profile), f"profile {name!r}")
