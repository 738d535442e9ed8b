"""The room as arrays: walls, posts, reflectances, edges, enclosed areas and places."""

import logging
import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sonarhw import arguments
from sonarhw.errors import InputError, counted, did_you_mean
from sonarhw.readings import FloatArray, same_values
from sonarhw_sim.air import Air
from sonarhw_sim.files import SHIPPED_ROOMS, parse_toml
from sonarhw_sim.room.edges import Edges, EdgesByHeight, edges_on_walls, find_edges, find_edges_by_height
from sonarhw_sim.room.grid import Listing, Surfaces, lay_grid, only
from sonarhw_sim.room.room_file import (
    MAX_COORDINATE,
    MEETING,
    LevelSection,
    Material,
    PostSection,
    RoomFile,
    Span,
    WallSection,
    lid_names,
)

# Test whether walls enclose a point, even if they do not meet at their ends.
#
# Each wall gets the angle from the point to its start; along the wall this angle changes continuously. Where two
# walls touch, their angles differ by a whole number of turns. If whole turns can be added to the walls so that all
# these differences vanish, nothing encloses the point. Otherwise a closed path along walls turns around it.


_MOST_WALLS = 500  # the test takes quadratic time


def walls_enclose(walls: FloatArray, point: tuple[float, float]) -> bool:
    """Return whether `point` (m) is on one of the walls (n, 4), or a closed path along them encloses it.

    With more than 500 walls the result is always False.
    """
    if not 0 < len(walls) <= _MOST_WALLS:
        return False
    if wall_distances(np.array([point]), walls).min() <= MEETING:
        return True
    first, second, contacts = _contacts(walls)
    before = walls[:, :2] - point

    def direction(rows: NDArray[np.intp]) -> FloatArray:
        start, end = before[rows], contacts - point
        turned = np.arctan2(_cross(start, end), (start * end).sum(axis=1))
        return np.asarray(np.arctan2(start[:, 1], start[:, 0]) + turned)

    turns = np.rint((direction(first) - direction(second)) / math.tau).astype(np.intp)
    return not _agree(len(walls), list(zip(first.tolist(), second.tolist(), turns.tolist(), strict=True)))


def _contacts(walls: FloatArray) -> tuple[NDArray[np.intp], NDArray[np.intp], FloatArray]:
    """Return all pairs of walls that touch or cross, (m,) rows each, and their contacts, (m, 2) m."""
    ends = walls.reshape(-1, 2, 2)
    start, along = ends[:, 0], ends[:, 1] - ends[:, 0]
    parts = []
    for end in (0, 1):
        first, second = np.nonzero(wall_distances(ends[:, end], walls) <= MEETING)
        parts.append((first, second, ends[first, end]))
    with np.errstate(divide="ignore", invalid="ignore"):
        share = _cross(start - start[:, None], along) / _cross(along[:, None], along)
        first, second = np.nonzero((share > 0) & (share < 1) & (share.T > 0) & (share.T < 1))
    parts.append((first, second, start[first] + share[first, second, None] * along[first]))
    first, second, points = (np.concatenate(column) for column in zip(*parts, strict=True))
    return first[first != second], second[first != second], points[first != second]


def wall_distances(points: FloatArray, walls: FloatArray) -> FloatArray:
    """Return the distance from each point (p, 2) to each wall (n, 4), (p, n) m."""
    start, along = walls[:, :2], walls[:, 2:] - walls[:, :2]
    share = ((points[:, None] - start) * along).sum(axis=2) / (along**2).sum(axis=1)
    foot = start + np.clip(share, 0.0, 1.0)[:, :, None] * along
    return np.asarray(np.hypot(*(points[:, None] - foot).transpose(2, 0, 1)))


def _cross(vectors: FloatArray, other: FloatArray) -> FloatArray:
    return np.asarray(vectors[..., 0] * other[..., 1] - vectors[..., 1] * other[..., 0])


def _agree(count: int, contacts: Sequence[tuple[int, int, int]]) -> bool:
    """Return whether `count` walls can be given whole turns that differ at each contact by its number of turns."""
    neighbours: list[list[tuple[int, int]]] = [[] for _ in range(count)]
    for one, other, turns in contacts:
        neighbours[one].append((other, turns))
        neighbours[other].append((one, -turns))
    given: dict[int, int] = {}
    for first in range(count):
        waiting = [] if first in given else [first]
        given.setdefault(first, 0)
        while waiting:
            one = waiting.pop()
            for other, turns in neighbours[one]:
                if other not in given:
                    given[other] = given[one] + turns
                    waiting.append(other)
                elif given[other] != given[one] + turns:
                    return False
    return True


# Reflectance of a material by angle of incidence and frequency.


