"""Detection of parameters whose deviations are too small because the posterior has a long, narrow ridge.

The sampler starts around the maximum and follows such a ridge too slowly to reach its end. As a test, one parameter is
fixed several deviations from the maximum, and the others are optimized. A normal distribution loses half the square of
that distance in log-likelihood; a long ridge loses almost nothing.
"""

import numpy as np

from sonarhw.readings import FloatArray
from sonarhw_compare.fit.likelihood.objective import Problem
from sonarhw_compare.fit.search.refine import climb
from sonarhw_compare.fit.values.parameters import Parameter

_TOGETHER = 1.9  # smallest eigenvalue of the correlations that is tested; 1 without correlation
_FAR = 6.0  # standard deviations; a normal distribution loses 18 there
_LITTLE = 4.5  # of the logarithm; a normal distribution loses this at 3 standard deviations
_TAKES_PART = 0.5  # of the largest component of an eigenvector
_CLIMBS = 2


def underestimated(problem: Problem, top: FloatArray, covariance: FloatArray) -> tuple[Parameter, ...]:
    """Return the parameters that can change together by more than the covariance allows.

    Its first rows and columns are those of the parameters.
    """
    count = len(problem.parameters)
    deviations = np.sqrt(np.diag(covariance)[:count])
    if not (deviations > 0).all():
        return ()
    values, vectors = np.linalg.eigh(covariance[:count, :count] / np.outer(deviations, deviations))
    best = problem.near(top)(top)
    found: set[int] = set()
    for value, vector in zip(values, vectors.T, strict=True):
        if value < _TOGETHER:
            continue
        if any(best - _with_one_fixed(problem, top, sign * vector, deviations) < _LITTLE for sign in (1, -1)):
            found.update(np.flatnonzero(np.abs(vector) > _TAKES_PART * np.abs(vector).max()).tolist())
    return tuple(problem.parameters[row] for row in sorted(found))


def _with_one_fixed(problem: Problem, top: FloatArray, vector: FloatArray, deviations: FloatArray) -> float:
    """Return the maximum with the main parameter of `vector` fixed 6 deviations away; -inf outside its bounds."""
    row = int(np.abs(vector).argmax())
    moved = top.copy()
    moved[: len(vector)] += _FAR * deviations * vector / abs(vector[row])
    lower, upper = problem.bounds
    if not lower[row] <= moved[row] <= upper[row]:
        return -np.inf
    moved = np.clip(moved, lower, upper)
    movable = np.ones(len(top), np.bool_)
    movable[row] = False
    movable[len(problem.parameters) :] = False
    for _ in range(_CLIMBS):
        moved = climb(problem.near(moved), moved, movable)
    return problem.near(moved)(moved)
