"""The room as arrays: walls, posts, reflectances, edges, and its places.

Surfaces are numbered walls first, then posts, both in the order of the file, then floor and ceiling, if any, then lids.
Floor, ceiling and lids reflect sound only from places with a height.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from sonarhw.errors import InputError
from sonarhw.readings import FloatArray
from sonarhw_sim.air import Air
from sonarhw_sim.named_file import Shipped
from sonarhw_sim.room.edges import Edges, EdgesByHeight, edges_on_walls, find_edges, find_edges_by_height
from sonarhw_sim.room.enclosures import Enclosures, Lid, find_enclosures
from sonarhw_sim.room.grid import Listing, Surfaces, lay_grid
from sonarhw_sim.room.outside import walls_enclose
from sonarhw_sim.room.reflectance_table import ReflectanceTable
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
from sonarhw_sim.toml_file import parse_toml

SHIPPED_ROOMS = Shipped("sonarhw_rooms", "room", "room file")
ENDLESS: Span = (-math.inf, math.inf)


@dataclass(frozen=True)
class Place:
    """A sensor position."""

    name: str
    position: tuple[float, float]  # m
    heading: float = 0.0  # rad: direction of the turntable's step 0 in the room
    height: float | None = None  # m, of the transducer; None: only the plan is used


@dataclass(frozen=True, eq=False)
class Room:
    """All surfaces of a room, its air, and its places. Two rooms are equal only if they are the same object."""

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

    @cached_property
    def surfaces(self) -> Surfaces:
        """Walls and posts in the form that kernels use."""
        return lay_grid(self.walls, self.posts)

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

    def place(self, name: "Place | str | tuple[float, float] | None" = None) -> Place:
        """Return the place with this name, or at `X,Y` (text, or two numbers in m); for None, the only place.

        A `Place` is returned as it is. Raises InputError if there is no such place, or it is inside a post.
        """
        if isinstance(name, Place):
            return name
        if isinstance(name, tuple):
            if len(name) != 2:
                raise InputError(f"place {name!r}: expected two numbers, x and y in metres")
            x, y = map(float, name)
            # the name appears in titles; millimetres are enough
            return self._place_at(",".join(f"{round(at, 3) + 0.0:.9g}" for at in (x, y)), (x, y))
        if name is None:
            if len(self.places) == 1:
                return next(iter(self.places.values()))
            raise InputError(f"room {self.name!r}: give a place, or X,Y in metres; {self._known_places()}")
        if name in self.places:
            return self.places[name]
        return self._place_at(name, self._position(name))

    def _position(self, name: str) -> tuple[float, float]:
        try:
            x, y = map(float, name.split(","))
        except ValueError as error:
            hint = " without a space" if name.endswith(",") else ""
            raise InputError(
                f"room {self.name!r}: no place {name!r}; {self._known_places()}, or X,Y in metres{hint}"
            ) from error
        return x, y

    def _place_at(self, name: str, position: tuple[float, float]) -> Place:
        x, y = position
        if not (abs(x) <= MAX_COORDINATE and abs(y) <= MAX_COORDINATE):
            raise InputError(f"place {name!r}: expected two numbers X,Y in metres, none over {MAX_COORDINATE:g}")
        for post in self.posts_at((x, y)):
            raise InputError(f"place {name!r} lies inside post {self.names[post]!r}; sound cannot leave it")
        return Place(name, (x, y))

    def _known_places(self) -> str:
        return f"its places: {', '.join(self.places)}" if self.places else "it has no places"


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
    for one, other in sorted(_meeting(points)):
        points[other] = points[one]
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
        one, other = order[lower], order[lower + behind]
        level = along[other] - along[one] <= 2 * MEETING
        lower, one, other = lower[level], one[level], other[level]
        near = ((points[other] - points[one]) ** 2).sum(axis=1) <= MEETING**2
        pairs += zip(np.minimum(one, other)[near].tolist(), np.maximum(one, other)[near].tolist(), strict=True)
    return pairs
