"""The burst: spectrum of the echo of a perfect wall straight ahead, around the carrier.

All signals of `board.traces` are complex envelopes around the board's frequency, RATE samples per second. The signal
with its carrier is computed from them at the end.
"""

import cmath
import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.fft import ifft

from sonarhw.readings import FloatArray
from sonarhw_sim.board.profile import Board
from sonarhw_sim.board.transducer import ComplexArray

RATE = 200_000.0  # Hz
_BAND = 60_000.0  # Hz to each side of the carrier; a transducer that rises over some cycles passes nothing beyond
_DECAY = 12.0  # time constants after which the transducer has decayed to 10⁻⁴
_FINER = 16  # steps between samples at which the peak of a burst is searched


@dataclass(frozen=True)
class Burst:
    """The echo of a perfect wall straight ahead, with a peak of 1."""

    spectrum: ComplexArray  # (k,): a sample is the sum of all components, each turned by its frequency
    lowest: float  # Hz above the carrier, of the first component; the spacing is RATE / length
    length: int  # samples of a pulse, with the delay across the face
    lead: int  # samples before its arrival: one rim of the face is nearer than its centre

    @property
    def frequencies(self) -> FloatArray:
        """Frequencies of the components above the carrier, (k,) float, Hz."""
        return self.lowest + np.arange(len(self.spectrum)) * RATE / self.length

    @property
    def samples(self) -> ComplexArray:
        """The echo, starting `lead` samples before its arrival, (length,) complex."""
        bins = np.zeros(self.length, dtype=np.complex128)
        rows = np.round(self.frequencies * self.length / RATE).astype(np.intp)
        bins[rows] = self.spectrum * np.exp(-1j * math.tau * self.frequencies * self.lead / RATE)
        return np.asarray(ifft(bins, norm="forward"))


def covered_by_burst(board: Board, speed_of_sound: float) -> float:
    """Return by how much the lengths of paths differ that a board receives at one instant, m."""
    return speed_of_sound * sum(tone.cycles / tone.frequency for tone in board.burst)


@lru_cache(maxsize=16)
def burst_of(board: Board, speed_of_sound: float) -> Burst:
    """Return the burst of a board in air with this speed of sound, m/s."""
    lead = math.ceil(2 * board.aperture_radius / speed_of_sound * RATE) + 2
    lasting = sum(tone.cycles / tone.frequency for tone in board.burst) + _DECAY * max(_rise(board), _ring(board))
    length = 1 << (2 * lead + math.ceil(lasting * RATE) - 1).bit_length()
    reach = int(_BAND / RATE * length)
    frequencies = np.arange(-reach, reach + 1) * RATE / length
    spectrum = burst_spectrum(frequencies, board) * RATE / length
    spectrum.flags.writeable = False
    burst = Burst(spectrum, float(frequencies[0]), length, lead)
    finer = np.zeros(length * _FINER, dtype=np.complex128)
    finer[np.arange(-reach, reach + 1)] = spectrum
    peak = float(np.abs(ifft(finer, norm="forward")).max())
    return Burst(spectrum / peak, burst.lowest, length, lead)


def _rise(board: Board) -> float:
    return board.rise_cycles / board.frequency


def _ring(board: Board) -> float:
    return (board.ring_cycles or board.rise_cycles) / board.frequency


def burst_spectrum(frequencies: FloatArray, board: Board) -> ComplexArray:
    """Return the Fourier transform of the echo straight ahead at `frequencies` (Hz above the carrier), same shape.

    Each tone is a rectangle in time, with continuous phase from tone to tone. The transducer rises and decays like a
    resonance around the carrier, 1/(1 + 2πifτ), once as sender and once as receiver. With `ring_cycles`, the sender
    decays with a time constant of its own: its circuit damps it while it drives it, and not afterwards.
    """
    turns, rise, ring = 1j * math.tau * frequencies, _rise(board), _ring(board)
    driven = np.zeros(frequencies.shape, dtype=np.complex128)
    begin, phase, swing = 0.0, 0.0, 0.0 + 0.0j
    for tone in board.burst:
        lasting, above = tone.cycles / tone.frequency, tone.frequency - board.frequency
        middle = cmath.exp(1j * (phase + math.pi * above * lasting))
        shape = np.sinc((frequencies - above) * lasting)
        driven += lasting * middle * shape * np.exp(-turns * (begin + lasting / 2))
        # the vibration at the end of this tone
        kept, steady = math.exp(-lasting / rise), cmath.exp(1j * phase) / (1 + 1j * math.tau * above * rise)
        swing = swing * kept + steady * (cmath.exp(1j * math.tau * above * lasting) - kept)
        begin, phase = begin + lasting, phase + math.tau * above * lasting
    sent = driven / (1 + turns * rise)
    if ring != rise:
        sent += swing * np.exp(-turns * begin) * (ring / (1 + turns * ring) - rise / (1 + turns * rise))
    return np.asarray(sent / (1 + turns * rise))
