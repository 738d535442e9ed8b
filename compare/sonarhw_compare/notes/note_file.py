"""The notes file of a log, `LOG.notes.csv`: one line for each note. The log itself is never changed.

Lines that are not notes are kept when the file is written again.
"""

import csv
import io
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from sonarhw.errors import InputError, OutputError, counted_are, harmless
from sonarhw.export import number, text_cell
from sonarhw.files import atomic_file

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


@dataclass(frozen=True)
class UnreadLine:
    """A line that is not a note."""

    number: int  # from 1
    cells: tuple[str, ...]


@dataclass(frozen=True)
class NoteFile:
    """The content of a notes file."""

    notes: tuple[ReadingNote, ...] = ()
    unread: tuple[UnreadLine, ...] = ()

    def doubts(self, path: Path) -> Iterator[str]:
        """Yield a warning if there are lines that are not notes."""
        if self.unread:
            lines = counted_are(len(self.unread), "line")
            yield (
                f"{path}: {lines} not a note, the first is line {self.unread[0].number}; expected "
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
        rows = [UnreadLine(lines.line_num, tuple(cells)) for cells in lines if cells]
    except OSError as error:
        raise InputError(f"{path}: notes cannot be read: {error.strerror}") from error
    except csv.Error as error:
        raise InputError(f"{path}: notes cannot be read: {error}") from error
    if rows and tuple(cell.strip() for cell in rows[0].cells) != HEADER:
        raise InputError(f"{path}: line {rows[0].number}: expected {','.join(HEADER)}; this is no file of notes")
    found = [(_note(row.cells), row) for row in rows[1:]]
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
    writer.writerows(line.cells for line in known.unread)
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
