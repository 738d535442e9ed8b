"""From the receive signal to echo times: the receiver of the Polaroid 6500, and a receiver of the first echo."""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray
from sonarhw_sim.air import Receiver
from sonarhw_sim.board.beam import BoolArray, ComplexArray, disc, every_path
from sonarhw_sim.board.profile import Board
from sonarhw_sim.board.signal import (
    FAINTEST,
    RATE,
    Arrivals,
    Noise,
    PulseTable,
    before_gain,
    burst_of,
    gain_at_samples,
    loudest_beam,
    own_burst,
    pulse_table,
    pulses,
    received,
)
from sonarhw_sim.compiled import compiled, compiled_part, inlined, rows_in_parts

# The ranging board's own receiver, as in the Polaroid 6500: from the receive signal to echo times.
#
# The rectified receive signal (`sonarhw_sim.board.signal.received`) charges a capacitor that leaks, REC. An echo is
# detected when REC is full. A weak echo is therefore detected later than a strong one, and an echo that is too short
# or too weak is not detected. While the board is blanked, REC is kept empty: first until the end of blanking or BINH,
# then after each echo while BLNK is high.


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
    detections = _detect(np.abs(samples) / full, opens * RATE, ends * RATE, board.rearm * RATE, kept_charge(board))
    return np.asarray(detections / RATE)


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
    detections = np.empty(0)
    charge = 0.0
    for k in range(math.ceil(opens), levels.shape[0]):
        # blanked: REC is kept empty
        if k < opens:
            continue
        before, charge = charge, kept * charge + (1.0 - kept) * levels[k]
        if charge < 1.0:
            continue

        # full: between the last sample and this one, but not before blanking ended
        detection = max(opens, k - 1 + (1.0 - before) / (charge - before))
        if detection > ends:
            break
        detections = np.append(detections, detection)
        opens, charge = detection + rearm, 0.0
    return detections


# The first echo of the board's own receiver at many headings, without whole signals.
#
# The result is that of `sonarhw_sim.board.receiver` on the signal of `sonarhw_sim.board.signal`. Pulses are added in
# order of their arrival, and the detector listens in between, so nothing after the first echo is computed. Pulses
# come from a table (`sonarhw_sim.board.signal`). Their phases serve all headings. Pulses that begin with the
# same sample, such as those of a path and its reverse, are added as one. Compiled by numba.


_LEAST_PART = 60  # headings: for fewer, a thread costs more than it saves
_AS_LOUD_FIRST = 1.0 + 1e-9  # of arrivals that are equally loud, the first is reported


class Sound(NamedTuple):
    """All sound that returns after one ping, for any heading; one row for each path, earliest first."""

    times: FloatArray  # (p,), s since the start of transmission
    amplitudes: ComplexArray  # (p,), with phase, without the beam
    leaving: FloatArray  # (p, 2), horizontal part of the unit vector of departure
    arriving: FloatArray  # (p, 2), horizontal part of the unit vector towards the arriving sound
    blocked: BoolArray  # (n, p), at each heading, the paths that a face blocks; (0, 0): none does


class _Detector(NamedTuple):
    """What the detector of a board does with a signal."""

    opens: float  # samples, end of blanking
    ends: float  # samples, latest time of an echo
    full: float  # level of a continuous signal that fills REC
    kept: float  # share of its charge that REC keeps from one sample to the next
    window: int  # samples before a detection that charged REC
    own: ComplexArray  # the transmit burst from sample 0 on
    gain: FloatArray  # (n,), factor of each sample


class _Work(NamedTuple):
    """Memory for one heading, used again for the next."""

    real: FloatArray  # (n,), the signal
    imaginary: FloatArray  # (n,)
    rows: NDArray[np.intp]  # (p,), paths whose pulses were added
    weights: ComplexArray  # (p, q), their weights of the pulses of the table
    sums: ComplexArray  # (q,), weights of all pulses that begin with one sample
    pulse: FloatArray  # (2, length), the last pulse
    phased: ComplexArray  # (p, q), weights without the beam, for every heading
    is_phased: BoolArray  # (p,), of which paths they are known


