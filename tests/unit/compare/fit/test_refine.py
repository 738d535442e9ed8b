"""Maximum, widths and covariance of normal distributions, which are known; and ridges that a covariance misses."""

from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from sonarhw_compare.fit.objective import Objective, Problem
from sonarhw_compare.fit.parameters import Parameter
from sonarhw_compare.fit.quantities import OFFSET
from sonarhw_compare.fit.search import (
    climb,
    covariance_of,
    directions_of,
    refined,
    underestimated,
    widths_of,
    without_effect,
)

from sonarhw.readings import FloatArray

COVARIANCE = np.array([[4.0, 1.2, 0.0], [1.2, 1.0, -0.1], [0.0, -0.1, 0.25]])
TOP = np.array([3.0, -2.0, 7.0])
ALL = np.ones(3, np.bool_)


def off_top(*by: float) -> FloatArray:
    return TOP + np.array(by)


class Normal:
    """A log-likelihood of three values, normal around TOP, between bounds."""

    def __init__(self, covariance: FloatArray = COVARIANCE, lower: FloatArray = TOP - 1e3) -> None:
        self.precision = np.linalg.inv(covariance)
        upper = TOP + 1e3
        parameters = [Parameter(OFFSET, name, None, *ends) for name, *ends in zip("abc", lower, upper, strict=True)]
        self.problem = SimpleNamespace(
            bounds=(lower, upper), steps=np.full(3, 0.5), parameters=parameters, near=lambda _: self
        )

    def __call__(self, values: FloatArray) -> float:
        lower, upper = self.problem.bounds
        away = values - TOP
        return (
            float(5.0 - away @ self.precision @ away / 2) if ((values >= lower) & (values <= upper)).all() else -np.inf
        )

    def many(self, values: FloatArray) -> FloatArray:
        return np.array([self(one) for one in values])

    @property
    def objective(self) -> Objective:
        return cast(Objective, self)


def test_a_width_is_the_change_of_one_value_that_loses_half() -> None:
    """It is found in steps of a half, from a twentieth of a step of the problem on."""
    exact = 1 / np.sqrt(np.diag(np.linalg.inv(COVARIANCE)))
    found = widths_of(Normal().objective, TOP)
    assert (exact <= found).all()
    assert (found < 1.5 * exact).all()


def test_widths_at_a_bound_are_those_of_the_other_side_and_a_flat_likelihood_has_the_largest() -> None:
    at_bound = Normal(lower=np.array([3.0, -1e3, -1e3]))
    assert widths_of(at_bound.objective, TOP) == pytest.approx(widths_of(Normal().objective, TOP))
    flat = Normal(np.diag([1e9, 1.0, 1.0]))
    assert 30.0 <= widths_of(flat.objective, TOP)[0] / 0.5 < 45.0


def test_the_covariance_is_that_of_the_distribution() -> None:
    assert covariance_of(Normal().objective, TOP) == pytest.approx(COVARIANCE)
    at_bound = Normal(np.diag([4.0, 1.0, 0.25]), lower=np.array([3.0, -1e3, -1e3]))
    assert covariance_of(at_bound.objective, TOP) == pytest.approx(np.diag([4.0, 1.0, 0.25]))


def test_directions_of_some_values_leave_the_others() -> None:
    some = directions_of(Normal().objective, TOP, np.array([0, 2]))
    assert some.shape == (2, 3)
    assert not some[:, 1].any()
    # with the second value fixed
    assert (some.T @ some)[np.ix_([0, 2], [0, 2])] == pytest.approx(
        np.linalg.inv(np.linalg.inv(COVARIANCE)[np.ix_([0, 2], [0, 2])])
    )


def test_a_climb_ends_at_the_maximum_within_the_bounds() -> None:
    assert climb(Normal().objective, off_top(3.0, -2.0, 1.0), ALL) == pytest.approx(TOP, abs=0.02)
    assert climb(Normal().objective, TOP, ALL).tolist() == TOP.tolist()
    # the best values of the others with the first one at its bound, 1 above its maximum
    bounded = Normal(lower=off_top(1.0, -1e3, -1e3))
    expected = off_top(1.0, *(COVARIANCE[1:, 0] / COVARIANCE[0, 0]))
    assert climb(bounded.objective, off_top(2.0, 1.0, 0.3), ALL, 30) == pytest.approx(expected, abs=0.1)


