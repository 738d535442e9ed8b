"""How well a prediction explains a scan: assigned echoes, probabilities of readings, and matched regions."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from sonarhw_sim.air import ROOM_TOLERANCE, Model
from sonarhw_sim.board.profile import Board
from sonarhw_sim.predict.predicted_scan import Echo, PredictedScan
from sonarhw_sim.predict.prediction import PredictionOptions
from sonarhw_sim.predict.probability import RESOLUTION, PossibleReading, possible_readings, scan_with_fainter_paths
from sonarhw_sim.rays.paths import Paths

from sonarhw.readings import FloatArray
from sonarhw_compare.match import TOLERANCE, Comparison, Kind
from sonarhw_compare.regions import Region, regions_of

# Assignment of predicted echoes to all measured echoes of a reading, and statistics of the residuals.
#
# Each predicted echo is used at most once, and the sum of the residuals is minimal (Hungarian method).


_TO_DEVIATION = 1.4826  # standard deviation of a normal distribution by its median absolute deviation


@dataclass(frozen=True)
class EchoStatistics:
    """Statistics of all measured echoes of a scan; readings of the carrier's own body are left out."""

    echoes: int
    explained: float | None  # share with a predicted echo; None without measured echoes
    bias_m: float | None  # median residual; this and the next are None if none is explained
    spread_m: float | None  # standard deviation, from the median absolute deviation


def assigned_echoes(comparison: Comparison, index: int) -> tuple[tuple[float, Echo | None], ...]:
    """Return every echo of reading `index`, m with the offset, nearest first, each with its predicted echo."""
    measured = np.array(comparison.readings[index].echo_ranges, dtype=np.float64) + comparison.offset
    echoes = comparison.prediction.ping(index).echoes
    chosen = assigned(measured, np.array([echo.range for echo in echoes], dtype=np.float64))
    predicted = (None if row is None else echoes[row] for row in chosen)
    return tuple(zip(measured.tolist(), predicted, strict=True))


def assigned(measured: FloatArray, predicted: FloatArray) -> list[int | None]:
    """Return for each of `measured` (m,) its row of `predicted` (p,); None without one within 5 cm, all in m."""
    differences = np.abs(measured[:, None] - predicted)
    # all costs beyond the tolerance are equal, so that they do not displace a pair within it
    from scipy.optimize import linear_sum_assignment  # loads slowly

    rows, columns = linear_sum_assignment(np.minimum(differences, 2 * TOLERANCE))
    chosen: list[int | None] = [None] * len(measured)
    for row, column in zip(rows.tolist(), columns.tolist(), strict=True):
        if differences[row, column] <= TOLERANCE:
            chosen[row] = column
    return chosen


def echo_statistics(comparison: Comparison) -> EchoStatistics:
    """Return the statistics of all echoes of a scan."""
    of_room = np.flatnonzero(comparison.of_room).tolist()
    echoes = [echo for index in of_room for echo in assigned_echoes(comparison, index)]
    residuals = np.array([measured - echo.range for measured, echo in echoes if echo is not None], dtype=np.float64)
    if not len(residuals):
        return EchoStatistics(len(echoes), 0.0 if echoes else None, None, None)
    bias = float(np.median(residuals))
    spread = float(_TO_DEVIATION * np.median(np.abs(residuals - bias)))
    return EchoStatistics(len(echoes), len(residuals) / len(echoes), bias, spread)


# Score of predicted probabilities: the log score of the readings, and the calibration of the stated probabilities.
#
# The log score is the mean natural logarithm of the probability of each reading, which is silence or a range within
# half a centimetre (or half the board's rounding). It is 0 for readings that are predicted with certainty. Assumed: 1
# % of the readings are strays, half of them silence, half with any range. Calibration considers the most probable
# reading of each heading, silence or a range within 5 cm, and compares its probability with how often it is measured.


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
    return ", ".join(f"{tenth.stated:.0%} and {tenth.observed:.0%} of {tenth.n}" for tenth in bins)


def _scan(prediction: PredictedScan, options: PredictionOptions | None, model: Model) -> PredictedScan:
    board = prediction.board
    if not board.threshold_sd_db:
        return prediction
    if model is not Model.RAY_FOLLOWING:
        return replace(prediction, board=replace(board, threshold_sd_db=0.0))
    place = prediction.place if prediction.places is None else prediction.places
    return scan_with_fainter_paths(prediction.room, place, board, prediction.headings, options)


def _probability(measured: float | None, outcomes: Sequence[PossibleReading], board: Board) -> float:
    """Return the probability of a reading, above 0."""
    if measured is None:
        return (1 - _STRAY) * outcomes[-1].probability + _STRAY / 2
    width = board.rounding or RESOLUTION
    stray = width / (2 * board.max_range)
    return (1 - _STRAY) * _within(measured, width / 2, outcomes) + _STRAY * stray


