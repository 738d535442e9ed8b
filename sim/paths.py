"""Paths: every way for sound to leave the transducer and come back, whatever its heading.

Takes a room and a position; hands on `Paths` with exact lengths, directions of departure and arrival, what each
touched and how much of its amplitude is left. One trace serves a whole scan: nothing here depends on where the
transducer points.
"""

import math
from dataclasses import dataclass, fields
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from sim.edges import Edges, inside_wedge
from sim.rays import IntArray, fan, follow_fan
from sim.room import Room
from sim.sequences import BoolArray, leg_is_free, solve_candidates
from sonarhw.readings import FloatArray

# 1/16° apart finds 99.3 % of all paths up to 21.4 m in the simple room, where 0.25° finds 94 %
RAYS = 5760
MAX_BOUNCES = 64
SLACK = 1e-9  # m: a path that comes out a rounding error over the wanted length is still one
_SAME = 1e-7  # m and rad: paths that agree so far in length and departure are one


@dataclass(frozen=True)
class PathSearch:
    """What to look for."""

    max_length: float  # m, there and back
    wavelength: float  # m; edges diffract by it
    max_bounces: int = MAX_BOUNCES
    diffraction: bool = True
    rays: int = RAYS


@dataclass(frozen=True)
class Paths:
    """Paths from a place back to itself, shortest first; one row each."""

    lengths: FloatArray  # (n,), m
    departures: FloatArray  # (n,), rad in -π..π
    arrivals: FloatArray  # (n,), rad: direction from which the sound comes back
    gains: FloatArray  # (n,): reflectances, edge factor and curvature; no directivity, spreading, absorption
    surfaces: IntArray  # (n, b): surfaces reflected off, in order; -1 behind the last
    edges: IntArray  # (n,): row in the room's edges that bends the path; -1: none
    bends: IntArray  # (n,): how many of its reflections come before that edge; all of them where there is none
    elevations: FloatArray  # (n, 2), rad: how far above the plane it departs, and comes back from
    points: FloatArray  # (n, b + 3, 2), m: source, reflections and edge in order of travel, receiver; NaN behind

    def __len__(self) -> int:
        return len(self.lengths)

    @property
    def bounces(self) -> IntArray:
        """Number of reflections of each path, (n,) int."""
        return np.asarray((self.surfaces >= 0).sum(axis=1), dtype=np.int32)

    @cached_property
    def leaving(self) -> FloatArray:
        """Horizontal part of the unit vector along which each path departs, (n, 2) float."""
        return _horizontal(self.departures, self.elevations[:, 0])

    @cached_property
    def arriving(self) -> FloatArray:
        """Horizontal part of the unit vector from where each path comes back, (n, 2) float."""
        return _horizontal(self.arrivals, self.elevations[:, 1])

    def select(self, rows: NDArray[np.intp]) -> "Paths":
        """Only those rows, in that order."""
        return Paths(*(getattr(self, column.name)[rows] for column in fields(Paths)))

    def via(self, path: int, room: Room) -> tuple[str, ...]:
        """Names of what a path touched, in order of travel; an edge as the two walls that meet there."""
        touched = tuple(room.names[surface] for surface in self.surfaces[path] if surface >= 0)
        edge, bend = int(self.edges[path]), int(self.bends[path])
        return touched if edge < 0 else (*touched[:bend], room.edges.names[edge], *touched[bend:])

    def outline(self, path: int) -> FloatArray:
        """The corners of a path from the place back to it, (k, 2) float, m."""
        points = self.points[path]
        return np.asarray(points[~np.isnan(points[:, 0])])


def _horizontal(directions: FloatArray, elevations: FloatArray) -> FloatArray:
    return np.asarray(np.column_stack((np.cos(directions), np.sin(directions))) * np.cos(elevations)[:, None])


def find_paths(room: Room, position: tuple[float, float], search: PathSearch) -> Paths:
    """Every path from `position` back to it that `search` asks for, shortest first."""
    place = np.array(position, dtype=np.float64)
    heard = _edges_in_sight(room, place) if search.diffraction else np.empty(0, dtype=np.intp)
    targets = np.vstack((place, room.edges.points[heard]))
    directions = fan(search.rays)
    touched, candidates = follow_fan(
        place, directions, room.walls, room.posts, targets, search.max_length + SLACK, search.max_bounces
    )
    touched = touched[:, : candidates[:, 1].max(initial=0)]
    # straight to an edge and back needs no ray to find it
    direct = [(0, 0, target) for target in range(1, len(targets))]
    candidates = np.vstack((np.array(direct, dtype=np.int32).reshape(-1, 3), _distinct(touched, candidates)))
    real, points, lengths, divergences = solve_candidates(
        place, directions, touched, candidates, targets, room.walls, room.posts
    )
    solved = _Solved(touched, candidates[real], points[real], lengths[real], divergences[real], heard)
    return _assemble(room, place, solved, search)


