"""A draft of a room: walls on straight lines, whose ends are free or meet other walls, posts, and places of scans."""

import math
import operator
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, TypeVar

import numpy as np
from sonarhw_sim.air import Air
from sonarhw_sim.room.edges import find_edges
from sonarhw_sim.room.room import Place, Room, join_ends, with_post, with_walls

from sonarhw.readings import FloatArray

MATERIAL, REFLECTANCE = "found", 0.9  # of found walls and posts; the reflectance is assumed
_PARALLEL = math.sin(math.radians(8))  # lines that differ less in direction do not meet in a corner
_LONGEST = 50.0  # m, from the middle of a wall to an end that meets another wall
_SHORTEST = 0.02  # m, of a wall
_SAME_CORNER = 0.05  # m, between the corners that an end may have with two walls on almost one line
_DIGITS = 9  # of the values of drafts that are compared: nanometres
_TOUCHING = 0.01  # m, between a wall and the end of one that reaches it

_Part = TypeVar("_Part")


@dataclass(frozen=True)
class DraftEnd:
    """An end of a wall: at a distance along it, or where its line meets that of another wall."""

    at: float  # m along the wall from its middle, negative for the first end
    meets: int | None = None  # key of the other wall


@dataclass(frozen=True)
class DraftWall:
    """A wall on the line through `middle` along `angle`, turned about `middle` when it is refined."""

    middle: tuple[float, float]  # m
    angle: float  # rad
    ends: tuple[DraftEnd, DraftEnd]

    @cached_property
    def along(self) -> FloatArray:
        """Unit vector from the first end to the second, (2,)."""
        return np.array([math.cos(self.angle), math.sin(self.angle)])

    @cached_property
    def normal(self) -> FloatArray:
        """Unit vector to the left of the wall, (2,)."""
        return np.array([-math.sin(self.angle), math.cos(self.angle)])

    def moved(self, left: float, turn: float) -> "DraftWall":
        """Return the wall moved to its left by `left` (m) and turned about its middle by `turn` (rad)."""
        x, y = (np.array(self.middle) + left * self.normal).tolist()
        return replace(self, middle=(x, y), angle=self.angle + turn)

    def with_end(self, which: int, end: DraftEnd) -> "DraftWall":
        """Return the wall with another first (0) or second (1) end."""
        return replace(self, ends=(end, self.ends[1]) if which == 0 else (self.ends[0], end))


@dataclass(frozen=True)
class DraftPost:
    """A round object."""

    center: tuple[float, float]  # m
    radius: float  # m


