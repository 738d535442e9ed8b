"""Tables of other programs as text that has one reading a line: a ring a line, and messages of `rostopic echo -p`.

The text is then read as any other text, so units and doubts are the same.
"""

import csv
import math
import re
from collections.abc import Iterator, Sequence
from io import StringIO
from itertools import islice

import numpy as np

from sonarhw.errors import InputError
from sonarhw.text.decoder import encoding_of

_ROS = "%time,"
_ANGLE = re.compile(r"\s*([+-]?\d+(?:[.,]\d+)?)\s*(?:°|deg|degrees|grad)?\s*", re.IGNORECASE)
_SILENT = "none"  # a range without an echo, as the reader of text knows it
_FEWEST = 4  # angles in a line
_LINES = 3  # of ranges, at least one must follow
_MOST_TURN = 720.0  # degrees
_RANGES = re.compile(r"field\.ranges(\d+)")


def as_long_text(where: str, data: bytes, step: float) -> bytes:
    """Return the text with one reading a line if it is one of these tables, else as it is.

    `step`: degrees from one sensor of a ROS topic to the next. Raises InputError for a table that lacks columns.
    """
    head = data[:4096].decode(encoding_of(data[:4096]), "replace").lstrip("\ufeff")
    if head.startswith(_ROS):
        return "".join(_of_ros(where, _text(data), step)).encode()
    separator = next((mark for mark in ("\t", ";", ",") if mark in head.partition("\n")[0]), None)
    if separator is None or not _is_wide(head, separator):
        return data
    return "".join(_of_wide(where, _text(data), separator)).encode()


def _text(data: bytes) -> str:
    return data.decode(encoding_of(data), "replace").lstrip("\ufeff")


def _is_wide(head: str, separator: str) -> bool:
    """Return whether the first line has angles of even spacing, and the lines below as many other numbers."""
    lines = [line.split(separator) for line in head.splitlines()[: _LINES + 1] if line.strip()]
    if len(lines) < 2:
        return False
    first = _angles(lines[0])
    if first is None:
        return False
    below = lines[1 : 1 + _LINES]
    if head.count("\n") < len(lines) and len(below) > 1:
        below = below[:-1]  # the last line may be cut
    return all(len(cells) == len(lines[0]) for cells in below) and any(_angles(cells) != first for cells in below)


def _angles(cells: Sequence[str]) -> tuple[int, list[float]] | None:
    """Return the number of cells before the angles, and the angles; None if the cells are no angles."""
    for before in (0, 1, 2):
        matches = [_ANGLE.fullmatch(cell) for cell in cells[before:]]
        if len(matches) < _FEWEST or any(match is None for match in matches):
            continue
        if before == 0 and not cells[0].strip():
            continue
        numbers = [float(match[1].replace(",", ".")) for match in matches if match]
        spacing = np.diff(numbers)
        if (
            spacing.all()
            and np.allclose(spacing, spacing[0], rtol=0.01)
            and abs(numbers[-1] - numbers[0]) <= _MOST_TURN
        ):
            return before, numbers
    return None


def _of_wide(where: str, text: str, separator: str) -> Iterator[str]:
    rows = csv.reader(StringIO(text), delimiter=separator)
    header = next(rows)
    read = _angles(header)
    assert read is not None, "checked by _is_wide"
    before, angles = read
    unit = re.search(r"\b(mm|cm|m|in|inch|ft)\b", " ".join(header[:before]), re.IGNORECASE)
    yield f"angle_deg;range{f'_{unit[1].lower()}' if unit else ''}\n"
    for number, cells in enumerate(rows, 2):
        if not any(cell.strip() for cell in cells):
            continue
        if len(cells) != len(header):
            raise InputError(
                f"{where}, line {number}: has {len(cells)} fields; expected {len(header)}, as in the header"
            )
        for angle, cell in zip(angles, cells[before:], strict=True):
            yield f"{angle:g};{cell.strip().replace(',', '.') or _SILENT}\n"


def _of_ros(where: str, text: str, step: float) -> Iterator[str]:
    """Yield LaserScan as its sweeps, Range as readings of sensors that are `step` degrees apart."""
    rows = csv.reader(StringIO(text))
    header = next(rows)
    at = {name: k for k, name in enumerate(header)}
    ranges = sorted((int(match[1]), k) for name, k in at.items() if (match := _RANGES.fullmatch(name)))
    yield "angle_deg,range_m\n"
    if ranges and {"field.angle_min", "field.angle_increment"} <= at.keys():
        for number, cells in enumerate(rows, 2):
            values = _numbers(where, number, cells, header)
            begin, turn = values[at["field.angle_min"]], values[at["field.angle_increment"]]
            least, most = _limits(at, values)
            for place, k in ranges:
                angle = math.degrees(begin + place * turn)
                yield f"{angle:.6g},{values[k] if least <= values[k] <= most else _SILENT}\n"
        return
    if "field.range" not in at:
        raise InputError(f"{where}: rostopic CSV without ranges; expected messages Range or LaserScan")
    frames: dict[str, int] = {}
    for number, cells in enumerate(rows, 2):
        values = _numbers(where, number, cells, header)
        frame = cells[at["field.header.frame_id"]] if "field.header.frame_id" in at else ""
        sensor = frames.setdefault(frame, len(frames))
        if sensor and not step:
            listed = ", ".join(islice(frames, 5))
            raise InputError(f"{where}: sensors {listed} without directions; add step=DEGREES, from one to the next")
        least, most = _limits(at, values)
        distance = values[at["field.range"]]
        yield f"{sensor * step:g},{distance if least <= distance <= most else _SILENT}\n"


def _limits(at: dict[str, int], values: Sequence[float]) -> tuple[float, float]:
    least = values[at["field.range_min"]] if "field.range_min" in at else None
    most = values[at["field.range_max"]] if "field.range_max" in at else None
    if least is None:
        least = values[at["field.min_range"]] if "field.min_range" in at else 0.0
    if most is None:
        most = values[at["field.max_range"]] if "field.max_range" in at else math.inf
    return least, most


def _numbers(where: str, number: int, cells: Sequence[str], header: Sequence[str]) -> list[float]:
    """Return the numbers in a line; NaN for text."""
    if len(cells) != len(header):
        raise InputError(f"{where}, line {number}: has {len(cells)} fields; expected {len(header)}, as in the header")
    return [_number(cell) for cell in cells]


def _number(cell: str) -> float:
    try:
        return float(cell)
    except ValueError:
        return math.nan
