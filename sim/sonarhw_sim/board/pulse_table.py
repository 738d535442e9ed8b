"""Pulses from a table: the echo in any direction is a weighted sum of a few fixed pulses.

The beam delays parts of the sound by at most the way across the face, out and back. Its spectrum is therefore smooth,
and its values at a few frequencies, the nodes, determine it in the whole band. The pulse of a node is what the burst
becomes if the beam is 1 at this node and 0 at the others. With 25 nodes (Polaroid 6500), a pulse is exact to 10⁻⁴ of
the echo straight ahead (`tests/unit/sim/board/test_first_echo.py`).
"""

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.fft import ifft

from sonarhw.readings import FloatArray
from sonarhw_sim.board.burst import RATE, Burst, burst_of
from sonarhw_sim.board.profile import Board
from sonarhw_sim.board.traces import FAINTEST
from sonarhw_sim.board.transducer import ComplexArray, disc_factor
from sonarhw_sim.board.weighing import beam_table

_REACH = 40e3  # Hz to each side of the carrier: bursts have hardly any sound beyond
_MORE = 6  # nodes above the least possible number
_ANGLES = 10  # out and back, with which the table is fitted
_RIDGE = 1e-9  # keeps shares small that no direction determines


class PulseTable(NamedTuple):
    """The pulses of all nodes, and what their weights depend on."""

    nodes: FloatArray  # (q,), Hz above the carrier
    real: FloatArray  # (q, length), the pulse of each node from its first sample on
    imaginary: FloatArray  # (q, length)
    lead: int  # samples before the arrival
    carrier: float  # Hz
    wavenumber: float  # multiplied by a frequency, this is ka
    discs: FloatArray  # the table of 2 J₁(x)/x (`sonarhw_sim.board.weighing`)


@lru_cache(maxsize=16)
def pulse_table(board: Board, speed_of_sound: float) -> PulseTable:
    """Return the pulses of a board in air with this speed of sound, m/s."""
    burst = burst_of(board, speed_of_sound)
    wavenumber = math.tau / speed_of_sound * board.aperture_radius
    # out and back, sound is early or late by up to the radius over the speed of sound
    spread = 4 * board.aperture_radius / speed_of_sound + 1 / RATE
    count = math.ceil(2 * _REACH * spread) + _MORE
    nodes = -_REACH * np.cos(math.pi * (np.arange(count) + 0.5) / count)
    pulses = _pulses(burst, nodes, board.frequency, wavenumber)
    # in other directions, a pulse is fainter and ends at most `lead` later
    length = min(burst.length, int(np.flatnonzero(np.abs(burst.samples) >= FAINTEST)[-1]) + burst.lead)
    highest = wavenumber * (board.frequency + _REACH)
    return PulseTable(
        nodes,
        np.ascontiguousarray(pulses.real[:, :length]),
        np.ascontiguousarray(pulses.imag[:, :length]),
        burst.lead,
        board.frequency,
        wavenumber,
        beam_table(highest),
    )


def _pulses(burst: Burst, nodes: FloatArray, carrier: float, wavenumber: float) -> ComplexArray:
    """Return the pulse of each node, (q, length) complex, fitted to beams of many directions and delays."""
    at_nodes, wanted = (_beams(frequencies, carrier, wavenumber) for frequencies in (nodes, burst.frequencies))
    shares = _least_squares(at_nodes, wanted)
    bins = np.zeros((len(nodes), burst.length), dtype=np.complex128)
    rows = np.round(burst.frequencies * burst.length / RATE).astype(np.intp)
    bins[:, rows] = shares * burst.spectrum * np.exp(-1j * math.tau * burst.frequencies * burst.lead / RATE)
    return np.asarray(ifft(bins, axis=1, norm="forward"))


def _least_squares(matrix: ComplexArray, wanted: ComplexArray) -> ComplexArray:
    """Return x with the least |`matrix` x − `wanted`|² + |`_RIDGE` x|², by modified Gram-Schmidt.

    LAPACK may add in another order on each processor and with each number of threads. Studies promise equal files.
    """
    count, several = matrix.shape[1], wanted.shape[1]
    q = np.concatenate((matrix, _RIDGE * np.eye(count, dtype=np.complex128)))
    rest = np.concatenate((wanted, np.zeros((count, several), dtype=np.complex128)))
    upper = np.zeros((count, count), dtype=np.complex128)
    parts = np.zeros((count, several), dtype=np.complex128)
    for k in range(count):
        upper[k, k] = np.sqrt((np.abs(q[:, k]) ** 2).sum())
        along = q[:, k : k + 1] / upper[k, k]
        upper[k, k + 1 :] = (along.conj() * q[:, k + 1 :]).sum(axis=0)
        q[:, k + 1 :] = q[:, k + 1 :] - along * upper[k, k + 1 :]
        parts[k] = (along.conj() * rest).sum(axis=0)
        rest = np.asarray(rest - along * parts[k])
    found = np.zeros_like(parts)
    for k in reversed(range(count)):
        found[k] = (parts[k] - (upper[k, k + 1 :, None] * found[k + 1 :]).sum(axis=0)) / upper[k, k]
    return found


def _beams(frequencies: FloatArray, carrier: float, wavenumber: float) -> ComplexArray:
    """Return the beam out and back at frequencies (f,) above the carrier, for many directions and delays, (d, f)."""
    sines = np.linspace(0.0, 1.0, _ANGLES)
    once = disc_factor(np.outer(sines, wavenumber * np.abs(carrier + frequencies)))
    out, back = np.triu_indices(_ANGLES)
    later = np.exp(-1j * math.tau * np.outer((0.0, 1 / RATE), frequencies))
    return np.asarray((once[out] * once[back] * later[:, None]).reshape(-1, len(frequencies)))
