"""Proposes the layout of unknown text from its words and numbers, with the evidence and what it could not decide."""

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from statistics import median

from sonarhw.text.decoder import make_decoder, text_of, unwrapped, utf16_of
from sonarhw.text.evidence import (
    BY_SWEEP,
    DEGREES_ASSUMED,
    FEWEST,
    LARGEST,
    LASER_CODES,
    REGULAR,
    Decision,
    Label,
    Question,
    angle_question,
    angle_unit,
    both_ways,
    column_roles,
    radar_roles,
    range_unit,
    silent_number,
    sweeps,
)
from sonarhw.text.layouts import ANGLE_DISTANCE, PRESETS, Layout
from sonarhw.text.numbers import GROUPS_TEXT, LINE_ENDS, Printed, ends_of, is_number, number_of, numbers_of
from sonarhw.text.patterns import parse_template
from sonarhw.text.tables import (
    ColumnNames,
    Columns,
    cells_of,
    column_names,
    columns_of,
    is_header,
    json_records,
    named_columns,
)
from sonarhw.text.words import (
    STEP,
    UNIT_NAMES,
    ColumnKind,
    NameMeaning,
    is_german,
    is_no_echo,
    meaning_of,
    unit_of_word,
    words_of,
)

MOST_LINES = 2000  # that a proposal looks at
_MOST_BYTES = 400_000
_SHARE = 0.55  # of the lines, that a layout must read
_MOST_SHOWN = 100  # rows of a table


@dataclass(frozen=True)
class LayoutProposal:
    """What text contains, as far as it can be decided."""

    layout: Layout | None = None  # None: no readings were recognised
    clockwise: bool = False
    evidence: tuple[str, ...] = ()  # how units and columns were decided
    questions: tuple[Question, ...] = ()  # what is undecided
    readings: tuple[Printed, ...] = ()  # those of the text, if nothing is undecided
    lines: int = 0  # of the text, without empty ones
    example: str = ""  # a line of the text

    @property
    def turn_assumed(self) -> bool:
        """Whether nothing says in which direction the angles grow; the sketches of the other presets are known."""
        layout = self.layout
        turns = any(reading.heading is not None for reading in self.readings)
        return turns and layout is not None and bool(layout.pattern or layout.turns_itself) and not self.clockwise

    @property
    def decided(self) -> bool:
        """Whether the layout reads the text without an answer of the user."""
        return self.layout is not None and not self.questions


NOTHING = LayoutProposal()
NAMED_CLOCKWISE = "angles grow clockwise, as named"  # evidence


def propose(
    data: bytes, begins_whole: bool = False, known: Layout | None = None, pauses: Sequence[tuple[int, float]] = ()
) -> LayoutProposal:
    """Return the proposal for the bytes of a device, or of a file (`begins_whole`).

    `known`: what the user states about units and step; its pattern and preset are not used. `pauses`: places in the
    bytes, and for how long the device paused before them, s.
    """
    stated = known or Layout()
    data = data[:_MOST_BYTES]
    if encoding := utf16_of(data):
        data, pauses = data.decode(encoding, "replace").replace("\ufeff", "").encode(), ()
    for name in ("a02yyuw", "urm37", "us100"):
        if (binary := _binary(name, data, stated)) is not None:
            return binary
    best = LayoutProposal(example=_middle(_lines(data, LINE_ENDS)))
    for ends in ("", *_other_ends(data, begins_whole)):
        lines = _lines(data, ends_of(ends) if ends else LINE_ENDS)
        if not begins_whole:
            lines = lines[1:]
        if len(lines) < 2:
            continue
        proposal = _of_lines(lines[:MOST_LINES], ends, stated, begins_whole)
        if proposal.layout is not None:
            ordered = _ordered(proposal, data, begins_whole, pauses)
            proposal = _checked(ordered, data, begins_whole)
        all_read = proposal.decided and len(proposal.readings) >= _WHOLE * len(lines)
        if not all_read and (question := _thousands_question(lines)):
            return LayoutProposal(questions=(Question(question),), example=lines[-1][:60])
        if proposal.layout is not None:
            return proposal
        if proposal.questions and not best.questions:
            best = replace(proposal, example=proposal.example or best.example)
        elif not ends and proposal.example:  # a row says more than the line above it
            best = replace(best, example=proposal.example)
    if hexadecimal := _HEXADECIMAL.search("\n".join(_lines(data, LINE_ENDS)[1:])):
        question = f"{hexadecimal[1]!r} may be hexadecimal: print decimal numbers, or 0x before hexadecimal ones"
        best = replace(best, layout=None, questions=(Question(question),))
    return best


_WHOLE = 0.97  # of the lines
_HEXADECIMAL = re.compile(
    r"(?<![^\W_])((?=[0-9]*[A-F])(?=[A-F]*[0-9])[0-9A-F]{2,4})(?![^\W_])(?:(?s:.*?)(?<![^\W_])[0-9A-F]{2,4}(?![^\W_])){3}"
)


def _thousands_question(lines: list[str]) -> str:
    """Return the question whether a mark separates thousands or numbers.

    It is empty unless a number always has three digits, and is missing in some lines or has a zero before others.
    """
    rows = [re.findall(r"\d+", line) for line in lines]
    counts = Counter(map(len, rows))
    usual = sorted(length for length, number in counts.items() if number > _FEW * len(rows))
    if not usual or usual[-1] - usual[0] != len(usual) - 1 or len(usual) > 2:
        return ""
    longer = [(row, line) for row, line in zip(rows, lines, strict=True) if len(row) == usual[-1]]
    for k in range(usual[-1] - 1):
        padded = len(usual) > 1 or (k and any(row[k + 1][0] == "0" for row, _ in longer))
        if padded and all(len(row[k + 1]) == 3 and len(row[k]) < 4 and row[k][0] != "0" for row, _ in longer):
            row, line = longer[0]
            shown = re.search(rf"{row[k]}\D{row[k + 1]}", line)
            if shown and shown[0][len(row[k])] in ", ":
                return f"{shown[0]!r} may be one number or two: print numbers without separators of thousands"
    return ""


