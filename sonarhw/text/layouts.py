"""Layouts of text: how a device prints its readings, as a pattern, a preset, CSV with a header or JSON.

A pattern is the text of a reading with fields in braces, such as `Angle: {deg} Dist: {cm}`, or a regular expression.
"""

import csv
import json
import math
import re
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from dataclasses import field as of_dataclass
from functools import lru_cache
from typing import Any, Final, Literal

from sonarhw.errors import InputError
from sonarhw.text.words import (
    ANGLE_UNITS,
    RANGE_UNITS,
    STEP,
    ColumnKind,
    NameMeaning,
    is_german,
    is_no_echo,
    is_range_word,
    meaning_of,
    time_unit,
    words_of,
)

MOST_HEADING = 720.0  # degrees, either side of 0; larger ones are not angles of a turntable
MOST_RANGE = 700.0  # m; larger ones do not fit into the frames of a log
_SMALLEST_UNIT = min(RANGE_UNITS.values())  # m
# stricter than `float`, which accepts 1_0 and the digits of all scripts
_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?", re.ASCII)


@dataclass(frozen=True)
class Printed:
    """The numbers of one reading."""

    heading: float | None  # degrees, as printed; None: the device prints no angle
    numbers: tuple[float, ...]  # ranges of the echoes as printed; empty: no echo
    scale: float | None = 1.0  # m, unit of the ranges; None: not stated
    restarted: bool = False  # whether a banner or another text was printed since the reading before
    time: float | None = None  # s, as printed; None: the text states none
    pose: tuple[float, float, float] | None = None  # of a robot: x, y (m) and heading (rad); None: none is stated
    degrees_assumed: bool = of_dataclass(default=False, compare=False)  # whether nothing states the unit of the heading

    @property
    def ranges(self) -> tuple[float, ...]:
        """Ranges of the echoes, m, nearest first. The unit must be known, if there are any."""
        assert self.scale is not None or not self.numbers
        return tuple(sorted(number * (self.scale or 1.0) for number in self.numbers))


HEADER: Final = "header"  # instead of readings: a line that names the columns of the following lines
PART: Final = "part"  # a line that begins or continues a reading on several lines
Read = tuple[Printed, ...] | Literal["header", "part"] | None  # None: not a reading


@dataclass(frozen=True)
class Units:
    """What the user states about the numbers."""

    range: str | None = None  # of RANGE_UNITS; None: as the text states
    angle: str | None = None  # of ANGLE_UNITS; None: as the text states, else degrees
    no_echo: tuple[float, ...] = ()  # numbers that stand for no echo
    step: float | None = None  # degrees between two readings without an angle, or of one step
    scale: float | None = None  # m, unit of the ranges as a number; None: `range`

    def printed(
        self, heading: float | None, texts: Sequence[str | None], range_unit: str | None, offset: float = 0.0
    ) -> Printed | None:
        """Return a reading of a heading (degrees) and texts of ranges; None if a scanner cannot print them.

        A range of 0 or less, or of `no_echo`, means no echo.
        """
        unit = self.range or range_unit
        try:
            values = [value for text in texts if (value := _range_value(text, unit)) is not None]
        except ValueError:
            return None
        scale = self.scale if self.scale or unit is None else RANGE_UNITS[unit]
        if heading is not None and not abs(heading) <= MOST_HEADING:
            return None
        echoes = tuple(value for value in values if value > 0 and value not in self.no_echo)
        if any(value * (scale or _SMALLEST_UNIT) > MOST_RANGE for value in echoes):
            return None
        return Printed(None if heading is None else heading + offset, echoes, scale)

    def heading(self, text: str, unit: str | None) -> float:
        """Return an angle, degrees. Raises ValueError."""
        stated = self.angle or unit or "deg"
        if stated == STEP:
            return number_of(text) * (self.step or 0.0)
        return number_of(text) * ANGLE_UNITS[stated]


def _range_value(text: str | None, unit: str | None) -> float | None:
    """Return a printed range; None if the text stands for no echo. Raises ValueError.

    Small units have no thousandths: in millimetres, 1,234 is 1234.
    """
    if text is None or is_no_echo(text):
        return None
    value = number_of(text)
    if unit in ("mm", "us") and _ONE_GROUP.fullmatch(text.strip()):
        value *= 1000
    return value if math.isfinite(value) else None


