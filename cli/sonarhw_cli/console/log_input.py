"""Reading of logs, with a warning if a log is torn or damaged, or if its angles may be wrong."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from sonarhw.errors import counted
from sonarhw_cli.console.lines import print_detail, warn
from sonarhw_cli.console.room_input import open_room

if TYPE_CHECKING:
    from sonarhw_compare.scans import GivenScan, PlacedNotes
    from sonarhw_sim.board.profile import Board
    from sonarhw_sim.room.room import Room

    from sonarhw.log import Log
    from sonarhw.readings import Reading

LogFile = Annotated[Path, typer.Argument(help="Log (*.mcap), whole or torn.", metavar="LOG")]
LogFiles = Annotated[list[Path], typer.Argument(help="Logs (*.mcap), whole or torn.", metavar="LOG")]


def open_log(path: Path) -> "Log":
    """Return the log in a file, with warnings on standard error. Raises InputError if the file is not a log."""
    log = load_log(path)
    print_detail(f"{path}: {counted(len(log.readings), f'{log.origin} reading')}")
    for doubt in log.doubts:
        warn(f"{path}: {doubt}")
    return log


def load_log(path: Path) -> "Log":
    """Return the log in a file, without warnings. Raises InputError if the file is not a log."""
    from sonarhw.log import read_log

    return read_log(path)


def notes_beside(log_file: Path, readings: "Sequence[Reading]") -> "PlacedNotes":
    """Return the notes on the readings of a log, and warn of those that are not shown."""
    from sonarhw_compare.scans import notes_of_log

    notes = notes_of_log(log_file, readings)
    for doubt in notes.doubts:
        warn(doubt)
    return notes


def open_scan(log_file: Path, board: str | None = None) -> "GivenScan":
    """Return the scan in a log, with warnings on standard error. Raises InputError without readings.

    If `board` is None, the log should name the board.
    """
    log = open_log(log_file)  # before the import, which takes a second, so that a wrong name is reported at once
    from sonarhw_compare.scans import GivenScan

    scan = GivenScan(str(log_file), log.readings, log)
    for doubt in scan.board_doubts if board is None else ():
        warn(doubt)
    return scan


def open_in_room(log_file: Path, room_name: str | None, board: str | None) -> "tuple[GivenScan, Room, Board]":
    """Return a log with the given room and board, or else with those in the log. Raises InputError without a room."""
    scan = open_scan(log_file, board)
    room = None if room_name is None else open_room(room_name)
    from sonarhw_sim.board.profile import load_board

    return scan, scan.room(room), load_board(board) if board else scan.board()
