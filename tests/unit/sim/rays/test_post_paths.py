"""Paths by posts: all of them, also by thin posts, and as strong as the exact scattering of a cylinder."""

import math

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import h1vp, hankel1, jv, jvp
from sonarhw_sim.rays.paths import PathSearch, find_paths
from sonarhw_sim.rays.posts import cylinder_factor
from sonarhw_sim.room.room import Room, parse_room

from tests.fixtures.rooms_for_tests import room_of
from tests.oracles.brute.exhaustive import Scene, all_ways
from tests.oracles.fermat import reflected_paths

WAVELENGTH = 0.006962
HERE = (0.0, 0.0)


def scene(walls: np.ndarray, posts: np.ndarray) -> Room:
    text = 'name = "scene"\n[materials.m]\nreflectance = 1.0\n[places.here]\nposition = [0.0, 0.0]\n'
    for k, (a, b, c, d) in enumerate(walls.tolist()):
        text += f'[[walls]]\nname = "w{k}"\nmaterial = "m"\npoints = [[{a}, {b}], [{c}, {d}]]\n'
    for k, (x, y, radius) in enumerate(posts.tolist()):
        text += f'[[posts]]\nname = "p{k}"\nmaterial = "m"\ncenter = [{x}, {y}]\nradius = {radius}\n'
    return parse_room(text, "scene")


def found(room: Room, walls: int) -> dict[tuple[int, ...], float]:
    """Return sequence and length of each path of up to three reflections with a post among them."""
    paths = find_paths(room, HERE, PathSearch(21.4, WAVELENGTH, diffraction=False, shadows=False))
    sequences = [tuple(row[row >= 0].tolist()) for row in paths.surfaces]
    lengths = dict(zip(sequences, paths.lengths.tolist(), strict=True))
    return {sequence: length for sequence, length in lengths.items() if len(sequence) <= 3 and max(sequence) >= walls}


def ray_gain(points: np.ndarray, sequence: tuple[int, ...], walls: int, posts: np.ndarray) -> float:
    """Return the gain of a path (k, 2) between reflectors of reflectance 1: how much posts spread its tube."""
    width, opening, length = 0.0, 1.0, 0.0
    legs = np.diff(points, axis=0)
    for leg, at, surface in zip(legs, points[1:], (*sequence, -1), strict=True):
        length += math.hypot(*leg)
        width += opening * math.hypot(*leg)
        if surface >= walls:
            x, y, radius = posts[surface - walls]
            cosine = ((x, y) - at) @ leg / math.hypot(*leg) / radius
            opening += 2 / (radius * cosine) * width
    return math.sqrt(length / width)


# In these scenes, a fan alone misses paths.
@pytest.mark.parametrize("seed", [2, 4, 5, 9])
def test_every_path_by_a_post_is_found_and_no_other(seed: int) -> None:
    random = np.random.default_rng(seed)
    corners = random.uniform(-3, 3, (2, 2))
    turn = random.uniform(0, math.pi, 2)
    along = 2.0 * np.column_stack((np.cos(turn), np.sin(turn)))
    walls = np.hstack((corners - along, corners + along))
    posts = np.column_stack((random.uniform(-3, 3, (2, 2)), 10 ** random.uniform(-3, -1.3, 2)))
    here = np.array(HERE)
    expected, optional = {}, set()
    for sequence, points, doubt in reflected_paths(here, here, walls, posts, 3):
        if max(sequence) >= len(walls):
            expected[sequence] = np.hypot(*np.diff(points, axis=0).T).sum()
            if doubt or 20 * math.log10(ray_gain(points, sequence, len(walls), posts)) < -60:
                optional.add(sequence)
    paths = found(scene(walls, posts), len(walls))
    assert paths.keys() <= expected.keys()
    assert expected.keys() - optional <= paths.keys()
    for sequence in paths:
        assert paths[sequence] == pytest.approx(expected[sequence], abs=1e-6)


