"""The paper's `range(θ, x, y)` for one heading (CIM-92-9, appendix A), compiled for tests that need thousands.

One ray at a time, without images or sequences. Rays leave in steps of δ. Each is tested at the receiver, reflected, and
near the end of a segment diffracted straight to the receiver. The paper keeps all rays on a heap and stops at the first
that is detected. Rays are independent, so here they are followed one after the other, from the axis outwards, and no
farther than they could return before the nearest echo so far. The result is the same without a heap. A whole scan from
one place is faster, and exact, with `sonarhw_sim.predict.prediction`.

Where appendix A leaves a choice: the search stops at a path of twice the maximum range and returns None. The receiver
is a segment across the heading, half a spacing of the ray's tube to each side. A diffracted leg needs a free line of
sight. Undetected sound at the transducer passes (`Unit.PASS`), ends (`Unit.BLOCK`), or is reflected by its face, which
is as wide as the aperture (`Unit.REFLECT`, as printed).
"""

import math
from typing import NamedTuple

import numpy as np
from sonarhw_sim.air import Unit
from sonarhw_sim.board.beam import beam, beam_table
from sonarhw_sim.board.profile import BODY_REFLECTANCE, NEAREST, ON_AXIS, Board, uncompensated_db, with_faces
from sonarhw_sim.compiled import compiled
from sonarhw_sim.rays.fan import first_among, reflect
from sonarhw_sim.rays.sequences import leg_is_free
from sonarhw_sim.room.grid import Cells, IntArray, Listing, Surfaces
from sonarhw_sim.room.room import Place, Room

from sonarhw.readings import FloatArray

RAY_SPACING = math.radians(0.25)
FIRST_RAY = 0.382  # of a spacing: not a round angle, at which rays in a regular room would meet its vertices
_NOTHING = -1


class _Ray(NamedTuple):
    """Position and state of a ray."""

    x: float  # m
    y: float
    dx: float  # unit vector
    dy: float
    travelled: float  # m
    amplitude: float
    width: float  # m per radian of departure: distance from its neighbour
    opening: float  # growth of that width per metre
    last: int  # the surface it leaves


class _Pose(NamedTuple):
    """Position and direction of the transducer."""

    x: float  # m
    y: float
    heading: float  # rad
    axis_x: float
    axis_y: float


class _Limits(NamedTuple):
    """Limits of a search."""

    blanked: float  # m of path
    longest: float  # m of path
    threshold: float  # amplitude
    decay: float  # 1/m, of absorption that the gain does not compensate
    spreads: bool  # whether the gain is fixed, so that spreading counts, relative to a path of 1 m
    wavelength: float  # m
    spacing: float  # rad
    passes: bool  # whether undetected sound passes the transducer
    ka: float
    face: int  # number of the transducer's own face among the walls, if it reflects


def range_at(
    room: Room, place: Place, board: Board, heading: float, *, unit: Unit = Unit.PASS, spacing: float = RAY_SPACING
) -> float | None:
    """Return the range (m) of appendix A at `heading` (rad in the room), before rounding; None: no echo."""
    face = len(room.walls) if unit is Unit.REFLECT else _NOTHING
    if unit is Unit.REFLECT:
        room = with_faces(room, [ON_AXIS.pose(place, heading)], board.aperture_radius, BODY_REFLECTANCE)
    ka = board.wavenumber(room.air) * board.aperture_radius
    at_1_m, at_2_m = uncompensated_db(np.array([1.0, 2.0]), board, room.air).tolist()
    per_metre = at_2_m - at_1_m - 20 * math.log10(2.0) if board.fixed_gain else at_1_m
    limits = _Limits(
        2 * board.blanked_range(room.air),
        2 * board.max_range,
        10 ** ((board.threshold_db + at_1_m - per_metre) / 20),
        math.log(10) / 20 * per_metre,
        board.fixed_gain,
        board.wavelength(room.air),
        spacing,
        unit is Unit.PASS,
        ka,
        face,
    )
    pose = _Pose(*place.position, heading, math.cos(heading), math.sin(heading))
    wedges = np.column_stack((room.edges.points, room.edges.starts, room.edges.openings))
    travelled = _first_detected(
        pose, limits, beam_table(ka), room.surfaces, room.reflectances, wedges, room.edges_on_walls
    )
    return None if math.isinf(travelled) else travelled / 2


