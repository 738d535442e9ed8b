"""The log-likelihood of readings for given paths: detected echoes, undetected echoes, and no echo.

Path k is detected with probability d = (1 - missed) Φ((level - threshold) / σ_level), at its range ± σ_range. If the
receiver adds later paths to it, d is the mean over all differences of phase, which no plan of a room states. False
echoes (strays) are uniform in range. The board listens until its first echo or, if it reports several, in all intervals
between them. The log-likelihood is

    Σ over echoes  ln(stray + Σ over paths  d N(r - ρ) / (1 - d m))  +  Σ over paths  ln(1 - d m)  -  stray · listened

with N the normal density and m the share of a path's normal distribution inside the intervals of listening. For one
echo, this is exactly the density of the first of independent arrivals. With probability `lost`, a ping receives nothing
from the room and reports only strays, if anything. docs/explanation/fit_method.md derives this.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from sonarhw_sim.board.beam import FAINT_DB, beam
from sonarhw_sim.compiled import array_part, compiled, compiled_part, inlined

from sonarhw.readings import FloatArray
from sonarhw_compare.fit.likelihood.echo_paths import BENT, ODD, Point, displaced

LATENESS_STEP = 0.5  # dB, between nodes of a lateness table
_FAR = 6.0  # standard deviations beyond which a normal distribution is 0
_HOPELESS = -40.0  # log-likelihood of silence to which further paths add nothing, because a ping can be lost
_ASIDE = 0.05  # cosine of the largest angle from the axis at which echoes are detected
_FAINT = 10 ** (-FAINT_DB / 20)  # amplitude by that of the threshold; fainter paths begin no arrival
_NEGLIGIBLE = 0.03  # amplitude of later paths by that of the first; less changes a level by 0.3 dB at most
_PHASES = np.cos((np.arange(6) + 0.5) * math.pi / 6)  # cosines of equally probable phase differences
_PER_DB = math.log(10.0) / 20.0  # the logarithm of an amplitude by its level
_ROOT_2 = math.sqrt(2.0)
_ROOT_2PI = math.sqrt(2.0 * math.pi)


class ScanArrays(NamedTuple):
    """The n readings of a scan, as arrays for the kernel."""

    angles: FloatArray  # (n,) rad, turntable angles
    ranges: FloatArray  # (n, e) m, of the echoes, padded with NaN
    counts: NDArray[np.int64]  # (n,), number of echoes
    ends: NDArray[np.bool_]  # (n,), whether the board stopped listening at the last of them


class BoardValues(NamedTuple):
    """Heading, detection and geometry of the board, for the kernel."""

    heading: float  # rad, actual one of the turntable's step 0
    scale: float  # true turn of the turntable by turntable angle
    ka: float  # wavenumber times aperture radius
    threshold_db: float
    opens: float  # m, shortest reported range
    closes: float  # m, longest reported range
    dead: float  # m, dead zone after an echo
    stretch: float  # reported range by true range
    offset: float  # m, added to the stretched range
    sender: Point  # m, ahead and to the left of the turning axis
    listener: Point


class ReadingNoise(NamedTuple):
    """Errors of readings."""

    range: float  # m
    level: float  # dB
    missed: float  # probability that a loud echo is not detected
    lost: float  # probability that a ping receives nothing from the room
    stray: float  # false echoes per metre of range
    stretch: float = 1.0  # reported range by true range; differs from 1 if the assumed speed of sound is wrong


class PathArrays(NamedTuple):
    """The k paths of a place, about shortest first."""

    out: FloatArray  # this and the next four as in `EchoPaths`
    back: FloatArray
    rise: FloatArray
    turn: FloatArray
    kind: NDArray[np.int8]
    until: NDArray[np.int64]  # (k,), the row after the last path that a receiver adds to each
    level_db: FloatArray  # (k,), before the beam


@compiled
def log_likelihoods(
    scan: ScanArrays,
    paths: PathArrays,
    by: Point,
    board: BoardValues,
    noise: ReadingNoise,
    table: FloatArray,
    lateness: FloatArray,
) -> FloatArray:
    """Return the log-likelihood of each reading, (n,); `table` is the beam table (`sonarhw_sim.board.beam`).

    The place has moved by the vector `by` (m) since `paths` were searched.
    `lateness` (l,) m is the error in range of late detection at 0, 0.5, 1, ... dB over the threshold; empty for none.
    """
    angles, echoes, counts, ended = scan.angles, scan.ranges, scan.counts, scan.ends
    reported, nearest, leaving, arriving = _on_axis(paths, by, board)
    aside = board.sender != (0.0, 0.0) or board.listener != (0.0, 0.0)
    reach = _reach(board) * board.stretch
    # amplitudes are relative to the threshold
    strengths = np.exp((paths.level_db - board.threshold_db) * _PER_DB)
    needed = _needed(strengths, paths.until, noise)
    likelihoods, densities = np.empty(angles.shape[0]), np.empty(echoes.shape[1])
    for i in range(angles.shape[0]):
        count, ranges = counts[i], echoes[i]
        ends = ended[i] and count > 0
        last = ranges[count - 1] if ends else board.closes
        farthest = last + _FAR * noise.range + reach
        heading = board.heading + board.scale * angles[i]
        hx, hy = math.cos(heading), math.sin(heading)
        sender, listener = _turned(board.sender, by, hx, hy), _turned(board.listener, by, hx, hy)
        densities[:] = noise.stray
        undetected = 0.0
        for k in range(reported.shape[0]):
            # leave out what arrives too late or is too faint at every heading
            if reported[k] > farthest or needed[k] > 1.0:
                if nearest[k] > farthest:
                    break
                continue
            # the direction decides first, because it excludes most paths
            ahead, home = _cosine(leaving, k, hx, hy), _cosine(arriving, k, hx, hy)
            if ahead < _ASIDE or home < _ASIDE:
                continue
            found = reported[k]
            if aside:
                found, ahead, home = _beside_axis(paths, k, sender, listener, hx, hy, board)
            amplitude = beam(ahead, board.ka, table)
            if amplitude < needed[k]:
                continue
            amplitude *= beam(home, board.ka, table)
            if amplitude < needed[k]:
                continue
            amplitude *= strengths[k]
            power = 0.0
            for j in range(k + 1, paths.until[k]):
                there, on = _cosine(leaving, j, hx, hy), _cosine(arriving, j, hx, hy)
                power += _power(strengths[j], there, on, board.ka, table)
            chance, late = _detection(amplitude, power, noise, lateness)
            if chance == 0.0:
                continue
            # count it as an echo at each reported range, and as no echo
            found += late
            silence = 1.0 - chance * _mass(found, ranges, count, ends, board, noise.range)
            undetected += math.log(silence)
            if count == 0 and undetected < _HOPELESS:
                break  # the ping was lost
            _add_densities(densities, ranges, count, found, chance / silence, noise.range)
        likelihoods[i] = _of_reading(undetected, densities, count, max(0.0, last - board.opens), noise)
    return likelihoods


@inlined
def _cosine(directions: FloatArray, row: int, x: float, y: float) -> float:
    """Return the cosine of the angle between a row of directions (k, 2) and the direction x, y."""
    cosine: float = directions[row, 0] * x + directions[row, 1] * y
    return cosine


@inlined
def _power(strength: float, ahead: float, home: float, ka: float, table: FloatArray) -> float:
    """Return the square of an amplitude after the beam, departing and arriving."""
    return (strength * beam(ahead, ka, table) * beam(home, ka, table)) ** 2


@inlined
def _beside_axis(
    paths: PathArrays, k: int, sender: Point, listener: Point, hx: float, hy: float, board: BoardValues
) -> tuple[float, float, float]:
    """Return the reported range of a path (m) and its cosines from the axis of the beam, departing and arriving."""
    one = displaced(paths.out[k], paths.back[k], paths.turn[k], paths.kind[k], sender, listener)
    there, on, back_x, back_y = _legs(one, paths.rise[k], paths.turn[k], paths.kind[k])
    ahead, home = (one[0] * hx + one[1] * hy) / there, back_x * hx + back_y * hy
    return (there + on) / 2 * board.stretch + board.offset, ahead, home


@inlined
def _detection(amplitude: float, power: float, noise: ReadingNoise, lateness: FloatArray) -> tuple[float, float]:
    """Return the probability that an arrival is detected, and by how much too far (m).

    `power` is that of the later paths which the receiver adds to it.
    """
    over, late = 20.0 * math.log10(amplitude), 0.0
    if power > (_NEGLIGIBLE * amplitude) ** 2:
        # smooth in the level: a limit at which whole arrivals come and go would trap the sampler
        begins = _normal((over + FAINT_DB) / noise.level)
        chance = (1.0 - noise.missed) * begins * _chance_of_sum(amplitude, math.sqrt(power), noise.level)
    else:
        late = _late(over, lateness)
        chance = (1.0 - noise.missed) * _normal(over / noise.level)
    return chance, late


@inlined
def _add_densities(
    densities: FloatArray, ranges: FloatArray, count: int, found: float, weight: float, spread: float
) -> None:
    """Add to the density (1/m) at each of `count` echoes what a path with the range `found` ± `spread` (m) gives."""
    for e in range(count):
        away = (ranges[e] - found) / spread
        if abs(away) < _FAR:
            densities[e] += weight * math.exp(-0.5 * away * away) / (spread * _ROOT_2PI)


@inlined
def _of_reading(undetected: float, densities: FloatArray, count: int, listened: float, noise: ReadingNoise) -> float:
    """Return the log-likelihood of a reading: of a ping that receives something, or nothing, from the room.

    `undetected` is that of the paths without an echo; the board has `listened` to this length of range (m).
    """
    strays = -noise.stray * listened
    likelihood = undetected + strays
    for e in range(count):
        likelihood += math.log(densities[e])
    strays += count * math.log(noise.stray)
    whole: float = np.logaddexp(math.log(1.0 - noise.lost) + likelihood, math.log(noise.lost) + strays)
    return whole


@array_part
def _on_axis(paths: PathArrays, by: Point, board: BoardValues) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return reported ranges (k,), the smallest one from each row on (k,), and directions, for a sensor on the axis.

    The directions of departure and towards the arriving sound, (k, 2) each, are horizontal parts of unit vectors.
    """
    out, back, rise, turn, kinds = paths.out, paths.back, paths.rise, paths.turn, paths.kind
    count = out.shape[0]
    reported, nearest, leaving, arriving = np.empty(count), np.empty(count), np.empty((count, 2)), np.empty((count, 2))
    for k in range(count):
        one = displaced(out[k], back[k], turn[k], kinds[k], by, by)
        there, on, arriving[k, 0], arriving[k, 1] = _legs(one, rise[k], turn[k], kinds[k])
        leaving[k, 0], leaving[k, 1] = one[0] / there, one[1] / there
        reported[k] = (there + on) / 2 * board.stretch + board.offset
    least = np.inf
    for k in range(count - 1, -1, -1):
        least = min(least, reported[k])
        nearest[k] = least
    return reported, nearest, leaving, arriving


