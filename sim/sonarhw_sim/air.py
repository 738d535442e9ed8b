"""Speed of sound in air, and absorption of sound at a frequency, by temperature, humidity and pressure."""

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Air:
    """The state of the air; a room file without `[air]` has the defaults."""

    temperature_c: float = 20.0
    relative_humidity: float = 0.5  # 0..1
    pressure_kpa: float = 101.325

    @property
    def speed_of_sound(self) -> float:
        """Speed of sound, m/s."""
        return self.speed_at(self.temperature_c)

    def speed_at(self, temperature_c: float) -> float:
        """Return the speed of sound, m/s, in this air at another temperature."""
        return speed_of_sound(temperature_c, self.relative_humidity, self.pressure_kpa)


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


def absorption(frequency: float, air: Air) -> float:
    """Return the absorption of a plane wave, dB/m (ISO 9613-1, eq. 3 to 5 and annex B)."""
    kelvin = air.temperature_c + 273.15
    warmth = kelvin / 293.15
    pressure = air.pressure_kpa / 101.325
    saturation = 10 ** (-6.8346 * (273.16 / kelvin) ** 1.261 + 4.6151)
    h = air.relative_humidity * 100 * saturation / pressure
    oxygen = pressure * (24 + 4.04e4 * h * (0.02 + h) / (0.391 + h))
    nitrogen = pressure * warmth**-0.5 * (9 + 280 * h * math.exp(-4.170 * (warmth ** (-1 / 3) - 1)))
    classical = 1.84e-11 / pressure * warmth**0.5
    relaxation = warmth**-2.5 * (
        0.01275 * math.exp(-2239.1 / kelvin) / (oxygen + frequency**2 / oxygen)
        + 0.1068 * math.exp(-3352.0 / kelvin) / (nitrogen + frequency**2 / nitrogen)
    )
    loss: float = 8.686 * frequency**2 * (classical + relaxation)
    return loss
