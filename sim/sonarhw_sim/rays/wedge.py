"""Diffraction at a hard wedge: the uniform theory of Kouyoumjian and Pathak (1974).

The sound field of rays ends abruptly at the boundaries of shadow and reflection. The diffracted field of this theory
has the opposite step there, so their sum is smooth. Compiled by numba. Time dependence e^{+jωt}.
"""

import math
from functools import cache

import numpy as np

from sonarhw.readings import FloatArray
from sonarhw_sim.compiled import compiled, compiled_part

_NODES_PER_UNIT = 32
_STEPS = 32  # from one node to the next
_SERIES_FROM = 6.0  # above, the asymptotic series of f and g has an error below 1e-8
_AT_BOUNDARY = 1e-7  # rad; a wall may be touched 1 nm beyond its end, so here the ray counts as present


@cache
def fresnel_table() -> FloatArray:
    """Return f, g and their slopes at z = 0, 1/32, 2/32, ..., 6, (n, 4) float.

    f and g are the auxiliary functions of the Fresnel integrals (Abramowitz and Stegun, 7.3.5 and 7.3.6).
    """
    # w = f + j g solves w′ = j (π z w - 1): from the series at the far end back to 0, by the method of Runge and Kutta.
    # scipy.special, which has these functions too, would delay the first prediction.
    z = np.arange(_SERIES_FROM * _NODES_PER_UNIT + 2) / _NODES_PER_UNIT
    values = [_series(float(z[-1]))]
    step = -1.0 / (_NODES_PER_UNIT * _STEPS)
    for node in range(len(z) - 1, 0, -1):
        at, w = float(z[node]), values[-1]
        for _ in range(_STEPS):
            half = math.pi * (at + step / 2)
            first = 1j * (math.pi * at * w - 1)
            second = 1j * (half * (w + step / 2 * first) - 1)
            third = 1j * (half * (w + step / 2 * second) - 1)
            at += step
            fourth = 1j * (math.pi * at * (w + step * third) - 1)
            w += step / 6 * (first + 2 * second + 2 * third + fourth)
        values.append(w)
    exact = np.array(values[::-1])
    slopes = 1j * (math.pi * z * exact - 1)
    table = np.column_stack((exact.real, exact.imag, slopes.real, slopes.imag))
    table.flags.writeable = False
    return table


def _series(z: float) -> complex:
    inverse = 1.0 / (math.pi * z * z)
    f = 1.0 - 3.0 * inverse**2 + 105.0 * inverse**4
    return complex(f, (1.0 - 15.0 * inverse**2 + 945.0 * inverse**4) * inverse) / (math.pi * z)


@compiled_part
def _auxiliary(z: float, table: FloatArray) -> complex:
    """Return f(z) + j g(z), for z from 0 on; the error is below 2e-8."""
    if z >= _SERIES_FROM:
        inverse = 1.0 / (math.pi * z * z)
        square = inverse * inverse
        f = (1.0 - 3.0 * square + 105.0 * square * square) / (math.pi * z)
        return complex(f, (1.0 - 15.0 * square) * inverse / (math.pi * z))
    x = z * _NODES_PER_UNIT
    node = int(x)
    t = x - node
    low, high = table[node], table[node + 1]
    start, end = (1.0 + 2.0 * t) * (1.0 - t) * (1.0 - t), t * t * (3.0 - 2.0 * t)
    rise, fall = t * (1.0 - t) * (1.0 - t) / _NODES_PER_UNIT, t * t * (t - 1.0) / _NODES_PER_UNIT
    return complex(
        start * low[0] + rise * low[2] + end * high[0] + fall * high[2],
        start * low[1] + rise * low[3] + end * high[1] + fall * high[3],
    )


@compiled
def transition(x: float, table: FloatArray) -> complex:
    """Return F(x) = 2j √x e^{jx} ∫ e^{-jt²} dt from √x to infinity, for x from 0 on, with `fresnel_table`."""
    value: complex = math.sqrt(math.tau * x) * _auxiliary(math.sqrt(2.0 * x / math.pi), table)
    return value


