"""Format of room files, and the checks of their values.

The format is public and stays compatible. `sonarhw_sim.room.model` converts it to arrays.
"""

import math
from collections import Counter
from functools import cached_property
from typing import Annotated, Self

from pydantic import Field, model_validator

from sonarhw_sim.toml_file import TomlModel

MEETING = 1e-6  # m; wall ends closer than this meet
MAX_COORDINATE = 1e6  # m; beyond, rounding would move walls

Share = Annotated[float, Field(ge=0, le=1)]
Positive = Annotated[float, Field(gt=0)]
Coordinate = Annotated[float, Field(ge=-MAX_COORDINATE, le=MAX_COORDINATE)]
Point = tuple[Coordinate, Coordinate]
Span = tuple[Coordinate, Coordinate]  # lower and upper end, m
Name = Annotated[str, Field(pattern=r"^[^>/\n\r]+$")]  # via joins names with > and /


class AirSection(TomlModel):
    """`[air]`."""

    temperature_c: Annotated[float, Field(ge=-40, le=60)] = 20.0
    relative_humidity: Share = 0.5
    pressure_kpa: Annotated[float, Field(ge=30, le=120)] = 101.325


class Material(TomlModel):
    """`[materials.NAME]`."""

    reflectance: Share  # amplitude ratio
    scatter: Share = 0.0  # 0 mirror .. 1 fully diffuse


class WallSection(TomlModel):
    """`[[walls]]`: a chain of segments."""

    name: Name
    points: Annotated[tuple[Point, ...], Field(min_length=2)]
    material: str
    closed: bool = False
    edges: tuple[Name, ...] | None = None
    height: Span | None = None

    @cached_property
    def segments(self) -> list[tuple[Point, Point]]:
        """Start and end of every segment, m."""
        ends = self.points[1:] + (self.points[:1] if self.closed else ())
        return list(zip(self.points, ends, strict=False))

    @property
    def segment_names(self) -> tuple[str, ...]:
        """The name of every segment, as in `via`."""
        return self.edges or tuple(f"{self.name}[{k}]" for k in range(len(self.segments)))

    @model_validator(mode="after")
    def _sane(self) -> Self:
        for k, (start, end) in enumerate(self.segments):
            if math.dist(start, end) <= MEETING:
                raise ValueError(f"segment {k} of wall {self.name!r}, at {start}, has no length")
        if self.closed and len(self.points) == 2:
            raise ValueError(f"wall {self.name!r} is closed but has only two points; expected three or more")
        if self.edges is not None and len(self.edges) != len(self.segments):
            raise ValueError(f"wall {self.name!r}: expected a name in edges for each of {len(self.segments)} segments")
        _check_span(self.height, f"wall {self.name!r}")
        return self


class PostSection(TomlModel):
    """`[[posts]]`: a round object."""

    name: Name
    center: Point
    radius: Positive
    material: str
    height: Span | None = None

    @model_validator(mode="after")
    def _sane(self) -> Self:
        _check_span(self.height, f"post {self.name!r}")
        return self

    def spans(self, height: float | None) -> bool:
        """Return whether it exists at this height, m; None: only the plan is used."""
        return height is None or self.height is None or self.height[0] <= height <= self.height[1]


class LevelSection(TomlModel):
    """`[floor]` or `[ceiling]`."""

    height: Coordinate
    material: str


class PlaceSection(TomlModel):
    """`[places.NAME]`."""

    position: Point
    heading_deg: float = 0.0
    height: Coordinate | None = None  # of the transducer; with it, floor, ceiling and heights are used


class RoomFile(TomlModel):
    """A whole room file."""

    name: str
    air: AirSection = AirSection()
    materials: dict[str, Material] = Field(default_factory=dict)
    walls: tuple[WallSection, ...] = ()
    posts: tuple[PostSection, ...] = ()
    floor: LevelSection | None = None
    ceiling: LevelSection | None = None
    places: dict[str, PlaceSection] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _sane(self) -> Self:
        if not self.walls:
            raise ValueError("a room needs at least one [[walls]]")
        self._materials_are_defined()
        self._names_are_unique()
        self._places_are_free()
        self._levels_leave_room()
        return self

    @property
    def levels(self) -> dict[str, LevelSection]:
        """Floor and ceiling, if any."""
        return {name: level for name, level in (("floor", self.floor), ("ceiling", self.ceiling)) if level is not None}

    def _materials_are_defined(self) -> None:
        used = [(wall.name, wall.material) for wall in self.walls]
        used += [(post.name, post.material) for post in self.posts]
        used += [(name, level.material) for name, level in self.levels.items()]
        for name, material in used:
            if material not in self.materials:
                known = ", ".join(self.materials) or "none"
                raise ValueError(f"unknown material {material!r} of {name!r}; defined: {known}")

    def _names_are_unique(self) -> None:
        names = [name for wall in self.walls for name in wall.segment_names] + [post.name for post in self.posts]
        names += self.levels
        twice, times = Counter(names).most_common(1)[0]
        if times > 1:
            raise ValueError(f"two surfaces are named {twice!r}; expected different names")

    def _places_are_free(self) -> None:
        for name, place in self.places.items():
            for post in self.posts:
                if math.dist(place.position, post.center) <= post.radius and post.spans(place.height):
                    raise ValueError(f"place {name!r} lies inside post {post.name!r}")

    def _levels_leave_room(self) -> None:
        bottom = -math.inf if self.floor is None else self.floor.height
        top = math.inf if self.ceiling is None else self.ceiling.height
        if bottom >= top:
            raise ValueError(f"the floor must lie below the ceiling, got heights {bottom:g} and {top:g}")
        for name, place in self.places.items():
            if place.height is not None and not bottom < place.height < top:
                raise ValueError(
                    f"height of place {name!r} must lie between floor and ceiling, {bottom:g} to {top:g}, "
                    f"got {place.height:g}"
                )


def _check_span(height: Span | None, whose: str) -> None:
    if height is not None and height[0] >= height[1]:
        raise ValueError(f"height of {whose} must be [lower, upper], got {list(height)}")