def sweep_text(proposal: LayoutProposal) -> tuple[str, ...]:
    """Return what the layout reads, in words: angles, ranges and an example."""
    readings = proposal.readings
    if not readings:
        return ()
    headings = [reading.heading for reading in readings if reading.heading is not None]
    scales = {reading.scale for reading in readings}
    numbers = [number for reading in readings for number in reading.numbers]
    asked = {key for question in proposal.questions for answer in question.answers for key in answer}
    unit = "" if asked & {"step", "angle"} else "°"
    turned = f"angles {min(headings):g}{unit} to {max(headings):g}{unit}" if headings else "no angles"
    silent = sum(not reading.numbers for reading in readings)
    if None in scales or not numbers:
        reach = f"ranges {min(numbers, default=0):g} to {max(numbers, default=0):g}"
    else:
        ranges = [distance for reading in readings for distance in reading.ranges]
        reach = f"ranges {min(ranges):.3g} m to {max(ranges):.3g} m"
    still = "; the angle does not change" if headings and len({*headings}) == 1 and len(headings) >= 8 else ""
    shown = f"{len(readings)} readings, {turned}, {reach}, {silent} without an echo{still}"
    return (shown, f"such as {proposal.example!r}") if proposal.example else (shown,)


def _middle(lines: Sequence[str]) -> str:
    """Return a line that is neither a banner nor torn, shortened; an empty text without lines."""
    return lines[len(lines) // 2][:_MOST_QUOTED] if lines else ""


_MOST_QUOTED = 60  # characters


def _lines(data: bytes, ends: re.Pattern[bytes]) -> list[str]:
    texts = (text_of(raw)[0] for raw in ends.split(data))
    return [plain for text in texts if text and (plain := unwrapped(text).strip(" ")).strip()]


_ENDS = ".#;!$>)]}|/&~* "  # characters that may separate readings, the most usual first
_MOST_SHORT = 80  # characters of a line of one reading


def _other_ends(data: bytes, begins_whole: bool) -> list[str]:
    """Return characters that may separate readings in text with few line ends, the likely ones first.

    A whole text ends with the one that does.
    """
    lengths = sorted(len(raw) for raw in LINE_ENDS.split(data) if raw)
    if len(lengths) >= 2 * FEWEST and lengths[len(lengths) // 2] <= _MOST_SHORT:
        return []
    counts = Counter(chr(byte) for byte in data if chr(byte) in _ENDS)
    last = data.strip(b"\r\n")[-1:].decode("latin-1") if begins_whole else ""
    frequent = [mark for mark, number in counts.most_common(4) if number >= 3]
    return sorted(frequent, key=lambda mark: (mark != last, _ENDS.index(mark)))


def _binary(name: str, data: bytes, stated: Layout) -> LayoutProposal | None:
    """Return the proposal of a binary preset, if most bytes are its messages."""
    preset = PRESETS[name]
    layout = replace(stated, preset=name, pattern="", ends="")
    assert layout.frame is not None
    decoder = make_decoder(layout)
    readings = decoder.feed(data)
    ranges = [number for reading in readings for number in reading.numbers]
    varies = _is_smooth(ranges) if not layout.frame.header else bool(ranges)  # without a header nothing else shows it
    if len(readings) < FEWEST or len(readings) * layout.frame.size < 0.8 * len(data) or not varies:
        return None
    evidence = (f"binary messages of {name} ({preset.example}), range in {UNIT_NAMES[preset.unit or 'mm']}",)
    return LayoutProposal(layout, False, evidence, _step_question(stated, 1), tuple(readings), len(readings))


def _is_smooth(ranges: Sequence[float]) -> bool:
    """Return whether ranges change, mostly by little."""
    changes = [abs(after - before) for before, after in pairwise(ranges)]
    return any(changes) and median(changes) < _SMOOTH * median(ranges)


_SMOOTH = 0.2


def _step_question(stated: Layout, sensors: int) -> tuple[Question, ...]:
    if stated.step is not None:
        return ()
    turn = "the turn of the table between two readings"
    if sensors > 1:
        even = f" ({360 / sensors:g} if they are evenly spaced around a circle)" if sensors <= 24 else ""
        turn = f"the turn from one of the {sensors} numbers of a line to the next{even}"
    return (Question(f"no angle is printed; DEGREES is {turn}", ({"step": "DEGREES"},)),)


_Order = tuple[list[Printed], bool | None]  # the readings, and whether the pauses agree with the order


def _ordered(
    proposal: LayoutProposal, data: bytes, begins_whole: bool, pauses: Sequence[tuple[int, float]]
) -> LayoutProposal:
    """Return a proposal of several lines a reading with the order of lines that the text shows, or with the question.

    The pauses of the device show it, or a sweep forwards that is like the one backwards, or the start of a whole text.
    """
    layout = proposal.layout
    assert layout is not None
    parts = layout.pattern.split("\\n")
    if len(parts) < 2:
        return proposal
    turned = [replace(layout, pattern="\\n".join([*parts[k:], *parts[:k]])) for k in range(len(parts))]
    read = [_read_in_order(order, data, begins_whole, pauses) for order in turned]
    by_pauses = next((k for k, (_, agree) in enumerate(read) if agree), None)
    by_sweeps = _most_alike([both_ways(readings) for readings, _ in read])
    best = by_sweeps if by_sweeps is not None else by_pauses
    why = "the device pauses before it" if by_sweeps is None else "sweeps forwards and backwards are then alike"
    if best is None and begins_whole and _begins_with_angle(layout):
        best, why = 0, "the first of the text"
    if best is None or (by_sweeps is not None and by_pauses not in (None, by_sweeps)):
        orders = tuple({"pattern": order.pattern} for order in turned[:2])
        question = Question("a reading may begin with each of its lines", orders)
        return replace(proposal, questions=(*proposal.questions, question))
    begins = f"a reading begins with the line {turned[best].pattern.split(chr(92) + 'n')[0]!r}: {why}"
    return replace(proposal, layout=turned[best], evidence=(begins, *proposal.evidence))


def _most_alike(differences: Sequence[float]) -> int | None:
    """Return the order in which sweeps forwards and backwards differ clearly least; None without one."""
    least = min(differences)
    others = [difference for difference in differences if difference > least]
    return differences.index(least) if others and least < _ALIKE * min(others) else None


_ALIKE = 0.5  # of the differences in the other order


def _read_in_order(layout: Layout, data: bytes, begins_whole: bool, pauses: Sequence[tuple[int, float]]) -> _Order:
    decoder = make_decoder(replace(layout, step=layout.step or 1.0) if layout.angle == STEP else layout, begins_whole)
    starts = [(0, 0.0), *((start, pause) for start, pause in pauses if 0 < start < len(data))]
    ends = [*(start for start, _ in starts[1:]), len(data)]
    pieces = zip(starts, ends, strict=True)
    readings = [printed for (start, pause), end in pieces for printed in decoder.feed(data[start:end], pause)]
    return readings, decoder.pauses.agree


def _begins_with_angle(layout: Layout) -> bool:
    return parse_template(layout.pattern).fields[0].kind is ColumnKind.ANGLE


def _checked(proposal: LayoutProposal, data: bytes, begins_whole: bool) -> LayoutProposal:
    """Return the proposal with the readings that its layout gives, or without a layout if it reads too little."""
    layout = proposal.layout
    assert layout is not None
    trial = layout if layout.step is not None else replace(layout, step=1.0)
    decoder = make_decoder(trial, begins_whole)
    readings = [*decoder.feed(data), *decoder.end()]
    others = decoder.ignored.total()
    least = 1 if begins_whole and layout.preset == "csv" else FEWEST  # whose header names the columns
    if len(readings) < least or len(readings) < others * _SHARE:
        return replace(proposal, layout=None)
    proposal = replace(proposal, readings=tuple(readings))
    if (silent := _silent_in(proposal)) is not None:
        said = f"{silent:g} taken for no echo, because no board measures so far; no_echo= changes it"
        if silent in LASER_CODES:
            said += "; a laser ranger measures the nearest wall, as `sonarhw compare LOG --model nearest` predicts"
        read = replace(layout, no_echo=(silent,))
        return _checked(replace(proposal, layout=read, evidence=(*proposal.evidence, said)), data, begins_whole)
    if DEGREES_ASSUMED in proposal.evidence:
        named = not any(fact.endswith(BY_SWEEP) for fact in proposal.evidence)
        question = angle_question([reading.heading or 0.0 for reading in readings], begins_whole, named)
        proposal = replace(proposal, questions=tuple(filter(None, (*proposal.questions, question))))
    return proposal


def _silent_in(proposal: LayoutProposal) -> float | None:
    """Return the number of no echo in text whose unit is decided, which no board can measure; None without one."""
    layout, scales = proposal.layout, {reading.scale for reading in proposal.readings if reading.numbers}
    if layout is None or layout.no_echo is not None or layout.frame or len(scales) != 1:
        return None
    silent = silent_number([number for reading in proposal.readings for number in reading.numbers])
    (scale,) = scales
    is_code = silent in LASER_CODES or (silent is not None and scale is not None and silent * scale > LARGEST)
    return silent if is_code else None


# one kind of line after the other


def _of_lines(lines: list[str], ends: str, stated: Layout, begins_whole: bool) -> LayoutProposal:
    if stated.columns is not None:
        return LayoutProposal() if ends else _of_named(lines, stated, stated.columns)
    in_order = partial(_numbers, begins_whole=begins_whole)
    for recognise in (_maxbotix, _json, partial(_header, begins_whole=begins_whole), in_order):
        proposal = recognise(lines, ends, stated)
        if proposal.layout is not None or proposal.questions:
            return proposal
    return LayoutProposal(example=_middle(lines))


_MAXBOTIX = re.compile(r"R(\d{3,4})( P[01])?")
_MODEL = re.compile(r"(?:PN:\s*)?MB(\d{4})")
_MODELS = (
    ("10[0-4]", "in"),
    ("10[0-9]", "in"),
    ("12", "cm"),
    ("70", "cm"),
    ("7366", "cm"),
    ("7388", "cm"),
    ("73", "mm"),
)
_MODELS_MM = ("1003", "1013", "1023", "1033", "1043", "1603", "1613", "1623", "1633", "1643")


def _maxbotix(lines: list[str], ends: str, stated: Layout) -> LayoutProposal:
    """Recognise the rangefinders of MaxBotix. Their unit follows from the model, the digits or the proximity flag."""
    matches = [match for line in lines if (match := _MAXBOTIX.fullmatch(line))]
    if ends or len(matches) < max(FEWEST, _SHARE * len(lines)):
        return LayoutProposal()
    numbers = [float(match[1]) for match in matches]
    model = next((match[1] for line in lines if (match := _MODEL.search(line))), None)
    digits = {len(match[1]) for match in matches}
    layout = replace(stated, preset="maxbotix", pattern="", ends="")
    unit, why = _unit_of_maxbotix(model, digits, any(match[2] for match in matches), max(numbers), stated)
    either = "three digits are centimetres (XL models) or inches (LV models)"
    questions = () if unit else (Question(either, ({"unit": "cm"}, {"unit": "in"})),)
    evidence = (f"range in {UNIT_NAMES[unit]}: {why}",) if why and unit else ()
    return LayoutProposal(
        replace(layout, unit=unit), False, evidence, (*questions, *_step_question(stated, 1)), lines=len(lines)
    )


def _unit_of_maxbotix(
    model: str | None, digits: set[int], flagged: bool, most: float, stated: Layout
) -> tuple[str | None, str]:
    """Return the unit of a rangefinder and the reason; no unit if it may be two."""
    if stated.unit is not None:
        return stated.unit, "as given"
    if model is not None and (unit := _unit_of_model(model)):
        return unit, f"model MB{model}"
    if digits == {4}:
        return "mm", "four digits"
    if flagged:
        return "in", "the proximity flag P of the inch models"
    if most > 254:
        return "cm", "three digits above 254, the most of the inch models"
    return None, ""


def _unit_of_model(model: str) -> str | None:
    if model in _MODELS_MM:
        return "mm"
    matching = [unit for start, unit in _MODELS if re.match(start, model)]
    return ("cm" if model in ("7366", "7388") else matching[0]) if matching else None


def _json(lines: list[str], ends: str, stated: Layout) -> LayoutProposal:
    per_line = [json_records(line) for line in lines]
    records = [record for of_line in per_line for record in of_line]
    if ends or len(records) < FEWEST or sum(map(bool, per_line)) < _SHARE * len(lines):
        return LayoutProposal()
    keys = [*records[len(records) // 2]]
    columns = columns_of(keys)
    if not isinstance(columns, Columns):
        reason = columns or "expected one key with a name of an angle and one of a range"
        question = Question(f"keys {', '.join(map(str, keys))}: {reason}; write a pattern=")
        return LayoutProposal(None, questions=(question,), example=lines[0][:60])
    heading, distance = keys[columns.heading], keys[columns.ranges[0]]
    values = [[record.get(heading), record.get(distance)] for record in records]
    numbers = [
        [float(cell) for cell in column if isinstance(cell, int | float)] for column in zip(*values, strict=True)
    ]
    layout = replace(stated, preset="jsonl", pattern="", ends="")
    angle, reach = angle_unit(numbers[0], columns.angle, stated), range_unit(numbers[1], columns.range, stated)
    layout = replace(
        layout, unit=reach.unit if reach.assumed else stated.unit, angle=angle.unit if angle.assumed else stated.angle
    )
    return _joined(layout, columns.angle.clockwise, angle, reach, lines)


def _joined(
    layout: Layout, clockwise: bool, angle: Decision, reach: Decision, lines: list[str], *evidence: str
) -> LayoutProposal:
    facts = (*evidence, angle.evidence, reach.evidence, NAMED_CLOCKWISE if clockwise else "")
    asked = (angle.question, reach.question)
    return LayoutProposal(
        layout,
        clockwise,
        tuple(filter(None, facts)),
        tuple(filter(None, asked)),
        lines=len(lines),
        example=lines[len(lines) // 2][:60],
    )


def _of_named(lines: list[str], stated: Layout, names: ColumnNames) -> LayoutProposal:
    """Return the proposal for columns that the user names: in metres, unless name or numbers exclude these."""
    cut = [cells_of(line, not names.decimal_comma) for line in lines]
    columns = [named_columns(cells, names) for cells in cut]
    first = next((number for number, read in enumerate(columns) if read is not None), None)
    if first is None or (read := columns[first]) is None:
        return LayoutProposal(example=lines[0][:60])
    rows = [cells[: read.count] for cells in cut[first:] if len(cells) >= read.count]
    named = names.heading in cut[first]
    angle = angle_unit(_column(rows, read.heading), read.angle, stated)
    numbers = _column(rows, read.ranges[0])
    reach = range_unit(numbers, read.range, stated, lines[first : first + 1])
    if reach.question and {"unit": "m"} in reach.question.answers and max(numbers, default=0) <= LARGEST:
        reach = Decision("m", True, "range in metres, because no unit is stated; unit= changes it")
    layout = replace(stated, preset="csv", pattern="", ends="", unit=reach.unit, angle=angle.unit)
    columns_read = f"columns {names.heading!r} and {names.range!r}"
    where = f"{columns_read} below {lines[first]!r}" if named else columns_read
    return _joined(layout, read.angle.clockwise, angle, reach, lines, where)


@dataclass(frozen=True)
class TextTable:
    """The columns of a text."""

    names: tuple[str, ...]  # those of its header, else column 1 and so on
    rows: tuple[tuple[str, ...], ...]  # the first ones
    header: str = ""  # the line; empty without one


def text_table(data: bytes, decimal_comma: bool = False, names: Sequence[str] = ()) -> TextTable | None:
    """Return the columns of a text; None if most of its lines are no rows of one table.

    A line that contains all `names` is the header.
    """
    data = data[:_MOST_BYTES]
    if encoding := utf16_of(data):
        data = data.decode(encoding, "replace").replace("\ufeff", "").encode()
    lines = _lines(data, LINE_ENDS)[:MOST_LINES]
    cut = [cells_of(line, not decimal_comma) for line in lines]
    headers = ((k, cut[k + 1 :]) for k, cells in enumerate(cut) if names and all(map(cells.count, names)))
    for number, rows in (*headers, *_headers(lines, cut)):
        return TextTable(tuple(cut[number]), tuple(map(tuple, rows[:_MOST_SHOWN])), lines[number])
    counts = Counter(len(cells) for cells in cut if len(cells) > 1 and _is_row(cells, len(cells)))
    if not counts or (most := counts.most_common(1)[0])[1] < _SHARE * len(lines):
        return None
    rows = [cells for cells in cut if _is_row(cells, most[0])]
    return TextTable(column_names(most[0]), tuple(map(tuple, rows[:_MOST_SHOWN])))


def _headers(lines: list[str], cut: list[list[str]]) -> Iterator[tuple[int, list[list[str]]]]:
    """Yield the lines that may be headers, and the rows below."""
    for number in range(len(lines) - 1):
        cells, below = cut[number], cut[number + 1 :]
        if not is_header(cells):
            continue
        rows = [row for row in below if _is_row(row, len(cells))]
        if len(rows) >= max(min(FEWEST, len(below)), _SHARE * len(below)):
            yield number, rows


def _is_row(cells: Sequence[str], count: int) -> bool:
    """Return whether these are cells of a reading: two numbers, or a number and no echo; empty ones may follow."""
    if len(cells) < count or any(cells[count:]):
        return False
    numbers = sum(map(is_number, cells))
    return numbers >= 2 or (numbers == 1 and any(not cell or is_no_echo(cell) for cell in cells))


def _header(lines: list[str], ends: str, stated: Layout, begins_whole: bool) -> LayoutProposal:
    """Recognise CSV with a header line that names both columns."""
    if ends:
        return LayoutProposal()
    unnamed = LayoutProposal()
    cut = [cells_of(line) for line in lines]
    for number, rows in _headers(lines, cut):
        line, cells = lines[number], cut[number]
        columns = columns_of(cells)
        if isinstance(columns, str):
            asked = Question(f"header {line!r}: {columns}; write a pattern=, or name the columns")
            return LayoutProposal(None, questions=(asked,), example=line[:60])
        if columns is not None:
            return _with_header(lines, line, cells, columns, rows, stated, begins_whole)
        if unnamed.layout is None:  # words that may be those of a banner
            named = [meaning_of(cell) for cell in cells]
            unnamed = _numbers(lines[number + 1 :], "", stated, named, line, begins_whole)
    return unnamed if unnamed.layout or not begins_whole else _single_column(lines, stated)


def _single_column(lines: list[str], stated: Layout) -> LayoutProposal:
    """Recognise the single column of a file whose header names it a range; the angles are counted."""
    for number, line in enumerate(lines[:-1]):
        meaning = meaning_of(line)
        if meaning.quantity is ColumnKind.RANGE and not any(map(str.isdigit, line)) and is_number(lines[number + 1]):
            below = lines[number + 1 :]
            return _numbers(below, "", stated, [meaning], line, True) if line not in below else LayoutProposal()
    return LayoutProposal()


def _with_header(
    lines: list[str],
    header: str,
    cells: list[str],
    columns: Columns,
    rows: list[list[str]],
    stated: Layout,
    begins_whole: bool,
) -> LayoutProposal:
    numbers = [_column(rows, k) for k in (columns.heading, columns.ranges[0])]
    angle = angle_unit(numbers[0], columns.angle, stated)
    reach = range_unit(numbers[1], columns.range, stated, (header,))
    lines_below = lines[lines.index(header) + 1 :]
    in_order = len(cells) == 2 and columns.heading == 0
    if begins_whole or lines.count(header) > 1:
        layout = replace(
            stated,
            preset="csv",
            pattern="",
            ends="",
            unit=reach.unit if reach.assumed else stated.unit,
            angle=angle.unit if angle.assumed else stated.angle,
        )
    elif in_order and not columns.angle.clockwise and (angle.unit or "deg") != STEP:
        # the header may have passed when the device is opened again
        layout = replace(
            stated,
            preset="csv",
            pattern="",
            ends="",
            unit=reach.unit,
            angle=angle.unit if angle.unit != "deg" else stated.angle,
        )
    else:
        layout = _pattern_of_columns(lines_below, columns, angle, reach, stated)
    return _joined(layout, columns.angle.clockwise, angle, reach, lines, f"header {header!r}")


def _pattern_of_columns(lines: list[str], columns: Columns, angle: Decision, reach: Decision, stated: Layout) -> Layout:
    example = next((line for line in lines if len(cells_of(line)) == columns.count), "")
    separator = next((mark for mark in ";\t|," if mark in example), " ")
    quoted = '"' if example.count('"') >= 2 * columns.count else ""
    fields = ["{-}"] * columns.count
    fields[columns.heading] = f"{{{angle.unit or 'angle'}}}"
    fields[columns.ranges[0]] = "{range}" if reach.unit is None or reach.assumed or stated.unit else f"{{{reach.unit}}}"
    unit = stated.unit or (reach.unit if reach.assumed else None)
    return replace(
        stated,
        preset="",
        pattern=separator.join(f"{quoted}{field}{quoted}" for field in fields),
        unit=unit,
        angle=None,
        ends="",
    )


def _column(rows: Iterable[Sequence[str]], k: int) -> list[float]:
    return numbers_of([row[k] for row in rows if is_number(row[k])])


# lines of words and numbers


_NUMBER = re.compile(r"(?<![^\W_])(?:(?<![\d.])[+-])?(?:0[xX][\dA-Fa-f]+|\d+(?:\.\d+)?|\.\d+)(?:[eE][+-]?\d+)?(?!\d)")
_COMMA_NUMBER = re.compile(rf"(?<![^\W_])(?:(?<![\d.])[+-])?(?:{GROUPS_TEXT}|\d+(?:[.,]\d+)?)(?!\d)")
_GLUED_NUMBER = re.compile(r"(?:(?<![\d.])[+-])?\d+(?:\.\d+)?")  # to letters: A90D23
_SILENT_WORDS = re.compile(r"[^\W\d_][^\d,;|:=]*|--?-?")


@dataclass(frozen=True)
class _Tokens:
    """A line as literals and the numbers between them."""

    literals: tuple[str, ...]  # one more than numbers
    numbers: tuple[str, ...]

    @property
    def shape(self) -> tuple[str, ...]:
        """The literals without differences in spaces."""
        return tuple(re.sub(r"\s+", " ", literal) for literal in self.literals)


def _tokens(line: str, number: re.Pattern[str]) -> _Tokens:
    literals, numbers, position = [], [], 0
    for match in number.finditer(line):
        literals.append(line[position : match.start()])
        numbers.append(match[0])
        position = match.end()
    return _Tokens((*literals, line[position:]), tuple(numbers))


def _numbers(
    lines: list[str],
    ends: str,
    stated: Layout,
    named: list[NameMeaning] | None = None,
    header: str = "",
    begins_whole: bool = False,
) -> LayoutProposal:
    """Recognise lines of words and numbers: by their words, and by the numbers where there are none."""
    best = LayoutProposal()
    for number in (_COMMA_NUMBER, _NUMBER, _GLUED_NUMBER):
        tokens = [_tokens(line, number) for line in lines]
        if number is _COMMA_NUMBER and not _has_decimal_commas(tokens, lines):
            continue
        for group in _records(tokens, begins_whole):
            proposal = _of_records(group, lines, ends, stated, named, header)
            if proposal.layout is not None and proposal.layout.prints_angle:
                return proposal
            if (proposal.layout and not best.layout) or (proposal.questions and not best.questions):
                best = proposal
    return best


def _has_decimal_commas(tokens: list[_Tokens], lines: list[str]) -> bool:
    votes = Counter(map(_commas, tokens))
    pairs = [[number_of(text) for text in _tokens(line, _NUMBER).numbers[::2]] for line in lines[:3]]
    is_sweep = any(len(firsts) > 2 * FEWEST and sweeps(firsts) >= REGULAR for firsts in pairs)  # 0,120;5,121;10,121
    return votes[1] > _FEW * len(lines) >= votes[-1] and not is_sweep


_FEW = 0.1  # of the lines


def _commas(line: _Tokens) -> int:
    """Return 1 if commas are within numbers, -1 if they separate them, and 0 without commas.

    Where a comma is within a number, other characters separate the numbers. A decimal point would be one of them.
    """
    between = line.literals[1:-1]
    if any(text.strip()[:1] == "," or text == "." for text in between):
        return -1
    return 1 if any("," in text for text in line.numbers) else 0


@dataclass(frozen=True)
class _Records:
    """Readings of the same shape; each has `height` lines."""

    rows: list[list[_Tokens]]
    height: int
    prefixed: bool = False  # whether another word stands before some lines, as `S` at the start of a turn

    @property
    def literals(self) -> tuple[str, ...]:
        """The literals of a reading; line ends are in them."""
        parts: list[str] = [""]
        usual = min(self.rows, key=lambda row: len(row[0].literals[0])) if self.prefixed else self.rows[0]
        for k, line in enumerate(usual):
            literals = list(line.literals)
            parts[-1] += ("\n" if k else "") + literals[0]
            parts += literals[1:]
        return tuple(parts)

    def column(self, k: int) -> list[float]:
        """Return the numbers of a column."""
        texts = [[text for line in row for text in line.numbers][k] for row in self.rows]
        return numbers_of(texts)


def _records(tokens: list[_Tokens], begins_whole: bool) -> list[_Records]:
    """Return how lines may be grouped to readings, the likely one first."""
    counts = Counter(line.shape for line in tokens if line.numbers)
    if not counts:
        return []
    shape, most = counts.most_common(1)[0]
    total = sum(counts.values())
    variants = {other for other in counts if shape[0].strip() and _is_prefixed(other, shape)}
    alone = _Records([[line] for line in tokens if line.shape in (shape, *variants)], 1, prefixed=bool(variants))
    groups = []
    if most < 0.7 * total:
        repeated = [_repeated(tokens, counts, height, begins_whole) for height in (2, 3, 4)]
        possible = [group for group in repeated if group is not None]
        groups += sorted(possible, key=lambda group: -len(group.rows) * group.height)[:1]
    if most >= FEWEST or len(shape) > 8:
        groups.append(alone)
    return groups


def _is_prefixed(shape: tuple[str, ...], usual: tuple[str, ...]) -> bool:
    """Return whether a line is the usual one after another word: `S theta:` and `theta:`."""
    return shape != usual and shape[1:] == usual[1:] and shape[0].endswith(f" {usual[0].strip()} ")


def _repeated(
    tokens: list[_Tokens], counts: Counter[tuple[str, ...]], height: int, begins_whole: bool
) -> _Records | None:
    """Return readings of `height` lines each, if lines of different shapes follow each other in turn."""
    lines = [line for line in tokens if line.numbers or _is_silence(line)]
    usual = {shape for shape, count in counts.items() if count >= max(2, 0.1 * sum(counts.values()) / height)}
    windows = Counter(
        tuple(line.shape for line in lines[k : k + height])
        for k in range(len(lines) - height + 1)
        if all(line.shape in usual for line in lines[k : k + height])
        and len({line.shape for line in lines[k : k + height]}) == height
    )
    if not windows:
        return None
    shapes = _first_of_cycle(lines, windows, begins_whole)
    rows, k = [], 0
    while k + height <= len(lines):
        if tuple(line.shape for line in lines[k : k + height]) == shapes:
            rows.append(lines[k : k + height])
            k += height
        else:
            k += 1
    if len(rows) < FEWEST or len(rows) * height < 0.5 * len(lines):
        return None
    return _Records(rows, height)


def _is_silence(line: _Tokens) -> bool:
    words = line.literals[0].rpartition(":")[2].strip()
    return is_no_echo(words) and bool(words)


def _first_of_cycle(
    lines: list[_Tokens], windows: Counter[tuple[tuple[str, ...], ...]], begins_whole: bool
) -> tuple[tuple[str, ...], ...]:
    """Return the order of lines in a reading: as a whole text begins; else the angle first, as most sketches print."""
    common = windows.most_common(1)[0][1]
    candidates = [shapes for shapes, count in windows.items() if count >= 0.7 * common]

    def rank(shapes: tuple[tuple[str, ...], ...]) -> tuple[bool, bool]:
        first = _phrase(shapes[0][0], ())
        return begins_whole and lines[0].shape == shapes[0], first.quantity is ColumnKind.ANGLE

    return max(candidates, key=rank)


def _phrase(text: str, german_words: Iterable[str]) -> NameMeaning:
    """Return what the words before a number say: the last one with a meaning decides."""
    words = words_of(text)
    german = is_german([*words, *german_words])
    for k in range(len(words) - 1, -1, -1):
        meaning = meaning_of(" ".join(words[k:]), german)
        if meaning.quantity in (ColumnKind.ANGLE, ColumnKind.RANGE, ColumnKind.UNSUPPORTED) and len(words[k]) > 1:
            return meaning
    whole = meaning_of(" ".join(words), german)
    return whole


_SUFFIX = re.compile(r"\s*§?([^\W\d_]+|[°º\"'])(?![^\W\d_])\.?\s*([:=]?)")


def _labels(literals: Sequence[str], named: list[NameMeaning] | None) -> list[Label]:
    for mark in "'\"":  # of feet and inches directly after their numbers, else a quote
        if any(mark in (literal[1:] if k else literal) for k, literal in enumerate(literals)):
            literals = [literal.replace(mark, " ") for literal in literals]
    words = [word for literal in literals for word in words_of(literal)]
    german = is_german(words)
    starts: list[str] = list(literals)  # what remains of a literal after the unit of the number before
    suffixes: list[NameMeaning] = [NameMeaning()] * len(literals)
    letters = _names_precede(literals)
    for k in range(len(literals) - 1, 0, -1):
        match = _SUFFIX.match(literals[k].split("\n")[0])
        if letters or match is None or (unit := unit_of_word(match[1], german)).quantity is None:
            continue
        after = suffixes[k + 1].quantity if k + 1 < len(literals) else None
        if not match[2] or after not in (None, unit.quantity):  # '63 deg: 145 cm': 'deg' is not the name of 145
            suffixes[k] = unit
            starts[k] = literals[k][match.end() :]
    labels = []
    for k in range(len(literals) - 1):
        key = named[k] if named and k < len(named) else _phrase(starts[k], words)
        if letters and len(starts[k].strip()) == 1 and key.quantity not in (ColumnKind.ANGLE, ColumnKind.RANGE):
            key = NameMeaning()  # 'X90V120' is neither a coordinate nor a voltage
        # as 'tilt 12 cm 45', in which each word may be the name of the number after it
        suffix, apart = suffixes[k + 1], _is_word_between(literals, k + 1)
        unclear = not named and key.quantity is None and bool(words_of(starts[k])) and apart
        between = literals[k + 1].strip() if unclear and suffix.quantity is not None else ""
        if key.quantity is ColumnKind.ANGLE and suffix.quantity is ColumnKind.RANGE and not apart:
            between = f"{starts[k].strip()}…{literals[k + 1].strip()}"
        if key.quantity in (ColumnKind.TIME, ColumnKind.OTHER) and suffix.unit is not None and not apart:
            key = NameMeaning()  # 'S1: 23cm' is no time
        labels.append(Label(_combined(key, suffix), bool(words_of(starts[k])), between))
    return labels


def _names_precede(literals: Sequence[str]) -> bool:
    """Return whether a word directly precedes each number, and none follows the last one: X90V120."""
    return all(re.fullmatch(r"\s*[^\W\d_]+", literal) for literal in literals[:-1]) and not words_of(literals[-1])


def _is_word_between(literals: Sequence[str], k: int) -> bool:
    """Return whether a word alone, between blanks, separates two numbers."""
    return k < len(literals) - 1 and re.fullmatch(r"\s+[^\W\d_]+\s+", literals[k]) is not None


def _combined(key: NameMeaning, suffix: NameMeaning) -> NameMeaning:
    """Return what a key before and a unit after a number say together."""
    if suffix.quantity is None or key.quantity in (ColumnKind.TIME, ColumnKind.OTHER):
        return key
    if key.quantity is None or (key.quantity is suffix.quantity and suffix.unit is not None):
        return replace(suffix, clockwise=key.clockwise)
    if suffix.quantity is ColumnKind.UNSUPPORTED or suffix.doubtful:
        return suffix
    return key


def _clock(records: _Records) -> set[int]:
    """Return the columns of hours, minutes and seconds: 14:02:07."""
    literals = [literal.strip() for literal in records.literals]
    rows = [[text for line in row for text in line.numbers] for row in records.rows]
    starts = [k for k in range(len(literals) - 3) if literals[k + 1] == literals[k + 2] == ":"]
    of_clock = [k for k in starts if all(_MINUTES.match(row[k + 1]) and _MINUTES.match(row[k + 2]) for row in rows)]
    return {k + place for k in of_clock for place in range(3)}


_MINUTES = re.compile(r"[0-5]\d(?:[.,]|$)")


def _of_records(
    records: _Records, lines: list[str], ends: str, stated: Layout, named: list[NameMeaning] | None, header: str
) -> LayoutProposal:
    literals = records.literals
    count = len(literals) - 1
    if count == 0 or len(records.rows) < (1 if count > 8 else FEWEST):
        return LayoutProposal()
    if records.height == 1 and count >= 6 and not named and (ring := _ring(records, lines, ends, stated)) is not None:
        return ring
    if count > 12:
        return LayoutProposal()
    example, clock = lines[len(lines) // 2][:60], _clock(records)
    labels = [
        Label(NameMeaning(ColumnKind.TIME), True) if k in clock else label
        for k, label in enumerate(_labels(literals, named))
    ]
    if between := next((label.between for label in labels if label.between), ""):
        either = "a name or the unit of an angle or of a range"
        if "…" not in between:
            either = "the unit of the number before it or the name of the one after it"
        question = Question(f"{example!r}: {between!r} is {either}; write a pattern=")
        return LayoutProposal(None, questions=(question,), lines=len(lines))
    columns = [records.column(k) for k in range(count)]
    roles = radar_roles(literals, columns, ends) or column_roles(columns, labels)
    if isinstance(roles, str):
        return LayoutProposal(None, questions=(Question(roles),), lines=len(lines), example=example)
    heading, ranges, evidence = roles
    if len(ranges) > 1 and (heading is None or any(labels[k].named for k in ranges[1:])):
        unit = Decision(labels[ranges[0]].meaning.unit)
        pattern = _pattern(literals, heading, ranges, Decision(None), unit, stated)
        field = unit.unit or "range"
        asked = (
            f"{example!r}: several ranges may be those of several sensors or echoes; write pattern=, for sensors with "
            f"the direction of each in place of DEG: pattern={pattern.replace(f'{{{field}}}', f'{{{field}@DEG}}')}"
        )
        return LayoutProposal(None, questions=(Question(asked),), lines=len(lines), example=example)
    numbers = [number for k in ranges for number in columns[k]]
    reach = range_unit(numbers, labels[ranges[0]].meaning, stated, (header, *literals))
    units = {labels[k].meaning.unit for k in ranges}
    if len(units) > 1:
        return LayoutProposal(None, questions=(Question(f"{example!r}: ranges in several units; write a pattern="),))
    facts = [f"header {header!r}"] if header else []
    if heading is None:
        angle, clockwise = Decision(None), False
    else:
        angle = angle_unit(columns[heading], labels[heading].meaning, stated)
        clockwise = labels[heading].meaning.clockwise
    pattern = ("{text}" if records.prefixed else "") + _pattern(literals, heading, ranges, angle, reach, stated)
    layout = _with_pattern(stated, pattern, reach, angle, ends)
    layout = _as_preset(layout, lines, reach, angle)
    if layout.preset == "arduino-radar" and stated.unit is None:
        reach = Decision(
            "cm", False, "range in centimetres: the sketch that separates readings by '.' or '#' prints them"
        )
        angle = replace(angle, evidence="")
    proposal = _joined(layout, clockwise, angle, reach, lines, *facts, *evidence)
    if heading is None:
        proposal = replace(proposal, questions=(*proposal.questions, *_step_question(stated, 1)))
    return proposal


def _pattern(
    literals: Sequence[str],
    heading: int | None,
    ranges: Sequence[int],
    angle: Decision,
    reach: Decision,
    stated: Layout,
) -> str:
    text = _escaped(literals[0].lstrip())
    for k in range(len(literals) - 1):
        if k == heading:
            text += "{angle}" if angle.unit is None or angle.assumed or stated.angle else f"{{{angle.unit}}}"
        elif k in ranges:
            text += "{range}" if reach.unit is None or reach.assumed or stated.unit else f"{{{reach.unit}}}"
        else:
            text += "{-}"
        last = k == len(literals) - 2
        text += _escaped(literals[k + 1].rstrip() if last else literals[k + 1])
    return text


def _escaped(text: str) -> str:
    return text.replace("\n", "\\n")


def _as_preset(layout: Layout, lines: list[str], reach: Decision, angle: Decision) -> Layout:
    """Return the layout as a preset where one reads the same lines."""
    if layout.pattern + layout.ends in ("{deg},{range}.", "{deg}*{range}.", "{deg},{range}#", "{deg}*{range}#"):
        return replace(layout, preset="arduino-radar", pattern="", ends="", unit=None)
    if reach.unit is not None and sum(bool(ANGLE_DISTANCE.fullmatch(line)) for line in lines) >= 0.8 * len(lines):
        return replace(layout, preset="angle-distance", pattern="")
    if (
        layout.pattern in ("{deg},{range}", "{angle},{range}", "{deg} {range}", "{deg};{range}", "{deg}\t{range}")
        and not layout.ends
    ):
        return replace(layout, preset="csv", pattern="")
    return layout


# many numbers in a line: rings of sensors, whole sweeps


def _ring(records: _Records, lines: list[str], ends: str, stated: Layout) -> LayoutProposal | None:
    """Recognise lines in which one or two numbers repeat; None if nothing repeats."""
    tokens = [row[0] for row in records.rows]
    literals = records.literals
    count = len(literals) - 1
    for skipped in (0, 1, 2):
        for width in (1, 2):
            if (count - skipped) % width or (count - skipped) // width < 4:
                continue
            inner = [literal.strip() for literal in literals[skipped + 1 : count]]
            if any(inner[k] != inner[k + width] for k in range(len(inner) - width)):
                continue
            flag = [number_of(row.numbers[0]) for row in tokens]
            rest = [[number_of(text) for text in row.numbers[1:]] for row in tokens]
            if skipped == 0 and width == 1 and _is_flag(flag, rest):
                continue
            proposal = _repeated_numbers(tokens, literals, skipped, width, lines, ends, stated)
            if proposal is not None:
                return proposal
    return None


def _repeated_numbers(
    tokens: list[_Tokens],
    literals: tuple[str, ...],
    skipped: int,
    width: int,
    lines: list[str],
    ends: str,
    stated: Layout,
) -> LayoutProposal | None:
    rows = [[number_of(text) for text in line.numbers] for line in tokens]
    sensors = (len(literals) - 1 - skipped) // width
    body = list(literals[skipped + 1 : skipped + 1 + width])
    labels = _labels((literals[skipped] if skipped == 0 else "", *body), None)
    last = width - 1
    columns = [[row[skipped + last + width * k] for row in rows] for k in range(sensors)]
    if len(rows) >= FEWEST and sum(len({*column}) > 1 for column in columns) == 1:
        return None  # settings beside one number
    numbers = [number for column in columns for number in column]
    reach = range_unit(numbers, labels[last].meaning, stated)
    field_text = "{range}" if reach.unit is None or reach.assumed or stated.unit else f"{{{reach.unit}}}"
    angle, facts = Decision(None), [f"{sensors} readings in a line"]
    if width == 2:
        first = [[row[skipped + width * k] for k in range(sensors)] for row in rows]
        counts = all(row == [*range(sensors)] or row == [*range(1, sensors + 1)] for row in first)
        if counts or labels[0].meaning.quantity is ColumnKind.OTHER:
            lead = "{-}"
        elif sweeps(first[0]) >= REGULAR or labels[0].meaning.quantity is ColumnKind.ANGLE:
            angle = angle_unit(first[0], labels[0].meaning, stated)
            lead = "{angle}" if angle.unit is None or angle.assumed else f"{{{angle.unit}}}"
        else:
            return None
        repeated = f"{lead}{body[0]}{field_text}{body[1]}"
    else:
        lead = ""
        repeated = f"{field_text}{body[0]}"
    start = literals[0].lstrip() if skipped == 0 else ""
    prefix = "".join(f"{literals[k]}{{-}}" for k in range(skipped)).lstrip() + (literals[skipped] if skipped else "")
    if skipped == 0 and start and repeated.endswith(start):  # S1:23cm S2:45cm
        prefix, repeated = "", start + repeated.removesuffix(start)
    elif skipped == 0 and start:
        prefix = start
    unit_after = literals[-1].strip()
    tail = "" if body[-1].startswith(unit_after) else unit_after.removeprefix(body[-1].strip())
    pattern = _escaped(f"{prefix}[{repeated}]...{tail}")
    layout = _with_pattern(stated, pattern, reach, angle, ends)
    proposal = _joined(layout, False, angle, reach, lines, *facts)
    if lead in ("", "{-}"):
        proposal = replace(proposal, questions=(*proposal.questions, *_step_question(stated, sensors)))
    return proposal


def _with_pattern(stated: Layout, pattern: str, reach: Decision, angle: Decision, ends: str) -> Layout:
    """Return the stated layout with a pattern, and the units that are assumed."""
    return replace(
        stated,
        preset="",
        pattern=pattern,
        unit=stated.unit or (reach.unit if reach.assumed else None),
        angle=stated.angle or (angle.unit if angle.assumed else None),
        ends=ends,
    )


def _is_flag(first: Sequence[float], rest: Sequence[Sequence[float]]) -> bool:
    """Return whether the first number of each line is a flag or a counter: 0 or 1, while the others are ranges."""
    small = all(number in (0, 1) for number in first)
    others = [number for row in rest for number in row]
    return (
        small and bool(others) and median(others) > 5 and sum(number in (0, 1) for number in others) < 0.1 * len(others)
    )
