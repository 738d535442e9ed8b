"""How well the pose of a scan is known before its readings are used, as a prior of its location."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from sonarhw_sim.room.room import Place

from sonarhw.errors import InputError
from sonarhw.readings import FloatArray
from sonarhw_compare.fit.search.pose_search import HEADINGS, Scores
from sonarhw_compare.fit.values.parameters import Parameter
from sonarhw_compare.fit.values.quantities import HEADING, Quantity, X, Y

_FINEST, _FINEST_TURN = 0.001, math.radians(0.1)  # m, rad: of what is exact; a search needs some width


@dataclass(frozen=True)
class PoseSpread:
    """Standard deviations of a pose; 0 is exact, infinite is unknown."""

    xy: float = 0.0  # m, of x and of y
    heading: float = 0.0  # rad
    around: Place | None = None  # where the pose is expected; None: where a search begins

    @property
    def is_whole(self) -> bool:
        """Whether position and heading are known."""
        return math.isfinite(self.xy) and math.isfinite(self.heading)

    @property
    def with_width(self) -> "PoseSpread":
        """The spread, at least 1 mm and 0.1°."""
        return replace(self, xy=max(self.xy, _FINEST), heading=max(self.heading, _FINEST_TURN))


UNKNOWN = PoseSpread(math.inf, math.inf)
NOWHERE = Place("", (0.0, 0.0))


def known_heading(heading: float | None, deviation: float) -> tuple[Place, PoseSpread]:
    """Return place and spread of a pose of which only the heading is known (rad), or nothing (None).

    Raises InputError if the heading is not finite, or the standard deviation is negative.
    """
    if heading is None:
        return NOWHERE, UNKNOWN
    if not (math.isfinite(heading) and deviation >= 0):
        raise InputError(
            f"heading {math.degrees(heading):g} ± {math.degrees(deviation):g}°: expected a finite heading and a "
            "standard deviation of 0° or more"
        )
    return replace(NOWHERE, heading=heading), PoseSpread(math.inf, deviation)


def with_prior(
    parameters: Sequence[Parameter], expected: Place, spread: PoseSpread, redundancy: float
) -> tuple[Parameter, ...]:
    """Return the parameters of a scan with normal priors of position and heading, where these are known.

    The log-likelihood will be divided by `redundancy`, and the prior with it, so its information is that many times as
    much here.
    """
    wide, (x, y) = spread.with_width, expected.position
    priors: dict[Quantity, tuple[float, float]] = {
        X: (x, wide.xy),
        Y: (y, wide.xy),
        HEADING: (expected.heading, wide.heading),
    }
    found = list(parameters)
    for row, parameter in enumerate(found):
        middle, deviation = priors.get(parameter.quantity, (0.0, math.inf))
        if math.isfinite(deviation):
            found[row] = replace(parameter, expected=middle, deviation=deviation / math.sqrt(redundancy))
    return tuple(found)


def scores_with_prior(scores: Scores, expected: Place, spread: PoseSpread, redundancy: float) -> Scores:
    """Return the scores of a lattice plus the logarithm of the prior, widened by a step of the lattice.

    If the heading is known, those of the lattice are within half a turn of it, as a normal prior needs them.
    """
    if math.isfinite(spread.heading):
        turns = np.remainder(scores.headings - expected.heading + math.pi, math.tau) - math.pi
        by_heading = _log_normal(turns, math.hypot(spread.heading, math.tau / HEADINGS))
        weighed = scores.scores + redundancy * by_heading
        scores = replace(scores, headings=expected.heading + turns, scores=weighed)
    if math.isfinite(spread.xy):
        away = np.hypot(*(scores.positions - expected.position).T)
        by_position = _log_normal(away, math.hypot(spread.xy, scores.spacing))
        scores = replace(scores, scores=scores.scores + redundancy * by_position[:, None])
    return scores


def _log_normal(away: FloatArray, deviation: float) -> FloatArray:
    """Return the logarithm of a normal distribution, 0 in its middle."""
    return np.asarray(-0.5 * (away / deviation) ** 2)
