"""Scans in files of other programs: `import_scan` reads any of them. The command, the window and Python call it."""

import csv
import json
import math
import os
import re
import time
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from io import StringIO
from itertools import compress, islice, pairwise
from pathlib import Path
from typing import Literal

import numpy as np
from sonarhw_sim.board.profile import Board, without_own_body

from sonarhw import arguments
from sonarhw.errors import InputError, counted, did_you_mean
from sonarhw.files import open_input
from sonarhw.log import LogMetadata, read_log
from sonarhw.mean_ranges import MOST_PINGS, are_means, unit_of
from sonarhw.plugins.device_plugin import Measurement
from sonarhw.plugins.sweep_tracker import SweepTracker
from sonarhw.readings import Origin, Reading, RobotPose
from sonarhw.scan_check import ANY_BOARD, check_scan
from sonarhw.text.decoder import Decoder, encoding_of, make_decoder, text_of, utf16_of
from sonarhw.text.evidence import TURN_ASSUMED, UnitChoice
from sonarhw.text.layouts import Layout, layout_of
from sonarhw.text.numbers import Printed
from sonarhw.text.proposals import NAMED_CLOCKWISE, LayoutProposal, TextTable, propose, text_table
from sonarhw.text.tables import ColumnNames, Columns, column_names, columns_of, json_records
from sonarhw.text.words import ANGLE_UNITS, RANGE_UNITS, plain_text
from sonarhw.text_device import with_pattern_of
from sonarhw.wire.messages import MOST_DEGREES
from sonarhw_compare.foreign_bags import json_messages
from sonarhw_compare.foreign_rows import LONGEST, MOST_READINGS, ForeignRow, Meaning, readings_of
from sonarhw_compare.foreign_traces import columns_as_text
from sonarhw_compare.import_formats import (
    ARRAYS,
    JSON_MCAP,
    LOG,
    RAW,
    TEXT,
    ImportFormat,
    import_format,
    refuse_options,
)
from sonarhw_compare.scans import GivenScan, reach_of

# What a user may state about a file, and the scan in it.