def random_cluster(seed: int) -> Scene:
    """Return three thin posts close to each other, 0.5 to 1 m from the sensor, and a wall behind them."""
    random = np.random.default_rng(seed)
    bearing, distance = random.uniform(0, math.tau), random.uniform(0.5, 1.0)
    middle = distance * np.array([math.cos(bearing), math.sin(bearing)])
    radii = 10 ** random.uniform(-3, -2, 3)
    around = bearing + random.uniform(0, math.tau) + math.tau / 3 * np.arange(3)
    gap = random.uniform(0.012, 0.05)
    centres = middle + gap * np.column_stack((np.cos(around), np.sin(around)))
    turned = bearing + math.pi / 2 + random.uniform(-0.3, 0.3)
    along, corner = np.array([math.cos(turned), math.sin(turned)]), 1.2 * middle
    wall = np.hstack((corner - along, corner + along))[None]
    return Scene(wall, np.column_stack((centres, radii)), random.uniform(0.5, 1, 4), np.array(HERE), WAVELENGTH)


@pytest.mark.parametrize("seed", range(6))
def test_every_chain_of_thin_posts_over_the_limit_is_found(seed: int) -> None:
    cluster = random_cluster(seed)
    room = room_of(cluster.walls, cluster.posts, cluster.reflectances)
    paths = find_paths(room, HERE, PathSearch(6.0, WAVELENGTH, diffraction=False, shadows=False))
    gains, lengths = paths.gains * np.exp(1j * paths.phases), paths.lengths
    by_posts = [way for way in all_ways(cluster, cluster.position, 3, 6.0) if way.touches > 1 and abs(way.gain) > 2e-3]
    assert len(by_posts) > 8
    for way in by_posts:
        same = np.flatnonzero((abs(lengths - way.length) < 1e-7) & (abs(gains - way.gain) < 1e-3 * abs(way.gain)))
        assert len(same), way


def test_all_edges_are_reached_by_way_of_a_post() -> None:
    """Each end of four walls, none of which blocks another, with a post beside the sensor."""
    walls = np.array([[2.0, -2.0, 2.0, -1.0], [2.0, -0.5, 2.0, 0.5], [2.0, 1.0, 2.0, 2.0], [2.0, 2.5, 2.0, 3.0]])
    room = scene(walls, np.array([[-0.5, 0.1, 0.2]]))
    paths = find_paths(room, HERE, PathSearch(12.0, WAVELENGTH, max_bounces=2, faintest_diffraction=1e-9))
    by_post = [k for k in range(len(paths)) if (paths.surfaces[k] == len(walls)).any() and paths.edges[k] >= 0]
    assert {int(paths.edges[k]) for k in by_post} == set(range(8))


@pytest.mark.parametrize("distance", [3.0, 8.0])
def test_a_wire_is_heard_at_every_bearing(distance: float) -> None:
    # a fan of rays alone passes 38 to 68 % of these
    wall = np.array([[-30.0, -30.0, -30.0, -31.0]])
    for bearing in np.linspace(0, math.tau, 25):
        post = [distance * math.cos(bearing), distance * math.sin(bearing), 0.002]
        assert found(scene(wall, np.array([post])), 1) == {(1,): pytest.approx(2 * (distance - 0.002))}


def exact_echo(radius: float, distance: float, apart: float, reflectance: float) -> complex:
    """Return the echo of a cylinder for a line source, both ends at `distance` (m), relative to a free source.

    Exact at any distance (Morse and Ingard, ch. 8): the addition theorem of the Hankel function.
    """
    k, order = math.tau / WAVELENGTH, np.arange(60)[:, None]
    # the derivative of the pressure at the surface is -jkβ of the pressure
    at_surface = 1j * (1 - reflectance) / (1 + reflectance)
    incident = jvp(order, k * radius) + at_surface * jv(order, k * radius)
    returned = h1vp(order, k * radius) + at_surface * hankel1(order, k * radius)
    terms = incident / returned * hankel1(order, k * distance) ** 2
    return complex((np.where(order == 0, 1, 2) * terms * np.cos(order * apart)).sum())


