"""The file formats in which readings are exported, by `sonarhw log export` and by Export data in the window.

To add a format, write a function `write_x(log, file, notes)` in a new module and add an entry to FORMATS. The command,
its help, the window's file dialog and its tooltip follow.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, BinaryIO

from sonarhw.export.csv_rows import write_csv

if TYPE_CHECKING:
    from sonarhw.log import Log


@dataclass(frozen=True)
class ExportFormat:
    """One file format."""

    suffix: str  # of the file name, in lower case
    title: str  # in a file dialog
    write: "Callable[[Log, BinaryIO, Mapping[int, str]], None]"  # notes by the place of their reading in the log


def _write_npz(log: "Log", file: BinaryIO, notes: Mapping[int, str]) -> None:
    from sonarhw.export.npz import write_npz  # loads NumPy, which the help of the command line does not need

    write_npz(log, file, notes)


# `--out -` writes the first format
FORMATS = (
    ExportFormat(".csv", "Readings", write_csv),
    ExportFormat(".npz", "Readings with traces, for NumPy", _write_npz),
)


def export_suffixes() -> tuple[str, ...]:
    """Return the suffix of every format, in order."""
    return tuple(known.suffix for known in FORMATS)


def export_format(suffix: str) -> ExportFormat:
    """Return the format with this suffix. Raises KeyError for any other."""
    return {known.suffix: known for known in FORMATS}[suffix]