_ONE_GROUP = re.compile(r"[1-9]\d{0,2}[.,]\d{3}", re.ASCII)
# thousands: 1,234.5 and 1.234,5 and 1,234,567 and 1 234 and 1'234
_GROUPED = re.compile(
    r"[+-]?(?:[1-9]\d{0,2}(?:,\d{3})+\.\d+|[1-9]\d{0,2}(?:\.\d{3})+,\d+|[1-9]\d{0,2}([.,])\d{3}(?:\1\d{3})+"
    r"|[1-9]\d{0,2}(?:[ '’\u00a0\u202f]\d{3})+(?:[.,]\d+)?)",
    re.ASCII,
)


def numbers_of(texts: Sequence[str]) -> list[float]:
    """Return a column of printed numbers. Whole ones beside 1,234 show that it is 1234. Raises ValueError."""
    others = [text for text in texts if not _ONE_GROUP.fullmatch(text) and number_of(text)]
    thousands = bool(others) and all(map(str.isdigit, others))
    return [number_of(text) * (1000 if thousands and _ONE_GROUP.fullmatch(text) else 1) for text in texts]


_HEX = re.compile(r"0[xX][0-9A-Fa-f]{1,8}")


def number_of(text: str) -> float:
    """Return a printed number: decimal with a point or comma, in thousands, or hexadecimal. Raises ValueError."""
    plain = text.strip()
    if _HEX.fullmatch(plain):
        return float(int(plain, 16))
    if grouped := _GROUPED.fullmatch(plain):
        marks = [char for char in plain if char in ",."]
        point = "" if grouped[1] or not marks else marks[-1]  # of the decimals
        plain = "".join("." if char == point else char for char in plain if char in f"+-{point}" or char.isdigit())
    plain = plain.replace(",", ".")
    if not _NUMBER.fullmatch(plain):
        raise ValueError(text)
    return float(plain)


@dataclass(frozen=True)
class LineFormat:
    """How the device prints a reading."""

    read: Callable[[str], Read]  # of a line without its end; may remember the line before
    ends: re.Pattern[bytes]  # what separates lines
    fits: Callable[[str], bool]  # whether a line is a reading by itself, or its first line; remembers nothing
    close: Callable[[], None] = lambda: None  # ends the process that matches lines, if any


LINE_ENDS = re.compile(rb"[\r\n\0]+")


def ends_of(characters: str) -> re.Pattern[bytes]:
    """Return what separates readings: these characters, and a NUL."""
    return re.compile(b"[" + re.escape(characters.encode()) + rb"\0]+")


# regular expressions


Groups = dict[str, str | None]  # the texts of the named groups of a match


def regex_format(
    pattern: re.Pattern[str],
    units: Units,
    ends: re.Pattern[bytes] = LINE_ENDS,
    matching: "MatchingProcess | None" = None,
) -> LineFormat:
    """Return the format of a regular expression with the groups of `check_regex`, which matches a whole line.

    `matching` matches the lines, in place of the pattern itself.
    """
    range_group = next(group for group in pattern.groupindex if group.partition("_")[0] == "range")
    heading_group = next((group for group in pattern.groupindex if group.partition("_")[0] == "heading"), None)
    named = range_group.partition("_")[2] or None
    of_pose = pose_columns([*pattern.groupindex])

    def match_here(line: str) -> Groups | None:
        match = pattern.fullmatch(line)
        return None if match is None else match.groupdict()

    matched = matching.groups if matching else match_here

    def read(line: str) -> Read:
        texts = matched(line.strip())
        if texts is None:
            return None
        word = texts.get("unit")
        stated = named if word is None else meaning_of(word).unit
        try:
            text = texts[heading_group] if heading_group else None
            heading = None if text is None or heading_group is None else units.heading(text, heading_group[8:])
        except ValueError:
            return None
        printed = units.printed(heading, [texts[range_group]], stated)
        return None if printed is None else (replace(printed, pose=_pose_in([*texts.values()], of_pose)),)

    return LineFormat(
        read, ends, lambda line: matched(line.strip()) is not None, matching.close if matching else lambda: None
    )


def _only(printed: Printed | None) -> Read:
    return None if printed is None else (printed,)


