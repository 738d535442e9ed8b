"""Rooms with any number of walls: a floor of offices with doors, tables and plates.

More walls give a larger floor, not a denser one: offices are 3 m square with two or three objects each. The place of
measurement is in the first office.
"""

import math

import numpy as np
from sonarhw_sim.room.room import Place, Room, parse_room

OFFICE = 3.0  # m
DOOR = 0.9  # m
WALLS_PER_OFFICE = 11  # its share of partitions, and its objects
PLACE = Place("desk", (1.13, 1.37))

Segment = tuple[float, float, float, float]


def office_floor(walls: int, seed: int = 1) -> Room:
    """Return a floor of exactly `walls` walls, at least 30."""
    random = np.random.default_rng(seed)
    offices = max(1, walls // WALLS_PER_OFFICE)
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
    """Return the walls between offices, each with a door."""
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
    """Return a corner of an object in an office, away from its walls and from the place."""
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
