"""Format of numbers on the command line: 9 significant digits, and nothing for a missing value."""

import csv
import math
from collections.abc import Iterable
from typing import TextIO

from sonarhw.export.csv_rows import number, text_cell


def written(value: float | int | str | None) -> str:
    """Return one CSV field; None and NaN are empty."""
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return ""
    return number(value) if isinstance(value, float) else text_cell(str(value))


def counted(count: int, noun: str) -> str:
    """Return a count with its noun: `1 reading`, `2 readings`."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def write_rows(out: TextIO, header: str, rows: Iterable[Iterable[float | int | str | None]]) -> None:
    """Write a header and rows as CSV; each line ends with a line feed."""
    out.write(header + "\n")
    csv.writer(out, lineterminator="\n").writerows(map(written, row) for row in rows)
