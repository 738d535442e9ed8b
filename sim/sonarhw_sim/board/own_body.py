"""Echoes of the carrier of a sensor, such as a robot's own body: turntable angles and ranges of a mask.

The carrier stands still relative to the turntable, so these echoes have the same turntable angle and range at every
place, and belong to no room.
"""

import math
from collections.abc import Sequence
from typing import Annotated, Self

import numpy as np
from pydantic import Field, model_validator

from sonarhw.readings import Reading
from sonarhw_sim.toml_file import TomlModel, about

OWN_BODY = "own body"  # in texts
_EXACT = 1e-9  # rad and m, for rounding errors

Angle = Annotated[float, Field(ge=-3600, le=3600)]
Range = Annotated[float, Field(ge=0, le=1000)]


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


def of_own_body(parts: OwnBody, readings: Sequence[Reading]) -> "np.ndarray[tuple[int], np.dtype[np.bool_]]":
    """Return which readings are of the carrier's body, (n,) bool."""
    return np.array([is_own_body(parts, one.angle, one.range) for one in readings], dtype=np.bool_)


def without_own_body(parts: OwnBody, readings: Sequence[Reading]) -> Sequence[Reading]:
    """Return the readings that are not of the carrier's body."""
    return [one for one in readings if not is_own_body(parts, one.angle, one.range)] if parts else readings


def own_range(parts: OwnBody, angle: float) -> float | None:
    """Return the range (m) that the carrier's body gives at a turntable angle (rad); None without such an echo."""
    return min((part.middle for part in parts if part.spans(angle)), default=None)
