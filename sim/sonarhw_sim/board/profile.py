"""Board profiles: all properties of a ranging board, read from an included profile or from a file, and its gain."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Self, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, field_validator, model_validator

from sonarhw import arguments
from sonarhw.errors import InputError
from sonarhw.readings import FloatArray, Reading
from sonarhw_sim.air import Air, EdgeStrength, Receiver, Unit, absorption
from sonarhw_sim.files import SHIPPED_BOARDS, TomlModel, about, parse_toml
from sonarhw_sim.room.room import ENDLESS, Place, Room, with_post, with_walls
from sonarhw_sim.room.room_file import MEETING

# Position of a transducer on its turntable, and the parts of its mounting that block or reflect sound.
#
# A place is the position of the turning axis. `Mount` is one head on a turntable; `sonarhw_sim.board.profile` has
# several sensors around a body. The effect of a face on sound that meets it is a `Unit`.
#
# The carrier of a turntable, such as a robot, stands still relative to it. Its echoes therefore have the same
# turntable angle and range at every place, and belong to no room: `OwnBodyPart`.


FACE = "unit"  # name of a transducer's face in `via`
BODY = "body"
# A metal foil on a metal plate, and the shell of a robot, are assumed as hard as the shelving of the example rooms. No
# scan of a near wall has calibrated this value. It only affects the level of repeated echoes.
BODY_REFLECTANCE = 0.95

OWN_BODY = "own body"  # in texts
_EXACT = 1e-9  # rad and m, for rounding errors

Angle = Annotated[float, Field(ge=-3600, le=3600)]
Range = Annotated[float, Field(ge=0, le=1000)]
Length = Annotated[float, Field(ge=0, le=10)]
Offset = Annotated[float, Field(ge=-10, le=10)]


_Real = TypeVar("_Real", float, FloatArray)
FACE_REFLECTANCES = {Unit.PASS: None, Unit.BLOCK: 0.0, Unit.REFLECT: BODY_REFLECTANCE}


@dataclass(frozen=True)
class TransducerPose:
    """Position and heading of a transducer; positions in m, in the room."""

    heading: float  # rad
    sender: tuple[float, float]
    receiver: tuple[float, float]
    ping_time: float = 0.0  # s: when it sends; its echo times count from here


class Mount(TomlModel):
    """`[mount]` of a board profile: one head on a turntable; lengths in m."""

    ahead: Annotated[Offset, about("distance from the turning axis to the face, along the heading", "m")] = 0.0
    aside: Annotated[Offset, about("distance from the turning axis to the face, to the left", "m")] = 0.0
    separation: Annotated[
        Length, about("distance from sender to receiver, side by side, the sender on the left; 0: one transducer", "m")
    ] = 0.0
    body_radius: Annotated[Length, about("radius of the round body about the turning axis; 0: no body", "m")] = 0.0

    @model_validator(mode="after")
    def _sane(self) -> Self:
        if self.body_radius > max(self.ahead, 0.0):
            raise ValueError(
                f"body_radius: expected ahead = {self.ahead:g} m or less, got {self.body_radius:g}; "
                "the face would lie inside the body"
            )
        return self

    @property
    def turns_about_face(self) -> bool:
        """Whether the paths are the same at every heading."""
        return self == ON_AXIS

    def pose(self, place: Place, heading: float) -> TransducerPose:
        """Return the pose of the head at `heading` (rad in the room)."""
        (x, y), half, turned = place.position, self.separation / 2, (math.cos(heading), math.sin(heading))
        return TransducerPose(
            heading,
            from_axis(x, y, turned, self.ahead, self.aside + half),
            from_axis(x, y, turned, self.ahead, self.aside - half),
        )

    def positions(self, headings: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the positions of sender and receiver about the turning axis at `headings` (n,) rad, (n, 2) m each."""
        half, turned = self.separation / 2, (np.cos(headings), np.sin(headings))
        return (
            np.column_stack(from_axis(0.0, 0.0, turned, self.ahead, self.aside + half)),
            np.column_stack(from_axis(0.0, 0.0, turned, self.ahead, self.aside - half)),
        )

    def senders(self, place: Place, heading: float) -> tuple[TransducerPose, ...]:
        """Return the poses of all senders whose ping may be received at `heading`: the head itself."""
        return (self.pose(place, heading),)


