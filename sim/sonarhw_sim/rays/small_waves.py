"""The wave scattered by a few small walls, free or on an endless wall, by boundary elements.

The unknowns are the jump of pressure across each wall, by hat functions, and the flow through openings of the endless
wall, constant on each panel. Both sides of the endless wall are half spaces with mirror images. The equations are
symmetric (Galerkin; the hypersingular integral by parts, Maue 1949), so source and receiver can be exchanged. Surfaces
are rigid. Time dependence e^{+jωt}.
"""

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray
from sonarhw_sim.board.beam import ComplexArray
from sonarhw_sim.compiled import compiled
from sonarhw_sim.room.small_things import WHOLE, SoundPart

if TYPE_CHECKING:
    from scipy.sparse import csr_array

_PER_WAVE = 8.0  # panels of the largest size
_SMALLEST = 0.15  # size of the panel at the end of a wall, relative to the largest
_GROWTH = 1.6  # of the size from one panel to the next
_NEAR = 4.0  # panel lengths: nearer, the logarithm is integrated exactly
_POINTS = 4  # on a panel, for integrals of near ones
_NODES, _WEIGHTS = (np.polynomial.legendre.leggauss(_POINTS) + np.array([[1.0], [0.0]])) / 2.0
_MEETING = 1e-7  # m
_OUTSIDE = 1.1  # radii, and a wavelength: nearer sources are evaluated directly
_FAINTEST = 1e-6  # of the loudest field at the unknowns
_NO_MIRRORS = np.empty((0, 3))
_STEP = 0.015  # of the wave number, to find the delay: half of the band of a burst of 16 cycles


