"""What a device prints on a line: a pattern, CSV or JSON.

Angles are in degrees, ranges in m.
"""

import json
import math
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass

from sonarhw.errors import InputError

UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254}  # m
MOST_HEADING = 720.0  # degrees, either side of 0; larger ones are not angles of a turntable
MOST_RANGE = 700.0  # m; larger ones do not fit into the frames of a log
_HEADINGS = ("heading", "angle", "bearing", "azimuth", "theta", "servo", "pan", "deg", "degrees", "a")
_RANGES = ("range", "distance", "dist", "d", "r", "m", "cm", "mm")
_UNIT_WORDS = {**UNITS, "metres": 1.0, "meters": 1.0, "inch": 0.0254, "inches": 0.0254, "centimeters": 0.01}
_NO_ECHO = ("out of range", "no echo", "none", "null", "nan", "inf", "timeout", "-", "--", "---")
# stricter than `float`, which accepts 1_0 and the digits of all scripts
_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?", re.ASCII)
_SEPARATOR = re.compile(r"[,;\t]")


@dataclass(frozen=True)
class Printed:
    """The numbers of one line."""

    heading: float | None  # degrees, as printed; None: the device prints no angle
    range: float | None  # m; None: no echo


class Header:
    """A line that names the columns of the following lines."""


@dataclass(frozen=True)
class RangeUnit:
    """Unit of the printed ranges, and the numbers that stand for no echo."""

    scale: float | None  # m; None: as the line or its header states, else centimetres
    no_echo: tuple[float, ...] = ()

    def printed(self, heading: str | None, distance: str | None, stated: float | None = None) -> Printed | None:
        """Return the numbers of a line; None if they are not numbers that a scanner can print.

        A `distance` of 0 or less, or of `no_echo`, means no echo. `stated` is the unit that the line states, m.
        """
        try:
            angle = None if heading is None else _number(heading)
            value = _range_value(distance)
        except ValueError:
            return None
        scale = next(scale for scale in (self.scale, stated, UNITS["cm"]) if scale is not None)
        if angle is not None and not abs(angle) <= MOST_HEADING:
            return None
        if value is None or value <= 0 or value in self.no_echo:
            return Printed(angle, None)
        return Printed(angle, value * scale) if value * scale <= MOST_RANGE else None


def _range_value(text: str | None) -> float | None:
    """Return a printed range; None if the text stands for no echo. Raises ValueError."""
    if text is None or text.strip().lower() in _NO_ECHO:
        return None
    value = _number(text)
    return value if math.isfinite(value) else None


def _number(text: str) -> float:
    if not _NUMBER.fullmatch(text.strip()):
        raise ValueError(text)
    return float(text)


@dataclass(frozen=True)
class LineFormat:
    """How the device prints a reading."""

    read: Callable[[str], Printed | Header | None]  # of a line without its end; None: not a reading
    ends: re.Pattern[bytes]  # what separates lines


LINE_ENDS = re.compile(rb"[\r\n\0]+")


def pattern_format(pattern: re.Pattern[str], unit: RangeUnit, ends: re.Pattern[bytes] = LINE_ENDS) -> LineFormat:
    """Return the format of a regular expression with the groups of `check_pattern`, which matches a whole line."""
    groups = set(pattern.groupindex)
    range_group = next(group for group in groups if group.partition("_")[0] == "range")
    named = UNITS.get(range_group.partition("_")[2])

    def read(line: str) -> Printed | None:
        match = pattern.fullmatch(line)
        if match is None:
            return None
        found = match.groupdict()
        word = found.get("unit")
        stated = named if word is None else _UNIT_WORDS.get(word.lower())
        return unit.printed(found.get("heading_deg"), found[range_group], stated)

    return LineFormat(read, ends)


def check_pattern(text: str, prints_angle: bool) -> re.Pattern[str]:
    """Return the compiled pattern. Raises InputError if it is invalid or lacks a group."""
    try:
        pattern = re.compile(text, re.ASCII)
    except (re.error, RecursionError, OverflowError) as error:
        raise InputError(f"pattern {text!r}: invalid regular expression: {error}") from error
    ranges = [group for group in pattern.groupindex if re.fullmatch("range(_m|_cm|_mm|_in)?", group)]
    if len(ranges) != 1:
        raise InputError(f"pattern {text!r}: expected one group (?P<range_cm>...), or range_m, range_mm, range_in")
    if prints_angle and "heading_deg" not in pattern.groupindex:
        raise InputError(f"pattern {text!r}: expected a group (?P<heading_deg>...); without an angle, add step=DEGREES")
    return pattern


def csv_format(unit: RangeUnit) -> LineFormat:
    """Return the format of lines of numbers after a header line, which names their columns.

    Columns are separated by commas, semicolons, tabs or spaces.

    Before the header, a line of exactly two numbers is an angle and a range.
    """
    columns = _Columns(0, 1, None, 2)

    def read(line: str) -> Printed | Header | None:
        nonlocal columns
        parts = _SEPARATOR.split(line) if _SEPARATOR.search(line) else line.split()
        cells = [cell.strip().strip('"') for cell in parts]
        if header := _columns(cells):
            columns = header
            return Header()
        if len(cells) != columns.count:
            return None
        return unit.printed(cells[columns.heading], cells[columns.range], columns.scale)

    return LineFormat(read, LINE_ENDS)


def json_format(unit: RangeUnit) -> LineFormat:
    """Return the format of JSON objects, one a line, with keys for angle and range."""

    def read(line: str) -> Printed | None:
        if not line.startswith("{"):
            return None
        try:
            record = json.loads(line)
        except (ValueError, RecursionError):
            return None
        columns = _columns(record)
        if columns is None:
            return None
        heading, distance = [*record.values()][columns.heading], [*record.values()][columns.range]
        if not _is_number(heading) or not (distance is None or _is_number(distance) or isinstance(distance, str)):
            return None
        return unit.printed(str(heading), None if distance is None else str(distance), columns.scale)

    return LineFormat(read, LINE_ENDS)


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


@dataclass(frozen=True)
class _Columns:
    heading: int  # index
    range: int  # index
    scale: float | None  # unit of the range in its name, m
    count: int


def _columns(names: Iterable[str]) -> _Columns | None:
    """Return the columns with these names; None if no name, or more than one, is that of an angle or of a range."""
    words = [re.findall(r"[a-z]+", name.lower()) for name in names]
    heading, distance = _index(words, _HEADINGS), _index(words, _RANGES)
    if heading is None or distance is None:
        return None
    return _Columns(heading, distance, _UNIT_WORDS.get(words[distance][-1]), len(words))


def _index(words: list[list[str]], names: tuple[str, ...]) -> int | None:
    """Return the index of the column whose name starts with one of `names`, the earliest of them that occurs."""
    for name in names:
        found = [index for index, column in enumerate(words) if column[:1] == [name]]
        if found:
            return found[0] if len(found) == 1 else None
    return None
