"""Directivity of the transducer, the shape of a pulse away from its axis, and the weight of each path."""

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.fft import fft, fftfreq, ifft
from numpy.typing import NDArray

from sonarhw.readings import FloatArray
from sonarhw_sim.board.profile import Board
from sonarhw_sim.compiled import array_part, compiled, compiled_part, inlined

# directivity and pulses away from the axis; the beam acts at departure and at arrival: the functions apply it once


ComplexArray = NDArray[np.complex128]


def beam_gain(angles: FloatArray, ka: float) -> FloatArray:
    """Return the amplitude at `angles` (rad) from the axis relative to straight ahead, for one pass, 0..1, same shape.

    A disc of radius a at wavenumber k: |2 J₁(x)/x| cos α with x = ka sin α; nothing at 90° and beyond. It is the
    carrier's part of Kuc and Siegel's h_R, whose integral is cos α (Kuc and Siegel 1987; CIM-92-9 eq. 1).
    """
    cosine = np.cos(angles)
    return np.asarray(np.where(cosine > 0, np.abs(disc_factor(ka * np.sin(angles))) * cosine, 0.0))


def disc_factor(x: FloatArray) -> FloatArray:
    """Return 2 J₁(x)/x, same shape, to 10⁻¹⁵.

    Poisson's integral: the sum of cos(x sin θ) over strips of the disc. SciPy's J₁ takes a fifth of a second to load,
    which is too long for each command; it is faster for a million values.
    """
    places, shares = _strips(x)
    # cos y = 1 - 2 sin²(y/2), so that the result is exactly 1 straight ahead; sum(), because BLAS may add in any order
    return np.asarray(1 - 2 * (np.sin(np.multiply.outer(x, places / 2)) ** 2 * shares).sum(axis=-1))


def disc_slope(x: FloatArray) -> FloatArray:
    """Return the derivative of `disc_factor`, -2 J₂(x)/x, same shape."""
    places, shares = _strips(x)
    return np.asarray(-(np.sin(np.multiply.outer(x, places)) * (shares * places)).sum(axis=-1))


