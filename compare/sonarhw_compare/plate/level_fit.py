"""Fit of aperture, gain steps and threshold to the levels of a plate's echo, and to where it is heard.

The peaks of traces give level differences between headings (beam) and distances (gain). Whether a ping hears the plate
compares its level with the threshold. Each is one residual of a least-squares fit:

- The mean peak of a heading has a normal error, whose deviation is that of the residuals.
- A ping hears the plate with probability Φ((level − threshold)/σ). In the first fit, the level is blurred by one step
  of the turntable, so that it changes smoothly with each value.

The first fit has a robust loss, and leaves out what other objects disturb. It gives what the peaks of traces determine,
with a covariance that is widened if neighbouring residuals are alike, because a beam that differs from the model makes
such errors. Hearing is then weighed without a blur (`level_posterior`): counted as an independent error of each ping,
the blur gave thresholds up to 0.9 dB beside the true one, with intervals that were too narrow.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares
from scipy.special import ndtr, xlogy
from sonarhw_sim.air import Receiver
from sonarhw_sim.board.profile import Board

from sonarhw.readings import BoolArray, FloatArray
from sonarhw_compare.plate.level_keys import LevelKey, changed_board
from sonarhw_compare.plate.level_posterior import SCATTERS, LevelPrior, level_posterior
from sonarhw_compare.plate.plate_readings import PlateReadings
from sonarhw_compare.plate.plate_signal import PlateLevels, plate_levels

FAINTEST_PEAK_DB = -26.0  # below, the steps of an 8-bit converter matter
_BELOW_FULL_DB = 2.0  # peaks that are expected within this of the largest sample may be limited
_OUTLIERS = 0.01  # share of pings
_FIRST_DEVIATION = 1.0  # dB, of a peak, before it is known
_LEAST_DEVIATION = 0.05  # dB, of a peak
_WIDE = (4.0, 1.5)  # dB: σ of the first fits, with which a wrong start is found
_PASSES = 2  # of leaving out outliers
_FIRST_NULL = 3.8317  # of J₁
_WIDER_LOBE = 1.2  # before the aperture is known
_USUAL = 4.0  # standard deviations; larger residuals are those of outliers
_STEP = 1e-3  # of each unknown, for derivatives
_MOST_STEPS = 60
_LEAST_GAIN = 1e-6  # of a step, as a share of the sum of squares; less changes no value by a tenth of its deviation
_FAR = 1.0  # limit of the unknown logarithm of the aperture's ratio
_FAR_DB = 30.0  # and of levels
_FAR_TURN = math.radians(5.0)


@dataclass(frozen=True)
class LevelFit:
    """The fitted board, and the standard deviation of each fitted value."""

    board: Board
    deviations: dict[LevelKey, float]  # in the unit of the key
    trace_level_db: float  # level of a perfect wall in the traces, dB of full scale; without traces, 0
    turns: FloatArray  # (s,), rad, turntable angle of each plate's perpendicular
    disturbed: float  # share of headings whose hearing differs so much that it is left out
    misfit_db: float  # largest median difference of one log's peaks to the fit; 0 without traces


@dataclass(frozen=True)
class _Unknowns:
    """The unknowns, as changes from the start: keys, ln σ, level of the traces, turn of each plate."""

    keys: tuple[LevelKey, ...]
    scans: int

    @property
    def limits(self) -> FloatArray:
        """Largest change of each unknown, to either side, (u,)."""
        of_keys = [_FAR if key is LevelKey.APERTURE else _FAR_DB for key in self.keys]
        return np.array([*of_keys, 3.0, _FAR_DB, *[_FAR_TURN] * self.scans])

    def board(self, start: Board, values: FloatArray) -> Board:
        """Return the board with these values. The aperture is the logarithm of a ratio."""
        return changed_board(start, dict(zip(self.keys, values.tolist(), strict=False)))

    def scatter(self, values: FloatArray) -> float:
        """Return σ of hearing, dB."""
        return float(np.clip(math.exp(values[len(self.keys)]), *SCATTERS))

    def trace_level(self, values: FloatArray) -> float:
        """Return the level of a perfect wall in the traces, dB of full scale."""
        return float(values[len(self.keys) + 1])

    def turns(self, values: FloatArray) -> FloatArray:
        """Return the direction of each plate relative to the middle of its echo, rad, (s,)."""
        return values[len(self.keys) + 2 :]


@dataclass(frozen=True)
class _Problem:
    """What is compared: peaks of some headings of each scan, and hearing."""

    start: Board
    scans: tuple[PlateReadings, ...]
    unknowns: _Unknowns
    used: tuple[BoolArray, ...]  # headings of each scan whose peak is used
    counted: BoolArray  # headings of all scans whose hearing is used
    deviation: float  # dB, of a peak
    scatter: float | None  # dB; None: it is an unknown

    def residuals(self, values: FloatArray) -> FloatArray:
        """Return all residuals that are used, in standard deviations, (k,)."""
        of_peaks = np.concatenate(self.peak_residuals(values)) / self.deviation
        return np.concatenate((of_peaks, self.hearing_residuals(values)[self.counted], self._weak(values)))

    def peak_residuals(self, values: FloatArray) -> list[FloatArray]:
        """Return measured minus expected peaks of each scan that are used, dB, (k,) each."""
        expected = self.expected_peaks(values)
        return [scan.peaks[used] - one[used] for scan, one, used in zip(self.scans, expected, self.used, strict=True)]

    def expected_peaks(self, values: FloatArray) -> list[FloatArray]:
        """Return the expected peak at every heading of each scan, dB of full scale, (n,) each."""
        level = self.unknowns.trace_level(values)
        return [
            levels.peaks_at(scan.angles - scan.middle - turn) + level for scan, levels, turn in self._modelled(values)
        ]

    def hearing_residuals(self, values: FloatArray) -> FloatArray:
        """Return the signed roots of the deviance of hearing at all headings of all scans, used or not, (n,)."""
        heard = np.concatenate([scan.heard for scan in self.scans]).astype(np.float64)
        return _deviance_roots(heard, self._pings, self._chances(values))

    @property
    def _pings(self) -> FloatArray:
        return np.concatenate([scan.pings for scan in self.scans]).astype(np.float64)

    def _modelled(self, values: FloatArray) -> list[tuple[PlateReadings, PlateLevels, float]]:
        board, turns = self.unknowns.board(self.start, values), self.unknowns.turns(values).tolist()
        levels = [plate_levels(board, scan.speed_of_sound, scan.distance) for scan in self.scans]
        return list(zip(self.scans, levels, turns, strict=True))

    def _chances(self, values: FloatArray) -> FloatArray:
        """Return the probability of hearing at each heading of all scans."""
        scatter = self.scatter or self.unknowns.scatter(values)
        threshold = self.unknowns.board(self.start, values).threshold_db
        chances = []
        for scan, levels, turn in self._modelled(values):
            angles = scan.angles - scan.middle - turn
            blur = levels.slopes_at(angles) * scan.step / math.sqrt(12)
            chances.append(ndtr((levels.detected_at(angles) - threshold) / np.hypot(scatter, blur)))
        return np.asarray(_OUTLIERS / 2 + (1 - _OUTLIERS) * np.concatenate(chances))

    def _weak(self, values: FloatArray) -> FloatArray:
        """Return weak prior residuals, so that the deviation of what nothing determines is large, not infinite."""
        return values / self.unknowns.limits


def free_keys(board: Board, scans: Sequence[PlateReadings]) -> tuple[LevelKey, ...]:
    """Return the keys that levels may determine for this board."""
    stepped = bool(board.gain_steps) and board.receiver is Receiver.BOARD
    return tuple(key for key in LevelKey if key is not LevelKey.GAIN_STEP or (stepped and len(scans) > 1))


def fit_levels(start: Board, scans: Sequence[PlateReadings], keys: Sequence[LevelKey]) -> LevelFit:
    """Return the fit of these keys to the levels of all scans; other values of `start` are held."""
    unknowns = _Unknowns(tuple(keys), len(scans))
    used = tuple(_measurable(scan, scan.peaks) & _in_main_lobe(start, scan, scan.middle, _WIDER_LOBE) for scan in scans)
    counted = np.ones(sum(len(scan.angles) for scan in scans), dtype=np.bool_)
    problem = _Problem(start, tuple(scans), unknowns, used, counted, _FIRST_DEVIATION, None)
    values = np.zeros(len(unknowns.limits))
    for scatter in _WIDE:
        values = _solved(replace(problem, scatter=scatter), values)
    for _ in range(_PASSES):
        problem = _without_outliers(problem, values)
        values = _solved(problem, values)
    return _fit_of(problem, values)


def _measurable(scan: PlateReadings, levels: FloatArray) -> BoolArray:
    """Return the headings at which peaks of these levels, dB of full scale, are neither limited nor faint."""
    most = 20 * math.log10(scan.largest) - _BELOW_FULL_DB if scan.largest > 0 else -math.inf
    return np.asarray((levels > FAINTEST_PEAK_DB) & (levels < most) & ~np.isnan(scan.peaks))


def _in_main_lobe(board: Board, scan: PlateReadings, direction: float, wider: float = 1.0) -> BoolArray:
    """Return the headings in the main lobe. Beyond it, echoes of other objects may be louder than the plate's."""
    ka = math.tau * board.frequency / scan.speed_of_sound * board.aperture_radius
    half = math.asin(min(1.0, wider * _FIRST_NULL / ka))
    return np.asarray(np.abs(scan.angles - direction) < half)