@dataclass(frozen=True)
class SmallWalls:
    """Small walls in coordinates of their own; on an endless wall, that is the line y = 0. All lengths in m."""

    walls: tuple[tuple[float, float, float, float], ...]
    wavelength: float
    openings: tuple[tuple[float, float], ...] = ()  # of the endless wall, from x to x
    on_wall: bool = False
    part: SoundPart = WHOLE

    def sound(self, points: FloatArray, pairs: NDArray[np.intp], mirrors: FloatArray = _NO_MIRRORS) -> ComplexArray:
        """Return the scattered sound between the points (n, 2) of each pair (p, 2), (p,).

        It is relative to sound by way of the centre of the part. On an endless wall, it is the difference from what the
        wall alone returns with its openings closed. `mirrors` (p, 3): the sound of a pair is without what its mirror
        returns, or only that.
        """
        return self._relative(math.tau / self.wavelength, points, pairs, mirrors)

    def delays(
        self, points: FloatArray, pairs: NDArray[np.intp], sound: ComplexArray, mirrors: FloatArray = _NO_MIRRORS
    ) -> FloatArray:
        """Return the delay, m, of the `sound` between the points of each pair, (p,)."""
        number = math.tau / self.wavelength
        beside = self._relative(number * (1.0 + _STEP), points, pairs, mirrors)
        return np.asarray(-np.angle(beside * np.conj(sound)) / (_STEP * number))

    def mirrors(self, points: FloatArray, pairs: NDArray[np.intp]) -> FloatArray:
        """Return where flat walls along an endless wall mirror the sound of each pair, (p, 3) m; NaN: nowhere.

        Each row is the point of the mirror, and -1 for the sound without it; 1 is for its own sound. It does not come
        from the centre of the part, where a beam may be much louder or fainter.
        """
        (x, y), (other_x, other_y) = points[pairs[:, 0]].T, points[pairs[:, 1]].T
        above = (y > 0.0) & (other_y > 0.0) & self.on_wall
        along = np.where(above, (x * other_y + other_x * y) / np.where(above, y + other_y, 1.0), math.nan)
        rows = np.full((len(pairs), 3), math.nan)
        # the highest last; walls below the endless wall are seen through its openings
        flat = sorted((h, min(a, b), max(a, b)) for a, h, b, end in self.walls if abs(h - end) <= _MEETING)
        for height, low, high in flat:
            here = (along > low) & (along < high)
            rows[here] = np.column_stack((along[here], *np.tile([[height], [-1.0]], here.sum())))
        return rows

    def _mirrored(
        self, number: float, points: FloatArray, pairs: NDArray[np.intp], mirrors: FloatArray
    ) -> ComplexArray:
        """Return what mirrors return more than the endless wall, the share of this part, (p,)."""
        (x, y), (other_x, other_y) = points[pairs[:, 0]].T, points[pairs[:, 1]].T
        lengths = number * np.hypot(x - other_x, y + other_y - 2 * np.array([0.0, 1.0])[:, None] * mirrors[:, 1])
        wall, mirror = _sound_at(lengths)
        return np.asarray(self.part.share(mirrors[:, :2]) * (mirror - wall))

    def _relative(
        self, number: float, points: FloatArray, pairs: NDArray[np.intp], mirrors: FloatArray
    ) -> ComplexArray:
        rows = np.zeros(len(points), np.intp)
        rows[pairs.ravel()] = 1
        points, pairs = points[rows > 0], (np.cumsum(rows) - 1)[pairs]
        lengths = np.hypot(*points.T)
        modes, near = _modes(self, number), lengths < self.nearest
        # the second point of each pair is far, unless both are near
        pairs = np.where(near[pairs[:, 1:]], pairs[:, ::-1], pairs)
        waves = self._waves(number, points)
        sent, below = waves @ modes.waves[0], np.flatnonzero(self.on_wall & (points[:, 1] < 0.0))
        sent[below] = waves[below] @ modes.waves[-1]
        returned, total = sent @ modes.scattered, np.empty(len(pairs), np.complex128)
        if near.any():
            caused = self._caused(number, points[near])
            answers = _answers(self, number, caused).T
            returned[near] = answers @ _fields(self.whole, number)[1]
        _fill_products(returned, sent, pairs, total)
        if near.any():
            both = np.flatnonzero(near[pairs].all(axis=1))
            first, second = (np.cumsum(near) - 1)[pairs[both]].T
            total[both] = (answers[first] * caused.T[second]).sum(axis=1)
        seen = np.flatnonzero(~np.isnan(mirrors[:, 0]))
        mirrored = self._mirrored(number, points, pairs[seen], mirrors[seen])
        total[seen] = np.where(mirrors[seen, 2] > 0.0, mirrored, total[seen] - mirrored)
        by_centre = number * np.hypot(*(points - self.part.centre).T)[pairs].sum(axis=1)
        return np.asarray(total / _sound_at(by_centre))

    @property
    def whole(self) -> "SmallWalls":
        """The same walls, not in parts."""
        return self if self.part == WHOLE else replace(self, part=WHOLE)

    @property
    def places(self) -> FloatArray:
        """The place of each unknown, (u, 2) m."""
        upper, lower, flow = self.panels
        places = [flow.middles]
        for panels, side in ((lower, -1.0), (upper, 1.0)):
            sizes = abs(panels.averages)
            places.insert(0, sizes @ panels.middles / sizes.sum(axis=1)[:, None] * (1.0, side))
        return np.concatenate(places)

    @cached_property
    def radius(self) -> float:
        """That of the circle round the origin with all walls and openings, m."""
        ends = [end for a, b, c, d in self.walls for end in ((a, b), (c, d))]
        return max(math.hypot(*end) for end in [*ends, *((x, 0.0) for x in itertools.chain(*self.openings))])

    @property
    def reach(self) -> float:
        """The distance from the centre of the part up to which it scatters, m."""
        steps = zip(self.part.numbers, self.part.spans, strict=True)
        return max((high - low) / (count - 1) if count > 1 else 0.0 for (_, count), (low, high) in steps) or self.radius

    @cached_property
    def nearest(self) -> float:
        """The distance from the origin, m, beyond which the sound of a source is a sum of waves from the origin."""
        return _OUTSIDE * self.radius + self.wavelength

    def _waves(self, number: float, points: FloatArray) -> ComplexArray:
        """Return waves from the origin at points (n, 2): even ones by order, then odd ones if no wall is there.

        By reciprocity, they are the factors of the regular waves that a source at a point causes at the walls.
        """
        from scipy.special import j0, j1, y0, y1

        sizes, order = number * np.maximum(np.hypot(*points.T), self.nearest), self._order(number)
        begin = np.column_stack((j0(sizes) - 1j * y0(sizes), j1(sizes) - 1j * y1(sizes)))
        waves = np.empty((len(points), 1 + order * (1 if self.on_wall else 2)), np.complex128)
        _fill_waves(order, sizes, np.arctan2(points[:, 1], points[:, 0]), begin, waves)
        return waves

    def _order(self, number: float) -> int:
        """Return the highest order of waves that the walls return."""
        size = number * self.radius
        return math.ceil(size + 6 * math.cbrt(size)) + 8

    @property
    def panels(self) -> "tuple[_Panels, _Panels, _Panels]":
        """Those of the walls above the endless wall, or all, those of the walls below, turned up, and the openings."""
        return _panels(self.whole)

    def _caused(self, number: float, points: FloatArray) -> ComplexArray:
        """Return what a source at each point (n, 2) causes at each unknown, (u, n)."""
        upper, lower, flow = self.panels
        above = (points[:, 1] > 0.0) | (not self.on_wall)
        turned = points * np.where(above, 1.0, -1.0)[:, None] ** np.array([0, 1])
        of_walls = [
            side * np.asarray(part.averages @ self._with_image(_slope_at, number, part, turned))
            for part, side in ((upper, above), (lower, ~above))
        ]
        through = np.where(above, 1.0, -1.0) * self._with_image(_pressure_at, number, flow, turned)
        return np.asarray(np.concatenate((*of_walls, through)))

    def _with_image(
        self,
        field: "Callable[[float, _Panels, FloatArray], ComplexArray]",
        number: float,
        panels: "_Panels",
        points: FloatArray,
    ) -> ComplexArray:
        total = field(number, panels, points)
        return total + field(number, panels, points * (1, -1)) if self.on_wall else total


