"""Walls that crowd at one spot: every contact is found, and the work grows with their number, not with its square."""

import math

import numpy as np
import pytest
from scipy.spatial import cKDTree
from sonarhw_sim.room import edges
from sonarhw_sim.room.edges import _pairs_near
from sonarhw_sim.room.grid import lay_grid
from sonarhw_sim.room.room import _meeting, join_ends, parse_room

from sonarhw.errors import InputError
from sonarhw.readings import FloatArray

NO_POSTS = np.empty((0, 3))


def star(count: int, length: float = 5.0) -> FloatArray:
    """Walls from one point, in a large room."""
    angles = np.arange(count) * math.tau / count
    walls = np.column_stack((np.zeros((count, 2)), length * np.cos(angles), length * np.sin(angles)))
    return np.vstack((walls, [(-50, -50, 50, -50), (50, 50, -50, 50)]))


def tuft(count: int) -> FloatArray:
    """Short walls within 1 cm, in a large room."""
    random = np.random.default_rng(1)
    start = random.uniform(0, 0.01, (count, 2))
    walls = np.hstack((start, start + random.uniform(-1e-3, 1e-3, (count, 2))))
    return np.vstack((walls, [(-50, -50, 50, 50)]))


CROWDS = {"star": star, "small star": lambda count: star(count, 0.1), "tuft": tuft}


def vertices_of(walls: FloatArray) -> FloatArray:
    return np.unique(walls.reshape(-1, 2), axis=0)


def pairs(walls: FloatArray) -> list[tuple[int, int]]:
    """Return the vertices and walls that are compared."""
    vertices = vertices_of(walls)
    near = _pairs_near(np.arange(len(vertices)), np.arange(len(walls), dtype=np.int32), vertices, walls)
    return [pair for vertex, wall in near for pair in zip(vertex.tolist(), wall.tolist(), strict=True)]


@pytest.mark.parametrize("crowd", CROWDS)
def test_the_number_of_comparisons_grows_with_the_number_of_walls(crowd: str) -> None:
    for count in (1000, 8000):
        assert len(pairs(CROWDS[crowd](count))) < 60 * count


@pytest.mark.parametrize("crowd", CROWDS)
def test_every_end_on_a_wall_is_compared_with_it_once(crowd: str) -> None:
    walls = CROWDS[crowd](400)
    vertices, compared = vertices_of(walls), pairs(walls)
    assert len(set(compared)) == len(compared)
    for number, (x, y, end_x, end_y) in enumerate(walls):
        share = ((vertices - (x, y)) @ (end_x - x, end_y - y)) / ((end_x - x) ** 2 + (end_y - y) ** 2)
        foot = (x, y) + np.clip(share, 0, 1)[:, None] * (end_x - x, end_y - y)
        on = np.flatnonzero(np.hypot(*(vertices - foot).T) <= 1e-6)
        assert {(vertex, number) for vertex in on.tolist()} <= set(compared)


def overlapping(count: int) -> str:
    """Return a room of walls on the x axis, each of which overlaps all others."""
    sections = [
        f'[[walls]]\nname = "w{k}"\npoints = [[{k}, 0], [{k + count}, 0]]\nmaterial = "m"' for k in range(count)
    ]
    return "\n".join(['name = "o"', "[materials.m]", "reflectance = 0.9", *sections])


def test_too_many_overlapping_walls_are_refused_with_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(edges, "_MOST_FACES", 1000)
    assert len(parse_room(overlapping(15), "few.toml").edges) == 2
    with pytest.raises(
        InputError, match=r"^many\.toml: walls: too many overlap, .* y = 0 m: .* at most 1000 .*one wall$"
    ):
        parse_room(overlapping(40), "many.toml")


def test_the_grid_lists_at_most_a_few_numbers_for_each_wall() -> None:
    same = np.tile([(0.0, 0.0, 1.0, 1.0)], (10_000, 1))
    assert len(lay_grid(same, NO_POSTS).listing.numbers) <= max(1 << 20, 16 * len(same))
    posts = np.tile([(0.0, 0.0, 3.0)], (2_000, 1))
    assert len(lay_grid(same[:1], posts).listing.numbers) <= max(1 << 20, 16 * (len(posts) + 1))


def test_ends_that_nearly_meet_are_joined_to_the_first() -> None:
    random = np.random.default_rng(0)
    count = 5000
    shared = np.array([1.0, 2.0]) + random.uniform(-3e-7, 3e-7, (count, 2))
    apart = np.column_stack((np.arange(count) * 0.01, np.full(count, 9.0)))
    joined = join_ends(np.hstack((shared, apart)))
    assert (joined[:, :2] == shared[0]).all()
    assert (joined[:, 2:] == apart).all()


def test_ends_that_meet_are_those_that_a_tree_finds() -> None:
    random = np.random.default_rng(0)
    places = np.repeat(random.uniform(-50, 50, (200, 2)), 5, axis=0)
    # on one line, level in the direction in which the search runs
    level = np.linspace(-1, 1, 200)[:, None] * [np.sin(1), -np.cos(1)]
    points = np.vstack((places, level)) + random.normal(0, 5e-7, (1200, 2))
    pairs = _meeting(points)
    assert len(pairs) > 500
    assert {*pairs} == cKDTree(points).query_pairs(1e-6)


@pytest.mark.parametrize("gap", [1e-9, 2.4e-7, 2.6e-7, 9.9e-7])
def test_an_end_moves_to_the_earlier_one_and_a_chain_to_its_first(gap: float) -> None:
    ends = [(5.0, 5.0), (5.0 + gap, 5.0), (5.0 + 2 * gap, 5.0), (5.0, 5.0 + 2e-6)]
    joined = join_ends(np.array([(*end, k, 0.0) for k, end in enumerate(ends)]))
    assert (joined[:3, :2] == ends[0]).all()
    assert (joined[3, :2] == ends[3]).all()
