"""Speed of sound and absorption against the tables of their sources."""

import pytest
from sonarhw_sim.air import Air, absorption, speed_of_sound


@pytest.mark.parametrize(
    ("temperature", "humidity", "speed"),
    [
        (0, 0.0, 331.448),
        (0, 0.8, 331.697),
        (10, 0.5, 337.781),
        (20, 0.0, 343.359),
        (20, 0.5, 343.987),
        (30, 0.8, 351.006),
    ],
)
def test_speed_of_sound_agrees_with_cramer(temperature: float, humidity: float, speed: float) -> None:
    assert speed_of_sound(temperature, humidity) == pytest.approx(speed, abs=0.002)


@pytest.mark.parametrize(
    ("temperature", "humidity", "frequency", "loss"),
    [
        (10, 0.1, 1e3, 21.6e-3),  # the standard's own table
        (0, 0.5, 49.4e3, 0.5808),
        (20, 0.2, 50e3, 0.9396),
        (20, 0.5, 49.4e3, 1.6414),
        (20, 0.8, 40e3, 1.2320),
        (30, 0.5, 50e3, 1.8935),
    ],
)
def test_absorption_agrees_with_the_standard(
    temperature: float, humidity: float, frequency: float, loss: float
) -> None:
    assert absorption(frequency, Air(temperature, humidity)) == pytest.approx(loss, rel=2e-3)
