"""The levels between which sound goes up and down, seen from one place: floor, ceiling and lids."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate, pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray
from sonarhw_sim.board.beam import BoolArray, beam_gain
from sonarhw_sim.compiled import compiled_part
from sonarhw_sim.rays.paths import Paths, PathSearch
from sonarhw_sim.room.grid import IntArray
from sonarhw_sim.room.room import Lid, Place, Room
from sonarhw_sim.room.room_file import MEETING


class KernelLevels(NamedTuple):
    """Levels for kernels, one row each."""

    heights: FloatArray  # (l,), m
    facing: IntArray  # (l,): 1 reflects sound from above, -1 from below
    limited: NDArray[np.bool_]  # (l,): whether it ends at an outline
    boxes: FloatArray  # (l, 4), m: least x, least y, largest x, largest y of the outline
    radii: FloatArray  # (l,), m: of a round outline about its only corner; 0: a polygon
    starts: IntArray  # (l + 1,): rows of the corners of each
    corners: FloatArray  # (c, 2), m


@dataclass(frozen=True)
class Levels:
    """Levels that sound from a place can touch."""

    surfaces: IntArray  # (l,): their numbers in the room
    lids: tuple[Lid | None, ...]  # (l,): outlines; None: without limit
    kernel: KernelLevels

    @property
    def floor(self) -> float:
        """Height below which there is no sound, m."""
        return float(self._ends(1).max(initial=-math.inf))

    @property
    def ceiling(self) -> float:
        """Height above which there is no sound, m."""
        return float(self._ends(-1).min(initial=math.inf))

    def _ends(self, facing: int) -> FloatArray:
        of_it = ~self.kernel.limited & (self.kernel.facing == facing)
        return np.asarray(self.kernel.heights[of_it])


def levels_of(room: Room, place: Place, height: float) -> Levels:
    """Return the levels around a place at a height, m. Lids beyond floor and ceiling are omitted."""
    ends = [k for k in room.levels if room.lid(k) is None]
    floor = max((float(room.heights[k, 0]) for k in ends if room.heights[k, 0] < height), default=-math.inf)
    ceiling = min((float(room.heights[k, 0]) for k in ends if room.heights[k, 0] >= height), default=math.inf)
    inside = [k for k in room.levels if floor + MEETING < room.heights[k, 0] < ceiling - MEETING]
    chosen = [*ends, *inside]
    lids = tuple(room.lid(k) for k in chosen)
    corners = [np.empty((0, 2)) if lid is None else lid.corners for lid in lids]
    facing = [
        (1 if room.heights[k, 0] < height else -1) if lid is None else _facing(lid, place, height)
        for k, lid in zip(chosen, lids, strict=True)
    ]
    kernel = KernelLevels(
        np.array([room.heights[k, 0] for k in chosen], dtype=np.float64),
        np.array(facing, dtype=np.int32),
        np.array([lid is not None for lid in lids], dtype=np.bool_),
        np.array([(0.0,) * 4 if lid is None else lid.box for lid in lids], dtype=np.float64).reshape(-1, 4),
        np.array([0.0 if lid is None else lid.radius for lid in lids], dtype=np.float64),
        np.append(0, np.cumsum([len(rows) for rows in corners])).astype(np.int32),
        np.ascontiguousarray(np.vstack((*corners, np.empty((0, 2))))),
    )
    return Levels(np.array(chosen, dtype=np.int32), lids, kernel)


def _facing(lid: Lid, place: Place, height: float) -> int:
    outward = 1 if lid.upper else -1
    return -outward if lid.surrounds(*place.position, height) else outward


@compiled_part
def is_within(x: float, y: float, level: int, levels: KernelLevels) -> bool:
    """Return whether a point (m) is within the outline of a level that has one."""
    first, last = levels.starts[level], levels.starts[level + 1]
    if levels.radii[level] > 0.0:
        inside: bool = math.hypot(x - levels.corners[first, 0], y - levels.corners[first, 1]) < levels.radii[level]
        return inside
    within = False
    x0, y0 = levels.corners[last - 1]
    for k in range(first, last):
        x1, y1 = levels.corners[k]
        if (y0 > y) != (y1 > y) and x < x0 + (y - y0) / (y1 - y0) * (x1 - x0):
            within = not within
        x0, y0 = x1, y1
    return within


# Sequences of reflections by levels, which turn the height of sound around.
#
# Sound that rises or falls with one slope along its way in the plan has the height that it would have without levels,
# folded at each of them (image sources).


_CLOSE = 1e-9  # m: heights that differ less are equal


@dataclass(frozen=True)
class LevelSequence:
    """The levels that sound touches between its departure at one height and its arrival at another."""

    levels: tuple[int, ...]  # rows of `Levels`
    heights: tuple[float, ...]  # m: of the departure, of each level, and of the arrival

    @cached_property
    def climbs(self) -> tuple[float, ...]:
        """Up and down travelled until each of the heights, m."""
        return (0.0, *accumulate(abs(after - before) for before, after in pairwise(self.heights)))

    @property
    def climb(self) -> float:
        """Up and down travelled in all, m."""
        return self.climbs[-1]

    @property
    def signs(self) -> tuple[float, float]:
        """The signs of the elevation at departure and of that from which sound arrives."""
        start, first, *_ = self.heights
        *_, last, end = self.heights
        return float((first > start) - (first < start)), float((last > end) - (last < end))


def level_sequences(
    levels: Levels, start: float, end: float, longest: float, most: int, lids: int
) -> Iterator[LevelSequence]:
    """Yield the sequences from one height to another, m, with a climb up to `longest` (m).

    They touch one level or more, up to `most`, and up to `lids` that are limited. Those that first go down come first.
    """
    kernel = levels.kernel
    each = [*zip(kernel.heights.tolist(), kernel.facing.tolist(), kernel.limited.tolist(), strict=True)]
    for going in (-1, 1):
        yield from _continued(each, (), (start,), 0.0, going, end, longest, most, lids)


def _continued(
    each: list[tuple[float, int, bool]],
    begun: tuple[int, ...],
    heights: tuple[float, ...],
    climb: float,
    going: int,
    end: float,
    longest: float,
    most: int,
    lids: int,
) -> Iterator[LevelSequence]:
    """Yield the sequences that continue one; `each` level has its height (m), facing, and whether it is limited."""
    for level, (height, facing, limited) in enumerate(each if most > 0 else []):
        gap = (height - heights[-1]) * going
        if facing != -going or gap <= _CLOSE or limited > lids or climb + gap > longest:
            continue
        rows, touched = (*begun, level), (*heights, height)
        if (end - height) * -going > _CLOSE and climb + gap + abs(end - height) <= longest:
            yield LevelSequence(rows, (*touched, end))
        yield from _continued(each, rows, touched, climb + gap, -going, end, longest, most - 1, lids - limited)


# Diffuse scatter of a rough floor or ceiling: the direct return of each of its visible patches, in space.


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
        distances = (starts[:, 0] * along[:, 1] - starts[:, 1] * along[:, 0]) / across
        share = (starts[:, 0] * dy - starts[:, 1] * dx) / across
    walls = np.flatnonzero((distances > 0) & (share >= 0) & (share <= 1))
    centres = room.posts[:, :2] - place.position
    ahead, aside = centres @ np.array([dx, dy]), centres @ np.array([-dy, dx])
    half = np.sqrt(np.maximum(room.posts[:, 2] ** 2 - aside**2, 0.0))
    posts = np.flatnonzero((half > 0) & (ahead + half > 0))
    return (
        np.concatenate((distances[walls], np.maximum(ahead - half, 0.0)[posts])),
        np.concatenate((distances[walls], (ahead + half)[posts])),
        room.heights[np.concatenate((walls, len(room.walls) + posts))],
    )


# Reflectances by angle of incidence and frequency, where the materials of a room have a table of them.


_SAME_POINT = 1e-9  # m: in a corner, sound touches both walls at one point


def reflectance_factors(room: Room, paths: Paths, frequencies: FloatArray) -> FloatArray:
    """Return what the gains (n,) of paths are to be multiplied with at each of `frequencies` (m,) Hz, (n, m).

    The gains contain the largest value of each table. An edge has the factor of its louder face, for the angle at which
    this face would reflect the sound into the same direction.
    """
    factors = np.ones((len(paths), len(frequencies)))
    angles, at_edges, faces = _incidence(room, paths), _incidence_at_edges(paths), _louder_faces(room, paths)
    for material, table in room.tables.items():
        if table.largest == 0.0:
            continue
        # row -1, "no surface", selects the appended value
        of_it = np.append(np.array(room.materials) == material, False)
        rows, touches = np.nonzero(of_it[paths.surfaces])
        np.multiply.at(factors, rows, table.at(angles[rows, touches], frequencies) / table.largest)
        bent = np.flatnonzero(of_it[faces])
        factors[bent] *= table.at(at_edges[bent], frequencies) / table.largest
    return factors


def _incidence(room: Room, paths: Paths) -> FloatArray:
    """Return the angle between sound and the perpendicular at each reflection, (n, b) rad; 0 without a reflection."""
    rows, touches = np.nonzero(paths.surfaces >= 0)
    surfaces = paths.surfaces[rows, touches]
    behind_edge = (paths.edges[rows] >= 0) & (touches >= paths.bends[rows])
    point = touches + 1 + behind_edge
    points = paths.points[rows, point]
    leg = points - paths.points[rows, point - 1]
    still = np.hypot(*leg.T) <= _SAME_POINT
    leg[still] = (paths.points[rows, point + 1] - points)[still]
    elevations = np.abs(paths.elevations[rows, behind_edge.astype(np.intp)])
    cosines = np.cos(elevations) * _cosines_in_plan(room, surfaces, points, leg)
    cosines[surfaces >= room.levels.start] = np.sin(elevations)[surfaces >= room.levels.start]
    angles = np.zeros(paths.surfaces.shape)
    angles[rows, touches] = np.arccos(np.clip(cosines, 0.0, 1.0))
    return angles


def _cosines_in_plan(room: Room, surfaces: NDArray[np.int32], points: FloatArray, legs: FloatArray) -> FloatArray:
    """Return the cosine of the angle between each leg and the perpendicular of its surface, in the plan, (k,)."""
    normals = np.ones_like(points)
    flat = surfaces < len(room.walls)
    round_ = ~flat & (surfaces < room.levels.start)
    walls = room.walls[surfaces[flat]]
    normals[flat] = np.column_stack((walls[:, 1] - walls[:, 3], walls[:, 2] - walls[:, 0]))
    normals[round_] = points[round_] - room.posts[surfaces[round_] - len(room.walls), :2]
    sizes = np.hypot(*normals.T) * np.hypot(*legs.T)
    return np.asarray(np.abs((normals * legs).sum(axis=1)) / np.maximum(sizes, 1e-300))


def _incidence_at_edges(paths: Paths) -> FloatArray:
    """Return half the angle by which the edge of each path turns the sound back, (n,) rad; 0 without an edge."""
    rows = np.flatnonzero(paths.edges >= 0)
    point = paths.bends[rows] + 1
    points = paths.points[rows, point]
    come, go = points - paths.points[rows, point - 1], paths.points[rows, point + 1] - points
    sizes = np.maximum(np.hypot(*come.T) * np.hypot(*go.T), 1e-300)
    half = np.arccos(np.clip(-(come * go).sum(axis=1) / sizes, -1.0, 1.0)) / 2
    angles = np.zeros(len(paths))
    angles[rows] = np.arccos(np.cos(half) * np.cos(np.abs(paths.elevations[rows]).max(axis=1, initial=0.0)))
    return angles


def _louder_faces(room: Room, paths: Paths) -> NDArray[np.intp]:
    """Return the face with the larger reflectance of the edge of each path, (n,) numbers of surfaces; -1: no edge."""
    faces = np.full((len(paths), 2), -1, dtype=np.intp)
    upright = (paths.edges >= 0) & (paths.edges < len(room.edges))
    faces[upright] = room.edges.faces[paths.edges[upright]]
    level = paths.edges >= len(room.edges)
    faces[level] = np.column_stack(np.divmod(paths.edges[level] - len(room.edges), max(len(room.names), 1)))
    louder = np.append(room.reflectances, -1.0)[faces].argmax(axis=1)
    return np.asarray(faces[np.arange(len(paths)), louder])
