"""Parameters of a fit: what may be free, what is known of it beforehand, and what it changes.

Takes names as a person types them; hands on frozen `Parameter`s, and room, places and board as values of them make
them.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
from scipy.optimize import brentq
from sonarhw_sim.air import Air
from sonarhw_sim.board.profile import Board
from sonarhw_sim.room.model import Place, Room

from sonarhw.errors import InputError
from sonarhw_compare.fit.values.free_walls import with_shifted_walls

_COLDEST, _WARMEST = -40.0, 60.0  # °C, as room files have it


class Kind(StrEnum):
    """What a parameter changes; values are in SI units and absolute unless something else is said."""

    X = "x"  # of a place, m
    Y = "y"
    HEADING = "heading"  # of a place, rad
    OFFSET = "offset"  # m, added to every measured range, as `compare` has it
    AHEAD = "ahead"  # m, from the turning axis to the face
    ASIDE = "aside"  # m, and to the left
    TEMPERATURE = "temperature"  # °C
    SPEED = "speed"  # of sound, m/s
    THRESHOLD = "threshold"  # dB
    APERTURE = "aperture"  # radius, m
    REFLECTANCE = "reflectance"  # of a material, amplitude ratio
    WALL = "wall"  # m by which a wall moves to its left, seen along its points


OF_PLACE = (Kind.X, Kind.Y, Kind.HEADING)
# What a person types, and which kinds that is
WORDS = {kind.value: (kind,) for kind in Kind} | {"position": (Kind.X, Kind.Y), "axis": (Kind.AHEAD, Kind.ASIDE)}
WORDS |= {"reflectances": (Kind.REFLECTANCE,), "walls": (Kind.WALL,)}


@dataclass(frozen=True)
class Parameter:
    """One number that a fit may choose."""

    kind: Kind
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
        return self.kind + (f":{self.of}" if self.of else "") + (f"@{self.label}" if self.label else "")


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
        for kind in kinds_of(word):
            for parameter in _of_kind(kind, of, scans, room, board):
                found[parameter.name] = parameter
    if {Kind.TEMPERATURE, Kind.SPEED} <= {parameter.kind for parameter in found.values()}:
        raise InputError("--free temperature,speed: one tells the other; free only one of them")
    return tuple(found.values())


def kinds_of(word: str) -> tuple[Kind, ...]:
    """The kinds that a word such as `position` or `wall:east` stands for. Raises InputError for any other word."""
    head = word.strip().partition(":")[0]
    if head not in WORDS:
        raise InputError(f"--free {word}: expected some of {', '.join(WORDS)}")
    return WORDS[head]


def _of_kind(kind: Kind, of: str, scans: Sequence[str], room: Room, board: Board) -> list[Parameter]:
    if kind in OF_PLACE:
        if of:
            raise InputError(f"--free {kind}:{of}: every scan has its own; write {kind}")
        labels = scans if len(scans) > 1 else [""]
        bounds = bounds_of(kind, room, board)
        return [Parameter(kind, "", k, *bounds, label=label) for k, label in enumerate(labels)]
    known = {Kind.REFLECTANCE: room.materials, Kind.WALL: room.names[: len(room.walls)]}.get(kind, ())
    if of and of not in known:
        raise InputError(f"--free {kind}:{of}: room {room.name!r} has {', '.join(dict.fromkeys(known)) or 'none'}")
    several = [of] if of else list(dict.fromkeys(known)) or [""]
    return [Parameter(kind, one, None, *bounds_of(kind, room, board)) for one in several]


def bounds_of(kind: Kind, room: Room, board: Board) -> tuple[float, float]:
    """The widest that a parameter of that kind may go, in its unit; a heading goes all round."""
    corners = np.vstack((room.walls.reshape(-1, 2), room.posts[:, :2]))
    (left, bottom), (right, top) = corners.min(axis=0).tolist(), corners.max(axis=0).tolist()
    mount = board.mount
    return {
        Kind.X: (left, right),
        Kind.Y: (bottom, top),
        Kind.HEADING: (-math.inf, math.inf),
        Kind.OFFSET: (-0.06, 0.06),
        Kind.AHEAD: (mount.ahead - 0.06, mount.ahead + 0.06),
        Kind.ASIDE: (mount.aside - 0.06, mount.aside + 0.06),
        Kind.TEMPERATURE: (-10.0, 45.0),
        Kind.SPEED: (Air(-10.0).speed_of_sound, Air(45.0).speed_of_sound),
        Kind.THRESHOLD: (board.threshold_db - 20.0, min(0.0, board.threshold_db + 20.0)),
        Kind.APERTURE: (board.aperture_radius / 2.5, board.aperture_radius * 2.5),
        Kind.REFLECTANCE: (0.2, 1.0),
        Kind.WALL: (-0.1, 0.1),
    }[kind]


def start_of(parameter: Parameter, places: Sequence[Place], room: Room, board: Board) -> float:
    """The value that room, place and board have now, within the parameter's bounds; what is expected where given."""
    place = places[parameter.scan or 0]
    value = parameter.expected
    if value is None:
        value = {
            Kind.X: place.position[0],
            Kind.Y: place.position[1],
            Kind.HEADING: place.heading,
            Kind.OFFSET: 0.0,
            Kind.AHEAD: board.mount.ahead,
            Kind.ASIDE: board.mount.aside,
            Kind.TEMPERATURE: room.air.temperature_c,
            Kind.SPEED: room.air.speed_of_sound,
            Kind.THRESHOLD: board.threshold_db,
            Kind.APERTURE: board.aperture_radius,
            Kind.REFLECTANCE: reflectance_of(room, parameter.of) if parameter.kind is Kind.REFLECTANCE else 0.0,
            Kind.WALL: 0.0,
        }[parameter.kind]
    return min(max(value, parameter.lower), parameter.upper)