@dataclass(frozen=True)
class ReflectanceTable:
    """Values at every combination of some angles and frequencies; between them, they change evenly."""

    angles: FloatArray  # (a,), rad from the perpendicular, increasing
    frequencies: FloatArray  # (f,), Hz, increasing
    values: FloatArray  # (a, f), amplitude ratios

    @property
    def largest(self) -> float:
        """The largest value."""
        return float(self.values.max())

    def at(self, angles: FloatArray, frequencies: FloatArray) -> FloatArray:
        """Return the reflectance at `angles` (k,) rad and `frequencies` (m,) Hz, (k, m).

        Beyond its ends, the table continues with its last values.
        """
        by_angle = np.array([np.interp(angles, self.angles, column) for column in self.values.T])
        return np.array([np.interp(frequencies, self.frequencies, column) for column in by_angle.T]).reshape(
            len(angles), len(frequencies)
        )


# Enclosures: closed chains of walls, and the edges that no sound from a place can reach because they are beyond one.
#
# A closed room has an outer edge at every corner. The search of paths to these would take as long as all the rest.


BoolArray = NDArray[np.bool_]

_ON_SURFACE = 0.01  # m, about a wavelength: as near to a wall or post, sound is not that of rays
_MOST_CORNERS = 2000  # of a chain: the test of inside and outside takes quadratic time
_BESIDE = 1e-6  # of a wall's length: distance from a corner at which its air is tested


@dataclass(frozen=True)
class Enclosures:
    """The closed chains of a room, and the edges at their corners."""

    walls: FloatArray  # (w, 4): one chain after the other
    starts: NDArray[np.intp]  # (c,): first row of each chain in `walls`
    edges: NDArray[np.intp]  # (e,): rows in the room's edges
    chains: NDArray[np.intp]  # (e,): the chain of each
    inside: BoolArray  # (e,): whether the air of each lies inside its chain
    count: int  # of the room's edges

    def separated_from(self, points: FloatArray) -> BoolArray:
        """Return which edges have their air on the other side of their chain than `points` (n, 2), (n, count) bool."""
        shut = np.zeros((len(points), self.count), dtype=np.bool_)
        if len(self.starts):
            within = np.add.reduceat(_passed(points, self.walls).astype(np.intp), self.starts, axis=1) % 2 == 1
            # a point on a wall is on both sides
            is_far = np.minimum.reduceat(wall_distances(points, self.walls), self.starts, axis=1) > MEETING
            shut[:, self.edges] = is_far[:, self.chains] & (self.inside != within[:, self.chains])
        return shut

    def is_outside_of_all(self, point: FloatArray, walls: FloatArray) -> bool:
        """Return whether `point` (2,) is in no chain, and one chain encloses all `walls` (n, 4) of the room."""
        chains = self._chains()
        return any(encloses(chain, walls) for chain in chains) and not any(
            inside(point[None], chain)[0] or wall_distances(point[None], chain).min() <= MEETING for chain in chains
        )

    def chains_around(self, point: FloatArray) -> list[FloatArray]:
        """Return the walls (n, 4) of each closed chain that contains `point` (2,)."""
        return [chain for chain in self._chains() if inside(point[None], chain)[0]]

    def _chains(self) -> list[FloatArray]:
        return np.split(self.walls, self.starts[1:]) if len(self.starts) else []


def encloses(chain: FloatArray, walls: FloatArray) -> bool:
    """Return whether the walls (n, 4) are all within the extent of a chain of walls (m, 4)."""
    ends, corners = walls.reshape(-1, 2), chain.reshape(-1, 2)
    low, high = ends.min(axis=0) + MEETING, ends.max(axis=0) - MEETING
    return bool((corners.min(axis=0) <= low).all() and (corners.max(axis=0) >= high).all())


def find_enclosures(walls: FloatArray, edges: Edges) -> Enclosures:
    """Return the closed chains of walls (n, 4) whose meeting ends have equal coordinates, two walls at each corner."""
    corners, vertex = np.unique(walls.reshape(-1, 2), axis=0, return_inverse=True)
    chains = [chain for chain in _closed_chains(vertex.reshape(-1, 2), len(corners)) if len(chain) <= _MOST_CORNERS]
    lengths = np.array([len(chain) for chain in chains], dtype=np.intp)
    of_corner = {
        corner: number for number, chain in enumerate(chains) for corner in map(tuple, walls[chain, :2].tolist())
    } | {corner: number for number, chain in enumerate(chains) for corner in map(tuple, walls[chain, 2:].tolist())}
    rows = [
        (row, of_corner[corner]) for row, corner in enumerate(map(tuple, edges.points.tolist())) if corner in of_corner
    ]
    at_corners, chain_of = np.array(rows, dtype=np.intp).reshape(-1, 2).T
    return Enclosures(
        walls[np.array([wall for chain in chains for wall in chain], dtype=np.intp)].reshape(-1, 4),
        np.cumsum(lengths) - lengths,
        at_corners,
        chain_of,
        _air_inside(walls, chains, edges, at_corners, chain_of),
        len(edges),
    )