@compiled
def _first_detected(
    pose: _Pose,
    limits: _Limits,
    table: FloatArray,
    surfaces: Surfaces,
    reflectances: FloatArray,
    wedges: FloatArray,
    edges_on_walls: Listing,
) -> float:
    """Return the length of the first detected path, m; inf if there is none."""
    # unpacking arrays from tuples costs as much as the test of a wall, so it is done once
    walls, posts, cells, (starts, numbers) = surfaces
    on_wall, edges = edges_on_walls
    nearest, count = np.inf, round(math.pi / limits.spacing)
    diffracted = [_outgoing(pose, pose.heading, limits, table) for _ in range(0)]
    for k in range(count):
        # from the axis outwards, to either side in turn
        number = count // 2 + (k // 2 if k % 2 == 0 else -1 - k // 2)
        direction = pose.heading - math.pi / 2 + (number + FIRST_RAY) * limits.spacing
        diffracted.append(_outgoing(pose, direction, limits, table))
        while len(diffracted) > 0:
            nearest = _follow(
                diffracted.pop(),
                nearest,
                pose,
                limits,
                table,
                walls,
                posts,
                cells,
                starts,
                numbers,
                reflectances,
                wedges,
                on_wall,
                edges,
                surfaces,
                diffracted,
            )
    return nearest


@compiled
def _outgoing(pose: _Pose, direction: float, limits: _Limits, table: FloatArray) -> _Ray:
    """Return a ray at departure, with the loss at its angle."""
    dx, dy = math.cos(direction), math.sin(direction)
    leaving = beam(dx * pose.axis_x + dy * pose.axis_y, limits.ka, table)
    return _Ray(pose.x, pose.y, dx, dy, 0.0, leaving, 0.0, 1.0, limits.face)


@compiled
def _follow(
    ray: _Ray,
    nearest: float,
    pose: _Pose,
    limits: _Limits,
    table: FloatArray,
    walls: FloatArray,
    posts: FloatArray,
    cells: Cells,
    starts: IntArray,
    numbers: IntArray,
    reflectances: FloatArray,
    wedges: FloatArray,
    on_wall: IntArray,
    edges: IntArray,
    surfaces: Surfaces,
    diffracted: list[_Ray],
) -> float:
    """Follow a ray until it is detected, too faint, or farther than `nearest`; return the nearest echo so far.

    Sound that edges diffract to the receiver but that is not detected continues there: it is added to `diffracted`.
    """
    at_receiver = True
    while _is_over_threshold(ray, 1.0, limits):
        # the next surface, or the receiver
        distance, surface = first_among(ray.x, ray.y, ray.dx, ray.dy, ray.last, walls, posts, cells, starts, numbers)
        to_receiver = np.inf if at_receiver else _to_receiver(ray, pose, limits.spacing)
        # the receiver is on its face, which an oblique ray may meet a little earlier
        on_face = surface == limits.face and surface != _NOTHING
        at_receiver = to_receiver < np.inf if on_face else to_receiver < distance
        ray = _moved(ray, to_receiver if at_receiver else distance)
        # no path back is shorter than the straight line, except for the length of the receiver
        home = math.hypot(pose.x - ray.x, pose.y - ray.y)
        home -= limits.spacing * (ray.width + ray.opening * home)
        if ray.travelled + max(home, 0.0) > min(nearest, limits.longest):
            break

        # at the receiver: detected, or past it
        if at_receiver:
            if _is_detected(ray, pose, limits, table):
                return ray.travelled
            if limits.face != _NOTHING:
                ray = _reflected_by_face(ray, pose, limits.face, reflectances, walls, posts)
            elif not limits.passes:
                break
            continue

        # at a wall: diffract near its end, and reflect
        if surface < walls.shape[0]:
            for edge in edges[on_wall[surface] : on_wall[surface + 1]]:
                arrived = _diffracted(ray, wedges[edge], pose, limits)
                if arrived.amplitude == 0.0 or arrived.travelled > min(nearest, limits.longest):
                    continue
                if not leg_is_free(wedges[edge, :2], np.array((pose.x, pose.y)), surfaces):
                    continue
                if _is_detected(arrived, pose, limits, table):
                    nearest = arrived.travelled
                elif limits.face != _NOTHING:
                    diffracted.append(_reflected_by_face(arrived, pose, limits.face, reflectances, walls, posts))
                elif limits.passes:
                    diffracted.append(arrived)
        ray = _reflected(ray, surface, reflectances[surface], walls, posts)
        at_receiver = on_face
    return nearest


