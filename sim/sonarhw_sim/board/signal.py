"""The receive signal: burst, pulses and traces of all echoes of a ping."""

import cmath
import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.fft import ifft, irfft, rfft
from numpy.typing import NDArray

from sonarhw.readings import FloatArray, Trace
from sonarhw_sim.air import Receiver
from sonarhw_sim.board.beam import ComplexArray, beam_table, disc, disc_factor
from sonarhw_sim.board.profile import Board, path_loss_db, stepped_gain_db
from sonarhw_sim.compiled import compiled, compiled_part

# The burst: spectrum of the echo of a perfect wall straight ahead, around the carrier.
#
# All signals of `board.traces` are complex envelopes around the board's frequency, RATE samples per second. The
# signal with its carrier is computed from them at the end.


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


# Traces: the receive signal of one ping, the sum of all its echoes with their phase.
#
# 1.0 is full scale: a perfect wall straight ahead after the ideal gain. The board's threshold is at 10^(threshold_db
# / 20). The receiver limits louder signals.
#
# Every echo is the burst, convolved with h_R at its angle of departure and at its angle of arrival. The convolution
# is a product of spectra, and the spectrum of h_R is 2 J₁(x)/x cos α. An echo is therefore computed as a short
# spectrum around the carrier, where its exact time of flight is a phase. Patches of rough surfaces have random
# phases, so their powers add up.


ENVELOPE_RATE = 50_000.0  # Hz
CONVERTER_RATE = 16e6 / 16 / 13  # Hz: an ATmega's converter at 16 MHz / 16, 13 clocks per sample
_CONVERTER_STEPS = 128  # to each side of zero: 8 bits
FAINTEST = 1e-4  # amplitude; an echo that is always below this is omitted, because noise hides it
_NOTHING = 1e-12  # share of the whole power that rounding may leave
_AT_ONCE = 128  # echoes computed at a time, so that memory does not grow with their number


@dataclass(frozen=True)
class Patches:
    """The patches that a transducer receives at one heading, one row each, in any order."""

    lengths: FloatArray  # (k,), m, of the path by way of the middle
    spreads: FloatArray  # (k,), m, by how much the ways over a patch differ
    amplitudes: FloatArray  # (k,), with the beam

    def power_between(self, begins: FloatArray, ends: FloatArray) -> FloatArray:
        """Return the power of all sound with paths between `begins` and `ends` (m), same shape."""
        audible = np.flatnonzero(self.amplitudes)
        powers, spreads = self.amplitudes[audible] ** 2, self.spreads[audible]
        edges = np.concatenate((self.lengths[audible] - spreads / 2, self.lengths[audible] + spreads / 2, [0.0]))
        rates = np.concatenate((powers / spreads, -powers / spreads, [0.0]))
        order = np.argsort(edges, kind="stable")
        edges = edges[order]
        until = np.append(0.0, np.cumsum(np.cumsum(rates[order])[:-1] * np.diff(edges)))
        power = np.interp(ends, edges, until) - np.interp(begins, edges, until)
        return np.asarray(np.where(power > _NOTHING * powers.sum(), power, 0.0))


@dataclass(frozen=True)
class Response:
    """Amplitude of arrivals by frequency, relative to that at the carrier."""

    frequencies: FloatArray  # (m,), Hz above the carrier, increasing; beyond them, the last values apply
    factors: FloatArray  # (n, m)

    def at(self, frequencies: FloatArray) -> FloatArray:
        """Return the amplitudes at `frequencies` (k,) Hz above the carrier, (n, k)."""
        shares = [np.interp(frequencies, self.frequencies, unit) for unit in np.eye(len(self.frequencies))]
        return np.asarray(np.einsum("nm,mk->nk", self.factors, np.array(shares)))


@dataclass(frozen=True)
class Arrivals:
    """All sound that returns after one ping, before the effect of the transducer; one row for each arrival."""

    times: FloatArray  # (n,), s since the start of transmission
    # (n,), with sign or phase, without beam, spreading and the absorption that the ideal gain compensates
    amplitudes: FloatArray | ComplexArray
    leaving: FloatArray  # (n,), cosine of the angle between the axis and the departure
    arriving: FloatArray  # (n,), cosine of the angle between the axis and the direction of arrival
    patches: Patches | None = None  # of rough surfaces, whose mean power is added; None: none
    response: Response | None = None  # of materials that reflect each frequency differently; None: all the same

    def __len__(self) -> int:
        return len(self.times)

    def select(self, rows: slice | NDArray[np.intp] | NDArray[np.bool_]) -> "Arrivals":
        """Return only these rows."""
        response = self.response
        return Arrivals(
            self.times[rows],
            self.amplitudes[rows],
            self.leaving[rows],
            self.arriving[rows],
            self.patches,
            response and replace(response, factors=response.factors[rows]),
        )


