"""Requests to open a log, a room or a CSV scan, and their answers."""

import time
from dataclasses import dataclass, replace
from itertools import count
from pathlib import Path

from sonarhw_compare.imports.foreign_csv import CsvColumns, guess_columns, likely_no_echo, read_foreign_scan
from sonarhw_sim.board.profile import Board
from sonarhw_sim.room.model import load_room

from sonarhw.errors import InputError, LogError
from sonarhw.export.encoded_log import write_scan
from sonarhw.log import Log, LogMetadata, read_log
from sonarhw_gui.scene.scene import Scene, first_place, scene_of_log, scene_with
from sonarhw_gui.shown.notices import Notice

LOG, ROOM, CSV = ".mcap", ".toml", ".csv"
_UNITS = {1.0: "metres", 0.01: "centimetres", 0.001: "millimetres", 0.3048: "feet", 0.0254: "inches"}


@dataclass(frozen=True)
class LogOpened:
    """A log and its scene; the room is None if the log contains none."""

    path: Path
    log: Log
    scene: Scene
    notice: str = ""  # how the file was interpreted, if it is ambiguous
    question: Notice | None = None  # a question about the interpretation, with the request that changes it


@dataclass(frozen=True)
class OpenLogRequest:
    """Open a log."""

    path: Path
    last_scene: Scene | None = None  # the scene of the last session; None: use the scene in the log

    def answer(self) -> LogOpened:
        """Read the log. Raises InputError."""
        log = read_log(self.path)
        return LogOpened(self.path, log, self.last_scene or scene_of_log(log.metadata))


@dataclass(frozen=True)
class LogGrown:
    """A log that was read again, because its file has grown."""

    path: Path
    log: Log
    took: float  # s


@dataclass(frozen=True)
class FollowLogRequest:
    """Read a log that is being written once more."""

    path: Path

    def answer(self) -> LogGrown:
        """Read the log. Raises InputError."""
        began = time.perf_counter()
        log = read_log(self.path)
        return LogGrown(self.path, log, time.perf_counter() - began)


@dataclass(frozen=True)
class OpenCsvRequest:
    """Open a CSV scan, which is imported as a log."""

    path: Path
    folder: Path  # where the imported log is stored
    no_echo: float | None = None  # the range that means no echo
    log_path: Path | None = None  # of an earlier import of this file, which is overwritten

    def answer(self) -> LogOpened:
        """Import the file as a log, and read the log. Raises InputError, LogError, OutputError."""
        columns, guessed = guess_columns(self.path)
        meaning = replace(guessed, no_echo=self.no_echo)
        readings = read_foreign_scan(self.path, columns, meaning)
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            why = f"cannot be created: {error.strerror}; imported scans are stored there"
            raise LogError(f"{self.folder}: {why}") from error
        path = self.log_path or self._free_name()
        write_scan(path, LogMetadata("import", time.time()), readings, overwrite=path == self.log_path)
        log = read_log(path)
        silence = "" if self.no_echo is None else f" and {self.no_echo:g} as no echo"
        notice = (
            f"{self.path.name} was imported as {path.name}, in {self.folder}; {columns.heading!r} was read as degrees "
            f"counter-clockwise, {columns.distance!r} as ranges in {_unit_name(meaning.scale)}"
            f"{silence}; use `sonarhw import` for another interpretation"
        )
        return LogOpened(path, log, scene_of_log(log.metadata), notice, self._question(columns, path))

    def _free_name(self) -> Path:
        names = (self.folder / f"{self.path.stem}{f'_{k}' if k > 1 else ''}{LOG}" for k in count(1))
        return next(name for name in names if not name.exists())

    def _question(self, columns: CsvColumns, log_path: Path) -> Notice | None:
        likely = None if self.no_echo is not None else likely_no_echo(self.path, columns)
        if likely is None:
            return None
        value, count = likely
        return Notice(
            f"{count} readings of {self.path.name} have {value:g} in {columns.distance!r}"
            f"{', the largest value' if value else ''}: does this mean no echo?",
            "No echo",
            replace(self, no_echo=value, log_path=log_path),
        )


@dataclass(frozen=True)
class RoomOpened:
    """The scene of a room file, at its first place."""

    path: Path
    scene: Scene


@dataclass(frozen=True)
class OpenRoomRequest:
    """Open a room file."""

    path: Path
    board: Board

    def answer(self) -> RoomOpened:
        """Read the room. Raises InputError."""
        room = load_room(self.path)
        return RoomOpened(self.path, scene_with(self.board, room, first_place(room), self.path.name))


Opened = LogOpened | RoomOpened | LogGrown
OpenRequest = OpenLogRequest | OpenRoomRequest | OpenCsvRequest | FollowLogRequest


def _unit_name(metres: float) -> str:
    return _UNITS.get(metres, f"{metres:g} m")


def can_open(path: Path) -> bool:
    """Return whether a file has the extension of a log, a room or a CSV scan."""
    return path.suffix.lower() in (LOG, ROOM, CSV)


def request_for(path: Path, board: Board, folder: Path) -> OpenRequest:
    """Return the request that opens a file. Raises InputError for an unknown extension."""
    match path.suffix.lower():
        case ".mcap":
            return OpenLogRequest(path)
        case ".toml":
            return OpenRoomRequest(path, board)
        case ".csv":
            return OpenCsvRequest(path, folder)
    raise InputError(f"{path.name}: expected a log ({LOG}), a room ({ROOM}) or a scan as {CSV}")
