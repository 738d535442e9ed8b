"""The speed of sound in air, and the one that a scan assumes for its ranges. Nothing here loads NumPy."""

import math
from collections.abc import Callable
from dataclasses import dataclass


def speed_of_sound(
    temperature_c: float = 20.0, relative_humidity: float = 0.5, pressure_kpa: float = 101.325, co2: float = 400e-6
) -> float:
    """Return the speed of sound in humid air of 0 to 30 °C, m/s (Cramer 1993, JASA 93, 2510, eq. 15, table III)."""
    t, p = temperature_c, pressure_kpa * 1e3
    kelvin = t + 273.15
    saturation = math.exp(1.2811805e-5 * kelvin**2 - 1.9509874e-2 * kelvin + 34.04926034 - 6.3536311e3 / kelvin)
    enhancement = 1.00062 + 3.14e-8 * p + 5.6e-7 * t**2
    water = relative_humidity * enhancement * saturation / p
    return (
        331.5024
        + 0.603055 * t
        - 0.000528 * t**2
        + (51.471935 + 0.1495874 * t - 0.000782 * t**2) * water
        + (-1.82e-7 + 3.73e-8 * t - 2.93e-10 * t**2) * p
        + (-85.20931 - 0.228525 * t + 5.91e-5 * t**2) * co2
        - 2.835149 * water**2
        - 2.15e-13 * p**2
        + 29.179762 * co2**2
        + 0.000486 * water * p * co2
    )


@dataclass(frozen=True)
class ScanAir:
    """The air during a scan, as far as the caller and the room file state it. The thermometer adds the rest."""

    speed_at: Callable[[float], float] = speed_of_sound  # speed of sound in m/s at a temperature in °C
    room_temperature: float = 20.0  # °C; used if neither the caller nor a thermometer provides a temperature
    chosen_temperature: float | None = None  # °C; set by the caller, overrides all others

    def speed_of_sound(self, thermometer: float | None) -> float:
        """Return the speed of sound in m/s: at the chosen temperature, else the thermometer's (°C), else the room's."""
        temperatures = (self.chosen_temperature, thermometer, self.room_temperature)
        return self.speed_at(next(temperature for temperature in temperatures if temperature is not None))
