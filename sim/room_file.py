"""Room files: what may stand in one, checked at the door.

Takes the text of a `*.toml`; hands on a `RoomFile` whose every value is sane, or refuses with one clear line. The
format is a promise to users; `sim.room` makes arrays of it.
"""

import math
from typing import Annotated, Self

from pydantic import Field, model_validator

from sim.toml_file import TomlModel

MEETING = 1e-6  # m; wall ends closer than this meet
MOST_DISTANT = 1e6  # m; farther off, rounding would move walls

Share = Annotated[float, Field(ge=0, le=1)]
Positive = Annotated[float, Field(gt=0)]
Coordinate = Annotated[float, Field(ge=-MOST_DISTANT, le=MOST_DISTANT)]
Point = tuple[Coordinate, Coordinate]
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
    height: tuple[float, float] | None = None

    @property
    def segments(self) -> list[tuple[Point, Point]]:
        """Start and end of every segment, m."""
        ends = self.points[1:] + (self.points[:1] if self.closed else ())
        return list(zip(self.points, ends, strict=False))

    @property
    def segment_names(self) -> tuple[str, ...]:
        """The name of every segment, as `via` writes it."""
        return self.edges or tuple(f"{self.name}[{k}]" for k in range(len(self.segments)))

    @model_validator(mode="after")
    def _sane(self) -> Self:
        for k, (start, end) in enumerate(self.segments):
            if math.dist(start, end) <= MEETING:
                raise ValueError(f"segment {k} of wall {self.name!r}, at {start}, has no length")
        if self.closed and len(self.points) == 2:
            raise ValueError(f"wall {self.name!r} is closed but has two points only; it would lie on itself")
        if self.edges is not None and len(self.edges) != len(self.segments):
            raise ValueError(f"wall {self.name!r}: expected a name in edges for each of {len(self.segments)} segments")
        if self.height is not None and self.height[0] >= self.height[1]:
            raise ValueError(f"height of wall {self.name!r} must be [lower, upper], got {list(self.height)}")
        return self


class PostSection(TomlModel):
    """`[[posts]]`: a round thing."""

    name: Name
    center: Point
    radius: Positive
    material: str
    height: tuple[float, float] | None = None


class PlaceSection(TomlModel):
    """`[places.NAME]`."""

    position: Point
    heading_deg: float = 0.0


class RoomFile(TomlModel):
    """A whole room file."""

    name: str
    air: AirSection = AirSection()
    materials: dict[str, Material] = Field(default_factory=dict)
    walls: tuple[WallSection, ...] = ()
    posts: tuple[PostSection, ...] = ()
    places: dict[str, PlaceSection] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _sane(self) -> Self:
        if not self.walls:
            raise ValueError("a room needs at least one [[walls]]")
        self._materials_are_defined()
        self._names_are_unique()
        self._places_are_free()
        return self

    def _materials_are_defined(self) -> None:
        things: tuple[WallSection | PostSection, ...] = (*self.walls, *self.posts)
        for thing in things:
            if thing.material not in self.materials:
                known = ", ".join(self.materials) or "none"
                raise ValueError(f"material {thing.material!r} of {thing.name!r} is not defined; defined: {known}")

    def _names_are_unique(self) -> None:
        names = [name for wall in self.walls for name in wall.segment_names] + [post.name for post in self.posts]
        twice = next((name for k, name in enumerate(names) if name in names[:k]), None)
        if twice is not None:
            raise ValueError(f"two segments or posts are named {twice!r}; a path could not say which it touched")

    def _places_are_free(self) -> None:
        for name, place in self.places.items():
            for post in self.posts:
                if math.dist(place.position, post.center) <= post.radius:
                    raise ValueError(f"place {name!r} lies inside post {post.name!r}")