@pytest.mark.parametrize("away", [3.0, -3.0])
def test_paths_are_searched_again_until_the_sensor_moves_less_than_half_a_step(away: float) -> None:
    """The climb ends at the maximum at once, so the second search of each stage is the last."""
    target = Normal()
    moving, still = (
        SimpleNamespace(quantity=SimpleNamespace(moves_paths=moves), expected=0.0) for moves in (True, False)
    )
    target.problem.parameters, target.problem.noises = (moving, still, still), ()
    target.problem.near = lambda _values, _prediction: target
    target.problem.with_noise = lambda values, _noise: values
    ticks: list[None] = []
    found = refined(cast(Problem, target.problem), off_top(away, 0.0, 0.0), tick=lambda: ticks.append(None))
    assert found == pytest.approx(TOP, abs=0.05)
    # three stages, of which only the first moves
    assert len(ticks) == 2 + 1 + 1


def test_a_climb_changes_only_what_is_movable() -> None:
    start = off_top(2.0, 1.0, 0.5)
    found = climb(Normal().objective, start, np.array([False, True, False]))
    assert found[[0, 2]].tolist() == start[[0, 2]].tolist()
    # the mean of the second value, given the two others
    others = COVARIANCE[np.ix_([0, 2], [0, 2])]
    assert found[1] == pytest.approx(TOP[1] + COVARIANCE[1, [0, 2]] @ np.linalg.solve(others, [2.0, 0.5]), abs=0.02)
    assert climb(Normal().objective, start, ~ALL) is start


def ridge(along: float) -> Normal:
    """Return a distribution in which the first two values change together by `along` deviations, the third alone."""
    together, apart = np.array([1.0, 1.0, 0.0]) / np.sqrt(2), np.array([1.0, -1.0, 0.0]) / np.sqrt(2)
    return Normal(along**2 * np.outer(together, together) + 0.01 * np.outer(apart, apart) + np.diag([0.0, 0.0, 1.0]))


@pytest.mark.parametrize(("along", "found"), [(1.0, ()), (1.8, ()), (2.2, ("a", "b")), (20.0, ("a", "b"))])
def test_values_that_can_change_together_by_twice_as_much_as_their_covariance_allows_are_found(
    along: float, found: tuple[str, ...]
) -> None:
    """At six of the given deviations, the loss is 18 over the square of `along`; the limit is 4.5."""
    stated = np.linalg.inv(ridge(1.0).precision)
    assert [one.of for one in underestimated(cast(Problem, ridge(along).problem), TOP, stated)] == [*found]


def test_no_ridge_is_found_among_independent_values_outside_bounds_or_without_deviations() -> None:
    problem = cast(Problem, ridge(20.0).problem)
    assert underestimated(problem, TOP, np.diag([0.5, 0.5, 1.0])) == ()
    stated = np.linalg.inv(ridge(1.0).precision)
    assert underestimated(problem, TOP, stated * [[1, 1, 0], [1, 1, 0], [0, 0, 0]]) == ()
    narrow = ridge(20.0)
    # the given deviations are √0.5; a uniform distribution has √12 of its own between its bounds
    narrow.problem.bounds = TOP - 2.4, TOP + 2.4
    assert underestimated(cast(Problem, narrow.problem), TOP, stated) == ()
    narrow.problem.bounds = TOP - 2.4, TOP + 2.6
    assert [one.of for one in underestimated(cast(Problem, narrow.problem), TOP, stated)] == ["a", "b"]


def test_a_value_without_effect_is_known_and_not_changed() -> None:
    flat = Normal()
    flat.precision[2] = flat.precision[:, 2] = 0.0
    assert without_effect(flat.objective, TOP).tolist() == [False, False, True]
    found = climb(flat.objective, off_top(1.0, 1.0, 3.0), ALL)
    assert found == pytest.approx(off_top(0.0, 0.0, 3.0), abs=0.05)
    assert found[2] == TOP[2] + 3.0
    assert not without_effect(Normal().objective, TOP).any()