def check_regex(text: str) -> re.Pattern[str]:
    """Return the compiled regular expression. Raises InputError if it is invalid or lacks a range."""
    try:
        pattern = re.compile(text, re.ASCII)
    except (re.error, RecursionError, OverflowError) as error:
        raise InputError(f"pattern {text!r}: invalid regular expression: {error}") from error
    ranges = [group for group in pattern.groupindex if re.fullmatch("range(_m|_cm|_mm|_in|_ft|_yd|_us)?", group)]
    if len(ranges) != 1:
        raise InputError(f"pattern {text!r}: expected one group (?P<range_cm>...), or range_m, range_mm, range_in")
    return pattern


_MATCHED_WITHIN = 1.0  # s for one line
_MOST_SLOW = 3  # lines one after another
# what the process executes: it ends within a match that takes too long, and when its input ends
_MATCH = """
import faulthandler, json, os, re, sys
nowhere = open(os.devnull, "w")
text, flags, method, within = json.loads(sys.stdin.readline())
matched = getattr(re.compile(text, flags), method)
for line in sys.stdin:
    faulthandler.dump_traceback_later(within, exit=True, file=nowhere)
    match = matched(json.loads(line))
    faulthandler.cancel_dump_traceback_later()
    print(json.dumps(match and match.groupdict()), flush=True)
"""


class MatchingProcess:
    """Matches lines with a pattern of the user, in a process that ends if a match takes longer than 1 s.

    A match cannot be interrupted, and no other thread of its process runs meanwhile.
    """

    def __init__(self, pattern: str, flags: int = re.ASCII, method: str = "fullmatch") -> None:
        """`method` of `re.Pattern`: fullmatch, match or search."""
        self._pattern, self._flags, self._method = pattern, int(flags), method
        self._slow = 0  # newest lines, one after another, whose match took too long
        self._process: subprocess.Popen[str] | None = None

    def groups(self, line: str) -> Groups | None:
        """Return the groups of the line; None without a match.

        Raises TimeoutError if it takes too long, and InputError for the third such line one after another.
        """
        try:
            answer = self._answer(line)
        except OSError:
            answer = ""
        if answer:
            self._slow = 0
            groups: Groups | None = json.loads(answer)
            return groups
        self.close()
        self._slow += 1
        if self._slow >= _MOST_SLOW:
            raise InputError(
                f"pattern {self._pattern!r}: matching takes more than {_MATCHED_WITHIN:g} s for lines such as "
                f"{line[:60]!r}; write it without a repetition within a repetition"
            )
        raise TimeoutError

    def close(self) -> None:
        """End the process. The next line starts it again."""
        process, self._process = self._process, None
        if process:
            process.kill()
            process.communicate()

    def _answer(self, line: str) -> str:
        """Return the answer to a line as JSON; empty if the process has ended."""
        if self._process is None:
            self._process = _started_matching()
            start = json.dumps((self._pattern, self._flags, self._method, _MATCHED_WITHIN))
            print(start, file=self._process.stdin, flush=True)
        assert self._process.stdout is not None
        print(json.dumps(line), file=self._process.stdin, flush=True)
        return self._process.stdout.readline()


def _started_matching() -> "subprocess.Popen[str]":
    hidden: dict[str, Any] = {"start_new_session": True}  # Ctrl-C in a terminal does not reach it
    if sys.platform == "win32":
        hidden = {"creationflags": subprocess.CREATE_NO_WINDOW}
    return subprocess.Popen(
        [sys.executable, "-I", "-S", "-c", _MATCH],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        encoding="ascii",
        **hidden,
    )


# patterns with fields


_FIELD = re.compile(r"\{([^{}]*)\}")
_NUMBER_TEXT = r"[+-]?(?:0x[\da-f]+|\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d+)?"
_MARKS = ((",", r"\."), (r"\.", ","), ("['’\u00a0\u202f]", "[.,]"))  # of thousands and decimals
GROUPS_TEXT = "|".join(rf"[1-9]\d{{0,2}}(?:{mark}\d{{3}})+(?:{point}\d+)?" for mark, point in _MARKS)
_COMMA_TEXT = rf"[+-]?(?:0x[\da-f]+|{GROUPS_TEXT}|\d+(?:[.,]\d*)?|[.,]\d+)(?:[eE][+-]?\d+)?"
_WORDS_TEXT = r"[^\W\d_][^\d,;|]*|--?-?"  # in place of a range
_SKIPPED = r"[^\s,;|]*"
_ANGLE_FIELDS = {"angle": None, "deg": "deg", "rad": "rad", "gon": "gon", "step": STEP}
_RANGE_FIELDS = {"range": None, **{unit: unit for unit in RANGE_UNITS}}
_FIELDS = ", ".join(f"{{{name}}}" for name in (*_ANGLE_FIELDS, *_RANGE_FIELDS, "-", "text"))
_UNIT_AFTER = re.compile(r"\s*[^\W\d_]+\.?|\s*[°\"]")


