"""Directivity of the transducer, and the shape of a pulse away from its axis.

The beam acts twice on an echo, at departure and at arrival. The functions apply it once, or `passes` times.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.fft import fft, fftfreq, ifft
from numpy.typing import NDArray

from sonarhw.readings import FloatArray

ComplexArray = NDArray[np.complex128]


def beam_gain(angles: FloatArray, ka: float) -> FloatArray:
    """Return the amplitude at `angles` (rad) from the axis relative to straight ahead, for one pass, 0..1, same shape.

    A disc of radius a at wavenumber k: |2 J₁(x)/x| cos α with x = ka sin α; nothing at 90° and beyond. It is the
    carrier's part of Kuc and Siegel's h_R, whose integral is cos α (Kuc and Siegel 1987; CIM-92-9 eq. 1).
    """
    cosine = np.cos(angles)
    return np.asarray(np.where(cosine > 0, np.abs(disc_factor(ka * np.sin(angles))) * cosine, 0.0))


def disc_factor(x: FloatArray) -> FloatArray:
    """Return 2 J₁(x)/x, same shape, to 10⁻¹⁵.

    Poisson's integral: the sum of cos(x sin θ) over strips of the disc. SciPy's J₁ takes a fifth of a second to load,
    which is too long for each command; it is faster for a million values.
    """
    places, shares = _strips(x)
    # cos y = 1 - 2 sin²(y/2), so that the result is exactly 1 straight ahead; sum(), because BLAS may add in any order
    return np.asarray(1 - 2 * (np.sin(np.multiply.outer(x, places / 2)) ** 2 * shares).sum(axis=-1))


def disc_slope(x: FloatArray) -> FloatArray:
    """Return the derivative of `disc_factor`, -2 J₂(x)/x, same shape."""
    places, shares = _strips(x)
    return np.asarray(-(np.sin(np.multiply.outer(x, places)) * (shares * places)).sum(axis=-1))


def _strips(x: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return places and shares of strips of half a disc, (m,) each, enough for the largest `x`.

    Equal steps of the angle θ, at sin θ of the radius. The sum over m of them is exact up to J₄ₘ₋₂(x), which is below
    rounding errors.
    """
    count = math.ceil(float(np.abs(x).max(initial=0.0)) / 2) + 8
    angles = (np.arange(count) + 0.5) * (math.pi / 2 / count)
    return np.sin(angles), 2 * np.cos(angles) ** 2 / count


def _transfer(ka: FloatArray, angles: FloatArray) -> FloatArray:
    """Return the Fourier transform of h_R without its delay, 2 J₁(x)/x cos α: signed, 0 from 90° on."""
    from scipy.special import j1  # slow to load, and only figures need so many values

    cosine = np.cos(angles)
    x = ka * np.sin(angles)
    safe = np.where(np.abs(x) < 1e-8, 1.0, x)
    return np.asarray(np.where(cosine > 0, np.where(np.abs(x) < 1e-8, 1.0, 2 * j1(safe) / safe) * cosine, 0.0))


def impulse_response(times: FloatArray, angle: float, radius: float, speed_of_sound: float) -> FloatArray:
    """Return h_R at `times` (s) after the wavefront reached the centre of the face, 1/s, same shape.

    (2c cos α)/(π a sin α) √(1 − c²t²/(a² sin² α)) while |t| ≤ a sin α / c (Kuc and Siegel 1987; CIM-92-9 eq. 1), for
    0 < |α| ≤ π/2; straight ahead it is a unit impulse and has no samples. Raises ValueError there.
    """
    spread = radius * abs(np.sin(angle)) / speed_of_sound
    if spread == 0 or np.cos(angle) <= 0:
        raise ValueError(f"angle {angle:g} rad: expected more than 0 and at most π/2, where h_R is a function")
    inside = np.maximum(0.0, 1 - (times / spread) ** 2)
    return np.asarray(2 * np.cos(angle) / (np.pi * spread) * np.sqrt(inside))


def convolved(
    pulse: FloatArray | ComplexArray, rate: float, angles: FloatArray, radius: float, speed_of_sound: float, passes: int
) -> tuple[ComplexArray, float]:
    """Return a pulse convolved `passes` times with h_R at every angle, (n, m) complex, and the time of its start, s.

    `pulse` (k,) is sampled at `rate` (Hz) from time 0, with its carrier; a real pulse stays real. Far off the axis the
    result begins before 0, because one rim of the face is nearer than its centre.
    """
    rim = int(np.ceil(passes * radius / speed_of_sound * rate)) + 1
    count = len(pulse) + 2 * rim
    length = 1 << (count - 1).bit_length()
    wavenumbers = np.asarray(2 * np.pi * fftfreq(length, 1 / rate) / speed_of_sound, dtype=np.float64)
    spectrum = fft(np.concatenate((np.zeros(rim), pulse)), length)
    passed = _transfer(wavenumbers * radius, np.asarray(angles, dtype=np.float64)[:, None]) ** passes
    return np.asarray(ifft(spectrum * passed, axis=1)[:, :count]), -rim / rate


@dataclass(frozen=True)
class BurstLoss:
    """Amplitude ratios of a whole burst at each angle to straight ahead; the level in dB is 20 lg of either."""

    peak: FloatArray  # (n,), ratio of the peaks
    energy: FloatArray  # (n,), root of the ratio of energies


def burst_loss(
    angles: FloatArray, pulse: FloatArray | ComplexArray, rate: float, radius: float, speed_of_sound: float, passes: int
) -> BurstLoss:
    """Return the remaining part of a pulse (k,) at `rate` (Hz) at `angles` (n,) rad from the axis, after `passes`.

    The carrier of the pulse must be a complex exponential. The peak is then that of the envelope, at any phase.
    """
    left, _ = convolved(pulse, rate, angles, radius, speed_of_sound, passes)
    power = np.abs(left) ** 2
    whole = np.abs(pulse) ** 2
    return BurstLoss(np.sqrt(power.max(axis=1) / whole.max()), np.sqrt(power.sum(axis=1) / whole.sum()))


def square_burst(frequency: float, cycles: int, rate: float) -> ComplexArray:
    """Return a burst with a rectangular envelope, (k,) complex at `rate` (Hz); the carrier is a complex exponential."""
    times = np.arange(round(cycles / frequency * rate)) / rate
    return np.asarray(np.exp(2j * np.pi * frequency * times))


def far_field(radius: float, wavelength: float) -> float:
    """Return the distance (m) beyond which h_R is accurate to 1 dB straight ahead: twice a²/λ.

    Kuc and Siegel require z ≫ a²/λ. On the axis, the field of a piston is |sin(ψ)/ψ| of its far field, with
    ψ = (π/2)(a²/λ)/z for z beyond a few radii: 0.64 at a²/λ, 0.90 at twice that (Kinsler and Frey, §7.4).
    """
    return 2 * radius**2 / wavelength
