"""Figure 5: the impulse response h_R convolved with the pulse, and the loss at each angle.

The convolution is computed here in time, sample by sample, as in the paper's formula. The rest of the product uses
spectra (`sonarhw_sim.board.beam`).
"""

import math
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from sonarhw_sim.air import Air
from sonarhw_sim.board.beam import ComplexArray, beam_gain, burst_loss, impulse_response, square_burst

from sonarhw.readings import FloatArray
from sonarhw_compare.paper.drawing import GREEN, MEASURED, PREDICTED, sheet
from sonarhw_compare.paper.exhibit import Claim, Exhibit

_FREQUENCY, _CYCLES = 49_412.0, 16  # the 6500's
_RATE = 8e6  # Hz
_SPEED = Air().speed_of_sound
_SLANT = 17.2  # degrees
_CHECKED = (-36.0, -20.0, -28.0)  # dB at that angle: carrier, peak, energy


@dataclass(frozen=True)
class Loss:
    """The loss of a burst in both directions together, dB."""

    carrier: float
    peak: float
    energy: float


def burst_off_the_axis(degrees: float = _SLANT, radius: float = 0.0192) -> Claim:
    """Check three measures of the loss at one angle."""
    loss = _loss(degrees, radius)
    found = (loss.carrier, loss.peak, loss.energy)
    return Claim(
        "h_R convolved with the pulse gives the loss by angle, once on transmission and once on reception (the paper "
        "draws the loss but does not state values; -36, -20 and -28 dB were computed independently of this code)",
        f"at {degrees:g}°, both directions: carrier {loss.carrier:.1f} dB, peak of the burst {loss.peak:.1f} dB, its "
        f"energy {loss.energy:.1f} dB",
        all(abs(value - expected) < 0.6 for value, expected in zip(found, _CHECKED, strict=True)),
    )


def loss_grows_to_the_first_null(radius: float = 0.0192) -> Claim:
    """Check the width of the main lobe."""
    angles = np.radians(np.arange(0, 30, 0.05))
    gains = beam_gain(angles, math.tau * _FREQUENCY / _SPEED * radius)
    rising = np.flatnonzero(np.diff(gains) > 0)
    null = math.degrees(angles[rising[0]]) if len(rising) else math.inf
    expected = math.degrees(math.asin(3.8317 / (math.tau * _FREQUENCY / _SPEED * 0.0192)))
    return Claim(
        "the farther from the axis, the larger the loss, until the contributions of the face cancel each other",
        f"the carrier's first null is at {null:.1f}°; that of a disc of 19.2 mm is at {expected:.1f}°",
        abs(null - expected) < 0.1,
    )


def _loss(degrees: float, radius: float) -> Loss:
    burst = square_burst(_FREQUENCY, _CYCLES, _RATE)
    left = _convolved(burst, math.radians(degrees), radius, passes=2)
    gain = beam_gain(np.array([math.radians(degrees)]), math.tau * _FREQUENCY / _SPEED * radius)[0]
    energy = (np.abs(left) ** 2).sum() / (np.abs(burst) ** 2).sum()
    return Loss(40 * math.log10(gain), 20 * math.log10(np.abs(left).max()), 10 * math.log10(energy))


def _convolved(burst: ComplexArray, angle: float, radius: float, passes: int) -> ComplexArray:
    """Return the burst convolved `passes` times with the response of the face at an angle (rad)."""
    half = math.ceil(radius * math.sin(angle) / _SPEED * _RATE) + 1
    times = np.arange(-half, half + 1) / _RATE
    response = impulse_response(times, angle, radius, _SPEED)
    # the samples miss part of the steep edges; the integral is known, so normalise it
    response *= math.cos(angle) / response.sum()
    for _ in range(passes):
        burst = np.convolve(burst, response)
    return burst


def _draw() -> Figure:
    figure = sheet(10, 5.2)
    left, right = figure.subplots(1, 2, width_ratios=(1, 1.15))
    burst = square_burst(_FREQUENCY, _CYCLES, _RATE)
    shown: list[tuple[float, ComplexArray]] = [(0.0, burst)]
    shown += [(degrees, _convolved(burst, math.radians(degrees), 0.0192, passes=1)) for degrees in (5.0, 10.0, _SLANT)]
    for row, (degrees, pulse) in enumerate(shown):
        times = (np.arange(len(pulse)) - len(pulse) / 2) / _RATE
        left.plot(times * 1e6, np.real(pulse) - 2.2 * row, color=PREDICTED, lw=0.8)
        left.text(-305, -2.2 * row, f"{degrees:g}°", fontsize=9, va="center")
    left.set(xlabel="time (µs)", ylabel="pulse at the face, one direction (common scale)", xlim=(-320, 320))
    left.set_yticks([])
    left.set_title("the pulse convolved with h_R", fontsize=11)
    _draw_losses(right)
    return figure


def _draw_losses(axes: Axes) -> None:
    degrees = np.arange(0.05, 40, 0.05)
    angles = np.radians(degrees)
    carrier = beam_gain(angles, math.tau * _FREQUENCY / _SPEED * 0.0192) ** 2
    loss = burst_loss(angles, square_burst(_FREQUENCY, _CYCLES, _RATE / 4), _RATE / 4, 0.0192, _SPEED, passes=2)
    for values, colour, style, label in (
        (carrier, PREDICTED, "-", "carrier: used for the level of a path"),
        (loss.peak, MEASURED, "--", "peak of a square 16-cycle burst"),
        (loss.energy, GREEN, "-.", "energy of that burst"),
    ):
        axes.plot(degrees, _decibels(values), style, color=colour, label=label)
    axes.axvline(_SLANT, color="black", lw=0.8, ls=":")
    axes.text(_SLANT + 0.4, -4, f"{_SLANT}°", fontsize=9)
    axes.set(xlabel="angle from the axis (degrees)", ylabel="loss, both directions (dB)", ylim=(-80, 2), xlim=(0, 40))
    axes.set_title("loss by angle, a = 19.2 mm, 49.4 kHz", fontsize=11)
    axes.grid(alpha=0.25)
    axes.legend(fontsize=8, loc="upper right")


def _decibels(amplitudes: FloatArray) -> FloatArray:
    return np.asarray(20 * np.log10(np.maximum(amplitudes, 1e-6)))


EXHIBITS = (
    Exhibit(
        "figure5",
        "Figure 5: the impulse response and the pulse",
        "A circular face of 19.2 mm radius and a square burst of 16 cycles of 49.4 kHz, at 20 °C and 50 % "
        "humidity. Left: Kuc and Siegel's h_R convolved with the burst, summed in time. Right: the loss at "
        "each angle in both directions together.",
        (),
        _draw,
        (burst_off_the_axis, loss_grows_to_the_first_null),
    ),
)