ON_AXIS = Mount()


def from_axis(
    x: _Real | float, y: _Real | float, turned: tuple[_Real, _Real], ahead: float, aside: float
) -> tuple[_Real, _Real]:
    """Return the position ahead and aside of the turning axis; `turned`: cosine and sine of one heading or of many."""
    cosine, sine = turned
    return x + ahead * cosine - aside * sine, y + ahead * sine + aside * cosine


def with_body(room: Room, place: Place, radius: float) -> Room:
    """Return the room with a round body about the place as an additional post; unchanged if `radius` (m) is 0."""
    if radius == 0.0:
        return room
    # a face on the body is just outside it
    return with_post(room, (*place.position, radius - MEETING), BODY, BODY_REFLECTANCE)


def with_faces(
    room: Room, poses: Sequence[TransducerPose], half_width: float, reflectance: float, height: float | None = None
) -> Room:
    """Return the room with the faces of transducers appended to its walls, each `half_width` (m) to both sides.

    If `height` (m) is known, they also reach this far up and down. They do not diffract: their ends are in the plane of
    the transducer, where it neither sends nor receives.
    """
    span = ENDLESS if height is None else (height - half_width, height + half_width)
    return with_walls(room, face_segments(poses, half_width), FACE, reflectance, span)


def face_segments(poses: Sequence[TransducerPose], half_width: float) -> FloatArray:
    """Return the faces of transducers across their headings, (n, 4) float, m; two for separate transducers."""
    segments = []
    for pose in poses:
        ax, ay = -half_width * math.sin(pose.heading), half_width * math.cos(pose.heading)
        segments += [(x - ax, y - ay, x + ax, y + ay) for x, y in dict.fromkeys((pose.sender, pose.receiver))]
    return np.array(segments, dtype=np.float64).reshape(-1, 4)


class OwnBodyPart(TomlModel):
    """`[[own_body]]` of a board profile: turntable angles, and the reported ranges of the carrier's echoes there."""

    from_deg: Annotated[Angle, about("first turntable angle, counter-clockwise", "degrees")]
    to_deg: Annotated[Angle, about("last turntable angle, at most a full turn later", "degrees")]
    nearest: Annotated[Range, about("smallest reported range of these echoes", "m")]
    farthest: Annotated[Range, about("largest reported range of these echoes", "m")]

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        if not self.from_deg <= self.to_deg <= self.from_deg + 360:
            raise ValueError(f"to_deg: expected {self.from_deg:g} to {self.from_deg + 360:g}, got {self.to_deg:g}")
        if self.farthest < self.nearest:
            raise ValueError(f"farthest: expected nearest = {self.nearest:g} m or more, got {self.farthest:g}")
        return self

    @property
    def middle(self) -> float:
        """The range in the middle, m."""
        return (self.nearest + self.farthest) / 2

    def spans(self, angle: float) -> bool:
        """Return whether a turntable angle (rad) is among those of the part."""
        turn = math.remainder(angle - math.radians((self.from_deg + self.to_deg) / 2), math.tau)
        return abs(turn) <= math.radians(self.to_deg - self.from_deg) / 2 + _EXACT


OwnBody = tuple[OwnBodyPart, ...]


def is_own_body(parts: OwnBody, angle: float, distance: float | None) -> bool:
    """Return whether a reading at a turntable angle (rad) with this reported range (m) is of the carrier's body."""
    return distance is not None and any(
        part.nearest - _EXACT <= distance <= part.farthest + _EXACT and part.spans(angle) for part in parts
    )


