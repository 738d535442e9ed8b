"""Scans of other programs as logs: CARMEN, Ping360, ROS bags, raw traces and mean ranges."""

import math
import os
import re
import struct
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from itertools import islice, pairwise
from pathlib import Path
from typing import Any, BinaryIO, TypeVar

import numpy as np
from numpy.typing import NDArray

from sonarhw.errors import InputError, MissingExtra, SonarError
from sonarhw.files import open_input
from sonarhw.readings import BoolArray, FloatArray, Reading, Trace
from sonarhw_compare.foreign_csv import (
    MOST_READINGS,
    MOST_SAMPLES,
    ForeignRow,
    Meaning,
    opened,
    readings_of,
    short_lines,
)
from sonarhw_compare.processes import Unfinished, call_apart

# Parsers that are not ours read a file in a process of its own: a damaged file can crash them, or let them compute
# without end.


_MOST_OPENED = 100_000_000_000  # bytes of a file; a bag may contain pictures
_PARSED_WITHIN = 30.0  # s
_SLOWEST = 5e6  # bytes/s beyond that
T = TypeVar("T")


def _apart(parse: Callable[..., T], file: Path, expected: str, *arguments: object) -> T:
    """Return `parse(file, *arguments)` from a process of its own. `file` may be a folder. Raises InputError."""
    try:
        size = sum(_size(part) for part in (sorted(file.iterdir()) if file.is_dir() else [file]))
        return call_apart(parse, file, *arguments, within=_PARSED_WITHIN + size / _SLOWEST)
    except SonarError:
        raise
    except OSError as error:
        raise InputError(f"{file}: cannot be read: {error.strerror or error}; expected {expected}") from error
    except Unfinished as error:
        raise InputError(f"{file}: is not {expected}: it {error}; the file is probably damaged") from error
    except Exception as error:  # parsers raise anything for damaged files
        # without the advice of later sentences
        first = str(error).partition("\n")[0].partition(". ")[0] or type(error).__name__
        raise InputError(f"{file}: is not {expected}: {first}") from error


def _size(file: Path) -> int:
    """Return the size of a regular file, bytes. Raises OSError for what is none."""
    with open_input(file, _MOST_OPENED) as opened_file:
        return os.fstat(opened_file.fileno()).st_size


# Sonar readings of CARMEN logs, as `carmen_logwrite_write_base_sonar` of CARMEN's logger writes them.
#
#     SONAR cone_angle num_sonars range... (x y theta)... ipc_timestamp ipc_hostname logger_timestamp
#
# Each line is one sweep over all sensors of a robot; theta is the direction of a sensor in the robot's frame, rad,
# and the angle of its reading. Other lines are ignored.


_COUNT = re.compile(r"\d{1,6}", re.ASCII)
_MOVED = 0.05  # m; the ranges of a robot that moved farther do not belong to one place
_AFTER = 3  # fields after the offsets: timestamp of the message, host, timestamp of the logger


def read_carmen_log(file: Path, meaning: Meaning) -> list[Reading]:
    """Return the sonar readings of a log, at least one. Raises InputError with the line.

    Warns if the robot moves between them, by the ODOM lines of the log.
    """
    path: list[tuple[float, float]] = []
    readings = readings_of(str(file), _carmen_rows(file, meaning.no_echo, path), meaning)
    if not readings:
        raise InputError(f"{file}: has no SONAR line; expected a CARMEN log with sonar readings")
    moved = max((math.dist(position, path[0]) for position in path), default=0.0)
    if moved > _MOVED:
        warnings.warn(
            f"{file}: the robot moves by {moved:.2f} m between the readings, which have no common place; split the log",
            stacklevel=2,
        )
    return readings


def _carmen_rows(file: Path, no_echo: float | None, path: list[tuple[float, float]]) -> Iterator[ForeignRow]:
    """Yield the readings; positions of the robot from the first SONAR line on are appended to `path`."""
    sweep, position = 0, None
    with opened(file, "a CARMEN log") as text:
        for number, line in enumerate(short_lines(file, text, "a CARMEN log"), 1):
            words, where = line.split(), f"line {number}"
            if words[:1] == ["ODOM"]:
                position = _numbers(file, where, words[1:3], 2)
                path += [(position[0], position[1])] if path else []
            elif words[:1] == ["SONAR"]:
                path += [(position[0], position[1])] if position and not path else []
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


