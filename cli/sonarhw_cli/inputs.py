"""Inputs of the commands: scanner URLs, logs with their rooms, places and boards."""

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from sonarhw.errors import InputError, counted
from sonarhw_cli.options import VERBOSE, print_detail, print_note, prints, warn

if TYPE_CHECKING:
    from sonarhw_compare.scanner_url import Find
    from sonarhw_compare.scans import GivenScan, PlacedNotes
    from sonarhw_sim.board.profile import Board
    from sonarhw_sim.room.room import Place, Room

    from sonarhw.host.scanner import Scanner
    from sonarhw.log import Log
    from sonarhw.readings import Reading

# Scanner URLs on the command line: connect to the scanner, with warnings on standard error.


ScannerUrl = Annotated[
    str,
    typer.Argument(
        help="Serial port, socket://HOST:PORT, 'fake:ROOM?place=NAME&seed=1' (quoted), a log, or a device that prints "
        "text, 'lines:PORT?baud=9600&preset=NAME'.",
        metavar="URL",
    ),
]
RECONNECT = 30.0  # s
Reconnect = Annotated[float, typer.Option(help="Time for reconnecting to a lost scanner, seconds.", metavar="S", min=0)]


@contextmanager
def connect(url: str, reconnect: float = RECONNECT) -> "Iterator[Scanner]":
    """Yield the connected scanner at `url`. After a loss, the driver tries to reconnect for up to `reconnect` s.

    Raises InputError for an invalid URL, LinkError, DeviceError.
    """
    from sonarhw_compare.scanner_url import open_scanner

    with open_scanner(url, reconnect=reconnect, warn=warn) as scanner:
        _print_fake(url)
        print_detail(f"{url}: scanner {scanner.info.serial or 'without serial number'}, {scanner.info.firmware}")
        yield scanner


@contextmanager
def connect_turntable(url: str) -> "Iterator[Scanner]":
    """Yield the connected scanner at `url`, whose turntable obeys commands. Raises what `connect` raises."""
    from sonarhw_compare.scanner_url import check_turns

    check_turns(url)
    with connect(url) as scanner:
        yield scanner


def board_of(scanner: "Scanner", chosen: str | None) -> "Board":
    """Return the profile that --board names, else that of the scanner, else the default."""
    from sonarhw_sim.air import DEFAULT_BOARD
    from sonarhw_sim.board.profile import board_names, load_board

    named = scanner.info.board
    return load_board(chosen or (named if named in board_names() else DEFAULT_BOARD))


@contextmanager
def resolve(url: str) -> "Iterator[Find]":
    """Yield a function that returns the URL to open with pyserial now. Raises InputError for an invalid URL."""
    from sonarhw_compare import scanner_url

    with scanner_url.resolve(url, warn) as find:
        _print_fake(url)
        yield find


def _print_fake(url: str) -> None:
    """With --verbose, print room, place and board of a `fake:` URL."""
    from sonarhw_compare.scanner_url import is_fake, read_fake_url
    from sonarhw_sim.room.room import load_room

    if not (is_fake(url) and prints(VERBOSE)):
        return
    fake = read_fake_url(url)
    room = load_room(fake.room)
    print_detail(f"{url}: room {room.name!r}, place {fake.place_in(room).name!r}, board {fake.board!r}")


# Rooms, places and poses that options name, with warnings about walls and places that are probably wrong.


def open_room(name: str) -> "Room":
    """Return a shipped room by name or the room in a file, with warnings on standard error. Raises InputError."""
    from sonarhw_sim.room.room import load_room, room_doubts

    room = load_room(name)
    print_detail(f"{name}: room {room.name!r}")
    for doubt in room_doubts(room):
        warn(f"{name}: {doubt}")
    return room


def chosen_place(room: "Room", wanted: str | None) -> "Place":
    """Return the place of a room that --place names, with a warning if no scanner can be there. Raises InputError.

    Prints that a heading is assumed.
    """
    note_assumed_heading(wanted)
    place = room.place(wanted)
    print_place(room, place)
    return place


def print_place(room: "Room", place: "Place") -> None:
    """Print the place with --verbose, and a warning if it is outside the room or inside an object."""
    from sonarhw_sim.room.room import warn_of_place

    warn_of_place(room, place, warn)


def check_one_of_each(places: Sequence[str], poses: Sequence[str], logs: int) -> None:
    """Raise InputError unless there is no place or pose, or one for each log."""
    if places and poses:
        raise InputError("--place and --pose: expected one of them, once for each log")
    for option, given in (("--place", places), ("--pose", poses)):
        if given and len(given) != logs:
            raise InputError(f"{option}: expected one for each of {counted(logs, 'log')}, got {len(given)}")


def place_of_pose(text: str) -> "Place":
    """Return the place of `X,Y,DEG`, metres and the heading of turntable step 0. Raises InputError for another form."""
    from sonarhw_sim.room.room import typed_place

    place = typed_place(text)
    if place is None or text.count(",") < 2:
        raise InputError(f"--pose {text}: expected X,Y,DEG: metres, metres, degrees")
    if not all(map(math.isfinite, (*place.position, place.heading))):
        raise InputError(f"--pose {text}: expected three finite numbers")
    return place


def place_without_room(text: str) -> str:
    """Return a place `X,Y` or `X,Y,DEG`, which needs no room. Raises InputError for the name of a place."""
    from sonarhw_sim.room.room import typed_place

    place = typed_place(text)
    if place is None or not all(map(math.isfinite, (*place.position, place.heading))):
        raise InputError(f"--place needs --room: {text} is a place of a room file; X,Y,DEG needs none")
    note_assumed_heading(text)
    return text


def at_height(place: str | None, height: float | None, room: "Room | None") -> "Place | str | None":
    """Return a place, with this height (m) in the room if it is at X,Y.

    Raises InputError for the height of another place, or one that is not in the room or has no effect there.
    """
    from sonarhw_sim.room.room import typed_place

    if height is None:
        return place
    typed = typed_place(place or "")
    if typed is None:
        raise InputError(f"--height {height:g}: give --place X,Y,DEG, too; places of a room file have their own height")
    if room is not None:
        room.check_height(height)
    return replace(typed, height=height)


def note_assumed_heading(text: str | None) -> None:
    """Print that the heading is assumed to be 0 if a place is given as `X,Y` alone."""
    from sonarhw_sim.room.room import typed_place

    if text and text.count(",") == 1 and typed_place(text) is not None:
        print_note(f"--place {text}: turntable step 0 is assumed at heading 0°; if it is not, write {text},DEG")


# Reading of logs, with a warning if a log is torn or damaged, or if its angles may be wrong.


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

    scan = GivenScan(str(log_file), log.readings, log, log_file)
    doubts = scan.board_doubts if board is None else ()
    for doubt in (*doubts, *scan.doubts(scan.board(board))):
        warn(doubt)
    return scan


def open_in_room(log_file: Path, room_name: str | None, board: str | None) -> "tuple[GivenScan, Room, Board]":
    """Return a log with the given room and board, or else with those in the log. Raises InputError without a room."""
    scan = open_scan(log_file, board)
    room = None if room_name is None else open_room(room_name)
    from sonarhw_sim.board.profile import load_board

    return scan, scan.room(room), load_board(board) if board else scan.board()
