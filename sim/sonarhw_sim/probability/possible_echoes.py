"""The echoes that one ping at one heading could report, each with its probability of detection.

Sound of one burst meets one threshold, which is normally distributed. Every later echo meets a threshold of its own.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr

from sonarhw.readings import FloatArray
from sonarhw_sim.board.burst import RATE, covered_by_burst
from sonarhw_sim.board.profile import Board
from sonarhw_sim.board.receiver import charge_levels
from sonarhw_sim.choices import Receiver
from sonarhw_sim.predict.predicted_scan import PredictedScan

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
    found = []
    while len(audible):
        inside = begins[audible] <= begins[audible[0]] + burst
        group, audible = audible[inside], audible[~inside]
        found.append(_possible_echo(levels[group], lengths[group] / 2, loudest[group].__getitem__, scan.board))
    return found


def _in_signal(scan: PredictedScan, index: int) -> list[PossibleEcho]:
    """Return the echoes of the board's own receiver: each rise of the charge by 3 dB begins one."""
    speed, board, ping = scan.room.air.speed_of_sound, scan.board, scan.ping(index)
    signal = ping.signal(2 * board.max_range / speed)
    levels = np.maximum(charge_levels(signal.samples, board, speed), _least_level(board) - _FALL_DB)
    times = np.arange(len(levels)) / RATE
    # a level is reached between two samples
    distances = np.append(times[0], (times[1:] + times[:-1]) / 2) * speed / 2
    starts = _rises(levels)
    found: list[PossibleEcho] = []
    missed = 1.0
    for begin, end in zip(starts, [*starts[1:], len(levels)], strict=True):
        if missed < _SURE:
            break
        if levels[begin:end].max() < _least_level(board):
            continue

        def path_at(row: int, begin: int = begin) -> int:
            return ping.path_detected(float(times[begin + row]), signal)

        found.append(_possible_echo(levels[begin:end], distances[begin:end], path_at, board))
        missed *= 1.0 - found[-1].probability
    return found


def _least_level(board: Board) -> float:
    return board.threshold_db - _SURELY * board.threshold_sd_db


def _possible_echo(
    levels: FloatArray, distances: FloatArray, path_at: Callable[[int], int], board: Board
) -> PossibleEcho:
    """Return the echo of sound with these levels (k,) dB at successive distances (k,) m."""
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