def _air_inside(
    walls: FloatArray,
    chains: list[list[int]],
    edges: Edges,
    rows: NDArray[np.intp],
    chain_of: NDArray[np.intp],
) -> BoolArray:
    middle = edges.starts[rows] + edges.openings[rows] / 2
    aside = np.column_stack((np.cos(middle), np.sin(middle)))
    within = np.zeros(len(rows), dtype=np.bool_)
    # rows grouped by chain
    order = np.argsort(chain_of, kind="stable")
    bounds = np.searchsorted(chain_of[order], np.arange(len(chains) + 1))
    for number, chain in enumerate(chains):
        here = order[bounds[number] : bounds[number + 1]]
        around = walls[chain]
        shortest = np.hypot(around[:, 2] - around[:, 0], around[:, 3] - around[:, 1]).min()
        within[here] = inside(edges.points[rows[here]] + _BESIDE * shortest * aside[here], around)
    return within


def inside(points: FloatArray, walls: FloatArray) -> BoolArray:
    """Return which points (m, 2) a closed chain of walls (k, 4) encloses an odd number of times, (m,) bool."""
    return np.asarray(_passed(points, walls).sum(axis=1) % 2 == 1)


def _passed(points: FloatArray, walls: FloatArray) -> BoolArray:
    """Return which walls (k, 4) a ray from each point (m, 2) along x passes, (m, k) bool."""
    x, y = points[:, :1], points[:, 1:]
    x0, y0, x1, y1 = walls.T
    crosses = (y0 > y) != (y1 > y)
    rise = np.where(y1 == y0, 1.0, y1 - y0)
    return np.asarray(crosses & (x < x0 + (y - y0) / rise * (x1 - x0)))


def _closed_chains(ends: NDArray[np.intp], corners: int) -> Iterator[list[int]]:
    """Yield the walls of each closed chain, in order; `ends` (n, 2) are the corners that each wall joins."""
    meeting: list[list[int]] = [[] for _ in range(corners)]
    for wall, (start, end) in enumerate(ends.tolist()):
        meeting[start].append(wall)
        meeting[end].append(wall)
    seen: set[int] = set()
    for first in range(len(ends)):
        chain, corner, wall = [], int(ends[first, 0]), first
        while wall not in seen:
            seen.add(wall)
            chain.append(wall)
            corner = int(ends[wall].sum()) - corner
            if len(meeting[corner]) != 2:
                break
            wall = sum(meeting[corner]) - wall
        if len(chain) > 2 and wall == first and corner == ends[first, 0]:
            yield chain


@dataclass(frozen=True)
class Lid:
    """The upper or lower end of a closed chain of walls, or of a post."""

    upper: bool
    span: tuple[float, float]  # m: heights of both ends of the solid
    sides: range  # numbers of its walls, or of its post
    corners: FloatArray  # (k, 2), m: of the outline, in order; of a round one the centre
    radius: float = 0.0  # m, of a round one

    @property
    def height(self) -> float:
        """Its height, m."""
        return self.span[int(self.upper)]

    @property
    def box(self) -> tuple[float, float, float, float]:
        """Least x, least y, largest x, largest y, m."""
        (left, bottom), (right, top) = self.corners.min(axis=0) - self.radius, self.corners.max(axis=0) + self.radius
        return float(left), float(bottom), float(right), float(top)

    def covers(self, points: FloatArray) -> NDArray[np.bool_]:
        """Return whether points (n, 2) m are within its outline, (n,) bool."""
        if self.radius > 0.0:
            return np.asarray(np.hypot(*(points - self.corners[0]).T) < self.radius)
        x, y = points.T[..., None]
        (x0, y0), (x1, y1) = self.corners.T, np.roll(self.corners, -1, axis=0).T
        beside = (y0 > y) != (y1 > y)
        rise = np.where(y1 == y0, 1.0, y1 - y0)
        crossed = beside & (x < x0 + (y - y0) / rise * (x1 - x0))
        return np.asarray(crossed.sum(axis=1) % 2 == 1)

    def surrounds(self, x: float, y: float, height: float) -> bool:
        """Return whether a point in space (m) is inside of the solid that it closes."""
        return self.span[0] < height < self.span[1] and bool(self.covers(np.array([[x, y]]))[0])


# The room as arrays: walls, posts, reflectances, edges, and its places.
#
# Surfaces are numbered walls first, then posts, both in the order of the file, then floor and ceiling, if any, then
# lids. Floor, ceiling and lids reflect sound only from places with a height.


ENDLESS: Span = (-math.inf, math.inf)


@dataclass(frozen=True)
class Place:
    """A sensor position."""

    name: str
    position: tuple[float, float]  # m
    heading: float = 0.0  # rad: direction of the turntable's step 0 in the room
    height: float | None = None  # m, of the transducer; None: only the plan is used

    def __post_init__(self) -> None:
        if isinstance(self.position, tuple) and len(self.position) == 2:
            x, y = self.position
            if type(x) is float is type(y) and type(self.heading) is float:
                self._check()
                return
        position = arguments.numbers_in("position", self.position, "x and y in metres")
        if position.shape != (2,):
            raise arguments.refusal("position", "x and y in metres", self.position)
        object.__setattr__(self, "position", tuple(position.tolist()))
        object.__setattr__(self, "heading", arguments.number(unit="rad")("heading", self.heading))
        self._check()

    def _check(self) -> None:
        if not isinstance(self.name, str):
            raise arguments.refusal("name", "a text", self.name)
        x, y = self.position
        if not (abs(x) <= MAX_COORDINATE and abs(y) <= MAX_COORDINATE):
            raise InputError(f"place {self.name!r}: expected two numbers X,Y in metres, none over {MAX_COORDINATE:g}")
        if not math.isfinite(self.heading):
            raise InputError(f"place {self.name!r}: expected a finite heading")
        if self.height is not None:
            arguments.number(unit="m")("height", self.height)


