"""Diffuse scatter of a rough floor or ceiling: the direct return of each of its visible patches, in space."""

import math

import numpy as np

from sonarhw.readings import FloatArray
from sonarhw_sim.board.transducer import beam_gain
from sonarhw_sim.board.weighing import BoolArray
from sonarhw_sim.rays.paths import Paths, PathSearch
from sonarhw_sim.room.model import Place, Room

_DIRECTIONS = 120  # in the plan; the beam of two passes is sampled exactly up to ka = 30
_RATIO = 1.05  # of the lengths of paths to the far and the near side of a patch
_STEEPEST = math.radians(80)  # no beam that points along the horizontal reaches farther down
_ON_LEVEL = 1e-9
_INAUDIBLE = 1e-2  # of `faintest_diffraction`: 40 dB below; the hundred in a beam are then 20 dB below


def rough_level_paths(room: Room, place: Place, height: float, search: PathSearch) -> list[Paths]:
    """Return the direct returns of floor and ceiling to a place, one table for each that is rough."""
    return [
        _patches_of(room, place, height, level, search)
        for level in room.levels
        if room.scattered[level] > 0 and room.lid(level) is None and search.max_bounces > 0
    ]


def patch_gains(sines: FloatArray, near: FloatArray, far: FloatArray, width: float) -> FloatArray:
    """Return the amplitude of fully diffuse, perfect patches relative to a perfect mirror at that length.

    In space, a source of power P lights a patch of the solid angle dΩ with P dΩ/(4π). Lambert's law returns cos(e)/π
    of it into each unit of solid angle, which at a distance s is the intensity P dΩ cos(e)/(4π² s²). A mirror at the
    same length 2s has P/(4π (2s)²). The ratio is 4 cos(e) dΩ/π. `sines` are those of the elevation, equal to cos(e),
    `near` and `far` those of the sides of a patch, and `width` is its extent in the plan, rad: dΩ is the difference of
    the sines times the width.
    """
    return np.asarray(np.sqrt(4 * sines * (near - far) * width / math.pi))


def _patches_of(room: Room, place: Place, height: float, level: int, search: PathSearch) -> Paths:
    rise, width = float(room.heights[level, 0]) - height, math.tau / _DIRECTIONS
    lengths, spreads, gains = _rings(abs(rise), width, search)
    elevations = np.arcsin(2 * abs(rise) / lengths)
    reach = np.sqrt((lengths / 2) ** 2 - rise**2)  # in the plan
    directions = np.arange(_DIRECTIONS) * width - math.pi
    free = [_free(room, place, height, rise, angle, reach) for angle in directions.tolist()]
    which, ring = np.nonzero(np.array(free).reshape(_DIRECTIONS, len(lengths)))
    order = np.argsort(lengths[ring], kind="stable")
    angles, ring = np.asarray(directions[which[order]], dtype=np.float64), ring[order]
    rows = len(ring)
    start = np.tile(np.array(place.position), (rows, 1))
    touches = start + reach[ring][:, None] * np.column_stack((np.cos(angles), np.sin(angles)))
    return Paths(
        lengths=lengths[ring],
        departures=angles,
        arrivals=angles,
        gains=room.scattered[level] * gains[ring],
        phases=np.full(rows, np.nan),
        spreads=spreads[ring],
        surfaces=np.full((rows, 1), level, dtype=np.int32),
        edges=np.full(rows, -1, dtype=np.int32),
        bends=np.ones(rows, dtype=np.int32),
        elevations=np.tile(math.copysign(1.0, rise) * elevations[ring][:, None], (1, 2)),
        points=np.stack((start, touches, start), axis=1),
    )


def _rings(away: float, width: float, search: PathSearch) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return length, spread and gain of patches of a perfect level `away` m above or below, (k,) each, nearest first.

    Patches that no transducer detects that points along the horizontal are omitted.
    """
    count = math.log(max(1.0, search.max_length / 2 / away * math.sin(_STEEPEST))) / math.log(_RATIO)
    sides = np.asarray(math.sin(_STEEPEST) * _RATIO ** -np.arange(math.floor(count) + 1.0), dtype=np.float64)
    near, far = sides[:-1], sides[1:]
    sines = np.sqrt(near * far)
    gains = patch_gains(sines, near, far, width)
    beams = np.ones(len(sines)) if search.ka is None else beam_gain(np.arcsin(sines), search.ka) ** 2
    kept = gains * beams >= _INAUDIBLE * search.faintest_diffraction
    lengths, spreads = 2 * away / sines, 2 * away * (1 / far - 1 / near)
    return lengths[kept], spreads[kept], gains[kept]


def _free(room: Room, place: Place, height: float, rise: float, angle: float, reach: FloatArray) -> BoolArray:
    """Return whether nothing blocks the lines to a level, `reach` (k,) m away in the plan in one direction, (k,)."""
    begins, ends, spans = _crossings(room, place, angle)
    # heights at which each line passes each obstacle
    first = height + rise * begins[:, None] / reach
    last = height + rise * np.minimum(ends[:, None], reach) / reach
    lower, upper = np.minimum(first, last), np.maximum(first, last)
    blocked = (begins[:, None] < reach) & (lower <= spans[:, 1:]) & (upper >= spans[:, :1])
    free = ~blocked.any(axis=0)
    for lid in room.lids:
        share = (lid.height - height) / rise
        if 0.0 < share < 1.0 - _ON_LEVEL:
            way = share * reach[:, None] * np.array([[math.cos(angle), math.sin(angle)]])
            free &= ~lid.covers(np.array(place.position) + way)
    return np.asarray(free)


def _crossings(room: Room, place: Place, angle: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return where a line in the plan enters and leaves walls and posts (m), (c,) each, and their spans, (c, 2) m."""
    dx, dy = math.cos(angle), math.sin(angle)
    starts, along = room.walls[:, :2] - place.position, room.walls[:, 2:] - room.walls[:, :2]
    with np.errstate(divide="ignore", invalid="ignore"):
        across = dx * along[:, 1] - dy * along[:, 0]
        at = (starts[:, 0] * along[:, 1] - starts[:, 1] * along[:, 0]) / across
        share = (starts[:, 0] * dy - starts[:, 1] * dx) / across
    walls = np.flatnonzero((at > 0) & (share >= 0) & (share <= 1))
    centres = room.posts[:, :2] - place.position
    ahead, aside = centres @ np.array([dx, dy]), centres @ np.array([-dy, dx])
    half = np.sqrt(np.maximum(room.posts[:, 2] ** 2 - aside**2, 0.0))
    posts = np.flatnonzero((half > 0) & (ahead + half > 0))
    return (
        np.concatenate((at[walls], np.maximum(ahead - half, 0.0)[posts])),
        np.concatenate((at[walls], (ahead + half)[posts])),
        room.heights[np.concatenate((walls, len(room.walls) + posts))],
    )