@dataclass(frozen=True)
class _Field:
    kind: ColumnKind
    unit: str | None
    mount: float | None  # degrees, direction of this sensor from that of the angle; None: none given


@dataclass(frozen=True)
class _Piece:
    """A part of a line: its expression with one group for each field."""

    text: str
    fields: tuple[_Field, ...]


@dataclass(frozen=True)
class _Line:
    """One line of a pattern; `repeated` stands between `before` and `after`, once or more often."""

    before: _Piece
    repeated: _Piece | None = None
    after: _Piece = _Piece("", ())

    def compiled(self) -> re.Pattern[str]:
        """Return the expression of the whole line, in which the repeated part is one group."""
        body = "" if self.repeated is None else f"((?:{_without_groups(self.repeated.text)})+)"
        return re.compile(rf"\s*{self.before.text}{body}{self.after.text}\s*", re.IGNORECASE)


def _without_groups(text: str) -> str:
    return re.sub(r"(?<!\\)\((?!\?)", "(?:", text)


@dataclass(frozen=True)
class Template:
    """A pattern with fields."""

    lines: tuple[_Line, ...]

    @property
    def fields(self) -> tuple[_Field, ...]:
        """All fields, in their order."""
        pieces = [piece for line in self.lines for piece in (line.before, line.repeated, line.after) if piece]
        return tuple(field for piece in pieces for field in piece.fields)

    @property
    def prints_angle(self) -> bool:
        """Whether each reading has an angle or the direction of its sensor."""
        fields = self.fields
        if any(line.repeated for line in self.lines):
            body = next(line.repeated for line in self.lines if line.repeated)
            return any(field.kind is ColumnKind.ANGLE for field in body.fields)
        mounted = all(field.mount is not None for field in fields if field.kind is ColumnKind.RANGE)
        return mounted or any(field.kind is ColumnKind.ANGLE for field in fields)

    @property
    def has_steps(self) -> bool:
        """Whether an angle is counted in steps."""
        return any(field.unit == STEP for field in self.fields)

    @property
    def states_unit(self) -> bool:
        """Whether the unit of the ranges is in the pattern."""
        return all(field.unit is not None for field in self.fields if field.kind is ColumnKind.RANGE)


def parse_template(text: str) -> Template:
    """Return a pattern with fields. Raises InputError."""
    lines = tuple(_line(text, part) for part in re.split(r"\\n|\n", text))
    template = Template(lines)
    fields = template.fields
    if not any(field.kind is ColumnKind.RANGE for field in fields):
        raise InputError(f"pattern {text!r}: expected a range such as {{cm}}; fields: {_FIELDS}")
    if sum(field.kind is ColumnKind.ANGLE for field in fields) > 1:
        raise InputError(f"pattern {text!r}: expected one angle; write {{-}} for a number that is ignored")
    if len({field.unit for field in fields if field.kind is ColumnKind.RANGE}) > 1:
        raise InputError(f"pattern {text!r}: expected one unit for all ranges")
    return template


_REPEATED = re.compile(r"\[(?!\[)(.+?)(?<!\])\]\.\.\.", re.DOTALL)


def _line(text: str, part: str) -> _Line:
    repetition = _REPEATED.search(part)
    if repetition is None:
        return _Line(_piece(text, part))
    after = part[repetition.end() :]
    if _REPEATED.search(after):
        raise InputError(f"pattern {text!r}: expected one repetition [...]... in a line")
    core = repetition[1].rstrip(" ,;:|\t")
    body = _piece(text, core, repetition[1][len(core) :])
    separator = _literal(repetition[1][len(core) :], True)  # may be missing after the last one
    if separator:
        body = replace(body, text=rf"{body.text}(?:{separator}|(?=\s*$))")
    return _Line(_piece(text, part[: repetition.start()]), body, _piece(text, after))