@dataclass(frozen=True)
class Noise:
    """Noise of the receiver, in the band of the transducer."""

    level: float  # root mean square of the signal with its carrier; 1 is full scale
    seed: tuple[int, ...]  # with one seed, the noise of a short signal is the beginning of that of a long one


@dataclass(frozen=True)
class Signal:
    """The receive signal of one ping, after the gain, as a complex envelope around the carrier."""

    samples: ComplexArray  # (n,), RATE samples per second from the start of transmission
    carrier: float  # Hz
    duration: float  # s

    def envelope(self, rate: float = ENVELOPE_RATE) -> Trace:
        """Return the envelope, 0..1."""
        times = np.arange(_count(self.duration, rate)) / rate
        levels = np.interp(times * RATE, np.arange(len(self.samples)), np.abs(self.samples))
        return Trace(np.minimum(levels, 1.0), rate, 0.0)

    def rf(self, rate: float) -> FloatArray:
        """Return the signal with its carrier, (n,) float, -1..1, at `rate` (Hz) from the start of transmission."""
        return np.asarray(_with_carrier(self.samples, RATE / rate, self.carrier / rate, _count(self.duration, rate)))

    def sampled(self, rate: float = CONVERTER_RATE) -> FloatArray:
        """Return `rf` after a converter of 8 bits, (n,) float in steps of 1/128.

        76.9 kHz is undersampling: a carrier of 49.4 kHz folds to 27.5 kHz.
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
    """Return the signal after the gain, of all `arrivals` and the board's own burst, for `duration` s.

    The board's own receiver uses the stepped gain if the profile has one. Otherwise the gain is ideal.
    """
    samples = np.zeros(_count(duration, RATE) + 3, dtype=np.complex128)
    burst = burst_of(board, speed_of_sound)
    kept = _may_matter(arrivals, board, speed_of_sound) & (arrivals.times < (len(samples) + burst.lead) / RATE)
    arrivals = before_gain(arrivals.select(kept), board, speed_of_sound, receiver)
    gain = gain_at_samples(len(samples), board, receiver)
    for k in range(0, len(arrivals), _AT_ONCE):
        _add(samples, *pulses(arrivals.select(slice(k, k + _AT_ONCE)), board, burst, speed_of_sound), gain)
    if arrivals.patches is not None:
        power = _power_at_samples(arrivals.patches, board, speed_of_sound, len(samples))
        lost = _lost(np.arange(len(samples)) / RATE, board, speed_of_sound, receiver)
        samples = _with_power(samples, power * (lost * gain) ** 2)
    # the transmit burst bypasses the gain and overdrives the receiver until the transducer has decayed
    own = own_burst(board, speed_of_sound)[: len(samples)]
    samples[: len(own)] += own
    if noise is not None and noise.level > 0:
        samples += _noise(len(samples), board, noise)
    return Signal(samples, board.frequency, duration)


def own_burst(board: Board, speed_of_sound: float) -> ComplexArray:
    """Return the transmit burst as the detector receives it, from the start of transmission on, (k,) complex."""
    burst = burst_of(board, speed_of_sound)
    return 10 ** (board.own_burst_db / 20) * np.ascontiguousarray(burst.samples[burst.lead :])


def pulses(
    arrivals: Arrivals, board: Board, burst: Burst, speed_of_sound: float
) -> tuple[ComplexArray, NDArray[np.intp]]:
    """Return the pulse of every arrival, (n, burst.length) complex, and the number of its first sample, (n,)."""
    whole = np.floor(arrivals.times * RATE).astype(np.intp)
    wavenumber = math.tau / speed_of_sound * board.aperture_radius  # multiplied by a frequency, this is ka
    highest = wavenumber * (board.frequency + max(-burst.lowest, board.frequency))
    spectra = np.zeros((len(arrivals), burst.length), dtype=np.complex128)
    _fill(
        spectra,
        arrivals.times,
        (arrivals.times * RATE - whole + burst.lead) / RATE,
        arrivals.amplitudes.astype(np.complex128),
        np.column_stack((arrivals.leaving, arrivals.arriving)),
        burst.spectrum,
        burst.lowest,
        RATE / burst.length,
        board.frequency,
        wavenumber,
        beam_table(highest),
    )
    if arrivals.response is not None:
        rows = np.round(burst.frequencies * burst.length / RATE).astype(np.intp)
        spectra[:, rows] *= arrivals.response.at(burst.frequencies)
    return np.asarray(ifft(spectra, axis=1, norm="forward")), whole - burst.lead


def _may_matter(arrivals: Arrivals, board: Board, speed_of_sound: float) -> NDArray[np.bool_]:
    """Return which arrivals may reach `FAINTEST` at any time, (n,) bool."""
    half = math.pi * board.frequency / speed_of_sound * board.aperture_radius
    loudness = np.abs(arrivals.amplitudes)
    if arrivals.response is not None:
        loudness = loudness * np.maximum(arrivals.response.factors.max(axis=1), 1.0)
    return np.asarray(_loudest(loudness, arrivals.leaving, arrivals.arriving, half) >= FAINTEST)


@compiled
def _loudest(loudness: FloatArray, leaving: FloatArray, arriving: FloatArray, half: float) -> FloatArray:
    loudest = np.zeros(loudness.shape[0])
    for row in range(loudness.shape[0]):
        loudest[row] = loudness[row] * loudest_beam(leaving[row], half) * loudest_beam(arriving[row], half)
    return loudest


@compiled_part
def loudest_beam(cosine: float, half: float) -> float:
    """Return the most that the beam lets pass of any part of a burst, at an angle given by its cosine.

    The lobes of 2 J₁(x)/x are below 1.6 x^-1.5. Start and end of a burst contain lower frequencies than its carrier, so
    x is halved: `half` is half of ka.
    """
    if cosine <= 0.0:
        return 0.0
    x = max(1.0, half * math.sqrt(max(0.0, 1.0 - cosine * cosine)))
    most: float = cosine * min(1.0, 1.6 / (x * math.sqrt(x)))
    return most


def before_gain(arrivals: Arrivals, board: Board, speed_of_sound: float, receiver: Receiver) -> Arrivals:
    """Return the arrivals at the input of the gain; for the ideal gain without the loss that it compensates."""
    return replace(arrivals, amplitudes=arrivals.amplitudes * _lost(arrivals.times, board, speed_of_sound, receiver))


def _lost(times: FloatArray, board: Board, speed_of_sound: float, receiver: Receiver) -> FloatArray:
    """Return the amplitude, at the input of the gain, of sound at `times` (s), same shape; 1 before an ideal gain."""
    if not is_stepped(board, receiver):
        return np.ones(times.shape)
    # sound that returns at once is blanked, and its loss is negligible
    return np.asarray(10 ** (-path_loss_db(np.maximum(times * speed_of_sound, 1e-3), board) / 20))


@lru_cache(maxsize=16)
def gain_at_samples(count: int, board: Board, receiver: Receiver) -> FloatArray:
    """Return the factor to apply to `before_gain` at each sample from the start of transmission, (count,) float."""
    gain = np.ones(count)
    if is_stepped(board, receiver):
        clock = np.arange(count) / RATE * (1 + board.clock_error)
        gain = np.asarray(10 ** (stepped_gain_db(clock, board) / 20))
    gain.flags.writeable = False
    return gain


def _power_at_samples(patches: Patches, board: Board, speed_of_sound: float, count: int) -> FloatArray:
    """Return the mean power of patches at each sample of a signal, (count,), at the input of the gain if it is ideal.

    The burst has the shape of its echo straight ahead.
    """
    burst = burst_of(board, speed_of_sound)
    limits = np.asarray((np.arange(count + burst.lead + 1) - 0.5) / RATE * speed_of_sound, dtype=np.float64)
    power = patches.power_between(limits[:-1], limits[1:])
    shape = np.abs(burst.samples) ** 2
    size = 1 << (len(power) + len(shape)).bit_length()
    received = irfft(rfft(power, size) * rfft(shape, size), size)[burst.lead : burst.lead + count]
    return np.asarray(np.maximum(received, 0.0))


def _with_power(samples: ComplexArray, power: FloatArray) -> ComplexArray:
    """Return samples (n,) whose magnitudes contain this power, too, with the phases that they have."""
    sizes = np.abs(samples)
    phasors = np.divide(samples, sizes, out=np.ones_like(samples), where=sizes > 0)
    return np.asarray(phasors * np.sqrt(sizes**2 + power))


def is_stepped(board: Board, receiver: Receiver) -> bool:
    """Return whether the gain of this receiver rises in steps; else it is ideal."""
    return receiver is Receiver.BOARD and bool(board.gain_steps)


def _noise(count: int, board: Board, noise: Noise) -> ComplexArray:
    """Return white noise after one passage through the transducer's resonance, (count,) complex."""
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
    amplitudes: ComplexArray,
    cosines: FloatArray,
    burst: ComplexArray,
    lowest: float,
    step: float,
    carrier: float,
    wavenumber: float,
    table: FloatArray,
) -> None:
    """Write the spectrum of every arrival, delayed, into the bins that `ifft` expects."""
    length, reach = spectra.shape[1], burst.shape[0] // 2
    for row in range(spectra.shape[0]):
        # the transducer neither sends nor receives to the rear
        leaving, arriving = cosines[row]
        if leaving <= 0.0 or arriving <= 0.0:
            continue

        # the phase of the carrier, and of each bin, by the time of flight
        size = amplitudes[row] * leaving * arriving
        turn = -2j * math.pi * (carrier * times[row] + lowest * delays[row])
        phasor, turning = size * np.exp(turn), np.exp(-2j * math.pi * step * delays[row])

        # beam at departure and arrival; for most sound the angles are equal
        out = wavenumber * math.sqrt(max(0.0, 1.0 - leaving * leaving))
        back = wavenumber * math.sqrt(max(0.0, 1.0 - arriving * arriving))
        for k in range(burst.shape[0]):
            frequency = abs(carrier + lowest + k * step)
            factor = disc(out * frequency, table)
            factor *= factor if out == back else disc(back * frequency, table)
            spectra[row, (k - reach) % length] = burst[k] * phasor * factor
            phasor *= turning


