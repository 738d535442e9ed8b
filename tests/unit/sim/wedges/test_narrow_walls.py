"""Narrow walls against the exact solution of an integral equation for a thin strip."""

import math

import numpy as np
import pytest
from scipy.special import hankel2
from sonarhw_sim.rays.paths import PathSearch, find_paths

from sonarhw.readings import FloatArray
from tests.fixtures.rooms_for_tests import room_of
from tests.oracles.exact.thin_strip import ThinStrip

WAVELENGTH = 343.99 / 49_400
WAVENUMBER = math.tau / WAVELENGTH
SEARCH = PathSearch(2.5, WAVELENGTH, faintest_diffraction=1e-6)


def seen_from(distance: float, tilt_deg: float, aside: float = 0.0) -> FloatArray:
    """Return a point at a distance (m) from the middle of a strip on the x axis, moved to the side by `aside` m."""
    tilt = math.radians(tilt_deg)
    return distance * np.array([math.sin(tilt), math.cos(tilt)]) + aside * np.array([math.cos(tilt), -math.sin(tilt)])


def by_paths(width: float, source: FloatArray, receiver: FloatArray, reflectance: float = 1.0) -> float:
    """Return the level (dB) of the sum of all paths by a strip, relative to a perfect mirror."""
    room = room_of([(-width / 2, 0.0, width / 2, 0.0)], reflectances=np.array([reflectance]))
    paths = find_paths(room, tuple(source.tolist()), SEARCH, tuple(receiver.tolist()))
    touching = paths.select(np.flatnonzero((paths.bounces > 0) | (paths.edges >= 0)))
    phasors = touching.gains * np.exp(1j * (touching.phases - WAVENUMBER * touching.lengths))
    mirrored = math.hypot(*(source - receiver * (1, -1)))
    return 20 * math.log10(abs((phasors * np.sqrt(mirrored / touching.lengths)).sum()))


def exactly(width: float, source: FloatArray, receiver: FloatArray, reflectance: float = 1.0) -> float:
    """Return the same level by the integral equation."""
    mirrored = math.hypot(*(source - receiver * (1, -1)))
    scattered = ThinStrip(width / 2, WAVENUMBER, reflectance).pressure(source, receiver)
    return 20 * math.log10(abs(scattered / (0.25 * hankel2(0, WAVENUMBER * mirrored))))


@pytest.mark.parametrize("distance", [0.5, 1.0])
@pytest.mark.parametrize("width", [0.003, 0.005, 0.007, 0.01, 0.02, 0.04, 0.1])
def test_strips_down_to_half_a_wavelength_are_as_loud_as_the_exact_wave(width: float, distance: float) -> None:
    at = seen_from(distance, 0.0)
    assert by_paths(width, at, at) == pytest.approx(exactly(width, at, at), abs=0.2)


@pytest.mark.parametrize("tilt_deg", [5, 10, 20, 40, 60])
@pytest.mark.parametrize("width", [0.005, 0.01, 0.02, 0.04, 0.1])
def test_tilted_strip_has_the_pattern_of_the_exact_wave(width: float, tilt_deg: float) -> None:
    at = seen_from(1.0, tilt_deg)
    assert by_paths(width, at, at) == pytest.approx(exactly(width, at, at), abs=0.6)


def test_edge_on_a_strip_is_almost_silent() -> None:
    """The ends alone would return 20 dB more: sound passes the near end, and is returned by the far one."""
    at = seen_from(0.5, 80)
    assert exactly(0.01, at, at) < -50
    assert by_paths(0.01, at, at) == pytest.approx(exactly(0.01, at, at), abs=1.5)


@pytest.mark.parametrize("reflectance", [0.3, 0.5, 0.8])
@pytest.mark.parametrize("width", [0.005, 0.01, 0.02, 0.04, 0.1])
def test_weaker_strip_straight_ahead_agrees_with_one_of_that_impedance(width: float, reflectance: float) -> None:
    at = seen_from(1.0, 0.0)
    found, exact = by_paths(width, at, at, reflectance), exactly(width, at, at, reflectance)
    assert found == pytest.approx(exact, abs=0.5)


def test_separate_receiver_and_its_reverse_agree_with_the_exact_wave() -> None:
    for width in (0.005, 0.01, 0.03):
        one, other = seen_from(0.7, 10, -0.1), seen_from(0.9, 10, 0.15)
        there, back = by_paths(width, one, other), by_paths(width, other, one)
        assert there == pytest.approx(back, abs=1e-6)
        assert there == pytest.approx(exactly(width, one, other), abs=0.5)


def test_a_side_that_another_wall_joins_midway_is_no_way_from_end_to_end() -> None:
    """A stem below: no sound of the lower side comes to the other end, so a source there hears two single ends."""
    strip, stem = (-0.01, 0.0, 0.01, 0.0), (0.002, 0.0, 0.002, -1.0)
    joined = room_of([strip, stem]).edges
    (end,) = np.flatnonzero(joined.points[:, 0] == -0.01)
    assert joined.bare is not None
    assert sorted(joined.bare[end]) == pytest.approx([0.012, 0.02])
    below = (0.3, -0.4)
    # seen from the right, the left end is hidden; the right end is that of a wall from the stem on
    whole, half = (
        find_paths(room_of(walls), below, SEARCH) for walls in ([strip, stem], [(0.002, 0.0, 0.01, 0.0), stem])
    )
    at_end = [paths.gains[np.isclose(paths.lengths, 2 * math.dist(below, (0.01, 0.0)))] for paths in (whole, half)]
    assert at_end[0] == pytest.approx(at_end[1], rel=0.2)


@pytest.mark.parametrize("width", [0.005, 0.02])
def test_narrow_plate_of_two_walls_that_overlap_is_as_loud_as_one(width: float) -> None:
    twice = room_of([(-width / 2, 0.0, width / 2, 0.0), (width / 2, 0.0, -width / 2, 0.0)])
    once = room_of([(-width / 2, 0.0, width / 2, 0.0)])
    one, other = (np.sort(find_paths(room, (0.0, 0.5), SEARCH).gains) for room in (twice, once))
    assert one == pytest.approx(other)