def of_own_body(parts: OwnBody, readings: Sequence[Reading]) -> NDArray[np.bool_]:
    """Return which readings are of the carrier's body, (n,) bool."""
    return np.array([is_own_body(parts, reading.angle, reading.range) for reading in readings], dtype=np.bool_)


def without_own_body(parts: OwnBody, readings: Sequence[Reading]) -> Sequence[Reading]:
    """Return the readings that are not of the carrier's body."""
    return [ping for ping in readings if not is_own_body(parts, ping.angle, ping.range)] if parts else readings


def own_range(parts: OwnBody, angle: float) -> float | None:
    """Return the range (m) that the carrier's body gives at a turntable angle (rad); None without such an echo."""
    return min((part.middle for part in parts if part.spans(angle)), default=None)


# a ring of sensors: each reports the first arrival after its own ping and blanking, whichever sensor sent the sound


_SAME_HEADING = 1e-6  # of the angle between sensors: a heading so near to a sensor's direction is that sensor's


class Ring(TomlModel):
    """`[ring]` of a board profile: sensor 0 points along the place's heading, the others follow counter-clockwise."""

    sensors: Annotated[int, Field(ge=1, le=360), about("number of sensors")]
    radius: Annotated[float, Field(gt=0, le=10), about("radius of the body that carries the faces", "m")]
    interval: Annotated[float, Field(ge=0, le=10), about("time from one ping to the next; 0: all at once", "s")] = 0.0
    order: Annotated[tuple[int, ...], Field(max_length=360), about("firing order; default: 0, 1, 2, …")] = ()

    @model_validator(mode="after")
    def _sane(self) -> Self:
        if self.order and sorted(self.order) != list(range(self.sensors)):
            raise ValueError(f"order: expected each sensor from 0 to {self.sensors - 1} once, got {list(self.order)}")
        return self

    @property
    def body_radius(self) -> float:
        """Radius of the round body about the place, m."""
        return self.radius

    @property
    def turns_about_face(self) -> bool:
        """Whether the paths are the same at every heading: never, because each sensor has its own position."""
        return False

    @property
    def firing_times(self) -> tuple[float, ...]:
        """Time at which each sensor fires, s after the first."""
        order = self.order or range(self.sensors)
        turns = {sensor: turn for turn, sensor in enumerate(order)}
        return tuple(turns[sensor] * self.interval for sensor in range(self.sensors))

    def headings(self, place: Place) -> FloatArray:
        """Return the heading of each sensor, (sensors,) float, rad in the room."""
        return np.asarray((place.heading + np.arange(self.sensors) * (math.tau / self.sensors)) % math.tau)

    def sensor_at(self, place: Place, heading: float) -> int | None:
        """Return the number of the sensor at `heading` (rad in the room), or None."""
        turn = (heading - place.heading) * self.sensors / math.tau
        nearest = round(turn)
        return nearest % self.sensors if abs(turn - nearest) <= _SAME_HEADING else None

    def pose(self, place: Place, heading: float) -> TransducerPose:
        """Return the pose of the sensor at `heading` (rad in the room). Raises InputError if there is none."""
        sensor = self.sensor_at(place, heading)
        if sensor is None:
            raise InputError(
                f"no sensor of the ring points to {math.degrees(heading):g}°; its {self.sensors} sensors are "
                f"{360 / self.sensors:g}° apart, starting at {math.degrees(place.heading):g}°"
            )
        return self._pose(place, sensor)

    def senders(self, place: Place, heading: float) -> tuple[TransducerPose, ...]:
        """Return the poses of all sensors: the receiver at any `heading` may receive all of them."""
        return tuple(self._pose(place, sensor) for sensor in range(self.sensors))

    def _pose(self, place: Place, sensor: int) -> TransducerPose:
        heading = float(self.headings(place)[sensor])
        x, y = place.position
        face = x + self.radius * math.cos(heading), y + self.radius * math.sin(heading)
        return TransducerPose(heading, face, face, self.firing_times[sensor])


MOST_RANGE = 1000.0  # m; sound in air fades long before