@dataclass(frozen=True)
class RoomDraft:
    """Walls by their keys, posts, and the place of each scan; frozen, so that every change is a new draft."""

    places: tuple[Place, ...]
    walls: dict[int, DraftWall] = field(default_factory=dict)
    posts: tuple[DraftPost, ...] = ()
    offset: float = 0.0  # m, by which all ranges are longer than the board's profile states
    threshold_db: float = 0.0  # dB, by which the threshold is higher than the board's profile states
    base: Room | None = None  # a known room, whose walls and posts are fixed; those of the draft are added to it

    def with_wall(self, key: int, wall: DraftWall) -> "RoomDraft":
        """Return the draft with one more or another wall."""
        return replace(self, walls={**self.walls, key: wall})

    def with_new_wall(self, wall: DraftWall) -> tuple["RoomDraft", int]:
        """Return the draft with one more wall, and its key."""
        key = max(self.walls, default=-1) + 1
        return self.with_wall(key, wall), key

    def without_wall(self, key: int) -> "RoomDraft":
        """Return the draft without a wall; ends that met it meet another wall there, or stay where they are."""
        walls = {other: wall for other, wall in self.walls.items() if other != key}
        return self._without(key, lambda wall, along: self._end_elsewhere(wall, along, walls))

    def without_only(self, key: int) -> "RoomDraft":
        """Return the draft without a wall; all others stay where they are, with free ends where they met it."""
        return self._without(key, lambda _, along: DraftEnd(along))

    def _without(self, key: int, end_at: Callable[[DraftWall, float], DraftEnd]) -> "RoomDraft":
        """Return the draft without a wall; `end_at` returns the new end of a wall that met it, m along that wall."""
        kept = {}
        for other, wall in self.walls.items():
            ends = [
                end_at(wall, along) if end.meets == key else end
                for end, along in zip(wall.ends, self.extent(other), strict=True)
            ]
            kept[other] = replace(wall, ends=(ends[0], ends[1]))
        return replace(self, walls={other: wall for other, wall in kept.items() if other != key})

    def without_post(self, post: DraftPost) -> "RoomDraft":
        """Return the draft without one of its posts."""
        return replace(self, posts=tuple(other for other in self.posts if other is not post))

    @staticmethod
    def _end_elsewhere(wall: DraftWall, along: float, walls: dict[int, DraftWall]) -> DraftEnd:
        """Return an end at the line of the wall that crosses nearest to `along`, or a free end there."""
        crossings = [(key, meeting(wall, other)) for key, other in walls.items() if other is not wall]
        near = [
            (abs(hit - along), key) for key, hit in crossings if hit is not None and abs(hit - along) < _SAME_CORNER
        ]
        return DraftEnd(along, min(near)[1] if near else None)

    def with_meeting_moved(self, key: int, other: int, behind: float) -> "RoomDraft":
        """Return the draft in which walls that meet wall `key` beyond `behind`, m along it, meet `other` instead."""
        walls = {}
        for name, wall in self.walls.items():
            along = meeting(self.walls[key], wall) if name not in (key, other) else None
            if along is not None and along >= behind:
                ends = [replace(end, meets=other) if end.meets == key else end for end in wall.ends]
                wall = replace(wall, ends=(ends[0], ends[1]))
            walls[name] = wall
        return replace(self, walls=walls)

    def extent(self, key: int) -> tuple[float, float]:
        """Return both ends of a wall, m along it from its middle."""
        wall = self.walls[key]
        ends = []
        for end in wall.ends:
            other = None if end.meets is None else self.walls.get(end.meets)
            along = None if other is None else meeting(wall, other)
            ends.append(end.at if along is None else along)
        return ends[0], ends[1]

    def alone(self, key: int) -> DraftWall:
        """Return a wall with free ends, where it ends now."""
        first, last = self.extent(key)
        return replace(self.walls[key], ends=(DraftEnd(first), DraftEnd(last)))

    def is_free(self, key: int, which: int) -> bool:
        """Return whether an end of a wall is free: it meets no wall, or one that does not reach as far."""
        wall = self.walls[key]
        other = None if (meets := wall.ends[which].meets) is None else self.walls.get(meets)
        along = None if other is None else meeting(other, wall)
        if along is None or meets is None:
            return True
        first, last = self.extent(meets)
        return not first - _TOUCHING <= along <= last + _TOUCHING

    def segment(self, key: int) -> FloatArray:
        """Return start and end of a wall, (4,) m."""
        wall = self.walls[key]
        first, last = self.extent(key)
        return np.concatenate([np.array(wall.middle) + along * wall.along for along in (first, last)])

    @property
    def segments(self) -> FloatArray:
        """Start and end of each wall, in the order of `walls`, (n, 4) m."""
        return np.array([self.segment(key) for key in self.walls], dtype=np.float64).reshape(-1, 4)

    @property
    def round_surfaces(self) -> FloatArray:
        """Centre and radius of each post, (n, 3) m."""
        return np.array([(*post.center, post.radius) for post in self.posts], dtype=np.float64).reshape(-1, 3)

    @property
    def is_sound(self) -> bool:
        """Whether every wall has a length, and its ends are in order."""
        return all(last - first >= _SHORTEST for first, last in map(self.extent, self.walls))

    def rounded(self) -> "RoomDraft":
        """Return the draft with all values rounded to a nanometre or nanoradian; parts that do not change stay.

        The last digits of a step differ between processors. Rounded away, they cannot decide which draft is better.
        """
        walls = {key: _rounded_wall(wall) for key, wall in self.walls.items()}
        posts = tuple(_same(post, DraftPost(_near(*post.center), *_near(post.radius))) for post in self.posts)
        places = tuple(
            _same(place, replace(place, position=_near(*place.position), heading=_near(place.heading)[0]))
            for place in self.places
        )
        numbers = _near(self.offset, self.threshold_db)
        same = all(wall is self.walls[key] for key, wall in walls.items())
        same = same and all(map(operator.is_, (*posts, *places), (*self.posts, *self.places)))
        if same and numbers == (self.offset, self.threshold_db):
            return self
        return replace(self, places=places, walls=walls, posts=posts, offset=numbers[0], threshold_db=numbers[1])

    def turned(self, turn: float, about: tuple[float, float], onto: tuple[float, float]) -> "RoomDraft":
        """Return the draft turned as a whole by an angle (rad) about a point, which then moves onto another one (m)."""
        cosine, sine = math.cos(turn), math.sin(turn)

        def at(point: tuple[float, float]) -> tuple[float, float]:
            x, y = point[0] - about[0], point[1] - about[1]
            return onto[0] + cosine * x - sine * y, onto[1] + sine * x + cosine * y

        return replace(
            self,
            places=tuple(
                replace(place, position=at(place.position), heading=place.heading + turn) for place in self.places
            ),
            walls={
                key: replace(wall, middle=at(wall.middle), angle=wall.angle + turn) for key, wall in self.walls.items()
            },
            posts=tuple(replace(post, center=at(post.center)) for post in self.posts),
        ).rounded()

    def room(self, air: Air) -> Room:
        """Return the room in which sound is followed; all surfaces but those of the base are found ones."""
        if self.base is not None:
            return self._in_base(self.base)
        segments = join_ends(self.segments)  # with gaps of rounding, corners would be two free ends
        names = (*(wall_name(k) for k in range(len(segments))), *(post_name(k) for k in range(len(self.posts))))
        return Room(
            name=MATERIAL,
            walls=segments,
            posts=self.round_surfaces,
            reflectances=np.full(len(names), REFLECTANCE),
            scattered=np.zeros(len(names)),
            heights=np.tile([-math.inf, math.inf], (len(names), 1)),
            names=names,
            materials=(MATERIAL,) * len(names),
            edges=find_edges(segments, names[: len(segments)]),
            air=air,
            places={},
            text="",
        )

    def _in_base(self, room: Room) -> Room:
        for number, segment in enumerate(self.segments):
            room = with_walls(room, segment[None], wall_name(number), REFLECTANCE)
        for number, post in enumerate(self.posts):
            room = with_post(room, (*post.center, post.radius), post_name(number), REFLECTANCE)
        walls = join_ends(room.walls)
        return replace(room, walls=walls, edges=find_edges(walls, room.names[: len(walls)])) if self.walls else room


