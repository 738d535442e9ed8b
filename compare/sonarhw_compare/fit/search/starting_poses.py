"""Starting poses of a fit, for each scan separately.

Where the position is free, `pose_search` scores a lattice over the region that the prior and the bounds allow.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from sonarhw.readings import FloatArray
from sonarhw_compare.fit.likelihood.objective import COARSE, Problem
from sonarhw_compare.fit.search.pose_search import QUICK, Scores, at_marks, best_apart, lattice, score_positions
from sonarhw_compare.fit.search.refine import refined
from sonarhw_compare.fit.values.parameters import Parameter
from sonarhw_compare.fit.values.quantities import HEADING, PlaceQuantity, Quantity, X, Y

_ROUGH = 16  # poses of the lattice that are scored again
_CLIMBED = 6  # of these, that are refined
_SURE = 4.0  # standard deviations of the prior that are searched
_SAME = 0.02  # m between positions that count as the same
_SAME_HEADING = math.radians(3)

Tick = Callable[[float], None]


@dataclass(frozen=True)
class ScoredValues:
    """Values of a problem and their score."""

    values: FloatArray  # (size,) of the whole problem
    score: float  # log-likelihood and prior, natural logarithm


def starting_poses(problem: Problem, scan: int, tick: Tick) -> list[ScoredValues]:
    """Return the best poses of a scan, best first; a single one if its pose is not free.

    Their scores are those of this scan alone with coarse noise. `tick` receives the completed share, 0..1.
    """
    rows = problem.pose_rows(scan)
    if not rows:
        return [ScoredValues(problem.start(), 0.0)]
    # a wrong offset would shift the place
    rows += [row for row, parameter in enumerate(problem.parameters) if parameter.quantity.shifts_place]
    alone = _alone(problem, scan, rows)
    starts = [alone.with_noise(one, COARSE) for one in _poses(alone, lambda share: tick(0.6 * share))]
    scored = sorted(((alone.near(one, QUICK)(one), k) for k, one in enumerate(starts)), reverse=True)
    found: list[ScoredValues] = []
    for done, (_, k) in enumerate(scored[:_CLIMBED]):
        tick(0.6 + 0.4 * done / _CLIMBED)
        top = refined(alone, starts[k], QUICK, (COARSE,), searches=2, iterations=3)
        if not any(is_same(alone, top, one.values) for one in found):
            found.append(ScoredValues(top, alone.near(top, QUICK)(top)))
    found.sort(key=lambda one: -one.score)
    return [replace(one, values=_in_whole(problem, rows, one.values)) for one in found]


def _alone(problem: Problem, scan: int, rows: list[int]) -> Problem:
    """Return the problem of the pose of one scan, with all other values at their start."""
    parameters = tuple(
        replace(one, scan=0) if isinstance(one.quantity, PlaceQuantity) else one
        for one in (problem.parameters[row] for row in rows)
    )
    return replace(
        problem,
        scans=(problem.scans[scan],),
        places=(problem.places[scan],),
        parameters=parameters,
        reported_speed=None,
    )


def _in_whole(problem: Problem, rows: list[int], values: FloatArray) -> FloatArray:
    whole = problem.start()
    whole[rows] = values[: len(rows)]
    return whole


def _poses(problem: Problem, tick: Tick) -> list[FloatArray]:
    """Return values of the parameters at the best poses of the lattice."""
    place, free = problem.places[0], {parameter.quantity: parameter for parameter in problem.parameters}
    spans = [
        _span(free[quantity]) if quantity in free else (at, at)
        for quantity, at in zip((X, Y), place.position, strict=True)
    ]
    positions, spacing = lattice((spans[0][0], spans[1][0]), (spans[0][1], spans[1][1]))
    done = iter(range(len(positions)))
    scores = score_positions(
        problem.scans[0],
        problem.room,
        problem.board,
        positions,
        spacing,
        place.height,
        lambda: tick(next(done) / len(positions)),
    )
    scores = _within(scores, free.get(HEADING), place.heading)
    chosen = at_marks(problem.board, best_apart(scores, _ROUGH)) or [(*place.position, place.heading)]
    starts = []
    for pose in chosen:
        values = problem.start()
        known: dict[Quantity, float] = dict(zip((X, Y, HEADING), pose, strict=True))
        for row, parameter in enumerate(problem.parameters):
            values[row] = known.get(parameter.quantity, values[row])
        starts.append(values)
    return starts


def _span(parameter: Parameter) -> tuple[float, float]:
    """Return the lower and upper value of a parameter that are searched."""
    if parameter.expected is None or parameter.deviation is None:
        return parameter.lower, parameter.upper
    reach = _SURE * parameter.deviation
    return max(parameter.lower, parameter.expected - reach), min(parameter.upper, parameter.expected + reach)


def _within(scores: Scores, heading: Parameter | None, given: float) -> Scores:
    """Return the scores of the allowed headings, shifted by whole turns into the range of the parameter."""
    lower, upper = (given, given) if heading is None else _span(heading)
    middle = (lower + upper) / 2
    if not math.isfinite(upper - lower):
        return scores
    half = math.pi / scores.headings.size
    turned = middle + np.remainder(scores.headings - middle + math.pi, math.tau) - math.pi
    allowed = np.abs(turned - middle) <= (upper - lower) / 2 + half
    return replace(
        scores,
        headings=np.clip(turned, lower, upper),
        scores=np.where(allowed, scores.scores, -math.inf),
    )


def is_same(problem: Problem, one: FloatArray, other: FloatArray) -> bool:
    """Report whether all poses of two solutions agree within 2 cm and 3°."""
    for row, parameter in enumerate(problem.parameters):
        apart = float(one[row] - other[row])
        if parameter.quantity.is_angle and abs(math.remainder(apart, math.tau)) > _SAME_HEADING:
            return False
        if parameter.quantity in (X, Y) and abs(apart) > _SAME:
            return False
    return True