@dataclass(frozen=True)
class ImportOptions:
    """What the user states about a file; what is not stated is recognised, or asked for by an error."""

    format: str = ""  # one of FORMATS; empty: by the content
    preset: str = ""  # of text
    pattern: str = ""
    unit: str = ""  # m, cm, mm, in, ft, yd, us
    angle: str = ""  # deg, rad, gon, step
    heading: str = ""  # columns of a table
    range: str = ""
    time: str = ""
    x: str = ""  # columns of the pose of a robot
    y: str = ""
    yaw: str = ""
    decimal_comma: bool = False
    scale: float | None = None  # m per unit of range
    turn: Literal["", "ccw", "cw"] = ""  # direction in which angles grow; empty: as stated, else counter-clockwise
    heading_zero: float = 0.0  # degrees, turntable angle at the angle 0
    no_echo: float | None = None  # the range that stands for no echo, in the unit of the file
    mean_of: int | None = None  # pings
    threshold: float | None = None  # share of full scale at which a trace has its echo
    blanking: float | None = None  # s
    rate: float | None = None  # Hz
    step: float | None = None  # degrees, from one reading, sensor or trace to the next
    topic: str = ""  # of a ROS bag
    variable: str = ""  # of a MAT or NPZ file
    axis: Literal["", "rows", "columns"] = ""  # what a ping is in a table of samples
    full_scale: float | None = None  # of samples
    speed_of_sound: float | None = None  # m/s

    def check(self) -> None:
        """Raise InputError for impossible values."""
        if self.scale is not None and not (math.isfinite(self.scale) and self.scale > 0):
            raise InputError(f"scale={self.scale:g}: expected a number above 0, such as 0.01 for centimetres")
        if not abs(self.heading_zero) <= MOST_DEGREES:
            most = f"{MOST_DEGREES:g}"
            raise InputError(f"heading_zero={self.heading_zero:g}: expected degrees between -{most} and {most}")
        if self.threshold is not None and not 0 < self.threshold <= 1:
            raise InputError(f"threshold={self.threshold:g}: expected a share of full scale, above 0 and up to 1")
        if self.blanking is not None and (self.threshold is None or not 0 <= self.blanking <= 1):
            raise InputError(f"blanking={self.blanking:g}: expected 0 to 1 s, and a threshold")
        if self.speed_of_sound is not None and not 100 <= self.speed_of_sound <= 10_000:
            raise InputError(f"speed_of_sound={self.speed_of_sound:g}: expected 100 to 10000 m/s")
        if self.step is not None and not -360 <= self.step <= 360:
            raise InputError(f"step={self.step:g}: expected -360 to 360 degrees")
        if self.full_scale is not None and not self.full_scale > 0:
            raise InputError(f"full_scale={self.full_scale:g}: expected a number above 0")
        if bool(self.x) + bool(self.y) + bool(self.yaw) not in (0, 3):
            given = next(f"{key}={value}" for key in ("x", "y", "yaw") if (value := getattr(self, key)))
            raise InputError(f"{given}: expected the columns of x, y and yaw")
        if self.mean_of is not None and not 2 <= self.mean_of <= MOST_PINGS:
            raise InputError(f"mean_of={self.mean_of}: expected 2 to {MOST_PINGS} pings")

    @property
    def stated(self) -> dict[str, str | float | bool]:
        """The values that are not the defaults."""
        default = asdict(ImportOptions())
        return {key: value for key, value in asdict(self).items() if value != default[key]}

    @property
    def layout(self) -> Layout | None:
        """The layout of the text; None without a preset or a pattern. Raises InputError."""
        return layout_of(self._keys(preset=self.preset, pattern=self.pattern)) if self.preset or self.pattern else None

    @property
    def known(self) -> Layout:
        """What is known of the text without a preset or pattern. Raises InputError."""
        known = layout_of(self._keys(preset="csv"))
        heading, reach, when, *pose = map(plain_text, (self.heading, self.range, self.time, self.x, self.y, self.yaw))
        if not (heading or reach or when or any(pose)):
            return replace(known, scale=self.scale)
        names = ColumnNames(heading, reach, when, tuple(filter(None, pose)), self.decimal_comma)
        return replace(known, scale=self.scale, columns=names)

    def _keys(self, **layout: str) -> dict[str, str]:
        keys = {**layout, "unit": self.unit, "angle": self.angle}
        values = {key: value for key, value in keys.items() if value}
        values |= {} if self.no_echo is None or not math.isfinite(self.no_echo) else {"no_echo": f"{self.no_echo!r}"}
        return values | ({"step": f"{self.step:g}"} if self.step else {})

    def meaning(self, kind: ImportFormat) -> Meaning:
        """Return units and conventions of a format. Raises InputError for an unknown unit."""
        if kind is LOG and self.angle and self.angle not in ANGLE_UNITS:
            raise InputError(f"angle={self.angle}: expected {', '.join(ANGLE_UNITS)} for a log")
        of_log = kind is LOG
        return Meaning(
            scale=self.scale if of_log and self.scale else 1.0,
            sign={"": None, "ccw": 1.0, "cw": -1.0}[self.turn],
            zero=self.heading_zero,
            no_echo=self.no_echo,
            speed_of_sound=self.speed_of_sound,
            threshold=self.threshold,
            blanking=self.blanking or 0.0,
            rate=self.rate,
            step=self.step or 0.0,
            topic=self.topic or None,
            variable=self.variable or None,
            axis=self.axis or None,
            full_scale=self.full_scale,
            unit_deg=ANGLE_UNITS[self.angle or "deg"] if of_log else 1.0,
        )


