"""The calibration of a board from scans of a flat plate at several distances: values, intervals, and what stays."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares, minimize_scalar
from scipy.special import logsumexp, ndtr, stdtrit, xlogy
from sonarhw_sim.air import Air, Receiver
from sonarhw_sim.board.profile import Board
from sonarhw_sim.board.signal import RATE, own_burst
from sonarhw_sim.predict.room_echoes import plate_echo

from sonarhw.errors import NoPlate, harmless
from sonarhw.readings import BoolArray, FloatArray, Reading
from sonarhw_compare.calibration.outcome import Calibration, Measured
from sonarhw_compare.calibration.plate_readings import (
    FEWEST,
    WIDEST,
    EchoPulse,
    FacedPlate,
    PlateLevels,
    PlateReadings,
    air_of,
    faced_plate,
    peak_of,
    plate_envelopes,
    plate_levels,
    plate_readings,
)
from sonarhw_compare.edits import Z95

# keys of a profile that the levels of a plate's echo determine
_LEVEL_KEYS = _APERTURE, _GAIN_STEP, _THRESHOLD = "aperture_radius", "gain_step_db", "threshold_db"


def _changed_board(board: Board, changes: Mapping[str, float]) -> Board:
    """Return the board with these changes. That of the aperture is the logarithm of a ratio."""
    values = {}
    for key, change in changes.items():
        before = float(getattr(board, key))
        values[key] = before * math.exp(change) if key == _APERTURE else before + change
    return board.with_numbers(values)


# Posterior of aperture, gain step and threshold: where a plate is heard, and what the peaks of traces say before.
#
# Whether a ping hears the plate compares its level with the threshold. Pings of one heading share its direction: if
# the turntable is beside the stated angle, all of them are louder or all are fainter. So the number of pings that
# hear the plate, out of n at one heading, has the likelihood
#
#     ∫ Binomial(heard; n, Φ((level(angle + e) − threshold)/σ)) N(e; 0, s) de
#
# with the scatter σ of pings and s of headings, which are unknown, too. At a small share of headings, other objects
# decide, and any number is equally likely. The turn of each plate is integrated. The rest is sampled, because this
# likelihood is far from normal: it has steps where the echo ends between two headings.


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


def level_posterior(problem: "_Problem", values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return mean and standard deviation of the keys of a problem, (k,) each, as changes from its first fit `values`.

    The prior is what the peaks alone determine; without traces, hardly anything.
    """
    board, count = problem.board(values), len(problem.keys)
    peaks = replace(problem, counted=np.zeros_like(problem.counted), scatter=1.0)
    solved = _solved(peaks, values)
    of_peaks = _covariance(peaks, solved) * _widening(peaks, solved)
    expected, certain = (solved - values)[:count], np.linalg.inv(of_peaks[:count, :count])
    counted = np.split(problem.counted, np.cumsum([len(scan.angles) for scan in problem.scans])[:-1])
    turns, deviations = problem.turns(values).tolist(), np.sqrt(np.diag(of_peaks))[count + 2 :].tolist()
    hearing = [
        _Hearing(board, scan, used, problem.keys, turn, deviation)
        for scan, used, turn, deviation in zip(problem.scans, counted, turns, deviations, strict=True)
    ]
    lowest, highest = np.log([(SCATTERS[0], _HEADING_ERRORS[0]), (SCATTERS[1], _HEADING_ERRORS[1])])

    def log_density(values: FloatArray) -> float:
        spreads, beside = values[count:], values[:count] - expected
        if (spreads < lowest).any() or (spreads > highest).any():
            return -math.inf
        before = -float(beside @ certain @ beside) / 2
        scatter, error = np.exp(spreads).tolist()
        return before + sum(scan.log_likelihood(values[:count], scatter, error) for scan in hearing)

    covariance = _covariance(problem, values)[:count, :count]
    first = np.zeros((count + 2, count + 2))
    first[:count, :count] = covariance * min(1.0, _MOST_START**2 / float(np.diag(covariance).max()))
    first[count:, count:] = np.diag(np.square(_FIRST_SPREADS))
    mean, moments = _moments(log_density, np.concatenate((np.zeros(count), (lowest + highest) / 2)), first)
    return mean[:count], np.sqrt(np.diag(moments)[:count])


