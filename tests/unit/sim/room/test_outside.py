"""Walls that go all round a point, against polygons and rooms whose walls meet anywhere but at their ends."""

import math

import numpy as np
import pytest
from sonarhw_sim.room.enclosures import inside
from sonarhw_sim.room.model import load_room
from sonarhw_sim.room.outside import walls_enclose

from tests.fixtures.rooms_for_tests import star_room


@pytest.mark.parametrize("seed", range(5))
def test_walls_of_one_chain_go_round_what_lies_inside_it(seed: int) -> None:
    walls, random = star_room(seed, 9, convex=False).walls, np.random.default_rng(seed)
    points = random.uniform(walls.min(), walls.max(), (40, 2))
    told = [walls_enclose(walls, (float(x), float(y))) for x, y in points]
    assert told == inside(points, walls).tolist()
    assert 0 < sum(told) < 40


def test_walls_that_cross_close_a_room_and_a_gap_opens_it() -> None:
    # four walls laid like a hash sign
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
