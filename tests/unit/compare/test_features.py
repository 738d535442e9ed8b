"""Walls between the points at which arcs touch them, and which points are corners."""

import math

import pytest
from sonarhw_compare.arcs import Arc
from sonarhw_compare.map import find_features


def arc(centre: tuple[float, float], target: tuple[float, float]) -> Arc:
    """Return an arc with its middle at a target."""
    dx, dy = target[0] - centre[0], target[1] - centre[1]
    return Arc(0, (), centre, math.hypot(dx, dy), math.atan2(dy, dx), math.radians(8))


@pytest.mark.parametrize(("apart", "length"), [(0.06, 0.1), (0.1, 0.1), (0.4, 0.4)])
def test_a_wall_is_as_long_as_the_touched_part_but_at_least_10_centimetres(apart: float, length: float) -> None:
    (wall,) = find_features([arc((x, 0.0), (x, 1.0)) for x in (0.3, 0.3 + apart)]).walls
    ends = sorted((wall.start, wall.end))
    assert [y for _, y in ends] == pytest.approx([1.0, 1.0], abs=1e-6)
    assert [x for x, _ in ends] == pytest.approx([0.3 + (apart - length) / 2, 0.3 + (apart + length) / 2], abs=1e-6)


def test_places_less_than_5_centimetres_apart_are_one() -> None:
    assert find_features([arc((x, 0.0), (x, 1.0)) for x in (0.3, 0.349)]).walls == ()
    assert len(find_features([arc((x, 0.0), (x, 1.0)) for x in (0.3, 0.351)]).walls) == 1
