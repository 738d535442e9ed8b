"""Diffuse scatter: the direct return of every visible patch of a rough surface, one path each.

The specular part of a rough surface is in `Room.reflectances`. Smooth surfaces have no patches and cost nothing.
Receivers add the power of all patches that the burst and the beam cover (`sonarhw_sim.predict.scattered`).
"""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray
from sonarhw_sim.rays.first_surface import first_hit
from sonarhw_sim.rays.kernel import fan
from sonarhw_sim.rays.paths import SLACK, Paths, PathSearch
from sonarhw_sim.rays.sequences import leg_is_free
from sonarhw_sim.room.model import Room

PATCHES = 720
PATCH = math.tau / PATCHES  # rad, widest patch as seen from the sensor: a small part of every beam
_RAYS = 1440  # that find the rough surfaces; narrower ones may be missed
_HALVINGS = 20  # of the angle between two rays, to find the end of a surface
_SHORTEST = 1e-4  # m: least `spreads` of a patch
_Sector = tuple[float, float, int]  # rad, begin and end, and the surface that is visible between them


def scattered_paths(
    room: Room,
    position: tuple[float, float],
    search: PathSearch,
    receiver: tuple[float, float] | None = None,
    patch: float = PATCH,
) -> Paths:
    """Return the direct returns of rough surfaces to `position`, or to a separate `receiver`, shortest first.

    No patch is wider than `patch`, rad as seen from `position`.
    """
    source = np.array(position, dtype=np.float64)
    target = source if receiver is None else np.array(receiver, dtype=np.float64)
    begins, widths, surfaces = _patches(room, source, patch)
    across = begins[:, None] + widths[:, None] * np.array([0.0, 0.5, 1.0])
    touches = source + _distances(room, source, across, surfaces)[:, :, None] * _unit(across)
    there, back = (np.hypot(*np.moveaxis(touches - end, 2, 0)) for end in (source, target))
    lengths = (there + back)[:, 1]
    middles = touches[:, 1]
    cosines = _cosines(room, surfaces, middles, source, target)
    gains = room.scattered[surfaces] * patch_gain(cosines, there[:, 1], back[:, 1], widths)
    kept = (gains > 0) & (lengths <= search.max_length + SLACK) & (search.max_bounces > 0)
    kept[kept] = [leg_is_free(touch, target, room.surfaces) for touch in middles[kept]]
    rows = np.flatnonzero(kept)[np.argsort(lengths[kept], kind="stable")]
    count = len(rows)
    return Paths(
        lengths=lengths[rows],
        departures=np.arctan2(*(middles - source)[rows].T[::-1]),
        arrivals=np.arctan2(*(middles - target)[rows].T[::-1]),
        gains=gains[rows],
        phases=np.full(count, np.nan),
        spreads=np.maximum(np.ptp(there + back, axis=1), _SHORTEST)[rows],
        surfaces=surfaces[rows, None].astype(np.int32),
        edges=np.full(count, -1, dtype=np.int32),
        bends=np.ones(count, dtype=np.int32),
        elevations=np.zeros((count, 2)),
        points=np.stack((np.tile(source, (count, 1)), middles[rows], np.tile(target, (count, 1))), axis=1),
    )


