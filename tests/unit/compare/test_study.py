"""Studies: axes and their draws, free space of simple rooms, and the figures of one scan."""

import numpy as np
import pytest
from scipy.stats import kstest, truncnorm, uniform
from sonarhw_compare.free_space import find_free_space
from sonarhw_compare.study_cases import Drawn, Listed, read_axis
from sonarhw_sim.room.room import Room

from sonarhw.errors import InputError
from tests.fixtures.rooms_for_tests import polygon_room


@pytest.mark.parametrize(
    ("written", "values"),
    [(3, (3,)), ("a", ("a",)), ((1, 2.5), (1.0, 2.5)), (("a", "b"), ("a", "b")), ((True, False), (True, False))],
)
def test_values_and_lists_are_grid_axes(written: object, values: tuple[object, ...]) -> None:
    axis = read_axis(written)
    assert isinstance(axis, Listed)
    assert axis.values == axis.extremes == values
    assert [type(value) for value in axis.values] == [type(value) for value in values]


def test_distributions_are_drawn_axes_with_their_limits() -> None:
    assert read_axis({"uniform": (1, 4)}) == Drawn("uniform", 1.0, 4.0)
    assert read_axis({"uniform": (1, 4)}).extremes == (1.0, 4.0)
    # a normal distribution ends at three standard deviations
    assert read_axis({"normal": (10, 2)}).extremes == (4.0, 16.0)


def test_drawn_values_have_the_stated_distribution() -> None:
    random = np.random.default_rng(1)
    flat = [Drawn("uniform", 1.0, 4.0).value(random) for _ in range(2000)]
    assert kstest(flat, uniform(1, 3).cdf).pvalue > 0.01
    bell = [Drawn("normal", 10.0, 2.0).value(random) for _ in range(2000)]
    assert kstest(bell, truncnorm(-3, 3, 10, 2).cdf).pvalue > 0.01
    assert max(abs(value - 10) for value in bell) <= 6


SQUARE = [(1.0, 1.0), (3.0, 1.0), (3.0, 2.0), (1.0, 2.0)]


PILLAR = '[[posts]]\nname = "p"\ncenter = [2.0, 1.5]\nradius = 0.2\nmaterial = "hard"\n'


BEYOND = '[[walls]]\nname = "beyond"\npoints = [[3.0, 2.0], [3.5, 2.5]]\nmaterial = "hard"\n'


# through the middles of cells
PARTITION = '[[walls]]\nname = "part"\npoints = [[1.51, 1.0], [1.51, 2.0]]\nmaterial = "hard"\n'


AT = "[places.p]\nposition = [{}, 1.5]\n"


def room(extra: str = "") -> Room:
    return polygon_room(SQUARE, extra=extra)


@pytest.mark.parametrize(("x", "area"), [(None, 1.49), (1.2, 0.51), (2.8, 1.49)])
def test_only_the_part_with_a_place_is_free_or_else_the_largest(x: float | None, area: float) -> None:
    space = find_free_space(room(PARTITION + ("" if x is None else AT.format(x))), 0.02)
    assert len(space.middles) * 0.02**2 == pytest.approx(area, abs=0.02)


def test_outside_the_walls_is_not_free() -> None:
    space = find_free_space(room(BEYOND + AT.format(2.0)), 0.05)
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


def test_positions_are_drawn_uniformly_with_their_clearance() -> None:
    space, random = find_free_space(room(PILLAR)), np.random.default_rng(1)
    drawn = np.array([space.draw(random, 0.1) for _ in range(400)])
    assert (drawn > (1.1, 1.1)).all()
    assert (drawn < (2.9, 1.9)).all()
    assert (np.hypot(*(drawn - (2.0, 1.5)).T) > 0.3).all()
    # symmetric about the middle
    assert drawn.mean(axis=0) == pytest.approx([2.0, 1.5], abs=0.08)
    # found at try 2108; no position is over 0.4 m from every wall
    assert space.holds(np.array(space.draw(np.random.default_rng(3), 0.399)), 0.399)
    with pytest.raises(InputError, match=r"no place is 0\.6 m from every wall"):
        space.draw(random, 0.6)
