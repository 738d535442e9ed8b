"""Import of scans from CSV files of other programs, with a heading and a range on each line.

Columns and units are given, or guessed from the header. Errors name the file and the line.
"""

import csv
import math
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from io import TextIOWrapper
from itertools import count, islice
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from sonarhw.errors import InputError, counted
from sonarhw.files import open_input
from sonarhw.readings import Reading, RobotPose, Trace, speed_of_sound
from sonarhw.text.decoder import encoding_of
from sonarhw.wire.messages import MOST_DEGREES

# Readings from the rows of any file of another program: units, conventions, limits.


SPACING = 0.1  # s between readings of a file without times
# limits of the frames of a log
MOST_RANGE = 700.0  # m
MOST_COORDINATE = 1e6  # m, as in room files
LONGEST = 86_400.0  # s, between readings
LONGEST_SCAN = 1e8  # s
# limits of a file, so that nothing needs more than 1 GB
MOST_READINGS = 200_000
MOST_SAMPLES = 50_000_000  # of all traces
_MOST_BYTES = 2_000_000_000  # of a text file
_START = 65_536  # bytes of a text that show its encoding
_PINGS = 256
_POSE_WITHIN = 1.0  # s; poses are published several times a second


@dataclass(frozen=True)
class Meaning:
    """Units and conventions of the numbers in a file."""

    scale: float = 1.0  # m per unit of range
    sign: float = 1.0  # 1: headings grow counter-clockwise, -1: clockwise
    zero: float = 0.0  # degrees, turntable angle at heading 0
    no_echo: float | None = None  # the range that stands for no echo
    speed_of_sound: float | None = None  # m/s; None: that of air at 20 °C
    threshold: float | None = None  # share of full scale at which a trace has its echo; None: traces have no echo
    blanking: float = 0.0  # s; earlier samples of a trace are no echo
    rate: float | None = None  # Hz, sampling rate of arrays of samples
    step: float = 0.0  # degrees, from one of their traces to the next, or from one sensor to the next
    topic: str | None = None  # of a ROS bag; None: all
    variable: str | None = None  # of a MAT or NPZ file; None: the only array
    axis: str | None = None  # "rows" or "columns": what a ping is in a table of samples; None: rows, unless doubtful
    full_scale: float | None = None  # of samples, such as volts; None: that of their type
    unit_deg: float = 1.0  # degrees per unit of heading


@dataclass(frozen=True)
class ForeignRow:
    """One reading of a file, in the units of the file."""

    where: str  # in the file, for error messages
    heading: float  # degrees
    distance: float | None  # None: no echo
    time: float | None  # s
    sweep: int = 0
    trace: Trace | None = None
    more: tuple[float, ...] = ()  # ranges of later echoes
    pose: RobotPose | None = None  # m and rad


def readings_of(where: str, rows: Iterable[ForeignRow], meaning: Meaning) -> list[Reading]:
    """Return the readings of rows, numbered in their order. Raises InputError with the file `where` and the row."""
    speed = meaning.speed_of_sound or speed_of_sound()
    readings: list[Reading] = []
    samples = 0
    for number, row in enumerate(rows):
        angle = math.radians(meaning.zero + meaning.sign * meaning.unit_deg * row.heading)
        before = readings[-1] if readings else None
        if number >= MOST_READINGS:
            raise InputError(f"{where}: has more than {MOST_READINGS} readings; split it into several files")
        samples += 0 if row.trace is None else len(row.trace.samples)
        if samples > MOST_SAMPLES:
            raise InputError(f"{where}: traces of more than {MOST_SAMPLES} samples; split it into several files")
        reading = Reading(
            number=number,
            sweep=row.sweep,
            ping=(before.ping + 1) % _PINGS if before and (before.angle, before.sweep) == (angle, row.sweep) else 0,
            angle=angle,
            time=number * SPACING if row.time is None else row.time,
            echo_times=_echo_times(row, meaning, speed),
            speed_of_sound=speed,
            trace=row.trace,
            pose=row.pose,
        )
        _check(reading, before, readings[0].time if readings else reading.time, f"{where}, {row.where}")
        readings.append(reading)
    return readings


def at_poses(rows: Iterable[ForeignRow], times: Sequence[float], poses: Sequence[RobotPose]) -> Iterator[ForeignRow]:
    """Yield rows with the pose at their time: between two poses on the straight line, none 1 s before or after all.

    `times` (s) are those of the poses; both are in any order.
    """
    stamps, known = np.array(times, np.float64), np.array(poses, np.float64).reshape(-1, 3)
    order = [row for row in np.argsort(stamps, kind="stable").tolist() if np.isfinite(known[row]).all()]
    stamps, known = stamps[order], known[order]
    turned = np.unwrap(known[:, 2])
    for row in rows:
        if not len(stamps) or row.time is None or not stamps[0] - _POSE_WITHIN <= row.time <= stamps[-1] + _POSE_WITHIN:
            yield row
            continue
        x, y, heading = (float(np.interp(row.time, stamps, part)) for part in (known[:, 0], known[:, 1], turned))
        yield replace(row, pose=(x, y, math.remainder(heading, math.tau)))


