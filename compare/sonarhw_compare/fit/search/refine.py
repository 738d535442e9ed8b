"""Maximization of the likelihood from a starting point, and the curvature at the maximum.

The likelihood has steps wherever an echo crosses the detection threshold. It is therefore maximized three times, with
less noise each time: `objective.COARSE`, then `MODERATE`, then the fitted noise. Paths are searched again wherever the
sensor has moved.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from sonarhw_sim.predict.prediction import PredictionOptions

from sonarhw.readings import BoolArray, FloatArray
from sonarhw_compare.fit.likelihood.echo_likelihood import ReadingNoise
from sonarhw_compare.fit.likelihood.objective import COARSE, MODERATE, Objective, Problem

_SEARCHES = 6  # of paths, in one stage
_ITERATIONS = 8
_GAIN = 1.0  # of the log-likelihood; a refinement that gains less is the last
_SETTLED = 0.5  # steps; a smaller change needs no new search of paths
_ENOUGH = 1e-4  # tolerance of the log-likelihood
_NARROW = 0.05  # tolerance of a parameter, in widths
_WORST = -1e12  # replaces -inf
_FLATTEST = 0.01  # smallest curvature over a width; a normal distribution has 1
_HIDDEN = 0.2  # of a direction; a normal distribution is lower by 0.5 at 1
_WIDEST = 30.0  # steps, largest width, for a flat likelihood


@dataclass(frozen=True)
class Peak:
    """A maximum of the likelihood."""

    score: float  # log-likelihood and prior, natural logarithm
    values: FloatArray  # (size,) of the problem
    objective: Objective  # with the paths there


def peak_at(problem: Problem, values: FloatArray, prediction: PredictionOptions | None = None) -> Peak:
    """Return the maximum at `values` (size,)."""
    objective = problem.near(values, prediction)
    return Peak(objective(values), values, objective)


def highest(problem: Problem, values: FloatArray, most: int, tick: Callable[[], None] = lambda: None) -> Peak:
    """Return the highest maximum of one complete refinement from `values` and up to `most` further ones."""

    def refine(values: FloatArray) -> Peak:
        return peak_at(problem, refined(problem, values, None, (None,), tick=tick))

    return max(repeated(refine(values), refine, most), key=lambda peak: peak.score)


def repeated(first: Peak, refine: Callable[[FloatArray], Peak], most: int) -> list[Peak]:
    """Return `first` and up to `most` maxima, each refined from the one before, until one gains little.

    With little noise, one refinement may end at a step of the likelihood.
    """
    peaks = [first]
    for _ in range(most):
        peaks.append(refine(peaks[-1].values))
        if peaks[-1].score - peaks[-2].score < _GAIN:
            break
    return peaks


def refined(
    problem: Problem,
    values: FloatArray,
    prediction: PredictionOptions | None = None,
    stages: tuple[ReadingNoise | None, ...] = (COARSE, MODERATE, None),
    free: BoolArray | None = None,
    tick: Callable[[], None] = lambda: None,
    searches: int = _SEARCHES,
    iterations: int = _ITERATIONS,
) -> FloatArray:
    """Return the values (size,) at the maximum near `values`, after one stage for each noise in `stages`.

    None as a stage also fits the noise. With `free` (parameters,), only those parameters change. `tick` is called
    before each search of paths.
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


def climb(objective: Objective, values: FloatArray, movable: BoolArray, iterations: int = _ITERATIONS) -> FloatArray:
    """Return the values at the maximum of an objective near `values`; only those `movable` (size,) change.

    Powell's method needs no derivatives, and its line searches pass over small steps of the likelihood.
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
    """Return the change of each value alone that lowers the log-likelihood by 0.5, (size,)."""
    steps = objective.problem.steps
    return _multiples(objective, top, np.diag(steps)) * steps


def _multiples(objective: Objective, top: FloatArray, units: FloatArray) -> FloatArray:
    """Return how many times each of `units` (k, size) lowers the log-likelihood by 0.5, (k,)."""
    best, widths = objective(top), np.full(len(units), 0.05)
    wider = np.ones(len(units), np.bool_)
    while wider.any():
        lost = best - _both(objective, top, widths[wider, None] * units[wider])
        # sides out of bounds are ignored
        most = np.where(np.isfinite(lost), lost, -np.inf).max(axis=0)
        wider[wider] = np.isfinite(lost).any(axis=0) & (most < 0.5)
        widths[wider] *= 1.5
        wider &= widths < _WIDEST
    return widths


def _both(objective: Objective, values: FloatArray, steps: FloatArray) -> FloatArray:
    """Return the log-likelihood at `values` (size,) plus and minus each of `steps` (k, size), (2, k)."""
    return objective.many(np.concatenate((values + steps, values - steps))).reshape(2, -1)


def covariance_of(objective: Objective, top: FloatArray) -> FloatArray:
    """Return the covariance (size, size) from the curvature at the maximum.

    It is measured twice: the second time along the principal directions, because the curvature along a ridge is lost in
    the roughness of the likelihood across it. Roughness can also hide a curvature altogether, so a direction is
    shortened if the log-likelihood is lower by 0.5 before a fifth of it.
    """
    directions = directions_of(objective, top)
    directions = _principal(objective, top, directions * _multiples(objective, top, directions)[:, None])
    widths = _multiples(objective, top, directions)
    directions *= np.where(widths < _HIDDEN, widths, 1.0)[:, None]
    return np.asarray(directions.T @ directions)


def directions_of(objective: Objective, values: FloatArray, rows: NDArray[np.intp] | None = None) -> FloatArray:
    """Return the principal directions of the posterior, (k, size), each one standard deviation long.

    Only the values in `rows` (k,) change; None: all. The curvature is measured over the distance at which the
    log-likelihood is lower by 0.5.
    """
    widths = np.diag(widths_of(objective, values))
    return _principal(objective, values, widths if rows is None else widths[rows])


def _principal(objective: Objective, values: FloatArray, units: FloatArray) -> FloatArray:
    """Return the principal directions (k, size) from the curvature over the distances `units` (k, size)."""
    first, second = np.tril_indices(len(units), -1)
    ends = _both(objective, values, np.concatenate((units, units[first] + units[second])))
    inside = np.isfinite(ends)
    # outside a bound there is one end only, or none
    counts = inside.sum(axis=0)
    means = np.where(inside, ends, 0.0).sum(axis=0) / np.maximum(counts, 1)
    bent = np.where(counts > 0, 2 * (means - objective(values)), -1.0)
    alone, together = np.split(bent, [len(units)])
    curvature = np.diag(alone)
    curvature[first, second] = curvature[second, first] = (together - alone[first] - alone[second]) / 2
    strengths, vectors = np.linalg.eigh(-curvature)
    return np.asarray((vectors / np.sqrt(np.maximum(strengths, _FLATTEST))).T @ units)
