"""Axes of a study: what they accept, and the distributions of drawn values."""

import math

import numpy as np
import pytest
from scipy.stats import kstest, truncnorm, uniform
from sonarhw_compare.study import Drawn, Listed, random_of, read_axis


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


@pytest.mark.parametrize(
    ("written", "message"),
    [
        ((), "expected a value, a list"),
        ((1, 1), "expected different values"),
        ((1, "a"), "expected values of one kind"),
        ((True, 2), "expected values of one kind"),
        ({"uniform": (4, 1)}, "low below high"),
        ({"uniform": (1, 1)}, "low below high"),
        ({"normal": (1, 0)}, "a deviation over 0"),
        ({"uniform": (1, 2, 3)}, "expected a value, a list"),
        ({"uniform": (1, "a")}, "got 'a' in uniform"),
        ({"uniform": (True, 2)}, "got True in uniform"),
        ({"uniform": (1, 2), "normal": (1, 2)}, "expected a value, a list"),
        ({"cauchy": (1, 2)}, r"got \{'cauchy': \[1, 2\]\}"),
    ],
)
def test_other_values_are_refused_with_the_expected_form(written: object, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        read_axis(written)


def test_drawn_values_have_the_stated_distribution() -> None:
    random = np.random.default_rng(1)
    flat = [Drawn("uniform", 1.0, 4.0).value(random) for _ in range(2000)]
    assert kstest(flat, uniform(1, 3).cdf).pvalue > 0.01
    bell = [Drawn("normal", 10.0, 2.0).value(random) for _ in range(2000)]
    assert kstest(bell, truncnorm(-3, 3, 10, 2).cdf).pvalue > 0.01
    assert max(abs(value - 10) for value in bell) <= 6


def test_a_draw_depends_on_seed_draw_and_key_only() -> None:
    first = random_of(1, 2, "x").random()
    assert random_of(1, 2, "x").random() == first
    assert len({first, *(random_of(*key).random() for key in ((2, 2, "x"), (1, 3, "x"), (1, 2, "y")))}) == 4
    assert math.isfinite(first)