@dataclass(frozen=True)
class _Hearing:
    """The likelihood of hearing of one scan."""

    board: Board
    scan: PlateReadings
    used: BoolArray  # (n,)
    keys: tuple[str, ...]
    turn: float  # rad
    turn_deviation: float  # rad
    levels: dict[tuple[int, int], PlateLevels] = field(default_factory=dict)

    def log_likelihood(self, changes: FloatArray, scatter: float, error: float) -> float:
        """Return the logarithm of the likelihood, with the turn of the plate integrated."""
        values = dict(zip(self.keys, changes.tolist(), strict=True))
        threshold = self.board.threshold_db + values[_THRESHOLD]
        level = self._detected(values[_APERTURE], values.get(_GAIN_STEP, 0.0))
        heard = ndtr((level - threshold) / scatter)
        at_errors = np.array([np.interp(_ANGLES + error * deviations, _ANGLES, heard) for deviations in _ERRORS])
        counts, below, share = self._headings
        table = np.log([_chances(at_errors, *count) for count in counts]).ravel()
        before, after = table[below], table[below + 1]
        logarithms = (before + share * (after - before)).sum(axis=1)
        return float(logsumexp(logarithms - ((self._turns / self.turn_deviation) ** 2) / 2))

    @property
    def _turns(self) -> FloatArray:
        half = min(_MOST_TURN, _TURN_DEVIATIONS * self.turn_deviation)
        return np.linspace(-half, half, _TURNS)

    @cached_property
    def _headings(self) -> tuple[list[tuple[int, int]], NDArray[np.intp], FloatArray]:
        """Where each used heading is in a table with a row of `_ANGLES` for each pair of numbers, at each turn.

        The numbers of pings that hear the plate and of all pings, for each row; the element of the flat table at or
        below the heading, (t, n); and the share of the way to the next element, (t, n).
        """
        offsets = self.scan.angles - self.scan.middle - self.turn - self._turns[:, None]
        place = np.clip((offsets[:, self.used] + WIDEST) / _ANGLE_STEP, 0.0, len(_ANGLES) - 1.0)
        below = np.minimum(place.astype(np.intp), len(_ANGLES) - 2)
        pairs = np.column_stack((self.scan.heard, self.scan.pings))[self.used].tolist()
        counts = sorted({(int(hits), int(pings)) for hits, pings in pairs})
        rows = np.array([counts.index((int(hits), int(pings))) for hits, pings in pairs], dtype=np.intp)
        return counts, below + rows * len(_ANGLES), place - below

    def _detected(self, aperture: float, gain: float) -> FloatArray:
        """Return the level at the detector at `_ANGLES`, dB, interpolated between boards on a grid."""
        row, column = math.floor(aperture / _APERTURE_NODE), math.floor(gain / _GAIN_NODE)
        down, right = aperture / _APERTURE_NODE - row, gain / _GAIN_NODE - column
        levels = np.zeros(len(_ANGLES))
        for step, share in ((row, 1 - down), (row + 1, down)):
            before, after = self._node(step, column), self._node(step, column + 1)
            detected = (1 - right) * before.detected + right * after.detected
            # a beam is a function of the sine times the aperture
            sines = np.sin(_ANGLES) * math.exp(aperture - step * _APERTURE_NODE)
            levels += share * np.interp(np.arcsin(np.clip(sines, -1, 1)), before.angles, detected)
        return levels

    def _node(self, row: int, column: int) -> PlateLevels:
        if (row, column) not in self.levels:
            changes = {_APERTURE: row * _APERTURE_NODE, _GAIN_STEP: column * _GAIN_NODE}
            board = replace(_changed_board(self.board, changes), threshold_db=0.0)
            self.levels[row, column] = plate_levels(board, self.scan.speed_of_sound, self.scan.distance)
        return self.levels[row, column]


