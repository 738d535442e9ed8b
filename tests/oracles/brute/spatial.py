"""Random rooms with floor and ceiling, and the comparison of predicted readings with those of images in space.

Only mirror paths: a box has no edge that bends sound, and in L-shaped rooms edges are left out.
"""

import itertools
import math
from dataclasses import dataclass, replace

import numpy as np
from sonarhw_sim.predict.prediction import PredictionOptions, predict_scan
from sonarhw_sim.room.room import Place, Room, parse_room

from tests.oracles.brute.exhaustive import Floats
from tests.oracles.brute.furnished import BOARD, MOST, Compared, sensor_of
from tests.oracles.brute.readings import readings, sound_of
from tests.oracles.images_in_space import faces_of, images_in_space

IN_SPACE = replace(BOARD, max_range=3.0)
_MANY = 64  # reflections


@dataclass(frozen=True)
class _Images:
    """Paths as images of the sensor."""

    lengths: Floats  # (n,), m
    gains: Floats  # (n,)
    departures: Floats  # (n, 3): unit vectors
    arrivals: Floats  # (n, 3)


@dataclass(frozen=True)
class Box:
    """A random box room."""

    room: Room
    place: Place
    size: Floats  # (3,), m
    shares: Floats  # (3, 2): reflectances of west, east; south, north; floor, ceiling


def random_box(seed: int) -> Box:
    """Return a random box room and a place in it."""
    random = np.random.default_rng(seed)
    size = random.uniform((1.2, 1.2, 1.0), (3.0, 3.0, 2.6))
    shares = random.uniform(0.5, 1.0, (3, 2))
    position = random.uniform(0.15, 0.85, 3) * size
    (x, y, top), ((west, east), (south, north), (floor, ceiling)) = size.tolist(), shares.tolist()
    sides = {
        "south": (((0.0, 0.0), (x, 0.0)), south),
        "east": (((x, 0.0), (x, y)), east),
        "north": (((x, y), (0.0, y)), north),
        "west": (((0.0, y), (0.0, 0.0)), west),
    }
    walls = "".join(_wall(name, points, name) for name, (points, _) in sides.items())
    room = _room(walls, top, {name: share for name, (_, share) in sides.items()}, floor, ceiling)
    return Box(room, _place(position), size, shares)


def compare_in_box(seed: int, headings: int) -> Compared:
    """Return the readings of a random box room, and those of all its images in closed form."""
    box = random_box(seed)
    return _compare(box.room, box.place, seed, headings, _MANY, _images_of_box(box))


def _images_of_box(box: Box) -> _Images:
    size, shares, position = box.size, box.shares, _point(box.place)
    most = np.ceil(2 * IN_SPACE.max_range / size).astype(int) + 1
    orders = np.array([row for row in itertools.product(*(range(-k, k + 1) for k in most)) if any(row)])
    images = orders * size + np.where(orders % 2, size - position, position)
    ways = images - position
    lengths = np.sqrt((ways**2).sum(axis=1))
    # the image of order k > 0 is behind the upper side, mirrored there first
    first, second = (np.abs(orders) + 1) // 2, np.abs(orders) // 2
    upper, lower = np.where(orders > 0, first, second), np.where(orders > 0, second, first)
    gains = (shares[:, 0] ** lower * shares[:, 1] ** upper).prod(axis=1)
    departures = ways / lengths[:, None]
    return _Images(lengths, gains, departures, np.where(orders % 2, departures, -departures))


def random_l_shape(seed: int) -> tuple[Room, Place]:
    """Return a random L-shaped room with a table, and a place in it."""
    random = np.random.default_rng(seed)
    (x, y), top = random.uniform(2.2, 3.0, 2).tolist(), float(random.uniform(1.6, 2.4))
    inner = random.uniform(0.45, 0.65, 2) * (x, y)
    ends = (
        (0.0, 0.0),
        (x, 0.0),
        (x, float(inner[1])),
        (float(inner[0]), float(inner[1])),
        (float(inner[0]), y),
        (0.0, y),
    )
    half, turn = random.uniform(0.12, 0.25, 2), float(random.uniform(0, math.pi))
    middle = inner * random.uniform(0.45, 0.55, 2)
    rotation = np.array([[math.cos(turn), math.sin(turn)], [-math.sin(turn), math.cos(turn)]])
    corners = middle + half * [[-1, -1], [1, -1], [1, 1], [-1, 1]] @ rotation
    low = float(random.choice([0.0, 0.4]))
    lid = low + float(random.uniform(0.05, 0.4))
    position = np.array([0.5 * inner[0], random.uniform(0.75, 0.9) * y, random.uniform(0.3, 1.2)])
    walls = _wall("w", ends, "hard", closed=True)
    walls += _wall("table", corners.tolist(), "wood", closed=True) + f"height = [{low!r}, {lid!r}]\nlids = true\n"
    shares = random.uniform(0.5, 1.0, 4).tolist()
    room = _room(walls, top, {"hard": shares[0], "wood": shares[1]}, *shares[2:])
    return room, _place(position)


def compare_in_l_shape(seed: int, headings: int) -> Compared:
    """Return the readings of a random L-shaped room with a table, and those of a search over all faces in space.

    Paths have up to three reflections.
    """
    room, place = random_l_shape(seed)
    x, y, height = _point(place).tolist()
    rows = np.array(images_in_space(faces_of(room), (x, y, height), MOST, 2 * IN_SPACE.max_range))
    images = _Images(rows[:, 0], rows[:, 1], rows[:, 2:5], rows[:, 5:8])
    return _compare(room, place, seed, headings, MOST, images)


def _place(position: Floats) -> Place:
    x, y, height = position.tolist()
    return Place("here", (x, y), height=height)


def _point(place: Place) -> Floats:
    return np.array([*place.position, place.height])


def _compare(room: Room, place: Place, seed: int, headings: int, most: int, images: _Images) -> Compared:
    turned = np.random.default_rng(seed).uniform(0, math.tau, headings)
    options = PredictionOptions(max_bounces=most, diffraction=False)
    scan = predict_scan(room, place, IN_SPACE, turned, options)
    sensor, wavelength = sensor_of(IN_SPACE, room.air, most), IN_SPACE.wavelength(room.air)
    departures, arrivals = images.departures[:, :2], images.arrivals[:, :2]
    sound = sound_of(images.lengths, departures, arrivals, images.gains.astype(complex), sensor, wavelength)
    return Compared(seed, turned, scan.ranges, readings(wavelength, sensor, sound, turned))


def _room(walls: str, top: float, shares: dict[str, float], floor: float, ceiling: float) -> Room:
    materials = {**shares, "lino": floor, "tiles": ceiling}
    text = f'name = "room"\n[floor]\nheight = 0.0\nmaterial = "lino"\n[ceiling]\nheight = {top!r}\nmaterial = "tiles"\n'
    text += "".join(f"[materials.{name}]\nreflectance = {share!r}\n" for name, share in materials.items())
    return parse_room(text + walls, "room")


def _wall(name: str, points: object, material: str, closed: bool = False) -> str:
    corners = [[float(x), float(y)] for x, y in points]  # type: ignore[attr-defined]
    return f'[[walls]]\nname = "{name}"\npoints = {corners}\nclosed = {str(closed).lower()}\nmaterial = "{material}"\n'
