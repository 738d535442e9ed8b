"""Write a log: an uncompressed MCAP file with one chunk per reading.

The file is readable even if the process is killed. During a scan, each reading is written at once, in one chunk with
its frames. Otherwise each frame is written at once. So a killed process loses at most the frames of the current
reading. Closing adds the index, with which a log of an hour opens at once.
"""

import errno
import json
import math
import os
import threading
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from io import FileIO
from itertools import count, pairwise
from pathlib import Path
from statistics import median_low
from types import TracebackType
from typing import IO, Any, BinaryIO, Self, cast

import numpy as np
from foxglove_schemas_protobuf.LaserScan_pb2 import LaserScan
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from mcap.well_known import MessageEncoding, SchemaEncoding
from mcap.writer import CompressionType, Writer
from mcap_protobuf.schema import build_file_descriptor_set

from sonarhw.errors import LogError, counted_are
from sonarhw.files import DiskSpaceMonitor, atomic_file, replace_regular
from sonarhw.log import reader
from sonarhw.readings import FAKE_FIRMWARE, Origin, Reading, RobotPose, Trace
from sonarhw.wire import messages
from sonarhw.wire.frames import Frame, encode_frame, frame_type
from sonarhw.wire.limits import KEPT_READINGS, PROTOCOL_MAJOR, PROTOCOL_MINOR
from sonarhw.wire.readings_of_frames import reading_message, trace_chunks

# the file of a log: one that is written as a whole, or one that grows during a recording


_NO_SYNC = (errno.EINVAL, errno.ENOTSUP, errno.EROFS)  # errors of pipes and devices without fsync
SYNCED_WITHIN = 10.0  # s for the last sync; a disk that does not answer must not hold the end of a program
MOST_COPIED = 64_000_000  # bytes of a log that are kept in memory, for a drive that is removed
_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)  # errors after which all earlier bytes are kept


class WholeLogFile:
    """The file of a log that is written as a whole. The caller has opened it, and keeps or discards it at the end."""

    disposable = True  # whether the new file may be removed after an error

    def __init__(self, file: BinaryIO) -> None:
        self.path = Path(str(file.name))
        self.readings = 0
        self.closed = False
        self._file = file
        self._written = 0

    def write(self, data: bytes) -> int:
        """Write the bytes."""
        self._written += len(data)
        return self._file.write(data)

    def tell(self) -> int:
        """Return the offset in the file of the next byte."""
        return self._written

    def flush(self) -> None:
        """Do nothing. The caller flushes the file."""

    def replace_old_file(self) -> None:
        """Do nothing. The caller replaces the old file."""

    def close(self) -> None:
        """Let no more bytes be written. The caller closes the file."""
        self.closed = True

    drop = close


