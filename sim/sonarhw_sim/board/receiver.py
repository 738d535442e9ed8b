"""The ranging board's own receiver, as in the Polaroid 6500: from the receive signal to echo times.

The rectified receive signal (`sonarhw_sim.board.traces.received`) charges a capacitor that leaks, REC. An echo is
detected when REC is full. A weak echo is therefore detected later than a strong one, and an echo that is too short or
too weak is not detected. While the board is blanked, REC is kept empty: first until the end of blanking or BINH, then
after each echo while BLNK is high.
"""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray
from sonarhw_sim.board.burst import RATE, burst_of
from sonarhw_sim.board.profile import Board
from sonarhw_sim.board.traces import Arrivals, Noise, before_gain, gain_at_samples, pulses, received
from sonarhw_sim.board.transducer import ComplexArray
from sonarhw_sim.choices import Receiver
from sonarhw_sim.compiled import compiled

_FIRST_LISTEN = 0.01  # s; most pings have an echo within this time
_AS_LOUD = 1.0 - 1e-9  # of arrivals that are equally loud, the first is reported
SHARE = 0.1  # of the signal just before a detection: an arrival with less did not cause it


@dataclass(frozen=True)
class ReceivedEchoes:
    """The echoes that the board detects after one ping."""

    times: FloatArray  # (k,), s, true time, earliest first
    winner: int  # row of the loudest arrival just before the first echo; -1: no echo, noise, or the own burst


def detect_echoes(
    arrivals: Arrivals, board: Board, speed_of_sound: float, noise: Noise | None = None
) -> ReceivedEchoes:
    """Return the echoes that the board's own receiver detects up to its maximum range."""
    return _detect_within(2 * board.max_range / speed_of_sound, arrivals, board, speed_of_sound, noise)


def detect_first_echo(
    arrivals: Arrivals, board: Board, speed_of_sound: float, noise: Noise | None = None
) -> ReceivedEchoes:
    """Return what `detect_echoes` returns, at least up to the first echo: a short signal is enough for most pings."""
    whole = 2 * board.max_range / speed_of_sound
    listen = min(_FIRST_LISTEN, whole)
    detected = _detect_within(listen, arrivals, board, speed_of_sound, noise)
    while not len(detected.times) and listen < whole:
        listen = min(2 * listen, whole)
        detected = _detect_within(listen, arrivals, board, speed_of_sound, noise)
    return detected


def _detect_within(
    duration: float, arrivals: Arrivals, board: Board, speed_of_sound: float, noise: Noise | None
) -> ReceivedEchoes:
    samples = received(arrivals, board, speed_of_sound, duration, Receiver.BOARD, noise).samples
    times = echo_times(samples, board, speed_of_sound)
    winner = loudest_before(float(times[0]), samples, arrivals, board, speed_of_sound) if len(times) else -1
    return ReceivedEchoes(times, winner)


def loudest_before(time: float, samples: ComplexArray, arrivals: Arrivals, board: Board, speed_of_sound: float) -> int:
    """Return the loudest arrival while REC last charged, before `time`; -1 if none is loud enough."""
    burst = burst_of(board, speed_of_sound)
    since = time - arrivals.times
    near = np.flatnonzero((since > -burst.lead / RATE) & (since < burst.length / RATE))
    if not len(near):
        return -1
    end = math.ceil(time * RATE) + 1
    begin = max(0, end - max(2, math.ceil(integration_samples(board))))
    candidates = before_gain(arrivals.select(near), board, speed_of_sound, Receiver.BOARD)
    gain = gain_at_samples(len(samples), board, Receiver.BOARD)[:end]
    alone = _sums_between(*pulses(candidates, board, burst, speed_of_sound), gain, begin)
    loudest = int((alone >= alone.max() * _AS_LOUD).argmax())
    return int(near[loudest]) if alone[loudest] >= SHARE * np.abs(samples[begin:end]).sum() else -1