def _near(*values: float) -> tuple[Any, ...]:
    return tuple(round(value, _DIGITS) + 0.0 for value in values)  # no negative zero


def _same(part: _Part, other: _Part) -> _Part:
    return part if part == other else other


def _rounded_wall(wall: DraftWall) -> DraftWall:
    ends = [_same(end, replace(end, at=_near(end.at)[0])) for end in wall.ends]
    return _same(wall, DraftWall(_near(*wall.middle), _near(wall.angle)[0], (ends[0], ends[1])))


def draft_of_room(room: Room) -> RoomDraft:
    """Return walls and posts of a room as a draft without places; walls with a common end meet there."""
    draft = RoomDraft(())
    for x, y, x2, y2 in room.walls.tolist():
        half = math.hypot(x2 - x, y2 - y) / 2
        middle, angle = ((x + x2) / 2, (y + y2) / 2), math.atan2(y2 - y, x2 - x)
        draft, _ = draft.with_new_wall(DraftWall(middle, angle, (DraftEnd(-half), DraftEnd(half))))
    corners = {key: draft.segment(key).reshape(2, 2) for key in draft.walls}
    for key, wall in draft.walls.items():
        for which in (0, 1):
            near = (other for other in corners if other != key and _common_end(corners, key, which, other))
            meets = next((other for other in near if meeting(wall, draft.walls[other]) is not None), None)
            wall = wall.with_end(which, replace(wall.ends[which], meets=meets))
        draft = draft.with_wall(key, wall)
    return replace(draft, posts=tuple(DraftPost((x, y), radius) for x, y, radius in room.posts.tolist()))


def _common_end(corners: dict[int, FloatArray], key: int, which: int, other: int) -> bool:
    """Return whether an end of a wall is an end of another one."""
    return bool((np.hypot(*(corners[other] - corners[key][which]).T) < _TOUCHING).any())


def wall_name(number: int) -> str:
    """Return the name of a found wall."""
    return f"wall {number + 1}"


