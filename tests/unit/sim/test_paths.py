"""Paths in the plan against image sources, Fermat's principle, exact waves and closed forms."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.spatial import cKDTree
from scipy.special import h1vp, hankel1, hankel2, jv, jvp
from sonarhw_sim.air import EdgeStrength
from sonarhw_sim.board.beam import beam_gain
from sonarhw_sim.rays import fan as path_table
from sonarhw_sim.rays.fan import TransducerAxes
from sonarhw_sim.rays.paths import Paths, PathSearch, find_paths, find_paths_of_places
from sonarhw_sim.rays.posts import cylinder_factor
from sonarhw_sim.rays.small_waves import SmallWalls
from sonarhw_sim.room.room import Room, load_room, with_post
from sonarhw_sim.room.small_things import WHOLE, SoundPart

from sonarhw.errors import InputError
from tests.fixtures.rooms_for_tests import polygon_room, room_of, star_room
from tests.oracles.exact.boundary_elements import RigidScene, level_of_wall, scattered
from tests.oracles.exact.exact_levels import WAVELENGTH as WAVE
from tests.oracles.exact.exact_levels import WAVENUMBER, by_paths, decibels, level_near
from tests.oracles.fermat import reflected_paths
from tests.oracles.image_sources import specular_lengths

WAVELENGTH = 0.00696


QUARTER_DEGREE = 1440  # rays


def specular(max_length: float, max_bounces: int = 64, rays: int = QUARTER_DEGREE) -> PathSearch:
    return PathSearch(max_length, WAVELENGTH, max_bounces, diffraction=False, rays=rays)


def missing_from(found: np.ndarray, expected: np.ndarray) -> int:
    """Return how many of the sorted `expected` lengths have no separate match in `found`, to a micrometre."""
    left, missing = list(found), 0
    for length in expected:
        at = int(np.argmin(np.abs(np.array(left) - length))) if left else -1
        if at >= 0 and abs(left[at] - length) < 1e-6:
            left.pop(at)
        else:
            missing += 1
    return missing


def test_specular_paths_are_those_of_image_sources() -> None:
    wanted_in_all = missed = invented = 0
    for seed in range(12):
        room = star_room(seed, 4 + seed % 5, convex=seed % 2 == 0)
        exact = np.array(specular_lengths(room, (0.11, -0.07), 3))
        found = find_paths(room, (0.11, -0.07), specular(40.0, 3)).lengths
        wanted_in_all += len(exact)
        missed += missing_from(found, exact)
        invented += missing_from(exact, found)
    assert wanted_in_all > 100
    assert missed <= 0.01 * wanted_in_all
    assert invented == 0


def test_free_wall_end_diffracts_with_the_papers_factor() -> None:
    room = polygon_room([(0.35, 0.0), (1.0, -0.4)], closed=False)
    paths = find_paths(room, (0.0, 0.0), PathSearch(0.8, WAVELENGTH, edge_strength=EdgeStrength.PAPER))
    assert [paths.via(k, room) for k in range(len(paths))] == [("w[0]/",)]
    assert paths.lengths[0] == pytest.approx(0.7)
    assert 20 * math.log10(paths.gains[0]) == pytest.approx(-33.0, abs=0.1)


# Edges by the factor of the paper and by angle.


@pytest.mark.parametrize("strength", EdgeStrength)
def test_no_path_above_the_faintest_is_missed(strength: EdgeStrength) -> None:
    room = load_room("rooms/arena.toml")
    place = room.places["p3"].position
    everything, louder = (
        find_paths(room, place, PathSearch(6.0, WAVELENGTH, edge_strength=strength, faintest_diffraction=faintest))
        for faintest in (1e-9, 1e-2)
    )
    rows = np.flatnonzero((everything.edges >= 0) & (everything.gains >= 1e-2))
    found = np.sort(louder.lengths[louder.edges >= 0])
    assert len(rows) > 20
    assert found == pytest.approx(np.sort(everything.lengths[rows]), abs=1e-9)


def test_paths_to_a_receiver_elsewhere_are_those_of_image_sources() -> None:
    room = load_room("rooms/simple.toml")
    search = PathSearch(4.0, WAVELENGTH, 3, diffraction=False)
    there = find_paths(room, (0.3, 0.2), search, receiver=(0.7, 0.5))
    assert there.lengths[0] == pytest.approx(0.5)
    assert there.bounces[0] == 0
    expected = sorted(
        math.hypot(x, y)
        for i in range(-3, 4)
        for j in range(-3, 4)
        if abs(i) + abs(j) <= 3
        for x in [i * 0.928 + (0.7 if i % 2 == 0 else 0.228) - 0.3]
        for y in [j * 0.742 + (0.5 if j % 2 == 0 else 0.242) - 0.2]
        if math.hypot(x, y) <= 4.0
    )
    assert there.lengths == pytest.approx(expected)
    assert len(specular_lengths(room, (0.3, 0.2), 1)) == 4


# Posts.


HERE = (0.0, 0.0)


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
@pytest.mark.parametrize("seed", [2, 9])
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
    paths = found(room_of(walls, posts), len(walls))
    assert paths.keys() <= expected.keys()
    assert expected.keys() - optional <= paths.keys()
    for sequence in paths:
        assert paths[sequence] == pytest.approx(expected[sequence], abs=1e-6)


@pytest.mark.parametrize("distance", [3.0, 8.0])
def test_a_wire_is_heard_at_every_bearing(distance: float) -> None:
    # a fan of rays alone passes 38 to 68 % of these
    wall = np.array([[-30.0, -30.0, -30.0, -31.0]])
    for bearing in np.linspace(0, math.tau, 25):
        post = [distance * math.cos(bearing), distance * math.sin(bearing), 0.002]
        assert found(room_of(wall, np.array([post])), 1) == {(1,): pytest.approx(2 * (distance - 0.002))}


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
    room = room_of(np.array([[-30.0, -30.0, -30.0, -31.0]]), np.array([[1.0, 0.5, radius]]))
    paths = find_paths(room, HERE, PathSearch(21.4, WAVELENGTH))
    away = math.hypot(1.0, 0.5) - radius
    exact = cylinder_factor(np.array([math.tau / WAVELENGTH * radius]), np.zeros(1), np.ones(1))[0]
    factor = abs(exact) if radius < 0.0255 else 1.0
    assert paths.gains == pytest.approx(factor * math.sqrt(radius / (radius + away)))


def test_sound_goes_from_a_thin_post_to_an_edge_at_every_bearing() -> None:
    wall, post = np.array([[4.0, 1.0], [4.5, 2.0]]), np.array([5.0, 0.0])
    for bearing in np.radians(np.arange(10.0, 11.0, 0.1)).tolist():
        turn = np.array([[math.cos(bearing), math.sin(bearing)], [-math.sin(bearing), math.cos(bearing)]])
        room = room_of((wall @ turn).reshape(1, 4), np.array([[*(post @ turn), 0.002]]))
        paths = find_paths(room, HERE, PathSearch(21.4, WAVELENGTH, faintest_diffraction=1e-7))
        by_both = paths.select(np.flatnonzero((paths.edges >= 0) & (paths.bounces == 1)))
        # to the post and back from the edge, and the reverse, for each end of the wall
        assert len(by_both) == 4
        nearest = math.dist(wall[0], post) + math.hypot(*wall[0]) + 5.0
        assert by_both.lengths[0] == pytest.approx(nearest, abs=0.004)


# Sound past obstacles.


WALL_AHEAD = (1.0, -9.0, 1.0, 9.0)


ORIGIN = np.zeros(2)


Walls = list[tuple[float, float, float, float]]


def past(walls: Walls, posts: list[tuple[float, float, float]]) -> float:
    """Return the level of the wall 1 m ahead of the origin past other walls and posts, dB relative to the bare wall."""
    return level_near([WALL_AHEAD, *walls], posts, ORIGIN, 2.0)


def across(ahead: float, low_mm: float, high_mm: float) -> tuple[float, float, float, float]:
    return ahead, low_mm / 1000, ahead, high_mm / 1000


@pytest.mark.parametrize(
    ("walls", "posts"), [([], [(0.25, 0.0, 0.0015)]), ([across(0.25, -5, 5)], []), ([across(0.4, 6, 26)], [])]
)
def test_a_wall_past_posts_is_as_loud_as_the_wave(walls: Walls, posts: list[tuple[float, float, float]]) -> None:
    scene = RigidScene([[wall[:2], wall[2:]] for wall in walls], posts, mirror=1.0)
    assert past(walls, posts) == pytest.approx(level_of_wall(scene), abs=1.0)


def by_knife_edges(short_mm: float, ahead: float) -> float:
    """Return the level of the wall past a half plane that ends short of the line to it, or beyond, by Kirchhoff.

    The plane and its image are two screens. The integral over the heights in both, which oscillates, is turned into the
    complex plane: heights y = h ± t exp(-jπ/4) from the edge on.
    """
    between, height = 2.0 - 2 * ahead, -short_mm / 1000
    width = math.sqrt(WAVE * ahead)
    node, weight = np.polynomial.legendre.leggauss(160)
    t, share = 4 * width * (node + 1), 4 * width * weight
    y = height + t * np.exp(-0.25j * math.pi)
    first, second = y[:, None], y[None, :]
    detour = (first**2 + second**2) / (2 * ahead) + (first - second) ** 2 / (2 * between)
    total = (share[:, None] * share * np.exp(-1j * WAVENUMBER * detour - 0.5j * math.pi)).sum()
    return 20 * math.log10(abs(total) * math.sqrt(2.0 / (ahead**2 * between)) / WAVE)


@pytest.mark.parametrize("short_mm", [15, 2, -7, -25])
def test_a_wall_past_the_edge_of_a_door_is_as_loud_as_past_two_screens(short_mm: float) -> None:
    # screens have no faces: in deep shadow, a rigid door is up to 1 dB fainter
    assert past([across(0.4, -400, -short_mm)], []) == pytest.approx(by_knife_edges(short_mm, 0.4), abs=1.0)


def test_no_millimetre_decides_between_the_wall_and_silence() -> None:
    """A strip, a post and the edge of a door are moved across the line to the wall."""
    for scene in (
        lambda y: past([across(0.3, y - 15, y + 15)], []),
        lambda y: past([], [(0.3, y / 1000, 0.012)]),
        lambda y: past([across(0.3, -400, y)], []),
    ):
        levels = [scene(y) for y in range(-30, 16)]
        assert min(levels) > -30
        # beside a deep minimum, a sum of several ways changes fast, but no faster
        assert max(abs(b - a) for a, b in itertools.pairwise(levels)) < 2.5


# Limits that hold before memory is allocated.


def test_too_many_rays_and_reflections_are_refused_before_memory_is_allocated() -> None:
    room = room_of([(0, 0, 2, 0), (2, 0, 2, 2), (2, 2, 0, 2), (0, 2, 0, 0)])
    search = PathSearch(max_length=1.0, wavelength=0.007, rays=1_000_000, max_bounces=1000)
    with pytest.raises(InputError, match="1000000 rays with up to 1000 reflections each: expected at most 100000000"):
        find_paths(room, (1.0, 1.0), search)


def test_too_many_paths_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    corridor = room_of([(-50, 0, 50, 0), (-50, 1, 50, 1)])
    search = PathSearch(max_length=200.0, wavelength=0.007, max_bounces=500, diffraction=False)
    # image sources: k reflections in a corridor 1 m wide give two paths of about k m, one for each first wall
    assert len(find_paths(corridor, (0.0, 0.4), search)) == 400
    monkeypatch.setattr(path_table, "MOST_POINTS", 40 * 42)
    with pytest.raises(InputError, match=r"^too many paths: \d+ or more, .* at most 1680 points in all, .*shorter"):
        find_paths(corridor, (0.0, 0.4), search)


def test_too_many_paths_past_edges_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    corridor = room_of([(-1, 0, 1, 0), (-1, 1, 1, 1)])
    search = PathSearch(max_length=40.0, wavelength=0.007, faintest_diffraction=1e-4)
    found = find_paths(corridor, (0.0, 0.4), search)
    bent, points = int((found.edges >= 0).sum()), found.points.shape[1]
    # with n paths to an edge there are about n² past it, so these are the first to be too many
    assert bent > 5 * (found.edges < 0).sum()
    monkeypatch.setattr(path_table, "MOST_POINTS", bent * points - 1)
    with pytest.raises(InputError, match=rf"^too many paths: \d+ or more, with up to {points} points each"):
        find_paths(corridor, (0.0, 0.4), search)
    monkeypatch.setattr(path_table, "MOST_POINTS", 2 * len(found) * points)
    assert len(find_paths(corridor, (0.0, 0.4), search)) == len(found)


# The axes of two transducers.


Floats = NDArray[np.float64]


KA = 17.3


FAINTEST = 3e-4


SENDER, LISTENER = (1.72, 1.23), (1.80, 1.20)  # on the laboratory's bench


def with_body(room: Room) -> Room:
    """Return the room with a round body, like that of a ring of sensors, beside both transducers."""
    return with_post(room, (1.76, 1.16, 0.03), "body", 0.95)


def amplitudes(paths: Paths, leaving: float, arriving: float) -> Floats:
    return np.asarray(
        paths.gains * beam_gain(paths.departures - leaving, KA) * beam_gain(paths.arrivals - arriving, KA)
    )


def as_rows(paths: Paths) -> Floats:
    angles = (f(a) for a in (paths.departures, paths.arrivals) for f in (np.cos, np.sin))
    return np.column_stack((paths.lengths, paths.gains, *angles))


@pytest.mark.parametrize("strength", EdgeStrength)
@pytest.mark.parametrize(("leaving_deg", "turned_deg"), [(10.0, 0.0), (100.0, 120.0)])
def test_no_detectable_path_is_dropped(strength: EdgeStrength, leaving_deg: float, turned_deg: float) -> None:
    room = with_body(load_room("rooms/laboratory.toml"))
    leaving, arriving = math.radians(leaving_deg), math.radians(leaving_deg + turned_deg)
    search = PathSearch(9.0, 0.007, edge_strength=strength, faintest_diffraction=3e-3)
    axes = TransducerAxes(np.array([leaving]), np.array([arriving]), KA, FAINTEST)
    every = find_paths(room, SENDER, search, LISTENER)
    detected = as_rows(every.select(np.flatnonzero(amplitudes(every, leaving, arriving) >= FAINTEST)))
    found = find_paths(room, SENDER, replace(search, axes=axes), LISTENER)
    distances, _ = cKDTree(as_rows(found)).query(detected)
    assert len(detected) > 10
    assert distances.max() < 1e-6
    assert len(found) < len(every) / 2


def cluttered() -> tuple[np.ndarray, np.ndarray]:
    """Return a room with legs, a cable and two screens: walls and posts."""
    corners = np.array([(-1.0, -0.9), (1.3, -0.9), (1.3, 1.1), (-1.0, 1.1)])
    walls = np.hstack((corners, np.roll(corners, -1, axis=0)))
    screens = np.array([[0.5, 0.1, 0.52, 0.14], [-0.4, 0.5, -0.9, 0.55]])
    posts = np.array([[0.3, -0.4, 0.02], [0.45, -0.62, 0.012], [-0.5, -0.2, 0.002], [0.1, 0.6, 0.006]])
    return np.vstack((walls, screens)), posts


def levels(paths: Paths) -> np.ndarray:
    """Return the length, gain and phase of all paths over -50 dB, shortest and loudest first."""
    loud = np.flatnonzero(paths.gains > 10 ** (-50 / 20))
    turns = np.exp(1j * paths.phases[loud])
    rows = np.column_stack((np.round(paths.lengths[loud], 7), paths.gains[loud], turns.real, turns.imag))
    return rows[np.lexsort((np.round(rows[:, 1], 6), rows[:, 0]))]


def turned_room(angle: float) -> Room:
    walls, posts = cluttered()
    turn = np.array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]])
    return room_of((walls.reshape(-1, 2) @ turn).reshape(-1, 4), np.column_stack((posts[:, :2] @ turn, posts[:, 2])))


SEARCH_PAST = PathSearch(5.0, WAVE, max_bounces=3, faintest_diffraction=1e-3)


def test_paths_of_several_places_are_those_of_each() -> None:
    room = with_post(load_room("laboratory"), (1.0, 1.2, 0.004), "wire", 0.9)
    search = PathSearch(8.0, WAVE, rays=720, faintest_diffraction=0.03)
    positions = np.array([(1.72, 1.23), tuple(room.posts[0, :2]), (0.93, 0.46), (2.1, 0.9)])
    for receivers in (None, positions + 0.01):
        paths, begins = find_paths_of_places(room, positions, search, receivers)
        for k, position in enumerate(positions.tolist()):
            receiver = None if receivers is None else tuple(receivers[k].tolist())
            alone, here = find_paths(room, tuple(position), search, receiver), slice(begins[k], begins[k + 1])
            assert (len(alone) == 0) == (k == 1)
            for name in ("lengths", "gains", "phases", "departures", "arrivals", "edges"):
                assert (getattr(paths, name)[here] == getattr(alone, name)).all()


def test_a_table_that_is_often_full_changes_no_path(monkeypatch: pytest.MonkeyPatch) -> None:
    room, positions = load_room("laboratory"), np.array([(1.72, 1.23), (0.93, 0.46)])
    search = PathSearch(8.0, WAVE, rays=720, faintest_diffraction=0.03, step=4)
    paths, _ = find_paths_of_places(room, positions, search)
    monkeypatch.setattr(path_table, "_ROOM", 2)
    assert (find_paths_of_places(room, positions, search)[0].lengths == paths.lengths).all()


def test_turning_the_room_changes_no_path() -> None:
    straight = levels(find_paths(turned_room(0.0), (0.0, 0.0), SEARCH_PAST))
    turned = levels(find_paths(turned_room(math.radians(17.3)), (0.0, 0.0), SEARCH_PAST))
    assert len(straight) > 50
    assert turned == pytest.approx(straight, abs=1e-6)


def test_exchanging_both_ends_changes_no_path() -> None:
    room, here, there = turned_room(0.0), (0.0, 0.0), (0.2, 0.3)
    out = levels(find_paths(room, here, SEARCH_PAST, there))
    assert len(out) > 50
    assert levels(find_paths(room, there, SEARCH_PAST, here)) == pytest.approx(out, abs=1e-6)


Chain = list[tuple[float, float]]

TRAY: Chain = [(0.7, -0.0101234), (0.7203137, -0.0101234), (0.7203137, 0.0197651), (0.7, 0.0197651)]
DUCT: Chain = [(0.8, -0.005), (0.79, -0.005), (0.79, 0.01), (0.8, 0.01)]
STAIRS: Chain = [(0.6, -0.02), (0.6, 0.0), (0.615, 0.0), (0.615, 0.02), (0.63, 0.02)]
SLATS: list[Chain] = [[(0.6, -0.04), (0.61, -0.02)], [(0.6, -0.01), (0.61, 0.01)], [(0.6, 0.02), (0.61, 0.04)]]


def walls_of(chains: list[Chain]) -> Walls:
    return [(*begin, *end) for chain in chains for begin, end in itertools.pairwise(chain)]


def turned(chains: list[Chain], angle: float) -> list[Chain]:
    turn = complex(math.cos(angle), math.sin(angle))
    points = [[turn * complex(*point) for point in chain] for chain in chains]
    return [[(point.real, point.imag) for point in chain] for chain in points]


@pytest.mark.parametrize(("chains", "mirror"), [([TRAY], None), ([DUCT], 0.8), ([STAIRS], None), (SLATS, None)])
def test_small_concave_things_are_as_loud_as_the_wave(chains: list[Chain], mirror: float | None) -> None:
    exact = scattered(RigidScene(chains, mirror=mirror), (0.0, 0.0), WAVENUMBER)
    of_wall = scattered(RigidScene(mirror=0.5), (0.0, 0.0), WAVENUMBER)
    walls = walls_of(chains) + ([] if mirror is None else [(mirror, -9.0, mirror, 9.0)])
    assert by_paths(walls, 1.0, ORIGIN) == pytest.approx(decibels(exact / of_wall), abs=0.7)


def test_a_small_thing_beside_the_line_to_a_wall_is_as_loud_as_the_wave_in_the_wall_too() -> None:
    corners = [(0.0, -0.02), (0.02713, -0.02), (0.02713, 0.02), (0.0, 0.02)]
    turn, centre = complex(math.cos(4.7), math.sin(4.7)), complex(0.5, -0.17)
    thing = [turn * complex(*corner) + centre for corner in corners]
    chain: Chain = [(corner.real, corner.imag) for corner in thing]
    exact = scattered(RigidScene([chain], mirror=1.0), (0.0, 0.0), WAVENUMBER)
    of_wall = scattered(RigidScene(mirror=1.0), (0.0, 0.0), WAVENUMBER)
    walls = [*walls_of([chain]), WALL_AHEAD]
    assert by_paths(walls, 2.0, ORIGIN) == pytest.approx(decibels(exact / of_wall), abs=0.4)


def test_a_slot_in_a_wall_is_as_loud_as_the_wave() -> None:
    slot: Chain = [(0.0, -0.01), (0.02, -0.01), (0.02, 0.01), (0.0, 0.01)]
    place, half = (-0.4, 0.25), 0.1
    plates: list[list[Chain]] = [[[(0.0, -half), *slot, (0.0, half)]], [[(0.0, -half), (0.0, half)]]]
    with_slot, without = (scattered(RigidScene(chains), place, WAVENUMBER) for chains in plates)
    of_wall = scattered(RigidScene(mirror=place[0] + 0.5), place, WAVENUMBER)
    walls = walls_of([[(0.0, -9.0), *slot, (0.0, 9.0)]])
    of_slot = by_paths(walls, 1.0, np.array(place), longer_than=0.81)
    # of a plate of limited length, so only nearly
    assert of_slot == pytest.approx(decibels((with_slot - without) / of_wall), abs=1.5)


def test_sound_by_a_small_thing_comes_back_at_its_distance_and_is_the_same_in_reverse() -> None:
    room = room_of([*walls_of([TRAY]), (-1.0, -9.0, -1.0, 9.0)])
    search = PathSearch(4.0, WAVE, faintest_diffraction=1e-5)
    there, back = (find_paths(room, start, search, end) for start, end in (((0, 0), (0.1, 0.2)), ((0.1, 0.2), (0, 0))))
    assert there.lengths == pytest.approx(back.lengths, abs=1e-5)
    assert sorted(there.gains) == pytest.approx(sorted(back.gains), rel=1e-5)
    alone = find_paths(room_of(walls_of([TRAY])), (0.0, 0.0), search)
    assert len(alone) > 0
    assert alone.lengths == pytest.approx(2 * 0.715, abs=2 * 0.025)


@pytest.mark.parametrize(
    ("chain", "openings"), [(TRAY, ()), ([(0.01, 0.0), (0.01, -0.06), (-0.01, -0.06), (-0.01, 0.0)], ((-0.01, 0.01),))]
)
def test_small_things_return_the_same_by_each_wall(chain: Chain, openings: tuple[tuple[float, float], ...]) -> None:
    middle = np.zeros(2) if openings else np.mean(chain, axis=0)
    walls = tuple(tuple(np.subtract(wall, [*middle, *middle]).tolist()) for wall in walls_of([chain]))
    by_waves, by_walls = (SmallWalls(walls, WAVE, openings, bool(openings)) for _ in range(2))
    random = np.random.default_rng(1)
    directions = random.uniform(0.0, math.pi if openings else math.tau, 50)
    distances = by_waves.radius + 10 ** random.uniform(-3.0, 0.5, 50)
    points = distances[:, None] * np.column_stack((np.cos(directions), np.sin(directions)))
    pairs = np.column_stack(np.triu_indices(50))
    sound = by_waves.sound(points, pairs)
    assert (distances > by_waves.nearest).sum() > 25
    vars(by_walls)["nearest"] = 100.0
    exact = by_walls.sound(points, pairs)
    loud = np.abs(exact) > 1e-3
    assert loud.sum() > 1000
    assert np.abs(20 * np.log10(np.abs(sound / exact)))[loud].max() < 0.01
    assert by_waves.delays(points, pairs, sound)[loud] == pytest.approx(
        by_walls.delays(points, pairs, exact)[loud], abs=2e-4
    )


def test_parts_of_a_wide_thing_return_what_it_returns_as_a_whole() -> None:
    wide, points = (
        ((-0.05, 0.01, 0.06, 0.01), (0.06, 0.01, 0.06, 0.0)),
        np.array([[0.2, 0.3], [-0.3, 0.2], [0.01, 0.05]]),
    )
    pairs = np.array([[0, 1], [0, 2], [2, 2]])

    def returned(part: SoundPart, mirrored: bool = False) -> NDArray[np.complex128]:
        lengths = np.hypot(*(points - part.centre).T)[pairs].sum(axis=1)
        small = SmallWalls(wide, WAVE, (), on_wall=True, part=part)
        sound, mirrors = small.sound(points, pairs), small.mirrors(points, pairs)
        if mirrored:
            seen = np.isfinite(mirrors).all(axis=1)
            assert seen.sum() == 2
            sound = small.sound(points, pairs, mirrors)
            sound[seen] += small.sound(points, pairs[seen], mirrors[seen] * (1, 1, -1))
        return np.asarray(sound * hankel2(0, WAVENUMBER * lengths))

    spans = (-0.05, 0.06), (0.0, 0.01)
    parts = [SoundPart(((x, 4), (y, 2)), spans) for x in range(4) for y in range(2)]
    assert sum(returned(part) for part in parts) == pytest.approx(returned(WHOLE), rel=1e-9)
    assert sum(returned(part, mirrored=True) for part in parts) == pytest.approx(returned(WHOLE), rel=1e-9)


SKIRTING: Chain = [(-0.05, 0.2), (-0.05, 0.197), (0.05, 0.197), (0.05, 0.2)]


def test_the_sound_of_a_skirting_comes_from_its_end_and_not_from_its_middle() -> None:
    walls = [*walls_of([[(x + 0.15, y) for x, y in SKIRTING]]), (-2.0, 0.2, 2.0, 0.2)]
    paths = find_paths(room_of(walls), (0.0, 0.0), PathSearch(1.0, WAVE, faintest_diffraction=1e-3))
    by_thing = np.flatnonzero(paths.edges >= 0)
    loudest = by_thing[paths.gains[by_thing].argmax()]
    assert math.degrees(paths.departures[loudest]) == pytest.approx(math.degrees(math.atan2(0.2, 0.1)), abs=3.0)


def test_a_plate_on_a_near_wall_is_as_loud_beside_the_axis_as_a_wall() -> None:
    plate: Chain = [(0.2, -0.15), (0.1976, -0.15), (0.1976, 0.15), (0.2, 0.15)]
    walls, ka = [*walls_of([plate]), (0.2, -3.0, 0.2, 3.0)], 17.0
    paths = find_paths(room_of(walls), (0.0, 0.0), PathSearch(0.6, WAVE, faintest_diffraction=1e-5))
    waves = paths.gains * np.exp(1j * (paths.phases - WAVENUMBER * paths.lengths))
    for beside in np.radians([0.0, 4.0, 7.0, 9.0]).tolist():
        beams = beam_gain(paths.departures - beside, ka) * beam_gain(paths.arrivals - beside, ka)
        of_wall = 2 * decibels(complex(beam_gain(np.array(beside), ka)))
        assert decibels((waves * beams).sum()) == pytest.approx(of_wall, abs=0.6)


def test_places_near_small_things_and_far_from_them_have_their_own_paths_in_one_search() -> None:
    room = room_of([*walls_of([[(x + 0.15, y) for x, y in SKIRTING]]), (-2.0, 0.2, 2.0, 0.2)])
    places = np.array([(0.0, 0.0), (0.0, -0.6), (0.1, -0.1), (0.3, -0.9)])
    search = PathSearch(2.5, WAVE, faintest_diffraction=1e-4)
    paths, begins = find_paths_of_places(room, places, search)
    for place, begin, end in zip(places.tolist(), begins[:-1], begins[1:], strict=True):
        alone = find_paths(room, (place[0], place[1]), search)
        assert paths.lengths[begin:end] == pytest.approx(alone.lengths, abs=1e-9)
        assert paths.gains[begin:end] == pytest.approx(alone.gains, rel=1e-6)


def test_a_niche_beside_a_corner_is_as_loud_as_one_in_a_long_wall() -> None:
    niche: Chain = [(1.0, 0.05), (1.01, 0.05), (1.01, 0.12), (1.0, 0.12)]
    levels = []
    for end in (3.0, 0.2):
        chains = [[(1.0, -3.0), *niche, (1.0, end), (-3.0, end)]]
        paths = find_paths(room_of(walls_of(chains)), (0.0, 0.0), PathSearch(2.1, WAVE, faintest_diffraction=1e-5))
        by_niche = np.flatnonzero((paths.edges >= 0) & (paths.bounces == 0) & (paths.arrivals < 0.15))
        waves = paths.gains * np.exp(1j * (paths.phases - WAVENUMBER * paths.lengths))
        levels.append(decibels(waves[by_niche].sum()))
    assert levels[1] == pytest.approx(levels[0], abs=0.1)


def test_a_rotated_room_with_small_things_has_the_same_paths() -> None:
    chains = [
        TRAY,
        DUCT,
        [(x + 0.1, y - 0.1) for x, y in SKIRTING],
        [(0.8, -2.0), (0.8, 2.0)],
        [(-0.5, -1.0), (-0.5, 1.0)],
    ]
    search = PathSearch(3.0, WAVE, faintest_diffraction=1e-4)
    plain, other = (
        find_paths(room_of(walls_of(turned(chains, angle))), (0.0, 0.0), search) for angle in (0.0, math.radians(17.3))
    )
    loud = np.flatnonzero(plain.gains > 1e-2)
    loud_other = np.flatnonzero(other.gains > 1e-2)
    assert other.lengths[loud_other] == pytest.approx(plain.lengths[loud], abs=1e-5)
    assert sorted(other.gains[loud_other]) == pytest.approx(sorted(plain.gains[loud]), rel=1e-4)


def test_walls_that_cannot_be_solved_return_at_most_a_plate_of_their_width() -> None:
    # a slot of 6 mm between two long walls that are not on one line
    walls = [(1.0, -3.0, 1.0, 0.0), (1.0, 0.0, 1.02, 0.0), (1.02, 0.0, 1.02, 0.006), (1.02, 0.006, 0.9, 2.5)]
    paths = find_paths(room_of(walls), (0.0, 0.0), PathSearch(3.0, WAVE, faintest_diffraction=1e-5))
    by_small = [row for row in range(len(paths)) if {1, 2} & set(paths.surfaces[row].tolist())]
    assert paths.gains[by_small] == pytest.approx(np.minimum(paths.gains[by_small], 0.021 * math.sqrt(2 / WAVE)))


def test_walls_cut_into_pieces_on_one_line_have_the_same_paths() -> None:
    corners = [(-1.0, -0.8), (1.1, -0.8), (1.1, 0.3), (0.9, 0.9), (-1.0, 0.7)]
    whole = [(*begin, *end) for begin, end in zip(corners, corners[1:] + corners[:1], strict=True)]
    whole += [(0.3, -0.4, 0.55, -0.2), (-0.4, 0.1, -0.4, 0.16)]
    cuts = [np.column_stack((np.linspace(x, u, 11), np.linspace(y, v, 11))) for x, y, u, v in whole]
    pieces = [(*begin, *end) for points in cuts for begin, end in itertools.pairwise(points.tolist())]
    search = PathSearch(6.0, WAVE, faintest_diffraction=1e-4)
    uncut, cut = (find_paths(room_of(walls), (0.1, 0.05), search) for walls in (whole, pieces))
    assert np.array_equal(uncut.lengths, cut.lengths)
    assert np.array_equal(uncut.gains, cut.gains)
    assert np.array_equal(uncut.points, cut.points, equal_nan=True)
    # each reflection is on the piece that is named
    assert np.array_equal(np.where(cut.surfaces < 0, -1, cut.surfaces // 10), uncut.surfaces)
    for row in np.flatnonzero((cut.bounces == 1) & (cut.edges < 0)).tolist():
        begin, end = np.reshape(pieces[cut.surfaces[row, 0]], (2, 2))
        touch = cut.points[row, 1]
        assert math.dist(touch, begin) + math.dist(touch, end) == pytest.approx(math.dist(begin, end), abs=1e-9)