MOST_NAME = 60  # bytes in UTF-8; a scanner sends the name, and the protocol limits it

Number = TypeVar("Number", float, FloatArray)
Instant = Annotated[float, Field(gt=0, le=1)]  # s
Level = Annotated[float, Field(ge=-300)]  # dB; lower, an amplitude would be lost to rounding

# The next two values are unverified, so they are only defaults. With this time constant of rise and decay, once as
# sender and once as receiver, the burst of 12 dB has decayed by 0.75 ms, where BINH may end blanking (6500 data sheet).
RISE_CYCLES = 1.5
OWN_BURST_DB = 12.0  # dB over full scale
# REC needs 3 to 16 cycles (from memory), and a barely detected echo is some 45 mm later than a strong one: about 8
INTEGRATION_CYCLES = 8.0
GAIN_STEP_DB = 4.0  # assumed: 44 dB for a wall from 0.41 to 6.5 m in 11 steps
_CHIRP_REACH = 30e3  # Hz; signals contain 60 kHz to each side of the carrier (sonarhw_sim.board.signal)
REARM = 0.44e-3  # s, shortest time for which BLNK is high (6500 data sheet)


class Tone(TomlModel):
    """A part of the burst at one frequency."""

    frequency: Annotated[float, Field(ge=1e3, le=1e6), about("frequency of this part", "Hz")]
    cycles: Annotated[int, Field(ge=1, le=1000), about("number of its cycles")]