@compiled_part
def _legs(
    one: tuple[float, float, float, float], rise: FloatArray, turn: FloatArray, kind: int
) -> tuple[float, float, float, float]:
    """Return the lengths of `out` and `back` of a path, m, and the unit vector (x, y) towards the arriving sound."""
    ox, oy, bx, by = one
    there = max(math.sqrt(ox * ox + oy * oy + rise[0] ** 2), 1e-12)
    if kind == BENT:
        on = max(math.sqrt(bx * bx + by * by + rise[1] ** 2), 1e-12)
        return there, on, bx / on, by / on
    # back along the image's axes: R⁻¹(-u)
    across = (turn[0] * oy - turn[1] * ox) / there
    return there, 0.0, -(turn[0] * ox + turn[1] * oy) / there, across if kind == ODD else -across


@array_part
def _needed(strengths: FloatArray, until: NDArray[np.int64], noise: ReadingNoise) -> FloatArray:
    """Return the least factor by the beam at which each path, or the sum that it begins, can be detected, (k,)."""
    least = math.exp(-_FAR * noise.level * _PER_DB)
    needed = np.empty(strengths.shape[0])
    for k in range(strengths.shape[0]):
        whole = strengths[k]
        for j in range(k + 1, until[k]):
            whole += strengths[j]
        amplitude = least * _FAINT if whole > strengths[k] else least
        needed[k] = amplitude / strengths[k] if whole > least else np.inf
    return needed


