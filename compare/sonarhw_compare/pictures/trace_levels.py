"""Levels of traces as they are drawn: envelopes, in dB of full scale."""

import numpy as np
from scipy.fftpack import hilbert  # scipy.signal has it too, but takes half a second to load
from sonarhw_sim.board.profile import Board

from sonarhw.readings import FloatArray, Trace

_BELOW_THRESHOLD_DB = 12.0  # level axes end there; the noise of a converter of 8 bits lies above


def floor_of(board: Board) -> float:
    """Where the level axes end, dB of full scale."""
    return board.threshold_db - _BELOW_THRESHOLD_DB


def in_db(amplitudes: FloatArray, floor_db: float) -> FloatArray:
    """Amplitudes in dB of full scale, none under `floor_db`; NaN stays NaN."""
    return np.asarray(20 * np.log10(np.maximum(np.abs(amplitudes), 10 ** (floor_db / 20))))


def envelope_of(trace: Trace) -> FloatArray:
    """The envelope of a trace, (n,) float, 0..1; of a carrier the length of its analytic signal. NaN where lost."""
    if not trace.carrier:
        return trace.samples
    lost = np.isnan(trace.samples)
    samples = np.where(lost, 0.0, trace.samples)
    envelope = np.hypot(samples, hilbert(samples))
    return np.where(lost, np.nan, np.minimum(envelope, 1.0))
