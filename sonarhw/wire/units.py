"""Conversions between the units of message fields and SI units; temperatures are in °C."""

import math

NO_TEMPERATURE = -32768  # 0.01 °C; means no thermometer
MOST_DEGREES = 2147  # the largest angle of a message, an i32 of µdeg
FULL_SCALE = 255  # of an 8-bit trace sample; that of a 16-bit sample is 257 times as large


def seconds_of(microseconds: int) -> float:
    """Return the time of a message in s."""
    return microseconds * 1e-6


def microseconds_of(seconds: float) -> int:
    """Return the time for a message, µs."""
    return round(seconds * 1e6)


def seconds_of_nanoseconds(nanoseconds: int) -> float:
    """Return the time of flight or trace time of a message in s."""
    return nanoseconds * 1e-9


def nanoseconds_of(seconds: float) -> int:
    """Return the time of flight or trace time for a message, ns."""
    return round(seconds * 1e9)


def radians_of(microdegrees: int) -> float:
    """Return the angle, angular speed or acceleration of a message in rad, rad/s or rad/s²."""
    return math.radians(microdegrees / 1e6)


def microdegrees_of(angle: float) -> int:
    """Return the angle, angular speed or acceleration for a message, µdeg, µdeg/s or µdeg/s²."""
    return round(math.degrees(angle) * 1e6)


def sound_speed_of(millimetres_per_second: int) -> float:
    """Return the speed of sound of a message in m/s."""
    return millimetres_per_second / 1000


def millimetres_per_second_of(sound_speed: float) -> int:
    """Return the speed of sound for a message, mm/s."""
    return round(sound_speed * 1000)


def degrees_c(centidegrees: int) -> float | None:
    """Return the temperature of a message in °C, or None if the device has no thermometer."""
    return None if centidegrees == NO_TEMPERATURE else centidegrees / 100


def centidegrees_of(temperature_c: float | None) -> int:
    """Return the temperature for a message, 0.01 °C; None means no thermometer."""
    return NO_TEMPERATURE if temperature_c is None else round(temperature_c * 100)
