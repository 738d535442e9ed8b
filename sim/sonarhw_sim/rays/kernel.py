"""The ray kernel: follows a fan of rays through the room and notes where each passes the receiver or an edge.

A candidate is "ray r, after its first b reflections, passes near target t". `rays.sequences` solves every candidate
exactly, so the limit of nearness may be generous. Rays that no receiver can detect (`sonarhw_sim.rays.detectable`) are
dropped. Compiled by numba; plain arrays only.
"""

import math
from typing import NamedTuple

import numpy as np

from sonarhw.errors import InputError
from sonarhw.readings import FloatArray
from sonarhw_sim.compiled import compiled, compiled_part, inlined
from sonarhw_sim.rays import path_table
from sonarhw_sim.rays.candidate_table import grown, longer, number_of
from sonarhw_sim.rays.detectable import Detectable
from sonarhw_sim.rays.first_surface import first_among, reflect
from sonarhw_sim.rays.passing import KernelHeights, Passing, no_heights, surface_at
from sonarhw_sim.room.grid import Cells, IntArray, Listing, Surfaces, advance, enter, list_points, listed

# Distance, in ray spacings, within which a ray is a candidate. A path midway between two rays is half a spacing from
# both; the rest finds paths through gaps narrower than the spacing.
ALLOWANCE = 1.5
WIDER = 16.0  # times this distance, if rays have slopes
_MOST_TOUCHES = 100_000_000  # 400 MB


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


class Fan(NamedTuple):
    """What the rays of a fan touch and come near to, one row each."""

    touched: IntArray  # (r, b): surfaces, in order, padded with -1
    candidates: IntArray  # (c, 3): row, reflections before the target, row of the target
    directions: FloatArray  # (r,), rad


def follow_fan(
    source: FloatArray,
    directions: FloatArray,
    surfaces: Surfaces,
    reflectances: FloatArray,
    targets: FloatArray,
    longest: FloatArray,
    max_bounces: int,
    detectable: Detectable,
    radii: FloatArray | None = None,
    passing: Passing | None = None,
    steepest: float = math.inf,
) -> Fan:
    """Follow every ray until its path is too long or too faint for every target.

    `directions` (n,) rad, evenly spaced; `targets` (t, 2): row 0 the receiver, the others edges or the centres of
    posts; `longest` (t,) m; `radii` (t,) m of the targets, None for points. A ray that meets one of the surfaces of
    `passing` touches or passes it, and there are several for each direction, with different slopes. Those that rise or
    fall more than `steepest` lead to the receiver only.

    Returns each sequence of surfaces to a target once.

    Raises InputError if rays times reflections, or the candidates, would need too much memory.
    """
    # what NumPy does as fast is not compiled: a call of min(), zeros() or full() in a kernel costs a tenth of a second
    # or more at its compilation
    spacing, max_length = float(directions[1] - directions[0]), float(longest.max())
    to_receiver = np.hypot(*(targets[1:] - targets[0]).T)
    radii = np.zeros(len(targets)) if radii is None else radii
    heights, slopes = no_heights(len(reflectances)), np.zeros((len(directions), 1))
    if passing is not None:
        # a path has one slope, and few of the rays nearest to it have a similar one
        spacing *= WIDER
        heights, slopes = passing.heights, passing.slopes(directions)
    if slopes.size * max_bounces > _MOST_TOUCHES:
        raise InputError(
            f"{slopes.size} rays with up to {max_bounces} reflections each: expected at most {_MOST_TOUCHES} "
            "reflections in all, because of memory; use fewer rays or fewer reflections"
        )
    touched = np.empty((slopes.size, max_bounces), np.int32)
    candidates = _follow(
        source,
        directions,
        slopes,
        surfaces,
        heights,
        reflectances,
        targets,
        radii,
        longest,
        detectable,
        list_points(surfaces.cells, targets[1:], ALLOWANCE * spacing * max_length + radii[1:, None]),
        touched,
        np.full((2, 4096), -1, np.int32),
        np.zeros(len(targets), np.int32),
        spacing,
        max_length,
        float(np.append(longest[1:] + to_receiver, longest[0]).max()),
        float(detectable.least.min()),
        steepest,
        path_table.MOST_POINTS,
    )
    path_table.check_size(len(candidates), int(candidates[:, 1].max(initial=0)) + 2)
    return Fan(touched, candidates, np.repeat(directions, slopes.shape[1]))


