"""Vertical sections: echoes by way of floor and ceiling, and over the tops of walls.

Takes a room, a place and the height of its transducer; hands on paths that leave the horizontal. Each section is a
vertical plane through the transducer, and the two-dimensional core follows sound in it as it does in the plan. Sound
stays in such a plane only where it meets things squarely, so a plane goes to the foot of the perpendicular on a wall,
to the axis of a post, or to a vertical edge or inner corner that answers in the plan: these reflect there, everything
else that crosses the plane only blocks. Walls are sheets, a box is open at the top; posts have lids.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from sim.edges import Edges, find_edges
from sim.paths import Paths, PathSearch, find_paths
from sim.room import Place, Room
from sim.room_file import MEETING
from sonarhw.readings import FloatArray

Span = tuple[float, float]  # lower and upper end, m

_PARALLEL = 1e-6  # rad: walls that differ less in direction are met squarely in one plane
_LEVEL = 1e-9  # m: a path that stays so near to the transducer's height is the plan's


@dataclass(frozen=True)
class _View:
    """Who asks for what."""

    room: Room
    position: tuple[float, float]
    height: float  # m
    search: PathSearch

    @property
    def reach(self) -> float:
        """How far floor, ceiling and endless walls are drawn, m: beyond all that sound gets to."""
        return self.search.max_length + 1.0


@dataclass(frozen=True)
class _Mirror:
    """What a plane meets squarely: a wall or post, all of a corner, or an edge, as one upright that reflects."""

    at: float  # m along the plane's direction from the place
    span: Span
    reflectance: float  # there and back in the plan
    surfaces: tuple[int, ...]  # what sound touches there
    edge: int = -1  # the edge that bends it there; then it touches no surface
    curvature: float = 1.0  # what the roundness of a post leaves of sound bent by its rim

    @property
    def has_rims(self) -> bool:
        """Whether its lower and upper end bend sound as edges that run straight across the plane."""
        return len(self.surfaces) == 1


@dataclass(frozen=True)
class _Plane:
    """One vertical plane through the place, with what it meets squarely."""

    direction: float  # rad
    mirrors: tuple[_Mirror, ...]
    once: bool = True  # whether a path may touch a mirror but once: what it leaves of sound is known for that alone


@dataclass(frozen=True)
class _Section:
    """A plane as a room: x runs along the plane from the place, y is the height."""

    room: Room
    owners: tuple[_Mirror | int | None, ...]  # of each of its walls: a mirror, a level's number, None: it only blocks


def vertical_paths(room: Room, place: Place, height: float, search: PathSearch, flat: Paths) -> list[Paths]:
    """The paths that leave the horizontal, plane by plane; `flat` are those of the plan."""
    if not room.levels and not np.isfinite(room.heights).any():
        return []
    if any(room.heights[k, 0] <= height <= room.heights[k, 1] for k in room.posts_at(place.position)):
        return []
    view = _View(room, place.position, height, search)
    planes = [_Plane(0.0, ()), *_wall_planes(view), *_post_planes(view), *_answering_planes(view, flat)]
    return [_follow(view, plane) for plane in planes]


def _wall_planes(view: _View) -> Iterator[_Plane]:
    """Planes square to the walls on which the place has a foot of the perpendicular; parallel walls share one."""
    room = view.room
    starts, along = room.walls[:, :2] - view.position, room.walls[:, 2:] - room.walls[:, :2]
    lengths = np.hypot(*along.T)
    foot = -(starts * along).sum(axis=1) / lengths
    # normals turned to lie within 0..π, for a plane runs both ways
    turned = np.arctan2(along[:, 0], -along[:, 1])
    directions = np.mod(turned, math.pi)
    directions[directions > math.pi - _PARALLEL] -= math.pi
    at = starts[:, 0] * np.cos(directions) + starts[:, 1] * np.sin(directions)
    met = (foot >= -_LEVEL) & (foot <= lengths + _LEVEL) & (np.abs(at) <= view.reach / 2)
    walls = np.flatnonzero(met)[np.argsort(directions[met], kind="stable")]
    breaks = np.flatnonzero(np.diff(directions[walls]) > _PARALLEL) + 1
    for group in np.split(walls, breaks) if len(walls) else []:
        mirrors = [_Mirror(float(at[k]), _span(room, k), float(room.reflectances[k]), (int(k),)) for k in group]
        yield _Plane(float(directions[group[0]]), tuple(mirrors), once=False)


def _post_planes(view: _View) -> Iterator[_Plane]:
    room = view.room
    for post, (x, y, radius) in enumerate(room.posts.tolist()):
        direction = math.atan2(y - view.position[1], x - view.position[0])
        chord = _chord(view, direction, post)
        surface = len(room.walls) + post
        if chord is None or chord[0] <= 0.0 or chord[0] > view.reach / 2:
            continue
        curvature = math.sqrt(radius / (radius + chord[0]))
        reflectance = float(room.reflectances[surface]) * curvature
        mirror = _Mirror(chord[0], _span(room, surface), reflectance, (surface,), curvature=curvature)
        yield _Plane(direction, (mirror,))


def _answering_planes(view: _View, flat: Paths) -> Iterator[_Plane]:
    """Planes to the edges and inner corners that send sound straight back in the plan."""
    back = np.hypot(*(flat.leaving - flat.arriving).T) <= _LEVEL
    for k in np.flatnonzero(back).tolist():
        inner = flat.outline(k)[1:-1]
        straight = np.abs(inner - inner[:1]).max(initial=0.0) <= MEETING
        touched = tuple(int(surface) for surface in flat.surfaces[k] if surface >= 0)
        edge = int(flat.edges[k])
        if not straight or (len(touched) < 2 if edge < 0 else len(touched) > 0):
            continue
        surfaces = touched if edge < 0 else view.room.surfaces_at_edge(edge)
        spans = view.room.heights[list(surfaces)]
        span = float(spans[:, 0].max()), float(spans[:, 1].min())
        mirror = _Mirror(float(flat.lengths[k]) / 2, span, float(flat.gains[k]), touched, edge)
        yield _Plane(float(flat.departures[k]), (mirror,))


def _span(room: Room, surface: int) -> Span:
    return float(room.heights[surface, 0]), float(room.heights[surface, 1])


def _chord(view: _View, direction: float, post: int) -> Span | None:
    """Where a plane enters and leaves a post, m along its direction from the place; None where it misses."""
    x, y, radius = view.room.posts[post].tolist()
    dx, dy = x - view.position[0], y - view.position[1]
    along = dx * math.cos(direction) + dy * math.sin(direction)
    aside = dy * math.cos(direction) - dx * math.sin(direction)
    if abs(aside) >= radius:
        return None
    half = math.sqrt(radius**2 - aside**2)
    return along - half, along + half


def _follow(view: _View, plane: _Plane) -> Paths:
    """The paths of one plane that are no other plane's."""
    section = _section(view, plane)
    # one more, because a vertical edge is none, and is drawn as a wall that reflects
    search = replace(view.search, max_bounces=view.search.max_bounces + 1)
    found = find_paths(section.room, (0.0, view.height), search)
    return _lifted(view, plane, section, found)


