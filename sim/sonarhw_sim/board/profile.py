"""Board profiles: all properties of a ranging board, read from an included profile or from a file."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, TypeVar

import numpy as np
from pydantic import Field, field_validator, model_validator

from sonarhw.readings import FloatArray
from sonarhw_sim.air import Air, absorption
from sonarhw_sim.board.mount import ON_AXIS, Mount, Offset, OwnBody, OwnBodyPart
from sonarhw_sim.board.ring import Ring
from sonarhw_sim.choices import EdgeStrength, Receiver
from sonarhw_sim.named_file import Shipped
from sonarhw_sim.room.model import Place
from sonarhw_sim.toml_file import TomlModel, about, parse_toml

SHIPPED_BOARDS = Shipped("sonarhw_sim.board.shipped", "board", "board profile")
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
_CHIRP_REACH = 30e3  # Hz; signals contain 60 kHz to each side of the carrier (sonarhw_sim.board.burst)
REARM = 0.44e-3  # s, shortest time for which BLNK is high (6500 data sheet)


@dataclass(frozen=True)
class Tone:
    """A part of the burst at one frequency."""

    frequency: float  # Hz
    cycles: int


class ToneFile(TomlModel):
    """A part of a chirp in a profile."""

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
        tuple[ToneFile, ...], Field(max_length=1000), about("parts of the burst; default: one, at `frequency`")
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
        return self.chirp or (Tone(self.frequency, self.transmit_cycles),)

    def heading_at(self, angle: Number, zero: float) -> Number:
        """Return the heading at a turntable angle, if step 0 should point along `zero`; all rad."""
        return zero + math.radians(self.home_angle_deg) + self.turned(angle)

    def turned(self, angle: Number) -> Number:
        """Return the true turn of the turntable at a turntable angle; both rad."""
        return self.turntable_scale * angle

    def angle_at(self, heading: float, zero: float) -> float:
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
    cosine, sine = math.cos(heading), math.sin(heading)
    return mark[0] + ahead * cosine - left * sine, mark[1] + ahead * sine + left * cosine


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
    values = file.model_dump()
    chirp = tuple(Tone(**tone) for tone in values.pop("chirp"))
    made = {"chirp": chirp, "mount": file.mount, "ring": file.ring, "own_body": file.own_body, "text": text}
    return Board(**values | made)


def board_names() -> list[str]:
    """Return the names of the shipped profiles."""
    return SHIPPED_BOARDS.names()
