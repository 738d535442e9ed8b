"""Traces: the envelope of the receive signal of one ping, summed over all its echoes with their phase.

Takes a predicted scan and one of its headings; hands on a `Trace`. 1.0 is a perfect wall straight ahead, after the
ideal gain, so the board's threshold lies at 10^(threshold_db / 20).
"""

import math

import numpy as np
from numpy.typing import NDArray

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
    amplitudes = 10 ** (scan.levels_at(index) / 20)
    heard = amplitudes > _FAINTEST
    # the board's own burst drives the receiver to its limit until the transducer has rung down
    arrivals = np.append(scan.paths.lengths[heard] / air.speed_of_sound, 0.0)
    strengths = np.append(amplitudes[heard], 4.0)
    samples = _sum_of_pulses(arrivals, strengths, board, rate, max(1, math.ceil(duration * rate)))
    return Trace(np.minimum(np.abs(samples), 1.0), rate, 0.0)


def pulse_envelope(times: FloatArray, board: Board) -> FloatArray:
    """The transmitted burst's envelope at `times` s after its start, 0..1, same shape: it swells and rings down."""
    burst = board.transmit_cycles / board.frequency
    rise = RISE_CYCLES / board.frequency
    swelling = 1 - np.exp(-np.clip(times, 0, burst) / rise)
    return np.asarray(swelling * np.exp(-np.maximum(times - burst, 0) / rise))


def _sum_of_pulses(
    arrivals: FloatArray, amplitudes: FloatArray, board: Board, rate: float, count: int
) -> NDArray[np.complex128]:
    """Complex envelope of all arrivals (s) together, each with the phase its carrier has then, (count,)."""
    lasting = (board.transmit_cycles + _DYING * RISE_CYCLES) / board.frequency
    first = np.ceil(arrivals * rate).astype(np.intp)
    samples = first[:, None] + np.arange(math.ceil(lasting * rate))
    phases = amplitudes * np.exp(-1j * math.tau * board.frequency * arrivals)
    pulses = phases[:, None] * pulse_envelope(samples / rate - arrivals[:, None], board)
    within = samples < count
    real, imaginary = (
        np.bincount(samples[within], weights=part[within], minlength=count) for part in (pulses.real, pulses.imag)
    )
    return np.asarray(real + 1j * imaginary)
