"""Edge diffraction: paths by one edge, the strength of a wedge, and of the two wedges of a narrow wall."""

import math
from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray
from sonarhw_sim.air import EdgeStrength
from sonarhw_sim.board.beam import ComplexArray, loudest_by_separation
from sonarhw_sim.compiled import compiled, compiled_part, rows_in_parts
from sonarhw_sim.rays import fan
from sonarhw_sim.rays.sequences import FEWEST_POINTS, PartialPaths, surfaces_and_points
from sonarhw_sim.room.edges import Edges, inside_wedge
from sonarhw_sim.room.grid import IntArray
from sonarhw_sim.room.room import Room

# diffraction at a hard wedge by the uniform theory of Kouyoumjian and Pathak (1974); time dependence e^{+jωt}


_NODES_PER_UNIT = 32
_STEPS = 32  # from one node to the next
_SERIES_FROM = 6.0  # above, the asymptotic series of f and g has an error below 1e-8
_AT_BOUNDARY = 1e-7  # rad; a wall may be touched 1 nm beyond its end, so here the ray counts as present


@cache
def fresnel_table() -> ComplexArray:
    """Return f + j g and its slope at z = 0, 1/32, 2/32, ..., 6, (n, 2) complex.

    f and g are the auxiliary functions of the Fresnel integrals (Abramowitz and Stegun, 7.3.5 and 7.3.6).
    """
    # w = f + j g solves w′ = j (π z w - 1): from the series at the far end back to 0, by the method of Runge and Kutta.
    # scipy.special, which has these functions too, would delay the first prediction.
    z = np.arange(_SERIES_FROM * _NODES_PER_UNIT + 2) / _NODES_PER_UNIT
    values = [_series(float(z[-1]))]
    step = -1.0 / (_NODES_PER_UNIT * _STEPS)
    for node in range(len(z) - 1, 0, -1):
        position, w = float(z[node]), values[-1]
        for _ in range(_STEPS):
            half = math.pi * (position + step / 2)
            first = 1j * (math.pi * position * w - 1)
            second = 1j * (half * (w + step / 2 * first) - 1)
            third = 1j * (half * (w + step / 2 * second) - 1)
            position += step
            fourth = 1j * (math.pi * position * (w + step * third) - 1)
            w += step / 6 * (first + 2 * second + 2 * third + fourth)
        values.append(w)
    exact = np.array(values[::-1])
    slopes = 1j * (math.pi * z * exact - 1)
    table = np.column_stack((exact, slopes))
    table.flags.writeable = False
    return table


def _series(z: float) -> complex:
    inverse = 1.0 / (math.pi * z * z)
    f = 1.0 - 3.0 * inverse**2 + 105.0 * inverse**4
    return complex(f, (1.0 - 15.0 * inverse**2 + 945.0 * inverse**4) * inverse) / (math.pi * z)


@compiled
def _auxiliary(z: FloatArray, table: ComplexArray) -> ComplexArray:
    """Return f(z) + j g(z) for z (m,) from 0 on; the error is below 2e-8. `table` is that of `fresnel_table`."""
    results = np.empty(z.shape[0], np.complex128)
    for k in range(z.shape[0]):
        if z[k] >= _SERIES_FROM:
            inverse = 1.0 / (math.pi * z[k] ** 2)
            f, g = 1.0 - 3.0 * inverse**2 + 105.0 * inverse**4, (1.0 - 15.0 * inverse**2) * inverse
            results[k] = complex(f, g) / (math.pi * z[k])
            continue
        node = int(z[k] * _NODES_PER_UNIT)
        t = z[k] * _NODES_PER_UNIT - node
        values = (1.0 + 2.0 * t) * (1.0 - t) ** 2 * table[node, 0] + t**2 * (3.0 - 2.0 * t) * table[node + 1, 0]
        slopes = t * (1.0 - t) ** 2 * table[node, 1] + t**2 * (t - 1.0) * table[node + 1, 1]
        results[k] = values + slopes / _NODES_PER_UNIT
    return results


def transition(x: FloatArray) -> ComplexArray:
    """Return F(x) = 2j √x e^{jx} ∫ e^{-jt²} dt from √x to infinity, for x (m,) from 0 on, (m,)."""
    return np.asarray(np.sqrt(math.tau * x) * _auxiliary(np.sqrt(2.0 * x / math.pi), fresnel_table()))


def _turns(angle: FloatArray, n: FloatArray) -> FloatArray:
    """Return the number of turns of 2nπ nearest to an angle: it selects the image source whose boundary is nearest."""
    return np.floor(angle / (math.tau * n) + 0.5)


