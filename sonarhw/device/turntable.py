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
_EXACT = 1e-6  # rad; far less than a microstep


class Turntable:
    """Turns at constant speed, never past where it is sent; tells its angle only once homed.

    It counts the steps it gives and does not see whether they are taken: `wedge` and `slip` make a difference.
    """

    def __init__(self, stands: float) -> None:
        """`stands`: where it points at power-on, rad; it does not know that itself."""
        self.homed = False
        self.speed = SPEED  # rad/s
        self.settling = SETTLING
        self._from = self._to = stands
        self._start = self._arrival = 0.0
        self._slipped = 0.0  # how far it truly stands from where it believes, rad
        self._stuck: tuple[float, float] | None = None  # where, and until when

    def angle(self, now: float) -> float:
        """Where it says it points, rad from the zero mark; 0 before it is homed."""
        return self._position(now) if self.homed else 0.0

    def home(self, now: float) -> float:
        """Seek the zero mark; the time when it is found, s. `found` is to be called then."""
        self.homed = False
        return self._move(0.0, now, HOMING_SPEED) + SETTLING

    def found(self, now: float) -> bool:
        """Whether the zero mark is here; from now on it is zero."""
        self._come_loose(now)
        self.homed = self._stuck is None
        if self.homed:
            self._slipped = 0.0
        return self.homed

    def turn(self, angle: float, now: float) -> float:
        """Turn to `angle`; the time when it stands still there, s."""
        arrival = self._move(angle, now, self.speed)
        return arrival + self.settling if arrival > now else now

    def halt(self, now: float) -> None:
        """Stand still where it is."""
        self._come_loose(now)
        self._from = self._to = self._position(now)
        self._start = self._arrival = now

    def error(self, now: float) -> float:
        """How far it truly stands from where it believes, rad; 0 while no step was missed."""
        self._come_loose(now)
        return self._slipped if self._stuck is None else self._stuck[0] - self._position(now)

    def mark_misplaced(self, now: float) -> bool:
        """Whether the mark came out of its place, or not at all, on the way it was sent last; it comes once a turn."""
        error = self.error(now)
        believed = self._from, self._to
        true = self._from + error, self._to + error
        return abs(error) > _EXACT and any(_passes_mark(min(way), max(way)) for way in (believed, true))

    def slip(self, angle: float) -> None:
        """Miss steps: from now on it stands `angle` (rad) from where it believes."""
        self._slipped += angle

    def wedge(self, now: float, until: float) -> None:
        """Move no more until then, whatever steps are given."""
        self._stuck = self._position(now) + self.error(now), until

    def _come_loose(self, now: float) -> None:
        if self._stuck is not None and now >= self._stuck[1]:
            where, until = self._stuck
            self._stuck = None
            self._slipped = where - self._position(until)

    def _position(self, now: float) -> float:
        if now >= self._arrival:
            return self._to
        return self._from + (self._to - self._from) * (now - self._start) / (self._arrival - self._start)

    def _move(self, angle: float, now: float, speed: float) -> float:
        self._come_loose(now)
        self._from, self._to, self._start = self._position(now), angle, now
        self._arrival = now + abs(self._to - self._from) / speed
        return self._arrival


def _passes_mark(low: float, high: float) -> bool:
    return math.floor((high + _EXACT) / math.tau) >= math.ceil((low - _EXACT) / math.tau)
