"""Traces: the receive signal of one ping, summed over all its echoes with their phase.

Takes arrivals as plain arrays, a board, the speed of sound; hands on a `Signal`: from it the signal with its carrier at
any rate, the same as a slow converter of 8 bits sees it, and its envelope. 1.0 is a perfect wall straight ahead after
the ideal gain, so the board's threshold lies at 10^(threshold_db / 20); beyond it the receiver is at its limit.

Every echo is the burst, convolved by h_R at its angle of departure and at that of arrival. Convolution with h_R is a
product of spectra, and the spectrum of h_R is 2 J₁(x)/x cos α: so an echo is made in a short spectrum round the
carrier, where its exact time of flight is a phase.
"""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.fft import ifft
from numpy.typing import NDArray

from sonarhw.readings import FloatArray, Trace
from sonarhw_sim.board.burst import RATE, Burst, burst_of
from sonarhw_sim.board.gain import path_loss_db, stepped_gain_db
from sonarhw_sim.board.profile import Board
from sonarhw_sim.board.transducer import ComplexArray
from sonarhw_sim.board.weighing import beam_table, disc
from sonarhw_sim.choices import Receiver
from sonarhw_sim.compiled import compiled

ENVELOPE_RATE = 50_000.0  # Hz
CONVERTER_RATE = 16e6 / 16 / 13  # Hz: an ATmega's converter at 16 MHz / 16, 13 clocks a sample
_CONVERTER_STEPS = 128  # to each side of zero: 8 bits
_FAINTEST = 1e-4  # amplitude; what is below it at every moment is lost in any noise
_TOGETHER = 128  # echoes made at a time, so that memory does not grow with their number


@dataclass(frozen=True)
class Arrivals:
    """What comes back of one ping, whatever the transducer makes of it; one row an arrival."""

    times: FloatArray  # (n,), s since the start of transmission
    amplitudes: FloatArray  # (n,), signed, without beam, spreading and the absorption that the ideal gain gives back
    leaving: FloatArray  # (n,), cosine of the angle between the axis and the departure
    arriving: FloatArray  # (n,), cosine of the angle between the axis and where it comes back from

    def __len__(self) -> int:
        return len(self.times)

    def select(self, rows: slice | NDArray[np.intp] | NDArray[np.bool_]) -> "Arrivals":
        """Only those rows."""
        return Arrivals(self.times[rows], self.amplitudes[rows], self.leaving[rows], self.arriving[rows])


@dataclass(frozen=True)
class Noise:
    """Noise of the receiver, in the band of the transducer."""

    level: float  # root mean square of the signal with its carrier; 1 is full scale
    seed: tuple[int, ...]  # a shorter signal of the same seed has the beginning of a longer one's noise


@dataclass(frozen=True)
class Signal:
    """The receive signal of one ping, after the gain, as complex envelope round the carrier."""

    samples: ComplexArray  # (n,), RATE samples a second from the start of transmission
    carrier: float  # Hz
    duration: float  # s

    def envelope(self, rate: float = ENVELOPE_RATE) -> Trace:
        """Its envelope, 0..1."""
        at = np.arange(_count(self.duration, rate)) / rate
        levels = np.interp(at * RATE, np.arange(len(self.samples)), np.abs(self.samples))
        return Trace(np.minimum(levels, 1.0), rate, 0.0)

    def rf(self, rate: float) -> FloatArray:
        """The signal with its carrier, (n,) float, -1..1, at `rate` (Hz) from the start of transmission."""
        return np.asarray(_with_carrier(self.samples, RATE / rate, self.carrier / rate, _count(self.duration, rate)))

    def sampled(self, rate: float = CONVERTER_RATE) -> FloatArray:
        """`rf` as a converter of 8 bits sees it, (n,) float in steps of 1/128.

        At 76.9 kHz it undersamples: a carrier of 49.4 kHz folds to 27.5 kHz.
        """
        steps = np.round(self.rf(rate) * _CONVERTER_STEPS)
        return np.asarray(np.minimum(steps, _CONVERTER_STEPS - 1) / _CONVERTER_STEPS)


