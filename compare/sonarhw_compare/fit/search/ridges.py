"""Whether numbers that change together may change by more than their deviations say: the ensemble, begun round the top,
follows a long and narrow ridge too slowly to come to its end.

Takes a `Problem`, its top and the covariance that was found; hands on the parameters whose deviations are too small.
One number is held several deviations from the top and the others are climbed with: a normal distribution loses half
the square of that, and along a ridge that goes on nothing is lost.
"""

import numpy as np

from sonarhw.readings import FloatArray
from sonarhw_compare.fit.likelihood.objective import Problem
from sonarhw_compare.fit.search.refine import climb
from sonarhw_compare.fit.values.parameters import Parameter

_TOGETHER = 1.9  # of the correlations' principal values, from which on numbers are looked at: 1 where none go together
_FAR = 6.0  # standard deviations, where a normal distribution has lost 18
_LITTLE = 4.5  # of the logarithm, as is lost at 3
_TAKES_PART = 0.5  # of the largest share of a principal direction
_CLIMBS = 2


def unending(problem: Problem, top: FloatArray, covariance: FloatArray) -> tuple[Parameter, ...]:
    """The parameters that may change together by more than the covariance (size, size) says."""
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
        if any(best - _held(problem, top, sign * vector, deviations) < _LITTLE for sign in (1, -1)):
            found.update(np.flatnonzero(np.abs(vector) > _TAKES_PART * np.abs(vector).max()).tolist())
    return tuple(problem.parameters[row] for row in sorted(found))


def _held(problem: Problem, top: FloatArray, vector: FloatArray, deviations: FloatArray) -> float:
    """The best there is with the first number of the direction held so far away; -inf beyond its bounds."""
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
