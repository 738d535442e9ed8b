"""Exact sound of a line source at a rigid wedge, in two dimensions. Time dependence e^{+jωt}."""

import math

import numpy as np
from numpy.typing import NDArray
from scipy.special import hankel2

Complexes = NDArray[np.complex128]
_DOWN = 1 - 0.2j  # along this direction the integrand decays
_FARTHEST, _STEPS = 6.0, 8000


def diffracted_by_wedge(
    angles: tuple[float, float], air: float, legs: tuple[float, float], wavenumber: float
) -> complex:
    """Return the diffracted sound, relative to a line source at the length of the path.

    `angles` (rad) are those of source and receiver from one face of `air` (rad), `legs` (m) their distances from the
    vertex. The integral is that of Macdonald over the sources at imaginary angles (Bowman, Senior, Uslenghi,
    Electromagnetic and Acoustic Scattering by Simple Shapes, ch. 6).
    """
    n, (one, other), (near, far) = air / math.pi, angles, legs
    # finer near 0, where the integrand changes fast beside a boundary of shadow or reflection
    share = (np.arange(_STEPS) + 0.5) / _STEPS
    at, weight = _FARTHEST * share**3 * _DOWN, 3 * _FARTHEST * share**2 / _STEPS * _DOWN
    field = hankel2(0, wavenumber * np.sqrt(near**2 + far**2 + 2 * near * far * np.cosh(at)))
    total = sum(
        (field * np.sin(beyond) / (np.cosh(at / n) - np.cos(beyond)) * weight).sum()
        for beyond in ((math.pi + turn) / n for turn in (one - other, other - one, one + other, -one - other))
    )
    return complex(-total / (math.tau * n) / hankel2(0, wavenumber * (near + far)))