@dataclass(frozen=True)
class _Modes:
    """Fields at the unknowns of small walls, as many as sources outside can cause, and what they return.

    The unknowns are many more: a field on a line of length l has about 2 l/λ degrees of freedom.
    """

    waves: tuple[ComplexArray, ...]  # (w, r): the fields by waves from the origin, above an endless wall and below
    scattered: ComplexArray  # (r, r): what each field returns


@lru_cache(maxsize=128)
def _modes(small: SmallWalls, number: float) -> _Modes:
    """Return the fields at small walls, and what a part of these returns, for a wave number (1/m)."""
    by_waves, fields = _fields(small.whole, number)
    return _Modes(by_waves, fields.T @ _answers(small, number, fields))


def _answers(small: SmallWalls, number: float, fields: ComplexArray) -> ComplexArray:
    """Return what each unknown of a part returns to sources of fields (u, n), (u, n).

    It is half of what leaves from the part, and half of what the sound that meets the part causes anywhere. Sound that
    both meets and leaves the part would contain resonances inside of solids, which only all walls together keep in.
    """
    inverse = _inverse(small.whole, number)
    if small.part == WHOLE:
        return np.asarray(inverse @ fields)
    share = small.part.share(small.places)[:, None] / 2.0
    return np.asarray(share * (inverse @ fields) + inverse @ (share * fields))


