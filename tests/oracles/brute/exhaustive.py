"""Every way of sound from a point to another over walls and posts: all sequences of surfaces are tried.

Walls are unfolded by image sources. A post touches the unfolded way where its length is least (Fermat): the contact is
found by bisection, and several contacts in turn. No rays and no grid.
"""

import cmath
import itertools
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import h2vp, hankel2, jv, jvp

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
_END = 1e-9  # m, beyond the end of a wall that still counts as the wall
_AT_END = 1e-7  # m, near the end of a leg, where a surface does not block it
_THIN = 3.66  # wavelengths of radius: thinner posts return the exact wave
_SWEEPS, _HALVINGS = 12, 32


@dataclass(frozen=True)
class Scene:
    """Surfaces, walls first and then posts, and the position of the sensor; m."""

    walls: Floats  # (n, 4)
    posts: Floats  # (m, 3)
    reflectances: Floats  # (n + m,)
    position: Floats  # (2,)
    wavelength: float


@dataclass(frozen=True)
class Way:
    """One way from the sensor to a point."""

    points: Floats  # (k + 2, 2), m
    length: float  # m
    gain: complex  # reflectances, and how posts spread the sound, with the phase beyond that of the length

    @property
    def touches(self) -> int:
        """Number of reflections."""
        return len(self.points) - 2


def all_ways(scene: Scene, end: Floats, most: int, longest: float) -> list[Way]:
    """Return all ways from the sensor to `end` of up to `most` reflections and `longest` m; none is listed twice."""
    surfaces, found = range(len(scene.walls) + len(scene.posts)), []
    for count in range(most + 1):
        all_of_them = itertools.product(surfaces, repeat=count)
        sequences = [one for one in all_of_them if all(a != b for a, b in itertools.pairwise(one))]
        rows = np.array(sequences, dtype=np.intp).reshape(len(sequences), count)
        is_post = rows >= len(scene.walls)
        for pattern in np.unique(is_post, axis=0):
            some = rows[(is_post == pattern).all(axis=1)]
            found += _ways_of(scene, end, some, np.flatnonzero(pattern), longest)
    return _each_once(found)


def _ways_of(scene: Scene, end: Floats, rows: Ints, at_posts: Ints, longest: float) -> list[Way]:
    """Return the ways of these sequences (s, k), with posts at the same places `at_posts` in all of them."""
    start, end = (np.broadcast_to(point, (len(rows), 2)) for point in (scene.position, end))
    contacts, good = _contacts(scene, start, end, rows, at_posts)
    points = np.empty((len(rows), rows.shape[1] + 2, 2))
    points[:, 0], points[:, -1] = start, end
    anchors = [0, *(at_posts + 1).tolist(), rows.shape[1] + 1]
    for number, place in enumerate(at_posts):
        points[:, place + 1] = contacts[number]
    for first, last in itertools.pairwise(anchors):
        walls = scene.walls[rows[:, first : last - 1]]
        points[:, first + 1 : last], valid = _over_walls(points[:, first], points[:, last], walls)
        good &= valid
    for place in at_posts:
        x, y, radius = scene.posts[rows[:, place] - len(scene.walls)].T
        normal = (points[:, place + 1] - np.column_stack((x, y))) / radius[:, None]
        for beside in (place, place + 2):
            good &= ((points[:, beside] - points[:, place + 1]) * normal).sum(axis=1) > 0
    legs = np.hypot(*np.moveaxis(np.diff(points, axis=1), -1, 0))
    # into a right-angled corner, the touches of both walls are the vertex
    good &= (legs.sum(axis=1) <= longest) & (legs[:, 0] > _AT_END) & (legs[:, -1] > _AT_END)
    kept = [k for k in np.flatnonzero(good).tolist() if _is_free(scene, points[k])]
    return [_way(scene, points[k], rows[k]) for k in kept if _into_corners(scene, points[k], rows[k])]


def _mirrored(points: Floats, walls: Floats) -> Floats:
    """Return points (s, 2) mirrored in walls (s, 4)."""
    along = walls[:, 2:] - walls[:, :2]
    along = along / np.hypot(*along.T)[:, None]
    there = points - walls[:, :2]
    return np.asarray(walls[:, :2] + 2 * (there * along).sum(axis=1)[:, None] * along - there)


