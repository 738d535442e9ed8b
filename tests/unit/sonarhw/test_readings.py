"""The speed of sound against the table of its source, and the temperature that a scan assumes."""

import pytest

from sonarhw.sound_speed import ScanAir, speed_of_sound


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
    ("air", "thermometer", "temperature"),
    [
        (ScanAir(room_temperature=35.0, chosen_temperature=0.0), 10.0, 0.0),
        (ScanAir(room_temperature=35.0), 10.0, 10.0),
        (ScanAir(room_temperature=35.0), 0.0, 0.0),
        (ScanAir(room_temperature=35.0), None, 35.0),
        (ScanAir(), None, 20.0),
    ],
    ids=["chosen", "thermometer", "thermometer at zero", "room", "nothing known"],
)
def test_a_scan_uses_the_best_known_temperature(air: ScanAir, thermometer: float | None, temperature: float) -> None:
    assert air.speed_of_sound(thermometer) == speed_of_sound(temperature)
