"""Mistakes in the plan of a room: wrong unit, walls that nearly meet or coincide, posts in walls, places outside."""

import math
from collections.abc import Iterable, Iterator
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray
from sonarhw_sim.check.finding import Finding, Point
from sonarhw_sim.room.model import Room
from sonarhw_sim.room.objects import object_around, object_name
from sonarhw_sim.room.outside import wall_distances
from sonarhw_sim.room.room_file import MEETING

LARGE = 100.0  # m; a larger room is probably not in metres
_NEAR = 0.02  # m; a smaller gap between walls is probably not intended
_NEAR_SHARE = 0.02  # of the extent of a small room
_SHORT = 1e-3  # m, of a wall, and of the overlap of two walls
_IN_WALL = 5e-3  # m from a wall; no transducer fits there
_BEAD = 0.03  # m; a smaller post may round the edge of a wall
_MOST_DISTANCES = 10**8  # in one test; above, only some walls are tested


def extent(room: Room) -> tuple[float, float]:
    """Return width and depth of the room, m."""
    centres, radii = room.posts[:, :2], room.posts[:, 2:]
    points = np.vstack((room.walls.reshape(-1, 2), centres - radii, centres + radii))
    width, depth = np.ptp(points, axis=0)
    return float(width), float(depth)


def plan_findings(room: Room) -> Iterator[Finding]:
    """Yield the findings in the plan: unit, walls, posts, places."""
    yield from _wrong_unit(room)
    yield from _short_walls(room)
    yield from _gaps(room)
    yield from _overlaps(room)
    yield from _posts_in_walls(room)
    yield from _places(room)


def _wrong_unit(room: Room) -> Iterator[Finding]:
    width, depth = extent(room)
    if max(width, depth) > LARGE:
        yield Finding(
            "unit",
            "room",
            f"is {_grouped(width)} m wide and {_grouped(depth)} m deep",
            f"are these centimetres ({width / 100:g} by {depth / 100:g} m) or "
            f"millimetres ({width / 1000:g} by {depth / 1000:g} m)? expected metres",
        )


def _grouped(number: float) -> str:
    return f"{number:,.0f}".replace(",", " ")


def _short_walls(room: Room) -> Iterator[Finding]:
    lengths = np.hypot(*(room.walls[:, 2:] - room.walls[:, :2]).T)
    for k in np.flatnonzero(lengths < _SHORT).tolist():
        found = f"is only {_millimetres(lengths[k])} long"
        yield Finding("short wall", f"wall {room.names[k]!r}", found, "remove one of its points", (_middle(room, k),))