def _over_walls(start: Floats, end: Floats, walls: Floats) -> tuple[Floats, NDArray[np.bool_]]:
    """Return the touches (s, k, 2) between points (s, 2) over walls (s, k, 4) in turn, and whether all are on them."""
    images = [start]
    for k in range(walls.shape[1]):
        images.append(_mirrored(images[-1], walls[:, k]))
    touches, valid, at = np.empty((len(start), walls.shape[1], 2)), np.ones(len(start), np.bool_), end
    for k in reversed(range(walls.shape[1])):
        origin, along, way = walls[:, k, :2], walls[:, k, 2:] - walls[:, k, :2], images[k + 1] - at
        area = along[:, 0] * way[:, 1] - along[:, 1] * way[:, 0]
        area = np.where(area == 0, 1e-300, area)
        apart = at - origin
        share = (apart[:, 0] * way[:, 1] - apart[:, 1] * way[:, 0]) / area
        passed = (apart[:, 0] * along[:, 1] - apart[:, 1] * along[:, 0]) / area
        slack = _END / np.hypot(*along.T)
        valid &= (share >= -slack) & (share <= 1 + slack) & (passed > -1e-12) & (passed < 1)
        at = origin + np.clip(share, -9.0, 9.0)[:, None] * along
        touches[:, k] = at
    return touches, valid


def _contacts(
    scene: Scene, start: Floats, end: Floats, rows: Ints, at_posts: Ints
) -> tuple[list[Floats], NDArray[np.bool_]]:
    """Return the contact with each post in turn, (s, 2) each, and whether the search for them has converged."""
    turn, move = np.tile(np.eye(2), (len(rows), 1, 1)), np.zeros((len(rows), 2))
    frames, centres, radii = [], [], []
    for place in range(rows.shape[1]):
        if place in at_posts:
            post = scene.posts[rows[:, place] - len(scene.walls)]
            frames.append((turn, move))
            centres.append(np.einsum("sij,sj->si", turn, post[:, :2]) + move)
            radii.append(post[:, 2])
            continue
        wall = scene.walls[rows[:, place]]
        along = wall[:, 2:] - wall[:, :2]
        along = along / np.hypot(*along.T)[:, None]
        mirror = 2 * along[:, :, None] * along[:, None] - np.eye(2)
        move = move + np.einsum("sij,sj->si", turn, wall[:, :2] - np.einsum("sij,sj->si", mirror, wall[:, :2]))
        turn = turn @ mirror
    chain = [start, *centres, np.einsum("sij,sj->si", turn, end) + move]
    moved = np.zeros(len(rows))
    for _ in range(_SWEEPS if len(centres) > 1 else 1):
        moved = np.zeros(len(rows))
        for k, (centre, radius) in enumerate(zip(centres, radii, strict=True), start=1):
            touched = _nearest_contact(chain[k - 1], chain[k + 1], centre, radius)
            moved += np.hypot(*(touched - chain[k]).T)
            chain[k] = touched
    folded = [
        np.einsum("sji,sj->si", frame, touched - shift)
        for (frame, shift), touched in zip(frames, chain[1:-1], strict=True)
    ]
    return folded, np.ones(len(rows), np.bool_) if len(centres) < 2 else moved < 1e-7


def _nearest_contact(before: Floats, after: Floats, centre: Floats, radius: Floats) -> Floats:
    """Return where the way from `before` by a circle to `after`, (s, 2) each, is shortest, on its near side."""
    source, target, middle = (point @ (1, 1j) for point in (before, after, centre))
    first = np.angle(source - middle)
    turn = np.angle((target - middle) / (source - middle))
    low, high, onward = np.zeros(len(turn)), np.ones(len(turn)), 1j * np.sign(turn)
    for _ in range(_HALVINGS):
        share = (low + high) / 2
        normal = np.exp(1j * (first + share * turn))
        contact = middle + radius * normal
        one, other = contact - source, contact - target
        # the growth of the length as the contact turns
        shrinks = ((one / np.abs(one) + other / np.abs(other)) * np.conj(onward * normal)).real < 0
        low, high = np.where(shrinks, share, low), np.where(shrinks, high, share)
    contact = middle + radius * np.exp(1j * (first + (low + high) / 2 * turn))
    return np.column_stack((contact.real, contact.imag))


