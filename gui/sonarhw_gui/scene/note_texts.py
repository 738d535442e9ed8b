"""The notes on the readings shown, as one frozen value."""

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True)
class NoteTexts:
    """The note of each reading that has one."""

    by_reading: Mapping[int, str] = field(default_factory=dict)  # by the place of the reading in the scan, from 0

    def __len__(self) -> int:
        return len(self.by_reading)

    def of(self, reading: int | None) -> str:
        """Return the note of a reading; empty without one."""
        return "" if reading is None else self.by_reading.get(reading, "")

    def with_note(self, reading: int, text: str) -> "NoteTexts":
        """Return the notes with another note on a reading; an empty text removes it."""
        others = {place: note for place, note in self.by_reading.items() if place != reading}
        return NoteTexts(dict(sorted({**others, reading: text}.items())) if text else others)

    def changed_since(self, before: "NoteTexts") -> tuple[int, ...]:
        """Return the readings whose notes differ."""
        either = {**before.by_reading, **self.by_reading}
        return tuple(place for place in either if before.of(place) != self.of(place))


NO_NOTES = NoteTexts()
