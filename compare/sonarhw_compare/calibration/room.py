"""The calibration of a board from scans of a known room: values, intervals, what stays and why.

First the carrier's own body, then geometry and reflectances, then threshold and aperture by the rule for echoes and
silence, then the spreads of threshold and range. The profile belongs to the room as it is, or to the room with the
reflectances found.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter, uniform_filter1d
from sonarhw_sim.board.profile import ON_AXIS, Board, OwnBodyPart, without_own_body
from sonarhw_sim.predict.prediction import PredictionOptions, paths_for, weigh_paths
from sonarhw_sim.predict.settled import predict_readings
from sonarhw_sim.room.room import Place, Room, parse_room

from sonarhw.errors import InputError, counted, harmless
from sonarhw.readings import BoolArray, FloatArray, Reading
from sonarhw_compare.arcs import place_numbers
from sonarhw_compare.calibration.outcome import CalibratedValue, Calibration, Measured
from sonarhw_compare.edits import Z95
from sonarhw_compare.fit import quantities
from sonarhw_compare.fit.objective import MODERATE, Objective, Problem, make_problem
from sonarhw_compare.fit.parameters import Parameter
from sonarhw_compare.fit.result import PlacedScan, Progress, check_given_once
from sonarhw_compare.fit.search import climb, covariance_of, refined
from sonarhw_compare.fit.starting import all_round, best_agreement, fit_scan
from sonarhw_compare.match import TOLERANCE, Comparison, Kind, compare_readings, drawn_blocks
from sonarhw_compare.regions import angles_and_ranges, mean_run

# Threshold and aperture by a rule that counts echoes and silence.
#
# The rule: of a grid of apertures and thresholds, take the pair with the largest weighted mean of two shares, the
# echoes within 5 cm of the prediction, counted three times, and the balanced accuracy of silence, counted once. A
# plain likelihood gives up many echoes for a little more silence. Shares of a few hundred readings are noisy, so each
# pair is averaged with its neighbours on the grid, and the given profile changes no more than the scans demand: of
# the pairs that are not worse than the best at 95 % confidence, the nearest to the given one is taken. The
# one-standard-error rule of Breiman, Friedman, Olshen and Stone (Classification and Regression Trees, 1984) does the
# same with one standard error.


ECHOES_COUNT = 3.0  # times as much as silence
APERTURES = 1.1 ** np.arange(-5.0, 6.0)  # relative to the given profile
THRESHOLDS = np.arange(-8.0, 11.0)  # dB, likewise
_OF_DRAWS = (2.5, 97.5)  # percentiles
_NEAREST_FIRST = 1e-5  # per step of the grid: of equal pairs, that of the given profile
_AS_GOOD = Z95  # standard errors of the difference from the best score

_STEPS_AWAY = np.abs(np.log(APERTURES) / np.log(1.1))[:, None] + np.abs(THRESHOLDS)  # (a, t), from the given profile


Interval = tuple[float, float, float]  # a value, and the low and high end of its 95 % interval


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
) -> tuple[Interval | None, Interval]:
    """Return threshold and aperture by the rule, for scans at `places` (with the actual headings of the zero).

    The threshold is None if the scans have no silence, or no echo: the rule then counts one kind only.
    `redundancy` is the number of readings per independent reading; the intervals are from a bootstrap of such blocks.
    """
    outcomes = _outcomes(scans, room, board, places, tick)
    scores = _scores(outcomes, np.ones((1, len(outcomes.sounding))))[0]
    random = np.random.default_rng(0)
    drawn_scores = _scores(outcomes, drawn_blocks(len(outcomes.sounding), redundancy, random))
    a, t = nearest_good_pair(scores, drawn_scores)
    drawn = np.array(best_pairs(drawn_scores))
    thresholds, apertures = board.threshold_db + THRESHOLDS, board.aperture_radius * APERTURES
    threshold = _between(float(thresholds[t]), thresholds[drawn[:, 1]], 1.0)
    aperture = _between(float(apertures[a]), apertures[drawn[:, 0]], 0.1 * float(apertures[a]))
    return threshold if outcomes.sounding.any() and not outcomes.sounding.all() else None, aperture


def _between(value: float, drawn: FloatArray, step: float) -> Interval:
    """Return a value of the grid with the interval of those drawn, at least half a step of the grid to each side."""
    low, high = np.percentile(drawn, _OF_DRAWS).tolist()
    return value, min(low, value) - step / 2, max(high, value) + step / 2


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
                changed = replace(
                    board,
                    aperture_radius=board.aperture_radius * wider,
                    threshold_db=min(0.0, board.threshold_db + higher),
                )
                grid[a, t] = weigh_paths(room, place, changed, headings, paths, options).ranges
        explained.append(np.abs(grid - measured) <= TOLERANCE)
        predicted.append(~np.isnan(grid))
        sounding.append(~np.isnan(measured))
    return _Outcomes(np.concatenate(sounding), np.concatenate(explained, axis=2), np.concatenate(predicted, axis=2))


def _scores(outcomes: _Outcomes, weights: FloatArray) -> FloatArray:
    """Return the score of each pair, (w, a, t), with each row of `weights` (w, r) for the readings."""
    sounding, silent = weights * outcomes.sounding, weights * ~outcomes.sounding
    echoes, silences = sounding.sum(axis=1)[:, None, None], silent.sum(axis=1)[:, None, None]
    share = np.einsum("wr,atr->wat", sounding, outcomes.explained) / np.maximum(echoes, 1e-9)
    heard = np.einsum("wr,atr->wat", sounding, outcomes.predicted) / np.maximum(echoes, 1e-9)
    quiet = np.einsum("wr,atr->wat", silent, ~outcomes.predicted) / np.maximum(silences, 1e-9)
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


# Echoes of the carrier of a sensor: the same turntable angle and range at every place, and not those of the room.
#
# Echoes that the room explains say nothing about the carrier, so they are not given. A run of neighbouring angles
# counts if nearly all places have the same range there, and if the other echoes, turned against each other at random,
# hardly ever have a run as long. At its ends an echo is as faint as the threshold, so it is detected at some places
# only.
#
# The room file may lack a wall that is equally far from two places. Its echoes look like those of the carrier, so
# scans from two places are not enough.


SAME_RANGE = 0.025  # m, largest difference of ranges that count as the same
_AGREEING = 0.7  # share of the places
_NEXT = 0.03  # m, largest difference of ranges of neighbouring angles
_TURNS = 300  # random turns of the scans against each other
_APART = 12  # directions from which turns are drawn, or one for each place if there are more
_AS_FAR = 0.05  # m, between ranges of one body, and of runs that are compared
_SHORTEST = 2  # angles
_CHANCE = 0.01  # of these, that have a run as long
_FINEST = math.radians(1.0)

IntArray = NDArray[np.intp]


def find_own_body(scans: Sequence[PlacedScan]) -> tuple[OwnBodyPart, ...]:
    """Return the parts of the carrier's body that the scans show, by turntable angle; none from fewer than 2 places.

    The scans have the readings that the room does not explain, silence included.
    """
    scans = [scan for scan in scans if scan.readings]
    places = place_numbers([scan.place.position for scan in scans])
    if len(set(places.tolist())) < 2:
        return ()
    step = max(_FINEST, *(_step(scan.readings) for scan in scans))
    count = round(math.tau / step)
    ranges, covered = (np.array(both) for both in zip(*(_on_grid(scan.readings, count) for scan in scans), strict=True))
    runs = _certain_runs(ranges, covered, places, np.random.default_rng(0))
    return tuple(sorted((_part(run, ranges, count) for run in runs), key=lambda part: part.from_deg))


def _certain_runs(
    ranges: FloatArray, covered: BoolArray, places: IntArray, random: np.random.Generator
) -> list[IntArray]:
    """Return the runs that are not by chance, with their ends."""
    values, enough = _consensus(ranges, covered, places)
    runs = [(run, float(np.median(values[run]))) for run in _runs(values, enough) if len(run) >= _SHORTEST]
    if not runs:
        return []
    by_chance = _runs_by_chance(*_without(runs, ranges, covered), places, random)
    runs = [(run, middle) for run, middle in runs if not _is_by_chance(run, middle, by_chance)]
    return _joined([_longer(run, middle, ranges) for run, middle in runs])


def _without(
    runs: Sequence[tuple[IntArray, float]], ranges: FloatArray, covered: BoolArray
) -> tuple[FloatArray, BoolArray]:
    """Return ranges and coverage without the echoes of runs: two parts of a body meet when scans are turned."""
    ranges, covered = ranges.copy(), covered.copy()
    for run, middle in runs:
        own = np.abs(ranges[:, run] - middle) <= _AS_FAR
        covered[:, run] &= ~own
        ranges[:, run] = np.where(own, np.nan, ranges[:, run])
    return ranges, covered


def _step(readings: Sequence[Reading]) -> float:
    """Return the usual step between the angles of a scan, rad."""
    angles = np.unique(np.round(np.remainder([reading.angle for reading in readings], math.tau), 6))
    return float(np.median(np.diff(angles))) if len(angles) > 1 else math.tau


def _on_grid(readings: Sequence[Reading], count: int) -> tuple[FloatArray, BoolArray]:
    """Return the range at each of `count` turntable angles, m, NaN for silence, and which angles have a reading."""
    angles, ranges = angles_and_ranges(readings)
    grid = np.arange(count) * (math.tau / count)
    away = np.abs(np.remainder(angles - grid[:, None] + math.pi, math.tau) - math.pi)
    nearest = away.argmin(axis=1)
    covered = away[np.arange(count), nearest] <= 0.75 * math.tau / count
    return np.where(covered, ranges[nearest], np.nan), covered


def _consensus(ranges: FloatArray, covered: BoolArray, places: IntArray) -> tuple[FloatArray, BoolArray]:
    """Return the range that most places have at each angle, (n,) m, and whether enough places have it, (n,)."""
    numbers = np.unique(places)
    same = np.abs(ranges[:, None] - ranges) <= SAME_RANGE  # (scan, other scan, angle)
    agreeing = sum(same[:, places == number].any(axis=1).astype(np.intp) for number in numbers)
    present = sum(covered[places == number].any(axis=0).astype(np.intp) for number in numbers)
    agreeing = np.asarray(agreeing)
    best = agreeing.argmax(axis=0)
    columns = np.arange(ranges.shape[1])
    enough = agreeing[best, columns] >= np.maximum(2, np.ceil(_AGREEING * present))
    return ranges[best, columns], enough


def _runs(values: FloatArray, enough: BoolArray) -> list[IntArray]:
    """Return the runs of neighbouring angles, also across angle 0, with enough places and nearly equal ranges."""
    count = len(values)
    joined = enough & np.roll(enough, 1) & (np.abs(values - np.roll(values, 1)) <= _NEXT)
    if joined.all():
        return [np.arange(count)]
    # begin behind a gap
    order = np.roll(np.arange(count), -int(np.flatnonzero(~joined)[0]))
    order = order[enough[order]]
    begins = ~(joined & np.roll(enough, 1))
    return np.split(order, np.flatnonzero(begins[order])[1:]) if len(order) else []


def _runs_by_chance(
    ranges: FloatArray, covered: BoolArray, places: IntArray, random: np.random.Generator
) -> list[list[tuple[int, float]]]:
    """Return the length and the range, m, of each run of the scans, turned against each other at random many times."""
    count = ranges.shape[1]
    spacing = max(1, count // max(_APART, places.max() + 1))
    runs = []
    for _ in range(_TURNS):
        # scans of one place stay together; no two places are turned alike
        turns = random.permutation(np.arange(0, count, spacing))[: places.max() + 1] + random.integers(0, spacing)
        rows = (np.arange(count) - turns[places][:, None]) % count
        values, enough = _consensus(
            np.take_along_axis(ranges, rows, axis=1), np.take_along_axis(covered, rows, axis=1), places
        )
        runs.append([(len(run), float(np.median(values[run]))) for run in _runs(values, enough)])
    return runs


def _is_by_chance(run: IntArray, middle: float, by_chance: list[list[tuple[int, float]]]) -> bool:
    """Return whether a run at a range (m) may be by chance: turned scans have one as long, and as far, too often."""
    alike = sum(
        any(length >= len(run) and abs(range_ - middle) <= _AS_FAR for length, range_ in runs) for runs in by_chance
    )
    return alike > _CHANCE * len(by_chance)


def _longer(run: IntArray, middle: float, ranges: FloatArray) -> IntArray:
    """Return a run with its neighbours at which a place has an echo as far away as the run, `middle` m."""
    alike: BoolArray = np.any(np.abs(ranges - middle) <= _AS_FAR, axis=0)
    count = len(alike)
    begin, end = int(run[0]), int(run[0]) + len(run) - 1
    while alike[(begin - 1) % count] and end - begin + 1 < count:
        begin -= 1
    while alike[(end + 1) % count] and end - begin + 1 < count:
        end += 1
    return np.arange(begin, end + 1) % count


def _joined(runs: Sequence[IntArray]) -> list[IntArray]:
    """Return runs, with those that have met as one."""
    joined: list[IntArray] = []
    for run in runs:
        met = [other for other in joined if np.isin(other, run).any()]
        angles = np.unique(np.concatenate((run, *met)))
        gaps = np.flatnonzero(np.diff(angles) > 1)
        # a run across angle 0 begins behind its only gap
        angles = np.roll(angles, -int(gaps[0]) - 1) if len(gaps) else angles
        joined = [*(other for other in joined if not np.isin(other, run).any()), angles]
    return joined


def _part(run: IntArray, ranges: FloatArray, count: int) -> OwnBodyPart:
    """Return a run as a part of the body; the outer half steps belong to it, and all ranges that count as the same."""
    step, echoes = 360.0 / count, ranges[:, run]
    away = np.abs(echoes - np.nanmedian(echoes))
    middles = np.take_along_axis(echoes, np.nanargmin(away, axis=0)[None], axis=0)
    own = echoes[np.abs(echoes - middles) <= SAME_RANGE]
    begin = (float(run[0]) - 0.5) * step
    return OwnBodyPart(
        from_deg=round(begin, 2),
        to_deg=round(begin + len(run) * step, 2),
        nearest=round(max(float(own.min()) - SAME_RANGE, 0.0), 4),
        farthest=round(float(own.max()) + SAME_RANGE, 4),
    )


# Headings, places, turntable scale and threshold to begin a calibration with: those that most readings match.


SCALES = np.arange(0.90, 1.141, 0.01)
# tried with each scale, dB: a sensor that hears more sees wider arcs, as a turntable does that turns less than it says
_THRESHOLDS = (-6.0, -4.5, -3.0, -1.5, 0.0, 1.5, 3.0, 4.5, 6.0)
_FREE = frozenset({"heading", "offset"})


@dataclass(frozen=True)
class TurntableFit:
    """What scans show of the geometry of the board and of their poses."""

    shared: dict[str, Measured]  # by key of the profile
    places: tuple[Place, ...]  # of the scans, with the actual heading of the turntable's zero
    # by material; those with a table, or outside the bounds of `fit`, stay
    reflectances: dict[str, Measured] = field(default_factory=dict)


class StartingSearch:
    """The starting values of scans of one room. What one scan shows alone is searched once for all sets of scans."""

    def __init__(self, scans: Sequence[PlacedScan], room: Room, board: Board) -> None:
        """Prepare the search for scans of a board."""
        # a face beside the axis would need a search for paths at every heading; the range offset stands for it
        plain = replace(board, mount=ON_AXIS)
        self._scans = [replace(scan, readings=without_own_body(board.own_body, scan.readings)) for scan in scans]
        self._room = room
        self._boards = [replace(plain, threshold_db=board.threshold_db + change) for change in _THRESHOLDS]
        self._matches: dict[int, BoolArray] = {}
        self._places: dict[tuple[int, int, int], Place] = {}

    def turntable(self, numbers: Sequence[int], tick: Callable[[float], None]) -> TurntableFit:
        """Return scale and threshold, shared by the scans `numbers`, and the pose of each with which most echoes match.

        The poses are within 3 cm of those given. The deviation of the scale is from a bootstrap of blocks of readings.
        """
        matches = np.concatenate([self._matches_of(number) for number in numbers], axis=2)
        row, column = _best(matches, np.ones((1, matches.shape[2])))[0]
        scales = self._boards[0].turntable_scale * SCALES
        runs = [mean_run(*angles_and_ranges(self._scans[number].readings)) for number in numbers]
        drawn = _best(matches, drawn_blocks(matches.shape[2], float(np.mean(runs)), np.random.default_rng(0)))
        deviation = math.hypot(float(np.std(scales[[k for _, k in drawn]])), SCALES[1] - SCALES[0])
        places = []
        for done, number in enumerate(numbers):
            tick(done / len(numbers))
            places.append(self._place_of(number, row, column))
        threshold = Measured(self._boards[row].threshold_db, 0.0)
        shared = {
            quantities.SCALE.key: Measured(float(scales[column]), deviation),
            quantities.THRESHOLD.key: threshold,
        }
        return TurntableFit(shared, tuple(places))

    def _matches_of(self, number: int) -> BoolArray:
        """Return whether each of the r readings of a scan matches, (thresholds, scales, r)."""
        if number not in self._matches:
            scan = self._scans[number]
            tables = [predict_readings(self._room, scan.place, board, all_round()).ranges for board in self._boards]
            scales = (self._boards[0].turntable_scale * SCALES).tolist()
            turned = [replace(self._boards[0], turntable_scale=scale) for scale in scales]
            self._matches[number] = np.array([[_matching(scan, table, board) for board in turned] for table in tables])
        return self._matches[number]

    def _place_of(self, number: int, row: int, column: int) -> Place:
        """Return the pose of a scan with a threshold (row) and a scale (column)."""
        key = (number, row, column)
        if key not in self._places:
            board, scan = self._boards[row], self._scans[number]
            turned = replace(board, turntable_scale=float(board.turntable_scale * SCALES[column]))
            self._places[key] = fit_scan(scan.readings, self._room, scan.place, turned, _FREE | {"position"}).place
        return self._places[key]


def _best(matches: BoolArray, weights: FloatArray) -> list[tuple[int, int]]:
    """Return threshold and scale (rows) with the most matches, for each row of `weights` (w, r) of the readings."""
    counts = np.einsum("wr,tsr->wts", weights, matches, optimize=True)
    # single counts are noisy: the best of three neighbours together. The present values win ties.
    smooth = uniform_filter1d(counts, 3, axis=2, mode="nearest")
    smooth -= np.add.outer(np.abs(_THRESHOLDS), np.abs(SCALES - 1.0)) * 1e-6
    return best_pairs(smooth)


def _matching(scan: PlacedScan, table: FloatArray, board: Board) -> BoolArray:
    """Return whether each reading matches at the heading and offset with the most matches."""
    fit = best_agreement(scan.readings, [(scan.place, table)], _FREE, board)
    angles, measured = angles_and_ranges(scan.readings)
    rows = np.round((fit.heading + board.turned(angles)) * (len(table) / math.tau)).astype(np.intp) % len(table)
    return np.asarray(np.abs(measured + fit.offset - table[rows]) <= TOLERANCE)


# Geometry of a board from scans of a known room, by the likelihood of `fit`.
#
# Shared by all scans: range offset and its slope, turntable scale, position of the turning axis, threshold and
# aperture, and the reflectances of the room, because threshold and reflectance decide together which echoes are
# heard. An echo with two reflections loses twice as much as one with a single reflection, which separates the two.
# The pose of each scan is a nuisance parameter: its position has a normal prior of 1.5 cm around the given one (marks
# and robots are only right within some 3 cm), its heading is free. Neighbouring readings of one echo have the same
# error, so the log-likelihood of a scan is divided by its number of readings per independent reading.


POSITION_SD = 0.015  # m, of a given position
_REACH = 0.06  # m, largest error of a given position
_TURN = math.radians(45.0)  # largest error of a starting heading
_SEARCHES, _ITERATIONS = 2, 4
_CLIMBS = 6  # at most, for the spreads
_GAIN = 0.01  # of the log-likelihood, that is worth another climb
_RANGE, _LEVEL = 0, 1  # rows of the noises
# shared quantities, with the standard deviation of their priors around the given profile; None: none
SHARED: tuple[tuple[quantities.BoardQuantity, float | None], ...] = (
    (quantities.OFFSET, 0.03),
    (quantities.SLOPE, 0.01),
    (quantities.SCALE, 0.05),
    (quantities.AXIS_X, 0.01),
    (quantities.AXIS_Y, 0.01),
    (quantities.THRESHOLD, 5.0),
    (quantities.APERTURE, None),
)


def fit_turntable(
    scans: Sequence[PlacedScan],
    room: Room,
    board: Board,
    start: TurntableFit,
    tick: Callable[[], None],
) -> TurntableFit:
    """Return the geometry of the board and the poses of the scans. `tick` is called before each search of paths."""
    # the actual heading of the zero is free, so the home angle is 0 here
    board = replace(board, home_angle_deg=0.0)
    problem = _problem(scans, room, board, start)
    values = problem.start()
    values = refined(problem, values, None, (MODERATE, None), tick=tick, searches=_SEARCHES, iterations=_ITERATIONS)
    deviations = np.sqrt(np.diag(covariance_of(problem.near(values), values))) * problem.widenings
    shared = {
        quantity.key: Measured(quantity.read(quantity.put(board, float(values[row]))), float(deviations[row]))
        for row, parameter in enumerate(problem.parameters)
        if isinstance(quantity := parameter.quantity, quantities.BoardQuantity)
    }
    reflectances = {
        problem.parameters[row].of: Measured(float(values[row]), float(deviations[row]))
        for row in problem.rows_of(quantities.REFLECTANCE)
    }
    # between the steps of the likelihood the curvature along the scale is that of the prior
    key = quantities.SCALE.key
    shared[key] = replace(shared[key], deviation=min(shared[key].deviation, start.shared[key].deviation))
    return TurntableFit(shared, problem.setting(values)[1], reflectances)


def _problem(scans: Sequence[PlacedScan], room: Room, board: Board, start: TurntableFit) -> Problem:
    parameters: list[Parameter] = []
    placed = []
    for k, (scan, begin_at) in enumerate(zip(scans, start.places, strict=True)):
        for quantity, coordinate in zip((quantities.X, quantities.Y), scan.place.position, strict=True):
            parameters.append(
                Parameter(quantity, "", k, coordinate - _REACH, coordinate + _REACH, coordinate, POSITION_SD, str(k))
            )
        parameters.append(
            Parameter(quantities.HEADING, "", k, begin_at.heading - _TURN, begin_at.heading + _TURN, label=str(k))
        )
        placed.append(replace(scan, place=replace(scan.place, heading=begin_at.heading)))
    begin = {key: measured.value for key, measured in start.shared.items()}
    for shared, deviation in SHARED:
        lower, upper = shared.bounds(room, board)
        expected = None if deviation is None else begin.get(shared.key, shared.value(board))
        expected = expected if expected is None else min(max(expected, lower), upper)
        parameters.append(Parameter(shared, "", None, lower, upper, expected, deviation))
    parameters += _reflectances(room, board)
    problem = make_problem(placed, room, board, parameters, PredictionOptions(), all_echoes=False)
    return problem.with_redundancies(readings_per_independent(scan, board) for scan in scans)


def _reflectances(room: Room, board: Board) -> list[Parameter]:
    """Return the reflectance of each material, with the bounds and the prior that `fit` states."""
    lower, upper = quantities.REFLECTANCE.bounds(room, board)
    deviation = quantities.REFLECTANCE.tolerance(board) if quantities.REFLECTANCE.tolerance else None
    present = {name: quantities.reflectance_of(room, name) for name in quantities.REFLECTANCE.parts(room)}
    return [
        Parameter(quantities.REFLECTANCE, name, None, lower, upper, value, deviation)
        for name, value in present.items()
        if lower <= value <= upper
    ]


def readings_per_independent(scan: PlacedScan, board: Board) -> float:
    """Return the number of readings per independent reading of a scan, without the carrier's own body."""
    return mean_run(*angles_and_ranges(without_own_body(board.own_body, scan.readings)))