class BoardFile(TomlModel):
    """The content of a profile."""

    name: Annotated[str, Field(max_length=MOST_NAME), about("name of the board, for titles and logs")]
    aperture_radius: Annotated[float, Field(gt=0, le=1), about("radius of the vibrating face", "m")]
    frequency: Annotated[float, Field(ge=1e3, le=1e6), about("frequency of the burst", "Hz")]
    transmit_cycles: Annotated[int, Field(ge=1, le=1000), about("number of cycles of the burst")]
    blanking: Annotated[float, Field(ge=0, le=1), about("end of blanking; earlier echoes are not detected", "s")]
    max_range: Annotated[float, Field(gt=0, le=MOST_RANGE), about("largest range", "m")]
    threshold_db: Annotated[
        Level, Field(le=0), about("weakest detected echo, two-way, relative to a perfect wall straight ahead", "dB")
    ]
    rounding: Annotated[float, Field(ge=0, le=1), about("ranges are whole multiples of this; 0: not rounded", "m")] = (
        0.0
    )
    threshold_sd_db: Annotated[
        float,
        Field(ge=0, le=30),
        about("standard deviation of the threshold of a reading: from ping to ping, and between sensors", "dB"),
    ] = 0.0
    range_sd: Annotated[float, Field(ge=0, le=1), about("standard deviation of a range, likewise", "m")] = 0.0
    absorption: Annotated[bool, about("false: no absorption by the air")] = True
    receiver: Annotated[Receiver, Field(strict=False), about("receiver of predictions, if none is given")] = (
        Receiver.FIRST_ECHO
    )
    edge_strength: Annotated[
        EdgeStrength, Field(strict=False), about("diffraction at edges in predictions, if none is given")
    ] = EdgeStrength.UNIFORM
    sum_arrivals: Annotated[
        bool, about("arrivals within one wavelength of path add up with their phases; false: each is detected alone")
    ] = True
    chirp: Annotated[
        tuple[Tone, ...], Field(max_length=1000), about("parts of the burst; default: one, at `frequency`")
    ] = ()
    # a shorter rise would need more than the 60 kHz to each side of the carrier that signals contain
    rise_cycles: Annotated[
        float, Field(ge=0.5, le=100), about("time constant of the transducer's rise and decay, each way", "cycles")
    ] = RISE_CYCLES
    ring_cycles: Annotated[
        Annotated[float, Field(ge=0.5, le=100)] | None,
        about("time constant of the sender's ring-down after the burst; default: `rise_cycles`", "cycles"),
    ] = None
    own_burst_db: Annotated[
        Level, Field(le=60), about("transmit burst in the receiver, over full scale; low for a second transducer", "dB")
    ] = OWN_BURST_DB
    integration_cycles: Annotated[
        float, Field(ge=0, le=1000), about("time constant of the detector; 0: none", "cycles")
    ] = INTEGRATION_CYCLES
    fixed_gain: Annotated[
        bool, about("true: the gain does not rise with time; levels are relative to a wall 0.5 m ahead")
    ] = False
    gain_steps: Annotated[
        tuple[Instant, ...], Field(max_length=1000), about("times of the gain steps; default: an ideal gain", "s")
    ] = ()
    gain_step_db: Annotated[float, Field(ge=0, le=20), about("height of a gain step", "dB")] = GAIN_STEP_DB
    blanking_inhibit: Annotated[
        Annotated[float, Field(ge=0, le=1)] | None, about("when BINH ends blanking early; default: never", "s")
    ] = None
    rearm: Annotated[Instant, about("time from one echo to the next that can be detected", "s")] = REARM
    clock_error: Annotated[
        float,
        Field(ge=-0.1, le=0.1),
        about("0.01: the clock runs 1 % fast, so ranges are 1 % too long"),
    ] = 0.0
    mount: Annotated[Mount, about("one head on a turntable")] = ON_AXIS
    ring: Annotated[Ring | None, about("a ring of sensors, in place of a turntable")] = None
    # `sonarhw calibrate` measures these two
    range_offset: Annotated[float, Field(ge=-1, le=1), about("reported range minus true range", "m")] = 0.0
    home_angle_deg: Annotated[
        float,
        Field(ge=-360, le=360),
        about("direction of the turntable's zero, counter-clockwise from the nominal one", "degrees"),
    ] = 0.0
    turntable_scale: Annotated[
        float, Field(ge=0.5, le=2), about("true turn of the turntable by reported turn; 1.02: it turns 2 % too far")
    ] = 1.0
    axis_x: Annotated[
        Offset, about("position of the turning axis relative to the place, along the turntable's zero", "m")
    ] = 0.0
    axis_y: Annotated[Offset, about("the same, to the left of the turntable's zero", "m")] = 0.0
    own_body: Annotated[
        tuple[OwnBodyPart, ...], Field(max_length=1000), about("echoes of the carrier's own body; default: none")
    ] = ()

    @field_validator("gain_steps")
    @classmethod
    def _in_order(cls, steps: tuple[float, ...]) -> tuple[float, ...]:
        if any(later <= earlier for earlier, later in pairwise(steps)):
            raise ValueError("expected increasing times")
        return steps

    @field_validator("name")
    @classmethod
    def _short(cls, name: str) -> str:
        if len(name.encode()) > MOST_NAME:
            raise ValueError(f"expected at most {MOST_NAME} bytes")
        return name

    @model_validator(mode="after")
    def _one_mounting(self) -> "BoardFile":
        if self.ring is not None and self.mount != ON_AXIS:
            raise ValueError("[mount] and [ring]: expected one of them, a head on a turntable or a ring of sensors")
        return self

    @model_validator(mode="after")
    def _one_gain(self) -> "BoardFile":
        if self.fixed_gain and self.gain_steps:
            raise ValueError("fixed_gain and gain_steps: expected one of them; a fixed gain has no steps")
        return self

    @model_validator(mode="after")
    def _detects_something(self) -> "BoardFile":
        silent = Air().speed_of_sound / 2 * (self.blanking if self.blanking_inhibit is None else self.blanking_inhibit)
        if self.max_range <= silent:
            raise ValueError(
                f"max_range: expected more than {silent:.3g} m, where blanking ends, got {self.max_range:g}; "
                "it would detect nothing"
            )
        return self

    @model_validator(mode="after")
    def _adds_up(self) -> "BoardFile":
        cycles = sum(tone.cycles for tone in self.chirp)
        if self.chirp and cycles != self.transmit_cycles:
            raise ValueError(f"chirp: expected transmit_cycles = {self.transmit_cycles} cycles in all, got {cycles}")
        for row, tone in enumerate(self.chirp):
            if abs(tone.frequency - self.frequency) > _CHIRP_REACH:
                raise ValueError(
                    f"chirp[{row}].frequency: expected one within {_CHIRP_REACH:g} Hz of frequency = "
                    f"{self.frequency:g}, got {tone.frequency:g}"
                )
        if self.blanking_inhibit is not None and self.blanking_inhibit > self.blanking:
            raise ValueError(
                f"blanking_inhibit: expected {self.blanking:g} s (blanking) or less, got {self.blanking_inhibit:g}; "
                "BINH only shortens"
            )
        return self