@dataclass(frozen=True, repr=False)
class ImportedScan(GivenScan):
    """The readings of a file of another program, and how it was read."""

    read_as: tuple[str, ...] = ()  # the format, or units and columns with their evidence, and what was left out
    damage: tuple[str, ...] = ()  # warnings of damaged or missing parts
    scale: float | None = None  # m per unit of range in the file; None: several or unknown
    silent: float = math.nan  # m, the range that stands for no echo
    mean_of: int | None = None
    recorded: LogMetadata | None = None  # of a log of this project, which is corrected
    lines: tuple[tuple[str, int], ...] = ()  # the first lines of a text, and the number of readings in each

    def doubts(self, board: Board | None = None) -> tuple[str, ...]:
        """Return what is probably wrong in the readings, if `board` made them; corrections are in the file's unit."""
        readings = self.readings if board is None else without_own_body(board.own_body, self.readings)
        reach = ANY_BOARD if board is None else reach_of(board)
        texts = []
        of_traces = all(reading.trace is not None for reading in readings)  # which have echoes only with a threshold
        for doubt in check_scan(readings, reach, self.silent):
            if doubt.kind == "means" and self.mean_of is not None:
                continue
            text = str(doubt)
            if doubt.kind == "no echo" and of_traces:
                text = (
                    f"{doubt.problem}: they are traces; threshold=SHARE reads an echo from each after blanking=SECONDS"
                )
            if doubt.silent is not None:
                number = "NUMBER" if self.scale is None else f"{doubt.silent / self.scale:.6g}"
                text = text.replace(f"echo {doubt.silent:.6g}`", f"echo {number}`")
            texts.append(text)
        return tuple(texts)

    def metadata(self, given: LogMetadata | None = None, place_is_stated: bool = False) -> LogMetadata:
        """Return the metadata of a log of the scan: what is `given`, else what a corrected log contains.

        Readings with poses have no place, unless the user states one.
        """
        made, recorded = given or LogMetadata("import", time.time()), self.recorded
        if recorded is not None and not made.room_text:
            place = made.place or recorded.place
            made = replace(made, room_file=recorded.room_file, room_text=recorded.room_text, place=place)
        if recorded is not None and not made.board:
            made = replace(made, board=recorded.board, board_text=recorded.board_text)
        if not place_is_stated and any(reading.pose for reading in self.readings):
            made = replace(made, place="")
        if recorded is not None:
            made = replace(made, made_by=recorded.made_by)
        how = self.read_as if recorded is None else (recorded.read_as, *self.read_as)
        return replace(made, source=self.where, read_as="; ".join(filter(None, how)))

    @property
    def likely_no_echo(self) -> float | None:
        """The range, in the unit of the file, that likely stands for no echo; None without one."""
        silent = next((doubt.silent for doubt in check_scan(self.readings) if doubt.silent is not None), None)
        return None if silent is None or self.scale is None else float(f"{silent / self.scale:.6g}")


# Text as devices print it, in files: serial monitors, captures, CSV, JSON.
#
# The decoder is that of `lines:` URLs, so the same bytes give the same readings from a port and from a file.


_MOST_TEXT = 200 * 2**20  # bytes of a file


def text_scan(
    where: str, data: bytes, meaning: Meaning, layout: Layout | None = None, stated: Layout | None = None
) -> ImportedScan:
    """Return the readings of a text, at least one.

    Without a `layout` one is proposed; `stated` are the columns, the units and the step that the user states. Raises
    InputError with the question that decides if something is doubtful.
    """
    if stated and stated.columns:
        _check_names(where, data, stated.columns)
    stated_turn = meaning.sign or 0.0
    proposal = LayoutProposal() if layout else propose(data, begins_whole=True, known=stated)
    if layout is None:
        layout = _decided(where, proposal, stated is not None and stated.columns is not None)
        meaning = replace(meaning, sign=_sign(meaning.sign, layout, proposal.clockwise))
    decoder = make_decoder(layout, begins_whole=True)
    unit = UnitChoice()
    try:
        printed, lines = _decoded_lines(decoder, data)
        decided = [reading for _, reading in unit.add([(0.0, reading) for reading in printed], last=True)]
    except InputError as error:
        raise InputError(f"{where}: {error}") from error
    finally:
        decoder.close()
    table = layout.columns is not None
    rows, left_out, untimed = _text_rows(where, decided, layout)
    readings = readings_of(where, rows, meaning)
    if not readings:
        raise InputError(
            f"{where}: no readings; no line is like {layout.example!r}; leave out the layout, then one is proposed"
        )
    read_as = f"read as {layout.preset or repr(layout.pattern)}"
    ignored = ", ".join(f"{kind} ({count})" for kind, count in decoder.ignored.items() if count)
    example = f", such as {decoder.example!r}" if ignored and decoder.example and table else ""
    encoding = "" if decoder.encoding in ("utf-8", "binary") else f"text in {decoder.encoding}"
    ignored = f"ignored: {ignored}{example}" if ignored else ""
    evidence = [fact for fact in proposal.evidence if fact != NAMED_CLOCKWISE or not stated_turn]
    turned = TURN_ASSUMED if proposal.turn_assumed else ""
    if stated_turn:
        turned = f"angles grow {'counter-' if stated_turn > 0 else ''}clockwise: as given"
    facts = (read_as, *evidence, turned, *unit.notes, encoding, ignored, left_out, untimed)
    scales = {reading.scale for reading in decided if reading.numbers}
    scan = ImportedScan(where, tuple(readings), read_as=tuple(filter(None, facts)), lines=lines)
    return replace(scan, scale=scales.pop() if len(scales) == 1 else None)


