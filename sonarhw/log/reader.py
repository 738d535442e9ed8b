"""Read a log, whole or torn: its index, contents and scans."""

import json
import math
import re
import struct
import zipfile
import zlib
from array import array
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from datetime import datetime
from functools import lru_cache, partial
from importlib.metadata import version
from io import BytesIO
from itertools import groupby
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from sonarhw import arguments
from sonarhw.errors import NotALog, counted
from sonarhw.files import NO_DATA, no_data
from sonarhw.log import mcap_records
from sonarhw.readings import (
    FloatArray,
    Origin,
    Reading,
    RobotPose,
    Trace,
    lost_steps_clause,
    origin_of,
    split_at_homings,
    unverified_clause,
)
from sonarhw.wire import messages
from sonarhw.wire.frames import Frame, decode_block, frame_payload, frame_type
from sonarhw.wire.readings_of_frames import (
    DeviceClock,
    ReadingAssembler,
    broken_reading_rule,
    readings_requested,
)

# the contents of a log, and the names used in the file


FORMAT_VERSION = 1
PROFILE = "sonarhw"  # of the MCAP header
METADATA_NAME = "sonarhw"  # of the MCAP metadata record

FRAMES_RECEIVED = "/frames/rx"
FRAMES_SENT = "/frames/tx"
READINGS = "/readings"
SWEEPS = "/scan"
BYTES = "/bytes/rx"  # as received from a device that sends no frames
TRACES = "/traces"  # decoded, for log viewers; never read back
POSES = "/poses"  # the pose of each reading of a sensor that moves
# in the order of their channel numbers, from 1, so that a log without its channel records can be read
TOPICS = (FRAMES_RECEIVED, FRAMES_SENT, READINGS, SWEEPS, BYTES, TRACES, POSES)


@dataclass(frozen=True)
class LogMetadata:
    """The origin of a log; the first record of the file."""

    made_by: str  # "scan", "ping", "import", "simulate"; "unknown" if it is missing in a torn file
    started: float  # s since the epoch; 0 if it is missing in a torn file
    room_file: str = ""  # name of the room file, empty without one
    room_text: str = ""  # text of the room file when the log was made
    place: str = ""
    board: str = ""  # name of the board profile
    board_text: str = ""  # text of the board profile when the log was made
    source: str = ""  # URL or file that the readings are from
    read_as: str = ""  # of a source that does not speak the protocol: its format and units, with the evidence
    product_version: str = version("sonarhw")
    format_version: int = FORMAT_VERSION


@dataclass(frozen=True)
class RecordedFrame:
    """One frame as it passed over the link."""

    time: float  # host clock, s since the epoch
    received: bool  # True: from the device; False: from the host
    wire: bytes  # with delimiter

    def decoded(self) -> tuple[Frame, messages.Message] | None:
        """Return the frame and its message; None if the frame is damaged or the message unknown."""
        frame = decode_block(self.wire[:-1])
        if not isinstance(frame, Frame):
            return None
        try:
            message = messages.unpack_message(frame.type, frame.payload)
        except messages.MessageError:
            return None
        return None if message is None else (frame, message)


class RecordedFrames:
    """All frames of a log, in order. Each iteration reads them from the file."""

    def __init__(self, file: mcap_records.OpenFile, count: int, topics: dict[int, str]) -> None:
        """`count` is the number of frames; `topics` are by channel number."""
        self._file = file
        self._count = count
        self._topics = topics

    def __len__(self) -> int:
        return self._count

    def __iter__(self) -> Iterator[RecordedFrame]:
        """Yield the frames. Raises NotALog if the file can no longer be read."""
        for _, frame in _frames(self._file, self._topics):
            yield frame

    def pieces(self) -> Iterator[list[RecordedFrame]]:
        """Yield the frames of each chunk."""
        for _, piece in groupby(_frames(self._file, self._topics), key=lambda placed: placed[0]):
            yield [frame for _, frame in piece]

    def received_bytes(self) -> Iterator[tuple[float, bytes]]:
        """Yield the bytes of a device that sends no frames, as received, and their time, s since the epoch."""
        for item in _records(self._file):
            if isinstance(item, mcap_records.McapMessage) and self._topics.get(item.channel) == BYTES:
                yield item.time * 1e-9, item.data


@dataclass(frozen=True)
class RecordedScan:
    """The readings from one Started to the next. An interrupted and continued scan is one scan."""

    began: float  # s on the clock of the readings
    expected: int | None  # readings announced by Started; None if the log does not contain it
    settings: messages.Settings | None
    readings: tuple[Reading, ...]  # by number; their traces are read from the file on access
    finished: messages.Finished | None  # None if the log ends before the scan
    homed: tuple[float, ...] = ()  # times of homings during the scan, s on the clock of the readings

    @property
    def made(self) -> int:
        """The number of readings that the device made: those announced, unless the scan was stopped."""
        return self.finished.readings if self.finished else self.expected or 0

    @property
    def missing(self) -> int:
        """The number of readings that the device made but the log does not contain."""
        return max(0, self.made - len(self.readings))

    @property
    def angle_warning(self) -> str | None:
        """Clause with the angles that may be wrong, and the reason; None if there are none."""
        slipped = self.finished is not None and self.finished.outcome == messages.Outcome.LOST_STEPS
        if not slipped and not self.homed:
            return None
        runs = split_at_homings(
            [reading.time for reading in self.readings], [reading.angle for reading in self.readings], self.homed
        )
        of_last = lost_steps_clause(runs) if slipped else None
        lost = of_last and f"the turntable lost steps; {of_last}"
        return "; ".join(filter(None, (lost, unverified_clause(runs)))) or None


