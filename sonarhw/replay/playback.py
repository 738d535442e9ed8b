"""Playback of a log for a viewer: which readings have been made at the current position.

It plays at any speed, in a loop, with or without long gaps, and seeks to any time, scan, sweep or reading. It has no
thread and no clock: the viewer passes the elapsed time.
"""

import math
from bisect import bisect_left, bisect_right
from itertools import pairwise
from statistics import median

from sonarhw.log.contents import Log

_TOLERANCE = 1e-6  # s; without it, rounding could exclude a reading
_PAUSE = 1.0  # s between two scans of a log; replaces the recorded pause
_GAP = 5.0  # a wait is a gap if it is longer than _PAUSE and than this multiple of the median wait


class Playback:
    """A position in the time of a log. It starts at the end, so that all readings are visible."""

    def __init__(self, log: Log) -> None:
        self.log = log
        self.readings = log.readings
        self.loop = False  # whether it restarts at the end
        self.playing = False
        self._times = self._recorded = _schedule(log)
        self.duration = self._times[-1] if self._times else 0.0  # s
        self._skip_gaps = False
        self._speed = 1.0
        self._watched = 0.0  # s; sum of the elapsed times that the viewer has passed
        self._anchor = (0.0, self.duration)  # value of `_watched`, and position at that time

    @property
    def position(self) -> float:
        """Current position, s from the beginning."""
        since, position = self._anchor
        if not self.playing or self._watched <= since:
            return position
        if math.isinf(self._speed):
            return self.duration
        # computed from the anchor, so that rounding errors do not add up
        ahead = position + (self._watched - since) * self._speed
        return ahead % self._lap if self.loop else min(ahead, self.duration)

    @property
    def speed(self) -> float:
        """Speed relative to the recording, above 0; infinite: all at once."""
        return self._speed

    @speed.setter
    def speed(self, speed: float) -> None:
        if not speed > 0:
            raise ValueError(f"speed is {speed}; expected a factor above 0")
        self.seek(self.position)
        self._speed = speed

    @property
    def skip_gaps(self) -> bool:
        """Whether long gaps between two readings are removed from the time of the log."""
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
        """Time of the first reading of each scan that has readings, s from the beginning."""
        scans = (scan for scan, recorded in enumerate(self.log.scans) if recorded.readings)
        return tuple(self._times[self._first_of(scan)] for scan in scans)

    @property
    def count(self) -> int:
        """Number of readings made up to the current position."""
        return bisect_right(self._times, self.position + _TOLERANCE)

    def play(self) -> None:
        """Play from the current position, or from the beginning if it is at the end."""
        position = self.position
        self.seek(0.0 if position >= self.duration else position)
        self.playing = True

    def pause(self) -> None:
        """Pause at the current position."""
        self.seek(self.position)
        self.playing = False

    def advance(self, elapsed: float) -> bool:
        """Let `elapsed` s of the viewer's time pass. Return whether the position has moved."""
        self._watched += elapsed
        if not self.playing:
            return False
        if not self.loop and self.position >= self.duration:
            self.pause()
        return True

    # seeking

    def seek(self, position: float) -> None:
        """Go to `position`, s from the beginning. Playing continues from there."""
        self._anchor = (self._watched, min(max(position, 0.0), self.duration))

    def seek_reading(self, index: int) -> None:
        """Go to the time of that reading of the log. Raises IndexError if there is none."""
        self.seek(self._times[range(len(self._times))[index]])

    def seek_scan(self, scan: int) -> None:
        """Go to the first reading of a scan, counted from 0. Raises IndexError if there is none."""
        self.seek_reading(self._first_of(scan))

    def seek_sweep(self, scan: int, sweep: int) -> None:
        """Go to the first reading of a sweep, or of the next one with readings. Raises IndexError if there is none."""
        readings = self.log.scans[scan].readings
        first = bisect_left(readings, sweep, key=lambda reading: reading.sweep)
        self.seek_reading(self._first_of(scan) + range(len(readings))[first])

    def step(self, by: int) -> None:
        """Pause `by` readings after the current one, or before it if negative. Wraps around only with `loop`."""
        self.pause()
        if self._times:
            wanted = self.count - 1 + by
            last = len(self._times) - 1
            self.seek_reading(wanted % (last + 1) if self.loop else min(max(wanted, 0), last))

    @property
    def _lap(self) -> float:
        """Time from the beginning of one run to that of the next, s."""
        gaps = len(self._times) - 1
        return self.duration + (self.duration / gaps if gaps > 0 and self.duration else _PAUSE)

    def _first_of(self, scan: int) -> int:
        return sum(len(before.readings) for before in self.log.scans[: range(len(self.log.scans))[scan]])


def _schedule(log: Log) -> list[float]:
    """Return the time of each reading of the log, s from the beginning, with a short pause between scans."""
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
    """Return the schedule with every gap shortened to the median wait. It begins with the first reading."""
    waits = [later - earlier for earlier, later in pairwise(times)]
    usual = median(waits) if waits else 0.0
    longest = max(_GAP * usual, _PAUSE) + _TOLERANCE
    shortened = [0.0] if times else []
    for wait in waits:
        shortened.append(shortened[-1] + (usual if wait > longest else wait))
    return shortened
