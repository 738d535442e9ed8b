"""Levels of traces for pictures: envelopes, in dB of full scale."""

import numpy as np
from sonarhw_sim.board.profile import Board

from sonarhw.readings import FloatArray, Trace

_BELOW_THRESHOLD_DB = 12.0  # lower end of level axes; the noise of an 8-bit converter is above it


def floor_of(board: Board) -> float:
    """Return the lower end of level axes, dB of full scale."""
    return board.threshold_db - _BELOW_THRESHOLD_DB


def in_db(amplitudes: FloatArray, floor_db: float) -> FloatArray:
    """Return amplitudes in dB of full scale, at least `floor_db`; NaN stays NaN."""
    return np.asarray(20 * np.log10(np.maximum(np.abs(amplitudes), 10 ** (floor_db / 20))))


def envelope_of(trace: Trace) -> FloatArray:
    """Return the envelope of a trace, (n,) float, 0..1, NaN if lost; of a carrier, that of its analytic signal."""
    if not trace.carrier:
        return trace.samples
    from scipy.fftpack import hilbert  # slow to load; scipy.signal also has it, but takes longer

    lost = np.isnan(trace.samples)
    samples = np.where(lost, 0.0, trace.samples)
    envelope = np.hypot(samples, hilbert(samples))
    return np.where(lost, np.nan, np.minimum(envelope, 1.0))
