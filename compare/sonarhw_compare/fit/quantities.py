"""The quantities that a fit can determine, each defined once: name, unit, bounds, texts, effect on the model.

To add one, add its definition here and list it in `QUANTITIES`; command line, window, result files and likelihood use
that list. This module loads quickly and without NumPy, because the help of the command line lists the quantities.
"""

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sonarhw_sim.air import Air
from sonarhw_sim.board.profile import Board
from sonarhw_sim.files import did_you_mean
from sonarhw_sim.room.edges import find_edges
from sonarhw_sim.room.room import Place, Room, wall_distances
from sonarhw_sim.room.room_file import MEETING
from sonarhw_sim.room.room_writing import with_corners

from sonarhw.errors import InputError
from sonarhw.readings import FloatArray

_COLDEST, _WARMEST = -40.0, 60.0  # °C, limits of a room file
_REACH = 0.06  # m, largest difference of a length from the board profile
ROOM_TOLERANCE = 0.005  # m, standard deviation of the position of a wall that is not free
# assumed standard deviations of other values that are not free
_SCALE_TOLERANCE = 0.01
_APERTURE_TOLERANCE = 0.15  # of the radius
_REFLECTANCE_TOLERANCE = 0.2
_THRESHOLD_TOLERANCE = 3.0  # dB

Bounds = Callable[["Room", "Board"], tuple[float, float]]
Tolerance = Callable[["Board"], float]


@dataclass(frozen=True)
class Offer:
    """The check box of a quantity in the window."""

    label: str
    tip: str
    checked: bool


@dataclass(frozen=True, eq=False, kw_only=True)
class Quantity:
    """A quantity that a fit can determine. Values are in SI units, headings in rad, temperatures in °C."""

    name: str  # in --free and in results
    unit: str  # as printed
    step: float  # a change that has a clear effect on the likelihood
    bounds: Bounds  # widest plausible values
    digits: int  # decimals in files, in the printed unit
    label: str  # in the window's table of results
    group: str = ""  # word that frees this and other quantities together
    offer: Offer | None = None  # None: the window has no check box for it
    moves_paths: bool = False  # whether it changes the paths of sound
    shifts_place: bool = False  # whether a wrong value shifts the fitted place
    tolerance: Tolerance | None = None  # largest standard deviation of a value that is not free; None: it is exact
    # Factor of the standard deviation if overlapping echoes are modelled as single ones, as with the board's own
    # receiver. Measured by `python -m benchmarks.fit`; for aperture and reflectances assumed, as that of the threshold.
    overlap: float = 1.0

    @property
    def word(self) -> str:
        """The word that frees it: its group, or else its name."""
        return self.group or self.name

    @property
    def is_angle(self) -> bool:
        """Whether it is an angle over the full circle, printed in degrees."""
        return self.unit == "°"

    @property
    def per_unit(self) -> float:
        """The number of printed units in one unit of its values."""
        return math.degrees(1.0) if self.is_angle else 1.0

    def __str__(self) -> str:
        return self.name

    def __reduce__(self) -> tuple[object, ...]:
        # another process has the same definitions
        return quantity_named, (self.name,)


@dataclass(frozen=True, eq=False, kw_only=True)
class PlaceQuantity(Quantity):
    """A quantity of the place. Each scan has its own."""

    value: Callable[["Place"], float]
    put: Callable[["Place", float], "Place"]


@dataclass(frozen=True, eq=False, kw_only=True)
class BoardQuantity(Quantity):
    """A quantity of the board profile."""

    key: str  # in the profile, such as `mount.ahead`
    is_correction: bool = False  # whether it is subtracted from the value in the profile

    def read(self, board: "Board") -> float:
        """Return the number under its key in the profile."""
        section, _, key = self.key.rpartition(".")
        return float(getattr(getattr(board, section) if section else board, key))

    def value(self, board: "Board") -> float:
        """Return the present value of the board."""
        return 0.0 if self.is_correction else self.read(board)

    def number(self, present: float, value: float) -> float:
        """Return the number under its key for a value, if the profile has a present number."""
        return present - value if self.is_correction else value

    def put(self, board: "Board", value: float) -> "Board":
        """Return the board with this value."""
        return self.write(board, self.number(self.read(board), value))

    def write(self, board: "Board", new: float) -> "Board":
        """Return the board with another number under its key."""
        section, _, key = self.key.rpartition(".")
        changed: dict[str, Any] = {key: new}
        if section:
            changed = {section: getattr(board, section).model_copy(update=changed)}
        return replace(board, **changed)


