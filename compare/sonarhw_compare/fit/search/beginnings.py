"""Beginnings: the poses from which a fit is worth climbing, for each scan by itself.

Takes a `Problem`; hands on, for each scan, its best poses as values of its parameters. Where the place is free the
lattice of `search` is laid over what is known of it beforehand.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from sonarhw.readings import FloatArray
from sonarhw_compare.fit.likelihood.objective import COARSE, Problem
from sonarhw_compare.fit.search.pose_search import QUICK, Scores, lattice, maxima, score_positions
from sonarhw_compare.fit.search.refine import refined
from sonarhw_compare.fit.values.parameters import Parameter
from sonarhw_compare.fit.values.quantities import HEADING, PlaceQuantity, Quantity, X, Y

_ROUGH = 16  # maxima of the lattice that are looked at
_CLIMBED = 6  # of these, that are climbed from
_SURE = 4.0  # standard deviations of what is known beforehand, beyond which nothing is sought
_SAME = 0.02  # m, and
_SAME_HEADING = math.radians(3)

Tick = Callable[[float], None]


@dataclass(frozen=True)
class Beginning:
    """A pose of one scan to climb from."""

    values: FloatArray  # (size,) of the whole problem; other scans' as they were
    score: float  # log-likelihood of this scan, its readings taken to err coarsely


def beginnings(problem: Problem, scan: int, tick: Tick) -> list[Beginning]:
    """The best poses of a scan, the best first; one where its pose is not free. `tick` gets the share done."""
    rows = [
        row
        for row, parameter in enumerate(problem.parameters)
        if isinstance(parameter.quantity, PlaceQuantity) and parameter.scan in (scan, None)
    ]
    if not rows:
        return [Beginning(problem.start(), 0.0)]
    # ranges that are all off would drag the place along
    rows += [row for row, parameter in enumerate(problem.parameters) if parameter.quantity.drags]
    alone = _alone(problem, scan, rows)
    begun = [alone.with_noise(one, COARSE) for one in _poses(alone, lambda share: tick(0.6 * share))]
    scored = sorted(((alone.near(one, QUICK)(one), k) for k, one in enumerate(begun)), reverse=True)
    found: list[Beginning] = []
    for done, (_, k) in enumerate(scored[:_CLIMBED]):
        tick(0.6 + 0.4 * done / _CLIMBED)
        top = refined(alone, begun[k], QUICK, (COARSE,), searches=2, iterations=3)
        if not any(is_same(alone, top, one.values) for one in found):
            found.append(Beginning(top, alone.near(top, QUICK)(top)))
    found.sort(key=lambda one: -one.score)
    return [replace(one, values=_in_whole(problem, rows, one.values)) for one in found]


def _alone(problem: Problem, scan: int, rows: list[int]) -> Problem:
    """The problem of one scan's pose, everything else as it is believed to be."""
    parameters = tuple(
        replace(one, scan=0) if isinstance(one.quantity, PlaceQuantity) else one
        for one in (problem.parameters[row] for row in rows)
    )
    return replace(
        problem, scans=(problem.scans[scan],), places=(problem.places[scan],), parameters=parameters, told_speed=None
    )


def _in_whole(problem: Problem, rows: list[int], values: FloatArray) -> FloatArray:
    whole = problem.start()
    whole[rows] = values[: len(rows)]
    return whole


def _poses(problem: Problem, tick: Tick) -> list[FloatArray]:
    """Values of the parameters at the maxima of the lattice."""
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
    chosen = maxima(scores, _ROUGH) or [(*place.position, place.heading)]
    begun = []
    for pose in chosen:
        values = problem.start()
        known: dict[Quantity, float] = dict(zip((X, Y, HEADING), pose, strict=True))
        for row, parameter in enumerate(problem.parameters):
            values[row] = known.get(parameter.quantity, values[row])
        begun.append(values)
    return begun


def _span(parameter: Parameter) -> tuple[float, float]:
    """Between which values a parameter is sought."""
    if parameter.expected is None or parameter.deviation is None:
        return parameter.lower, parameter.upper
    reach = _SURE * parameter.deviation
    return max(parameter.lower, parameter.expected - reach), min(parameter.upper, parameter.expected + reach)


def _within(scores: Scores, heading: Parameter | None, given: float) -> Scores:
    """The scores of headings that may be, as values of the parameter: turned by whole circles until they are."""
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
    """Whether two answers are one: all their poses within 2 cm and 3°."""
    for row, parameter in enumerate(problem.parameters):
        apart = float(one[row] - other[row])
        if parameter.quantity.is_angle and abs(math.remainder(apart, math.tau)) > _SAME_HEADING:
            return False
        if parameter.quantity in (X, Y) and abs(apart) > _SAME:
            return False
    return True
