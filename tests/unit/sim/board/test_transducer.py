"""The beam against a table of a piston, and h_R against the formula printed by Kuc and Siegel."""

import math

import numpy as np
import pytest
from scipy.signal import fftconvolve
from scipy.special import j1, jv
from sonarhw_sim.air import Air
from sonarhw_sim.board.beam import (
    beam_gain,
    burst_loss,
    convolved,
    disc_factor,
    disc_slope,
    far_field,
    impulse_response,
    square_burst,
)
from sonarhw_sim.board.profile import board_names, load_board

SPEED = 343.987
RADIUS = 0.0192
CARRIER = 49412.0


def decibels(angle_deg: float, ka: float) -> float:
    return 20 * math.log10(float(beam_gain(np.array(math.radians(angle_deg)), ka)))


@pytest.mark.parametrize(
    ("ka", "at_3", "at_6", "at_12", "null"), [(14.44, 6.43, 8.82, 11.68, 15.39), (17.33, 5.35, 7.34, 9.71, 12.77)]
)
def test_beam_is_that_of_a_piston(ka: float, at_3: float, at_6: float, at_12: float, null: float) -> None:
    for angle, loss in ((at_3, -3), (at_6, -6), (at_12, -12)):
        assert decibels(angle, ka) == pytest.approx(loss, abs=0.3)
    assert decibels(null, ka) < -45


@pytest.mark.parametrize("largest", [0.01, 1.0, 17.33, 300.0])
def test_the_factor_of_a_disc_and_its_slope_are_those_of_bessel_functions(largest: float) -> None:
    x = np.linspace(-largest, largest, 4000).reshape(40, 100)
    assert disc_factor(x) == pytest.approx(2 * j1(x) / x, abs=3e-15)
    assert disc_slope(x) == pytest.approx(-2 * jv(2, x) / x, abs=3e-15)


def test_carrier_two_ways_at_17_degrees_is_minus_36_decibels() -> None:
    assert 2 * decibels(17.2, 17.33) == pytest.approx(-36, abs=0.5)


def test_peak_of_a_square_burst_there_is_minus_20_and_its_energy_minus_28() -> None:
    burst = square_burst(CARRIER, 16, 4e6)
    peak, energy = burst_loss(np.radians([17.2]), burst, 4e6, RADIUS, SPEED, passes=2)
    assert 20 * math.log10(peak[0]) == pytest.approx(-20, abs=0.5)
    assert 20 * math.log10(energy[0]) == pytest.approx(-28, abs=0.5)


def test_no_sound_leaves_to_the_rear() -> None:
    behind = beam_gain(np.radians([90.0, 120.0, 180.0, 250.0]), 17.33)
    assert behind == pytest.approx(np.zeros(4), abs=1e-12)
    assert beam_gain(np.zeros(1), 17.33)[0] == 1.0
    peak, _ = burst_loss(np.radians([120.0, 180.0]), square_burst(CARRIER, 16, 4e6), 4e6, RADIUS, SPEED, passes=1)
    assert peak == pytest.approx(np.zeros(2), abs=1e-12)


@pytest.mark.parametrize("degrees", [2.0, 17.2, 45.0, 85.0])
def test_h_r_lasts_while_the_wavefront_crosses_the_face_and_its_integral_is_the_cosine(degrees: float) -> None:
    angle = math.radians(degrees)
    crossing = RADIUS * math.sin(angle) / SPEED
    times, step = np.linspace(-1.5 * crossing, 1.5 * crossing, 200_001, retstep=True)
    response = impulse_response(times, angle, RADIUS, SPEED)
    assert response.sum() * step == pytest.approx(math.cos(angle), rel=1e-6)
    assert times[response > 0][[0, -1]] == pytest.approx([-crossing, crossing], rel=1e-3)


@pytest.mark.parametrize("angle", [0.0, 2.0])
def test_h_r_is_a_function_only_off_the_axis_and_not_behind_the_face(angle: float) -> None:
    with pytest.raises(ValueError, match="more than 0"):
        impulse_response(np.zeros(1), angle, RADIUS, SPEED)


@pytest.mark.parametrize("passes", [1, 2])
def test_pulse_off_the_axis_is_the_convolution_with_h_r(passes: int) -> None:
    rate, angle = 20e6, math.radians(25)
    pulse = square_burst(CARRIER, 16, rate).imag
    crossing = RADIUS * math.sin(angle) / SPEED
    half = math.ceil(crossing * rate)
    # as printed: (2c cos α)/(π a sin α) √(1 − c²t²/(a² sin² α))
    t = np.arange(-half, half + 1) / rate
    inside = np.maximum(0, 1 - SPEED**2 * t**2 / (RADIUS * math.sin(angle)) ** 2)
    printed = 2 * SPEED * math.cos(angle) / (math.pi * RADIUS * math.sin(angle)) * np.sqrt(inside)
    expected = pulse
    for _ in range(passes):
        expected = fftconvolve(expected, printed) / rate

    left, begin = convolved(pulse, rate, np.array([angle]), RADIUS, SPEED, passes)
    first = round((-passes * half / rate - begin) * rate)
    assert left[0, first : first + len(expected)].real == pytest.approx(expected, abs=2e-4)
    assert np.abs(left.imag).max() < 1e-12


def test_far_field_is_where_a_piston_on_its_axis_is_within_a_decibel_of_it() -> None:
    wavelength = SPEED / CARRIER
    z = far_field(RADIUS, wavelength)
    k = 2 * math.pi / wavelength
    # exact on the axis, and its far field (Kinsler and Frey, §7.4)
    exact = abs(2 * math.sin(k / 2 * (math.hypot(z, RADIUS) - z)))
    assert -1.0 < 20 * math.log10(exact / (k * RADIUS**2 / (2 * z))) < -0.5


@pytest.mark.parametrize("name", board_names())
def test_included_boards_detect_only_in_their_far_field(name: str) -> None:
    board = load_board(name)
    assert board.blanked_range(Air()) > far_field(board.aperture_radius, board.wavelength(Air()))
