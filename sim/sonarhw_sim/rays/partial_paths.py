"""PartialPaths: how sound gets from a place to the receiver or to an edge, each solved exactly.

Takes a room, a place and targets; hands on `PartialPaths`, and puts them in order with each path once.
"""

import math
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray
from sonarhw_sim.compiled import compiled
from sonarhw_sim.rays.detectable import Detectable
from sonarhw_sim.rays.kernel import follow_fan
from sonarhw_sim.rays.sequences import solve_candidates
from sonarhw_sim.room.grid import IntArray
from sonarhw_sim.room.model import Room

NEARLY = 1e-9  # m: lengths that come out a rounding error apart are equal
_SAME = 1e-7  # m and rad: paths that agree so far in length, departure and arrival are one


@dataclass(frozen=True)
class PartialPaths:
    """PartialPaths from a place to the receiver or an edge, or, bent, by an edge to the receiver; one row each."""

    lengths: FloatArray  # (n,), m
    gains: FloatArray  # (n,)
    surfaces: IntArray  # (n, b)
    edges: IntArray  # (n,): the edge it leads to or by; -1: none
    bends: IntArray  # (n,)
    points: FloatArray  # (n, b + 3, 2)

    @staticmethod
    def none() -> "PartialPaths":
        """No way at all."""
        no = np.empty(0)
        whole = no.astype(np.int32)
        return PartialPaths(no, no, np.empty((0, 0), np.int32), whole, whole, np.empty((0, 3, 2)))

    def select(self, rows: NDArray[np.intp]) -> "PartialPaths":
        """Only those rows, in that order."""
        return PartialPaths(*(getattr(self, column.name)[rows] for column in fields(PartialPaths)))

    def joined(self, other: "PartialPaths") -> "PartialPaths":
        """These, then the others."""
        most = max(self.surfaces.shape[1], other.surfaces.shape[1])
        one, two = self._padded(most), other._padded(most)
        return PartialPaths(
            *(np.concatenate((getattr(one, c.name), getattr(two, c.name))) for c in fields(PartialPaths))
        )

    def _padded(self, most: int) -> "PartialPaths":
        more = most - self.surfaces.shape[1]
        if more == 0:
            return self
        surfaces = np.pad(self.surfaces, ((0, 0), (0, more)), constant_values=-1)
        points = np.pad(self.points, ((0, 0), (0, more), (0, 0)), constant_values=np.nan)
        return PartialPaths(self.lengths, self.gains, surfaces, self.edges, self.bends, points)


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
    """Every `audible` way from `place` (2,) to targets (t, 2) that is no longer than their `longest` (t,) m.

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
    # the appended 1 is what row -1, "no surface", picks
    gains = np.append(room.reflectances, 1.0)[surfaces].prod(axis=1) / np.sqrt(divergences[real])
    points = np.concatenate((points[real], np.full((len(ray), 1, 2), np.nan)), axis=1)
    leads_to = np.append(-1, edges).astype(np.int32)[target]
    paths = PartialPaths(lengths[real], gains, surfaces, leads_to, bounces.astype(np.int32), points)
    return paths.select(np.flatnonzero(gains > 0))


def _with_direct_paths(candidates: IntArray, targets: int) -> IntArray:
    """The candidates and the straight way to every edge: in a sharp corner the rays beside it meet a wall too soon."""
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
    """Put equals within `order`, which is by length, in order of the room file; whether each is new behind those."""
    # equals, to a nanometre, are few: put each where it belongs among them
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
    """Whether two paths of one length leave in one direction and arrive in one, by the same edge if any."""
    if edges[one] != edges[other]:
        return False
    first, second = _last(points[one]), _last(points[other])
    return _are_parallel(points[one], 0, points[other], 0) and _are_parallel(
        points[one], first - 1, points[other], second - 1
    )


@compiled
def _last(corners: FloatArray) -> int:
    """The last corner of a path; NaN lies behind it."""
    last: int = corners.shape[0] - 1
    while math.isnan(corners[last, 0]):
        last -= 1
    return last


@compiled
def _are_parallel(one: FloatArray, leg: int, other: FloatArray, other_leg: int) -> bool:
    """Whether a leg of one path runs along a leg of the other; each is numbered by the corner it starts from."""
    ax, ay = one[leg + 1, 0] - one[leg, 0], one[leg + 1, 1] - one[leg, 1]
    bx, by = other[other_leg + 1, 0] - other[other_leg, 0], other[other_leg + 1, 1] - other[other_leg, 1]
    both = math.hypot(ax, ay) * math.hypot(bx, by)
    parallel: bool = abs(ax * by - ay * bx) <= _SAME * both and ax * bx + ay * by >= 0.0
    return parallel
