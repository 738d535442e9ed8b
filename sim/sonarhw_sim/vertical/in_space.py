"""Paths in space: each path of the plan, together with each sequence of floor and ceiling that its heights allow.

Walls and posts are upright, floor and ceiling are level. So the plan of a path in space is a path in the plan, its
height folds at levels as between two mirrors, and its length is √(plan² + climb²).
"""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray
from sonarhw_sim.board.transducer import beam_gain
from sonarhw_sim.rays.diffraction import amplitudes_at_edges
from sonarhw_sim.rays.partial_paths import first_of_kind
from sonarhw_sim.rays.paths import SLACK, Paths, PathSearch
from sonarhw_sim.room.model import Place, Room
from sonarhw_sim.vertical.clearance import Courses
from sonarhw_sim.vertical.level_sequences import LevelSequence, level_sequences, straight_up_and_down

_TOGETHER = 1e-9  # m: touches this near to each other in the plan are in the order of the plan


def raised_paths(courses: Courses, height: float, search: PathSearch) -> list[Paths]:
    """Return the paths in space from a height (m) back to it, one table for each sequence of levels."""
    room = courses.plan.room
    longest, most = search.max_length + SLACK, search.max_bounces
    return [_raised(courses, sequence, search) for sequence in level_sequences(room, height, longest, most)]


def _raised(courses: Courses, sequence: LevelSequence, search: PathSearch) -> Paths:
    paths = courses.paths
    fits = np.hypot(paths.lengths, sequence.climb) <= search.max_length + SLACK
    fits &= paths.bounces + len(sequence.surfaces) <= search.max_bounces
    rows = courses.clear(sequence, np.flatnonzero(fits))
    rows = rows[_once(courses, rows)]
    elevations = np.arctan2(sequence.climb, paths.lengths[rows])
    gains, phases = _bent(courses, rows, elevations, search)
    gains *= courses.plan.room.reflectances[list(sequence.surfaces)].prod()
    loud = np.flatnonzero(_loud_enough(gains, elevations, paths.edges[rows] >= 0, search))
    rows, elevations, gains, phases = rows[loud], elevations[loud], gains[loud], phases[loud]
    surfaces, bends, points = _merged(courses, sequence, rows)
    return replace(
        paths.select(rows),
        lengths=np.hypot(paths.lengths[rows], sequence.climb),
        gains=gains,
        phases=phases,
        surfaces=surfaces,
        bends=bends,
        points=points,
        elevations=np.outer(elevations, sequence.signs),
    )


