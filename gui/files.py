"""Opening logs and rooms while the window goes on: requests for a worker, and what it answers.

Takes a file; hands on a log with the scene it carries, or a scene for the room.
"""

from dataclasses import dataclass
from pathlib import Path

from gui.scene import Scene, first_place, scene_of_log
from sim.board import Board
from sim.room import load_room
from sonarhw.log import Log, read_log


@dataclass(frozen=True)
class LogOpened:
    """A log and the scene inside it; its room is None where it carries none."""

    name: str
    log: Log
    scene: Scene


@dataclass(frozen=True)
class OpenLogRequest:
    """What is in this log?"""

    path: Path

    def answer(self) -> LogOpened:
        """Read it. Raises InputError."""
        log = read_log(self.path)
        return LogOpened(self.path.name, log, scene_of_log(log.metadata))


@dataclass(frozen=True)
class RoomOpened:
    """A scene in the room of a file, at its first place."""

    scene: Scene


@dataclass(frozen=True)
class OpenRoomRequest:
    """What is in this room file?"""

    path: Path
    board: Board

    def answer(self) -> RoomOpened:
        """Read it. Raises InputError."""
        room = load_room(self.path)
        return RoomOpened(Scene(room, first_place(room), self.board, self.path.name))