def received(
    arrivals: Arrivals,
    board: Board,
    speed_of_sound: float,
    duration: float,
    receiver: Receiver = Receiver.FIRST_ECHO,
    noise: Noise | None = None,
) -> Signal:
    """What the receiver has, after its gain, of all `arrivals` and the board's own burst, for `duration` s.

    The board's own receiver has the stepped gain where the profile knows it, else, and for the paper's, the ideal one.
    """
    samples = np.zeros(_count(duration, RATE) + 3, dtype=np.complex128)
    burst = burst_of(board, speed_of_sound)
    worth = _audible(arrivals, board, speed_of_sound) & (arrivals.times < (len(samples) + burst.lead) / RATE)
    arrivals = before_gain(arrivals.select(worth), board, speed_of_sound, receiver)
    gain = gain_at_samples(len(samples), board, receiver)
    for k in range(0, len(arrivals), _TOGETHER):
        _add(samples, *pulses(arrivals.select(slice(k, k + _TOGETHER)), board, burst, speed_of_sound), gain)
    # the burst reaches the receiver past the gain, and drives it to its limit until the transducer has rung down
    own = Arrivals(np.zeros(1), np.full(1, 10 ** (board.own_burst_db / 20)), np.ones(1), np.ones(1))
    _add(samples, *pulses(own, board, burst, speed_of_sound), gain_at_samples(len(samples), board, Receiver.FIRST_ECHO))
    if noise is not None and noise.level > 0:
        samples += _noise(len(samples), board, noise)
    return Signal(samples, board.frequency, duration)


def pulses(
    arrivals: Arrivals, board: Board, burst: Burst, speed_of_sound: float
) -> tuple[ComplexArray, NDArray[np.intp]]:
    """Every arrival by itself, (n, burst.length) complex, and the number of the sample with which each begins, (n,)."""
    whole = np.floor(arrivals.times * RATE).astype(np.intp)
    wavenumber = math.tau / speed_of_sound * board.aperture_radius  # times a frequency: ka there
    highest = wavenumber * (board.frequency + max(-burst.lowest, board.frequency))
    spectra = np.zeros((len(arrivals), burst.length), dtype=np.complex128)
    _fill(
        spectra,
        arrivals.times,
        (arrivals.times * RATE - whole + burst.lead) / RATE,
        arrivals.amplitudes,
        np.column_stack((arrivals.leaving, arrivals.arriving)),
        burst.spectrum,
        burst.lowest,
        RATE / burst.length,
        board.frequency,
        wavenumber,
        beam_table(highest),
    )
    return np.asarray(ifft(spectra, axis=1, norm="forward")), whole - burst.lead


def _audible(arrivals: Arrivals, board: Board, speed_of_sound: float) -> NDArray[np.bool_]:
    """Which arrivals may be as loud as `_FAINTEST` at some moment, (n,) bool.

    Lobes of 2 J₁(x)/x lie under 1.6 x^-1.5; edges of a burst hold lower frequencies than its carrier, so x is halved.
    """
    half = math.pi * board.frequency / speed_of_sound * board.aperture_radius
    loudest = np.abs(arrivals.amplitudes)
    for cosines in (arrivals.leaving, arrivals.arriving):
        x = half * np.sqrt(np.maximum(0.0, 1 - cosines**2))
        loudest = loudest * np.maximum(0.0, cosines) * np.minimum(1.0, 1.6 / np.maximum(x, 1.0) ** 1.5)
    return np.asarray(loudest >= _FAINTEST)


def before_gain(arrivals: Arrivals, board: Board, speed_of_sound: float, receiver: Receiver) -> Arrivals:
    """Arrivals as they come to the gain; to the ideal one without the loss that it would give back anyway."""
    if not _is_stepped(board, receiver):
        return arrivals
    # nothing that returns at once is heard, and it has no loss to speak of
    lengths = np.maximum(arrivals.times * speed_of_sound, 1e-3)
    lost = 10 ** (-path_loss_db(lengths, board) / 20)
    return Arrivals(arrivals.times, arrivals.amplitudes * lost, arrivals.leaving, arrivals.arriving)


@lru_cache(maxsize=16)
def gain_at_samples(count: int, board: Board, receiver: Receiver) -> FloatArray:
    """What the gain makes of `before_gain`, for so many samples from the start of transmission, (count,) float."""
    gain = np.ones(count)
    if _is_stepped(board, receiver):
        clock = np.arange(count) / RATE * (1 + board.clock_error)
        gain = np.asarray(10 ** (stepped_gain_db(clock, board) / 20))
    gain.flags.writeable = False
    return gain


