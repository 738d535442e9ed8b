"""Sound that runs along a narrow wall from one end to the other, any number of times, before it leaves.

Each end is a wedge and diffracts by the uniform theory. Along a hard face, half of the sound is incident on the next
wedge and half is its reflection. A face with an impedance weakens it as flat ground weakens a wave between two points
on it (Sommerfeld 1909): by 1 - F(kwβ²/2), with the width w, the admittance β of the face relative to that of air, and
the transition function F. The sum over all passages is a geometric series of matrices.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray
from sonarhw_sim.board.transducer import ComplexArray
from sonarhw_sim.room.edges import Edges
from sonarhw_sim.room.grid import IntArray
from sonarhw_sim.wedges.wedge import by_wedge, transition

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
        there, here = rows[0][path], rows[1][path]
        if halves[0] is halves[1]:
            both = _departing(halves[0], np.append(there, here), np.tile(end, 2), ends, wedges)
            out, back = np.split(both, 2)
        else:
            out, back = _departing(halves[0], there, end, ends, wedges), _departing(halves[1], here, end, ends, wedges)
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
    one, two = np.flatnonzero(behind > first), np.flatnonzero(behind > first + 1)
    return np.append(one, two), np.append(first[one], first[two] + 1)


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
    row, end, one, other = np.nonzero(np.repeat(both_sides, 2, axis=1))
    edge, width = np.where(end == 0, ends.own[row], ends.other[row]), ends.widths[row]
    # at the other end, the side of the own first face is the last face
    opening = wedges.openings[edge]
    turned = _departs(edge, np.abs(end - one) * opening, np.abs(end - other) * opening, width, width, wedges)
    again = np.zeros((len(ends.own), 4, 4), np.complex128)
    again[row, 2 * end + other, 2 * (1 - end) + one] = turned
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
