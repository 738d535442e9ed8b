"""Keeps the notes on readings beside their log. If its folder cannot be written, in a folder of the window."""

import hashlib
from collections.abc import Sequence
from pathlib import Path

from sonarhw_compare.scans import ReadingNote, note_on, notes_of_log, notes_path, placed_notes, read_notes, save_notes

from sonarhw.errors import InputError, SonarError
from sonarhw.readings import Reading
from sonarhw_gui.scene.note_texts import NO_NOTES, NoteTexts


class NoteStore:
    """The notes of one log at a time. Notes are written at once; of a scan without a log they are kept in memory."""

    def __init__(self, folder: Path | None) -> None:
        """`folder`: for notes that cannot be written beside their log; None: they are kept in memory."""
        self.messages: list[str] = []
        self._folder = folder
        self._stored = NO_NOTES
        self._aside = False  # whether the user knows that notes are not beside the log

    def open(self, log: Path | None, readings: Sequence[Reading]) -> NoteTexts:
        """Return the notes on the readings of a log; None: it has no file yet."""
        self._stored, self._aside = NO_NOTES, False
        if log is None:
            return NO_NOTES
        beside = notes_of_log(log, readings)
        self.messages += beside.doubts
        aside = placed_notes(self._kept_aside(log), readings, notes_path(log), log)
        self._stored = NoteTexts(dict(sorted({**beside.texts, **aside.texts}.items())))
        return self._stored

    def save(self, notes: NoteTexts, readings: Sequence[Reading], log: Path | None) -> None:
        """Write the notes that have changed since the last call."""
        places = notes.changed_since(self._stored)
        if not places:
            return
        if log is None:
            self._warn_of_no_log()
            return
        changes = [note_on(readings[place], notes.of(place)) for place in places if place < len(readings)]
        others = [note for note in self._kept_aside(log) if not any(map(note.is_on_reading_of, changes))]
        try:
            save_notes(notes_path(log), [*others, *changes])
            aside = self._aside_path(log)
            if aside is not None:
                aside.unlink(missing_ok=True)
        except (SonarError, OSError) as error:
            if self._keep_aside(log, changes, str(error)):
                self._stored = notes
        else:
            self._stored, self._aside = notes, False

    def _warn_of_no_log(self) -> None:
        if not self._aside:
            self.messages.append(
                "this scan has no log, and its notes are lost when the window closes; Copy CSV above the table of "
                "readings includes them"
            )
        self._aside = True

    def _keep_aside(self, log: Path, changes: Sequence[ReadingNote], problem: str) -> bool:
        """Keep notes in the folder of the window; return whether they are on the disk. One message a log."""
        where = "the notes are lost when the window closes"
        path = self._aside_path(log)
        kept = False
        if path is not None:
            try:
                path.parent.mkdir(parents=True, exist_ok=True)
                save_notes(path, changes)
                where, kept = f"this window keeps the notes in {path.parent} meanwhile", True
            except (SonarError, OSError):
                kept = False
        if not (self._aside and kept):
            self.messages.append(f"{problem}; {where}")
        self._aside = kept
        return kept

    def _kept_aside(self, log: Path) -> tuple[ReadingNote, ...]:
        path = self._aside_path(log)
        try:
            return () if path is None else read_notes(path).notes
        except InputError as error:
            self.messages.append(str(error))
            return ()

    def _aside_path(self, log: Path) -> Path | None:
        if self._folder is None:
            return None
        name = str(log.absolute()).encode(errors="surrogateescape")
        return self._folder / f"{log.stem}-{hashlib.sha256(name).hexdigest()[:12]}.notes.csv"