def post_name(number: int) -> str:
    """Return the name of a found post."""
    return f"post {number + 1}"


def meeting(wall: DraftWall, other: DraftWall) -> float | None:
    """Return where the line of a wall meets that of another, m along it; None if they are almost parallel."""
    slope = float(wall.along @ other.normal)
    if abs(slope) < _PARALLEL:
        return None
    along = float((np.array(other.middle) - wall.middle) @ other.normal) / slope
    return along if abs(along) <= _LONGEST else None


# A prior of wall directions: most walls of a room are parallel or at right angles to one of them.
#
# A share of the walls is at right angles to a common wall, with a small spread. The others have any direction. A wall
# that the scans determine keeps its direction; one that they hardly determine gets the direction of the others. The
# walls of a known room, to which a draft adds some, do not count: what is put into a room can have any direction.


SPREAD = math.radians(1)  # standard deviation of the walls at right angles
SHARE = 0.8  # of the walls of a room that are at right angles
_ANY = 2 / math.pi  # density of the direction of the others, per radian


def log_prior(draft: RoomDraft) -> float:
    """Return the logarithm of the prior of the directions of a draft's walls; 0 if all are at right angles."""
    away = _away(draft)
    return float(_logarithms(away).sum(axis=1).max()) if len(away) else 0.0


def common_angle(draft: RoomDraft) -> float | None:
    """Return the angle of the common wall, rad; None without walls."""
    walls = list(draft.walls.values())
    return walls[_common(_away(draft))].angle if walls else None


def long_direction(draft: RoomDraft) -> float:
    """Return the mean direction, rad, of the walls at right angles to the common wall, where all of them have the same.

    Each counts by the cube of its length, to which the information of touches along it is proportional. Oblique walls
    do not count: a wrong one would turn the whole room.
    """
    away = set(oblique(draft))
    kept = {key: wall for key, wall in draft.walls.items() if key not in away}
    angles = np.array([wall.angle for wall in kept.values()])
    lengths = np.array([last - first for first, last in map(draft.extent, kept)])
    return float(np.angle((lengths**3 * np.exp(4j * angles)).sum())) / 4


def at_right_angles(draft: RoomDraft) -> int:
    """Return the number of walls that are parallel or at right angles to the common wall, with it, within 3°."""
    return len(draft.walls) - len(oblique(draft))


def oblique(draft: RoomDraft) -> list[int]:
    """Return the keys of the walls that are not within 3° of right angles to the common wall."""
    away = _away(draft)
    if not len(away):
        return []
    return [key for key, turned in zip(draft.walls, away[_common(away)], strict=True) if abs(turned) >= 3 * SPREAD]


def pulls(draft: RoomDraft) -> Iterator[tuple[int, int, float, float]]:
    """Yield wall, common wall, angle (rad) by which the first is away from right angles, and the weight of this error.

    The weight is the probability that the wall is at right angles at all, over the variance.
    """
    away, keys = _away(draft), list(draft.walls)
    if len(keys) < 2:
        return
    common = _common(away)
    near = _core(away[common])
    weights = near / (near + (1 - SHARE) * _ANY) / SPREAD**2
    for row, key in enumerate(keys):
        if row != common:
            yield key, keys[common], float(away[common, row]), float(weights[row])


def _away(draft: RoomDraft) -> FloatArray:
    """Return the angle by which each wall (columns) is away from right angles to each one (rows), rad."""
    angles = np.array([wall.angle for wall in draft.walls.values()])
    quarter = math.pi / 2
    return np.asarray(np.remainder(angles - angles[:, None] + quarter / 2, quarter) - quarter / 2)


def _common(away: FloatArray) -> int:
    """Return the row of the wall that makes the directions of all walls most probable."""
    return int(_logarithms(away).sum(axis=1).argmax())


def _core(away: FloatArray) -> FloatArray:
    return np.asarray(SHARE * np.exp(-0.5 * (away / SPREAD) ** 2) / (SPREAD * math.sqrt(math.tau)))


def _logarithms(away: FloatArray) -> FloatArray:
    of_right = float(_core(np.zeros(1))[0]) + (1 - SHARE) * _ANY
    return np.asarray(np.log((_core(away) + (1 - SHARE) * _ANY) / of_right))