@dataclass(frozen=True)
class _Solved:
    touched: IntArray  # (rays, b)
    candidates: IntArray  # (n, 3)
    points: FloatArray  # (n, b + 2, 2)
    lengths: FloatArray  # (n,), to the target
    divergences: FloatArray  # (n,)
    heard: NDArray[np.intp]  # row in the room's edges of target 1, 2, ...


def _edges_in_sight(room: Room, place: FloatArray) -> NDArray[np.intp]:
    edges = room.edges
    open_towards = np.flatnonzero(edges.opens_towards(place))
    in_sight = [k for k in open_towards if leg_is_free(edges.points[k], place, room.walls, room.posts)]
    return np.array(in_sight, dtype=np.intp)


def _distinct(touched: IntArray, candidates: IntArray) -> IntArray:
    """One candidate for each sequence and target: neighbouring rays find the same ones."""
    ray, bounces, target = candidates.T
    most = bounces.max(initial=0)
    sequences = np.where(np.arange(most) < bounces[:, None], touched[ray, :most], -1)
    # rows as bytes: equal or not is all that is asked, and bytes compare fast
    keys = np.column_stack((target, sequences)).astype(np.int32)
    _, first = np.unique(keys.view(f"V{keys.itemsize * keys.shape[1]}").ravel(), return_index=True)
    return candidates[np.sort(first)]


def _assemble(room: Room, place: FloatArray, solved: _Solved, search: PathSearch) -> Paths:
    ray, bounces, target = solved.candidates.T
    behind = np.arange(solved.touched.shape[1]) >= bounces[:, None]
    surfaces = np.where(behind, -1, solved.touched[ray])
    edges = np.concatenate(([-1], solved.heard)).astype(np.int32)[target]
    points = np.concatenate((solved.points, np.full((len(ray), 1, 2), np.nan)), axis=1)
    rows = np.arange(len(ray))
    points[rows[edges >= 0], bounces[edges >= 0] + 2] = place
    before = points[rows, bounces + (edges >= 0)]  # the corner before the sensor
    lengths = solved.lengths + np.where(edges >= 0, np.hypot(*(before - place).T), 0.0)
    gains = _reflected(room, surfaces) / np.sqrt(solved.divergences)
    diffracted = edges >= 0
    gains[diffracted] *= edge_gain(solved.lengths[diffracted], lengths[diffracted], search.wavelength)
    paths = Paths(
        lengths,
        np.arctan2(*(points[:, 1] - place).T[::-1]),
        np.arctan2(*(before - place).T[::-1]),
        gains,
        surfaces.astype(np.int32),
        edges,
        bounces,
        np.zeros((len(ray), 2)),
        points,
    )
    kept = (lengths <= search.max_length + SLACK) & ~(diffracted & ~_stays_in_wedge(room.edges, paths)) & (gains > 0)
    return _shortest_first(paths.select(np.flatnonzero(kept)))


def _reflected(room: Room, surfaces: IntArray) -> FloatArray:
    # the appended 1 is what row -1, "no surface", picks
    return np.asarray(np.append(room.reflectances, 1.0)[surfaces].prod(axis=1))


def edge_gain(to_edge: FloatArray, length: FloatArray, wavelength: float) -> FloatArray:
    """Amplitude of a diffracted path relative to a reflected one of its length, same shape.

    (2π √(z/λ))⁻¹ (CIM-92-9 §4) with z = 2 s s′/(s + s′) for legs s to the edge and s′ from it; never over 1.
    """
    from_edge = length - to_edge
    z = 2 * to_edge * from_edge / np.maximum(length, 1e-300)
    with np.errstate(divide="ignore"):
        return np.asarray(np.minimum(1.0, 1 / (math.tau * np.sqrt(z / wavelength))))


def _stays_in_wedge(edges: Edges, paths: Paths) -> BoolArray:
    """Whether sound reaches each path's edge through the same wedge of air in which the sensor lies, (n,) bool."""
    stays = np.zeros(len(paths), dtype=np.bool_)
    bent = np.flatnonzero(paths.edges >= 0)
    edge = paths.edges[bent]
    before = paths.points[bent, paths.bounces[bent]] - edges.points[edge]
    stays[bent] = inside_wedge(np.arctan2(before[:, 1], before[:, 0]), edges.starts[edge], edges.openings[edge])
    return stays


def _shortest_first(paths: Paths) -> Paths:
    """Sorted by length, and each path once: through a vertex several sequences describe one path."""
    order = np.lexsort((*paths.surfaces.T[::-1], paths.edges, np.round(paths.lengths, 9)))
    paths = paths.select(order)
    where = np.column_stack((paths.lengths, np.cos(paths.departures), np.sin(paths.departures), paths.edges))
    same = cKDTree(where).query_pairs(_SAME, output_type="ndarray") if len(paths) else np.empty((0, 2), np.intp)
    # of two that are one, the later in the order of the room file goes
    return paths.select(np.setdiff1d(np.arange(len(paths)), same.max(axis=1, initial=-1)))
