"""Scans as callers give them: a log, a file or readings, with room, place, board and notes of each."""

import csv
import io
import math
import sys
import warnings
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeAlias

from sonarhw_sim.air import DEFAULT_BOARD
from sonarhw_sim.board.profile import Board, load_board, parse_board
from sonarhw_sim.room.room import Place, Room, load_room, parse_room

from sonarhw.errors import InputError, OutputError, counted_are, harmless
from sonarhw.export import number, text_cell
from sonarhw.files import atomic_file
from sonarhw.log import Log, LogMetadata, read_log
from sonarhw.readings import FloatArray, Origin, Reading

# The room, place and board that a log was recorded with, even if their files no longer exist.


def room_of_log(metadata: LogMetadata, where: str) -> Room | None:
    """Return the room inside the log `where`; None if it contains none. Raises InputError if it is invalid."""
    return parse_room(metadata.room_text, f"room inside {where}") if metadata.room_text else None


def place_of_log(metadata: LogMetadata, room: Room) -> str | None:
    """Return the place of a log: X,Y, or the name of a place in this room. None if it contains neither."""
    return metadata.place if metadata.place in room.places or "," in metadata.place else None


def board_of_log(metadata: LogMetadata) -> Board:
    """Return the profile inside the log, else the one it names, else the default.

    Raises InputError if the profile inside is invalid, or the named one is not installed.
    """
    if metadata.board_text:
        return parse_board(metadata.board_text, f"the board profile in the log ({metadata.board or 'no name'})")
    return load_board(metadata.board or DEFAULT_BOARD)


# A scan as a caller gives it: a log, its file, or readings. Room, place and board are those given, else the log's.


RoomInput: TypeAlias = Room | Path | str
PlaceInput: TypeAlias = Place | Sequence[float] | FloatArray | str
BoardInput: TypeAlias = Board | Path | str
Warn: TypeAlias = Callable[[str], None]  # receives a warning


@dataclass(frozen=True)
class GivenScan:
    """The readings of a scan, and the log that contains them, if any.

    Raises InputError without readings, and for readings whose angles or ranges are unknown.
    """

    where: str  # name of the log in error messages
    readings: tuple[Reading, ...]
    log: Log | None = None
    file: Path | None = None  # of the log

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
    def notes(self) -> "PlacedNotes":
        """The notes beside the log; none without a file."""
        return PlacedNotes() if self.file is None else notes_of_log(self.file, self.readings)

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


def emit(message: str) -> None:
    """Emit a Python warning at the line that called these packages."""
    depth, frame = 2, sys._getframe(1)
    while frame.f_back is not None and frame.f_globals.get("__name__", "").startswith("sonarhw"):
        depth, frame = depth + 1, frame.f_back
    warnings.warn(message, stacklevel=depth)


def given_scan(scan: ScanInput, warn: Warn = emit) -> GivenScan:
    """Return a scan from a log, the file of a log, or readings. Raises InputError if there is no reading.

    Warns if the file is torn or damaged, or if its angles may be wrong.
    """
    if isinstance(scan, GivenScan):
        return scan
    if isinstance(scan, str | Path):
        log = read_log(scan)
        for doubt in log.doubts:
            warn(f"{scan}: {doubt}")
        return GivenScan(str(scan), log.readings, log, Path(scan))
    if isinstance(scan, Log):
        return GivenScan("the log", scan.readings, scan)
    return GivenScan("the scan", tuple(scan))


# The notes file of a log, `LOG.notes.csv`: one line for each note. The log itself is never changed.
#
# Lines that are not notes are kept when the file is written again.


HEADER = "sweep", "reading", "heading_deg", "range_m", "note"
MOST_CHARACTERS = 500  # of a note
_MOST_BYTES = 16 * 2**20
_SAME_DEGREES, _SAME_METRES = 1e-4, 1e-5  # rounding of the file
_TEXT = {"encoding": "utf-8", "errors": "surrogateescape"}  # bytes that are not UTF-8 are kept