class LogFile:
    """Collects bytes and writes them in one piece at `flush`.

    A thread syncs every piece to the disk at once. A drive that is pulled out then has all pieces, and its removal is
    detected. Without a sync, the system accepts bytes for a removed drive for half a minute.
    """

    def __init__(self, path: Path, overwrite: bool, fallback: Path | None, warn: Callable[[str], None]) -> None:
        """Create the file. Raises LogError if it exists (unless `overwrite`) or cannot be created.

        An old file is replaced by `replace_old_file`. If writing fails later, or if the file was deleted, it is
        continued in the folder `fallback`, and `warn` is called.
        """
        self.path = path
        self.readings = 0  # readings in the file after the next `flush`, for error messages
        self._fallback, self._warn = fallback, warn
        self._pending = bytearray()
        self._copy: bytearray | None = bytearray()  # of all bytes in the file; None: they are too many
        self._written = 0  # bytes
        self._kept = 0  # readings in the file
        # an old file is unchanged until the new one, beside it, is complete
        self._replaces_old = overwrite and path.is_file()
        self._actual = _free_name(path.parent, f"{path.stem}.unfinished") if self._replaces_old else path
        # a device or a pipe always exists, and has no content to lose
        self._device = path.exists() and not path.is_file() and not path.is_dir()
        try:
            self._file = FileIO(self._actual, "wb" if self._device else "xb")
        except FileExistsError as error:
            raise LogError(f"{path}: exists already; choose another name, or allow overwriting it") from error
        except OSError as error:
            raise LogError(f"{path}: cannot be written: {error.strerror}; choose another file") from error
        self._sync_thread = _SyncThread(self._file)

    @property
    def closed(self) -> bool:
        """Whether the file is closed."""
        return self._file.closed

    @property
    def disposable(self) -> bool:
        """Whether the new file may be removed after an error: it has no reading, and an old file is still unchanged."""
        return self._replaces_old and not self.readings

    def write(self, data: bytes) -> int:
        """Store the bytes until the next `flush`."""
        self._pending += data
        return len(data)

    def tell(self) -> int:
        """Return the offset in the file of the next byte."""
        return self._written + len(self._pending)

    def flush(self) -> None:
        """Write all stored bytes. On failure truncate the file after its last whole piece and raise LogError."""
        try:
            self._write_pending()
        except OSError as error:
            self._give_up()
            if not self._continue_elsewhere(str(error.strerror)):
                raise self._failure(error) from error
        if self._copy is not None:
            self._copy += self._pending
            if len(self._copy) > MOST_COPIED:
                self._copy = None
        self._written += len(self._pending)
        self._kept = self.readings
        self._pending.clear()
        self._sync_thread.request(self._kept)

    def _write_pending(self) -> None:
        if self._sync_thread.failure:
            raise self._sync_thread.failure
        _write_all(self._file, self._pending)
        if os.fstat(self._file.fileno()).st_nlink == 0:
            raise FileNotFoundError(errno.ENOENT, "it was deleted while it was being written")

    def _continue_elsewhere(self, reason: str) -> bool:
        """Write everything so far to a new file in the fallback folder. Return whether that succeeds."""
        if self._fallback is None or not self._written or self._device:
            return False
        target = _free_name(self._fallback, self.path.stem)
        try:
            # without a copy, the old file may still be readable
            content = self._actual.read_bytes()[: self._written] if self._copy is None else self._copy
            self._fallback.mkdir(parents=True, exist_ok=True)
            file = FileIO(target, "xb")
        except OSError:
            return False
        try:
            if len(content) < self._written:
                raise OSError(errno.EIO, "the old file is incomplete")
            _write_all(file, content + self._pending)
        except OSError:
            file.close()
            target.unlink(missing_ok=True)
            return False
        self._warn(
            f"{self._actual}: can no longer be written: {reason}; the recording continues in {target}, with all "
            "readings so far"
        )
        self.path = self._actual = target
        self._file, self._replaces_old, self._fallback = file, False, None
        self._sync_thread = _SyncThread(file)
        return True

    def replace_old_file(self) -> None:
        """Replace the old file by this one, which is complete and closed. Raises LogError."""
        if not self._replaces_old:
            return
        self._replaces_old = False
        try:
            replace_regular(self._actual, self.path.resolve())
        except OSError as error:
            raise LogError(
                f"{self.path}: cannot be overwritten: {error.strerror}; the scan is in {self._actual}"
            ) from error

    def close(self) -> None:
        """Sync the file to the disk and close it. Bytes that were not flushed are dropped. Raises LogError."""
        if self._file.closed:
            return
        try:
            self._sync_thread.finish()
        except OSError as error:
            self._abandon()
            if not self._continue_elsewhere(str(error.strerror)):
                raise self._failure(error) from error
            self._sync_thread.finish()
        finally:
            self._abandon()

    def drop(self) -> None:
        """Close and remove the file. An old file that it was to replace is unchanged."""
        if not self._file.closed:
            self._give_up()
        if not self._device:
            self._actual.unlink(missing_ok=True)

    def _failure(self, error: OSError) -> LogError:
        # a full disk keeps all written bytes; a removed drive keeps only the synced ones
        sync_thread = self._sync_thread
        only_synced = error is sync_thread.failure or error.errno not in _FULL
        kept = sync_thread.kept if only_synced else self._kept
        if not kept:
            return LogError(
                f"{self._actual}: cannot be written: {error.strerror}; nothing is recorded, choose another file"
            )
        if error.errno == errno.ENOENT:
            return LogError(f"{self._actual}: was deleted while it was being written; record into another folder")
        count = f"{counted_are(kept, 'reading')} kept in it"
        delete = "delete other files or " if error.errno in _FULL else ""
        return LogError(
            f"{self._actual}: can no longer be written: {error.strerror}; {count}; {delete}record to another disk"
        )

    def _give_up(self) -> None:
        try:
            if self._sync_thread.stop(SYNCED_WITHIN):
                self._file.truncate(self._written)
        except OSError:
            pass  # the reader finds the end of the last whole piece
        finally:
            self._abandon()

    def _abandon(self) -> None:
        """Close the file; if its disk does not answer, in another thread, because that may not end either."""
        if self._sync_thread.stop(0):
            self._file.close()
        else:
            threading.Thread(target=self._file.close, name=f"close {self._actual}", daemon=True).start()


