"""A job of the device: its script, its readings and its result.

A script is a generator that yields a `Wait` and returns its result. The session runs the script, drops it when the
device is lost, and starts it again when the device is back. So a script may send a command twice. This is safe, because
settings and angles are absolute, and a scan requests only the missing readings.
"""

import math
from array import array
from collections import deque
from collections.abc import Callable, Generator
from dataclasses import dataclass
from typing import Any, TypeAlias, TypeVar

from sonarhw.host.driver import Command
from sonarhw.lost_steps import split_at_homings
from sonarhw.readings import FloatArray, Reading
from sonarhw.wire.arrivals import Progress
from sonarhw.wire.device_clock import DeviceClock
from sonarhw.wire.messages import Started

T = TypeVar("T")


@dataclass(frozen=True)
class Wait:
    """The condition that a script waits for."""

    done: Callable[[], bool]
    until: float = math.inf  # s; the script continues at this time even if it is not done


Script: TypeAlias = Generator[Wait, None, T]


class Job:
    """A job of the device. When it is `done`, it has a `result` or an `error`."""

    def __init__(self, script: "Callable[[Any, Job], Script[Any]]", readings: int = 0, moves: bool = True) -> None:
        """`script` creates the script from a `Conversation`, again after each loss of the device.

        `readings` is the number of readings in a scan. `moves` is False if the turntable must not home for this job.
        """
        self.script = script
        self.moves = moves
        self.since = 0.0
        self.moving = False  # whether the device homes, turns or scans for this job
        self.command: Command | None = None  # the newest Home, Turn or StartScan
        self.losses_in_a_row = 0  # losses of the device since the last reading
        self.stop_wanted = False
        self.done = False
        self.result: Any = None
        self.error: BaseException | None = None
        # the following are for scans
        self.readings: deque[Reading] = deque()
        self.progress = Progress(readings)
        self.began: float | None = None  # on the clock of `Reading.time`, s
        self.unverified_angles: str | None = None  # clause with the angles that could not be checked for lost steps
        self._times, self._angles = array("d"), array("d")  # of all readings of the scan
        self._homed: list[float] = []  # time of the newest reading before each homing

    def note_start(self, clock: DeviceClock) -> None:
        """Store start and size of the scan from the answer to StartScan. Call this before its readings are taken.

        The script cannot do this. It may run too late, because readings may arrive together with the answer, or because
        the device may be lost after the answer.
        """
        if self.command is None or not isinstance(self.command.answer, Started):
            return
        if self.began is None:
            self.began = clock.continued(self.command.answered_us)
        if not self.progress.received and self.command.broken is None:
            # a replayed log plays its own readings, even if another sector was requested
            self.progress.total = self.command.answer.first + self.command.answer.readings

    def take(self, reading: Reading) -> bool:
        """Store a reading. Returns False if it is a duplicate or its number is outside the scan."""
        new = self.progress.take(reading.number)
        if new:
            self._times.append(reading.time)
            self._angles.append(reading.angle)
        return new

    def note_homing(self) -> None:
        """Store that the turntable homes again."""
        if self._times:
            self._homed.append(max(self._times))

    def angles_between_homings(self) -> list[FloatArray]:
        """Return the angles of the readings, rad, split at each homing."""
        return split_at_homings(self._times, self._angles, self._homed)

    def end(self, result: Any = None, error: BaseException | None = None) -> None:
        """Finish the job, unless it is done already."""
        if not self.done:
            self.done, self.result, self.error = True, result, error
