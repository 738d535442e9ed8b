"""Scans of other programs in text and in sensor logs: text of devices, CARMEN, Player and Ping360.

`read_scan` reads any file of another program.
"""

import csv
import math
import re
import struct
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from io import StringIO
from itertools import islice
from pathlib import Path
from typing import BinaryIO

import numpy as np

from sonarhw.errors import InputError, counted
from sonarhw.files import open_input
from sonarhw.log import Log, read_log
from sonarhw.plugins.device_plugin import Measurement
from sonarhw.plugins.sweep_tracker import SweepTracker
from sonarhw.readings import Reading, RobotPose, Trace, speed_of_sound
from sonarhw.text.decoder import encoding_of, make_decoder
from sonarhw.text.layouts import Layout, Printed
from sonarhw.text.proposals import LayoutProposal, UnitChoice, propose
from sonarhw_compare.foreign_bags import json_messages
from sonarhw_compare.foreign_csv import (
    MOST_READINGS,
    ForeignRow,
    Meaning,
    at_poses,
    opened,
    readings_of,
    short_lines,
)
from sonarhw_compare.import_formats import JSON_MCAP, TEXT, import_format

# Text as devices print it, in files: serial monitors, captures, CSV, JSON.
#
# The decoder is that of `lines:` URLs, so the same bytes give the same readings from a port and from a file.


_MOST_TEXT = 200 * 2**20  # bytes of a file


@dataclass(frozen=True)
class ImportedScan:
    """The readings of a text or file of another program."""

    readings: list[Reading]
    notes: tuple[str, ...]  # how it was read: format, or units and columns with the evidence, and what was left out


def read_text_scan(
    file: Path, meaning: Meaning, layout: Layout | None = None, stated: Layout | None = None
) -> ImportedScan:
    """Return the readings of a text file, at least one.

    Without a `layout` one is proposed; `stated` are the units and the step that the user states. Raises InputError with
    the question that decides if something is doubtful.
    """
    data = _content(file)
    if layout is None:
        data = as_long_text(str(file), data, meaning.step)
    return text_scan(str(file), data, meaning, layout, stated)


def text_scan(
    where: str, data: bytes, meaning: Meaning, layout: Layout | None = None, stated: Layout | None = None
) -> ImportedScan:
    """Return the readings of a text, as `read_text_scan`."""
    proposal = LayoutProposal() if layout else propose(data, begins_whole=True, known=stated)
    if layout is None:
        layout = _decided(where, proposal)
        meaning = replace(meaning, sign=-meaning.sign) if proposal.clockwise else meaning
    decoder = make_decoder(layout, begins_whole=True)
    unit = UnitChoice()
    try:
        printed = [*decoder.feed(data), *decoder.end()]
        decided = [reading for _, reading in unit.add([(0.0, reading) for reading in printed], last=True)]
    except InputError as error:
        raise InputError(f"{where}: {error}") from error
    finally:
        decoder.close()
    rows, dropped = _text_rows(decided, layout)
    readings = readings_of(where, rows, meaning)
    if not readings:
        raise InputError(
            f"{where}: no readings; no line is like {layout.example!r}; leave out the layout, then one is proposed"
        )
    read_as = f"read as {layout.preset or repr(layout.pattern)}"
    ignored = ", ".join(f"{kind} ({count})" for kind, count in decoder.ignored.items() if count)
    encoding = "" if decoder.encoding in ("utf-8", "binary") else f"text in {decoder.encoding}"
    far = f"angles far from their neighbours ({dropped})" if dropped else ""
    left_out = ", ".join(filter(None, (ignored, far)))
    facts = (read_as, *proposal.evidence, *unit.notes, encoding, f"ignored: {left_out}" if left_out else "")
    return ImportedScan(readings, tuple(filter(None, facts)))


