"""Board profiles: everything that makes one ranging board answer differently from another.

Takes the name of a profile that ships with the product, or a file; hands on a frozen `Board`.
"""

import math
from dataclasses import dataclass, field
from importlib.resources import files
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field

from sim.air import Air, absorption
from sim.toml_file import TomlModel, parse_toml, read_text
from sonarhw.errors import InputError
from sonarhw.readings import FloatArray

Positive = Annotated[float, Field(gt=0)]


class BoardFile(TomlModel):
    """What may stand in a profile."""

    name: str
    aperture_radius: Positive  # m
    frequency: Annotated[float, Field(ge=1e3, le=1e6)]  # Hz
    transmit_cycles: Annotated[int, Field(ge=1)]
    blanking: Annotated[float, Field(ge=0)]  # s
    max_range: Positive  # m
    threshold_db: Annotated[float, Field(le=0)]
    rounding: Annotated[float, Field(ge=0)] = 0.0  # m; 0: none
    absorption: bool = True
    range_offset: float = 0.0  # m; `sonarhw calibrate` finds these two
    home_angle_deg: Annotated[float, Field(ge=-360, le=360)] = 0.0


@dataclass(frozen=True)
class Board:
    """A ranging board; lengths in m, times in s."""

    name: str
    aperture_radius: float
    frequency: float  # Hz
    transmit_cycles: int
    blanking: float  # nothing is heard before this time
    max_range: float
    threshold_db: float  # of the weakest echo heard, relative to a perfect wall straight ahead
    text: str = field(default="", compare=False, repr=False)  # the profile, so that a log can carry it
    rounding: float = 0.0  # ranges are reported in whole multiples of this; 0: as they are
    absorption: bool = True  # whether air other than the ideal gain expects makes a difference
    range_offset: float = 0.0  # what this board tells beyond the true range
    home_angle_deg: float = 0.0  # where the turntable's zero points, counter-clockwise from where it should

    def wavenumber(self, air: Air) -> float:
        """2π over the wavelength, rad/m."""
        return math.tau * self.frequency / air.speed_of_sound

    def wavelength(self, air: Air) -> float:
        """Wavelength in that air, m."""
        return air.speed_of_sound / self.frequency

    def blanked_range(self, air: Air) -> float:
        """Range below which nothing is heard, m."""
        return self.blanking * air.speed_of_sound / 2

    def excess_absorption(self, air: Air) -> float:
        """What this air takes beyond what the ideal gain gives back, dB/m.

        The gain is made for 20 °C and 50 % humidity (the defaults of `Air`).
        """
        return absorption(self.frequency, air) - absorption(self.frequency, Air()) if self.absorption else 0.0

    def reported(self, distances: FloatArray) -> FloatArray:
        """The ranges the board would report for true ones, m, same shape; NaN stays NaN."""
        told = distances + self.range_offset if self.range_offset else distances
        return np.round(told / self.rounding) * self.rounding if self.rounding else told


def load_board(wanted: str) -> Board:
    """The profile that ships under this name, or in this file. Raises InputError where there is none or it is wrong."""
    if wanted.endswith(".toml"):
        return parse_board(read_text(Path(wanted), "board profile"), wanted)
    shipped = files("sim.boards") / f"{wanted}.toml"
    if wanted not in board_names():
        raise InputError(f"no board {wanted!r}; known: {', '.join(board_names())}, or a file NAME.toml")
    return parse_board(shipped.read_text(encoding="utf-8"), shipped.name)


def parse_board(text: str, where: str) -> Board:
    """The board in the text of a profile. Raises InputError naming `where` and the key."""
    return Board(**parse_toml(text, where, BoardFile).model_dump(), text=text)


def board_names() -> list[str]:
    """Names of the profiles that ship with the product."""
    return sorted(
        entry.name.removesuffix(".toml") for entry in files("sim.boards").iterdir() if entry.name.endswith(".toml")
    )
