"""Free space against areas and distances of simple rooms."""

import numpy as np
import pytest
from sonarhw_compare.free_space import find_free_space
from sonarhw_sim.room.room import Room

from sonarhw.errors import InputError
from tests.fixtures.rooms_for_tests import polygon_room

SQUARE = [(1.0, 1.0), (3.0, 1.0), (3.0, 2.0), (1.0, 2.0)]
PILLAR = '[[posts]]\nname = "p"\ncenter = [2.0, 1.5]\nradius = 0.2\nmaterial = "hard"\n'
BEYOND = '[[walls]]\nname = "beyond"\npoints = [[3.0, 2.0], [3.5, 2.5]]\nmaterial = "hard"\n'
# through the middles of cells
PARTITION = '[[walls]]\nname = "part"\npoints = [[1.51, 1.0], [1.51, 2.0]]\nmaterial = "hard"\n'
PLACE = "[places.p]\nposition = [{}, 1.5]\n"


def room(extra: str = "") -> Room:
    return polygon_room(SQUARE, extra=extra)


def test_a_room_without_posts_is_free_as_a_whole() -> None:
    space = find_free_space(room(), 0.1)
    assert space.free.shape == (10, 20)
    assert space.free.all()
    assert len(space.middles) == 200
    assert space.middles.min(axis=0) == pytest.approx([1.05, 1.05])
    assert space.middles.max(axis=0) == pytest.approx([2.95, 1.95])
    # 120 cells along the longer side
    assert find_free_space(room()).spacing == pytest.approx(2 / 120)


def test_free_space_moves_with_its_room() -> None:
    moved = polygon_room([(x + 4.0, y - 2.0) for x, y in SQUARE], extra=PILLAR.replace("2.0, 1.5", "6.0, -0.5"))
    there, here = find_free_space(moved, 0.1), find_free_space(room(PILLAR), 0.1)
    assert np.array_equal(there.free, here.free)
    assert there.middles - here.middles == pytest.approx(np.full(here.middles.shape, (4.0, -2.0)))


def test_the_area_of_a_post_is_not_free() -> None:
    space = find_free_space(room(PILLAR), 0.01)
    assert len(space.middles) * 0.01**2 == pytest.approx(2 - np.pi * 0.2**2, abs=0.003)
    assert (np.hypot(*(space.middles - (2.0, 1.5)).T) > 0.2).all()


@pytest.mark.parametrize(("x", "area"), [(None, 1.49), (1.2, 0.51), (2.8, 1.49)])
def test_only_the_part_with_a_place_is_free_or_else_the_largest(x: float | None, area: float) -> None:
    space = find_free_space(room(PARTITION + ("" if x is None else PLACE.format(x))), 0.02)
    assert len(space.middles) * 0.02**2 == pytest.approx(area, abs=0.02)


def test_outside_the_walls_is_not_free() -> None:
    space = find_free_space(room(BEYOND + PLACE.format(2.0)), 0.05)
    assert (space.middles <= (3.0, 2.0)).all()
    assert not space.holds(np.array([3.3, 1.5]))
    assert space.holds(np.array([2.9, 1.5]))


@pytest.mark.parametrize(
    ("point", "clear"),
    [((1.13, 1.5), 0.13), ((2.0, 1.77), 0.07), ((2.4, 1.2), 0.2), ((2.36, 1.98), 0.02), ((1.0 + 0.3, 1.0 + 0.4), 0.3)],
)
def test_a_position_is_valid_up_to_its_distance_from_walls_and_posts(point: tuple[float, float], clear: float) -> None:
    space, at = find_free_space(room(PILLAR)), np.array(point)
    assert space.holds(at, clear - 1e-6)
    assert not space.holds(at, clear + 1e-6)


def test_positions_are_drawn_uniformly_with_their_clearance(monkeypatch: pytest.MonkeyPatch) -> None:
    space, random = find_free_space(room(PILLAR)), np.random.default_rng(1)
    drawn = np.array([space.draw(random, 0.1) for _ in range(400)])
    assert (drawn > (1.1, 1.1)).all()
    assert (drawn < (2.9, 1.9)).all()
    assert (np.hypot(*(drawn - (2.0, 1.5)).T) > 0.3).all()
    # symmetric about the middle
    assert drawn.mean(axis=0) == pytest.approx([2.0, 1.5], abs=0.08)
    monkeypatch.setattr("sonarhw_compare.free_space._TRIES", 1000)  # fewer tries to draw a place
    with pytest.raises(InputError, match=r"no place is 0\.6 m from every wall"):
        space.draw(random, 0.6)
