"""The torn log that is shown: it is read again while another program writes it, or else reported as torn."""

import math
import time
from pathlib import Path

from sonarhw_gui.store.file_watch import LOOK_EVERY, Stamp, stamp_of

TORN_AFTER = 3.0  # s without growth, after which a log that was just written is reported as torn
_RECENT = 5.0  # s; a log that was written within this time is taken to be in use
_GROWING = 10.0  # s; a log without a change for so long is not growing any more
_REST = 5.0  # times the duration of reading the log, before the next look at it


class FollowedLog:
    """The file of a torn log, and the warning about it. All times are s on one clock."""

    def __init__(self) -> None:
        self._path: Path | None = None
        self._stamp: Stamp | None = None  # at the last look
        self._look_at = self._grown_at = -math.inf
        self._warning, self._warn_at = "", math.inf

    def follow(self, path: Path | None, warning: str, now: float) -> None:
        """Follow a torn log; None: it is in no file. The warning is due when the log no longer grows, else now."""
        self._path, self._stamp = path, None if path is None else stamp_of(path)
        self._look_at, self._grown_at = now, -math.inf
        in_use = self._stamp is not None and time.time() - self._stamp.changed_ns / 1e9 < _RECENT
        self._warning, self._warn_at = warning, now + (TORN_AFTER if in_use else 0.0)

    def stop(self) -> None:
        """Follow nothing, and drop the warning."""
        self._path, self._grown_at, self._warn_at = None, -math.inf, math.inf

    def grows(self, now: float) -> bool:
        """Return whether the log has grown within the last seconds."""
        return now - self._grown_at < _GROWING

    def due_warnings(self, now: float) -> list[str]:
        """Return the warning if it is due, once."""
        if now < self._warn_at:
            return []
        self._warn_at = math.inf
        return [self._warning]

    def grown_file(self, now: float) -> Path | None:
        """Return the file if it has grown since the last look; it must then be read again."""
        if self._path is None or now < self._look_at:
            return None
        self._look_at = now + LOOK_EVERY
        stamp = stamp_of(self._path)
        if stamp is None or stamp == self._stamp:
            return None
        self._stamp, self._grown_at, self._warn_at = stamp, now, math.inf
        return self._path

    def rest(self, took: float, now: float) -> None:
        """Let a log that takes `took` s to read grow for a while before the next look."""
        self._look_at = now + max(LOOK_EVERY, _REST * took)