def _without_outliers(problem: _Problem, values: FloatArray) -> _Problem:
    """Return the problem with the deviation of peaks, and without the headings that other objects disturb.

    Peaks are measurable if they are so by the fit. A selection by the measured peaks would prefer those with errors to
    one side.
    """
    expected = problem.expected_peaks(values)
    board, turns = problem.unknowns.board(problem.start, values), problem.unknowns.turns(values).tolist()
    used = tuple(
        _measurable(scan, levels) & _in_main_lobe(board, scan, scan.middle + turn)
        for scan, levels, turn in zip(problem.scans, expected, turns, strict=True)
    )
    residuals = np.concatenate(replace(problem, used=used).peak_residuals(values))
    # of a normal distribution, half of the absolute values are below 0.6745; outliers do not count
    deviation = float(np.median(np.abs(residuals))) / 0.6745 if len(residuals) else _FIRST_DEVIATION
    freedom = max(1, len(residuals) - len(values))
    deviation = max(deviation * math.sqrt(max(1, len(residuals)) / freedom), _LEAST_DEVIATION)
    used = tuple(
        chosen & ~(np.abs(scan.peaks - levels) > _USUAL * deviation)
        for scan, chosen, levels in zip(problem.scans, used, expected, strict=True)
    )
    counted = np.abs(problem.hearing_residuals(values)) <= _USUAL
    return replace(problem, used=used, counted=counted, deviation=deviation)