def _section(view: _View, plane: _Plane) -> _Section:
    room, reach = view.room, view.reach
    lowest, highest = view.height - reach, view.height + reach
    segments: list[tuple[float, float, float, float]] = []
    owners: list[_Mirror | int | None] = []
    for level in room.levels:
        height = float(room.heights[level, 0])
        lowest, highest = (height, highest) if height < view.height else (lowest, height)
        segments.append((-reach, height, reach, height))
        owners.append(level)
    uprights: list[tuple[float, Span, _Mirror | None]] = [(mirror.at, mirror.span, mirror) for mirror in plane.mirrors]
    uprights += [(at, span, None) for at, span in _blocking(view, plane)]
    for at, (lower, upper), owner in _without_overlap(uprights):
        lower, upper = max(lower, lowest), min(upper, highest)
        if upper - lower > MEETING:
            segments.append((at, lower, at, upper))
            owners.append(owner)
    lids = [lid for lid in _lids(view, plane) if lowest < lid[1] < highest]
    segments += lids
    owners += [None] * len(lids)
    return _Section(_as_room(room, np.array(segments, dtype=np.float64).reshape(-1, 4), owners), tuple(owners))


def _blocking(view: _View, plane: _Plane) -> Iterator[tuple[float, Span]]:
    """Where (m along the plane) and how high the walls and posts stand that cross a plane."""
    room = view.room
    dx, dy = math.cos(plane.direction), math.sin(plane.direction)
    rx, ry = (room.walls[:, :2] - view.position).T
    ex, ey = (room.walls[:, 2:] - room.walls[:, :2]).T
    across = dx * ey - dy * ex
    slant = np.abs(across) > _PARALLEL * np.hypot(ex, ey)
    safe = np.where(slant, across, 1.0)
    at, along = (rx * ey - ry * ex) / safe, (rx * dy - ry * dx) / safe
    crosses = slant & (along >= -_LEVEL) & (along <= 1 + _LEVEL) & (np.abs(at) <= view.reach)
    for wall in np.flatnonzero(crosses).tolist():
        yield float(at[wall]), _span(room, wall)
    for post in range(len(room.posts)):
        for end in _chord(view, plane.direction, post) or ():
            yield end, _span(room, len(room.walls) + post)