@dataclass(frozen=True, eq=False, kw_only=True)
class AirQuantity(Quantity):
    """A quantity of the air."""

    key: str  # in [air] of the room file
    value: Callable[[Air], float]
    put: Callable[[Air, float], Air]


@dataclass(frozen=True, eq=False, kw_only=True)
class PartQuantity(Quantity):
    """A quantity of each material or each wall of the room."""

    part: str  # placeholder after the colon, such as MATERIAL in `reflectance:MATERIAL`
    parts: Callable[["Room"], Sequence[str]]
    value: Callable[["Room", str], float]
    put: Callable[["Room", Mapping[str, float]], "Room"]  # values by part
    write: Callable[["Room", Mapping[str, float]], "Room"]  # as `put`, and also in the text of the room file


def nearest_temperature(speed: float, air: Air) -> float:
    """Return the temperature (°C) at which the speed of sound in the air is nearest to this one (m/s)."""
    found = air.temperature_at(speed)
    if found is None:
        found = _COLDEST if speed < air.speed_at(_COLDEST) else _WARMEST
    return found


def reflectance_of(room: "Room", material: str) -> float:
    """Return the reflectance of a material, specular and diffuse together."""
    row = room.materials.index(material)
    return math.hypot(room.reflectances[row], room.scattered[row])


def _span(axis: int) -> Bounds:
    """Return a function that returns the bounds of a room along x (0) or y (1)."""

    def bounds(room: "Room", _board: "Board") -> tuple[float, float]:
        ends = [*room.walls.reshape(-1, 2)[:, axis].tolist(), *room.posts[:, axis].tolist()]
        return min(ends), max(ends)

    return bounds


def _speeds(_room: "Room", _board: "Board") -> tuple[float, float]:
    return Air(-10.0).speed_of_sound, Air(45.0).speed_of_sound


def _around(key: str) -> Bounds:
    return lambda _, board: (getattr(board.mount, key) - _REACH, getattr(board.mount, key) + _REACH)


def _with_reflectances(room: "Room", values: Mapping[str, float]) -> "Room":
    import numpy as np

    present = {one: reflectance_of(room, one) for one in values}
    factors = {one: value / present[one] for one, value in values.items() if present[one]}
    by_surface = np.array([factors.get(one, 1.0) for one in room.materials])
    return replace(room, reflectances=room.reflectances * by_surface, scattered=room.scattered * by_surface)


def _write_reflectances(room: "Room", values: Mapping[str, float]) -> "Room":
    from sonarhw_sim.room.room_writing import materials, with_material

    for material, value in values.items():
        room = with_material(room, material, round(value, REFLECTANCE.digits), materials(room)[material].scatter)
    return room


def _shift_walls(room: "Room", values: Mapping[str, float]) -> "Room":

    return with_shifted_walls(room, values)


def _write_walls(room: "Room", values: Mapping[str, float]) -> "Room":

    return with_written_walls(room, values, WALL.digits)


