"""Random rooms with boxes, a plate and posts, and the comparison of predicted readings with the exhaustive ones."""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from sonarhw_sim.air import Air, Receiver
from sonarhw_sim.board.profile import Board, load_board
from sonarhw_sim.predict.prediction import PredictionOptions, predict_scan
from sonarhw_sim.room.room import Place

from tests.fixtures.rooms_for_tests import room_of
from tests.oracles.brute.exhaustive import Floats, Scene
from tests.oracles.brute.readings import Sensor, all_sound, readings

Flags = NDArray[np.bool_]
MOST = 3  # reflections
THINNEST = 0.02  # m, radius of posts
BOARD = replace(load_board("polaroid-6500"), receiver=Receiver.FIRST_ECHO, max_range=2.2, threshold_db=-30.0)
_GAP = 0.05  # m, between objects, and from the sensor to each
_EQUAL = 1e-6  # m


@dataclass(frozen=True)
class Compared:
    """The readings of one room."""

    seed: int
    headings: Floats  # (h,), rad
    predicted: Floats  # (h,), m, NaN: none
    exhaustive: Floats  # (h, 3), m: with the threshold lower by a tie, as it is, higher by a tie

    @property
    def unsure(self) -> Flags:
        """At which headings the exhaustive reading changes within a tie, (h,) bool."""
        low, _, high = self.exhaustive.T
        return np.asarray(~_equal(low, high))

    @property
    def wrong(self) -> Flags:
        """At which headings the prediction differs, also from both readings of a tie, (h,) bool."""
        return np.asarray(~np.any([_equal(self.predicted, column) for column in self.exhaustive.T], axis=0))


def _equal(one: Floats, other: Floats) -> Flags:
    return np.asarray((np.abs(one - other) < _EQUAL) | (np.isnan(one) & np.isnan(other)))


def compare(seed: int, headings: int, thinnest: float = THINNEST, board: Board = BOARD) -> Compared:
    """Return the readings of a random room at this number of headings, with posts of `thinnest` m radius or more.

    Without sound that bends twice or past thin posts, which the exhaustive search does not contain.
    """
    scene, turned = random_scene(seed, thinnest, board), np.random.default_rng(seed).uniform(0, math.tau, headings)
    room = room_of(scene.walls, scene.posts, scene.reflectances)
    x, y = scene.position.tolist()
    scan = predict_scan(room, Place("here", (x, y)), board, turned, PredictionOptions(max_bounces=MOST, shadows=False))
    sensor = sensor_of(board, room.air, MOST)
    expected = readings(scene.wavelength, sensor, all_sound(scene, sensor), turned)
    return Compared(seed, turned, scan.ranges, expected)


def sensor_of(board: Board, air: Air, most: int) -> Sensor:
    """Return the sensor of a board with the paper's receiver, and paths of up to `most` reflections."""
    ka = board.wavenumber(air) * board.aperture_radius
    return Sensor(ka, board.threshold_db, 2 * board.blanked_range(air), 2 * board.max_range, most)


def random_scene(seed: int, thinnest: float = THINNEST, board: Board = BOARD) -> Scene:
    """Return a room of four walls, right-angled or not, with one or two boxes, a plate, and one or two posts.

    No wall is so narrow that sound runs along it from end to end.
    """
    random = np.random.default_rng(1000 + seed)
    width, depth = random.uniform(1.9, 2.8), random.uniform(1.6, 2.2)
    corners = np.array([[0, 0], [width, 0], [width, depth], [0, depth]], dtype=np.float64)
    if seed % 2:
        corners += random.uniform(-0.15, 0.15, (4, 2))
    placed: list[tuple[Floats, float]] = []

    def place(radius: float) -> Floats:
        while True:
            centre = random.uniform((0.2, 0.2), (width - 0.2, depth - 0.2))
            free = all(math.dist(centre, other) > radius + around + _GAP for other, around in placed)
            if free and _depth_inside(centre, corners) > radius + _GAP:
                placed.append((centre, radius))
                return np.asarray(centre)

    chains, posts = [corners], []
    for _ in range(random.integers(1, 3)):
        half = random.uniform(0.07, 0.18, 2)
        centre, turn = place(math.hypot(*half)), random.uniform(0, math.pi)
        chains.append(centre + half * [[-1, -1], [1, -1], [1, 1], [-1, 1]] @ _rotation(turn))
    half_plate = random.uniform(0.08, 0.3)
    middle, along = place(half_plate), random.uniform(0, math.pi)
    for _ in range(random.integers(1, 3)):
        radius = math.exp(random.uniform(math.log(thinnest), math.log(0.08)))
        posts.append([*place(radius), radius])
    position = place(0.0)
    ends = half_plate * np.array([math.cos(along), math.sin(along)])
    walls = [np.hstack((chain, np.roll(chain, -1, axis=0))) for chain in chains]
    walls.append(np.hstack((middle - ends, middle + ends))[None])
    lines = np.vstack(walls)
    shares = random.uniform(0.4, 1.0, len(lines) + len(posts))
    return Scene(lines, np.array(posts), shares, position, board.wavelength(Air()))


def _rotation(angle: float) -> Floats:
    return np.array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]])


def _depth_inside(point: Floats, corners: Floats) -> float:
    """Return the distance (m) of a point from the nearest side of a convex polygon, counter-clockwise."""
    along = np.roll(corners, -1, axis=0) - corners
    apart = point - corners
    return float(((along[:, 0] * apart[:, 1] - along[:, 1] * apart[:, 0]) / np.hypot(*along.T)).min())
