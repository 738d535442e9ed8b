"""Edges and narrow walls by the uniform theory: Fresnel integrals, exact solutions, and its own symmetries."""

import math

import numpy as np
import pytest
from scipy.special import fresnel, hankel2, modfresnelm
from sonarhw_sim.air import EdgeStrength
from sonarhw_sim.rays.diffraction import by_wedge, most_by_wedge, transition
from sonarhw_sim.rays.paths import Paths, PathSearch, find_paths

from sonarhw.readings import FloatArray
from tests.fixtures.rooms_for_tests import room_of
from tests.oracles.exact.exact_traces import peak_by_paths, peak_by_wave, post_at, strip_at, wall_end_at
from tests.oracles.exact.exact_wedge import diffracted_by_wedge
from tests.oracles.exact.thin_strip import ThinStrip

WAVELENGTH = 343.99 / 49_400


DISTANCE = 1.0  # m, of walls


HARD = np.ones(2)


SEARCH = PathSearch(2.5, WAVELENGTH, faintest_diffraction=1e-6)


def paths_to(walls: list[tuple[float, float, float, float]], reflectance: float = 1.0) -> Paths:
    room = room_of(walls, reflectances=np.full(len(walls), reflectance))
    return find_paths(room, (0.0, 0.0), SEARCH)


def summed_db(paths: Paths) -> float:
    """Return the level of the sum of all paths, relative to an endless wall."""
    phasors = paths.gains * np.exp(1j * (paths.phases - math.tau / WAVELENGTH * paths.lengths))
    return 20 * math.log10(abs(phasors.sum()))


def wall_from(low: float, high: float) -> list[tuple[float, float, float, float]]:
    return [(DISTANCE, low, DISTANCE, high)]


def by_fresnel(low: float, high: float) -> float:
    """Return the level (dB) by the Fresnel integral of a wall from `low` to `high` m of the foot."""
    scale = 2 / math.sqrt(WAVELENGTH * DISTANCE)
    (sine, cosine), (sine_low, cosine_low) = fresnel(high * scale), fresnel(low * scale)
    return 20 * math.log10(abs(complex(cosine - cosine_low, sine_low - sine)) / math.sqrt(2))


def wedge(
    one: float, other: float, n: float, faces: FloatArray = HARD, legs: tuple[float, float] = (0.4, 0.7)
) -> complex:
    columns = (np.array([value]) for value in (one, other, n, faces, *legs))
    return complex(by_wedge(*columns, WAVELENGTH)[0])


def test_transition_function_is_that_of_scipy() -> None:
    x = np.concatenate((np.linspace(0, 70, 7001), np.geomspace(1e-12, 1e6, 500)))
    exact = 2j * np.sqrt(x) * np.exp(1j * x) * modfresnelm(np.sqrt(x))[0]
    assert np.abs(transition(x) - exact).max() < 1e-7


@pytest.mark.parametrize("air", [210, 240, 270, 300, 330])
def test_outer_corners_are_those_of_the_exact_integral(air: int) -> None:
    # the scene of the wave benchmark, in which the grid blurs the sharpest corners
    opening, wavelength, leg = math.radians(air), 0.024, 0.29
    for one, other in ((0.5, 0.5), (0.45, 0.48), (0.35, 0.6)):
        angles = one * opening, other * opening
        exact = diffracted_by_wedge(angles, opening, (leg, leg), math.tau / wavelength)
        columns = (np.array([value]) for value in (*angles, opening / math.pi, HARD, leg, leg))
        assert abs(by_wedge(*columns, wavelength)[0]) == pytest.approx(abs(exact), rel=0.01, abs=1e-4)


@pytest.mark.parametrize(("beyond", "level"), [(-0.1, -20.6), (-0.03, -11.9), (0.003, -5.4), (0.051, 1.4)])
def test_wall_that_ends_near_the_foot_of_the_perpendicular_fades(beyond: float, level: float) -> None:
    assert by_fresnel(-1e3, beyond) == pytest.approx(level, abs=0.1)
    assert summed_db(paths_to(wall_from(-9.0, beyond))) == pytest.approx(level, abs=1.0)


@pytest.mark.parametrize("beyond", np.linspace(-0.08, 0.08, 7))
def test_every_wall_end_agrees_with_the_fresnel_integral(beyond: float) -> None:
    found, level = summed_db(paths_to(wall_from(-9.0, float(beyond)))), by_fresnel(-1e3, float(beyond))
    assert found == pytest.approx(level, abs=0.8)
    assert found <= level + 0.5


@pytest.mark.parametrize(("width", "level"), [(0.02, -9.4), (0.04, -3.4), (0.101, 2.6), (0.2, 1.4)])
def test_strip_is_as_loud_as_its_width_allows(width: float, level: float) -> None:
    assert by_fresnel(-width / 2, width / 2) == pytest.approx(level, abs=0.1)
    assert summed_db(paths_to(wall_from(-width / 2, width / 2))) == pytest.approx(level, abs=0.2)