def _term(angle: FloatArray, n: FloatArray, scale: FloatArray) -> ComplexArray:
    """Return one of the four terms, (m,): -e^{-jπ/4} cot(angle/2n) F(kLa) / (2n √(2πkL)).

    F contains the factor √(kLa), which cancels: the term is ∓1/2 at its boundary. `scale` is 2 √(kL/π).
    """
    beyond = angle - math.tau * n * _turns(angle, n)
    at_boundary = np.abs(beyond) < _AT_BOUNDARY
    beyond = np.where(at_boundary, 1.0, beyond)
    aside = np.abs(np.sin(0.5 * beyond))
    size = -0.5 * aside / (n * np.tan(0.5 * beyond / n))
    return np.where(at_boundary, -0.5, size * (1.0 - 1.0j) * _auxiliary(scale * aside, fresnel_table()))


@compiled_part
def _most(angle: float, n: float, scale: float) -> float:
    """Return an upper bound of |`_term`| without trigonometry: |F| is at most 1, and |cot x| at most 1/|x|."""
    turns = math.floor(angle / (math.tau * n) + 0.5)
    beyond = abs(angle - math.tau * n * turns)
    return min(0.5, math.sqrt(2.0) / (math.pi * scale * max(beyond, 1e-12)))


@compiled
def most_by_wedge(angle: float, other: float, n: float, to_edge: float, from_edge: float, wavelength: float) -> float:
    """Return an upper bound of |`by_wedge`| for one path, many times faster."""
    scale = max(2.0 * math.sqrt(2.0 * to_edge * from_edge / max(to_edge + from_edge, 1e-300) / wavelength), 1e-6)
    difference, mirrored = angle - other, angle + other
    bound: float = (
        _most(math.pi + difference, n, scale)
        + _most(math.pi - difference, n, scale)
        + _most(math.pi + mirrored, n, scale)
        + _most(math.pi - mirrored, n, scale)
    )
    return bound


def by_wedge(
    angle: FloatArray,
    other: FloatArray,
    n: FloatArray,
    faces: FloatArray,
    to_edge: FloatArray,
    from_edge: FloatArray,
    wavelength: float | FloatArray,
) -> ComplexArray:
    """Return the amplitude of diffracted paths relative to reflected ones of their length from a perfect wall, (m,).

    `angle` and `other` (m,) are the angles (rad) of the two legs from the first face of a wedge of air of nπ, `faces`
    (m, 2) the reflectances of the first and the last face, `to_edge` and `from_edge` (m,) the lengths of the legs, m;
    the wavelength, m, is one or (m,).
    The reflectance of a face multiplies its reflection term. The shadow terms are 1 at the boundary of the shadow, and
    straight back (1 + ρ)/2 with the mean reflectance ρ of both faces. For n below 1, image sources of several
    reflections have boundaries too, and a term has the reflectances of the nearest one. The whole is at most as loud as
    the louder face, so an edge of two absorbers is silent.
    """
    # 2 √(kL/π) with the distance parameter L = s s′/(s + s′) of a cylindrical wave
    legs = to_edge * from_edge / np.maximum(to_edge + from_edge, 1e-300)
    scale = np.maximum(2.0 * np.sqrt(2.0 * legs / wavelength), 1e-6)
    difference, mirrored = angle - other, angle + other
    first, last = faces.T
    both = np.where(n < 1.0, first * last, 1.0)
    # an edge of impedance walls returns half of what a black one does, but has the same shadow
    of_shadow = 1.0 - 0.5 * np.cos(0.5 * difference) ** 2 * (1.0 - 0.5 * (first + last))
    total = (
        of_shadow * both ** np.abs(_turns(math.pi + difference, n)) * _term(math.pi + difference, n, scale)
        + of_shadow * both ** np.abs(_turns(math.pi - difference, n)) * _term(math.pi - difference, n, scale)
        + last * both ** np.maximum(_turns(math.pi + mirrored, n) - 1, 0) * _term(math.pi + mirrored, n, scale)
        + first * both ** np.abs(_turns(math.pi - mirrored, n)) * _term(math.pi - mirrored, n, scale)
    )
    loudest, size = np.maximum(first, last), np.abs(total)
    return np.asarray(total * np.minimum(1.0, loudest / np.maximum(size, 1e-300)))