def _content(file: Path) -> bytes:
    try:
        with open_input(file, _MOST_TEXT) as opened_file:
            data = opened_file.read(_MOST_TEXT)
    except FileNotFoundError as error:
        raise InputError(f"{file}: no such file; give the name of a scan") from error
    except OSError as error:
        raise InputError(f"{file}: cannot be read: {error.strerror}; expected a text file") from error
    except ValueError as error:  # a NUL in the name
        raise InputError(f"{file}: {error}") from error
    if not data.strip():
        raise InputError(f"{file}: the file is empty; expected one reading per line")
    return data


def _decided(where: str, proposal: LayoutProposal) -> Layout:
    """Return the layout of a proposal. Raises InputError with what is undecided."""
    if proposal.layout is not None and not proposal.questions:
        return proposal.layout
    if proposal.questions:
        raise InputError(f"{where}: {'; '.join(proposal.questions)}")
    example = f", such as {proposal.example!r}" if proposal.example else ""
    raise InputError(
        f"{where}: no readings were recognised in the text{example}; give a pattern, the names of the columns, or the "
        "format; `sonarhw import --help` lists them"
    )


def _text_rows(printed: list[Printed], layout: Layout) -> tuple[list[ForeignRow], int]:
    """Return the rows in sweeps, and the number of readings with an angle far from both neighbours."""
    tracker = SweepTracker(begins_whole=True)
    placed, steps = [], 0
    for reading in printed[: MOST_READINGS + 1]:
        heading = reading.heading
        if heading is None:
            heading = steps * (layout.step or 0.0) % 360
            steps += 1
        placed += tracker.add(Measurement(math.radians(heading), reading.ranges, restarted=reading.restarted))
    placed += tracker.flush()
    rows = [
        ForeignRow(
            f"reading {number + 1}",
            math.degrees(item.measurement.angle),
            item.measurement.ranges[0] if item.measurement.ranges else None,
            None,
            item.sweep,
            more=item.measurement.ranges[1:],
        )
        for number, item in enumerate(placed)
    ]
    return rows, tracker.dropped


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


def as_long_text(where: str, data: bytes, step: float) -> bytes:
    """Return the text with one reading a line if it is one of these tables, else as it is.

    `step`: degrees from one sensor of a ROS topic to the next. Raises InputError for a table that lacks columns.
    """
    head = data[:4096].decode(encoding_of(data[:4096]), "replace").lstrip("\ufeff")
    separator = next((mark for mark in ("\t", ";", ",") if mark in head.partition("\n")[0]), "")
    try:
        if head.startswith(_ROS_CSV):
            return "".join(_of_ros_csv(where, _decoded_text(data), step)).encode()
        if separator and _is_wide(head, separator):
            return "".join(_of_wide(where, _decoded_text(data), separator)).encode()
    except csv.Error as error:
        raise InputError(f"{where}: is not CSV: {error}") from error
    return data


def _decoded_text(data: bytes) -> str:
    return data.decode(encoding_of(data), "replace").lstrip("\ufeff")


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


# Sonar readings of CARMEN logs, as `carmen_logwrite_write_base_sonar` of CARMEN's logger writes them.
#
#     SONAR cone_angle num_sonars range... (x y theta)... ipc_timestamp ipc_hostname logger_timestamp
#
# Each line is one sweep over all sensors of a robot; theta is the direction of a sensor in the robot's frame, rad,
# and the angle of its reading. Lines between state poses of the robot, as `carmen_logwrite_write_odometry` writes them:
#
#     ODOM x y theta tv rv accel ipc_timestamp ipc_hostname logger_timestamp
#
# Other lines are ignored.


_COUNT = re.compile(r"\d{1,6}", re.ASCII)
_AFTER = 3  # fields after the offsets: timestamp of the message, host, timestamp of the logger


def read_carmen_log(file: Path, meaning: Meaning) -> list[Reading]:
    """Return the sonar readings of a log, at least one, with the poses of its ODOM lines at their times.

    Raises InputError with the line.
    """
    odometry: list[tuple[float, RobotPose]] = []
    rows = [*islice(_carmen_rows(file, meaning.no_echo, odometry), MOST_READINGS + 1)]
    placed = at_poses(rows, [time for time, _ in odometry], [pose for _, pose in odometry])
    readings = readings_of(str(file), placed, meaning)
    if not readings:
        raise InputError(f"{file}: has no SONAR line; expected a CARMEN log with sonar readings")
    return readings


