"""Samples of distributions with known moments have their means and standard deviations."""

from threading import current_thread, main_thread
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from sonarhw_compare.fit.objective import Objective
from sonarhw_compare.fit.search import Mixture, samples_of

from sonarhw.readings import FloatArray

SIZE = 11  # five parameters and six of noise
MANY = 26  # with two values of the board, three reflectances and ten walls
DRAWS = 40_000


class Target:
    """A normal distribution with unit deviations, neighbours correlated by 0.5, truncated at its bounds."""

    def __init__(self, lowest: float = -np.inf, size: int = SIZE) -> None:
        apart = np.abs(np.subtract.outer(np.arange(size), np.arange(size)))
        self.precision = np.linalg.inv(0.5**apart)
        lower, upper = np.full(size, -1e3), np.full(size, 1e3)
        lower[0] = max(lowest, lower[0])
        self.problem = SimpleNamespace(bounds=(lower, upper), steps=np.ones(size), parameters=("",) * size)

    def __call__(self, values: FloatArray) -> float:
        lower, upper = self.problem.bounds
        inside = ((values >= lower) & (values <= upper)).all()
        return float(-0.5 * values @ self.precision @ values) if inside else -np.inf

    def many(self, values: FloatArray) -> FloatArray:
        return np.array([self(one) for one in values])

    def smooth(self, values: FloatArray) -> FloatArray:
        return self.many(values)


class Box(Target):
    """A uniform distribution between its bounds."""

    def __init__(self) -> None:
        super().__init__()
        self.problem.bounds = -np.ones(SIZE), np.ones(SIZE)

    def __call__(self, values: FloatArray) -> float:
        lower, upper = self.problem.bounds
        return 0.0 if ((values >= lower) & (values <= upper)).all() else -np.inf


START = Mixture(np.ones(1), np.zeros((1, SIZE)), np.eye(SIZE)[None])


def drawn(target: Target) -> FloatArray:
    return samples_of(cast(Objective, target), START, DRAWS, seed=1)


def test_samples_of_a_normal_distribution_have_its_deviations_and_correlations() -> None:
    samples = drawn(Target())
    assert samples.std(axis=0) == pytest.approx(np.ones(SIZE), rel=0.08)
    assert samples.std(axis=0).mean() == pytest.approx(1.0, rel=0.03)
    assert np.corrcoef(samples, rowvar=False)[0, :3] == pytest.approx([1.0, 0.5, 0.25], abs=0.06)
    assert samples.mean(axis=0) == pytest.approx(np.zeros(SIZE), abs=0.1)


def test_few_samples_of_many_values_have_the_deviations_although_the_start_is_three_times_as_narrow() -> None:
    """The curvature at one of the maxima that the steps of a likelihood make is larger than that of the whole."""
    start = Mixture(np.ones(1), np.zeros((1, MANY)), np.eye(MANY)[None] / 9)
    samples = samples_of(cast(Objective, Target(size=MANY)), start, 4_000, seed=1)
    assert samples.std(axis=0).mean() == pytest.approx(1.0, rel=0.1)


def test_the_share_of_a_chain_grows_from_0_to_1() -> None:
    shares: list[float] = []
    samples_of(cast(Objective, Target()), START, 4_000, 1, shares.append)
    assert shares[0] == 0.0
    assert shares == sorted(shares)
    # a chain that has converged ends before its last part
    assert 0.3 < shares[-1] < 1.0
    assert max(np.diff(shares)) < 0.35


def test_samples_of_a_half_normal_distribution_have_its_moments() -> None:
    samples = drawn(Target(lowest=0.0))[:, 0]
    assert samples.mean() == pytest.approx(np.sqrt(2 / np.pi), rel=0.04)
    assert samples.std() == pytest.approx(np.sqrt(1 - 2 / np.pi), rel=0.04)


def test_samples_with_the_means_of_many_values_on_bounds_have_their_moments() -> None:
    """All draws but about one in 60 are beyond a bound; the ensemble was then a few points, which emcee refuses."""
    target = Target()
    target.precision = np.eye(SIZE)
    target.problem.bounds[0][:6] = 0.0
    samples = drawn(target)
    halves = np.repeat([np.sqrt(2 / np.pi), 0.0], [6, SIZE - 6])
    assert samples.mean(axis=0) == pytest.approx(halves, abs=0.1)


def test_samples_of_a_uniform_distribution_reach_its_bounds() -> None:
    samples = drawn(Box())
    assert samples.std(axis=0) == pytest.approx(np.full(SIZE, 1 / np.sqrt(3)), rel=0.08)
    assert samples.std(axis=0).mean() == pytest.approx(1 / np.sqrt(3), rel=0.03)


class Interrupted(Target):
    """A distribution during whose computation the user presses Ctrl-C."""

    def many(self, values: FloatArray) -> FloatArray:
        if current_thread() is main_thread():  # Python raises it nowhere else
            raise KeyboardInterrupt
        return super().many(values)


def test_an_interrupt_of_a_fit_prints_nothing(capfd: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(KeyboardInterrupt):
        drawn(Interrupted())
    assert capfd.readouterr() == ("", "")
