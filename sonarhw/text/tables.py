"""Named columns: CSV with a header, and JSON."""

import csv
import json
import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

from sonarhw.text.numbers import HEADER, LINE_ENDS, LineFormat, Printed, Read, Units, is_number, number_of
from sonarhw.text.words import (
    ANGLE_UNITS,
    RANGE_UNITS,
    STEP,
    ColumnKind,
    NameMeaning,
    is_german,
    is_range_word,
    meaning_of,
    time_unit,
    words_of,
)


@dataclass(frozen=True)
class Columns:
    """The columns of angle and range among named ones."""

    count: int
    heading: int
    ranges: tuple[int, ...]
    angle: NameMeaning
    range: NameMeaning
    time: int | None = None
    second: float = 1.0  # s, unit of the times
    pose: "PoseColumns" = ()


PoseColumns = tuple[tuple[int, float], ...]  # the columns of x, y and yaw of a robot, with their units, m, m and rad
_POSE = re.compile(r"(x|y)_(m|cm|mm|in|ft|yd)|(yaw)_(deg|rad|gon)")


def pose_columns(names: Sequence[str], chosen: Sequence[str] = ()) -> PoseColumns:
    """Return the columns of a pose: `chosen` ones, else those such as x_m, y_m and yaw_deg; none unless there are all.

    Units are the last words of their names, by default m and degrees.
    """
    found = {match[1] or match[3]: match[0] for name in names if (match := _POSE.fullmatch(name.strip()))}
    wanted = chosen or [found.get(part, "") for part in ("x", "y", "yaw")]
    places = [_place_of(names, name) for name in wanted if name]
    if None in places or len(places) != len(_POSE_UNITS):
        return ()
    words = [words_of(name) for name in wanted]
    units = [
        next((known[word] for word in reversed(of_name) if word in known), usual)
        for of_name, (known, usual) in zip(words, _POSE_UNITS, strict=True)
    ]
    return tuple((place, unit) for place, unit in zip(places, units, strict=True) if place is not None)


_LENGTHS = {unit: metres for unit, metres in RANGE_UNITS.items() if unit != "us"}
_TURNS = {unit: math.radians(degrees) for unit, degrees in ANGLE_UNITS.items()}
_POSE_UNITS = ((_LENGTHS, 1.0), (_LENGTHS, 1.0), (_TURNS, math.radians(1)))  # of x, y and yaw, and the usual one


def pose_in(cells: Sequence[str | None], columns: PoseColumns) -> tuple[float, float, float] | None:
    """Return the pose in a row; None if it has none."""
    try:
        x, y, yaw = (number_of(cells[k] or "") * unit for k, unit in columns)
    except (ValueError, IndexError):
        return None
    return x, y, yaw


@dataclass(frozen=True)
class ColumnNames:
    """The columns of a table that the user names; `column 2` is the second one, also without a header."""

    heading: str
    range: str
    time: str = ""
    pose: tuple[str, ...] = ()  # x, y and yaw of a robot
    decimal_comma: bool = False  # commas are those of decimal numbers, not between columns


_COLUMN = re.compile(r"column (\d{1,3})", re.ASCII)


def column_names(count: int) -> tuple[str, ...]:
    """Return the names of the columns of a table without a header."""
    return tuple(f"column {k + 1}" for k in range(count))


def named_columns(cells: Sequence[str], names: ColumnNames) -> Columns | None:
    """Return the columns that the user has named; None unless each name occurs once among the cells of a header.

    Columns that are named by their number need no header.
    """
    places = [_place_of(cells, name) for name in (names.heading, names.range, names.time) if name]
    if None in places:
        return None
    heading, distance, *rest = [place for place in places if place is not None]
    german = is_german(word for cell in cells for word in words_of(cell))
    angle, reach = (meaning_of(cells[k], german) if k < len(cells) else NameMeaning() for k in (heading, distance))
    second = next((time_unit(cells[k]) or 1.0 for k in rest if k < len(cells)), 1.0)
    pose = pose_columns(cells, names.pose)
    if names.pose and not pose:
        return None
    return Columns(len(cells), heading, (distance,), angle, reach, rest[0] if rest else None, second, pose)


def _place_of(cells: Sequence[str], name: str) -> int | None:
    if name in cells:
        return cells.index(name) if cells.count(name) == 1 else None
    number = _COLUMN.fullmatch(name)
    return int(number[1]) - 1 if number and 0 < int(number[1]) <= len(cells) else None


