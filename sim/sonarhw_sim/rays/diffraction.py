"""Edge diffraction: paths source → walls → edge → walls → receiver, joined from the paths to each edge.

Each pair of a path from the source and a reversed path from the receiver gives one diffracted path.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray
from sonarhw_sim.board.transducer import ComplexArray
from sonarhw_sim.board.weighing import loudest_by_separation
from sonarhw_sim.choices import EdgeStrength
from sonarhw_sim.compiled import compiled, compiled_part
from sonarhw_sim.cores import rows_in_parts
from sonarhw_sim.rays import path_table
from sonarhw_sim.rays.partial_paths import PartialPaths
from sonarhw_sim.room.edges import Edges, inside_wedge
from sonarhw_sim.room.grid import IntArray
from sonarhw_sim.room.model import Room
from sonarhw_sim.wedges.narrow_walls import Arriving, along_narrow_walls
from sonarhw_sim.wedges.wedge import by_wedge, most_by_wedge

_AT_EDGE = 1e-7  # m
_LEAST_PART = 2000  # rows to pair: fewer take about as long as a thread needs to begin
_FEWEST_POINTS = 3  # of a diffracted path


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
        """Return the longest path to edges at `distances` (n,) m from the other end that can be loud enough, (n,) m.

        The second leg is at least the straight distance. The result is 0 if no path is loud enough, inf if all are.
        """
        if self.strength is not EdgeStrength.PAPER:
            # towards reflection, edges at any distance are loud
            return np.full(len(distances), np.inf)
        z = self.wavelength / (math.tau * max(self.faintest, 1e-9)) ** 2
        with np.errstate(divide="ignore"):
            # 2 / z = 1 / s + 1 / s′
            per_longest = 2 / z - 1 / distances
        longest = np.where(per_longest > 0, 1 / np.maximum(per_longest, 1e-300), np.inf)
        return np.where(longest >= distances, longest, 0.0)

    def loudest(self, there: FloatArray, on: FloatArray) -> FloatArray:
        """Return the largest gain of edges, for legs not shorter than these (n,) m, (n,) float."""
        if self.strength is not EdgeStrength.PAPER:
            return np.ones(len(there))
        legs = zip(there, on, strict=True)
        return np.array([edge_gain(one, other, self.wavelength) for one, other in legs], dtype=np.float64)


class EdgePaths(NamedTuple):
    """Paths to edges, in order of edge and then of length; one row each."""

    edges: IntArray  # (n,): row in the room's edges
    lengths: FloatArray  # (n,), m
    gains: FloatArray  # (n,): reflectances and curvature
    angles: FloatArray  # (n,), rad from the wedge's first face to the direction from which the path comes
    departures: FloatArray  # (n,), rad


def diffracted_paths(
    room: Room,
    out: PartialPaths,
    back: PartialPaths,
    edge_diffraction: EdgeDiffraction,
    max_length: float,
    max_bounces: int,
) -> PartialPaths:
    """Return all paths that combine a path of `out` to an edge with a reversed one of `back`."""
    out_rows, out_edges = _paths_to_edges(room, out)
    back_rows, back_edges = (out_rows, out_edges) if back is out else _paths_to_edges(room, back)
    faces = room.reflectances[room.edges.faces]
    first, second, gains, phases = join_at_edges(out_edges, back_edges, room.edges, faces, edge_diffraction, max_length)
    first, second = out_rows[first], back_rows[second]
    few = np.flatnonzero(out.bends[first] + back.bends[second] <= max_bounces)
    first, second, gains, phases = first[few], second[few], gains[few], phases[few]
    phases = phases + out.phases[first] + back.phases[second]
    before, after = out.bends[first], back.bends[second]
    most = int((before + after).max(initial=0))
    path_table.check_size(len(first), most + _FEWEST_POINTS)
    surfaces = np.empty((len(first), most), np.int32)
    points = np.empty((len(first), most + _FEWEST_POINTS, 2))
    path_table.fill_rows(surfaces, out.surfaces, first, before, back.surfaces, second, after)
    path_table.fill_rows(points, out.points, first, before + 2, back.points, second, after + 1)
    lengths = out.lengths[first] + back.lengths[second]
    return PartialPaths(lengths, gains, phases, surfaces, out.edges[first], out.bends[first], points)


def _paths_to_edges(room: Room, paths: PartialPaths) -> tuple[NDArray[np.intp], EdgePaths]:
    """Return the rows of paths that reach an edge through its wedge of air, by edge and length, and their angles."""
    rows = np.flatnonzero(paths.edges >= 0)
    edges = paths.edges[rows]
    before = paths.points[rows, paths.bends[rows]] - room.edges.points[edges]
    direction = np.arctan2(before[:, 1], before[:, 0])
    within = inside_wedge(direction, room.edges.starts[edges], room.edges.openings[edges])
    # a reflection at the edge itself does not count as a path to it
    within &= np.hypot(*before.T) > _AT_EDGE
    order = np.lexsort((paths.lengths[rows], edges))
    order = order[within[order]]
    rows, direction = rows[order], direction[order]
    edges, away = paths.edges[rows], paths.points[rows, 1] - paths.points[rows, 0]
    angles = np.mod(direction - room.edges.starts[edges], math.tau)
    departures = np.arctan2(away[:, 1], away[:, 0])
    return rows, EdgePaths(edges, paths.lengths[rows], paths.gains[rows], angles, departures)


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
    starts, wedges = np.searchsorted(back.edges, out.edges), edges.openings / math.pi
    limits = edge_diffraction.wavelength, max_length, edge_diffraction.faintest
    strength = [*EdgeStrength].index(edge_diffraction.strength)
    most, beams = path_table.MOST_POINTS // _FEWEST_POINTS, edge_diffraction.beams
    if back is out:
        starts = np.arange(len(starts))

    def paired(begin: int, end: int) -> tuple[NDArray[np.intp], FloatArray]:
        count = path_table.ROOM_FOR_PAIRS
        while True:
            pairs, bounds = np.empty((count, 2), np.intp), np.empty((count, 2))
            count = _join(begin, end, out, back, starts, wedges, limits, beams, strength, most, pairs, bounds)
            path_table.check_size(count, _FEWEST_POINTS)
            if count <= len(pairs):
                return pairs[:count], bounds[:count]

    pairs, bounds = rows_in_parts(paired, len(out.edges), _LEAST_PART)
    path_table.check_size(len(pairs), _FEWEST_POINTS)
    found = _loud_enough(out, back, pairs, bounds, edges, faces, edge_diffraction)
    return _with_reversed(*found) if back is out else found


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
    before, at, after = (points[np.arange(len(edges)), bends + step] for step in (0, 1, 2))
    legs = np.hypot(*np.moveaxis(np.diff(points, axis=1), -1, 0))
    there = np.where(np.arange(legs.shape[1]) <= bends[:, None], legs, 0.0).sum(axis=1)
    on = np.nansum(legs, axis=1) - there
    one, other = (_angle_at(room.edges, edges, point - at) for point in (before, after))
    faces = room.reflectances[room.edges.faces[edges]]
    return edge_amplitudes(one, other, room.edges.openings[edges] / math.pi, faces, there, on, wavelengths, strength)


def edge_amplitudes(
    one: FloatArray,
    other: FloatArray,
    wedges: FloatArray,
    faces: FloatArray,
    there: FloatArray,
    on: FloatArray,
    wavelengths: FloatArray,
    strength: EdgeStrength,
) -> ComplexArray:
    """Return the amplitudes of edges with this strength, relative to reflected paths of their length, (n,).

    Arguments as for `by_wedge`, (n,) each.
    """
    if strength is EdgeStrength.UNIFORM:
        return by_wedge(one, other, wedges, faces, there, on, wavelengths)
    gains = [edge_gain(*legs_and_wave) for legs_and_wave in zip(there, on, wavelengths, strict=True)]
    if strength is EdgeStrength.PAPER:
        return np.array(gains, dtype=np.complex128)
    factors = [keller(*angles) for angles in zip(one, other, wedges, strict=True)]
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
    found = 0
    for i in range(begin, end):
        edge, to_edge = out.edges[i], out.lengths[i]
        for j in range(starts[i], back.edges.shape[0]):
            if back.edges[j] != edge or to_edge + back.lengths[j] > max_length:
                break
            legs = out.gains[i] * back.gains[j] * _by_separation(out.departures[i], back.departures[j], beams)
            # a bound first, because most pairs are too faint
            if legs < faintest:
                continue
            factor = most_of_edge(
                out.angles[i], back.angles[j], wedges[edge], to_edge, back.lengths[j], wavelength, strength
            )
            if legs * factor < faintest:
                continue
            if found < pairs.shape[0]:
                pairs[found, 0], pairs[found, 1], bounds[found, 0], bounds[found, 1] = i, j, legs, factor
            found += 1
        if found > most:
            break
    return found


@compiled_part
def _by_separation(departure: float, arrival: float, beams: FloatArray) -> float:
    """Return both beam factors at the best heading for directions of departure and arrival (rad)."""
    apart = abs(departure - arrival)
    apart = min(apart, math.tau - apart)
    most: float = beams[int(max(apart, 0.0) / math.pi * (beams.shape[0] - 1))]
    return most


@compiled_part
def most_of_edge(
    one: float, other: float, n: float, to_edge: float, from_edge: float, wavelength: float, strength: int
) -> float:
    """Return an upper bound of the amplitude of an edge relative to a reflection; exact but for the uniform theory."""
    if strength == _UNIFORM:
        return most_by_wedge(one, other, n, to_edge, from_edge, wavelength)
    gain = edge_gain(to_edge, from_edge, wavelength)
    return min(1.0, gain * keller(one, other, n)) if strength == _KELLER else gain


@compiled
def edge_gain(to_edge: float, from_edge: float, wavelength: float) -> float:
    """Return the amplitude of a diffracted path relative to a reflected one of its length, for its two legs (m).

    (2π √(z/λ))⁻¹ (CIM-92-9 §4) with z = 2 s s′/(s + s′), at most 1.
    """
    z = 2 * to_edge * from_edge / max(to_edge + from_edge, 1e-300)
    gain: float = min(1.0, 1 / (math.tau * math.sqrt(z / wavelength)))
    return gain


@compiled
def keller(one: float, other: float, n: float) -> float:
    """Return the strength of an edge relative to the paper's factor, for two angles (rad) from its first face.

    Keller's coefficient for a hard wedge of outer angle nπ, over √2: straight back from a thin plate (n = 2) at angle
    φ it is |1 + 1/cos φ| / √2. It diverges towards reflection, where the caller limits it to the strength of the wall
    (Keller 1962, eq. 28; `by_wedge` is the uniform theory, which is finite there).
    """
    turn = math.cos(math.pi / n)
    apart, mirrored = turn - math.cos((one - other) / n), turn - math.cos((one + other) / n)
    bound = 1e-9  # without effect, because of the caller's limit
    apart = apart if abs(apart) > bound else bound
    mirrored = mirrored if abs(mirrored) > bound else bound
    strength: float = 2 * abs(math.sin(math.pi / n) * (1 / apart + 1 / mirrored)) / n / math.sqrt(2.0)
    return strength