X = PlaceQuantity(
    name="x",
    unit="m",
    step=2e-3,
    bounds=_span(0),
    digits=5,
    label="x",
    group="position",
    offer=Offer("Position", "Position of the sensor in the room", True),
    moves_paths=True,
    value=lambda place: place.position[0],
    put=lambda place, value: replace(place, position=(value, place.position[1])),
)
Y = PlaceQuantity(
    name="y",
    unit="m",
    step=2e-3,
    bounds=_span(1),
    digits=5,
    label="y",
    group="position",
    moves_paths=True,
    value=lambda place: place.position[1],
    put=lambda place, value: replace(place, position=(place.position[0], value)),
)
HEADING = PlaceQuantity(
    name="heading",
    unit="°",
    step=math.radians(0.2),
    bounds=lambda _room, _board: (-math.inf, math.inf),
    digits=3,
    label="step 0 at",
    offer=Offer("Heading", "Direction of step 0 of the turntable", True),
    overlap=1.5,
    value=lambda place: place.heading,
    put=lambda place, value: replace(place, heading=value),
)
OFFSET = BoardQuantity(  # added to every measured range, as in `compare`
    name="offset",
    unit="m",
    step=2e-3,
    bounds=lambda _room, _board: (-_REACH, _REACH),
    digits=5,
    label="range offset",
    offer=Offer("Range offset", "Correction that is added to each measured range", True),
    shifts_place=True,
    overlap=1.4,
    key="range_offset",
    is_correction=True,
)
# for calibration; `fit` does not offer it
SLOPE = BoardQuantity(
    name="slope",
    unit="",
    step=2e-3,
    bounds=lambda _room, board: (board.clock_error - 0.04, board.clock_error + 0.04),
    digits=5,
    label="slope of the range offset",
    key="clock_error",
)
AHEAD = BoardQuantity(
    name="ahead",
    unit="m",
    step=2e-3,
    bounds=_around("ahead"),
    digits=5,
    label="face ahead of the axis",
    group="axis",
    shifts_place=True,
    key="mount.ahead",
)
ASIDE = BoardQuantity(
    name="aside",
    unit="m",
    step=2e-3,
    bounds=_around("aside"),
    digits=5,
    label="face left of the axis",
    group="axis",
    key="mount.aside",
)
SCALE = BoardQuantity(
    name="scale",
    unit="",
    step=5e-4,
    bounds=lambda _room, _board: (0.8, 1.25),
    digits=5,
    label="turntable scale",
    offer=Offer("Turntable scale", "True turn of the turntable by its reported turn", False),
    tolerance=lambda _: _SCALE_TOLERANCE,
    key="turntable_scale",
)
AXIS_X = BoardQuantity(
    name="axis_x",
    unit="m",
    step=2e-3,
    bounds=lambda _, board: (board.axis_x - _REACH, board.axis_x + _REACH),
    digits=5,
    label="axis ahead of the mark",
    moves_paths=True,
    shifts_place=True,
    key="axis_x",
)
AXIS_Y = BoardQuantity(
    name="axis_y",
    unit="m",
    step=2e-3,
    bounds=lambda _, board: (board.axis_y - _REACH, board.axis_y + _REACH),
    digits=5,
    label="axis left of the mark",
    moves_paths=True,
    shifts_place=True,
    key="axis_y",
)
TEMPERATURE = AirQuantity(
    name="temperature",
    unit="°C",
    step=0.5,
    bounds=lambda _room, _board: (-10.0, 45.0),
    digits=2,
    label="air",
    offer=Offer("Air temperature", "Sets the speed of sound; ranges alone rarely separate it from an offset", False),
    key="temperature_c",
    value=lambda air: air.temperature_c,
    put=lambda air, value: replace(air, temperature_c=value),
)
SPEED = AirQuantity(
    name="speed",
    unit="m/s",
    step=0.3,
    bounds=_speeds,
    digits=2,
    label="speed of sound",
    key="temperature_c",
    value=lambda air: air.speed_of_sound,
    put=lambda air, value: replace(air, temperature_c=nearest_temperature(value, air)),
)
THRESHOLD = BoardQuantity(
    name="threshold",
    unit="dB",
    step=0.5,
    bounds=lambda _, board: (board.threshold_db - 20.0, min(0.0, board.threshold_db + 20.0)),
    digits=2,
    label="threshold",
    overlap=2.0,
    tolerance=lambda _: _THRESHOLD_TOLERANCE,
    key="threshold_db",
)
APERTURE = BoardQuantity(
    name="aperture",
    unit="m",
    step=2e-4,
    bounds=lambda _, board: (board.aperture_radius / 2.5, board.aperture_radius * 2.5),
    digits=6,
    label="aperture radius",
    overlap=2.0,
    tolerance=lambda board: _APERTURE_TOLERANCE * board.aperture_radius,
    key="aperture_radius",
)
REFLECTANCE = PartQuantity(
    name="reflectance",
    unit="",
    step=0.01,
    bounds=lambda _room, _board: (0.2, 1.0),
    digits=4,
    label="reflectance",
    group="reflectances",
    offer=Offer("Reflectances", "Amplitude ratio of an echo off each material, 0 to 1", False),
    overlap=2.0,
    tolerance=lambda _: _REFLECTANCE_TOLERANCE,
    part="MATERIAL",
    parts=lambda room: tuple(one for one in room.materials if one not in room.tables),
    value=reflectance_of,
    put=_with_reflectances,
    write=_write_reflectances,
)
WALL = PartQuantity(  # shift of a wall to its left, seen along its points, m
    name="wall",
    unit="m",
    step=2e-3,
    bounds=lambda _room, _board: (-0.1, 0.1),
    digits=5,
    label="wall",
    group="walls",
    moves_paths=True,
    tolerance=lambda _: ROOM_TOLERANCE,
    part="NAME",
    parts=lambda room: room.names[: len(room.walls)],
    value=lambda _room, _wall: 0.0,
    put=_shift_walls,
    write=_write_walls,
)