@lru_cache(maxsize=4)
def _fields(small: SmallWalls, number: float) -> tuple[tuple[ComplexArray, ...], ComplexArray]:
    """Return `waves` of `_Modes`, and the fields at the unknowns, (u, r), by sources on the nearest circle."""
    count = 1 + small._order(number)
    angles = (np.arange(count if small.on_wall else 2 * count) + 0.5) * math.pi / count
    points = small.nearest * np.column_stack((np.cos(angles), np.sin(angles)))
    waves = small._waves(number, points)
    caused = [small._caused(number, side) for side in (points, points * (1, -1))[: 1 + small.on_wall]]
    # slopes of sound at walls, and sound at openings, which is fainter by the wave number
    units = np.ones(len(caused[0]))
    units[len(units) - len(small.panels[2].starts) :] = number
    fields, sizes, _ = np.linalg.svd(units[:, None] * np.hstack(caused), full_matrices=False)
    fields = fields[:, sizes > _FAINTEST * sizes[0]]
    parts = fields.conj().T * units
    by_waves = tuple(np.asarray(np.linalg.lstsq(waves, (parts @ side).T)[0]) for side in caused)
    return by_waves, np.asarray(fields / units[:, None])


@compiled
def _fill_waves(
    order: int, sizes: FloatArray, directions: FloatArray, begin: ComplexArray, waves: ComplexArray
) -> None:
    """Fill in waves from the origin, `begin` (n, 2) with orders 0 and 1, and odd ones if there is space for them."""
    for k in range(sizes.shape[0]):
        turn = complex(math.cos(directions[k]), math.sin(directions[k]))
        before, now, angle = begin[k, 0], begin[k, 1], turn
        waves[k, 0] = before
        for m in range(1, order + 1):
            waves[k, m] = 2.0 * angle.real * now
            if waves.shape[1] > order + 1:
                waves[k, order + m] = 2.0 * angle.imag * now
            before, now, angle = now, 2.0 * m / sizes[k] * now - before, angle * turn


@compiled
def _fill_products(one: ComplexArray, other: ComplexArray, pairs: NDArray[np.intp], products: ComplexArray) -> None:
    """Fill in the product (p,) of a row of one table and a row of the other, for pairs (p, 2) of rows."""
    for k in range(pairs.shape[0]):
        first, second, total = pairs[k, 0], pairs[k, 1], 0.0j
        for m in range(one.shape[1]):
            total += one[first, m] * other[second, m]
        products[k] = total


@dataclass(frozen=True)
class _Panels:
    """Straight pieces of walls, and hat functions on them."""

    starts: FloatArray  # (n, 2), m
    ends: FloatArray  # (n, 2), m
    # each function is on a few panels
    averages: "csr_array"  # (f, n): of each function on each panel
    slopes: "csr_array"  # (f, n): by how much each grows from the start to the end of each panel

    @staticmethod
    def of(walls: FloatArray, wavelength: float, on_wall: bool) -> "_Panels":
        """Return the panels of walls (w, 4) m."""
        from scipy.sparse import csr_array  # slow to import, and most rooms have no small walls

        parts = [_cut(wall, wavelength) for wall in walls]
        ends = np.concatenate([np.empty((0, 2, 2)), *parts])
        averages, slopes = _hats(ends[:, 0], ends[:, 1], on_wall)
        middles = ends.mean(axis=1)
        # halves, with the values there that integrate a slope times another one exactly
        halves = np.stack((ends[:, 0], middles, middles, ends[:, 1]), axis=1).reshape(-1, 2, 2)
        steps = np.stack((-slopes, slopes), axis=1).reshape(len(halves), slopes.shape[1]) / 3.0
        averages, slopes = np.repeat(averages, 2, axis=0) + steps, np.repeat(slopes / 2, 2, axis=0)
        return _Panels(halves[:, 0], halves[:, 1], csr_array(averages.T), csr_array(slopes.T))

    @cached_property
    def lengths(self) -> FloatArray:
        return np.asarray(np.hypot(*(self.ends - self.starts).T))

    @cached_property
    def tangents(self) -> FloatArray:
        return np.asarray((self.ends - self.starts) / self.lengths[:, None])

    @cached_property
    def normals(self) -> FloatArray:
        return np.column_stack((-self.tangents[:, 1], self.tangents[:, 0]))

    @cached_property
    def middles(self) -> FloatArray:
        return np.asarray((self.starts + self.ends) / 2)

    @cached_property
    def points(self) -> FloatArray:
        """Points of Gauss on each, (n, 4, 2)."""
        return np.asarray(self.starts[:, None] + _NODES[:, None] * (self.ends - self.starts)[:, None])

    @property
    def image(self) -> "_Panels":
        """The panels mirrored in the line y = 0. Their normals are the opposite of mirrored normals."""
        return _Panels(self.starts * (1, -1), self.ends * (1, -1), self.averages, self.slopes)