@dataclass(frozen=True)
class Log:
    """The contents of a log."""

    metadata: LogMetadata
    info: messages.Info | None  # of the last greeting
    settings: messages.Settings | None  # the last in force
    frames: RecordedFrames
    scans: tuple[RecordedScan, ...]
    torn: str | None  # clause that states where the file is incomplete or damaged; None: the file is whole
    damaged: bool  # whether it is damaged before its end

    @property
    def origin(self) -> Origin:
        """The origin of the readings: measured, or fake, simulated or imported."""
        device = self.info
        return origin_of(self.metadata.made_by, device.firmware if device else "", device.serial if device else "")

    @property
    def condition(self) -> str:
        """`whole`, `torn` or `damaged`."""
        return "damaged" if self.damaged else "torn" if self.torn else "whole"

    @property
    def doubts(self) -> tuple[str, ...]:
        """Clauses for warnings: what is missing in the file and what to do, and which angles may be wrong."""
        count = len(self.readings)
        remedy = "; to repair it: `sonarhw log recover LOG --out FILE.mcap`" if count else ""
        missing = (f"{self.condition}; {counted(count, 'whole reading')} read; {self.torn}{remedy}",) * bool(self.torn)
        several = len(self.scans) > 1
        doubted = ((number, scan.angle_warning) for number, scan in enumerate(self.scans, 1))
        return missing + tuple(f"scan {number}: {why}" if several else why for number, why in doubted if why)

    @property
    def readings(self) -> tuple[Reading, ...]:
        """The readings of all scans, one scan after the other."""
        if len(self.scans) == 1:
            return self.scans[0].readings
        return tuple(reading for scan in self.scans for reading in scan.readings)


# the readings of one recorded scan as columns, about 100 bytes each, with the positions of their traces in the log


Columns = dict[str, NDArray[np.float64] | NDArray[np.int64]]
Span = tuple[int, int]  # offsets of the first and last chunk that contain a reading or its trace

_INTEGERS = ("number", "sweep", "ping", "echoes", "first_chunk", "last_chunk")
_FLOATS = ("angle", "time", "speed_of_sound", "temperature_c", "host_time")
_POSE = ("pose_x", "pose_y", "pose_heading")  # m, m, rad; only in scans with poses, NaN for readings without one
NO_TRACE = -1
# limits of a frame
_MOST_ECHOES = 255
_ANGLES = -math.radians(2148), math.radians(2148)


class ReadingColumns:
    """Columns with one row per reading. The trace of a row may be added later."""

    def __init__(self) -> None:
        self._integers = {name: array("q") for name in _INTEGERS}
        self._floats = {name: array("d") for name in _FLOATS}
        self._echo_times = array("d")
        self._rows: dict[int, int] = {}  # by number
        self._poses: dict[int, RobotPose] = {}  # by row

    def __len__(self) -> int:
        return len(self._integers["number"])

    def __contains__(self, number: int) -> bool:
        return number in self._rows

    @property
    def latest(self) -> float:
        """Time of the latest reading, s. There must be at least one."""
        return max(self._floats["time"])

    def add(self, reading: Reading, span: Span | None) -> None:
        """Append a reading. `span` is None as long as no part of its trace has been found."""
        self._rows[reading.number] = len(self)
        first, last = span or (NO_TRACE, NO_TRACE)
        integers = (reading.number, reading.sweep, reading.ping, len(reading.echo_times), first, last)
        maybe = (np.nan if value is None else value for value in (reading.temperature_c, reading.host_time))
        floats = (reading.angle, reading.time, reading.speed_of_sound, *maybe)
        for name, value in zip(_INTEGERS, integers, strict=True):
            self._integers[name].append(value)
        for name, number in zip(_FLOATS, floats, strict=True):
            self._floats[name].append(number)
        self._echo_times.extend(reading.echo_times)

    def place(self, number: int, pose: RobotPose) -> None:
        """Set the pose of a reading. Ignored if there is no reading with this number."""
        if number in self._rows:
            self._poses[self._rows[number]] = pose

    def extend_trace(self, number: int, began: int, chunk: int) -> None:
        """Extend the span of a reading to `chunk`, which contains a part of its trace. `began` contains the reading."""
        row = self._rows[number]
        if self._integers["first_chunk"][row] == NO_TRACE:
            self._integers["first_chunk"][row] = began
        self._integers["last_chunk"][row] = chunk

    def columns(self) -> Columns:
        """Return arrays in the order of the rows. `echo_times` has the echoes of all readings, one after another."""
        integers = {name: np.array(values, np.int64) for name, values in self._integers.items()}
        floats = {name: np.array(values, np.float64) for name, values in self._floats.items()}
        columns: Columns = {**integers, **floats, "echo_times": np.array(self._echo_times, np.float64)}
        if self._poses:
            poses = np.full((len(self), len(_POSE)), np.nan)
            poses[[*self._poses]] = [*self._poses.values()]
            columns |= {name: np.ascontiguousarray(column) for name, column in zip(_POSE, poses.T, strict=True)}
        return columns