QUANTITIES: tuple[Quantity, ...] = (
    *(X, Y, HEADING),
    *(OFFSET, AHEAD, ASIDE, SCALE, AXIS_X, AXIS_Y),
    *(TEMPERATURE, SPEED),
    *(THRESHOLD, APERTURE),
    *(REFLECTANCE, WALL),
)
# each word of --free, and its quantities
WORDS: dict[str, tuple[Quantity, ...]] = {one.name: (one,) for one in QUANTITIES}
WORDS |= {word: tuple(one for one in QUANTITIES if one.group == word) for word in (q.group for q in QUANTITIES) if word}


def quantity_named(name: str) -> Quantity:
    """Return the quantity with this name."""
    return WORDS[name][0]


def words_of(kind: type[Quantity] = Quantity) -> str:
    """Return the words for all quantities of a kind, for a help text."""
    several: dict[str, list[str]] = {}
    for one in QUANTITIES:
        if isinstance(one, kind):
            name = f"{one.name}[:{one.part}]" if isinstance(one, PartQuantity) else one.name
            several.setdefault(one.word, []).append(name)
    return ", ".join(word if names == [word] else f"{word} ({', '.join(names)})" for word, names in several.items())


# Parameters of a fit: a free quantity, the scan, material or wall that it belongs to, its bounds and its prior.
#
# Words of `--free` are parsed into `Parameter`s, and values of parameters are applied to room, places and board.


@dataclass(frozen=True)
class Parameter:
    """One number that a fit determines."""

    quantity: Quantity
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


def free_parameters(free: Sequence[str], scans: Sequence[str], room: Room, board: Board) -> tuple[Parameter, ...]:
    """Return the parameters of words such as `position`, `offset` or `reflectance:shelving`.

    `scans` are the names of the scans. Each scan has its own position and heading; all other parameters are shared. The
    bounds are those of the quantity; for a position, the whole room. Raises InputError for unknown words.
    """
    found: dict[str, Parameter] = {}
    for word in free:
        of = word.strip().partition(":")[2]
        for quantity in quantities_of(word):
            for parameter in _of_quantity(quantity, of, scans, room, board):
                found[parameter.name] = parameter
    if {TEMPERATURE, SPEED} <= {parameter.quantity for parameter in found.values()}:
        raise InputError("temperature,speed: each determines the other; free only one of them")
    return tuple(found.values())


def quantities_of(word: str) -> tuple[Quantity, ...]:
    """Return the quantities of a word such as `position` or `wall:east`. Raises InputError for unknown words."""
    head = word.strip().partition(":")[0]
    if head not in WORDS:
        raise InputError(
            f"free {word}: unknown quantity{did_you_mean(head, WORDS) or ';'} expected some of {', '.join(WORDS)}"
        )
    return WORDS[head]


def _of_quantity(quantity: Quantity, of: str, scans: Sequence[str], room: Room, board: Board) -> list[Parameter]:
    bounds = quantity.bounds(room, board)
    if isinstance(quantity, PlaceQuantity):
        if of:
            raise InputError(
                f"free {quantity}:{of}: {quantity} belongs to a scan, not to a part of the room; write {quantity}"
            )
        labels = scans if len(scans) > 1 else [""]
        return [Parameter(quantity, "", k, *bounds, label=label) for k, label in enumerate(labels)]
    known = quantity.parts(room) if isinstance(quantity, PartQuantity) else ()
    if isinstance(quantity, PartQuantity) and not known:
        raise InputError(f"free {quantity}: room {room.name!r} has no {quantity} that a fit can change; leave it out")
    if of and of not in known:
        names = ", ".join(dict.fromkeys(known)) or "none"
        raise InputError(f"free {quantity}:{of}: unknown {quantity} {of!r}; room {room.name!r} has {names}")
    several = [of] if of else list(dict.fromkeys(known)) or [""]
    return [Parameter(quantity, one, None, *bounds) for one in several]


