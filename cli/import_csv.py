"""`sonarhw import`: other people's scans, as CSV, become logs."""

import csv
import math
import time
from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Annotated

import typer

from cli.numbers import counted
from cli.options import LOG, Force, checked_out
from sonarhw.errors import InputError

if TYPE_CHECKING:
    from sonarhw.readings import Reading

SPACING = 0.1  # s between readings whose file tells no time
# what the frames of a log can carry
MOST_DEGREES = 2147.0
MOST_RANGE = 700.0  # m
_FAR = 20.0  # m; farther than any of these boards hears
LONGEST = 1e9  # s
_PINGS = 256
_OTHER_SEPARATORS = {";": "semicolons", "\t": "tabs", "|": "bars"}


class TurnDirection(StrEnum):
    """Which way the headings of a file count."""

    CCW = "ccw"
    CW = "cw"


def import_csv(
    file: Annotated[Path, typer.Argument(help="CSV file with a header line.", metavar="CSV")],
    out: Annotated[Path, typer.Option("--out", help="Log to write (*.mcap).")],
    heading: Annotated[str, typer.Option("--heading", help="Column of the heading, degrees.", metavar="COL")],
    distance: Annotated[
        str, typer.Option("--range", help="Column of the range; an empty field is no echo.", metavar="COL")
    ],
    scale: Annotated[float, typer.Option(help="Metres in one unit of the range column.")] = 1.0,
    turn: Annotated[TurnDirection, typer.Option(help="Which way the headings count.")] = TurnDirection.CCW,
    heading_zero: Annotated[
        float, typer.Option("--heading-zero", help="Turntable angle where the column says 0, degrees.")
    ] = 0.0,
    no_echo: Annotated[
        float | None, typer.Option("--no-echo", help="Value of the range column that means: no echo.")
    ] = None,
    time_column: Annotated[
        str | None, typer.Option("--time", help="Column of the time, s; without it readings are 0.1 s apart.")
    ] = None,
    force: Force = False,
) -> None:
    """Make a log of a scan that others recorded as CSV."""
    from sonarhw.encode import write_scan
    from sonarhw.log import LogMetadata

    checked_out(out, (LOG,), force, file)
    _check_options(scale, heading_zero)
    sign = -1.0 if turn is TurnDirection.CW else 1.0
    columns = _Columns(heading, distance, time_column)
    readings = _readings(_rows(file, columns, no_echo), _Meaning(file, scale, sign, heading_zero))
    write_scan(out, LogMetadata("import", time.time()), readings, overwrite=force)
    echoes = sum(reading.range is not None for reading in readings)
    typer.echo(f"{out}: {counted(len(readings), 'reading')}, {echoes} with an echo")
    _warn_of_far_ranges(readings, scale)


def _warn_of_far_ranges(readings: "list[Reading]", scale: float) -> None:
    ranges = [reading.range for reading in readings if reading.range is not None]
    if ranges and (middle := median(ranges)) > _FAR:
        typer.echo(
            f"sonarhw: warning: half of the ranges are over {middle:.4g} m, farther than such a board hears; "
            f"are they centimetres? --scale {scale / 100:g}",
            err=True,
        )


@dataclass(frozen=True)
class _Columns:
    heading: str
    distance: str
    time: str | None


@dataclass(frozen=True)
class _Meaning:
    """What the numbers of a file mean."""

    file: Path
    scale: float  # m
    sign: float
    zero: float  # degrees


@dataclass(frozen=True)
class _Row:
    """The numbers of one line, in the file's own units."""

    line: int
    heading: float
    distance: float | None  # None: no echo
    time: float | None


def _check_options(scale: float, heading_zero: float) -> None:
    if not (math.isfinite(scale) and scale > 0):
        raise InputError(f"--scale {scale:g}: expected a number above 0, such as 0.01 for centimetres")
    if not math.isfinite(heading_zero):
        raise InputError(f"--heading-zero {heading_zero:g}: expected degrees")


def _rows(file: Path, columns: _Columns, no_echo: float | None) -> Iterator[_Row]:
    try:
        with file.open(encoding="utf-8-sig", newline="") as text:
            lines = csv.reader(text)
            places = _places(file, [name.strip() for name in next(lines, [])], columns)
            for fields in lines:
                if any(field.strip() for field in fields):
                    yield _row(_Line(file, lines.line_num, fields), columns, places, no_echo)
    except OSError as error:
        raise InputError(f"{file}: cannot be read: {error.strerror}; a CSV file was expected") from error
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{file}: is no CSV text: {error}") from error


def _places(file: Path, header: list[str], columns: _Columns) -> dict[str, int]:
    if not any(header):
        raise InputError(f"{file}: is empty; expected a header line and a reading a line")
    separator = next((mark for mark in _OTHER_SEPARATORS if len(header) == 1 and mark in header[0]), None)
    if separator is not None:
        raise InputError(
            f"{file}, line 1: has one column, with {_OTHER_SEPARATORS[separator]} in it; "
            "expected commas between columns, and points in numbers"
        )
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
            raise self.refuse(f"has {counted(len(self.fields), 'field')} and none for column {name!r}")
        return self.fields[place].strip()

    def number_in(self, name: str, place: int) -> float:
        """The number in a column, which may be infinite or NaN."""
        text = self.text(name, place)
        try:
            return float(text)
        except ValueError:
            raise self.refuse(f"{name} is {text!r}; expected a number") from None


def _row(line: _Line, columns: _Columns, places: dict[str, int], no_echo: float | None) -> _Row:
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


def _readings(rows: Iterator[_Row], meaning: _Meaning) -> "list[Reading]":
    from sim.air import speed_of_sound
    from sonarhw.readings import Reading

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
        _check(reading, before, f"{meaning.file}, line {row.line}")
        readings.append(reading)
    if not readings:
        raise InputError(f"{meaning.file}: has no readings; expected a header line and a reading a line")
    return readings


def _check(reading: "Reading", before: "Reading | None", where: str) -> None:
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