_SHOWN = 12  # lines
_MOST_OF_LINE = 200  # bytes that are shown


def _decoded_lines(decoder: Decoder, data: bytes) -> tuple[list[Printed], tuple[tuple[str, int], ...]]:
    """Return all readings, and the first lines with the number of readings in each; no lines of UTF-16."""
    *first, rest = data.split(b"\n", _SHOWN) if utf16_of(data) is None else [data]
    printed: list[Printed] = []
    lines = []
    for line in first:
        before = len(printed)
        printed += decoder.feed(line + b"\n")
        lines.append((text_of(line[:_MOST_OF_LINE])[0] or "", len(printed) - before))
    printed += [*decoder.feed(rest), *decoder.end()]
    return printed, tuple(lines)


def _sign(stated: float | None, layout: Layout, named_clockwise: bool) -> float:
    """Return the sign of angles: the stated one, else that of their names, which some layouts apply themselves."""
    applied = -1.0 if named_clockwise and layout.turns_itself else 1.0
    return applied * (stated or (-1.0 if named_clockwise else 1.0))


def _check_names(where: str, data: bytes, names: ColumnNames) -> None:
    """Raise InputError if the columns that the user names are not those of the text."""
    wanted = [name for name in (names.heading, names.range, names.time, *names.pose) if name]
    table = text_table(data, names.decimal_comma, wanted)
    has = f"its columns: {', '.join(table.names)}" if table else "it has no columns"
    if repeated := next((name for name in wanted if wanted.count(name) > 1), None):
        raise InputError(
            f"{where}: column {repeated!r} is given for two quantities; expected one column each for heading, range "
            "and time"
        )
    for name in wanted if table else ():
        if table and table.names.count(name) != 1 and name not in column_names(len(table.names)):
            problem = "no column" if name not in table.names else "more than one column"
            near = _near_column(name, [other for other in table.names if other not in wanted], table.names)
            raise InputError(f"{where}: {problem} {name!r}{near or ';'} {has}")
    if not names.heading or not names.range:
        missing = "heading=" if names.range else "range="
        raise InputError(f"{where}: name the columns of both heading and range: {missing} is missing; {has}")


def _near_column(name: str, free: Sequence[str], names: Sequence[str]) -> str:
    """Return the column that a wrong name means, as a question: the only one without a quantity, or a similar one."""
    if name in names:
        return ""
    if (numbered := f"column {name}") in names:
        return f"; did you mean {numbered!r}?"
    return f"; did you mean {free[0]!r}?" if len(free) == 1 else did_you_mean(name, free)


def _content(file: Path) -> bytes:
    try:
        with open_input(file, _MOST_TEXT) as opened_file:
            data = opened_file.read(_MOST_TEXT)
    except OSError as error:
        raise InputError(f"{file}: cannot be read: {error.strerror}; expected a text file") from error
    except ValueError as error:  # a NUL in the name
        raise InputError(f"{file}: {error}") from error
    if not data.strip():
        raise InputError(f"{file}: the file is empty; expected one reading per line")
    return data


def _decided(where: str, proposal: LayoutProposal, names_columns: bool) -> Layout:
    """Return the layout of a proposal. Raises InputError with what is undecided."""
    if proposal.layout is not None and not proposal.questions:
        return proposal.layout
    if proposal.questions:
        asked = "; ".join(map(str, proposal.questions))
        raise InputError(f"{where}: {with_pattern_of(proposal.example, asked)}")
    example = f", such as {proposal.example!r}" if proposal.example else ""
    hint = "give a pattern, the names of the columns, or the format; `sonarhw import --help` lists them"
    if not proposal.example:
        hint = "no line is text in UTF-8, UTF-16 or cp1252: save it in UTF-8, or give the format"
    elif names_columns:
        hint = "check the names of the columns, or leave them out, then they are proposed"
    raise InputError(f"{where}: no readings were recognised in the text{example}; {hint}")


