"""Other people's scans: a CSV file with a heading and a range a line, read as readings.

Takes a file, the columns that matter and what their numbers mean, or guesses both from the names of the columns; hands
on readings. Raises InputError, with the line, for what cannot be meant.
"""

import csv
import math
import re
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TextIO

from sonarhw_sim.air import speed_of_sound

from sonarhw.errors import InputError
from sonarhw.readings import Reading

SPACING = 0.1  # s between readings whose file tells no time
# what the frames of a log can carry
MOST_DEGREES = 2147.0
MOST_RANGE = 700.0  # m
LONGEST = 1e9  # s
_PINGS = 256
_OTHER_SEPARATORS = {";": "semicolons", "\t": "tabs", "|": "bars"}
_HEADING_NAMES = ("heading", "angle", "bearing", "azimuth", "theta", "turret", "deg", "degrees")
_RANGE_NAMES = ("range", "distance", "dist", "echo", "m", "cm", "mm", "metres", "meters")
_TIME_NAMES = ("time", "seconds", "s", "t")
_FEWEST_ALIKE, _SHARE_ALIKE = 3, 0.1  # readings of one range, of which a wall seldom gives that many
_UNITS = {"m": 1.0, "metres": 1.0, "meters": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254, "ft": 0.3048}


@dataclass(frozen=True)
class Columns:
    """The names of the columns that matter."""

    heading: str
    distance: str
    time: str | None = None


@dataclass(frozen=True)
class Meaning:
    """What the numbers of a file mean."""

    scale: float = 1.0  # m in one unit of the range
    sign: float = 1.0  # 1: headings count counter-clockwise, -1: clockwise
    zero: float = 0.0  # degrees: turntable angle where the heading says 0
    no_echo: float | None = None  # the range that stands for none


@dataclass(frozen=True)
class _Row:
    """The numbers of one line, in the file's own units."""

    line: int
    heading: float
    distance: float | None  # None: no echo
    time: float | None


def read_foreign_scan(file: Path, columns: Columns, meaning: Meaning) -> list[Reading]:
    """The readings in a CSV file, at least one. Raises InputError."""
    return _readings(file, _rows(file, columns, meaning.no_echo), meaning)


def guess_columns(file: Path) -> tuple[Columns, Meaning]:
    """The columns of a file by their names, and the unit that the name of the range ends in; metres where in none.

    Raises InputError where there is no one column that is called like a heading, or like a range.
    """
    with _opened(file) as text:
        header = _header(file, next(csv.reader(text), []))
    heading, distance = _called(header, _HEADING_NAMES), _called(header, _RANGE_NAMES)
    if heading is None or distance is None:
        wanted = "a heading" if heading is None else "a range"
        raise InputError(
            f"{file}, line 1: no one column is called like {wanted}; there are: {', '.join(header)}; "
            "`sonarhw import` takes --heading COL --range COL"
        )
    unit = _UNITS.get(_words(distance)[-1], 1.0)
    return Columns(heading, distance, _called(header, _TIME_NAMES)), Meaning(unit)


def likely_silence(file: Path, columns: Columns) -> tuple[float, int] | None:
    """The range, in the file's own unit, that seems to stand for no echo, and how many readings have it, or None.

    It is one that at least a tenth of the readings, and three, have to the last digit: 0, or else the longest. Raises
    InputError.
    """
    ranges = [row.distance for row in _rows(file, columns, None) if row.distance is not None]
    counts = Counter(ranges)
    for value in (0.0, max(ranges, default=0.0)):
        if len(counts) > 1 and counts[value] >= max(_FEWEST_ALIKE, _SHARE_ALIKE * len(ranges)):
            return value, counts[value]
    return None


def _called(header: list[str], names: tuple[str, ...]) -> str | None:
    """The one column whose name begins with the first of the words that any column begins with."""
    for name in names:
        matching = [column for column in header if name in _words(column)[:1]]
        if matching:
            return matching[0] if len(matching) == 1 else None
    return None


def _words(column: str) -> list[str]:
    return re.findall(r"[a-z]+", column.lower()) or [""]


@contextmanager
def _opened(file: Path) -> Iterator[TextIO]:
    try:
        with file.open(encoding="utf-8-sig", newline="") as text:
            yield text
    except OSError as error:
        raise InputError(f"{file}: cannot be read: {error.strerror}; a CSV file was expected") from error
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{file}: is no CSV text: {error}") from error


def _rows(file: Path, columns: Columns, no_echo: float | None) -> Iterator[_Row]:
    with _opened(file) as text:
        lines = csv.reader(text)
        places = _places(file, _header(file, next(lines, [])), columns)
        for fields in lines:
            if any(field.strip() for field in fields):
                yield _row(_Line(file, lines.line_num, fields), columns, places, no_echo)


