"""A flat plate in front of a scanner: heard over a beam, at one range but for a delay where the echo is weak."""

import math

from sonarhw.echo_source import Heard, Ping

BEAM = math.radians(11.0)  # to either side of the perpendicular
_LATE = 0.004  # m, at the rim of the beam


def plate_range(angle: float, distance: float, direction: float) -> float | None:
    """Range of a plate in `direction` as told at `angle`; None where it is out of the beam."""
    off = abs(angle - direction) / BEAM
    return distance + _LATE * off**4 if off <= 1 else None


class Plate:
    """An echo source: a plate, and a scanner whose zero and ranges are off."""

    temperature_c = 20.0

    def __init__(self, distance: float, direction: float, offset: float, speed_of_sound: float) -> None:
        self._distance, self._direction = distance, direction
        self._offset, self._speed = offset, speed_of_sound

    def hear(self, ping: Ping) -> Heard:
        """The plate."""
        told = plate_range(ping.angle, self._distance, self._direction)
        return Heard(() if told is None else (2 * (told + self._offset) / self._speed,))