def _carmen_rows(file: Path, no_echo: float | None, odometry: list[tuple[float, RobotPose]]) -> Iterator[ForeignRow]:
    """Yield the readings; the times and poses of ODOM lines are appended to `odometry`."""
    sweep = 0
    with opened(file, "a CARMEN log") as text:
        for number, line in enumerate(short_lines(file, text, "a CARMEN log"), 1):
            words, where = line.split(), f"line {number}"
            if words[:1] == ["ODOM"]:
                x, y, heading, time = _numbers(file, where, [*words[1:4], *words[-3:-2]], 4)
                odometry.append((time, (x, y, heading)))
            elif words[:1] == ["SONAR"]:
                yield from _sweep(file, where, words[1:], sweep, no_echo)
                sweep += 1


def _sweep(file: Path, where: str, words: list[str], sweep: int, no_echo: float | None) -> Iterator[ForeignRow]:
    """Yield the readings of one SONAR line."""
    count = int(words[1]) if len(words) > 1 and _COUNT.fullmatch(words[1]) else 0
    if not 1 <= count <= len(words):
        raise InputError(f"{file}, {where}: expected the cone angle and the number of sonars after SONAR")
    expected = 2 + 4 * count + _AFTER
    if len(words) != expected:
        problem = f"has {len(words)} fields after SONAR; expected {expected} for {count} sonars"
        raise InputError(f"{file}, {where}: {problem}")
    values = _numbers(file, where, words[2:-2], 4 * count + 1)
    time = values[-1]
    for k, distance in enumerate(values[:count]):
        if distance != no_echo and distance < 0:
            raise InputError(f"{file}, {where}: range {distance:g}; expected 0 or more, or the value for no echo")
        heading = math.degrees(values[count + 3 * k + 2])
        yield ForeignRow(where, heading, None if distance == no_echo else distance, time, sweep)


def _numbers(file: Path, where: str, words: list[str], count: int) -> list[float]:
    try:
        values = [float(word) for word in words]
    except ValueError as error:
        raise InputError(f"{file}, {where}: {error}; expected numbers") from error
    if len(values) != count or not all(map(math.isfinite, values)):
        raise InputError(f"{file}, {where}: expected {count} finite numbers")
    return values


# Sonar of Player's `writelog` driver: the poses of the sensors, then their ranges.
#
#     time host robot sonar index type subtype count ...
#
# A pose is x y z roll pitch yaw.


_OF_POSE = 6  # numbers
_PLAYER_RANGES = ("001", "001")  # type and subtype: data
_PLAYER_POSES = (("004", "001"), ("001", "002"))  # the answer to a request, or data


def read_player_log(file: Path, meaning: Meaning) -> list[Reading]:
    """Return the sonar readings of a log of Player, at least one. Raises InputError with the line."""
    readings = readings_of(str(file), _player_rows(file, meaning), meaning)
    if not readings:
        raise InputError(f"{file}: has no sonar ranges; expected a log of Player with the interface sonar")
    return readings


def _player_rows(file: Path, meaning: Meaning) -> Iterator[ForeignRow]:
    yaws: dict[str, list[float]] = {}
    sweep = 0
    began: float | None = None
    with opened(file, "a log of Player") as text:
        for number, line in enumerate(short_lines(file, text, "a log of Player"), 1):
            words, where = line.split(), f"line {number}"
            if line.startswith("#") or len(words) < 8 or words[3] != "sonar":
                continue
            index, kind, count = words[4], (words[5], words[6]), _count(file, where, words[7])
            if kind in _PLAYER_POSES:
                poses = _numbers(file, where, words[8:], _OF_POSE * count)
                yaws[index] = [math.degrees(yaw) for yaw in poses[5::_OF_POSE]]
            elif kind == _PLAYER_RANGES:
                ranges = _numbers(file, where, words[8:], count)
                (time,) = _numbers(file, where, words[:1], 1)
                began = time if began is None else began
                if len(yaws.get(index, ())) != count:
                    if not meaning.step:
                        raise InputError(
                            f"{file}, {where}: {count} ranges without the directions of the sensors (type 004); add "
                            "step=DEGREES, the angle from one sensor to the next"
                        )
                    yaws[index] = [k * meaning.step for k in range(count)]
                for yaw, distance in zip(yaws[index], ranges, strict=True):
                    silent = distance <= 0 or distance == meaning.no_echo
                    yield ForeignRow(where, yaw, None if silent else distance, time - began, sweep)
                sweep += 1


