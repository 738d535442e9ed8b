"""Exact sound of whole rigid rooms in the plan, by boundary elements, for every heading at once.

Unknown is the jump of pressure over each element, as in `boundary_elements`. Sources and receivers are cylindrical
harmonics about the place of the transducer: all headings follow from one solution at each frequency. Frequencies are
complex, so that sound fades with time; this is undone in the signal. Nothing then returns from beyond the time window,
and no resonance is sharp. Time dependence e^{+jωt}. Nothing here is of the product, and nothing uses rays.
"""

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.linalg import lu_factor, lu_solve
from scipy.signal import lfilter
from scipy.special import hankel2, i0, j1

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
Point = tuple[float, float]

_NEAR = 0.35  # wavelengths: nearer elements are integrated with more points
_FAR_NODES, _FAR_WEIGHTS = np.polynomial.legendre.leggauss(2)
_NEAR_NODES, _NEAR_WEIGHTS = np.polynomial.legendre.leggauss(6)
_STEPS = 100  # of the table of Hankel functions, on a wavelength
_FADES = 3.0  # powers of ten of amplitude within the time window
_FEWEST = 2  # elements on a wall
_KAISER, _LEAST_TAPER = 10.0, 0.03


@dataclass(frozen=True)
class RigidRoom:
    """Rigid surfaces round a place at the origin; all lengths in m."""

    outline: Sequence[Point]  # corners of a closed polygon; each piece between two of them has elements of its own
    plates: Sequence[Sequence[Point]] = ()  # chains of points of thin plates
    posts: Sequence[tuple[float, float, float]] = ()  # x, y, radius


@dataclass(frozen=True)
class Band:
    """Frequencies of a time window."""

    carrier: float  # wavelength, m
    window: float  # m: longest path
    count: int  # frequencies to each side of the carrier

    @property
    def offsets(self) -> Floats:
        """Wave numbers above the carrier, (2 count + 1,) rad/m."""
        return np.asarray(math.tau / self.window * np.arange(-self.count, self.count + 1), np.float64)

    @property
    def fading(self) -> float:
        """Loss by the imaginary part of the wave number, nepers/m."""
        return _FADES * math.log(10) / self.window

    @property
    def wavenumbers(self) -> Complexes:
        """Complex wave numbers, (2 count + 1,) rad/m."""
        return np.asarray(math.tau / self.carrier + self.offsets - 1j * self.fading)


@dataclass(frozen=True)
class _Mesh:
    """Elements: pieces between nodes."""

    nodes: Floats  # (p, 2)
    ends: NDArray[np.intp]  # (n, 2), rows of nodes

    @property
    def vectors(self) -> Floats:
        return np.asarray(self.nodes[self.ends[:, 1]] - self.nodes[self.ends[:, 0]])

    @property
    def lengths(self) -> Floats:
        return np.asarray(np.hypot(*self.vectors.T))

    @property
    def tangents(self) -> Floats:
        return self.vectors / self.lengths[:, None]

    @property
    def normals(self) -> Floats:
        return np.column_stack((-self.tangents[:, 1], self.tangents[:, 0]))

    def points(self, share: float) -> Floats:
        """Return the points at a share of each element, (n, 2)."""
        return self.nodes[self.ends[:, 0]] + share * self.vectors


def mesh_of(room: RigidRoom, wavelength: float, per_wavelength: float) -> _Mesh:
    """Return elements, at least `per_wavelength` of them, of equal length on each wall.

    Shorter ones at ends and corners are worse: the slope at the middle of an element is wrong where its neighbours have
    other lengths. With them, the end of a skirting was 3.5 dB too loud.
    """
    size, nodes, ends, count = wavelength / per_wavelength, [], [], 0
    chains = [[*room.outline, room.outline[0]], *room.plates]
    pieces = [_piece(np.array(a), np.array(b), size) for chain in chains for a, b in itertools.pairwise(chain)]
    for points in [*pieces, *(_circle(*post, size) for post in room.posts)]:
        nodes.append(points)
        first = count + np.arange(len(points) - 1)
        ends.append(np.column_stack((first, first + 1)))
        count += len(points)
    return _Mesh(np.concatenate(nodes), np.concatenate(ends))


def _piece(begin: Floats, end: Floats, size: float) -> Floats:
    count = max(_FEWEST, math.ceil(math.dist(begin, end) / size))
    return np.asarray(begin + np.linspace(0.0, 1.0, count + 1)[:, None] * (end - begin))


