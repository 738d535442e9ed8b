"""How to get to the top: from a place to begin to the values that explain the scans best.

Takes a `Problem` and values near an answer; hands on better ones. The likelihood is rough: at every threshold an echo
comes or goes. So it is climbed three times, each time with readings taken to err less (`objective.COARSE`, then
`MIDDLING`, then as they do), and paths are searched anew wherever the sensor has moved.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from sonarhw_sim.predict.prediction import PredictionOptions

from sonarhw.readings import FloatArray
from sonarhw_compare.fit.likelihood.echo_likelihood import Noise
from sonarhw_compare.fit.likelihood.objective import COARSE, MIDDLING, Objective, Problem

MOST_SEARCHES = 6  # of paths, for one climb
MOST_ITERATIONS = 8
_SETTLED = 0.5  # steps within which paths need no new search
_ENOUGH = 1e-4  # of the likelihood's logarithm: less is no gain
_NARROW = 0.05  # of a number's width: finer is no gain
_WORST = -1e12  # what stands for no chance at all
_FLATTEST = 0.01  # curvature over a width, where a normal distribution has 1
_WIDEST = 30.0  # steps: where the likelihood is flat, a width is no more

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
    rows = [row for row, parameter in enumerate(problem.parameters) if parameter.quantity.moves_paths]
    for noise in stages:
        movable = np.append(
            np.ones(parameters, np.bool_) if free is None else free, [noise is None] * len(problem.noises)
        )
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
    """Values at the top of one objective, from `values` on; only those `movable` (size,) change.

    By Powell's rule, which takes no slopes: searches along lines step over what is rough.
    """
    rows = np.flatnonzero(movable)
    if not len(rows):
        return values
    lower, upper = objective.problem.bounds
    directions = directions_of(objective, values, rows)

    def at(along: FloatArray) -> FloatArray:
        return np.asarray(np.clip(values + along @ directions, lower, upper))

    def loss(scaled: FloatArray) -> float:
        return -max(objective(at(scaled)), _WORST)

    found = minimize(
        loss,
        np.zeros(len(rows)),
        method="Powell",
        options={"maxiter": iterations, "ftol": _ENOUGH, "xtol": _NARROW},
    )
    return at(np.asarray(found.x)) if found.fun < loss(np.zeros(len(rows))) else values


def widths_of(objective: Objective, top: FloatArray) -> FloatArray:
    """By how much each number may change alone until the likelihood has lost half a unit of its logarithm, (size,)."""
    best, steps = objective(top), objective.problem.steps
    widths = np.empty(len(top))
    for row in range(len(top)):
        width = 0.05
        while width < _WIDEST and _lost(objective, top, row, width * steps[row], best) < 0.5:
            width *= 1.5
        widths[row] = width * steps[row]
    return widths


def _lost(objective: Objective, top: FloatArray, row: int, by: float, best: float) -> float:
    """What the better-known side loses at `by` from the top; past a bound there is one side only."""
    above, below = top.copy(), top.copy()
    above[row] += by
    below[row] -= by
    losses = [loss for loss in (best - objective(above), best - objective(below)) if np.isfinite(loss)]
    return max(losses, default=np.inf)


def covariance_of(objective: Objective, top: FloatArray) -> FloatArray:
    """Covariance (size, size) by the curvature at the top."""
    directions = directions_of(objective, top)
    return np.asarray(directions.T @ directions)


def directions_of(objective: Objective, values: FloatArray, rows: NDArray[np.intp] | None = None) -> FloatArray:
    """Principal directions of the posterior, (k, size), each as long as its standard deviation by the curvature.

    Only the numbers in `rows` (k,) change; None: all. Slopes of neither side are taken for more than they are: the
    curvature is that over as far as half a unit of the logarithm goes.
    """
    size = len(values)
    rows = np.arange(size) if rows is None else rows
    units = np.diag(widths_of(objective, values))[rows]
    best = objective(values)

    def bent(step: FloatArray) -> float:
        ends = objective(values + step), objective(values - step)
        # past a bound there is one end only
        finite = [end for end in ends if np.isfinite(end)]
        return 2 * (sum(finite) / len(finite) - best) if finite else -1.0

    alone = [bent(unit) for unit in units]
    curvature = np.diag(alone)
    for i in range(len(rows)):
        for j in range(i):
            curvature[i, j] = curvature[j, i] = (bent(units[i] + units[j]) - alone[i] - alone[j]) / 2
    strengths, vectors = np.linalg.eigh(-curvature)
    return np.asarray((vectors / np.sqrt(np.maximum(strengths, _FLATTEST))).T @ units)