def _echo_times(row: ForeignRow, meaning: Meaning, speed: float) -> tuple[float, ...]:
    """Return the time of the echo, s: that of the range, or of the first sample of the trace over the threshold."""
    if row.distance is not None:
        return tuple(2 * distance * meaning.scale / speed for distance in (row.distance, *row.more))
    if row.trace is None or meaning.threshold is None:
        return ()
    loud = np.flatnonzero((np.abs(row.trace.samples) >= meaning.threshold) & (row.trace.times >= meaning.blanking))
    return (float(row.trace.times[loud[0]]),) if len(loud) else ()


def _check(reading: Reading, before: Reading | None, began: float, where: str) -> None:
    degrees = math.degrees(reading.angle)
    if reading.pose is not None and not max(map(abs, reading.pose)) <= MOST_COORDINATE:
        raise InputError(
            f"{where}: pose {', '.join(f'{part:g}' for part in reading.pose)}; expected metres and a heading in "
            f"radians, none over {MOST_COORDINATE:g}"
        )
    if abs(degrees) > MOST_DEGREES:
        raise InputError(f"{where}: turntable angle {degrees:g} degrees; expected at most {MOST_DEGREES:g}")
    if (farthest := max(reading.echo_ranges, default=0.0)) > MOST_RANGE:
        raise InputError(f"{where}: range {farthest:g} m; expected at most {MOST_RANGE:g} m; check the scale")
    if before and reading.time < before.time:
        raise InputError(
            f"{where}: time {reading.time:g} s is before the reading above it at {before.time:g} s; "
            "sort the lines by time"
        )
    if before and reading.time - before.time > LONGEST:
        raise InputError(
            f"{where}: time {reading.time:g} s; expected seconds, at most {LONGEST:g} s after the reading above; "
            "convert other units to seconds"
        )
    if reading.time - began > LONGEST_SCAN:
        raise InputError(
            f"{where}: time {reading.time:g} s; expected at most {LONGEST_SCAN:g} s after the first reading"
        )


MOST_CHARACTERS = 65_536  # of a line
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?|[+-]?(nan|inf|infinity)", re.ASCII | re.IGNORECASE)
_DECIMAL_COMMA = re.compile(r"[+-]?\d+,\d+(e[+-]?\d+)?", re.ASCII | re.IGNORECASE)
_AT_DECIMAL_COMMAS = (
    "if its numbers have decimal commas, write points, or separate the columns by semicolons and choose decimal commas"
)
_OTHER_SEPARATORS = {";": "semicolons", "\t": "tabs", "|": "bars"}
_HEADING_NAMES = ("heading", "angle", "bearing", "azimuth", "theta", "turret", "deg", "degrees")
_RANGE_NAMES = ("range", "distance", "dist", "echo", "m", "cm", "mm", "metres", "meters")
_TIME_NAMES = ("time", "seconds", "s", "t")
_FEWEST_ALIKE, _SHARE_ALIKE = 3, 0.1  # least number and share of readings with one range that likely stands for no echo
_UNITS = {"m": 1.0, "metres": 1.0, "meters": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254, "ft": 0.3048}


@dataclass(frozen=True)
class CsvColumns:
    """The names of the columns to import, and how the file is written."""

    heading: str
    distance: str
    time: str | None = None
    decimal_comma: bool = False  # numbers such as 1,5 between semicolons or tabs


def read_foreign_scan(file: Path, columns: CsvColumns, meaning: Meaning) -> list[Reading]:
    """Return the readings of a CSV file, at least one. Raises InputError."""
    readings = readings_of(str(file), _rows(file, columns, meaning.no_echo), meaning)
    if not readings:
        raise InputError(f"{file}: no readings; expected a header line and one reading per line")
    return readings


@dataclass(frozen=True)
class CsvHead:
    """The first lines of a CSV file, as they are written."""

    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    decimal_comma: bool


def read_head(file: Path, most_rows: int, decimal_comma: bool = False) -> CsvHead:
    """Return the names of the columns and the first lines below them. Raises InputError."""
    with opened(file) as text:
        header, reader = _header_and_reader(file, text, decimal_comma)
        filled = (row for row in reader if any(field.strip() for field in row))
        return CsvHead(tuple(header), tuple(map(tuple, islice(filled, most_rows))), decimal_comma)


