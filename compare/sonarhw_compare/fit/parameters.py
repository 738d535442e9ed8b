"""The free parameters of a fit: their start values, bounds, priors and tolerances, and walls that move."""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from sonarhw_sim.board.profile import Board
from sonarhw_sim.room.room import Place, Room

from sonarhw.errors import InputError, did_you_mean
from sonarhw_compare.fit import quantities

# Parameters of a fit: a free quantity, the scan, material or wall that it belongs to, its bounds and its prior.
#
# Words of `--free` are parsed into `Parameter`s, and values of parameters are applied to room, places and board.


@dataclass(frozen=True)
class Parameter:
    """One number that a fit determines."""

    quantity: quantities.Quantity
    of: str = ""  # material or wall; empty for other quantities
    scan: int | None = None  # number of its scan; None: shared by all scans
    lower: float = -math.inf
    upper: float = math.inf
    expected: float | None = None  # mean of a normal prior; None: uniform between the bounds
    deviation: float | None = None  # standard deviation of the prior
    label: str = ""  # name of the scan, if there are several
    is_tolerated: bool = False  # not free: marginalised, with a standard deviation of `deviation` at most

    @property
    def name(self) -> str:
        """The name in results: `x`, `reflectance:shelving`, `heading@B01`."""
        return self.quantity.name + (f":{self.of}" if self.of else "") + (f"@{self.label}" if self.label else "")

    @property
    def limits(self) -> tuple[float, float]:
        """The bounds; for an angle without bounds, those of a full circle."""
        return (self.lower, self.upper) if math.isfinite(self.upper - self.lower) else (-math.pi, math.pi)


def free_parameters(free: Sequence[str], scans: Sequence[str], room: Room, board: Board) -> tuple[Parameter, ...]:
    """Return the parameters of words such as `position`, `offset` or `reflectance:shelving`.

    `scans` are the names of the scans. Each scan has its own position and heading; all other parameters are shared. The
    bounds are those of the quantity; for a position, the whole room. Raises InputError for unknown words.
    """
    parameters: dict[str, Parameter] = {}
    for word in free:
        of = word.strip().partition(":")[2]
        for quantity in quantities_of(word):
            for parameter in _of_quantity(quantity, of, scans, room, board):
                parameters[parameter.name] = parameter
    if {quantities.TEMPERATURE, quantities.SPEED} <= {parameter.quantity for parameter in parameters.values()}:
        raise InputError("temperature,speed: each determines the other; free only one of them")
    return tuple(parameters.values())


_OTHER_WORDS = {
    **dict.fromkeys(("angle", "bearing", "direction", "orientation", "rotation", "theta", "yaw"), "heading"),
    **dict.fromkeys(("location", "place", "pose", "xy"), "position"),
    **dict.fromkeys(("beam", "beamwidth"), "aperture"),
    **dict.fromkeys(("c", "sound_speed", "speed_of_sound"), "speed"),
    **dict.fromkeys(("material", "materials"), "reflectances"),
    "range_offset": "offset",
    "all": "",
}


def quantities_of(word: str) -> tuple[quantities.Quantity, ...]:
    """Return the quantities of a word such as `position` or `wall:east`. Raises InputError for unknown words."""
    head = word.strip().partition(":")[0]
    if head not in quantities.WORDS:
        hint = did_you_mean(_OTHER_WORDS.get(head, head), quantities.WORDS) or ";"
        raise InputError(f"free {word}: unknown quantity{hint} expected some of {', '.join(quantities.WORDS)}")
    return quantities.WORDS[head]


def _of_quantity(
    quantity: quantities.Quantity, of: str, scans: Sequence[str], room: Room, board: Board
) -> list[Parameter]:
    bounds = quantity.bounds(room, board)
    if isinstance(quantity, quantities.PlaceQuantity):
        if of:
            raise InputError(
                f"free {quantity}:{of}: {quantity} belongs to a scan, not to a part of the room; write {quantity}"
            )
        labels = scans if len(scans) > 1 else [""]
        return [Parameter(quantity, "", k, *bounds, label=label) for k, label in enumerate(labels)]
    parts = quantity.parts(room) if isinstance(quantity, quantities.PartQuantity) else ()
    if isinstance(quantity, quantities.PartQuantity) and not parts:
        raise InputError(f"free {quantity}: room {room.name!r} has no {quantity} that a fit can change; leave it out")
    if of and of not in parts:
        names = ", ".join(dict.fromkeys(parts)) or "none"
        near = did_you_mean(of, parts)
        raise InputError(f"free {quantity}:{of}: unknown {quantity} {of!r}{near or ';'} room {room.name!r} has {names}")
    several = [of] if of else list(dict.fromkeys(parts)) or [""]
    return [Parameter(quantity, part, None, *bounds) for part in several]


