"""Random rooms with furniture, posts and a doorway, and scans from random places in them."""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.random import Generator
from sonarhw_compare.fit import PlacedScan
from sonarhw_sim.board.profile import Board
from sonarhw_sim.predict.room_echoes import MAX_ECHOES, Disturbance, RoomEchoes
from sonarhw_sim.room.room import Place, Room, parse_room

from sonarhw.readings import FloatArray, Ping, Reading

READINGS = 120
RANGE = 0.01  # m
LEVEL = 1.0  # dB
ANYWHERE = 0.05  # of readings: the range is random
_CLEAR = 0.3  # m, from a place to walls and posts
_APART = 0.5  # m, between places
Point = tuple[float, float]


@dataclass(frozen=True)
class RandomRoom:
    """A room and the scans of it."""

    seed: int
    room: Room
    scans: tuple[PlacedScan, ...]


def random_room(seed: int, board: Board, scans: int | None = None, all_echoes: bool = False) -> RandomRoom:
    """Return a random room of 4 to 12 walls, and 4 to 8 scans of it, by default with the first echo of each reading."""
    random = np.random.default_rng((seed, 17))
    while True:
        outline = _outline(random)
        room = parse_room(_text(seed, outline, random), f"random room {seed}")
        places = _places(room, outline, random, scans or int(random.integers(4, 9)))
        if len(room.walls) <= 12 and places:
            made = [
                PlacedScan(noisy_scan(room, place, board, 100 * seed + k, all_echoes), place, f"scan{k}", f"scan{k}")
                for k, place in enumerate(places)
            ]
            return RandomRoom(seed, room, tuple(made))


def _outline(random: Generator) -> list[Point]:
    """Return the corners of a rectangle, an L, a room with an oblique corner or a T."""
    width, depth = random.uniform(2.2, 4.5, 2).tolist()
    a, b = (random.uniform(0.25, 0.5, 2) * (width, depth)).tolist()
    shapes: list[list[Point]] = [
        [(0.0, 0.0), (width, 0.0), (width, depth), (0.0, depth)],
        [(0.0, 0.0), (width, 0.0), (width, depth - b), (width - a, depth - b), (width - a, depth), (0.0, depth)],
        [(0.0, 0.0), (width, 0.0), (width, depth - b), (width - a, depth), (0.0, depth)],
        [
            (a / 2, 0.0),
            (width, 0.0),
            (width, depth - b),
            (width - a, depth - b),
            (width - a, depth),
            (0.0, depth),
            (0.0, b / 2),
            (a / 2, b / 2),
        ],
    ]
    return shapes[int(random.integers(len(shapes)))]


def _text(seed: int, outline: list[Point], random: Generator) -> str:
    turn = random.uniform(0, math.tau)
    turned = np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]])
    text = [f'name = "random {seed}"', "[materials.wall]", "reflectance = 0.9"]

    def wall(name: str, points: list[Point], closed: bool) -> None:
        moved = (np.array(points) @ turned.T).tolist()
        text.extend(["[[walls]]", f'name = "{name}"', f"points = {moved}", f"closed = {str(closed).lower()}"])
        text.append('material = "wall"')

    if random.random() < 0.5:  # a doorway in the first wall
        (x, y), (x2, _) = outline[0], outline[1]
        door = random.uniform(0.6, 0.9)
        at = random.uniform(x + 0.3, x2 - 0.3 - door)
        wall("outline", [(at + door, y), *outline[1:], outline[0], (at, y)], False)
    else:
        wall("outline", outline, True)
    inside = np.array(outline)
    low, high = inside.min(axis=0), inside.max(axis=0)
    if random.random() < 0.5:  # furniture
        x, y = random.uniform(low + 0.5, high - 1.2).tolist()
        w, d = random.uniform(0.3, 0.7, 2).tolist()
        if all(_inside(point, outline) for point in ((x, y), (x + w, y + d), (x + w, y), (x, y + d))):
            wall("box", [(x, y), (x + w, y), (x + w, y + d), (x, y + d)], True)
    for number in range(int(random.integers(0, 3))):
        x, y = random.uniform(low + 0.3, high - 0.3).tolist()
        if _inside((x, y), outline):
            x, y = (turned @ (x, y)).tolist()
            text.extend(["[[posts]]", f'name = "post{number}"', f"center = [{x}, {y}]"])
            text.extend([f"radius = {random.uniform(0.03, 0.12)}", 'material = "wall"'])
    return "\n".join(text)


def _inside(point: Point, outline: list[Point]) -> bool:
    (x, y), inside = point, False
    for (x1, y1), (x2, y2) in zip(outline, outline[1:] + outline[:1], strict=True):
        if (y1 > y) != (y2 > y) and x < x1 + (y - y1) / (y2 - y1) * (x2 - x1):
            inside = not inside
    return inside


def _places(room: Room, outline: list[Point], random: Generator, count: int) -> list[Place]:
    """Return clear places apart from each other; empty if no room was found for them."""
    corners = room.walls[[name.startswith("outline") for name in room.names[: len(room.walls)]]].reshape(-1, 2)
    low, high = corners.min(axis=0), corners.max(axis=0)
    found: list[Place] = []
    for _ in range(2000):
        x, y = random.uniform(low, high).tolist()
        clear = not room.is_outside((x, y)) and _clearance(room, (x, y)) > _CLEAR and _within(corners, (x, y))
        if clear and all(math.dist((x, y), other.position) > _APART for other in found):
            found.append(Place(f"p{len(found)}", (x, y)))
        if len(found) == count:
            return found
    return []


def _within(corners: FloatArray, point: Point) -> bool:
    """Report whether a point lies inside the outline, whose corners are in order; a doorway counts as closed."""
    return _inside(point, [(x, y) for x, y in corners.tolist()])


def _clearance(room: Room, point: Point) -> float:
    starts, along = room.walls[:, :2], room.walls[:, 2:] - room.walls[:, :2]
    share = np.clip(((point - starts) * along).sum(axis=1) / (along**2).sum(axis=1), 0, 1)
    walls = np.hypot(*(starts + share[:, None] * along - point).T)
    posts = np.hypot(*(room.posts[:, :2] - point).T) - room.posts[:, 2]
    return float(min([*walls, *posts]))


def noisy_scan(room: Room, place: Place, board: Board, seed: int, all_echoes: bool = False) -> list[Reading]:
    """Return the scan of a place with errors of range and level, and some false echoes.

    A false echo replaces the first echo of a reading, or is added to `all_echoes` that a scanner reports.
    """
    random = np.random.default_rng((seed, 5))
    speed = room.air.speed_of_sound
    listen = 2 * board.max_range / speed
    errors = Disturbance(0.0, 0.0, 0.0, 2 * RANGE / speed, LEVEL, 0.0, furniture=False)
    source = RoomEchoes(room, place, replace(board), seed, errors)
    made = []
    for number, angle in enumerate((np.arange(READINGS) * math.tau / READINGS).tolist()):
        times = source.receive(Ping(angle, 0, 0, listen, trace=False)).echo_times[: MAX_ECHOES if all_echoes else 1]
        if random.random() < ANYWHERE:
            false = float(random.uniform(board.blanking_end, listen))
            times = tuple(sorted((*times, false))[:MAX_ECHOES]) if all_echoes else (false,)
        made.append(Reading(number, 0, 0, angle, 0.1 * number, times, speed))
    return made