def _piece(text: str, part: str, after: str = "") -> _Piece:
    """Return the expression of a part of a line, before the text `after`.

    After words for no echo, the unit may be missing. A comma next to a number is no part of it.
    """
    regex, position = "", 0
    fields: list[_Field] = []
    for match in _FIELD.finditer(part):
        regex += _literal(part[position : match.start()], position > 0)
        field = _field(text, match[1])
        position = match.end()
        decimals = part[max(match.start() - 1, 0) : match.start()] != "," and not (part + after)[position:].startswith(
            ","
        )
        number = _COMMA_TEXT if decimals else _NUMBER_TEXT
        if field is None:
            regex += ".*?" if match[1] == "text" else _SKIPPED
        elif field.kind is ColumnKind.ANGLE:
            regex += f"({number})"
        else:
            unit = _UNIT_AFTER.match(part, position)
            ending = "" if unit is None else _literal(unit[0], True)
            position = position if unit is None else unit.end()
            group = f"({number}(?={ending})|{_WORDS_TEXT})"
            regex += f"{group}(?:(?:{ending})?)" if ending else group
        if field is not None:
            fields.append(field)
    return _Piece(regex + _literal(part[position:], position > 0), tuple(fields))


def _literal(text: str, after_field: bool) -> str:
    """Return the expression of text between fields, where spaces may be more or fewer."""
    if not text:
        return ""
    if not text.strip():
        return r"\s+" if after_field else r"\s*"
    parts = [re.escape(word) for word in text.split()]
    lead = r"\s*" if text[0].isspace() or after_field else ""
    return lead + r"\s*".join(parts) + (r"\s*" if text[-1].isspace() or not text[-1].isalnum() else "")


def _field(text: str, name: str) -> _Field | None:
    """Return a field; None for one that is ignored. Raises InputError."""
    word, at, mount = name.partition("@")
    if word in ("-", "text"):
        return None
    if word in _ANGLE_FIELDS and not at:
        return _Field(ColumnKind.ANGLE, _ANGLE_FIELDS[word], None)
    if word in _RANGE_FIELDS and (not at or _NUMBER.fullmatch(mount)):
        return _Field(ColumnKind.RANGE, _RANGE_FIELDS[word], float(mount) if at else None)
    raise InputError(f"pattern {text!r}: unknown field {{{name}}}; fields: {_FIELDS}, with a direction {{cm@90}}")


def template_format(template: Template, units: Units, ends: re.Pattern[bytes] = LINE_ENDS) -> LineFormat:
    """Return the format of a pattern with fields."""
    lines = [(line, line.compiled()) for line in template.lines]
    matched: list[re.Match[str]] = []  # the first lines of the reading in progress

    def read(text: str) -> Read:
        for start in (len(matched), 0):
            match = lines[start][1].fullmatch(text)
            del matched[start:]
            if match is not None:
                matched.append(match)
                break
            if not start:
                return None
        if len(matched) < len(lines):
            return PART
        matches = [(line, match) for (line, _), match in zip(lines, matched, strict=True)]
        matched.clear()
        return _readings(matches, units)

    return LineFormat(read, ends, lambda text: bool(lines[0][1].fullmatch(text)))


_Value = tuple[_Field, str]


def _readings(matches: list[tuple[_Line, re.Match[str]]], units: Units) -> Read:
    """Return the readings of all lines of a pattern; None if a number is impossible."""
    values: list[_Value] = []
    repeated: list[list[_Value]] = []
    for line, match in matches:
        texts = list(match.groups())
        values += zip(line.before.fields, texts, strict=False)
        if line.repeated is not None:
            body = re.compile(line.repeated.text, re.IGNORECASE)
            repeated += [
                list(zip(line.repeated.fields, repetition.groups(), strict=True))
                for repetition in body.finditer(texts[len(line.before.fields)])
            ]
        values += zip(line.after.fields, texts[len(texts) - len(line.after.fields) :], strict=True)
    try:
        printed = list(_printed(values, repeated, units))
    except ValueError:
        return None
    return None if None in printed or not printed else tuple(unit for unit in printed if unit is not None)


def _printed(values: list[_Value], repeated: list[list[_Value]], units: Units) -> Iterator[Printed | None]:
    """Yield the readings of values; of a repeated part without angles, `step` apart. Raises ValueError."""
    angle = _angle(values, units)
    ranges = [value for value in values if value[0].kind is ColumnKind.RANGE]
    unit = next(
        (field.unit for field, _ in (*ranges, *(pair for part in repeated for pair in part)) if _is_range(field)), None
    )
    for k, part in enumerate(repeated):
        own = _angle(part, units)
        heading = (angle or 0.0) + k * (units.step or 0.0) if own is None else own
        yield units.printed(heading, [text for field, text in part if _is_range(field)], unit)
    common = [text for field, text in ranges if field.mount is None]
    if common:
        yield units.printed(angle, common, unit)
    for field, text in ranges:
        if field.mount is not None:
            yield units.printed(angle or 0.0, [text], unit, field.mount)


