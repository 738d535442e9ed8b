"""Values that are neither free nor exact: their parameters, their prior, the average over it, and what is reported."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from scipy.stats import multivariate_normal, norm
from sonarhw_compare.fit import free_parameters
from sonarhw_compare.fit.fitting import shown_mismatches
from sonarhw_compare.fit.objective import LEVELS, PROBABILITIES, tolerance_prior
from sonarhw_compare.fit.parameters import Parameter, tolerated_parameters
from sonarhw_compare.fit.quantities import REFLECTANCE, SCALE, THRESHOLD, WALL, X
from sonarhw_compare.fit.search import averaged
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.room.room import load_room

from sonarhw.readings import FloatArray

ROOM, BOARD = load_room("rooms/arena.toml"), load_board("polaroid-6500")
WALLS = ("west", "east")
# x, two walls with a tolerance of 5 mm, and the turntable's scale with one of 1 %
PARAMETERS = (
    Parameter(X),
    *(Parameter(WALL, name, expected=0.0, deviation=0.005, is_tolerated=True) for name in WALLS),
    Parameter(SCALE, expected=1.0, deviation=0.01, is_tolerated=True),
)


def names(free: list[str], tolerance: float = 0.005) -> set[str]:
    parameters = free_parameters(free, [""], ROOM, BOARD)
    return {one.name for one in tolerated_parameters(parameters, ROOM, BOARD, tolerance, WALLS)}


def test_what_is_free_is_not_tolerated_and_a_tolerance_of_zero_is_exact() -> None:
    levels = {"scale", "threshold", "aperture", "reflectance:board"}
    assert names(["position"]) == {*levels, "wall:west", "wall:east"}
    assert names(["position", "wall:east", "aperture"]) == {*levels, "wall:west"} - {"aperture"}
    assert names(["position"], 0.0) == levels


def test_the_prior_is_a_mixture_of_normal_distributions_with_one_deviation_for_all_walls() -> None:
    prior = tolerance_prior(PARAMETERS)
    values = np.array([3.0, 0.002, -0.001, 1.004])
    walls = [np.prod([np.exp(-0.5 * (w / (0.005 * k)) ** 2) / k for w in values[1:3]]) for k in LEVELS]
    scale = [np.exp(-0.5 * (0.004 / (0.01 * k)) ** 2) / k for k in LEVELS]
    expected = float(np.log(PROBABILITIES @ walls) + np.log(PROBABILITIES @ scale))
    assert prior(values[None]) == pytest.approx([expected])


def test_the_average_over_deviations_has_the_moments_of_a_direct_calculation() -> None:
    """The likelihood is normal: two measurements of x plus or minus a wall, and one of the scale."""
    rows = np.array([[1.0, 1.0, 0.0, 0.0], [1.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
    measured, errors = np.array([0.5, 0.503, 1.0002]), np.array([2e-4, 2e-4, 1e-3])
    middle, widest = np.array([0.0, 0.0, 1.0]), np.array([0.005, 0.005, 0.01])

    def posterior(levels: FloatArray) -> tuple[FloatArray, FloatArray, float]:
        deviations = widest * levels[[0, 0, 1]]
        among = np.diag([0.01, *deviations**2])  # a wide prior of x
        of_data = rows @ among @ rows.T + np.diag(errors**2)
        gain = among @ rows.T @ np.linalg.inv(of_data)
        prior = np.array([0.0, *middle])
        evidence = multivariate_normal(rows @ prior, of_data).pdf(measured)
        return prior + gain @ (measured - rows @ prior), among - gain @ rows @ among, float(evidence)

    top, covariance, _ = posterior(np.ones(2))
    found = averaged(top, covariance, tolerance_prior(PARAMETERS))
    several = [posterior(np.array(levels)) for levels in product(LEVELS, repeat=2)]
    weights = np.array([one[2] for one in several]) * np.outer(PROBABILITIES, PROBABILITIES).ravel()
    weights /= weights.sum()
    mean = sum(weight * one[0] for weight, one in zip(weights, several, strict=True))
    assert found.weights == pytest.approx(weights, abs=1e-4)
    assert found.mean == pytest.approx(mean, rel=1e-5)
    spread = sum(w * (c + np.outer(m - mean, m - mean)) for w, (m, c, _) in zip(weights, several, strict=True))
    assert np.diag(found.covariance) == pytest.approx(np.diag(spread), rel=1e-3)


def test_a_threshold_that_depends_on_unknown_reflectances_is_as_uncertain_as_they_are() -> None:
    """The scan determines the sum of a threshold (dB) and 10 times a reflectance."""
    reflectance = Parameter(REFLECTANCE, "board", expected=0.6, deviation=0.2, is_tolerated=True)
    prior = tolerance_prior((Parameter(THRESHOLD), reflectance))
    slope, error = 10.0, 0.1
    among = np.diag([1e4, 0.2**2])  # a wide prior of the threshold
    row = np.array([1.0, slope])
    covariance = np.linalg.inv(np.linalg.inv(among) + np.outer(row, row) / error**2)
    found = averaged(np.array([-40.0 - slope * 0.6, 0.6]), covariance, prior)
    deviation = float(np.sqrt(found.covariance[0, 0]))
    assert deviation == pytest.approx(np.hypot(slope * 0.2, error), rel=1e-2)
    # a reflectance of 0.75 times the assumed one of 0.95 is no exception: more than a tenth lie beyond it
    assert norm.cdf(-0.25 * 0.95 * slope / deviation) > 0.1


def test_a_mismatch_names_what_explains_most_and_what_the_scan_cannot_distinguish_from_it() -> None:
    tolerated = PARAMETERS[1:]
    # both walls share a shift of 10 mm of which only the sum is known; the scale is right
    covariance = np.array([[25.0, -24.9, 0.0], [-24.9, 25.0, 0.0], [0.0, 0.0, 1.0]]) * 1e-6
    (shown,) = shown_mismatches(tolerated, np.array([0.005, 0.005, 0.001]), covariance)
    assert {shown.parameter.name, *shown.alternatives} == {"wall:west", "wall:east"}
    assert shown.shift == pytest.approx(0.01, rel=0.01)
    assert "10.0 ± " in str(shown)
    assert shown_mismatches(tolerated, np.array([0.001, 0.001, 0.001]), covariance * 100) == ()
    (scale,) = shown_mismatches(tolerated, np.array([0.0, 0.0, 0.009]), covariance)
    assert "scale 1.00900 ± 0.00100, while the board profile has 1.00000" in str(scale)
    assert replace(scale, shift=0.0) != scale
