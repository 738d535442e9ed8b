"""Peaks of the trace of small scenes, by their paths and by exact waves, in dB relative to that of an endless wall.

The wave is multiplied, frequency by frequency, with the spectrum of the trace of a flat wall. Only this trace, the
burst of the board, is that of the product. Straight ahead of the transducer, without its beam.
"""

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.special import h2vp, hankel2, jvp
from sonarhw_sim.air import EdgeStrength
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.board.signal import RATE, Arrivals, received
from sonarhw_sim.rays.paths import PathSearch, find_paths

from tests.fixtures.rooms_for_tests import room_of
from tests.oracles.exact.exact_levels import WAVELENGTH, Point, decibels, visible_images
from tests.oracles.exact.exact_wedge import diffracted_by_wedge
from tests.oracles.exact.thin_strip import ThinStrip

Wave = Callable[[float], complex]  # sound at a wavenumber (rad/m), relative to an endless wall

_BOARD = load_board("polaroid-6500")
_SPEED = WAVELENGTH * _BOARD.frequency  # m/s
_SIZE = 0.1  # of full scale
_BAND, _STEP = 12_000.0, 250.0  # Hz, from the carrier
_BEFORE, _AFTER = 0.0003, 0.002  # s, around the echo of the wall


def peak_by_wave(distance: float, wave: Wave) -> float:
    """Return the peak of the trace of a wave; its sound arrives within 2 ms of that of a wall at a distance, m."""
    wall = _trace(np.array([2 * distance]), np.ones(1), distance)
    offsets = np.arange(-_BAND, _BAND + _STEP, _STEP)
    ratios = np.array([wave(math.tau * (_BOARD.frequency + offset) / _SPEED) for offset in offsets.tolist()])
    at = np.fft.fftfreq(len(wall), 1 / RATE)
    factors = np.interp(at, offsets, ratios.real) + 1j * np.interp(at, offsets, ratios.imag)
    return decibels(np.abs(np.fft.ifft(np.fft.fft(wall) * factors)).max() / np.abs(wall).max())


def peak_by_paths(
    walls: Sequence[Sequence[float]],
    distance: float,
    source: Point,
    posts: Sequence[Sequence[float]] = (),
    strength: EdgeStrength = EdgeStrength.UNIFORM,
) -> float:
    """Return the peak of the predicted trace at a place `source` (2,) m, relative to a wall at a distance, m."""
    room = room_of(walls, posts, np.ones(max(len(walls) + len(posts), 1)))
    search = PathSearch(2 * distance + 0.5, WAVELENGTH, faintest_diffraction=1e-6, edge_strength=strength)
    paths = find_paths(room, tuple(source.tolist()), search)
    amplitudes = paths.gains * np.exp(1j * paths.phases) * np.sqrt(2 * distance / paths.lengths)
    wall = _trace(np.array([2 * distance]), np.ones(1), distance)
    return decibels(np.abs(_trace(paths.lengths, amplitudes, distance)).max() / np.abs(wall).max())


def _trace(lengths: NDArray[np.float64], amplitudes: NDArray[np.generic], distance: float) -> NDArray[np.complex128]:
    """Return the samples of a trace around the echo of a wall, without the transmit burst."""
    ahead, middle = np.ones(len(lengths)), 2 * distance / _SPEED
    arrivals = Arrivals(lengths / _SPEED, _SIZE * np.asarray(amplitudes), ahead, ahead)
    echoes = received(arrivals, _BOARD, _SPEED, middle + _AFTER).samples
    silence = received(arrivals.select(slice(0)), _BOARD, _SPEED, middle + _AFTER).samples
    return np.asarray((echoes - silence)[int((middle - _BEFORE) * RATE) :])


def strip_at(width: float, distance: float) -> Wave:
    """Return the wave of a thin strip straight ahead, m."""
    place = np.array([0.0, distance])
    return lambda k: ThinStrip(width / 2, k).pressure(place, place) / complex(0.25 * hankel2(0, k * 2 * distance))


def wall_end_at(beyond: float, distance: float) -> Wave:
    """Return the wave of a wall that ends `beyond` m behind the foot of the perpendicular."""
    leg, angle = math.hypot(beyond, distance), math.atan2(distance, beyond)

    def wave(k: float) -> complex:
        edge = diffracted_by_wedge((angle, angle), math.tau, (leg, leg), k) * hankel2(0, k * 2 * leg)
        return complex(edge / hankel2(0, k * 2 * distance) + (beyond > 0))

    return wave


def outer_corner_at(air_deg: float, at_deg: float, distance: float) -> Wave:
    """Return the wave of a rigid outer corner whose vertex is at a distance (m), seen in `at_deg` from one face."""
    air, at = math.radians(air_deg), math.radians(at_deg)
    reflected = [2 * distance * abs(math.sin(turn / 2)) for turn in visible_images(air, at)]

    def wave(k: float) -> complex:
        wall = hankel2(0, k * 2 * distance)
        edge = diffracted_by_wedge((at, at), air, (distance, distance), k)
        return complex(edge + sum(hankel2(0, k * length) / wall for length in reflected))

    return wave


def post_at(radius: float, distance: float) -> Wave:
    """Return the wave of a rigid post whose surface is at a distance, m."""

    def wave(k: float) -> complex:
        ka, kr = k * radius, k * (radius + distance)
        order = np.arange(math.ceil(ka + 6 * ka ** (1 / 3)) + 8)
        returned = jvp(order, ka) / h2vp(order, ka) * hankel2(order, kr) ** 2
        return complex((np.where(order == 0, 1.0, 2.0) * returned).sum() / hankel2(0, k * 2 * distance))

    return wave