def _chances(at_errors: FloatArray, hits: int, pings: int) -> FloatArray:
    """Return the probability that `hits` of `pings` hear the plate at each of `_ANGLES`.

    `at_errors` (5, n) are the probabilities that one ping hears it, with each of `_ERRORS`.
    """
    chances = np.full_like(at_errors, float(math.comb(pings, hits)))
    # NumPy's powers are slow from the third on
    for chance, count in ((at_errors, hits), (1 - at_errors, pings - hits)):
        for _ in range(count):
            chances *= chance
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
        weights = _weights(np.array([log_density(sample) for sample in samples]) - proposed)
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


# Fit of aperture, gain steps and threshold to the levels of a plate's echo, and to where it is heard.
#
# The peaks of traces give level differences between headings (beam) and distances (gain). Whether a ping hears the
# plate compares its level with the threshold. Each is one residual of a least-squares fit:
#
# - The mean peak of a heading has a normal error, whose deviation is that of the residuals.
# - A ping hears the plate with probability Φ((level − threshold)/σ). In the first fit, the level is blurred by one step
#   of the turntable, so that it changes smoothly with each value.
#
# The first fit has a robust loss, and leaves out what other objects disturb. It gives what the peaks of traces
# determine, with a covariance that is widened if neighbouring residuals are alike, because a beam that differs from
# the model makes such errors. Hearing is then weighed without a blur (`level_posterior`): counted as an independent
# error of each ping, the blur gave thresholds up to 0.9 dB beside the true one, with intervals that were too narrow.


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
    deviations: dict[str, float]  # in the unit of the key
    trace_level_db: float  # level of a perfect wall in the traces, dB of full scale; without traces, 0
    disturbed: float  # share of headings whose hearing differs so much that it is left out
    misfit_db: float  # largest median difference of one log's peaks to the fit; 0 without traces


@dataclass(frozen=True)
class _Problem:
    """What is compared: peaks of some headings of each scan, and hearing.

    The unknowns are changes from the start: keys, ln σ, level of the traces, turn of each plate.
    """

    start: Board
    scans: tuple[PlateReadings, ...]
    keys: tuple[str, ...]
    used: tuple[BoolArray, ...]  # headings of each scan whose peak is used
    counted: BoolArray  # headings of all scans whose hearing is used
    deviation: float  # dB, of a peak
    scatter: float | None  # dB; None: it is an unknown

    @property
    def limits(self) -> FloatArray:
        """Largest change of each unknown, to either side, (u,)."""
        of_keys = [_FAR if key == _APERTURE else _FAR_DB for key in self.keys]
        return np.array([*of_keys, 3.0, _FAR_DB, *[_FAR_TURN] * len(self.scans)])

    def board(self, values: FloatArray) -> Board:
        """Return the board with these values."""
        return _changed_board(self.start, dict(zip(self.keys, values.tolist(), strict=False)))

    def trace_level(self, values: FloatArray) -> float:
        """Return the level of a perfect wall in the traces, dB of full scale."""
        return float(values[len(self.keys) + 1])

    def turns(self, values: FloatArray) -> FloatArray:
        """Return the direction of each plate relative to the middle of its echo, rad, (s,)."""
        return values[len(self.keys) + 2 :]

    def residuals(self, values: FloatArray) -> FloatArray:
        """Return all residuals that are used, in standard deviations, (k,)."""
        of_peaks = np.concatenate(self.peak_residuals(values)) / self.deviation
        # a weak prior, so that the deviation of what nothing determines is large, not infinite
        return np.concatenate((of_peaks, self.hearing_residuals(values)[self.counted], values / self.limits))

    def peak_residuals(self, values: FloatArray) -> list[FloatArray]:
        """Return measured minus expected peaks of each scan that are used, dB, (k,) each."""
        expected = self.expected_peaks(values)
        return [
            scan.peaks[used] - peaks[used] for scan, peaks, used in zip(self.scans, expected, self.used, strict=True)
        ]

    def expected_peaks(self, values: FloatArray) -> list[FloatArray]:
        """Return the expected peak at every heading of each scan, dB of full scale, (n,) each."""
        level = self.trace_level(values)
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
        board, turns = self.board(values), self.turns(values).tolist()
        levels = [plate_levels(board, scan.speed_of_sound, scan.distance) for scan in self.scans]
        return list(zip(self.scans, levels, turns, strict=True))

    def _chances(self, values: FloatArray) -> FloatArray:
        """Return the probability of hearing at each heading of all scans."""
        scatter = self.scatter or float(np.clip(math.exp(values[len(self.keys)]), *SCATTERS))
        threshold = self.board(values).threshold_db
        chances = []
        for scan, levels, turn in self._modelled(values):
            angles = scan.angles - scan.middle - turn
            blur = levels.slopes_at(angles) * scan.step / math.sqrt(12)
            chances.append(ndtr((levels.detected_at(angles) - threshold) / np.hypot(scatter, blur)))
        return np.asarray(_OUTLIERS / 2 + (1 - _OUTLIERS) * np.concatenate(chances))


