"""Edge diffraction: paths source → walls → edge → walls → receiver, joined from the paths to each edge.

Each pair of a path from the source and a reversed path from the receiver gives one diffracted path. Compiled by numba.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray
from sonarhw_sim.board.transducer import ComplexArray
from sonarhw_sim.board.weighing import loudest_by_separation
from sonarhw_sim.choices import EdgeStrength
from sonarhw_sim.compiled import compiled, compiled_part
from sonarhw_sim.rays import path_table
from sonarhw_sim.rays.partial_paths import PartialPaths
from sonarhw_sim.rays.wedge import by_wedge, fresnel_table, most_by_wedge
from sonarhw_sim.room.edges import Edges, inside_wedge
from sonarhw_sim.room.grid import IntArray
from sonarhw_sim.room.model import Room

_AT_EDGE = 1e-7  # m
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


@dataclass(frozen=True)
class EdgePaths:
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
    out, out_edges = _paths_to_edges(room, out)
    back, back_edges = (out, out_edges) if back is out else _paths_to_edges(room, back)
    faces = room.reflectances[room.edges.faces]
    first, second, gains, phases = join_at_edges(out_edges, back_edges, room.edges, faces, edge_diffraction, max_length)
    few = np.flatnonzero(out.bends[first] + back.bends[second] <= max_bounces)
    first, second, gains, phases = first[few], second[few], gains[few], phases[few]
    most = int((out.bends[first] + back.bends[second]).max(initial=0))
    path_table.check_size(len(first), most + 3)
    surfaces, points = np.full((len(first), most), -1, np.int32), np.full((len(first), most + 3, 2), np.nan)
    _concatenate(first, second, out.surfaces, out.points, back.surfaces, back.points, surfaces, points)
    lengths = out.lengths[first] + back.lengths[second]
    return PartialPaths(lengths, gains, phases, surfaces, out.edges[first], out.bends[first], points)


def _paths_to_edges(room: Room, paths: PartialPaths) -> tuple[PartialPaths, EdgePaths]:
    """Return the paths that reach an edge through its own wedge of air, by edge and length, with their angles."""
    paths = paths.select(np.flatnonzero(paths.edges >= 0))
    rows = np.arange(len(paths.lengths))
    before = paths.points[rows, paths.bends] - room.edges.points[paths.edges]
    direction = np.arctan2(before[:, 1], before[:, 0])
    within = inside_wedge(direction, room.edges.starts[paths.edges], room.edges.openings[paths.edges])
    # a reflection at the edge itself does not count as a path to it
    within &= np.hypot(*before.T) > _AT_EDGE
    order = np.lexsort((paths.lengths, paths.edges))
    order = order[within[order]]
    paths, direction = paths.select(order), direction[order]
    angles = np.mod(direction - room.edges.starts[paths.edges], math.tau)
    away = paths.points[:, 1] - paths.points[:, 0]
    departures = np.arctan2(away[:, 1], away[:, 0])
    return paths, EdgePaths(paths.edges, paths.lengths, paths.gains, angles, departures)


@compiled
def _concatenate(
    first: NDArray[np.intp],
    second: NDArray[np.intp],
    out_surfaces: IntArray,
    out_points: FloatArray,
    back_surfaces: IntArray,
    back_points: FloatArray,
    surfaces: IntArray,
    points: FloatArray,
) -> None:
    """Fill in surfaces (all -1) and points (all NaN) of paths that consist of one path and another one, reversed."""
    for path in range(first.shape[0]):
        i, j = first[path], second[path]
        b = 0
        while b < out_surfaces.shape[1] and out_surfaces[i, b] >= 0:
            surfaces[path, b] = out_surfaces[i, b]
            b += 1
        for k in range(b + 2):
            points[path, k, 0], points[path, k, 1] = out_points[i, k, 0], out_points[i, k, 1]
        back = 0
        while back < back_surfaces.shape[1] and back_surfaces[j, back] >= 0:
            back += 1
        for k in range(back):
            surfaces[path, b + k] = back_surfaces[j, back - 1 - k]
        for k in range(back + 1):
            points[path, b + 2 + k, 0] = back_points[j, back - k, 0]
            points[path, b + 2 + k, 1] = back_points[j, back - k, 1]


def join_at_edges(
    out: EdgePaths,
    back: EdgePaths,
    edges: Edges,
    faces: FloatArray,
    edge_diffraction: EdgeDiffraction,
    max_length: float,
) -> tuple[NDArray[np.intp], NDArray[np.intp], FloatArray, FloatArray]:
    """Return the rows of `out` and `back` (m,) that form paths up to `max_length`, loud enough, their gains and phases.

    `faces` (e, 2) are the reflectances of both faces of each edge. Raises InputError if these paths are too many
    for the memory.
    """
    count, pairs, amplitudes = _join(
        (out.edges, out.lengths, out.gains, out.angles, out.departures),
        (back.edges, back.lengths, back.gains, back.angles, back.departures),
        np.searchsorted(back.edges, out.edges),
        (edges.openings / math.pi, faces),
        edge_diffraction.wavelength,
        max_length,
        edge_diffraction.faintest,
        edge_diffraction.beams,
        [*EdgeStrength].index(edge_diffraction.strength),
        fresnel_table(),
        path_table.MOST_POINTS // _FEWEST_POINTS,
    )
    path_table.check_size(count, _FEWEST_POINTS)
    return pairs[:, 0], pairs[:, 1], np.abs(amplitudes), np.angle(amplitudes)


_EdgeColumns = tuple[IntArray, FloatArray, FloatArray, FloatArray, FloatArray]
_Wedges = tuple[FloatArray, FloatArray]  # opening over π, (e,), and reflectances of the faces, (e, 2)
_UNIFORM, _KELLER, _PAPER = range(3)  # in the order of EdgeStrength


@compiled
def _join(
    out: _EdgeColumns,
    back: _EdgeColumns,
    starts: NDArray[np.intp],
    wedges: _Wedges,
    wavelength: float,
    max_length: float,
    faintest: float,
    beams: FloatArray,
    strength: int,
    table: FloatArray,
    most: int,
) -> tuple[int, NDArray[np.intp], ComplexArray]:
    """Return the number of row pairs that form a path, these pairs (m, 2), and their amplitudes (m,).

    More than `most` pairs are not returned, and not all counted. `starts` (o,) is the first row of `back` at the edge
    of each row of `out`.
    """
    found = 0
    pairs, amplitudes = np.empty((0, 2), np.intp), np.empty(0, np.complex128)
    for filling in (False, True):
        if found > most:
            break
        if filling:
            pairs, amplitudes, found = np.empty((found, 2), np.intp), np.empty(found, np.complex128), 0
        for i in range(out[0].shape[0]):
            edge, to_edge = out[0][i], out[1][i]
            n, faces = wedges[0][edge], wedges[1][edge]
            for j in range(starts[i], back[0].shape[0]):
                if back[0][j] != edge or to_edge + back[1][j] > max_length:
                    break
                legs, heard = out[2][i] * back[2][j], _by_separation(out[4][i], back[4][j], beams)
                # a bound first, because most pairs are too faint
                if heard * legs < faintest:
                    continue
                if heard * legs * _most(out[3][i], back[3][j], n, to_edge, back[1][j], wavelength, strength) < faintest:
                    continue
                if filling:
                    angles = out[3][i], back[3][j]
                    amplitude = legs * _factor(angles, n, faces, to_edge, back[1][j], wavelength, strength, table)
                    if heard * abs(amplitude) < faintest:
                        continue
                    pairs[found, 0], pairs[found, 1], amplitudes[found] = i, j, amplitude
                found += 1
            if found > most:
                break
    return found, pairs[:found], amplitudes[:found]


@compiled_part
def _by_separation(departure: float, arrival: float, beams: FloatArray) -> float:
    """Return both beam factors at the best heading for directions of departure and arrival (rad)."""
    apart = abs(departure - arrival)
    apart = min(apart, math.tau - apart)
    most: float = beams[int(max(apart, 0.0) / math.pi * (beams.shape[0] - 1))]
    return most


@compiled_part
def _most(
    one: float, other: float, n: float, to_edge: float, from_edge: float, wavelength: float, strength: int
) -> float:
    """Return an upper bound of |`_factor`|."""
    if strength == _UNIFORM:
        return most_by_wedge(one, other, n, to_edge, from_edge, wavelength)
    gain = edge_gain(to_edge, from_edge, wavelength)
    return min(1.0, gain * keller(one, other, n)) if strength == _KELLER else gain


@compiled_part
def _factor(
    angles: tuple[float, float],
    n: float,
    faces: FloatArray,
    to_edge: float,
    from_edge: float,
    wavelength: float,
    strength: int,
    table: FloatArray,
) -> complex:
    """Return the amplitude of a diffracted path relative to a reflected one of its length, for its two legs (m)."""
    if strength == _UNIFORM:
        return by_wedge(angles[0], angles[1], n, faces, to_edge, from_edge, wavelength, table)
    return complex(_most(angles[0], angles[1], n, to_edge, from_edge, wavelength, strength), 0.0)


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