# Sound that runs along a narrow wall from one end to the other, any number of times, before it leaves.
#
# Each end is a wedge and diffracts by the uniform theory. Along a hard face, half of the sound is incident on the
# next wedge and half is its reflection. A face with an impedance weakens it as flat ground weakens a wave between two
# points on it (Sommerfeld 1909): by 1 - F(kwβ²/2), with the width w, the admittance β of the face relative to that of
# air, and the transition function F. The sum over all passages is a geometric series of matrices.


WIDEST = 16.0  # wavelengths: the burst is as long, so sound that ran along a wall arrives during the echo of its end
_FLUSH = 1e-6  # rad and m

# The sound of a path to a narrow wall departs in four ways: from its own end or from the other one, along the side
# that is the first face of its own edge or along the last face.
_OWN_HALF = np.array([[1.0, 1.0, 0.5, 0.5]] * 2 + [[0.5, 0.5, 0.0, 0.0]] * 2)
_OTHER_END = np.eye(4)[[2, 3, 0, 1]]


class Arriving(NamedTuple):
    """Paths that arrive at edges, one row each."""

    edges: IntArray  # (m,): row of the edge
    angles: FloatArray  # (m,), rad from the first face of its wedge
    lengths: FloatArray  # (m,), m


class _Wedges(NamedTuple):
    """The edges of a room, one row each, and the wavelength."""

    openings: FloatArray  # (e,), rad
    faces: FloatArray  # (e, 2): reflectances
    wavelength: float  # m


class _Ends(NamedTuple):
    """Ends of narrow walls, one row each; the edge of a narrow solid is an end of two walls."""

    own: NDArray[np.intp]  # (w,): row of the edge
    other: NDArray[np.intp]  # (w,): row of the edge at the other end
    widths: FloatArray  # (w,), m
    sides: NDArray[np.bool_]  # (w, 2): whether the first and the last face of `own` are a side of the wall


def along_narrow_walls(
    halves: tuple[Arriving, Arriving],
    rows: tuple[NDArray[np.intp], NDArray[np.intp]],
    edges: Edges,
    faces: FloatArray,
    wavelength: float,
) -> ComplexArray:
    """Return the amplitude that narrow walls add to diffracted paths, as `by_wedge`, (m,).

    A path consists of one row of each of the `halves`; `rows` (m,) are these, at the same edge. `faces` (e, 2) are the
    reflectances of the faces of each edge. Sound that leaves from the other end than it came to belongs half to either
    end.
    """
    added = np.zeros(len(rows[0]), np.complex128)
    ends = _ends_of_narrow_walls(edges, WIDEST * wavelength)
    if not len(ends.own):
        return added
    wedges = _Wedges(edges.openings, faces, wavelength)
    path, end = _at_ends(halves[0].edges[rows[0]], ends)
    if len(path):
        first, second = rows[0][path], rows[1][path]
        if halves[0] is halves[1]:
            both = _departing(halves[0], np.append(first, second), np.tile(end, 2), ends, wedges)
            out, back = np.split(both, 2)
        else:
            out, back = (
                _departing(halves[0], first, end, ends, wedges),
                _departing(halves[1], second, end, ends, wedges),
            )
        exchange = _exchange(ends, wedges)[end] * _OWN_HALF
        np.add.at(added, path, np.einsum("mi,mij,mj->m", out, exchange, back))
    return np.asarray(added * np.sqrt(halves[0].lengths[rows[0]] + halves[1].lengths[rows[1]]))


def _ends_of_narrow_walls(edges: Edges, widest: float) -> _Ends:
    """Return the ends of walls up to `widest` m. A thin plate is a wall with both faces of its edge."""
    partners = _other_ends(edges, widest)
    thin = (partners[:, 0] >= 0) & (partners[:, 0] == partners[:, 1])
    own, face = np.nonzero(partners >= 0)
    once = np.flatnonzero(~(thin[own] & (face == 1)))
    own, face = own[once], face[once]
    other = partners[own, face]
    sides = (np.arange(2) == face[:, None]) | thin[own][:, None]
    return _Ends(own, other, np.hypot(*(edges.points[own] - edges.points[other]).T), sides)


