"""Scenes for the wave equation, and comparison with the paths of the same scenes, arrival by arrival.

Each scene shows one effect. Its arrivals are at least a burst apart, so that they do not overlap.
"""

import math
from dataclasses import dataclass

import numpy as np
from sonarhw_sim.air import EdgeStrength
from sonarhw_sim.rays.paths import Paths, PathSearch, find_paths
from sonarhw_sim.room.room import Room

from tests.fixtures.rooms_for_tests import room_of
from tests.oracles.wave_equation import CELL, FLAT_WALL, WAVELENGTH, Arrival, Scene, Wall, arrival_near, matched

LONGEST = 0.75  # m: greatest length of paths
OUT = 9.0  # m: walls end there, out of range
EDGE_AT = 12 * WAVELENGTH  # m from the source


def inner_corner(opening_deg: float, distance: float, from_floor_deg: float) -> Scene:
    """Return two walls with air between them, seen from `distance` in a direction relative to the floor."""
    x, y = _vertex(distance, from_floor_deg)
    return Scene(
        f"inner corner of {opening_deg:g}°, seen from {from_floor_deg:g}°",
        (_reverse(_wall_from(x, y, opening_deg)), (x, y, OUT, y)),
        solids=((0,), (1,)),
    )


def outer_corner(air_deg: float, from_face_deg: float) -> Scene:
    """Return the corner of a solid in `air_deg` of air, seen from a direction relative to its level face."""
    x, y = _vertex(EDGE_AT, from_face_deg)
    walls = (_reverse(_wall_from(x, y, air_deg)), (x, y, OUT, y))
    return Scene(f"corner in {air_deg:g}° of air, seen from {from_face_deg:g}°", walls, solids=((0, 1),))


def plate_end(from_face_deg: float) -> Scene:
    """Return the end of a thin level plate, seen from a direction relative to it."""
    x, y = _vertex(EDGE_AT, from_face_deg)
    return Scene(f"end of a plate, seen from {from_face_deg:g}°", ((x, y, OUT, y),))


def strip(width: float) -> Scene:
    """Return a thin plate at the flat wall's distance, `width` m wide, opposite the source."""
    at = FLAT_WALL.walls[0][0]
    low = _on_line(-width / 2)
    return Scene(f"strip of {1000 * width:g} mm", ((at, low, at, low + width),))


def strip_on_a_stem(width: float, aside: float) -> Scene:
    """Return `strip` with another plate that joins it from behind, `aside` m beside its middle."""
    at, joint = FLAT_WALL.walls[0][0], _on_line(aside)
    return Scene("strip on a stem", (*strip(width).walls, (at, joint, OUT, joint)))


def _vertex(distance: float, towards_source_deg: float) -> tuple[float, float]:
    """Return the position of a vertex with the source in this direction, moved to lines between cells."""
    angle = math.radians(towards_source_deg)
    return _on_line(-distance * math.cos(angle)), _on_line(-distance * math.sin(angle))


def _on_line(coordinate: float) -> float:
    return (math.floor(coordinate / CELL) + 0.5) * CELL


def _wall_from(x: float, y: float, direction_deg: float) -> Wall:
    angle = math.radians(direction_deg)
    return x, y, x + OUT * math.cos(angle), y + OUT * math.sin(angle)


def _reverse(wall: Wall) -> Wall:
    return (*wall[2:], *wall[:2])


def _floor(y: float) -> Wall:
    return -OUT, y, OUT, y


