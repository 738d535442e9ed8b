"""How to get to the top: from a place to begin to the values that explain the scans best.

Takes a `Problem` and values near an answer; hands on better ones. The likelihood is rough: at every threshold an echo
comes or goes. So it is climbed three times, each time with readings taken to err less (`objective.COARSE`, then
`MIDDLING`, then as they do), and paths are searched anew wherever the sensor has moved.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import Bounds, minimize

from compare.fit.likelihood import Noise
from compare.fit.objective import COARSE, MIDDLING, NOISES, Objective, Problem
from compare.fit.parameters import Kind
from sim.prediction import PredictionOptions
from sonarhw.readings import FloatArray

MOST_SEARCHES = 6  # of paths, for one climb
MOST_ITERATIONS = 60
_SETTLED = 0.5  # steps within which paths need no new search
_ENOUGH = 1e-5  # of the likelihood's logarithm: less is no gain
_DIFFERENCE = 0.2  # of a step, by which slopes are taken
MOVES_PATHS = (Kind.X, Kind.Y, Kind.WALL)

BoolArray = NDArray[np.bool_]


def refined(
    problem: Problem,
    values: FloatArray,
    prediction: PredictionOptions | None = None,
    stages: tuple[Noise | None, ...] = (COARSE, MIDDLING, None),
    free: BoolArray | None = None,
    tick: Callable[[], None] = lambda: None,
    searches: int = MOST_SEARCHES,
    iterations: int = MOST_ITERATIONS,
) -> FloatArray:
    """Values (size,) at the top near `values`, climbed to once for each of `stages`; None: noise is found, too.

    Where `free` (parameters,) is given, only those parameters change. `tick` is called now and then.
    """
    parameters = len(problem.parameters)
    rows = [row for row, parameter in enumerate(problem.parameters) if parameter.kind in MOVES_PATHS]
    for noise in stages:
        movable = np.append(np.ones(parameters, np.bool_) if free is None else free, [noise is None] * len(NOISES))
        values = values if noise is None else problem.with_noise(values, noise)
        for _ in range(searches):
            tick()
            before, values = values, climb(problem.near(values, prediction), values, movable, iterations)
            if not (np.abs(values - before)[rows] > _SETTLED * problem.steps[rows]).any():
                break
    return values


def climb(
    objective: Objective, values: FloatArray, movable: BoolArray, iterations: int = MOST_ITERATIONS
) -> FloatArray:
    """Values at the top of one objective, from `values` on; only those `movable` (size,) change."""
    problem = objective.problem
    rows = np.flatnonzero(movable)
    if not len(rows):
        return values
    steps, (lower, upper) = problem.steps[rows], (bound[rows] for bound in problem.bounds)

    def loss(scaled: FloatArray) -> float:
        moved = values.copy()
        moved[rows] = np.clip(values[rows] + scaled * steps, lower, upper)
        found = -objective(moved)
        return found if np.isfinite(found) else 1e12

    found = minimize(
        loss,
        np.zeros(len(rows)),
        method="L-BFGS-B",
        bounds=Bounds((lower - values[rows]) / steps, (upper - values[rows]) / steps),
        options={"eps": _DIFFERENCE, "maxiter": iterations, "ftol": _ENOUGH},
    )
    best = values.copy()
    best[rows] = np.clip(values[rows] + found.x * steps, lower, upper)
    return best if -found.fun >= objective(values) else values