def likely_columns(header: Sequence[str]) -> tuple[str | None, str | None, str | None]:
    """Return the columns of heading, range and time, guessed by their names; None if none or several have such one."""
    heading, distance, time = (_column_named(header, names) for names in (_HEADING_NAMES, _RANGE_NAMES, _TIME_NAMES))
    return heading, distance, time


def likely_unit(column: str) -> float | None:
    """Return the unit at the end of the name of a column, m; None without one."""
    return _UNITS.get(_words(column)[-1])


def guess_columns(file: Path) -> tuple[CsvColumns, Meaning]:
    """Return the columns, guessed by their names, and the unit at the end of the name of the range, by default metres.

    Raises InputError if no column, or more than one, has a name for a heading or for a range.
    """
    header = read_head(file, 0).header
    heading, distance, time = likely_columns(header)
    if heading is None or distance is None:
        wanted = "a heading" if heading is None else "a range"
        raise InputError(
            f"{file}, line 1: expected exactly one column with a name for {wanted}, got: {', '.join(header)}"
            f"{_hint(header)}; use `sonarhw import --heading COL --range COL`"
        )
    return CsvColumns(heading, distance, time), Meaning(likely_unit(distance) or 1.0)


def likely_no_echo(file: Path, columns: CsvColumns) -> tuple[float, int] | None:
    """Return the range, in the unit of the file, that likely stands for no echo, and its number of readings, or None.

    It is 0 or else the longest range, if at least three readings and a tenth of them have exactly this range. Raises
    InputError.
    """
    ranges = [row.distance for row in _rows(file, columns, None) if row.distance is not None]
    counts = Counter(ranges)
    for value in (0.0, max(ranges, default=0.0)):
        if len(counts) > 1 and counts[value] >= max(_FEWEST_ALIKE, _SHARE_ALIKE * len(ranges)):
            return value, counts[value]
    return None


def _column_named(header: Sequence[str], names: tuple[str, ...]) -> str | None:
    """Return the column whose name starts with the first matching word of `names`; None unless there is exactly one."""
    for name in names:
        matching = [column for column in header if name in _words(column)[:1]]
        if matching:
            return matching[0] if len(matching) == 1 else None
    return None


def _words(column: str) -> list[str]:
    return re.findall(r"[a-z]+", column.lower()) or [""]


@contextmanager
def opened(file: Path, expected: str = "a CSV file") -> Iterator[TextIO]:
    """Open a text file in UTF-8, UTF-16 or cp1252. Raises InputError for what is not text, or not `expected`."""
    try:
        with open_input(file, _MOST_BYTES) as data:
            encoding = encoding_of(data.read(_START))
            data.seek(0)
            with TextIOWrapper(data, encoding=encoding, newline="") as text:
                yield text
    except InputError:  # of the reader of the text
        raise
    except FileNotFoundError as error:
        raise InputError(f"{file}: no such file; give the name of {expected}") from error
    except OSError as error:
        raise InputError(f"{file}: cannot be read: {error.strerror}; expected {expected}") from error
    except UnicodeDecodeError as error:
        raise InputError(
            f"{file}: is not UTF-8 text: byte {error.object[error.start]:#04x}; expected {expected} in UTF-8"
        ) from error
    except (ValueError, csv.Error) as error:  # ValueError: a NUL in the name
        raise InputError(f"{file}: is not {expected}: {error}") from error


def short_lines(file: Path, text: TextIO, expected: str = "a CSV file", most: int = MOST_CHARACTERS) -> Iterator[str]:
    """Yield the lines of at most `most` characters. Raises InputError before a line needs much memory."""
    for number in count(1):
        line = text.readline(most + 1)
        if not line:
            return
        if len(line) > most:
            raise InputError(f"{file}, line {number}: has more than {most} characters; expected {expected}")
        yield line


def _rows(file: Path, columns: CsvColumns, no_echo: float | None) -> Iterator[ForeignRow]:
    with opened(file) as text:
        header, reader = _header_and_reader(file, text, columns.decimal_comma)
        indices, read = _column_indices(file, header, columns), 0
        for fields in reader:
            if any(field.strip() for field in fields):
                read += 1
                if read > MOST_READINGS:
                    raise InputError(f"{file}: has more than {MOST_READINGS} readings; split it into several files")
                line = _Line(file, reader.line_num + 1, fields, columns.decimal_comma)
                line.check_length(len(header))
                yield _row(line, columns, indices, no_echo)


def _header_and_reader(file: Path, text: TextIO, decimal_comma: bool) -> tuple[list[str], Any]:
    """Return the names of the columns, and the reader of the lines below.

    With decimal commas, columns are separated by tabs if the header has one, or else by semicolons.
    """
    lines = short_lines(file, text)
    first, separator = next(lines, ""), ","
    if decimal_comma:
        separator = "\t" if "\t" in first else ";"
    header = _header(file, next(csv.reader([first], delimiter=separator), []), separator)
    return header, csv.reader(lines, delimiter=separator)


