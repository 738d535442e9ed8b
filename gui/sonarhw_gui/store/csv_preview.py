"""The readings of a CSV scan as they would be imported, for the preview of the import dialog."""

from dataclasses import dataclass
from pathlib import Path

from sonarhw_compare.foreign_csv import CsvColumns, Meaning, likely_no_echo, read_foreign_scan

from sonarhw.readings import Reading


@dataclass(frozen=True)
class CsvRead:
    """The readings of a CSV file."""

    request: "ReadCsvRequest"
    readings: tuple[Reading, ...]
    likely_no_echo: tuple[float, int] | None  # a range that likely means no echo, and its number of readings


@dataclass(frozen=True)
class ReadCsvRequest:
    """Read a whole CSV file with these columns, units and conventions."""

    path: Path
    columns: CsvColumns
    meaning: Meaning

    def answer(self) -> CsvRead:
        """Read the file. Raises InputError."""
        readings = tuple(read_foreign_scan(self.path, self.columns, self.meaning))
        known = self.meaning.no_echo is not None
        return CsvRead(self, readings, None if known else likely_no_echo(self.path, self.columns))
