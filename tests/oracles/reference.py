"""The paper's `range(θ, x, y)`, readable next to appendix A of CIM-92-9: the reference for the fast prediction.

Plain Python, one ray at a time, without images or sequences. Rays leave in steps of δ. Their next intersections are on
a heap sorted by travelled distance. The nearest is taken, tested at the receiver, reflected, and near the end of a
segment diffracted straight to the receiver.

Where appendix A leaves a choice: the search stops at a path of twice the maximum range and returns None. The receiver
is a segment across the heading, half a spacing of the ray's tube to each side. A diffracted leg needs a free line of
sight. Undetected sound at the transducer passes (`Unit.PASS`), ends (`Unit.BLOCK`), or is reflected by its face, which
is as wide as the aperture (`Unit.REFLECT`, as printed).
"""

import heapq
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from sonarhw_sim.air import Unit
from sonarhw_sim.board.beam import beam_gain
from sonarhw_sim.board.profile import BODY_REFLECTANCE, ON_AXIS, Board, uncompensated_db, with_faces
from sonarhw_sim.room.edges import inside_wedge
from sonarhw_sim.room.room import Place, Room

from tests.oracles.one_heading import FIRST_RAY, RAY_SPACING

_NOTHING = -1
_RECEIVER = -2


@dataclass(frozen=True)
class Ray:
    """Position and state of a ray."""

    x: float
    y: float
    direction: float  # rad
    travelled: float = 0.0  # m
    amplitude: float = 1.0
    width: float = 0.0  # m per radian of departure: distance from its neighbour
    opening: float = 1.0  # growth of that width per metre
    last: int = _NOTHING  # the surface it leaves

    @property
    def spread(self) -> float:
        """Amplitude factor of posts on the path, which widen the tube more than the ideal gain compensates."""
        return math.sqrt(self.travelled / self.width) if self.width else 1.0

    def at(self, distance: float) -> "Ray":
        """Return the ray `distance` m farther on."""
        return replace(
            self,
            x=self.x + distance * math.cos(self.direction),
            y=self.y + distance * math.sin(self.direction),
            travelled=self.travelled + distance,
            width=self.width + self.opening * distance,
        )


@dataclass(frozen=True)
class Arrival:
    """A ray at the next surface, or at the receiver."""

    ray: Ray
    surface: int  # _RECEIVER for the transducer's own segment


@dataclass(frozen=True)
class _Setting:
    room: Room
    place: Place
    board: Board
    heading: float
    unit: Unit
    spacing: float
    face: int = _NOTHING  # number of the transducer's own face, if it reflects

    def beam(self, direction: float) -> float:
        """Return the amplitude by angle from the axis, one way."""
        ka = self.board.wavenumber(self.room.air) * self.board.aperture_radius
        return float(beam_gain(np.array(direction - self.heading), ka))

    def over_threshold(self, ray: Ray, arriving: float = 1.0) -> bool:
        """Return whether a ray is loud enough, with a factor `arriving` at the receiver."""
        loss = float(uncompensated_db(np.array(ray.travelled), self.board, self.room.air))
        return ray.amplitude * ray.spread * arriving > 10 ** ((self.board.threshold_db + loss) / 20)


