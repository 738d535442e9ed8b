"""Paths from a place to the receiver or to an edge, each solved exactly, without duplicates."""

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray
from sonarhw_sim.compiled import compiled, compiled_part, inlined
from sonarhw_sim.rays.candidate_table import Fan
from sonarhw_sim.rays.kernel import Targets
from sonarhw_sim.rays.passing import Passing
from sonarhw_sim.rays.path_table import PathTable, fill_rows
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


def solved_paths(
    room: Room,
    place: FloatArray,
    fan: Fan,
    targets: Targets,
    leads_to: IntArray,
    passing: Passing | None,
) -> PartialPaths:
    """Return those candidates of a fan that are real paths; `leads_to` (t,) is the edge at each target or -1."""
    blocking = room.surfaces if passing is None else passing.blocking
    # the height of a path to an edge is not known yet
    climbs = passing.to_receiver if passing is not None and leads_to[0] < 0 else None
    real, points, lengths, divergences = solve_candidates(place, fan, targets, blocking, climbs)
    # contiguous also if there are several: numba would compile both layouts
    ray, bounces, target = np.ascontiguousarray(fan.candidates[real].T)
    most = points.shape[1] - 3
    surfaces, gains = np.empty((len(ray), most), np.int32), np.empty(len(ray))
    _fill_touched(fan.touched, ray, bounces, room.reflectances, surfaces, gains)
    gains /= np.sqrt(divergences)
    bends = bounces.astype(np.int32)
    paths = PartialPaths(lengths, gains, np.zeros(len(gains)), surfaces, leads_to[target], bends, points)
    return paths if (gains > 0).all() else paths.select(np.flatnonzero(gains > 0))


@compiled
def _fill_touched(
    touched: IntArray,
    rays: IntArray,
    bounces: IntArray,
    reflectances: FloatArray,
    surfaces: IntArray,
    gains: FloatArray,
) -> None:
    """Fill in the surfaces (n, b) of paths, padded with -1, and the products of their reflectances (n,)."""
    for row in range(surfaces.shape[0]):
        gain = 1.0
        for k in range(bounces[row]):
            surfaces[row, k] = touched[rays[row], k]
            gain *= reflectances[surfaces[row, k]]
        surfaces[row, bounces[row] :] = -1
        gains[row] = gain


def shortest_first(paths: PartialPaths) -> PartialPaths:
    """Sort paths by length and drop duplicates.

    These are paths with equal points: through a vertex, several sequences describe one path.
    """
    order = _in_order(paths)
    return paths.select(order[first_of_kind(paths.lengths, paths.edges, paths.points, order)])


def sequences_once(paths: PartialPaths, both_ways: bool) -> PartialPaths:
    """Sort paths by length and drop those with the surfaces of another one.

    With `both_ways`, paths between one place and itself are listed in the reverse direction, too.
    """
    paths = paths.select(first_of_equal(_sequences(paths)))
    if both_ways:
        paths = PartialPaths.join([paths, missing_reverses(paths)])
    return paths.select(_in_order(paths))


def missing_reverses(paths: PartialPaths) -> PartialPaths:
    """Return the reverses of paths between one place and itself that have the surfaces of none of these paths."""
    count = (paths.surfaces >= 0).sum(axis=1)
    back = np.column_stack((paths.edges, _bends_back(paths, count), _turned(paths.surfaces, count)))
    # most reverses are known
    missing = np.flatnonzero(~np.isin(hashes_of(back), hashes_of(_sequences(paths))))
    return _reversed(paths.select(missing))


def _sequences(paths: PartialPaths) -> IntArray:
    """Return what distinguishes each path from the others: its edges, bends and surfaces, (p, k)."""
    return np.column_stack((paths.edges, paths.bends, paths.surfaces))


def first_of_equal(table: IntArray) -> NDArray[np.intp]:
    """Return the first of each set of equal rows (n, k), in order."""
    hashes = hashes_of(table)
    order = np.argsort(hashes, kind="stable")
    near = np.flatnonzero(np.diff(hashes[order]) == 0)
    repeated = near[(table[order[near]] == table[order[near + 1]]).all(axis=1)] + 1
    return np.sort(np.delete(order, repeated))