@dataclass(frozen=True)
class Board:
    """A ranging board; lengths in m, times in s."""

    name: str
    aperture_radius: float
    frequency: float  # Hz
    transmit_cycles: int
    blanking: float  # earlier echoes are not detected
    max_range: float
    threshold_db: float  # of the weakest detected echo, relative to a perfect wall straight ahead
    text: str = field(default="", compare=False, repr=False)  # of the profile, so that a log can contain it
    rounding: float = 0.0  # ranges are reported in whole multiples of this; 0: not rounded
    threshold_sd_db: float = 0.0  # standard deviation of the threshold of a reading
    range_sd: float = 0.0  # standard deviation of a range
    absorption: bool = True  # whether air that differs from what the ideal gain expects has an effect
    receiver: Receiver = Receiver.FIRST_ECHO  # used unless a command selects another
    edge_strength: EdgeStrength = EdgeStrength.UNIFORM  # used unless a command selects another
    sum_arrivals: bool = True  # arrivals within one wavelength of path add up; False: each is detected alone
    chirp: tuple[Tone, ...] = ()  # the tones of the burst; empty: all of it at `frequency`
    rise_cycles: float = RISE_CYCLES  # time constant of rise and decay each way, in cycles
    ring_cycles: float | None = None  # time constant of the sender's ring-down after the burst; None: `rise_cycles`
    own_burst_db: float = OWN_BURST_DB  # transmit burst in the receiver, over full scale
    integration_cycles: float = INTEGRATION_CYCLES  # time constant of the detector, in cycles; 0: none
    fixed_gain: bool = (
        False  # the gain does not rise: far echoes are fainter; levels are relative to a wall 0.5 m ahead
    )
    gain_steps: tuple[float, ...] = ()  # times of the gain steps; empty: the ideal or the fixed gain
    gain_step_db: float = GAIN_STEP_DB
    blanking_inhibit: float | None = None  # when BINH ends blanking early; None: BINH stays low
    rearm: float = REARM  # from one echo to the next that can be detected
    clock_error: float = 0.0  # 0.01: the clock runs 1 % fast, so intervals are too short and counts too high
    mount: Mount = ON_AXIS
    ring: Ring | None = None  # the sensors, if not one on a turntable
    range_offset: float = 0.0  # reported range minus true range
    home_angle_deg: float = 0.0  # direction of the turntable's zero, counter-clockwise from the nominal one
    turntable_scale: float = 1.0  # true turn of the turntable by reported turn
    # position of the turning axis relative to the place, m: along the turntable's zero, and to the left of it
    axis_x: float = 0.0
    axis_y: float = 0.0
    own_body: OwnBody = ()  # echoes of the carrier, which are no echoes of the room

    def __repr__(self) -> str:
        carrier = "" if self.ring is None else f", ring of {self.ring.sensors}"
        return f"Board({self.name!r}, {self.frequency:g} Hz, up to {self.max_range:g} m{carrier})"

    @property
    def mounting(self) -> Mount | Ring:
        """The mount or ring that carries the transducers."""
        return self.ring or self.mount

    @property
    def states_spread(self) -> bool:
        """Whether a prediction of this board has probabilities between 0 and 1. Those of a ring are not computed."""
        return self.ring is None and bool(self.threshold_sd_db or self.range_sd)

    @property
    def certain(self) -> "Board":
        """The board without spreads: one sensor, whose threshold and range offset are those of the profile."""
        return replace(self, threshold_sd_db=0.0, range_sd=0.0)

    def with_numbers(self, numbers: Mapping[str, float]) -> "Board":
        """Return the board with these numbers, by key of the profile. Raises TypeError for an unknown key."""
        changes: dict[str, Any] = dict(numbers)  # which keys is known only at run time
        return replace(self, **changes)

    @property
    def blanking_end(self) -> float:
        """End of blanking by the board's clock, s, with or without BINH."""
        return self.blanking if self.blanking_inhibit is None else self.blanking_inhibit

    @property
    def burst(self) -> tuple[Tone, ...]:
        """The tones of the burst, in order."""
        return self.chirp or (Tone.model_construct(frequency=self.frequency, cycles=self.transmit_cycles),)

    def heading_at(self, angle: Number, zero: float) -> Number:
        """Return the heading at a turntable angle, if step 0 should point along `zero`; all rad."""
        return zero + math.radians(self.home_angle_deg) + self.turned(angle)

    def turned(self, angle: Number) -> Number:
        """Return the true turn of the turntable at a turntable angle; both rad."""
        return self.turntable_scale * angle

    def angle_at(self, heading: Number, zero: float) -> Number:
        """Return the turntable angle at a heading, if step 0 points along `zero`; all rad. The inverse of `turned`."""
        return (heading - zero) / self.turntable_scale

    def faced(self, place: Place) -> Place:
        """Return a place of a room file with the actual heading of the turntable's zero."""
        return replace(place, heading=self.heading_at(0.0, place.heading)) if self.home_angle_deg else place

    def at_axis(self, place: Place) -> Place:
        """Return the place with the position of the turning axis; its heading is the actual one of step 0."""
        if not (self.axis_x or self.axis_y):
            return place
        return replace(place, position=axis_beside(place.position, place.heading, self.axis_x, self.axis_y))

    def wavenumber(self, air: Air) -> float:
        """Return 2π over the wavelength, rad/m."""
        return math.tau * self.frequency / air.speed_of_sound

    def wavelength(self, air: Air) -> float:
        """Return the wavelength, m."""
        return air.speed_of_sound / self.frequency

    def blanked_range(self, air: Air) -> float:
        """Return the range at the end of blanking, m; nearer echoes are not detected."""
        return self.blanking_end * air.speed_of_sound / 2

    def excess_absorption(self, air: Air) -> float:
        """Return the absorption in this air that the ideal gain does not compensate, dB/m.

        The gain compensates absorption at 20 °C and 50 % humidity (the defaults of `Air`).
        """
        return absorption(self.frequency, air) - absorption(self.frequency, Air()) if self.absorption else 0.0

    def unrounded(self, distances: FloatArray) -> FloatArray:
        """Return the ranges by the clock of the board, with its range offset, for true ones, m, same shape."""
        return distances * (1 + self.clock_error) + self.range_offset

    def true_ranges(self, ranges: FloatArray) -> FloatArray:
        """Return the true ranges of reported ones, m, same shape: the inverse of `unrounded`."""
        return (ranges - self.range_offset) / (1 + self.clock_error)

    def reported(self, distances: FloatArray) -> FloatArray:
        """Return the ranges that the board reports for true ones, m, same shape; NaN stays NaN. None is negative."""
        ranges = np.maximum(self.unrounded(distances), 0.0)
        return np.round(ranges / self.rounding) * self.rounding if self.rounding else ranges


