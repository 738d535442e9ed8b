"""Changes of a room that may explain misfits: a new post or wall, a moved wall, another reflectance."""

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from sonarhw_sim.room.room import Room
from sonarhw_sim.room.room_writing import changed_room, section

from sonarhw.errors import InputError
from sonarhw_compare.explain.sentences import LengthText
from sonarhw_compare.fit.values.free_walls import with_written_walls
from sonarhw_compare.room_edit import Point, add_post, add_wall, set_material
from sonarhw_compare.room_finding.evidence import REFLECTANCE

OBJECT = "found object"  # material of new posts and walls
_DIGITS = 4  # of metres in a room file


class RoomChange(Protocol):
    """A change of a room."""

    def applied(self, room: Room) -> Room:
        """Return the changed room. Its text is edited, so it can be saved. Raises InputError if it is not possible."""

    def text(self, length: LengthText) -> str:
        """Return what is changed; `length` formats lengths, m."""


@dataclass(frozen=True)
class NewPost:
    """A round object that the room does not contain."""

    center: Point  # m
    radius: float  # m

    def applied(self, room: Room) -> Room:
        """Return the room with the post. Raises InputError if it overlaps another post."""
        x, y = (round(at, _DIGITS) for at in self.center)
        if (np.hypot(*(room.posts[:, :2] - (x, y)).T) < room.posts[:, 2] + self.radius).any():
            raise InputError(f"a post at {_point(self.center)} overlaps another one; choose another place")
        return add_post(_with_object(room), (x, y), round(self.radius, _DIGITS), OBJECT)

    def text(self, length: LengthText) -> str:
        """Return where it is."""
        return f"something near {_point(self.center)}: a post of radius {length(self.radius)}"


@dataclass(frozen=True)
class NewWall:
    """A straight object that the room does not contain."""

    start: Point  # m
    end: Point  # m

    def applied(self, room: Room) -> Room:
        """Return the room with the wall."""
        ends = [(round(x, _DIGITS), round(y, _DIGITS)) for x, y in (self.start, self.end)]
        return add_wall(_with_object(room), ends[0], ends[1], OBJECT)

    def text(self, length: LengthText) -> str:
        """Return where it is."""
        return f"something from {_point(self.start)} to {_point(self.end)}: a wall"


@dataclass(frozen=True)
class MovedWall:
    """A wall at another distance from the sensor; corners move to where the walls then meet."""

    wall: str
    left: float  # m, to its left, seen from its start to its end
    farther: float  # m, from the sensor

    def applied(self, room: Room) -> Room:
        """Return the room with the moved wall."""
        return with_written_walls(room, {self.wall: self.left}, _DIGITS)

    def text(self, length: LengthText) -> str:
        """Return by how much it moves."""
        return f"wall {self.wall} is {length(abs(self.farther))} {'farther' if self.farther > 0 else 'nearer'}"


@dataclass(frozen=True)
class OtherReflectance:
    """A surface that reflects more or less sound than assumed."""

    surface: str
    before: float  # amplitude ratio
    reflectance: float
    edge: str | None = None  # where its sound is diffracted, if that is what changes

    def applied(self, room: Room) -> Room:
        """Return the room with a material of this reflectance for the surface."""
        number = room.names.index(self.surface)
        name = f"{room.materials[number]} {self.reflectance:g}"
        with_one = changed_room(
            room, lambda document: section(document, "materials", name).update(reflectance=self.reflectance)
        )
        return set_material(with_one, number, name)

    def in_arrays(self, room: Room) -> Room:
        """Return the room with the reflectance, faster, with the text of the old one."""
        values = room.reflectances.copy()
        values[room.names.index(self.surface)] = self.reflectance
        return replace(room, reflectances=values)

    def text(self, _: LengthText) -> str:
        """Return what reflects more or less."""
        weaker = self.reflectance < self.before
        change = f"reflectance {self.reflectance:.2f} instead of {self.before:.2f}"
        if self.edge is not None:
            return f"edge {self.edge} is {'weaker' if weaker else 'stronger'} than assumed: {self.surface} has {change}"
        return f"{self.surface} reflects {'less' if weaker else 'more'} than assumed: {change}"


def _with_object(room: Room) -> Room:
    return changed_room(
        room, lambda document: section(document, "materials", OBJECT).setdefault("reflectance", REFLECTANCE)
    )


def _point(at: Point) -> str:
    x, y = (np.round(at, 2) + 0.0).tolist()
    return f"{x:.2f}, {y:.2f} m"
