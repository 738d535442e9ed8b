"""The burst: what one echo straight ahead looks like to the receiver, as a spectrum round the carrier.

Takes a board; hands on a `Burst`. All signals of `board.traces` are complex envelopes round the board's frequency, RATE
samples a second, from which the signal with its carrier is made at the end.
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
_BAND = 60_000.0  # Hz to each side of the carrier; a transducer that swells over some cycles passes nothing beyond
_DYING = 12.0  # time constants after which the transducer has rung down to 10⁻⁴
_FINER = 16  # steps between samples in which the peak of a burst is sought


@dataclass(frozen=True)
class Burst:
    """The echo of a perfect wall straight ahead, 1 at its loudest."""

    spectrum: ComplexArray  # (k,): a sample is their sum, each turned by its frequency
    lowest: float  # Hz above the carrier, of the first; the others follow at RATE / length
    length: int  # samples a pulse lasts, with all that the width of the face adds
    lead: int  # of these, before its arrival: one rim of the face is nearer than its middle

    @property
    def frequencies(self) -> FloatArray:
        """Hz above the carrier, (k,) float."""
        return self.lowest + np.arange(len(self.spectrum)) * RATE / self.length

    @property
    def samples(self) -> ComplexArray:
        """The echo from `lead` samples before its arrival on, (length,) complex."""
        bins = np.zeros(self.length, dtype=np.complex128)
        rows = np.round(self.frequencies * self.length / RATE).astype(np.intp)
        bins[rows] = self.spectrum * np.exp(-1j * math.tau * self.frequencies * self.lead / RATE)
        return np.asarray(ifft(bins, norm="forward"))


@lru_cache(maxsize=16)
def burst_of(board: Board, speed_of_sound: float) -> Burst:
    """The burst of a board in air of that speed of sound, m/s."""
    lead = math.ceil(2 * board.aperture_radius / speed_of_sound * RATE) + 2
    lasting = sum(tone.cycles / tone.frequency for tone in board.burst) + _DYING * _rise(board)
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


def burst_spectrum(frequencies: FloatArray, board: Board) -> ComplexArray:
    """Fourier transform of what is sent and heard straight ahead, at `frequencies` (Hz above the carrier), same shape.

    Each tone is a rectangle in time, its phase going on where the last one's ended. The transducer swells and rings as
    a resonance seen from its carrier does, by 1/(1 + 2πifτ), once sending and once hearing.
    """
    sent = np.zeros(frequencies.shape, dtype=np.complex128)
    begin, phase = 0.0, 0.0
    for tone in board.burst:
        lasting, above = tone.cycles / tone.frequency, tone.frequency - board.frequency
        middle = cmath.exp(1j * (phase + math.pi * above * lasting))
        shape = np.sinc((frequencies - above) * lasting)
        sent += lasting * middle * shape * np.exp(-1j * math.tau * frequencies * (begin + lasting / 2))
        begin, phase = begin + lasting, phase + math.tau * above * lasting
    return np.asarray(sent / (1 + 1j * math.tau * frequencies * _rise(board)) ** 2)