def columns_of(names: Sequence[str]) -> Columns | str | None:
    """Return the columns with these names, or what is wrong with them; None if no name is one of a quantity."""
    german = is_german(word for name in names for word in words_of(name))
    pose = pose_columns(names)
    of_pose = {k for k, _ in pose}
    meanings = [NameMeaning() if k in of_pose else meaning_of(name, german) for k, name in enumerate(names)]
    angles = [k for k, meaning in enumerate(meanings) if meaning.quantity is ColumnKind.ANGLE]
    ranges = [k for k, meaning in enumerate(meanings) if meaning.quantity is ColumnKind.RANGE]
    if len(angles) > 1:  # a full word before an abbreviation
        named = [k for k in angles if meanings[k].unit != STEP and len(names[k]) > 1]
        angles = named if len(named) == 1 else angles
    if len(ranges) > 1:
        distances = [k for k in ranges if len(names[k]) > 1 and meanings[k].unit != "us"]
        named = [k for k in distances if is_range_word(words_of(names[k])[0])]  # range_m, not path_m
        ranges = next((chosen for chosen in (distances, named) if len(chosen) == 1), ranges)
    unsupported = [meaning for meaning in meanings if meaning.quantity is ColumnKind.UNSUPPORTED]
    if not ranges and unsupported and angles:
        return f"{unsupported[0].word!r} is not a unit of a range; expected {', '.join(RANGE_UNITS)}"
    if len(angles) != 1 or not ranges:
        return None
    if len(ranges) > 1:
        listed = ", ".join(names[k] for k in ranges)
        return f"several columns may be the range: {listed}"
    times = [k for k, meaning in enumerate(meanings) if meaning.quantity is ColumnKind.TIME and time_unit(names[k])]
    time = times[0] if len(times) == 1 else None
    second = 1.0 if time is None else time_unit(names[time]) or 1.0
    return Columns(len(names), angles[0], tuple(ranges), meanings[angles[0]], meanings[ranges[0]], time, second, pose)


_TWO_NUMBERS = Columns(2, 0, (1,), NameMeaning(ColumnKind.ANGLE), NameMeaning(ColumnKind.RANGE))


def csv_format(units: Units, names: ColumnNames | None = None) -> LineFormat:
    """Return the format of lines of numbers after a header line, which names their columns.

    Columns are separated by commas, semicolons, tabs, bars or spaces. Before the header, a line of exactly two numbers
    is an angle and a range. With `names`, these columns are read, below the first line that contains the names.
    """
    columns = _TWO_NUMBERS if names is None else None
    below = False  # whether a header has been read

    def split(line: str) -> list[str]:
        return cells_of(line, names is None or not names.decimal_comma)

    def parse(line: str, columns: Columns | None) -> Read:
        cells = split(line)
        columns = columns or (named_columns(cells, names) if names else None)
        if columns is None or len(cells) < columns.count or any(cells[columns.count :]):
            return None
        try:
            heading = units.heading(cells[columns.heading], columns.angle.unit)
        except ValueError:
            return None
        heading = -heading if columns.angle.clockwise else heading
        # without a header, the end of the line may be missing
        texts = [cells[k] or (None if below or k < columns.count - 1 else "") for k in columns.ranges]
        printed = units.printed(heading, texts, columns.range.unit)
        if printed is None:
            return None
        time, pose = _time_in(cells, columns), pose_in(cells, columns.pose)
        assumed = units.angle is None and columns.angle.unit is None
        return (replace(printed, time=time, pose=pose, degrees_assumed=assumed),)

    def read(line: str) -> Read:
        nonlocal columns, below
        header: Columns | str | None
        if any(char.isalpha() for char in line):
            cells = split(line)
            again = names is None or columns is None or names.heading in cells
            if names is not None:
                header = named_columns(cells, names) if again else None
            else:
                header = columns_of(cells) if is_header(cells) else None
            if isinstance(header, Columns) and not isinstance(parse(line, header), tuple):
                columns, below = header, True
                return HEADER
        return parse(line, columns)

    return LineFormat(read, LINE_ENDS, lambda line: isinstance(parse(line, columns), tuple))


def is_header(cells: Sequence[str]) -> bool:
    """Return whether a line may name columns: it has words, and neither numbers nor a version."""
    numbers = any(is_number(cell.lower().removeprefix("v")) for cell in cells)
    return len(cells) > 1 and any(map(words_of, cells)) and not numbers


def _time_in(cells: list[str], columns: Columns) -> float | None:
    """Return the time in a row, s; None without one."""
    if columns.time is None:
        return None
    try:
        return number_of(cells[columns.time]) * columns.second
    except ValueError:
        return None


_COMMENT = re.compile(r"[#%]+\s*(?=[^\W\d])")  # before the names of columns
_MOST_QUOTED = 100_000  # characters of a line; the library refuses cells that are little longer


