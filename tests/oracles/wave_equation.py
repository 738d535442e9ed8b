"""Solver of the two-dimensional wave equation by finite differences, independent of rays.

For a scene (walls, posts, a source, a receiver) it returns the received echoes of a short tone burst by length of path,
and length and strength of the one nearest to a given length. Strengths are relative to a flat wall, with the spreading
of a line source, 1/√length, divided out.

Pressure is on square cells, with leapfrog steps in time. A rigid surface is a face without flow. An oblique or round
surface cuts cells and faces, which count by their share of air. The grid is large enough that nothing returns from its
border in time. The direct sound, computed without surfaces, is subtracted, so only echoes remain.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.signal import correlate, hilbert

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]
Wall = tuple[float, float, float, float]
Post = tuple[float, float, float]

CELL = 0.001  # m
WAVELENGTH = 24 * CELL
FARTHEST = 0.85  # m: length of the longest path received
_COURANT = 0.7  # cells that sound travels in a step
STEP = _COURANT * CELL  # m
_CYCLES = 4  # of the burst, under a Hann window
_FLAT_WALL = 0.2405  # m from the source, on a line between cells
_ON_SURFACE = 1e-9  # m
_MARGIN = 8  # cells


@dataclass(frozen=True)
class Scene:
    """Rigid objects round a source at the origin; all lengths in m.

    The space to the right of all walls of a solid is rigid. A wall in no solid is a thin plate, on a line between cells
    (x or y an odd multiple of half a cell).
    """

    name: str
    walls: tuple[Wall, ...] = ()
    solids: tuple[tuple[int, ...], ...] = ()
    posts: tuple[Post, ...] = ()
    receiver: tuple[float, float] = (0.0, 0.0)  # at the centre of a cell
    shadowed: bool = False  # whether an object is between source and receiver


@dataclass(frozen=True)
class Arrival:
    """One echo."""

    length: float  # m, from source to receiver
    strength: float  # amplitude relative to a flat wall, with spreading divided out


FLAT_WALL = Scene("flat wall", walls=((_FLAT_WALL, -9.0, _FLAT_WALL, 9.0),), solids=((0,),))


@lru_cache
def echoes(scene: Scene) -> Floats:
    """Return the received echoes of the surfaces, one sample every STEP of length."""
    air, gains = _faces(scene), _gains(scene)
    received = _march(*air, gains, _burst(), *_cells(scene.receiver))
    return np.asarray(received if scene.shadowed else received - direct(scene.receiver))


@lru_cache
def direct(receiver: tuple[float, float]) -> Floats:
    """Return the received sound in free air, sampled as `echoes`."""
    free = Scene("nothing", receiver=receiver)
    return np.asarray(_march(*_faces(free), _gains(free), _burst(), *_cells(receiver)))


def arrival_near(scene: Scene, length: float, within: float = WAVELENGTH / 2) -> Arrival:
    """Return the strongest echo with a path of `length` m ± `within`."""
    strengths, lengths = matched(scene)
    near = np.flatnonzero(np.abs(lengths - length) <= within)
    best = int(near[np.argmax(strengths[near])])
    # the maximum of the parabola through three samples
    before, at, after = strengths[best - 1 : best + 2]
    shift = np.clip(0.5 * (before - after) / (before - 2 * at + after), -0.5, 0.5)
    found = lengths[best] + shift * STEP
    return Arrival(float(found), float(at - 0.25 * (before - after) * shift))


def matched(scene: Scene) -> tuple[Floats, Floats]:
    """Return the strength of the echoes relative to a flat wall, with spreading divided out, and their lengths, m."""
    pattern = np.asarray(hilbert(echoes(FLAT_WALL)))
    likeness = np.abs(correlate(np.asarray(hilbert(echoes(scene))), pattern, method="fft"))
    lengths = np.arange(1.0 - len(pattern), 1 + len(likeness) - len(pattern)) * STEP + 2 * _FLAT_WALL
    spreading = np.sqrt(np.maximum(lengths, 0.0) / (2 * _FLAT_WALL))
    return np.asarray(likeness / np.sum(np.abs(pattern) ** 2) * spreading), lengths


def _burst() -> Floats:
    lengths = np.arange(round(_CYCLES * WAVELENGTH / STEP)) * STEP
    share = lengths / (_CYCLES * WAVELENGTH)
    return np.asarray(np.sin(np.pi * share) ** 2 * np.sin(2 * np.pi * lengths / WAVELENGTH))


def _cells(point: tuple[float, float]) -> tuple[int, int]:
    return round(point[0] / CELL), round(point[1] / CELL)


def _lines(scene: Scene) -> Floats:
    """Return the coordinates of the lines between cells; paths beyond the outermost are too long."""
    radius = int((FARTHEST + np.hypot(*scene.receiver)) / CELL / 2) + 2 * _MARGIN
    return np.asarray((np.arange(-radius, radius + 2) - 0.5) * CELL)


def _clearance(scene: Scene, x: Floats, y: Floats) -> Floats:
    """Return the distance of points to the nearest solid or post, m; negative inside."""
    clearance = np.full(np.broadcast_shapes(x.shape, y.shape), FARTHEST)
    for solid in scene.solids:
        sides = [_left_of(scene.walls[wall], x, y) for wall in solid]
        clearance = np.minimum(clearance, np.maximum.reduce(sides))
    for centre_x, centre_y, radius in scene.posts:
        clearance = np.minimum(clearance, np.hypot(x - centre_x, y - centre_y) - radius)
    return clearance - _ON_SURFACE


def _left_of(wall: Wall, x: Floats, y: Floats) -> Floats:
    x0, y0, x1, y1 = wall
    return np.asarray(((x1 - x0) * (y - y0) - (y1 - y0) * (x - x0)) / np.hypot(x1 - x0, y1 - y0))


def _faces(scene: Scene) -> tuple[Singles, Singles]:
    """Return the share of air of every cell's face towards +x and towards +y."""
    lines = _lines(scene)
    corners = _clearance(scene, lines[:, None], lines[None, :])
    right = _air_between(corners[1:, :-1], corners[1:, 1:])
    upper = _air_between(corners[:-1, 1:], corners[1:, 1:])
    middles = (lines[1:] + lines[:-1]) / 2
    in_solids = {wall for solid in scene.solids for wall in solid}
    for k, (x0, y0, x1, y1) in enumerate(scene.walls):
        if k in in_solids:
            continue
        if x0 == x1:
            closed, along = right[np.argmin(np.abs(lines[1:] - x0))], (y0, y1)
        else:
            closed, along = upper[:, np.argmin(np.abs(lines[1:] - y0))], (x0, x1)
        closed[(middles > min(along)) & (middles < max(along))] = 0.0
    return right, upper


