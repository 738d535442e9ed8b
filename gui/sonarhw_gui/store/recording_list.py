"""Lists the logs in the folder of recordings, newest first; a thread reads a few at a time."""

import time
from dataclasses import dataclass, replace
from pathlib import Path

from sonarhw_sim.room.room import parse_room

from sonarhw.errors import InputError
from sonarhw.log import Log, read_log
from sonarhw_gui.work.worker import Failure, Worker

_SLICE = 0.2  # s of reading between updates of the list


@dataclass(frozen=True)
class RecordingRow:
    """One log."""

    path: Path
    changed: float  # modification time, s since the epoch
    began: float  # start of the scan, s since the epoch
    room: str
    place: str
    readings: int
    traces: bool
    condition: str  # whole, torn, damaged, or why the file cannot be read


@dataclass(frozen=True)
class RecordingList:
    """The recordings of a folder that are read so far."""

    folder: Path
    rows: tuple[RecordingRow, ...] = ()  # newest first
    files: int = 0  # number of logs in the folder

    @property
    def complete(self) -> bool:
        """Whether every file has been read."""
        return len(self.rows) == self.files


@dataclass(frozen=True)
class ListRequest:
    """Read more recordings of a folder. A file that has not changed is not read again."""

    known: RecordingList

    def answer(self) -> RecordingList:
        """Read for `_SLICE` s. Raises InputError if the folder cannot be read."""
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
    """Return the logs of a folder with their modification times, newest first; none if there is no folder yet."""
    try:
        found = [(path, path.stat().st_mtime) for path in folder.glob("*.mcap")]
    except OSError as error:
        raise InputError(f"{folder}: cannot be read: {error.strerror}") from error
    return sorted(found, key=lambda one: -one[1])


def _recording(path: Path, changed: float) -> RecordingRow:
    try:
        log = read_log(path)
    except InputError as error:
        reason = str(error).removeprefix(f"{path}: ")
        return RecordingRow(path, changed, changed, "", "", 0, False, reason)
    traces = any(reading.trace is not None for reading in log.readings[:1])
    made = log.metadata
    return RecordingRow(
        path, changed, made.started or changed, _room(log), made.place, len(log.readings), traces, log.condition
    )


def _room(log: Log) -> str:
    """Return the name of the room in a log, else the name of its room file."""
    try:
        return parse_room(log.metadata.room_text, "room").name if log.metadata.room_text else log.metadata.room_file
    except InputError:
        return log.metadata.room_file


class Recordings:
    """Reads the folder in a thread while the list is shown."""

    def __init__(self, folder: Path) -> None:
        self.listed = RecordingList(folder)
        self.failures: list[str] = []
        self._worker = Worker("list recordings")
        self._worker.submit(ListRequest(self.listed))

    def take(self) -> bool:
        """Fetch what was read since the last call; return whether there is anything new."""
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
