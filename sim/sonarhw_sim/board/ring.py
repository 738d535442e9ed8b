"""A ring of sensors around a body, each pointing outwards; every sensor may receive the pings of all.

A place is the centre of the body. A sensor reports the first arrival above its threshold after its blanking, measured
from its own ping, whichever sensor sent the sound.
"""

import math
from typing import Annotated, Self

import numpy as np
from pydantic import Field, model_validator

from sonarhw.errors import InputError
from sonarhw.readings import FloatArray
from sonarhw_sim.board.mount import TransducerPose
from sonarhw_sim.room.model import Place
from sonarhw_sim.toml_file import TomlModel, about

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
