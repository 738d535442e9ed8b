"""The quantities that a fit can determine, each defined once: name, unit, bounds, texts, effect on the model.

To add one, add its definition here and list it in `QUANTITIES`; command line, window and result files use that list.
`objective.py` says what a quantity of the board, of a place, or of a part changes in the likelihood. This module loads
quickly and without NumPy, because the help of the command line lists the quantities.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from sonarhw_sim.air import Air

if TYPE_CHECKING:
    from sonarhw_sim.board.profile import Board
    from sonarhw_sim.room.room import Place, Room

_COLDEST, _WARMEST = -40.0, 60.0  # °C, limits of a room file
_REACH = 0.06  # m, largest difference of a length from the board profile
NEAR = 0.25  # m; a free position is searched within this distance of a given place
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
    temperature = air.temperature_at(speed)
    if temperature is None:
        temperature = _COLDEST if speed < air.speed_at(_COLDEST) else _WARMEST
    return temperature


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


def _length(name: str, label: str, key: str, **more: Any) -> BoardQuantity:
    """Return a length of the board profile that is within some centimetres of the one under its key."""

    def bounds(_room: "Room", board: "Board") -> tuple[float, float]:
        present = quantity.read(board)
        return present - _REACH, present + _REACH

    quantity = BoardQuantity(name=name, unit="m", step=2e-3, bounds=bounds, digits=5, label=label, key=key, **more)
    return quantity


def _with_reflectances(room: "Room", values: Mapping[str, float]) -> "Room":
    import numpy as np

    present = {material: reflectance_of(room, material) for material in values}
    factors = {material: value / present[material] for material, value in values.items() if present[material]}
    by_surface = np.array([factors.get(material, 1.0) for material in room.materials])
    return replace(room, reflectances=room.reflectances * by_surface, scattered=room.scattered * by_surface)


def _write_reflectances(room: "Room", values: Mapping[str, float]) -> "Room":
    from sonarhw_sim.room.room_writing import materials, with_material

    for material, value in values.items():
        room = with_material(room, material, round(value, REFLECTANCE.digits), materials(room)[material].scatter)
    return room


def _shift_walls(room: "Room", values: Mapping[str, float]) -> "Room":
    from sonarhw_compare.fit.free_walls import with_shifted_walls

    return with_shifted_walls(room, values)


def _write_walls(room: "Room", values: Mapping[str, float]) -> "Room":
    from sonarhw_compare.fit.free_walls import with_written_walls

    return with_written_walls(room, values, WALL.digits)


def _coordinate(axis: int, name: str, offer: Offer | None = None) -> PlaceQuantity:
    def put(place: "Place", value: float) -> "Place":
        x, y = place.position
        return replace(place, position=(value, y) if axis == 0 else (x, value))

    return PlaceQuantity(
        name=name,
        unit="m",
        step=2e-3,
        bounds=_span(axis),
        digits=5,
        label=name,
        group="position",
        offer=offer,
        moves_paths=True,
        value=lambda place: place.position[axis],
        put=put,
    )


X = _coordinate(0, "x", Offer("Position", "Position of the sensor in the room", True))
Y = _coordinate(1, "y")
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
AHEAD = _length("ahead", "face ahead of the axis", "mount.ahead", group="axis", shifts_place=True)
ASIDE = _length("aside", "face left of the axis", "mount.aside", group="axis")
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
AXIS_X = _length("axis_x", "axis ahead of the mark", "axis_x", moves_paths=True, shifts_place=True)
AXIS_Y = _length("axis_y", "axis left of the mark", "axis_y", moves_paths=True, shifts_place=True)
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
    parts=lambda room: tuple(material for material in room.materials if material not in room.tables),
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
WORDS: dict[str, tuple[Quantity, ...]] = {quantity.name: (quantity,) for quantity in QUANTITIES}
WORDS |= {
    word: tuple(quantity for quantity in QUANTITIES if quantity.group == word)
    for word in (q.group for q in QUANTITIES)
    if word
}


def quantity_named(name: str) -> Quantity:
    """Return the quantity with this name."""
    return WORDS[name][0]


def words_of(kind: type[Quantity] = Quantity) -> str:
    """Return the words for all quantities of a kind, for a help text."""
    several: dict[str, list[str]] = {}
    for quantity in QUANTITIES:
        if isinstance(quantity, kind):
            name = f"{quantity.name}[:{quantity.part}]" if isinstance(quantity, PartQuantity) else quantity.name
            several.setdefault(quantity.word, []).append(name)
    return ", ".join(word if names == [word] else f"{word} ({', '.join(names)})" for word, names in several.items())
