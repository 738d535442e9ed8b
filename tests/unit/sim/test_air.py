"""Absorption against the tables of its source."""

import pytest
from sonarhw_sim.air import Air, absorption


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
def test_absorption_is_that_of_iso_9613(temperature: float, humidity: float, frequency: float, loss: float) -> None:
    assert absorption(frequency, Air(temperature, humidity)) == pytest.approx(loss, rel=2e-3)


# ISO 9613-2:1996, table 2: dB/km in the octave bands 63 Hz to 8 kHz, calculated by ISO 9613-1 for the exact midbands
TABLE = {
    (10, 0.7): (0.1, 0.4, 1.0, 1.9, 3.7, 9.7, 32.8, 117),
    (20, 0.7): (0.1, 0.3, 1.1, 2.8, 5.0, 9.0, 22.9, 76.6),
    (30, 0.7): (0.1, 0.3, 1.0, 3.1, 7.4, 12.7, 23.1, 59.3),
    (15, 0.2): (0.3, 0.6, 1.2, 2.7, 8.2, 28.2, 88.8, 202),
    (15, 0.5): (0.1, 0.5, 1.2, 2.2, 4.2, 10.8, 36.2, 129),
    (15, 0.8): (0.1, 0.3, 1.1, 2.4, 4.1, 8.3, 23.7, 82.8),
}
MIDBANDS = tuple(1000 * 10 ** (0.3 * band) for band in range(-4, 4))  # Hz


@pytest.mark.parametrize(("state", "row"), TABLE.items())
def test_absorption_agrees_with_the_published_table(state: tuple[int, float], row: tuple[float, ...]) -> None:
    for frequency, printed in zip(MIDBANDS, row, strict=True):
        # printed with one decimal, or none from 100 on; 4.15 is printed as 4.1
        half = 0.052 if printed < 100 else 0.5
        assert absorption(frequency, Air(*state)) * 1000 == pytest.approx(printed, abs=half)


@pytest.mark.parametrize("share", [0.5, 0.7])
def test_absorption_at_low_pressure_follows_from_that_at_one_atmosphere(share: float) -> None:
    """Absorption over pressure depends only on temperature, frequency over pressure, and the share of water vapour."""
    for (temperature, humidity), row in TABLE.items():
        thin = Air(temperature, humidity * share, 101.325 * share)
        for frequency, printed in zip(MIDBANDS, row, strict=True):
            half = 0.052 if printed < 100 else 0.5
            assert absorption(frequency * share, thin) / share * 1000 == pytest.approx(printed, abs=half)


@pytest.mark.parametrize("temperature", [-39.0, 0.0, 20.0, 37.5])
def test_temperature_at_the_speed_of_a_temperature_is_that_temperature(temperature: float) -> None:
    air = Air(relative_humidity=0.3)
    assert air.temperature_at(air.speed_at(temperature)) == pytest.approx(temperature, abs=1e-6)


def test_a_speed_of_no_usual_temperature_has_none() -> None:
    assert Air().temperature_at(290.0) is None
    assert Air().temperature_at(400.0) is None
