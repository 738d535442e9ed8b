"""Exact sound of a line source among rigid plates, solids and posts, in two dimensions, by boundary elements.

The unknown is the jump of pressure over each element, a short straight piece of a surface. The normal derivative of its
double layer is written without a singular integral (Maue 1949): as a difference of two ends of the element, and an
integral of the single layer. An endless rigid wall is a mirror. Time dependence e^{+jωt}.
"""

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lstsq
from scipy.special import hankel2

from tests.oracles.exact.exact_levels import WAVELENGTH, decibels

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
Point = tuple[float, float]

_ELEMENTS, _FEWEST = 16, 6  # on a wavelength; on a wall
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(3)
_INNER = 12  # points within each solid
_SQUARE = np.array([[0.5, 0.5], [-0.5, 0.5], [-0.5, -0.5], [0.5, -0.5], [0.5, 0.5]])
_BAND, _STEP = 0.03, 0.003  # of the carrier: frequencies of the burst of 16 cycles, and their spacing


@dataclass(frozen=True)
class RigidScene:
    """Rigid surfaces; all lengths in m."""

    plates: Sequence[Sequence[Point]] = ()  # chains of points; a closed chain is a solid
    posts: Sequence[tuple[float, float, float]] = ()  # x, y, radius
    mirror: float | None = None  # x of an endless wall across the x axis

    def elements(self, finer: int) -> Floats:
        """Return the ends of all elements, (n, 2, 2), of equal length on each wall, `finer` times as many as needed."""
        parts = [ends for chain in self.plates for ends in _pieces(chain, finer)]
        for x, y, radius in self.posts:
            count = finer * max(12, math.ceil(math.tau * radius / WAVELENGTH * _ELEMENTS))
            turn = math.tau / count
            # a polygon of the same area
            outer = radius * math.sqrt(turn / math.sin(turn))
            corners = outer * np.exp(1j * turn * np.arange(count + 1))
            points = np.column_stack((x + corners.real, y + corners.imag))
            parts.append(np.stack((points[:-1], points[1:]), axis=1))
        return np.concatenate(parts) if parts else np.empty((0, 2, 2))

    def inner_points(self) -> Floats:
        """Return points inside of solids and posts, (p, 2), at irregular places."""
        random, parts = np.random.default_rng(0), [np.empty((0, 2))]
        outlines = [np.array(chain) for chain in self.plates if tuple(chain[0]) == tuple(chain[-1])]
        outlines += [np.array([x, y]) + radius * _SQUARE for x, y, radius in self.posts]
        for corners in outlines:
            weights = random.dirichlet(np.ones(len(corners) - 1), _INNER)
            parts.append(weights @ corners[:-1])
        return np.concatenate(parts)


def _pieces(chain: Sequence[Point], finer: int) -> Iterator[Floats]:
    for begin, end in itertools.pairwise(np.array(chain)):
        # equal ones: near neighbours of another length, the slope at the middle of an element is wrong
        count = finer * max(_FEWEST, math.ceil(math.dist(begin, end) / WAVELENGTH * _ELEMENTS))
        points = begin + np.linspace(0.0, 1.0, count + 1)[:, None] * (end - begin)
        yield np.stack((points[:-1], points[1:]), axis=1)


def _green(k: float, x: Floats, y: Floats) -> Complexes:
    return np.asarray(-0.25j * hankel2(0, k * np.hypot(*np.moveaxis(x - y, -1, 0))))


def _gradient(k: float, x: Floats, y: Floats) -> Complexes:
    """Return the gradient of the sound of a source at y with respect to x, (..., 2)."""
    away = x - y
    distance = np.hypot(*np.moveaxis(away, -1, 0))
    return np.asarray((0.25j * k * hankel2(1, k * distance) / distance)[..., None] * away)


def _normals(ends: Floats) -> tuple[Floats, Floats, Floats]:
    along = ends[:, 1] - ends[:, 0]
    lengths = np.hypot(*along.T)
    tangents = along / lengths[:, None]
    return tangents, np.column_stack((-tangents[:, 1], tangents[:, 0])), lengths