@compiled_part
def _chance_of_sum(first: float, others: float, spread: float) -> float:
    """Return the probability that the sum of two amplitudes of unknown phases exceeds 1; `spread` (dB) is its error."""
    far = math.exp(_FAR * spread * _PER_DB)
    if abs(first - others) > far:
        return 1.0
    if (first + others) * far < 1.0:
        return 0.0
    chance = 0.0
    for cosine in _PHASES:
        power = first * first + others * others + 2.0 * first * others * cosine
        chance += _normal(10.0 * math.log10(power) / spread)
    return chance / len(_PHASES)


@compiled_part
def _turned(from_axis: Point, axis: Point, x: float, y: float) -> Point:
    """Return a point given ahead and to the left of the axis, m, in room coordinates; the head points along x, y."""
    return axis[0] + from_axis[0] * x - from_axis[1] * y, axis[1] + from_axis[0] * y + from_axis[1] * x


@compiled_part
def _reach(board: BoardValues) -> float:
    """Return the larger distance of sender and listener from the axis, m."""
    return max(math.hypot(board.sender[0], board.sender[1]), math.hypot(board.listener[0], board.listener[1]))


@compiled_part
def _normal(x: float) -> float:
    """Return the share of a normal distribution below x standard deviations."""
    if abs(x) > _FAR:
        return 1.0 if x > 0.0 else 0.0
    share: float = 0.5 * math.erfc(-x / _ROOT_2)
    return share


@compiled_part
def _mass(reported: float, ranges: FloatArray, count: int, ends: bool, board: BoardValues, spread: float) -> float:
    """Return the share of an echo's normal distribution about `reported` inside the intervals of listening."""
    mass, begin = 0.0, board.opens
    for e in range(count):
        if ranges[e] > begin:
            mass += _normal((ranges[e] - reported) / spread) - _normal((begin - reported) / spread)
        begin = ranges[e] + board.dead
    if not ends and board.closes > begin:
        mass += _normal((board.closes - reported) / spread) - _normal((begin - reported) / spread)
    return mass


@compiled_part
def _late(over: float, lateness: FloatArray) -> float:
    """Return the error in range, m, of the late detection of an echo `over` dB over the threshold."""
    if lateness.shape[0] == 0:
        return 0.0
    at = min(max(over / LATENESS_STEP, 0.0), lateness.shape[0] - 1.001)
    node = int(at)
    late: float = lateness[node] + (at - node) * (lateness[node + 1] - lateness[node])
    return late
