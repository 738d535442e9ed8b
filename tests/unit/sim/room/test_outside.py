"""Enclosure of a point, against polygons and rooms whose walls do not meet at their ends."""

import math

import numpy as np
import pytest
from sonarhw_sim.room.room import inside, load_room, walls_enclose

from tests.fixtures.rooms_for_tests import star_room


@pytest.mark.parametrize("seed", range(5))
def test_walls_of_one_chain_enclose_the_points_inside(seed: int) -> None:
    walls, random = star_room(seed, 9, convex=False).walls, np.random.default_rng(seed)
    points = random.uniform(walls.min(), walls.max(), (40, 2))
    enclosed = [walls_enclose(walls, (float(x), float(y))) for x, y in points]
    assert enclosed == inside(points, walls).tolist()
    assert 0 < sum(enclosed) < 40


def test_crossing_walls_enclose_a_room_and_a_gap_opens_it() -> None:
    # four walls like a hash sign
    walls = np.array([(-2.0, s, 2.0, s) for s in (-1.0, 1.0)] + [(s, -2.0, s, 2.0) for s in (-1.0, 1.0)])
    assert walls_enclose(walls, (0.3, 0.2))
    assert not walls_enclose(walls, (1.5, 0.2))
    walls[3, 3] = 0.99
    assert not walls_enclose(walls, (0.3, 0.2))


def test_the_arena_whose_walls_meet_in_mid_wall_has_an_outside() -> None:
    arena = load_room("rooms/arena.toml")
    for place in arena.places.values():
        assert not arena.is_outside(place.position)
    assert not arena.is_outside((0.0, 1.0))
    for point in ((3.0, 3.0), (-1.0, -1.0), (0.4, 1.9), (1.9, 1.2), (math.pi, 0.1)):
        assert arena.is_outside(point)