def _write_all(file: FileIO, data: bytes | bytearray) -> None:
    left = memoryview(bytes(data))
    while left:
        left = left[file.write(left) :]


def _free_name(folder: Path, stem: str) -> Path:
    """Return the name of a log that does not exist."""
    names = (folder / f"{stem}{number}.mcap" for number in ("", *(f"-{n}" for n in range(2, 10_000))))
    return next(name for name in names if not (name.exists() or name.is_symlink()))


class _SyncThread:
    """A thread that syncs a file to its disk as often as the disk allows."""

    def __init__(self, file: FileIO) -> None:
        self.kept = 0  # readings on the disk
        self._file = file
        self._wanted = 0
        self.failure: OSError | None = None
        self._stopping = False
        self._wake = threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"sync {file.name!s}", daemon=True)
        self._thread.start()

    def request(self, readings: int) -> None:
        """Request a sync of the file, which now has that number of readings. Does not wait for the sync."""
        self._wanted = readings
        self._wake.set()

    def finish(self) -> None:
        """Sync the file a last time and end the thread. Raises OSError, also if the disk does not answer."""
        if not self.stop(SYNCED_WITHIN):
            raise OSError(errno.ETIMEDOUT, f"its disk has not answered for {SYNCED_WITHIN:g} s")
        if self.failure:
            raise self.failure

    def stop(self, within: float) -> bool:
        """End the thread after a last sync. Return whether it ends, and the file may be closed, in `within` s."""
        self._stopping = True
        self._wake.set()
        self._thread.join(within)
        return not self._thread.is_alive()

    def _run(self) -> None:
        stopping = False
        while not stopping and not self.failure:
            self._wake.wait()
            self._wake.clear()
            stopping, wanted = self._stopping, self._wanted
            try:
                _sync(self._file)
            except OSError as error:
                self.failure = error
            except ValueError:  # the file was closed, because its disk did not answer
                return
            else:
                self.kept = wanted


def _sync(file: FileIO) -> None:
    try:
        os.fsync(file.fileno())
    except OSError as error:
        if error.errno not in _NO_SYNC:
            raise


# a sweep as a foxglove.LaserScan, which log viewers draw: +inf without an echo, NaN without a reading


FRAME_ID = "turntable"
_MOST_RANGES = 36_000  # 0.01° over a whole turn; a finer step comes from rounding


def laser_scan(readings: Sequence[Reading], time: float) -> LaserScan:
    """Return the message for the readings of one sweep, at least one. `time` (s since the epoch) is its time stamp.

    The message has equal steps only, so the ranges are on a grid of the smallest step between two headings. Of several
    pings at one heading the median range is used.
    """
    ranges = _by_heading(readings)
    headings = sorted(ranges)
    start, span = headings[0], headings[-1] - headings[0]
    step = max(min((after - before for before, after in pairwise(headings)), default=1), span / _MOST_RANGES)
    grid = [math.nan] * (round(span / step) + 1)
    for heading in headings:
        grid[round((heading - start) / step)] = median_low(ranges[heading])
    end = start + round(step * (len(grid) - 1))
    message = LaserScan(
        frame_id=FRAME_ID, start_angle=messages.radians_of(start), end_angle=messages.radians_of(end), ranges=grid
    )
    message.timestamp.FromNanoseconds(round(reader.possible_time(time) * 1e9))
    message.pose.orientation.w = 1.0
    return message


def _by_heading(readings: Sequence[Reading]) -> dict[int, list[float]]:
    """Return the ranges of all pings at each heading, in whole microdegrees, as in the messages."""
    ranges: dict[int, list[float]] = defaultdict(list)
    for reading in readings:
        ranges[messages.microdegrees_of(reading.angle)].append(math.inf if reading.range is None else reading.range)
    return ranges


