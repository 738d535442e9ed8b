"""Warn early when the disk is too small for a recording.

There are two warnings at most: one when the disk is nearly full, and one shortly before it is full.
"""

import shutil
from collections.abc import Callable
from pathlib import Path

_CHECK_EVERY = 1.0  # s
_RATE_KNOWN_AFTER = 5.0  # s of writing
# limits of the two warnings: remaining recording time, s, and free bytes
_NEARLY_FULL = (600.0, 32_000_000)
_ABOUT_TO_BE_FULL = (60.0, 2_000_000)
# bytes of a reading and of a trace sample in a log with its index
_READING = 800.0
_SAMPLE = 2.4  # bytes of a sample of a trace: its frame, and 1 or 2 bytes in its decoded message


class DiskSpaceMonitor:
    """Watches the free space of the disk of `path` while that file grows, and passes warnings to `warn`."""

    def __init__(self, path: Path, warn: Callable[[str], None]) -> None:
        self._path = path
        self._warn = warn
        self._limits = [_NEARLY_FULL, _ABOUT_TO_BE_FULL]
        self._began: float | None = None
        self._next_check = 0.0

    def written(self, size: int, now: float) -> None:
        """Check the free space, at most once a second. `size` bytes have been written until `now`, s on any clock."""
        if self._began is None:
            self._began = self._next_check = now
        if now < self._next_check or not self._limits:
            return
        self._next_check = now + _CHECK_EVERY
        free = free_bytes(self._path)
        if free is None:
            return
        took = now - self._began
        left = free / (size / took) if took > _RATE_KNOWN_AFTER and size else float("inf")
        reached = [limit for limit in self._limits if left < limit[0] or free < limit[1]]
        if reached:
            self._limits = [limit for limit in self._limits if limit not in reached]
            time = f", enough for about {_span(left)} of this scan" if left < float("inf") else ""
            self._warn(f"{self._path}: its disk is nearly full: {free / 1e6:.1f} MB are free{time}; delete other files")


def log_size(readings: int, samples: float) -> float:
    """Estimate the bytes of a log with that many readings, each with a trace of `samples` samples."""
    return readings * (_READING + _SAMPLE * samples)


def free_bytes(path: Path) -> int | None:
    """Return the free bytes of the disk of `path`, or None if they are unknown."""
    try:
        return shutil.disk_usage(path.resolve().parent).free
    except OSError:
        return None


def _span(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 120 else f"{seconds / 60:.0f} minutes"