def _is_range(field: _Field) -> bool:
    return field.kind is ColumnKind.RANGE


def _angle(values: list[_Value], units: Units) -> float | None:
    return next((units.heading(text, field.unit) for field, text in values if field.kind is ColumnKind.ANGLE), None)


# CSV with a header, and JSON


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


def _pose_in(cells: Sequence[str | None], columns: PoseColumns) -> tuple[float, float, float] | None:
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
        time, pose = _time_in(cells, columns), _pose_in(cells, columns.pose)
        assumed = units.angle is None and columns.angle.unit is None
        return (replace(printed, time=time, pose=pose, degrees_assumed=assumed),)

    def read(line: str) -> Read:
        nonlocal columns, below
        if any(char.isalpha() for char in line):
            cells = split(line)
            again = names is None or columns is None or names.heading in cells
            header = columns_of(cells) if names is None else named_columns(cells, names) if again else None
            if isinstance(header, Columns) and not isinstance(parse(line, header), tuple):
                columns, below = header, True
                return HEADER
        return parse(line, columns)

    return LineFormat(read, LINE_ENDS, lambda line: isinstance(parse(line, columns), tuple))


def _time_in(cells: list[str], columns: Columns) -> float | None:
    """Return the time in a row, s; None without one."""
    if columns.time is None:
        return None
    try:
        return number_of(cells[columns.time]) * columns.second
    except ValueError:
        return None


_MOST_QUOTED = 100_000  # characters of a line; the library refuses cells that are little longer


def cells_of(line: str, commas_separate: bool = True) -> list[str]:
    """Return the cells of a line: between commas, semicolons, tabs or bars, else between spaces.

    Between semicolons, tabs or bars, a comma is that of a decimal number. A cell in quotes may contain any of them.
    """
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

    return LineFormat(read, LINE_ENDS, lambda line: isinstance(read(line), tuple))


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
    pose = _pose_in([str(value) for value in values], columns.pose)
    return None if printed is None else replace(printed, pose=pose, degrees_assumed=assumed)


_columns_of_keys = lru_cache(64)(columns_of)
_QUOTED_NUMBER = re.compile(r"([+-]?\d+(?:\.\d+)?)\s*([^\W\d_]{0,12}|°)")
_SCAN_KEYS = ("angle_min", "angle_increment", "ranges")  # of the message LaserScan, in radians and metres


def json_records(line: str) -> list[dict[str, Any]]:
    """Return the values of each reading in a JSON text by their keys; of a key in several objects, by all keys.

    A text is an object, a list of objects, or an object with a list of angles and one of ranges.
    """
    if not line.startswith(("{", "[")):
        return []
    try:
        return [*_records_in(json.loads(line))]
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


# the presets: formats of lines that many sketches and sensors print


_RADAR = re.compile(r"(?P<heading_deg>-?\d{1,3})[,*](?P<range>-?\d{1,5})", re.ASCII)
_RADAR_ENDS = re.compile(rb"[.#\0]")
ANGLE_DISTANCE = re.compile(
    r"angle\W*?(?P<heading_deg>-?\d+(?:\.\d+)?)\s*(?:°|deg(?:rees?|s)?\b)?\W*?"
    r"(?:distance|dist|range)\W*?(?P<range>-?\d+(?:\.\d+)?|out of range|no echo|nan|inf|timeout)"
    r"\s*(?P<unit>mm|cm|m|in|inch|inches|ft|feet|yd|yards?|us)?\W*",
    re.ASCII | re.IGNORECASE,
)
_MAXBOTIX = re.compile(r"R(?P<range>\d{3,4})(?P<flag> P[01])?", re.ASCII)


_MILLIMETRES = (5000.0, 9999.0)  # of a MaxBotix rangefinder without an echo