@dataclass(frozen=True)
class _Measured(Measurement):
    """A measurement of a robot with its pose."""

    pose: RobotPose | None = None


def _text_rows(where: str, printed: list[Printed], layout: Layout) -> tuple[list[ForeignRow], str, str]:
    """Return the rows in sweeps, what was left out, and why printed times are not used; empty texts: nothing."""
    tracker = SweepTracker(begins_whole=True)
    placed, steps = [], 0
    times, untimed = _times_of(where, printed, layout.columns is not None and bool(layout.columns.time))
    measured = []
    for reading, when in zip(printed[: MOST_READINGS + 1], times, strict=False):
        heading = reading.heading
        if heading is None:
            heading = steps * (layout.step or 0.0) % 360
            steps += 1
        angle = math.radians(heading)
        measured.append(_Measured(angle, reading.ranges, when, restarted=reading.restarted, pose=reading.pose))
    for measurement in measured:
        placed += [(item.sweep, item.measurement) for item in tracker.add(measurement)]
    placed += [(item.sweep, item.measurement) for item in tracker.flush()]
    if layout.columns is not None and len(placed) < len(measured):  # a table has no restarts and lost digits
        placed = [(0, measurement) for measurement in measured]
    rows = [
        ForeignRow(
            f"reading {number + 1}",
            math.degrees(measurement.angle),
            measurement.ranges[0] if measurement.ranges else None,
            measurement.time,
            sweep,
            more=measurement.ranges[1:],
            pose=measurement.pose if isinstance(measurement, _Measured) else None,
        )
        for number, (sweep, measurement) in enumerate(placed)
    ]
    lost = {
        "angles far from their neighbours": tracker.dropped,
        "readings before a restart": len(measured) - len(placed) - tracker.dropped,
    }
    left_out = ", ".join(f"{kind} ({count})" for kind, count in lost.items() if count > 0)
    return rows, f"left out: {left_out}" if left_out else "", untimed


def _times_of(where: str, printed: list[Printed], named: bool) -> tuple[list[float | None], str]:
    """Return the times of readings from the first one on, s, and why those of the text are not used.

    Raises InputError for such times in a column that the user names.
    """
    stated = [reading.time for reading in printed]
    if not any(time is not None for time in stated):
        return [None] * len(stated), ""
    known = [time for time in stated if time is not None]
    problem = ""
    if len(known) < len(stated):
        problem = f"{counted(len(stated) - len(known), 'reading')} without a time"
    elif any(after < before for before, after in pairwise(known)):
        problem = "they go back; sort the lines by time"
    elif any(after - before > LONGEST for before, after in pairwise(known)):
        problem = f"expected seconds, at most {LONGEST:g} s from one to the next; convert other units to seconds"
    if problem and named:
        raise InputError(f"{where}: times of the column: {problem}")
    if problem:
        return [None] * len(stated), f"times are not used: {problem}"
    return [*stated], ""


# Tables of other programs become text with one reading a line: a ring a line, and messages of `rostopic echo -p`.
#
# The text is then read as any other text, so units and doubts are the same.


_ROS_CSV = "%time,"
_ANGLE = re.compile(r"\s*([+-]?\d+(?:[.,]\d+)?)\s*(?:°|deg|degrees|grad)?\s*", re.IGNORECASE)
_SILENT = "none"  # a range without an echo, as the reader of text knows it
_FEWEST_ANGLES = 4  # angles in a line
_BELOW = 3  # of ranges, at least one must follow
_MOST_TURN = 720.0  # degrees
_RANGES = re.compile(r"field\.ranges(\d+)")