@compiled
def _follow(
    source: FloatArray,
    directions: FloatArray,
    slopes: FloatArray,
    surfaces: Surfaces,
    heights: KernelHeights,
    reflectances: FloatArray,
    targets: FloatArray,
    radii: FloatArray,
    longest: FloatArray,
    detectable: Detectable,
    edges: Listing,
    touched: IntArray,
    slots: IntArray,
    met: IntArray,
    spacing: float,
    max_length: float,
    max_return: float,
    faintest: float,
    steepest: float,
    most_points: int,
) -> IntArray:
    """Fill `touched` (n k, b) and return the candidates of `follow_fan`, up to `most_points` points in all.

    `slopes` (n, k) are the slopes of the rays in each direction; row d k + j of `touched` belongs to slope j of
    direction d. Rays with different slopes are one ray until they meet a surface that only some of them pass, and only
    one row is filled for them. `edges` lists the targets after the first, by the cells near them; `slots` (2, n) are
    hash tables, all -1; `met` (t,) is all 0; `max_return` is the length of the longest path to any target and straight
    on to the receiver, m.
    """
    # one long function: passing growing lists between compiled functions costs 5 to 20 % of the time
    walls, posts, cells, (starts, numbers) = surfaces
    leaving, least, axis_x, axis_y, receiving = detectable
    max_bounces, count = touched.shape[1], slopes.shape[1]
    candidates, misses, found = np.empty((1024, 3), np.int32), np.empty(1024), 0
    keys, sequences, known = np.empty((1024, 2), np.int32), np.empty((1024, 2), np.int32), 0
    key_slots, sequence_slots = slots
    nearby, leg_number = np.empty(targets.shape[0], np.int32), 0
    deepest = 0
    same_transducer = targets[0, 0] == source[0] and targets[0, 1] == source[1]
    # branches that wait, at the surface that they meet: the leg to it, and in whole numbers the rest
    order, met_by = np.empty(count, np.int32), np.empty(count, np.int32)
    legs, states = np.empty((count, 10)), np.empty((count, 6), np.int32)
    for direction in range(directions.shape[0]):
        if leaving[direction] <= faintest:
            continue
        for k in range(count):
            order[k] = k
        begin, end, waiting = 0, count, 0
        flattest, ray = _flattest(slopes[direction], order, begin, end), direction * count
        touched[ray] = -1
        dx, dy = math.cos(directions[direction]), math.sin(directions[direction])
        leg = _Leg(source[0], source[1], dx, dy, 0.0, 0.0, 1.0, leaving[direction])
        # a plain -1 has a type of its own, for which `first_among` would be compiled once more
        surface: int = np.int64(-1)  # type: ignore[assignment]
        following: int = np.int64(-1)  # type: ignore[assignment]
        bounces, distance, at_surface, sequence = 0, 0.0, False, 0
        while True:
            going = True
            if not at_surface:
                # find the next surface
                distance, following = first_among(
                    leg.x, leg.y, leg.dx, leg.dy, surface, walls, posts, cells, starts, numbers
                )
                reach = min(distance, max_length - leg.length)

                # note every target that this leg passes; not the receiver on the first leg if that starts there
                leg_number += 1
                passed = 0
                if flattest <= steepest:
                    passed = _edges_along(
                        leg.x, leg.y, leg.dx, leg.dy, reach, leg.opening > 1.0, cells, edges, nearby, met, leg_number
                    )
                if bounces > 0 or not same_transducer:
                    nearby[passed] = 0
                    passed += 1
                for k in range(passed):
                    target = nearby[k]
                    tx, ty = targets[target, 0], targets[target, 1]
                    miss, loudest = _passes(leg, reach, tx, ty, radii[target], longest[target], spacing)
                    if target == 0 and miss >= 0.0:
                        loudest *= _most_received(leg, axis_x, axis_y, spacing, receiving)
                    if miss < 0.0 or loudest <= least[target]:
                        continue
                    if found == candidates.shape[0]:
                        candidates, misses = longer(candidates, misses)
                        keys, key_slots = grown(keys, key_slots)
                    number = number_of(sequence, target, keys, found, key_slots)
                    # of equal candidates, the ray that passes nearest in widths of its tube is kept: where posts spread
                    # the tube, only that ray leads to the exact path
                    if number == found or miss < misses[number]:
                        candidates[number, 0], candidates[number, 1], candidates[number, 2] = ray, bounces, target
                        misses[number] = miss
                    found = max(found, number + 1)
                    if bounces > deepest:
                        deepest = bounces
                    if found * (deepest + 2) > most_points:
                        return candidates[:found]

                # stop where the path leaves the room, is long enough or can no longer return in time
                going = leg.length + distance <= max_length
                if going:
                    going = _shortest_return(leg, distance, targets[0, 0], targets[0, 1], spacing) <= max_return

            at_surface = False
            if going:
                # pass the surface, if it is not as high as the ray is there
                surface = following
                if heights.low[following]:
                    x, y = leg.x + distance * leg.dx, leg.y + distance * leg.dy
                    for k in range(begin, end):
                        climb = slopes[direction, order[k]] * (leg.length + distance)
                        met_by[k] = surface_at(x, y, climb, following, heights, walls)
                    middle = _parted(met_by, order, begin, end)
                    if middle < end:
                        legs[waiting, 0], legs[waiting, 1] = leg.x, leg.y
                        legs[waiting, 2], legs[waiting, 3] = leg.dx, leg.dy
                        legs[waiting, 4], legs[waiting, 5], legs[waiting, 6] = leg.length, leg.width, leg.opening
                        legs[waiting, 7], legs[waiting, 8] = leg.amplitude, distance
                        states[waiting, 0], states[waiting, 1], states[waiting, 2] = middle, end, bounces
                        states[waiting, 3], states[waiting, 4] = following, direction * count + order[middle]
                        states[waiting, 5] = sequence
                        touched[states[waiting, 4]] = touched[ray]
                        legs[waiting, 9] = _flattest(slopes[direction], order, middle, end)
                        waiting += 1
                        end = middle
                        flattest = _flattest(slopes[direction], order, begin, end)
                    following = int(met_by[begin])
                    if following < 0:
                        leg = _passed(leg, distance)
                        continue
                going = bounces < max_bounces

            if going:
                # reflect, and stop where the sound is too faint; sound spread by a post only gets fainter
                leg = _reflected(leg, distance, following, reflectances[following], walls, posts)
                going = leg.amplitude * math.sqrt(leg.length / leg.width) > faintest
            if going:
                surface = following
                touched[ray, bounces] = following
                bounces += 1
                if known == sequences.shape[0]:
                    sequences, sequence_slots = grown(sequences, sequence_slots)
                sequence = number_of(sequence, following, sequences, known, sequence_slots) + 1
                known = max(known, sequence)
            elif waiting == 0:
                break
            else:
                waiting -= 1
                leg = _Leg(
                    legs[waiting, 0],
                    legs[waiting, 1],
                    legs[waiting, 2],
                    legs[waiting, 3],
                    legs[waiting, 4],
                    legs[waiting, 5],
                    legs[waiting, 6],
                    legs[waiting, 7],
                )
                distance, flattest, at_surface = legs[waiting, 8], legs[waiting, 9], True
                begin, end, bounces = states[waiting, 0], states[waiting, 1], states[waiting, 2]
                following, ray, sequence = states[waiting, 3], states[waiting, 4], states[waiting, 5]
    return candidates[:found]