@dataclass(frozen=True, eq=False)
class Room:
    """All surfaces of a room, its air, and its places. Rooms are equal if their values and their texts are equal."""

    name: str
    walls: FloatArray  # (n, 4): x, y of start and end, m
    posts: FloatArray  # (m, 3): x, y of the centre, radius, m
    # (s,), amplitude ratio of specular reflection by each of the s surfaces; with a table, at its largest
    reflectances: FloatArray
    scattered: FloatArray  # (s,), amplitude ratio of diffuse reflection; with a table, at its largest
    heights: FloatArray  # (s, 2), m: lower and upper end; infinite without a height in the file
    names: tuple[str, ...]  # of the s surfaces
    materials: tuple[str, ...]  # of the s surfaces
    edges: Edges
    air: Air
    places: dict[str, Place]
    text: str  # of the file, so that a log can contain it
    tables: Mapping[str, ReflectanceTable] = field(default_factory=dict)  # of the materials that have one
    lids: tuple[Lid, ...] = ()  # the last surfaces

    def __eq__(self, other: object) -> bool:
        return same_values(self, other) if isinstance(other, Room) else NotImplemented

    def __hash__(self) -> int:
        # with the walls, because all drafts of a search have one name, and caches would compare them all
        return hash((self.name, self.text, self.names, (self.walls + 0.0).tobytes()))  # no negative zero

    def __repr__(self) -> str:
        size = f"{counted(len(self.walls), 'wall')}, {counted(len(self.posts), 'post')}"
        return f"Room({self.name!r}, {size}, places: {', '.join(self.places) or 'none'})"

    @cached_property
    def surfaces(self) -> Surfaces:
        """Walls and posts in the form that kernels use."""
        return lay_grid(self.walls, self.posts)

    def blocking(self, passed_below: float) -> Surfaces:
        """Return the surfaces with a grid that lists no post of a radius below this (m), which sound passes."""
        passed = self.posts[:, 2] < passed_below
        if not passed.any():
            return self.surfaces
        return only(self.surfaces, np.append(np.ones(len(self.walls), np.bool_), ~passed))

    @cached_property
    def enclosures(self) -> Enclosures:
        """The closed chains of its walls."""
        return find_enclosures(self.walls, self.edges)

    @cached_property
    def edges_on_walls(self) -> Listing:
        """For each wall, the edges that lie on it."""
        return edges_on_walls(self.edges, self.walls)

    @cached_property
    def edges_by_height(self) -> EdgesByHeight:
        """The upright edges that exist at any height, and where."""
        return find_edges_by_height(self.walls, self.names, self.heights[: self.levels.start])

    @property
    def levels(self) -> range:
        """Numbers of the surfaces that are level: floor, ceiling and lids."""
        return range(len(self.walls) + len(self.posts), len(self.names))

    def lid(self, surface: int) -> Lid | None:
        """Return the lid that is a surface; None for other surfaces."""
        row = surface - (len(self.names) - len(self.lids))
        return self.lids[row] if row >= 0 else None

    def edge_between(self, first: int, second: int) -> int:
        """Return the number of an edge of limited height or a rim: between two surfaces, or of one (given twice)."""
        return len(self.edges) + first * len(self.names) + second

    def edge_name(self, edge: int) -> str:
        """Return the name of an edge as in `via`; `edge` is a row of `edges` or a result of `edge_between`."""
        if edge < len(self.edges):
            return self.edges.names[edge]
        first, second = divmod(edge - len(self.edges), len(self.names))
        return f"{self.names[first]}/{self.names[second] if second != first else ''}"

    def posts_at(self, position: tuple[float, float]) -> list[int]:
        """Return the surface numbers of the posts that contain a point (m), inside or on the circle."""
        inside = np.hypot(*(self.posts[:, :2] - position).T) <= self.posts[:, 2]
        return (len(self.walls) + np.flatnonzero(inside)).tolist()

    def is_outside(self, position: tuple[float, float]) -> bool:
        """Return whether a point (m) is outside of a room closed by its walls; an open room has no outside."""
        if self.enclosures.is_outside_of_all(np.array(position), self.walls):
            return True
        # walls that meet elsewhere than at their ends close the room if they enclose its places
        closed = any(walls_enclose(self.walls, place.position) for place in self.places.values())
        return closed and not walls_enclose(self.walls, position)

    def is_far_from(self, position: tuple[float, float]) -> bool:
        """Return whether a point (m) is farther from walls and posts than 5 m and than their extent."""
        ends = np.vstack((self.walls.reshape(-1, 2), self.posts[:, :2]))
        lowest, highest = ends.min(axis=0), ends.max(axis=0)
        beyond = np.maximum(lowest - position, position - highest)
        # a single plate or post is small, and is detected from farther away than its size
        return bool(beyond.max() > max(5.0, float((highest - lowest).max())))

    def check_height(self, height: float) -> None:
        """Raise InputError if a transducer cannot be at this height, m, or if the height has no effect."""
        levels = {self.names[k]: float(self.heights[k, 0]) for k in self.levels}
        lowest, highest = levels.get("floor", -MAX_COORDINATE), levels.get("ceiling", MAX_COORDINATE)
        if not np.isfinite(self.heights).any():
            raise InputError(
                f"height {height:g}: has no effect: room {self.name!r} has no floor or ceiling, and no wall or post "
                "with a height; leave it out, or add one of them to the room file"
            )
        if not lowest < height < highest:
            raise InputError(
                f"height {height:g}: expected metres between {lowest:g} and {highest:g} (floor and ceiling)"
            )

    def place(self, name: "Place | str | Sequence[float] | FloatArray | None" = None) -> Place:
        """Return the place with this name, or at a position; for None, the only place.

        A position is text, `X,Y` or `X,Y,DEG` with metres and the heading of step 0 in degrees, or two or three numbers
        with metres and radians. Without a heading, it is 0. A `Place` is returned as it is. Raises InputError if there
        is no such place, or it is inside a post.
        """
        if isinstance(name, Place):
            return name
        if name is None:
            if len(self.places) == 1:
                return next(iter(self.places.values()))
            raise InputError(f"room {self.name!r}: give a place, or X,Y in metres; {self._known_places()}")
        if isinstance(name, str):
            return self.places[name] if name in self.places else self._free_place(self._typed_place(name))
        return self._free_place(place_at("place", name))

    def _typed_place(self, name: str) -> Place:
        place = typed_place(name)
        if place is None:
            hint = ""
            if name.endswith(","):
                hint = " without a space"
            elif re.fullmatch(r"-?[\d.]+(,-?[\d.]+){3,}", name):
                hint = " or X,Y,DEG, with decimal points, such as 1.5,0.8"
            elif re.fullmatch(r"-?\d+,\d+ *[; ] *-?\d+,\d+", name):
                hint = " with decimal points, such as 1.5,0.8"
            elif name.count(",") in (1, 2) and re.search(r"\d", name):
                hint = " and DEG as numbers, without units, spaces or brackets"
            near = did_you_mean(name, self.places) or ";"
            raise InputError(
                f"room {self.name!r}: no place {name!r}{near} {self._known_places()}, or X,Y in metres{hint}"
            )
        return place

    def _free_place(self, place: Place) -> Place:
        for post in self.posts_at(place.position):
            raise InputError(f"place {place.name!r} lies inside post {self.names[post]!r}; sound cannot leave it")
        return place

    def _known_places(self) -> str:
        return f"its places: {', '.join(self.places)}" if self.places else "it has no places"