def _within(middle: float, reach: float, outcomes: Sequence[PossibleReading]) -> float:
    """Return the probability of a range up to `reach` (m) from `middle` (m)."""
    return sum(
        _share(outcome, middle + reach) - _share(outcome, middle - reach)
        for outcome in outcomes
        if outcome.range is not None
    )


def _share(outcome: PossibleReading, limit: float) -> float:
    """Return the probability that an outcome has a range below `limit`, m."""
    assert outcome.range is not None
    from scipy.special import ndtr  # loads slowly

    below = ndtr((limit - outcome.range) / max(outcome.spread, 1e-6))
    return outcome.probability * float(below)


def _most_probable(measured: float | None, outcomes: Sequence[PossibleReading]) -> tuple[float, bool]:
    """Return the probability of the most probable reading, and whether `measured` (m; None: silence) is that."""
    silence = outcomes[-1].probability
    ranges = [outcome.range for outcome in outcomes if outcome.range is not None]
    chances = [_within(middle, TOLERANCE, outcomes) for middle in ranges]
    if not chances or silence >= max(chances):
        return silence, measured is None
    best = int(np.argmax(chances))
    return chances[best], measured is not None and abs(measured - ranges[best]) <= TOLERANCE


# Assignment of the measured regions of constant depth to the predicted ones, with the differences of each pair.


RegionPair: TypeAlias = tuple[Region, Region]  # one region as measured and as predicted


@dataclass(frozen=True)
class RegionMatch:
    """The regions of two scans."""

    pairs: tuple[RegionPair, ...]
    parts: tuple[RegionPair, ...]  # further regions that overlap a region of a pair: a reflector detected in pieces
    only_measured: tuple[Region, ...]
    only_predicted: tuple[Region, ...]

    def by_bearing(self) -> list[tuple[Region | None, Region | None]]:
        """Return each region as measured and as predicted, None if missing in that scan, counter-clockwise."""
        rows: list[tuple[float, Region | None, Region | None]] = []
        rows += [(measured.bearing, measured, predicted) for measured, predicted in self.pairs + self.parts]
        rows += [(region.bearing, region, None) for region in self.only_measured]
        rows += [(region.bearing, None, region) for region in self.only_predicted]
        return [(measured, predicted) for _, measured, predicted in sorted(rows, key=lambda row: row[0])]


def compare_regions(comparison: Comparison) -> RegionMatch:
    """Return the regions of a measured scan and of its prediction, at the headings of the readings.

    Readings of different predicted paths are in different regions, even if two walls are equally far away.
    Echoes of the carrier's own body are in none.
    """
    prediction = comparison.prediction
    ranges = np.where(comparison.of_room, comparison.measured, math.nan)
    measured = [_mirror(prediction.paths, path) for path in comparison.paths.tolist()]
    winners = [_mirror(prediction.paths, int(winner)) for winner in prediction.winners]
    return match_regions(
        regions_of(prediction.headings, ranges, mirrors=measured),
        regions_of(prediction.headings, prediction.ranges, mirrors=winners),
    )


def _mirror(paths: Paths, path: int) -> tuple[int, ...] | None:
    """Return the edge and surfaces of a path, equal for both directions; None without a path."""
    if path < 0:
        return None
    return int(paths.edges[path]), *sorted(paths.surfaces[path].tolist())


def match_regions(measured: Sequence[Region], predicted: Sequence[Region]) -> RegionMatch:
    """Assign regions within 5 cm in range so that the headings in common are as many as possible."""
    cells = np.array([[_shared(one, other) for other in predicted] for one in measured], dtype=np.float64)
    shared = cells.reshape(len(measured), len(predicted))
    from scipy.optimize import linear_sum_assignment  # loads slowly

    rows, columns = linear_sum_assignment(shared, maximize=True)
    chosen = [(int(k), int(j)) for k, j in zip(rows, columns, strict=True) if shared[k, j] > 0]
    of_measured = set(range(len(measured))) - {k for k, _ in chosen}
    of_predicted = set(range(len(predicted))) - {j for _, j in chosen}
    parts = [(k, int(shared[k].argmax())) for k in sorted(of_measured) if shared[k].any()]
    parts += [(int(shared[:, j].argmax()), j) for j in sorted(of_predicted) if shared[:, j].any()]
    return RegionMatch(
        tuple((measured[k], predicted[j]) for k, j in chosen),
        tuple((measured[k], predicted[j]) for k, j in parts),
        tuple(measured[k] for k in sorted(of_measured) if not shared[k].any()),
        tuple(predicted[j] for j in sorted(of_predicted) if not shared[:, j].any()),
    )


def _shared(one: Region, other: Region) -> float:
    """Return the overlap of two regions, rad; 0 if their ranges differ."""
    if abs(one.range - other.range) > TOLERANCE:
        return 0.0
    turn = abs(math.remainder(one.bearing - other.bearing, math.tau))
    return max(0.0, min(one.width, other.width, (one.width + other.width) / 2 - turn))
