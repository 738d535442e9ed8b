"""Rooms of as many walls as wanted: a floor of offices with doors, tables and plates.

Takes a number of walls and a seed; hands on a room, and a place in its first office. More walls make a larger floor,
not a denser one: offices are 3 m square and hold two or three things each.
"""

import math

import numpy as np
from sonarhw_sim.room.model import Place, Room, parse_room

OFFICE = 3.0  # m
DOOR = 0.9  # m
WALLS_AN_OFFICE = 11  # its share of partitions, and what stands in it
PLACE = Place("desk", (1.13, 1.37))

Segment = tuple[float, float, float, float]


def office_floor(walls: int, seed: int = 1) -> Room:
    """A floor of exactly `walls` walls, 30 at least."""
    random = np.random.default_rng(seed)
    offices = max(1, walls // WALLS_AN_OFFICE)
    across = math.ceil(math.sqrt(offices))
    up = math.ceil(offices / across)
    segments = _outline(across * OFFICE, up * OFFICE) + _partitions(across, up, random)
    while walls - len(segments) >= 4:
        segments += _table(across, up, random)
    while len(segments) < walls:
        segments.append(_plate(across, up, random))
    return parse_room("\n".join(_lines(segments)), f"floor of {walls} walls")


def _outline(width: float, height: float) -> list[Segment]:
    corners = [(0.0, 0.0), (width, 0.0), (width, height), (0.0, height)]
    return [(*a, *b) for a, b in zip(corners, corners[1:] + corners[:1], strict=True)]


def _partitions(across: int, up: int, random: np.random.Generator) -> list[Segment]:
    """Between any two offices a wall with a door in it."""
    segments: list[Segment] = []
    for column in range(across):
        for row in range(up):
            x, y = column * OFFICE, row * OFFICE
            door = float(random.uniform(0.2, OFFICE - DOOR - 0.2))
            if column:
                segments += [(x, y, x, y + door), (x, y + door + DOOR, x, y + OFFICE)]
            if row:
                segments += [(x, y, x + door, y), (x + door + DOOR, y, x + OFFICE, y)]
    return segments


def _table(across: int, up: int, random: np.random.Generator) -> list[Segment]:
    x, y = _somewhere(across, up, random)
    width, height = random.uniform(0.2, 0.5, 2).tolist()
    return [(x + a, y + b, x + c, y + d) for a, b, c, d in _outline(width, height)]


def _plate(across: int, up: int, random: np.random.Generator) -> Segment:
    x, y = _somewhere(across, up, random)
    return x, y, x + 0.4, y + 0.3


def _somewhere(across: int, up: int, random: np.random.Generator) -> tuple[float, float]:
    """A corner of what stands in an office: clear of its walls and of the place."""
    while True:
        x, y = random.uniform(0.3, OFFICE - 0.9, 2).tolist()
        if math.dist((x + 0.25, y + 0.25), PLACE.position) > 0.6:
            return OFFICE * int(random.integers(across)) + x, OFFICE * int(random.integers(up)) + y


def _lines(segments: list[Segment]) -> list[str]:
    lines = ['name = "Offices"', "[materials.plaster]", "reflectance = 0.95"]
    for k, (x0, y0, x1, y1) in enumerate(segments):
        lines += ["[[walls]]", f'name = "w{k}"', f"points = [[{x0!r}, {y0!r}], [{x1!r}, {y1!r}]]"]
        lines.append('material = "plaster"')
    return lines