def check_columns(columns: Columns, end: int) -> None:
    """Raise ValueError unless `columns` may come from `ReadingColumns.columns`, for a log with chunks before `end`."""
    of_poses = _POSE if _POSE[0] in columns else ()
    floats = (*_FLOATS, *of_poses)
    wanted = {**dict.fromkeys(_INTEGERS, np.int64), **dict.fromkeys((*floats, "echo_times"), np.float64)}
    if {name: column.dtype for name, column in columns.items()} != wanted:
        raise ValueError("other columns or types")
    count, echoes, times = len(columns["number"]), columns["echoes"], columns["echo_times"]
    first, last = columns["first_chunk"], columns["last_chunk"]
    if any(columns[name].shape != (count,) for name in (*_INTEGERS, *floats)):
        raise ValueError("columns of several lengths")
    if (echoes < 0).any() or (echoes > _MOST_ECHOES).any() or int(echoes.sum()) != len(times):
        raise ValueError("another number of echoes")
    for name, least, most in (("number", 0, 2**32), ("sweep", 0, 2**16), ("ping", 0, 2**8), ("angle", *_ANGLES)):
        if not ((columns[name] >= least) & (columns[name] < most)).all():
            raise ValueError(f"{name} out of range")
    if not np.isfinite(columns["time"]).all() or not (times >= 0).all() or np.isinf(times).any():
        raise ValueError("no times")
    if not ((first == NO_TRACE) | ((first >= 0) & (first <= last) & (last < end))).all():
        raise ValueError("traces outside the file")


def readings_of(columns: Columns, trace: Callable[[int, Span], Trace], origin: Origin) -> tuple[Reading, ...]:
    """Return the readings by number. `trace` returns the trace for a reading's number and span."""
    order = np.argsort(columns["number"], kind="stable").tolist()
    rows = [*_rows(columns, trace, origin)]
    return tuple(rows[row] for row in order)


def _rows(columns: Columns, trace: Callable[[int, Span], Trace], origin: Origin) -> Iterator[Reading]:
    echo_times = columns["echo_times"].tolist()
    poses = _poses(columns)
    used = 0
    names = (*_INTEGERS, *_FLOATS)
    for row, pose in zip(zip(*(columns[name].tolist() for name in names), strict=True), poses, strict=True):
        number, sweep, ping, echoes, first, last, angle, time, speed, *maybe = row
        temperature, host_time = (None if value != value else value for value in maybe)
        times = tuple(echo_times[used : used + echoes])
        used += echoes
        yield Reading(
            number=number,
            sweep=sweep,
            ping=ping,
            angle=angle,
            time=time,
            echo_times=times,
            speed_of_sound=speed,
            temperature_c=temperature,
            trace=None if first == NO_TRACE else trace(number, (first, last)),
            host_time=host_time,
            origin=origin,
            pose=pose,
        )


def _poses(columns: Columns) -> list[RobotPose | None]:
    """Return the pose of each row; None where it is unknown."""
    if _POSE[0] not in columns:
        return [None] * len(columns["number"])
    x, y, headings = (columns[name].tolist() for name in _POSE)
    return [pose if all(map(math.isfinite, pose)) else None for pose in zip(x, y, headings, strict=True)]


# the frames and traces of a log, which are read from the file on access


_CACHED_TRACES = 64
_UNKNOWN_SETTINGS = messages.Settings(0, 0, 0, 1, 0)


def recorded_frame(message: mcap_records.McapMessage, topics: dict[int, str]) -> RecordedFrame | None:
    """Return the frame in a message of the file; None if it contains none."""
    topic = topics.get(message.channel)
    if topic not in (FRAMES_RECEIVED, FRAMES_SENT):
        return None
    return RecordedFrame(message.time * 1e-9, topic == FRAMES_RECEIVED, message.data)


def _frames(
    file: mcap_records.OpenFile, topics: dict[int, str], span: Span | None = None
) -> Iterator[tuple[int, RecordedFrame]]:
    for item in _records(file, *(span or ())[:1]):
        if span is not None and not isinstance(item, mcap_records.Damage) and item.at > span[1]:
            return
        if isinstance(item, mcap_records.McapMessage) and (frame := recorded_frame(item, topics)):
            yield item.at, frame


def _records(
    file: mcap_records.OpenFile, *start: int
) -> Iterator[mcap_records.Record | mcap_records.McapMessage | mcap_records.Damage]:
    try:
        yield from mcap_records.read_records(file, *start)
    except OSError as error:
        raise NotALog(f"{file.path}: can no longer be read: {error.strerror}") from error


def _stored_traces(
    file: mcap_records.OpenFile, settings: messages.Settings | None, topics: dict[int, str]
) -> Callable[[int, Span], Trace]:
    """Return a function that reads the trace of a reading in the chunks of a span. It keeps the last few traces."""
    settings = replace(settings or _UNKNOWN_SETTINGS, trace=1)

    @lru_cache(maxsize=_CACHED_TRACES)
    def load(number: int, span: Span) -> Trace:
        assembler = ReadingAssembler()
        readings = assembler.feed(settings)
        for _, frame in _frames(file, topics, span):
            if frame.received and (decoded := frame.decoded()):
                readings += assembler.feed(decoded[1])
        readings += assembler.flush()
        traces = [reading.trace for reading in readings if reading.number == number and reading.trace]
        if not traces:
            raise NotALog(f"{file.path}: the trace of reading {number} cannot be read; `log recover` may help")
        return traces[-1]

    return load