def free_keys(board: Board, scans: Sequence[PlateReadings]) -> tuple[str, ...]:
    """Return the keys that levels may determine for this board."""
    stepped = bool(board.gain_steps) and board.receiver is Receiver.BOARD
    return tuple(key for key in _LEVEL_KEYS if key != _GAIN_STEP or (stepped and len(scans) > 1))


def fit_levels(start: Board, scans: Sequence[PlateReadings], keys: Sequence[str]) -> LevelFit:
    """Return the fit of these keys to the levels of all scans; other values of `start` are held."""
    used = tuple(_measurable(scan, scan.peaks) & _in_main_lobe(start, scan, scan.middle, _WIDER_LOBE) for scan in scans)
    counted = np.ones(sum(len(scan.angles) for scan in scans), dtype=np.bool_)
    problem = _Problem(start, tuple(scans), tuple(keys), used, counted, _FIRST_DEVIATION, None)
    values = np.zeros(len(problem.limits))
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
    board, turns = problem.board(values), problem.turns(values).tolist()
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
    limits = problem.limits
    solution = least_squares(
        problem.residuals,
        np.clip(values, -0.99 * limits, 0.99 * limits),
        jac=partial(_derivatives, problem.residuals),
        bounds=(-limits, limits),
        x_scale=limits,
        loss="soft_l1",  # objects beside the plate disturb some headings
        max_nfev=_MOST_STEPS,
        ftol=_LEAST_GAIN,
    )
    return np.asarray(solution.x)


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
    mean, spread = level_posterior(problem, values)
    board = _changed_board(problem.board(values), dict(zip(problem.keys, mean.tolist(), strict=True)))
    deviations = dict(zip(problem.keys, spread.tolist(), strict=True))
    deviations[_APERTURE] *= board.aperture_radius
    residuals = [of_scan for of_scan in problem.peak_residuals(values) if len(of_scan)]
    return LevelFit(
        board,
        deviations,
        problem.trace_level(values),
        float(1 - problem.counted.mean()),
        max((abs(float(np.median(residual))) for residual in residuals), default=0.0),
    )


def _covariance(problem: _Problem, values: FloatArray) -> FloatArray:
    slopes = _derivatives(problem.residuals, values)
    return np.asarray(np.linalg.inv(slopes.T @ slopes))


def _widening(problem: _Problem, values: FloatArray) -> float:
    """Return the factor of variances: over 1 if neighbouring residuals are alike, or residuals too large."""
    by_scan = [residual for residual in problem.peak_residuals(values) if len(residual) > 2]
    products = [of_scan[1:] * of_scan[:-1] for of_scan in by_scan]
    power = sum(float((of_scan**2).sum()) for of_scan in by_scan)
    alike = float(np.clip(sum(float(product.sum()) for product in products) / power, 0.0, 0.9)) if power else 0.0
    residuals = problem.residuals(values)
    excess = float((residuals**2).sum()) / max(1, len(residuals) - len(values))
    return (1 + alike) / (1 - alike) * max(1.0, excess)