def axis_beside(mark: tuple[float, float], heading: float, ahead: float, left: float) -> tuple[float, float]:
    """Return the position, m, of a turning axis that stands beside a mark; the turntable's zero points along `heading`.

    `ahead` (m) is along the zero, and `left` (m) to the left of it.
    """
    return from_axis(*mark, (math.cos(heading), math.sin(heading)), ahead, left)


@arguments.checked(name=arguments.file_name)
def load_board(name: Path | str) -> Board:
    """Return a shipped profile by name, or the one in a file. Raises InputError if it is unknown or wrong.

    A text without `.toml` at its end and without a slash is the name of a shipped profile.
    """
    return parse_board(*SHIPPED_BOARDS.read(name))


def parse_board(text: str, where: str) -> Board:
    """Return the board in the text of a profile. Raises InputError with `where` and the key."""
    return board_from(parse_toml(text, where, BoardFile), text)


def board_from(file: BoardFile, text: str = "") -> Board:
    """Return the board of a checked profile; `text` is the profile as a log contains it."""
    return Board(**{key: getattr(file, key) for key in BoardFile.model_fields}, text=text)


def board_names() -> list[str]:
    """Return the names of the shipped profiles."""
    return SHIPPED_BOARDS.names()


# Gain of the receiver, and transmission loss of a path, in dB.
#
# The ideal gain compensates `path_loss_db` exactly, so amplitudes do not include it. The gain of the 6500 rises in
# steps that approximate it. A fixed gain compensates nothing, so far echoes are faint.