def range_at(
    room: Room, place: Place, board: Board, heading: float, unit: Unit = Unit.PASS, spacing: float = RAY_SPACING
) -> float | None:
    """Return the range (m) of appendix A at `heading` (rad in the room), not rounded; None: no echo.

    It agrees with the fast prediction within the ray spacing, except at the headings described in model.md (a path near
    the threshold, the end of a segment, blanking or the maximum range).
    """
    setting = _Setting(room, place, board, heading, unit, spacing)
    if unit is Unit.REFLECT:
        faced = with_faces(room, [ON_AXIS.pose(place, heading)], board.aperture_radius, BODY_REFLECTANCE)
        setting = replace(setting, room=faced, face=len(room.walls))
    heap: list[tuple[float, int, Arrival]] = []
    count = 0

    def push(arrivals: Iterator[Arrival]) -> None:
        nonlocal count
        for arrival in arrivals:
            count += 1  # breaks ties, so that arrivals are never compared
            heapq.heappush(heap, (arrival.ray.travelled, count, arrival))

    # rays at departure, each with the loss at its angle
    for ray in _fan(setting):
        push(_next_arrivals(setting, ray))

    while heap:
        # the intersection that sound reaches first
        travelled, _, arrival = heapq.heappop(heap)
        if travelled > 2 * board.max_range:
            return None

        # at the receiver: detected, or past it
        if arrival.surface == _RECEIVER:
            if _is_detected(setting, arrival.ray):
                return travelled / 2
            if unit is Unit.PASS:
                push(_next_arrivals(setting, arrival.ray, past_receiver=True))
            if unit is Unit.REFLECT:
                push(_next_arrivals(setting, _reflected(setting, _at_face(setting, arrival.ray))))
            continue

        # at a wall: reflect, and diffract near its end
        push(_diffractions(setting, arrival))
        push(_next_arrivals(setting, _reflected(setting, arrival)))
    return None


def _fan(setting: _Setting) -> Iterator[Ray]:
    for k in range(round(math.pi / setting.spacing)):
        direction = setting.heading - math.pi / 2 + (k + FIRST_RAY) * setting.spacing
        ray = Ray(*setting.place.position, direction, amplitude=setting.beam(direction), last=setting.face)
        if setting.over_threshold(ray):
            yield ray


def _is_detected(setting: _Setting, ray: Ray) -> bool:
    if ray.travelled / 2 < setting.board.blanked_range(setting.room.air):
        return False
    return setting.over_threshold(ray, setting.beam(ray.direction + math.pi))


def _at_face(setting: _Setting, ray: Ray) -> Arrival:
    """Return a ray in the receiver's tube, moved forward or back to the plane of the face."""
    x, y = setting.place.position
    ahead = (x - ray.x) * math.cos(setting.heading) + (y - ray.y) * math.sin(setting.heading)
    return Arrival(ray.at(ahead / math.cos(ray.direction - setting.heading)), setting.face)


def _next_arrivals(setting: _Setting, ray: Ray, *, past_receiver: bool = False) -> Iterator[Arrival]:
    """Yield the next arrival of a ray: at a surface, or at the receiver before it."""
    if not setting.over_threshold(ray):
        return
    distance, surface = _first_intersection(setting.room, ray)
    at_receiver = past_receiver or ray.travelled == 0 or (ray.last == setting.face != _NOTHING)
    receiver = None if at_receiver else _meets_receiver(setting, ray)
    # the receiver is on its face, which an oblique ray may meet a little earlier
    if receiver is not None and (receiver < distance or surface == setting.face):
        yield Arrival(ray.at(receiver), _RECEIVER)
    elif surface != _NOTHING:
        yield Arrival(ray.at(distance), surface)


def _meets_receiver(setting: _Setting, ray: Ray) -> float | None:
    """Return the distance (m) along a ray to the receiver; None if it misses."""
    dx, dy = math.cos(ray.direction), math.sin(ray.direction)
    tx, ty = setting.place.position[0] - ray.x, setting.place.position[1] - ray.y
    ahead = tx * dx + ty * dy
    aside = abs(tx * dy - ty * dx)
    tube = setting.spacing / 2 * (ray.width + ray.opening * ahead)
    return ahead if ahead > 0 and aside <= tube else None


