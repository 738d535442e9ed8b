"""Patterns of the user: the text of a reading with fields in braces, such as `Angle: {deg} Dist: {cm}`, or a regular
expression."""

import json
import re
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

from sonarhw.errors import InputError
from sonarhw.text.numbers import GROUPS_TEXT, LINE_ENDS, NUMBER, PART, LineFormat, Printed, Read, Units
from sonarhw.text.tables import pose_columns, pose_in
from sonarhw.text.words import RANGE_UNITS, STEP, ColumnKind, meaning_of

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
        return None if printed is None else (replace(printed, pose=pose_in([*texts.values()], of_pose)),)

    return LineFormat(
        read, ends, lambda line: matched(line.strip()) is not None, matching.close if matching else lambda: None
    )


def check_regex(text: str) -> re.Pattern[str]:
    """Return the compiled regular expression. Raises InputError if it is invalid or lacks a range."""
    try:
        pattern = re.compile(text, re.ASCII)
    except (re.error, RecursionError, OverflowError) as error:
        raise InputError(f"pattern {text!r}: invalid regular expression: {error}") from error
    ranges = [group for group in pattern.groupindex if re.fullmatch("range(_m|_cm|_mm|_in|_ft|_yd|_us)?", group)]
    if len(ranges) != 1:
        raise InputError(
            f"pattern {text!r}: expected fields such as {{deg}},{{cm}}, or a regular expression with one group "
            "(?P<range_cm>...), or range_m, range_mm, range_in"
        )
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


FIELD = re.compile(r"\{([^{}]*)\}")
_NUMBER_TEXT = r"[+-]?(?:0x[\da-f]+|\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d+)?"
_COMMA_TEXT = rf"[+-]?(?:0x[\da-f]+|{GROUPS_TEXT}|\d+(?:[.,]\d*)?|[.,]\d+)(?:[eE][+-]?\d+)?"
_WORDS_TEXT = r"[^\W\d_][^\d,;|]*|--?-?|0"  # in place of a range with its unit
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
    separator, end = _literal(repetition[1][len(core) :], True), _piece(text, after)
    if separator:  # may be missing after the last one
        body = replace(body, text=rf"{body.text}(?:{separator}|(?=(?:{_without_groups(end.text)})?\s*$))")
    return _Line(_piece(text, part[: repetition.start()]), body, end)


def _piece(text: str, part: str, after: str = "") -> _Piece:
    """Return the expression of a part of a line, before the text `after`.

    After words for no echo, the unit may be missing. A comma next to a number is no part of it.
    """
    regex, position = "", 0
    fields: list[_Field] = []
    for match in FIELD.finditer(part):
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
    if word in _RANGE_FIELDS and (not at or NUMBER.fullmatch(mount)):
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