def _count(file: Path, where: str, word: str) -> int:
    if not _COUNT.fullmatch(word):
        raise InputError(f"{file}, {where}: {word!r}; expected the number of sonars")
    return int(word)


# Profiles of a Ping360 or a Ping1D in the sensor logs (`.bin`) of Ping Viewer.
#
# Ping Viewer writes big-endian: a header (its `src/link/logsensorstruct.cpp`), then pairs of texts and arrays, each
# after its length in bytes: the time `hh:mm:ss.zzz`, in UTF-16 or UTF-8, and one message of the Ping protocol (its
# `examples/decode_sensor_binary_log.py`). The messages `device_data` (2300) and `auto_device_data` (2301) contain one
# profile each.


_TEXTS = 5  # of the program that wrote the log, after title and version
_MOST_BYTES = 65_536  # of one text or message
_DAY = 86_400.0  # s
_TICK = 25e-9  # s, unit of the sample period
_DEGREES = 0.9  # of one gradian
_START = b"BR"
_FRAME = struct.Struct("<2sHHBB")  # start, length of the payload, message, sender, receiver
_PING1D, _PING1D_PROFILE = 1300, struct.Struct("<IHHIIIIH")  # mm, percent, us, number, mm, mm, gain, samples
_PROFILES = {2300: struct.Struct("<BBHHHHHH"), 2301: struct.Struct("<BBHHHHHHBBHH")}
_TIME = re.compile(r"(\d\d).(\d\d).(\d\d).(\d{3})")  # digits of any script; 12 hours have a word behind


def read_ping360_log(file: Path, meaning: Meaning) -> list[Reading]:
    """Return the profiles of a log as traces, at least one. Raises InputError.

    Warns about damaged messages, which are left out. A log that ends within a profile gives those before.
    """
    skipped: list[str] = []
    speed = meaning.speed_of_sound or speed_of_sound()
    try:
        with open_input(file, _MOST_LOG) as data:
            readings = readings_of(str(file), _ping360_rows(file, data, skipped, speed), meaning)
    except OSError as error:
        raise InputError(f"{file}: cannot be read: {error.strerror}; expected a log of Ping Viewer") from error
    if not readings:
        why = f"; {skipped[0]}" if skipped else ""
        raise InputError(f"{file}: has no profile of a Ping360 or Ping1D; expected a log of Ping Viewer with one{why}")
    if skipped:
        damage = counted(len(skipped), "damaged message")
        warnings.warn(f"{file}: {damage} left out, of {len(readings) + len(skipped)}; {skipped[0]}", stacklevel=2)
    return readings


def _ping360_rows(file: Path, data: BinaryIO, skipped: list[str], speed: float) -> Iterator[ForeignRow]:
    _check_header(file, data)
    clock = _Clock()
    for number, (text, frame) in enumerate(_messages(data, skipped), 1):
        where = f"message {number}"
        seconds = clock.seconds(text)
        if seconds is None:
            skipped.append(f"{where}: has no time hh:mm:ss.zzz")
            continue
        try:
            profile = _profile(where, frame, speed)
        except ValueError as error:
            skipped.append(str(error))
            continue
        if profile is not None:
            heading, distance, trace = profile
            yield ForeignRow(where, heading, distance, seconds, trace=trace)


_NEXT = re.compile(rb"\0\0\0(?:\x0c(?=.{12}\0)|\x18(?=.{24}\0))", re.DOTALL)  # length of a time, before another length
_MOST_LOG = 2**30  # bytes