# The end of blanking, from the first echoes that a board reports.


_TOGETHER = 20e-6  # s: first echoes within this are reported when blanking ends
_LATE = 0.1e-3  # s, later than the board detects the echo of a near plate
_WITHIN = 1e-3  # s, after the echo of a plate begins, in which it still sounds
_TICK = 2e-6  # s, of the clock that counts echo times


def find_blanking(calibration: Calibration, scans: Sequence[PlateReadings]) -> None:
    """Find the end of blanking: the time at which many first echoes are reported, though their sound came before.

    If a plate is so near that its echo begins within blanking and ends after it, the board reports the echo at the
    moment at which blanking ends, at all headings. The profile gives the time that it needs to detect an echo.
    """
    board, key = calibration.start, "blanking" if calibration.start.blanking_inhibit is None else "blanking_inhibit"
    first = min((float(scan.first_times.min()) for scan in scans if len(scan.first_times)), default=math.inf)
    for scan in scans:
        begins = 2 * scan.distance / scan.speed_of_sound
        delay = plate_echo(board, air_of(scan.speed_of_sound), scan.distance).delay
        detected = begins + 2 * delay / scan.speed_of_sound
        together = int((scan.first_times <= first + _TOGETHER).sum())
        if together < FEWEST or not detected + _LATE < first < begins + _WITHIN:
            continue
        if first > scan.blanked_until + _TOGETHER:
            calibration.add(key, first, first - _TOGETHER, first + _TICK, "s")
        else:
            blanked = f"{scan.blanked_until * 1000:.3g} ms"
            calibration.kept[key] = f"the scanner ignored all echoes before {blanked}; scan with less blanking"
        return
    calibration.kept[key] = "no plate is so near that its echo begins while the board is blanked"


# Fit of swelling and ring-down to the shape of plate echoes in traces, and of the own burst to their beginning.


_MOST_PULSES = 32  # whose shape is fitted
_FEWEST_PULSES = 5
_LIMITED = 0.9  # of the largest sample; louder ones may be limited
_FAINT = 0.1  # of the largest sample; the shape of fainter echoes is rough
_RING_FAINT = 0.03  # amplitude; fainter samples of the ring-down may be noise
_FEWEST_SAMPLES = 4  # of a ring-down
_CYCLES = (0.5, 40.0)  # limits of the fit
_OTHER_RING = 1.1  # times the swelling, where the fit of the ring-down begins
_LATEST = 0.15e-3  # s, between the expected and the fitted time of an echo
_LEAST_SHARE = 0.02  # least relative deviation of a time constant: pulses have a model, too
_LEAST_RING_DB = 0.3  # least deviation of the own burst, likewise
_MOST_SLOPE = 1.5  # ratio of ring-down to swelling, from which on they differ


def pulse_shape(board: Board, scans: Sequence[PlateReadings]) -> tuple[Measured, Measured | None] | None:
    """Return swelling and ring-down, cycles, as medians of fits to single echoes; None if too few are suitable.

    If swelling and ring-down are alike, one value for both is fitted, which is more accurate, and the second is None.
    """
    suitable = [pulse for scan in scans for pulse in _suitable(scan, len(scans))]
    if len(suitable) < _FEWEST_PULSES:
        return None
    rises, rings = np.array([_shape_of(board, *pulse, own_ring=True) for pulse in suitable]).T
    if 1 / _MOST_SLOPE <= float(np.median(rings / rises)) <= _MOST_SLOPE:
        rises, _ = np.array([_shape_of(board, *pulse, own_ring=False) for pulse in suitable]).T
        return _median(rises), None
    return _median(rises), _median(rings)