def reflectance_of(room: Room, material: str) -> float:
    """The reflectance of a material, mirrored and scattered together."""
    row = room.materials.index(material)
    return float(math.hypot(room.reflectances[row], room.scattered[row]))


def applied(
    values: Mapping[Parameter, float], room: Room, places: Sequence[Place], board: Board
) -> tuple[Room, tuple[Place, ...], Board]:
    """Room, places and board with those values."""
    shifts = {parameter.of: value for parameter, value in values.items() if parameter.kind is Kind.WALL}
    if shifts:
        room = with_shifted_walls(room, shifts)
    room = _with_reflectances(values, replace(room, air=_air(values, room.air)))
    moved = list(places)
    for parameter, value in values.items():
        if parameter.kind in OF_PLACE:
            for k in range(len(moved)) if parameter.scan is None else [parameter.scan]:
                moved[k] = _moved(moved[k], parameter.kind, value)
    return room, tuple(moved), _board(values, board)


def _air(values: Mapping[Parameter, float], air: Air) -> Air:
    for parameter, value in values.items():
        if parameter.kind is Kind.TEMPERATURE:
            air = replace(air, temperature_c=value)
        elif parameter.kind is Kind.SPEED:
            air = replace(air, temperature_c=temperature_at(value, air))
    return air


def temperature_at(speed: float, air: Air) -> float:
    """The temperature (°C) at which that air has that speed of sound (m/s); its bounds where none has."""

    def excess(temperature: float) -> float:
        return replace(air, temperature_c=temperature).speed_of_sound - speed

    if excess(_COLDEST) > 0:
        return _COLDEST
    return float(brentq(excess, _COLDEST, _WARMEST, xtol=1e-6)) if excess(_WARMEST) > 0 else _WARMEST


def _with_reflectances(values: Mapping[Parameter, float], room: Room) -> Room:
    factors = np.ones(len(room.materials))
    for parameter, value in values.items():
        if parameter.kind is Kind.REFLECTANCE:
            old = reflectance_of(room, parameter.of)
            factors[[name == parameter.of for name in room.materials]] = value / old if old else 1.0
    return replace(room, reflectances=room.reflectances * factors, scattered=room.scattered * factors)


def _moved(place: Place, kind: Kind, value: float) -> Place:
    x, y = place.position
    if kind is Kind.HEADING:
        return replace(place, heading=value)
    return replace(place, position=(value, y) if kind is Kind.X else (x, value))


def _board(values: Mapping[Parameter, float], board: Board) -> Board:
    for parameter, value in values.items():
        match parameter.kind:
            case Kind.OFFSET:
                board = replace(board, range_offset=board.range_offset - value)
            case Kind.AHEAD | Kind.ASIDE:
                board = replace(board, mount=board.mount.model_copy(update={parameter.kind.value: value}))
            case Kind.THRESHOLD:
                board = replace(board, threshold_db=value)
            case Kind.APERTURE:
                board = replace(board, aperture_radius=value)
    return board
