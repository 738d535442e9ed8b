"""Diffuse scatter: the weak direct return of every visible patch of a rough surface, one path each.

The specular part of a rough surface is in `Room.reflectances`. Smooth surfaces have no patches and cost nothing.
"""

import math

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray
from sonarhw_sim.rays.kernel import fan, first_hit
from sonarhw_sim.rays.paths import SLACK, Paths, PathSearch
from sonarhw_sim.rays.sequences import leg_is_free
from sonarhw_sim.room.model import Room

# A patch has about the size that a receiver does not resolve. On a wall at 45°, 1 to 2 m away, the 56 mm of range that
# a burst of 16 cycles covers are 3° to 1.6° wide. Patches wider or narrower by half change a patch's level by 2 dB.
PATCHES = 180
PATCH = math.tau / PATCHES  # rad, as seen from the sensor


def scattered_paths(
    room: Room, position: tuple[float, float], search: PathSearch, receiver: tuple[float, float] | None = None
) -> Paths:
    """Return the direct returns of rough surfaces to `position`, or to a separate `receiver`, shortest first."""
    source = np.array(position, dtype=np.float64)
    target = source if receiver is None else np.array(receiver, dtype=np.float64)
    directions, distances, surfaces = _rough_patches(room, source)
    touches = source + distances[:, None] * _unit(directions)
    back = np.hypot(*(target - touches).T)
    cosines = _cosines(room, surfaces, touches, source, target)
    gains = room.scattered[surfaces] * patch_gain(cosines, distances, back)
    lengths = distances + back
    kept = (gains > 0) & (lengths <= search.max_length + SLACK) & (search.max_bounces > 0)
    kept[kept] = [leg_is_free(touch, target, room.surfaces) for touch in touches[kept]]
    rows = np.flatnonzero(kept)[np.argsort(lengths[kept], kind="stable")]
    count = len(rows)
    return Paths(
        lengths=lengths[rows],
        departures=np.arctan2(*(touches - source)[rows].T[::-1]),
        arrivals=np.arctan2(*(touches - target)[rows].T[::-1]),
        gains=gains[rows],
        phases=np.full(count, np.nan),
        surfaces=surfaces[rows, None].astype(np.int32),
        edges=np.full(count, -1, dtype=np.int32),
        bends=np.ones(count, dtype=np.int32),
        elevations=np.zeros((count, 2)),
        points=np.stack((np.tile(source, (count, 1)), touches[rows], np.tile(target, (count, 1))), axis=1),
    )


def patch_gain(cosines: FloatArray, there: FloatArray, back: FloatArray) -> FloatArray:
    """Return the amplitude of a fully diffuse, perfect patch relative to a perfect mirror at that length, 0..1.

    In two dimensions a source of power P lights the patch, `PATCH` = dφ wide as the source sees it, with P dφ/(2π),
    whatever its distance and slant. Lambert's law in two dimensions sends cos(e)/2 of that into each radian at an angle
    e from the normal (its integral over ±90° is 1), which at a distance s′ (`back`) is the intensity
    P dφ cos(e)/(4π s′). The intensity from a mirror at the same length s + s′ is P/(2π (s + s′)). The ratio is
    dφ cos(e) (s + s′)/(2 s′): dφ cos(i) straight back at incidence i. The amplitude is its root, limited
    to that of a mirror.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        power = PATCH * np.maximum(cosines, 0.0) * (there + back) / (2 * back)
    return np.asarray(np.sqrt(np.clip(np.nan_to_num(power), 0.0, 1.0)))


def _rough_patches(room: Room, source: FloatArray) -> tuple[FloatArray, FloatArray, NDArray[np.intp]]:
    """Return direction (rad), distance (m) and surface of each rough patch visible from `source`, (k,) each."""
    x, y = source
    directions = fan(PATCHES)
    hits = [first_hit(x, y, math.cos(a), math.sin(a), -1, room.surfaces) for a in directions]
    distances, surfaces = np.array([hit[0] for hit in hits]), np.array([hit[1] for hit in hits], dtype=np.intp)
    # surface -1, "none", selects the appended 0
    rough = np.flatnonzero(np.append(room.scattered, 0.0)[surfaces] > 0)
    if room.posts_at((x, y)):
        rough = rough[:0]
    return directions[rough], distances[rough], surfaces[rough]


def _cosines(
    room: Room, surfaces: NDArray[np.intp], touches: FloatArray, source: FloatArray, target: FloatArray
) -> FloatArray:
    """Return the cosine of the angle between each surface's normal, on the side of `source`, and `target`, (k,)."""
    normals = np.empty_like(touches)
    flat = surfaces < len(room.walls)
    walls, posts = room.walls[surfaces[flat]], room.posts[surfaces[~flat] - len(room.walls)]
    normals[flat] = np.column_stack((walls[:, 1] - walls[:, 3], walls[:, 2] - walls[:, 0]))
    normals[~flat] = touches[~flat] - posts[:, :2]
    lit, away = ((normals * (point - touches)).sum(axis=1) for point in (source, target))
    with np.errstate(divide="ignore", invalid="ignore"):
        cosines = np.sign(lit) * away / np.hypot(*normals.T) / np.hypot(*(target - touches).T)
    return np.asarray(np.nan_to_num(cosines))


def _unit(directions: FloatArray) -> FloatArray:
    return np.column_stack((np.cos(directions), np.sin(directions)))