def spreads(
    scans: Sequence[PlacedScan], room: Room, board: Board, places: Sequence[Place], tick: Callable[[], None]
) -> tuple[Measured, Measured]:
    """Return the spreads of range, m, and threshold, dB, of readings, with board and poses (actual headings) given."""
    tick()
    board = replace(board, home_angle_deg=0.0)
    placed = [replace(scan, place=place) for scan, place in zip(scans, places, strict=True)]
    # a fit needs a free quantity; it stays at its value
    fixed = (Parameter(quantities.OFFSET, "", None, *quantities.OFFSET.bounds(room, board)),)
    problem = make_problem(placed, room, board, fixed, PredictionOptions(), all_echoes=False)
    problem = problem.with_redundancies(readings_per_independent(scan, board) for scan in scans)
    movable = np.append(False, np.ones(len(problem.noises), np.bool_))
    objective = problem.near(problem.start())
    values = _top(objective, problem.start(), movable)
    logarithms = values[1:]
    deviations: FloatArray = np.sqrt(np.diag(covariance_of(objective, values)))[1:]
    return tuple(
        Measured(math.exp(logarithms[row]), math.exp(logarithms[row]) * float(deviations[row]))
        for row in (_RANGE, _LEVEL)
    )  # type: ignore[return-value]