def start_of(parameter: Parameter, places: Sequence[Place], room: Room, board: Board) -> float:
    """Return the mean of the prior, or else the present value in room, place or board, clipped to the bounds."""
    value = parameter.expected
    if value is None:
        value = present_value(parameter, places[parameter.scan or 0], room, board)
    return min(max(value, parameter.lower), parameter.upper)


def present_value(parameter: Parameter, place: Place, room: Room, board: Board) -> float:
    """Return the value of a parameter in place, room or board."""
    match parameter.quantity:
        case PlaceQuantity() as quantity:
            return quantity.value(place)
        case BoardQuantity() as quantity:
            return quantity.value(board)
        case AirQuantity() as quantity:
            return quantity.value(room.air)
        case PartQuantity() as quantity:
            return quantity.value(room, parameter.of)
    raise TypeError(f"{parameter.quantity!r}: unknown kind of quantity; expected place, board, air or part of the room")


def applied(
    values: Mapping[Parameter, float], room: Room, places: Sequence[Place], board: Board
) -> tuple[Room, tuple[Place, ...], Board]:
    """Return room, places and board with these values."""
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
    """Return the values of materials and walls by name, grouped by quantity."""
    found: dict[PartQuantity, dict[str, float]] = {}
    for quantity in QUANTITIES:
        by_part = {parameter.of: value for parameter, value in values.items() if parameter.quantity is quantity}
        if isinstance(quantity, PartQuantity) and by_part:
            found[quantity] = by_part
    return found


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
    found = list(parameters)
    for prior in priors:
        name, _, text = prior.partition("=")
        rows = [k for k, parameter in enumerate(found) if name in (parameter.name, parameter.quantity.name)]
        if not rows:
            known = ", ".join(parameter.name for parameter in parameters)
            raise InputError(f"prior {prior}: expected NAME=… with a free quantity: {known}")
        for k in rows:
            found[k] = _with_prior(found[k], prior, text)
    return tuple(found)


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
    return InputError(
        f"prior {prior}: expected NAME=VALUE+-DEVIATION, or NAME=LOW..HIGH with LOW below HIGH, "
        f"and numbers from -{_MOST:g} to {_MOST:g}"
    )


# Walls moved along their normals by a fit. Neighbouring walls are stretched, so corners and T-junctions stay closed.
#
# A gap of a tenth of a millimetre, or an end behind the wall that it should touch, would diffract as a free end does.


_PARALLEL = 1e-3  # sine of the angle between two lines that count as parallel


def left_normals(walls: FloatArray) -> FloatArray:
    """Return unit normals of walls (n, 4), to the left seen from start to end, (n, 2) float."""
    along = walls[:, 2:] - walls[:, :2]
    return np.asarray(np.column_stack((-along[:, 1], along[:, 0])) / np.hypot(*along.T)[:, None])


def with_shifted_walls(room: Room, shifts: Mapping[str, float]) -> Room:
    """Return the room with walls moved to their left (m, by name).

    A corner moves to where its walls now meet. A wall that ends on another one still ends on it.
    """
    walls = _shifted(room, shifts)
    return replace(room, walls=walls, edges=find_edges(walls, room.names[: len(walls)]))


def can_shift(room: Room, shifts: Mapping[str, float]) -> bool:
    """Return whether all walls keep a length and their directions if some are moved to their left (m, by name)."""
    before, after = (walls[:, 2:] - walls[:, :2] for walls in (room.walls, _shifted(room, shifts)))
    return bool(((before * after).sum(axis=1) > MEETING * np.hypot(*before.T)).all())


