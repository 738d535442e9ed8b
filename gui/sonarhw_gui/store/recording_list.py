"""The logs in the folder of recordings, read a few at a time in a thread, newest first."""

import time
from dataclasses import dataclass, replace
from pathlib import Path

from sonarhw_sim.room.model import parse_room

from sonarhw.errors import InputError
from sonarhw.log import Log, read_log
from sonarhw_gui.work.worker import Failure, Worker

_SLICE = 0.2  # s of reading before what is known is shown


@dataclass(frozen=True)
class RecordingRow:
    """One log."""

    path: Path
    changed: float  # when the file was, s since the epoch
    began: float  # s since the epoch
    room: str
    place: str
    readings: int
    traces: bool
    condition: str  # whole, torn, damaged, or why it cannot be read


@dataclass(frozen=True)
class RecordingList:
    """What is known of a folder."""

    folder: Path
    rows: tuple[RecordingRow, ...] = ()  # the newest first
    files: int = 0  # that there are

    @property
    def complete(self) -> bool:
        """Whether every file has been read."""
        return len(self.rows) == self.files


@dataclass(frozen=True)
class ListRequest:
    """What is in this folder? What is known of a file that has not changed is not read again."""

    known: RecordingList

    def answer(self) -> RecordingList:
        """Read some more. Raises InputError where the folder cannot be read."""
        files = _files(self.known.folder)
        known = {row.path: row for row in self.known.rows}
        rows, until = [], time.monotonic() + _SLICE
        for path, changed in files:
            before = known.get(path)
            if before is not None and before.changed == changed:
                rows.append(before)
            elif time.monotonic() < until:
                rows.append(_recording(path, changed))
        rows.sort(key=lambda row: -row.began)
        return replace(self.known, rows=tuple(rows), files=len(files))


def _files(folder: Path) -> list[tuple[Path, float]]:
    """The logs of a folder and when they were changed, the newest first; none where there is no folder yet."""
    try:
        found = [(path, path.stat().st_mtime) for path in folder.glob("*.mcap")]
    except OSError as error:
        raise InputError(f"{folder}: cannot be read: {error.strerror}") from error
    return sorted(found, key=lambda one: -one[1])


def _recording(path: Path, changed: float) -> RecordingRow:
    try:
        log = read_log(path)
    except InputError as error:
        told = str(error).removeprefix(f"{path}: ")
        return RecordingRow(path, changed, changed, "", "", 0, False, told)
    traces = any(reading.trace is not None for reading in log.readings[:1])
    made = log.metadata
    return RecordingRow(
        path, changed, made.started or changed, _room(log), made.place, len(log.readings), traces, log.condition
    )


def _room(log: Log) -> str:
    """The name of the room inside it, else of the file that it was in."""
    try:
        return parse_room(log.metadata.room_text, "room").name if log.metadata.room_text else log.metadata.room_file
    except InputError:
        return log.metadata.room_file


class Recordings:
    """Goes through the folder while somebody looks."""

    def __init__(self, folder: Path) -> None:
        self.listed = RecordingList(folder)
        self.failures: list[str] = []
        self._worker = Worker("list recordings")
        self._worker.submit(ListRequest(self.listed))

    def take(self) -> bool:
        """Take in what has been read since the last call; whether anything has."""
        taken = self._worker.take()
        for answer in taken:
            if isinstance(answer, Failure):
                self.failures.append(answer.message)
                continue
            self.listed = answer
            if not answer.complete:
                self._worker.submit(ListRequest(answer))
        return bool(taken)

    def close(self) -> None:
        """End the thread."""
        self._worker.close()