def _top(objective: Objective, values: FloatArray, movable: BoolArray) -> FloatArray:
    """Return the values at the maximum of an objective near `values`; only those `movable` (size,) change.

    One climb may end in a corner of the bounds, where moves along its directions change nothing. The next climb has
    directions of its own.
    """
    for _ in range(_CLIMBS):
        before, values = values, climb(objective, values, movable)
        if objective(values) - objective(before) < _GAIN:
            break
    return values


# Reflectances of a room that a calibration finds: their intervals, the room with them, and its text.


_LEAST_HALF = 0.005  # of an interval; one at a bound has no curvature


def reflectances_of(room: Room, fitted: TurntableFit) -> tuple[CalibratedValue, ...]:
    """Return the reflectances that scans give, with 95 % intervals; `before` is the value of the room file."""
    findings = []
    for material, measured in fitted.reflectances.items():
        value, half = measured.value, max(Z95 * measured.deviation, _LEAST_HALF)
        before = quantities.reflectance_of(room, material)
        findings.append(CalibratedValue(material, value, value - half, min(value + half, 1.0), before, ""))
    return tuple(findings)


def with_reflectances(room: Room, reflectances: Sequence[CalibratedValue]) -> Room:
    """Return the room with these reflectances, also in its text. Raises InputError if there are none."""
    if not reflectances:
        raise InputError(
            f"room {room.name!r}: no material has a reflectance that scans can change; "
            "expected one from 0.2 to 1, without a table"
        )
    return quantities.REFLECTANCE.write(
        room, {reflectance.key: float(reflectance.text) for reflectance in reflectances}
    )