class OpenSweeps:
    """The sweeps that are not complete yet. A lost reading may arrive after the next sweep has begun."""

    def __init__(self) -> None:
        self._sweeps: dict[int, list[Reading]] = {}  # without traces, by number

    def add(self, reading: Reading, of_each: int | None) -> list[list[Reading]]:
        """Add a reading, and return the readings of each sweep that is over now.

        `of_each` is the number of readings of a sweep. If it is None, a sweep is over when the device can no longer
        send a reading of it again.
        """
        self._sweeps.setdefault(reading.sweep, []).append(replace(reading, trace=None))
        over = [number for number in self._sweeps if self._is_over(number, reading, of_each)]
        return [self._sweeps.pop(number) for number in over]

    def end(self) -> list[list[Reading]]:
        """Return the readings of each sweep that has begun: no more will follow."""
        begun, self._sweeps = self._sweeps, {}
        return [begun[number] for number in sorted(begun)]

    def _is_over(self, number: int, newest: Reading, of_each: int | None) -> bool:
        readings = self._sweeps[number]
        if of_each is not None:  # readings of any sweep may be measured again until it is complete
            return len(readings) >= of_each
        return number < newest.sweep and newest.number - readings[-1].number >= KEPT_READINGS


# a trace as a protobuf message, which log viewers plot: /traces.level[:]; the exact samples are in the frames


FULL_SCALE = 255
_Field = descriptor_pb2.FieldDescriptorProto
_FIELDS = (
    ("reading", _Field.TYPE_UINT32, False),  # number of the reading in its scan
    ("angle_deg", _Field.TYPE_DOUBLE, False),  # turntable angle
    ("rate_hz", _Field.TYPE_DOUBLE, False),
    ("start_s", _Field.TYPE_DOUBLE, False),  # from the start of transmission to the first sample
    ("carrier", _Field.TYPE_BOOL, False),
    ("level", _Field.TYPE_SINT32, True),  # full scale is 255; a lost sample repeats the one before it
    ("lost", _Field.TYPE_UINT32, True),  # indices of lost samples
)


def _message_class() -> type[Any]:
    file = descriptor_pb2.FileDescriptorProto(name="sonarhw/trace.proto", package="sonarhw", syntax="proto3")
    message = file.message_type.add(name="Trace")
    for number, (name, kind, repeated) in enumerate(_FIELDS, start=1):
        label = _Field.LABEL_REPEATED if repeated else _Field.LABEL_OPTIONAL
        message.field.add(name=name, number=number, type=kind, label=label)
    pool = descriptor_pool.DescriptorPool()
    pool.Add(file)
    return message_factory.GetMessageClass(pool.FindMessageTypeByName("sonarhw.Trace"))


TraceMessage = _message_class()


def trace_message(reading: int, angle_deg: float, trace: Trace) -> Any:
    """Return the message of the trace of reading number `reading`, a `TraceMessage`."""
    lost = np.isnan(trace.samples)
    before = np.maximum.accumulate(np.where(lost, 0, np.arange(len(lost))))
    levels = np.nan_to_num(np.rint(trace.samples[before] * FULL_SCALE)).astype(int)
    return TraceMessage(
        reading=reading,
        angle_deg=angle_deg,
        rate_hz=trace.rate,
        start_s=trace.start,
        carrier=trace.carrier,
        level=levels.tolist(),
        lost=np.flatnonzero(lost).tolist(),
    )


# topics, encodings and schemas of the decoded channels, for logs and for live viewers


_READING_SCHEMA = {
    "type": "object",
    "properties": {
        "time": {"type": "number", "description": "start of transmission on the device's clock, s"},
        "sweep": {"type": "integer"},
        "ping": {"type": "integer"},
        "number": {"type": "integer"},
        "angle_deg": {"type": "number", "description": "turntable angle, counter-clockwise"},
        "range_m": {"type": ["number", "null"]},
        "echo_times_s": {"type": "array", "items": {"type": "number"}},
        "speed_of_sound": {"type": ["number", "null"], "description": "m/s"},
        "temperature_c": {"type": ["number", "null"]},
    },
}


@dataclass(frozen=True)
class Channel:
    """How the messages of a topic are encoded."""

    encoding: str
    schema_name: str
    schema_encoding: str
    schema: bytes


def _protobuf(message: Any) -> Channel:
    schema = build_file_descriptor_set(message).SerializeToString()
    return Channel(MessageEncoding.Protobuf, message.DESCRIPTOR.full_name, SchemaEncoding.Protobuf, schema)