def _first_intersection(room: Room, ray: Ray) -> tuple[float, int]:
    dx, dy = math.cos(ray.direction), math.sin(ray.direction)
    nearest, surface = math.inf, _NOTHING
    for k, (x0, y0, x1, y1) in enumerate(room.walls.tolist()):
        ex, ey = x1 - x0, y1 - y0
        across = dx * ey - dy * ex
        if k == ray.last or across == 0:
            continue
        distance = ((x0 - ray.x) * ey - (y0 - ray.y) * ex) / across
        along = ((x0 - ray.x) * dy - (y0 - ray.y) * dx) / across
        if 0 <= along <= 1 and 1e-11 < distance < nearest:
            nearest, surface = distance, k
    for k, (cx, cy, radius) in enumerate(room.posts.tolist(), start=len(room.walls)):
        towards = (cx - ray.x) * dx + (cy - ray.y) * dy
        aside = (cx - ray.x) * dy - (cy - ray.y) * dx
        if k == ray.last or towards <= 0 or abs(aside) >= radius:
            continue
        distance = towards - math.sqrt(radius**2 - aside**2)
        if 0 < distance < nearest:
            nearest, surface = distance, k
    return nearest, surface


def _reflected(setting: _Setting, arrival: Arrival) -> Ray:
    room, ray = setting.room, arrival.ray
    if arrival.surface < len(room.walls):
        x0, y0, x1, y1 = room.walls[arrival.surface]
        direction = 2 * math.atan2(y1 - y0, x1 - x0) - ray.direction
        opening = ray.opening
    else:
        cx, cy, radius = room.posts[arrival.surface - len(room.walls)]
        normal = math.atan2(ray.y - cy, ray.x - cx)
        direction = 2 * normal + math.pi - ray.direction
        opening = ray.opening + 2 * ray.width / (radius * math.cos(direction - normal))
    return replace(
        ray,
        direction=direction,
        opening=opening,
        amplitude=ray.amplitude * float(room.reflectances[arrival.surface]),
        last=arrival.surface,
    )


def _diffractions(setting: _Setting, arrival: Arrival) -> Iterator[Arrival]:
    """Yield sound diffracted straight to the receiver by edges within one ray spacing of the point on a wall."""
    room, ray = setting.room, arrival.ray
    near = setting.spacing * ray.width
    dx, dy = math.cos(ray.direction), math.sin(ray.direction)
    px, py = setting.place.position
    for k in range(len(room.edges)):
        x, y = room.edges.points[k].tolist()
        if abs((x - ray.x) * dy - (y - ray.y) * dx) > near or not _lies_on(room, arrival.surface, (x, y)):
            continue
        home, back = math.atan2(py - y, px - x), ray.direction + math.pi
        if not inside_wedge(np.array([home, back]), room.edges.starts[k], room.edges.openings[k]).all():
            continue
        leg = math.hypot(px - x, py - y)
        if not _in_sight(room, (x, y), (px, py)):
            continue
        loss = ray.spread * _edge_loss(setting, ray.travelled, leg)
        # sound from the edge spreads as from a source at the travelled distance behind it
        leaving = Ray(x, y, home, ray.travelled, ray.amplitude * loss, width=ray.travelled)
        yield Arrival(leaving.at(leg), _RECEIVER)


def _lies_on(room: Room, surface: int, point: tuple[float, float]) -> bool:
    if surface >= len(room.walls):
        return False
    x0, y0, x1, y1 = room.walls[surface].tolist()
    return math.dist((x0, y0), point) + math.dist(point, (x1, y1)) - math.dist((x0, y0), (x1, y1)) < 1e-9


def _edge_loss(setting: _Setting, before: float, after: float) -> float:
    z = 2 * before * after / (before + after)
    return min(1.0, 1 / (math.tau * math.sqrt(z / setting.board.wavelength(setting.room.air))))


def _in_sight(room: Room, start: tuple[float, float], end: tuple[float, float]) -> bool:
    distance = math.dist(start, end)
    direction = math.atan2(end[1] - start[1], end[0] - start[0])
    # start beside the edge, otherwise its own walls block
    ray = Ray(*start, direction).at(1e-6 * distance)
    return _first_intersection(room, ray)[0] > distance * (1 - 2e-6)