def first_echoes(
    headings: FloatArray,
    sound: Sound,
    board: Board,
    speed_of_sound: float,
    of_heading: NDArray[np.intp] | None = None,
) -> tuple[FloatArray, NDArray[np.intp]]:
    """Return time and path of the first echo of the board's own receiver, without noise, at `headings` (n,) rad.

    The paths at a heading are those from one row up to another, `of_heading` (n, 2); None: all.
    Times (n,) s are true times, NaN without an echo. The path (n,) is the row of the loudest one just before the echo;
    -1: no echo, or the own burst.
    """
    table, detector = pulse_table(board, speed_of_sound), _detector(board, speed_of_sound)
    straight = Arrivals(sound.times, sound.amplitudes, np.empty(0), np.empty(0))
    before = before_gain(straight, board, speed_of_sound, Receiver.BOARD).amplitudes.astype(np.complex128)
    headings = np.ascontiguousarray(headings, dtype=np.float64)
    loudness = np.abs(sound.amplitudes)
    rows = every_path(len(headings), len(sound.times)) if of_heading is None else of_heading

    def heard(begin: int, end: int) -> tuple[FloatArray, NDArray[np.intp]]:
        detections, winners = np.full(end - begin, np.nan), np.full(end - begin, -1, dtype=np.intp)
        work = _work(len(detector.gain), len(sound.times), *table.real.shape)
        here = sound._replace(blocked=sound.blocked[begin:end])
        some, of_these = headings[begin:end], rows[begin:end]
        _first_echoes(some, of_these, here, loudness, before, table, detector, work, detections, winners)
        return detections, winners

    detections, winners = rows_in_parts(heard, len(headings), _LEAST_PART)
    return detections / RATE, winners


def _detector(board: Board, speed_of_sound: float) -> _Detector:
    ends = 2 * board.max_range / speed_of_sound * RATE
    count = math.ceil(ends) + 3
    return _Detector(
        board.blanking_end / (1 + board.clock_error) * RATE,
        ends,
        max(10 ** (board.threshold_db / 20), 1e-300) * charge_of_burst(board, speed_of_sound),
        kept_charge(board),
        max(2, math.ceil(integration_samples(board))),
        own_burst(board, speed_of_sound)[:count],
        gain_at_samples(count, board, Receiver.BOARD),
    )


def _work(samples: int, paths: int, nodes: int, length: int) -> _Work:
    return _Work(
        np.zeros(samples),
        np.zeros(samples),
        np.zeros(paths, np.intp),
        np.zeros((paths, nodes), np.complex128),
        np.zeros(nodes, np.complex128),
        np.zeros((2, length)),
        np.zeros((paths, nodes), np.complex128),
        np.zeros(paths, np.bool_),
    )


@compiled
def _first_echoes(
    headings: FloatArray,
    of_heading: NDArray[np.intp],
    sound: Sound,
    loudness: FloatArray,
    before_gain: ComplexArray,
    table: PulseTable,
    detector: _Detector,
    work: _Work,
    detections: FloatArray,
    winners: NDArray[np.intp],
) -> None:
    """Fill in sample number, with its fraction, and path of the first echo at each heading, which are NaN and -1."""
    for row in range(headings.shape[0]):
        heading = row, math.cos(headings[row]), math.sin(headings[row])
        first, end = of_heading[row, 0], of_heading[row, 1]
        detections[row], winners[row] = _first_echo(
            heading, first, end, sound, loudness, before_gain, table, detector, work
        )


