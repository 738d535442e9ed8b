"""The probability of each reading, from the spreads of the board and of the room."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from sonarhw.errors import InputError
from sonarhw.readings import FloatArray
from sonarhw_sim.air import ROOM_TOLERANCE, Model, Receiver
from sonarhw_sim.board.profile import Board
from sonarhw_sim.board.receiver import charge_levels
from sonarhw_sim.board.signal import RATE, covered_by_burst
from sonarhw_sim.predict.predicted_scan import PredictedScan
from sonarhw_sim.predict.prediction import PredictionOptions, predict_along, predict_scan, received_by
from sonarhw_sim.room.room import Place, Room

# The echoes that one ping at one heading could report, each with its probability of detection.
#
# Sound of one burst meets one threshold, which is normally distributed. Every later echo meets a threshold of its
# own.


_SURELY = 5.5  # standard deviations; a threshold is hardly ever (2e-8) so far from its mean
_SURE = 1e-8  # probability of missing all echoes so far, below which later ones do not matter
_FALL_DB = 3.0  # by so much the signal falls and rises between two echoes


@dataclass(frozen=True)
class PossibleEcho:
    """An echo that a ping may report."""

    probability: float  # of its detection, if no earlier echo is detected
    distance: float  # m, expected range, without clock error, offset and rounding
    spread: float  # m, standard deviation of the range, because louder sound is detected earlier
    path: int  # row in the scan's paths; -1: the own burst


def possible_echoes(scan: PredictedScan, index: int) -> tuple[PossibleEcho, ...]:
    """Return the echoes that a ping at heading `index` may report, earliest first."""
    if not scan.board.threshold_sd_db:
        return _certain(scan, index)
    if scan.receiver is Receiver.BOARD:
        return tuple(_in_signal(scan, index))
    return tuple(_among_arrivals(scan, index))


def _certain(scan: PredictedScan, index: int) -> tuple[PossibleEcho, ...]:
    distance = float(scan.distances[index])
    return () if np.isnan(distance) else (PossibleEcho(1.0, distance, 0.0, int(scan.winners[index])),)


def _among_arrivals(scan: PredictedScan, index: int) -> list[PossibleEcho]:
    """Return the echoes of the paper's receiver: arrivals within one burst are one echo."""
    ping, begins = scan.ping(index), scan.apparent_lengths
    levels, loudest, lengths = ping.levels, ping.loudest, ping.arrival_lengths
    audible = np.flatnonzero(scan.in_time & (levels >= _least_level(scan.board)))
    audible = audible[np.argsort(begins[audible], kind="stable")]
    burst = covered_by_burst(scan.board, scan.room.air.speed_of_sound)
    possible = []
    while len(audible):
        inside = begins[audible] <= begins[audible[0]] + burst
        group, audible = audible[inside], audible[~inside]
        possible.append(_possible_echo(levels[group], lengths[group] / 2, loudest[group].__getitem__, scan.board))
    return possible


def _in_signal(scan: PredictedScan, index: int) -> list[PossibleEcho]:
    """Return the echoes of the board's own receiver: each rise of the charge by 3 dB begins one."""
    speed, board, ping = scan.room.air.speed_of_sound, scan.board, scan.ping(index)
    signal = ping.signal(2 * board.max_range / speed)
    levels = np.maximum(charge_levels(signal.samples, board, speed), _least_level(board) - _FALL_DB)
    times = np.arange(len(levels)) / RATE
    # a level is reached between two samples
    distances = np.append(times[0], (times[1:] + times[:-1]) / 2) * speed / 2
    starts = _rises(levels)
    possible: list[PossibleEcho] = []
    missed = 1.0
    for begin, end in zip(starts, [*starts[1:], len(levels)], strict=True):
        if missed < _SURE:
            break
        if levels[begin:end].max() < _least_level(board):
            continue

        def path_at(row: int, begin: int = begin) -> int:
            return ping.path_detected(float(times[begin + row]), signal)

        possible.append(_possible_echo(levels[begin:end], distances[begin:end], path_at, board))
        missed *= 1.0 - possible[-1].probability
    return possible


def _least_level(board: Board) -> float:
    return board.threshold_db - _SURELY * board.threshold_sd_db


def _possible_echo(
    levels: FloatArray, distances: FloatArray, path_at: Callable[[int], int], board: Board
) -> PossibleEcho:
    """Return the echo of sound with these levels (k,) dB at successive distances (k,) m."""
    from scipy.special import ndtr  # loads slowly

    reached = ndtr((np.maximum.accumulate(levels) - board.threshold_db) / board.threshold_sd_db)
    probability = float(reached[-1])
    weights = np.diff(reached, prepend=0.0) / probability
    mean = float(weights @ distances)
    spread = float(np.sqrt(weights @ (distances - mean) ** 2))
    middle = int(np.searchsorted(reached, probability / 2))
    return PossibleEcho(probability, mean, spread, int(path_at(middle)))


def _rises(levels: FloatArray) -> list[int]:
    """Return the samples at which rises of at least 3 dB begin, after falls of as much; the first is 0."""
    turns = np.flatnonzero(np.diff(np.sign(np.diff(levels)), prepend=0.0, append=0.0)).tolist()
    starts, high, low = [0], float(levels[0]), 0
    falling = False
    for k in turns:
        level = float(levels[k])
        if not falling:
            high = max(high, level)
            falling, low = level <= high - _FALL_DB, k
        elif level < levels[low]:
            low = k
        elif level >= levels[low] + _FALL_DB:
            starts.append(low)
            high, falling = level, False
    return starts


