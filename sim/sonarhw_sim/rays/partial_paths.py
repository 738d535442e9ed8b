"""Paths from a place to the receiver or to an edge, each solved exactly, without duplicates."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray
from sonarhw_sim.compiled import compiled
from sonarhw_sim.rays.detectable import Detectable
from sonarhw_sim.rays.kernel import follow_fan
from sonarhw_sim.rays.path_table import PathTable
from sonarhw_sim.rays.sequences import solve_candidates
from sonarhw_sim.room.grid import IntArray
from sonarhw_sim.room.model import Room

NEARLY = 1e-9  # m: lengths that differ less, by rounding, are equal
_SAME = 1e-7  # m and rad: paths that differ less in length, departure and arrival are the same path


@dataclass(frozen=True)
class PartialPaths(PathTable):
    """Paths from a place to the receiver or to an edge, or, diffracted, past an edge to the receiver."""

    gains: FloatArray  # (n,)
    surfaces: IntArray  # (n, b)
    edges: IntArray  # (n,): the edge that the path leads to or past; -1: none
    bends: IntArray  # (n,)
    points: FloatArray  # (n, b + 3, 2)

    @staticmethod
    def none() -> "PartialPaths":
        """Return an empty table."""
        no = np.empty(0)
        whole = no.astype(np.int32)
        return PartialPaths(no, no, np.empty((0, 0), np.int32), whole, whole, np.empty((0, 3, 2)))


def find_partial_paths(
    room: Room,
    place: FloatArray,
    targets: FloatArray,
    edges: NDArray[np.intp],
    longest: FloatArray,
    directions: FloatArray,
    max_bounces: int,
    detectable: Detectable,
) -> PartialPaths:
    """Return every detectable path from `place` (2,) to targets (t, 2), not longer than their `longest` (t,) m.

    Rays in the `directions` of a fan find them. Row 0 of the targets is the receiver, the others are the room's
    `edges` (t - 1,).
    """
    touched, candidates = follow_fan(
        place, directions, room.surfaces, room.reflectances, targets, longest, max_bounces, detectable
    )
    candidates = _with_direct_paths(candidates, len(targets))
    real, points, lengths, divergences = solve_candidates(
        place, directions, touched, candidates, targets, longest, room.surfaces
    )
    ray, bounces, target = candidates[real].T
    most = points.shape[1] - 2
    surfaces = np.where(np.arange(most) < bounces[:, None], touched[ray, :most], -1).astype(np.int32)
    # surface -1, "none", selects the appended 1
    gains = np.append(room.reflectances, 1.0)[surfaces].prod(axis=1) / np.sqrt(divergences[real])
    points = np.concatenate((points[real], np.full((len(ray), 1, 2), np.nan)), axis=1)
    leads_to = np.append(-1, edges).astype(np.int32)[target]
    paths = PartialPaths(lengths[real], gains, surfaces, leads_to, bounces.astype(np.int32), points)
    return paths.select(np.flatnonzero(gains > 0))


def _with_direct_paths(candidates: IntArray, targets: int) -> IntArray:
    """Return the candidates and the direct path to every edge, which rays miss in a sharp corner."""
    bounces, target = candidates[:, 1], candidates[:, 2]
    straight = np.zeros((targets - 1, 3), dtype=np.int32)
    straight[:, 2] = np.arange(1, targets)
    return np.vstack((straight, candidates[(bounces > 0) | (target == 0)]))


def shortest_first(paths: PartialPaths) -> PartialPaths:
    """Sort paths by length and drop duplicates: through a vertex, several sequences describe one path."""
    order = np.argsort(paths.lengths, kind="stable")
    kept = _order_and_keep(paths.lengths, paths.edges, paths.surfaces, paths.points, order)
    return paths.select(order[kept])


@compiled
def _order_and_keep(
    lengths: FloatArray, edges: IntArray, surfaces: IntArray, points: FloatArray, order: NDArray[np.intp]
) -> NDArray[np.bool_]:
    """Sort paths of equal length in `order` as in the room file, and return whether each is the first of its kind."""
    # few paths are equal to a nanometre, so insertion sort is fast
    for k in range(1, order.shape[0]):
        j = k
        while j > 0 and _belongs_before(order[j], order[j - 1], lengths, edges, surfaces):
            order[j], order[j - 1] = order[j - 1], order[j]
            j -= 1
    kept = np.ones(order.shape[0], np.bool_)
    for k in range(order.shape[0]):
        j = k - 1
        while kept[k] and j >= 0 and lengths[order[k]] - lengths[order[j]] <= _SAME:
            kept[k] = not (kept[j] and _are_one(order[k], order[j], edges, points))
            j -= 1
    return kept


@compiled
def _belongs_before(one: int, other: int, lengths: FloatArray, edges: IntArray, surfaces: IntArray) -> bool:
    if abs(lengths[one] - lengths[other]) > NEARLY:
        return False
    difference = edges[one] - edges[other]
    for k in range(surfaces.shape[1]):
        if difference == 0:
            difference = surfaces[one, k] - surfaces[other, k]
    return bool(difference < 0)


@compiled
def _are_one(one: int, other: int, edges: IntArray, points: FloatArray) -> bool:
    """Return whether two paths of equal length have the same departure, arrival and edge."""
    if edges[one] != edges[other]:
        return False
    first, second = _last(points[one]), _last(points[other])
    return _are_parallel(points[one], 0, points[other], 0) and _are_parallel(
        points[one], first - 1, points[other], second - 1
    )


@compiled
def _last(corners: FloatArray) -> int:
    """Return the number of a path's last point; the rest is NaN."""
    last: int = corners.shape[0] - 1
    while math.isnan(corners[last, 0]):
        last -= 1
    return last


@compiled
def _are_parallel(one: FloatArray, leg: int, other: FloatArray, other_leg: int) -> bool:
    """Return whether a leg of one path is parallel to a leg of the other; a leg has the number of its first point."""
    ax, ay = one[leg + 1, 0] - one[leg, 0], one[leg + 1, 1] - one[leg, 1]
    bx, by = other[other_leg + 1, 0] - other[other_leg, 0], other[other_leg + 1, 1] - other[other_leg, 1]
    both = math.hypot(ax, ay) * math.hypot(bx, by)
    parallel: bool = abs(ax * by - ay * bx) <= _SAME * both and ax * bx + ay * by >= 0.0
    return parallel