def _at_ends(edge: IntArray, ends: _Ends) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return each path past these edges (m,) once for each row of `ends` at its edge: path and row, (k,)."""
    # `own` is in order
    first, behind = np.searchsorted(ends.own, edge), np.searchsorted(ends.own, edge, side="right")
    single, double = np.flatnonzero(behind > first), np.flatnonzero(behind > first + 1)
    return np.append(single, double), np.append(first[single], first[double] + 1)


def _other_ends(edges: Edges, widest: float) -> NDArray[np.intp]:
    """Return the edge at the other end of each face, (e, 2); -1 if it is farther than `widest` m, or none.

    Inner corners are no ends, and a side that another wall joins midway has none.
    """
    partners = np.full((len(edges), 2), -1)
    narrow = np.ones((len(edges), 2), np.bool_) if edges.bare is None else edges.bare > 0.0
    edge, face = np.nonzero(narrow & (edges.openings > math.pi)[:, None])
    direction = np.mod(edges.starts[edge] + face * edges.openings[edge], math.tau)
    # seen along the wall in a direction of 0 to 180°: whether it begins here, and whether its air is on the left
    begins = (direction > _FLUSH) & (direction < math.pi + _FLUSH)
    along = direction - np.where(begins, 0.0, math.pi)
    left = (face == 0) == begins
    place = edges.points[edge, 0] * np.cos(along) + edges.points[edge, 1] * np.sin(along)
    wall = edges.faces[edge, face]
    order = np.lexsort((begins, np.round(place / _FLUSH), left, wall))
    first, last = order[:-1], order[1:]
    joined = (wall[first] == wall[last]) & (left[first] == left[last]) & begins[first] & ~begins[last]
    joined &= place[last] - place[first] <= widest
    if edges.bare is not None:
        joined &= place[last] - place[first] < edges.bare[edge[first], face[first]] + 2 * _FLUSH
    first, last = first[joined], last[joined]
    partners[edge[first], face[first]] = edge[last]
    partners[edge[last], face[last]] = edge[first]
    return partners


def _departing(
    half: Arriving, rows: NDArray[np.intp], end: NDArray[np.intp], ends: _Ends, wedges: _Wedges
) -> ComplexArray:
    """Return the sound of rows of `half` that departs from rows of `ends` in the four ways, (m, 4), at the other end.

    Phases are relative to the length of each path, and to the width of the wall.
    """
    # many paths share a half
    some, again = np.unique(rows * len(ends.own) + end, return_inverse=True)
    row, face = np.nonzero(ends.sides[some % len(ends.own)])
    path, end = np.divmod(some[row], len(ends.own))
    edge, other, width = ends.own[end], ends.other[end], ends.widths[end]
    angle, length = half.angles[path], half.lengths[path]
    # the first face of one edge is on the same side as the last face of the other
    side, far_side = face * wedges.openings[edge], (1 - face) * wedges.openings[other]
    # the source, or its image, from the other end
    image = length * np.exp(1j * angle) - width * np.exp(1j * side)
    far_angle = np.mod(np.angle(image) - side - math.pi + far_side, math.tau)
    far_length = np.maximum(np.abs(image), _FLUSH)
    delay = np.exp(-1j * math.tau / wedges.wavelength * (far_length - length))
    visible = far_angle < wedges.openings[other]
    ways = np.zeros((len(some), 4), np.complex128)
    kept = _incident(edge, face, angle - side, wedges)
    ways[row, face] = kept * _departs(edge, angle, side, length, width, wedges)
    kept = _incident(other, 1 - face, far_angle - far_side, wedges)
    ways[row, 2 + face] = visible * delay * kept * _departs(other, far_angle, far_side, far_length, width, wedges)
    return np.asarray(ways[again])


def _incident(edge: NDArray[np.intp], face: NDArray[np.intp], above: FloatArray, wedges: _Wedges) -> FloatArray:
    """Return what a face of edges leaves of sound at an angle `above` it, relative to the perpendicular, (m,).

    The sound at a face of admittance β is sin φ / (sin φ + β) of that at a hard one.
    """
    admittance = _admittance(wedges.faces[edge, face])
    sine = np.abs(np.sin(above))
    return np.asarray((1.0 + admittance) * sine / np.maximum(sine + admittance, 1e-300))


def _departs(
    edge: NDArray[np.intp], angle: FloatArray, side: FloatArray, length: FloatArray, width: FloatArray, wedges: _Wedges
) -> ComplexArray:
    """Return the sound at `width` (m,) m along a `side` of edges (m,), from sources at an angle and distance, (m,)."""
    n = wedges.openings[edge] / math.pi
    # along a face, `_exchange` contains its reflectance
    amplitude = by_wedge(angle, side, n, np.ones((len(n), 2)), length, width, wedges.wavelength)
    return np.asarray(amplitude / np.sqrt(length + width))


def _exchange(ends: _Ends, wedges: _Wedges) -> ComplexArray:
    """Return what remains at the place of departure of either path, for each two ways to depart, (w, 4, 4)."""
    both_sides = ends.sides[:, None, :, None] & ends.sides[:, None, None, :]
    row, end, way, other_way = np.nonzero(np.repeat(both_sides, 2, axis=1))
    edge, width = np.where(end == 0, ends.own[row], ends.other[row]), ends.widths[row]
    # at the other end, the side of the own first face is the last face
    opening = wedges.openings[edge]
    turned = _departs(edge, np.abs(end - way) * opening, np.abs(end - other_way) * opening, width, width, wedges)
    again = np.zeros((len(ends.own), 4, 4), np.complex128)
    again[row, 2 * end + other_way, 2 * (1 - end) + way] = turned
    # half: at grazing incidence the sound at a face is the incident sound and its reflection
    reflectance = np.where(ends.sides[:, 0], wedges.faces[ends.own, 0], wedges.faces[ends.own, 1])
    radians = math.tau / wedges.wavelength * ends.widths
    kept = 1.0 - transition(0.5 * radians * _admittance(reflectance) ** 2)
    passage = (0.5 * kept * np.sqrt(ends.widths) * np.exp(-1j * radians))[:, None, None]
    series = np.linalg.inv(np.eye(4) - again * passage)
    return np.asarray(passage * series.transpose(0, 2, 1) @ _OTHER_END)


def _admittance(reflectances: FloatArray) -> FloatArray:
    """Return the admittances of faces relative to that of air, same shape, for reflectances at perpendicular sound."""
    return np.asarray((1.0 - reflectances) / (1.0 + reflectances))


# diffracted paths: pairs of a path from the source to an edge and a reversed path from the receiver to it


_AT_EDGE = 1e-7  # m
_LEAST_PART = 2000  # rows to pair: fewer take about as long as a thread needs to begin


@dataclass(frozen=True)
class EdgeDiffraction:
    """Which diffracted paths to find, and how strongly edges diffract."""

    wavelength: float  # m
    faintest: float  # gain; fainter diffracted paths are omitted
    strength: EdgeStrength = EdgeStrength.UNIFORM
    ka: float | None = None  # of a transducer at any heading, to omit what it cannot detect; None: list all

    @property
    def beams(self) -> FloatArray:
        """Largest product of both beam factors at any heading, by the angle between departure and arrival, 0 to π."""
        if self.ka is None:
            return np.ones(1)
        # at this angle or a larger one, so that the bound is not too low
        return np.ascontiguousarray(np.maximum.accumulate(loudest_by_separation(self.ka)[::-1])[::-1])

    def longest_partial(self, distances: FloatArray) -> FloatArray:
        """Return the longest path to edges at `distances` (m) from the other end that can be loud enough, same shape.

        The second leg is at least the straight distance. The result is 0 if no path is loud enough, inf if all are.
        """
        if self.strength is not EdgeStrength.PAPER:
            # towards reflection, edges at any distance are loud
            return np.full(distances.shape, np.inf)
        z = self.wavelength / (math.tau * max(self.faintest, 1e-9)) ** 2
        with np.errstate(divide="ignore"):
            # 2 / z = 1 / s + 1 / s′
            per_longest = 2 / z - 1 / distances
        longest = np.where(per_longest > 0, 1 / np.maximum(per_longest, 1e-300), np.inf)
        return np.where(longest >= distances, longest, 0.0)

    def loudest(self, before: FloatArray, after: FloatArray) -> FloatArray:
        """Return the largest gain of edges, for legs not shorter than these (n,) m, (n,) float."""
        if self.strength is not EdgeStrength.PAPER:
            return np.ones(len(before))
        legs = zip(before, after, strict=True)
        return np.array([edge_gain(leg, other_leg, self.wavelength) for leg, other_leg in legs], dtype=np.float64)


class EdgePaths(NamedTuple):
    """Paths to edges, in order of place, of edge and then of length; one row each."""

    edges: IntArray  # (n,): row in the room's edges
    lengths: FloatArray  # (n,), m
    gains: FloatArray  # (n,): reflectances and curvature
    angles: FloatArray  # (n,), rad from the wedge's first face to the direction from which the path comes
    departures: FloatArray  # (n,), rad
    meeting: NDArray[np.int64]  # (n,): equal of those that begin at one place and lead to one edge


def diffracted_paths(
    room: Room,
    out: PartialPaths,
    back: PartialPaths,
    edge_diffraction: EdgeDiffraction,
    max_length: float,
    max_bounces: int,
    faces: FloatArray,
) -> PartialPaths:
    """Return all paths that combine a path of `out` to an edge with a reversed one of `back`.

    `faces` (e, 2) are the reflectances of both faces of each edge.
    """
    out_rows, out_edges = _paths_to_edges(room, out)
    back_rows, back_edges = (out_rows, out_edges) if back is out else _paths_to_edges(room, back)
    first, second, gains, phases = join_at_edges(out_edges, back_edges, room.edges, faces, edge_diffraction, max_length)
    first, second = out_rows[first], back_rows[second]
    few = np.flatnonzero(out.bends[first] + back.bends[second] <= max_bounces)
    first, second, gains, phases = first[few], second[few], gains[few], phases[few]
    phases = phases + out.phases[first] + back.phases[second]
    surfaces, points = surfaces_and_points(out, back, first, second)
    lengths = out.lengths[first] + back.lengths[second]
    edges, bends, places = out.edges[first], out.bends[first], out.places[first]
    return PartialPaths(lengths, gains, phases, surfaces, edges, bends, points, places)


def _paths_to_edges(room: Room, paths: PartialPaths) -> tuple[NDArray[np.intp], EdgePaths]:
    """Return the rows of paths that reach an edge through its wedge of air, in order, and their angles."""
    rows = np.flatnonzero(paths.edges >= 0)
    edges = paths.edges[rows]
    before = paths.points[rows, paths.bends[rows]] - room.edges.points[edges]
    direction = np.arctan2(before[:, 1], before[:, 0])
    within = inside_wedge(direction, room.edges.starts[edges], room.edges.openings[edges])
    # a reflection at the edge itself does not count as a path to it
    within &= np.hypot(*before.T) > _AT_EDGE
    order = np.lexsort((paths.lengths[rows], edges, paths.places[rows]))
    order = order[within[order]]
    rows, direction = rows[order], direction[order]
    edges, away = paths.edges[rows], paths.points[rows, 1] - paths.points[rows, 0]
    angles = np.mod(direction - room.edges.starts[edges], math.tau)
    departures = np.arctan2(away[:, 1], away[:, 0])
    meeting = paths.places[rows].astype(np.int64) * len(room.edges) + edges
    return rows, EdgePaths(edges, paths.lengths[rows], paths.gains[rows], angles, departures, meeting)


def join_at_edges(
    out: EdgePaths,
    back: EdgePaths,
    edges: Edges,
    faces: FloatArray,
    edge_diffraction: EdgeDiffraction,
    max_length: float,
) -> tuple[NDArray[np.intp], NDArray[np.intp], FloatArray, FloatArray]:
    """Return the rows of `out` and `back` (m,) that form paths up to `max_length`, loud enough, their gains and phases.

    `faces` (e, 2) are the reflectances of both faces of each edge. If `back` is `out`, each pair is computed once and
    listed with its reverse. Raises InputError if these paths are too many for the memory.
    """
    starts, wedges = np.searchsorted(back.meeting, out.meeting), edges.openings / math.pi
    limits = edge_diffraction.wavelength, max_length, edge_diffraction.faintest
    strength = [*EdgeStrength].index(edge_diffraction.strength)
    most, beams = fan.MOST_POINTS // FEWEST_POINTS, edge_diffraction.beams
    if back is out:
        starts = np.arange(len(starts))

    def paired(begin: int, end: int) -> tuple[NDArray[np.intp], FloatArray]:
        count = fan.ROOM_FOR_PAIRS
        while True:
            pairs, bounds = np.empty((count, 2), np.intp), np.empty((count, 2))
            count = _join(begin, end, out, back, starts, wedges, limits, beams, strength, most, pairs, bounds)
            fan.check_size(count, FEWEST_POINTS)
            if count <= len(pairs):
                return pairs[:count], bounds[:count]

    pairs, bounds = rows_in_parts(paired, len(out.edges), _LEAST_PART)
    fan.check_size(len(pairs), FEWEST_POINTS)
    joined = _loud_enough(out, back, pairs, bounds, edges, faces, edge_diffraction)
    return _with_reversed(*joined) if back is out else joined


def _with_reversed(
    first: NDArray[np.intp], second: NDArray[np.intp], gains: FloatArray, phases: FloatArray
) -> tuple[NDArray[np.intp], NDArray[np.intp], FloatArray, FloatArray]:
    """Return pairs of rows (m,), their gains and phases, and the pairs of two different rows in reverse."""
    turned = np.flatnonzero(first != second)
    rows = np.append(first, second[turned]), np.append(second, first[turned])
    return *rows, np.append(gains, gains[turned]), np.append(phases, phases[turned])


def _loud_enough(
    out: EdgePaths,
    back: EdgePaths,
    pairs: NDArray[np.intp],
    bounds: FloatArray,
    edges: Edges,
    faces: FloatArray,
    edge_diffraction: EdgeDiffraction,
) -> tuple[NDArray[np.intp], NDArray[np.intp], FloatArray, FloatArray]:
    """Return the result of `join_at_edges` from the pairs (m, 2) of `_join` and their bounds (m, 2)."""
    (first, second), (legs, factors) = pairs.T, bounds.T
    if edge_diffraction.strength is EdgeStrength.UNIFORM:
        arriving = _arriving(out)
        halves = arriving, arriving if back is out else _arriving(back)
        amplitudes = _uniform(halves, (first, second), edges, faces, edge_diffraction.wavelength)
    else:
        amplitudes = factors.astype(np.complex128)
    loud = np.flatnonzero(legs * np.abs(amplitudes) >= edge_diffraction.faintest)
    first, second, amplitudes = first[loud], second[loud], amplitudes[loud]
    gains = out.gains[first] * back.gains[second] * np.abs(amplitudes)
    return first, second, gains, np.angle(amplitudes)


def amplitudes_at_edges(
    room: Room, edges: IntArray, bends: IntArray, points: FloatArray, wavelengths: FloatArray, strength: EdgeStrength
) -> NDArray[np.complex128]:
    """Return the amplitudes of the `edges` (n,) of diffracted paths, relative to reflected ones of their length, (n,).

    `bends` (n,) and `points` (n, p, 2) are as in `rays.paths.Paths`, `wavelengths` (n,) m.
    """
    before, edge, after = (points[np.arange(len(edges)), bends + step] for step in (0, 1, 2))
    legs = np.hypot(*np.moveaxis(np.diff(points, axis=1), -1, 0))
    before_edge = np.where(np.arange(legs.shape[1]) <= bends[:, None], legs, 0.0).sum(axis=1)
    after_edge = np.nansum(legs, axis=1) - before_edge
    angle, other = (_angle_at(room.edges, edges, point - edge) for point in (before, after))
    faces = room.reflectances[room.edges.faces[edges]]
    return edge_amplitudes(
        angle, other, room.edges.openings[edges] / math.pi, faces, before_edge, after_edge, wavelengths, strength
    )


def edge_amplitudes(
    angle: FloatArray,
    other: FloatArray,
    wedges: FloatArray,
    faces: FloatArray,
    before: FloatArray,
    after: FloatArray,
    wavelengths: FloatArray,
    strength: EdgeStrength,
) -> ComplexArray:
    """Return the amplitudes of edges with this strength, relative to reflected paths of their length, (n,).

    Arguments as for `by_wedge`, (n,) each.
    """
    if strength is EdgeStrength.UNIFORM:
        return by_wedge(angle, other, wedges, faces, before, after, wavelengths)
    gains = [edge_gain(*legs_and_wave) for legs_and_wave in zip(before, after, wavelengths, strict=True)]
    if strength is EdgeStrength.PAPER:
        return np.array(gains, dtype=np.complex128)
    factors = [keller(*angles) for angles in zip(angle, other, wedges, strict=True)]
    return np.minimum(np.array(gains) * factors, 1.0).astype(np.complex128)


def _angle_at(edges: Edges, rows: IntArray, directions: FloatArray) -> FloatArray:
    return np.mod(np.arctan2(directions[:, 1], directions[:, 0]) - edges.starts[rows], math.tau)


def _arriving(paths: EdgePaths) -> Arriving:
    return Arriving(paths.edges, paths.angles, paths.lengths)


def _uniform(
    halves: tuple[Arriving, Arriving],
    rows: tuple[NDArray[np.intp], NDArray[np.intp]],
    edges: Edges,
    faces: FloatArray,
    wavelength: float,
) -> ComplexArray:
    """Return the amplitude of the edge of each path by the uniform theory, at most that of its louder face, (m,).

    Arguments as for `along_narrow_walls`.
    """
    (out, back), (first, second) = halves, rows
    edge = out.edges[first]
    angles, lengths = (out.angles[first], back.angles[second]), (out.lengths[first], back.lengths[second])
    amplitudes = by_wedge(*angles, edges.openings[edge] / math.pi, faces[edge], *lengths, wavelength)
    amplitudes += along_narrow_walls(halves, rows, edges, faces, wavelength)
    loudest, sizes = faces[edge].max(axis=1), np.abs(amplitudes)
    return np.asarray(amplitudes * np.minimum(1.0, loudest / np.maximum(sizes, 1e-300)))


_UNIFORM, _KELLER, _PAPER = range(3)  # in the order of EdgeStrength


@compiled
def _join(
    begin: int,
    end: int,
    out: EdgePaths,
    back: EdgePaths,
    starts: NDArray[np.intp],
    wedges: FloatArray,
    limits: tuple[float, float, float],
    beams: FloatArray,
    strength: int,
    most: int,
    pairs: NDArray[np.intp],
    bounds: FloatArray,
) -> int:
    """Return how many pairs of rows may form a path, and fill in the first of these pairs (m, 2) and of `bounds`.

    Only rows of `out` from `begin` up to `end` are paired. More than `most` pairs are not all counted. `starts` (o,) is
    the first row of `back` to try with each row of `out`, `wedges` (e,) the opening of each edge over π, `limits`
    wavelength, longest path and faintest amplitude. The `bounds` (m, 2) are the amplitude of a pair with a perfect edge
    at its best heading, and the most of its edge.
    """
    wavelength, max_length, faintest = limits
    count = 0
    for i in range(begin, end):
        edge, to_edge = out.edges[i], out.lengths[i]
        for j in range(starts[i], back.meeting.shape[0]):
            if back.meeting[j] != out.meeting[i] or to_edge + back.lengths[j] > max_length:
                break
            legs = out.gains[i] * back.gains[j] * by_separation(out.departures[i], back.departures[j], beams)
            # a bound first, because most pairs are too faint
            if legs < faintest:
                continue
            factor = most_of_edge(
                out.angles[i], back.angles[j], wedges[edge], to_edge, back.lengths[j], wavelength, strength
            )
            if legs * factor < faintest:
                continue
            if count < pairs.shape[0]:
                pairs[count, 0], pairs[count, 1], bounds[count, 0], bounds[count, 1] = i, j, legs, factor
            count += 1
        if count > most:
            break
    return count


@compiled_part
def by_separation(departure: float, arrival: float, beams: FloatArray) -> float:
    """Return both beam factors at the best heading for directions of departure and arrival (rad)."""
    separation = abs(departure - arrival)
    separation = min(separation, math.tau - separation)
    most: float = beams[int(max(separation, 0.0) / math.pi * (beams.shape[0] - 1))]
    return most


@compiled_part
def most_of_edge(
    angle: float, other: float, n: float, to_edge: float, from_edge: float, wavelength: float, strength: int
) -> float:
    """Return an upper bound of the amplitude of an edge relative to a reflection; exact but for the uniform theory."""
    if strength == _UNIFORM:
        return most_by_wedge(angle, other, n, to_edge, from_edge, wavelength)
    gain = edge_gain(to_edge, from_edge, wavelength)
    return min(1.0, gain * keller(angle, other, n)) if strength == _KELLER else gain


@compiled
def edge_gain(to_edge: float, from_edge: float, wavelength: float) -> float:
    """Return the amplitude of a diffracted path relative to a reflected one of its length, for its two legs (m).

    (2π √(z/λ))⁻¹ (CIM-92-9 §4) with z = 2 s s′/(s + s′), at most 1.
    """
    z = 2 * to_edge * from_edge / max(to_edge + from_edge, 1e-300)
    gain: float = min(1.0, 1 / (math.tau * math.sqrt(z / wavelength)))
    return gain


@compiled
def keller(angle: float, other: float, n: float) -> float:
    """Return the strength of an edge relative to the paper's factor, for two angles (rad) from its first face.

    Keller's coefficient for a hard wedge of outer angle nπ, over √2: straight back from a thin plate (n = 2) at angle
    φ it is |1 + 1/cos φ| / √2. It diverges towards reflection, where the caller limits it to the strength of the wall
    (Keller 1962, eq. 28; `by_wedge` is the uniform theory, which is finite there).
    """
    turn = math.cos(math.pi / n)
    difference, mirrored = turn - math.cos((angle - other) / n), turn - math.cos((angle + other) / n)
    bound = 1e-9  # without effect, because of the caller's limit
    difference = difference if abs(difference) > bound else bound
    mirrored = mirrored if abs(mirrored) > bound else bound
    strength: float = 2 * abs(math.sin(math.pi / n) * (1 / difference + 1 / mirrored)) / n / math.sqrt(2.0)
    return strength