def cells_of(line: str, commas_separate: bool = True) -> list[str]:
    """Return the cells of a line: between commas, semicolons, tabs or bars, else between spaces.

    Between semicolons, tabs or bars, a comma is that of a decimal number. A cell in quotes may contain any of them.
    """
    line = _COMMENT.sub("", line)
    mark = next((mark for mark in ";\t|" if mark in line), "," if commas_separate else "")
    if mark and mark in line:
        quoted = len(line) <= _MOST_QUOTED and re.search(rf'(?:^|{re.escape(mark)})\s*"', line) is not None
        parts = next(csv.reader([line], delimiter=mark, skipinitialspace=True)) if quoted else line.split(mark)
    else:
        # a unit in brackets belongs to the name before it: Angle (deg)
        parts = re.split(r"\s+(?![(\[])", line.strip())
    return [cell.strip().strip('"').strip() for cell in parts]


def json_format(units: Units) -> LineFormat:
    """Return the format of JSON, one text a line, with keys for angle and range, also within other objects."""

    def read(line: str) -> Read:
        printed = [_of_record(record, units) for record in json_records(line)]
        return tuple(reading for reading in printed if reading is not None) or None

    return LineFormat(read, LINE_ENDS, lambda line: line.startswith(("{", "[")) and isinstance(read(line), tuple))


def _of_record(record: dict[str, Any], units: Units) -> Printed | None:
    columns = _columns_of_keys(tuple(record))
    if not isinstance(columns, Columns):
        return None
    values = [*record.values()]
    heading, distance = values[columns.heading], values[columns.ranges[0]]
    echoes = distance if isinstance(distance, list) else [distance]
    possible = all(echo is None or isinstance(echo, str) or _is_number(echo) for echo in echoes)
    if not _is_number(heading) or not possible:
        return None
    try:
        angle = units.heading(str(heading), columns.angle.unit)
    except ValueError:
        return None
    texts = [None if echo is None else str(echo) for echo in echoes]
    angle = -angle if columns.angle.clockwise else angle
    printed = units.printed(angle, texts, columns.range.unit)
    assumed = units.angle is None and columns.angle.unit is None
    pose = pose_in([str(value) for value in values], columns.pose)
    return None if printed is None else replace(printed, pose=pose, degrees_assumed=assumed)


_columns_of_keys = lru_cache(64)(columns_of)
_QUOTED_NUMBER = re.compile(r"([+-]?\d+(?:\.\d+)?)\s*([^\W\d_]{0,12}|°)")
_SCAN_KEYS = ("angle_min", "angle_increment", "ranges")  # of the message LaserScan, in radians and metres


def json_records(line: str) -> list[dict[str, Any]]:
    """Return the values of each reading in a JSON text by their keys; of a key in several objects, by all keys.

    A text is an object, a list of objects, or an object with a list of angles and one of ranges. Other text may stand
    before it, such as the name of a topic.
    """
    begin = 0 if line.startswith("[") else line.find("{")
    try:
        return [*_records_in(json.loads(line[begin:]))] if begin >= 0 else []
    except (ValueError, RecursionError):
        return []


def _records_in(content: object) -> Iterator[dict[str, Any]]:
    if isinstance(content, list):
        for item in content:
            yield from _records_in(item)
    if not isinstance(content, dict):
        return
    of_objects = [value for value in content.values() if isinstance(value, list) and isinstance((*value, 0)[0], dict)]
    if of_objects:
        yield from _records_in(of_objects)
        return
    record = dict(_leaves(content))
    columns = _columns_of_keys(tuple(record))
    if all(key in record for key in _SCAN_KEYS):
        begin, turn, ranges = (record[key] for key in _SCAN_KEYS)
        least, most = record.get("range_min", 0.0), record.get("range_max", math.inf)
        for k, distance in enumerate(ranges):
            inside = _is_number(distance) and least <= distance <= most
            yield {"angle_rad": begin + k * turn, "range_m": distance if inside else None}
    elif isinstance(columns, Columns) and isinstance([*record.values()][columns.heading], list):
        heading, distance = ([*record][k] for k in (columns.heading, columns.ranges[0]))
        if isinstance(record[distance], list) and len(record[distance]) == len(record[heading]):
            for angle, echo in zip(record[heading], record[distance], strict=True):
                yield {heading: angle, distance: echo}
    else:
        yield record


def _leaves(record: dict[str, Any], depth: int = 0) -> Iterator[tuple[str, Any]]:
    unit = record.get("unit") or record.get("units")
    for key, value in record.items():
        if isinstance(value, str) and (quoted := _QUOTED_NUMBER.fullmatch(value.strip())):  # "148 cm"
            yield f"{key} {quoted[2]}".strip(), float(quoted[1])
            continue
        if isinstance(value, dict) and depth < 5:
            for inner, leaf in _leaves(value, depth + 1):
                # {"angle": {"value": 90, "unit": "deg"}}
                yield (key + inner[len("value") :] if inner.split()[:1] == ["value"] else inner), leaf
        elif not isinstance(value, dict):
            stated = f"{key} {unit}" if isinstance(unit, str) and key not in ("unit", "units") else key
            yield stated if _is_number(value) and isinstance(unit, str) else key, value


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