def hashes_of(table: IntArray) -> NDArray[np.int64]:
    """Return a hash of each row (n, k): to sort whole rows takes longer than all else."""
    hashes = np.empty(len(table), np.int64)
    _fill_hashes(table, _weights(table.shape[1]), hashes)
    return hashes


@compiled
def _fill_hashes(table: IntArray, weights: NDArray[np.int64], hashes: NDArray[np.int64]) -> None:
    for row in range(table.shape[0]):
        hashes[row] = 0
        for k in range(table.shape[1]):
            hashes[row] += table[row, k] * weights[k]


@lru_cache(maxsize=128)
def _weights(columns: int) -> NDArray[np.int64]:
    """Return the weight of each column in a hash, (columns,)."""
    return np.random.default_rng(0).integers(1, 2**62, columns)


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
    turned, rows = np.empty_like(table), np.arange(len(table))
    fill_rows(turned, table, rows, 0 * count, table, rows, count)
    return turned


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


def first_of_kind(
    lengths: FloatArray,
    kinds: NDArray[np.integer],
    points: FloatArray,
    order: NDArray[np.intp] | None = None,
    rows: NDArray[np.intp] | None = None,
) -> NDArray[np.bool_]:
    """Return which paths have no earlier one of equal length, departure, arrival and kind, in this order, (n,).

    `kinds` (n,) are their edges, or numbers that distinguish more. `lengths` (p,) m and `points` (p, b, 2) m, padded
    with NaN, belong to `rows` (n,) of these tables, by default to all in turn. Without an `order` (n,), paths are in
    order of length.
    """
    each, kept = np.arange(len(kinds)), np.ones(len(kinds), dtype=np.bool_)
    order, rows = (each if chosen is None else chosen for chosen in (order, rows))
    _drop_repeated(order, rows, lengths, kinds.astype(np.int64), points, kept)
    return kept


def last_points(points: FloatArray) -> NDArray[np.intp]:
    """Return the number of the last point of each path (n, p, 2), padded with NaN, (n,)."""
    last = np.empty(len(points), dtype=np.intp)
    _find_last(points, last)
    return last


@compiled
def _find_last(points: FloatArray, last: NDArray[np.intp]) -> None:
    for row in range(points.shape[0]):
        last[row] = _last(points[row])


@compiled
def _drop_repeated(
    order: NDArray[np.intp],
    rows: NDArray[np.intp],
    lengths: FloatArray,
    kinds: NDArray[np.int64],
    points: FloatArray,
    kept: NDArray[np.bool_],
) -> None:
    """Set `kept` (n,) to False where the path is equal to an earlier one in `order` (n,) that is kept."""
    for k in range(order.shape[0]):
        path, before = order[k], k - 1
        row = rows[path]
        while before >= 0 and lengths[row] - lengths[rows[order[before]]] <= _SAME:
            other = order[before]
            if kept[before] and kinds[path] == kinds[other] and _ends_alike(points[row], points[rows[other]]):
                kept[k] = False
                break
            before -= 1


@compiled_part
def _ends_alike(one: FloatArray, other: FloatArray) -> bool:
    """Return whether the first and the last legs of two paths (p, 2) have the same directions."""
    last = _last(one) - 1, _last(other) - 1
    return _are_parallel(one, 0, other, 0) and _are_parallel(one, last[0], other, last[1])


@compiled_part
def _last(path: FloatArray) -> int:
    """Return the number of the last point of a path (p, 2), padded with NaN."""
    k = path.shape[0] - 1
    while k > 0 and math.isnan(path[k, 0]):
        k -= 1
    return int(k)


@compiled_part
def _are_parallel(one: FloatArray, leg: int, other: FloatArray, other_leg: int) -> bool:
    """Return whether a leg of one path and a leg of another one have the same direction."""
    x, y = one[leg + 1, 0] - one[leg, 0], one[leg + 1, 1] - one[leg, 1]
    other_x = other[other_leg + 1, 0] - other[other_leg, 0]
    other_y = other[other_leg + 1, 1] - other[other_leg, 1]
    both = math.hypot(x, y) * math.hypot(other_x, other_y)
    alike: bool = abs(x * other_y - y * other_x) <= _SAME * both and x * other_x + y * other_y >= 0.0
    return alike
