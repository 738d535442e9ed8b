"""What is probably wrong in a room that can be read, and why a prediction has no echo."""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from sonarhw.errors import InputError
from sonarhw.readings import FloatArray
from sonarhw_sim.board.profile import Board
from sonarhw_sim.files import parse_table, problems_of
from sonarhw_sim.predict.settled import predict_readings
from sonarhw_sim.room.room import Place, Room, object_around, object_name, surface_distances, wall_distances
from sonarhw_sim.room.room_file import MEETING, RoomFile
from sonarhw_sim.room.room_writing import materials
from sonarhw_sim.room.small_things import clusters_of, coupled_to, slits_of

Point = tuple[float, float]  # m


@dataclass(frozen=True)
class Finding:
    """What is probably wrong, where, and what to do."""

    kind: str  # one word, for programs
    where: str  # names of walls, posts, places or materials
    found: str
    advice: str
    at: tuple[Point, ...] = ()  # where a drawing marks it; empty: nowhere

    @property
    def line(self) -> str:
        """The finding on one line."""
        return f"{self.where}: {self.found}; {self.advice}"


# Mistakes in the plan of a room: wrong unit, walls that nearly meet or coincide, posts in walls, places outside.


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
        text = f"is only {_millimetres(lengths[k])} long"
        yield Finding("short wall", f"wall {room.names[k]!r}", text, "remove one of its points", (_middle(room, k),))


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
                text = f"overlaps wall {room.names[wall]!r} by {_millimetres(radius - distances[wall])}"
                advice = "move the post, or make it smaller"
                yield Finding("post in wall", f"post {room.names[number]!r}", text, advice, ((x, y),))
        if room.is_outside((x, y)):
            text, advice = f"is outside the room, at {_point((x, y))}", "move it into the room, or remove it"
            yield Finding("post outside", f"post {room.names[number]!r}", text, advice, ((x, y),))


def _places(room: Room) -> Iterator[Finding]:
    for place in room.places.values():
        where, point = f"place {place.name!r}", _point(place.position)
        if room.is_outside(place.position) or room.is_far_from(place.position):
            advice = "move it into the room; expected [x, y] in metres"
            yield Finding("place outside", where, f"is outside the room, at {point}", advice, (place.position,))
        distances = wall_distances(np.array([place.position]), room.walls)[0]
        nearest = int(distances.argmin())
        if distances[nearest] < _IN_WALL:
            text = f"is {_millimetres(distances[nearest])} from wall {room.names[nearest]!r}, at {point}"
            yield Finding("place in wall", where, text, "move it away from the wall", (place.position,))
        chain = object_around(room, place)
        if chain is not None:
            text = f"is inside {object_name(room, chain)}, at {point}"
            yield Finding("place in object", where, text, "move it out; expected [x, y] in metres", (place.position,))


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


# Why a predicted scan has no echo at all.


def reason_for_silence(room: Room, place: Place, board: Board) -> str:
    """Return why `board` receives nothing at `place`: too far away, too near, or too faint."""
    nearest, farthest = _distances(room, place)
    if nearest > board.max_range:
        doubt = "; are the coordinates in centimetres or millimetres? expected metres"
        unit = doubt if max(extent(room)) > LARGE else ""
        return (
            f"the nearest wall is {nearest:.3g} m away, and board {board.name!r} reports at most "
            f"{board.max_range:g} m{unit}"
        )
    if farthest < board.blanked_range(room.air):
        return (
            f"the farthest wall is {farthest:.3g} m away, and board {board.name!r} detects nothing nearer than "
            f"{board.blanked_range(room.air):.3g} m (blanking)"
        )
    return (
        f"within {board.max_range:g} m, nothing is above the threshold of board {board.name!r} "
        f"({board.threshold_db:g} dB); try more headings, or check the reflectances and the threshold"
    )


def _distances(room: Room, place: Place) -> tuple[float, float]:
    """Return the distance from a place to the nearest point and to the farthest end of walls and posts, m."""
    position = np.array(place.position)
    near, to_posts = surface_distances(room, position), np.hypot(*(room.posts[:, :2] - position).T)
    far = np.concatenate((np.hypot(*(room.walls.reshape(-1, 2) - position).T), to_posts + room.posts[:, 2]))
    return float(near.min()), float(far.max())


# All findings in a room: its plan, its materials, and places from which nothing is heard.