_POINT, _TURN = ({"type": "object", "properties": {k: {"type": "number"} for k in axes}} for axes in ("xyz", "xyzw"))
# a viewer such as Foxglove draws the sweeps where they were made
_POSE_SCHEMA = {
    "type": "object",
    "properties": {
        "timestamp": {"type": "object", "properties": {"sec": {"type": "integer"}, "nsec": {"type": "integer"}}},
        "parent_frame_id": {"type": "string"},
        "child_frame_id": {"type": "string"},
        "translation": _POINT,
        "rotation": _TURN,
        "number": {"type": "integer", "description": "number of the reading in its scan"},
        "heading": {"type": "number", "description": "rad, counter-clockwise from x"},
    },
}

DECODED = {
    reader.READINGS: Channel(
        MessageEncoding.JSON, "sonarhw.Reading", SchemaEncoding.JSONSchema, json.dumps(_READING_SCHEMA).encode()
    ),
    reader.SWEEPS: _protobuf(LaserScan),
    reader.TRACES: _protobuf(TraceMessage),
    reader.POSES: Channel(
        MessageEncoding.JSON, "foxglove.FrameTransform", SchemaEncoding.JSONSchema, json.dumps(_POSE_SCHEMA).encode()
    ),
}


def reading_messages(reading: Reading, time: float) -> Iterator[tuple[str, bytes]]:
    """Yield topic and message of a reading made at `time` (s since the epoch), and of pose and trace if it has them."""
    if reading.pose is not None:
        yield reader.POSES, json.dumps(_pose_record(reading.number, reading.pose, time)).encode()
    yield reader.READINGS, json.dumps(_reading_record(reading)).encode()
    if reading.trace is not None:
        message = trace_message(reading.number, math.degrees(reading.angle), reading.trace)
        yield reader.TRACES, message.SerializeToString()


def _pose_record(number: int, pose: RobotPose, time: float) -> dict[str, Any]:
    """Return the JSON fields of a pose: a foxglove.FrameTransform, with the number of its reading and its heading."""
    x, y, heading = pose
    seconds, nanoseconds = divmod(round(reader.possible_time(time) * 1e9), 10**9)
    return {
        "timestamp": {"sec": seconds, "nsec": nanoseconds},
        "parent_frame_id": "room",
        "child_frame_id": FRAME_ID,
        "translation": {"x": x, "y": y, "z": 0.0},
        "rotation": {"x": 0.0, "y": 0.0, "z": math.sin(heading / 2), "w": math.cos(heading / 2)},
        "number": number,
        "heading": heading,
    }


def _reading_record(reading: Reading) -> dict[str, Any]:
    """Return the JSON fields of a reading, in degrees, metres, seconds and °C."""
    return {
        "time": reading.time,
        "sweep": reading.sweep,
        "ping": reading.ping,
        "number": reading.number,
        "angle_deg": math.degrees(reading.angle),
        "range_m": reading.range if reading.range is not None and math.isfinite(reading.range) else None,
        "echo_times_s": reading.echo_times,
        "speed_of_sound": reading.speed_of_sound if math.isfinite(reading.speed_of_sound) else None,
        "temperature_c": reading.temperature_c,
    }


_FRAME_ENCODING = "application/x-sonarhw-frame"