def as_long_text(where: str, data: bytes, step: float) -> tuple[bytes, str]:
    """Return the text with one reading a line, and what it was, if it is one of these; else as it is, and nothing.

    `step`: degrees from one sensor of a ROS topic to the next. Raises InputError for a table that lacks columns.
    """
    head = _decoded_text(data[:4096]).lstrip()
    if head[:1] in ("{", "[") and (records := json_records(_decoded_text(data).lstrip())):
        return "\n".join(map(json.dumps, records)).encode(), "JSON"
    separator = next((mark for mark in ("\t", ";", ",") if mark in head.partition("\n")[0]), "")
    try:
        if _ROS_ECHO.search(head):
            messages = _ros_echo_as_csv(where, _decoded_text(data))
            return "".join(_of_ros_csv(where, messages, step)).encode(), "messages of `rostopic echo`"
        if head.startswith(_ROS_CSV):
            return "".join(_of_ros_csv(where, _decoded_text(data), step)).encode(), "messages of `rostopic echo -p`"
        if separator and _is_wide(head, separator):
            return "".join(_of_wide(where, _decoded_text(data), separator)).encode(), "a table of a sweep a line"
    except csv.Error as error:
        raise InputError(f"{where}: is not CSV: {error}") from error
    return data, ""


def _decoded_text(data: bytes) -> str:
    return plain_text(data.decode(encoding_of(data) or "utf-8", "replace"))


def _is_wide(head: str, separator: str) -> bool:
    """Return whether the first line has angles of even spacing, and the lines below as many other numbers."""
    lines = [line.split(separator) for line in head.splitlines()[: _BELOW + 1] if line.strip()]
    if len(lines) < 2:
        return False
    first = _angles(lines[0])
    if first is None:
        return False
    below = lines[1 : 1 + _BELOW]
    if head.count("\n") < len(lines) and len(below) > 1:
        below = below[:-1]  # the last line may be cut
    return all(len(cells) == len(lines[0]) for cells in below) and any(_angles(cells) != first for cells in below)


def _angles(cells: Sequence[str]) -> tuple[int, list[float]] | None:
    """Return the number of cells before the angles, and the angles; None if the cells are no angles."""
    for before in (0, 1, 2):
        matches = [_ANGLE.fullmatch(cell) for cell in cells[before:]]
        if len(matches) < _FEWEST_ANGLES or any(match is None for match in matches):
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


_ECHOED = ("frame_id", "angle_min", "angle_increment", "range_min", "range_max", "min_range", "max_range", "range")
_ROS_ECHO = re.compile(r"^(range|ranges|angle_increment): ?", re.MULTILINE)
_ECHO_LINE = re.compile(r"\s*(?:(\w+):)?\s*(?:- )?(.*)")


def _ros_echo_as_csv(where: str, text: str) -> str:
    """Return what `rostopic echo` or `ros2 topic echo` has printed as the CSV of `rostopic echo -p`."""
    messages: list[dict[str, str]] = []
    for document in re.split(r"^---\s*$", text, flags=re.MULTILINE):
        values: dict[str, list[str]] = {}
        key = ""
        for line in document.splitlines():
            if (match := _ECHO_LINE.fullmatch(line)) is not None:
                key = match[1] or key
                values.setdefault(key, []).extend(re.split(r",\s*", match[2].strip("[]'\" ")) if match[2] else [])
        if "..." in values.get("ranges", ()):
            raise InputError(f"{where}: its ranges are cut at '...'; print them with `ros2 topic echo --full-length`")
        single = {f"field.{name}": values[name][0] for name in _ECHOED if values.get(name)}
        several = {f"field.ranges{k}": value for k, value in enumerate(values.get("ranges", ()))}
        frame = single.pop("field.frame_id", "")
        messages += [{"%time": "0", "field.header.frame_id": frame, **single, **several}] if single else []
    file = StringIO()
    writer = csv.DictWriter(file, list(messages[0]) if messages else ["%time"], extrasaction="ignore")
    writer.writeheader()
    writer.writerows(messages)
    return file.getvalue()