def _messages(data: BinaryIO, skipped: list[str]) -> Iterator[tuple[bytes, bytes]]:
    """Yield the time and the frame of each message. After damage, reading continues at the next time."""
    content = data.read(_MOST_LOG)
    offset = 0
    while offset < len(content):
        text, middle = _sized(content, offset)
        frame, end = (None, offset) if text is None else _sized(content, middle)
        again = None
        if text is None or frame is None or not _is_whole(frame):
            again = _next_message(content, offset + 1, end)  # a wrong length may cover the following messages
        if text is not None and frame is not None and again is None:
            yield text, frame
            offset = end
            continue
        again = again or _next_message(content, offset + 1, len(content))
        what = f"bytes {offset} to {again or len(content)} of the messages"
        skipped.append(f"{what} are damaged" if again is not None else f"{what}: the log ends in a message")
        offset = len(content) if again is None else again


def _is_whole(frame: bytes) -> bool:
    checksum = int.from_bytes(frame[-2:], "little")
    return frame.startswith(_START) and checksum == sum(frame[:-2]) & 0xFFFF


def _next_message(content: bytes, start: int, stop: int) -> int | None:
    offsets = (match.start() for match in _NEXT.finditer(content, start, min(stop + 30, len(content))))
    return next((offset for offset in offsets if offset < stop and _begins(content, offset)), None)


def _sized(content: bytes, offset: int) -> tuple[bytes | None, int]:
    """Return the bytes after their length, and the end; None if there are fewer or too many."""
    count = int.from_bytes(content[offset : offset + 4], "big")
    end = offset + 4 + count
    return (content[offset + 4 : end], end) if count <= _MOST_BYTES and end <= len(content) else (None, offset)


def _has_time(text: bytes) -> bool:
    return bool(_TIME.match(_decoded(text)))


def _begins(content: bytes, offset: int) -> bool:
    text, middle = _sized(content, offset)
    return text is not None and _has_time(text) and _sized(content, middle)[0] is not None


class _Clock:
    """The time of messages, which begins again at 0 after midnight."""

    def __init__(self) -> None:
        self._before, self._days = 0.0, 0.0

    def seconds(self, text: bytes) -> float | None:
        """Return the time of a message, s; None without one."""
        clock = _TIME.match(_decoded(text))
        if clock is None:
            return None
        hours, minutes, seconds, milliseconds = (int(digits) for digits in clock.groups())
        now = 3600.0 * hours + 60.0 * minutes + seconds + milliseconds / 1000
        self._days += _DAY if now + self._days < self._before - _DAY / 2 else 0.0
        self._before = max(self._before, now + self._days)  # the clock may be set back a little
        return self._before


def _check_header(file: Path, data: BinaryIO) -> None:
    """Skip the header. Raises InputError if there is none."""
    title = _array(file, data)
    if title is None or "ping" not in _decoded(title).lower():
        raise InputError(f"{file}: has no header of Ping Viewer; expected one of its sensor logs")
    data.read(4)
    for _ in range(_TEXTS):
        _array(file, data)
    data.read(8)


def _array(file: Path, data: BinaryIO) -> bytes | None:
    """Return the next text or message; None at the end of the log."""
    start = data.read(4)
    if len(start) < 4:
        return None
    (count,) = struct.unpack(">I", start)
    if count == 0xFFFFFFFF:  # a null text of Qt
        return b""
    if count > _MOST_BYTES:
        raise InputError(f"{file}: a text or message of {count} bytes; expected a log of Ping Viewer")
    content = data.read(count)
    return content if len(content) == count else None


def _decoded(text: bytes) -> str:
    """Return a text in UTF-16 or UTF-8; damaged characters are replaced."""
    wide = len(text) % 2 == 0 and (b"\0" in text or not text.isascii())
    return text.decode("utf-16-be" if wide else "utf-8", "replace")


