"""Reading of logs, with a warning if a log is torn or damaged, or if its angles may be wrong."""

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
    """Return the log in a file, with warnings on standard error. Raises InputError if the file is not a log."""
    log = load_log(path)
    if log.torn:
        read = f"{counted(len(log.readings), 'whole reading')} read"
        warn(f"{path}: {log.condition}; {read}; {log.torn}")
    for number, scan in enumerate(log.scans, 1):
        if scan.angle_warning:
            which = f"scan {number}: " if len(log.scans) > 1 else ""
            warn(f"{path}: {which}{scan.angle_warning}")
    return log


def load_log(path: Path) -> "Log":
    """Return the log in a file, without warnings. Raises InputError if the file is not a log."""
    from sonarhw.log import read_log

    if not path.is_file():
        what = "is a folder" if path.is_dir() else "is not a file" if path.exists() else "no such file"
        raise InputError(f"{path}: {what}; give the name of a log (*.mcap)")
    return read_log(path)


def open_in_room(log_file: Path, room_file: Path | None, board: str | None) -> "tuple[Log, Room, Board]":
    """Return a log with the given room and board, or else with those in the log. Raises InputError without a room."""
    from sonarhw_sim.board.profile import load_board

    room = None if room_file is None else open_room(room_file)
    log = open_log(log_file)
    room = room or recorded_room(log_file, log.metadata)
    return log, room, load_board(board) if board else recorded_board(log_file, log.metadata)


def recorded_room(log_file: Path, metadata: "LogMetadata") -> "Room":
    """Return the room inside a log. Raises InputError if it contains none."""
    from sonarhw_sim.room.model import parse_room

    if not metadata.room_text:
        raise InputError(f"{log_file}: contains no room; give one with --room")
    return parse_room(metadata.room_text, f"room inside {log_file}")


def recorded_board(log_file: Path, metadata: "LogMetadata") -> "Board":
    """Return the board in a log. If it contains none, return the default board and print a warning."""
    from sonarhw_compare.imports.recorded_board import board_of_log
    from sonarhw_sim.choices import DEFAULT_BOARD

    if not metadata.board_text and not metadata.board:
        warn(f"{log_file}: names no board, {DEFAULT_BOARD} is assumed; give the right one with --board")
    return board_of_log(metadata)


def recorded_place(metadata: "LogMetadata", room: "Room") -> str | None:
    """Return the place of a log: X,Y, or the name of a place in this room. None if it contains neither."""
    return metadata.place if metadata.place in room.places or "," in metadata.place else None