REFLECTED = (
    FLAT_WALL,
    Scene("flat wall, separate receiver", FLAT_WALL.walls, FLAT_WALL.solids, receiver=(0.0, 0.3)),
    inner_corner(90, 0.35, 31),
    inner_corner(60, 0.38, 20),
    Scene("post", posts=((0.25, 0.0, 0.05),)),
    Scene("thick post, separate receiver", posts=((0.28, 0.0, 0.1),), receiver=(0.0, 0.2)),
    Scene("two posts", posts=((0.12, 0.16, 0.05), (0.2, -0.18, 0.06))),
    Scene("post before a wall", (_floor(-0.1005),), solids=((0,),), posts=((0.28, 0.1, 0.06),)),
)
PLATES = tuple(plate_end(direction) for direction in (30, 60, 100, 110, 120, 135))
CORNERS = (outer_corner(270, 110), outer_corner(270, 135), outer_corner(240, 120), inner_corner(120, EDGE_AT, 100))
DIFFRACTED = (
    *PLATES,
    *CORNERS,
    Scene("behind the end of a plate", ((0.1505, -0.1005, 0.1505, OUT),), receiver=(0.3, 0.0), shadowed=True),
    Scene("end of a plate beside a post", ((0.2005, 0.1005, 0.2005, OUT),), posts=((0.0, -0.2, 0.1),)),
    Scene("end of a plate over a wall", (_floor(-0.1005), (0.1505, 0.1205, OUT, 0.1205)), solids=((0,),)),
)
TWICE_BENT = (
    Scene("edges of two plates, 60 mm apart", ((0.2005, 0.0305, 0.2005, OUT), (0.2005, -0.0305, 0.2005, -OUT))),
    Scene("edges of two plates, 120 mm apart", ((0.2005, 0.0605, 0.2005, OUT), (0.2005, -0.0605, 0.2005, -OUT))),
    Scene("edges of two plates, one 100 mm behind", ((0.1505, 0.0605, 0.1505, OUT), (0.2505, -0.0305, 0.2505, -OUT))),
    Scene(
        "corners of two boxes, 90 mm apart",
        (
            *((OUT, 0.0455, 0.2005, 0.0455), (0.2005, 0.0455, 0.2005, OUT)),
            *((0.2005, -OUT, 0.2005, -0.0455), (0.2005, -0.0455, OUT, -0.0455)),
        ),
        solids=((0, 1), (2, 3)),
    ),
)


@dataclass(frozen=True)
class Difference:
    """One arrival by the paths, and by the wave equation."""

    scene: str
    via: str  # as in `sonarhw paths`; several if they are equally long
    diffracted: bool  # whether an edge diffracts it
    predicted: Arrival
    found: Arrival

    @property
    def cycles(self) -> float:
        """Delay relative to the prediction, in cycles of the carrier."""
        return (self.found.length - self.predicted.length) / WAVELENGTH

    @property
    def decibels(self) -> float:
        """Level relative to the prediction, dB."""
        return 20 * math.log10(self.found.strength / self.predicted.strength)


def differences(scene: Scene, edge_strength: EdgeStrength = EdgeStrength.UNIFORM) -> list[Difference]:
    """Return all arrivals of a scene, earliest first; paths up to one wavelength longer arrive with a path and add."""
    room = room_of(scene.walls, scene.posts)
    search = PathSearch(LONGEST, WAVELENGTH, edge_strength=edge_strength)
    paths = find_paths(room, (0.0, 0.0), search, receiver=scene.receiver)
    touching = np.flatnonzero((paths.bounces > 0) | (paths.edges >= 0))
    arrivals = []
    while len(touching):
        together = paths.lengths[touching] <= paths.lengths[touching[0]] + WAVELENGTH
        arrivals.append(_difference(scene, room, paths, touching[together]))
        touching = touching[~together]
    return arrivals


def unexplained(scene: Scene) -> float:
    """Return the strongest echo without a path, relative to a flat wall."""
    strengths, lengths = matched(scene)
    # shorter than this, the burst of an arrival has not ended
    explained = [np.abs(lengths - arrival.predicted.length) < 3 * WAVELENGTH for arrival in differences(scene)]
    free = (lengths > 3 * WAVELENGTH) & (lengths < LONGEST) & ~np.logical_or.reduce(explained)
    return float(strengths[free].max())


def _difference(scene: Scene, room: Room, paths: Paths, rows: np.ndarray) -> Difference:
    phasors = paths.gains[rows] * np.exp(1j * (paths.phases[rows] - math.tau / WAVELENGTH * paths.lengths[rows]))
    loudest = rows[np.argmax(paths.gains[rows])]
    predicted = Arrival(float(paths.lengths[loudest]), float(abs(phasors.sum())))
    via = " | ".join(">".join(paths.via(int(row), room)) for row in rows)
    diffracted = bool((paths.edges[rows] >= 0).any())
    return Difference(scene.name, via, diffracted, predicted, arrival_near(scene, predicted.length))
