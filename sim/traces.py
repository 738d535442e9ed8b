"""Traces: the envelope of the receive signal of one ping, summed over all its echoes with their phase.

Takes a predicted scan and one of its headings; hands on a `Trace`. 1.0 is a perfect wall straight ahead, after the
ideal gain, so the board's threshold lies at 10^(threshold_db / 20).
"""

import math

import numpy as np

from sim.board import Board
from sim.prediction import PredictedScan
from sonarhw.readings import FloatArray, Trace

RATE = 50_000.0  # Hz
RISE_CYCLES = 4.0  # time constant of the transducer's swelling and ringing, in cycles of its carrier
_FAINTEST = 1e-4  # amplitude; echoes below it are lost in any noise
_DYING = 8.0  # time constants after which a pulse is over


def predicted_trace(scan: PredictedScan, index: int, duration: float, rate: float = RATE) -> Trace:
    """The envelope heard at heading `index` of a scan, from the start of transmission for `duration` s."""
    board, air = scan.board, scan.room.air
    samples = np.zeros(max(1, math.ceil(duration * rate)), dtype=np.complex128)
    amplitudes = 10 ** (scan.levels[index] / 20)
    for path in np.flatnonzero(amplitudes > _FAINTEST):
        arrival = scan.paths.lengths[path] / air.speed_of_sound
        _add_pulse(samples, board, rate, float(arrival), float(amplitudes[path]))
    # the board's own burst drives the receiver to its limit until the transducer has rung down
    _add_pulse(samples, board, rate, 0.0, 4.0)
    return Trace(np.minimum(np.abs(samples), 1.0), rate, 0.0)


def pulse_envelope(times: FloatArray, board: Board) -> FloatArray:
    """The transmitted burst's envelope at `times` s after its start, 0..1, same shape: it swells and rings down."""
    burst = board.transmit_cycles / board.frequency
    rise = RISE_CYCLES / board.frequency
    swelling = 1 - np.exp(-np.clip(times, 0, burst) / rise)
    return np.asarray(swelling * np.exp(-np.maximum(times - burst, 0) / rise))


def _add_pulse(samples: np.ndarray, board: Board, rate: float, arrival: float, amplitude: float) -> None:
    lasting = (board.transmit_cycles + _DYING * RISE_CYCLES) / board.frequency
    first = math.ceil(arrival * rate)
    last = min(len(samples), math.ceil((arrival + lasting) * rate))
    if first < last:
        since = np.arange(first, last) / rate - arrival
        phase = np.exp(-1j * math.tau * board.frequency * arrival)
        samples[first:last] += amplitude * phase * pulse_envelope(since, board)