def _of_ros_csv(where: str, text: str, step: float) -> Iterator[str]:
    """Yield LaserScan as its sweeps, Range as readings of sensors that are `step` degrees apart."""
    rows = csv.reader(StringIO(text))
    header = next(rows)
    column = {name: k for k, name in enumerate(header)}
    ranges = sorted((int(match[1]), k) for name, k in column.items() if (match := _RANGES.fullmatch(name)))
    yield "angle_deg,range_m\n"
    if ranges and {"field.angle_min", "field.angle_increment"} <= column.keys():
        for number, cells in enumerate(rows, 2):
            values = _row_numbers(where, number, cells, header)
            begin, turn = values[column["field.angle_min"]], values[column["field.angle_increment"]]
            least, most = _limits(column, values)
            for place, k in ranges:
                angle = math.degrees(begin + place * turn)
                yield f"{angle:.6g},{values[k] if least <= values[k] <= most else _SILENT}\n"
        return
    if "field.range" not in column:
        raise InputError(f"{where}: rostopic CSV without ranges; expected messages Range or LaserScan")
    frames: dict[str, int] = {}
    for number, cells in enumerate(rows, 2):
        values = _row_numbers(where, number, cells, header)
        frame = cells[column["field.header.frame_id"]] if "field.header.frame_id" in column else ""
        sensor = frames.setdefault(frame, len(frames))
        if sensor and not step:
            listed = ", ".join(islice(frames, 5))
            raise InputError(f"{where}: sensors {listed} without directions; add step=DEGREES, from one to the next")
        least, most = _limits(column, values)
        distance = values[column["field.range"]]
        yield f"{sensor * step:g},{distance if least <= distance <= most else _SILENT}\n"


def _limits(at: dict[str, int], values: Sequence[float]) -> tuple[float, float]:
    least = values[at["field.range_min"]] if "field.range_min" in at else None
    most = values[at["field.range_max"]] if "field.range_max" in at else None
    if least is None:
        least = values[at["field.min_range"]] if "field.min_range" in at else 0.0
    if most is None:
        most = values[at["field.max_range"]] if "field.max_range" in at else math.inf
    return least, most


def _row_numbers(where: str, number: int, cells: Sequence[str], header: Sequence[str]) -> list[float]:
    """Return the numbers in a line; NaN for text."""
    if len(cells) != len(header):
        raise InputError(f"{where}, line {number}: has {len(cells)} fields; expected {len(header)}, as in the header")
    return [_number(cell) for cell in cells]


def _number(cell: str) -> float:
    try:
        return float(cell)
    except ValueError:
        return math.nan


# Any file of another program.


@arguments.checked(file=arguments.file_name, options=arguments.instance(ImportOptions, "an `ImportOptions`"))
def import_scan(file: Path | str | os.PathLike[str], options: ImportOptions | None = None) -> ImportedScan:
    """Return the scan in a file of another program, at least one reading. The content selects the format.

    `options` is what you state about the file. What is doubtful is not guessed: the error names the option that
    decides it. `read_as` of the result states format, columns and units with their evidence. Raises InputError, and
    MissingExtra if the format needs an extra.
    """
    path, options = Path(file), options or ImportOptions()
    options.check()
    _refuse_missing(path)
    kind = import_format(path, options.rate, options.format)
    refuse_options(path, kind, options.stated)
    if kind is RAW and options.rate is not None and path.suffix.lower() == ".wav":
        raise InputError(f"{path}: rate={options.rate:g}: a WAV file has its own; leave it out")
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        scan = _read(path, kind, options)
    silent = math.nan if options.no_echo is None else options.no_echo * (scan.scale or 1.0)
    readings = [replace(reading, origin=reading.origin or Origin.IMPORTED) for reading in scan.readings]
    kept = readings if options.mean_of is None else _without_means(readings, silent, scan.scale, options.mean_of)
    left_out = len(readings) - len(kept)
    means = f"{counted(left_out, 'mean')} of different ranges left out"
    return replace(
        scan,
        readings=tuple(replace(reading, number=number) for number, reading in enumerate(kept)),
        read_as=scan.read_as if options.mean_of is None else (*scan.read_as, means),
        damage=tuple(str(warning.message) for warning in caught),
        silent=silent,
        mean_of=options.mean_of,
    )


def _refuse_missing(file: Path) -> None:
    try:
        file.stat()
    except FileNotFoundError as error:
        what = "is on the web; download it first" if re.match("https?:/", str(file)) else "no such file"
        raise InputError(f"{file}: {what}; give the name of a scan") from error
    except (OSError, ValueError):  # its reader reports it
        return


