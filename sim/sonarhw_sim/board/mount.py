"""Position of a transducer on its turntable, and the parts of its mounting that block or reflect sound.

A place is the position of the turning axis. `Mount` is one head on a turntable; `sonarhw_sim.board.ring` has several
sensors around a body. The effect of a face on sound that meets it is a `Unit`.

The carrier of a turntable, such as a robot, stands still relative to it. Its echoes therefore have the same turntable
angle and range at every place, and belong to no room: `OwnBodyPart`.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Self, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from sonarhw.readings import FloatArray, Reading
from sonarhw_sim.choices import Unit
from sonarhw_sim.room.model import ENDLESS, Place, Room, with_post, with_walls
from sonarhw_sim.room.room_file import MEETING
from sonarhw_sim.toml_file import TomlModel, about

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
            _from_axis(x, y, turned, self.ahead, self.aside + half),
            _from_axis(x, y, turned, self.ahead, self.aside - half),
        )

    def positions(self, headings: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the positions of sender and receiver about the turning axis at `headings` (n,) rad, (n, 2) m each."""
        half, turned = self.separation / 2, (np.cos(headings), np.sin(headings))
        return (
            np.column_stack(_from_axis(0.0, 0.0, turned, self.ahead, self.aside + half)),
            np.column_stack(_from_axis(0.0, 0.0, turned, self.ahead, self.aside - half)),
        )

    def senders(self, place: Place, heading: float) -> tuple[TransducerPose, ...]:
        """Return the poses of all senders whose ping may be received at `heading`: the head itself."""
        return (self.pose(place, heading),)


ON_AXIS = Mount()


def _from_axis(x: float, y: float, turned: tuple[_Real, _Real], ahead: float, aside: float) -> tuple[_Real, _Real]:
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
    return np.array([is_own_body(parts, one.angle, one.range) for one in readings], dtype=np.bool_)


def without_own_body(parts: OwnBody, readings: Sequence[Reading]) -> Sequence[Reading]:
    """Return the readings that are not of the carrier's body."""
    return [one for one in readings if not is_own_body(parts, one.angle, one.range)] if parts else readings


def own_range(parts: OwnBody, angle: float) -> float | None:
    """Return the range (m) that the carrier's body gives at a turntable angle (rad); None without such an echo."""
    return min((part.middle for part in parts if part.spans(angle)), default=None)
