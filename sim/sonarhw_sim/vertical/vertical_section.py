"""A vertical plane through a transducer as a two-dimensional room: x runs along the plane, y is the height.

Surfaces that the plane does not meet perpendicularly only block, because sound that they reflect leaves the plane.
Walls are sheets, so a box is open at the top. Posts have lids.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from sonarhw.readings import FloatArray
from sonarhw_sim.rays.paths import PathSearch
from sonarhw_sim.room.edges import Edges, find_edges
from sonarhw_sim.room.model import Room
from sonarhw_sim.room.room_file import MEETING, Span

PARALLEL = 1e-6  # rad: walls that differ less in direction are perpendicular to one plane
LEVEL = 1e-9  # m: a path that stays so near to the transducer's height belongs to the plan


@dataclass(frozen=True)
class SectionQuery:
    """Input of a section: a place in a room, the height of the transducer, and the search."""

    room: Room
    position: tuple[float, float]
    height: float  # m
    search: PathSearch

    @property
    def reach(self) -> float:
        """Extent of floor, ceiling and unlimited walls, m: farther than any path."""
        return self.search.max_length + 1.0


@dataclass(frozen=True)
class Mirror:
    """A wall, post, corner or edge that is perpendicular to a plane, as one reflecting vertical line."""

    at: float  # m along the plane's direction from the place
    span: Span
    reflectance: float  # for the path there and back in the plan
    surfaces: tuple[int, ...]  # surfaces that sound touches there
    edge: int = -1  # edge that diffracts there; then there are no surfaces
    curvature: float = 1.0  # gain by the curvature of a post, for sound diffracted at its rim
    phase: float = 0.0  # rad, of sound that the edge diffracts

    @property
    def has_rims(self) -> bool:
        """Whether its lower and upper end diffract sound as edges perpendicular to the plane."""
        return len(self.surfaces) == 1


@dataclass(frozen=True)
class Plane:
    """One vertical plane through the place, with its perpendicular surfaces."""

    direction: float  # rad
    mirrors: tuple[Mirror, ...]
    once: bool = True  # whether a path may touch a mirror only once, because its reflectance is for a single touch


Owner = Mirror | int | None  # of a wall of a section: a mirror, or the number of floor or ceiling; None: it only blocks
Segment = tuple[float, float, float, float]  # x, y of start and end, m
_Upright = tuple[float, Span, Mirror | None]  # position along the plane, span, owner


@dataclass(frozen=True)
class Section:
    """A plane as a room: x runs along the plane from the place, y is the height."""

    room: Room
    owners: tuple[Owner, ...]  # of each of its walls


def draw_section(view: SectionQuery, plane: Plane) -> Section:
    """Return the surfaces that a plane meets, as a room."""
    levels, open_between = _levels(view)
    uprights: list[_Upright] = [(mirror.at, mirror.span, mirror) for mirror in plane.mirrors]
    uprights += [(at, span, None) for at, span in _blocking(view, plane)]
    drawn: list[tuple[Segment, Owner]] = [*levels]
    for at, span, owner in _without_overlap(uprights):
        lower, upper = max(span[0], open_between[0]), min(span[1], open_between[1])
        if upper - lower > MEETING:
            drawn.append(((at, lower, at, upper), owner))
    drawn += [(lid, None) for lid in _lids(view, plane) if open_between[0] < lid[1] < open_between[1]]
    owners = tuple(owner for _, owner in drawn)
    return Section(_as_room(view.room, np.array([segment for segment, _ in drawn]).reshape(-1, 4), owners), owners)


def _levels(view: SectionQuery) -> tuple[list[tuple[Segment, Owner]], Span]:
    """Return floor and ceiling, and the heights (m) between which there is air."""
    lowest, highest = view.height - view.reach, view.height + view.reach
    drawn: list[tuple[Segment, Owner]] = []
    for level in view.room.levels:
        height = float(view.room.heights[level, 0])
        lowest, highest = (height, highest) if height < view.height else (lowest, height)
        drawn.append(((-view.reach, height, view.reach, height), level))
    return drawn, (lowest, highest)


def _blocking(view: SectionQuery, plane: Plane) -> Iterator[tuple[float, Span]]:
    """Yield position (m along the plane) and span of the walls and posts that cross a plane."""
    room = view.room
    dx, dy = math.cos(plane.direction), math.sin(plane.direction)
    rx, ry = (room.walls[:, :2] - view.position).T
    ex, ey = (room.walls[:, 2:] - room.walls[:, :2]).T
    across = dx * ey - dy * ex
    slant = np.abs(across) > PARALLEL * np.hypot(ex, ey)
    safe = np.where(slant, across, 1.0)
    at, along = (rx * ey - ry * ex) / safe, (rx * dy - ry * dx) / safe
    crosses = slant & (along >= -LEVEL) & (along <= 1 + LEVEL) & (np.abs(at) <= view.reach)
    for wall in np.flatnonzero(crosses).tolist():
        yield float(at[wall]), span_of(room, wall)
    for post in range(len(room.posts)):
        for end in chord(view, plane.direction, post) or ():
            yield end, span_of(room, len(room.walls) + post)


def _lids(view: SectionQuery, plane: Plane) -> list[Segment]:
    lids: list[Segment] = []
    for post in range(len(view.room.posts)):
        within = chord(view, plane.direction, post)
        if within is not None:
            lids += [(within[0], end, within[1], end) for end in span_of(view.room, len(view.room.walls) + post)]
    return lids


def _without_overlap(uprights: list[_Upright]) -> list[_Upright]:
    """Return the vertical lines without overlaps: of later ones, only parts outside of earlier ones are kept."""
    kept: list[_Upright] = []
    for at, span, owner in uprights:
        flush = [(other, taken) for other, taken, _ in kept if abs(other - at) <= MEETING]
        left = [span]
        for _, taken in flush:
            left = [piece for whole in left for piece in _outside(whole, taken)]
        # flush lines get exactly the same position, so that their ends meet
        kept += [(flush[0][0] if flush else at, piece, owner) for piece in left]
    return kept


def _outside(whole: Span, taken: Span) -> list[Span]:
    pieces = [(whole[0], min(whole[1], taken[0])), (max(whole[0], taken[1]), whole[1])]
    return [piece for piece in pieces if piece[0] < piece[1]]


def _as_room(room: Room, segments: FloatArray, owners: tuple[Owner, ...]) -> Room:
    labels = tuple(str(k) for k in range(len(segments)))
    edges = find_edges(segments, labels)
    rims = [
        row
        for row, name in enumerate(edges.names)
        if any(isinstance(owner := owners[k], Mirror) and owner.has_rims for k in walls_at_edge(name))
    ]
    return replace(
        room,
        walls=segments,
        posts=np.empty((0, 3)),
        reflectances=np.array([_reflectance(room, owner) for owner in owners], dtype=np.float64),
        scattered=np.zeros(len(segments)),
        heights=np.tile((-math.inf, math.inf), (len(segments), 1)),
        names=labels,
        materials=labels,
        edges=_edge_rows(edges, rims),
    )


def _reflectance(room: Room, owner: Owner) -> float:
    if isinstance(owner, Mirror):
        return owner.reflectance
    return 0.0 if owner is None else float(room.reflectances[owner])


def walls_at_edge(name: str) -> list[int]:
    """Return the walls of a section that meet at the edge with this name."""
    return [int(label) for label in name.split("/") if label]


def _edge_rows(edges: Edges, rows: list[int]) -> Edges:
    names = tuple(edges.names[row] for row in rows)
    return Edges(edges.points[rows], edges.starts[rows], edges.openings[rows], edges.faces[rows], names)


def span_of(room: Room, surface: int) -> Span:
    """Return lower and upper end of a surface, m; infinite if not given."""
    return float(room.heights[surface, 0]), float(room.heights[surface, 1])


def chord(view: SectionQuery, direction: float, post: int) -> Span | None:
    """Return where a plane enters and leaves a post, m along its direction from the place, or None."""
    x, y, radius = view.room.posts[post].tolist()
    dx, dy = x - view.position[0], y - view.position[1]
    along = dx * math.cos(direction) + dy * math.sin(direction)
    aside = dy * math.cos(direction) - dx * math.sin(direction)
    if abs(aside) >= radius:
        return None
    half = math.sqrt(radius**2 - aside**2)
    return along - half, along + half