def _suitable(scan: PlateReadings, count: int) -> list[tuple[PlateReadings, EchoPulse]]:
    """Return echoes of one of `count` scans that are loud and not limited; those nearest to the perpendicular."""
    loud = [pulse for pulse in scan.pulses if _FAINT <= peak_of(pulse.samples) / scan.largest <= _LIMITED]
    # there, the beam delays least
    loud.sort(key=lambda pulse: abs(pulse.angle - scan.middle))
    return [(scan, pulse) for pulse in loud[: math.ceil(_MOST_PULSES / count)]]


def _median(values: FloatArray) -> Measured:
    # as an interval of a normal distribution
    spread = float(np.std(values, ddof=1)) / math.sqrt(len(values)) * float(stdtrit(len(values) - 1, 0.975)) / Z95
    value = float(np.median(values))
    return Measured(value, math.hypot(spread, _LEAST_SHARE * value))


def _shape_of(board: Board, scan: PlateReadings, pulse: EchoPulse, *, own_ring: bool) -> tuple[float, float]:
    """Return swelling and ring-down, cycles, with which an echo of the plate fits best; amplitude and time are free."""
    angles = np.array([pulse.angle - scan.middle])

    def residuals(values: FloatArray) -> FloatArray:
        amplitude, later, rise, *ring = values.tolist()
        changed = replace(board, rise_cycles=rise, ring_cycles=ring[0] if ring else None)
        model = plate_envelopes(changed, scan.speed_of_sound, scan.distance, angles)
        expected = np.interp(pulse.times - later * _LATEST, model.times[0], model.samples[0], left=0.0, right=0.0)
        return np.asarray(amplitude * expected - pulse.samples)

    model = plate_envelopes(board, scan.speed_of_sound, scan.distance, angles)
    low, high = _CYCLES
    rise = float(np.clip(board.rise_cycles, 1.01 * low, 0.99 * high))
    start = [peak_of(pulse.samples) / float(model.samples.max()), 0.0, rise]
    bounds = [0.0, -1.0, low], [math.inf, 1.0, high]
    if own_ring:
        start.append(float(np.clip(board.ring_cycles or _OTHER_RING * rise, 1.01 * low, 0.99 * high)))
        bounds = [*bounds[0], low], [*bounds[1], high]
    fitted = least_squares(residuals, start, bounds=bounds, diff_step=[1e-3] * len(start), max_nfev=40)
    return float(fitted.x[2]), float(fitted.x[-1])


def ring_down(
    board: Board, deviation: float, scans: Sequence[PlateReadings], trace_level_db: float
) -> tuple[Measured, float] | None:
    """Return the level of the transmit burst's ring-down, dB over full scale, and the time constant of its decay.

    None if the traces do not show it. The board has the measured time constants. The standard `deviation` (cycles) of
    that of the decay widens that of the level. `trace_level_db` is the level of a perfect wall in the traces.
    """
    begins = [(scan, scan.begin) for scan in scans if scan.begin is not None]
    shown = [(scan, _decaying(begin, scan.largest)) for scan, begin in begins]
    shown = [(scan, begin) for scan, begin in shown if len(begin.times) >= _FEWEST_SAMPLES]
    if not shown:
        return None

    decay = "rise_cycles" if board.ring_cycles is None else "ring_cycles"
    measured = float(getattr(board, decay))

    def levels(cycles: float) -> FloatArray:
        changed = board.with_numbers({decay: cycles, "own_burst_db": 0.0})
        return np.concatenate([_excess(changed, scan.speed_of_sound, begin) for scan, begin in shown])

    here = levels(measured)
    slower, faster = (float(levels(max(measured + by, _CYCLES[0])).mean()) for by in (deviation, -deviation))
    spread = math.hypot(float(here.std()) / math.sqrt(len(shown)), (slower - faster) / 2, _LEAST_RING_DB)
    best = minimize_scalar(lambda cycles: float(levels(cycles).var()), bounds=_CYCLES, method="bounded")
    return Measured(float(here.mean()) - trace_level_db, spread), float(best.x)