@inlined
def _first_echo(
    heading: tuple[int, float, float],
    first: int,
    end: int,
    sound: Sound,
    loudness: FloatArray,
    before_gain: ComplexArray,
    table: PulseTable,
    detector: _Detector,
    work: _Work,
) -> tuple[float, int]:
    """Return the sample number and the path of the first echo at a heading: its row, and a unit vector that way.

    Its paths are the rows from `first` up to `end`.
    """
    count, length, written = work.real.shape[0], table.real.shape[1], detector.own.shape[0]
    for k in range(written):
        work.real[k], work.imaginary[k] = detector.own[k].real, detector.own[k].imag
    # earlier samples have no effect
    sample = math.ceil(detector.opens)
    unheard, charge, detection = sample - detector.window, 0.0, math.nan
    # a plain 0 has a type of its own, for which `_loudest` would be compiled once more
    used: int = np.int64(0)  # type: ignore[assignment]
    last = -table.lead - 1  # where the last pulse begins
    for path in range(first, end + 1):
        begin, leaving, arriving = count, 0.0, 0.0
        if path < end:
            begin = int(sound.times[path] * RATE) - table.lead
            if begin >= count or begin + length <= unheard:
                continue
            leaving, arriving = _cosines(path, heading, sound)
            if not _matters(leaving, arriving, loudness[path], table):
                continue
        # the signal before this pulse is complete
        if begin > last:
            if used > 0:
                _add(last, work.sums, table, detector.gain, work)
                written = min(count, last + length)
            detection, sample, charge = _listened(sample, begin, charge, written, detector, work)
            if not math.isnan(detection) or path == end:
                break
            work.sums[:] = 0.0
            last = begin
        if not work.is_phased[path]:
            _phase(work.phased[path], sound.times[path], before_gain[path], table)
            work.is_phased[path] = True
        _weigh(work.weights[used], work.phased[path], leaving, arriving, table, work.sums)
        work.rows[used] = path
        used += 1
    if detection > detector.ends:
        detection = math.nan
    winner = -1 if math.isnan(detection) else _loudest(detection, used, sound.times, table, detector, work)
    work.real[:written], work.imaginary[:written] = 0.0, 0.0
    return detection, winner


@inlined
def _cosines(path: int, heading: tuple[int, float, float], sound: Sound) -> tuple[float, float]:
    """Return the cosines of the angles from the axis at which sound leaves and arrives; 0 if a face blocks it."""
    row, x, y = heading
    if sound.blocked.shape[0] > 0 and sound.blocked[row, path]:
        return 0.0, 0.0
    leaving: float = sound.leaving[path, 0] * x + sound.leaving[path, 1] * y
    arriving: float = sound.arriving[path, 0] * x + sound.arriving[path, 1] * y
    return leaving, arriving


@inlined
def _matters(leaving: float, arriving: float, loudness: float, table: PulseTable) -> bool:
    """Return whether sound may be detected, or change what is detected."""
    if leaving <= 0.0 or arriving <= 0.0:
        return False
    half = 0.5 * table.wavenumber * table.carrier
    matters: bool = loudness * loudest_beam(leaving, half) * loudest_beam(arriving, half) >= FAINTEST
    return matters


@inlined
def _listened(
    sample: int, end: int, charge: float, written: int, detector: _Detector, work: _Work
) -> tuple[float, int, float]:
    """Return where REC is full from `sample` to `end`, NaN if it is not; the next sample, and its charge.

    The signal is 0 from sample `written` on.
    """
    kept, share = detector.kept, (1.0 - detector.kept) / detector.full
    for k in range(sample, min(end, written)):
        before, charge = charge, kept * charge + share * _size(work.real[k], work.imaginary[k])
        if charge >= 1.0:
            return max(detector.opens, k - 1 + (1.0 - before) / (charge - before)), k, charge
    silent = end - max(sample, written)
    if silent > 0:
        charge *= kept**silent
    return math.nan, max(sample, end), charge


