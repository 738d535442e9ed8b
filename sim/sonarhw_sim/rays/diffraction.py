"""Edge diffraction: paths source → walls → edge → walls → receiver, joined from the paths to each edge.

Each pair of a path from the source and a reversed path from the receiver gives one diffracted path. Compiled by numba.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray
from sonarhw_sim.choices import EdgeStrength
from sonarhw_sim.compiled import compiled
from sonarhw_sim.rays.partial_paths import PartialPaths
from sonarhw_sim.room.edges import Edges, inside_wedge
from sonarhw_sim.room.grid import IntArray
from sonarhw_sim.room.model import Room

_AT_EDGE = 1e-7  # m


@dataclass(frozen=True)
class EdgeDiffraction:
    """Which diffracted paths to find, and how strongly edges diffract."""

    wavelength: float  # m
    faintest: float  # gain; fainter diffracted paths are omitted
    strength: EdgeStrength = EdgeStrength.PAPER

    def longest_partial(self, distances: FloatArray) -> FloatArray:
        """Return the longest path to edges at `distances` (n,) m from the other end that can be loud enough, (n,) m.

        The second leg is at least the straight distance. The result is 0 if no path is loud enough, inf if all are.
        """
        if self.strength is EdgeStrength.KELLER:
            # the coefficient diverges towards reflection
            return np.full(len(distances), np.inf)
        z = self.wavelength / (math.tau * max(self.faintest, 1e-9)) ** 2
        with np.errstate(divide="ignore"):
            # 2 / z = 1 / s + 1 / s′
            per_longest = 2 / z - 1 / distances
        longest = np.where(per_longest > 0, 1 / np.maximum(per_longest, 1e-300), np.inf)
        return np.where(longest >= distances, longest, 0.0)

    def loudest(self, there: FloatArray, on: FloatArray) -> FloatArray:
        """Return the largest gain of edges, for legs not shorter than these (n,) m, (n,) float."""
        if self.strength is EdgeStrength.KELLER:
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
    first, second, gains = join_at_edges(out_edges, back_edges, room.edges, edge_diffraction, max_length)
    most = int((out.bends[first] + back.bends[second]).max(initial=0))
    surfaces, points = _concatenated(first, second, out.surfaces, out.points, back.surfaces, back.points, most)
    lengths = out.lengths[first] + back.lengths[second]
    paths = PartialPaths(lengths, gains, surfaces, out.edges[first], out.bends[first], points)
    return paths.select(np.flatnonzero((surfaces >= 0).sum(axis=1) <= max_bounces))


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
    return paths, EdgePaths(paths.edges, paths.lengths, paths.gains, angles)


@compiled
def _concatenated(
    first: NDArray[np.intp],
    second: NDArray[np.intp],
    out_surfaces: IntArray,
    out_points: FloatArray,
    back_surfaces: IntArray,
    back_points: FloatArray,
    most: int,
) -> tuple[IntArray, FloatArray]:
    """Return surfaces and points of paths that consist of one path and another one, reversed."""
    count = first.shape[0]
    surfaces = np.full((count, most), -1, np.int32)
    points = np.full((count, most + 3, 2), np.nan)
    for path in range(count):
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
    return surfaces, points


def join_at_edges(
    out: EdgePaths, back: EdgePaths, edges: Edges, edge_diffraction: EdgeDiffraction, max_length: float
) -> tuple[NDArray[np.intp], NDArray[np.intp], FloatArray]:
    """Return the rows of `out` and `back` (m,) that form paths up to `max_length`, loud enough, and the gains (m,)."""
    pairs, gains = _join(
        (out.edges, out.lengths, out.gains, out.angles),
        (back.edges, back.lengths, back.gains, back.angles),
        np.searchsorted(back.edges, out.edges),
        edges.openings / math.pi,
        edge_diffraction.wavelength,
        max_length,
        edge_diffraction.faintest,
        edge_diffraction.strength is EdgeStrength.KELLER,
    )
    return pairs[:, 0], pairs[:, 1], gains


_EdgeColumns = tuple[IntArray, FloatArray, FloatArray, FloatArray]


@compiled
def _join(
    out: _EdgeColumns,
    back: _EdgeColumns,
    starts: NDArray[np.intp],
    ns: FloatArray,
    wavelength: float,
    max_length: float,
    faintest: float,
    by_angle: bool,
) -> tuple[NDArray[np.intp], FloatArray]:
    """Return row pairs that form a path, (m, 2), and the gains (m,).

    `starts` (o,) is the first row of `back` at the edge of each row of `out`.
    """
    found = 0
    pairs, gains = np.empty((0, 2), np.intp), np.empty(0)
    for filling in (False, True):
        if filling:
            pairs, gains, found = np.empty((found, 2), np.intp), np.empty(found), 0
        for i in range(out[0].shape[0]):
            for j in range(starts[i], back[0].shape[0]):
                if back[0][j] != out[0][i] or out[1][i] + back[1][j] > max_length:
                    break
                gain = out[2][i] * back[2][j] * edge_gain(out[1][i], back[1][j], wavelength)
                if by_angle:
                    gain = min(out[2][i] * back[2][j], gain * keller(out[3][i], back[3][j], ns[out[0][i]]))
                if gain < faintest:
                    continue
                if filling:
                    pairs[found, 0], pairs[found, 1], gains[found] = i, j, gain
                found += 1
    return pairs, gains


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
    (Keller 1962, eq. 28; the limit replaces the uniform theory of Kouyoumjian and Pathak 1974).
    """
    turn = math.cos(math.pi / n)
    apart, mirrored = turn - math.cos((one - other) / n), turn - math.cos((one + other) / n)
    bound = 1e-9  # without effect, because of the caller's limit
    apart = apart if abs(apart) > bound else bound
    mirrored = mirrored if abs(mirrored) > bound else bound
    strength: float = 2 * abs(math.sin(math.pi / n) * (1 / apart + 1 / mirrored)) / n / math.sqrt(2.0)
    return strength