class StoredTrace(Trace):
    """A trace that is read from its log on access. Access raises NotALog if the log can no longer be read."""

    def __init__(self, load: Callable[[int, Span], Trace], number: int, span: Span) -> None:
        self._load = load
        self._number = number
        self._span = span

    def __repr__(self) -> str:
        return f"StoredTrace({self._number}, {self._span})"

    @property
    def samples(self) -> FloatArray:
        """See `Trace`."""
        return self._loaded.samples

    @property
    def rate(self) -> float:
        """See `Trace`."""
        return self._loaded.rate

    @property
    def start(self) -> float:
        """See `Trace`."""
        return self._loaded.start

    @property
    def carrier(self) -> bool:
        """See `Trace`."""
        return self._loaded.carrier

    @property
    def _loaded(self) -> Trace:
        return self._load(self._number, self._span)


# decoding of recorded frames to readings and scans, as the driver decoded them during the scan


_NUMBER = struct.Struct("<I")  # first field of a TraceChunk; decoding all fields would double the time to read a log
_TRACES_AHEAD = 4  # traces kept without their readings, which were lost and may be sent again


@dataclass
class DecodedScan:
    """The part of a scan that has been decoded so far."""

    command: int  # sequence number of its newest StartScan
    order: messages.StartScan | None  # None if the log has no frames from a host
    since_us: int  # device time; earlier pings belong to the previous scan
    settings: messages.Settings | None
    started: float | None = None  # s on the clock of the readings
    expected: int | None = None
    readings: ReadingColumns = field(default_factory=ReadingColumns)
    first: Reading | None = None  # reading with the lowest number
    finished: messages.Finished | None = None
    homed: list[float] = field(default_factory=list)  # time of the newest reading before each homing

    @property
    def answered(self) -> bool:
        """Whether the device has answered the command."""
        return self.started is not None or len(self.readings) > 0

    @property
    def began(self) -> float:
        """Start of the scan, s on the clock of its readings."""
        # if the first Started was lost, the repeated one is later than the first readings
        times = [] if self.first is None else [self.first.time]
        return min(times if self.started is None else [*times, self.started])

    def is_continued_by(self, order: messages.StartScan) -> bool:
        """Return whether `order` requests a missing part of this scan, or all of it if there are no readings yet."""
        part = order.first > 0 or order.count > 0
        return self.order is not None and _whole(self.order) == _whole(order) and (part or not self.readings)


def _whole(order: messages.StartScan) -> messages.StartScan:
    return replace(order, first=0, count=0)


