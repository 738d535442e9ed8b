"""Parameters of a fit: the quantities that are free, of which scan, material or wall, and what is known of them.

Words that a person types become frozen `Parameter`s; values of them become room, places and board.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from sonarhw_sim.board.profile import Board
from sonarhw_sim.room.model import Place, Room

from sonarhw.errors import InputError
from sonarhw_compare.fit.values.quantities import (
    QUANTITIES,
    SPEED,
    TEMPERATURE,
    WORDS,
    AirQuantity,
    BoardQuantity,
    PartQuantity,
    PlaceQuantity,
    Quantity,
)


@dataclass(frozen=True)
class Parameter:
    """One number that a fit may choose."""

    quantity: Quantity
    of: str = ""  # the material or the wall, where the kind has several
    scan: int | None = None  # the only scan it belongs to; None: all share it
    lower: float = -math.inf
    upper: float = math.inf
    expected: float | None = None  # what is known of it beforehand, with a normal error of
    deviation: float | None = None
    label: str = ""  # of the scan, where there are several

    @property
    def name(self) -> str:
        """Its name in results: `x`, `reflectance:shelving`, `heading@B01`."""
        return self.quantity.name + (f":{self.of}" if self.of else "") + (f"@{self.label}" if self.label else "")


def free_parameters(
    free: Sequence[str], scans: Sequence[str], room: Room, board: Board, place: Place | None = None
) -> tuple[Parameter, ...]:
    """The parameters that words such as `position`, `offset` or `reflectance:shelving` stand for.

    `scans` are the names of the scans: each has a position and a heading of its own, everything else is shared. Bounds
    are the widest that make sense; a position is sought in the whole room. Raises InputError for any other word.
    """
    found: dict[str, Parameter] = {}
    for word in free:
        of = word.strip().partition(":")[2]
        for quantity in quantities_of(word):
            for parameter in _of_quantity(quantity, of, scans, room, board):
                found[parameter.name] = parameter
    if {TEMPERATURE, SPEED} <= {parameter.quantity for parameter in found.values()}:
        raise InputError("--free temperature,speed: one tells the other; free only one of them")
    return tuple(found.values())


def quantities_of(word: str) -> tuple[Quantity, ...]:
    """The quantities that a word such as `position` or `wall:east` stands for. Raises InputError for any other word."""
    head = word.strip().partition(":")[0]
    if head not in WORDS:
        raise InputError(f"--free {word}: expected some of {', '.join(WORDS)}")
    return WORDS[head]


def _of_quantity(quantity: Quantity, of: str, scans: Sequence[str], room: Room, board: Board) -> list[Parameter]:
    bounds = quantity.bounds(room, board)
    if isinstance(quantity, PlaceQuantity):
        if of:
            raise InputError(f"--free {quantity}:{of}: every scan has its own; write {quantity}")
        labels = scans if len(scans) > 1 else [""]
        return [Parameter(quantity, "", k, *bounds, label=label) for k, label in enumerate(labels)]
    known = quantity.parts(room) if isinstance(quantity, PartQuantity) else ()
    if of and of not in known:
        raise InputError(f"--free {quantity}:{of}: room {room.name!r} has {', '.join(dict.fromkeys(known)) or 'none'}")
    several = [of] if of else list(dict.fromkeys(known)) or [""]
    return [Parameter(quantity, one, None, *bounds) for one in several]


def start_of(parameter: Parameter, places: Sequence[Place], room: Room, board: Board) -> float:
    """The value that room, place and board have now, within the parameter's bounds; what is expected where given."""
    value = parameter.expected
    if value is None:
        value = _present(parameter, places[parameter.scan or 0], room, board)
    return min(max(value, parameter.lower), parameter.upper)


def _present(parameter: Parameter, place: Place, room: Room, board: Board) -> float:
    match parameter.quantity:
        case PlaceQuantity() as quantity:
            return quantity.value(place)
        case BoardQuantity() as quantity:
            return quantity.value(board)
        case AirQuantity() as quantity:
            return quantity.value(room.air)
        case PartQuantity() as quantity:
            return quantity.value(room, parameter.of)
    raise TypeError(f"{parameter.quantity!r} belongs to neither place, board, air nor parts of the room")


def applied(
    values: Mapping[Parameter, float], room: Room, places: Sequence[Place], board: Board
) -> tuple[Room, tuple[Place, ...], Board]:
    """Room, places and board with those values."""
    moved = list(places)
    for parameter, value in values.items():
        match parameter.quantity:
            case PlaceQuantity() as quantity:
                for k in range(len(moved)) if parameter.scan is None else [parameter.scan]:
                    moved[k] = quantity.put(moved[k], value)
            case BoardQuantity() as quantity:
                board = quantity.put(board, value)
            case AirQuantity() as quantity:
                room = replace(room, air=quantity.put(room.air, value))
    for parts, by_part in values_by_part(values).items():
        room = parts.put(room, by_part)
    return room, tuple(moved), board


def values_by_part(values: Mapping[Parameter, float]) -> dict[PartQuantity, dict[str, float]]:
    """The values of materials and walls, by the name of each; all of a quantity belong together."""
    found: dict[PartQuantity, dict[str, float]] = {}
    for quantity in QUANTITIES:
        by_part = {parameter.of: value for parameter, value in values.items() if parameter.quantity is quantity}
        if isinstance(quantity, PartQuantity) and by_part:
            found[quantity] = by_part
    return found
