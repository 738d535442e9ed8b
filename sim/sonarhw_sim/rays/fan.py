"""The ray kernel: follows a fan of rays through the room and notes where each passes the receiver or an edge."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from sonarhw.errors import InputError
from sonarhw.readings import FloatArray, angle_difference
from sonarhw_sim.board.beam import beam_gain
from sonarhw_sim.compiled import array_part, compiled, compiled_part, in_parts, inlined
from sonarhw_sim.rays.passing import BoolArray, KernelHeights, Passing, surface_at
from sonarhw_sim.room.grid import Cells, IntArray, Listing, Surfaces, advance, enter, list_points, listed
from sonarhw_sim.room.room import Room

# Upper bounds on the amplitude of rays, so that the ray kernel drops rays that no receiver can detect.
#
# No bound is below the true amplitude, so a path is lost only if it is fainter than `TransducerAxes.faintest`. A
# search for all headings at once has no `TransducerAxes` and drops nothing.


_ANGLES = 1441  # from 0 to π at which the beam is tabulated
# Allowance for the distance between the exact path and the ray that found it. Rays are a sixteenth of a degree apart,
# but behind a post the tube between two rays widens, and a path at its rim is louder than the ray at its centre.
_ASIDE = math.radians(1.0)
_LOUDER = 2.0  # 6 dB


class Detectable(NamedTuple):
    """Amplitude of each ray at departure, and the least amplitude at each target."""

    leaving: FloatArray  # (n, d): upper bound of the amplitude of each ray of each place at departure
    least: FloatArray  # (t,): a path to a target must exceed this amplitude
    axes: FloatArray  # (n, 2): unit vector of the axis of each receiver
    receiving: FloatArray  # (a,): upper bound of the receiver's beam at or beyond each angle, evenly from 0 to π


@dataclass(frozen=True)
class TransducerAxes:
    """Axes of sender and receiver, for a search of paths that leave and arrive in front of them, loud enough."""

    leaving: FloatArray  # (n,), rad, of the sender at each place
    arriving: FloatArray  # (n,), rad, of its receiver
    ka: float  # of both
    faintest: float  # amplitude, with beams, reflectances and curvature; fainter paths may be omitted

    def select(self, rows: NDArray[np.intp]) -> "TransducerAxes":
        """Return the axes of these places."""
        return TransducerAxes(self.leaving[rows], self.arriving[rows], self.ka, self.faintest)

    @property
    def reversed(self) -> "TransducerAxes":
        """The axes for reversed paths."""
        return TransducerAxes(self.arriving, self.leaving, self.ka, self.faintest)

    def detectable(self, directions: FloatArray, onward: FloatArray) -> Detectable:
        """Return the limits for rays in these directions (d,) rad, and targets with a gain of at most `onward` (t,)."""
        return Detectable(
            self.departing(directions, self.leaving[:, None]),
            self.faintest / _LOUDER / onward,
            np.column_stack((np.cos(self.arriving), np.sin(self.arriving))),
            loudest_aside(self.ka),
        )

    def departing(self, directions: FloatArray, headings: FloatArray) -> FloatArray:
        """Return an upper bound of the amplitude of rays in `directions` (rad) from senders along `headings`."""
        aside = np.abs(angle_difference(directions, headings))
        return np.asarray(loudest_aside(self.ka)[(aside / math.pi * (_ANGLES - 1)).astype(np.intp)])


def all_rays(
    rays: int, places: int, targets: int, faintest: float = 0.0, leaving: FloatArray | None = None
) -> Detectable:
    """Return the limits for a search that drops only rays without any sound left; so many `targets` at each place.

    Paths to targets but the first may be omitted if they are fainter than `faintest`; with amplitudes of rays at
    departure, `leaving` (places, rays), those to the first too.
    """
    of_place = np.full(targets, faintest / _LOUDER)
    if leaving is None:
        of_place[0], leaving = 0.0, np.ones((places, rays))
    axes = np.column_stack((np.ones(places), np.zeros(places)))
    return Detectable(leaving, np.tile(of_place, places), axes, _for_kernels(np.ones(1)))


@lru_cache(maxsize=16)
def loudest_aside(ka: float) -> FloatArray:
    """Return the largest beam factor, for one pass, at or beyond each angle minus one degree, (1441,) for 0 to π."""
    angles = np.linspace(0, math.pi, _ANGLES)
    return _for_kernels(np.maximum.accumulate(beam_gain(np.maximum(angles - _ASIDE, 0.0), ka)[::-1])[::-1])


def _for_kernels(receiving: FloatArray) -> FloatArray:
    """Return a contiguous, read-only array. For an array of another kind, the kernels would be compiled once more."""
    receiving = np.ascontiguousarray(receiving)
    receiving.flags.writeable = False
    return receiving


# the first surface that a ray meets, and its reflection there


_AT_START = 1e-11  # m


@compiled
def first_hit(x: float, y: float, dx: float, dy: float, leaving: int, surfaces: Surfaces) -> tuple[float, int]:
    """Return the distance (m) to the first surface along a ray and its number; (inf, -1) if there is none.

    `leaving` is the surface on which the ray starts, or -1. It is convex or flat, so the ray cannot meet it again.
    """
    walls, posts, cells, (starts, numbers) = surfaces
    # int(): a constant -1 has a type of its own, for which `first_among` would be compiled once more
    return first_among(x, y, dx, dy, int(leaving), walls, posts, cells, starts, numbers)


@compiled_part
def first_among(
    x: float,
    y: float,
    dx: float,
    dy: float,
    leaving: int,
    walls: FloatArray,
    posts: FloatArray,
    cells: Cells,
    starts: IntArray,
    numbers: IntArray,
) -> tuple[float, int]:
    """Return the same as `first_hit`. In inner loops, unpacking a tuple of arrays costs as much as testing a wall."""
    nearest, surface = np.inf, -1
    if starts.shape[0] == 2:
        # a single cell: to test its surfaces takes less time than to find where a ray enters it
        for i in range(starts[1]):
            k = numbers[i]
            if k != leaving:
                distance = _distance_to(x, y, dx, dy, k, walls, posts)
                if distance < nearest:
                    nearest, surface = distance, k
        return nearest, surface
    walk = enter(cells, x, y, dx, dy)
    while walk.inside:
        cell = walk.row * cells.columns + walk.column
        for i in range(starts[cell], starts[cell + 1]):
            k = numbers[i]
            if k != leaving:
                distance = _distance_to(x, y, dx, dy, k, walls, posts)
                if distance < nearest:
                    nearest, surface = distance, k
        if nearest <= min(walk.next_column, walk.next_row):
            break
        walk = advance(cells, walk)
    return nearest, surface


@inlined
def _distance_to(x: float, y: float, dx: float, dy: float, surface: int, walls: FloatArray, posts: FloatArray) -> float:
    """Return the distance (m) along a ray to a surface; inf if the ray misses it."""
    if surface >= walls.shape[0]:
        near_side = post_distance(x, y, dx, dy, posts[surface - walls.shape[0]])
        return near_side if near_side > 0.0 else np.inf
    ex, ey = walls[surface, 2] - walls[surface, 0], walls[surface, 3] - walls[surface, 1]
    rx, ry = walls[surface, 0] - x, walls[surface, 1] - y
    across = dx * ey - dy * ex
    side = 1.0 if across > 0.0 else -1.0
    along, ahead, across = side * (rx * dy - ry * dx), side * (rx * ey - ry * ex), side * across
    # a second wall flush with the one on which the ray starts is not met
    if (along < -1e-12 * across) | (along > (1.0 + 1e-12) * across) | (ahead <= _AT_START * across):
        return np.inf
    distance: float = ahead / across
    return distance


@compiled_part
def post_distance(x: float, y: float, dx: float, dy: float, post: FloatArray) -> float:
    """Return the distance (m) along a ray to the near side of a post (x, y, radius); inf if the ray misses it."""
    cx, cy = post[0] - x, post[1] - y
    towards = cx * dx + cy * dy
    aside = cx * dy - cy * dx
    inside = post[2] * post[2] - aside * aside
    if towards <= 0.0 or inside <= 0.0:
        return np.inf
    near_side: float = towards - math.sqrt(inside)
    return near_side


@compiled_part
def reflect(
    x: float, y: float, dx: float, dy: float, surface: int, walls: FloatArray, posts: FloatArray
) -> tuple[float, float, float]:
    """Return the direction after reflection at (x, y), and the opening of the tube per metre of its width, 1/m.

    The opening is 0 for a flat wall and 2 / (R cos i) for a post of radius R at incidence i.
    """
    n = walls.shape[0]
    if surface < n:
        wall = walls[surface]
        ex, ey = wall[2] - wall[0], wall[3] - wall[1]
        scale = 2.0 * (dx * ex + dy * ey) / (ex * ex + ey * ey)
        return scale * ex - dx, scale * ey - dy, 0.0
    post = posts[surface - n]
    nx, ny = (x - post[0]) / post[2], (y - post[1]) / post[2]
    inward = dx * nx + dy * ny
    return dx - 2.0 * inward * nx, dy - 2.0 * inward * ny, 2.0 / (post[2] * max(-inward, 1e-9))


@compiled
def distances_ahead(points: FloatArray, headings: FloatArray, surfaces: Surfaces) -> FloatArray:
    """Return the distance from `points` (n, 2) along `headings` (n,) rad to the first surface, or inf, (n,) m."""
    distances = np.empty(headings.shape[0])
    for k in range(headings.shape[0]):
        x, y = math.cos(headings[k]), math.sin(headings[k])
        distances[k] = first_hit(points[k, 0], points[k, 1], x, y, -1, surfaces)[0]
    return distances


# tables of paths, and the limit of their size


# Points of all paths of one table. A search needs about 80 bytes for each, 2.4 GB. The shipped
# rooms have up to 2 million.
MOST_POINTS = 30_000_000
# of two partial paths, for which memory is reserved at first, so that they are rarely counted before they are listed
ROOM_FOR_PAIRS = 1_000_000


@dataclass(frozen=True)
class PathTable:
    """Columns of equal length; each subclass adds its own."""

    lengths: FloatArray  # (n,), m

    def __len__(self) -> int:
        return len(self.lengths)

    def select(self, rows: NDArray[np.intp]) -> Self:
        """Return only these rows, in this order."""
        return type(self)(*[getattr(self, name)[rows] for name in self.__dataclass_fields__])

    @classmethod
    def join(cls, tables: Sequence[Self]) -> Self:
        """Return the rows of all tables, in order; expects at least one table."""
        filled = [table for table in tables if len(table)] or tables[:1]
        if len(filled) == 1:
            return filled[0]
        return cls(*[_joined([getattr(table, name) for table in filled]) for name in cls.__dataclass_fields__])


def check_size(paths: int, points: int) -> None:
    """Raise InputError if a table of so many paths with up to `points` points each needs too much memory."""
    if paths * points > MOST_POINTS:
        raise InputError(
            f"too many paths: {paths} or more, with up to {points} points each: expected at most {MOST_POINTS} points "
            "in all, because of memory; choose a shorter range or fewer reflections"
        )


def _joined(arrays: list[NDArray[Any]]) -> NDArray[Any]:
    """Return the rows of all arrays, padded on the second axis to the longest: -1 for no surface, NaN for no point."""
    if arrays[0].ndim == 1:
        return np.concatenate(arrays)
    count, width = sum(map(len, arrays)), max(array.shape[1] for array in arrays)
    check_size(count, width)
    nothing = -1 if np.issubdtype(arrays[0].dtype, np.integer) else np.nan
    rows = np.empty((count, width, *arrays[0].shape[2:]), np.result_type(*arrays))
    first = 0
    for array in arrays:
        rows[first : first + len(array), : array.shape[1]] = array
        rows[first : first + len(array), array.shape[1] :] = nothing
        first += len(array)
    return rows


def fill_rows(
    table: NDArray[Any],
    front: NDArray[Any],
    first: NDArray[np.intp],
    count: NDArray[np.integer],
    other: NDArray[Any],
    second: NDArray[np.intp],
    other_count: NDArray[np.integer],
) -> None:
    """Fill each row of `table` from the left: `count` columns of a row of `front`, then a row of `other`, reversed.

    `first` and `second` (m,) are these rows, and `other_count` columns of `other` are used. The rest of a row is filled
    with -1, or NaN for points.
    """
    nothing = table.dtype.type(-1 if np.issubdtype(table.dtype, np.integer) else np.nan)
    if table.ndim == 2:
        table, front, other = table[:, :, None], front[:, :, None], other[:, :, None]
    counts = (np.asarray(each, np.int64) for each in (first, count, second, other_count))
    _fill(table, front, other, nothing, *counts)


@compiled
def _fill(
    table: NDArray[Any],
    front: NDArray[Any],
    other: NDArray[Any],
    nothing: Any,
    first: NDArray[np.int64],
    count: NDArray[np.int64],
    second: NDArray[np.int64],
    other_count: NDArray[np.int64],
) -> None:
    """Fill the rows of `table` (m, k, d) as `fill_rows`."""
    for row in range(table.shape[0]):
        total = count[row] + other_count[row]
        for axis in range(table.shape[2]):
            for k in range(count[row]):
                table[row, k, axis] = front[first[row], k, axis]
            for k in range(count[row], total):
                table[row, k, axis] = other[second[row], total - 1 - k, axis]
            for k in range(total, table.shape[1]):
                table[row, k, axis] = nothing


# The candidates of a fan and their sequences of surfaces, numbered in order of their first appearance. For kernels.
#
# A sequence of surfaces is the number of the sequence without its last surface, and that surface; a candidate of a
# fan is the number of its sequence, and its target. So both are found without a comparison of whole sequences. Pairs
# of numbers are found by a hash table.


_ROOM = 4096  # rows at first
_SLOTS = 4  # for each row, at first, a power of two


class CandidateTable(NamedTuple):
    """Room for candidates and sequences."""

    candidates: IntArray  # (c, 3): number of the sequence, reflections before the target, row of the target
    keys: IntArray  # (c, 2): sequence and target
    slots: IntArray  # hash table of the keys, -1 where empty
    sequences: IntArray  # (s, 2): number of the sequence without the last surface, 0 for none, and that surface
    sequence_slots: IntArray


class Fan(NamedTuple):
    """What the rays of a fan come near to, and what they touched before."""

    touched: IntArray  # (r, b): sequences of surfaces, in order, padded with -1
    candidates: IntArray  # (c, 3): row of `touched`, reflections before the target, row of the target


def no_candidates() -> CandidateTable:
    """Return an empty table."""
    keys, sequences = np.empty((2, _ROOM, 2), np.int32)
    slots, sequence_slots = np.full((2, _SLOTS * _ROOM), -1, np.int32)
    return CandidateTable(np.empty((_ROOM, 3), np.int32), keys, slots, sequences, sequence_slots)


@inlined
def is_full(table: CandidateTable, candidate_count: int, sequence_count: int) -> bool:
    """Return whether there is no room for more than `candidate_count` candidates or `sequence_count` sequences."""
    full: bool = (candidate_count == table.candidates.shape[0]) | (sequence_count == table.sequences.shape[0])
    return full


@array_part
def with_room(table: CandidateTable, candidate_count: int, sequence_count: int) -> CandidateTable:
    """Return the same table with room for twice as many of what is full."""
    candidates, keys, slots, sequences, sequence_slots = table
    if candidate_count == candidates.shape[0]:
        candidates = _longer(candidates)
        keys, slots = _grown(keys, slots)
    if sequence_count == sequences.shape[0]:
        sequences, sequence_slots = _grown(sequences, sequence_slots)
    return CandidateTable(candidates, keys, slots, sequences, sequence_slots)


@compiled
def with_other(
    table: CandidateTable, found: int, known: int, other: CandidateTable, other_found: int, other_known: int
) -> tuple[CandidateTable, int, int]:
    """Return a table with those of another one behind its own, each once, and its numbers of candidates and sequences.

    The tables have so many `found` candidates and `known` sequences.
    """
    numbers = np.empty(other_known + 1, np.int32)  # in this table, of the sequences of the other
    numbers[0] = 0
    for k in range(other_known):
        if known == table.sequences.shape[0]:
            table = with_room(table, found, known)
        before, last = numbers[other.sequences[k, 0]], other.sequences[k, 1]
        numbers[k + 1] = number_of(before, last, table.sequences, known, table.sequence_slots) + 1
        known = max(known, numbers[k + 1])
    for k in range(other_found):
        if found == table.candidates.shape[0]:
            table = with_room(table, found, known)
        sequence, target = numbers[other.keys[k, 0]], other.keys[k, 1]
        if number_of(sequence, target, table.keys, found, table.slots) == found:
            table.candidates[found, 0], table.candidates[found, 1] = sequence, other.candidates[k, 1]
            table.candidates[found, 2] = target
            found += 1
    return table, found, known


def fan_of(table: CandidateTable, found: int, known: int, places: int, targets: int) -> Fan:
    """Return the candidates with their sequences, and the direct path to every target, which rays may miss.

    The table has so many `found` candidates and `known` sequences; `targets` are those of each place. Raises InputError
    if they need too much memory.
    """
    candidates = table.candidates[:found]
    deepest = int(candidates[:, 1].max(initial=0))
    check_size(found, deepest + 2)
    touched = _touched_before(table, found, known, deepest)
    by_rays = candidates[(candidates[:, 1] > 0) | (candidates[:, 2] % targets == 0)]
    return Fan(touched, np.vstack((direct_candidates(places, targets), by_rays)))


def direct_candidates(places: int, targets: int) -> IntArray:
    """Return the candidates without reflections to every target but the receivers, which are the first of each place.

    They are (places * (targets - 1), 3).
    """
    rows = np.arange(places * targets, dtype=np.int32).reshape(places, targets)[:, 1:].ravel()
    return np.column_stack((np.zeros((len(rows), 2), np.int32), rows))


@compiled
def _touched_before(table: CandidateTable, found: int, known: int, deepest: int) -> IntArray:
    """Return each sequence of the candidates, (r, deepest), padded with -1, and replace its number by its row.

    The table has so many `found` candidates and `known` sequences; `deepest` are the most reflections of a candidate.
    """
    rows, count = np.empty(known + 1, np.int32), 0
    for k in range(known + 1):
        rows[k] = -1
    touched = np.empty((max(found, 1), deepest), np.int32)  # the system gives memory only to rows that are filled
    for k in range(found):
        sequence, bounces = table.candidates[k, 0], table.candidates[k, 1]
        if rows[sequence] < 0:
            rows[sequence] = count
            for step in range(bounces, deepest):
                touched[count, step] = -1
            before = sequence
            for step in range(bounces - 1, -1, -1):
                touched[count, step] = table.sequences[before - 1, 1]
                before = table.sequences[before - 1, 0]
            count += 1
        table.candidates[k, 0] = rows[sequence]
    return touched[: max(count, 1)]


@compiled_part
def number_of(first: int, second: int, pairs: IntArray, count: int, slots: IntArray) -> int:
    """Return the number of a pair among the first `count` of `pairs` (p, 2); if it is new, `count`, and enter it."""
    slot = _hash(first, second) & (slots.shape[0] - 1)
    while slots[slot] >= 0:
        number = int(slots[slot])
        if pairs[number, 0] == first and pairs[number, 1] == second:
            return number
        slot = (slot + 1) & (slots.shape[0] - 1)
    slots[slot] = count
    pairs[count, 0], pairs[count, 1] = first, second
    return count


@array_part
def _grown(pairs: IntArray, slots: IntArray) -> tuple[IntArray, IntArray]:
    """Return twice as many rows for pairs, and a hash table with twice as many slots; all of `pairs` are entered."""
    count = pairs.shape[0]
    more, larger = np.empty((2 * count, 2), np.int32), np.empty(2 * slots.shape[0], np.int32)
    for k in range(larger.shape[0]):
        larger[k] = -1
    for k in range(count):
        number_of(pairs[k, 0], pairs[k, 1], more, k, larger)
    return more, larger


@inlined
def _longer(candidates: IntArray) -> IntArray:
    """Return the rows with twice the capacity; numba would need a second to compile a concatenation."""
    count = candidates.shape[0]
    more = np.empty((2 * count, 3), np.int32)
    for k in range(count):
        more[k, 0], more[k, 1], more[k, 2] = candidates[k, 0], candidates[k, 1], candidates[k, 2]
    return more


@inlined
def _hash(first: int, second: int) -> int:
    mixed: int = ((first + 1) * 2654435761 ^ (second + 1) * 2246822519) & 0xFFFFFFFF
    mixed ^= mixed >> 15
    return mixed


# The ray kernel: follows a fan of rays through the room and notes where each passes the receiver or an edge.
#
# A candidate is "ray r, after its first b reflections, passes near target t". `rays.sequences` solves every candidate
# exactly, so the limit of nearness may be generous. Rays that no receiver can detect (`sonarhw_sim.rays.fan`)
# are dropped. Compiled by numba; plain arrays only.


# Distance, in ray spacings, within which a ray is a candidate. A path midway between two rays is half a spacing from
# both; the rest finds paths through gaps narrower than the spacing.
_ALLOWANCE = 1.5
WIDER = 16.0  # times this distance, if rays have slopes
_FEW_EDGES = 8  # to test so many at each leg takes less time than to look in the cells of its way
_LEAST_PART = 720  # directions: fewer take about as long as a thread needs to begin
_MOST_TOUCHES = 100_000_000  # 400 MB
_MOST_GAPS = 64
_LEFT = 1 << 40  # is added to the last sequence of a ray that leaves the room
_Numbers = NDArray[np.int64]  # as kernels compute with, so that none is compiled twice


class _Leg(NamedTuple):
    """A ray where it leaves a surface, and its state there."""

    x: float  # m
    y: float
    dx: float  # unit vector
    dy: float
    length: float  # m travelled
    width: float  # m per radian of departure: distance from its neighbour
    opening: float  # growth of that width per metre
    amplitude: float


class _Branch(NamedTuple):
    """Rays of one direction, with different slopes, that have touched the same surfaces so far."""

    direction: int  # of n * d: those of the first place, then those of the second
    begin: int  # of these rays, in the order of the workspace
    end: int
    bounces: int
    sequence: int  # number of the surfaces touched


class _Search(NamedTuple):
    """What stays the same while rays are followed: arguments of `follow_fan`, and values derived from them."""

    sources: FloatArray
    directions: FloatArray
    slopes: FloatArray  # (n * d, k), of the rays in each direction at each place
    surfaces: Surfaces
    heights: KernelHeights
    reflectances: FloatArray
    targets: FloatArray
    radii: FloatArray
    longest: FloatArray
    max_bounces: int
    edges: Listing  # the targets of a place after the first, by the cells near them
    detectable: Detectable
    spacing: float  # rad
    max_length: float  # m, of the longest path to any target
    max_return: float  # m, of the longest path to any target and straight on to the receiver
    faintest: float  # amplitude of the faintest path to any target
    steepest: FloatArray
    step: int  # directions from one ray to the next


class _Workspace(NamedTuple):
    """Arrays to fill; k slopes in each direction, t targets of each place."""

    nearby: _Numbers  # (t,): targets that a leg may pass
    is_nearby: BoolArray  # (t,): whether each is one of these; False between two legs
    order: _Numbers  # (k,): slopes of a direction, those of one branch beside each other
    touches: _Numbers  # (k,): the surface that each of them touches where the branch meets a low one; -1: passes
    waiting: _Numbers  # (k, 6): branches that wait at a surface, and that surface
    waiting_legs: FloatArray  # (k, 9): their legs to the surface, and its distance
    gaps: _Numbers  # (g, 4): rows of two directions, each with the last sequence of its ray


class Targets(NamedTuple):
    """Where rays lead: for each place a row of its receiver, then the others: edges, or walls and posts as circles.

    These are as many at each place, and the same: one that is none of a place has a longest path of -inf.
    """

    points: FloatArray  # (t, 2), m
    longest: FloatArray  # (t,), m: of the path to each
    radii: FloatArray  # (t,), m; 0 for points

    @staticmethod
    def at(points: FloatArray, longest: FloatArray) -> "Targets":
        """Return targets that are points."""
        return Targets(points, longest, np.zeros(len(points)))


def follow_fan(
    room: Room,
    sources: FloatArray,
    directions: FloatArray,
    targets: Targets,
    max_bounces: int,
    detectable: Detectable,
    passing: Passing | None = None,
    steepest: FloatArray | None = None,
    passed_below: float = 0.0,
    step: int = 1,
    until: float = math.inf,
) -> Fan:
    """Follow every ray from `sources` (n, 2) until its path is too long or too faint for every target.

    `directions` (d,) rad, evenly spaced. Rays follow one of every `step` directions, and others only between two whose
    rays touch different surfaces. With `passing` there is one source; a ray that meets one of the surfaces of `passing`
    touches or passes it, and there are several for each direction, with different slopes. Those that rise or fall more
    than `steepest` lead to the receiver only: slopes (k,) for amplitudes from 0 to 1, None for no limit. In the plan,
    rays pass posts of a radius under `passed_below` m. Rays stop where each way on to the receiver is longer than
    `until` (m).

    Returns each sequence of surfaces to a target once, and always the direct path to every target but the receiver.

    Raises InputError if rays times reflections, or the candidates, would need too much memory.
    """
    search = _search(room, sources, directions, targets, max_bounces, detectable, passing, steepest, passed_below, step)
    search = search._replace(max_return=min(search.max_return, until))
    each = len(targets.points) // len(sources)

    def followed(begin: int, end: int) -> tuple[CandidateTable, int, int]:
        space = _workspace(each, search.slopes.shape[1])
        return _follow(begin, end, search, space, no_candidates(), MOST_POINTS)

    (table, found, known), *others = in_parts(followed, len(sources) * len(directions), _LEAST_PART)
    for other in others:
        table, found, known = with_other(table, found, known, *other)
    return fan_of(table, found, known, len(sources), each)


def _no_heights(surfaces: int) -> KernelHeights:
    """Return the heights for a search in which sound passes none of so many surfaces."""
    nothing = Listing(np.zeros(surfaces + 1, np.int32), np.empty(0, np.int32))
    return KernelHeights(np.zeros(surfaces, np.bool_), np.empty((0, 2)), nothing, 0.0, 0.0, 0.0)


def _search(
    room: Room,
    sources: FloatArray,
    directions: FloatArray,
    targets: Targets,
    max_bounces: int,
    detectable: Detectable,
    passing: Passing | None,
    steepest: FloatArray | None,
    passed_below: float,
    step: int,
) -> _Search:
    """Return the arguments of `follow_fan` for kernels."""
    # what NumPy does as fast is not compiled: a call of min(), zeros() or full() in a kernel costs a tenth of a second
    # or more at its compilation
    points, longest, radii = targets
    spacing, max_length = step * float(directions[1] - directions[0]), float(longest.max())
    heights, slopes = _no_heights(len(room.reflectances)), np.zeros((len(sources) * len(directions), 1))
    first, each = np.arange(len(sources)) * (len(points) // len(sources)), len(points) // len(sources)
    surfaces = room.blocking(passed_below if passing is None else 0.0)
    if passing is not None:
        # a path has one slope, and few of the rays nearest to it have a similar one
        spacing *= WIDER
        heights, slopes = passing.heights, passing.slopes(directions)
    rays = slopes.size // len(sources)
    if rays * max_bounces > _MOST_TOUCHES:
        raise InputError(
            f"{rays} rays with up to {max_bounces} reflections each: expected at most {_MOST_TOUCHES} "
            "reflections in all, because of memory; use fewer rays or fewer reflections"
        )
    near_edges = _ALLOWANCE * spacing * max_length + radii[1:each, None]
    onward = longest + np.hypot(*(points - np.repeat(points[first], each, axis=0)).T)
    return _Search(
        sources,
        directions,
        slopes,
        surfaces,
        heights,
        room.reflectances,
        points,
        radii,
        longest,
        max_bounces,
        list_points(room.surfaces.cells, points[1:each], near_edges),
        detectable,
        spacing,
        max_length,
        float(onward.max()),
        float(detectable.least.min()),
        np.full(2, math.inf) if steepest is None else steepest,
        step,
    )


def _workspace(targets: int, slopes: int) -> _Workspace:
    order, touches = np.empty((2, slopes), np.int64)
    waiting, legs = np.empty((slopes, 6), np.int64), np.empty((slopes, 9))
    nearby, gaps = np.empty(targets, np.int64), np.empty((_MOST_GAPS, 4), np.int64)
    return _Workspace(nearby, np.zeros(targets, np.bool_), order, touches, waiting, legs, gaps)


@compiled
def _follow(
    direction: int, end: int, search: _Search, space: _Workspace, table: CandidateTable, most_points: int
) -> tuple[CandidateTable, int, int]:
    """Return the candidates of the rays from one direction up to another; and the numbers of candidates and sequences.

    They are not all, if they have more than `most_points` points in all.
    """
    found, known = 0, 0
    while True:
        direction, found, known = _follow_directions(direction, end, found, known, search, space, table)
        deepest = 0
        for k in range(found):
            deepest = max(deepest, table.candidates[k, 1])
        if direction == end or found * (deepest + 2) > most_points:
            return table, found, known
        table = with_room(table, found, known)


@compiled_part
def _follow_directions(
    first: int, end: int, found: int, known: int, search: _Search, space: _Workspace, table: CandidateTable
) -> tuple[int, int, int]:
    """Follow the rays from direction `first` up to `end`; return the direction reached, and `found` and `known` there.

    These are the numbers of candidates and of sequences in the table. Where it is full, the rays of the direction
    reached have to be followed again, which changes no candidate.
    """
    # this part makes no arrays: growing them here would cost 10 to 25 % of the time
    before, count = -1, search.directions.shape[0]
    for direction in range(first, end):
        row = direction % count
        if row % search.step > 0:
            continue
        if search.step > 1 and (before < 0 or row == 0):
            # the direction before the first one of a place is its last one
            earlier = direction - search.step if row > 0 else direction + (count - 1) // search.step * search.step
            found, known, before = _follow_ray(earlier, found, known, search, space, table)
            if is_full(table, found, known):
                return direction, found, known
        found, known, last = _follow_ray(direction, found, known, search, space, table)
        if search.step > 1 and not _are_alike(before, last, table):
            place = direction - row
            low = row - search.step if row > 0 else (count - 1) // search.step * search.step
            found, known = _follow_between(
                place, low, before, row if row > 0 else count, last, found, known, search, space, table
            )
        before = last
        if is_full(table, found, known):
            return direction, found, known
    return end, found, known


@compiled_part
def _follow_between(
    place: int,
    row: int,
    last: int,
    next_row: int,
    next_last: int,
    found: int,
    known: int,
    search: _Search,
    space: _Workspace,
    table: CandidateTable,
) -> tuple[int, int]:
    """Follow rays between two rows of directions whose rays meet different surfaces; return `found` and `known`.

    `place` is the first direction of the place; `last` and `next_last` are the last sequences of both rays. The gap is
    halved until it is that between two neighbours, wherever the rays on both sides of it differ.
    """
    gaps, count = space.gaps, 1
    gaps[0, 0], gaps[0, 1], gaps[0, 2], gaps[0, 3] = row, last, next_row, next_last
    while count > 0 and not is_full(table, found, known):
        count -= 1
        low, of_low, high, of_high = gaps[count, 0], gaps[count, 1], gaps[count, 2], gaps[count, 3]
        middle = (low + high) // 2
        if middle == low:
            continue
        found, known, of_middle = _follow_ray(place + middle, found, known, search, space, table)
        if not _are_alike(of_low, of_middle, table):
            gaps[count, 0], gaps[count, 1], gaps[count, 2], gaps[count, 3] = low, of_low, middle, of_middle
            count += 1
        if not _are_alike(of_middle, of_high, table):
            gaps[count, 0], gaps[count, 1], gaps[count, 2], gaps[count, 3] = middle, of_middle, high, of_high
            count += 1
    return found, known


@inlined
def _are_alike(last: int, other: int, table: CandidateTable) -> bool:
    """Return whether two rays touch the same surfaces, but for the last one of each before the limit of length."""
    if last == other:
        return True
    if max(last, other) >= _LEFT:
        return False
    shorter, longer = min(last, other), max(last, other)  # a sequence is numbered after those that it continues
    before = table.sequences[longer - 1, 0]
    alike: bool = before == shorter or (shorter > 0 and before == table.sequences[shorter - 1, 0])
    return alike


@compiled_part
def _follow_ray(
    direction: int, found: int, known: int, search: _Search, space: _Workspace, table: CandidateTable
) -> tuple[int, int, int]:
    """Follow the rays of one direction until the table is full.

    Returns `found`, `known` and the last sequence, a larger number if the ray leaves the room.
    """
    place, row = direction // search.directions.shape[0], direction % search.directions.shape[0]
    leaving, angle = search.detectable.leaving[place, row], search.directions[row]
    if leaving <= search.faintest:
        return found, known, 0
    x, y = search.sources[place, 0], search.sources[place, 1]
    leg = _Leg(x, y, math.cos(angle), math.sin(angle), 0.0, 0.0, 1.0, leaving)
    return _follow_direction(direction, leg, found, known, search, space, table)


@inlined
def _follow_direction(
    direction: int, leg: _Leg, found: int, known: int, search: _Search, space: _Workspace, table: CandidateTable
) -> tuple[int, int, int]:
    """Return the result of `_follow_ray` for rays that begin with a leg."""
    walls, posts, cells, (starts, numbers) = search.surfaces
    branch = _whole_branch(direction, space)
    # a plain -1 has a type of its own, for which `first_among` would be compiled once more
    surface: int = np.int64(-1)  # type: ignore[assignment]
    following: int = np.int64(-1)  # type: ignore[assignment]
    distance, flattest, waiting, going = 0.0, _flattest(branch, search, space), 0, True
    place, receiver = _place_and_receiver(direction, search)
    while going or waiting > 0:
        if going:
            distance, following = first_among(
                leg.x, leg.y, leg.dx, leg.dy, surface, walls, posts, cells, starts, numbers
            )
            edges_too = flattest == 0.0 or flattest <= search.steepest[_step(leg.amplitude, search.steepest.shape[0])]
            found = _note_targets(place, receiver, leg, distance, branch, edges_too, found, search, space, table)
            if is_full(table, found, known):
                break
            going = _can_return(receiver, leg, distance, search)
        else:
            waiting -= 1
            branch, leg, distance, following = _resumed(waiting, space)
            flattest, going = _flattest(branch, search, space), True
        if not going:
            continue

        # pass the surface, if it is not as high as the ray is there
        surface = following
        if search.heights.low[following]:
            branch, waiting = _divided(branch, leg, distance, following, waiting, search, space)
            flattest, following = _flattest(branch, search, space), space.touches[branch.begin]
            if following < 0:
                leg = _passed(leg, distance)
                continue

        # reflect, and stop where the sound is too faint; sound spread by a post only gets fainter
        going = branch.bounces < search.max_bounces
        if going:
            leg = _reflected(leg, distance, following, search.reflectances[following], walls, posts)
            # 0 in a search for all headings, in which the root would take a tenth of the time
            louder = search.faintest == 0.0 or leg.amplitude * math.sqrt(leg.length / leg.width) > search.faintest
            going = louder and leg.amplitude > 0.0
        if going:
            surface = following
            branch = _reflected_branch(branch, following, known, table)
            known = max(known, branch.sequence)
            if is_full(table, found, known):
                break
    return found, known, branch.sequence if distance < np.inf else branch.sequence + _LEFT


@inlined
def _place_and_receiver(direction: int, search: _Search) -> tuple[int, int]:
    """Return the row of the place of a direction, and the row of its receiver among the targets."""
    place = direction // search.directions.shape[0]
    return place, place * (search.targets.shape[0] // search.sources.shape[0])


@inlined
def _note_targets(
    place: int,
    receiver: int,
    leg: _Leg,
    distance: float,
    branch: _Branch,
    edges_too: bool,
    found: int,
    search: _Search,
    space: _Workspace,
    table: CandidateTable,
) -> int:
    """Enter every target that a leg passes, until the table is full; return `found`.

    The receiver is none of them on the first leg if that starts there.
    """
    sources, targets = search.sources, search.targets
    reach = min(distance, search.max_length - leg.length)
    passed = _edges_along(leg, reach, search, space) if edges_too else 0
    is_there = targets[receiver, 0] == sources[place, 0] and targets[receiver, 1] == sources[place, 1]
    if branch.bounces > 0 or not is_there:
        space.nearby[passed] = 0
        passed += 1
    for k in range(passed):
        target = receiver + space.nearby[k]
        if not _passes(place, receiver, leg, reach, target, search):
            continue
        if number_of(branch.sequence, target, table.keys, found, table.slots) == found:
            table.candidates[found, 0], table.candidates[found, 1] = branch.sequence, branch.bounces
            table.candidates[found, 2] = target
            found += 1
            if found == table.candidates.shape[0]:
                break
    return found


@inlined
def _passes(place: int, receiver: int, leg: _Leg, reach: float, target: int, search: _Search) -> bool:
    """Return whether a leg passes near a target, and its path there is neither too long nor too faint."""
    tx, ty = search.targets[target, 0] - leg.x, search.targets[target, 1] - leg.y
    ahead, aside = tx * leg.dx + ty * leg.dy, abs(tx * leg.dy - ty * leg.dx)
    distance_ahead = max(ahead, 0.0)
    width = leg.width + leg.opening * distance_ahead
    near = _ALLOWANCE * search.spacing * width + search.radii[target]
    if not (-near <= ahead <= reach + near and aside <= near) or leg.length + ahead > search.longest[target] + near:
        return False
    loudest = leg.amplitude * math.sqrt((leg.length + distance_ahead) / width)
    if target == receiver:
        loudest *= _most_received(place, leg, search.spacing, search.detectable)
    # at the start of the first leg, the tube has no width, and `loudest` is not a number
    return not loudest <= search.detectable.least[target]


@inlined
def _most_received(place: int, leg: _Leg, spacing: float, detectable: Detectable) -> float:
    """Return the largest beam factor of the receiver for the directions of a tube."""
    cosine = -leg.dx * detectable.axes[place, 0] - leg.dy * detectable.axes[place, 1]
    aside = max(math.acos(min(max(cosine, -1.0), 1.0)) - _ALLOWANCE * spacing * leg.opening, 0.0)
    most: float = detectable.receiving[int(aside / math.pi * (detectable.receiving.shape[0] - 1))]
    return most


@inlined
def _can_return(receiver: int, leg: _Leg, distance: float, search: _Search) -> bool:
    """Return whether a path is in the room at `distance` ahead, not too long, and near enough to return in time."""
    if leg.length + distance > search.max_length:
        return False
    target_x, target_y = search.targets[receiver, 0], search.targets[receiver, 1]
    x, y = target_x - leg.x - distance * leg.dx, target_y - leg.y - distance * leg.dy
    home = math.sqrt(x * x + y * y)
    width = leg.width + leg.opening * (distance + home)
    return leg.length + distance + home - _ALLOWANCE * search.spacing * width <= search.max_return


@inlined
def _whole_branch(direction: int, space: _Workspace) -> _Branch:
    """Return the branch of all rays of a direction at departure."""
    count = space.order.shape[0]
    for k in range(count):
        space.order[k] = k
    return _Branch(direction, 0, count, 0, 0)


@inlined
def _step(amplitude: float, steps: int) -> int:
    """Return the first of so many steps from 0 to 1 that is not below an amplitude."""
    return min(math.ceil(amplitude * (steps - 1)), steps - 1)


@compiled_part
def _flattest(branch: _Branch, search: _Search, space: _Workspace) -> float:
    """Return the least slope, up or down, of the rays of a branch."""
    least = np.inf
    for k in range(branch.begin, branch.end):
        least = min(least, abs(search.slopes[branch.direction, space.order[k]]))
    return least


@inlined
def _divided(
    branch: _Branch, leg: _Leg, distance: float, surface: int, waiting: int, search: _Search, space: _Workspace
) -> tuple[_Branch, int]:
    """Return those rays of a branch that touch the same as its first one, at a low surface, and how many branches wait.

    The other rays of the branch wait from now on.
    """
    middle = _part(branch, leg, distance, surface, search, space)
    if middle == branch.end:
        return branch, waiting
    rest = _Branch(branch.direction, middle, branch.end, branch.bounces, branch.sequence)
    for k in range(len(rest)):
        space.waiting[waiting, k] = rest[k]
    for k in range(len(leg)):
        space.waiting_legs[waiting, k] = leg[k]
    space.waiting[waiting, len(rest)], space.waiting_legs[waiting, len(leg)] = surface, distance
    kept = _Branch(branch.direction, branch.begin, middle, branch.bounces, branch.sequence)
    return kept, waiting + 1


@compiled_part
def _part(branch: _Branch, leg: _Leg, distance: float, surface: int, search: _Search, space: _Workspace) -> int:
    """Move the rays of a branch that touch the same as its first one, at a low surface, to its front.

    Returns the end of these rays.
    """
    x, y, length = leg.x + distance * leg.dx, leg.y + distance * leg.dy, leg.length + distance
    slopes, order, touches, middle = search.slopes[branch.direction], space.order, space.touches, branch.begin
    for k in range(branch.begin, branch.end):
        touches[k] = surface_at(x, y, slopes[order[k]] * length, surface, search.heights, search.surfaces.walls)
        if touches[k] == touches[branch.begin]:
            order[k], order[middle] = order[middle], order[k]
            touches[k], touches[middle] = touches[middle], touches[k]
            middle += 1
    return middle


@inlined
def _resumed(row: int, space: _Workspace) -> tuple[_Branch, _Leg, float, int]:
    """Return the branch that waits in this row, its leg, and distance and number of the surface that it meets."""
    b, leg = space.waiting[row], space.waiting_legs[row]
    branch = _Branch(b[0], b[1], b[2], b[3], b[4])
    return branch, _Leg(leg[0], leg[1], leg[2], leg[3], leg[4], leg[5], leg[6], leg[7]), leg[8], b[5]


@inlined
def _reflected_branch(branch: _Branch, surface: int, known: int, table: CandidateTable) -> _Branch:
    """Return the branch after it has touched one more surface; the sequence may be new, as number `known` + 1."""
    sequence = number_of(branch.sequence, surface, table.sequences, known, table.sequence_slots) + 1
    return _Branch(branch.direction, branch.begin, branch.end, branch.bounces + 1, sequence)


@inlined
def _passed(leg: _Leg, distance: float) -> _Leg:
    """Return the leg from `distance` on, where the tube is wider."""
    x, y, width = leg.x + distance * leg.dx, leg.y + distance * leg.dy, leg.width + leg.opening * distance
    return _Leg(x, y, leg.dx, leg.dy, leg.length + distance, width, leg.opening, leg.amplitude)


@compiled_part
def _reflected(
    leg: _Leg, distance: float, surface: int, reflectance: float, walls: FloatArray, posts: FloatArray
) -> _Leg:
    """Return the leg after the reflection at `distance`, where the tube is wider."""
    x, y, width = leg.x + distance * leg.dx, leg.y + distance * leg.dy, leg.width + leg.opening * distance
    dx, dy, curvature = reflect(x, y, leg.dx, leg.dy, surface, walls, posts)
    opening = leg.opening + curvature * width
    return _Leg(x, y, dx, dy, leg.length + distance, width, opening, leg.amplitude * reflectance)


@inlined
def _edges_along(leg: _Leg, reach: float, search: _Search, space: _Workspace) -> int:
    """Fill in the targets of a place (edge k is target k + 1) that a leg may pass; return their number.

    An edge is listed in every cell from which a ray without posts could be near it, and taken once. A tube spread by a
    post is wider, so all edges are targets. So are all if they are few.
    """
    cells, nearby, is_nearby, count = search.surfaces.cells, space.nearby, space.is_nearby, 0
    if leg.opening > 1.0 or nearby.shape[0] - 1 <= _FEW_EDGES:
        for k in range(nearby.shape[0] - 1):
            nearby[k] = k + 1
        return int(nearby.shape[0] - 1)
    if search.edges.numbers.shape[0] == 0:
        return 0
    walk = enter(cells, leg.x, leg.y, leg.dx, leg.dy)
    while walk.inside:
        for k in listed(cells, search.edges, walk):
            if not is_nearby[k + 1]:
                is_nearby[k + 1], nearby[count] = True, k + 1
                count += 1
        if min(walk.next_column, walk.next_row) > reach:
            break
        walk = advance(cells, walk)
    for k in range(count):
        is_nearby[nearby[k]] = False
    return count


def fan(rays: int, heading: float | None = None) -> FloatArray:
    """Return the directions of `rays` evenly spaced rays, (rays,) rad; with `heading` (rad) those within 90° of it.

    They are turned by an irrational fraction of the spacing, so that in symmetric rooms no ray meets a vertex exactly.
    """
    all_round = (np.arange(rays, dtype=np.float64) + (math.sqrt(5) - 1) / 2) * (math.tau / rays)
    if heading is None:
        return all_round
    aside = np.sort(angle_difference(all_round, heading))
    return heading + aside[np.abs(aside) < math.pi / 2]
