"""Format of numbers on the command line: 9 significant digits, and nothing for a missing value.

An estimate has the decimals of two significant digits of its standard deviation.
"""

import csv
import math
from collections.abc import Iterable
from typing import TextIO

from sonarhw.export import number, text_cell

_MOST_DECIMALS = 6


def written(value: float | int | str | None) -> str:
    """Return one CSV field; None and NaN are empty."""
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return ""
    return number(value) if isinstance(value, float) else text_cell(str(value))


def estimate_text(value: float, deviation: float) -> str:
    """Return a value with the decimals of two significant digits of its standard deviation, never -0."""
    return f"{value:z.{_decimals(deviation)}f}"


def deviation_text(deviation: float, unit: str) -> str:
    """Return a standard deviation with two significant digits and its unit; metres as millimetres."""
    if unit == "m":
        return deviation_text(deviation * 1000, "mm")
    return with_unit(f"{deviation:.{_decimals(deviation)}f}", unit)


def with_unit(text: str, unit: str) -> str:
    """Return a number with its unit: `1.5 mm`, `90°`, `0.9`."""
    return text + unit if unit in ("", "°") else f"{text} {unit}"


def _decimals(deviation: float) -> int:
    # rounding may need one decimal less: 0.0996 is 0.10
    rounded = float(f"{deviation:.1e}")
    return min(_MOST_DECIMALS, max(0, 1 - math.floor(math.log10(rounded)))) if rounded > 0 else _MOST_DECIMALS


def write_rows(out: TextIO, header: str, rows: Iterable[Iterable[float | int | str | None]]) -> None:
    """Write a header and rows as CSV; each line ends with a line feed."""
    out.write(header + "\n")
    csv.writer(out, lineterminator="\n").writerows(map(written, row) for row in rows)
