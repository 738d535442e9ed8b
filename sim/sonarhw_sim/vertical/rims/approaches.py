"""Approaches: the sequences of walls by which sound from a place can reach parts of each wall that has a rim.

The walls of a sequence, mirrored in those that follow, are windows through which the mirrored place is visible from a
part of the wall.
"""

import math
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray
from sonarhw_sim.compiled import compiled, compiled_part, inlined
from sonarhw_sim.rays.detectable import all_rays
from sonarhw_sim.rays.kernel import Targets, fan, follow_fan
from sonarhw_sim.rays.paths import SLACK, PathSearch
from sonarhw_sim.rays.sequences import mirrored
from sonarhw_sim.room.grid import IntArray, whole_numbers
from sonarhw_sim.vertical.plan import Plan

_FEWER = 4  # times as few rays as usual, because a wall is wider than a point
_PIECE = 0.25  # m: the longest part of a wall that an approach leads to
_EDGE = 1e-9  # of a window: where its sight would not end


class Approaches(NamedTuple):
    """Sequences of walls that lead to a part of a wall, or to a post, one row each."""

    walls: IntArray  # (n,): the wall or post
    surfaces: IntArray  # (n, b): those touched before, in order, padded with -1
    bounces: IntArray  # (n,)
    images: FloatArray  # (n, 2), m: the place mirrored in all of them
    gains: FloatArray  # (n,)
    lows: FloatArray  # (n,), m along the wall: where the part begins
    highs: FloatArray  # (n,), m

    def select(self, rows: NDArray[np.intp]) -> "Approaches":
        """Return only these rows, in this order."""
        return Approaches._make(column[rows] for column in self)


def approaches_to(
    plan: Plan, surfaces: IntArray, place: FloatArray, other: FloatArray, climbs: FloatArray, search: PathSearch
) -> Approaches:
    """Return the approaches from `place` (2,) to walls and posts (w,), of paths that continue to `other` (2,).

    `climbs` (c,) m are those of the ways to the rims, negative if they first go down. A post is one part. Sound that
    posts reflect is not followed to rims, because a post has no mirror image.
    """
    room = plan.room
    target, before, bounces = _towards(plan, surfaces, place, other, climbs, search)
    kept = (before < len(room.walls)).all(axis=1)
    to, before, bounces = surfaces[target[kept]], before[kept], bounces[kept]
    gains, images = np.append(room.reflectances, 1.0)[before].prod(axis=1), images_of(place, before, room.walls)
    whole = np.zeros(len(to))
    all_ = Approaches(to, before, bounces, images, gains, whole, whole)
    posts, walls = np.flatnonzero(to >= len(room.walls)), np.flatnonzero(to < len(room.walls))
    to_walls = all_.select(walls)
    seen = np.empty((len(walls), 2))
    _look(to_walls.images, to_walls.surfaces, to_walls.bounces, to_walls.walls, room.walls, seen)
    parts: list[tuple[NDArray[Any], ...]] = [
        _in_pieces(to_walls._replace(lows=seen[:, 0], highs=seen[:, 1])),
        all_.select(posts),
    ]
    return Approaches._make(np.concatenate(columns) for columns in zip(*parts, strict=True))


