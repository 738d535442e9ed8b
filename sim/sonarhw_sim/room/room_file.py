"""Format of room files, and the checks of their values.

The format is public and stays compatible. `sonarhw_sim.room.room` converts it to arrays.
"""

import math
from collections import Counter
from functools import cached_property
from typing import Annotated, Self

from pydantic import Field, model_validator

from sonarhw.errors import did_you_mean
from sonarhw_sim.files import TomlModel, about, quoted

MEETING = 1e-6  # m; wall ends closer than this meet
MAX_COORDINATE = 1e6  # m; beyond, rounding would move walls

MOST_SURFACES = 200_000  # walls and posts; more would need gigabytes
MOST_ROWS = 10_000  # of the table of a material
MOST_NAME = 200  # characters
MOST_TURNS_DEG = 36_000.0  # of a heading; far beyond, a degree would be lost to rounding

Share = Annotated[float, Field(ge=0, le=1)]
Length = Annotated[float, Field(gt=0, le=MAX_COORDINATE)]
Coordinate = Annotated[float, Field(ge=-MAX_COORDINATE, le=MAX_COORDINATE)]
Point = tuple[Coordinate, Coordinate]
Span = tuple[Coordinate, Coordinate]  # lower and upper end, m
Name = Annotated[str, Field(pattern=r"^[^>/\n\r]+$", max_length=MOST_NAME)]  # via joins names with > and /
Text = Annotated[str, Field(max_length=MOST_NAME)]


class AirSection(TomlModel):
    """`[air]`."""

    temperature_c: Annotated[float, Field(ge=-40, le=60), about("temperature of the air", "°C")] = 20.0
    relative_humidity: Annotated[Share, about("relative humidity; 0.5 is 50 %")] = 0.5
    pressure_kpa: Annotated[float, Field(ge=30, le=120), about("air pressure", "kPa")] = 101.325


class ReflectanceRow(TomlModel):
    """A reflectance at one angle and frequency."""

    incidence_deg: Annotated[
        float, Field(ge=0, le=90), about("angle between the sound and the perpendicular of the surface", "degrees")
    ]
    frequency: Annotated[float, Field(ge=1e3, le=1e6), about("frequency", "Hz")]
    reflectance: Annotated[Share, about("reflectance at this angle and frequency")]


class Material(TomlModel):
    """`[materials.NAME]`."""

    reflectance: Annotated[
        Share | None,
        about("amplitude of the reflected over that of the incident sound; required without `table`"),
    ] = None
    scatter: Annotated[Share, about("share of the reflected power that is diffuse: 0 mirror, 1 fully diffuse")] = 0.0
    table: Annotated[
        tuple[ReflectanceRow, ...],
        Field(max_length=MOST_ROWS),
        about(
            "reflectances at each of some angles and frequencies, in place of `reflectance`; beyond its ends, "
            "the table continues with its nearest values"
        ),
    ] = ()

    @property
    def largest(self) -> float:
        """The reflectance, or the largest one of the table."""
        return max((row.reflectance for row in self.table), default=self.reflectance or 0.0)

    @model_validator(mode="after")
    def _one_reflectance(self) -> Self:
        if self.reflectance is None and not self.table:
            raise ValueError("reflectance: missing; expected a number from 0 to 1, or a table")
        if self.reflectance is not None and self.table:
            raise ValueError("reflectance, table: expected one of them; the table contains all reflectances")
        return self

    @model_validator(mode="after")
    def _complete(self) -> Self:
        rows = Counter((row.incidence_deg, row.frequency) for row in self.table)
        for angle in sorted({angle for angle, _ in rows}):
            for frequency in sorted({frequency for _, frequency in rows}):
                if rows[angle, frequency] != 1:
                    count = "no row" if not rows[angle, frequency] else f"{rows[angle, frequency]} rows"
                    raise ValueError(
                        f"table: expected one row for each angle at each frequency, got {count} for "
                        f"{angle:g}° at {frequency:g} Hz"
                    )
        return self


class WallSection(TomlModel):
    """`[[walls]]`: a chain of segments."""

    name: Annotated[Name, about("name of the chain; its segments are NAME[0], NAME[1], … without `edges`")]
    points: Annotated[
        tuple[Point, ...], Field(min_length=2, max_length=MOST_SURFACES), about("corners in order, as [x, y]", "m")
    ]
    material: Annotated[Text, about("name of one of [materials]")]
    closed: Annotated[bool, about("true: a last segment leads from the last point to the first")] = False
    edges: Annotated[tuple[Name, ...] | None, about("a name for each segment, in order")] = None
    height: Annotated[Span | None, about("[lower, upper] end; default: from floor to ceiling", "m")] = None
    lids: Annotated[bool, about("true: level surfaces close both ends; needs `closed` and `height`")] = False

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
            raise ValueError(
                f"wall {self.name!r}: expected a name in edges for each of {len(self.segments)} segments, "
                f"got {len(self.edges)}{self._closing_hint()}"
            )
        _check_span(self.height, f"wall {self.name!r}")
        if self.lids and not (self.closed and self.height):
            raise ValueError(f"lids of wall {self.name!r}: expected closed = true and a height")
        return self

    def _closing_hint(self) -> str:
        missing = not self.closed and self.edges is not None and len(self.edges) == len(self.points)
        return "; is closed = true missing?" if missing else ""