def patch_gain(cosines: FloatArray, there: FloatArray, back: FloatArray, widths: FloatArray) -> FloatArray:
    """Return the amplitude of fully diffuse, perfect patches relative to a perfect mirror at that length, 0..1.

    In two dimensions a source of power P lights a patch, dφ wide as the source sees it (`widths`), with P dφ/(2π),
    whatever its distance and slant. Lambert's law in two dimensions sends cos(e)/2 of that into each radian at an angle
    e from the normal (its integral over ±90° is 1), which at a distance s′ (`back`) is the intensity
    P dφ cos(e)/(4π s′). The intensity from a mirror at the same length s + s′ is P/(2π (s + s′)). The ratio is
    dφ cos(e) (s + s′)/(2 s′): dφ cos(i) straight back at incidence i. The amplitude is its root, limited
    to that of a mirror.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        power = widths * np.maximum(cosines, 0.0) * (there + back) / (2 * back)
    return np.asarray(np.sqrt(np.clip(np.nan_to_num(power), 0.0, 1.0)))


def _patches(room: Room, source: FloatArray, patch: float) -> tuple[FloatArray, FloatArray, NDArray[np.intp]]:
    """Return where the visible patches begin and how wide they are (rad), and their surfaces, (k,) each."""
    sectors = [] if room.posts_at((float(source[0]), float(source[1]))) else _rough_sectors(room, source)
    begins, ends = (np.array([sector[k] for sector in sectors], dtype=np.float64) for k in (0, 1))
    counts = np.ceil((ends - begins) / patch).astype(np.intp)
    widths = np.repeat((ends - begins) / np.maximum(counts, 1), counts)
    within = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    surfaces = np.repeat(np.array([sector[2] for sector in sectors], dtype=np.intp), counts)
    return np.repeat(begins, counts) + within * widths, widths, surfaces


def _rough_sectors(room: Room, source: FloatArray) -> list[_Sector]:
    """Return the sectors in which a rough surface is visible from `source`."""
    x, y = source

    def seen(angle: float) -> int:
        return int(first_hit(x, y, math.cos(angle), math.sin(angle), -1, room.surfaces)[1])

    rough = {-1: False} | dict(enumerate((room.scattered[: room.levels.start] > 0).tolist()))
    directions = fan(_RAYS).tolist()
    directions.append(directions[0] + math.tau)
    surfaces = [seen(angle) for angle in directions]
    begin, sectors = directions[0], []
    for k in range(_RAYS):
        if surfaces[k] == surfaces[k + 1]:
            continue
        ends, begins = directions[k], directions[k + 1]
        if rough[surfaces[k]]:
            sectors.append((begin, _last_seen(seen, ends, begins), surfaces[k]))
        begin = _last_seen(seen, begins, ends) if rough[surfaces[k + 1]] else begins
    if rough[surfaces[-1]]:
        sectors.append((begin, directions[-1], surfaces[-1]))
    return [sector for sector in sectors if sector[1] > sector[0]]


def _last_seen(seen: Callable[[float], int], here: float, beyond: float) -> float:
    """Return the angle nearest to `beyond` at which the surface at the angle `here` is still seen, rad."""
    surface = seen(here)
    for _ in range(_HALVINGS):
        middle = (here + beyond) / 2
        here, beyond = (middle, beyond) if seen(middle) == surface else (here, middle)
    return here


def _distances(room: Room, source: FloatArray, angles: FloatArray, surfaces: NDArray[np.intp]) -> FloatArray:
    """Return the distance from `source` to the surface of each patch, in the directions `angles` (k, 3), same shape."""
    towards, distances = _unit(angles), np.empty(angles.shape)
    flat = surfaces < len(room.walls)
    walls, posts = room.walls[surfaces[flat]], room.posts[surfaces[~flat] - len(room.walls)]
    normals = np.column_stack((walls[:, 1] - walls[:, 3], walls[:, 2] - walls[:, 0]))[:, None]
    aside = ((walls[:, None, :2] - source) * normals).sum(axis=2)
    with np.errstate(divide="ignore", invalid="ignore"):
        distances[flat] = np.nan_to_num(aside / (towards[flat] * normals).sum(axis=2))
    to_centre = posts[:, None, :2] - source
    ahead = (to_centre * towards[~flat]).sum(axis=2)
    within = posts[:, None, 2] ** 2 - (to_centre**2).sum(axis=2) + ahead**2
    distances[~flat] = ahead - np.sqrt(np.maximum(within, 0.0))
    return distances


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
    return np.stack((np.cos(directions), np.sin(directions)), axis=-1)
