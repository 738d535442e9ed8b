"""What the readings shown come from: the live scanner, or a log that is replayed."""

import math
import time
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import Protocol, TypeAlias

from sonarhw.device.replayed_log import Playback
from sonarhw.log import Log, RecordedScan
from sonarhw.readings import Origin, Reading
from sonarhw_gui.model.scene import Scene

SPEEDS = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, math.inf)
_SPAN = 3.0  # s, of the measurement of a rate


RecordedIn: TypeAlias = tuple[str, str, str]  # text and file of a room, and a place; empty parts are unknown
UNRECORDED: RecordedIn = ("", "", "")


class RateMeter:
    """The number of readings per second over the last 3 s."""

    def __init__(self) -> None:
        self._counts: deque[tuple[float, int]] = deque()

    def add(self, count: int, now: float) -> None:
        """Count readings that have arrived at `now`, s."""
        if count:
            self._counts.append((now, count))

    def rate(self, now: float) -> float:
        """Return the readings per second; 0 before the second arrival."""
        while self._counts and self._counts[0][0] < now - _SPAN:
            self._counts.popleft()
        if len(self._counts) < 2:
            return 0.0
        # the window begins with the first arrival, whose readings were made before it
        arrived = sum(count for _, count in self._counts) - self._counts[0][1]
        return arrived / max(now - self._counts[0][0], 1e-3)


class Source(Protocol):
    """The live scanner or a replayed log."""

    meter: RateMeter  # of the readings

    @property
    def readings(self) -> tuple[Reading, ...]:
        """All readings, including those after the position of a replay."""

    @property
    def shown(self) -> tuple[Reading, ...]:
        """The readings to show now; the same object while unchanged."""

    @property
    def origin(self) -> Origin:
        """The origin of the readings; without readings, of those that will be made."""

    @property
    def recorded(self) -> Log | Path | None:
        """The log of the readings, or its file; None if there is none."""

    @property
    def path(self) -> Path | None:
        """The file of the log of the readings; None if there is none."""

    @property
    def recorded_in(self) -> RecordedIn:
        """The setting of the readings; empty without readings."""


class Replay(Playback):
    """A log that is replayed."""

    def __init__(self, log: Log, name: str, path: Path | None, changed: Callable[[Playback], None]) -> None:
        """`path`: where to open it again."""
        super().__init__(log, changed)
        self.name, self.path = name, path
        self.meter = RateMeter()
        self.lost = _lost_in(log)  # readings
        self._shown: tuple[Reading, ...] = ()

    def extend(self, log: Log) -> None:
        """Replay the same log with the readings that it has now."""
        self.lost = _lost_in(log)
        super().extend(log)

    @property
    def shown(self) -> tuple[Reading, ...]:
        """The readings up to the position; the same object while unchanged."""
        before, count = self._shown, self.count
        if len(before) != count or (count and before[-1] is not self.readings[count - 1]):
            self.meter.add(max(0, count - len(before)), time.monotonic())
            self._shown = self.readings[:count]
        return self._shown

    @property
    def origin(self) -> Origin:
        """The origin that the log names."""
        return self.log.origin

    @property
    def recorded(self) -> Log:
        """The log."""
        return self.log

    @property
    def recorded_in(self) -> RecordedIn:
        """The setting that the log names."""
        named = self.log.metadata
        return (named.room_text, named.room_file, named.place) if self.readings else UNRECORDED


def doubt_in(source: Source, scene: Scene) -> str:
    """Return a warning if readings were recorded in another room or at another place than this; else ""."""
    text, name, place = source.recorded_in
    if not text or scene.room is None:
        return ""
    if text != scene.room.text:
        other = f"{'an earlier version of ' if name == scene.room_file else ''}{name or 'another room'}"
        return f"these readings were recorded in {other}; they are now compared with {scene.room_file}"
    if place and place != scene.pose.name:
        return f"these readings were recorded at place {place}; they are now compared from {scene.pose.name}"
    return ""


def _lost_in(log: Log) -> int:
    """Return the number of readings missing in the scans of a log."""
    return sum(map(lost_in, log.scans))


def lost_in(scan: RecordedScan) -> int:
    """Return the number of readings of a scan missing in its log; if its size is unknown, the number of gaps."""
    numbers = {reading.number for reading in scan.readings}
    made = scan.finished.readings if scan.finished else max(numbers, default=-1) + 1
    return max(0, made - len(numbers))
