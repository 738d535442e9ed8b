"""A log played back: which of its readings have been made by now, on their recorded schedule.

Takes a log and the passing of time; hands on how many readings are shown. No clock and no Qt of its own.
"""

import math
from bisect import bisect_right

from sonarhw.log import Log

SPEEDS = (0.5, 1.0, 2.0, 5.0, 20.0, math.inf)
_REACHED = 1e-6  # s: the slider's whole milliseconds must not cut off the last reading
_PAUSE = 1.0  # s between two scans of a log, however long they lie apart


class Playback:
    """A position in the time of a log; at its end to begin with, so that everything is seen at once."""

    def __init__(self, log: Log) -> None:
        self.log = log
        self.readings = log.readings
        self._times = _schedule(log)
        self.duration = self._times[-1] if self._times else 0.0  # s
        self.position = self.duration  # s
        self.speed = 1.0
        self.playing = False

    @property
    def count(self) -> int:
        """How many readings have been made at this position."""
        return bisect_right(self._times, self.position + _REACHED)

    def play(self) -> None:
        """Go on, from the beginning where the end was reached."""
        if self.position >= self.duration:
            self.position = 0.0
        self.playing = True

    def pause(self) -> None:
        """Stand still."""
        self.playing = False

    def seek(self, position: float) -> None:
        """Go to `position`, s from the beginning."""
        self.position = min(max(position, 0.0), self.duration)

    def advance(self, elapsed: float) -> bool:
        """Let `elapsed` s of the watcher's time pass; whether the position has moved."""
        if not self.playing:
            return False
        ahead = self.duration if math.isinf(self.speed) else self.position + elapsed * self.speed
        self.seek(ahead)
        self.playing = self.position < self.duration
        return True


def _schedule(log: Log) -> list[float]:
    """When each reading of the log was made, s from the beginning; scans follow one another with a short pause."""
    times: list[float] = []
    began = 0.0
    for scan in log.scans:
        latest = began
        for reading in scan.readings:
            latest = max(latest, began + reading.time - scan.began)
            times.append(latest)
        began = latest + _PAUSE
    return times
