"""Exact sound of a line source at a flat thin strip, in two dimensions: an integral equation, independent of rays.

The jump of pressure over the strip, and its sum over both sides, are expanded in Chebyshev polynomials of the place on
the strip. The logarithm of the kernel is integrated exactly (Kress, Linear Integral Equations, ch. 12), so the error
falls exponentially with the number of points. Time dependence e^{+jωt}.
"""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.special import hankel2, j0

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
_POINTS_MORE = 24  # than 1.3 for each radian of the phase from the middle to the end


@dataclass(frozen=True)
class ThinStrip:
    """A strip on the x axis from -half_width to half_width, with one impedance on both sides, at one wavenumber."""

    half_width: float  # m
    wavenumber: float  # rad/m
    reflectance: float = 1.0  # at normal incidence: sets the impedance, (1 + ρ)/(1 - ρ) of that of air

    @cached_property
    def _angles(self) -> Floats:
        """The angles θ of the points, which are at x = half_width cos θ."""
        count = math.ceil(1.3 * self.half_width * self.wavenumber) + _POINTS_MORE
        return (np.arange(count) + 0.5) * math.pi / count

    @property
    def _admittance(self) -> complex:
        return 1j * self.wavenumber * (1 - self.reflectance) / (1 + self.reflectance)

    @cached_property
    def _integrals(self) -> Complexes:
        """Weights (m, m) for ∫ G f dθ from 0 to π at each point, with G = -j/4 H₀⁽²⁾(k |x - x'|)."""
        angles, count = self._angles, len(self._angles)
        order, scale = np.arange(1, count), self.wavenumber * self.half_width
        cosines = np.cos(np.outer(angles, order))
        of_logarithm = math.pi / count * (-math.log(2) - 2 * (cosines / order) @ cosines.T)
        apart = np.abs(np.cos(angles)[:, None] - np.cos(angles))
        np.fill_diagonal(apart, 1.0)
        logarithmic = -j0(scale * apart) / math.tau
        smooth = -0.25j * hankel2(0, scale * apart) - logarithmic * np.log(apart)
        np.fill_diagonal(logarithmic, -1 / math.tau)
        np.fill_diagonal(smooth, -0.25j - (math.log(scale / 2) + np.euler_gamma) / math.tau)
        return np.asarray(logarithmic * of_logarithm + smooth * math.pi / count)

    def pressure(self, source: Floats, receiver: Floats) -> complex:
        """Return the scattered pressure at `receiver` (2,) m of a line source at `source` (2,) m of strength G."""
        return complex(self._by_jump(source, receiver) + self._by_sum(source, receiver))

    def _by_jump(self, source: Floats, receiver: Floats) -> complex:
        """Return the part of the jump of pressure: normal derivatives on both sides agree with the impedance."""
        angles, count = self._angles, len(self._angles)
        order, sines = np.arange(1, count + 1), np.sin(angles)
        values, slopes = np.sin(np.outer(angles, order)), np.cos(np.outer(angles, order)) * order
        # the cosine series of a function at the points, differentiated by θ
        rows = np.arange(count)
        series = np.cos(np.outer(rows, angles)) * np.where(rows > 0, 2, 1)[:, None] / count
        derivative = -np.sin(np.outer(angles, rows)) * rows @ series
        single = self.half_width * self._integrals @ (sines[:, None] * values)
        # the normal derivative of a double layer is (d²/dx² + k²) of a single layer
        double = derivative @ (self._integrals @ slopes) / self.half_width + (
            self.wavenumber**2 * sines[:, None] * single
        )
        matrix = self._admittance / 2 * sines[:, None] * values - double
        jump = values @ np.linalg.solve(matrix, sines * self._normal_derivatives(source))
        return complex(self._weights * jump @ self._dipoles(receiver))

    def _by_sum(self, source: Floats, receiver: Floats) -> complex:
        """Return the part of the flow into both sides; 0 for a rigid strip."""
        if self.reflectance == 1.0:
            return 0.0
        single = self.half_width * self._integrals * np.sin(self._angles)
        matrix = np.eye(len(self._angles)) / 2 + self._admittance * single
        total = np.linalg.solve(matrix, self._monopoles(source))
        return complex(-self._admittance * (self._weights * total) @ self._monopoles(receiver))

    @property
    def _weights(self) -> Floats:
        return np.asarray(self.half_width * np.sin(self._angles) * math.pi / len(self._angles))

    def _away(self, point: Floats) -> tuple[Floats, float]:
        return np.hypot(point[0] - self.half_width * np.cos(self._angles), point[1]), float(point[1])

    def _monopoles(self, point: Floats) -> Complexes:
        return np.asarray(-0.25j * hankel2(0, self.wavenumber * self._away(point)[0]))

    def _dipoles(self, point: Floats) -> Complexes:
        """Return ∂G/∂y' for each point of the strip, which is also the normal derivative of the incident sound."""
        away, y = self._away(point)
        return np.asarray(-0.25j * self.wavenumber * hankel2(1, self.wavenumber * away) * y / away)

    def _normal_derivatives(self, source: Floats) -> Complexes:
        return self._dipoles(source)