def _circle(x: float, y: float, radius: float, size: float) -> Floats:
    count = max(20, math.ceil(math.tau * radius / size * 1.3))
    turn = math.tau / count
    # a polygon of the same area
    corners = radius * math.sqrt(turn / math.sin(turn)) * np.exp(1j * turn * np.arange(count + 1))
    return np.column_stack((x + corners.real, y + corners.imag))


def responses(room: RigidRoom, band: Band, orders: int, per_wavelength: float = 6.0) -> Iterator[Complexes]:
    """Yield, at each frequency, what each harmonic at the place receives of each, (2 orders + 1, 2 orders + 1).

    Column n is the sound of a source Hₙ(kr) e^{jnθ}, n from -`orders` on; row m the coefficient of Jₘ(kr) e^{jmθ} of
    what the room returns.
    """
    mesh = mesh_of(room, band.carrier, per_wavelength)
    near = _near_pairs(mesh, band.carrier)
    for k in band.wavenumbers.tolist():
        sent = _flow(mesh.points(0.5), mesh.normals, k, orders)
        jump = _solved(_matrix(mesh, near, k), -sent)
        heard = np.zeros_like(sent)
        for node, weight in zip(_FAR_NODES, _FAR_WEIGHTS, strict=True):
            # of order -m, up to its sign (-1)^m
            heard += weight / 2 * mesh.lengths[:, None] * _flow(mesh.points((node + 1) / 2), mesh.normals, k, orders)
        signs = (-1.0) ** np.arange(-orders, orders + 1)
        yield np.asarray(-0.25j * (signs * heard)[:, ::-1].T @ jump)


def _solved(matrix: Complexes, sides: Complexes) -> Complexes:
    """Return the solution for right sides, by factors of half the precision and a correction, to 10⁻⁶."""
    factors = lu_factor(matrix.astype(np.complex64), overwrite_a=True, check_finite=False)
    found = np.asarray(lu_solve(factors, sides.astype(np.complex64)), np.complex128)
    return np.asarray(found + lu_solve(factors, (sides - matrix @ found).astype(np.complex64)))


def _flow(points: Floats, normals: Floats, k: complex, orders: int) -> Complexes:
    """Return the derivative along normals of Hₙ(kr) e^{jnθ} at points (n, 2), for n from -orders on, (n, 2 o + 1)."""
    radius, angle = np.hypot(*points.T), np.arctan2(points[:, 1], points[:, 0])
    waves = np.empty((orders + 2, len(points)), np.complex128)
    waves[0], waves[1] = hankel2(0, k * radius), hankel2(1, k * radius)
    for n in range(1, orders + 1):
        waves[n + 1] = 2 * n / (k * radius) * waves[n] - waves[n - 1]
    outward, across = (points * normals).sum(axis=1) / radius, (points[:, 0] * normals[:, 1]).copy()
    across = (across - points[:, 1] * normals[:, 0]) / radius
    result = np.empty((len(points), 2 * orders + 1), np.complex128)
    for n in range(orders + 1):
        slope = -k * waves[1] if n == 0 else k * (waves[n - 1] - n / (k * radius) * waves[n])
        for sign in (1, -1):
            # H of order -n is (-1)^n of that of order n
            turn = (1.0 if sign == 1 or n % 2 == 0 else -1.0) * np.exp(1j * sign * n * angle)
            result[:, orders + sign * n] = turn * (slope * outward + 1j * sign * n * waves[n] / radius * across)
    return result


def _near_pairs(mesh: _Mesh, wavelength: float) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    middles = mesh.points(0.5)
    apart = np.hypot(*np.moveaxis(middles[:, None] - middles, -1, 0))
    one, other = np.nonzero(apart < _NEAR * wavelength)
    return one, other


def _matrix(mesh: _Mesh, near: tuple[NDArray[np.intp], NDArray[np.intp]], k: complex) -> Complexes:
    """Return the derivative along the normal at the middle of each element of the double layer of each, (n, n).

    By Maue: a difference of both ends of the element, and a single layer.
    """
    middles, tangents, normals, lengths = mesh.points(0.5), mesh.tangents, mesh.normals, mesh.lengths
    step = math.tau / k.real / _STEPS
    farthest = float(np.hypot(*np.ptp(mesh.nodes, axis=0)))
    distances = np.arange(math.ceil(farthest / step) + 3) * step
    distances[0] = step
    zero, one = hankel2(0, k * distances), hankel2(1, k * distances)
    table = np.column_stack((zero, -k * one * step, one, (k * zero - one / distances) * step))
    points = np.stack([mesh.points((node + 1) / 2) for node in _FAR_NODES])
    matrix = np.empty((len(lengths), len(lengths)), np.complex128, order="F")
    _fill(middles, tangents, normals, lengths, mesh.nodes, mesh.ends, points, table, step, k, matrix)
    matrix[near] = _entries(mesh, *near, k)
    return matrix