@pytest.mark.parametrize("diameter", [0.001, 0.002, 0.003, 0.004])
@pytest.mark.parametrize(("incidence", "reflectance"), [(0.0, 1.0), (0.5, 1.0), (1.0, 1.0), (0.0, 0.5), (0.5, 0.1)])
def test_a_thin_post_is_as_strong_as_the_exact_wave(diameter: float, incidence: float, reflectance: float) -> None:
    distance, radius, k = 0.8, diameter / 2, math.tau / WAVELENGTH

    def excess(half: float) -> float:
        return math.atan2(distance * math.sin(half), distance * math.cos(half) - radius) - incidence

    half = brentq(excess, 0.0, incidence) if incidence else 0.0
    leg = math.hypot(distance * math.cos(half) - radius, distance * math.sin(half))
    by_rays = math.sqrt(2 * leg / (2 * leg + 2 * leg**2 / (radius * math.cos(incidence))))
    # time runs the other way in these Hankel functions
    exact = np.conj(-exact_echo(radius, distance, 2 * half, reflectance) / hankel1(0, k * 2 * leg)) / by_rays
    ours = reflectance * cylinder_factor(np.array([k * radius]), np.array([incidence]), np.array([reflectance]))[0]
    assert 20 * math.log10(abs(ours / exact)) == pytest.approx(0.0, abs=0.15)
    assert np.angle(ours / exact) == pytest.approx(0.0, abs=0.03)


@pytest.mark.parametrize("radius", [0.001, 0.0254, 0.0256])
def test_the_gain_of_a_path_contains_the_factor_of_thin_posts_only(radius: float) -> None:
    room = scene(np.array([[-30.0, -30.0, -30.0, -31.0]]), np.array([[1.0, 0.5, radius]]))
    paths = find_paths(room, HERE, PathSearch(21.4, WAVELENGTH))
    away = math.hypot(1.0, 0.5) - radius
    exact = cylinder_factor(np.array([math.tau / WAVELENGTH * radius]), np.zeros(1), np.ones(1))[0]
    factor = abs(exact) if radius < 0.0255 else 1.0
    assert paths.gains == pytest.approx(factor * math.sqrt(radius / (radius + away)))


def test_sound_goes_from_a_thin_post_to_an_edge_at_every_bearing() -> None:
    wall, post = np.array([[4.0, 1.0], [4.5, 2.0]]), np.array([5.0, 0.0])
    for bearing in np.radians(np.arange(10.0, 11.0, 0.1)).tolist():
        turn = np.array([[math.cos(bearing), math.sin(bearing)], [-math.sin(bearing), math.cos(bearing)]])
        room = scene((wall @ turn).reshape(1, 4), np.array([[*(post @ turn), 0.002]]))
        paths = find_paths(room, HERE, PathSearch(21.4, WAVELENGTH, faintest_diffraction=1e-7))
        by_both = paths.select(np.flatnonzero((paths.edges >= 0) & (paths.bounces == 1)))
        # to the post and back from the edge, and the reverse, for each end of the wall
        assert len(by_both) == 4
        nearest = math.dist(wall[0], post) + math.hypot(*wall[0]) + 5.0
        assert by_both.lengths[0] == pytest.approx(nearest, abs=0.004)


def test_a_path_by_a_post_and_walls_is_found_in_both_directions() -> None:
    """Pillar, west and north wall of the laboratory, seen from its bench."""
    walls = np.array([[-1.72, 1.57, -1.72, -1.23], [0.98, 1.57, -1.72, 1.57]])
    posts, here = np.array([[-0.62, 0.82, 0.15]]), np.array(HERE)
    expected = {sequence: points for sequence, points, _ in reflected_paths(here, here, walls, posts, 4)}
    paths = find_paths(scene(walls, posts), HERE, PathSearch(21.4, WAVELENGTH, diffraction=False))
    lengths = {tuple(row[row >= 0].tolist()): length for row, length in zip(paths.surfaces, paths.lengths, strict=True)}
    for sequence in ((2, 0, 2, 1), (1, 2, 0, 2)):
        assert lengths[sequence] == pytest.approx(np.hypot(*np.diff(expected[sequence], axis=0).T).sum(), abs=1e-9)
