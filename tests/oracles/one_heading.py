"""One heading at a time: the paper's `range(θ, x, y)`, compiled for whoever asks for them by the thousand.

Takes a room, a place, a board and a heading; returns what `oracles.reference` does, ray for ray (CIM-92-9, appendix A).
The paper keeps all rays on a heap and stops at the first that is heard. Rays know nothing of each other, so here they
are followed one after the other, from the axis outwards, and none farther than could still come home before the nearest
echo so far: the same answer without a heap. A whole scan from one place is had sooner, and exactly, from
`sonarhw_sim.predict.prediction`.
"""

import math
from typing import NamedTuple

import numpy as np
from sonarhw_sim.board.gain import NEAREST, uncompensated_db
from sonarhw_sim.board.profile import Board
from sonarhw_sim.board.weighing import beam, beam_table
from sonarhw_sim.compiled import compiled
from sonarhw_sim.rays.kernel import first_among, reflect
from sonarhw_sim.rays.sequences import leg_is_free
from sonarhw_sim.room.grid import Cells, IntArray, Listing, Surfaces
from sonarhw_sim.room.model import Place, Room

from sonarhw.readings import FloatArray

RAY_SPACING = math.radians(0.25)
FIRST_RAY = 0.382  # of a spacing: off the round angles, on which rays of a tidy room would run into its vertices
_NOTHING = -1


class _Ray(NamedTuple):
    """A ray on its way: where it is, and what has become of it so far."""

    x: float  # m
    y: float
    dx: float  # unit vector
    dy: float
    travelled: float  # m
    amplitude: float
    width: float  # m per radian of departure: how far from its neighbour
    opening: float  # growth of that width per metre
    last: int  # the surface it leaves


class _Stand(NamedTuple):
    """Where the transducer is and points."""

    x: float  # m
    y: float
    heading: float  # rad
    axis_x: float
    axis_y: float


class _Limits(NamedTuple):
    """What bounds a search."""

    blanked: float  # m of path
    longest: float  # m of path
    threshold: float  # amplitude
    decay: float  # 1/m, of what air takes and the gain does not give back
    spreads: bool  # whether the gain gives back nothing, and so spreading counts, from a way of 1 m on
    wavelength: float  # m
    spacing: float  # rad
    passes: bool  # whether sound that meets the transducer unheard goes on
    ka: float


def range_at(
    room: Room, place: Place, board: Board, heading: float, *, blocking: bool = False, spacing: float = RAY_SPACING
) -> float | None:
    """The range (m) that appendix A finds at `heading` (rad in the room), before rounding; None: no echo.

    Sound that meets the transducer unheard passes, or ends where it is `blocking`.
    """
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
        not blocking,
        ka,
    )
    stand = _Stand(*place.position, heading, math.cos(heading), math.sin(heading))
    wedges = np.column_stack((room.edges.points, room.edges.starts, room.edges.openings))
    travelled = _first_heard(
        stand, limits, beam_table(ka), room.surfaces, room.reflectances, wedges, room.edges_on_walls
    )
    return None if math.isinf(travelled) else travelled / 2


@compiled
def _first_heard(
    stand: _Stand,
    limits: _Limits,
    table: FloatArray,
    surfaces: Surfaces,
    reflectances: FloatArray,
    wedges: FloatArray,
    edges_on_walls: Listing,
) -> float:
    """How far the first sound heard has travelled, m; inf where none is."""
    # taking arrays out of tuples costs as much as meeting a wall: once, here
    walls, posts, cells, (starts, numbers) = surfaces
    on_wall, edges = edges_on_walls
    nearest, count = np.inf, round(math.pi / limits.spacing)
    bent = [_outgoing(stand, stand.heading, limits, table) for _ in range(0)]
    for k in range(count):
        # from the axis outwards, to either side in turn
        number = count // 2 + (k // 2 if k % 2 == 0 else -1 - k // 2)
        direction = stand.heading - math.pi / 2 + (number + FIRST_RAY) * limits.spacing
        bent.append(_outgoing(stand, direction, limits, table))
        while len(bent) > 0:
            nearest = _follow(
                bent.pop(),
                nearest,
                stand,
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
                bent,
            )
    return nearest


@compiled
def _outgoing(stand: _Stand, direction: float, limits: _Limits, table: FloatArray) -> _Ray:
    """A ray as it leaves, with the loss at its angle."""
    dx, dy = math.cos(direction), math.sin(direction)
    leaving = beam(dx * stand.axis_x + dy * stand.axis_y, limits.ka, table)
    return _Ray(stand.x, stand.y, dx, dy, 0.0, leaving, 0.0, 1.0, _NOTHING)