def _lids(view: _View, plane: _Plane) -> list[tuple[float, float, float, float]]:
    lids = []
    for post in range(len(view.room.posts)):
        chord = _chord(view, plane.direction, post)
        ends = _span(view.room, len(view.room.walls) + post)
        lids += [(chord[0], end, chord[1], end) for end in ends if chord is not None]
    return lids


def _without_overlap(uprights: list[tuple[float, Span, _Mirror | None]]) -> list[tuple[float, Span, _Mirror | None]]:
    """Uprights of which no two lie on one another: what comes first stands, of the others what sticks out is left."""
    apart: list[tuple[float, Span, _Mirror | None]] = []
    for at, span, owner in uprights:
        flush = [(other, taken) for other, taken, _ in apart if abs(other - at) <= MEETING]
        left = [span]
        for _, taken in flush:
            left = [piece for whole in left for piece in _outside(whole, taken)]
        # flush means exactly so, or the ends of the two would not meet
        apart += [(flush[0][0] if flush else at, piece, owner) for piece in left]
    return apart


def _outside(whole: Span, taken: Span) -> list[Span]:
    pieces = [(whole[0], min(whole[1], taken[0])), (max(whole[0], taken[1]), whole[1])]
    return [piece for piece in pieces if piece[0] < piece[1]]


