"""Room files and board profiles with fitted values.

Comments, layout and all values that were not free stay unchanged. A profile marks its fitted values, a room file lists
them at its top.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import tomlkit
from sonarhw_sim.board.profile import Board, parse_board
from sonarhw_sim.room.room import Place, Room, parse_room
from sonarhw_sim.room.room_writing import with_air, with_place

from sonarhw.errors import harmless
from sonarhw_compare.fit.values.parameters import Parameter, values_by_part
from sonarhw_compare.fit.values.quantities import HEADING, AirQuantity, BoardQuantity, PlaceQuantity, Quantity, X
from sonarhw_compare.profile_edit import below_header, set_marked

Values = Mapping[Parameter, float]


def fitted_room(room: Room, values: Values, places: Sequence[Place]) -> Room:
    """Return the room with these values; `places` are the fitted places of the scans, with the names for the room file.

    Raises InputError if the result is not a valid room, such as a place inside a post or a wall without length.
    """
    for parts, by_part in values_by_part(values).items():
        room = parts.write(room, by_part)
    for parameter, value in values.items():
        if isinstance(quantity := parameter.quantity, AirQuantity):
            found = getattr(quantity.put(room.air, value), quantity.key)
            room = with_air(room, replace(room.air, **{quantity.key: round(found, quantity.digits)}))
    if any(isinstance(parameter.quantity, PlaceQuantity) for parameter in values):
        for place in places:
            room = with_place(room, _rounded(place))
    return room


def _rounded(place: Place) -> Place:
    x, y = (round(at, X.digits) + 0.0 for at in place.position)
    return replace(place, position=(x, y), heading=math.radians(round(math.degrees(place.heading), HEADING.digits)))


def with_listed_findings(room: Room, before: str, findings: Sequence[str], logs: Sequence[str]) -> Room:
    """Return the room with a header that lists the `findings`, as lines of `finding`; `before` is the old room's name.

    A header, and not comments beside the values, because a wall's shift changes several points, and tables within one
    line cannot contain comments.
    """
    header = [
        f"# Fitted by `sonarhw fit`{_on(logs)}, beginning with room {before!r}:",
        *(f"#   {harmless(one)}" for one in findings),
    ]
    return parse_room("\n".join([*header, room.text]), f"room {room.name!r}")


def finding(parameter: Parameter, value: float, deviation: float, before: float | None) -> str:
    """Return a fitted value with its deviation and the former value, if known, in one line."""
    quantity = parameter.quantity
    shown = f"{parameter.name} {_written(quantity, value)} ± {_written(quantity, deviation)}{_unit(quantity)}"
    return shown if before is None else f"{shown}; before: {_written(quantity, before)}"


def kept(parameter: Parameter, value: float) -> str:
    """Return one line about a value that was free, and is not constrained by the scans."""
    return f"{parameter.name} {_written(parameter.quantity, value)}: kept, the scans hardly constrain it"


def _written(quantity: Quantity, value: float) -> str:
    return f"{value * quantity.per_unit:z.{quantity.digits}f}"


def _unit(quantity: Quantity) -> str:
    return quantity.unit if quantity.is_angle or not quantity.unit else f" {quantity.unit}"


def _on(logs: Sequence[str]) -> str:
    return f" on {', '.join(logs)}" if logs else ""


def fitted_board(
    board: Board,
    values: Values,
    name: str,
    deviations: Values | None = None,
    logs: Sequence[str] = (),
    unconstrained: Sequence[str] = (),
) -> Board:
    """Return the board with these values and another name. Raises InputError if a value is not allowed.

    The text marks each fitted value, with ± its standard deviation if given, and names the `logs` and the
    `unconstrained` quantities, whose values are kept. Comments of the old
    profile are quoted under its name, because they describe the old values only.
    """
    profile: Any = tomlkit.parse(board.text)
    profile["name"] = name
    found = []
    for parameter, quantity, value in board_values(board, values):
        deviation = None if deviations is None else deviations.get(parameter)
        spread = "" if deviation is None else f" ± {deviation:.{quantity.digits}f}"
        table, key = table_and_key(profile, quantity)
        set_marked(table, key, value, quantity.read(board), f"fitted{spread}")
        found.append(quantity.name)
    text = _with_provenance(tomlkit.dumps(profile), board.name, found, logs, unconstrained)
    return parse_board(text, f"profile {name!r}")


def board_values(board: Board, values: Values) -> Iterator[tuple[Parameter, BoardQuantity, float]]:
    """Yield each fitted value of a board as its profile states it; `board` is the one of the fit."""
    for parameter, value in values.items():
        if isinstance(quantity := parameter.quantity, BoardQuantity):
            yield parameter, quantity, round(quantity.read(quantity.put(board, value)), quantity.digits)


def table_and_key(profile: Any, quantity: BoardQuantity) -> tuple[Any, str]:
    """Return the table of a profile's TOML document that contains a quantity, and its key there."""
    section, _, key = quantity.key.rpartition(".")
    return profile.setdefault(section, tomlkit.table()) if section else profile, key


def _with_provenance(
    text: str, before: str, found: Sequence[str], logs: Sequence[str], unconstrained: Sequence[str]
) -> str:
    """Return the text below a header with the fitted values; its old header is quoted as that of profile `before`."""
    fitted = ", ".join(found) or "no value"
    header = [f"# Fitted by `sonarhw fit`{_on(logs)}, beginning with profile {before!r}: {fitted}."]
    if unconstrained:
        header.append(f"# Kept, the scans hardly constrain it: {', '.join(unconstrained)}.")
    return below_header(header, text, before)