def read_pose(text: str) -> tuple[float, ...]:
    """Return x and y (m) and, if it is stated, the heading (rad) of `X,Y` or `X,Y,DEG`. Raises ValueError."""
    x, y, *degrees = map(float, text.split(","))
    if len(degrees) > 1:
        raise ValueError(text)
    return x, y, *map(math.radians, degrees)


def typed_place(text: str) -> Place | None:
    """Return the place of `X,Y` or `X,Y,DEG`, metres and the heading of step 0, by default 0; None for other text."""
    try:
        x, y, *heading = read_pose(text)
    except ValueError:
        return None
    return Place(text, (x, y), sum(heading, 0.0))


def place_at(name: str, pose: object, degrees: bool = False) -> Place:
    """Return the place of x and y (m), and no heading or one in rad, or in degrees.

    `name` is that of the argument. Raises InputError for anything else.
    """
    expected = f"x and y in metres, and no heading or one in {'degrees' if degrees else 'radians'}"
    read = arguments.numbers_in(name, pose, expected)
    if read.shape not in ((2,), (3,)):
        raise arguments.refusal(name, expected, pose)
    x, y, *turn = read.tolist()
    heading = math.radians(turn[0]) if turn and degrees else sum(turn, 0.0)
    # the name appears in titles; millimetres are enough
    shown = (x, y, *(math.degrees(heading) for _ in turn))
    return Place(",".join(f"{round(number, 3) + 0.0:.9g}" for number in shown), (x, y), heading)


@arguments.checked(name=arguments.file_name)
def load_room(name: Path | str) -> Room:
    """Return a shipped room by name, or the room in a file. Raises InputError with file, key and reason if it is wrong.

    A text without `.toml` at its end and without a slash is the name of a shipped room.
    """
    return parse_room(*SHIPPED_ROOMS.read(name))


def room_names() -> list[str]:
    """Return the names of the shipped rooms."""
    return SHIPPED_ROOMS.names()