@pytest.mark.parametrize(("degrees", "level"), [(135.0, -32.4), (110.0, -27.6)])
def test_corner_of_a_box_is_as_loud_as_in_the_wave_equation(degrees: float, level: float) -> None:
    angle = math.radians(degrees)
    assert 20 * math.log10(abs(wedge(angle, angle, 1.5, legs=(0.35, 0.35)))) == pytest.approx(level, abs=0.3)


@pytest.mark.parametrize("n", [0.4, 0.7, 1.2, 1.5, 2.0])
@pytest.mark.parametrize("faces", [(1.0, 1.0), (0.9, 0.3), (0.0, 0.5)])
def test_amplitude_is_reciprocal_and_mirrored(n: float, faces: tuple[float, float]) -> None:
    there, back = np.array(faces), np.array(faces[::-1])
    for one, other in np.random.default_rng(0).uniform(0.05, n * math.pi - 0.05, (50, 2)):
        amplitude = wedge(one, other, n, there)
        assert wedge(other, one, n, there, (0.7, 0.4)) == pytest.approx(amplitude)
        assert wedge(n * math.pi - one, n * math.pi - other, n, back) == pytest.approx(amplitude)


@pytest.mark.parametrize("n", [0.4, 0.7, 1.0 - 1e-6, 1.2, 1.5, 2.0])
def test_bound_is_never_too_low(n: float) -> None:
    for one, other in np.random.default_rng(1).uniform(0.0, n * math.pi, (300, 2)):
        assert abs(wedge(one, other, n)) <= most_by_wedge(one, other, n, 0.4, 0.7, WAVELENGTH) + 1e-9


@pytest.mark.parametrize("n", [0.5, 1 / 3, 0.25, 1.0])
def test_wedge_whose_angle_divides_180_degrees_does_not_diffract(n: float) -> None:
    for one, other in np.random.default_rng(2).uniform(0.02, n * math.pi - 0.02, (50, 2)):
        assert abs(wedge(one, other, n)) < 1e-9


def test_edge_of_two_absorbers_is_silent_and_no_edge_is_louder_than_its_louder_face() -> None:
    for one, other in np.random.default_rng(3).uniform(0.0, math.tau, (100, 2)):
        assert wedge(one, other, 2.0, np.zeros(2)) == 0
        assert abs(wedge(one, other, 2.0, np.array([0.001, 0.01]))) <= 0.01 + 1e-12
    assert len(paths_to(wall_from(-9.0, -0.01), reflectance=0.0)) == 0


@pytest.mark.parametrize("faces", [(0.9, 0.3), (0.3, 0.9), (0.0, 0.5)])
def test_half_of_the_reflection_by_each_face_remains_where_it_ends(faces: tuple[float, float]) -> None:
    """With long legs, because the other three terms fade with the root of their length."""
    for face, normal in ((faces[0], math.pi / 2), (faces[1], math.pi)):
        amplitude = wedge(normal - 0.3, normal + 0.3, 1.5, np.array(faces), (1e6, 1e6))
        assert abs(amplitude) == pytest.approx(face / 2, abs=1e-3)


def test_level_is_smooth_where_a_reflection_ends() -> None:
    for reflectance in (1.0, 0.5):
        beyond = np.arange(-0.002, 0.002, 1e-4)
        levels = [summed_db(paths_to(wall_from(-9.0, float(end)), reflectance)) for end in beyond]
        assert np.abs(np.diff(levels)).max() < 0.1
        end_at_foot = summed_db(paths_to(wall_from(-9.0, 0.0), reflectance))
        assert end_at_foot == pytest.approx(20 * math.log10(reflectance / 2), abs=0.5)


def test_level_is_smooth_where_a_shadow_begins() -> None:
    levels = []
    for end in np.arange(-0.002, 0.002, 1e-4) + 3e-5:
        room = room_of([(0.5, -9.0, 0.5, float(end))])
        paths = find_paths(room, (0.0, 0.0), PathSearch(1.2, WAVELENGTH, faintest_diffraction=1e-6), (1.0, 0.0))
        levels.append(summed_db(paths))
    assert np.abs(np.diff(levels)).max() < 0.2
    assert levels[20] == pytest.approx(20 * math.log10(0.5), abs=0.3)


def test_inner_corner_is_smooth_through_90_degrees() -> None:
    levels = []
    for opening in np.radians(np.arange(89.6, 90.4, 0.05)):
        walls = [(0.0, 0.0, 3.0, 0.0), (0.0, 0.0, 3.0 * math.cos(opening), 3.0 * math.sin(opening))]
        at = 0.7 * math.cos(opening * 0.4), 0.7 * math.sin(opening * 0.4)
        paths = find_paths(room_of(walls), at, SEARCH)
        through = np.abs(paths.lengths - 1.4) < 0.005
        levels.append(summed_db(paths.select(np.flatnonzero(through))))
    assert np.abs(np.diff(levels)).max() < 0.3
    assert levels[8] == pytest.approx(0.0, abs=0.1)


