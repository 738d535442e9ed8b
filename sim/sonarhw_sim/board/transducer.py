"""The transducer: how much sound leaves it, and is heard by it, away from its axis.

Takes angles from the axis; hands on amplitude ratios, and what a pulse becomes at an angle. One way unless `ways` says
more; a reading pays it on departure and on arrival.
"""

from dataclasses import dataclass

import numpy as np
from numpy.fft import fft, fftfreq, ifft
from numpy.typing import NDArray
from scipy.special import j1

from sonarhw.readings import FloatArray

ComplexArray = NDArray[np.complex128]


def beam_gain(angles: FloatArray, ka: float) -> FloatArray:
    """Amplitude at `angles` (rad) from the axis relative to straight ahead, one way, 0..1, same shape.

    A disc of radius a at wavenumber k: |2 J₁(x)/x| cos α with x = ka sin α; nothing at 90° and beyond. It is the
    carrier's part of Kuc and Siegel's h_R, whose integral is cos α (Kuc and Siegel 1987; CIM-92-9 eq. 1).
    """
    return np.abs(_transfer(ka, angles))


def _transfer(ka: FloatArray | float, angles: FloatArray) -> FloatArray:
    """Fourier transform of h_R without its delay, 2 J₁(x)/x cos α: signed, 0 from 90° on."""
    cosine = np.cos(angles)
    x = ka * np.sin(angles)
    safe = np.where(np.abs(x) < 1e-8, 1.0, x)
    return np.asarray(np.where(cosine > 0, np.where(np.abs(x) < 1e-8, 1.0, 2 * j1(safe) / safe) * cosine, 0.0))


def impulse_response(times: FloatArray, angle: float, radius: float, speed_of_sound: float) -> FloatArray:
    """h_R at `times` (s) after the wavefront met the middle of the face, 1/s, same shape.

    (2c cos α)/(π a sin α) √(1 − c²t²/(a² sin² α)) while |t| ≤ a sin α / c (Kuc and Siegel 1987; CIM-92-9 eq. 1), for
    0 < |α| ≤ π/2; straight ahead it is a unit impulse, which has no samples: ValueError.
    """
    spread = radius * abs(np.sin(angle)) / speed_of_sound
    if spread == 0 or np.cos(angle) <= 0:
        raise ValueError(f"angle {angle:g} rad: expected one over 0 and up to π/2, where h_R is a function")
    inside = np.maximum(0.0, 1 - (times / spread) ** 2)
    return np.asarray(2 * np.cos(angle) / (np.pi * spread) * np.sqrt(inside))


def convolved(
    pulse: FloatArray | ComplexArray, rate: float, angles: FloatArray, radius: float, speed_of_sound: float, ways: int
) -> tuple[ComplexArray, float]:
    """A pulse convolved with h_R once for each way, at every angle: (n, m) complex, and when its first sample is, s.

    `pulse` (k,) is sampled at `rate` (Hz) from time 0 on, carrier and all; a real one stays real. Far off the axis it
    begins before 0: one rim of the face is nearer than its middle.
    """
    rim = int(np.ceil(ways * radius / speed_of_sound * rate)) + 1
    count = len(pulse) + 2 * rim
    length = 1 << (count - 1).bit_length()
    wavenumbers = np.asarray(2 * np.pi * fftfreq(length, 1 / rate) / speed_of_sound, dtype=np.float64)
    spectrum = fft(np.concatenate((np.zeros(rim), pulse)), length)
    passed = _transfer(wavenumbers * radius, np.asarray(angles, dtype=np.float64)[:, None]) ** ways
    return np.asarray(ifft(spectrum * passed, axis=1)[:, :count]), -rim / rate


@dataclass(frozen=True)
class BurstLoss:
    """What a whole burst keeps at each angle, as amplitude ratios to straight ahead; decibels are 20 lg of either."""

    peak: FloatArray  # (n,) of its loudest moment
    energy: FloatArray  # (n,) root of its energy


def burst_loss(
    angles: FloatArray, pulse: FloatArray | ComplexArray, rate: float, radius: float, speed_of_sound: float, ways: int
) -> BurstLoss:
    """How much of a pulse (k,) at `rate` (Hz) is left at `angles` (n,) rad from the axis, `ways` ways.

    Give the pulse with its carrier as a complex exponential: the peak is then its envelope's, whatever its phase.
    """
    left, _ = convolved(pulse, rate, angles, radius, speed_of_sound, ways)
    power = np.abs(left) ** 2
    whole = np.abs(pulse) ** 2
    return BurstLoss(np.sqrt(power.max(axis=1) / whole.max()), np.sqrt(power.sum(axis=1) / whole.sum()))


def square_burst(frequency: float, cycles: int, rate: float) -> ComplexArray:
    """A burst that begins and ends at once, (k,) complex at `rate` (Hz): the carrier as a complex exponential."""
    times = np.arange(round(cycles / frequency * rate)) / rate
    return np.asarray(np.exp(2j * np.pi * frequency * times))


def far_field(radius: float, wavelength: float) -> float:
    """Distance (m) from which on h_R holds to 1 dB straight ahead: twice a²/λ.

    Kuc and Siegel ask for z ≫ a²/λ. On the axis a piston gives |sin(ψ)/ψ| of what its far field says, with
    ψ = (π/2)(a²/λ)/z for z beyond a few radii: 0.64 at a²/λ, 0.90 at twice that (Kinsler and Frey, §7.4).
    """
    return 2 * radius**2 / wavelength