@njit(cache=True, fastmath=True)
def _fill(
    middles: Floats,
    tangents: Floats,
    normals: Floats,
    lengths: Floats,
    nodes: Floats,
    ends: NDArray[np.intp],
    points: Floats,
    table: Complexes,
    step: float,
    k: complex,
    matrix: Complexes,
) -> None:
    slopes = np.empty((len(nodes), len(middles)), np.complex128)
    for p in range(len(nodes)):
        for i in range(len(middles)):
            x, y = middles[i, 0] - nodes[p, 0], middles[i, 1] - nodes[p, 1]
            distance = math.sqrt(x * x + y * y)
            at = distance / step
            row = int(at)
            t = at - row
            wave = (
                (1 + 2 * t) * (1 - t) * (1 - t) * table[row, 2]
                + t * (1 - t) * (1 - t) * table[row, 3]
                + t * t * (3 - 2 * t) * table[row + 1, 2]
                + t * t * (t - 1) * table[row + 1, 3]
            )
            slopes[p, i] = 0.25j * k * wave * (x * tangents[i, 0] + y * tangents[i, 1]) / distance
    for j in range(len(ends)):
        first, last = ends[j]
        for i in range(len(middles)):
            single = 0.0j
            for node in range(points.shape[0]):
                x, y = middles[i, 0] - points[node, j, 0], middles[i, 1] - points[node, j, 1]
                at = math.sqrt(x * x + y * y) / step
                row = int(at)
                t = at - row
                single += (
                    (1 + 2 * t) * (1 - t) * (1 - t) * table[row, 0]
                    + t * (1 - t) * (1 - t) * table[row, 1]
                    + t * t * (3 - 2 * t) * table[row + 1, 0]
                    + t * t * (t - 1) * table[row + 1, 1]
                )
            facing = normals[i, 0] * normals[j, 0] + normals[i, 1] * normals[j, 1]
            matrix[i, j] = slopes[first, i] - slopes[last, i] + k * k * facing * (-0.125j) * lengths[j] * single


def _entries(mesh: _Mesh, one: NDArray[np.intp], other: NDArray[np.intp], k: complex) -> Complexes:
    """Return entries of the matrix of near pairs of elements, (p,)."""
    middles, normals, lengths = mesh.points(0.5)[one], mesh.normals, mesh.lengths[other]
    result = np.zeros(len(one), np.complex128)
    for end, sign in ((0, 1.0), (1, -1.0)):
        away = middles - mesh.nodes[mesh.ends[other, end]]
        distance = np.hypot(*away.T)
        result += sign * 0.25j * k * hankel2(1, k * distance) / distance * (away * mesh.tangents[one]).sum(axis=1)
    single = np.zeros_like(result)
    for node, weight in zip(_NEAR_NODES, _NEAR_WEIGHTS, strict=True):
        away = middles - mesh.points((node + 1) / 2)[other]
        single += weight / 2 * lengths * -0.25j * hankel2(0, k * np.maximum(np.hypot(*away.T), 1e-12))
    own = one == other
    # the logarithm of an element at its own middle
    single[own] = lengths[own] * (-0.25j - (np.log(k * lengths[own] / 4) + np.euler_gamma - 1) / math.tau)
    return np.asarray(result + k**2 * (normals[one] * normals[other]).sum(axis=1) * single)


# What a transducer receives.


def beam_at(cosines: Floats, ka: float) -> Floats:
    """Return the beam of a disc, 2 J₁(x)/x cos α with x = ka sin α, nothing to the rear, same shape.

    It is the definition of the product, an input here: not what is tested.
    """
    x = ka * np.sqrt(np.maximum(1 - cosines**2, 1e-12))
    return np.asarray(np.where(cosines > 0, 2 * j1(x) / x * cosines, 0.0))


def beam_harmonics(ka: float, orders: int) -> Floats:
    """Return the coefficients of the beam, of e^{jnα} for n from -orders on, (2 orders + 1,)."""
    angles = (np.arange(4096) + 0.5) * math.tau / 4096
    beam = beam_at(np.cos(angles), ka)
    return np.array([(beam * np.cos(n * angles)).mean() for n in range(-orders, orders + 1)])