def _once(courses: Courses, rows: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return which of these rows differ in space: through a vertex, several sequences describe one path."""
    if courses.plan.passing is None:
        return np.arange(len(rows))
    paths = courses.paths
    return np.flatnonzero(first_of_kind(paths.lengths[rows], paths.edges[rows], paths.points[rows]))


def _bent(
    courses: Courses, rows: NDArray[np.intp], elevations: FloatArray, search: PathSearch
) -> tuple[FloatArray, FloatArray]:
    """Return gains and phases (n,) of paths with these elevations (n,).

    Sound that meets an upright edge at an elevation e is diffracted as in the plan by a wave 1/cos e times as long: the
    field along the edge is a factor exp(jkz sin e).
    """
    paths, room = courses.paths, courses.plan.room
    gains, phases = paths.gains[rows], paths.phases[rows]
    bent = np.flatnonzero(paths.edges[rows] >= 0)
    if len(bent):
        chosen = rows[bent]
        at_edges = room, paths.edges[chosen], paths.bends[chosen], paths.points[chosen]
        flat = np.full(len(bent), search.wavelength)
        was = amplitudes_at_edges(*at_edges, flat, search.edge_strength)
        now = amplitudes_at_edges(*at_edges, flat / np.cos(elevations[bent]), search.edge_strength)
        gains[bent] *= np.abs(now) / np.maximum(np.abs(was), 1e-300)
        phases[bent] += np.angle(now * was.conj())
    return gains, phases


def _loud_enough(
    gains: FloatArray, elevations: FloatArray, bent: NDArray[np.bool_], search: PathSearch
) -> NDArray[np.bool_]:
    """Return which paths are not omitted as too faint: no heading is nearer to a direction than its elevation."""
    most = np.ones(len(gains))
    if search.ka is not None and search.axes is None:
        angles = np.linspace(0, math.pi / 2, 901)
        loudest = np.maximum.accumulate(beam_gain(angles, search.ka)[::-1])[::-1]
        most = loudest[(elevations / (math.pi / 2) * 900).astype(np.intp)] ** 2
    return ~bent | (gains * most >= search.faintest_diffraction)


def _merged(
    courses: Courses, sequence: LevelSequence, rows: NDArray[np.intp]
) -> tuple[NDArray[np.int32], NDArray[np.int32], FloatArray]:
    """Return surfaces (n, b), bends (n,) and points (n, b + 3, 2) of paths with touches of levels among the others."""
    paths, levels = courses.paths, len(sequence.surfaces)
    at, ways = courses.at[rows], paths.lengths[rows]
    touches = ways[:, None] * sequence.climbs[1:-1] / sequence.climb
    # levels first: they are so in a right-angled corner of level and wall, where sound touches both at one point
    points = np.concatenate((_along(paths.points[rows], at, touches), paths.points[rows]), axis=1)
    met = np.hstack((np.tile(np.array(sequence.surfaces, np.int32), (len(rows), 1)), courses.met[rows]))
    where = np.nan_to_num(np.round(np.hstack((touches, at)) / _TOGETHER), nan=np.inf)
    # source first, receiver last
    where[:, levels] = -1.0
    count = np.isfinite(paths.points[rows, :, 0]).sum(axis=1)
    where[np.arange(len(rows)), levels + count - 1] = np.round(ways / _TOGETHER) + 1
    order = np.argsort(where, axis=1, kind="stable")
    met = np.take_along_axis(met, order, axis=1)
    points = np.take_along_axis(points, order[..., None], axis=1)
    # the edge is the one point between source and receiver without a surface
    bent = paths.edges[rows] >= 0
    bends = np.where(bent, (met[:, 1:] < 0).argmax(axis=1), paths.bends[rows] + levels).astype(np.int32)
    surfaces = np.take_along_axis(met, np.argsort(met < 0, axis=1, kind="stable"), axis=1)
    most = points.shape[1]
    return surfaces[:, : most - 3], bends, points


def _along(points: FloatArray, at: FloatArray, lengths: FloatArray) -> FloatArray:
    """Return the points (n, k, 2) at `lengths` (n, k) m along the ways through `points` (n, p, 2) at `at` (n, p) m."""
    leg = (at[:, None, :] <= lengths[..., None]).sum(axis=2) - 1
    last = np.isfinite(at).sum(axis=1)[:, None] - 2
    leg = np.minimum(leg, last)
    row = np.arange(len(points))[:, None]
    start, end = points[row, leg], points[row, leg + 1]
    begin, size = at[row, leg], at[row, leg + 1] - at[row, leg]
    share = (lengths - begin) / np.where(size > 0, size, 1.0)
    return np.asarray(start + share[..., None] * (end - start))


def straight_paths(room: Room, place: Place, height: float, search: PathSearch) -> list[Paths]:
    """Return the paths that only go up and down between the levels, one table each."""
    return [
        _straight(room, place, sequence)
        for sequence in level_sequences(room, height, search.max_length + SLACK, search.max_bounces)
        if not _stands_in(room, place, sequence)
    ]


def _stands_in(room: Room, place: Place, sequence: LevelSequence) -> bool:
    """Return whether a post stands above or below a place, in the way of a sequence."""
    posts = room.posts_at(place.position)
    lower, upper = room.heights[posts].T
    return bool(((lower <= sequence.heights.max()) & (upper >= sequence.heights.min())).any())


def _straight(room: Room, place: Place, sequence: LevelSequence) -> Paths:
    count, whole = len(sequence.surfaces), np.array([-1], np.int32)
    return Paths(
        lengths=np.array([sequence.climb]),
        departures=np.zeros(1),
        arrivals=np.zeros(1),
        gains=room.reflectances[[list(sequence.surfaces)]].prod(axis=1),
        phases=np.zeros(1),
        spreads=np.zeros(1),
        surfaces=np.array([sequence.surfaces], np.int32),
        edges=whole,
        bends=np.array([count], np.int32),
        elevations=np.array([straight_up_and_down(sequence)]),
        points=np.concatenate((np.tile(place.position, (1, count + 2, 1)), np.full((1, 1, 2), np.nan)), axis=1),
    )
