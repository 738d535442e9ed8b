"""A turntable that takes time to turn: where it points at any moment.

Takes orders to turn, with the time; hands on when it arrives and where it is. Angles in rad, times in s.
"""

import math

SPEED = math.pi  # rad/s
SETTLING = 0.020  # s after a move


class Turntable:
    """Turns at constant speed, never past where it is sent; knows its angle only once homed."""

    def __init__(self, seek: float) -> None:
        self.homed = False
        self._seek = seek  # angle to the zero mark at power-on, rad
        self._from = self._to = 0.0
        self._start = self._arrival = 0.0

    def angle(self, now: float) -> float:
        """Where it points, rad from the zero mark; 0 before it is homed."""
        if not self.homed:
            return 0.0
        if now >= self._arrival:
            return self._to
        return self._from + (self._to - self._from) * (now - self._start) / (self._arrival - self._start)

    def home(self, now: float) -> float:
        """Seek the zero mark; the time when it is found, s. `found` is to be called then."""
        seek = abs(self.angle(now)) if self.homed else self._seek
        self.homed = False
        return now + seek / SPEED + SETTLING

    def found(self, now: float) -> None:
        """The zero mark is here."""
        self.homed = True
        self._from = self._to = 0.0
        self._start = self._arrival = now

    def turn(self, angle: float, now: float) -> float:
        """Turn to `angle`; the time when it stands still there, s."""
        self._from, self._to, self._start = self.angle(now), angle, now
        travel = abs(self._to - self._from) / SPEED
        self._arrival = now + travel
        return self._arrival + (SETTLING if travel else 0.0)

    def halt(self, now: float) -> None:
        """Stand still where it is."""
        self._from = self._to = self.angle(now)
        self._start = self._arrival = now
