"""The ring: several sensors round a body, each pointing outwards, that may hear one another.

Takes a place, which is the centre of the body, and the heading of a sensor; hands on where that sensor stands, and all
the others, with when each of them fires. What a sensor reports is the first arrival over its threshold after its
blanking, counted from its own ping, whoever's ping it was.
"""

import math
from typing import Annotated, Self

import numpy as np
from pydantic import Field, model_validator

from sonarhw.errors import InputError
from sonarhw.readings import FloatArray
from sonarhw_sim.board.mount import TransducerPose
from sonarhw_sim.room.model import Place
from sonarhw_sim.toml_file import TomlModel

_POINTS_ALONG = 1e-6  # of the angle between sensors: how near to one's direction a heading must lie to be its


class Ring(TomlModel):
    """`[ring]` of a board profile: sensor 0 points along the place's heading, the others follow counter-clockwise."""

    sensors: Annotated[int, Field(ge=1, le=360)]
    radius: Annotated[float, Field(gt=0, le=10)]  # m: of the body, on which the faces sit
    interval: Annotated[float, Field(ge=0, le=10)] = 0.0  # s from one ping to the next; 0: all at once
    order: tuple[int, ...] = ()  # which sensor fires first, second, ...; empty: 0, 1, 2, ...

    @model_validator(mode="after")
    def _sane(self) -> Self:
        if self.order and sorted(self.order) != list(range(self.sensors)):
            raise ValueError(f"order: expected each sensor from 0 to {self.sensors - 1} once, got {list(self.order)}")
        return self

    @property
    def body_radius(self) -> float:
        """Of the round body about the place, m."""
        return self.radius

    @property
    def turns_about_face(self) -> bool:
        """Whether sound goes the same ways at every heading: never, each sensor stands somewhere else."""
        return False

    @property
    def firing_times(self) -> tuple[float, ...]:
        """When each sensor fires, s after the first."""
        order = self.order or range(self.sensors)
        turns = {sensor: turn for turn, sensor in enumerate(order)}
        return tuple(turns[sensor] * self.interval for sensor in range(self.sensors))

    def headings(self, place: Place) -> FloatArray:
        """Where each sensor points, (sensors,) float, rad in the room."""
        return np.asarray((place.heading + np.arange(self.sensors) * (math.tau / self.sensors)) % math.tau)

    def sensor_at(self, place: Place, heading: float) -> int | None:
        """The sensor that points along `heading` (rad in the room); None: none does."""
        turn = (heading - place.heading) * self.sensors / math.tau
        nearest = round(turn)
        return nearest % self.sensors if abs(turn - nearest) <= _POINTS_ALONG else None

    def pose(self, place: Place, heading: float) -> TransducerPose:
        """The sensor that points along `heading` (rad in the room). Raises InputError where none does."""
        sensor = self.sensor_at(place, heading)
        if sensor is None:
            raise InputError(
                f"no sensor of the ring points to {math.degrees(heading):g}°: its {self.sensors} stand "
                f"{360 / self.sensors:g}° apart from {math.degrees(place.heading):g}° on"
            )
        return self._pose(place, sensor)

    def senders(self, place: Place, heading: float) -> tuple[TransducerPose, ...]:
        """Every sensor: whichever `heading` one listens at, it may hear them all."""
        return tuple(self._pose(place, sensor) for sensor in range(self.sensors))

    def _pose(self, place: Place, sensor: int) -> TransducerPose:
        heading = float(self.headings(place)[sensor])
        x, y = place.position
        face = x + self.radius * math.cos(heading), y + self.radius * math.sin(heading)
        return TransducerPose(heading, face, face, self.firing_times[sensor])
