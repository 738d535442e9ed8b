"""Scans as callers give them: a log, a file or readings, with room, place, board and notes of each."""

import csv
import io
import math
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TypeAlias, cast

import numpy as np
from numpy.typing import ArrayLike
from sonarhw_sim.air import DEFAULT_BOARD, Air
from sonarhw_sim.board.profile import Board, load_board, parse_board, without_own_body
from sonarhw_sim.room.room import Place, Room, load_room, parse_room, place_at

from sonarhw import arguments
from sonarhw.arguments import Warn, emit
from sonarhw.errors import InputError, OutputError, counted, counted_are, harmless, number, text_cell
from sonarhw.files import atomic_file
from sonarhw.log import Log, LogMetadata, read_log
from sonarhw.readings import FloatArray, Origin, Reading, RobotPose, angle_difference, poses_from
from sonarhw.scan_check import DoubtKind, Reach, check_scan

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

_ONE_PLACE, _ONE_HEADING = 0.05, math.radians(3)  # m and rad; beyond, readings do not belong to one place


@dataclass(frozen=True)
class GivenScan:
    """The readings of a scan, and the log that contains them, if any.

    Raises InputError without readings, and for readings whose angles or ranges are unknown.
    """

    where: str  # name of the log in error messages
    readings: tuple[Reading, ...]
    log: Log | None = None
    file: Path | None = None  # of the log
    pose: Place | None = None  # of a scan without a log
    warned_of: frozenset[DoubtKind] = frozenset()  # doubts that need no second warning

    def __repr__(self) -> str:
        echoes = sum(reading.range is not None for reading in self.readings)
        where = "" if self.pose is None else f", at {self.pose.name}"
        return f"GivenScan({self.where!r}, {counted(len(self.readings), 'reading')}, {echoes} with an echo{where})"

    def __post_init__(self) -> None:
        if not self.readings:
            raise InputError(f"{self.where}: contains no readings")
        for reading in self.readings:
            if not isinstance(reading, Reading):
                raise arguments.refusal("readings", "readings", reading)
            if not math.isfinite(reading.angle) or (reading.range is not None and not math.isfinite(reading.range)):
                raise InputError(
                    f"{self.where}: the range or angle of reading {reading.number} is unknown; a log without "
                    "Settings has no speed of sound; give another log, or `sonarhw log export` it for its echo times"
                )

    @cached_property
    def poses(self) -> FloatArray | None:
        """The poses of the readings, (n, 3) m, m and rad; None if one is unknown, or if the sensor stands still."""
        return None if self.readings[0].pose is None else poses_from(self.readings[0].pose, self.readings)

    def check_stands(self) -> None:
        """Raise InputError if the sensor has moved too far for one place."""
        if self.poses is None:
            return
        moved = float(np.hypot(*(self.poses[:, :2] - self.poses[0, :2]).T).max())
        if moved > _ONE_PLACE or _turn(self.poses) > _ONE_HEADING:
            raise InputError(
                f"{self.where}: the sensor moves by {moved:.2f} m and turns by {math.degrees(_turn(self.poses)):.0f}°; "
                "expected readings from one place; `sonarhw compare` and `sonarhw track` use a pose for each reading"
            )

    def places(self, begin: Place) -> list[Place] | None:
        """Return the place of each reading if the first is at `begin`; None if the sensor stands still."""
        poses = poses_from((*begin.position, begin.heading), self.readings)
        return None if poses is None else places_at(begin, poses)

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
        """Return the given place, else the recorded one, else the first pose, else the only place.

        Raises InputError if there is none.
        """
        wanted = self.recorded_place(room) if given is None else given
        if wanted is None and self.poses is not None:
            return place_at("poses", self.poses[0])
        if wanted is None and len(room.places) != 1:
            places = ", ".join(room.places) or "none"
            raise InputError(
                f"{self.where}: contains no place in room {room.name!r}; give a place, or X,Y in metres; its places: "
                f"{places}; `sonarhw locate` finds an unknown place"
            )
        return room.place(wanted)

    def recorded_place(self, room: Room) -> Place | str | None:
        """Return the pose of a scan from arrays, else the place in the log, if the room has it or it is X,Y."""
        return self.pose if self.log is None else place_of_log(self.log.metadata, room)

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

    def doubts(self, board: Board) -> tuple[str, ...]:
        """Return what is probably wrong in the readings, a line each, if `board` made them."""
        readings = without_own_body(board.own_body, self.readings)
        doubts = check_scan(readings, reach_of(board))
        return tuple(f"{self.where}: {doubt}" for doubt in doubts if doubt.kind not in self.warned_of)

    def board(self, given: BoardInput | None = None) -> Board:
        """Return the given board, else that of the log, else the default board."""
        if isinstance(given, Board):
            return given
        if given is not None:
            return load_board(given)
        return load_board(DEFAULT_BOARD) if self.log is None else board_of_log(self.log.metadata)


