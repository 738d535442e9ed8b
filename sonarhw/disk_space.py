"""Whether the disk has room for what is being recorded, told while there is time to do something about it.

Takes how much has been written by when; hands on one line, once when the disk is nearly full and once more when it
is about to be.
"""

import shutil
from collections.abc import Callable
from pathlib import Path

_LOOK_EVERY = 1.0  # s
_SURE_AFTER = 5.0  # s of writing, before which nothing is said of its pace
# s of recording left, or bytes whatever the pace
_NEARLY_FULL = (600.0, 32_000_000)
_ABOUT_TO_BE_FULL = (60.0, 2_000_000)
# bytes of a log, with its index
_READING = 800.0
_SAMPLE = 1.3


class DiskSpaceMonitor:
    """Watches the disk under `path` while that grows, and tells `warn`."""

    def __init__(self, path: Path, warn: Callable[[str], None]) -> None:
        self._path = path
        self._warn = warn
        self._limits = [_NEARLY_FULL, _ABOUT_TO_BE_FULL]
        self._began: float | None = None
        self._next_look = 0.0

    def written(self, size: int, now: float) -> None:
        """Look, once a second: `size` bytes have been written by `now`, s on any clock."""
        if self._began is None:
            self._began = self._next_look = now
        if now < self._next_look or not self._limits:
            return
        self._next_look = now + _LOOK_EVERY
        free = free_bytes(self._path)
        if free is None:
            return
        took = now - self._began
        left = free / (size / took) if took > _SURE_AFTER and size else float("inf")
        reached = [limit for limit in self._limits if left < limit[0] or free < limit[1]]
        if reached:
            self._limits = [limit for limit in self._limits if limit not in reached]
            pace = f", enough for some {_span(left)} of this scan" if left < float("inf") else ""
            self._warn(f"{self._path}: its disk is nearly full: {free / 1e6:.1f} MB are free{pace}; make room")


def log_size(readings: int, samples: float) -> float:
    """About how many bytes of a log that many readings take, with traces of `samples` samples each."""
    return readings * (_READING + _SAMPLE * samples)


def free_bytes(path: Path) -> int | None:
    """How much can still be written where `path` lies; None where that cannot be told."""
    try:
        return shutil.disk_usage(path.resolve().parent).free
    except OSError:
        return None


def _span(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 120 else f"{seconds / 60:.0f} minutes"