class ScanDecoder:
    """Decodes recorded frames, and assigns their readings to scans.

    A scan begins with the StartScan of the host. Logs of imported and simulated scans contain no frames from a host; a
    scan then begins with Started. Both may occur twice, because a command is repeated until it is answered. An
    interrupted and continued scan is one scan.
    """

    def __init__(self) -> None:
        self.info: messages.Info | None = None
        self.settings: messages.Settings | None = None
        self.frames = 0
        self._checked = False  # whether readings must agree with their order; a replayed log plays another scan
        self._clock = DeviceClock()
        self._assembler = ReadingAssembler(self._clock)
        self._scans: list[DecodedScan] = []
        self._hello: int | None = None  # sequence number of the newest Hello
        self._greeted_at = 0  # number of scans when the conversation began
        self._homed = False  # whether the turntable has homed since the newest scan was requested
        self._newest_us = 0
        self._newest: tuple[int, int] | None = None  # number and chunk offset of the newest reading
        self._ahead: dict[int, Span] = {}  # traces without their reading, by number

    def take(self, recorded: RecordedFrame, place: int = 0) -> list[Reading]:
        """Process a frame and return the readings that it completes, without traces.

        `place` is the offset of its chunk. Damaged frames and unknown messages are ignored.
        """
        self.frames += 1
        block = recorded.wire[:-1]
        # fast path: most of a log is traces, and the CRC-32 of the chunk has been checked
        if recorded.received and frame_type(block) == messages.TraceChunk.TYPE:
            self._find_trace(frame_payload(block), place)
            return []
        decoded = recorded.decoded()
        if decoded is None:
            return []
        frame, message = decoded
        if not recorded.received:
            self._from_host(frame.sequence, message)
            return []
        # Accepted and Refused may be unmatched answers; their times must be ignored
        if not isinstance(message, messages.Accepted | messages.Refused):
            self._newest_us = frame.time_us
            self._clock.add_frame(frame.time_us, recorded.time)
        return self._keep(self._from_device(frame, message), place)

    def place(self, number: int, pose: RobotPose) -> None:
        """Set the pose of a reading of the newest scan."""
        if self._scans:
            self._scans[-1].readings.place(number, pose)

    @property
    def begun(self) -> int:
        """Number of scans requested; a continued scan counts once."""
        return len(self._scans)

    @property
    def readings_per_sweep(self) -> int | None:
        """Number of readings of each sweep of the newest scan; None if unknown."""
        order = self._scans[-1].order if self._scans and self._checked else None
        return order.headings * order.pings if order else None

    def scans(self) -> list[DecodedScan]:
        """Return all scans so far, in order, without those that the device never answered."""
        return [scan for scan in self._scans if scan.answered]

    def _from_host(self, sequence: int, message: messages.Message) -> None:
        if isinstance(message, messages.Hello) and sequence != self._hello:
            self._hello, self._greeted_at = sequence, len(self._scans)
        if isinstance(message, messages.Home):
            self._homed = True
        if isinstance(message, messages.StartScan) and not self._is_current(sequence):
            if self._scans and self._scans[-1].is_continued_by(message):
                self._continue(sequence)
            else:
                self._begin(sequence, message)

    def _from_device(self, frame: Frame, message: messages.Message) -> list[Reading]:
        match message:
            case messages.Info():
                self.info, self._checked = message, False
            case messages.Capabilities():
                self._checked = True
            case messages.Settings():
                self.settings = message
                # the assembler then completes a reading without its trace
                message = replace(message, trace=0)
            case messages.Started():
                if not self._is_current(message.command):
                    self._begin(message.command)
                scan = self._scans[-1]
                if scan.started is None:
                    scan.started = self._clock.continued(frame.time_us)
                if self._checked and scan.order:
                    scan.expected = readings_requested(_whole(scan.order))
                else:
                    scan.expected = max(scan.expected or 0, message.first + message.readings)
                return []
            case messages.Refused() if self._is_current(message.command) and not self._scans[-1].answered:
                self._scans.pop()
            case messages.Finished() if self._scans:
                self._finish(self._scans[-1], message)
            case messages.ReadingMessage() if self._scans and message.fired_us < self._scans[-1].since_us:
                return []
            case messages.ReadingMessage() if self._breaks_rules(message):
                return []
        return self._assembler.feed(message)

    def _breaks_rules(self, message: messages.ReadingMessage) -> bool:
        order = self._scans[-1].order if self._scans else None
        if not self._checked or order is None or self.info is None:
            return False
        return broken_reading_rule(message, order, self.settings, self.info.microsteps) is not None

    def _finish(self, scan: DecodedScan, message: messages.Finished) -> None:
        # a command for a missing part has fewer readings than the whole scan
        if self._is_current(message.command) and (not scan.finished or message.readings >= scan.finished.readings):
            scan.finished = message
        elif scan.finished and message.outcome == messages.Outcome.LOST_STEPS and not self._homed:
            # detected after the scan, when the turntable turned over the zero mark
            scan.finished = replace(scan.finished, outcome=messages.Outcome.LOST_STEPS, text=message.text)

    def _is_current(self, command: int) -> bool:
        return len(self._scans) > self._greeted_at and self._scans[-1].command == command

    def _begin(self, command: int, order: messages.StartScan | None = None) -> None:
        self._forget(command)
        self._scans.append(DecodedScan(command, order, self._newest_us, self.settings))

    def _continue(self, command: int) -> None:
        scan = self._scans[-1]
        if self._homed and scan.readings:
            scan.homed.append(scan.readings.latest)
        self._forget(command)
        scan.command, scan.since_us = command, self._newest_us
        self._greeted_at = len(self._scans) - 1

    def _forget(self, command: int) -> None:
        self._homed = False
        # the numbers of readings start again at 0; a Started resets the assembler
        self._assembler.feed(messages.Started(command, 0))
        self._newest, self._ahead = None, {}

    def _keep(self, readings: list[Reading], place: int) -> list[Reading]:
        if not readings:
            return []
        if not self._scans:  # the log begins in the middle of a scan
            self._scans.append(DecodedScan(-1, None, 0, self.settings))
        scan = self._scans[-1]
        fresh = [reading for reading in readings if reading.number not in scan.readings]
        for reading in fresh:
            if scan.first is None or reading.number < scan.first.number:
                scan.first = reading
            ahead = self._ahead.pop(reading.number, None)
            scan.readings.add(reading, (ahead[0], place) if ahead else None)
            self._newest = reading.number, place
        return fresh

    def _find_trace(self, payload: bytes, place: int) -> None:
        """Store the position of a part of a trace, which belongs to the newest or to a later reading."""
        if len(payload) < _NUMBER.size:
            return
        (number,) = _NUMBER.unpack_from(payload)
        if self._newest and self._newest[0] == number:
            self._scans[-1].readings.extend_trace(number, self._newest[1], place)
        elif not self._scans or number not in self._scans[-1].readings:
            first, _ = self._ahead.get(number, (place, place))
            self._ahead[number] = first, place
            while len(self._ahead) > _TRACES_AHEAD:
                del self._ahead[next(iter(self._ahead))]


# the index at the end of a closed log: the result of a `ScanDecoder` as an MCAP attachment, an .npz file of columns


