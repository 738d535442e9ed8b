"""Notes on the readings of a log: find the reading of each note."""

import math
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from sonarhw.errors import InputError
from sonarhw.readings import Reading
from sonarhw_compare.notes.note_file import ReadingNote, note_text, notes_path, read_notes


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