def _gaps(room: Room) -> Iterator[Finding]:
    """Yield the free ends of walls that nearly meet another wall."""
    near = min(_NEAR, _NEAR_SHARE * max(extent(room)))
    ends, counts = np.unique(room.walls.reshape(-1, 2), axis=0, return_counts=True)
    free = ends[counts == 1][: _MOST_DISTANCES // len(room.walls)]
    seen: set[frozenset[int]] = set()
    for end in free:
        own = int(np.flatnonzero((room.walls.reshape(-1, 2, 2) == end).all(axis=2).any(axis=1))[0])
        distances = wall_distances(end[None], room.walls)[0]
        distances[own] = math.inf
        other = int(distances.argmin())
        if MEETING < distances[other] < near and not _cross(room.walls[own], room.walls[other]):
            if frozenset((own, other)) not in seen:
                yield Finding(
                    "gap",
                    f"walls {room.names[own]!r} and {room.names[other]!r}",
                    f"have a gap of {_millimetres(distances[other])} at {_point(end)}",
                    "sound passes through it; let them meet in one point",
                    (_pair(end),),
                )
            seen.add(frozenset((own, other)))


def _cross(wall: FloatArray, other: FloatArray) -> bool:
    return all(
        (_side(first, second[:2]) > 0) != (_side(first, second[2:]) > 0)
        for first, second in ((wall, other), (other, wall))
    )


def _side(wall: FloatArray, point: FloatArray) -> float:
    along, to = wall[2:] - wall[:2], point - wall[:2]
    return float(along[0] * to[1] - along[1] * to[0])


def _overlaps(room: Room) -> Iterator[Finding]:
    """Yield the pairs of walls that coincide or overlap, both in the plan and in height."""
    along = room.walls[:, 2:] - room.walls[:, :2]
    along = along / np.hypot(*along.T)[:, None]
    backwards = (along[:, 0] < -MEETING) | ((abs(along[:, 0]) <= MEETING) & (along[:, 1] < 0))
    along[backwards] *= -1
    starts, stops = np.sort(np.stack([(room.walls[:, k : k + 2] * along).sum(axis=1) for k in (0, 2)]), axis=0)
    offsets = along[:, 0] * room.walls[:, 1] - along[:, 1] * room.walls[:, 0]
    lines = np.round(np.column_stack((along, offsets)) / MEETING)
    order = np.lexsort((starts, *lines.T))
    for first, second in pairwise(order.tolist()):
        shared = min(stops[first], stops[second]) - starts[second]
        if (lines[first] == lines[second]).all() and shared > _SHORT and _same_heights(room, first, second):
            same = abs(starts[first] - starts[second]) < _SHORT and abs(stops[first] - stops[second]) < _SHORT
            yield Finding(
                "duplicate wall" if same else "overlap",
                f"walls {room.names[first]!r} and {room.names[second]!r}",
                "coincide" if same else f"overlap over {_millimetres(shared)}",
                "remove one of them" if same else "shorten one of them",
                (_middle(room, second),),
            )


def _posts_in_walls(room: Room) -> Iterator[Finding]:
    first_post = len(room.walls)
    for number, (x, y, radius) in enumerate(room.posts[: _MOST_DISTANCES // first_post].tolist(), first_post):
        if radius < _BEAD:
            continue
        distances = wall_distances(np.array([[x, y]]), room.walls)[0]
        for wall in np.flatnonzero(distances < radius - MEETING).tolist():
            if _same_heights(room, number, wall):
                found = f"overlaps wall {room.names[wall]!r} by {_millimetres(radius - distances[wall])}"
                advice = "move the post, or make it smaller"
                yield Finding("post in wall", f"post {room.names[number]!r}", found, advice, ((x, y),))
        if room.is_outside((x, y)):
            found, advice = f"is outside the room, at {_point((x, y))}", "move it into the room, or remove it"
            yield Finding("post outside", f"post {room.names[number]!r}", found, advice, ((x, y),))


def _places(room: Room) -> Iterator[Finding]:
    for place in room.places.values():
        where, at = f"place {place.name!r}", _point(place.position)
        if room.is_outside(place.position) or room.is_far_from(place.position):
            advice = "move it into the room; expected [x, y] in metres"
            yield Finding("place outside", where, f"is outside the room, at {at}", advice, (place.position,))
        distances = wall_distances(np.array([place.position]), room.walls)[0]
        nearest = int(distances.argmin())
        if distances[nearest] < _IN_WALL:
            found = f"is {_millimetres(distances[nearest])} from wall {room.names[nearest]!r}, at {at}"
            yield Finding("place in wall", where, found, "move it away from the wall", (place.position,))
        chain = object_around(room, place)
        if chain is not None:
            found = f"is inside {object_name(room, chain)}, at {at}"
            yield Finding("place in object", where, found, "move it out; expected [x, y] in metres", (place.position,))


def _same_heights(room: Room, first: int, second: int) -> bool:
    (low, high), (lower, upper) = room.heights[[first, second]]
    return bool(low < upper and lower < high)


def _middle(room: Room, wall: int) -> Point:
    return _pair((room.walls[wall, :2] + room.walls[wall, 2:]) / 2)


def _pair(point: FloatArray) -> Point:
    return float(point[0]), float(point[1])


def _point(point: Iterable[float] | NDArray[np.float64]) -> str:
    x, y = point
    return f"{x:.6g}, {y:.6g} m"


def _millimetres(length: float) -> str:
    return f"{length:.4g} m" if length >= 1 else f"{1000 * length:.3g} mm"