@dataclass(frozen=True)
class ReadingNote:
    """A note, and what identifies its reading in the log."""

    sweep: int  # from 1
    reading: int  # `Reading.number`, from 0 within its scan
    heading_deg: float | None  # turntable angle; None if it is unknown
    range_m: float | None  # None: no echo, or unknown
    text: str  # empty: delete the note

    def is_on_reading_of(self, other: "ReadingNote") -> bool:
        """Return whether both notes are on the same reading."""
        return (
            (self.sweep, self.reading) == (other.sweep, other.reading)
            and _same(self.heading_deg, other.heading_deg, _SAME_DEGREES)
            and _same(self.range_m, other.range_m, _SAME_METRES)
        )


NumberedLine: TypeAlias = tuple[int, tuple[str, ...]]  # number from 1, and cells


@dataclass(frozen=True)
class NoteFile:
    """The content of a notes file."""

    notes: tuple[ReadingNote, ...] = ()
    unread: tuple[NumberedLine, ...] = ()  # lines that are not notes

    def doubts(self, path: Path) -> Iterator[str]:
        """Yield a warning if there are lines that are not notes."""
        if self.unread:
            lines = counted_are(len(self.unread), "line")
            yield (
                f"{path}: {lines} not a note, the first is line {self.unread[0][0]}; expected "
                f"{','.join(HEADER)}; such lines are kept and not shown"
            )


def notes_path(log: Path) -> Path:
    """Return the notes file of a log: beside it, with the extension `.notes.csv`."""
    return log.with_suffix(".notes.csv")


def note_text(text: str) -> str:
    """Return a text as a note: one line of at most 500 characters, without control characters."""
    return harmless(" ".join(text.split()))[:MOST_CHARACTERS]


def read_notes(path: Path) -> NoteFile:
    """Return the notes in a file; without a file, none. Raises InputError if it is not a notes file."""
    try:
        if not path.exists():
            return NoteFile()
        if not path.is_file():  # a pipe may have no end
            raise InputError(f"{path}: is not a file; notes on readings are stored there")
        if path.stat().st_size > _MOST_BYTES:
            raise InputError(f"{path}: is larger than {_MOST_BYTES // 2**20} MiB; expected notes on readings")
        text = path.read_bytes().decode(**_TEXT).removeprefix("\ufeff")
        lines = csv.reader(io.StringIO(text, newline=""))
        rows = [(lines.line_num, tuple(cells)) for cells in lines if cells]
    except OSError as error:
        raise InputError(f"{path}: notes cannot be read: {error.strerror}") from error
    except csv.Error as error:
        raise InputError(f"{path}: notes cannot be read: {error}") from error
    if rows and tuple(cell.strip() for cell in rows[0][1]) != HEADER:
        raise InputError(f"{path}: line {rows[0][0]}: expected {','.join(HEADER)}; this is no file of notes")
    found = [(_note(row[1]), row) for row in rows[1:]]
    notes = tuple(note for note, _ in found if note is not None)
    return NoteFile(notes, tuple(row for note, row in found if note is None))


def save_notes(path: Path, changes: Sequence[ReadingNote]) -> None:
    """Write notes into their file; an empty text deletes the note of its reading. Everything else in it is kept.

    The file is read again, because another program may have changed it. Without notes it is removed. Raises InputError
    if it is not a notes file, OutputError if it cannot be written.
    """
    known = read_notes(path)
    kept = [note for note in known.notes if not any(note.is_on_reading_of(change) for change in changes)]
    notes = sorted([*kept, *(change for change in changes if change.text)], key=lambda note: (note.sweep, note.reading))
    if not notes and not known.unread:
        _remove(path)
        return
    text = io.StringIO(newline="")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(HEADER)
    writer.writerows(map(_cells, notes))
    writer.writerows(cells for _, cells in known.unread)
    with atomic_file(path, "folder for the log", overwrite=True) as file:
        file.write(text.getvalue().encode(**_TEXT))