def _header(file: Path, fields: list[str], separator: str = ",") -> list[str]:
    """Return the names of the columns. Raises InputError if there are none."""
    header = [name.strip() for name in fields]
    if not any(header):
        raise InputError(f"{file}: the file is empty; expected a header line and one reading per line")
    other = other_separator(header)
    if other is not None and separator == ",":
        raise InputError(
            f"{file}, line 1: only one column, with {other} in it; expected commas between columns, "
            "and points in numbers; for semicolons or tabs, and decimal commas, use "
            "`sonarhw import --decimal-comma`"
        )
    if len(header) == 1 and separator != ",":
        raise InputError(
            f"{file}, line 1: only one column; with decimal commas, expected semicolons or tabs between columns"
        )
    return header


def _hint(header: Sequence[str]) -> str:
    """Return what to do if the first line has numbers where names are expected, else an empty text."""
    try:
        [float(name) for name in header]
    except ValueError:
        return ""
    return "; if the first line is a reading, add a line with names above it, such as heading,range"


def other_separator(header: Sequence[str]) -> str | None:
    """Return what separates columns instead of commas, such as "semicolons"; None if commas or nothing does."""
    return next((words for mark, words in _OTHER_SEPARATORS.items() if len(header) == 1 and mark in header[0]), None)


def _column_indices(file: Path, header: list[str], columns: CsvColumns) -> dict[str, int]:
    wanted = [columns.heading, columns.distance, *([] if columns.time is None else [columns.time])]
    if repeated := next((name for name in wanted if wanted.count(name) > 1), None):
        raise InputError(
            f"{file}: column {repeated!r} is given for two quantities; expected one column each for heading, range and "
            "time"
        )
    for name in wanted:
        if header.count(name) != 1:
            problem = "no column" if name not in header else "more than one column"
            raise InputError(f"{file}, line 1: {problem} {name!r}; columns: {', '.join(header)}{_hint(header)}")
    return {name: header.index(name) for name in wanted}


@dataclass(frozen=True)
class _Line:
    file: Path
    number: int
    fields: list[str]
    decimal_comma: bool

    def error(self, message: str) -> InputError:
        """Return an error with the file and the line."""
        return InputError(f"{self.file}, line {self.number}: {message}")

    def check_length(self, columns: int) -> None:
        """Raise InputError if the line has more fields than the header."""
        extra = self.fields[columns:]
        if any(field.strip() for field in extra):
            problem = f"has {len(self.fields)} fields; expected {columns}, as in the header"
            raise self.error(problem if self.decimal_comma else f"{problem}; {_AT_DECIMAL_COMMAS}")

    def text(self, name: str, index: int) -> str:
        """Return the field of a column."""
        if index >= len(self.fields):
            raise self.error(f"has {counted(len(self.fields), 'field')}, but none for column {name!r}")
        return self.fields[index].strip()

    def number_in(self, name: str, index: int) -> float:
        """Return the number in a column, which may be infinite or NaN."""
        text = self.text(name, index)
        if self.decimal_comma and _DECIMAL_COMMA.fullmatch(text):
            text = text.replace(",", ".")
        if _NUMBER.fullmatch(text):
            return float(text)
        advice = f"; {_AT_DECIMAL_COMMAS}" if _DECIMAL_COMMA.fullmatch(text) else ""
        raise self.error(f"{name} is {text!r}; expected a number{advice}")


def _row(line: _Line, columns: CsvColumns, indices: dict[str, int], no_echo: float | None) -> ForeignRow:
    heading = line.number_in(columns.heading, indices[columns.heading])
    if not math.isfinite(heading):
        raise line.error(f"{columns.heading} is {heading:g}; expected degrees")
    seconds = None
    if columns.time is not None:
        seconds = line.number_in(columns.time, indices[columns.time])
        if not math.isfinite(seconds):
            raise line.error(f"{columns.time} is {seconds:g}; expected seconds")
    name = columns.distance
    if not line.text(name, indices[name]):
        return ForeignRow(f"line {line.number}", heading, None, seconds)
    distance = line.number_in(name, indices[name])
    if no_echo is not None and (distance == no_echo or (math.isnan(distance) and math.isnan(no_echo))):
        return ForeignRow(f"line {line.number}", heading, None, seconds)
    if not 0 <= distance < math.inf:
        raise line.error(
            f"{name} is {distance:g}; expected a range of 0 or more; if {distance:g} means no echo, use "
            f"`sonarhw import FILE.csv --no-echo {distance:g} --out LOG.mcap`, or *Import scan* in the window"
        )
    return ForeignRow(f"line {line.number}", heading, distance, seconds)
