"""Posterior of a fit near its best solution, with all that is not exact as further parameters: median, interval, draws.

The further parameters are walls, levels and the turntable's scale (`values/tolerances.py`). They are maximised together
with the solution, and then sampled with it. `fitting` reports the marginal distributions of the free parameters.
"""

import math
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from sonarhw_sim.predict.prediction import predict_scan

from sonarhw.readings import FloatArray
from sonarhw_compare.fit.likelihood.objective import MODERATE, Problem
from sonarhw_compare.fit.search.averaging import averaged
from sonarhw_compare.fit.search.posterior import CREDIBLE_INTERVAL, samples_of
from sonarhw_compare.fit.search.refine import Peak, covariance_of, peak_at, refined, repeated
from sonarhw_compare.fit.values.fit_result import FitOptions
from sonarhw_compare.fit.values.parameters import Parameter
from sonarhw_compare.fit.values.tolerances import tolerated_parameters

MOST_WALLS = 12  # that may be off: those that most echoes touch
# coordinates that are swept together before a refinement, and the steps of each, in its own unit
_SWEEPS = (
    ("aperture", "threshold", "heading"),
    ("reflectance", "threshold"),
    ("scale", "heading"),
    ("aperture", "threshold", "heading"),
)
_STEPS = {
    "aperture": (-4e-3, -2e-3, 0.0, 2e-3, 4e-3),
    # without the right aperture and reflectances, the threshold before is wrong by up to 9 dB
    "threshold": tuple(1.5 * step for step in range(-6, 7)),
    "reflectance": (-0.3, -0.2, -0.1, 0.0, 0.05),
    "heading": tuple(math.radians(turn) for turn in (-4.0, -3.0, -2.0, -1.0, 0.0, 1.0, 2.0, 3.0, 4.0)),
    "scale": (-0.02, -0.01, -0.005, 0.0, 0.005, 0.01, 0.02),
}
_SEARCHES, _ITERATIONS = 2, 4  # of a refinement of all values
_CLIMBS = 4  # most further refinements
_NORMAL_INTERVAL = 1.96  # standard deviations, half the 95 % interval of a normal distribution


@dataclass(frozen=True)
class Marginals:
    """The posterior of the vector of `problem`: free parameters, tolerated values, noise."""

    problem: Problem
    tolerated: tuple[Parameter, ...]
    middle: FloatArray  # (size,), medians
    lower: FloatArray  # (size,), of the 95 % credible intervals
    upper: FloatArray
    covariance: FloatArray  # (size, size)
    narrow: FloatArray  # the same without the factors `Problem.widenings`
    samples: FloatArray  # (m, size)

    @property
    def shifts(self) -> tuple[FloatArray, FloatArray]:
        """Differences of the tolerated values from those of room and board, (t,), and their covariance (t, t)."""
        rows = np.flatnonzero([parameter.is_tolerated for parameter in self.problem.parameters])
        mean = self.samples.mean(axis=0) if len(self.samples) else self.middle
        return mean[rows] - [one.expected or 0.0 for one in self.tolerated], self.covariance[np.ix_(rows, rows)]


def marginals_of(problem: Problem, values: FloatArray, options: FitOptions, tick: Callable[[float], None]) -> Marginals:
    """Return the posterior near the best `values` (size,) of a problem without tolerated values."""
    tolerated = tolerated_at(problem, values, options)
    whole = problem.with_tolerated(tolerated)
    top = problem.with_values_of(tolerated, values)
    if tolerated:
        top = _maximum(whole, _swept(whole, top))
    start = averaged(top, covariance_of(whole.near(top), top), whole.tolerance_prior)
    if not options.samples:
        reach = _NORMAL_INTERVAL * whole.widenings * np.sqrt(np.diag(start.covariance))
        middle, *ends = np.clip((start.mean, start.mean - reach, start.mean + reach), *whole.bounds)
        return _marginals(whole, tolerated, middle, ends, start.covariance, np.empty((0, whole.size)))
    objective = replace(whole, averages=True).near(top)
    samples = samples_of(objective, start, options.samples, options.seed, tick)
    middle, narrow = np.median(samples, axis=0), np.cov(samples, rowvar=False)
    samples = np.clip(middle + whole.widenings * (samples - middle), *whole.bounds)
    return _marginals(whole, tolerated, middle, np.percentile(samples, CREDIBLE_INTERVAL, axis=0), narrow, samples)


def _swept(problem: Problem, values: FloatArray) -> FloatArray:
    """Return the best of several combinations of heading and tolerated values of the board, with moderate noise.

    A wrong beam width or turntable shifts the heading by several readings, and a maximisation would not find back.
    """
    objective = problem.near(values)
    best = problem.with_noise(values, MODERATE)
    for words in _SWEEPS:
        grids = [(rows, _STEPS[word]) for word in words if (rows := _rows_named(problem, word))]
        combinations = list(product(*(steps for _, steps in grids)))
        candidates = np.tile(best, (1 + len(combinations), 1))
        for (rows, _), shifts in zip(grids, zip(*combinations, strict=True), strict=True):
            candidates[1:, rows] += np.array(shifts)[:, None]
        best = candidates[objective.many(candidates).argmax()]
    return best


def _maximum(problem: Problem, values: FloatArray) -> FloatArray:
    """Return the maximum near `values` after repeated refinement, of few iterations each."""

    def refine(values: FloatArray) -> Peak:
        return peak_at(problem, refined(problem, values, None, (None,), searches=1, iterations=_ITERATIONS))

    top = refined(problem, values, None, (MODERATE, None), searches=_SEARCHES, iterations=_ITERATIONS)
    return repeated(peak_at(problem, top), refine, _CLIMBS)[-1].values


def _rows_named(problem: Problem, name: str) -> list[int]:
    return [row for row, parameter in enumerate(problem.parameters) if parameter.quantity.name == name]


def _marginals(
    whole: Problem,
    tolerated: tuple[Parameter, ...],
    middle: FloatArray,
    ends: Sequence[FloatArray],
    narrow: FloatArray,
    samples: FloatArray,
) -> Marginals:
    covariance = narrow * np.outer(whole.widenings, whole.widenings)
    return Marginals(whole, tolerated, middle, ends[0], ends[1], covariance, narrow, samples)


def tolerated_at(problem: Problem, values: FloatArray, options: FitOptions) -> tuple[Parameter, ...]:
    """Return the parameters that are neither free nor exact; of many walls, those that the echoes touch most."""
    if options.exact:
        return ()
    walls = problem.room.names[: len(problem.room.walls)]
    if len(walls) > MOST_WALLS:
        walls = _walls_touched(problem, values)
    return tolerated_parameters(problem.parameters, problem.room, problem.board, options.room_tolerance, walls)


def _walls_touched(problem: Problem, values: FloatArray) -> tuple[str, ...]:
    """Return the names of up to 12 walls that the predicted echoes touch, most touched first."""
    room, places, board = problem.setting(values)
    touched: Counter[int] = Counter()
    for scan, place in zip(problem.scans, places, strict=True):
        here = board.faced(place)
        predicted = predict_scan(room, here, board, board.heading_at(scan.angles, here.heading), problem.prediction)
        surfaces = predicted.paths.surfaces[predicted.winners[predicted.winners >= 0]]
        touched.update(surfaces[(surfaces >= 0) & (surfaces < len(room.walls))].tolist())
    return tuple(room.names[wall] for wall, _ in touched.most_common(MOST_WALLS))
