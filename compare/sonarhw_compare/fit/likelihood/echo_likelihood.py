"""How likely readings are, given the paths of a place: every echo heard, every echo not heard, and silence.

Takes readings as arrays, paths, what the board hears and how it errs; hands on one log-likelihood. Path k is heard with
chance d = (1 - missed) Φ((level - threshold) / σ_level), at its range ± σ_range; strays come anywhere. While the board
listens, until its first echo or, where it tells several, through all the gaps between them, the likelihood is

    Σ over echoes  ln(stray + Σ over paths  d N(r - ρ) / (1 - d m))  +  Σ over paths  ln(1 - d m)  -  stray · listened

with N the normal density and m the share of a path's normal that falls into the time of listening. For one echo that
is exactly the density of the first of independent arrivals. With chance `lost` a ping hears nothing of the room, and
what is told of it are strays, if anything. docs/how_to/fit.md derives it.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from sonarhw_sim.board.weighing import beam
from sonarhw_sim.compiled import compiled

from sonarhw.readings import FloatArray
from sonarhw_compare.fit.likelihood.echo_paths import BENT, ODD, displaced

LATENESS_STEP = 0.5  # dB
_FAR = 6.0  # standard deviations beyond which a normal is over
_ASIDE = 0.05  # cosine of the angle from the axis beyond which nothing is heard
_ROOT_2 = math.sqrt(2.0)
_ROOT_2PI = math.sqrt(2.0 * math.pi)


class Heard(NamedTuple):
    """A scan as the kernel wants it; n readings."""

    angles: FloatArray  # (n,), rad: turntable angle, home angle added
    ranges: FloatArray  # (n, e), m: of the echoes, NaN behind
    counts: NDArray[np.int64]  # (n,): echoes that count
    ends: NDArray[np.bool_]  # (n,): whether listening ended with the last of them


class Ear(NamedTuple):
    """What the board hears, and how."""

    heading: float  # rad, of the turntable's step 0
    ka: float
    threshold_db: float
    opens: float  # m: ranges between these are listened to
    closes: float
    dead: float  # m, after an echo
    stretch: float  # told range by true range
    offset: float  # m, told range beyond that
    sender: tuple[float, float]  # m, ahead and aside of the turning axis
    listener: tuple[float, float]


class Noise(NamedTuple):
    """How readings err."""

    range: float  # m
    level: float  # dB
    missed: float  # chance that a loud echo is not heard
    lost: float  # chance that a ping hears nothing of the room
    stray: float  # echoes of nothing, for every metre of range
    stretch: float = 1.0  # told ranges by true ones: the speed of sound by which they were told is never quite right


class Known(NamedTuple):
    """The paths of a scan's place, k of them, about shortest first."""

    out: FloatArray  # (k, 2), as in `EchoPaths`, and so
    back: FloatArray
    rise: FloatArray
    turn: FloatArray
    kind: NDArray[np.int8]
    level_db: FloatArray  # (k,), before the beam


@compiled
def log_likelihoods(
    heard: Heard, known: Known, ear: Ear, noise: Noise, table: FloatArray, lateness: FloatArray
) -> FloatArray:
    """Log-likelihood of every reading, (n,); `table` is the beam's (`sonarhw_sim.board.weighing`).

    `lateness` (l,) m is by how much an echo so many half decibels over the threshold is found late; empty: by nothing.
    """
    angles, echoes, counts, ended = heard.angles, heard.ranges, heard.counts, heard.ends
    known_out, back, rise, turn = known.out, known.back, known.rise, known.turn
    kinds, levels = known.kind, known.level_db
    told, nearest, leaving, arriving = _on_axis(known_out, back, rise, turn, kinds, ear)
    aside = ear.sender != (0.0, 0.0) or ear.listener != (0.0, 0.0)
    reach = _reach(ear) * ear.stretch
    needed = 10.0 ** ((ear.threshold_db - _FAR * noise.level - levels) / 20.0)
    likelihoods, densities = np.empty(angles.shape[0]), np.empty(echoes.shape[1])
    for i in range(angles.shape[0]):
        count, ranges = counts[i], echoes[i]
        ends = ended[i] and count > 0
        last = ranges[count - 1] if ends else ear.closes
        farthest = last + _FAR * noise.range + reach
        hx, hy = math.cos(ear.heading + angles[i]), math.sin(ear.heading + angles[i])
        sender, listener = _turned(ear.sender, hx, hy), _turned(ear.listener, hx, hy)
        densities[:] = noise.stray
        unheard = 0.0
        for k in range(told.shape[0]):
            if told[k] > farthest or needed[k] > 1.0:
                if nearest[k] > farthest:
                    break
                continue
            ahead, home = leaving[k, 0] * hx + leaving[k, 1] * hy, arriving[k, 0] * hx + arriving[k, 1] * hy
            if ahead < _ASIDE or home < _ASIDE:
                continue
            found = told[k]
            if aside:
                one = displaced(known_out[k], back[k], turn[k], kinds[k], sender, listener)
                there, on, bx, by = _legs(one, rise[k], turn[k], kinds[k])
                ahead, home = (one[0] * hx + one[1] * hy) / there, bx * hx + by * hy
                found = (there + on) / 2 * ear.stretch + ear.offset
            amplitude = beam(ahead, ear.ka, table)
            if amplitude < needed[k]:
                continue
            amplitude *= beam(home, ear.ka, table)
            if amplitude < needed[k]:
                continue

            over = levels[k] + 20.0 * math.log10(amplitude) - ear.threshold_db
            found += _late(over, lateness)
            chance = (1.0 - noise.missed) * _normal(over / noise.level)
            silence = 1.0 - chance * _mass(found, ranges, count, ends, ear, noise.range)
            unheard += math.log(silence)
            for e in range(count):
                away = (ranges[e] - found) / noise.range
                if abs(away) < _FAR:
                    densities[e] += chance / silence * math.exp(-0.5 * away * away) / (noise.range * _ROOT_2PI)

        strays = -noise.stray * max(0.0, last - ear.opens)
        likelihood = unheard + strays
        for e in range(count):
            likelihood += math.log(densities[e])
        strays += count * math.log(noise.stray)
        likelihoods[i] = np.logaddexp(math.log(1.0 - noise.lost) + likelihood, math.log(noise.lost) + strays)
    return likelihoods


