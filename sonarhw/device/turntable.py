"""A simulated turntable: its angle at any time. Angles are in rad, times in s.

A simulated cam on the axle shows on which side of the zero mark the table is, also after a power failure. So the table
homes directly, in the direction that unwinds the cable. It homes at twice the speed of its turns: two turns take 2 s.
"""

import math

from sonarhw.wire.codes import Zero

SPEED = math.pi  # rad/s
HOMING_SPEED = 2 * SPEED
SETTLING = 0.020  # s after a move
MISSING = math.radians(5)  # past the position of a mark that has not come
_TOLERANCE = 1e-6  # rad; far less than a microstep


class Turntable:
    """A turntable that turns at constant speed without overshoot. It reports its angle only when it is homed.

    It counts its steps, but cannot detect whether the table follows them. `wedge` and `slip` make steps fail.
    """

    def __init__(self, initial_angle: float) -> None:
        """`initial_angle` is the true angle at power-on, rad. The turntable does not report it."""
        self.zero = Zero.UNKNOWN
        self.speed = SPEED  # rad/s
        self.settling = SETTLING
        self.sign = 1.0  # -1: the table turns clockwise where it counts counter-clockwise
        self.initial = initial_angle
        self.origin = initial_angle  # counted angle where it started, or the last known zero, rad
        self._from = self._to = initial_angle
        self._start = self._arrival = 0.0
        self._slipped = 0.0  # true minus counted angle, rad
        self._stuck: tuple[float, float] | None = None  # angle at which it is blocked, and until when

    def angle(self, now: float) -> float:
        """Return the reported angle, rad from the zero mark; 0 before it is homed."""
        return 0.0 if self.zero is Zero.UNKNOWN else self._position(now)

    def home(self, now: float, mark: float = 0.0) -> float:
        """Turn to the zero mark at that true angle, and return the time of arrival, s. Then call `confirm_home`."""
        self.zero = Zero.UNKNOWN
        self._count_from(self.sign * (self.true_angle(now) - mark), now)
        return self._move(0.0, now, HOMING_SPEED) + SETTLING

    def confirm_home(self, now: float) -> bool:
        """Return whether the zero mark is reached. If so, the table is homed and its angle is 0."""
        self._release_if_due(now)
        if self._stuck is None:
            self.zero, self._slipped, self.origin = Zero.MARK, 0.0, 0.0
        return self.zero is Zero.MARK

    def set_zero(self, now: float) -> None:
        """Call the present angle 0, without moving."""
        self._count_from(0.0, now)
        self.zero, self.origin = Zero.HAND, 0.0

    def turn(self, angle: float, now: float) -> float:
        """Turn to `angle`, and return the time when the table has settled there, s."""
        arrival = self._move(angle, now, self.speed)
        return arrival + self.settling if arrival > now else now

    def turn_to(self, sign: float, now: float) -> None:
        """Turn in this direction, 1 or -1, for a counter-clockwise command from now on."""
        true = self.true_angle(now)
        self.halt(now)
        self.sign = sign
        if self._stuck is None:
            self._slipped = true - sign * self._position(now)

    def jogged(self, angle: float, now: float) -> float:
        """Return the counted angle after turning by `angle`, rad; before a zero is known from an unknown zero."""
        return self._position(now) + angle

    def halt(self, now: float) -> None:
        """Stop at the present angle."""
        self._release_if_due(now)
        self._from = self._to = self._position(now)
        self._start = self._arrival = now

    def error(self, now: float) -> float:
        """Return true minus counted angle, rad; 0 if no step was missed."""
        self._release_if_due(now)
        return self._slipped if self._stuck is None else self._stuck[0] - self.sign * self._position(now)

    def true_angle(self, now: float) -> float:
        """Return the true angle, rad."""
        error = self.error(now)
        return self.sign * self._position(now) + error

    def mark_misplaced(self, now: float) -> bool:
        """Return whether the last move passed the mark, or should have passed it, at a wrong angle.

        A zero that was set by hand is not checked.
        """
        if self.zero is Zero.HAND:
            return False
        error = self.error(now)
        counted = self._from, self._to
        true = self._from + error, self._to + error
        return abs(error) > _TOLERANCE and any(_passes_mark(min(move), max(move)) for move in (counted, true))

    def on_wrong_side(self, now: float, inverted: bool) -> bool:
        """Return whether the mark, perhaps inverted, shows another side of zero than the count within half a turn."""
        counted = self._position(now)
        beside = abs(counted) > MISSING
        return self.zero is Zero.MARK and beside and (marked(self.true_angle(now)) != inverted) != (counted > 0)

    def slip(self, angle: float) -> None:
        """Miss steps: add `angle` (rad) to the difference of true and counted angle."""
        self._slipped += angle

    def wedge(self, now: float, until: float) -> None:
        """Block the table until that time. It counts the steps that it misses."""
        self._stuck = self.true_angle(now), until

    def _count_from(self, angle: float, now: float) -> None:
        """Count on from `angle`, rad, at the present position."""
        self._slipped = self.true_angle(now) - self.sign * angle
        self._from = self._to = angle
        self._start = self._arrival = now

    def _release_if_due(self, now: float) -> None:
        if self._stuck is not None and now >= self._stuck[1]:
            where, until = self._stuck
            self._stuck = None
            self._slipped = where - self.sign * self._position(until)

    def _position(self, now: float) -> float:
        if now >= self._arrival:
            return self._to
        return self._from + (self._to - self._from) * (now - self._start) / (self._arrival - self._start)

    def _move(self, angle: float, now: float, speed: float) -> float:
        self._release_if_due(now)
        self._from, self._to, self._start = self._position(now), angle, now
        self._arrival = now + abs(self._to - self._from) / speed
        return self._arrival


def marked(angle: float) -> bool:
    """Return the level of the mark at this true angle: high from 0 to half a turn."""
    return math.sin(angle + 1e-9) >= 0


def _passes_mark(low: float, high: float) -> bool:
    return math.floor((high + _TOLERANCE) / math.tau) >= math.ceil((low - _TOLERANCE) / math.tau)