@compiled_part
def _turns(angle: float, n: float) -> int:
    """Return the number of turns of 2nπ nearest to an angle: it selects the image source whose boundary is nearest."""
    return math.floor(angle / (math.tau * n) + 0.5)


@compiled_part
def _term(angle: float, n: float, scale: float, table: FloatArray) -> complex:
    """Return one of the four terms: -e^{-jπ/4} cot(angle/2n) F(kLa) / (2n √(2πkL)).

    F contains the factor √(kLa), which cancels: the term is ∓1/2 at its boundary. `scale` is 2 √(kL/π).
    """
    beyond = angle - math.tau * n * _turns(angle, n)
    if abs(beyond) < _AT_BOUNDARY:
        return complex(-0.5, 0.0)
    aside = abs(math.sin(0.5 * beyond))
    size = -0.5 * aside / (n * math.tan(0.5 * beyond / n))
    return size * (1.0 - 1.0j) * _auxiliary(scale * aside, table)


@compiled_part
def _most(angle: float, n: float, scale: float) -> float:
    """Return an upper bound of |`_term`| without trigonometry: |F| is at most 1, and |cot x| at most 1/|x|."""
    beyond = abs(angle - math.tau * n * _turns(angle, n))
    return min(0.5, math.sqrt(2.0) / (math.pi * scale * max(beyond, 1e-12)))


@compiled_part
def _scale(to_edge: float, from_edge: float, wavelength: float) -> float:
    """Return 2 √(kL/π) with the distance parameter L = s s′/(s + s′) of a cylindrical wave."""
    apart = to_edge * from_edge / max(to_edge + from_edge, 1e-300)
    return max(2.0 * math.sqrt(2.0 * apart / wavelength), 1e-6)


@compiled
def most_by_wedge(one: float, other: float, n: float, to_edge: float, from_edge: float, wavelength: float) -> float:
    """Return an upper bound of |`by_wedge`|, several times faster."""
    scale = _scale(to_edge, from_edge, wavelength)
    apart, mirrored = one - other, one + other
    bound: float = (
        _most(math.pi + apart, n, scale)
        + _most(math.pi - apart, n, scale)
        + _most(math.pi + mirrored, n, scale)
        + _most(math.pi - mirrored, n, scale)
    )
    return bound


@compiled
def by_wedge(
    one: float,
    other: float,
    n: float,
    faces: FloatArray,
    to_edge: float,
    from_edge: float,
    wavelength: float,
    table: FloatArray,
) -> complex:
    """Return the amplitude of a diffracted path relative to a reflected one of its length from a perfect wall.

    `one` and `other` are the angles (rad) of its two legs from the first face of a wedge of air of nπ, `faces` (2,) the
    reflectances of the first and the last face. The reflectance of a face multiplies its reflection term. For n below
    1, image sources of several reflections have boundaries too, and a term has the reflectances of the nearest one. The
    whole is at most as loud as the louder face, so an edge of two absorbers is silent.
    """
    scale = _scale(to_edge, from_edge, wavelength)
    apart, mirrored = one - other, one + other
    first, last = faces[0], faces[1]
    if n >= 1.0:
        direct_up, direct_down, by_last, by_first = 1.0, 1.0, last, first
    else:
        both = first * last
        direct_up, direct_down = both ** abs(_turns(math.pi + apart, n)), both ** abs(_turns(math.pi - apart, n))
        by_last = last * both ** max(_turns(math.pi + mirrored, n) - 1, 0)
        by_first = first * both ** abs(_turns(math.pi - mirrored, n))
    total: complex = (
        direct_up * _term(math.pi + apart, n, scale, table)
        + direct_down * _term(math.pi - apart, n, scale, table)
        + by_last * _term(math.pi + mirrored, n, scale, table)
        + by_first * _term(math.pi - mirrored, n, scale, table)
    )
    loudest, size = max(first, last), abs(total)
    return total if size <= loudest else total * (loudest / size)
