"""Detection of parameters whose deviations are too small because the posterior has a long, narrow ridge.

The sampler starts around the maximum and follows such a ridge too slowly to reach its end. As a test, one parameter is
fixed several deviations from the maximum, within the bounds, and the others are optimized. A normal distribution loses
half the square of that distance in log-likelihood; a long ridge loses almost nothing.
"""

import numpy as np

from sonarhw.readings import FloatArray
from sonarhw_compare.fit.likelihood.objective import Problem
from sonarhw_compare.fit.search.refine import climb
from sonarhw_compare.fit.values.parameters import Parameter

_TOGETHER = 1.9  # smallest eigenvalue of the correlations that is tested; 1 without correlation
_FAR = 6.0  # standard deviations from the maximum; nearer where a bound is nearer
_NEAREST = 3.5  # standard deviations; nothing is tested nearer, since a uniform distribution is 3.46 of them wide
_LITTLE = 0.25  # of the log-likelihood that a normal distribution loses at the same distance
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
        takes_part = np.abs(vector) > _TAKES_PART * np.abs(vector).max()
        for direction in (vector, -vector):
            change = np.where(takes_part, deviations * direction / np.abs(vector).max(), 0.0)
            far = _distance(problem, top[:count], change)
            if far >= _NEAREST:
                lost = best - _with_one_fixed(problem, top, far * change, int(np.abs(vector).argmax()))
                if lost < _LITTLE * far**2 / 2:
                    found.update(np.flatnonzero(takes_part).tolist())
    return tuple(problem.parameters[row] for row in sorted(found))


def _distance(problem: Problem, top: FloatArray, change: FloatArray) -> float:
    """Return how many times `change` (count,) can be added within the bounds, at most 6."""
    lower, upper = (bound[: len(top)] for bound in problem.bounds)
    room = np.where(change > 0, upper - top, top - lower)
    moved = change != 0
    return min(_FAR, float((room[moved] / np.abs(change[moved])).min()))


def _with_one_fixed(problem: Problem, top: FloatArray, change: FloatArray, row: int) -> float:
    """Return the maximum near `top` plus `change`, with the parameter `row` fixed there."""
    moved = top.copy()
    moved[: len(change)] += change
    moved = np.clip(moved, *problem.bounds)  # at a bound, rounding could put it outside
    movable = np.ones(len(top), np.bool_)
    movable[row] = False
    movable[len(problem.parameters) :] = False
    for _ in range(_CLIMBS):
        moved = climb(problem.near(moved), moved, movable)
    return problem.near(moved)(moved)
