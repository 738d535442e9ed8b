"""The state of the air, the absorption of sound in it, and the choices of a prediction."""

import math
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property
from typing import Self

from sonarhw.sound_speed import speed_of_sound

# the state of the air, and the absorption of sound in it


_COLDEST, _HOTTEST = -40.0, 60.0  # °C


@dataclass(frozen=True)
class Air:
    """The state of the air; a room file without `[air]` has the defaults."""

    temperature_c: float = 20.0
    relative_humidity: float = 0.5  # 0..1
    pressure_kpa: float = 101.325

    @cached_property
    def speed_of_sound(self) -> float:
        """Speed of sound, m/s."""
        return self.speed_at(self.temperature_c)

    def speed_at(self, temperature_c: float) -> float:
        """Return the speed of sound, m/s, in this air at another temperature."""
        return speed_of_sound(temperature_c, self.relative_humidity, self.pressure_kpa)

    def temperature_at(self, speed: float) -> float | None:
        """Return the temperature, °C, at which sound has this speed, m/s, in this air; None outside -40 to 60 °C."""
        from scipy.optimize import brentq  # slow to import, and rarely needed

        if not self.speed_at(_COLDEST) <= speed <= self.speed_at(_HOTTEST):
            return None
        return float(brentq(lambda temperature: self.speed_at(temperature) - speed, _COLDEST, _HOTTEST))


def absorption(frequency: float, air: Air) -> float:
    """Return the absorption of a plane wave, dB/m (ISO 9613-1, eq. 3 to 5 and annex B)."""
    kelvin = air.temperature_c + 273.15
    warmth = kelvin / 293.15
    pressure = air.pressure_kpa / 101.325
    saturation = 10 ** (-6.8346 * (273.16 / kelvin) ** 1.261 + 4.6151)
    h = air.relative_humidity * 100 * saturation / pressure
    oxygen = pressure * (24 + 4.04e4 * h * (0.02 + h) / (0.391 + h))
    nitrogen = pressure * warmth**-0.5 * (9 + 280 * h * math.exp(-4.170 * (warmth ** (-1 / 3) - 1)))
    classical = 1.84e-11 / pressure * warmth**0.5
    relaxation = warmth**-2.5 * (
        0.01275 * math.exp(-2239.1 / kelvin) / (oxygen + frequency**2 / oxygen)
        + 0.1068 * math.exp(-3352.0 / kelvin) / (nitrogen + frequency**2 / nitrogen)
    )
    loss: float = 8.686 * frequency**2 * (classical + relaxation)
    return loss


# the choices that every prediction offers; nothing heavy is imported, so that a command line can list them


ROOM_TOLERANCE = 0.005  # m, standard deviation of the position of each wall of a room file; assumed
DEFAULT_BOARD = "polaroid-6500"  # the board profile if a user names none


class Model(StrEnum):
    """How to predict a scan: following the sound, or a simpler baseline model to compare with.

    To add a model, add a line here and its function, decorated with `predicts(Model.NAME)`, to
    `sonarhw_sim.predict.prediction`. Command line, study files and comparison take it from here.
    """

    follows_sound: bool  # whether it has paths; only these depend on the unit and the near field

    RAY_FOLLOWING = "ray-following"
    NEAREST = "nearest", False  # the first wall along the axis; with a seed, its distance has random errors
    CONE = "cone", False  # the nearest wall within ±15°
    KUC_SIEGEL = "kuc-siegel"  # single reflections and edges only

    def __new__(cls, name: str, follows_sound: bool = True) -> Self:
        """Make the model of a name."""
        member = str.__new__(cls, name)
        member._value_ = name
        member.follows_sound = follows_sound
        return member


class Receiver(StrEnum):
    """How a board derives a range from the receive signal."""

    FIRST_ECHO = "first-echo"  # the paper's: the first arrival over the threshold, after an ideal gain
    BOARD = "board"  # the ranging board's own: stepped gain, integration, its own clock (sonarhw_sim.board.receiver)


class Unit(StrEnum):
    """The effect of the transducer's body on sound that passes it."""

    PASS = "pass"  # none: it is small, and sound closes around it
    BLOCK = "block"  # sound that meets its face ends there
    REFLECT = "reflect"  # both sides of its face reflect like a wall: appendix A as printed


class EdgeStrength(StrEnum):
    """How strongly an edge diffracts sound."""

    UNIFORM = "uniform"  # by angles, distances and reflectances of its faces, continuous with reflection
    KELLER = "keller"  # by the angles to its faces, too loud near reflection
    PAPER = "paper"  # the same in all directions
