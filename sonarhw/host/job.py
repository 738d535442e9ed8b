"""A job: something that is wanted of the device, what came of it, and the script that does it.

A script is a generator that yields what it waits for and returns its result. The session runs it, drops it when the
device is lost and begins it again when the device is back. So a script repeats everything from its beginning, and
everything it sends may be sent twice: settings and angles are absolute, and a scan asks for what has not come.
"""

import math
from array import array
from collections import deque
from collections.abc import Callable, Generator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar

from sonarhw.host.driver import Command
from sonarhw.lost_steps import split_at_homings
from sonarhw.readings import FloatArray, Reading
from sonarhw.wire.arrivals import Progress
from sonarhw.wire.device_clock import DeviceClock
from sonarhw.wire.messages import Started

if TYPE_CHECKING:
    from sonarhw.host.conversation import Conversation

T = TypeVar("T")


@dataclass(frozen=True)
class Wait:
    """What a script waits for."""

    done: Callable[[], bool]
    until: float = math.inf  # s; then it goes on all the same


Script: TypeAlias = Generator[Wait, None, T]


class Job:
    """Something that is wanted of the device; `done` with a `result` or an `error`."""

    def __init__(self, script: "Callable[[Conversation, Job], Script[Any]]", readings: int = 0) -> None:
        """`script` makes the script, again after each loss of the device; a scan has that many `readings`."""
        self.script = script
        self.since = 0.0
        self.moving = False  # the device homes, turns or scans for it
        self.command: Command | None = None  # the newest home, turn or scan
        self.fruitless = 0  # losses of the device in a row, without a reading in between
        self.stop_wanted = False
        self.done = False
        self.result: Any = None
        self.error: BaseException | None = None
        # of a scan
        self.readings: deque[Reading] = deque()
        self.progress = Progress(readings)
        self.began: float | None = None  # on the clock of `Reading.time`, s
        self.unverified_angles: str | None = None  # a clause: which angles could not be checked for lost steps
        self._times, self._angles = array("d"), array("d")  # of all its readings
        self._homed: list[float] = []  # time of the newest reading when the zero was sought anew

    def heed_start(self, clock: DeviceClock) -> None:
        """Book what the device makes of a scan command; to be called before its readings are taken.

        The script may be too late for that: readings come in one piece with the answer, and so may a loss.
        """
        if self.command is None or not isinstance(self.command.answer, Started):
            return
        if self.began is None:
            self.began = clock.continued(self.command.answered_us)
        if not self.progress.received:
            # a replayed log plays what it holds, whatever was ordered
            self.progress.total = self.command.answer.first + self.command.answer.readings

    def take(self, reading: Reading) -> bool:
        """Book a reading; False where it has come before or belongs to no such scan."""
        new = self.progress.take(reading.number)
        if new:
            self._times.append(reading.time)
            self._angles.append(reading.angle)
        return new

    def home(self) -> None:
        """Book that the zero is sought anew."""
        if self._times:
            self._homed.append(max(self._times))

    def angles_between_homings(self) -> list[FloatArray]:
        """The angles of its readings, rad, apart where the zero was sought anew."""
        return split_at_homings(self._times, self._angles, self._homed)

    def end(self, result: Any = None, error: BaseException | None = None) -> None:
        """It is over, where it was not before."""
        if not self.done:
            self.done, self.result, self.error = True, result, error