NAME = "sonarhw.index.npz"
MEDIA_TYPE = "application/x-npz"
_VERSION = 2
_HEAD = "head"  # the JSON text beside the columns, as bytes
_ARRAY_HEAD = re.compile(
    rb"\x93NUMPY\x01\x00..\{'descr': '(?P<kind>[<|][fiu][18])', 'fortran_order': False, "
    rb"'shape': \((?P<size>\d{1,15}),\), \} *\n",
    re.DOTALL,
)
_UNREADABLE = (
    *(zipfile.BadZipFile, zlib.error, struct.error, NotImplementedError, RuntimeError, messages.MessageError),
    *(LookupError, ValueError, TypeError, AttributeError, OverflowError, OSError, EOFError),
)

_M = TypeVar("_M", bound=messages.Message)


IndexedScan = tuple[RecordedScan, Columns]  # a scan without readings, and its readings


@dataclass(frozen=True)
class LogIndex:
    """The decoded contents of the frames of a log."""

    info: messages.Info | None
    settings: messages.Settings | None
    frames: int
    scans: tuple[IndexedScan, ...]
    read_as: str = ""  # of the metadata at the end of the log


def index_of(decoder: ScanDecoder) -> LogIndex:
    """Return the index of the frames that `decoder` has processed."""
    scans = (
        (
            RecordedScan(scan.began, scan.expected, scan.settings, (), scan.finished, tuple(scan.homed)),
            scan.readings.columns(),
        )
        for scan in decoder.scans()
    )
    return LogIndex(decoder.info, decoder.settings, decoder.frames, tuple(scans))


def pack_index(index: LogIndex, offset: int) -> bytes:
    """Return the bytes of an index that will be at offset `offset` of the file."""
    head = {
        "version": _VERSION,
        "at": offset,
        "info": _packed(index.info),
        "settings": _packed(index.settings),
        "frames": index.frames,
        "read_as": index.read_as,
        "scans": [
            {
                "began": scan.began,
                "expected": scan.expected,
                "settings": _packed(scan.settings),
                "finished": _packed(scan.finished),
                "homed": scan.homed,
            }
            for scan, _ in index.scans
        ],
    }
    arrays = {
        f"{number}/{name}": column
        for number, (_, columns) in enumerate(index.scans)
        for name, column in columns.items()
    }
    packed = BytesIO()
    np.savez(packed, allow_pickle=False, **{_HEAD: np.frombuffer(json.dumps(head).encode(), np.uint8)}, **arrays)
    return packed.getvalue()


def unpack_index(data: bytes, offset: int) -> LogIndex | None:
    """Return the index in an attachment at offset `offset`. None if it has another version or belongs to another file.

    None also if its contents are invalid, although the checksums of the file are correct.
    """
    try:
        arrays = _arrays(data)
        head = json.loads(arrays.pop(_HEAD).tobytes())
        if (head["version"], head["at"]) != (_VERSION, offset):
            return None
        columns: list[Columns] = [{} for _ in head["scans"]]
        for name, array in arrays.items():
            number, _, column = name.partition("/")
            columns[int(number)][column] = array
        scans = tuple(_scan(scan, mine, offset) for scan, mine in zip(head["scans"], columns, strict=True))
        info, settings = _unpacked(messages.Info, head["info"]), _unpacked(messages.Settings, head["settings"])
        frames = _count(head["frames"], offset)  # a frame has more than a byte
        return LogIndex(info, settings, frames, scans, str(head.get("read_as", "")))
    except _UNREADABLE:
        return None


def _arrays(data: bytes) -> dict[str, NDArray[Any]]:
    """Return the one-dimensional arrays of an .npz file without compression. Raises the errors in _UNREADABLE."""
    with zipfile.ZipFile(BytesIO(data)) as archive:
        members = archive.infolist()
        if any(member.compress_type != zipfile.ZIP_STORED for member in members):
            raise ValueError("a compressed index")  # its size is unlimited
        if sum(member.file_size for member in members) > len(data):
            raise ValueError("members of the index share bytes")
        return {member.filename.removesuffix(".npy"): _array(archive.read(member)) for member in members}


def _array(stored: bytes) -> NDArray[Any]:
    # np.load would allocate as much as the file declares, and evaluates the text of its header
    head = _ARRAY_HEAD.match(stored)
    if head is None:
        raise ValueError("a header that numpy does not write for these columns")
    array = np.frombuffer(stored, head["kind"].decode(), offset=head.end())
    if array.shape != (int(head["size"]),):
        raise ValueError(f"declared size {int(head['size'])}, {array.shape} stored")
    return array


def _count(stored: object, most: int) -> int:
    if not (isinstance(stored, int) and 0 <= stored <= most):
        raise ValueError(f"{stored!r} is no count")
    return stored


def _scan(scan: dict[str, Any], columns: Columns, end: int) -> IndexedScan:
    settings, finished = _unpacked(messages.Settings, scan["settings"]), _unpacked(messages.Finished, scan["finished"])
    began, expected, homed = float(scan["began"]), scan["expected"], tuple(map(float, scan["homed"]))
    if not np.isfinite((began, *homed)).all():
        raise ValueError("a time that is not finite")
    expected = None if expected is None else _count(expected, 0xFFFFFFFF)
    check_columns(columns, end)
    return RecordedScan(began, expected, settings, (), finished, homed), columns


def _packed(message: messages.Message | None) -> str | None:
    return None if message is None else message.pack().hex()


def _unpacked(kind: type[_M], packed: str | None) -> _M | None:
    return None if packed is None else kind.unpack(bytes.fromhex(packed))