def _is_free(scene: Scene, points: Floats) -> bool:
    """Return whether no surface blocks a way, apart from those at the ends of its legs."""
    for start, end in itertools.pairwise(points):
        way = end - start
        length = math.hypot(*way)
        if length < 2 * _AT_END:
            continue
        way = way / length
        origin, along = scene.walls[:, :2] - start, scene.walls[:, 2:] - scene.walls[:, :2]
        area = way[0] * along[:, 1] - way[1] * along[:, 0]
        with np.errstate(divide="ignore", invalid="ignore"):
            ahead = (origin[:, 0] * along[:, 1] - origin[:, 1] * along[:, 0]) / area
            share = (origin[:, 0] * way[1] - origin[:, 1] * way[0]) / area
        if ((ahead > _AT_END) & (ahead < length - _AT_END) & (share >= 0) & (share <= 1)).any():
            return False
        centre = scene.posts[:, :2] - start
        nearest = np.clip(centre @ way, 0.0, length)
        if (np.hypot(*(centre - nearest[:, None] * way).T) < scene.posts[:, 2] - _AT_END).any():
            return False
    return True


def _into_corners(scene: Scene, points: Floats, surfaces: Ints) -> bool:
    """Return whether sound beside a way that touches two walls at their vertex is reflected by both, one after another.

    It is not at an outer corner.
    """
    for k in range(len(surfaces) - 1):
        if math.dist(points[k + 1], points[k + 2]) > _AT_END:
            continue
        walls = scene.walls[surfaces[k : k + 2]]
        onto = [max((wall[:2], wall[2:]), key=lambda e: math.dist(e, points[k + 1])) - points[k + 1] for wall in walls]
        coming = points[k + 1] - points[k]
        along = onto[0] / math.hypot(*onto[0])
        leaving = 2 * (coming @ along) * along - coming
        # beside the vertex: along the first wall, then on with the sound, onto the second wall
        on, reached = np.linalg.solve(np.column_stack((leaving, -onto[1])), -onto[0])
        if on <= 0 or reached <= 0:
            return False
    return True


def _way(scene: Scene, points: Floats, surfaces: Ints) -> Way:
    legs = np.diff(points, axis=0)
    lengths = np.hypot(*legs.T)
    width, opening, gain = float(lengths[0]), 1.0, 1.0 + 0j
    for k, surface in enumerate(surfaces.tolist()):
        reflectance = float(scene.reflectances[surface])
        gain *= reflectance
        if surface >= len(scene.walls):
            x, y, radius = scene.posts[surface - len(scene.walls)].tolist()
            normal = (points[k + 1] - (x, y)) / radius
            cosine = float(-legs[k] @ normal / lengths[k])
            opening += 2 * width / (radius * cosine)
            if radius < _THIN * scene.wavelength:
                gain *= _of_thin_post(math.tau / scene.wavelength * radius, math.acos(min(cosine, 1.0)), reflectance)
        width += opening * float(lengths[k + 1])
    length = float(lengths.sum())
    return Way(points, length, gain * math.sqrt(length / width))


def _of_thin_post(ka: float, incidence: float, reflectance: float) -> complex:
    """Return the far wave of a cylinder with an impedance, relative to its ray."""
    total, admittance = 0j, 1j * (1 - reflectance) / (1 + reflectance)
    for order in range(60):
        returned = (jvp(order, ka) - admittance * jv(order, ka)) / (h2vp(order, ka) - admittance * hankel2(order, ka))
        total += complex((1 if order == 0 else 2) * returned * math.cos(order * (math.pi - 2 * incidence)))
    # the wave by way of the centre, of a longer way than by the side
    longer = cmath.exp(0.25j * math.pi - 2j * ka * math.cos(incidence))
    return -2 * total * longer / math.sqrt(math.pi * ka * math.cos(incidence)) / reflectance


def _each_once(ways: list[Way]) -> list[Way]:
    """Return ways without those that have the same points, which sequences through a vertex describe."""
    kept: dict[tuple[float, ...], Way] = {}
    for way in ways:
        kept.setdefault(tuple(np.round(way.points, 6).ravel().tolist()), way)
    return list(kept.values())