def gained_by_reflection(before: Room, after: Room) -> float:
    """Return how much louder one reflection is in a room with other reflectances, dB: the mean along its walls."""
    count = len(before.walls)
    old, new = (np.hypot(room.reflectances, room.scattered)[:count] for room in (before, after))
    lengths = np.hypot(*(before.walls[:, 2:] - before.walls[:, :2]).T) * (old > 0)
    if not lengths.any():
        return 0.0
    return float(np.average(20 * np.log10(np.where(old > 0, new / np.maximum(old, 1e-9), 1.0)), weights=lengths))


def is_contradicted(reflectance: CalibratedValue) -> bool:
    """Return whether the value of the room file is outside the 95 % interval of the scans."""
    return not reflectance.low <= reflectance.before <= reflectance.high


def reflectance_text(reflectance: CalibratedValue) -> str:
    """Return material, reflectance, interval, and the value of the room file, in words."""
    name = harmless(reflectance.key)
    value = f"reflectance of {name!r}: {reflectance.text}, 95 % {reflectance.interval_text}"
    return f"{value}; the room file says {reflectance.before:g}"


_UNITS = {"range_offset": "m", "clock_error": "", "turntable_scale": "", "axis_x": "m", "axis_y": "m"}
# standard deviations: 95 % confidence in the five values of the geometry together (Bonferroni's inequality), so that
# none of five changes by chance alone
_CONTRADICTED = 2.58
_SAME_ZERO = math.radians(10.0)  # most difference of the zero between logs, up to which it belongs to the board
_FEWEST_SCANS = 3  # for the rule to be sure
_FEWEST_PLACES = 3  # of which one can be left out
_LONE_RUN = 3  # neighbouring readings, at least, that are proposed as own body if there is only one place


