"""Scans in logs of other programs: CARMEN, Player, BeeSoft, ARIA, Ping Viewer; and logs of this project."""

import math
import re
import struct
import warnings
from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import BinaryIO

import numpy as np

from sonarhw.errors import InputError, counted
from sonarhw.files import open_input
from sonarhw.log import Log, read_log
from sonarhw.readings import Reading, RobotPose, Trace, moved_by
from sonarhw.sound_speed import speed_of_sound
from sonarhw_compare.foreign_rows import (
    MOST_READINGS,
    ForeignRow,
    Meaning,
    at_poses,
    opened,
    readings_of,
    short_lines,
)

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


# Sonar of the logs of BeeSoft, as its `sonarClient` writes them: centimetres, without the directions of the sensors.
#
#     @SENS dd-mm-yy hh:mm:ss.microseconds
#     #SONAR count: range...
#     #ROBOT x y heading


_SENS = re.compile(r"@SENS +\d+-\d+-\d+ +(\d+):(\d+):(\d+)\.(\d{1,6})", re.ASCII)
_BEESOFT_SONAR = re.compile(r"#SONAR +(\d{1,4}):(.*)", re.ASCII)
_MOVED = 0.05  # m; the ranges of a robot that moved farther do not belong to one place


def read_beesoft_log(file: Path, meaning: Meaning) -> list[Reading]:
    """Return the sonar readings of a log of BeeSoft, at least one. Raises InputError with the line.

    Warns if the robot moves between them: the log does not state how its headings are counted.
    """
    path: list[tuple[float, float]] = []
    readings = readings_of(str(file), _beesoft_rows(file, meaning, path), meaning)
    if not readings:
        raise InputError(f"{file}: has no line #SONAR; expected a log of BeeSoft with sonar readings")
    moved = max((math.dist(position, path[0]) for position in path), default=0.0)
    if moved > _MOVED:
        warnings.warn(
            f"{file}: the robot moves by {moved:.2f} m between the readings, which have no common place; split the log",
            stacklevel=2,
        )
    return readings


def _beesoft_rows(file: Path, meaning: Meaning, path: list[tuple[float, float]]) -> Iterator[ForeignRow]:
    """Yield the readings; positions of the robot (m) are appended to `path`."""
    clock, began, now, sweep = _Clock(), None, 0.0, 0
    with opened(file, "a log of BeeSoft") as text:
        for number, line in enumerate(short_lines(file, text, "a log of BeeSoft"), 1):
            where = f"line {number}"
            if stamp := _SENS.match(line):
                hours, minutes, seconds = (int(part) for part in stamp.groups()[:3])
                now = clock.after(3600.0 * hours + 60.0 * minutes + seconds + int(stamp[4]) * 1e-6)
                began = now if began is None else began
            elif line.startswith("#ROBOT"):
                x, y = _numbers(file, where, line.split()[1:3], 2)
                path.append((x * _CENTIMETRE, y * _CENTIMETRE))
            elif sonar := _BEESOFT_SONAR.match(line):
                count = int(sonar[1])
                ranges = _numbers(file, where, sonar[2].split(), count)
                if not meaning.step:
                    even = f"; {360 / count:g} or -{360 / count:g} if they are evenly spaced" if count else ""
                    raise InputError(
                        f"{file}, {where}: {count} ranges without the directions of the sensors; add step=DEGREES from "
                        f"one sensor to the next, negative if clockwise{even}"
                    )
                for k, distance in enumerate(ranges):
                    silent = distance <= 0 or distance == meaning.no_echo
                    metres = None if silent else distance * _CENTIMETRE
                    yield ForeignRow(where, k * meaning.step, metres, now - (began or 0.0), sweep)
                sweep += 1


_CENTIMETRE, _MILLIMETRE = 0.01, 0.001  # m


# Range scans in the logs `.2d` of ARIA and MobileSim, as described in its `ArLaserLogger.cpp`: millimetres and degrees.
#
#     LaserOdometryLog
#     sick1pose: x y theta          of the sensor on the robot
#     sick1conf: first last count   degrees
#     time: seconds
#     robot: x y theta
#     scan1: x y ...                points in the frame of the robot; `sick1:` before version 3 has ranges


def read_aria_log(file: Path, meaning: Meaning) -> list[Reading]:
    """Return the scans of a log of ARIA with the poses of its sensor, at least one. Raises InputError with the line."""
    readings = readings_of(str(file), _aria_rows(file, meaning.no_echo), meaning)
    if not readings:
        raise InputError(f"{file}: has no line scan1 or sick1 with readings; expected a log of ARIA (.2d)")
    return readings


def _aria_rows(file: Path, no_echo: float | None) -> Iterator[ForeignRow]:
    sensor, first, last = (0.0, 0.0, 0.0), -90.0, 90.0
    pose: RobotPose | None = None
    time: float | None = None
    sweep = 0
    with opened(file, "a log of ARIA") as text:
        for number, line in enumerate(short_lines(file, text, "a log of ARIA", _MOST_OF_SCAN), 1):
            tag, _, rest = line.partition(":")
            words, where = rest.split(), f"line {number}"
            if tag == "sick1pose":
                sensor = _aria_pose(file, where, words)
            elif tag == "sick1conf":
                first, last = _numbers(file, where, words[:2], 2)
            elif tag == "time" and len(words) == 1 and ":" not in words[0]:
                (time,) = _numbers(file, where, words, 1)
            elif tag == "robot":
                pose = moved_by(_aria_pose(file, where, words), sensor)
            elif tag in ("scan1", "sick1"):
                values = _numbers(file, where, words, len(words))
                pairs = _of_points(values, sensor) if tag == "scan1" else _of_ranges(values, first, last)
                for degrees, distance in pairs:
                    silent = distance <= 0 or distance == no_echo
                    yield ForeignRow(where, degrees, None if silent else distance, time, sweep, pose=pose)
                sweep += 1


_MOST_OF_SCAN = 1_000_000  # characters


def _aria_pose(file: Path, where: str, words: list[str]) -> RobotPose:
    x, y, degrees = _numbers(file, where, words[:3], 3)
    return x * _MILLIMETRE, y * _MILLIMETRE, math.radians(degrees)


def _of_points(values: list[float], sensor: RobotPose) -> Iterator[tuple[float, float]]:
    """Yield angles (degrees) and ranges (m) of points from the sensor; 0, 0 in place of a point is no echo."""
    for x, y in zip(values[::2], values[1::2], strict=False):
        right, up = x * _MILLIMETRE - sensor[0], y * _MILLIMETRE - sensor[1]
        silent = x == 0 and y == 0
        turned = math.remainder(math.atan2(up, right) - sensor[2], math.tau)
        yield math.degrees(turned), 0.0 if silent else math.hypot(right, up)


def _of_ranges(values: list[float], first: float, last: float) -> Iterator[tuple[float, float]]:
    step = (last - first) / (len(values) - 1) if len(values) > 1 else 0.0
    for k, value in enumerate(values):
        yield first + k * step, value * _MILLIMETRE


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
        return self.after(3600.0 * hours + 60.0 * minutes + seconds + milliseconds / 1000)

    def after(self, now: float) -> float:
        """Return a time of day, s, counted on after midnight; never before the time returned last."""
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