def _decaying(begin: EchoPulse, largest: float) -> EchoPulse:
    """Return the samples after the last limited one, until they are faint."""
    limited = np.flatnonzero(begin.samples > 0.8 * largest)
    first = int(limited[-1]) + 1 if len(limited) else len(begin.samples)
    faint = np.flatnonzero(begin.samples[first:] < _RING_FAINT)
    last = first + (int(faint[0]) if len(faint) else 0)
    return EchoPulse(begin.angle, begin.times[first:last], begin.samples[first:last])


def _excess(board: Board, speed_of_sound: float, ring: EchoPulse) -> FloatArray:
    """Return the levels of a ring-down over the board's own burst, dB, at each of its samples."""
    burst = np.abs(own_burst(board, speed_of_sound))
    expected = np.interp(ring.times, np.arange(len(burst)) / RATE, burst, right=float(burst[-1]))
    return np.asarray(20 * np.log10(ring.samples / np.maximum(expected, 1e-12)))


# half of a 95 % interval up to which a value counts as determined: dB, or share of the aperture
_MOST_DB = 1.0
_MOST_APERTURE = 0.05
# least standard deviations: humidity and temperature of the air, and the reflectance of the plate are assumed
_LEAST_DB = 0.1
_LEAST_APERTURE = 0.0025
_MOST_DISTURBED = 0.02  # share of headings; outliers of a plate that stands alone are rarer
_MISFIT_DB = 1.0  # from which on the gain does not explain the levels at all distances
_LEVEL_DB = 5.0  # by which the threshold of a profile may be wrong, and a plate may be fainter than a perfect one


def _no_traces(calibration: Calibration) -> str:
    """Return the reason why a value that needs traces stays."""
    return "the scan has no traces" if calibration.plate else "the logs contain no traces"


def calibrate_facing_plate(start: Board, readings: Sequence[Reading], distance: float, direction: float) -> Calibration:
    """Return the calibration of a board from one scan of a plate that faces it, beginning with the profile `start`.

    Distance, m, and `direction`, the turntable angle that faces the plate, rad, count as exact. So the scan gives range
    offset and home angle, and then what a log of a plate gives. Raises NoPlate if it does not show a flat plate there.
    """
    faint, usual, loud = (plate_echo(start, Air(), distance, louder) for louder in (-_LEVEL_DB, 0.0, _LEVEL_DB))
    faced = faced_plate(readings, distance, direction, (faint.early_arc, loud.arc), usual.delay)
    scan = plate_readings("the scan", readings, distance, direction, start, start.blanking_end)
    return calibrate_with_plates(start, [scan], faced)


def calibrate_with_plates(start: Board, scans: Sequence[PlateReadings], faced: FacedPlate | None = None) -> Calibration:
    """Return the calibration of a board from scans of a plate, beginning with the profile `start`.

    `faced` is what the only scan shows of a plate that the scanner faces. Raises NoPlate if blanking hides all plates.
    """
    calibration = Calibration(start, start, plate=faced)
    if faced:
        offset = Measured(faced.range_offset, faced.range_spread)
        home = Measured(math.degrees(faced.home_angle), math.degrees(faced.home_uncertainty))
        calibration.add_measured("range_offset", offset, "m", 5, "m, measured minus true")
        calibration.add_measured("home_angle_deg", home, "degrees", 3, "direction of the turntable's zero")
    find_blanking(calibration, scans)
    deviation = _find_pulse_shape(calibration, scans)
    levels = _find_levels(calibration, _after_blanking(calibration.board, scans))
    _find_ring_down(calibration, scans, deviation, levels)
    if levels.misfit_db > _MISFIT_DB:
        calibration.doubts.append(
            f"the peaks of one log differ by {levels.misfit_db:.1f} dB from the gain of this profile; "
            "check the distances, and that the plate is large enough"
        )
    if levels.disturbed > _MOST_DISTURBED:
        calibration.doubts.append(
            f"{levels.disturbed:.0%} of the headings have echoes that a plate alone does not give; the intervals "
            "may be too narrow; remove what stands near the plate, and scan again"
        )
    if not faced:
        keys = ", ".join(finding.key for finding in calibration.findings)
        calibration.header = [
            f"# Calibrated by `sonarhw calibrate` with a plate, beginning with profile {start.name!r}: {keys}.",
            *(f"#   {harmless(scan.name)}: plate at {scan.distance:g} m" for scan in scans),
        ]
    return calibration