@dataclass(kw_only=True)
class RoomCalibration(Calibration):
    """The calibration of a board in a known room."""

    scans: Sequence[PlacedScan]
    given: Room
    room: Room  # to which the profile belongs: the given one, or with the reflectances found
    reflectances: tuple[CalibratedValue, ...] = ()  # of the materials, by these scans
    before: tuple[Comparison, ...] = ()  # of the scans, with the profile `start`
    after: tuple[Comparison, ...] = ()
    # what each value would be without one place, by key and place; for values that all places together change
    without_places: dict[str, dict[str, Measured]] = field(default_factory=dict)

    @property
    def contradictions(self) -> list[str]:
        """The reflectances of the room file that the scans contradict, if the profile belongs to the room file."""
        return [
            f"room {self.room.name!r}: the scans contradict the reflectance {finding.before:g} of {finding.key!r}: "
            f"{finding.interval_text}"
            for finding in self.reflectances
            if self.room is self.given and is_contradicted(finding)
        ]

    def lines(self) -> list[str]:
        """Return what was found, what stays and why, and how well the scans are explained, in words."""
        used = "not used; the profile belongs to the room file"
        if self.room is not self.given:
            used = "used, and written with the room"
        return [
            *super().lines(),
            *(
                f"{key} without {place}: {measured.value:.4g} ± {Z95 * measured.deviation:.2g} {_UNITS[key]}".rstrip()
                for key, by_place in self.without_places.items()
                for place, measured in by_place.items()
            ),
            *(f"{reflectance_text(reflectance)}; {used}" for reflectance in self.reflectances),
            *(
                f"{scan.name}: {when} {_explained(comparison)}"
                for scan, *both in zip(self.scans, self.before, self.after, strict=True)
                for when, comparison in zip(("before", "after"), both, strict=True)
            ),
        ]

    def own_body_lines(self) -> list[str]:
        """Return the parts of the own body, and how many readings of it are left out, in words."""
        own = int(sum((~comparison.of_room).sum() for comparison in self.after))
        left_out = [f"own body: {counted(own, 'reading')} left out"] if self.own_body else []
        return [*super().own_body_lines(), *left_out]

    def figures(self) -> dict[str, Any]:
        """Return the same, as for JSON."""
        scans = zip(self.scans, self.before, self.after, strict=True)
        return super().figures() | {
            "reflectances": [reflectance.figures for reflectance in self.reflectances],
            "room_is_changed": self.room is not self.given,
            "without_places": {
                key: {place: asdict(measured) for place, measured in by_place.items()}
                for key, by_place in self.without_places.items()
            },
            "scans": [
                {"name": scan.name, "before": asdict(before.summary()), "after": asdict(after.summary())}
                for scan, before, after in scans
            ],
        }

    def room_with_header(self, profile: str) -> Room:
        """Return the room with a header that names the `profile` to which it belongs, and the scans."""
        header = [
            f"# Reflectances found by `sonarhw calibrate`, together with board profile {harmless(profile)!r}. "
            "All else is as before.",
            *(
                f"#   {reflectance_text(reflectance).replace('the room file says', 'before:')}"
                for reflectance in self.reflectances
            ),
            f"#   from {', '.join(harmless(scan.title) for scan in self.scans)}",
        ]
        return parse_room("\n".join([*header, self.room.text]), f"room {self.room.name!r}")