@lru_cache(maxsize=48)
def _panels(small: SmallWalls) -> tuple[_Panels, _Panels, _Panels]:
    walls = np.array(small.walls).reshape(-1, 4)
    below = small.on_wall & (walls[:, 1] + walls[:, 3] < 0.0)
    openings = np.array([(a, 0.0, b, 0.0) for a, b in small.openings]).reshape(-1, 4)
    return (
        _Panels.of(walls[~below], small.wavelength, small.on_wall),
        _Panels.of(walls[below] * (1, -1, 1, -1), small.wavelength, small.on_wall),
        _Panels.of(openings, small.wavelength, True),
    )


def _cut(wall: FloatArray, wavelength: float) -> FloatArray:
    """Return the ends of the panels of a wall (4,), (n, 2, 2); they are shorter towards its ends."""
    length, largest = math.hypot(wall[2] - wall[0], wall[3] - wall[1]), wavelength / _PER_WAVE
    size, half = _SMALLEST * largest, length / 2
    sizes: list[float] = []
    while sum(sizes) < half:
        sizes.append(min(size, largest))
        size *= _GROWTH
    shares = np.cumsum([0.0, *sizes, *sizes[::-1]])
    points = wall[:2] + (shares / shares[-1])[:, None] * (wall[2:] - wall[:2])
    return np.stack((points[:-1], points[1:]), axis=1)


def _hats(starts: FloatArray, ends: FloatArray, on_wall: bool) -> tuple[FloatArray, FloatArray]:
    """Return averages and slopes of the hat functions, (n, f) each.

    Where m panels meet there are m wedges of air. The pressure in all but one of them is unknown; it is on the two
    panels beside the wedge. At a free end there is none. The endless wall divides the last wedge, so there each panel
    has one.
    """
    points = np.concatenate((starts, ends))
    _, nodes = np.unique(np.round(points / _MEETING), axis=0, return_inverse=True)
    count, columns = len(starts), []
    away = np.concatenate((ends - starts, starts - ends))
    angles = np.arctan2(away[:, 1], away[:, 0])
    for node in range(int(nodes.max(initial=-1)) + 1):
        here = np.flatnonzero(nodes.ravel() == node)
        here = here[np.argsort(angles[here])]
        flush = on_wall and abs(points[here[0], 1]) < 10 * _MEETING
        wedges = [(row,) for row in here] if flush else [*itertools.pairwise(here)]
        for wedge in wedges:
            # the normal is to the left of the way from the node for panels that start here
            signs = [(1.0, -1.0)[number] * (1.0 if row < count else -1.0) for number, row in enumerate(wedge)]
            columns.append([(row % count, sign, row < count) for row, sign in zip(wedge, signs, strict=True)])
    averages, slopes = np.zeros((count, len(columns))), np.zeros((count, len(columns)))
    for column, parts in enumerate(columns):
        for panel, sign, at_start in parts:
            averages[panel, column] += 0.5 * sign
            slopes[panel, column] += -sign if at_start else sign
    return averages, slopes


