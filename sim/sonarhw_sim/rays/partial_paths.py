"""Paths from a place to the receiver or to an edge, each solved exactly, without duplicates."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray
from sonarhw_sim.compiled import compiled, inlined
from sonarhw_sim.rays.detectable import Detectable
from sonarhw_sim.rays.kernel import Fan, follow_fan
from sonarhw_sim.rays.passing import Passing
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
    phases: FloatArray  # (n,), rad
    surfaces: IntArray  # (n, b)
    edges: IntArray  # (n,): the edge that the path leads to or past; -1: none
    bends: IntArray  # (n,)
    points: FloatArray  # (n, b + 3, 2)

    @staticmethod
    def none() -> "PartialPaths":
        """Return an empty table."""
        no = np.empty(0)
        whole = no.astype(np.int32)
        return PartialPaths(no, no, no, np.empty((0, 0), np.int32), whole, whole, np.empty((0, 3, 2)))


def find_partial_paths(
    room: Room,
    place: FloatArray,
    targets: FloatArray,
    edges: NDArray[np.intp],
    longest: FloatArray,
    directions: FloatArray,
    max_bounces: int,
    detectable: Detectable,
    passing: Passing | None,
    steepest: float,
) -> PartialPaths:
    """Return every detectable path from `place` (2,) to targets (t, 2), not longer than their `longest` (t,) m.

    Rays in the `directions` of a fan find them. Row 0 of the targets is the receiver, the others are the room's
    `edges` (t - 1,), to which sound is too faint with a slope over `steepest`.
    """
    found = follow_fan(
        place,
        directions,
        room.surfaces,
        room.reflectances,
        targets,
        longest,
        max_bounces,
        detectable,
        passing=passing,
        steepest=steepest,
    )
    found = found._replace(candidates=with_direct_paths(found.candidates, len(targets)))
    leads_to = np.append(-1, edges).astype(np.int32)
    return solved_paths(room, place, found, targets, longest, leads_to, passing)


def solved_paths(
    room: Room,
    place: FloatArray,
    fan: Fan,
    targets: FloatArray,
    longest: FloatArray,
    leads_to: IntArray,
    passing: Passing | None,
) -> PartialPaths:
    """Return those candidates of a fan that are real paths; `leads_to` (t,) is the edge at each target or -1."""
    blocking = room.surfaces if passing is None else passing.blocking
    # the height of a path to an edge is not known yet
    climbs = passing.to_receiver if passing is not None and leads_to[0] < 0 else None
    real, points, lengths, divergences = solve_candidates(
        place, fan.directions, fan.touched, fan.candidates, targets, longest, blocking, climbs
    )
    ray, bounces, target = fan.candidates[real].T
    most = points.shape[1] - 3
    surfaces = np.where(np.arange(most) < bounces[:, None], fan.touched[ray, :most], -1).astype(np.int32)
    # surface -1, "none", selects the appended 1
    gains = np.append(room.reflectances, 1.0)[surfaces].prod(axis=1) / np.sqrt(divergences)
    bends = bounces.astype(np.int32)
    paths = PartialPaths(lengths, gains, np.zeros(len(gains)), surfaces, leads_to[target], bends, points)
    return paths if (gains > 0).all() else paths.select(np.flatnonzero(gains > 0))


def with_direct_paths(candidates: IntArray, targets: int) -> IntArray:
    """Return the candidates and the direct path to every target but the receiver, which rays may miss."""
    bounces, target = candidates[:, 1], candidates[:, 2]
    straight = np.zeros((targets - 1, 3), dtype=np.int32)
    straight[:, 2] = np.arange(1, targets)
    return np.vstack((straight, candidates[(bounces > 0) | (target == 0)]))


def shortest_first(paths: PartialPaths) -> PartialPaths:
    """Sort paths by length and drop duplicates.

    These are paths with equal points: through a vertex, several sequences describe one path.
    """
    order = _in_order(paths)
    return paths.select(order[first_of_kind(paths.lengths[order], paths.edges[order], paths.points[order])])


def sequences_once(paths: PartialPaths, both_ways: bool) -> PartialPaths:
    """Sort paths by length and drop those with the surfaces of another one.

    With `both_ways`, paths between one place and itself are listed in the reverse direction, too.
    """
    count = (paths.surfaces >= 0).sum(axis=1)
    table = np.column_stack((paths.edges, paths.bends, paths.surfaces))
    if both_ways:
        turned = _turned(paths.surfaces, count)
        table = np.vstack((table, np.column_stack((paths.edges, _bends_back(paths, count), turned))))
    kept = first_of_equal(table)
    own, back = kept[kept < len(paths)], kept[kept >= len(paths)] - len(paths)
    # most reverses are known
    paths = PartialPaths.join([paths.select(own), _reversed(paths.select(back))])
    return paths.select(_in_order(paths))


def first_of_equal(table: IntArray) -> NDArray[np.intp]:
    """Return the first of each set of equal rows (n, k), in order."""
    hashes = hashes_of(table)
    order = np.argsort(hashes, kind="stable")
    near = np.flatnonzero(np.diff(hashes[order]) == 0)
    repeated = near[(table[order[near]] == table[order[near + 1]]).all(axis=1)] + 1
    return np.sort(np.delete(order, repeated))


def hashes_of(table: IntArray) -> NDArray[np.int64]:
    """Return a hash of each row (n, k): to sort whole rows takes longer than all else."""
    weights = np.random.default_rng(0).integers(1, 2**62, table.shape[1])
    return np.asarray((table.astype(np.int64) * weights).sum(axis=1))


def _reversed(paths: PartialPaths) -> PartialPaths:
    """Return paths between one place and itself in the reverse direction."""
    count = (paths.surfaces >= 0).sum(axis=1)
    points = np.isfinite(paths.points[:, :, 0]).sum(axis=1)
    return replace(
        paths,
        surfaces=_turned(paths.surfaces, count),
        bends=_bends_back(paths, count),
        points=_turned(paths.points, points),
    )


def _bends_back(paths: PartialPaths, count: NDArray[np.intp]) -> IntArray:
    """Return `bends` of the reversed paths, which have `count` (n,) surfaces."""
    return np.asarray(count - np.where(paths.edges < 0, 0, paths.bends), dtype=np.int32)


def _turned(table: NDArray[Any], count: NDArray[np.intp]) -> NDArray[Any]:
    """Return a table with the first `count` (n,) columns of each row in reverse order."""
    column = np.arange(table.shape[1])
    order = np.where(column < count[:, None], count[:, None] - 1 - column, column)
    return np.asarray(table[np.arange(len(table))[:, None], order])


def _in_order(paths: PartialPaths) -> NDArray[np.intp]:
    """Return the rows by length, and those of equal length as in the room file."""
    order = np.argsort(paths.lengths, kind="stable")
    _sort_equals(order, paths.lengths[order], paths.edges, paths.surfaces)
    return order


@compiled
def _sort_equals(order: NDArray[np.intp], lengths: FloatArray, edges: IntArray, surfaces: IntArray) -> None:
    """Sort each run of rows of nearly equal `lengths` (n,) m in `order` (n,) by edge, then by surfaces; stable."""
    begin = 0
    for k in range(1, order.shape[0]):
        if lengths[k] - lengths[k - 1] > NEARLY:
            begin = k
        row, at = order[k], k
        while at > begin and _comes_before(row, order[at - 1], edges, surfaces):
            order[at] = order[at - 1]
            at -= 1
        order[at] = row


@inlined
def _comes_before(one: int, other: int, edges: IntArray, surfaces: IntArray) -> bool:
    """Return whether the edge and the surfaces of row `one` come before those of the other."""
    if edges[one] != edges[other]:
        return bool(edges[one] < edges[other])
    for k in range(surfaces.shape[1]):
        if surfaces[one, k] != surfaces[other, k]:
            return bool(surfaces[one, k] < surfaces[other, k])
    return False


def first_of_kind(lengths: FloatArray, edges: IntArray, points: FloatArray) -> NDArray[np.bool_]:
    """Return which paths, in order of length, have no earlier one of equal length, departure, arrival and edge, (n,).

    `lengths` (n,) m, `edges` (n,), `points` (n, p, 2) m, padded with NaN.
    """
    rows = np.arange(len(lengths))
    last = np.isfinite(points[:, :, 0]).sum(axis=1) - 1
    legs = np.stack((points[:, 1] - points[:, 0], points[rows, last] - points[rows, last - 1]), axis=1)
    kept = np.ones(len(rows), dtype=np.bool_)
    pairs: list[tuple[int, int]] = []
    later, before = rows, 0
    while len(later):
        before += 1
        later = later[later >= before]
        later = later[lengths[later] - lengths[later - before] <= _SAME]
        alike = (edges[later] == edges[later - before]) & _are_parallel(legs[later], legs[later - before])
        pairs += [(row, row - before) for row in later[alike].tolist()]
    for row, earlier in sorted(pairs):
        kept[row] &= ~kept[earlier]
    return kept


def _are_parallel(one: FloatArray, other: FloatArray) -> NDArray[np.bool_]:
    """Return whether all vectors (n, k, 2) of a row have the same directions, (n,) bool."""
    both = np.hypot(one[..., 0], one[..., 1]) * np.hypot(other[..., 0], other[..., 1])
    cross = one[..., 0] * other[..., 1] - one[..., 1] * other[..., 0]
    parallel = (np.abs(cross) <= _SAME * both) & ((one * other).sum(axis=-1) >= 0.0)
    return np.asarray(parallel.all(axis=1))