def _as_room(room: Room, segments: FloatArray, owners: list[_Mirror | int | None]) -> Room:
    labels = tuple(str(k) for k in range(len(segments)))
    edges = find_edges(segments, labels)
    rims = [
        row
        for row, name in enumerate(edges.names)
        if any(isinstance(owner := owners[k], _Mirror) and owner.has_rims for k in _labels(name))
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


def _reflectance(room: Room, owner: _Mirror | int | None) -> float:
    if isinstance(owner, _Mirror):
        return owner.reflectance
    return 0.0 if owner is None else float(room.reflectances[owner])


def _labels(name: str) -> list[int]:
    """The walls of a section that meet at an edge of that name."""
    return [int(label) for label in name.split("/") if label]


def _edge_rows(edges: Edges, rows: list[int]) -> Edges:
    names = tuple(edges.names[row] for row in rows)
    return Edges(edges.points[rows], edges.starts[rows], edges.openings[rows], names)


@dataclass(frozen=True)
class _Event:
    """What a path of a section meets, in the words of the room."""

    surfaces: tuple[int, ...]  # that it reflects off
    edge: int = -1  # that bends it
    gain: float = 1.0  # on top of what the section has counted
    squarely: bool = True  # whether it is one of the plane's mirrors, not floor or ceiling


@dataclass(frozen=True)
class _Lifted:
    """One path of a section as a path of the room."""

    row: int  # in the section's paths
    events: tuple[_Event, ...]
    points: FloatArray  # (k, 2), in the plane

    @property
    def surfaces(self) -> tuple[int, ...]:
        return tuple(surface for event in self.events for surface in event.surfaces)

    @property
    def edge(self) -> int:
        return next((event.edge for event in self.events if event.edge >= 0), -1)

    @property
    def bend(self) -> int:
        """Reflections before the edge; all of them where there is none."""
        at = next((k for k, event in enumerate(self.events) if event.edge >= 0), len(self.events))
        return sum(len(event.surfaces) for event in self.events[:at])


def _lifted(view: _View, plane: _Plane, section: _Section, found: Paths) -> Paths:
    lifted = [_lift(view, section, found, row) for row in range(len(found))]
    lifted = [path for path in lifted if _belongs(view, plane, path)]
    rows = np.array([path.row for path in lifted], dtype=np.intp)
    bounces = max((len(path.surfaces) for path in lifted), default=0)
    surfaces = np.full((len(lifted), bounces), -1, dtype=np.int32)
    points = np.full((len(lifted), bounces + 3, 2), np.nan)
    along = np.array([math.cos(plane.direction), math.sin(plane.direction)])
    for k, path in enumerate(lifted):
        surfaces[k, : len(path.surfaces)] = path.surfaces
        points[k, : len(path.points)] = view.position + path.points[:, :1] * along
    departures, rising = _out_of_plane(plane, found.departures[rows])
    arrivals, sinking = _out_of_plane(plane, found.arrivals[rows])
    return Paths(
        lengths=found.lengths[rows],
        departures=departures,
        arrivals=arrivals,
        gains=found.gains[rows] * [math.prod(event.gain for event in path.events) for path in lifted],
        surfaces=surfaces,
        edges=np.array([path.edge for path in lifted], dtype=np.int32),
        bends=np.array([path.bend for path in lifted], dtype=np.int32),
        elevations=np.column_stack((rising, sinking)),
        points=points,
    )


def _lift(view: _View, section: _Section, found: Paths, row: int) -> _Lifted:
    owners = [section.owners[wall] for wall in found.surfaces[row] if wall >= 0]
    events = [_touched(owner, float(found.lengths[row])) for owner in owners]
    if found.edges[row] >= 0:
        events.insert(int(found.bends[row]), _rim(view.room, section, int(found.edges[row])))
    corners = found.outline(row)
    # in a corner sound meets both walls at one point
    times = [1, *(max(1, len(event.surfaces)) for event in events), 1]
    return _Lifted(row, tuple(events), np.repeat(corners, times, axis=0))


def _touched(owner: _Mirror | int | None, length: float) -> _Event:
    if isinstance(owner, _Mirror):
        return _Event(owner.surfaces) if owner.edge < 0 else _Event((), owner.edge, _obliquely(owner, length))
    return _Event(() if owner is None else (owner,), squarely=False)


def _obliquely(edge: _Mirror, length: float) -> float:
    """By how much louder an edge is when met at the slant of a path so long (m) than when met squarely.

    Keller's cone: the coefficient grows as 1/sin β of the angle β to the edge, the legs as well, whose root it is held
    against, so 1/√(sin β) is left (Kouyoumjian and Pathak 1974); no edge is louder than a wall.
    """
    return min(math.sqrt(length / (2 * edge.at)), 1 / edge.reflectance)


def _rim(room: Room, section: _Section, edge: int) -> _Event:
    mirror = next(
        owner
        for wall in _labels(section.room.edges.names[edge])
        if isinstance(owner := section.owners[wall], _Mirror) and owner.has_rims
    )
    surface = mirror.surfaces[0]
    return _Event((), room.edge_between(surface, surface), mirror.curvature)


def _belongs(view: _View, plane: _Plane, path: _Lifted) -> bool:
    """Whether a path leaves the horizontal, is no other plane's, and touches no more than may be."""
    rises = np.abs(path.points[:, 1] - view.height).max() > _LEVEL
    squarely = sum(event.squarely for event in path.events)
    own = squarely == bool(plane.mirrors) if plane.once else squarely > 0
    return bool(rises) and own and len(path.surfaces) <= view.search.max_bounces


def _out_of_plane(plane: _Plane, angles: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Directions in the plan and elevations, (n,) rad each, of angles (n,) in a plane."""
    forward = np.cos(angles)
    directions = plane.direction + np.where(forward < 0, math.pi, 0.0)
    return np.arctan2(np.sin(directions), np.cos(directions)), np.arctan2(np.sin(angles), np.abs(forward))
