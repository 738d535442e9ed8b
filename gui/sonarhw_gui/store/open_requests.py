"""Requests to open a log, a room or a CSV scan, and their answers."""

import time
from dataclasses import dataclass, replace
from pathlib import Path

from sonarhw_sim.board.profile import Board
from sonarhw_sim.files import file_name
from sonarhw_sim.room.room import load_room

from sonarhw.errors import InputError, LogError
from sonarhw.export import write_scan
from sonarhw.log import Log, LogMetadata, read_log
from sonarhw_gui.scene.scene import Scene, first_place, scene_of_log, scene_with
from sonarhw_gui.store.csv_preview import ReadCsvRequest
from sonarhw_gui.store.new_recording import free_name

LOG, ROOM, CSV = ".mcap", ".toml", ".csv"


@dataclass(frozen=True)
class LogOpened:
    """A log and its scene; the room is None if the log contains none."""

    path: Path
    log: Log
    scene: Scene
    notice: str = ""  # where an imported file was stored


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
    """Import a CSV scan as a log, and open the log."""

    source: ReadCsvRequest
    folder: Path  # where the imported log is stored

    def answer(self) -> LogOpened:
        """Import the file, and read the log. Raises InputError, LogError, OutputError."""
        readings = self.source.answer().readings
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            why = f"cannot be created: {error.strerror}; imported scans are stored there"
            raise LogError(f"{self.folder}: {why}") from error
        path = free_name(self.folder, self.source.path.stem, LOG)
        write_scan(path, LogMetadata("import", time.time()), readings)
        log = read_log(path)
        notice = f"{self.source.path.name} was imported as {path.name}, in {self.folder}"
        return LogOpened(path, log, scene_of_log(log.metadata), notice)


@dataclass(frozen=True)
class RoomOpened:
    """The scene of a room file, at its first place."""

    path: Path | None  # None: a shipped room
    scene: Scene

    def at_known_place(self, here: Scene, recorded: str) -> Scene:
        """Return the scene at the place of `here` if that is the same room, which was reloaded.

        Else at the place where the readings were recorded, if the room has a place of this name.
        """
        room, reloaded = self.scene.room, here.room is not None and here.room_file == self.scene.room_file
        for name in (here.pose.name if reloaded else "", recorded):
            if room is not None and name in room.places:
                return replace(self.scene, place=room.place(name))
        return self.scene


@dataclass(frozen=True)
class OpenRoomRequest:
    """Open a room file, or a shipped room by its name."""

    path: Path | str
    board: Board

    def answer(self) -> RoomOpened:
        """Read the room. Raises InputError."""
        room = load_room(self.path)
        path = self.path if isinstance(self.path, Path) else None
        return RoomOpened(path, scene_with(self.board, room, first_place(room), file_name(self.path)))


Opened = LogOpened | RoomOpened | LogGrown
OpenRequest = OpenLogRequest | OpenRoomRequest | OpenCsvRequest | FollowLogRequest


def can_open(path: Path) -> bool:
    """Return whether a file has the extension of a log, a room or a CSV scan."""
    return path.suffix.lower() in (LOG, ROOM, CSV)


def is_csv(path: Path) -> bool:
    """Return whether a file is a scan that must be imported."""
    return path.suffix.lower() == CSV


def request_for(path: Path, board: Board) -> OpenRequest:
    """Return the request that opens a file. Raises InputError for an unknown extension."""
    match path.suffix.lower():
        case ".mcap":
            return OpenLogRequest(path)
        case ".toml":
            return OpenRoomRequest(path, board)
    raise InputError(f"{path.name}: expected a log ({LOG}), a room ({ROOM}) or a scan as {CSV}")