def _remove(path: Path) -> None:
    try:
        path.unlink(missing_ok=True)
    except OSError as error:
        raise OutputError(f"{path}: cannot be removed: {error.strerror}") from error


def _cells(note: ReadingNote) -> tuple[str, ...]:
    degrees, metres = ("" if value is None else number(value) for value in (note.heading_deg, note.range_m))
    return str(note.sweep), str(note.reading), degrees, metres, _cell(note.text)


def _cell(text: str) -> str:
    if not text.isprintable():  # not written by this program: stays as it is
        return text
    # one more ' before a text that begins with one, because reading removes the first
    return f"'{text}" if text.startswith("'") else text_cell(text)


def _note(cells: Sequence[str]) -> ReadingNote | None:
    """Return the note in these cells; None if they are not a note."""
    if len(cells) != len(HEADER):
        return None
    try:
        sweep, reading = int(cells[0]), int(cells[1])
        degrees, metres = (float(cell) if cell.strip() else None for cell in cells[2:4])
    except ValueError:
        return None
    text = cells[4].removeprefix("'").strip()
    known = all(value is None or math.isfinite(value) for value in (degrees, metres))
    return ReadingNote(sweep, reading, degrees, metres, text) if sweep > 0 <= reading and known and text else None


def _same(one: float | None, other: float | None, within: float) -> bool:
    if one is None or other is None:
        return one is other
    return abs(one - other) <= within


# Notes on the readings of a log: find the reading of each note.


@dataclass(frozen=True)
class PlacedNotes:
    """The notes on readings of a log."""

    texts: dict[int, str] = field(default_factory=dict)  # by the place of the reading among those of the log, from 0
    doubts: tuple[str, ...] = ()  # why notes are not among them


def note_on(reading: Reading, text: str) -> ReadingNote:
    """Return a note on a reading."""
    degrees, metres = _known(math.degrees(reading.angle)), _known(reading.range)
    return ReadingNote(reading.sweep + 1, reading.number, degrees, metres, text)


def notes_of_log(log: Path, readings: Sequence[Reading]) -> PlacedNotes:
    """Return the notes beside a log with these readings. A file that cannot be read is a doubt."""
    path = notes_path(log)
    try:
        stored = read_notes(path)
    except InputError as error:
        return PlacedNotes(doubts=(str(error),))
    placed = placed_notes(stored.notes, readings, path, log)
    return PlacedNotes(placed.texts, (*stored.doubts(path), *placed.doubts))


def placed_notes(notes: Iterable[ReadingNote], readings: Sequence[Reading], path: Path, log: Path) -> PlacedNotes:
    """Return each note at its reading. A note whose reading is missing or has changed is a doubt.

    Several notes on one reading are joined. `path`: the notes file; `log`: the log of the readings.
    """
    notes = tuple(notes)
    numbered: dict[tuple[int, int], list[int]] = defaultdict(list)
    for place, reading in enumerate(readings if notes else ()):
        numbered[reading.sweep + 1, reading.number].append(place)
    texts: dict[int, str] = {}
    lost = 0
    for note in notes:
        places = numbered.get((note.sweep, note.reading), [])
        found = next((place for place in places if note.is_on_reading_of(note_on(readings[place], ""))), None)
        if found is None:
            lost += 1
        else:
            texts[found] = note_text(f"{texts[found]}; {note.text}" if found in texts else note.text)
    return PlacedNotes(texts, _doubts(lost, path, log))


def _doubts(lost: int, path: Path, log: Path) -> tuple[str, ...]:
    if not lost:
        return ()
    belong = "1 note belongs to a reading" if lost == 1 else f"{lost} notes belong to readings"
    return (f"{path}: {belong} that {log.name} does not contain; the log has changed. The file keeps them",)


def _known(value: float | None) -> float | None:
    return value if value is not None and math.isfinite(value) else None
