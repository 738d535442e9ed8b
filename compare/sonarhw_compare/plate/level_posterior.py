"""Posterior of aperture, gain step and threshold: where a plate is heard, and what the peaks of traces say before.

Whether a ping hears the plate compares its level with the threshold. Pings of one heading share its direction: if the
turntable is beside the stated angle, all of them are louder or all are fainter. So the number of pings that hear the
plate, out of n at one heading, has the likelihood

    ∫ Binomial(heard; n, Φ((level(angle + e) − threshold)/σ)) N(e; 0, s) de

with the scatter σ of pings and s of headings, which are unknown, too. At a small share of headings, other objects
decide, and any number is equally likely. The turn of each plate is integrated. The rest is sampled, because this
likelihood is far from normal: it has steps where the echo ends between two headings.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp, ndtr
from sonarhw_sim.board.profile import Board

from sonarhw.readings import BoolArray, FloatArray
from sonarhw_compare.plate.level_keys import LevelKey, changed_board
from sonarhw_compare.plate.plate_readings import PlateReadings
from sonarhw_compare.plate.plate_signal import WIDEST, PlateLevels, plate_levels

SCATTERS = (0.2, 3.0)  # dB, limits of σ
_HEADING_ERRORS = (math.radians(0.02), math.radians(0.5))  # limits of s
_DISTURBED = 0.01  # share of headings at which other objects decide
_ANGLE_STEP = math.radians(0.05)
_ANGLES = np.arange(-WIDEST, WIDEST + _ANGLE_STEP, _ANGLE_STEP)
_TURNS, _MOST_TURN, _TURN_DEVIATIONS = 61, math.radians(1.5), 5.0  # of each plate, about its first fit
_APERTURE_NODE, _GAIN_NODE = 0.005, 0.25  # between which levels are interpolated: ln of a ratio, dB
# five errors of a heading in standard deviations, and their weights
_ERRORS, _FACTORS = np.polynomial.hermite_e.hermegauss(5)
_ROUNDS, _SAMPLES = 4, 200
_FREEDOM = 5  # of the proposals, Student's t
_FEWEST = 30.0  # effective samples; with fewer, the weights of a round are flattened
_MOST_START = 1.0  # largest standard deviation of the first proposals
_FIRST_SPREADS = (0.3, 0.7)  # of ln σ and ln s


@dataclass(frozen=True)
class LevelPrior:
    """What is known before hearing: a normal distribution of the keys, and one of the turn of each plate."""

    keys: tuple[LevelKey, ...]
    mean: FloatArray  # (k,), changes from the board; of the aperture, ln of its ratio
    covariance: FloatArray  # (k, k)
    turns: FloatArray  # (s,), rad, from the middle of the echo
    turn_deviations: FloatArray  # (s,), rad


@dataclass(frozen=True)
class LevelPosterior:
    """Mean and standard deviation of each key, as changes from the board."""

    mean: FloatArray  # (k,)
    deviations: FloatArray  # (k,)


def level_posterior(
    board: Board,
    scans: Sequence[PlateReadings],
    counted: Sequence[BoolArray],
    prior: LevelPrior,
    start: FloatArray,
    covariance: FloatArray,
) -> LevelPosterior:
    """Return the posterior of the keys of `prior`.

    `counted` are the headings of each scan whose hearing is used. `start` (k,) and `covariance` (k, k) are those of a
    first fit, where the samples begin.
    """
    hearing = [
        _Hearing(board, scan, used, prior.keys, turn, deviation)
        for scan, used, turn, deviation in zip(
            scans, counted, prior.turns.tolist(), prior.turn_deviations.tolist(), strict=True
        )
    ]
    certain, count = np.linalg.inv(prior.covariance), len(prior.keys)
    lowest, highest = np.log([(SCATTERS[0], _HEADING_ERRORS[0]), (SCATTERS[1], _HEADING_ERRORS[1])])

    def log_density(values: FloatArray) -> float:
        spreads, beside = values[count:], values[:count] - prior.mean
        if (spreads < lowest).any() or (spreads > highest).any():
            return -math.inf
        before = -float(beside @ certain @ beside) / 2
        scatter, error = np.exp(spreads).tolist()
        return before + sum(one.log_likelihood(values[:count], scatter, error) for one in hearing)

    first = np.zeros((count + 2, count + 2))
    first[:count, :count] = covariance * min(1.0, _MOST_START**2 / float(np.diag(covariance).max()))
    first[count:, count:] = np.diag(np.square(_FIRST_SPREADS))
    mean, found = _moments(log_density, np.concatenate((start, (lowest + highest) / 2)), first)
    return LevelPosterior(mean[:count], np.sqrt(np.diag(found)[:count]))


@dataclass(frozen=True)
class _Headings:
    """Where each used heading is in a table with a row of `_ANGLES` for each pair of numbers, at each turn."""

    counts: list[tuple[int, int]]  # of each row: pings that hear the plate, and all pings
    below: NDArray[np.intp]  # (t, n), element of the flat table at or below the heading
    share: FloatArray  # (t, n), of the way to the next element


@dataclass(frozen=True)
class _Hearing:
    """The likelihood of hearing of one scan."""

    board: Board
    scan: PlateReadings
    used: BoolArray  # (n,)
    keys: tuple[LevelKey, ...]
    turn: float  # rad
    turn_deviation: float  # rad
    levels: dict[tuple[int, int], PlateLevels] = field(default_factory=dict)

    def log_likelihood(self, changes: FloatArray, scatter: float, error: float) -> float:
        """Return the logarithm of the likelihood, with the turn of the plate integrated."""
        values = dict(zip(self.keys, changes.tolist(), strict=True))
        threshold = self.board.threshold_db + values[LevelKey.THRESHOLD]
        level = self._detected(values[LevelKey.APERTURE], values.get(LevelKey.GAIN_STEP, 0.0))
        heard = ndtr((level - threshold) / scatter)
        at_errors = np.array([np.interp(_ANGLES + error * one, _ANGLES, heard) for one in _ERRORS])
        of_headings = self._headings
        table = np.log([_chances(at_errors, *one) for one in of_headings.counts]).ravel()
        before, after = table[of_headings.below], table[of_headings.below + 1]
        found = (before + of_headings.share * (after - before)).sum(axis=1)
        return float(logsumexp(found - ((self._turns / self.turn_deviation) ** 2) / 2))

    @property
    def _turns(self) -> FloatArray:
        half = min(_MOST_TURN, _TURN_DEVIATIONS * self.turn_deviation)
        return np.linspace(-half, half, _TURNS)

    @cached_property
    def _headings(self) -> _Headings:
        offsets = self.scan.angles - self.scan.middle - self.turn - self._turns[:, None]
        place = np.clip((offsets[:, self.used] + WIDEST) / _ANGLE_STEP, 0.0, len(_ANGLES) - 1.0)
        below = np.minimum(place.astype(np.intp), len(_ANGLES) - 2)
        pairs = np.column_stack((self.scan.heard, self.scan.pings))[self.used].tolist()
        counts = sorted({(int(hits), int(pings)) for hits, pings in pairs})
        rows = np.array([counts.index((int(hits), int(pings))) for hits, pings in pairs], dtype=np.intp)
        return _Headings(counts, below + rows * len(_ANGLES), place - below)

    def _detected(self, aperture: float, gain: float) -> FloatArray:
        """Return the level at the detector at `_ANGLES`, dB, interpolated between boards on a grid."""
        row, column = math.floor(aperture / _APERTURE_NODE), math.floor(gain / _GAIN_NODE)
        down, right = aperture / _APERTURE_NODE - row, gain / _GAIN_NODE - column
        found = np.zeros(len(_ANGLES))
        for step, share in ((row, 1 - down), (row + 1, down)):
            before, after = self._node(step, column), self._node(step, column + 1)
            detected = (1 - right) * before.detected + right * after.detected
            # a beam is a function of the sine times the aperture
            sines = np.sin(_ANGLES) * math.exp(aperture - step * _APERTURE_NODE)
            found += share * np.interp(np.arcsin(np.clip(sines, -1, 1)), before.angles, detected)
        return found

    def _node(self, row: int, column: int) -> PlateLevels:
        if (row, column) not in self.levels:
            changes = {LevelKey.APERTURE: row * _APERTURE_NODE, LevelKey.GAIN_STEP: column * _GAIN_NODE}
            board = replace(changed_board(self.board, changes), threshold_db=0.0)
            self.levels[row, column] = plate_levels(board, self.scan.speed_of_sound, self.scan.distance)
        return self.levels[row, column]


def _chances(at_errors: FloatArray, hits: int, pings: int) -> FloatArray:
    """Return the probability that `hits` of `pings` hear the plate at each of `_ANGLES`.

    `at_errors` (5, n) are the probabilities that one ping hears it, with each of `_ERRORS`.
    """
    chances = np.full_like(at_errors, float(math.comb(pings, hits)))
    # NumPy's powers are slow from the third on
    for one, count in ((at_errors, hits), (1 - at_errors, pings - hits)):
        for _ in range(count):
            chances *= one
    return np.asarray((1 - _DISTURBED) * (_FACTORS / _FACTORS.sum() @ chances) + _DISTURBED / (pings + 1))


def _moments(
    log_density: Callable[[FloatArray], float], mean: FloatArray, covariance: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return mean and covariance of a distribution by adaptive importance sampling from a Student's t distribution.

    The proposals of each round are those that the samples of the round before suggest. The same samples are drawn
    again for the same distribution.
    """
    random, size = np.random.default_rng(0), len(mean)
    for _ in range(_ROUNDS):
        wide = np.linalg.cholesky(1.5 * covariance + 1e-9 * np.eye(size))
        drawn = random.standard_normal((_SAMPLES, size))
        drawn /= np.sqrt(random.chisquare(_FREEDOM, (_SAMPLES, 1)) / _FREEDOM)
        samples = mean + drawn @ wide.T
        proposed = -(_FREEDOM + size) / 2 * np.log1p((drawn**2).sum(axis=1) / _FREEDOM)
        weights = _weights(np.array([log_density(one) for one in samples]) - proposed)
        mean = weights @ samples
        beside = samples - mean
        covariance = (beside * weights[:, None]).T @ beside
    return mean, covariance


def _weights(logarithms: FloatArray) -> FloatArray:
    """Return weights with a sum of 1. They are flattened until they are those of `_FEWEST` samples or more."""
    flatter = 1.0
    while True:
        weights = np.exp(flatter * (logarithms - logarithms.max()))
        weights /= weights.sum()
        if 1 / float((weights**2).sum()) >= _FEWEST or flatter < 0.01:
            return np.asarray(weights)
        flatter *= 0.8
