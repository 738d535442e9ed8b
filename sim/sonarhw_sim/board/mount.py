"""Position of a transducer on its turntable, and the parts of its mounting that block or reflect sound.

A place is the position of the turning axis. `Mount` is one head on a turntable; `sonarhw_sim.board.ring` has several
sensors around a body. The effect of a face on sound that meets it is a `Unit`.
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
from sonarhw_sim.toml_file import TomlModel, about

FACE = "unit"  # name of a transducer's face in `via`
BODY = "body"
# A metal foil on a metal plate, and the shell of a robot, are assumed as hard as the shelving of the example rooms. No
# scan of a near wall has calibrated this value. It only affects the level of repeated echoes.
BODY_REFLECTANCE = 0.95

Length = Annotated[float, Field(ge=0, le=10)]
Offset = Annotated[float, Field(ge=-10, le=10)]


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
        half = self.separation / 2
        return TransducerPose(
            heading,
            _from_axis(place, heading, self.ahead, self.aside + half),
            _from_axis(place, heading, self.ahead, self.aside - half),
        )

    def senders(self, place: Place, heading: float) -> tuple[TransducerPose, ...]:
        """Return the poses of all senders whose ping may be received at `heading`: the head itself."""
        return (self.pose(place, heading),)


ON_AXIS = Mount()


def _from_axis(place: Place, heading: float, ahead: float, aside: float) -> tuple[float, float]:
    x, y = place.position
    cosine, sine = math.cos(heading), math.sin(heading)
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
