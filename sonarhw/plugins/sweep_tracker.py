"""Assigns the measurements of a device that turns by itself to sweeps.

A sweep ends where the angle turns back (a servo), jumps back to its start, or completes a turn of 360°. A scan starts
in the middle of a sweep. This first part is left out, unless its end shows that it was a whole sweep.

Angles are in radians.
"""

import math
from collections import deque
from dataclasses import dataclass
from statistics import median
from typing import Literal

from sonarhw.plugins.device_plugin import Measurement

_STEPS = 15  # newest steps, of which the median is the usual step
_FEWEST = 5  # steps after which an angle can be recognised as wrong
_JUMP = 3.0  # usual steps
_FAR = 4.0  # usual steps
_FIRST_STEP = math.radians(30)  # largest step over 0° while the usual one is unknown


@dataclass(frozen=True)
class Placed:
    """A measurement, and its place in the scan."""

    sweep: int
    ping: int  # counts from 0 at each heading
    measurement: Measurement


# why a sweep ends before a measurement: the angle turns back or jumps back, a turn of 360° is complete, the device has
# restarted, or measurements are missing
_Break = Literal["turn", "jump", "full", "restart", "gap"]


class SweepTracker:
    """Divides a scan into sweeps. It is `done` after as many whole ones as `want` states."""

    def __init__(self, begins_whole: bool = False) -> None:
        """`begins_whole`: the first sweep is kept, as of a file."""
        self.left_out = 0  # measurements before the first whole sweep
        self.dropped = 0  # measurements with an angle far from both its neighbours
        self.restarts = 0
        self._wanted: int | None = None  # whole sweeps
        self._whole = 0  # whole sweeps so far
        self._sweep = 0
        self._lead: list[Placed] | None = []  # before the first whole sweep; None after its start
        self._held: Measurement | None = None  # the newest, until the next one confirms it
        self._last: Measurement | None = None  # the newest that was placed
        self._ping = 0
        self._pings = 1  # most pings at a heading within a sweep
        self._steps: deque[float] = deque(maxlen=_STEPS)  # absolute
        self._gap = False
        self._span_before = math.nan  # of the sweep before
        self._lowest, self._highest = math.inf, -math.inf  # angles so far
        # of the present sweep
        self._first = 0.0
        self._at_boundary = begins_whole
        self._direction = 0.0  # 1: counter-clockwise, -1: clockwise, 0: unknown
        self._travel = 0.0
        self._wrapped = False  # whether the angle has passed from 360° to 0° or back

    @property
    def started(self) -> bool:
        """Whether a whole sweep has begun."""
        return self._lead is None

    @property
    def done(self) -> bool:
        """Whether enough whole sweeps are complete."""
        return self._wanted is not None and self._whole >= self._wanted

    @property
    def waiting(self) -> int:
        """Number of measurements so far, before the first whole sweep."""
        return len(self._lead or ())

    def want(self, sweeps: int) -> None:
        """Set the number of whole sweeps."""
        self._wanted = sweeps

    def add(self, measurement: Measurement) -> list[Placed]:
        """Add a measurement. Return those that have become certain, in order."""
        held, self._held = self._held, measurement
        if held is None:
            return []
        if self._is_outlier(held, measurement):
            self.dropped += 1
            return []
        return self._place(held, measurement)

    def gap(self) -> None:
        """Handle a loss of the link: the present sweep is not whole, and the next one may begin anywhere."""
        self._held, self._gap = None, True

    def flush(self) -> list[Placed]:
        """Return what is left at the end of a scan; all of it if there was no whole sweep.

        The last sweep is whole if it is as long as the one before.
        """
        held, self._held = self._held, None
        rest = self._place(held, None) if held is not None and not self.done else []
        self._whole += self._at_boundary and self._travel >= self._span_before - self._usual_step / 2
        if self._lead is not None:
            rest, self._lead = self._lead, None
        return rest

    def _place(self, held: Measurement, following: Measurement | None) -> list[Placed]:
        ready: list[Placed] = []
        delta = self._delta(self._last.angle, held.angle) if self._last else 0.0
        broken = self._break_before(held, following, delta)
        if broken is not None:
            ready = self._end_sweep(broken, held.angle)
            if self.done:
                return ready
        elif self._last is not None:
            self._move(delta)
        else:
            self._first = held.angle
        placed = Placed(self._sweep, self._ping, held)
        self._last = held
        self._lowest, self._highest = min(self._lowest, held.angle), max(self._highest, held.angle)
        if self._lead is not None:
            self._lead.append(placed)
            return ready
        return [*ready, placed]

    def _move(self, delta: float) -> None:
        if delta == 0:
            self._ping += 1
            return
        self._pings = max(self._pings, self._ping + 1) if self._travel else self._pings
        self._ping = 0
        self._direction = self._direction or math.copysign(1.0, delta)
        self._travel += abs(delta)
        self._steps.append(abs(delta))

    def _break_before(self, held: Measurement, following: Measurement | None, delta: float) -> _Break | None:
        if self._last is None:
            return None
        if self._gap:
            return "gap"
        jump = bool(self._steps) and abs(delta) > _JUMP * self._usual_step
        if held.restarted and jump:
            return "restart"
        ahead = 0.0 if following is None else self._delta(held.angle, following.angle) * self._direction
        if delta * self._direction < 0 and (jump or ahead <= 0):  # a measured angle may shake
            return "jump" if jump else "turn"
        # many sketches print the last angle twice, first on the way out and then on the way back
        if delta == 0 and self._pings == 1 and self._ping == 0:
            return "turn" if ahead < 0 else None
        if self._wrapped and self._travel + abs(delta) >= 2 * math.pi - self._usual_step / 2:
            return "full"
        return None

    def _end_sweep(self, broken: _Break, angle: float) -> list[Placed]:
        """End the sweep before `angle`. Return the readings of the first sweep, if it was whole."""
        whole = self._is_whole(broken, angle)
        self._span_before = self._travel
        self._whole += whole
        self.restarts += broken == "restart" or (broken == "jump" and self._at_boundary and not whole)
        ready: list[Placed] = []
        if self._lead is None or whole:
            self._sweep += 1
            ready, self._lead = self._lead or [], None
        else:
            self.left_out += len(self._lead)
            self._lead = [] if broken == "gap" else None
        back = {"turn": -self._direction, "jump": self._direction, "full": self._direction}
        self._start_sweep(angle, at_boundary=broken != "gap", direction=back.get(broken, 0.0))
        return ready

    def _start_sweep(self, angle: float, at_boundary: bool, direction: float) -> None:
        self._first = angle
        self._at_boundary = at_boundary
        self._direction = direction
        self._travel = 0.0
        self._wrapped = False
        self._ping = 0
        self._gap = False

    def _is_whole(self, broken: _Break, angle: float) -> bool:
        near = self._usual_step / 2
        if broken == "gap":
            return False
        if broken == "restart":  # some devices print a line of text after each sweep
            return self._at_boundary and abs(self._travel - self._span_before) <= near
        if broken == "jump":  # back to the start, or after a restart that left no text
            return abs(angle - self._first) <= near or (self._at_boundary and self._covers_all(angle))
        return self._at_boundary or broken == "full"

    def _covers_all(self, angle: float) -> bool:
        """Return whether the present sweep covers all angles so far, and `angle`."""
        assert self._last is not None
        low, high = min(self._lowest, angle), max(self._highest, angle)
        near = 1.5 * self._usual_step
        ends = sorted((self._first, self._last.angle))
        return ends[0] - low <= near and high - ends[1] <= near

    @property
    def _usual_step(self) -> float:
        return median(self._steps) if self._steps else 0.0

    def _delta(self, before: float, after: float) -> float:
        """Return the change of the angle. A step over 360° is as large as the other steps."""
        change = after - before
        wrapped = change - math.copysign(2 * math.pi, change)
        most = 1.5 * self._usual_step if self._steps else _FIRST_STEP
        if abs(change) > math.pi and abs(wrapped) <= most:
            self._wrapped = True
            return wrapped
        return change

    def _is_outlier(self, held: Measurement, following: Measurement) -> bool:
        """Return whether an angle is far from its neighbours, which are near each other: a digit was lost."""
        if self._last is None or len(self._steps) < _FEWEST:
            return False
        far = _FAR * self._usual_step
        before, after = self._last.angle, following.angle
        return _apart(before, held.angle) > far and _apart(held.angle, after) > far and _apart(before, after) <= far


def _apart(one: float, other: float) -> float:
    return abs(math.remainder(one - other, 2 * math.pi))
