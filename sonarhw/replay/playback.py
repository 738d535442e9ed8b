"""A log played back: which of its readings have been made by now, on their recorded schedule.

Takes a log and a watcher's clock; hands on how many readings are shown. It plays at any speed, in a loop, without the
waits in which nothing was measured, and goes to any time, scan, sweep or reading, backwards too. No thread and no clock
of its own.
"""

import math
from bisect import bisect_left, bisect_right
from itertools import pairwise
from statistics import median

from sonarhw.log.contents import Log

_REACHED = 1e-6  # s: a slider's whole milliseconds must not cut off the last reading
_PAUSE = 1.0  # s between two scans of a log, however long they lie apart
_GAP = 5.0  # times the usual wait from one reading to the next; a longer one, if over _PAUSE too, is a gap


class Playback:
    """A position in the time of a log; at its end to begin with, so that everything is seen at once."""

    def __init__(self, log: Log) -> None:
        self.log = log
        self.readings = log.readings
        self.loop = False  # whether it starts over at the end
        self.playing = False
        self._times = self._recorded = _schedule(log)
        self.duration = self._times[-1] if self._times else 0.0  # s
        self._skip_gaps = False
        self._speed = 1.0
        self._watched = 0.0  # s that the watcher's clock has told of
        self._anchor = (0.0, self.duration)  # a moment of the watcher's clock and the position then

    @property
    def position(self) -> float:
        """Where it is, s from the beginning."""
        since, position = self._anchor
        if not self.playing or self._watched <= since:
            return position
        if math.isinf(self._speed):
            return self.duration
        # always from the anchor: nothing adds up, however often and unevenly the clock is looked at
        ahead = position + (self._watched - since) * self._speed
        return ahead % self._lap if self.loop else min(ahead, self.duration)

    @property
    def speed(self) -> float:
        """Times faster than recorded, above 0; infinite: all at once."""
        return self._speed

    @speed.setter
    def speed(self, speed: float) -> None:
        if not speed > 0:
            raise ValueError(f"speed is {speed}; expected a factor above 0")
        self.seek(self.position)
        self._speed = speed

    @property
    def skip_gaps(self) -> bool:
        """Whether long waits between two readings are left out, and no longer count in the time of the log."""
        return self._skip_gaps

    @skip_gaps.setter
    def skip_gaps(self, skip: bool) -> None:
        made = self.count
        self._skip_gaps = skip
        self._times = _without_gaps(self._recorded) if skip else self._recorded
        self.duration = self._times[-1] if self._times else 0.0
        self.seek(self._times[made - 1] if made else 0.0)

    @property
    def scan_starts(self) -> tuple[float, ...]:
        """When the first reading of each scan was made, s from the beginning; of scans that have one."""
        scans = (scan for scan, recorded in enumerate(self.log.scans) if recorded.readings)
        return tuple(self._times[self._first_of(scan)] for scan in scans)

    @property
    def count(self) -> int:
        """How many readings have been made at this position."""
        return bisect_right(self._times, self.position + _REACHED)

    def play(self) -> None:
        """Go on, from the beginning where the end was reached."""
        position = self.position
        self.seek(0.0 if position >= self.duration else position)
        self.playing = True

    def pause(self) -> None:
        """Stand still."""
        self.seek(self.position)
        self.playing = False

    def advance(self, elapsed: float) -> bool:
        """Let `elapsed` s of the watcher's time pass; whether the position has moved."""
        self._watched += elapsed
        if not self.playing:
            return False
        if not self.loop and self.position >= self.duration:
            self.pause()
        return True

    # going somewhere

    def seek(self, position: float) -> None:
        """Go to `position`, s from the beginning; it plays on from there if it played."""
        self._anchor = (self._watched, min(max(position, 0.0), self.duration))

    def seek_reading(self, index: int) -> None:
        """Go to where that reading of the log has just been made. Raises IndexError where there is none."""
        self.seek(self._times[range(len(self._times))[index]])

    def seek_scan(self, scan: int) -> None:
        """Go to the first reading of a scan, counted from 0. Raises IndexError where the log has none."""
        self.seek_reading(self._first_of(scan))

    def seek_sweep(self, scan: int, sweep: int) -> None:
        """Go to the first reading of a sweep or of the next that the scan has. Raises IndexError where it has none."""
        readings = self.log.scans[scan].readings
        first = bisect_left(readings, sweep, key=lambda reading: reading.sweep)
        self.seek_reading(self._first_of(scan) + range(len(readings))[first])

    def step(self, by: int) -> None:
        """Stand still `by` readings further on, or before; over the end to the beginning in a loop, else not."""
        self.pause()
        if self._times:
            wanted = self.count - 1 + by
            last = len(self._times) - 1
            self.seek_reading(wanted % (last + 1) if self.loop else min(max(wanted, 0), last))

    @property
    def _lap(self) -> float:
        """From the beginning of one run to that of the next, s."""
        gaps = len(self._times) - 1
        return self.duration + (self.duration / gaps if gaps > 0 and self.duration else _PAUSE)

    def _first_of(self, scan: int) -> int:
        return sum(len(before.readings) for before in self.log.scans[: range(len(self.log.scans))[scan]])


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


def _without_gaps(times: list[float]) -> list[float]:
    """The schedule with every gap cut to the usual wait; it begins with the first reading."""
    waits = [later - earlier for earlier, later in pairwise(times)]
    usual = median(waits) if waits else 0.0
    longest = max(_GAP * usual, _PAUSE) + _REACHED
    shortened = [0.0] if times else []
    for wait in waits:
        shortened.append(shortened[-1] + (usual if wait > longest else wait))
    return shortened