# Profiles of a Ping360 in the sensor logs (`.bin`) of Ping Viewer.
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
_PROFILES = {2300: struct.Struct("<BBHHHHHH"), 2301: struct.Struct("<BBHHHHHHBBHH")}
_TIME = re.compile(r"(\d\d):(\d\d):(\d\d)\.(\d{3})", re.ASCII)


def read_ping360_log(file: Path, meaning: Meaning) -> list[Reading]:
    """Return the profiles of a log as traces, at least one. Raises InputError.

    A log that ends within a profile gives those before.
    """
    try:
        with open_input(file, _MOST_OPENED) as data:
            readings = readings_of(str(file), _ping360_rows(file, data), meaning)
    except OSError as error:
        raise InputError(f"{file}: cannot be read: {error.strerror}; expected a log of Ping Viewer") from error
    if not readings:
        raise InputError(f"{file}: has no profile of a Ping360; expected a log of Ping Viewer with one")
    return readings


def _ping360_rows(file: Path, data: BinaryIO) -> Iterator[ForeignRow]:
    _check_header(file, data)
    before, days, number = 0.0, 0.0, 0
    while (text := _array(file, data)) is not None and (frame := _array(file, data)) is not None:
        number += 1
        where = f"message {number}"
        seconds = _seconds(file, where, text)
        # a log over midnight begins again at 0
        days += _DAY if seconds < before - _DAY / 2 else 0.0
        before = seconds
        profile = _profile(file, where, frame)
        if profile is not None:
            gradians, trace = profile
            yield ForeignRow(where, _DEGREES * gradians, None, seconds + days, trace=trace)


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
    """Return a text in UTF-16 or UTF-8; other characters than those of ASCII are replaced."""
    return text.replace(b"\0", b"").decode("ascii", "replace")


def _seconds(file: Path, where: str, text: bytes) -> float:
    match = _TIME.fullmatch(_decoded(text))
    if match is None:
        raise InputError(f"{file}, {where}: has no time hh:mm:ss.zzz; expected a log of Ping Viewer")
    hours, minutes, seconds, milliseconds = map(int, match.groups())
    return 3600.0 * hours + 60.0 * minutes + seconds + milliseconds / 1000


def _profile(file: Path, where: str, frame: bytes) -> tuple[int, Trace] | None:
    """Return angle (gradians) and trace of a message; None for another message. Raises InputError if it is damaged."""
    if len(frame) < _FRAME.size + 2:
        raise InputError(f"{file}, {where}: {len(frame)} bytes; expected a message of the Ping protocol")
    start, length, message, _, _ = _FRAME.unpack_from(frame)
    payload, checksum = frame[_FRAME.size : -2], int.from_bytes(frame[-2:], "little")
    if start != _START or length != len(payload) or checksum != sum(frame[:-2]) & 0xFFFF:
        raise InputError(f"{file}, {where}: start, length or checksum is wrong; the log is damaged")
    if message not in _PROFILES:
        return None
    layout = _PROFILES[message]
    if len(payload) < layout.size:
        raise InputError(f"{file}, {where}: a profile of {len(payload)} bytes; expected at least {layout.size}")
    fields = layout.unpack_from(payload)
    samples = np.frombuffer(payload[layout.size :], np.uint8) / 255.0
    period = fields[4] * _TICK
    if not period or len(samples) != fields[-1] or not len(samples):
        raise InputError(f"{file}, {where}: a profile of {len(samples)} samples, expected {fields[-1]} and a period")
    return fields[2], Trace(samples, 1.0 / period, 0.0)


# Traces from arrays of samples: WAV, NPY, MAT and text.
#
# Each row of a table, or each channel of a WAV file, is the received signal of one ping, from the start of
# transmission on. The full scale of integers is that of their type; floats are shares of full scale, from −1 to 1.


LONGEST_TRACE = 0xFFFF  # samples of a trace in a log
_LONGEST_NUMBER = 26  # characters with its comma, as numpy.savetxt writes it
SLOWEST, FASTEST = 1e3, 1e7  # Hz
_WHAT = "an array of samples"


