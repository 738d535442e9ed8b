"""What a fit has found, as files: the room with its places, materials, walls and air, the board with its profile.

Takes the room or board that a fit began with and its values; hands on room and board whose text says what was found,
comments and layout as they were; a profile says which of its values were fitted. What was not free stays as it is.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import tomlkit
from sonarhw_sim.board.profile import Board, parse_board
from sonarhw_sim.room.model import Place, Room
from sonarhw_sim.room.room_writing import materials, with_air, with_corners, with_material, with_place

from sonarhw_compare.fit.values.free_walls import with_shifted_walls
from sonarhw_compare.fit.values.parameters import OF_PLACE, Kind, Parameter, temperature_at

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


def found_board(
    board: Board, values: Values, name: str, deviations: Values | None = None, logs: Sequence[str] = ()
) -> Board:
    """The board with those values under another name. Raises InputError where no profile has such.

    Its text marks each value that is found, ± its standard deviation where that is given, and says of which `logs`;
    what the profile said of itself and of values before stands under its own name, for it holds of those alone.
    """
    profile: Any = tomlkit.parse(board.text)
    profile["name"] = name
    found = [parameter.kind for parameter in values if parameter.kind in OF_BOARD]
    for parameter, value in values.items():
        deviation = None if deviations is None else deviations.get(parameter)
        match parameter.kind:
            case Kind.OFFSET:
                _set(profile, "range_offset", board.range_offset, board.range_offset - value, deviation, _LENGTH)
            case Kind.THRESHOLD:
                _set(profile, "threshold_db", board.threshold_db, value, deviation, _DECIBELS)
            case Kind.APERTURE:
                _set(profile, "aperture_radius", board.aperture_radius, value, deviation, _APERTURE)
            case Kind.AHEAD | Kind.ASIDE:
                mount = profile.setdefault("mount", tomlkit.table())
                before = board.mount.ahead if parameter.kind is Kind.AHEAD else board.mount.aside
                _set(mount, parameter.kind.value, before, value, deviation, _LENGTH)
    text = _with_provenance(tomlkit.dumps(profile), board.name, found, logs)
    return parse_board(text, f"profile {name!r}")


def _set(table: Any, key: str, before: float, value: float, deviation: float | None, digits: int) -> None:
    """The value in the table, marked as found; what was said of the one before stays beside that one."""
    said = table[key].trivia.comment.lstrip("# ") if key in table else ""
    spread = "" if deviation is None else f" ± {deviation:.{digits}f}"
    table[key] = round(value, digits)
    table[key].comment(f"fitted{spread}; before: {before:g}" + (f" ({said})" if said else ""))
    table[key].trivia.comment_ws = "  "


def _with_provenance(text: str, before: str, found: Sequence[Kind], logs: Sequence[str]) -> str:
    """The text under lines that say what was fitted; the header it had is quoted as that of the profile `before`."""
    lines = text.splitlines()
    behind = next(k for k, line in enumerate(lines) if not line.startswith("#"))
    by = f" on {', '.join(logs)}" if logs else ""
    header = [f"# Fitted by `sonarhw fit`{by}, beginning with profile {before!r}: {', '.join(found)}."]
    if behind:
        header.append(f"# What {before!r} says of itself, true of its own values alone:")
        header += [f"#   {line.removeprefix('#').removeprefix(' ')}".rstrip() for line in lines[:behind]]
    return "\n".join(header + lines[behind:]) + "\n"