def received(response: Complexes, k: complex, beam: Floats, headings: Floats) -> Complexes:
    """Return the sound at headings (h,) rad relative to that of an endless wall, times 1/√L of its path, (h,)."""
    orders = len(beam) // 2
    n = np.arange(-orders, orders + 1)
    sent = beam * (-1j) ** n
    turned = np.exp(-1j * np.outer(headings, n))
    # a wave from α has coefficients j^m e^{-jmα}; those of the source are -j/4 times H, and so is the wall's
    heard = ((turned.conj() * sent) @ response * (turned * sent)).sum(axis=1)
    return np.asarray(heard / (np.sqrt(2 / (math.pi * k)) * np.exp(0.25j * math.pi)))


def envelope(spectra: Complexes, band: Band, count: int) -> Complexes:
    """Return the impulse response of damped spectra (2 band.count + 1, h) at `count` equal steps of length, (count, h).

    It is the complex envelope on the carrier, relative to that of an endless wall at every length, in a tapered band:
    the sum over its frequencies.
    """
    rows = np.zeros((count, spectra.shape[1]), np.complex128)
    rows[np.arange(-band.count, band.count + 1)] = spectra * _taper_at(band.offsets, band)[:, None]
    lengths = np.arange(count) * band.window / count
    undone = np.exp(band.fading * lengths) * np.sqrt(lengths)
    return np.asarray(np.fft.ifft(rows, axis=0, norm="forward") * undone[:, None])


@dataclass(frozen=True)
class Pulse:
    """What the receiver makes of an impulse, in steps of length; its peak, or its charge, is 1."""

    spectrum: Complexes  # (count,), by which that of a signal is multiplied
    kept: float  # of the charge from one step to the next; 0: the signal itself is the charge


def short_pulse(band: Band, count: int) -> Pulse:
    """Return the shortest pulse of a band, without charge."""
    return Pulse(np.full(count, 1 / _taper_at(band.offsets, band).sum() + 0j), 0.0)


def burst_pulse(band: Band, count: int, spectrum: Complexes, integration: float) -> Pulse:
    """Return the pulse of a burst that charges a capacitor with a time constant of `integration` m of path.

    `spectrum` (count,) is that of the burst at the frequencies of a signal.
    """
    offsets = np.asarray(math.tau * np.fft.fftfreq(count, band.window / count), np.float64)
    taper, kept = _taper_at(offsets, band), math.exp(-band.window / count / integration)
    wanted = np.where(taper > _LEAST_TAPER, spectrum / np.maximum(taper, _LEAST_TAPER), 0.0)
    alone = np.abs(np.fft.ifft(wanted * taper, norm="forward"))
    return Pulse(wanted / charge(np.roll(alone, count // 8)[:, None], kept).max(), kept)


def _taper_at(offsets: Floats, band: Band) -> Floats:
    """Return the taper of a band at wave numbers above the carrier, same shape: Kaiser's, for its low side lobes.

    A lobe of an early echo grows as fading is undone.
    """
    share = np.minimum(np.abs(offsets) * band.window / math.tau / (band.count + 1), 1.0)
    return np.asarray(i0(_KAISER * np.sqrt(1 - share**2)) / i0(_KAISER) * (share < 1))


def charge(levels: Floats, kept: float) -> Floats:
    """Return the charge by levels (n, h) of a capacitor that keeps a share of it at each step, same shape."""
    return np.asarray(lfilter([1 - kept], [1, -kept], levels, axis=0)) if kept else levels


def first_echoes(signal: Complexes, band: Band, pulse: Pulse, threshold: float, limits: tuple[float, float]) -> Floats:
    """Return the range (m, NaN: none) of the first echo of each column of an impulse response (count, h).

    A charge has to reach the threshold, between the `limits` of the range. Without a charge, an echo is where the level
    is highest, not before.
    """
    ranges = np.arange(len(signal)) * band.window / len(signal) / 2
    within = ((ranges >= limits[0]) & (ranges <= limits[1]))[:, None]
    levels = np.abs(np.fft.ifft(np.fft.fft(signal, axis=0) * pulse.spectrum[:, None], axis=0))
    if pulse.kept:
        loud = charge(np.where(within, levels, 0.0), pulse.kept) >= threshold
    else:
        highest = (levels >= np.roll(levels, 1, axis=0)) & (levels >= np.roll(levels, -1, axis=0))
        loud = highest & (levels >= threshold)
    loud &= within
    return np.where(loud.any(axis=0), ranges[loud.argmax(axis=0)], np.nan)