def read_raw_traces(file: Path, meaning: Meaning) -> list[Reading]:
    """Return one reading for each trace, `meaning.step` degrees apart. Raises InputError."""
    table, rate = _samples(file, meaning.rate)
    if rate is None or not SLOWEST <= rate <= FASTEST:
        raise InputError(f"{file}: a sampling rate of {rate} Hz; expected {SLOWEST:g} to {FASTEST:g} Hz")
    samples = _scaled(file, np.atleast_2d(table))
    count = samples.shape[1]
    if not 2 <= count <= LONGEST_TRACE:
        raise InputError(f"{file}: traces of {count} samples; expected 2 to {LONGEST_TRACE}; one row is one ping")
    return readings_of(str(file), _trace_rows(samples, rate, meaning.step), meaning)


def _trace_rows(samples: FloatArray, rate: float, step: float) -> Iterator[ForeignRow]:
    carrier = bool((samples < 0).any())
    for number, trace in enumerate(samples):
        yield ForeignRow(f"row {number + 1}", number * step, None, None, trace=Trace(trace, rate, 0.0, carrier))


def _scaled(file: Path, table: NDArray[np.generic]) -> FloatArray:
    """Return the samples as shares of full scale, (n, m). Raises InputError unless they are such shares."""
    if table.ndim != 2 or table.dtype.kind not in "iuf":
        raise InputError(
            f"{file}: an array of shape {table.shape} and type {table.dtype}; expected numbers, one row for each ping"
        )
    samples = np.asarray(table, dtype=np.float64)
    if table.dtype.kind != "f":
        bits = 8 * table.dtype.itemsize - (table.dtype.kind == "i")
        samples = samples / 2.0**bits
    most = float(np.abs(samples).max(initial=0.0))
    if not most <= 1:  # also NaN
        raise InputError(f"{file}: a sample of {most:g}; expected shares of full scale, from -1 to 1")
    return samples


def _check_size(file: Path, count: float) -> None:
    if count > MOST_SAMPLES:
        raise InputError(f"{file}: {count:g} samples; expected at most {MOST_SAMPLES}; split it into several files")


def _samples(file: Path, rate: float | None) -> tuple[NDArray[np.generic], float | None]:
    """Return the array in a file, by its suffix, and the sampling rate, Hz: its own, or the given one."""
    match file.suffix.lower():
        case ".wav":
            return _apart(_wav, file, "a WAV file")
        case ".npy":
            return _apart(_npy, file, "an array of NumPy (.npy)"), rate
        case ".mat":
            return _apart(_mat, file, "a MAT file"), rate
        case _:
            return _text(file), rate


def _wav(file: Path) -> tuple[NDArray[np.generic], float]:
    """Return the channels of a WAV file, (n, m), and its rate, Hz."""
    from scipy.io import wavfile

    _check_size(file, file.stat().st_size)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", wavfile.WavFileWarning)  # chunks that are not sound
        rate, sound = wavfile.read(file)
    if sound.dtype == np.uint8:  # eight bits have their zero at 128
        sound = (sound.astype(np.int16) - 128).astype(np.int8)
    return np.atleast_2d(sound.T), float(rate)


def _npy(file: Path) -> NDArray[np.generic]:
    table = np.load(file, mmap_mode="r", allow_pickle=False)
    if not isinstance(table, np.ndarray):
        raise InputError(f"{file}: is an archive of arrays (.npz); give one array (.npy)")
    _check_size(file, table.size)
    return np.array(table)


def _mat(file: Path) -> NDArray[np.generic]:
    """Return the only array of a MAT file that is longer than one number. Sizes are checked before it is loaded."""
    from scipy.io import loadmat, whosmat

    try:
        sizes = {name: math.prod(shape) for name, shape, _ in whosmat(file)}
        arrays = [name for name, size in sizes.items() if size > 1]
        if len(arrays) != 1:
            raise InputError(f"{file}: expected one array of samples, got {', '.join(arrays) or 'none'}")
        _check_size(file, sizes[arrays[0]])
        return np.asarray(loadmat(file, variable_names=arrays)[arrays[0]])
    except NotImplementedError as error:
        raise InputError(f"{file}: a MAT file of version 7.3; save it with `save -v7`") from error