class PostSection(TomlModel):
    """`[[posts]]`: a round object."""

    name: Annotated[Name, about("name of the post")]
    center: Annotated[Point, about("centre, as [x, y]", "m")]
    radius: Annotated[Length, about("radius", "m")]
    material: Annotated[Text, about("name of one of [materials]")]
    height: Annotated[Span | None, about("[lower, upper] end; default: from floor to ceiling", "m")] = None
    lids: Annotated[bool, about("true: its ends reflect sound, not only block it; needs `height`")] = False

    @model_validator(mode="after")
    def _sane(self) -> Self:
        _check_span(self.height, f"post {self.name!r}")
        if self.lids and not self.height:
            raise ValueError(f"lids of post {self.name!r}: expected a height")
        return self

    def spans(self, height: float | None) -> bool:
        """Return whether it exists at this height, m; None: only the plan is used."""
        return height is None or self.height is None or self.height[0] <= height <= self.height[1]


class LevelSection(TomlModel):
    """`[floor]` or `[ceiling]`."""

    height: Annotated[Coordinate, about("height of the surface", "m")]
    material: Annotated[Text, about("name of one of [materials]")]


class PlaceSection(TomlModel):
    """`[places.NAME]`."""

    position: Annotated[Point, about("position of the turning axis, as [x, y]", "m")]
    heading_deg: Annotated[
        float,
        Field(ge=-MOST_TURNS_DEG, le=MOST_TURNS_DEG),
        about("direction of the turntable's step 0: 0 along x, 90 along y", "degrees"),
    ] = 0.0
    height: Annotated[
        Coordinate | None, about("height of the transducer; without it, floor, ceiling and heights have no effect", "m")
    ] = None


class RoomFile(TomlModel):
    """A whole room file."""

    name: Annotated[Text, about("name of the room, for titles and logs")]
    air: Annotated[AirSection, about("the air")] = AirSection()
    materials: Annotated[dict[Text, Material], about("what walls, posts, floor and ceiling are made of")] = Field(
        default_factory=dict
    )
    walls: Annotated[tuple[WallSection, ...], Field(max_length=MOST_SURFACES), about("chains of flat walls")] = ()
    posts: Annotated[tuple[PostSection, ...], Field(max_length=MOST_SURFACES), about("round objects")] = ()
    floor: Annotated[LevelSection | None, about("the floor; used from a place with a height")] = None
    ceiling: Annotated[LevelSection | None, about("the ceiling; used from a place with a height")] = None
    places: Annotated[dict[Text, PlaceSection], about("positions of the sensor")] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _sane(self) -> Self:
        if not self.walls:
            raise ValueError("walls: missing; a room needs at least one [[walls]]")
        surfaces = sum(len(wall.segments) for wall in self.walls) + len(self.posts)
        if surfaces > MOST_SURFACES:
            raise ValueError(f"walls, posts: expected at most {MOST_SURFACES} segments and posts, got {surfaces}")
        self._materials_are_defined()
        self._names_are_unique()
        self._places_are_free()
        self._levels_leave_room()
        return self

    @property
    def levels(self) -> dict[str, LevelSection]:
        """Floor and ceiling, if any."""
        return {name: level for name, level in (("floor", self.floor), ("ceiling", self.ceiling)) if level is not None}

    @property
    def with_lids(self) -> list[WallSection | PostSection]:
        """The chains of walls and the posts with lids."""
        solids: list[WallSection | PostSection] = [*self.walls, *self.posts]
        return [solid for solid in solids if solid.lids]

    def _materials_are_defined(self) -> None:
        used = [(f"walls[{k}]", wall.name, wall.material) for k, wall in enumerate(self.walls)]
        used += [(f"posts[{k}]", post.name, post.material) for k, post in enumerate(self.posts)]
        used += [(name, name, level.material) for name, level in self.levels.items()]
        for key, name, material in used:
            if material not in self.materials:
                hint = did_you_mean(material, self.materials) or ";"
                names = ", ".join(self.materials) or "none"
                raise ValueError(
                    f"{key}.material: unknown material {quoted(material)} of {name!r}{hint} defined: {names}"
                )

    def _names_are_unique(self) -> None:
        names = [name for wall in self.walls for name in wall.segment_names] + [post.name for post in self.posts]
        names += [*self.levels, *(name for solid in self.with_lids for name in lid_names(solid))]
        twice, times = Counter(names).most_common(1)[0]
        if times > 1:
            raise ValueError(f"walls, posts: two surfaces are named {twice!r}; expected different names")

    def _places_are_free(self) -> None:
        for name, place in self.places.items():
            for post in self.posts:
                if math.dist(place.position, post.center) <= post.radius and post.spans(place.height):
                    raise ValueError(f"places: place {name!r} lies inside post {post.name!r}; move one of them")

    def _levels_leave_room(self) -> None:
        bottom = -math.inf if self.floor is None else self.floor.height
        top = math.inf if self.ceiling is None else self.ceiling.height
        if bottom >= top:
            raise ValueError(
                f"floor, ceiling: the floor must lie below the ceiling, got heights {bottom:g} and {top:g}"
            )
        for name, place in self.places.items():
            if place.height is not None and not bottom < place.height < top:
                raise ValueError(
                    f"places: height of place {name!r} must lie between floor and ceiling, {bottom:g} to {top:g}, "
                    f"got {place.height:g}"
                )


def lid_names(solid: WallSection | PostSection) -> tuple[str, str]:
    """Return the names of the lower and the upper level end of a solid, as in `via`."""
    return f"{solid.name} underside", f"{solid.name} lid"


def _check_span(height: Span | None, whose: str) -> None:
    if height is not None and height[0] >= height[1]:
        raise ValueError(f"height of {whose} must be [lower, upper], got {list(height)}")