_STEP_DEG = 5.0  # from one heading to the next
_MOST_WALLS = 2000  # with more, no scan is predicted: it would take minutes


def check_room(room: Room, board: Board) -> list[Finding]:
    """Return everything that is probably wrong in a room, if it is scanned with `board`."""
    findings = [*plan_findings(room), *_guessed_levels(room, board)]
    return [*findings, *_unused_materials(room), *_silent_places(room, board)]


def refusals_of(text: str, where: str) -> list[str]:
    """Return a line for each error in the text of a room file; empty if it can be used. Raises InputError."""
    return problems_of(parse_table(text, where), RoomFile)


def _guessed_levels(room: Room, board: Board) -> Iterator[Finding]:
    """Yield the walls that are nearer to each other than rays resolve, and are not solved by the wave."""
    wavelength = board.wavelength(room.air)
    sound = f"for sound of {_millimetres(wavelength)}"
    for cluster in clusters_of(room, wavelength):
        middle = _middle(room, cluster.walls[0])
        several, at = len(cluster.walls) > 1, f"at {_point(middle)}"
        if not cluster.solvable:
            text = f"{'have' if several else 'has'} edges too near to others {sound}, {at}"
            advice = "the levels of their echoes are guesses, at most those of a plate as wide"
        elif coupled := coupled_to(cluster, room, wavelength):
            other = f"{'post' if coupled[0] >= len(room.walls) else 'wall'} {room.names[coupled[0]]!r}"
            text = f"{'are' if several else 'is'} too near to {other} {sound}, {at}"
            advice = "sound that goes to it and back is left out, so the levels of their echoes are guesses"
        else:
            continue
        yield Finding("guessed level", _walls(room, cluster.walls), text, advice, (middle,))
    gaps = [point for finding in _gaps(room) for point in finding.at]
    for slit in slits_of(room, wavelength):
        if not _is_heard(room, slit.walls) or any(math.dist(point, slit.middle) < _NEAR for point in gaps):
            continue
        where = " and ".join(repr(room.names[row]) for row in slit.walls)
        text = f"have a slit too narrow {sound}, at {_point(slit.middle)}"
        advice = "the levels of sound through it and from its edges are guesses"
        yield Finding("guessed level", f"walls {where}", text, advice, (_pair(slit.middle),))


def _is_heard(room: Room, walls: Sequence[int]) -> bool:
    """Return whether all these walls are in the plan of a place."""
    low, high = room.heights[list(walls), 0].max(), room.heights[list(walls), 1].min()
    heights = [place.height for place in room.places.values()]
    return not heights or any(height is None or low <= height <= high for height in heights)


def _walls(room: Room, rows: Sequence[int]) -> str:
    names = [room.names[row] for row in rows]
    return f"wall {names[0]!r}" if len(names) == 1 else f"walls {names[0]!r} to {names[-1]!r}"


def _unused_materials(room: Room) -> Iterator[Finding]:
    for name in materials(room):
        if name not in room.materials:
            text = "no wall, post, floor or ceiling has it"
            yield Finding("unused material", f"material {name!r}", text, "use it, or remove it")


def _silent_places(room: Room, board: Board) -> Iterator[Finding]:
    """Yield the places at which the board detects nothing in a whole turn, or that have no prediction.

    Places outside the room or in an object are left out: they have a finding, and in a closed box a search of paths can
    take minutes.
    """
    if len(room.walls) > _MOST_WALLS:
        return
    for place in room.places.values():
        if room.is_outside(place.position) or object_around(room, place) is not None:
            continue
        where = f"place {place.name!r}"
        headings = np.arange(0, math.tau, math.radians(_STEP_DEG)) if board.ring is None else board.ring.headings(place)
        try:
            ranges = predict_readings(room, place, board, headings).ranges
        except InputError as error:
            # the advice after the semicolon is about options that a check does not have
            text = f"its echoes cannot be predicted: {str(error).partition(';')[0]}"
            advice = "check whether surfaces enclose it, the reflectances, and the number of surfaces"
            yield Finding("no prediction", where, text, advice, (place.position,))
            continue
        if np.isnan(ranges).all():
            text = f"nothing is heard here: {reason_for_silence(room, place, board)}"
            advice = "move the place, or use another board"
            yield Finding("silence", where, text, advice, (place.position,))