@compiled
def _sums_between(some: ComplexArray, first: NDArray[np.intp], gain: FloatArray, begin: int) -> FloatArray:
    """Return the sum of each pulse, after the gain, from sample `begin` to the end of `gain`, (n,) float."""
    sums = np.zeros(some.shape[0])
    for row in range(some.shape[0]):
        for k in range(max(0, begin - first[row]), min(some.shape[1], gain.shape[0] - first[row])):
            sums[row] += abs(some[row, k]) * gain[first[row] + k]
    return sums


def charge_levels(samples: ComplexArray, board: Board, speed_of_sound: float) -> FloatArray:
    """Return the charge of REC at each sample if it is never full, (n,) dB, as levels are; -inf outside listening.

    The first echo is detected when this level reaches the threshold (`echo_times`).
    """
    opens = board.blanking_end / (1 + board.clock_error) * RATE
    ends = min(2 * board.max_range / speed_of_sound, (len(samples) - 1) / RATE) * RATE
    charges = _charged(np.abs(samples), opens, ends, kept_charge(board)) / charge_of_burst(board, speed_of_sound)
    with np.errstate(divide="ignore"):
        return np.asarray(20 * np.log10(charges))


def echo_times(samples: ComplexArray, board: Board, speed_of_sound: float) -> FloatArray:
    """Return the times at which the board detects echoes, (k,) float, s from the start of transmission, true time.

    `samples` are the complex envelope after the gain, RATE per second. REC follows v′ = (|s|/A − v)/τ and is full at 1.
    A is chosen so that a single wall straight ahead at the threshold just fills REC, so `threshold_db` has the same
    meaning for both receivers.
    """
    # above zero, so that a threshold of -inf detects everything
    full = max(10 ** (board.threshold_db / 20), 1e-300) * charge_of_burst(board, speed_of_sound)
    # blanking ends by the board's own clock
    opens = board.blanking_end / (1 + board.clock_error)
    ends = min(2 * board.max_range / speed_of_sound, (len(samples) - 1) / RATE)
    found = _detect(np.abs(samples) / full, opens * RATE, ends * RATE, board.rearm * RATE, kept_charge(board))
    return np.asarray(found / RATE)


def counted_time(times: FloatArray, board: Board) -> FloatArray:
    """Return true times as the board's clock counts them, s, same shape."""
    return times * (1 + board.clock_error)


def integration_samples(board: Board) -> float:
    """Return τ of the integration, samples."""
    return board.integration_cycles / board.frequency * RATE


@lru_cache(maxsize=16)
def charge_of_burst(board: Board, speed_of_sound: float) -> float:
    """Return the charge of REC by the echo of a perfect wall straight ahead; a continuous signal as loud gives 1."""
    kept, charge, most = kept_charge(board), 0.0, 0.0
    for level in np.abs(burst_of(board, speed_of_sound).samples).tolist():
        charge = kept * charge + (1.0 - kept) * level
        most = max(most, charge)
    return most


def kept_charge(board: Board) -> float:
    """Return the share of its charge that REC keeps from one sample to the next."""
    time_constant = integration_samples(board)
    return math.exp(-1.0 / time_constant) if time_constant > 0.0 else 0.0


@compiled
def _charged(levels: FloatArray, opens: float, ends: float, kept: float) -> FloatArray:
    """Return the charge at each sample between `opens` and `ends`, (n,); 0 at the others."""
    charges = np.zeros(levels.shape[0])
    charge = 0.0
    for k in range(math.ceil(opens), min(levels.shape[0], math.floor(ends) + 1)):
        charge = kept * charge + (1.0 - kept) * levels[k]
        charges[k] = charge
    return charges


@compiled
def _detect(levels: FloatArray, opens: float, ends: float, rearm: float, kept: float) -> FloatArray:
    """Return the sample numbers, with fractions, at which REC is full, (k,) float."""
    found = np.empty(0)
    charge = 0.0
    for k in range(math.ceil(opens), levels.shape[0]):
        # blanked: REC is kept empty
        if k < opens:
            continue
        before, charge = charge, kept * charge + (1.0 - kept) * levels[k]
        if charge < 1.0:
            continue

        # full: between the last sample and this one, but not before blanking ended
        at = max(opens, k - 1 + (1.0 - before) / (charge - before))
        if at > ends:
            break
        found = np.append(found, at)
        opens, charge = at + rearm, 0.0
    return found