def _text(file: Path) -> NDArray[np.generic]:
    """Return the numbers of a text file, one row a line, between commas, semicolons, tabs or spaces."""
    lines: list[FloatArray] = []
    with opened(file, _WHAT) as text:
        for number, line in enumerate(short_lines(file, text, _WHAT, LONGEST_TRACE * _LONGEST_NUMBER), 1):
            words = line.replace(",", " ").replace(";", " ").split()
            if not words:
                continue
            try:
                lines.append(np.array(words, dtype=np.float64))
            except ValueError as error:
                raise InputError(f"{file}, line {number}: {error}; expected samples between commas") from error
            if len(lines[-1]) != len(lines[0]):
                raise InputError(f"{file}, line {number}: {len(words)} samples; expected {len(lines[0])}, as above")
            _check_size(file, len(lines) * len(lines[0]))
    if not lines:
        raise InputError(f"{file}: the file is empty; expected one row of samples for each ping")
    # a column is one trace
    return np.array(lines).T if lines[0].size == 1 else np.array(lines)


# Scans in bags of ROS 1 and ROS 2: messages `sensor_msgs/Range` and `sensor_msgs/LaserScan`, read by rosbags.
#
# A LaserScan is one sweep, with an angle for each range. A Range has no angle: the topics are `meaning.step` degrees
# apart, in the order of their names. By the definition of the messages, only ranges within their limits are echoes.


_RANGE, _SCAN = "sensor_msgs/msg/Range", "sensor_msgs/msg/LaserScan"
_MOST_BYTES_OF_BAG = 1_000_000  # of a message; a LaserScan of 100 000 ranges has half of this


def read_ros_bag(bag: Path, meaning: Meaning) -> list[Reading]:
    """Return the readings of a bag, at least one: a file of ROS 1, or the folder of ROS 2. Raises InputError.

    Raises MissingExtra if rosbags is not installed.
    """
    if find_spec("rosbags") is None:
        raise MissingExtra("ROS bags need rosbags", "ros")
    readings = readings_of(str(bag), iter(_apart(_rows_of_bag, bag, "a complete ROS bag", meaning)), meaning)
    if not readings:
        raise InputError(f"{bag}: has no message of sensor_msgs/Range or LaserScan")
    return readings


