"""The mount: where on its carrier a transducer sits, and what of the carrier stands in the way of sound.

Takes a place, which is where the turning axis stands, and a heading.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Self

import numpy as np
from pydantic import Field, model_validator

from sonarhw.readings import FloatArray
from sonarhw_sim.choices import Unit
from sonarhw_sim.room.model import ENDLESS, Place, Room, with_post, with_walls
from sonarhw_sim.room.room_file import MEETING
from sonarhw_sim.toml_file import TomlModel

FACE = "unit"  # what `via` calls the face of a transducer
BODY = "body"
# A metal foil on a metal plate, and the shell of a robot: as hard as anything in a room, so as the example rooms'
# shelving. A guess until a scan of a near wall calibrates it; only the loudness of repeated echoes depends on it.
CARRIER_REFLECTANCE = 0.95

Length = Annotated[float, Field(ge=0, le=10)]
Offset = Annotated[float, Field(ge=-10, le=10)]


FACE_REFLECTANCES = {Unit.PASS: None, Unit.BLOCK: 0.0, Unit.REFLECT: CARRIER_REFLECTANCE}


@dataclass(frozen=True)
class TransducerPose:
    """Where a transducer is when it points along a heading; positions in m, in the room."""

    heading: float  # rad
    sender: tuple[float, float]
    receiver: tuple[float, float]
    ping_time: float = 0.0  # s: when it sends, and from when its own time runs


class Mount(TomlModel):
    """`[mount]` of a board profile: one head on a turntable; lengths in m."""

    ahead: Offset = 0.0  # from the turning axis to the face, along the heading
    aside: Offset = 0.0  # and to the left
    separation: Length = 0.0  # between sender and receiver where they are two, side by side, the sender on the left
    body_radius: Length = 0.0  # of the round body about the axis; 0: there is none

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
        """Whether sound goes the same ways at every heading."""
        return self == ON_AXIS

    def pose(self, place: Place, heading: float) -> TransducerPose:
        """The head when it points along `heading` (rad in the room)."""
        half = self.separation / 2
        return TransducerPose(
            heading,
            _from_axis(place, heading, self.ahead, self.aside + half),
            _from_axis(place, heading, self.ahead, self.aside - half),
        )

    def senders(self, place: Place, heading: float) -> tuple[TransducerPose, ...]:
        """Everything whose ping may be heard at `heading`: the head's own."""
        return (self.pose(place, heading),)


ON_AXIS = Mount()


def _from_axis(place: Place, heading: float, ahead: float, aside: float) -> tuple[float, float]:
    x, y = place.position
    cosine, sine = math.cos(heading), math.sin(heading)
    return x + ahead * cosine - aside * sine, y + ahead * sine + aside * cosine


def with_body(room: Room, place: Place, radius: float) -> Room:
    """The room with a round body about the place, as one post more; as it is where `radius` (m) is 0."""
    if radius == 0.0:
        return room
    # a face on the body stands just outside it
    return with_post(room, (*place.position, radius - MEETING), BODY, CARRIER_REFLECTANCE)


def with_faces(
    room: Room, stands: Sequence[TransducerPose], half_width: float, reflectance: float, height: float | None = None
) -> Room:
    """The room with the faces of transducers as walls behind its own, each `half_width` (m) to both sides.

    As far up and down from `height` (m), where that is known. They bend no sound: their ends lie in the plane of the
    transducer, to which it is deaf.
    """
    span = ENDLESS if height is None else (height - half_width, height + half_width)
    return with_walls(room, face_segments(stands, half_width), FACE, reflectance, span)


def face_segments(stands: Sequence[TransducerPose], half_width: float) -> FloatArray:
    """The faces of transducers across their headings, (n, 4) float, m; where a stand has two, they are two."""
    segments = []
    for stand in stands:
        ax, ay = -half_width * math.sin(stand.heading), half_width * math.cos(stand.heading)
        segments += [(x - ax, y - ay, x + ax, y + ay) for x, y in dict.fromkeys((stand.sender, stand.receiver))]
    return np.array(segments, dtype=np.float64).reshape(-1, 4)