def _solved(problem: _Problem, values: FloatArray) -> FloatArray:
    limits = problem.unknowns.limits

    def derivatives(at: FloatArray) -> FloatArray:
        return _derivatives(problem.residuals, at)

    found = least_squares(
        problem.residuals,
        np.clip(values, -0.99 * limits, 0.99 * limits),
        jac=derivatives,
        bounds=(-limits, limits),
        x_scale=limits,
        loss="soft_l1",  # objects beside the plate disturb some headings
        max_nfev=_MOST_STEPS,
        ftol=_LEAST_GAIN,
    )
    return np.asarray(found.x)


def _derivatives(function: Callable[[FloatArray], FloatArray], values: FloatArray) -> FloatArray:
    """Return the derivative of a function by each value, (r, u), by central differences."""
    columns = []
    for k in range(len(values)):
        step = np.zeros(len(values))
        step[k] = _STEP
        columns.append((function(values + step) - function(values - step)) / (2 * _STEP))
    return np.column_stack(columns)


def _deviance_roots(heard: FloatArray, pings: FloatArray, chances: FloatArray) -> FloatArray:
    """Return the signed root of the deviance of `heard` of `pings`, each with these probabilities, same shape."""
    missed = pings - heard
    deviance = xlogy(heard, heard / (pings * chances)) + xlogy(missed, missed / (pings * (1 - chances)))
    return np.asarray(np.sign(heard - pings * chances) * np.sqrt(2 * np.maximum(deviance, 0.0)))


def _fit_of(problem: _Problem, values: FloatArray) -> LevelFit:
    unknowns, board, count = problem.unknowns, problem.unknowns.board(problem.start, values), len(problem.unknowns.keys)
    found = level_posterior(
        board,
        problem.scans,
        np.split(problem.counted, np.cumsum([len(scan.angles) for scan in problem.scans])[:-1]),
        _prior_of_peaks(problem, values),
        np.zeros(count),
        _covariance(problem, values)[:count, :count],
    )
    changes = dict(zip(unknowns.keys, found.mean.tolist(), strict=True))
    board = changed_board(board, changes)
    deviations = dict(zip(unknowns.keys, found.deviations.tolist(), strict=True))
    deviations[LevelKey.APERTURE] *= board.aperture_radius
    residuals = [one for one in problem.peak_residuals(values) if len(one)]
    return LevelFit(
        board,
        deviations,
        unknowns.trace_level(values),
        np.array([scan.middle for scan in problem.scans]) + unknowns.turns(values),
        float(1 - problem.counted.mean()),
        max((abs(float(np.median(one))) for one in residuals), default=0.0),
    )


def _prior_of_peaks(problem: _Problem, values: FloatArray) -> LevelPrior:
    """Return what the peaks alone determine, relative to the fit `values`; without traces, hardly anything."""
    count = len(problem.unknowns.keys)
    peaks = replace(problem, counted=np.zeros_like(problem.counted), scatter=1.0)
    solved = _solved(peaks, values)
    covariance = _covariance(peaks, solved) * _widening(peaks, solved)
    return LevelPrior(
        problem.unknowns.keys,
        (solved - values)[:count],
        covariance[:count, :count],
        problem.unknowns.turns(values),
        np.sqrt(np.diag(covariance))[count + 2 :],
    )


def _covariance(problem: _Problem, values: FloatArray) -> FloatArray:
    slopes = _derivatives(problem.residuals, values)
    return np.asarray(np.linalg.inv(slopes.T @ slopes))


def _widening(problem: _Problem, values: FloatArray) -> float:
    """Return the factor of variances: over 1 if neighbouring residuals are alike, or residuals too large."""
    by_scan = [one for one in problem.peak_residuals(values) if len(one) > 2]
    products = [one[1:] * one[:-1] for one in by_scan]
    power = sum(float((one**2).sum()) for one in by_scan)
    alike = float(np.clip(sum(float(one.sum()) for one in products) / power, 0.0, 0.9)) if power else 0.0
    residuals = problem.residuals(values)
    excess = float((residuals**2).sum()) / max(1, len(residuals) - len(values))
    return (1 + alike) / (1 - alike) * max(1.0, excess)
