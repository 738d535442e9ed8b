"""The log that a command reads: opened, with a line of warning where it is torn, damaged or its angles are in doubt."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from sonarhw.errors import InputError
from sonarhw_cli.console.number_format import counted
from sonarhw_cli.console.room_input import open_room
from sonarhw_cli.console.warning_line import warn

if TYPE_CHECKING:
    from sonarhw_sim.board.profile import Board
    from sonarhw_sim.room.model import Room

    from sonarhw.log import Log, LogMetadata

LogFile = Annotated[Path, typer.Argument(help="Log (*.mcap), whole or torn.", metavar="LOG")]
LogFiles = Annotated[list[Path], typer.Argument(help="Logs (*.mcap), whole or torn.", metavar="LOG...")]


def open_log(path: Path) -> "Log":
    """The log in a file, with warnings on standard error. Raises InputError where there is none."""
    log = load_log(path)
    if log.torn:
        read = f"{counted(len(log.readings), 'whole reading')} {'is' if len(log.readings) == 1 else 'are'} read"
        warn(f"{path}: {log.condition}; {read}; {log.torn}")
    for number, scan in enumerate(log.scans, 1):
        if scan.angle_warning:
            which = f"scan {number}: " if len(log.scans) > 1 else ""
            warn(f"{path}: {which}{scan.angle_warning}")
    return log


def load_log(path: Path) -> "Log":
    """The log in a file, without a warning. Raises InputError where there is none."""
    from sonarhw.log import read_log

    if not path.is_file():
        what = "is a folder" if path.is_dir() else "is no file" if path.exists() else "there is no such file"
        raise InputError(f"{path}: {what}; give the name of a log (*.mcap)")
    return read_log(path)


def open_in_room(log_file: Path, room_file: Path | None, board: str | None) -> "tuple[Log, Room, Board]":
    """The log with its room and board: those given, else those recorded in it. Raises InputError if it has none."""
    from sonarhw_sim.board.profile import load_board

    room = None if room_file is None else open_room(room_file)
    log = open_log(log_file)
    room = room or recorded_room(log_file, log.metadata)
    return log, room, load_board(board) if board else recorded_board(log_file, log.metadata)


def recorded_room(log_file: Path, metadata: "LogMetadata") -> "Room":
    """The room inside a log. Raises InputError where it holds none."""
    from sonarhw_sim.room.model import parse_room

    if not metadata.room_text:
        raise InputError(f"{log_file}: holds no room; give one with --room")
    return parse_room(metadata.room_text, f"room inside {log_file}")


def recorded_board(log_file: Path, metadata: "LogMetadata") -> "Board":
    """The board that a log was recorded with; where it says of none, the default, with a line of warning."""
    from sonarhw_compare.imports.recorded_board import DEFAULT_BOARD, board_of_log

    if not metadata.board_text and not metadata.board:
        warn(f"{log_file}: names no board, taken for {DEFAULT_BOARD}; give --board")
    return board_of_log(metadata)


def recorded_place(metadata: "LogMetadata", room: "Room") -> str | None:
    """The place a log was recorded at, by a name that this room knows or as X,Y; None where it says neither."""
    return metadata.place if metadata.place in room.places or "," in metadata.place else None