def parse_room(text: str, where: str) -> Room:
    """Return the room in the text of a room file. Raises InputError with `where`, key and reason."""
    file = parse_toml(text, where, RoomFile)
    walls = join_ends(np.array([start + end for wall in file.walls for start, end in wall.segments], dtype=np.float64))
    names = tuple(name for wall in file.walls for name in wall.segment_names)
    lids = _lids(file)
    surfaces = [*_surfaces(file), *(solid for solid in file.with_lids for _ in range(2))]
    spans = [_span(surface) for surface in _surfaces(file)] + [(lid.height, lid.height) for lid in lids]
    materials = [file.materials[surface.material] for surface in surfaces]
    return Room(
        name=file.name,
        walls=walls,
        posts=np.array([(*post.center, post.radius) for post in file.posts], dtype=np.float64).reshape(-1, 3),
        # scatter is a share of the reflected power
        reflectances=np.array([material.largest * math.sqrt(1 - material.scatter) for material in materials]),
        scattered=np.array([material.largest * math.sqrt(material.scatter) for material in materials]),
        heights=np.array(spans, dtype=np.float64),
        names=(
            *names,
            *(post.name for post in file.posts),
            *file.levels,
            *(name for solid in file.with_lids for name in lid_names(solid)),
        ),
        materials=tuple(surface.material for surface in surfaces),
        edges=_edges_of(walls, names, where),
        air=Air(**file.air.model_dump()),
        places={
            name: Place(name, place.position, math.radians(place.heading_deg), place.height)
            for name, place in file.places.items()
        },
        text=text,
        lids=lids,
        tables={name: _table_of(file.materials[name]) for name in _used(surfaces) if file.materials[name].table},
    )


def _used(surfaces: Sequence[WallSection | PostSection | LevelSection]) -> list[str]:
    return sorted({surface.material for surface in surfaces})


def _table_of(material: Material) -> ReflectanceTable:
    angles = sorted({row.incidence_deg for row in material.table})
    frequencies = sorted({row.frequency for row in material.table})
    values = {(row.incidence_deg, row.frequency): row.reflectance for row in material.table}
    return ReflectanceTable(
        np.radians(angles),
        np.array(frequencies, dtype=np.float64),
        np.array([[values[angle, frequency] for frequency in frequencies] for angle in angles], dtype=np.float64),
    )


def _edges_of(walls: FloatArray, names: tuple[str, ...], where: str) -> Edges:
    try:
        return find_edges(walls, names)
    except InputError as error:
        raise InputError(f"{where}: {error}") from error


def _surfaces(file: RoomFile) -> list[WallSection | PostSection | LevelSection]:
    """Return the section of the file for each surface but lids, in the order of their numbers."""
    return [*(wall for wall in file.walls for _ in wall.segments), *file.posts, *file.levels.values()]


def _lids(file: RoomFile) -> tuple[Lid, ...]:
    """Return the lids of a file, two for each solid: the lower one, then the upper one."""
    lids: list[Lid] = []
    first = 0
    for wall in file.walls:
        sides = range(first, first + len(wall.segments))
        first = sides.stop
        if wall.lids and wall.height:
            lids += [Lid(upper, wall.height, sides, np.array(wall.points, dtype=np.float64)) for upper in (False, True)]
    for post in file.posts:
        if post.lids and post.height:
            centre = np.array([post.center], dtype=np.float64)
            lids += [Lid(upper, post.height, range(0), centre, post.radius) for upper in (False, True)]
    return tuple(lids)


def _span(surface: WallSection | PostSection | LevelSection) -> Span:
    if isinstance(surface, LevelSection):
        return surface.height, surface.height
    return surface.height or ENDLESS


def with_walls(room: Room, walls: FloatArray, name: str, reflectance: float, span: Span = ENDLESS) -> Room:
    """Return the room with additional walls (k, 4), all with one name and height; their ends do not diffract."""
    rows = _more_rows(room, len(room.walls), len(walls), name, reflectance, span)
    return replace(room, walls=np.vstack((room.walls, walls)), **rows)


def with_post(room: Room, post: tuple[float, float, float], name: str, reflectance: float) -> Room:
    """Return the room with an additional post (x, y, radius) of unlimited height."""
    rows = _more_rows(room, room.levels.start, 1, name, reflectance, ENDLESS)
    return replace(room, posts=np.vstack((room.posts, [post])), **rows)


def with_air(room: Room, air: Air) -> Room:
    """Return the room with other air."""
    return _with_same_geometry(room, air=air)


def with_material(room: Room, material: str, reflectance: float | None, scatter: float = 0.0) -> Room:
    """Return the room with another reflectance (amplitude) and scatter (share of the reflected power) of a material.

    The reflectance replaces a table; None keeps the reflectance or the table.
    """
    of_it = np.array([name == material for name in room.materials], dtype=np.bool_)
    largest = np.hypot(room.reflectances, room.scattered) if reflectance is None else reflectance
    tables = {name: table for name, table in room.tables.items() if reflectance is None or name != material}
    return _with_same_geometry(
        room,
        reflectances=np.where(of_it, largest * math.sqrt(1 - scatter), room.reflectances),
        scattered=np.where(of_it, largest * math.sqrt(scatter), room.scattered),
        tables=tables,
    )


