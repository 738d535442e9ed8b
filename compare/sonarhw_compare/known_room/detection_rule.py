"""Threshold and aperture by a rule that counts echoes and silence.

The rule: of a grid of apertures and thresholds, take the pair with the largest weighted mean of two shares, the echoes
within 5 cm of the prediction, counted three times, and the balanced accuracy of silence, counted once. A plain
likelihood gives up many echoes for a little more silence. Shares of a few hundred readings are noisy, so each pair is
averaged with its neighbours on the grid, and the given profile changes no more than the scans demand: of the pairs that
are not worse than the best at 95 % confidence, the nearest to the given one is taken. The one-standard-error rule of
Breiman, Friedman, Olshen and Stone (Classification and Regression Trees, 1984) does the same with one standard error.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import uniform_filter
from sonarhw_sim.board.profile import ON_AXIS, Board, without_own_body
from sonarhw_sim.predict.prediction import PredictionOptions, paths_for, weigh_paths
from sonarhw_sim.room.room import Place, Room

from sonarhw.readings import BoolArray, FloatArray
from sonarhw_compare.fit.values.fit_result import PlacedScan
from sonarhw_compare.matching.block_bootstrap import drawn_blocks
from sonarhw_compare.matching.match import TOLERANCE
from sonarhw_compare.matching.regions import angles_and_ranges

ECHOES_COUNT = 3.0  # times as much as silence
APERTURES = 1.1 ** np.arange(-5.0, 6.0)  # relative to the given profile
THRESHOLDS = np.arange(-8.0, 11.0)  # dB, likewise
_OF_DRAWS = (2.5, 97.5)  # percentiles
_NEAREST_FIRST = 1e-5  # per step of the grid: of equal pairs, that of the given profile
_AS_GOOD = 1.96  # standard errors of the difference from the best score

_STEPS_AWAY = np.abs(np.log(APERTURES) / np.log(1.1))[:, None] + np.abs(THRESHOLDS)  # (a, t), from the given profile


@dataclass(frozen=True)
class Between:
    """A value with its 95 % interval."""

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class DetectionChoice:
    """What the rule chooses."""

    threshold_db: Between
    aperture_radius: Between
    is_determined: bool  # False: the scans have no silence, or no echo, and the rule counts one kind only


@dataclass(frozen=True)
class _Outcomes:
    """What each pair of the grid predicts right, for all r readings together."""

    sounding: BoolArray  # (r,), whether an echo was measured
    explained: BoolArray  # (a, t, r): an echo within 5 cm of the prediction
    predicted: BoolArray  # (a, t, r): an echo is predicted


def choose_detection(
    scans: Sequence[PlacedScan],
    room: Room,
    board: Board,
    places: Sequence[Place],
    redundancy: float,
    tick: Callable[[float], None] = lambda _share: None,
) -> DetectionChoice:
    """Return threshold and aperture by the rule, for scans at `places` (with the actual headings of the zero).

    `redundancy` is the number of readings per independent reading; the intervals are from a bootstrap of such blocks.
    """
    found = _outcomes(scans, room, board, places, tick)
    scores = _scores(found, np.ones((1, len(found.sounding))))[0]
    random = np.random.default_rng(0)
    drawn_scores = _scores(found, drawn_blocks(len(found.sounding), redundancy, random))
    a, t = nearest_good_pair(scores, drawn_scores)
    drawn = np.array(best_pairs(drawn_scores))
    thresholds, apertures = board.threshold_db + THRESHOLDS, board.aperture_radius * APERTURES
    both = bool(found.sounding.any() and not found.sounding.all())
    return DetectionChoice(
        _between(float(thresholds[t]), thresholds[drawn[:, 1]], 1.0),
        _between(float(apertures[a]), apertures[drawn[:, 0]], 0.1 * float(apertures[a])),
        both,
    )


def _between(value: float, drawn: FloatArray, step: float) -> Between:
    """Return a value of the grid with the interval of those drawn, at least half a step of the grid to each side."""
    low, high = np.percentile(drawn, _OF_DRAWS).tolist()
    return Between(value, min(low, value) - step / 2, max(high, value) + step / 2)


def _outcomes(
    scans: Sequence[PlacedScan],
    room: Room,
    board: Board,
    places: Sequence[Place],
    tick: Callable[[float], None],
) -> _Outcomes:
    # a face beside the axis would need a search for paths at every heading; here it only makes ranges shorter
    offset = board.range_offset - board.mount.ahead
    board = replace(board, mount=ON_AXIS, range_offset=offset, home_angle_deg=0.0)
    faintest = replace(board, threshold_db=board.threshold_db + float(THRESHOLDS.min()))
    explained, predicted, sounding = [], [], []
    for k, (scan, place) in enumerate(zip(scans, places, strict=True)):
        tick(k / len(scans))
        angles, measured = angles_and_ranges(without_own_body(board.own_body, scan.readings))
        headings = place.heading + board.turned(angles)
        options = PredictionOptions()
        paths = paths_for(room, place, faintest, options)
        grid = np.empty((len(APERTURES), len(THRESHOLDS), len(headings)))
        for a, wider in enumerate(APERTURES.tolist()):
            for t, higher in enumerate(THRESHOLDS.tolist()):
                one = replace(
                    board,
                    aperture_radius=board.aperture_radius * wider,
                    threshold_db=min(0.0, board.threshold_db + higher),
                )
                grid[a, t] = weigh_paths(room, place, one, headings, paths, options).ranges
        explained.append(np.abs(grid - measured) <= TOLERANCE)
        predicted.append(~np.isnan(grid))
        sounding.append(~np.isnan(measured))
    return _Outcomes(np.concatenate(sounding), np.concatenate(explained, axis=2), np.concatenate(predicted, axis=2))


def _scores(found: _Outcomes, weights: FloatArray) -> FloatArray:
    """Return the score of each pair, (w, a, t), with each row of `weights` (w, r) for the readings."""
    sounding, silent = weights * found.sounding, weights * ~found.sounding
    echoes, silences = sounding.sum(axis=1)[:, None, None], silent.sum(axis=1)[:, None, None]
    share = np.einsum("wr,atr->wat", sounding, found.explained) / np.maximum(echoes, 1e-9)
    heard = np.einsum("wr,atr->wat", sounding, found.predicted) / np.maximum(echoes, 1e-9)
    quiet = np.einsum("wr,atr->wat", silent, ~found.predicted) / np.maximum(silences, 1e-9)
    accuracy = np.where((silences > 0) & (echoes > 0), (heard + quiet) / 2, 0.0)
    scores = (ECHOES_COUNT * share + accuracy) / (ECHOES_COUNT + 1)
    return np.asarray(uniform_filter(scores, (1, 3, 3), mode="nearest") - _NEAREST_FIRST * _STEPS_AWAY)


def nearest_good_pair(scores: FloatArray, drawn: FloatArray) -> tuple[int, int]:
    """Return row and column of the pair nearest to the given profile whose score (a, t) is as good as the best.

    `drawn` (w, a, t) are the scores of the bootstrap. The standard error is that of the difference from the best score,
    because both come from the same readings.
    """
    best = best_pairs(scores[None])[0]
    errors = np.std(drawn[:, *best, None, None] - drawn, axis=0)
    is_good = scores[best] - scores <= _AS_GOOD * errors
    # of pairs equally far away, that with the larger score; scores are at most 1, so a step counts more
    ((a, t),) = best_pairs(np.where(is_good, 0.5 * scores - _STEPS_AWAY, -np.inf)[None])
    return a, t


def best_pairs(scores: FloatArray) -> list[tuple[int, int]]:
    """Return row and column of the largest score of each (a, t) table."""
    rows, columns = np.unravel_index(scores.reshape(len(scores), -1).argmax(axis=1), scores.shape[1:])
    return list(zip(rows.tolist(), columns.tolist(), strict=True))