@compiled
def _follow(
    ray: _Ray,
    nearest: float,
    stand: _Stand,
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
    bent: list[_Ray],
) -> float:
    """Follow a ray from the transducer until it is heard, too faint, or farther than `nearest`; the nearest echo now.

    What edges bend of it to the receiver unheard goes on from there: it is added to `bent`.
    """
    at_receiver = True
    while _is_over_threshold(ray, 1.0, limits):
        # the next thing it meets
        distance, surface = first_among(ray.x, ray.y, ray.dx, ray.dy, ray.last, walls, posts, cells, starts, numbers)
        to_receiver = np.inf if at_receiver else _to_receiver(ray, stand, limits.spacing)
        at_receiver = to_receiver < distance
        ray = _moved(ray, min(distance, to_receiver))
        # no way home is shorter than the straight one, but for the receiver's own length
        home = math.hypot(stand.x - ray.x, stand.y - ray.y)
        home -= limits.spacing * (ray.width + ray.opening * home)
        if ray.travelled + max(home, 0.0) > min(nearest, limits.longest):
            break

        # at the receiver: heard, or gone on its way
        if at_receiver:
            if _is_heard(ray, stand, limits, table):
                return ray.travelled
            if not limits.passes:
                break
            continue

        # at a wall: near its end diffract, and reflect besides
        if surface < walls.shape[0]:
            for edge in edges[on_wall[surface] : on_wall[surface + 1]]:
                arrived = _bent(ray, wedges[edge], stand, limits)
                if arrived.amplitude == 0.0 or arrived.travelled > min(nearest, limits.longest):
                    continue
                if not leg_is_free(wedges[edge, :2], np.array((stand.x, stand.y)), surfaces):
                    continue
                if _is_heard(arrived, stand, limits, table):
                    nearest = arrived.travelled
                elif limits.passes:
                    bent.append(arrived)
        ray = _reflected(ray, surface, reflectances[surface], walls, posts)
    return nearest


@compiled
def _is_heard(ray: _Ray, stand: _Stand, limits: _Limits, table: FloatArray) -> bool:
    arriving = beam(-ray.dx * stand.axis_x - ray.dy * stand.axis_y, limits.ka, table)
    return ray.travelled >= limits.blanked and _is_over_threshold(ray, arriving, limits)


@compiled
def _moved(ray: _Ray, distance: float) -> _Ray:
    """The ray `distance` m further on."""
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
def _to_receiver(ray: _Ray, stand: _Stand, spacing: float) -> float:
    """Distance along a ray to the receiver, which is as long as the ray's tube is wide; inf where it misses."""
    tx, ty = stand.x - ray.x, stand.y - ray.y
    ahead, aside = tx * ray.dx + ty * ray.dy, abs(tx * ray.dy - ty * ray.dx)
    meets = ahead > 0.0 and aside <= spacing / 2 * (ray.width + ray.opening * ahead)
    return ahead if meets else np.inf


@compiled
def _bent(ray: _Ray, wedge: FloatArray, stand: _Stand, limits: _Limits) -> _Ray:
    """What an edge within one spacing of a ray bends of it, at the receiver; of no amplitude where it bends nothing.

    `wedge` (4,): x and y of the edge, direction of its first face and opening.
    """
    edge_x, edge_y, first, opening = wedge
    aside = abs((edge_x - ray.x) * ray.dy - (edge_y - ray.y) * ray.dx)
    homeward, back = math.atan2(stand.y - edge_y, stand.x - edge_x), math.atan2(-ray.dy, -ray.dx)
    leg = math.hypot(stand.x - edge_x, stand.y - edge_y)
    bends = aside <= limits.spacing * ray.width and _inside(homeward, first, opening) and _inside(back, first, opening)
    z = 2 * ray.travelled * leg / (ray.travelled + leg)
    factor = min(1.0, 1 / (math.tau * math.sqrt(z / limits.wavelength))) * math.sqrt(ray.travelled / ray.width)
    amplitude = ray.amplitude * factor if bends else 0.0
    # what leaves the edge spreads as if from a source as far behind it as sound has travelled
    dx, dy = math.cos(homeward), math.sin(homeward)
    return _moved(_Ray(edge_x, edge_y, dx, dy, ray.travelled, amplitude, ray.travelled, 1.0, _NOTHING), leg)


@compiled
def _inside(direction: float, first: float, opening: float) -> bool:
    turned = (direction - first) % math.tau
    # along a face sound grazes past and is not bent
    return 1e-9 < turned < opening - 1e-9