def _with_same_geometry(room: Room, **changes: Any) -> Room:
    """Return the room with changes that move no surface, keeping what was computed from the geometry."""
    changed = replace(room, **changes)
    for computed in ("surfaces", "enclosures", "edges_on_walls"):
        if computed in room.__dict__:
            changed.__dict__[computed] = room.__dict__[computed]
    return changed


def _more_rows(room: Room, behind: int, count: int, name: str, reflectance: float, span: Span) -> dict[str, Any]:
    more = (name,) * count
    return {
        "reflectances": np.insert(room.reflectances, behind, [reflectance] * count),
        "scattered": np.insert(room.scattered, behind, [0.0] * count),
        "heights": np.insert(room.heights, behind, [span] * count, axis=0),
        "names": (*room.names[:behind], *more, *room.names[behind:]),
        "materials": (*room.materials[:behind], *more, *room.materials[behind:]),
    }


def join_ends(walls: FloatArray) -> FloatArray:
    """Return the walls with meeting ends moved to one point, so that no sound passes through gaps of rounding."""
    ends = walls.reshape(-1, 2)
    # ends in one small square are one point, so that the number of pairs grows with that of the points
    _, first, square = np.unique(np.floor(ends / (MEETING / 4)), axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first)
    points = ends[first[order]]
    # in order, so that an end that moves to a moved end moves to its new position
    for end, other in sorted(_meeting(points)):
        points[other] = points[end]
    return np.asarray(points[np.argsort(order)[square.ravel()]].reshape(-1, 4))


def _meeting(points: FloatArray) -> list[tuple[int, int]]:
    """Return the pairs of rows of `points` (n, 2) that meet, the smaller row first."""
    # along a direction that walls rarely have, so that few points that do not meet are level with each other
    along = points @ np.array([math.cos(1.0), math.sin(1.0)])
    order = np.argsort(along)
    pairs: list[tuple[int, int]] = []
    lower, behind = np.arange(len(points)), 0
    while len(lower):
        behind += 1
        lower = lower[: np.searchsorted(lower, len(points) - behind)]
        first, second = order[lower], order[lower + behind]
        level = along[second] - along[first] <= 2 * MEETING
        lower, first, second = lower[level], first[level], second[level]
        near = ((points[second] - points[first]) ** 2).sum(axis=1) <= MEETING**2
        pairs += zip(np.minimum(first, second)[near].tolist(), np.maximum(first, second)[near].tolist(), strict=True)
    return pairs


# Objects made of walls: closed chains inside another chain, such as a box in a room.


_NARROW = 1.2  # m; a closed chain of walls this narrow inside another is an object, not a room


def object_around(room: Room, place: Place) -> list[int] | None:
    """Return the walls of the object that contains a place, if any.

    An object is a closed chain of walls inside another one, with lids, or too narrow to be a room.
    """
    around = room.enclosures.chains_around(np.array(place.position))
    if not around or len(around) % 2:
        return None
    smallest = min(around, key=lambda chain: float(np.ptp(chain.reshape(-1, 2), axis=0).min()))
    walls = [k for k, wall in enumerate(room.walls) if (smallest == wall).all(axis=1).any()]
    lowest, highest = room.heights[walls].min(), room.heights[walls].max()
    beside = place.height is not None and not lowest < place.height < highest
    narrow = float(np.ptp(smallest.reshape(-1, 2), axis=0).min()) < _NARROW
    lidded = any(walls[0] in lid.sides for lid in room.lids)
    return walls if (narrow or lidded) and not beside else None


def object_name(room: Room, walls: list[int]) -> str:
    """Return the words for the object of these walls."""
    return f"the object of walls {room.names[walls[0]]!r} to {room.names[walls[-1]]!r}"


# Facets: closed chains of walls that approximate a circle, where a post may be meant.
#
# A flat wall returns sound only at normal incidence, so a pillar of many walls is almost silent from most places. A
# round one returns sound to all places.


_FEWEST = 12  # walls; a chain with fewer may be intended
_ROUND = 1.02  # largest ratio of the distances of corners from the middle


@dataclass(frozen=True)
class Facets:
    """A closed chain of walls that approximates a circle."""

    walls: range  # their numbers
    middle: tuple[float, float]  # m
    radius: float  # m


def facets_of(room: Room) -> tuple[Facets, ...]:
    """Return the circles of walls that are objects in the room: with another object outside, and no place inside."""
    places = np.array([place.position for place in room.places.values()], dtype=np.float64).reshape(-1, 2)
    objects = np.vstack((room.walls.reshape(-1, 2), room.posts[:, :2], places))

    def is_object(circle: Facets) -> bool:
        beyond = np.hypot(*(objects - circle.middle).T) > _ROUND * circle.radius
        return bool(beyond.any()) and bool(beyond[len(objects) - len(places) :].all())

    return tuple(circle for circle in _circles(room.walls) if is_object(circle))