@lru_cache(maxsize=4)  # up to 8 MB each, needed again only for places beside small walls
def _inverse(small: SmallWalls, number: float) -> ComplexArray:
    """Return the inverse of the symmetric system of equations at a wave number (1/m)."""
    upper, lower, flow = small.panels
    walls = [_hypersingular(number, part, small.on_wall) for part in (upper, lower)]
    leading = [part.averages @ _slopes_of(number, part, flow) * 2.0 for part in (upper, lower)]
    sizes = np.cumsum([0, len(walls[0]), len(walls[1]), len(flow.starts)])
    up, down, through = (slice(begin, end) for begin, end in itertools.pairwise(sizes))
    system = np.zeros((sizes[-1], sizes[-1]), np.complex128)
    system[up, up], system[down, down] = walls
    system[up, through], system[through, up] = -leading[0], -leading[0].T
    system[down, through], system[through, down] = leading[1], leading[1].T
    system[through, through] = -4.0 * _single_layers(number, flow, flow)
    inverse = np.linalg.inv(system)
    inverse.flags.writeable = False
    return np.asarray(inverse)


def _hypersingular(number: float, panels: _Panels, on_wall: bool) -> ComplexArray:
    """Return the equations of walls for their hat functions, (f, f)."""
    total = np.zeros((panels.averages.shape[0],) * 2, np.complex128)
    if not total.size:
        return total
    # mirroring turns the direction in which functions grow
    for other, sign in ((panels, 1.0), (panels.image, -1.0))[: 1 + on_wall]:
        layers = _single_layers(number, panels, other)
        facing = number**2 * (panels.normals @ (sign * other.normals).T)
        total += sign * _tested(panels.slopes, layers / (panels.lengths[:, None] * other.lengths))
        total -= _tested(panels.averages, facing * layers)
    # slopes on a panel of length 1: ∫∫ -ln |x - y| x y dx dy / 2π is 1 / 32π, by the values on halves ln 2 / 18π
    missing = 8.0 * (1.0 / 32.0 - math.log(2.0) / 18.0) / math.pi
    total -= number**2 * missing * ((panels.slopes * panels.lengths**2) @ panels.slopes.T).toarray()
    return total


def _tested(functions: "csr_array", layers: ComplexArray) -> ComplexArray:
    """Return a table (n, n) of panels for functions (f, n) on them, (f, f)."""
    return np.asarray((functions @ (functions @ layers).T).T)


def _single_layers(number: float, panels: _Panels, others: _Panels) -> ComplexArray:
    """Return the integrals over each panel (n) and each other one (m) of the sound of a source, (n, m)."""
    from scipy.special import j0, y0

    if not len(panels.starts) or not len(others.starts):
        return np.zeros((len(panels.starts), len(others.starts)), np.complex128)
    away = panels.middles[:, None] - others.middles
    radii = number * np.maximum(np.hypot(away[..., 0], away[..., 1]), 1e-12)
    means = np.empty(radii.shape, np.complex128)
    # by their middles, unless they are near
    means.real, means.imag = -0.25 * y0(radii), -0.25 * j0(radii)
    rows, columns = _near(panels, others)
    points, length = panels.points[rows], others.lengths[columns]
    logarithm = _logarithms(points, others.starts[columns][:, None], others.tangents[columns][:, None], length[:, None])
    away = points[:, :, None] - others.points[columns][:, None]
    radii = np.maximum(np.hypot(away[..., 0], away[..., 1]), 1e-12)
    rest = _sound_at(number * radii) + np.log(radii) / math.tau
    # at radius 0 the rest is finite: its limit
    limit = -0.25j - (math.log(number / 2.0) + np.euler_gamma) / math.tau
    rest = np.where(radii < 1e-9, limit, rest)
    means[rows, columns] = rest @ _WEIGHTS @ _WEIGHTS - logarithm @ _WEIGHTS / (math.tau * length)
    if others is panels:
        # of a panel with itself, exactly
        own = np.log(panels.lengths) - 1.5
        np.fill_diagonal(means, limit - own / math.tau)
    return np.asarray(means * panels.lengths[:, None] * others.lengths)