def _matrix(k: float, ends: Floats, sources: Floats) -> Complexes:
    """Return the normal derivative at the middle of elements (n, 2, 2) of the double layers of others (m, 2, 2)."""
    middles = ends.mean(axis=1)
    tangents, normals, _ = _normals(ends)
    _, other_normals, lengths = _normals(sources)
    result = np.zeros((len(ends), len(sources)), np.complex128)
    for end, sign in ((0, 1.0), (1, -1.0)):
        slope = _gradient(k, middles[:, None], sources[None, :, end])
        result += sign * (slope * tangents[:, None]).sum(axis=2)
    single = np.zeros_like(result)
    for node, weight in zip(_NODES, _WEIGHTS, strict=True):
        point = sources[:, 0] + (node + 1) / 2 * (sources[:, 1] - sources[:, 0])
        distance = np.hypot(*np.moveaxis(middles[:, None] - point, -1, 0))
        single += weight / 2 * lengths * -0.25j * hankel2(0, k * np.maximum(distance, 1e-12))
    if ends is sources:
        # the logarithm of an element at its own middle
        own = lengths * (-0.25j - (np.log(k * lengths / 4) + np.euler_gamma - 1) / math.tau)
        np.fill_diagonal(single, own)
    return np.asarray(result + k**2 * (normals @ other_normals.T) * single)


def _mirrored(ends: Floats, mirror: float) -> Floats:
    """Return the mirror images of elements, in the order that mirrors their normals."""
    images = ends.copy()
    images[..., 0] = 2 * mirror - images[..., 0]
    return np.ascontiguousarray(images[:, ::-1])


def scattered(scene: RigidScene, place: Point, k: float, receiver: Point | None = None) -> complex:
    """Return the sound at `receiver` of a source at `place`, without that which comes straight, at wave number k.

    The error of equal elements is proportional to their length, so that of two lengths gives the limit (Richardson).
    """
    coarse, fine = (_scattered(scene, place, k, receiver, finer) for finer in (1, 2))
    return 2 * fine - coarse


def _scattered(scene: RigidScene, place: Point, k: float, receiver: Point | None, finer: int) -> complex:
    source = np.array(place, dtype=np.float64)
    end = source if receiver is None else np.array(receiver, dtype=np.float64)
    ends = scene.elements(finer)
    sources, total = [source], 0.0 + 0.0j
    if scene.mirror is not None:
        sources.append(np.array([2 * scene.mirror - source[0], source[1]]))
        total += complex(_green(k, end, sources[1]))
    if not len(ends):
        return total
    layers = [ends] if scene.mirror is None else [ends, _mirrored(ends, scene.mirror)]
    matrix = np.sum([_matrix(k, ends, layer) for layer in layers], axis=0)
    middles, (_, normals, _) = ends.mean(axis=1), _normals(ends)
    incident = np.sum([(_gradient(k, middles, point) * normals).sum(axis=1) for point in sources], axis=0)
    inner = scene.inner_points()
    if len(inner):
        # the pressure inside of a solid is 0: else the equations have other solutions at its resonances
        matrix = np.vstack((matrix, k * np.sum([_double_layer(k, inner, layer) for layer in layers], axis=0)))
        incident = np.append(incident, k * np.sum([_green(k, inner, point) for point in sources], axis=0))
        jump = lstsq(matrix, -incident, check_finite=False, lapack_driver="gelsy")[0]
    else:
        jump = np.linalg.solve(matrix, -incident)
    return total + complex(np.sum([_double_layer(k, end[None], layer)[0] for layer in layers], axis=0) @ jump)


def _double_layer(k: float, points: Floats, layer: Floats) -> Complexes:
    """Return the sound at points (p, 2) of a jump of 1 at each element (n, 2, 2), (p, n)."""
    _, normals, widths = _normals(layer)
    return np.asarray(-(_gradient(k, points[:, None], layer.mean(axis=1)) * normals).sum(axis=2) * widths)


def level_of_wall(scene: RigidScene, place: Point = (0.0, 0.0)) -> float:
    """Return the level of the echo of the mirror past the other surfaces, dB relative to the bare mirror.

    It is the mean over the frequencies of the burst, with the phase of the mirror's path, so what arrives 0.1 m earlier
    or later, up to 2 m, is not in it.
    """
    offsets = np.arange(-_BAND, _BAND + _STEP / 2, _STEP)
    weights = np.cos(offsets / _BAND * math.pi / 2.2) ** 2
    total = 0.0 + 0.0j
    for offset, weight in zip(offsets.tolist(), weights.tolist(), strict=True):
        k = math.tau / WAVELENGTH * (1 + offset)
        total += weight * scattered(scene, place, k) / scattered(RigidScene(mirror=scene.mirror), place, k)
    return decibels(total / weights.sum())