def _header(file: Path, fields: list[str]) -> list[str]:
    """The names of the columns. Raises InputError where there are none."""
    header = [name.strip() for name in fields]
    if not any(header):
        raise InputError(f"{file}: is empty; expected a header line and a reading a line")
    separator = next((mark for mark in _OTHER_SEPARATORS if len(header) == 1 and mark in header[0]), None)
    if separator is not None:
        raise InputError(
            f"{file}, line 1: has one column, with {_OTHER_SEPARATORS[separator]} in it; "
            "expected commas between columns, and points in numbers"
        )
    return header


def _places(file: Path, header: list[str], columns: Columns) -> dict[str, int]:
    wanted = [columns.heading, columns.distance, *([] if columns.time is None else [columns.time])]
    for name in wanted:
        if header.count(name) != 1:
            count = "no column" if name not in header else "more than one column"
            raise InputError(f"{file}, line 1: {count} {name!r}; there are: {', '.join(header)}")
    return {name: header.index(name) for name in wanted}


@dataclass(frozen=True)
class _Line:
    file: Path
    number: int
    fields: list[str]

    def refuse(self, what: str) -> InputError:
        """The error that this line is to be refused with."""
        return InputError(f"{self.file}, line {self.number}: {what}")

    def text(self, name: str, place: int) -> str:
        """The field of a column."""
        if place >= len(self.fields):
            raise self.refuse(
                f"has {len(self.fields)} field{'' if len(self.fields) == 1 else 's'} and none for column {name!r}"
            )
        return self.fields[place].strip()

    def number_in(self, name: str, place: int) -> float:
        """The number in a column, which may be infinite or NaN."""
        text = self.text(name, place)
        try:
            return float(text)
        except ValueError:
            raise self.refuse(f"{name} is {text!r}; expected a number") from None


def _row(line: _Line, columns: Columns, places: dict[str, int], no_echo: float | None) -> _Row:
    heading = line.number_in(columns.heading, places[columns.heading])
    if not math.isfinite(heading):
        raise line.refuse(f"{columns.heading} is {heading:g}; expected degrees")
    seconds = None
    if columns.time is not None:
        seconds = line.number_in(columns.time, places[columns.time])
        if not math.isfinite(seconds):
            raise line.refuse(f"{columns.time} is {seconds:g}; expected seconds")
    name = columns.distance
    if not line.text(name, places[name]):
        return _Row(line.number, heading, None, seconds)
    distance = line.number_in(name, places[name])
    if no_echo is not None and (distance == no_echo or (math.isnan(distance) and math.isnan(no_echo))):
        return _Row(line.number, heading, None, seconds)
    if not 0 <= distance < math.inf:
        raise line.refuse(f"{name} is {distance:g}; expected a range of 0 or more, or --no-echo {distance:g}")
    return _Row(line.number, heading, distance, seconds)


def _readings(file: Path, rows: Iterator[_Row], meaning: Meaning) -> list[Reading]:
    speed = speed_of_sound()
    readings: list[Reading] = []
    for number, row in enumerate(rows):
        angle = math.radians(meaning.zero + meaning.sign * row.heading)
        before = readings[-1] if readings else None
        reading = Reading(
            number=number,
            sweep=0,
            ping=(before.ping + 1) % _PINGS if before and before.angle == angle else 0,
            angle=angle,
            time=number * SPACING if row.time is None else row.time,
            echo_times=() if row.distance is None else (2 * row.distance * meaning.scale / speed,),
            speed_of_sound=speed,
        )
        _check(reading, before, f"{file}, line {row.line}")
        readings.append(reading)
    if not readings:
        raise InputError(f"{file}: has no readings; expected a header line and a reading a line")
    return readings


def _check(reading: Reading, before: Reading | None, where: str) -> None:
    degrees = math.degrees(reading.angle)
    if abs(degrees) > MOST_DEGREES:
        raise InputError(f"{where}: a turntable angle of {degrees:g} degrees; expected at most {MOST_DEGREES:g}")
    if reading.range is not None and reading.range > MOST_RANGE:
        raise InputError(f"{where}: a range of {reading.range:g} m; expected at most {MOST_RANGE:g}: is --scale right?")
    if before and reading.time < before.time:
        raise InputError(
            f"{where}: time {reading.time:g} s is before the reading above it at {before.time:g} s; "
            "sort the lines by time"
        )
    if before and reading.time - before.time > LONGEST:
        raise InputError(f"{where}: time {reading.time:g} s; expected seconds, at most {LONGEST:g} after the one above")
