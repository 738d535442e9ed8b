"""The room of found walls: images are left out, and near walls are extended to their corner."""

import math

import numpy as np
import pytest
from sonarhw_compare.arcs import Arc
from sonarhw_compare.map import Features, Wall, reachable_walls, room_of


def wall(start: tuple[float, float], end: tuple[float, float], degrees: float, *arcs: int) -> Wall:
    return Wall(start, end, math.radians(degrees), arcs)


def arc(x: float, y: float, distance: float, degrees: float) -> Arc:
    return Arc(0, (), (x, y), distance, math.radians(degrees), math.radians(5))


UP, ASIDE = arc(0.5, 0.0, 1.0, 90.0), arc(0.5, 0.0, 1.0, 0.0)


def ends(*walls: Wall) -> list[list[float]]:
    room = room_of(Features((UP, ASIDE), walls, ()))
    assert room is not None
    return np.round(room.walls, 6).tolist()


@pytest.mark.parametrize("gap", [0.0, 0.5, 0.99])
def test_walls_less_than_a_metre_from_their_corner_are_extended_to_it(gap: float) -> None:
    """One wall along y = 1, one along x = 1.5; both end `gap` before the corner."""
    level = wall((0.2, 1.0), (1.5 - gap, 1.0), 90, 0)
    upright = wall((1.5, -0.4), (1.5, 1.0 - gap), 0, 1)
    assert ends(level, upright) == [[0.2, 1.0, 1.5, 1.0], [1.5, -0.4, 1.5, 1.0]]


def test_walls_more_than_a_metre_from_their_corner_are_not_extended() -> None:
    level, upright = wall((-0.6, 1.0), (0.49, 1.0), 90, 0), wall((1.5, -1.4), (1.5, -0.01), 0, 1)
    assert ends(level, upright) == [[-0.6, 1.0, 0.49, 1.0], [1.5, -1.4, 1.5, -0.01]]


def test_nearly_parallel_walls_do_not_meet() -> None:
    slight = math.tan(math.radians(8))
    level, oblique = wall((0.2, 1.0), (0.8, 1.0), 90, 0), wall((0.9, 1.02), (1.5, 1.02 + 0.6 * slight), 98, 1)
    assert ends(level, oblique)[0] == [0.2, 1.0, 0.8, 1.0]


def test_without_walls_there_is_no_room() -> None:
    assert room_of(Features((UP,), (), ())) is None


@pytest.mark.parametrize(
    ("y", "left", "reachable"),
    [
        (2.0, 0.3, False),  # behind the near wall
        (1.05, 0.3, True),  # so near behind it that it may be the same wall
        (2.0, 0.55, False),  # the near wall counts as 10 cm longer
        (2.0, 0.65, True),  # the straight line passes the end of the near wall
    ],
)
def test_a_wall_behind_another_is_an_image(y: float, left: float, reachable: bool) -> None:
    arcs = (UP, arc(0.5, 0.0, y, 90.0))
    near, far = wall((left, 1.0), (left + 1.0, 1.0), 90, 0), wall((0.3, y), (0.9, y), 90, 1)
    assert reachable_walls(Features(arcs, (far, near), ())) == ((near, far) if reachable else (near,))


def test_a_wall_that_most_places_see_is_reachable() -> None:
    arcs = (UP, arc(0.5, 0.0, 2.0, 90.0), arc(2.0, 0.0, 2.0, 90.0), arc(2.3, 0.0, 2.0, 90.0))
    near = wall((0.3, 1.0), (0.9, 1.0), 90, 0)
    assert len(reachable_walls(Features(arcs, (near, wall((0.5, 2.0), (2.3, 2.0), 90, 1, 2, 3)), ()))) == 2
    assert len(reachable_walls(Features(arcs, (near, wall((0.5, 2.0), (2.3, 2.0), 90, 1, 2)), ()))) == 2
    assert len(reachable_walls(Features(arcs, (near, wall((0.5, 2.0), (2.3, 2.0), 90, 1)), ()))) == 1
