"""Notices that the log, room or board file shown in the window has changed on disk."""

import math
import os
import time
from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

_EVERY = 1.0  # s between two looks
_RECENT = 5.0  # s; a log that was written within this time is taken to be in use
_GROWING = 10.0  # s; a log without a change for so long is not followed any more
_REST = 5.0  # times the duration of reading a file, before the next look at it
Stamp = tuple[int, int]  # time of the last change, ns, and size


class WatchedFile(StrEnum):
    """What a file contains."""

    LOG = "log"
    ROOM = "room"
    BOARD = "board"


@dataclass(frozen=True)
class ReloadBoard:
    """An accepted offer to read a changed board profile again."""

    path: Path


class FileWatch:
    """Looks at the files once a second, and reports each change once."""

    def __init__(self) -> None:
        self._files: dict[WatchedFile, tuple[Path, Stamp | None]] = {}
        self._next: dict[WatchedFile, float] = {}
        self._changed_at: dict[WatchedFile, float] = {}

    def watch(self, what: WatchedFile, path: Path | None) -> None:
        """Report changes of this file from now on; None: of no file."""
        self._files.pop(what, None)
        self._changed_at.pop(what, None)
        if path is not None:
            self._files[what] = path, _stamp(path)

    def path(self, what: WatchedFile) -> Path | None:
        """Return the file of this kind; None if none is watched."""
        return self._files[what][0] if what in self._files else None

    def grows(self, what: WatchedFile, now: float) -> bool:
        """Return whether the file of this kind has changed within the last seconds."""
        return what in self._files and now - self._changed_at.get(what, -math.inf) < _GROWING

    def rest(self, what: WatchedFile, took: float, now: float) -> None:
        """Let a file that takes `took` s to read grow for a while before the next look."""
        self._next[what] = now + max(_EVERY, _REST * took)

    def changed(self, now: float) -> Iterator[tuple[WatchedFile, Path]]:
        """Yield the files that have changed since the last look. A missing file may be about to be replaced."""
        for what, (path, before) in list(self._files.items()):
            if now < self._next.get(what, now):
                continue
            self._next[what] = now + _EVERY
            stamp = _stamp(path)
            if stamp is not None and stamp != before:
                self._files[what], self._changed_at[what] = (path, stamp), now
                yield what, path


def is_being_written(path: Path) -> bool:
    """Return whether a file was written within the last seconds."""
    stamp = _stamp(path)
    return stamp is not None and time.time() - stamp[0] / 1e9 < _RECENT


def _stamp(path: Path) -> Stamp | None:
    try:
        status = os.stat(path)
    except OSError:
        return None
    return status.st_mtime_ns, status.st_size