@compiled_part
def _flattest(slopes: FloatArray, order: IntArray, begin: int, end: int) -> float:
    """Return the least slope, up or down, of the rays between `begin` and `end`."""
    least = np.inf
    for k in range(begin, end):
        least = min(least, abs(slopes[order[k]]))
    return least


@compiled_part
def _parted(met_by: IntArray, order: IntArray, begin: int, end: int) -> int:
    """Move the rays between `begin` and `end` that meet the same as the first of them to the front.

    Returns the row behind these rays.
    """
    middle = begin + 1
    for k in range(begin + 1, end):
        if met_by[k] == met_by[begin]:
            order[k], order[middle] = order[middle], order[k]
            met_by[k], met_by[middle] = met_by[middle], met_by[k]
            middle += 1
    return middle


@compiled_part
def _passes(
    leg: _Leg, reach: float, x: float, y: float, radius: float, longest: float, spacing: float
) -> tuple[float, float]:
    """Return the distance at which a leg passes a target, relative to the limit, and its largest amplitude there.

    The distance is negative if the leg is not near, or its path is too long.
    """
    tx, ty = x - leg.x, y - leg.y
    ahead, aside = tx * leg.dx + ty * leg.dy, abs(tx * leg.dy - ty * leg.dx)
    on = max(ahead, 0.0)
    width = leg.width + leg.opening * on
    near = ALLOWANCE * spacing * width + radius
    if not (-near <= ahead <= reach + near and aside <= near) or leg.length + ahead > longest + near:
        return -1.0, 0.0
    return aside / near, leg.amplitude * math.sqrt((leg.length + on) / width)