def places_at(begin: Place, poses: FloatArray) -> list[Place]:
    """Return the places of poses (n, 3), with the name and the height of `begin`."""
    return [replace(begin, position=(x, y), heading=turn) for x, y, turn in poses.tolist()]


def reach_of(board: Board) -> Reach:
    """Return the ranges that a board can report."""
    return Reach(board.name, board.blanked_range(Air()), board.max_range)


ScanInput: TypeAlias = Path | str | Log | Sequence[Reading] | tuple[ArrayLike, ArrayLike] | GivenScan


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


def given_scan(scan: ScanInput, warn: Warn = emit) -> GivenScan:
    """Return a scan from a log, the file of a log, readings, or a pair of headings and ranges.

    Warns if the file is torn or damaged, or if its angles may be wrong. Raises InputError if it is nothing of this, or
    if there is no reading.
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
    if is_pair(scan):
        return scan_from_arrays(*scan)
    readings = [*scan] if isinstance(scan, Iterable) else [scan]
    for reading in readings:
        if not isinstance(reading, Reading):
            raise arguments.refusal("scan", _SCAN, scan)
    return GivenScan("the scan", tuple(readings))


def is_pair(scan: object) -> bool:
    """Return whether this is a pair of headings (n,) and ranges, and not two scans."""
    if not isinstance(scan, tuple | list) or len(scan) != 2:
        return False
    try:
        headings = np.asarray(scan[0])
    except ValueError:  # rows of several lengths
        return False
    return headings.ndim == 1 and headings.dtype.kind in "iuf"


_SCAN = "a log, its file, readings, (headings, ranges), or a scan of `scan_from_arrays`"
_RANGES = "metres, (n,), (n, pings) or (n, pings, echoes), with NaN for no echo"


@arguments.checked(degrees=arguments.flag, speed_of_sound=arguments.number(1, unit="m/s"))
def scan_from_arrays(
    headings: ArrayLike,
    ranges: ArrayLike,
    *,
    pose: PlaceInput | ArrayLike | None = None,
    times: ArrayLike | None = None,
    degrees: bool = False,
    speed_of_sound: float | None = None,
) -> GivenScan:
    """Return a scan from arrays, for `compare`, `fit`, `locate`, `map_room`, `write_report` and `compare_scans`.

    `headings` (n,) rad are counter-clockwise from the heading of the pose. `ranges` are m: (n,), or (n, p) for p pings
    at each heading, or (n, p, e) with the e echoes of each ping, earliest first. NaN, inf or None means no echo.
    `pose` is x and y in m and no heading or one in rad, counter-clockwise from x; of a sensor that moves, one for each
    heading, (n, 3). With `degrees`, `headings` and those of poses are degrees. `times` (n,) s are those of the pings,
    by default 0.1 s apart. `speed_of_sound` (m/s), by default that at 20 °C, only converts ranges to times of echoes.
    Raises InputError. Warns if angles are probably degrees, or ranges centimetres.
    """
    turned = arguments.in_radians("headings", arguments.angles("headings", headings), degrees)
    echoes = echoes_of(ranges, len(turned))
    warned_of: set[DoubtKind] = {"angles"}
    if arguments.warn_of_centimetres("ranges", echoes[..., 0]):
        warned_of.add("beyond reach")
    started = 0.1 * np.arange(len(turned)) if times is None else _times(times, len(turned))
    speed = Air().speed_of_sound if speed_of_sound is None else speed_of_sound
    poses = _poses(pose, len(turned), degrees)
    pings = echoes.shape[1]
    readings = [
        Reading(
            number=row * pings + ping,
            sweep=0,
            ping=ping,
            angle=angle,
            time=time,
            echo_times=tuple(2 * echo / speed for echo in of_ping if math.isfinite(echo)),
            speed_of_sound=speed,
            origin=Origin.IMPORTED,
            pose=None if poses is None else poses[row],
        )
        for row, (angle, time, of_heading) in enumerate(
            zip(turned.tolist(), started.tolist(), echoes.tolist(), strict=True)
        )
        for ping, of_ping in enumerate(of_heading)
    ]
    placed = None if pose is None or poses is not None else _pose(cast(PlaceInput, pose), degrees)
    return GivenScan("the scan", tuple(readings), pose=placed, warned_of=frozenset(warned_of))


def echoes_of(ranges: ArrayLike, headings: int) -> FloatArray:
    """Return the echoes of each ping, (n, pings, echoes) m, not finite without an echo. Raises InputError."""
    read = arguments.numbers_in("ranges", ranges, _RANGES)
    read = np.atleast_1d(read)
    if not 1 <= read.ndim <= 3 or 0 in read.shape[1:]:
        raise arguments.refusal("ranges", _RANGES, read)
    if len(read) != headings:
        expected = f"ranges: expected one row for each of {counted(headings, 'heading')}"
        raise InputError(f"{expected}, got {len(read)}{_rows_of_scans(read, headings)}")
    if (read <= 0).any():
        row = int(np.argwhere(read <= 0)[0, 0])
        raise InputError(f"ranges: expected metres above 0, got {read[read <= 0][0]:g} at index {row}; NaN is no echo")
    echoes = read.reshape(*read.shape, *(1,) * (3 - read.ndim))
    ordered = np.where(np.isfinite(echoes), echoes, np.inf)
    if (ordered[..., 1:] < ordered[..., :-1]).any():
        raise InputError("ranges: expected the echoes of each ping in order, the nearest first, and NaN after the last")
    return echoes


def _rows_of_scans(ranges: FloatArray, headings: int) -> str:
    """Return how ranges with a row for each scan are given; empty if they have none."""
    if ranges.ndim != 2 or headings not in (ranges.shape[1], ranges.size):
        return ""
    scans, of_each = ranges.shape
    return (
        f"; {scans} scans of {of_each} headings are `scan_from_arrays(np.tile(headings, {scans}), ranges.ravel(), "
        f"pose=np.repeat(poses, {of_each}, axis=0))`"
    )


def _times(times: ArrayLike, headings: int) -> FloatArray:
    read = arguments.numbers_in("times", times, "seconds, (n,)")
    if read.shape != (headings,) or not np.isfinite(read).all():
        raise arguments.refusal("times", f"finite seconds, ({headings},), one for each heading", read)
    return read


def _poses(pose: object, headings: int, degrees: bool) -> list[RobotPose] | None:
    """Return a pose for each heading; None if one place, or nothing, is given. Raises InputError."""
    if pose is None or isinstance(pose, Place | str) or np.ndim(np.asarray(pose, dtype=object)) < 2:
        return None
    read = arguments.rows("pose", pose, (3,), "x and y in metres and a heading in radians")
    if len(read) != headings:
        each, left = divmod(headings, len(read))
        way = "" if left or len(read) == 1 else f"; for {each} headings at each, `np.repeat(pose, {each}, axis=0)`"
        raise InputError(f"pose: expected one, or one for each of {counted(headings, 'heading')}, got {len(read)}{way}")
    turns = arguments.in_radians("pose", read[:, 2], degrees)
    return [(x, y, turn) for (x, y, _), turn in zip(read.tolist(), turns.tolist(), strict=True)]


def _turn(poses: FloatArray) -> float:
    """Return by how much the heading of poses (n, 3) differs from the first, at most, rad."""
    return float(np.abs(angle_difference(poses[:, 2], poses[0, 2])).max())


def _pose(pose: PlaceInput, degrees: bool) -> Place:
    """Return the place of x, y and heading. Raises InputError."""
    if isinstance(pose, Place):
        return pose
    place = place_at("pose", pose, degrees)
    arguments.warn_of_degrees("pose", np.array([place.heading]))
    return place


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
    rows_by_note = [(_note(row[1]), row) for row in rows[1:]]
    notes = tuple(note for note, _ in rows_by_note if note is not None)
    return NoteFile(notes, tuple(row for note, row in rows_by_note if note is None))


def save_notes(path: Path, changes: Sequence[ReadingNote]) -> None:
    """Write notes into their file; an empty text deletes the note of its reading. Everything else in it is kept.

    The file is read again, because another program may have changed it. Without notes it is removed. Raises InputError
    if it is not a notes file, OutputError if it cannot be written.
    """
    stored = read_notes(path)
    kept = [note for note in stored.notes if not any(note.is_on_reading_of(change) for change in changes)]
    notes = sorted([*kept, *(change for change in changes if change.text)], key=lambda note: (note.sweep, note.reading))
    if not notes and not stored.unread:
        _remove(path)
        return
    text = io.StringIO(newline="")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(HEADER)
    writer.writerows(map(_cells, notes))
    writer.writerows(cells for _, cells in stored.unread)
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
    is_finite = all(value is None or math.isfinite(value) for value in (degrees, metres))
    return ReadingNote(sweep, reading, degrees, metres, text) if sweep > 0 <= reading and is_finite and text else None


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
        noted = next((place for place in places if note.is_on_reading_of(note_on(readings[place], ""))), None)
        if noted is None:
            lost += 1
        else:
            texts[noted] = note_text(f"{texts[noted]}; {note.text}" if noted in texts else note.text)
    return PlacedNotes(texts, _doubts(lost, path, log))


def _doubts(lost: int, path: Path, log: Path) -> tuple[str, ...]:
    if not lost:
        return ()
    belong = "1 note belongs to a reading" if lost == 1 else f"{lost} notes belong to readings"
    return (f"{path}: {belong} that {log.name} does not contain; the log has changed. The file keeps them",)


def _known(value: float | None) -> float | None:
    return value if value is not None and math.isfinite(value) else None