# reading a log: an undamaged one with its index, any other one by decoding its frames


_FIELDS = ("format_version", "product_version", "made_by", "started", "room_file", "room_text", "place", "board")
LATEST = 1.8e10  # s since the epoch; later times do not fit into the messages of a log
_UNKNOWN = LogMetadata("unknown", 0.0, product_version="unknown")
_Speeds = dict[tuple[int, float], float]  # m/s, by number and device time (µs) of the reading


def possible_time(time: float) -> float:
    """Return the time nearest to `time` that a log can contain, s since the epoch. A broken device sends any."""
    return min(max(0.0, time), LATEST)  # 0 for NaN


@arguments.checked(path=arguments.file_name)
def read_log(path: Path | str) -> Log:
    """Return everything readable in a log. `torn` states where it ends too early or is damaged.

    Raises NotALog if the file cannot be read, is not a log of sonarhw, or has a newer format.
    """
    path = Path(path)
    try:
        # a pipe or a device may have no end
        if not path.is_file():
            what = "is a folder" if path.is_dir() else "is not a file" if path.exists() else "no such file"
            raise NotALog(f"{path}: {what}; give the name of a log (*.mcap)")
        file = mcap_records.OpenFile(path)
        if not file.size:
            raise NotALog(f"{path}: the file is empty; expected a log of sonarhw")
        if not mcap_records.is_mcap(file):
            if path.suffix.lower() == ".toml":
                raise NotALog(f"{path}: is a room file or a board profile; expected a log of sonarhw (*.mcap)")
            if other := no_data(path.name, file.read(0, 512)):
                is_a, advice = NO_DATA[other]
                raise NotALog(f"{path}: is {is_a}; expected a log of sonarhw (*.mcap); {advice}")
            raise NotALog(
                f"{path}: is not an MCAP file; expected a log of sonarhw; "
                "`sonarhw import` converts a scan in CSV to a log"
            )
        head = _Head(path)
        attachments = mcap_records.checked_attachments(file)
        index = stored_index(file, head, attachments) if attachments else None
        topics = dict(enumerate(TOPICS, start=1))  # by channel number, as `LogWriter` registers them
        damage: list[mcap_records.Damage] = []
        if index is None:
            index, damage = decoded_frames(file, head, topics)
            if attachments is None and not damage:
                damage.append(
                    mcap_records.Damage("its checksum does not match, though every chunk of frames is undamaged")
                )
    except OSError as error:
        raise NotALog(f"{path}: cannot be read: {error.strerror}") from error
    metadata, invalid = head.metadata(_torn(damage), has_frames=bool(index.info or index.scans))
    metadata = replace(metadata, read_as=index.read_as or metadata.read_as)
    torn = _torn([*damage, *invalid])
    damaged = not all(place.at_end for place in [*damage, *invalid])
    log = Log(metadata, index.info, index.settings, RecordedFrames(file, index.frames, topics), (), torn, damaged)
    return replace(log, scans=tuple(_recorded(scan, file, log.origin, topics) for scan in index.scans))


def _recorded(
    indexed: IndexedScan, file: mcap_records.OpenFile, origin: Origin, topics: dict[int, str]
) -> RecordedScan:
    scan, columns = indexed
    trace = partial(StoredTrace, _stored_traces(file, scan.settings, topics))
    return replace(scan, readings=readings_of(columns, trace, origin))