def _towards(
    plan: Plan, surfaces: IntArray, place: FloatArray, other: FloatArray, climbs: FloatArray, search: PathSearch
) -> tuple[NDArray[np.intp], IntArray, IntArray]:
    """Return which of these walls and posts rays come near to, the surfaces touched before, (n, b), and how many."""
    room, first_post = plan.room, len(plan.room.walls)
    assert plan.passing is not None
    walls, posts = (
        room.walls[surfaces[surfaces < first_post]],
        room.posts[surfaces[surfaces >= first_post] - first_post],
    )
    points = np.vstack((other, (walls[:, :2] + walls[:, 2:]) / 2, posts[:, :2]))
    radii = np.concatenate(([0.0], np.hypot(*(walls[:, 2:] - walls[:, :2]).T) / 2, posts[:, 2]))
    away = np.maximum(np.hypot(*(points - other).T) - radii, 0.0)
    targets = Targets(points, np.append(0.0, search.max_length + SLACK - away[1:]), radii)
    directions = fan(max(16, search.rays // _FEWER), None if search.axes is None else search.axes.leaving)
    detectable = all_rays(len(directions), len(points), search.faintest_diffraction)
    with_climbs = replace(plan.passing, climbs=climbs)
    found = follow_fan(room, place, directions, targets, search.max_bounces, detectable, with_climbs)
    ray, bounces, target = found.candidates[found.candidates[:, 2] > 0].T
    most = int(bounces.max(initial=0))
    before = np.where(np.arange(most) < bounces[:, None], found.touched[ray, :most], -1).astype(np.int32)
    return target - 1, before, bounces.astype(np.int32)


@compiled
def images_of(place: FloatArray, surfaces: IntArray, walls: FloatArray) -> FloatArray:
    """Return a place mirrored in sequences of walls (n, b), padded with -1, (n, 2) m."""
    images = np.empty((surfaces.shape[0], 2))
    for row in range(surfaces.shape[0]):
        x, y = place
        for step in range(surfaces.shape[1]):
            if surfaces[row, step] >= 0:
                x, y = mirrored(x, y, walls[surfaces[row, step]])
        images[row, 0], images[row, 1] = x, y
    return images


@compiled
def _look(
    images: FloatArray, surfaces: IntArray, bounces: IntArray, wall: IntArray, walls: FloatArray, parts: FloatArray
) -> None:
    """Fill in the part of each wall (n,) from which an image (n, 2) is visible through its windows, (n, 2) m along it.

    An end before a begin: none.
    """
    windows = np.empty((surfaces.shape[1], 4))
    for row in range(wall.shape[0]):
        for step in range(bounces[row]):
            mirror = walls[surfaces[row, step]]
            for earlier in range(step):
                one, other = windows[earlier, :2], windows[earlier, 2:]
                one[0], one[1] = mirrored(one[0], one[1], mirror)
                other[0], other[1] = mirrored(other[0], other[1], mirror)
            for k in range(4):
                windows[step, k] = mirror[k]
        parts[row, 0], parts[row, 1] = _visible(images[row], walls[wall[row]], windows, bounces[row])


@compiled_part
def _visible(image: FloatArray, wall: FloatArray, windows: FloatArray, count: int) -> tuple[float, float]:
    """Return the part of a wall from which an image (2,) is visible through the first `count` windows, m along it."""
    along_x, along_y = wall[2] - wall[0], wall[3] - wall[1]
    length = math.hypot(along_x, along_y)
    along_x, along_y = along_x / length, along_y / length
    x, y = image[0] - wall[0], image[1] - wall[1]
    axial, aside = x * along_x + y * along_y, y * along_x - x * along_y
    lowest, highest = -np.inf, np.inf
    # a window is no limit for an image on the wall
    for k in range(count if abs(aside) > _EDGE else 0):
        begin_x, begin_y = windows[k, 0] - wall[0], windows[k, 1] - wall[1]
        end_x, end_y = windows[k, 2] - wall[0], windows[k, 3] - wall[1]
        begin, end = begin_x * along_x + begin_y * along_y, end_x * along_x + end_y * along_y
        # distance from the wall over that of the image: sound passes a window between both
        near = (begin_y * along_x - begin_x * along_y) / aside
        far = (end_y * along_x - end_x * along_y) / aside
        slope = far - near if abs(far - near) > _EDGE else _EDGE
        first, last = (_EDGE - near) / slope, (1.0 - _EDGE - near) / slope
        low, high = max(min(first, last), 0.0), min(max(first, last), 1.0)
        if low > high:
            return 0.0, -np.inf
        one = _seen_at(begin, end, near, far, low, axial)
        other = _seen_at(begin, end, near, far, high, axial)
        lowest, highest = max(lowest, min(one, other)), min(highest, max(one, other))
    return max(lowest - _EDGE, -_EDGE), min(highest + _EDGE, length + _EDGE)


@inlined
def _seen_at(begin: float, end: float, near: float, far: float, share: float, axial: float) -> float:
    """Return where along a wall the image is visible through the point at a share of a window, m."""
    ahead = 1.0 - min(max(near + share * (far - near), 0.0), 1.0 - _EDGE)
    at: float = axial + (begin + share * (end - begin) - axial) / ahead
    return at


def _in_pieces(approaches: Approaches) -> Approaches:
    """Return the approaches divided into short parts; those without any part are omitted."""
    approaches = approaches.select(np.flatnonzero(approaches.highs > approaches.lows))
    widths = approaches.highs - approaches.lows
    pieces = np.ceil(widths / _PIECE).astype(np.intp)
    row, piece = whole_numbers(np.zeros(len(widths), np.intp), pieces - 1)
    width = (widths / pieces)[row]
    begins = approaches.lows[row] + piece * width
    return approaches.select(row)._replace(lows=begins, highs=begins + width)