def _is_stepped(board: Board, receiver: Receiver) -> bool:
    return receiver is Receiver.BOARD and bool(board.gain_steps)


def _noise(count: int, board: Board, noise: Noise) -> ComplexArray:
    """White noise that has passed the transducer's resonance once, (count,) complex."""
    white = np.random.default_rng(noise.seed).standard_normal((count, 2)).view(np.complex128)[:, 0]
    kept = math.exp(-board.frequency / max(board.rise_cycles, 0.1) / RATE)
    return np.asarray(_smoothed(noise.level * math.sqrt(1 - kept**2) * white, kept))


def _count(duration: float, rate: float) -> int:
    return max(1, math.ceil(duration * rate))


@compiled
def _fill(
    spectra: ComplexArray,
    times: FloatArray,
    delays: FloatArray,
    amplitudes: FloatArray,
    cosines: FloatArray,
    burst: ComplexArray,
    lowest: float,
    step: float,
    carrier: float,
    wavenumber: float,
    table: FloatArray,
) -> None:
    """Spectrum of every arrival into the bins that `ifft` expects, each turned by its delay."""
    length, reach = spectra.shape[1], burst.shape[0] // 2
    for row in range(spectra.shape[0]):
        # sound that leaves backwards, or comes from behind, is not heard
        leaving, arriving = cosines[row]
        if leaving <= 0.0 or arriving <= 0.0:
            continue

        # the phase of the carrier, and of each bin, by the time of flight
        size = amplitudes[row] * leaving * arriving
        turn = -2j * math.pi * (carrier * times[row] + lowest * delays[row])
        phasor, turning = size * np.exp(turn), np.exp(-2j * math.pi * step * delays[row])

        # both smears; most sound comes back from where it went
        out = wavenumber * math.sqrt(max(0.0, 1.0 - leaving * leaving))
        back = wavenumber * math.sqrt(max(0.0, 1.0 - arriving * arriving))
        for k in range(burst.shape[0]):
            frequency = abs(carrier + lowest + k * step)
            smear = disc(out * frequency, table)
            smear *= smear if out == back else disc(back * frequency, table)
            spectra[row, (k - reach) % length] = burst[k] * phasor * smear
            phasor *= turning


@compiled
def _smoothed(rough: ComplexArray, kept: float) -> ComplexArray:
    """Every sample and what is `kept` of all before it, (n,)."""
    smooth = rough.copy()
    for k in range(1, smooth.shape[0]):
        smooth[k] += kept * smooth[k - 1]
    return smooth


@compiled
def _add(samples: ComplexArray, some: ComplexArray, first: NDArray[np.intp], gain: FloatArray) -> None:
    for row in range(some.shape[0]):
        for k in range(max(0, -first[row]), min(some.shape[1], samples.shape[0] - first[row])):
            samples[first[row] + k] += some[row, k] * gain[first[row] + k]


@compiled
def _with_carrier(samples: ComplexArray, step: float, turns: float, count: int) -> FloatArray:
    """Real part of `samples` on the carrier, `count` of them `step` samples apart, limited to -1..1.

    A cubic through the two samples to each side runs between them (Catmull and Rom).
    """
    signal = np.empty(count)
    phasor, turning = 1.0 + 0.0j, np.exp(2j * math.pi * turns)
    last = samples.shape[0] - 1
    node, constant, linear, square, cube = -1, 0.0j, 0.0j, 0.0j, 0.0j
    for k in range(count):
        # the cubic of the stretch between two samples
        if int(k * step) != node and node < last - 1:
            node = min(int(k * step), last - 1)
            before, after = samples[max(node - 1, 0)], samples[min(node + 2, last)]
            low, high = samples[node], samples[node + 1]
            constant, linear = low, 0.5 * (high - before)
            square = before - 2.5 * low + 2.0 * high - 0.5 * after
            cube = 0.5 * (after - before) + 1.5 * (low - high)

        # its real part on the carrier
        t = k * step - node
        real = constant.real + t * (linear.real + t * (square.real + t * cube.real))
        imaginary = constant.imag + t * (linear.imag + t * (square.imag + t * cube.imag))
        signal[k] = min(1.0, max(-1.0, real * phasor.real - imaginary * phasor.imag))
        phasor *= turning
    return signal