def calibrate_in_room(
    start: Board,
    scans: Sequence[PlacedScan],
    room: Room,
    progress: Progress = lambda _share, _doing: None,
    *,
    reflectances: bool = False,
) -> RoomCalibration:
    """Return the calibration of a board from scans of a known room, beginning with the profile `start`.

    The place of each scan is right within some 3 cm. Headings of the places are searched in the full circle. With
    `reflectances`, the room of the result has those that the scans give. Raises InputError for a ring of sensors, a
    scan without an echo, or a scan that is given twice; with `reflectances`, also if the scans have no silence, or if
    the room has no reflectance to find.
    """
    _check(start, scans, reflectances)
    progress(0.0, "searching headings")
    search = StartingSearch(scans, room, start)
    first = search.turntable(range(len(scans)), lambda share: progress(0.25 * share, "searching headings"))
    scale = first.shared[quantities.SCALE.key].value
    calibration = RoomCalibration(start, replace(start, turntable_scale=scale), scans=scans, given=room, room=room)
    calibration.before = _compared(calibration, start)
    _find_own_body(calibration, first)
    searches = iter(range(1000))
    fitted = fit_turntable(
        scans,
        room,
        calibration.board,
        first,
        lambda: progress(min(0.25 + 0.06 * next(searches), 0.5), "fitting geometry"),
    )
    calibration.reflectances = reflectances_of(room, fitted)
    if reflectances:
        _reflect_as_found(calibration)
    _find_geometry(calibration, fitted, lambda share: progress(0.5 + 0.1 * share, "leaving out places"))
    _find_home(calibration, fitted)
    _find_detection(
        calibration, fitted.places, lambda share: progress(0.6 + 0.25 * share, "choosing threshold and aperture")
    )
    _find_spreads(calibration, fitted.places, lambda: progress(0.87, "finding spreads"))
    progress(0.93, "comparing")
    calibration.after = _compared(calibration, calibration.board)
    progress(1.0, "comparing")
    if len(scans) < _FEWEST_SCANS:
        calibration.doubts.append(
            f"{counted(len(scans), 'scan')}: values may be those of this place alone; "
            f"expected at least {_FEWEST_SCANS} places"
        )
    calibration.doubts += [f"{doubt}; calibrate its reflectances, too" for doubt in calibration.contradictions]
    calibration.header = _header(calibration)
    return calibration