@compiled_part
def _phase(phased: ComplexArray, time: float, amplitude: complex, table: PulseTable) -> None:
    """Write the weight of each pulse of the table in the pulse that arrives at `time`, without the beam."""
    size = amplitude * np.exp(-2j * math.pi * table.carrier * time)
    later = time - int(time * RATE) / RATE
    for q in range(phased.shape[0]):
        phased[q] = size * np.exp(-2j * math.pi * table.nodes[q] * later)


@compiled_part
def _weigh(
    weights: ComplexArray,
    phased: ComplexArray,
    leaving: float,
    arriving: float,
    table: PulseTable,
    sums: ComplexArray,
) -> None:
    """Write the weight of each pulse of the table, with the beam, and add it to the sums."""
    # for most sound, both angles are equal
    out = table.wavenumber * math.sqrt(max(0.0, 1.0 - leaving * leaving))
    back = table.wavenumber * math.sqrt(max(0.0, 1.0 - arriving * arriving))
    for q in range(weights.shape[0]):
        frequency = abs(table.carrier + table.nodes[q])
        factor = disc(out * frequency, table.discs)
        factor *= factor if out == back else disc(back * frequency, table.discs)
        weights[q] = phased[q] * (leaving * arriving * factor)
        sums[q] += weights[q]


@compiled_part
def _make_pulse(weights: ComplexArray, begin: int, end: int, table: PulseTable, pulse: FloatArray) -> None:
    """Write the samples from `begin` to `end` of the pulse with these weights."""
    # slices, because the processor does several samples at once only if rows cannot be negative
    real, imaginary = pulse[0, begin:end], pulse[1, begin:end]
    real[:] = 0.0
    imaginary[:] = 0.0
    for q in range(weights.shape[0]):
        a, b = weights[q].real, weights[q].imag
        node_real, node_imaginary = table.real[q, begin:end], table.imaginary[q, begin:end]
        for k in range(real.shape[0]):
            real[k] += a * node_real[k] - b * node_imaginary[k]
            imaginary[k] += a * node_imaginary[k] + b * node_real[k]


@compiled_part
def _add(first: int, weights: ComplexArray, table: PulseTable, gain: FloatArray, work: _Work) -> None:
    """Add the pulse with these weights, from sample `first` on, to the signal."""
    begin, end = max(0, -first), min(table.real.shape[1], gain.shape[0] - first)
    _make_pulse(weights, begin, end, table, work.pulse)
    real, imaginary = work.real[first + begin : first + end], work.imaginary[first + begin : first + end]
    factor, pulse = gain[first + begin : first + end], work.pulse[:, begin:end]
    for k in range(real.shape[0]):
        real[k] += pulse[0, k] * factor[k]
        imaginary[k] += pulse[1, k] * factor[k]


@compiled_part
def _loudest(echo: float, used: int, times: FloatArray, table: PulseTable, detector: _Detector, work: _Work) -> int:
    """Return the path that was loudest while REC last charged, before sample `echo`; -1 if none is loud enough."""
    end = math.ceil(echo) + 1
    since = max(0, end - detector.window)
    total, most, loudest = 0.0, 0.0, -1
    for k in range(since, min(end, work.real.shape[0])):
        total += _size(work.real[k], work.imaginary[k])
    for row in range(used):
        first = int(times[work.rows[row]] * RATE) - table.lead
        begin, last = max(0, since - first), min(table.real.shape[1], end - first)
        if begin >= last:
            continue
        _make_pulse(work.weights[row], begin, last, table, work.pulse)
        alone = 0.0
        for k in range(begin, last):
            alone += _size(work.pulse[0, k], work.pulse[1, k]) * detector.gain[first + k]
        if alone > most * _AS_LOUD_FIRST:
            most, loudest = alone, work.rows[row]
    return loudest if most >= SHARE * total else -1


@compiled_part
def _size(real: float, imaginary: float) -> float:
    return math.sqrt(real * real + imaginary * imaginary)