def maxbotix_format(units: Units) -> LineFormat:
    """Return the format of MaxBotix rangefinders: four digits are millimetres, three with a flag P inches."""

    def read(line: str) -> Read:
        match = _MAXBOTIX.fullmatch(line.strip())
        if match is None:
            return None
        digits = match["range"]
        silent = _MILLIMETRES if len(digits) == 4 and not units.no_echo else units.no_echo
        unit = "mm" if len(digits) == 4 else "in" if match["flag"] else None
        return _only(replace(units, no_echo=silent).printed(None, [digits], unit))

    return LineFormat(read, LINE_ENDS, lambda line: bool(_MAXBOTIX.fullmatch(line)))


@dataclass(frozen=True)
class BinaryFrame:
    """A message of a sensor that prints no text: `header`, two bytes of the range, and the sum of all bytes before.

    A message without a header has no sum either; its ranges are then within `limits`.
    """

    header: bytes
    limits: tuple[int, int] = (0, 65535)
    request: bytes = b""  # that the sensor answers with a message; empty: it sends by itself

    @property
    def size(self) -> int:
        """Bytes of a message."""
        return len(self.header) + 3 if self.header else 2

    def number(self, message: bytes) -> int | None:
        """Return the range in a message; None for other bytes."""
        start = len(self.header)
        number = int.from_bytes(message[start : start + 2], "big")
        summed = not self.header or sum(message[:-1]) & 0xFF == message[-1]
        inside = self.limits[0] <= number <= self.limits[1]
        return number if message.startswith(self.header) and summed and inside else None


@dataclass(frozen=True)
class Preset:
    """A format, and what the devices that print it have in common."""

    example: str
    make: Callable[[Units], LineFormat] | BinaryFrame
    unit: str | None = None  # of the range; None: as printed
    no_echo: tuple[float, ...] = ()  # in that unit; 0 and negative numbers always mean no echo
    board: str = ""  # name of the board profile of the usual sensor
    prints_angle: bool = True


PRESETS = {
    "arduino-radar": Preset("90,23.", lambda units: regex_format(_RADAR, units, _RADAR_ENDS), "cm", board="hc-sr04"),
    "angle-distance": Preset(
        "Angle: 90 Distance: 23 cm", lambda units: regex_format(ANGLE_DISTANCE, units), board="hc-sr04"
    ),
    "maxbotix": Preset("R0123", lambda units: maxbotix_format(units), prints_angle=False),
    "a02yyuw": Preset("the bytes FF H L SUM", BinaryFrame(b"\xff"), "mm", prints_angle=False),
    "urm37": Preset(
        "the bytes 22 H L SUM", BinaryFrame(b"\x22", request=b"\x22\0\0\x22"), "cm", (65535.0,), prints_angle=False
    ),
    "us100": Preset("the bytes H L", BinaryFrame(b"", (20, 4600), b"\x55"), "mm", prints_angle=False),
    "jsonl": Preset('{"heading_deg": 90, "range_cm": 23}', json_format),
    "csv": Preset("heading_deg,range_cm, then 90,23", csv_format),
}


