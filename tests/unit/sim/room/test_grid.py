"""The grid loses no surface: results equal those of a test of all surfaces."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sonarhw_sim.rays.fan import distance_to, first_hit
from sonarhw_sim.rays.sequences import leg_is_free
from sonarhw_sim.room.grid import lay_grid, list_points

from tests.fixtures.rooms_for_tests import room_of

# also round numbers: walls and rays along the lines between cells
coordinates = st.one_of(st.floats(-5, 5), st.integers(-5, 5).map(float))
points = st.tuples(coordinates, coordinates)
walls = st.tuples(points, points).filter(lambda ends: math.dist(*ends) > 1e-3).map(lambda ends: (*ends[0], *ends[1]))
posts = st.tuples(coordinates, coordinates, st.floats(0.01, 1.0))
directions = st.one_of(st.floats(0, math.tau), st.integers(0, 7).map(lambda k: k * math.pi / 4))
clutter = st.tuples(st.lists(walls, min_size=1, max_size=30), st.lists(posts, max_size=5))


@settings(max_examples=100, deadline=None)
@given(clutter, points, directions)
def test_first_hit_is_the_nearest_of_all_surfaces(
    things: tuple[list[tuple[float, ...]], list[tuple[float, ...]]], start: tuple[float, float], direction: float
) -> None:
    surfaces = lay_grid(np.array(things[0]), np.array(things[1]).reshape(-1, 3))
    ray = (*start, math.cos(direction), math.sin(direction))
    count = len(things[0]) + len(things[1])
    nearest = min(distance_to(*ray, k, surfaces.walls, surfaces.posts) for k in range(count))
    distance, surface = first_hit(*ray, -1, surfaces)
    assert distance == nearest
    assert (surface == -1) == math.isinf(nearest)


@settings(max_examples=70, deadline=None)
@given(clutter, points, points)
def test_leg_is_free_if_no_single_surface_blocks_it(
    things: tuple[list[tuple[float, ...]], list[tuple[float, ...]]],
    start: tuple[float, float],
    end: tuple[float, float],
) -> None:
    all_walls, all_posts = np.array(things[0]), np.array(things[1]).reshape(-1, 3)
    leg = np.array(start), np.array(end)
    none = np.empty((0, 3))
    alone = [leg_is_free(*leg, lay_grid(all_walls[k : k + 1], none)) for k in range(len(all_walls))]
    alone += [leg_is_free(*leg, lay_grid(np.empty((0, 4)), all_posts[k : k + 1])) for k in range(len(all_posts))]
    assert leg_is_free(*leg, lay_grid(all_walls, all_posts)) == all(alone)


def test_a_leg_exactly_through_the_corner_of_two_walls_is_not_free() -> None:
    leg = np.array([0.0, 0.0]), np.array([2.0, 2.0])
    walls = np.array([[1.0, 1.0, 0.0, 2.0], [1.0, 1.0, 2.0, 0.0]])
    for one, other in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
        turned = np.array([np.roll(wall, 1 - turn) for wall, turn in zip(walls, (one, other), strict=True)])
        assert not leg_is_free(*leg, lay_grid(turned, np.empty((0, 3))))


def test_points_are_listed_in_all_cells_within_reach() -> None:
    random = np.random.default_rng(0)
    room = room_of(random.uniform(-4, 4, (60, 4)))
    cells, some = room.surfaces.cells, random.uniform(-4, 4, (50, 2))
    listing = list_points(cells, some, 0.3)
    for x, y in random.uniform(-4, 4, (500, 2)):
        cell = int((y - cells.bottom) / cells.side) * cells.columns + int((x - cells.left) / cells.side)
        here = listing.numbers[listing.starts[cell] : listing.starts[cell + 1]]
        assert set(np.flatnonzero(np.hypot(*(some - (x, y)).T) <= 0.3)) <= set(here.tolist())


def test_there_are_about_as_many_cells_as_walls_in_any_shape() -> None:
    random = np.random.default_rng(0)
    for stretch in (1.0, 1e3, 1e-3):
        ends = random.uniform(0, 1, (1000, 4)) * (stretch, 1, stretch, 1)
        cells = lay_grid(ends, np.empty((0, 3))).cells
        assert 200 < cells.columns * cells.rows < 5000


@pytest.mark.parametrize("place", [(-3.0, 1.0), (1.0, 9.0), (40.0, 40.0)])
def test_rays_from_outside_enter_the_grid(place: tuple[float, float]) -> None:
    surfaces = room_of([(0, 0, 2, 0), (2, 0, 2, 2), (2, 2, 0, 2), (0, 2, 0, 0)]).surfaces
    towards = math.atan2(1.0 - place[1], 1.0 - place[0])
    distance, surface = first_hit(*place, math.cos(towards), math.sin(towards), -1, surfaces)
    assert surface >= 0
    assert math.dist(place, (1.0, 1.0)) - distance <= math.sqrt(2) + 1e-9