class _Head:
    """The part of the header of a file that has been read so far."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._profile: str | None = None
        self._fields: dict[str, str] | None = None

    @property
    def complete(self) -> bool:
        return self._fields is not None

    def take(self, record: mcap_records.Record) -> None:
        """Process a record. Raises the errors in UNREADABLE."""
        profile = mcap_records.profile_of(record)
        self._profile = self._profile if profile is None else profile  # that of other programs may be empty
        name, fields = mcap_records.metadata_of(record) or ("", None)
        if name == METADATA_NAME:
            self._fields = fields

    def metadata(self, torn: str | None, has_frames: bool) -> tuple[LogMetadata, list[mcap_records.Damage]]:
        """Return the metadata and its damage.

        `has_frames`: the file has frames of a scanner. Raises NotALog if it is not a log.
        """
        if self._fields is not None:
            return _metadata(self._path, self._fields)
        if torn and (self._profile == PROFILE or (self._profile is None and has_frames)):
            return _UNKNOWN, []
        if torn and self._profile is None:
            raise NotALog(f"{self._path}: cannot be read: its header is damaged: {torn}")
        raise NotALog(
            f"{self._path}: is an MCAP file, but not a log of sonarhw: it has no {METADATA_NAME} metadata; "
            "`sonarhw import` converts one with ranges to a log"
        )


def stored_index(file: mcap_records.OpenFile, head: _Head, attachments: dict[str, int]) -> LogIndex | None:
    """Return the index of a closed and undamaged log; None if its frames must be decoded."""
    offset = attachments.get(NAME)
    packed = None if offset is None else mcap_records.attachment(file, offset)
    index = None if packed is None or offset is None else unpack_index(packed, offset)
    if index and any(_has_no_speed(scan) for scan in index.scans):
        return None
    for item in mcap_records.read_records(file):
        if index is None or head.complete:
            return index
        try:
            if isinstance(item, mcap_records.Record):
                head.take(item)
        except mcap_records.UNREADABLE:
            return None
    return None


def decoded_frames(
    file: mcap_records.OpenFile, head: _Head, topics: dict[int, str]
) -> tuple[LogIndex, list[mcap_records.Damage]]:
    """Decode the readable frames. Return their index, and the damage. Add the channels of the file to `topics`."""
    decoder = ScanDecoder()
    damage: list[mcap_records.Damage] = []
    speeds: _Speeds = {}
    for item in mcap_records.read_records(file):
        match item:
            case mcap_records.Damage():
                damage.append(item)
            case mcap_records.McapMessage():
                if frame := recorded_frame(item, topics):
                    decoder.take(frame, item.at)
                elif topics.get(item.channel) == POSES and (placed := _decoded_pose(item.data)):
                    decoder.place(*placed)
                elif topics.get(item.channel) == READINGS and decoder.settings is None:
                    speeds.update(_decoded_speed(item.data))
            case mcap_records.Record():
                try:
                    head.take(item)
                    topics.update(mcap_records.channel_of(item))
                except mcap_records.UNREADABLE:
                    damage.append(
                        mcap_records.Damage(f"the record that begins at byte {item.at} is left out: it is damaged")
                    )
    index = index_of(decoder)
    return replace(index, scans=tuple(_with_speed(scan, speeds) for scan in index.scans)), damage


def _decoded_speed(data: bytes) -> _Speeds:
    """Return the speed of sound in a decoded reading."""
    try:
        record = json.loads(data)
        return {(record["number"], round(record["time"] * 1e6)): float(record["speed_of_sound"])}
    except (ValueError, KeyError, TypeError, OverflowError, RecursionError):
        return {}


def _decoded_pose(data: bytes) -> tuple[int, RobotPose] | None:
    """Return the number of a reading and its pose; None if the message is damaged."""
    try:
        record = json.loads(data)
        pose = tuple(float(part) for part in (*map(record["translation"].get, "xy"), record["heading"]))
        return (int(record["number"]), (pose[0], pose[1], pose[2])) if all(map(math.isfinite, pose)) else None
    except (ValueError, LookupError, TypeError, AttributeError, OverflowError, RecursionError):
        return None


def _has_no_speed(indexed: IndexedScan) -> bool:
    return bool(np.isnan(indexed[1]["speed_of_sound"]).any())


def _with_speed(indexed: IndexedScan, speeds: _Speeds) -> IndexedScan:
    """Return the scan. If its Settings were lost, its speed of sound is that of the decoded readings."""
    if not _has_no_speed(indexed):
        return indexed
    scan, columns = indexed
    keys = zip(columns["number"].tolist(), np.rint(columns["time"] * 1e6).tolist(), strict=True)
    decoded = [speeds.get(key, math.nan) for key in keys]
    filled = np.where(np.isnan(columns["speed_of_sound"]), decoded, columns["speed_of_sound"])
    return scan, {**columns, "speed_of_sound": filled}


def _torn(damage: list[mcap_records.Damage]) -> str | None:
    # thousands of records may be damaged, so the message names only the first
    more = len(damage) - 1
    others = f" (and {more} more {'place' if more == 1 else 'places'})" if more > 0 else ""
    return f"{damage[0].text}{others}" if damage else None


def _metadata(path: Path, fields: dict[str, str]) -> tuple[LogMetadata, list[mcap_records.Damage]]:
    """Return the metadata in these fields, and a clause about each that is missing or invalid."""
    missing = [name for name in _FIELDS if name not in fields]
    damage = (
        [mcap_records.Damage(f"its {METADATA_NAME} metadata has no field {', '.join(map(repr, missing))}")]
        if missing
        else []
    )
    read = LogMetadata(
        made_by=fields.get("made_by", "unknown"),
        started=0.0,
        room_file=fields.get("room_file", ""),
        room_text=fields.get("room_text", ""),
        place=fields.get("place", ""),
        board=fields.get("board", ""),
        board_text=fields.get("board_text", ""),  # missing in early logs, as the next two
        source=fields.get("source", ""),
        read_as=fields.get("read_as", ""),
        product_version=fields.get("product_version", "unknown"),
    )
    try:
        read = replace(read, started=_seconds(fields.get("started", "1970-01-01T00:00:00Z")))
    except (ValueError, OverflowError, OSError):
        damage.append(
            mcap_records.Damage(
                f"the start time in its {METADATA_NAME} metadata is invalid: {fields['started'][:40]!r}"
            )
        )
    try:
        read = replace(read, format_version=int(fields.get("format_version", FORMAT_VERSION)))
    except ValueError:
        damage.append(mcap_records.Damage(f"the format in its {METADATA_NAME} metadata is invalid"))
    if read.format_version > FORMAT_VERSION:
        raise NotALog(
            f"{path}: has format {read.format_version}; this version reads up to {FORMAT_VERSION}: update sonarhw"
        )
    return read, damage


def _seconds(date: str) -> float:
    """Return a date in s since the epoch. Raises ValueError for a date that no log can have."""
    seconds = datetime.fromisoformat(date).timestamp()
    if not 0 <= seconds <= LATEST:
        raise ValueError(f"{date} is not in a time of logs")
    return seconds