def _near(panels: _Panels, others: _Panels) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    away = panels.middles[:, None] - others.middles
    reach = _NEAR * np.maximum(panels.lengths[:, None], others.lengths)
    rows, columns = np.nonzero(np.hypot(away[..., 0], away[..., 1]) < reach)
    return rows, columns


def _logarithms(points: FloatArray, starts: FloatArray, tangents: FloatArray, lengths: FloatArray) -> FloatArray:
    """Return the integral of ln r over panels, seen from points (k, p, 2), (k, p)."""
    away = points - starts
    along = (away * tangents).sum(axis=2)
    aside = np.abs(away[..., 1] * tangents[..., 0] - away[..., 0] * tangents[..., 1])

    def primitive(x: FloatArray) -> FloatArray:
        radius = np.maximum(np.hypot(x, aside), 1e-300)
        return np.asarray(x * np.log(radius) - x + aside * np.arctan2(x, np.maximum(aside, 1e-300)))

    return np.asarray(primitive(lengths - along) + primitive(along))


def _slopes_of(number: float, panels: _Panels, sources: _Panels) -> ComplexArray:
    """Return the integral over each panel (n) of the slope along its normal of the sound of sources (m), (n, m)."""
    if not len(panels.starts) or not len(sources.starts):
        return np.zeros((len(panels.starts), len(sources.starts)), np.complex128)
    total = _slope_at(number, panels, sources.middles)
    rows, columns = _near(panels, sources)
    away = panels.points[rows][:, :, None] - sources.points[columns][:, None]
    near = _slopes(number, away, panels.normals[rows][:, None, None]) @ _WEIGHTS @ _WEIGHTS
    total[rows, columns] = near * panels.lengths[rows]
    return np.asarray(total * sources.lengths)


def _slope_at(number: float, panels: _Panels, points: FloatArray) -> ComplexArray:
    """Return the integral over each panel of the slope along its normal of the sound of sources (k, 2), (n, k)."""
    slopes = _slopes(number, panels.middles[:, None] - points, panels.normals[:, None])
    return np.asarray(slopes * panels.lengths[:, None])


def _slopes(number: float, away: FloatArray, normals: FloatArray) -> ComplexArray:
    """Return the slope along `normals` of the sound of sources, at points `away` (..., 2) m from them."""
    from scipy.special import j1, y1

    radii = np.hypot(away[..., 0], away[..., 1])
    across = number * (away * normals).sum(axis=-1) / radii
    # the derivative of -j/4 H₀ is j k/4 H₁, H₁ = J₁ - j Y₁
    slopes = np.empty(radii.shape, np.complex128)
    slopes.real, slopes.imag = 0.25 * y1(number * radii) * across, 0.25 * j1(number * radii) * across
    return slopes


def _pressure_at(number: float, panels: _Panels, points: FloatArray) -> ComplexArray:
    """Return the integral over each panel of the sound of sources (k, 2), (n, k)."""
    away = panels.middles[:, None] - points
    radii = number * np.hypot(away[..., 0], away[..., 1])
    return np.asarray(_sound_at(radii) * panels.lengths[:, None])


def _sound_at(sizes: FloatArray) -> ComplexArray:
    """Return the sound of a source at distances times the wave number, same shape."""
    from scipy.special import j0, y0  # slow to import, and most rooms have no small walls

    return np.asarray(-0.25j * j0(sizes) - 0.25 * y0(sizes))


def forget_solutions() -> None:
    """Drop what is kept of solved walls, up to 100 MB; it is computed again when it is needed."""
    for kept in (_modes, _fields, _inverse, _panels):
        kept.cache_clear()