def start_of(parameter: Parameter, places: Sequence[Place], room: Room, board: Board) -> float:
    """Return the mean of the prior, or else the present value in room, place or board, clipped to the bounds."""
    value = parameter.expected
    if value is None:
        value = present_value(parameter, places[parameter.scan or 0], room, board)
    return min(max(value, parameter.lower), parameter.upper)


def present_value(parameter: Parameter, place: Place, room: Room, board: Board) -> float:
    """Return the value of a parameter in place, room or board."""
    match parameter.quantity:
        case quantities.PlaceQuantity() as quantity:
            return quantity.value(place)
        case quantities.BoardQuantity() as quantity:
            return quantity.value(board)
        case quantities.AirQuantity() as quantity:
            return quantity.value(room.air)
        case quantities.PartQuantity() as quantity:
            return quantity.value(room, parameter.of)
    raise TypeError(f"{parameter.quantity!r}: unknown kind of quantity; expected place, board, air or part of the room")


def applied(
    values: Mapping[Parameter, float], room: Room, places: Sequence[Place], board: Board
) -> tuple[Room, tuple[Place, ...], Board]:
    """Return room, places and board with these values."""
    moved = list(places)
    for parameter, value in values.items():
        match parameter.quantity:
            case quantities.PlaceQuantity() as quantity:
                for k in range(len(moved)) if parameter.scan is None else [parameter.scan]:
                    moved[k] = quantity.put(moved[k], value)
            case quantities.BoardQuantity() as quantity:
                board = quantity.put(board, value)
            case quantities.AirQuantity() as quantity:
                room = replace(room, air=quantity.put(room.air, value))
    for parts, by_part in values_by_part(values).items():
        room = parts.put(room, by_part)
    return room, tuple(moved), board


def values_by_part(values: Mapping[Parameter, float]) -> dict[quantities.PartQuantity, dict[str, float]]:
    """Return the values of materials and walls by name, grouped by quantity."""
    grouped: dict[quantities.PartQuantity, dict[str, float]] = {}
    for quantity in quantities.QUANTITIES:
        by_part = {parameter.of: value for parameter, value in values.items() if parameter.quantity is quantity}
        if isinstance(quantity, quantities.PartQuantity) and by_part:
            grouped[quantity] = by_part
    return grouped


# Priors of a fit in text: `temperature=21+-1` (normal), `x=0.2..1.4` (bounds), in the units of `--prior`.


_NUMBER = r"([-+]?\d*\.?\d+(?:[eE][-+]?\d+)?)"

_MOST = 1e6  # of a number, in the unit of --prior
_LEAST = 1e-6  # of a deviation


def check_words(words: Sequence[str], priors: Sequence[str]) -> None:
    """Raise InputError for errors in the free words and in the priors, before a log is read."""
    free = [quantity.name for word in words for quantity in quantities_of(word)]
    for prior in priors:
        name, _, text = prior.partition("=")
        if free and re.split("[:@]", name)[0] not in free:
            listed = ", ".join(free)
            raise InputError(f"prior {prior}: {name} is not free; free it too, or use one of {listed}")
        if _range_of(text) is None and _normal_of(text) is None:
            raise _malformed_prior(prior)


def with_priors(parameters: Sequence[Parameter], priors: Sequence[str]) -> tuple[Parameter, ...]:
    """Return the parameters with their priors. Raises InputError for an unknown name or an invalid prior."""
    changed = list(parameters)
    for prior in priors:
        name, _, text = prior.partition("=")
        rows = [k for k, parameter in enumerate(changed) if name in (parameter.name, parameter.quantity.name)]
        if not rows:
            names = ", ".join(parameter.name for parameter in parameters)
            raise InputError(f"prior {prior}: expected NAME=… with a free quantity: {names}")
        for k in rows:
            changed[k] = _with_prior(changed[k], prior, text)
    return tuple(changed)