def _after_blanking(board: Board, scans: Sequence[PlateReadings]) -> list[PlateReadings]:
    """Return the scans whose echo begins after the board is blanked. Raises NoPlate if there is none."""
    kept = [
        scan for scan in scans if 2 * scan.distance / scan.speed_of_sound > max(board.blanking_end, scan.blanked_until)
    ]
    if not kept:
        nearest = board.blanking_end * scans[0].speed_of_sound / 2
        raise NoPlate(f"no plate is beyond {nearest:.2g} m, where blanking ends; scan a plate that is farther away")
    return kept


def _find_pulse_shape(calibration: Calibration, scans: Sequence[PlateReadings]) -> float:
    """Find swelling and ring-down, and return the standard deviation of the time constant of the decay, cycles."""
    if not any(scan.pulses for scan in scans):
        calibration.kept["rise_cycles"] = _no_traces(calibration)
        return 0.0
    shape = pulse_shape(calibration.start, scans)
    if shape is None:
        calibration.kept["rise_cycles"] = "too few echoes of the plate are loud without being limited"
        return 0.0
    rise, ring = shape
    calibration.add_measured("rise_cycles", rise, "cycles")
    if ring is not None or calibration.start.ring_cycles is not None:
        calibration.add_measured("ring_cycles", ring or rise, "cycles")
    return (ring or rise).deviation


def _find_levels(calibration: Calibration, scans: Sequence[PlateReadings]) -> LevelFit:
    """Fit the levels. Keys that they do not determine stay, and count as unknown in the intervals of the others."""
    keys = free_keys(calibration.start, scans)
    if _GAIN_STEP not in keys:
        source = "scan" if calibration.plate else "log"
        calibration.kept[_GAIN_STEP] = (
            f"one {source} shows the gain at one time only"
            if calibration.start.gain_steps
            else "this profile has no gain steps"
        )
    fit = fit_levels(calibration.board, scans, keys)
    for key in keys:
        value, deviation = float(getattr(fit.board, key)), fit.deviations[key]
        unit, most, least = (
            ("m", _MOST_APERTURE * value, _LEAST_APERTURE * value) if key == _APERTURE else ("dB", _MOST_DB, _LEAST_DB)
        )
        half = Z95 * deviation
        if calibration.plate and fit.disturbed > _MOST_DISTURBED:
            calibration.kept[key] = "the plate is too small for it, or not alone; it must extend by half its distance"
        elif half > most:
            text = f"{half / value:.0%}" if key == _APERTURE else f"{half:.1f} dB"
            calibration.kept[key] = f"the scans determine it to ± {text} only"
        else:
            calibration.add_measured(key, Measured(value, math.hypot(deviation, least)), unit)
    return fit


def _find_ring_down(
    calibration: Calibration, scans: Sequence[PlateReadings], deviation: float, levels: LevelFit
) -> None:
    if not any(scan.pulses for scan in scans):
        calibration.kept["own_burst_db"] = _no_traces(calibration)
        return
    shown = ring_down(calibration.board, deviation, scans, levels.trace_level_db)
    if shown is None:
        calibration.kept["own_burst_db"] = "the traces do not show how the burst decays"
        return
    level, decay = shown
    cycles = calibration.board.ring_cycles or calibration.board.rise_cycles
    if 1 / _MOST_SLOPE <= decay / cycles <= _MOST_SLOPE:
        calibration.add_measured("own_burst_db", level, "dB")
    else:
        calibration.kept["own_burst_db"] = (
            f"the burst decays with {decay:.1f} cycles, and the echoes with {cycles:.1f}; "
            "a profile has one value for both"
        )