_INSTANTS = 1000  # at which the two gains are compared
NEAREST = 0.01  # m: only echoes to a place on a wall have a shorter path


def path_loss_db(lengths: FloatArray, board: Board) -> FloatArray:
    """Return the loss over `lengths` (m, over 0) relative to 1 m, in the air that the ideal gain expects, dB.

    20 lg of the length (CIM-92-9 §4: the gain cancels it), and ISO 9613-1 at 20 °C and 50 % unless the board has no
    absorption.
    """
    per_metre = absorption(board.frequency, Air()) if board.absorption else 0.0
    return np.asarray(20 * np.log10(lengths) + per_metre * lengths)


def uncompensated_db(lengths: FloatArray, board: Board, air: Air) -> FloatArray:
    """Return the loss over `lengths` (m) that the gain does not compensate, dB, same shape.

    With the ideal gain, this is the absorption beyond the one that it expects. A fixed gain compensates nothing. The
    loss is then spreading and all absorption, relative to a path of 1 m, so a perfect wall 0.5 m straight ahead has 0
    dB.
    """
    excess = board.excess_absorption(air) * lengths
    if not board.fixed_gain:
        return np.asarray(excess)
    return np.asarray(path_loss_db(np.maximum(lengths, NEAREST), board) - _loss_at_1_m_db(board) + excess)


def largest_gain(board: Board, air: Air, max_length: float) -> float:
    """Return the largest amplification of an echo with a path of at most `max_length` (m), amplitude, 1 or more."""
    ends = np.array([2 * board.blanked_range(air), max_length])
    return max(1.0, float(10 ** (-uncompensated_db(ends, board, air).min() / 20)))


def _loss_at_1_m_db(board: Board) -> float:
    return float(path_loss_db(np.ones(1), board)[0])


def stepped_gain_db(times: FloatArray, board: Board) -> FloatArray:
    """Return the gain of the 6500 at `times` (s by the board's clock), dB, same shape.

    A resistor sets the level of the first step (TL852 data sheet, Texas Instruments SLSS003), so it differs between
    boards. It is chosen so that the mean difference to the ideal gain between the first and the last step is zero.
    """
    steps = np.searchsorted(np.array(board.gain_steps), times, side="right")
    return np.asarray(_first_gain_db(board) + board.gain_step_db * steps)


@lru_cache(maxsize=16)
def _first_gain_db(board: Board) -> float:
    begin, end = board.gain_steps[0], board.gain_steps[-1]
    times = begin + (end - begin) * (np.arange(_INSTANTS) + 0.5) / _INSTANTS
    steps = np.searchsorted(np.array(board.gain_steps), times, side="right")
    ideal = path_loss_db(times * Air().speed_of_sound, board)
    return float((ideal - board.gain_step_db * steps).mean())