def _strips(x: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return places and shares of strips of half a disc, (m,) each, enough for the largest `x`.

    Equal steps of the angle θ, at sin θ of the radius. The sum over m of them is exact up to J₄ₘ₋₂(x), which is below
    rounding errors.
    """
    count = math.ceil(float(np.abs(x).max(initial=0.0)) / 2) + 8
    angles = (np.arange(count) + 0.5) * (math.pi / 2 / count)
    return np.sin(angles), 2 * np.cos(angles) ** 2 / count


def _transfer(ka: FloatArray, angles: FloatArray) -> FloatArray:
    """Return the Fourier transform of h_R without its delay, 2 J₁(x)/x cos α: signed, 0 from 90° on."""
    from scipy.special import j1  # slow to load, and only figures need so many values

    cosine = np.cos(angles)
    x = ka * np.sin(angles)
    safe = np.where(np.abs(x) < 1e-8, 1.0, x)
    return np.asarray(np.where(cosine > 0, np.where(np.abs(x) < 1e-8, 1.0, 2 * j1(safe) / safe) * cosine, 0.0))


def impulse_response(times: FloatArray, angle: float, radius: float, speed_of_sound: float) -> FloatArray:
    """Return h_R at `times` (s) after the wavefront reached the centre of the face, 1/s, same shape.

    (2c cos α)/(π a sin α) √(1 − c²t²/(a² sin² α)) while |t| ≤ a sin α / c (Kuc and Siegel 1987; CIM-92-9 eq. 1), for
    0 < |α| ≤ π/2; straight ahead it is a unit impulse and has no samples. Raises ValueError there.
    """
    spread = radius * abs(np.sin(angle)) / speed_of_sound
    if spread == 0 or np.cos(angle) <= 0:
        raise ValueError(f"angle {angle:g} rad: expected more than 0 and at most π/2, where h_R is a function")
    inside = np.maximum(0.0, 1 - (times / spread) ** 2)
    return np.asarray(2 * np.cos(angle) / (np.pi * spread) * np.sqrt(inside))


def convolved(
    pulse: FloatArray | ComplexArray, rate: float, angles: FloatArray, radius: float, speed_of_sound: float, passes: int
) -> tuple[ComplexArray, float]:
    """Return a pulse convolved `passes` times with h_R at every angle, (n, m) complex, and the time of its start, s.

    `pulse` (k,) is sampled at `rate` (Hz) from time 0, with its carrier; a real pulse stays real. Far off the axis the
    result begins before 0, because one rim of the face is nearer than its centre.
    """
    rim = int(np.ceil(passes * radius / speed_of_sound * rate)) + 1
    count = len(pulse) + 2 * rim
    length = 1 << (count - 1).bit_length()
    wavenumbers = np.asarray(2 * np.pi * fftfreq(length, 1 / rate) / speed_of_sound, dtype=np.float64)
    spectrum = fft(np.concatenate((np.zeros(rim), pulse)), length)
    passed = _transfer(wavenumbers * radius, np.asarray(angles, dtype=np.float64)[:, None]) ** passes
    return np.asarray(ifft(spectrum * passed, axis=1)[:, :count]), -rim / rate


def burst_loss(
    angles: FloatArray, pulse: FloatArray | ComplexArray, rate: float, radius: float, speed_of_sound: float, passes: int
) -> tuple[FloatArray, FloatArray]:
    """Return what is left of a pulse (k,) at `rate` (Hz) at `angles` (n,) rad from the axis, after `passes`.

    It is the ratio of the peaks to that straight ahead, (n,), and the root of the ratio of the energies, (n,).
    The carrier of the pulse must be a complex exponential. The peak is then that of the envelope, at any phase.
    """
    left, _ = convolved(pulse, rate, angles, radius, speed_of_sound, passes)
    power = np.abs(left) ** 2
    whole = np.abs(pulse) ** 2
    return np.sqrt(power.max(axis=1) / whole.max()), np.sqrt(power.sum(axis=1) / whole.sum())


def square_burst(frequency: float, cycles: int, rate: float) -> ComplexArray:
    """Return a burst with a rectangular envelope, (k,) complex at `rate` (Hz); the carrier is a complex exponential."""
    times = np.arange(round(cycles / frequency * rate)) / rate
    return np.asarray(np.exp(2j * np.pi * frequency * times))


def far_field(radius: float, wavelength: float) -> float:
    """Return the distance (m) beyond which h_R is accurate to 1 dB straight ahead: twice a²/λ.

    Kuc and Siegel require z ≫ a²/λ. On the axis, the field of a piston is |sin(ψ)/ψ| of its far field, with
    ψ = (π/2)(a²/λ)/z for z beyond a few radii: 0.64 at a²/λ, 0.90 at twice that (Kinsler and Frey, §7.4).
    """
    return 2 * radius**2 / wavelength


# amplitudes of paths at a heading, relative to a perfect wall straight ahead; directions are unit vectors


BoolArray = NDArray[np.bool_]

FAINT_DB = 20.0  # below the threshold: fainter paths begin no arrival
SAME_LENGTH = 1e-9  # m: lengths that differ less, by rounding, are equal
_NODES_PER_UNIT = 32  # of x = ka sin α
_SEPARATIONS = 721  # angles between departure and arrival for which the loudest heading is searched


@lru_cache(maxsize=16)
def beam_table(ka: float) -> FloatArray:
    """Return values and slopes of 2 J₁(x)/x at x = 0, 1/32, 2/32, ... beyond ka, (n, 2) float.

    A cubic through them has an error of 10⁻⁹; `beam_gain` is the closed form.
    """
    x = np.arange(math.ceil(ka * _NODES_PER_UNIT) + 2) / _NODES_PER_UNIT
    table = np.column_stack((disc_factor(x), disc_slope(x)))
    table.flags.writeable = False
    return table


@lru_cache(maxsize=16)
def loudest_by_separation(ka: float) -> FloatArray:
    """Return the product of both beam factors at the best heading, by the angle between departure and arrival.

    (721,) float for angles of 0 to π. Paths that are too faint even at their best heading can be dropped.
    """
    gains = beam_gain(np.linspace(-math.pi / 2, math.pi / 2, 2 * _SEPARATIONS - 1), ka)
    # the other beam is the same, turned by two steps for each separation; it is 0 beyond 90°
    other = np.concatenate((gains, np.zeros(len(gains))))
    return np.array([float((gains * other[2 * turn : 2 * turn + len(gains)]).max()) for turn in range(_SEPARATIONS)])


@compiled_part
def disc(x: float, table: FloatArray) -> float:
    """Return 2 J₁(x)/x with its sign, for x from 0 to the end of the table."""
    x *= _NODES_PER_UNIT
    node = int(x)
    t = x - node
    low, high = table[node], table[node + 1]
    step = 1.0 / _NODES_PER_UNIT
    value: float = (
        (1.0 + 2.0 * t) * (1.0 - t) * (1.0 - t) * low[0]
        + t * (1.0 - t) * (1.0 - t) * step * low[1]
        + t * t * (3.0 - 2.0 * t) * high[0]
        + t * t * (t - 1.0) * step * high[1]
    )
    return value


@compiled
def beam(cosine: float, ka: float, table: FloatArray) -> float:
    """Return the amplitude, for one pass, at an angle α given by its cosine: |2 J₁(x)/x| cos α, 0 from 90° on."""
    return abs(_signed_beam(cosine, ka, table))


@compiled_part
def _signed_beam(cosine: float, ka: float, table: FloatArray) -> float:
    """Return `beam` with its sign, which alternates from lobe to lobe."""
    if cosine <= 0.0:
        return 0.0
    amplitude: float = disc(ka * math.sqrt(max(0.0, 1.0 - cosine * cosine)), table) * cosine
    return amplitude


@compiled
def amplitudes_at(
    heading: float, leaving: FloatArray, arriving: FloatArray, strengths: FloatArray, ka: float, table: FloatArray
) -> FloatArray:
    """Return the signed amplitude of every path at a heading (rad), (p,).

    `leaving` and `arriving` (p, 2) are the horizontal parts of the unit vectors along which a path departs and from
    which it returns. `strengths` (p,) are the amplitudes without the beam.
    """
    x, y = math.cos(heading), math.sin(heading)
    amplitudes = np.empty(strengths.shape[0])
    for path in range(strengths.shape[0]):
        out = _signed_beam(leaving[path, 0] * x + leaving[path, 1] * y, ka, table)
        back = _signed_beam(arriving[path, 0] * x + arriving[path, 1] * y, ka, table)
        amplitudes[path] = out * back * strengths[path]
    return amplitudes


class Together(NamedTuple):
    """The paths that arrive together with each path, and their phases."""

    begins: NDArray[np.intp]  # (p,): the first of them
    ends: NDArray[np.intp]  # (p,): the row after the last
    phasors: ComplexArray  # (p,), of the carrier at arrival, magnitude 1
    faintest: float  # amplitude of a path that begins an arrival


def together(
    lengths: FloatArray, phases: FloatArray, wavelength: float, board: Board, apart: float | FloatArray = 0.0
) -> Together:
    """Return which paths arrive together: those of the same length and up to one wavelength longer.

    `lengths` (p,) m are in order, `phases` (p,) rad are beyond those of the lengths. Paths of several places are in
    order of `lengths` + `apart` (p,), m. If the board does not sum
    arrivals, every path is alone. A path more than 20 dB below the threshold belongs to the arrivals of others, but
    begins none: else a sum could end before a loud path, only because there is sound that nobody can detect.
    """
    phasors = np.exp(1j * (phases - math.tau / wavelength * lengths))
    if not board.sum_arrivals:
        rows = np.arange(len(lengths))
        return Together(rows, rows + 1, phasors, 0.0)
    in_order = lengths + apart
    begins = np.searchsorted(in_order, in_order - SAME_LENGTH)
    ends = np.searchsorted(in_order, in_order + wavelength, side="right")
    return Together(begins, ends, phasors, 10 ** ((board.threshold_db - FAINT_DB) / 20))


def sum_of_arrival(amplitudes: FloatArray, sets: Together, path: int) -> float:
    """Return the amplitude of the arrival that begins with one path."""
    members = slice(sets.begins[path], sets.ends[path])
    return float(abs((amplitudes[members] * sets.phasors[members]).sum()))


@compiled_part
def _sum_of(amplitudes: FloatArray, phasors: ComplexArray, begin: int, end: int) -> float:
    """Return the magnitude of the sum of the paths from row `begin` to `end`."""
    total = 0.0j
    for path in range(begin, end):
        total += amplitudes[path] * phasors[path]
    magnitude: float = math.sqrt(total.real * total.real + total.imag * total.imag)
    return magnitude


@compiled_part
def _loudest_of(amplitudes: FloatArray, begin: int, end: int) -> int:
    """Return the loudest path from row `begin` to `end`; of equals, the first."""
    loudest = begin
    for path in range(begin + 1, end):
        if abs(amplitudes[path]) > abs(amplitudes[loudest]) * (1.0 + 1e-9):
            loudest = path
    return loudest


@compiled
def sums_of_arrivals(amplitudes: FloatArray, sets: Together) -> tuple[FloatArray, NDArray[np.intp]]:
    """Return the amplitude of the arrival that begins with each path, (p,), and the loudest path of each, (p,).

    A path that is too faint to begin one has its own amplitude.
    """
    sums, loudest = np.empty(len(amplitudes)), np.empty(len(amplitudes), np.intp)
    for path in range(len(amplitudes)):
        begin, end = sets.begins[path], sets.ends[path]
        if abs(amplitudes[path]) < sets.faintest:
            sums[path], loudest[path] = abs(amplitudes[path]), path
            continue
        sums[path] = _sum_of(amplitudes, sets.phasors, begin, end)
        loudest[path] = _loudest_of(amplitudes, begin, end)
    return sums, loudest


class PathsAndBeam(NamedTuple):
    """The paths that may be detected, in order of length, and what decides on it."""

    leaving: FloatArray  # (p, 2), horizontal part of the unit vector of departure
    arriving: FloatArray  # (p, 2), horizontal part of the unit vector towards the arriving sound
    strengths: FloatArray  # (p,), amplitudes without the beam
    sets: Together
    blocked: BoolArray  # (n, p), the paths that a face blocks at each heading; (0, 0): none
    threshold: float  # amplitude
    ka: float
    table: FloatArray  # `beam_table`


@inlined
def _weigh(
    leaving: FloatArray,
    arriving: FloatArray,
    strengths: FloatArray,
    blocked: BoolArray,
    ka: float,
    table: FloatArray,
    begin: int,
    end: int,
    k: int,
    x: float,
    y: float,
    amplitudes: FloatArray,
) -> None:
    """Fill in the signed amplitudes of the paths from row `begin` to `end`, at heading `k` along the vector x, y.

    The arrays are those of `PathsAndBeam`: read one by one from the tuple, they would take twice as long.
    """
    for path in range(begin, end):
        amplitude = strengths[path] * _signed_beam(leaving[path, 0] * x + leaving[path, 1] * y, ka, table)
        if amplitude != 0.0:
            amplitude *= _signed_beam(arriving[path, 0] * x + arriving[path, 1] * y, ka, table)
        if blocked.shape[0] > 0 and blocked[k, path]:
            amplitude = 0.0
        amplitudes[path] = amplitude


@array_part
def _most_of_arrivals(paths: PathsAndBeam) -> FloatArray:
    """Return the most that the arrival that begins with each path can have at any heading, (p,)."""
    most = np.zeros(paths.strengths.shape[0])
    # with sum(), numba would load scipy.linalg, in 0.2 s
    for path in range(most.shape[0]):
        for member in range(paths.sets.begins[path], paths.sets.ends[path]):
            most[path] += paths.strengths[member]
    return most


class Sought(NamedTuple):
    """Which echo is sought at each heading: the first one, or the one nearest to a measured range."""

    first: bool
    measured: FloatArray  # (n,), m; has no effect on the first
    reach: float  # m, largest difference of an echo's range
    lengths: FloatArray  # (p,), m, of the paths
    ranges: FloatArray  # (p,), m, that the board reports for them
    in_time: BoolArray  # (p,): whether a path can begin an echo
    span: float  # m: paths up to so much longer than the first of an echo belong to it; below 0: none


@compiled
def detected(
    headings: FloatArray, of_heading: NDArray[np.intp], paths: PathsAndBeam, sought: Sought
) -> NDArray[np.intp]:
    """Return the loudest path of the sought echo at each heading (n,) rad, (n,) int; -1: none, or none within reach.

    The paths at a heading are those from one row up to another, `of_heading` (n, 2).
    """
    leaving, arriving, strengths, sets, blocked, threshold, ka, table = paths
    first, measured, reach, lengths, ranges, in_time, span = sought
    most = _most_of_arrivals(paths)
    nearest, amplitudes = np.full(headings.shape[0], -1, np.intp), np.empty(most.shape[0])
    for k in range(headings.shape[0]):
        x, y = math.cos(headings[k]), math.sin(headings[k])
        weighed, until, least = of_heading[k, 0], -np.inf, np.inf
        for path in range(of_heading[k, 0], of_heading[k, 1]):
            # paths within an echo begin no other one
            if most[path] < threshold or not in_time[path] or lengths[path] <= until:
                continue
            begin, end = sets.begins[path], sets.ends[path]
            if ranges[begin] - measured[k] > reach:
                break
            _weigh(leaving, arriving, strengths, blocked, ka, table, max(begin, weighed), end, k, x, y, amplitudes)
            weighed = max(weighed, end)
            if abs(amplitudes[path]) < sets.faintest:
                continue
            level = _sum_of(amplitudes, sets.phasors, begin, end)
            if level < threshold or level <= 0.0:
                continue
            until = lengths[path] + span
            loudest = _loudest_of(amplitudes, begin, end)
            difference = abs(ranges[loudest] - measured[k])
            if difference < least and difference <= reach:
                least, nearest[k] = difference, loudest
            if first:
                break
    return nearest


class ArrivalLevels(NamedTuple):
    """Amplitudes of arrivals at headings, (n,) each; 0 without one."""

    of_readings: FloatArray  # of the arrival that gave the reading
    loudest: FloatArray  # of the loudest arrival in time


@compiled
def arrival_levels(
    headings: FloatArray,
    of_heading: NDArray[np.intp],
    paths: PathsAndBeam,
    in_time: BoolArray,
    winners: NDArray[np.intp],
    begins_with_winner: bool,
    all_arrivals: bool,
) -> ArrivalLevels:
    """Return the amplitudes of arrivals at each heading (n,) rad; `winners` (n,) are the paths of the readings, or -1.

    The paths at a heading are those from one row up to another, `of_heading` (n, 2). The arrival of a reading begins
    with its path, or else is the first one that is loud enough and has it as its loudest path. Without `all_arrivals`,
    `loudest` is not complete.
    """
    leaving, arriving, strengths, sets, blocked, threshold, ka, table = paths
    of_readings, loudest = np.zeros(headings.shape[0]), np.zeros(headings.shape[0])
    amplitudes = np.empty(strengths.shape[0])
    for k in range(headings.shape[0]):
        x, y, winner = math.cos(headings[k]), math.sin(headings[k]), winners[k]
        first, last = of_heading[k, 0], of_heading[k, 1]
        if not all_arrivals and winner < 0:
            continue
        if not all_arrivals and begins_with_winner:
            first, last = winner, winner + 1
        weighed = 0
        for path in range(first, last):
            begin, end = sets.begins[path], sets.ends[path]
            _weigh(leaving, arriving, strengths, blocked, ka, table, max(begin, weighed), end, k, x, y, amplitudes)
            weighed = max(weighed, end)
            level, loudest_path = abs(amplitudes[path]), path
            if level >= sets.faintest or (begins_with_winner and path == winner):
                level, loudest_path = _sum_of(amplitudes, sets.phasors, begin, end), _loudest_of(amplitudes, begin, end)
            if in_time[path]:
                loudest[k] = max(loudest[k], level)
            if path == winner and of_readings[k] == 0.0:
                of_readings[k] = level
            if not begins_with_winner and loudest_path == winner and in_time[path] and level >= threshold:
                of_readings[k], winner = level, -1
                if not all_arrivals:
                    break
    return ArrivalLevels(of_readings, loudest)


def every_path(headings: int, paths: int) -> NDArray[np.intp]:
    """Return the rows of all paths for each heading, (n, 2), as `detected` takes them."""
    return np.tile(np.array([0, paths], np.intp), (headings, 1))


@inlined
def _meets_face(corners: FloatArray, x: float, y: float, half_width: float) -> bool:
    """Return whether a path, points (k, 2) relative to the sensor, meets the face of a transducer along x, y.

    The first leg starts on the face and the last ends on it, so both are ignored.
    """
    last = corners.shape[0] - 1
    while last > 0 and math.isnan(corners[last, 0]):
        last -= 1
    for k in range(1, last - 1):
        # distance ahead of the face, and position along it
        ahead, ahead_next = corners[k, 0] * x + corners[k, 1] * y, corners[k + 1, 0] * x + corners[k + 1, 1] * y
        if ahead == ahead_next or ahead * ahead_next > 0.0:
            continue
        aside, aside_next = corners[k, 1] * x - corners[k, 0] * y, corners[k + 1, 1] * x - corners[k + 1, 0] * y
        if abs(aside + (aside_next - aside) * ahead / (ahead - ahead_next)) <= half_width:
            return True
    return False


@compiled
def meeting_face(points: FloatArray, headings: FloatArray, half_width: float) -> BoolArray:
    """Return which paths meet the face of a transducer at each heading (n,) rad, (n, p) bool.

    `points` (p, k, 2) are those of the paths relative to the sensor, m, padded with NaN; `half_width` is that of the
    face, m.
    """
    meets = np.empty((headings.shape[0], points.shape[0]), np.bool_)
    for row in range(headings.shape[0]):
        x, y = math.cos(headings[row]), math.sin(headings[row])
        for path in range(points.shape[0]):
            meets[row, path] = _meets_face(points[path], x, y, half_width)
    return meets