def test_walls_that_cross_at_120_degrees_have_edges_at_their_crossing() -> None:
    angle = math.radians(60)
    crossing = [
        (-1.0, 0.5, 1.0, 0.5),
        (-math.cos(angle), 0.5 - math.sin(angle), math.cos(angle), 0.5 + math.sin(angle)),
    ]
    ends = [(0.0, 0.5, 1.0, 0.5), (0.0, 0.5, -math.cos(angle), 0.5 - math.sin(angle))]
    for walls in (crossing, ends):
        room = room_of(walls)
        search = PathSearch(1.5, WAVELENGTH, faintest_diffraction=1e-6, edge_strength=EdgeStrength.PAPER)
        paths = find_paths(room, (0.2, 0.1), search)
        at_crossing = [paths.edges[k] for k in range(len(paths)) if paths.edges[k] >= 0 and paths.bounces[k] == 0]
        points = [room.edges.points[edge].tolist() for edge in at_crossing]
        assert points.count([0.0, 0.5]) == 1


# Narrow walls against the exact solution of an integral equation for a thin strip.


WAVENUMBER = math.tau / WAVELENGTH


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
@pytest.mark.parametrize("width", [0.003, 0.007, 0.02, 0.1])
def test_strips_down_to_half_a_wavelength_are_as_loud_as_the_exact_wave(width: float, distance: float) -> None:
    at = seen_from(distance, 0.0)
    assert by_paths(width, at, at) == pytest.approx(exactly(width, at, at), abs=0.2)


@pytest.mark.parametrize("tilt_deg", [5, 20, 60])
@pytest.mark.parametrize("width", [0.005, 0.02, 0.1])
def test_tilted_strip_has_the_pattern_of_the_exact_wave(width: float, tilt_deg: float) -> None:
    at = seen_from(1.0, tilt_deg)
    assert by_paths(width, at, at) == pytest.approx(exactly(width, at, at), abs=0.6)


@pytest.mark.parametrize("reflectance", [0.3, 0.8])
@pytest.mark.parametrize("width", [0.005, 0.02, 0.1])
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
    assert sorted(joined.bare[end]) == pytest.approx([0.012, 0.02])
    below = (0.3, -0.4)
    # seen from the right, the left end is hidden; the right end is that of a wall from the stem on
    whole, half = (find_paths(room_of(of), below, SEARCH) for of in ([strip, stem], [(0.002, 0.0, 0.01, 0.0), stem]))
    at_end = [paths.gains[np.isclose(paths.lengths, 2 * math.dist(below, (0.01, 0.0)))] for paths in (whole, half)]
    assert at_end[0] == pytest.approx(at_end[1], rel=0.2)


@pytest.mark.parametrize("width", [0.005, 0.02])
def test_narrow_plate_of_two_walls_that_overlap_is_as_loud_as_one(width: float) -> None:
    twice = room_of([(-width / 2, 0.0, width / 2, 0.0), (width / 2, 0.0, -width / 2, 0.0)])
    once = room_of([(-width / 2, 0.0, width / 2, 0.0)])
    one, other = (np.sort(find_paths(room, (0.0, 0.5), SEARCH).gains) for room in (twice, once))
    assert one == pytest.approx(other)


# Peaks of traces are those of exact waves at every frequency of the burst.


HERE = np.array([0.0, 1.0])


STRIP = [(-0.005, 0.0, 0.005, 0.0)]


@pytest.mark.parametrize("beyond", [-0.03, 0.003])
def test_the_peak_of_a_wall_end_is_that_of_the_wave(beyond: float) -> None:
    peak = peak_by_paths([(-9.0, 0.0, beyond, 0.0)], 1.0, HERE)
    assert peak == pytest.approx(peak_by_wave(1.0, wall_end_at(beyond, 1.0)), abs=0.3)


def test_the_peak_of_a_strip_is_that_of_the_wave_and_not_with_the_strength_of_the_paper() -> None:
    wave = peak_by_wave(1.0, strip_at(0.01, 1.0))
    assert peak_by_paths(STRIP, 1.0, HERE) == pytest.approx(wave, abs=0.3)
    assert peak_by_paths(STRIP, 1.0, HERE, strength=EdgeStrength.PAPER) > wave + 6.0


def test_the_peak_of_a_wire_is_that_of_the_wave() -> None:
    peak = peak_by_paths([], 1.0, np.zeros(2), [(1.001, 0.0, 0.001)])
    assert peak == pytest.approx(peak_by_wave(1.0, post_at(0.001, 1.0)), abs=0.3)
