"""A turntable that takes time to turn: where it points at any moment.

Takes orders to turn, with the time; hands on when it arrives and where it is. Angles in rad, times in s.

It is built so that homing is short from anywhere its cable allows: a cam on the axle tells on which side of the zero
mark it stands, after power has failed too, so it goes straight there, the short way for the cable. It pings nothing on
the way and so may slew at twice the speed of its turns: two whole turns in 2 s.
"""

import math

SPEED = math.pi  # rad/s
HOMING_SPEED = 2 * SPEED
SETTLING = 0.020  # s after a move


class Turntable:
    """Turns at constant speed, never past where it is sent; tells its angle only once homed."""

    def __init__(self, stands: float) -> None:
        """`stands`: where it points at power-on, rad; it does not know that itself."""
        self.homed = False
        self._from = self._to = stands
        self._start = self._arrival = 0.0

    def angle(self, now: float) -> float:
        """Where it says it points, rad from the zero mark; 0 before it is homed."""
        return self._position(now) if self.homed else 0.0

    def home(self, now: float) -> float:
        """Seek the zero mark; the time when it is found, s. `found` is to be called then."""
        self.homed = False
        return self._move(0.0, now, HOMING_SPEED) + SETTLING

    def found(self) -> None:
        """The zero mark is here."""
        self.homed = True

    def turn(self, angle: float, now: float) -> float:
        """Turn to `angle`; the time when it stands still there, s."""
        arrival = self._move(angle, now, SPEED)
        return arrival + SETTLING if arrival > now else now

    def halt(self, now: float) -> None:
        """Stand still where it is."""
        self._from = self._to = self._position(now)
        self._start = self._arrival = now

    def _position(self, now: float) -> float:
        if now >= self._arrival:
            return self._to
        return self._from + (self._to - self._from) * (now - self._start) / (self._arrival - self._start)

    def _move(self, angle: float, now: float, speed: float) -> float:
        self._from, self._to, self._start = self._position(now), angle, now
        self._arrival = now + abs(self._to - self._from) / speed
        return self._arrival