class LogWriter:
    """A log being written; a `sonarhw.host.session.Recorder` and a context manager.

    Raises LogError if the file exists (unless `overwrite`), or cannot be created or written. The file then keeps
    everything up to the last whole reading. A file to be overwritten is unchanged until `close`. Each reading is synced
    to the disk, so that a removed drive has all readings. `warn` is called with one line when the disk is nearly full.
    Any thread may use the writer.

    With the folder `fallback`, a log that can no longer be written (full disk, removed drive, deleted file) is
    continued in a new file there, with everything so far; `warn` is called, and `path` is then the new file.

    An open binary file instead of a path receives a log that is not recorded but written as a whole. The caller closes
    it, and discards it after an error.
    """

    def __init__(
        self,
        file: Path | str | BinaryIO,
        metadata: reader.LogMetadata,
        *,
        overwrite: bool = False,
        warn: Callable[[str], None] | None = None,
        fallback: Path | None = None,
    ) -> None:
        self._lock = threading.RLock()  # one thread may close the log while another records
        self._file: LogFile | WholeLogFile
        if isinstance(file, str | Path):
            self._file = LogFile(Path(file), overwrite, fallback, warn or (lambda _: None))
        else:
            self._file = WholeLogFile(file)
        self._disk_space = DiskSpaceMonitor(self._file.path, warn) if warn else None
        self._scanning = False
        self._scans = 0  # number of scans at the newest Started
        self._decoder = reader.ScanDecoder()
        self._sweeps = OpenSweeps()  # not yet written
        self._time = metadata.started
        self._metadata = metadata
        self._writer = Writer(cast(IO[bytes], self._file), compression=CompressionType.NONE, enable_data_crcs=True)
        self._writer.start(reader.PROFILE)
        self._writer.add_metadata(reader.METADATA_NAME, metadata_record(metadata))
        self._channels = _register_channels(self._writer)
        try:
            self._commit()
        except LogError:
            self.drop()
            raise

    @property
    def path(self) -> Path:
        """Path of the file."""
        return self._file.path

    @property
    def count(self) -> int:
        """Number of readings in the log; frames may complete them before a scan delivers them."""
        return self._file.readings

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind and self._file.disposable:
            self.drop()
        else:
            self.close()

    def frame(self, received: bool, time: float, wire: bytes) -> None:
        """Record one frame's bytes with its delimiter; `time` is in s since the epoch. Raises LogError."""
        self.take(reader.RecordedFrame(time, received, wire))

    def take(self, recorded: reader.RecordedFrame) -> list[Reading]:
        """Record a frame, and return the readings, without traces, that it completes. Raises LogError."""
        with self._lock:
            return self._take(recorded)

    def _take(self, recorded: reader.RecordedFrame) -> list[Reading]:
        self._time = recorded.time
        kind = frame_type(recorded.wire[:-1]) if recorded.received else None
        if kind == messages.Started.TYPE:
            self._commit()  # frames of the previous scan
            self._scanning = True
        # the time as it will be read from the file, in whole ns
        placed = replace(recorded, time=round(recorded.time * 1e9) * 1e-9)
        readings = self._decoder.take(placed, self._file.tell())
        self._file.readings += len(readings)
        if kind == messages.Started.TYPE and self._scans != self._decoder.begun:
            self._scans = self._decoder.begun
            self._end_sweeps()
        self._add(reader.FRAMES_RECEIVED if recorded.received else reader.FRAMES_SENT, recorded.wire)
        if kind in (messages.Finished.TYPE, messages.Info.TYPE):
            self._scanning = False
        if not self._scanning:
            self._commit()
        return readings

    def state_how_read(self, text: str) -> None:
        """Record how the source was read, which may be known only after its first readings. Raises LogError."""
        with self._lock:
            if self._file.closed or text == self._metadata.read_as:
                return
            self._metadata = replace(self._metadata, read_as=text)
            self._writer.add_metadata(reader.METADATA_NAME, metadata_record(self._metadata))
            self._commit()

    def received_bytes(self, time: float, data: bytes) -> None:
        """Record bytes of a device that sends no frames, as received; `time` is in s since the epoch. Raises LogError.

        They are written with the next reading.
        """
        with self._lock:
            self._time = time
            self._add(reader.BYTES, data)

    def reading(self, reading: Reading) -> None:
        """Write one decoded reading, with the frames before it, to disk. Raises LogError."""
        with self._lock:
            self._reading(reading)

    def _reading(self, reading: Reading) -> None:
        for sweep in self._sweeps.add(reading, self._decoder.readings_per_sweep):
            self._end_sweep(sweep)
        if reading.pose is not None:
            self._decoder.place(reading.number, reading.pose)
        for topic, data in reading_messages(reading, self._time if reading.host_time is None else reading.host_time):
            self._add(topic, data)
        self._commit()

    def close(self) -> None:
        """Write the last sweep and the index, and close the file. A second call does nothing. Raises LogError."""
        with self._lock:
            if not self._file.closed:
                self._finish()

    def _finish(self) -> None:
        try:
            self._end_sweeps()
            self._commit()
            index = replace(reader.index_of(self._decoder), read_as=self._metadata.read_as)
            packed = reader.pack_index(index, self._file.tell())
            self._writer.add_attachment(0, round(self._time * 1e9), reader.NAME, reader.MEDIA_TYPE, packed)
            self._writer.finish()  # type: ignore[no-untyped-call]
            self._file.flush()
        finally:
            self._file.close()
        self._file.replace_old_file()

    def drop(self) -> None:
        """Close and remove the log. A file to be overwritten is unchanged."""
        with self._lock:
            self._file.drop()

    def _end_sweeps(self) -> None:
        for sweep in self._sweeps.end():
            self._end_sweep(sweep)

    def _end_sweep(self, readings: list[Reading]) -> None:
        times = [reading.host_time for reading in readings if reading.host_time is not None] or [self._time]
        self._add(reader.SWEEPS, laser_scan(readings, min(times)).SerializeToString(), min(times))

    def _add(self, topic: str, data: bytes, published: float | None = None) -> None:
        if self._file.closed:
            raise LogError(f"{self._file.path}: the log is closed; open a new one")
        logged = round(self._time * 1e9)  # never decreases, as other tools require
        self._writer.add_message(
            self._channels[topic],
            logged,
            data,
            logged if published is None else round(reader.possible_time(published) * 1e9),
        )

    def _commit(self) -> None:
        self._writer.flush()  # type: ignore[no-untyped-call]
        if self._disk_space:
            self._disk_space.written(self._file.tell(), self._time)


