"""Notices that the room or board file shown in the window has changed on disk."""

import os
from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import NamedTuple

LOOK_EVERY = 1.0  # s between two looks at a file


class Stamp(NamedTuple):
    """What differs after a change of a file."""

    changed_ns: int  # time of the last change, since the epoch
    size: int  # bytes


class WatchedFile(StrEnum):
    """What a file contains."""

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
        self._look_at = 0.0

    def watch(self, what: WatchedFile, path: Path | None) -> None:
        """Report changes of this file from now on; None: of no file."""
        self._files.pop(what, None)
        if path is not None:
            self._files[what] = path, stamp_of(path)

    def path(self, what: WatchedFile) -> Path | None:
        """Return the file of this kind; None if none is watched."""
        return self._files[what][0] if what in self._files else None

    def changed(self, now: float) -> Iterator[tuple[WatchedFile, Path]]:
        """Yield the files that have changed since the last look. A missing file may be about to be replaced."""
        if now < self._look_at:
            return
        self._look_at = now + LOOK_EVERY
        for what, (path, before) in list(self._files.items()):
            stamp = stamp_of(path)
            if stamp is not None and stamp != before:
                self._files[what] = path, stamp
                yield what, path


def stamp_of(path: Path) -> Stamp | None:
    """Return the stamp of a file; None if it is missing or cannot be looked at."""
    try:
        status = os.stat(path)
    except OSError:
        return None
    return Stamp(status.st_mtime_ns, status.st_size)
