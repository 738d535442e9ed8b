"""Exact levels of small scenes at one frequency, and the level of the same scene by its paths.

Levels are those of all echoes together at the carrier, in dB relative to an endless perfect wall. No method here uses
rays: an integral equation for thin plates, the integral of a wedge with its image sources, the series of a cylinder.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.special import h2vp, hankel2, jv, jvp
from sonarhw_sim.rays.paths import PathSearch, find_paths

from tests.fixtures.rooms_for_tests import room_of
from tests.oracles.exact.exact_wedge import diffracted_by_wedge
from tests.oracles.exact.thin_strip import ThinStrip

Point = NDArray[np.float64]  # (2,), m
WAVELENGTH = 343.99 / 49_400
WAVENUMBER = math.tau / WAVELENGTH
_SILENT = 1e-6  # amplitude, in place of 0
_BURST = 0.1  # m


def decibels(amplitude: complex) -> float:
    """Return a level in dB, not below -120."""
    return 20 * math.log10(max(abs(amplitude), _SILENT))


def by_paths(
    walls: Sequence[Sequence[float]],
    mirrored: float,
    source: Point,
    receiver: Point | None = None,
    *,
    posts: Sequence[Sequence[float]] = (),
    reflectance: float = 1.0,
    longer_than: float = 0.0,
) -> float:
    """Return the level of all paths longer than some m, relative to a perfect wall with a path of `mirrored` m."""
    room = room_of(walls, posts, np.full(max(len(walls) + len(posts), 1), reflectance))
    end = source if receiver is None else receiver
    search = PathSearch(mirrored + 3.0, WAVELENGTH, faintest_diffraction=1e-6)
    paths = find_paths(room, tuple(source.tolist()), search, tuple(end.tolist()))
    rows = np.flatnonzero(((paths.bounces > 0) | (paths.edges >= 0)) & (paths.lengths > longer_than))
    phasors = paths.gains[rows] * np.exp(1j * (paths.phases[rows] - WAVENUMBER * paths.lengths[rows]))
    return decibels(complex((phasors * np.sqrt(mirrored / paths.lengths[rows])).sum()))


def level_near(
    walls: Sequence[Sequence[float]], posts: Sequence[Sequence[float]], place: Point, length: float
) -> float:
    """Return the level of all paths of a length (m) or little more or less, relative to a perfect wall."""
    room = room_of(walls, posts, np.ones(len(walls) + len(posts)))
    search = PathSearch(length + 1.0, WAVELENGTH, faintest_diffraction=1e-5)
    paths = find_paths(room, tuple(place.tolist()), search)
    rows = np.flatnonzero(np.abs(paths.lengths - length) < _BURST)
    phasors = paths.gains[rows] * np.exp(1j * (paths.phases[rows] - WAVENUMBER * paths.lengths[rows]))
    return decibels(complex((phasors * np.sqrt(length / paths.lengths[rows])).sum()))


def by_integral_equation(
    ends: tuple[float, float], mirrored: float, source: Point, receiver: Point, reflectance: float = 1.0
) -> float:
    """Return the level of a thin plate on the x axis between `ends` (m), with the impedance of `reflectance`."""
    low, high = ends
    middle = np.array([(low + high) / 2, 0.0])
    plate = ThinStrip((high - low) / 2, WAVENUMBER, reflectance)
    return decibels(
        plate.pressure(source - middle, receiver - middle) / complex(0.25 * hankel2(0, WAVENUMBER * mirrored))
    )


def by_wedge_integral(air_deg: float, at_deg: float, distance: float, longer_than: float = 0.0) -> float:
    """Return the level of a rigid wedge, seen in `at_deg` from one face, relative to a wall at its vertex.

    Of the image sources, those with paths longer than `longer_than` m.
    """
    air, at = math.radians(air_deg), math.radians(at_deg)
    wall = hankel2(0, WAVENUMBER * 2 * distance)
    total = diffracted_by_wedge((at, at), air, (distance, distance), WAVENUMBER) * wall
    for turn in visible_images(air, at):
        length = 2 * distance * abs(math.sin(turn / 2))
        total += hankel2(0, WAVENUMBER * length) if length > longer_than else 0.0
    return decibels(complex(total / wall))


def visible_images(air: float, at: float) -> list[float]:
    """Return the angles between the source and its images that are visible from it: less than half a turn.

    In a wedge that divides half a turn, the image opposite the source is one, and is visible.
    """
    most = math.ceil(math.pi / air) + 1
    turns = [2 * k * air for k in range(-most, most + 1) if k] + [2 * k * air - 2 * at for k in range(-most, most + 2)]
    divides = abs(math.pi / air - round(math.pi / air)) < 1e-9
    opposite = divides and any(abs(abs(turn) - math.pi) < 1e-9 for turn in turns)
    return [turn for turn in turns if abs(turn) < math.pi - 1e-9] + [math.pi] * opposite


def by_cylinder_series(radius: float, distance: float, reflectance: float = 1.0) -> float:
    """Return the level of a post whose surface is `distance` m away, with the impedance of `reflectance`."""
    ka, kr = WAVENUMBER * radius, WAVENUMBER * (radius + distance)
    order = np.arange(math.ceil(ka + 6 * ka ** (1 / 3)) + 8)
    admittance = 1j * (1 - reflectance) / (1 + reflectance)
    returned = (jvp(order, ka) - admittance * jv(order, ka)) / (h2vp(order, ka) - admittance * hankel2(order, ka))
    total = (np.where(order == 0, 1.0, 2.0) * returned * hankel2(order, kr) ** 2).sum()
    return decibels(complex(total / hankel2(0, WAVENUMBER * 2 * distance)))