def _shifted(room: Room, shifts: Mapping[str, float]) -> FloatArray:
    """Return the walls of `with_shifted_walls`, (n, 4) m."""
    by = np.array([shifts.get(name, 0.0) for name in room.names[: len(room.walls)]])
    normals = left_normals(room.walls)
    ends = room.walls.reshape(-1, 2, 2) + (by[:, None] * normals)[:, None, :]
    for point in np.unique(room.walls.reshape(-1, 2), axis=0):
        for wall, end in np.argwhere((room.walls.reshape(-1, 2, 2) == point).all(axis=2)):
            meeting = _meeting(room.walls, normals, point, wall)
            ends[wall, end] = _corner(point, normals[meeting], by[meeting])
    return np.ascontiguousarray(ends.reshape(-1, 4))


def with_written_walls(room: Room, shifts: Mapping[str, float], digits: int) -> Room:
    """Return the room as `with_shifted_walls` does, rounded to so many decimals, also in the text of its file."""
    shifted = with_shifted_walls(room, shifts).walls.round(digits)
    ends = zip(room.walls.reshape(-1, 2).tolist(), shifted.reshape(-1, 2).tolist(), strict=True)
    return with_corners(room, {(x, y): (new_x, new_y) for (x, y), (new_x, new_y) in ends})


def corner_moves(room: Room, point: FloatArray, columns: Mapping[int, int]) -> FloatArray:
    """Return the derivative of an edge at `point` (2,) by the shift of each wall to its left, (2, columns) float.

    `columns` maps the number of each movable wall to its column.
    """
    normals, moves = left_normals(room.walls), np.zeros((2, len(columns)))
    meeting = _meeting(room.walls, normals, point)
    for wall in columns.keys() & set(meeting.tolist()):
        moves[:, columns[wall]] = _corner(point, normals[meeting], (meeting == wall).astype(np.float64)) - point
    return moves


def _meeting(walls: FloatArray, normals: FloatArray, point: FloatArray, ending: int | None = None) -> NDArray[np.intp]:
    """Return the numbers of the walls (n, 4) that determine where a corner is: those that end there.

    At a T-junction, they are the one that ends there, `ending` or else any, and the other one. A wall that lies flush
    with one that ends there makes no T-junction.
    """
    ends = np.flatnonzero((walls.reshape(-1, 2, 2) == point).all(axis=2).any(axis=1))
    through = np.setdiff1d(np.flatnonzero(wall_distances(point[None], walls)[0] <= MEETING), ends)
    sines = np.abs(normals[through, 0, None] * normals[ends, 1] - normals[through, 1, None] * normals[ends, 0])
    if not len(through) or (sines < _PARALLEL).any():
        return ends
    first = ends[:1] if ending is None else [ending]
    return np.array([*first, *through])


def _corner(point: FloatArray, normals: FloatArray, by: FloatArray) -> FloatArray:
    """Return where lines through `point` with normals (k, 2) meet after a shift by `by` (k,): the nearest solution."""
    if abs(np.linalg.det(normals[[0, -1]])) < _PARALLEL:
        return np.asarray(point + normals[0] * by[0])
    return np.asarray(point + np.linalg.lstsq(normals, by, rcond=None)[0])


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
    words = [word for quantity in QUANTITIES for word in _words(quantity, room, walls)]
    found = [_tolerated(one, room, board, room_tolerance) for one in free_parameters(words, [""], room, board)]
    return tuple(one for one in found if one.deviation and one.name not in taken)


def _words(quantity: Quantity, room: Room, walls: Sequence[str]) -> list[str]:
    if quantity.tolerance is None or (isinstance(quantity, PartQuantity) and not quantity.parts(room)):
        return []
    return [f"{WALL}:{wall}" for wall in walls] if quantity is WALL else [quantity.name]


def _tolerated(parameter: Parameter, room: Room, board: Board, room_tolerance: float) -> Parameter:
    quantity = parameter.quantity
    stated = quantity.tolerance(board) if quantity.tolerance else 0.0
    deviation = room_tolerance if quantity is WALL else stated
    present = present_value(parameter, Place("", (0.0, 0.0)), room, board)
    return replace(
        parameter,
        expected=present,
        deviation=deviation,
        lower=max(parameter.lower, present - _TOLERANCE_REACH * deviation),
        upper=min(parameter.upper, present + _TOLERANCE_REACH * deviation),
        is_tolerated=True,
    )