# The probability of each possible reading: silence, or a range and the path that gives it.
#
# A reading is one ping, or the median of several. The spread of a range has three parts: that of the board
# (`range_sd`), that of a detection that is later if the sound is fainter, and the tolerance of the room, which is the
# same for all pings. Assumed: each reflection or edge changes the range by the tolerance, as for sound perpendicular
# to a wall.


RESOLUTION = 0.01  # m, of ranges in a list of probabilities, unless the board rounds
_SEARCHED = 3.0  # standard deviations of the threshold: by so much fainter paths are searched
_LEAST = 1e-6  # less probable readings are left out
_FAR = 3.5  # standard deviations of a range


@dataclass(frozen=True)
class PossibleReading:
    """A possible reading: silence, or an echo."""

    probability: float
    range: float | None  # m, expected, with the board's offset and before rounding; None: silence
    spread: float  # m, standard deviation of the range
    path: int  # row in the scan's paths; -1: none


def scan_with_fainter_paths(
    room: Room,
    place: Place | Sequence[Place],
    board: Board,
    headings: FloatArray,
    options: PredictionOptions | None = None,
) -> PredictedScan:
    """Return the scan of `predict_scan`, with the paths that a threshold lower by 3 standard deviations detects.

    `place` is that of all headings, or of each.
    """
    options = options or PredictionOptions()
    fainter = replace(board, threshold_db=board.threshold_db - _SEARCHED * board.threshold_sd_db)
    if isinstance(place, Place):
        scan = predict_scan(room, place, fainter, headings, options)
    else:
        scan = predict_along(Model.RAY_FOLLOWING, room, place, fainter, headings, options)
    return received_by(replace(scan, board=board), options) if board.threshold_sd_db else scan


def possible_readings(
    scan: PredictedScan, index: int, pings: int = 1, room_tolerance: float = ROOM_TOLERANCE
) -> tuple[PossibleReading, ...]:
    """Return the possible readings at heading `index`, nearest first and silence last; the probabilities add up to 1.

    A reading is the median of an odd number of `pings`; silent pings count as the farthest. `room_tolerance` (m) is the
    standard deviation of the position of each wall. `scan` is that of `scan_with_fainter_paths`. Raises InputError if
    the number of pings is not odd.
    """
    check_pings(pings)
    echoes = possible_echoes(scan, index)
    heard = np.array([echo.probability for echo in echoes])
    missed = np.cumprod(np.append(1.0, 1.0 - heard))
    chances = median_chances(np.append(heard * missed[:-1], missed[-1]), pings)
    touched = scan.paths.bounces + (scan.paths.edges >= 0)
    ranges = np.maximum(scan.board.unrounded(np.array([echo.distance for echo in echoes])), 0.0)
    outcomes = []
    for echo, distance, chance in zip(echoes, ranges.tolist(), chances[:-1].tolist(), strict=True):
        if chance < _LEAST:
            continue
        contacts = int(touched[echo.path]) if echo.path >= 0 else 0
        of_pings = median_spread(pings) * math.hypot(scan.board.range_sd, echo.spread)
        spread = math.hypot(of_pings, room_tolerance * math.sqrt(contacts))
        outcomes.append(PossibleReading(chance, distance, spread, echo.path))
    silence = float(chances[-1])
    outcomes.append(PossibleReading(silence if silence >= _LEAST else 0.0, None, 0.0, -1))
    total = sum(outcome.probability for outcome in outcomes)
    return tuple(replace(outcome, probability=outcome.probability / total) for outcome in outcomes)


def check_pings(pings: int) -> None:
    """Raise InputError unless the median of this number of pings is one of them."""
    if pings < 1 or pings % 2 == 0:
        raise InputError(f"pings {pings}: expected an odd number, so that the median is one of the ranges")


def median_chances(chances: FloatArray, pings: int) -> FloatArray:
    """Return the probability that each of several ordered outcomes is the median of an odd number of pings, same shape.

    `chances` (n,) are those of one ping. At least half of the pings lie at or before the median (order statistics).
    """
    if pings == 1:
        return chances
    until = np.minimum(np.cumsum(chances), 1.0)
    until[-1] = 1.0
    from scipy.special import bdtrc  # loads slowly

    return np.diff(bdtrc(pings // 2, pings, until), prepend=0.0)


@lru_cache
def median_spread(pings: int) -> float:
    """Return the standard deviation of the median of an odd number of standard normal values."""
    half = (pings + 1) // 2
    levels = (np.arange(2000) + 0.5) / 2000
    # the median of uniform values has a beta distribution
    from scipy.special import betaincinv, ndtri  # loads slowly

    return 1.0 if pings == 1 else math.sqrt(float(np.mean(ndtri(betaincinv(half, half, levels)) ** 2)))


def range_chances(outcome: PossibleReading, board: Board) -> Iterator[tuple[float | None, float]]:
    """Yield ranges that the board may report for an outcome, m (None: silence), with their probabilities.

    They are whole multiples of the board's rounding, or of 1 cm; one range without a spread.
    """
    if outcome.range is None or not outcome.spread:
        rounded = None if outcome.range is None else _multiple(outcome.range, board.rounding)
        yield rounded, outcome.probability
        return
    step = board.rounding or RESOLUTION
    first = max(0, round((outcome.range - _FAR * outcome.spread) / step))
    last = max(first, round((outcome.range + _FAR * outcome.spread) / step))
    edges = (np.arange(first, last + 2) - 0.5) * step
    from scipy.special import ndtr  # loads slowly

    masses = np.diff(ndtr((edges - outcome.range) / outcome.spread))
    for number, mass in zip(range(first, last + 1), (masses / masses.sum()).tolist(), strict=True):
        yield number * step, outcome.probability * mass


def _multiple(distance: float, step: float) -> float:
    return round(distance / step) * step if step else distance