@compiled
def _reflected_by_face(
    ray: _Ray, pose: _Pose, face: int, reflectances: FloatArray, walls: FloatArray, posts: FloatArray
) -> _Ray:
    """Return a ray in the receiver's tube, moved forward or back to the plane of the face and reflected there."""
    ahead = (pose.x - ray.x) * pose.axis_x + (pose.y - ray.y) * pose.axis_y
    at_face = _moved(ray, ahead / (ray.dx * pose.axis_x + ray.dy * pose.axis_y))
    return _reflected(at_face, face, reflectances[face], walls, posts)


@compiled
def _is_detected(ray: _Ray, pose: _Pose, limits: _Limits, table: FloatArray) -> bool:
    arriving = beam(-ray.dx * pose.axis_x - ray.dy * pose.axis_y, limits.ka, table)
    return ray.travelled >= limits.blanked and _is_over_threshold(ray, arriving, limits)


@compiled
def _moved(ray: _Ray, distance: float) -> _Ray:
    """Return the ray `distance` m farther on."""
    x, y, dx, dy, travelled, amplitude, width, opening, last = ray
    x, y, travelled, width = x + distance * dx, y + distance * dy, travelled + distance, width + opening * distance
    return _Ray(x, y, dx, dy, travelled, amplitude, width, opening, last)


@compiled
def _is_over_threshold(ray: _Ray, arriving: float, limits: _Limits) -> bool:
    spread = math.sqrt(ray.travelled / ray.width) if ray.width > 0.0 else 1.0
    loss = math.exp(-limits.decay * ray.travelled) if limits.decay != 0.0 else 1.0
    if limits.spreads:
        loss /= max(ray.travelled, NEAREST)
    over: bool = ray.amplitude * spread * loss * arriving > limits.threshold
    return over


@compiled
def _reflected(ray: _Ray, surface: int, reflectance: float, walls: FloatArray, posts: FloatArray) -> _Ray:
    dx, dy, curvature = reflect(ray.x, ray.y, ray.dx, ray.dy, surface, walls, posts)
    opening = ray.opening + curvature * ray.width
    return _Ray(ray.x, ray.y, dx, dy, ray.travelled, ray.amplitude * reflectance, ray.width, opening, surface)


@compiled
def _to_receiver(ray: _Ray, pose: _Pose, spacing: float) -> float:
    """Return the distance along a ray to the receiver, which is as wide as the ray's tube; inf if it misses."""
    tx, ty = pose.x - ray.x, pose.y - ray.y
    ahead, aside = tx * ray.dx + ty * ray.dy, abs(tx * ray.dy - ty * ray.dx)
    meets = ahead > 0.0 and aside <= spacing / 2 * (ray.width + ray.opening * ahead)
    return ahead if meets else np.inf


@compiled
def _diffracted(ray: _Ray, wedge: FloatArray, pose: _Pose, limits: _Limits) -> _Ray:
    """Return the ray that an edge within one spacing diffracts, at the receiver; with amplitude 0 if there is none.

    `wedge` (4,): x and y of the edge, direction of its first face and opening.
    """
    edge_x, edge_y, first, opening = wedge
    aside = abs((edge_x - ray.x) * ray.dy - (edge_y - ray.y) * ray.dx)
    homeward, back = math.atan2(pose.y - edge_y, pose.x - edge_x), math.atan2(-ray.dy, -ray.dx)
    leg = math.hypot(pose.x - edge_x, pose.y - edge_y)
    bends = aside <= limits.spacing * ray.width and _inside(homeward, first, opening) and _inside(back, first, opening)
    z = 2 * ray.travelled * leg / (ray.travelled + leg)
    factor = min(1.0, 1 / (math.tau * math.sqrt(z / limits.wavelength))) * math.sqrt(ray.travelled / ray.width)
    amplitude = ray.amplitude * factor if bends else 0.0
    # sound from the edge spreads as from a source at the travelled distance behind it
    dx, dy = math.cos(homeward), math.sin(homeward)
    return _moved(_Ray(edge_x, edge_y, dx, dy, ray.travelled, amplitude, ray.travelled, 1.0, _NOTHING), leg)


@compiled
def _inside(direction: float, first: float, opening: float) -> bool:
    turned = (direction - first) % math.tau
    # sound along a face is not diffracted
    return 1e-9 < turned < opening - 1e-9
