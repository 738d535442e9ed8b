"""Approaches: the sequences of walls by which sound from a place can reach parts of each wall that has a rim.

The walls of a sequence, mirrored in those that follow, are windows through which the mirrored place is visible from a
part of the wall.
"""

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray
from sonarhw_sim.rays.detectable import all_rays
from sonarhw_sim.rays.kernel import fan, follow_fan
from sonarhw_sim.rays.partial_paths import with_direct_paths
from sonarhw_sim.rays.paths import SLACK, PathSearch
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
    lows, highs = _visible(to_walls.images, to_walls.surfaces, to_walls.walls, room.walls)
    parts: list[tuple[NDArray[Any], ...]] = [
        _in_pieces(to_walls._replace(lows=lows, highs=highs)),
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
    targets = np.vstack((other, (walls[:, :2] + walls[:, 2:]) / 2, posts[:, :2]))
    radii = np.concatenate(([0.0], np.hypot(*(walls[:, 2:] - walls[:, :2]).T) / 2, posts[:, 2]))
    away = np.maximum(np.hypot(*(targets - other).T) - radii, 0.0)
    longest = np.append(0.0, search.max_length + SLACK - away[1:])
    directions = fan(max(16, search.rays // _FEWER), None if search.axes is None else search.axes.leaving)
    found = follow_fan(
        place,
        directions,
        room.surfaces,
        room.reflectances,
        targets,
        longest,
        search.max_bounces,
        all_rays(len(directions), len(targets), search.faintest_diffraction),
        radii,
        replace(plan.passing, climbs=climbs),
    )
    candidates = with_direct_paths(found.candidates, len(targets))
    ray, bounces, target = candidates[candidates[:, 2] > 0].T
    most = int(bounces.max(initial=0))
    before = np.where(np.arange(most) < bounces[:, None], found.touched[ray, :most], -1).astype(np.int32)
    return target - 1, before, bounces.astype(np.int32)


def images_of(place: FloatArray, surfaces: IntArray, walls: FloatArray) -> FloatArray:
    """Return a place mirrored in sequences of walls (n, b), (n, 2) m."""
    images = np.tile(place, (len(surfaces), 1))
    for step in range(surfaces.shape[1]):
        rows = np.flatnonzero(surfaces[:, step] >= 0)
        images[rows] = _mirrored(images[rows], walls[surfaces[rows, step]])
    return images


def _mirrored(points: FloatArray, walls: FloatArray) -> FloatArray:
    """Return points (n, ..., 2) mirrored in walls (n, 4), same shape."""
    between = (slice(None), *[None] * (points.ndim - 2))
    along = walls[:, 2:] - walls[:, :2]
    across = (np.column_stack((along[:, 1], -along[:, 0])) / np.hypot(*along.T)[:, None])[between]
    aside = ((points - walls[:, :2][between]) * across).sum(axis=-1, keepdims=True)
    return np.asarray(points - 2 * aside * across)


def _visible(
    images: FloatArray, surfaces: IntArray, wall: IntArray, walls: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the part of each wall (n,) from which an image (n, 2) is visible through its windows, (n,) m along it."""
    windows = walls[surfaces].reshape(*surfaces.shape, 2, 2)
    for step in range(1, surfaces.shape[1]):
        rows = np.flatnonzero(surfaces[:, step] >= 0)
        windows[rows, :step] = _mirrored(windows[rows, :step], walls[surfaces[rows, step]])
    along = walls[wall, 2:] - walls[wall, :2]
    length = np.hypot(*along.T)
    along /= length[:, None]
    left = np.column_stack((-along[:, 1], along[:, 0]))
    away, there = images - walls[wall, :2], windows - walls[wall, None, None, :2]
    axial, aside = (away * along).sum(axis=1)[:, None], (away * left).sum(axis=1)[:, None]
    begin, end = np.moveaxis((there * along[:, None, None]).sum(axis=-1), 2, 0)
    # distance from the wall over that of the image: sound passes a window between both
    on_wall = np.abs(aside) <= _EDGE
    near, far = np.moveaxis((there * left[:, None, None]).sum(axis=-1) / np.where(on_wall, 1.0, aside)[..., None], 2, 0)
    slope = np.where(np.abs(far - near) <= _EDGE, _EDGE, far - near)
    first, last = (_EDGE - near) / slope, (1.0 - _EDGE - near) / slope
    low, high = np.maximum(np.minimum(first, last), 0.0), np.minimum(np.maximum(first, last), 1.0)
    ends = []
    for share in (low, high):
        ahead = 1.0 - np.clip(near + share * (far - near), 0.0, 1.0 - _EDGE)
        ends.append(axial + (begin + share * (end - begin) - axial) / ahead)
    free = (surfaces < 0) | on_wall
    lows = np.where(free, -np.inf, np.minimum(*ends))
    highs = np.where(free, np.inf, np.where(low > high, -np.inf, np.maximum(*ends)))
    return (
        np.maximum(lows.max(axis=1, initial=-np.inf) - _EDGE, -_EDGE),
        np.minimum(highs.min(axis=1, initial=np.inf) + _EDGE, length + _EDGE),
    )


def _in_pieces(approaches: Approaches) -> Approaches:
    """Return the approaches divided into short parts; those without any part are omitted."""
    approaches = approaches.select(np.flatnonzero(approaches.highs > approaches.lows))
    widths = approaches.highs - approaches.lows
    pieces = np.ceil(widths / _PIECE).astype(np.intp)
    row, piece = whole_numbers(np.zeros(len(widths), np.intp), pieces - 1)
    width = (widths / pieces)[row]
    begins = approaches.lows[row] + piece * width
    return approaches.select(row)._replace(lows=begins, highs=begins + width)