@compiled_part
def _most_received(leg: _Leg, axis_x: float, axis_y: float, spacing: float, receiving: FloatArray) -> float:
    """Return the largest beam factor of the receiver for the directions of a tube."""
    cosine = -leg.dx * axis_x - leg.dy * axis_y
    aside = max(math.acos(min(max(cosine, -1.0), 1.0)) - ALLOWANCE * spacing * leg.opening, 0.0)
    most: float = receiving[int(aside / math.pi * (receiving.shape[0] - 1))]
    return most


@compiled_part
def _shortest_return(leg: _Leg, distance: float, x: float, y: float, spacing: float) -> float:
    """Return the least length of a path that continues from `distance` ahead to the receiver: straight."""
    home = math.hypot(x - leg.x - distance * leg.dx, y - leg.y - distance * leg.dy)
    return leg.length + distance + home - ALLOWANCE * spacing * (leg.width + leg.opening * (distance + home))


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


@compiled_part
def _edges_along(
    x: float,
    y: float,
    dx: float,
    dy: float,
    reach: float,
    spread: bool,
    cells: Cells,
    edges: Listing,
    nearby: IntArray,
    met: IntArray,
    leg_number: int,
) -> int:
    """Fill `nearby` with the targets (edge k is target k + 1) that a leg may pass; return their number.

    An edge is listed in every cell from which a ray without posts could be near it. A tube spread by a post (`spread`)
    is wider, so all edges are targets. `met` (t,) contains the last leg near each target, so that a target listed in
    many cells is taken once.
    """
    count = 0
    if spread:
        for k in range(nearby.shape[0] - 1):
            nearby[k] = k + 1
        return int(nearby.shape[0] - 1)
    if edges.numbers.shape[0] == 0:
        return 0
    walk = enter(cells, x, y, dx, dy)
    while walk.inside:
        for k in listed(cells, edges, walk):
            if met[k + 1] != leg_number:
                met[k + 1] = leg_number
                nearby[count] = k + 1
                count += 1
        if min(walk.next_column, walk.next_row) > reach:
            break
        walk = advance(cells, walk)
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