@compiled
def _on_axis(
    out: FloatArray, back: FloatArray, rise: FloatArray, turn: FloatArray, kinds: NDArray[np.int8], ear: Ear
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Of paths from and to the turning axis: told range (k,), the least that it or a later one has (k,), directions.

    Directions (k, 2), of departure and of where each comes back from, are the horizontal parts of unit vectors.
    """
    count = out.shape[0]
    told, nearest, leaving, arriving = np.empty(count), np.empty(count), np.empty((count, 2)), np.empty((count, 2))
    for k in range(count):
        one = (out[k, 0], out[k, 1], back[k, 0], back[k, 1])
        there, on, arriving[k, 0], arriving[k, 1] = _legs(one, rise[k], turn[k], kinds[k])
        leaving[k, 0], leaving[k, 1] = one[0] / there, one[1] / there
        told[k] = (there + on) / 2 * ear.stretch + ear.offset
    least = np.inf
    for k in range(count - 1, -1, -1):
        least = min(least, told[k])
        nearest[k] = least
    return told, nearest, leaving, arriving


@compiled
def _legs(
    one: tuple[float, float, float, float], rise: FloatArray, turn: FloatArray, kind: int
) -> tuple[float, float, float, float]:
    """Lengths of `out` and `back` of a path, m, and the unit vector, x and y, from where it comes back."""
    ox, oy, bx, by = one
    there = max(math.sqrt(ox * ox + oy * oy + rise[0] ** 2), 1e-12)
    if kind == BENT:
        on = max(math.sqrt(bx * bx + by * by + rise[1] ** 2), 1e-12)
        return there, on, bx / on, by / on
    # back along the image's axes: R⁻¹(-u)
    across = (turn[0] * oy - turn[1] * ox) / there
    return there, 0.0, -(turn[0] * ox + turn[1] * oy) / there, across if kind == ODD else -across


@compiled
def _turned(from_axis: tuple[float, float], x: float, y: float) -> tuple[float, float]:
    """A point ahead and aside of the axis, m, in the room, where the head points along x, y."""
    return from_axis[0] * x - from_axis[1] * y, from_axis[0] * y + from_axis[1] * x


@compiled
def _reach(ear: Ear) -> float:
    """How far sender or listener are from the axis, m."""
    return max(math.hypot(ear.sender[0], ear.sender[1]), math.hypot(ear.listener[0], ear.listener[1]))


@compiled
def _normal(x: float) -> float:
    """Share of a normal distribution below x standard deviations."""
    if abs(x) > _FAR:
        return 1.0 if x > 0.0 else 0.0
    share: float = 0.5 * math.erfc(-x / _ROOT_2)
    return share


@compiled
def _mass(told: float, ranges: FloatArray, count: int, ends: bool, ear: Ear, spread: float) -> float:
    """Share of an echo's normal, about `told`, that falls into the time of listening."""
    mass, begin = 0.0, ear.opens
    for e in range(count):
        if ranges[e] > begin:
            mass += _normal((ranges[e] - told) / spread) - _normal((begin - told) / spread)
        begin = ranges[e] + ear.dead
    if not ends and ear.closes > begin:
        mass += _normal((ear.closes - told) / spread) - _normal((begin - told) / spread)
    return mass


@compiled
def _late(over: float, lateness: FloatArray) -> float:
    """By how much an echo `over` dB above the threshold is found late, m."""
    if lateness.shape[0] == 0:
        return 0.0
    at = min(max(over / LATENESS_STEP, 0.0), lateness.shape[0] - 1.001)
    node = int(at)
    late: float = lateness[node] + (at - node) * (lateness[node + 1] - lateness[node])
    return late
