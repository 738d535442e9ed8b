"""Diffraction at a hard wedge: the uniform theory of Kouyoumjian and Pathak (1974).

The sound field of rays ends abruptly at the boundaries of shadow and reflection. The diffracted field of this theory
has the opposite step there, so their sum is smooth. Time dependence e^{+jωt}.
"""

import math
from functools import cache

import numpy as np

from sonarhw.readings import FloatArray
from sonarhw_sim.board.transducer import ComplexArray
from sonarhw_sim.compiled import compiled, compiled_part

_NODES_PER_UNIT = 32
_STEPS = 32  # from one node to the next
_SERIES_FROM = 6.0  # above, the asymptotic series of f and g has an error below 1e-8
_AT_BOUNDARY = 1e-7  # rad; a wall may be touched 1 nm beyond its end, so here the ray counts as present


@cache
def fresnel_table() -> ComplexArray:
    """Return f + j g and its slope at z = 0, 1/32, 2/32, ..., 6, (n, 2) complex.

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
    table = np.column_stack((exact, slopes))
    table.flags.writeable = False
    return table


def _series(z: float) -> complex:
    inverse = 1.0 / (math.pi * z * z)
    f = 1.0 - 3.0 * inverse**2 + 105.0 * inverse**4
    return complex(f, (1.0 - 15.0 * inverse**2 + 945.0 * inverse**4) * inverse) / (math.pi * z)


@compiled
def _auxiliary(z: FloatArray, table: ComplexArray) -> ComplexArray:
    """Return f(z) + j g(z) for z (m,) from 0 on; the error is below 2e-8. `table` is that of `fresnel_table`."""
    found = np.empty(z.shape[0], np.complex128)
    for k in range(z.shape[0]):
        if z[k] >= _SERIES_FROM:
            inverse = 1.0 / (math.pi * z[k] ** 2)
            f, g = 1.0 - 3.0 * inverse**2 + 105.0 * inverse**4, (1.0 - 15.0 * inverse**2) * inverse
            found[k] = complex(f, g) / (math.pi * z[k])
            continue
        node = int(z[k] * _NODES_PER_UNIT)
        t = z[k] * _NODES_PER_UNIT - node
        values = (1.0 + 2.0 * t) * (1.0 - t) ** 2 * table[node, 0] + t**2 * (3.0 - 2.0 * t) * table[node + 1, 0]
        slopes = t * (1.0 - t) ** 2 * table[node, 1] + t**2 * (t - 1.0) * table[node + 1, 1]
        found[k] = values + slopes / _NODES_PER_UNIT
    return found


def transition(x: FloatArray) -> ComplexArray:
    """Return F(x) = 2j √x e^{jx} ∫ e^{-jt²} dt from √x to infinity, for x (m,) from 0 on, (m,)."""
    return np.asarray(np.sqrt(math.tau * x) * _auxiliary(np.sqrt(2.0 * x / math.pi), fresnel_table()))


def _turns(angle: FloatArray, n: FloatArray) -> FloatArray:
    """Return the number of turns of 2nπ nearest to an angle: it selects the image source whose boundary is nearest."""
    return np.floor(angle / (math.tau * n) + 0.5)


def _term(angle: FloatArray, n: FloatArray, scale: FloatArray) -> ComplexArray:
    """Return one of the four terms, (m,): -e^{-jπ/4} cot(angle/2n) F(kLa) / (2n √(2πkL)).

    F contains the factor √(kLa), which cancels: the term is ∓1/2 at its boundary. `scale` is 2 √(kL/π).
    """
    beyond = angle - math.tau * n * _turns(angle, n)
    at_boundary = np.abs(beyond) < _AT_BOUNDARY
    beyond = np.where(at_boundary, 1.0, beyond)
    aside = np.abs(np.sin(0.5 * beyond))
    size = -0.5 * aside / (n * np.tan(0.5 * beyond / n))
    return np.where(at_boundary, -0.5, size * (1.0 - 1.0j) * _auxiliary(scale * aside, fresnel_table()))


@compiled_part
def _most(angle: float, n: float, scale: float) -> float:
    """Return an upper bound of |`_term`| without trigonometry: |F| is at most 1, and |cot x| at most 1/|x|."""
    turns = math.floor(angle / (math.tau * n) + 0.5)
    beyond = abs(angle - math.tau * n * turns)
    return min(0.5, math.sqrt(2.0) / (math.pi * scale * max(beyond, 1e-12)))


@compiled
def most_by_wedge(one: float, other: float, n: float, to_edge: float, from_edge: float, wavelength: float) -> float:
    """Return an upper bound of |`by_wedge`| for one path, many times faster."""
    scale = max(2.0 * math.sqrt(2.0 * to_edge * from_edge / max(to_edge + from_edge, 1e-300) / wavelength), 1e-6)
    apart, mirrored = one - other, one + other
    bound: float = (
        _most(math.pi + apart, n, scale)
        + _most(math.pi - apart, n, scale)
        + _most(math.pi + mirrored, n, scale)
        + _most(math.pi - mirrored, n, scale)
    )
    return bound


def by_wedge(
    one: FloatArray,
    other: FloatArray,
    n: FloatArray,
    faces: FloatArray,
    to_edge: FloatArray,
    from_edge: FloatArray,
    wavelength: float | FloatArray,
) -> ComplexArray:
    """Return the amplitude of diffracted paths relative to reflected ones of their length from a perfect wall, (m,).

    `one` and `other` (m,) are the angles (rad) of the two legs from the first face of a wedge of air of nπ, `faces`
    (m, 2) the reflectances of the first and the last face, `to_edge` and `from_edge` (m,) the lengths of the legs, m;
    the wavelength, m, is one or (m,).
    The reflectance of a face multiplies its reflection term. The shadow terms are 1 at the boundary of the shadow, and
    straight back (1 + ρ)/2 with the mean reflectance ρ of both faces. For n below 1, image sources of several
    reflections have boundaries too, and a term has the reflectances of the nearest one. The whole is at most as loud as
    the louder face, so an edge of two absorbers is silent.
    """
    # 2 √(kL/π) with the distance parameter L = s s′/(s + s′) of a cylindrical wave
    legs = to_edge * from_edge / np.maximum(to_edge + from_edge, 1e-300)
    scale = np.maximum(2.0 * np.sqrt(2.0 * legs / wavelength), 1e-6)
    apart, mirrored = one - other, one + other
    first, last = faces.T
    both = np.where(n < 1.0, first * last, 1.0)
    # an edge of impedance walls returns half of what a black one does, but has the same shadow
    of_shadow = 1.0 - 0.5 * np.cos(0.5 * apart) ** 2 * (1.0 - 0.5 * (first + last))
    total = (
        of_shadow * both ** np.abs(_turns(math.pi + apart, n)) * _term(math.pi + apart, n, scale)
        + of_shadow * both ** np.abs(_turns(math.pi - apart, n)) * _term(math.pi - apart, n, scale)
        + last * both ** np.maximum(_turns(math.pi + mirrored, n) - 1, 0) * _term(math.pi + mirrored, n, scale)
        + first * both ** np.abs(_turns(math.pi - mirrored, n)) * _term(math.pi - mirrored, n, scale)
    )
    loudest, size = np.maximum(first, last), np.abs(total)
    return np.asarray(total * np.minimum(1.0, loudest / np.maximum(size, 1e-300)))