def _check(start: Board, scans: Sequence[PlacedScan], reflectances: bool) -> None:
    """Raise InputError if no calibration is possible with this board and these scans."""
    if start.ring is not None:
        raise InputError(f"board {start.name!r} is a ring of sensors and has no turntable to calibrate")
    check_given_once(scans)
    for scan in scans:
        if all(reading.range is None for reading in scan.readings):
            raise InputError(f"{scan.title}: no reading has an echo; it cannot calibrate a board")
    if reflectances and all(reading.range is not None for scan in scans for reading in scan.readings):
        raise InputError("the logs have no silence, so they determine no reflectance; calibrate the board only")


def _compared(calibration: RoomCalibration, board: Board) -> tuple[Comparison, ...]:
    """Return each scan beside its prediction, with heading, offset and position within 3 cm as fit it best."""
    comparisons = []
    for scan in calibration.scans:
        fit = fit_scan(scan.readings, calibration.room, scan.place, board, frozenset({"heading", "offset", "position"}))
        comparisons.append(compare_readings(scan.readings, calibration.room, fit.place, board, offset=fit.offset))
    return tuple(comparisons)


def _explained(comparison: Comparison) -> str:
    """Return how well a profile explains a scan at its pose, echoes within 5 cm and silence, in words."""
    summary = comparison.summary()
    share = "no echo" if summary.within_5cm is None else f"{summary.within_5cm:.0%} of the echoes within 5 cm"
    agreement = summary.no_echo_agreement
    return share if agreement is None else f"{share}, balanced accuracy of silence {agreement:.3f}"


def _header(calibration: RoomCalibration) -> list[str]:
    """Return the header of the profile, which names the room and the scans."""
    keys = [finding.key for finding in calibration.findings] + (["own_body"] if calibration.own_body else [])
    which = "as in its file" if calibration.room is calibration.given else "with these reflectances"
    header = [
        f"# Calibrated by `sonarhw calibrate` in room {harmless(calibration.given.name)!r}, beginning with profile "
        f"{calibration.start.name!r}: {', '.join(keys)}.",
        "# Threshold and aperture: most echoes within 5 cm, counted three times, and silence, counted once.",
        "# Spreads are those of readings, as they are in the logs.",
        f"# The profile belongs to the room {which}. The scans give:",
        *(f"#   {reflectance_text(reflectance)}" for reflectance in calibration.reflectances),
    ]
    for scan, after in zip(calibration.scans, calibration.after, strict=True):
        x, y = scan.place.position
        header.append(f"#   {harmless(scan.title)}: at {x:g}, {y:g} m; {_explained(after)}")
    return header


def _find_own_body(calibration: RoomCalibration, first: TurntableFit) -> None:
    """Find the carrier's body among the echoes that the room does not explain, and apply it."""
    board = replace(calibration.start, own_body=(), turntable_scale=first.shared[quantities.SCALE.key].value)
    compared = [
        compare_readings(scan.readings, calibration.room, place, board)
        for scan, place in zip(calibration.scans, first.places, strict=True)
    ]
    if place_numbers([scan.place.position for scan in calibration.scans]).max() == 0:
        calibration.kept["own_body"] = "all logs are from one place; scan from another place"
        calibration.doubts += _lone_runs(compared)
        return
    unexplained = [[row.reading for row in comparison.rows if row.path is None] for comparison in compared]
    calibration.own_body = find_own_body(
        [replace(scan, readings=readings) for scan, readings in zip(calibration.scans, unexplained, strict=True)]
    )
    if calibration.own_body:
        calibration.board = replace(calibration.board, own_body=calibration.own_body)
    elif calibration.start.own_body:
        calibration.kept["own_body"] = "no other echoes have the same turntable angle and range at all places"


def _lone_runs(compared: Sequence[Comparison]) -> list[str]:
    """Return runs of echoes that are nearer than all that the room can give, of the first scan, in words."""
    rows = [row for row in compared[0].rows if row.kind in (Kind.SHORT, Kind.EXTRA) and row.path is None]
    nearest = float(np.nanmin(compared[0].prediction.ranges, initial=math.inf))
    near = np.array([row.index for row in rows if row.measured is not None and row.measured < nearest], dtype=np.intp)
    lines = []
    for run in np.split(near, np.flatnonzero(np.diff(near) > 1) + 1):
        if len(run) >= _LONE_RUN:
            angles, ranges = angles_and_ranges([compared[0].rows[k].reading for k in run])
            first, last = np.degrees((angles.min(), angles.max()))
            lines.append(
                f"echoes at turntable angles {first:.0f} to {last:.0f} degrees, {ranges.min():.2f} to "
                f"{ranges.max():.2f} m, are nearer than anything in the room: perhaps own body; scan from another place"
            )
    return lines


def _reflect_as_found(calibration: RoomCalibration) -> None:
    """Give the room the reflectances found, and move the threshold with the level of one reflection.

    This level is what profile and room file state together. It stays until the scans contradict it, by the rule for
    threshold and aperture. Echoes with more reflections determine the reflectances.
    """
    calibration.room = with_reflectances(calibration.given, calibration.reflectances)
    moved = calibration.board.threshold_db + gained_by_reflection(calibration.given, calibration.room)
    calibration.board = replace(calibration.board, threshold_db=min(moved, 0.0))