def _profile(where: str, frame: bytes, speed: float) -> tuple[float, float | None, Trace] | None:
    """Return angle (degrees), range (m) if it is stated, and trace of a message; None for another message.

    Raises ValueError if it is damaged.
    """
    if len(frame) < _FRAME.size + 2:
        raise ValueError(f"{where}: {len(frame)} bytes; expected a message of the Ping protocol")
    start, length, message, _, _ = _FRAME.unpack_from(frame)
    payload, checksum = frame[_FRAME.size : -2], int.from_bytes(frame[-2:], "little")
    if start != _START or length != len(payload) or checksum != sum(frame[:-2]) & 0xFFFF:
        raise ValueError(f"{where}: start, length or checksum is wrong")
    if message == _PING1D:
        return _ping1d_profile(where, payload, speed)
    if message not in _PROFILES:
        return None
    layout = _PROFILES[message]
    if len(payload) < layout.size:
        raise ValueError(f"{where}: a profile of {len(payload)} bytes; expected at least {layout.size}")
    fields = layout.unpack_from(payload)
    samples = np.frombuffer(payload[layout.size :], np.uint8) / 255.0
    period = fields[4] * _TICK
    if not period or len(samples) != fields[-1] or not len(samples):
        raise ValueError(f"{where}: a profile of {len(samples)} samples, expected {fields[-1]} and a period")
    return _DEGREES * fields[2], None, Trace(samples, 1.0 / period, 0.0)


def _ping1d_profile(where: str, payload: bytes, speed: float) -> tuple[float, float | None, Trace]:
    """Return a profile of a Ping1D, which points in one direction and states distances in place of times."""
    if len(payload) < _PING1D_PROFILE.size:
        raise ValueError(f"{where}: a profile of {len(payload)} bytes; expected at least {_PING1D_PROFILE.size}")
    distance, confidence, _, _, begin, length, _, count = _PING1D_PROFILE.unpack_from(payload)
    samples = np.frombuffer(payload[_PING1D_PROFILE.size :], np.uint8) / 255.0
    if len(samples) != count or not count or not length:
        raise ValueError(f"{where}: a profile of {len(samples)} samples, expected {count} and a length")
    rate = count * speed / (2 * length / 1000)
    return 0.0, distance / 1000 if confidence and distance else None, Trace(samples, rate, 2 * begin / 1000 / speed)


# Logs of this project, whose readings are corrected.


def read_own_log(file: Path, meaning: Meaning) -> list[Reading]:
    """Return the readings of a log with other units or signs, at least one. Raises InputError."""
    readings = readings_of(str(file), _log_rows(read_log(file), meaning), meaning)
    if not readings:
        raise InputError(f"{file}: contains no readings")
    return readings


def _log_rows(log: Log, meaning: Meaning) -> Iterator[ForeignRow]:
    began = min((reading.time for reading in log.readings), default=0.0)
    for reading in log.readings:
        ranges = reading.echo_ranges
        silent = meaning.no_echo is not None and ranges and abs(ranges[0] - meaning.no_echo) < _SAME_RANGE
        first, *more = (None,) if silent or not ranges else ranges
        degrees = math.degrees(reading.angle)
        where = f"reading {reading.number}"
        time = reading.time - began
        yield ForeignRow(where, degrees, first, time, reading.sweep, reading.trace, tuple(more), reading.pose)


_SAME_RANGE = 0.0015  # m, of a range that stands for no echo, as it is typed


# Any file of another program.


def read_scan(
    file: Path,
    meaning: Meaning | None = None,
    layout: Layout | None = None,
    stated: Layout | None = None,
    name: str = "",
) -> ImportedScan:
    """Return the readings of a file of another program, at least one. Its content selects the format, else `name`.

    Text is read as `read_text_scan` does. Raises InputError; warns about damaged parts.
    """
    meaning = meaning or Meaning()
    chosen = import_format(file, meaning.rate, name)
    if chosen is TEXT:
        return read_text_scan(file, meaning, layout, stated)
    if chosen is JSON_MCAP:
        return text_scan(str(file), json_messages(file), meaning, layout, stated)
    return ImportedScan(chosen.read(file, meaning), (f"read as {chosen.title}",))