def _circles(walls: FloatArray) -> Iterator[Facets]:
    """Yield the closed chains of walls (n, 4) whose corners lie on a circle."""
    continues = (walls[:-1, 2:] == walls[1:, :2]).all(axis=1)
    bounds = [0, *(np.flatnonzero(~continues) + 1).tolist(), len(walls)]
    for first, behind in pairwise(bounds):
        chain = walls[first:behind]
        if len(chain) >= _FEWEST and (chain[-1, 2:] == chain[0, :2]).all():
            middle = chain[:, :2].mean(axis=0)
            away = np.hypot(*(chain[:, :2] - middle).T)
            if _winds_once(chain, middle) and away.max() <= _ROUND * away.min():
                yield Facets(range(first, behind), (float(middle[0]), float(middle[1])), float(away.mean()))


def _winds_once(chain: FloatArray, middle: FloatArray) -> bool:
    """Return whether walls wind around a point once, all in one direction."""
    start, end = chain[:, :2] - middle, chain[:, 2:] - middle
    turns = np.arctan2(start[:, 0] * end[:, 1] - start[:, 1] * end[:, 0], (start * end).sum(axis=1))
    one_way = bool((turns > 0).all() or (turns < 0).all())
    return one_way and round(abs(turns.sum()) / math.tau) == 1


# Warnings about a valid room that is probably not what its author means.


def room_doubts(room: Room) -> tuple[str, ...]:
    """Return a warning for each round object that consists of flat walls."""
    doubts = []
    for circle in facets_of(room):
        first, last = room.names[circle.walls[0]], room.names[circle.walls[-1]]
        x, y = (round(coordinate, 4) + 0.0 for coordinate in circle.middle)
        doubts.append(
            f"walls {first!r} to {last!r} approximate a circle, but flat walls return almost no sound; "
            f"use [[posts]] with center = [{x:g}, {y:g}] and radius = {circle.radius:.4g}"
        )
    return tuple(doubts)


_PROBABLY_SMALLER = 20  # a coordinate outside the room that is probably in a smaller unit than metres


def surface_distances(room: Room, point: FloatArray) -> FloatArray:
    """Return the distances from a point (2,) to walls, then to posts, (n,) m; below 0 inside a post."""
    to_posts = np.hypot(*(room.posts[:, :2] - point).T) - room.posts[:, 2]
    return np.concatenate((wall_distances(point[None], room.walls)[0], to_posts))


def place_doubts(room: Room, place: Place) -> tuple[str, ...]:
    """Return a warning if a place is outside the room, inside an object such as a box, or on a wall or post."""
    x, y = place.position
    where = f"place {place.name!r} at {x:g}, {y:g} m is"
    if room.is_outside(place.position) or room.is_far_from(place.position):
        is_far = max(abs(x), abs(y)) >= _PROBABLY_SMALLER
        units = (("centimetres", 100), ("millimetres", 1000)) if is_far else ()
        inside = ((unit, x / n, y / n) for unit, n in units if not room.is_outside((x / n, y / n)))
        (left, bottom), (right, top) = _corners(room)
        hint = f", whose walls are between {left:g}, {bottom:g} and {right:g}, {top:g} m"
        hint = next((f"; if these are {unit}, it is at {a:g}, {b:g} m" for unit, a, b in inside), hint)
        return (f"{where} outside room {room.name!r}{hint}",)
    walls = object_around(room, place)
    if walls is not None:
        return (f"{where} inside {object_name(room, walls)} of room {room.name!r}",)
    away = np.abs(surface_distances(room, np.array(place.position)))
    near = int(away.argmin())
    if away[near] >= _ON_SURFACE:
        return ()
    return (
        f"{where} {away[near] * 1e3:.0f} mm from {room.names[near]!r}: rays do not hold nearer than "
        f"{_ON_SURFACE * 1e3:g} mm",
    )


def _corners(room: Room) -> tuple[FloatArray, FloatArray]:
    """Return the least and the largest coordinates of the ends of walls and the middles of posts, (2,) m each."""
    ends = np.vstack((room.walls.reshape(-1, 2), room.posts[:, :2]))
    return ends.min(axis=0), ends.max(axis=0)


def warn_of_poses(name: str, room: Room, positions: FloatArray, warn: Callable[[str], None] = arguments.emit) -> None:
    """Warn if most of these positions (n, 2) m are beyond all walls and posts."""
    (left, bottom), (right, top) = lowest, highest = _corners(room)
    beyond = ((positions < lowest) | (positions > highest)).any(axis=1)
    if beyond.sum() > len(positions) / 2:
        many = f"{beyond.sum()} of {len(positions)} are" if len(positions) > 1 else "it is"
        warn(
            f"{name}: {many} beyond the walls, which are between {left:g}, {bottom:g} and {right:g}, {top:g} m; "
            f"divide centimetres by 100"
        )


def warn_of_place(room: Room, place: Place, warn: Callable[[str], None]) -> None:
    """Log the place of a scan, and warn if it is outside the room or inside an object."""
    x, y = place.position
    logging.getLogger("sonarhw").info("place %r at %g, %g m in room %r", place.name, x, y, room.name)
    for doubt in place_doubts(room, place):
        warn(doubt)