def _rows_of_bag(bag: Path, meaning: Meaning) -> list[ForeignRow]:
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    # bags of ROS 2 may contain no definitions; those of these two messages are the same in all versions
    with AnyReader([bag], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
        return [*islice(_bag_rows(bag, reader, meaning), MOST_READINGS + 1)]


def _bag_rows(bag: Path, reader: Any, meaning: Meaning) -> Iterator[ForeignRow]:
    connections = [one for one in reader.connections if one.msgtype in (_RANGE, _SCAN)]
    topics = sorted({one.topic for one in connections})
    if meaning.topic is not None and meaning.topic not in topics:
        raise InputError(f"{bag}: no topic {meaning.topic!r}; topics with ranges: {', '.join(topics) or 'none'}")
    chosen = [one for one in connections if meaning.topic in (None, one.topic)]
    if not chosen:
        return
    first: int | None = None
    for number, (connection, time, content) in enumerate(reader.messages(connections=chosen)):
        where = f"message {number + 1} of the topics with ranges"
        if len(content) > _MOST_BYTES_OF_BAG:
            raise InputError(f"{bag}, {where}: {len(content)} bytes; expected at most {_MOST_BYTES_OF_BAG}")
        message = reader.deserialize(content, connection.msgtype)
        first = time if first is None else first
        seconds = (time - first) * 1e-9
        if connection.msgtype == _RANGE:
            heading = topics.index(connection.topic) * meaning.step
            yield ForeignRow(where, heading, _echo(message.range, message.min_range, message.max_range), seconds)
            continue
        step = math.degrees(message.angle_increment)
        start = math.degrees(message.angle_min)
        if not (math.isfinite(start) and math.isfinite(step)):
            raise InputError(f"{bag}, {where}: an angle is not finite")
        for k, distance in enumerate(message.ranges.tolist()):
            echo = _echo(distance, message.range_min, message.range_max)
            yield ForeignRow(where, start + k * step, echo, seconds, number)


def _echo(distance: float, least: float, most: float) -> float | None:
    """Return a range, or None if it is outside the limits that its message states."""
    inside = math.isfinite(distance) and max(least, 0.0) <= distance <= most
    return distance if inside else None


# Ranges that are means of several pings, with no echo as a number, as some programs record them.
#
# Where the nearest echo changes, such a mean lies between the two ranges, where nothing is. A mean of five pings
# between 0.51 and 2.14 m is 0.84, 1.16, 1.49 or 1.81 m, and means with no echo look like ranges too. Ranges that a
# sensor has measured are rarely just there.


MOST_PINGS = 8
_STEADY = 5  # neighbouring readings, at least, that have one range
_LONGEST = 16  # most readings from one such range to the next
_APART = 12  # units, least difference of two ranges whose means can be recognised
_ERROR = 1.0 + 1e-6  # units, of a mean of whole units, rounded or cut off
_AT_ENDS = 2.0  # units; a reading as near to one of the two ranges is no mean
_DECIMALS = 3  # most, of the unit of a file
_WHOLE = 1e-3  # units, of a whole number
_CHANCE = 1e-4  # that measured ranges have as many likely means


@dataclass(frozen=True)
class _Between:
    """A reading between two steady ranges."""

    row: int
    range: float  # in units, like the next two
    before: float
    after: float
    is_first: bool  # of neighbouring readings with this range, which prove no more than one

    def is_mean_of(self, pings: int) -> bool:
        """Return whether the range is a mean of so many pings, some with the range before and some with that after."""
        return bool(self._are_means(np.array([self.range]), pings)[0])

    def chance_of(self, pings: int) -> float:
        """Return the share of such means among all whole ranges between the two."""
        low, high = sorted((self.before, self.after))
        return float(self._are_means(np.arange(low + _AT_ENDS + 1, high - _AT_ENDS), pings).mean())

    def _are_means(self, ranges: FloatArray, pings: int) -> BoolArray:
        shares = np.arange(1, pings) / pings
        means = self.before + shares * (self.after - self.before)
        return np.asarray((np.abs(ranges[:, None] - means) <= _ERROR).any(axis=1))


def likely_pings(scans: Sequence[FloatArray], unit: float) -> int | None:
    """Return the number of pings that each range of scans is likely a mean of; None if nothing shows such means.

    A scan has ranges (n,) in the order of its angles, m, whole multiples of `unit` (m), with the number that stands for
    no echo. Scans are of one program.
    """
    pairs = [pair for ranges in scans for pair in _all_between(np.round(ranges / unit)) if pair.is_first]
    if not pairs:
        return None
    chances = {pings: _chance(pairs, pings) for pings in range(2, MOST_PINGS + 1)}
    likely = min(chances, key=chances.__getitem__)
    return likely if chances[likely] < _CHANCE else None


def are_means(ranges: FloatArray, unit: float, pings: int) -> BoolArray:
    """Return which ranges (n,) of a scan, as in `likely_pings`, are means of two different ranges, (n,)."""
    means = np.zeros(len(ranges), np.bool_)
    means[[pair.row for pair in _all_between(np.round(ranges / unit)) if pair.is_mean_of(pings)]] = True
    return means


def unit_of(ranges: FloatArray, scale: float) -> float:
    """Return the unit of ranges (n,), m, NaN for none: `scale` (m), or its first decimal in which all are whole."""
    metres = ranges[~np.isnan(ranges)] / scale
    for decimals in range(_DECIMALS):
        if np.allclose(metres, np.round(metres, decimals), rtol=0.0, atol=_WHOLE * 10.0**-decimals):
            return float(scale * 10.0**-decimals)
    return float(scale * 10.0**-_DECIMALS)


def _chance(pairs: Sequence[_Between], pings: int) -> float:
    """Return the probability that measured ranges look like at least as many means."""
    from scipy.stats import binomtest  # takes a second

    means = sum(pair.is_mean_of(pings) for pair in pairs)
    expected = float(np.mean([pair.chance_of(pings) for pair in pairs]))
    return float(binomtest(means, len(pairs), expected, alternative="greater").pvalue)


def _all_between(ranges: FloatArray) -> Iterator[_Between]:
    """Yield the readings between one steady range and the next, in units."""
    steps = np.flatnonzero(np.abs(np.diff(ranges)) > _ERROR) + 1
    runs = [run for run in np.split(np.arange(len(ranges)), steps) if len(run) >= _STEADY]
    for one, other in pairwise(runs):
        before, after = float(ranges[one[-1]]), float(ranges[other[0]])
        low, high = min(before, after) + _AT_ENDS, max(before, after) - _AT_ENDS
        if abs(after - before) < _APART or other[0] - one[-1] > _LONGEST:
            continue
        for row in range(int(one[-1]) + 1, int(other[0])):
            if low < ranges[row] < high:
                yield _Between(row, float(ranges[row]), before, after, ranges[row] != ranges[row - 1])