def _read(file: Path, kind: ImportFormat, options: ImportOptions) -> ImportedScan:
    meaning = options.meaning(kind)
    if kind in (TEXT, JSON_MCAP, ARRAYS):
        layout, known = options.layout, options.known
        if kind is ARRAYS:
            data, what = columns_as_text(file, options.variable or None, named=bool(options.heading))
        else:
            data, what = json_messages(file) if kind is JSON_MCAP else _content(file), ""
        data, what = (data, what) if layout or what else as_long_text(str(file), data, meaning.step)
        if layout is not None:
            layout = replace(layout, scale=options.scale)
        scan = text_scan(str(file), data, meaning, layout, known)
        return replace(scan, read_as=(f"read as {what}", *scan.read_as[1:])) if what else scan
    readings = kind.read(file, meaning)
    scale = meaning.scale if kind is LOG else None if kind.has_traces else 1.0
    stated = ", ".join(f"{key}={value}" for key, value in options.stated.items())
    how = f"corrected: {stated or 'nothing'}" if kind is LOG else f"read as {kind.title_of(file)}"
    units = (f"{kind.units}: by the definition of the format",) if kind.units else ()
    scan = ImportedScan(str(file), tuple(readings), read_as=(how, *units), scale=scale)
    if kind is not LOG:
        return scan
    log = read_log(file)  # a corrected log keeps the origin of its readings
    same = tuple(replace(reading, origin=log.origin) for reading in scan.readings)
    return replace(scan, readings=same, recorded=log.metadata)


def _without_means(readings: list[Reading], silent: float, scale: float | None, mean_of: int) -> list[Reading]:
    """Return the readings without means of different ranges."""
    ranges = np.array([silent if reading.range is None else reading.range for reading in readings], np.float64)
    return [*compress(readings, ~are_means(ranges, unit_of(ranges, scale or 1.0), mean_of))]


def columns_of_file(file: Path, decimal_comma: bool = False) -> TextTable | None:
    """Return the columns of a text file; None if it is no table. Raises InputError."""
    return text_table(_content(file), decimal_comma)


def first_lines(file: Path) -> tuple[tuple[str, int], ...]:
    """Return the first lines of a text file, none of which is known to be a reading. Raises InputError."""
    lines = _decoded_text(_content(file)[: _MOST_OF_LINE * _SHOWN]).splitlines()[:_SHOWN]
    return tuple((line[:_MOST_OF_LINE], 0) for line in lines)


# Names of earlier versions. New programs call `import_scan`.


@dataclass(frozen=True)
class CsvColumns:
    """The names of the columns to import, and how the file is written. Deprecated: `ImportOptions`."""

    heading: str
    distance: str
    time: str | None = None
    decimal_comma: bool = False  # numbers such as 1,5 between semicolons or tabs


def read_foreign_scan(file: Path, columns: CsvColumns, meaning: Meaning) -> list[Reading]:
    """Return the readings of a CSV file, at least one. Deprecated: `import_scan`. Raises InputError."""
    options = ImportOptions(
        angle="deg",
        heading=columns.heading,
        range=columns.distance,
        time=columns.time or "",
        decimal_comma=columns.decimal_comma,
        scale=meaning.scale,
        turn="ccw",
        no_echo=meaning.no_echo,
        speed_of_sound=meaning.speed_of_sound,
    )
    turned, zero = (meaning.sign or 1.0) * meaning.unit_deg, math.radians(meaning.zero)
    return [replace(reading, angle=zero + turned * reading.angle) for reading in import_scan(file, options).readings]


def guess_columns(file: Path) -> tuple[CsvColumns, Meaning]:
    """Return the columns, by their names, and the unit of the range that its name states, by default metres.

    Deprecated: `import_scan` does both. Raises InputError if the names do not say which columns they are.
    """
    table = columns_of_file(file)
    if table is None or not table.header:
        raise InputError(f"{file}: expected a header with the names of the columns; name them in `import_scan`")
    columns = columns_of(table.names)
    if not isinstance(columns, Columns):
        problem = columns or "no name of a heading and a range"
        raise InputError(f"{file}: {problem} in {', '.join(table.names)}; name the columns in `import_scan`")
    time = None if columns.time is None else table.names[columns.time]
    named = CsvColumns(table.names[columns.heading], table.names[columns.ranges[0]], time)
    return named, Meaning(RANGE_UNITS[columns.range.unit or "m"])
