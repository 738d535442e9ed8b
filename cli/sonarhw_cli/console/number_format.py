"""Numbers as the command line writes them: 9 significant digits, nothing for what is not there."""

import csv
import math
from collections.abc import Iterable
from typing import TextIO

from sonarhw.export.csv_rows import number


def written(value: float | int | str | None) -> str:
    """One CSV field; None and NaN are empty."""
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return ""
    return number(value) if isinstance(value, float) else str(value)


def counted(count: int, noun: str) -> str:
    """So many of something: `1 reading`, `2 readings`."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def write_rows(out: TextIO, header: str, rows: Iterable[Iterable[float | int | str | None]]) -> None:
    """Write a header and rows as CSV with plain line ends."""
    out.write(header + "\n")
    csv.writer(out, lineterminator="\n").writerows(map(written, row) for row in rows)