def metadata_record(metadata: reader.LogMetadata) -> dict[str, str]:
    """Return the text fields of the MCAP metadata record, with the start time as ISO 8601 in UTC."""
    fields = {
        "format_version": str(metadata.format_version),
        "product_version": metadata.product_version,
        "made_by": metadata.made_by,
        "started": datetime.fromtimestamp(metadata.started, UTC).isoformat(),
        "room_file": metadata.room_file,
        "room_text": metadata.room_text,
        "place": metadata.place,
        "board": metadata.board,
        "board_text": metadata.board_text,
        "source": metadata.source,
        "read_as": metadata.read_as,
    }
    # the name of a file may contain bytes that are not UTF-8
    return {name: text.encode("utf-8", "backslashreplace").decode() for name, text in fields.items()}


def _register_channels(writer: Writer) -> dict[str, int]:
    encodings = {
        reader.FRAMES_RECEIVED: (_FRAME_ENCODING, 0),
        reader.FRAMES_SENT: (_FRAME_ENCODING, 0),
        reader.BYTES: ("application/octet-stream", 0),
    }
    for topic, channel in DECODED.items():
        schema = writer.register_schema(channel.schema_name, channel.schema_encoding, channel.schema)
        encodings[topic] = (channel.encoding, schema)
    return {topic: writer.register_channel(topic, *encodings[topic]) for topic in reader.TOPICS}


def copy_log(log: reader.Log, path: Path, *, overwrite: bool = False) -> int:
    """Write the readable part of `log` to `path`, with index and sweeps, completely or not at all.

    Frames and their times are unchanged, but an impossible time becomes the one before. Returns the number of
    impossible times. Raises OutputError if the file exists (unless `overwrite`) or cannot be written, NotALog if `log`
    can no longer be read.
    """
    times = _PossibleTimes(log.metadata.started)
    metadata = replace(log.metadata, started=times.of(log.metadata.started))
    with atomic_file(path, overwrite=overwrite) as file, LogWriter(file, metadata) as writer:
        poses = {_key(reading): reading.pose for reading in log.readings}
        received = log.frames.received_bytes()
        ahead = next(received, None)
        for frames in log.frames.pieces():
            while ahead is not None and ahead[0] <= frames[-1].time:
                writer.received_bytes(times.of(ahead[0]), ahead[1])
                ahead = next(received, None)
            placed = [replace(frame, time=times.of(frame.time)) for frame in frames]
            for reading in [reading for frame in placed for reading in writer.take(frame)]:
                writer.reading(replace(reading, pose=poses.get(_key(reading))))
        for time, data in (ahead, *received) if ahead else ():
            writer.received_bytes(times.of(time), data)
    return times.impossible


def _key(reading: Reading) -> tuple[int, int]:
    """Return what identifies a reading in a log: its number, and its time in microseconds."""
    return reading.number, round(reading.time * 1e6)


class _PossibleTimes:
    """Replaces times that no log can contain by the one before."""

    def __init__(self, first: float) -> None:
        self.impossible = 0
        self._newest = first if 0 <= first <= reader.LATEST else 0.0

    def of(self, time: float) -> float:
        """Return the time, or the one before if it is impossible; s since the epoch."""
        if 0 <= time <= reader.LATEST:  # not NaN
            self._newest = time
        else:
            self.impossible += 1
        return self._newest


