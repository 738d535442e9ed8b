"""The ray kernel: follows a fan of rays through the room and notes where each passes the receiver or an edge.

A candidate is "ray r, after its first b reflections, passes near target t". `rays.sequences` solves every candidate
exactly, so the limit of nearness may be generous. Rays that no receiver can detect (`sonarhw_sim.rays.detectable`) are
dropped. Compiled by numba; plain arrays only.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sonarhw.errors import InputError
from sonarhw.readings import FloatArray
from sonarhw_sim.compiled import compiled, compiled_part, inlined
from sonarhw_sim.cores import in_parts
from sonarhw_sim.rays import path_table
from sonarhw_sim.rays.candidate_table import (
    CandidateTable,
    Fan,
    fan_of,
    is_full,
    no_candidates,
    number_of,
    with_other,
    with_room,
)
from sonarhw_sim.rays.detectable import Detectable
from sonarhw_sim.rays.first_surface import first_among, reflect
from sonarhw_sim.rays.passing import BoolArray, KernelHeights, Passing, no_heights, surface_at
from sonarhw_sim.room.grid import Listing, Surfaces, advance, enter, list_points, listed
from sonarhw_sim.room.model import Room

# Distance, in ray spacings, within which a ray is a candidate. A path midway between two rays is half a spacing from
# both; the rest finds paths through gaps narrower than the spacing.
_ALLOWANCE = 1.5
WIDER = 16.0  # times this distance, if rays have slopes
_FEW_EDGES = 8  # to test so many at each leg takes less time than to look in the cells of its way
_LEAST_PART = 720  # directions: fewer take about as long as a thread needs to begin
_MOST_TOUCHES = 100_000_000  # 400 MB
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

    direction: int
    begin: int  # of these rays, in the order of the workspace
    end: int
    bounces: int
    sequence: int  # number of the surfaces touched


class _Search(NamedTuple):
    """What stays the same while rays are followed: arguments of `follow_fan`, and values derived from them."""

    source: FloatArray
    directions: FloatArray
    slopes: FloatArray  # (n, k), of the rays in each direction
    surfaces: Surfaces
    heights: KernelHeights
    reflectances: FloatArray
    targets: FloatArray
    radii: FloatArray
    longest: FloatArray
    max_bounces: int
    edges: Listing  # the targets after the first, by the cells near them
    detectable: Detectable
    spacing: float  # rad
    max_length: float  # m, of the longest path to any target
    max_return: float  # m, of the longest path to any target and straight on to the receiver
    faintest: float  # amplitude of the faintest path to any target
    steepest: FloatArray


class _Workspace(NamedTuple):
    """Arrays to fill; k slopes in each direction, t targets."""

    nearby: _Numbers  # (t,): targets that a leg may pass
    is_nearby: BoolArray  # (t,): whether each is one of these; False between two legs
    order: _Numbers  # (k,): slopes of a direction, those of one branch beside each other
    touches: _Numbers  # (k,): the surface that each of them touches where the branch meets a low one; -1: passes
    waiting: _Numbers  # (k, 6): branches that wait at a surface, and that surface
    waiting_legs: FloatArray  # (k, 9): their legs to the surface, and its distance


class Targets(NamedTuple):
    """Where rays lead: row 0 is the receiver, the others are edges, or walls and posts as circles."""

    points: FloatArray  # (t, 2), m
    longest: FloatArray  # (t,), m: of the path to each
    radii: FloatArray  # (t,), m; 0 for points

    @staticmethod
    def at(points: FloatArray, longest: FloatArray) -> "Targets":
        """Return targets that are points."""
        return Targets(points, longest, np.zeros(len(points)))


def follow_fan(
    room: Room,
    source: FloatArray,
    directions: FloatArray,
    targets: Targets,
    max_bounces: int,
    detectable: Detectable,
    passing: Passing | None = None,
    steepest: FloatArray | None = None,
) -> Fan:
    """Follow every ray from `source` (2,) until its path is too long or too faint for every target.

    `directions` (n,) rad, evenly spaced. A ray that meets one of the surfaces of `passing` touches or passes it, and
    there are several for each direction, with different slopes. Those that rise or fall more than `steepest` lead to
    the receiver only: slopes (k,) for amplitudes from 0 to 1, None for no limit.

    Returns each sequence of surfaces to a target once, and always the direct path to every target but the receiver.

    Raises InputError if rays times reflections, or the candidates, would need too much memory.
    """
    search = _search(room, source, directions, targets, max_bounces, detectable, passing, steepest)

    def followed(begin: int, end: int) -> tuple[CandidateTable, int, int]:
        space = _workspace(len(targets.points), search.slopes.shape[1])
        return _follow(begin, end, search, space, no_candidates(), path_table.MOST_POINTS)

    (table, found, known), *others = in_parts(followed, len(directions), _LEAST_PART)
    for other in others:
        table, found, known = with_other(table, found, known, *other)
    return fan_of(table, found, known, len(targets.points))


def _search(
    room: Room,
    source: FloatArray,
    directions: FloatArray,
    targets: Targets,
    max_bounces: int,
    detectable: Detectable,
    passing: Passing | None,
    steepest: FloatArray | None,
) -> _Search:
    """Return the arguments of `follow_fan` for kernels."""
    # what NumPy does as fast is not compiled: a call of min(), zeros() or full() in a kernel costs a tenth of a second
    # or more at its compilation
    points, longest, radii = targets
    spacing, max_length = float(directions[1] - directions[0]), float(longest.max())
    heights, slopes = no_heights(len(room.reflectances)), np.zeros((len(directions), 1))
    if passing is not None:
        # a path has one slope, and few of the rays nearest to it have a similar one
        spacing *= WIDER
        heights, slopes = passing.heights, passing.slopes(directions)
    if slopes.size * max_bounces > _MOST_TOUCHES:
        raise InputError(
            f"{slopes.size} rays with up to {max_bounces} reflections each: expected at most {_MOST_TOUCHES} "
            "reflections in all, because of memory; use fewer rays or fewer reflections"
        )
    near_edges = _ALLOWANCE * spacing * max_length + radii[1:, None]
    onward = longest[1:] + np.hypot(*(points[1:] - points[0]).T)
    return _Search(
        source,
        directions,
        slopes,
        room.surfaces,
        heights,
        room.reflectances,
        points,
        radii,
        longest,
        max_bounces,
        list_points(room.surfaces.cells, points[1:], near_edges),
        detectable,
        spacing,
        max_length,
        float(np.append(onward, longest[0]).max()),
        float(detectable.least.min()),
        np.full(2, math.inf) if steepest is None else steepest,
    )


def _workspace(targets: int, slopes: int) -> _Workspace:
    order, touches = np.empty((2, slopes), np.int64)
    waiting, legs = np.empty((slopes, 6), np.int64), np.empty((slopes, 9))
    return _Workspace(np.empty(targets, np.int64), np.zeros(targets, np.bool_), order, touches, waiting, legs)


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
    for direction in range(first, end):
        leaving = search.detectable.leaving[direction]
        if leaving > search.faintest:
            dx, dy = math.cos(search.directions[direction]), math.sin(search.directions[direction])
            leg = _Leg(search.source[0], search.source[1], dx, dy, 0.0, 0.0, 1.0, leaving)
            found, known = _follow_direction(direction, leg, found, known, search, space, table)
            if is_full(table, found, known):
                return direction, found, known
    return end, found, known


@inlined
def _follow_direction(
    direction: int, leg: _Leg, found: int, known: int, search: _Search, space: _Workspace, table: CandidateTable
) -> tuple[int, int]:
    """Follow the rays of one direction until the table is full; return `found` and `known`."""
    walls, posts, cells, (starts, numbers) = search.surfaces
    branch = _whole_branch(direction, space)
    # a plain -1 has a type of its own, for which `first_among` would be compiled once more
    surface: int = np.int64(-1)  # type: ignore[assignment]
    following: int = np.int64(-1)  # type: ignore[assignment]
    distance, flattest, waiting, going = 0.0, _flattest(branch, search, space), 0, True
    while going or waiting > 0:
        if going:
            distance, following = first_among(
                leg.x, leg.y, leg.dx, leg.dy, surface, walls, posts, cells, starts, numbers
            )
            edges_too = flattest <= search.steepest[_step(leg.amplitude, search.steepest.shape[0])]
            found = _note_targets(leg, distance, branch, edges_too, found, search, space, table)
            if is_full(table, found, known):
                break
            going = _can_return(leg, distance, search)
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
            going = leg.amplitude * math.sqrt(leg.length / leg.width) > search.faintest
        if going:
            surface = following
            branch = _reflected_branch(branch, following, known, table)
            known = max(known, branch.sequence)
            if is_full(table, found, known):
                break
    return found, known


@inlined
def _note_targets(
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
    source, targets = search.source, search.targets
    reach = min(distance, search.max_length - leg.length)
    passed = _edges_along(leg, reach, search, space) if edges_too else 0
    if branch.bounces > 0 or targets[0, 0] != source[0] or targets[0, 1] != source[1]:
        space.nearby[passed] = 0
        passed += 1
    for k in range(passed):
        target = space.nearby[k]
        if not _passes(leg, reach, target, search):
            continue
        if number_of(branch.sequence, target, table.keys, found, table.slots) == found:
            table.candidates[found, 0], table.candidates[found, 1] = branch.sequence, branch.bounces
            table.candidates[found, 2] = target
            found += 1
            if found == table.candidates.shape[0]:
                break
    return found


@inlined
def _passes(leg: _Leg, reach: float, target: int, search: _Search) -> bool:
    """Return whether a leg passes near a target, and its path there is neither too long nor too faint."""
    tx, ty = search.targets[target, 0] - leg.x, search.targets[target, 1] - leg.y
    ahead, aside = tx * leg.dx + ty * leg.dy, abs(tx * leg.dy - ty * leg.dx)
    on = max(ahead, 0.0)
    width = leg.width + leg.opening * on
    near = _ALLOWANCE * search.spacing * width + search.radii[target]
    if not (-near <= ahead <= reach + near and aside <= near) or leg.length + ahead > search.longest[target] + near:
        return False
    loudest = leg.amplitude * math.sqrt((leg.length + on) / width)
    if target == 0:
        loudest *= _most_received(leg, search.spacing, search.detectable)
    # at the start of the first leg, the tube has no width, and `loudest` is not a number
    return not loudest <= search.detectable.least[target]


@inlined
def _most_received(leg: _Leg, spacing: float, detectable: Detectable) -> float:
    """Return the largest beam factor of the receiver for the directions of a tube."""
    cosine = -leg.dx * detectable.axis_x - leg.dy * detectable.axis_y
    aside = max(math.acos(min(max(cosine, -1.0), 1.0)) - _ALLOWANCE * spacing * leg.opening, 0.0)
    most: float = detectable.receiving[int(aside / math.pi * (detectable.receiving.shape[0] - 1))]
    return most


@inlined
def _can_return(leg: _Leg, distance: float, search: _Search) -> bool:
    """Return whether a path is in the room at `distance` ahead, not too long, and near enough to return in time."""
    if leg.length + distance > search.max_length:
        return False
    x, y = search.targets[0, 0] - leg.x - distance * leg.dx, search.targets[0, 1] - leg.y - distance * leg.dy
    home = math.hypot(x, y)
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
    """Fill in the targets (edge k is target k + 1) that a leg may pass; return their number.

    An edge is listed in every cell from which a ray without posts could be near it, and taken once. A tube spread by a
    post is wider, so all edges are targets. So are all if they are few.
    """
    cells, nearby, is_nearby, count = search.surfaces.cells, space.nearby, space.is_nearby, 0
    if leg.opening > 1.0 or search.targets.shape[0] - 1 <= _FEW_EDGES:
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
    aside = np.sort((all_round - heading + math.pi) % math.tau - math.pi)
    return heading + aside[np.abs(aside) < math.pi / 2]