@dataclass(frozen=True)
class Layout:
    """How a device prints, as the query of a URL or the options of an import state it."""

    preset: str = ""  # one of PRESETS; empty: a pattern
    pattern: str = ""
    unit: str | None = None  # of RANGE_UNITS
    angle: str | None = None  # of ANGLE_UNITS
    no_echo: tuple[float, ...] | None = None
    step: float | None = None  # degrees
    ends: str = ""  # characters between readings; empty: line ends
    columns: ColumnNames | None = None  # of the preset csv; None: by the words in the header
    scale: float | None = None  # m, unit of the ranges as a number

    @property
    def board(self) -> str:
        """Name of the board profile that suits the usual sensor, empty if unknown."""
        return PRESETS[self.preset].board if self.preset else ""

    @property
    def is_regex(self) -> bool:
        """Whether the pattern is a regular expression."""
        return "(?P<" in self.pattern or not _FIELD.search(self.pattern)

    @property
    def turns_itself(self) -> bool:
        """Whether angles whose name says clockwise are reversed while they are read."""
        return self.preset in ("csv", "jsonl")

    @property
    def example(self) -> str:
        """A line that the layout reads, or the pattern."""
        return PRESETS[self.preset].example if self.preset else self.pattern

    @property
    def frame(self) -> BinaryFrame | None:
        """The messages of a sensor that prints no text; None for text."""
        make = PRESETS[self.preset].make if self.preset else None
        return make if isinstance(make, BinaryFrame) else None

    @property
    def units(self) -> Units:
        """What the layout states about the numbers."""
        preset = PRESETS[self.preset] if self.preset else None
        no_echo = preset.no_echo if preset and self.no_echo is None else self.no_echo or ()
        unit = self.unit or (preset.unit if preset else None)
        return Units(unit, self.angle, no_echo, self.step, self.scale)

    def make_format(self, matching: "MatchingProcess | None" = None) -> LineFormat:
        """Return a fresh format of the lines. Raises InputError for an invalid pattern. `matching` matches lines."""
        units = self.units
        if self.columns is not None:
            return csv_format(units, self.columns)
        if self.preset:
            make = PRESETS[self.preset].make
            assert not isinstance(make, BinaryFrame)
            return make(units)
        ends = ends_of(self.ends) if self.ends else LINE_ENDS
        if self.is_regex:
            return regex_format(check_regex(self.pattern), units, ends, matching)
        return template_format(parse_template(self.pattern), units, ends)

    def check(self) -> None:
        """Raise InputError for settings that do not fit together."""
        if bool(self.preset) == bool(self.pattern):
            which = "give only one of them" if self.preset else f"{', '.join(PRESETS)}; {_GUESS}"
            raise InputError(f"expected preset=NAME or pattern=PATTERN: {which}")
        if self.preset and self.preset not in PRESETS:
            raise InputError(f"preset={self.preset}: expected {', '.join(PRESETS)}")
        if self.preset and self.ends:
            raise InputError("ends: only with a pattern; remove it")
        prints_angle, needs_step, states_unit = self._properties()
        if prints_angle and not needs_step and self.step is not None and self.preset not in ("csv", "jsonl"):
            raise InputError("step: the device prints its angle; remove step")
        if not prints_angle and self.step is None:
            raise InputError(
                "the device prints no angle: add step=DEGREES, the turn of the table between two readings, or from one "
                "sensor to the next"
            )
        if needs_step and self.step is None:
            raise InputError("the angle is counted in steps: add step=DEGREES, the turn of one step")
        if self.unit and states_unit:
            raise InputError("unit: the pattern names the unit already; remove one of them")

    def _properties(self) -> tuple[bool, bool, bool]:
        """Return whether readings have angles, whether these are steps, and whether the pattern states the unit."""
        if self.preset:
            return PRESETS[self.preset].prints_angle, self.angle == STEP, False
        if self.is_regex:
            groups = check_regex(self.pattern).groupindex
            return any(name.startswith("heading") for name in groups), False, any("range_" in name for name in groups)
        template = parse_template(self.pattern)
        return template.prints_angle, template.has_steps or self.angle == STEP, template.states_unit

    def with_unit(self, unit: str) -> "Layout":
        """Return the layout with this unit of the ranges."""
        return replace(self, unit=unit)


_GUESS = "`sonarhw ports --guess` proposes one"


def layout_of(values: Mapping[str, str]) -> Layout:
    """Return the layout that the keys of a URL, or the options of an import, state. Raises InputError."""
    layout = Layout(
        preset=values.get("preset", ""),
        pattern=values.get("pattern", ""),
        unit=one_of("unit", values["unit"], tuple(RANGE_UNITS)) if "unit" in values else None,
        angle=one_of("angle", values["angle"], (*ANGLE_UNITS, STEP)) if "angle" in values else None,
        no_echo=_numbers("no_echo", values["no_echo"]) if "no_echo" in values else None,
        step=_step(values["step"]) if "step" in values else None,
        ends=values.get("ends", ""),
    )
    layout.check()
    return layout


def one_of(key: str, value: str, choices: tuple[str, ...]) -> str:
    """Return a value. Raises InputError unless it is one of the choices."""
    if value not in choices:
        raise InputError(f"{key}={value}: expected {', '.join(choices)}")
    return value


def degrees_of(key: str, text: str) -> float:
    """Return degrees. Raises InputError."""
    value = _number_of_parameter(key, text)
    if abs(value) > 360:
        raise InputError(f"{key}={text}: expected degrees from -360 to 360")
    return value


def _step(text: str) -> float:
    if not 0 < (degrees := degrees_of("step", text)) <= 180:
        raise InputError(f"step={text}: expected degrees above 0, up to 180; for a clockwise turn add turn=cw")
    return degrees


def _numbers(key: str, text: str) -> tuple[float, ...]:
    return tuple(_number_of_parameter(key, part) for part in text.split(","))


def _number_of_parameter(key: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(f"{key}={text}: expected a number")
    return value