# imported and simulated scans as logs, with the frames that a scanner would have sent


_TICK = 1e-6  # s
_HELLO, _CONFIGURE, _START_SCAN = range(3)  # sequence numbers of the assumed commands


def write_scan(
    path: Path, metadata: reader.LogMetadata, readings: Sequence[Reading], *, overwrite: bool = False
) -> None:
    """Write one scan as a log that starts at `metadata.started`, completely or not at all.

    Decoding restores angles to 1 µdeg, times to 1 µs, ranges to 0.2 µm, traces to 8 bits, and the earliest 122 echoes.
    Readings are numbered again in their order. Readings with equal or decreasing times are set 1 µs apart.

    Raises OutputError if the file exists (unless `overwrite`) or cannot be written, and ValueError if a value does not
    fit into a frame.
    """
    with atomic_file(path, overwrite=overwrite) as file, LogWriter(file, metadata) as writer:
        for frames, reading in _encode(metadata, readings):
            for time, wire in frames:
                writer.frame(True, metadata.started + time, wire)
            if reading is not None:
                writer.reading(reading)


_Stamped = tuple[float, bytes]  # s since the scan began, frame


def _encode(
    metadata: reader.LogMetadata, readings: Sequence[Reading]
) -> Iterator[tuple[list[_Stamped], Reading | None]]:
    """Yield the frames of a scan in pieces, each with its reading."""
    sequence = count()

    def stamped(message: messages.Message, time: float) -> _Stamped:
        frame = Frame(message.TYPE, next(sequence) % 0x10000, messages.microseconds_of(time), message.pack())
        return time, encode_frame(frame)

    settings = _settings(readings)
    greeting = (_info(metadata, readings), settings, messages.Started(_START_SCAN, len(readings)))
    yield [stamped(message, 0.0) for message in greeting], None
    first = min((reading.time for reading in readings), default=0.0)
    time, fired = 0.0, -_TICK
    for number, reading in enumerate(readings):
        # a ping is identified by its time, so two pings must not have the same time
        fired = max(reading.time - first, fired + _TICK)
        reading = replace(reading, number=number, time=fired)
        time = max(time, reading.time + messages.seconds_of(settings.listen_us))
        frames = [stamped(reading_message(reading, settings.speed_of_sound), time)]
        if reading.trace is not None:
            frames += [stamped(chunk, time) for chunk in trace_chunks(number, reading.trace)]
        yield frames, reading
    yield [stamped(messages.Finished(_START_SCAN, messages.Outcome.DONE, len(readings), ""), time)], None


def _speed_of_sound(readings: Sequence[Reading]) -> int:
    speed = readings[0].speed_of_sound if readings else 0.0
    if readings and not (math.isfinite(speed) and speed >= 1):
        raise ValueError(f"reading 0 has a speed of sound of {speed} m/s; expected at least 1 m/s")
    return messages.millimetres_per_second_of(speed)


def _info(metadata: reader.LogMetadata, readings: Sequence[Reading]) -> messages.Info:
    traces = [reading.trace for reading in readings if reading.trace is not None]
    # the origin of a log follows from its writer and this name
    is_fake = bool(readings) and readings[0].origin is Origin.FAKE
    maker = FAKE_FIRMWARE if is_fake else f"sonarhw {metadata.made_by}"
    return messages.Info(
        command=_HELLO,
        major=PROTOCOL_MAJOR,
        minor=PROTOCOL_MINOR,
        firmware=f"{maker} {metadata.product_version}",
        serial="",
        board=metadata.board,
        temperature=messages.centidegrees_of(readings[0].temperature_c if readings else None),
        trace_rate=round(traces[0].rate) if traces else 0,
        microsteps=0,
    )


def _settings(readings: Sequence[Reading]) -> messages.Settings:
    traces = [reading.trace for reading in readings if reading.trace is not None]
    ends = [reading.echo_times[-1] for reading in readings if reading.echo_times]
    ends += [trace.start + len(trace.samples) / trace.rate for trace in traces]
    return messages.Settings(
        command=_CONFIGURE,
        listen_us=math.ceil(max(ends, default=0.0) * 1e6),
        blanking_us=0,
        trace=int(bool(traces)),
        speed_of_sound=_speed_of_sound(readings),
    )
