"""Score of predicted probabilities: the log score of the readings, and the calibration of the stated probabilities.

The log score is the mean natural logarithm of the probability of each reading, which is silence or a range within half
a centimetre (or half the board's rounding). It is 0 for readings that are predicted with certainty. Assumed: 1 % of the
readings are strays, half of them silence, half with any range. Calibration considers the most probable reading of each
heading, silence or a range within 5 cm, and compares its probability with how often it is measured.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import ndtr
from sonarhw_sim.air import ROOM_TOLERANCE, Model
from sonarhw_sim.board.profile import Board
from sonarhw_sim.predict.predicted_scan import PredictedScan
from sonarhw_sim.predict.prediction import PredictionOptions
from sonarhw_sim.predict.probability import RESOLUTION, PossibleReading, possible_readings, scan_with_fainter_paths

from sonarhw_compare.matching.match import TOLERANCE, Comparison, Kind

_STRAY = 0.01  # share of readings that nothing in the room explains
_BINS = 10  # of calibration


@dataclass(frozen=True)
class CalibrationBin:
    """The headings whose most probable reading has a probability in one tenth of 0 to 1."""

    n: int
    stated: float  # mean of their stated probabilities
    observed: float  # share of these headings at which that reading is measured


@dataclass(frozen=True)
class ProbabilityScore:
    """How well the predicted probabilities agree with the readings of a scan."""

    log_score: float | None  # None without readings
    calibration: tuple[CalibrationBin, ...]  # bins with readings, lowest probability first
    pings: int  # a reading is the median of so many
    room_tolerance_m: float


def score_comparison(
    comparison: Comparison,
    options: PredictionOptions | None = None,
    *,
    model: Model = Model.RAY_FOLLOWING,
    pings: int = 1,
    room_tolerance: float = ROOM_TOLERANCE,
) -> ProbabilityScore:
    """Return the score of a comparison; `options` and `model` are those of its prediction.

    Readings are medians of an odd number of `pings`. `room_tolerance` (m) is the standard deviation of the position of
    each wall. The predictions of simpler models have no spread of the threshold. Readings of the carrier's own body are
    left out. Raises InputError.
    """
    scan = _scan(comparison.prediction, options, model)
    of_room = [row for row in comparison.rows if row.kind is not Kind.OWN_BODY]
    rows = [(row.measured, possible_readings(scan, row.index, pings, room_tolerance)) for row in of_room]
    logarithms = [math.log(_probability(measured, outcomes, scan.board)) for measured, outcomes in rows]
    log_score = float(np.mean(logarithms)) if logarithms else None
    return ProbabilityScore(log_score, calibration([_most_probable(*row) for row in rows]), pings, room_tolerance)


def calibration(stated: Sequence[tuple[float, bool]]) -> tuple[CalibrationBin, ...]:
    """Return the bins of stated probabilities, each with whether the reading was as stated."""
    bins: list[list[tuple[float, bool]]] = [[] for _ in range(_BINS)]
    for probability, happened in stated:
        bins[min(int(probability * _BINS), _BINS - 1)].append((probability, happened))
    means = ((len(chosen), *np.mean(chosen, axis=0).tolist()) for chosen in bins if chosen)
    return tuple(CalibrationBin(count, probability, share) for count, probability, share in means)


def calibration_text(bins: Sequence[CalibrationBin]) -> str:
    """Return the bins as text: stated and observed shares, and the number of readings."""
    return ", ".join(f"{one.stated:.0%} and {one.observed:.0%} of {one.n}" for one in bins)


def _scan(prediction: PredictedScan, options: PredictionOptions | None, model: Model) -> PredictedScan:
    board = prediction.board
    if not board.threshold_sd_db:
        return prediction
    if model is not Model.RAY_FOLLOWING:
        return replace(prediction, board=replace(board, threshold_sd_db=0.0))
    return scan_with_fainter_paths(prediction.room, prediction.place, board, prediction.headings, options)


def _probability(measured: float | None, outcomes: Sequence[PossibleReading], board: Board) -> float:
    """Return the probability of a reading, above 0."""
    if measured is None:
        return (1 - _STRAY) * outcomes[-1].probability + _STRAY / 2
    width = board.rounding or RESOLUTION
    stray = width / (2 * board.max_range)
    return (1 - _STRAY) * _within(measured, width / 2, outcomes) + _STRAY * stray


def _within(middle: float, reach: float, outcomes: Sequence[PossibleReading]) -> float:
    """Return the probability of a range up to `reach` (m) from `middle` (m)."""
    return sum(_share(one, middle + reach) - _share(one, middle - reach) for one in outcomes if one.range is not None)


def _share(outcome: PossibleReading, limit: float) -> float:
    """Return the probability that an outcome has a range below `limit`, m."""
    assert outcome.range is not None
    below = ndtr((limit - outcome.range) / max(outcome.spread, 1e-6))
    return outcome.probability * float(below)


def _most_probable(measured: float | None, outcomes: Sequence[PossibleReading]) -> tuple[float, bool]:
    """Return the probability of the most probable reading, and whether `measured` (m; None: silence) is that."""
    silence = outcomes[-1].probability
    ranges = [one.range for one in outcomes if one.range is not None]
    chances = [_within(middle, TOLERANCE, outcomes) for middle in ranges]
    if not chances or silence >= max(chances):
        return silence, measured is None
    best = int(np.argmax(chances))
    return chances[best], measured is not None and abs(measured - ranges[best]) <= TOLERANCE