def _with_prior(parameter: Parameter, prior: str, text: str) -> Parameter:
    unit = 1 / parameter.quantity.per_unit
    if bounds := _range_of(text):
        return replace(parameter, lower=bounds[0] * unit, upper=bounds[1] * unit)
    if normal := _normal_of(text):
        value, deviation = normal[0] * unit, normal[1] * unit
        if normal[1] >= _LEAST and parameter.lower <= value <= parameter.upper:
            return replace(parameter, expected=value, deviation=deviation)
        bounded = math.isfinite(parameter.lower) and math.isfinite(parameter.upper)
        where = f" and a value from {parameter.lower / unit:g} to {parameter.upper / unit:g}" if bounded else ""
        raise InputError(f"prior {prior}: expected a deviation of at least {_LEAST:g}{where}")
    raise _malformed_prior(prior)


def _range_of(text: str) -> tuple[float, float] | None:
    match = re.fullmatch(rf"{_NUMBER}\s*\.\.\s*{_NUMBER}", text)
    if match is None or not -_MOST <= float(match[1]) < float(match[2]) <= _MOST:
        return None
    return float(match[1]), float(match[2])


def _normal_of(text: str) -> tuple[float, float] | None:
    match = re.fullmatch(rf"{_NUMBER}\s*(?:\+-|±)\s*{_NUMBER}", text)
    if match is None or not (abs(float(match[1])) <= _MOST and float(match[2]) <= _MOST):
        return None
    return float(match[1]), float(match[2])


def _malformed_prior(prior: str) -> InputError:
    hint = ""
    if re.search(r"\d ?(?!e[+-]?\d)[^\W\d]|[°%]", prior.partition("=")[2]):
        hint = ", without units: lengths are metres, headings degrees"
    elif "," in prior:
        hint = ", with decimal points"
    return InputError(
        f"prior {prior}: expected NAME=VALUE+-DEVIATION, or NAME=LOW..HIGH with LOW below HIGH, "
        f"and numbers from -{_MOST:g} to {_MOST:g}{hint}"
    )


# Values that a fit does not determine and does not take as exact: walls, reflectances, threshold, aperture,
# turntable.
#
# Each is a parameter of the posterior, with a normal prior about its present value, and is marginalised.


_TOLERANCE_REACH = 5.0  # standard deviations, half the width of the bounds


def tolerated_parameters(
    free: Sequence[Parameter], room: Room, board: Board, room_tolerance: float, walls: Sequence[str]
) -> tuple[Parameter, ...]:
    """Return the parameters that are neither free nor exact.

    `room_tolerance` (m) is the standard deviation of the position of a wall; only `walls` may be off.
    """
    taken = {parameter.name for parameter in free}
    words = [word for quantity in quantities.QUANTITIES for word in _words(quantity, room, walls)]
    parameters = [
        _tolerated(parameter, room, board, room_tolerance) for parameter in free_parameters(words, [""], room, board)
    ]
    return tuple(parameter for parameter in parameters if parameter.deviation and parameter.name not in taken)


def _words(quantity: quantities.Quantity, room: Room, walls: Sequence[str]) -> list[str]:
    if quantity.tolerance is None or (isinstance(quantity, quantities.PartQuantity) and not quantity.parts(room)):
        return []
    return [f"{quantities.WALL}:{wall}" for wall in walls] if quantity is quantities.WALL else [quantity.name]


def _tolerated(parameter: Parameter, room: Room, board: Board, room_tolerance: float) -> Parameter:
    quantity = parameter.quantity
    stated = quantity.tolerance(board) if quantity.tolerance else 0.0
    deviation = room_tolerance if quantity is quantities.WALL else stated
    present = present_value(parameter, Place("", (0.0, 0.0)), room, board)
    return replace(
        parameter,
        expected=present,
        deviation=deviation,
        lower=max(parameter.lower, present - _TOLERANCE_REACH * deviation),
        upper=min(parameter.upper, present + _TOLERANCE_REACH * deviation),
        is_tolerated=True,
    )
