"""A scan as a caller gives it: a log, its file, or readings. Room, place and board are those given, else the log's."""

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

from sonarhw_sim.air import DEFAULT_BOARD
from sonarhw_sim.board.profile import Board, load_board
from sonarhw_sim.room.room import Place, Room, load_room

from sonarhw.errors import InputError
from sonarhw.log import Log, read_log
from sonarhw.readings import Origin, Reading
from sonarhw_compare.imports.recorded_setting import board_of_log, place_of_log, room_of_log

RoomInput: TypeAlias = Room | Path | str
PlaceInput: TypeAlias = Place | tuple[float, float] | str
BoardInput: TypeAlias = Board | Path | str


@dataclass(frozen=True)
class GivenScan:
    """The readings of a scan, and the log that contains them, if any.

    Raises InputError without readings, and for readings whose angles or ranges are unknown.
    """

    where: str  # name of the log in error messages
    readings: tuple[Reading, ...]
    log: Log | None = None

    def __post_init__(self) -> None:
        if not self.readings:
            raise InputError(f"{self.where}: contains no readings")
        for reading in self.readings:
            if not math.isfinite(reading.angle) or (reading.range is not None and not math.isfinite(reading.range)):
                raise InputError(
                    f"{self.where}: the range or angle of reading {reading.number} is unknown; a log without "
                    "Settings has no speed of sound; give another log, or `sonarhw log export` it for its echo times"
                )

    @property
    def origin(self) -> Origin:
        """The origin of the readings: that of the log, else that of the first reading."""
        return self.log.origin if self.log else self.readings[0].origin or Origin.MEASURED

    @property
    def room_text(self) -> str:
        """The text of the room inside the log; empty without one."""
        return "" if self.log is None else self.log.metadata.room_text

    @property
    def recorded_room(self) -> Room | None:
        """The room inside the log; None without one."""
        return None if self.log is None else room_of_log(self.log.metadata, self.where)

    def room(self, given: RoomInput | None = None) -> Room:
        """Return the given room, else the one inside the log. Raises InputError if there is neither."""
        if isinstance(given, Room):
            return given
        if given is not None:
            return load_room(given)
        room = self.recorded_room
        if room is None:
            raise InputError(f"{self.where}: contains no room; give a room")
        return room

    def place(self, room: Room, given: PlaceInput | None = None) -> Place:
        """Return the given place, else the recorded one, else the only one. Raises InputError if there is none."""
        wanted = self.recorded_place(room) if given is None else given
        if wanted is None and len(room.places) != 1:
            places = ", ".join(room.places) or "none"
            raise InputError(
                f"{self.where}: contains no place in room {room.name!r}; give a place, or X,Y in metres; its places: "
                f"{places}; `sonarhw locate` finds an unknown place"
            )
        return room.place(wanted)

    def recorded_place(self, room: Room) -> str | None:
        """Return the place in the log, if the room has it or it is X,Y; else None."""
        return None if self.log is None else place_of_log(self.log.metadata, room)

    @property
    def board_doubts(self) -> tuple[str, ...]:
        """A warning if there is a log that names no board, so that `board` returns the default."""
        if self.log is None or self.log.metadata.board_text or self.log.metadata.board:
            return ()
        return (f"{self.where}: names no board, {DEFAULT_BOARD} is assumed; give the right board",)

    def board(self, given: BoardInput | None = None) -> Board:
        """Return the given board, else that of the log, else the default board."""
        if isinstance(given, Board):
            return given
        if given is not None:
            return load_board(given)
        return load_board(DEFAULT_BOARD) if self.log is None else board_of_log(self.log.metadata)


ScanInput: TypeAlias = Path | str | Log | Sequence[Reading] | GivenScan


def common_board(scans: Sequence[GivenScan], given: BoardInput | None) -> Board:
    """Return the given board, else that of all the scans. Raises InputError if they have different ones."""
    if given is not None:
        return scans[0].board(given)
    boards = [scan.board() for scan in scans]
    for scan, board in zip(scans, boards, strict=True):
        if board != boards[0]:
            raise InputError(
                f"{scans[0].where} and {scan.where} were recorded with different boards; give one board for both"
            )
    return boards[0]


def given_scan(scan: ScanInput) -> GivenScan:
    """Return a scan from a log, the file of a log, or readings. Raises InputError if there is no reading.

    Emits a Python warning if the file is torn or damaged, or if its angles may be wrong.
    """
    if isinstance(scan, GivenScan):
        return scan
    if isinstance(scan, str | Path):
        log = read_log(scan)
        for doubt in log.doubts:
            warnings.warn(f"{scan}: {doubt}", stacklevel=3)
        return GivenScan(str(scan), log.readings, log)
    if isinstance(scan, Log):
        return GivenScan("the log", scan.readings, scan)
    return GivenScan("the scan", tuple(scan))