def _air_between(one: Floats, other: Floats) -> Singles:
    low, high = np.minimum(one, other), np.maximum(one, other)
    return np.where(low > 0, 1.0, np.where(high > 0, high / np.maximum(high - low, 1e-300), 0.0)).astype(np.float32)


def _gains(scene: Scene) -> Singles:
    """Return the factor of the flow into every cell: Courant's number squared over its share of air, 0 in solids.

    The share of air of cut cells is computed from samples, with a minimum that keeps the steps stable.
    """
    lines = _lines(scene)
    corners = _clearance(scene, lines[:, None], lines[None, :])
    four = np.stack((corners[:-1, :-1], corners[1:, :-1], corners[:-1, 1:], corners[1:, 1:]))
    air = (four.min(axis=0) > 0).astype(np.float64)
    cut = np.nonzero((four.min(axis=0) <= 0) & (four.max(axis=0) > 0))
    inside = ((np.arange(16) + 0.5) / 16) * CELL
    x, y = lines[cut[0]][:, None, None] + inside[:, None], lines[cut[1]][:, None, None] + inside
    air[cut] = (_clearance(scene, x, y) > 0).mean(axis=(1, 2))
    right, upper = _faces(scene)
    faces = right + upper
    faces[1:] += right[:-1]
    faces[:, 1:] += upper[:, :-1]
    air = np.where(air > 0, np.maximum(air, _COURANT**2 * faces / 2), np.inf)
    return np.asarray(_COURANT**2 / air, dtype=np.float32)


@njit(cache=True, fastmath=True)
def _step_row(
    old: Singles, rows: tuple[Singles, Singles, Singles], right: tuple[Singles, Singles], upper: Singles, gains: Singles
) -> None:
    """Replace the pressures of a row from the previous step by those of the next.

    `rows` are the row before, this row and the row after; this row is a cell longer at both ends. `right` and `upper`
    are the faces before and after each cell.
    """
    before, now, after = rows
    for j in range(old.shape[0]):
        here = now[j + 1]
        inflow = (
            right[1][j] * (after[j] - here)
            + right[0][j] * (before[j] - here)
            + upper[j + 1] * (now[j + 2] - here)
            + upper[j] * (now[j] - here)
        )
        old[j] = here + here - old[j] + gains[j] * inflow


@njit(cache=True, fastmath=True)
def _march(right: Singles, upper: Singles, gains: Singles, burst: Floats, cells_x: int, cells_y: int) -> Floats:
    """Return the pressure at each step, at an offset in cells from the centre of the grid, where the burst starts."""
    middle = right.shape[0] // 2
    steps = int(FARTHEST / STEP)
    received = np.zeros(steps)
    old, now = np.zeros_like(right), np.zeros_like(right)
    for step in range(steps):
        # farther out there is no sound yet, or none that can return in time
        reach = min(_COURANT * step, _COURANT * (steps - step) + np.hypot(cells_x, cells_y)) + _MARGIN
        for i in range(middle - int(reach), middle + int(reach) + 1):
            half = int(np.sqrt(reach**2 - (i - middle) ** 2))
            first, last = middle - half, middle + half + 1
            _step_row(
                old[i, first:last],
                (now[i - 1, first:last], now[i, first - 1 : last + 1], now[i + 1, first:last]),
                (right[i - 1, first:last], right[i, first:last]),
                upper[i, first - 1 : last],
                gains[i, first:last],
            )
        old, now = now, old
        if step < burst.shape[0]:
            now[middle, middle] += burst[step]
        received[step] = now[middle + cells_x, middle + cells_y]
    return received