@compiled
def _smoothed(rough: ComplexArray, kept: float) -> ComplexArray:
    """Return each sample plus `kept` of the result before it, (n,)."""
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
    """Return the real part of `samples` on the carrier, `count` values `step` samples apart, limited to -1..1.

    Values between samples are interpolated with a cubic through the two samples to each side (Catmull and Rom).
    """
    signal = np.empty(count)
    phasor, turning = 1.0 + 0.0j, np.exp(2j * math.pi * turns)
    last = samples.shape[0] - 1
    node, constant, linear, square, cube = -1, 0.0j, 0.0j, 0.0j, 0.0j
    for k in range(count):
        # the cubic between two samples
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


# Pulses from a table: the echo in any direction is a weighted sum of a few fixed pulses.
#
# The beam delays parts of the sound by at most the way across the face, out and back. Its spectrum is therefore
# smooth, and its values at a few frequencies, the nodes, determine it in the whole band. The pulse of a node is what
# the burst becomes if the beam is 1 at this node and 0 at the others. With 25 nodes (Polaroid 6500), a pulse is exact
# to 10⁻⁴ of the echo straight ahead (`tests/unit/sim/test_receiver.py`).


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
    discs: FloatArray  # the table of 2 J₁(x)/x (`sonarhw_sim.board.beam`)


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
    weights = np.zeros_like(parts)
    for k in reversed(range(count)):
        weights[k] = (parts[k] - (upper[k, k + 1 :, None] * weights[k + 1 :]).sum(axis=0)) / upper[k, k]
    return weights


def _beams(frequencies: FloatArray, carrier: float, wavenumber: float) -> ComplexArray:
    """Return the beam out and back at frequencies (f,) above the carrier, for many directions and delays, (d, f)."""
    sines = np.linspace(0.0, 1.0, _ANGLES)
    once = disc_factor(np.outer(sines, wavenumber * np.abs(carrier + frequencies)))
    out, back = np.triu_indices(_ANGLES)
    later = np.exp(-1j * math.tau * np.outer((0.0, 1 / RATE), frequencies))
    return np.asarray((once[out] * once[back] * later[:, None]).reshape(-1, len(frequencies)))