def _find_geometry(calibration: RoomCalibration, fitted: TurntableFit, tick: Callable[[float], None]) -> None:
    """Add what the scans show to be other than before, without any one place too; the rest stays."""
    changed = []
    for key, unit in _UNITS.items():
        measured, before = fitted.shared[key], float(getattr(calibration.start, key))
        if abs(measured.value - before) > _CONTRADICTED * measured.deviation:
            changed.append(key)
        else:
            half = f"{measured.value:.2g} ± {_CONTRADICTED * measured.deviation:.2g} {unit}".rstrip()
            calibration.kept[key] = f"the scans do not contradict it (99 %: {half})"
    without = _without_places(calibration, tick) if changed else {}
    calibration.without_places = {
        key: {place: fit.shared[key] for place, fit in without.items()} for key in changed if without
    }
    for key in changed:
        measured, before = fitted.shared[key], float(getattr(calibration.start, key))
        by_place = calibration.without_places.get(key, {})
        against = [place for place, other in by_place.items() if not _is_changed(other, before, measured.value)]
        if against:
            other = by_place[against[0]]
            calibration.kept[key] = (
                f"{measured.value:.4g} by all scans, but without {against[0]} they do not contradict it "
                f"({other.value:.4g} ± {Z95 * other.deviation:.2g} {_UNITS[key]}".rstrip()
                + ")"
            )
        else:
            calibration.add_measured(key, measured, _UNITS[key])
    stays = {key: float(getattr(calibration.start, key)) for key in _UNITS if key in calibration.kept}
    calibration.board = calibration.board.with_numbers(stays)
    calibration.kept["mount.ahead"] = "only its sum with range_offset shows in a room; measure it with a ruler"


def _is_changed(measured: Measured, before: float, value: float) -> bool:
    """Return whether a value is other than before at 95 % confidence, in the direction of another `value`."""
    away = (measured.value - before) * math.copysign(1.0, value - before)
    return away > Z95 * measured.deviation


def _without_places(calibration: RoomCalibration, tick: Callable[[float], None]) -> dict[str, TurntableFit]:
    """Return what the scans show without those of each place, by the place; empty from fewer than three places."""
    numbers = place_numbers([scan.place.position for scan in calibration.scans])
    places = np.unique(numbers).tolist()
    if len(places) < _FEWEST_PLACES:
        return {}
    start = replace(calibration.start, own_body=calibration.board.own_body)
    search = StartingSearch(calibration.scans, calibration.room, start)
    fits = {}
    for done, number in enumerate(places):
        tick(done / len(places))
        others = np.flatnonzero(numbers != number).tolist()
        scans = [calibration.scans[other] for other in others]
        first = search.turntable(others, lambda _share: None)
        board = replace(calibration.board, turntable_scale=first.shared[quantities.SCALE.key].value)
        left_out = calibration.scans[numbers.tolist().index(number)].place
        name = left_out.name or f"{left_out.position[0]:g},{left_out.position[1]:g}"
        fits[name] = fit_turntable(scans, calibration.room, board, first, lambda: None)
    return fits


def _find_home(calibration: RoomCalibration, fitted: TurntableFit) -> None:
    """Add the direction of the zero, if it is the same in all logs."""
    turns = np.array(
        [
            math.remainder(place.heading - scan.place.heading, math.tau)
            for scan, place in zip(calibration.scans, fitted.places, strict=True)
        ]
    )
    middle = float(np.angle(np.exp(1j * turns).mean()))
    away = np.angle(np.exp(1j * (turns - middle)))
    if np.abs(away).max() > _SAME_ZERO:
        calibration.kept["home_angle_deg"] = (
            f"the zero differs by up to {math.degrees(float(np.ptp(away))):.0f} degrees between the logs; "
            "give the heading of each place"
        )
        return
    # at least the uncertainty of one heading
    spread = max(float(np.std(away, ddof=1)) if len(away) > 1 else 0.0, math.radians(1.0)) / math.sqrt(len(away))
    calibration.add_measured("home_angle_deg", Measured(math.degrees(middle), math.degrees(spread)), "degrees")


def _find_detection(calibration: RoomCalibration, places: Sequence[Place], tick: Callable[[float], None]) -> None:
    """Add threshold and aperture by the rule for echoes and silence; a threshold that no silence bounds stays."""
    redundancy = float(np.mean([readings_per_independent(scan, calibration.board) for scan in calibration.scans]))
    threshold, aperture = choose_detection(
        calibration.scans, calibration.room, calibration.board, places, redundancy, tick
    )
    if threshold is None:
        calibration.kept["threshold_db"] = "the logs have no silence, or no echo"
    else:
        calibration.add("threshold_db", *threshold, "dB")
    calibration.add("aperture_radius", *aperture, "m")


def _find_spreads(calibration: RoomCalibration, places: Sequence[Place], tick: Callable[[], None]) -> None:
    """Add the standard deviations of range and threshold; one that the profile states stays until contradicted."""
    of_range, of_threshold = spreads(calibration.scans, calibration.room, calibration.board, places, tick)
    for key, measured, unit in (("threshold_sd_db", of_threshold, "dB"), ("range_sd", of_range, "m")):
        half, before = Z95 * measured.deviation, float(getattr(calibration.start, key))
        low, high = max(measured.value - half, 0.0), measured.value + half
        # the spread of a population holds until the scans contradict it; 0 states none
        if before and low <= before <= high:
            calibration.kept[key] = f"the 95 % interval of the scans, {low:.2g} to {high:.2g} {unit}, contains it"
        else:
            calibration.add(key, measured.value, low, high, unit)
