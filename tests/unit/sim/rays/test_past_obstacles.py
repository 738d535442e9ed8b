"""What is heard of a wall past posts and edges, against boundary elements, and how it changes with the pose."""

import itertools
import math

import numpy as np
import pytest
from sonarhw_sim.rays.paths import Paths, PathSearch, find_paths
from sonarhw_sim.rays.shadows import two_edges
from sonarhw_sim.room.room import Room

from tests.fixtures.rooms_for_tests import room_of
from tests.oracles.exact.boundary_elements import RigidScene, level_of_wall
from tests.oracles.exact.exact_levels import WAVELENGTH, WAVENUMBER, level_near

WALL = (1.0, -9.0, 1.0, 9.0)
HERE = np.zeros(2)
Walls = list[tuple[float, float, float, float]]


def past(walls: Walls, posts: list[tuple[float, float, float]]) -> float:
    """Return the level of the wall 1 m ahead of the origin past other walls and posts, dB relative to the bare wall."""
    return level_near([WALL, *walls], posts, HERE, 2.0)


def across(ahead: float, low_mm: float, high_mm: float) -> tuple[float, float, float, float]:
    return ahead, low_mm / 1000, ahead, high_mm / 1000


@pytest.mark.parametrize(
    ("walls", "posts"),
    [
        ([], [(0.25, 0.0, 0.0015)]),
        ([], [(0.25, 0.02, 0.005)]),
        ([across(0.25, -5, 5)], []),
        ([across(0.4, -10, 10)], []),
        ([across(0.4, 6, 26)], []),
    ],
)
def test_a_wall_past_posts_and_strips_is_as_loud_as_the_wave(
    walls: Walls, posts: list[tuple[float, float, float]]
) -> None:
    scene = RigidScene([[wall[:2], wall[2:]] for wall in walls], posts, mirror=1.0)
    assert past(walls, posts) == pytest.approx(level_of_wall(scene), abs=1.0)


def by_knife_edges(short_mm: float, ahead: float) -> float:
    """Return the level of the wall past a half plane that ends short of the line to it, or beyond, by Kirchhoff.

    The plane and its image are two screens. The integral over the heights in both, which oscillates, is turned into the
    complex plane: heights y = h ± t exp(-jπ/4) from the edge on.
    """
    between, height = 2.0 - 2 * ahead, -short_mm / 1000
    width = math.sqrt(WAVELENGTH * ahead)
    node, weight = np.polynomial.legendre.leggauss(160)
    t, share = 4 * width * (node + 1), 4 * width * weight
    y = height + t * np.exp(-0.25j * math.pi)
    first, second = y[:, None], y[None, :]
    detour = (first**2 + second**2) / (2 * ahead) + (first - second) ** 2 / (2 * between)
    total = (share[:, None] * share * np.exp(-1j * WAVENUMBER * detour - 0.5j * math.pi)).sum()
    return 20 * math.log10(abs(total) * math.sqrt(2.0 / (ahead**2 * between)) / WAVELENGTH)


@pytest.mark.parametrize("short_mm", [15, 7, 2, -2, -7, -15, -25])
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
        levels = [scene(y) for y in range(-45, 31)]
        assert min(levels) > -30
        # beside a deep minimum, a sum of several ways changes fast, but no faster
        assert max(abs(b - a) for a, b in itertools.pairwise(levels)) < 2.5


def test_the_transition_function_of_two_edges_has_its_limits() -> None:
    at, ratio = np.zeros(1), np.array([0.25 / 1.75])
    # source, edge and image of the edge in line, at 0.25, 1.5 and 0.25 m: -11.3 dB by the double knife edge
    assert 20 * math.log10(abs(two_edges(at, at, ratio)[0]) / 4) == pytest.approx(-11.28, abs=0.01)
    one, other = np.array([0.7]), np.array([2.3])
    alone = two_edges(one, at, at)[0] * two_edges(at, other, at)[0]
    assert two_edges(one, other, at)[0] == pytest.approx(alone, rel=1e-6)


def furnished() -> tuple[np.ndarray, np.ndarray]:
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
    walls, posts = furnished()
    turn = np.array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]])
    return room_of((walls.reshape(-1, 2) @ turn).reshape(-1, 4), np.column_stack((posts[:, :2] @ turn, posts[:, 2])))


SEARCH = PathSearch(5.0, WAVELENGTH, max_bounces=3, faintest_diffraction=1e-3)


def test_turning_the_room_changes_no_path() -> None:
    straight = levels(find_paths(turned_room(0.0), (0.0, 0.0), SEARCH))
    turned = levels(find_paths(turned_room(math.radians(17.3)), (0.0, 0.0), SEARCH))
    assert len(straight) > 50
    assert turned == pytest.approx(straight, abs=1e-6)


def test_exchanging_both_ends_changes_no_path() -> None:
    room, here, there = turned_room(0.0), (0.0, 0.0), (0.2, 0.3)
    out = levels(find_paths(room, here, SEARCH, there))
    assert len(out) > 50
    assert levels(find_paths(room, there, SEARCH, here)) == pytest.approx(out, abs=1e-6)
