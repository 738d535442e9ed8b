"""Writes a log: an uncompressed MCAP file with one chunk a reading, on disk before the next ping.

Takes frames and readings as a Recorder; hands on a file that is readable however the process ends. While a scan runs,
frames wait for their reading and leave with it in one chunk; while none runs, each frame is written at once. So a
killed process loses at most the frames of the reading in flight.
"""

import json
import math
import os
from datetime import UTC, datetime
from io import FileIO
from pathlib import Path
from types import TracebackType
from typing import IO, Any, Self, cast

from foxglove_schemas_protobuf.LaserScan_pb2 import LaserScan
from mcap.well_known import MessageEncoding, SchemaEncoding
from mcap.writer import CompressionType, Writer
from mcap_protobuf.schema import register_schema

from sonarhw.arrivals import KEPT
from sonarhw.errors import LogError
from sonarhw.frames import Frame, decode_block
from sonarhw.laser_scan import laser_scan
from sonarhw.log_contents import (
    FRAMES_RECEIVED,
    FRAMES_SENT,
    METADATA_NAME,
    PROFILE,
    READINGS,
    SWEEPS,
    LogMetadata,
)
from sonarhw.messages import Finished, Info, Started
from sonarhw.readings import Reading

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
        "temperature_c": {"type": ["number", "null"]},
    },
}
_FRAME_ENCODING = "application/x-sonarhw-frame"


class LogWriter:
    """A log being written; a `sonarhw.recorder.Recorder` and a context manager.

    Raises LogError where the file exists (unless `overwrite`), cannot be made, or no longer takes what is written;
    the file then keeps everything up to the last whole reading.
    """

    def __init__(self, path: Path, metadata: LogMetadata, *, overwrite: bool = False) -> None:
        self._file = _WholeWrites(path, overwrite)
        self._scanning = False
        self._sweeps: dict[int, list[Reading]] = {}  # not yet written, by number
        self._time = metadata.started
        self._writer = Writer(cast(IO[bytes], self._file), compression=CompressionType.NONE)
        self._writer.start(PROFILE)
        self._writer.add_metadata(METADATA_NAME, metadata_record(metadata))
        self._channels = _register_channels(self._writer)
        self._file.flush()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def frame(self, received: bool, time: float, wire: bytes) -> None:
        """Keep one frame's bytes with its delimiter; `time` in s since the epoch. Raises LogError."""
        self._time = time
        frame = decode_block(wire[:-1]) if received else None
        if isinstance(frame, Frame) and frame.type == Started.TYPE:
            self._end_sweeps()
            self._scanning = True
        self._add(FRAMES_RECEIVED if received else FRAMES_SENT, wire)
        if isinstance(frame, Frame) and frame.type in (Finished.TYPE, Info.TYPE):
            self._scanning = False
        if not self._scanning:
            self._commit()

    def reading(self, reading: Reading) -> None:
        """Keep one decoded reading and write it, with the frames before it, to disk. Raises LogError."""
        self._sweeps.setdefault(reading.sweep, []).append(reading)
        for sweep, readings in [*self._sweeps.items()]:
            # until then the device may send one of them again
            if sweep < reading.sweep and reading.number - readings[-1].number >= KEPT:
                self._end_sweep(sweep)
        self._add(READINGS, json.dumps(reading_record(reading)).encode())
        self._commit()

    def close(self) -> None:
        """Write the last sweep and the index, and close the file; a second call does nothing. Raises LogError."""
        if self._file.closed:
            return
        try:
            self._end_sweeps()
            self._writer.finish()  # type: ignore[no-untyped-call]
            self._file.flush()
        finally:
            self._file.close()

    def _end_sweeps(self) -> None:
        for sweep in sorted(self._sweeps):
            self._end_sweep(sweep)

    def _end_sweep(self, sweep: int) -> None:
        self._add(SWEEPS, laser_scan(self._sweeps.pop(sweep), self._time).SerializeToString())

    def _add(self, topic: str, data: bytes) -> None:
        if self._file.closed:
            raise LogError(f"{self._file.path}: the log is closed; nothing can be added to it")
        nanoseconds = round(self._time * 1e9)
        self._writer.add_message(self._channels[topic], nanoseconds, data, nanoseconds)

    def _commit(self) -> None:
        self._writer.flush()  # type: ignore[no-untyped-call]


class _WholeWrites:
    """The file under the MCAP writer: gathers what it writes and gives it to the system in one piece at `flush`."""

    def __init__(self, path: Path, overwrite: bool) -> None:
        self.path = path
        self._pending = bytearray()
        self._written = 0
        try:
            # a device or a pipe is always there, and nothing in it can be lost
            device = path.exists() and not path.is_file() and not path.is_dir()
            self._file = FileIO(path, "wb" if overwrite or device else "xb")
        except FileExistsError as error:
            raise LogError(f"{path}: exists already; choose another name or overwrite it on purpose") from error
        except OSError as error:
            raise LogError(f"{path}: cannot be written: {error.strerror}") from error

    @property
    def closed(self) -> bool:
        """Whether nothing can be written any more."""
        return self._file.closed

    def write(self, data: bytes) -> int:
        """Keep the bytes for the next `flush`."""
        self._pending += data
        return len(data)

    def tell(self) -> int:
        """Offset in the file of the next byte written."""
        return self._written + len(self._pending)

    def flush(self) -> None:
        """Give everything to the system. On failure cut the file behind its last whole piece and raise LogError."""
        try:
            left = memoryview(bytes(self._pending))
            while left:
                left = left[self._file.write(left) :]
            links = os.fstat(self._file.fileno()).st_nlink
        except OSError as error:
            self._give_up()
            raise LogError(f"{self.path}: {self._what_is_left(error.strerror)}") from error
        if links == 0:
            self._give_up()
            raise LogError(f"{self.path}: was deleted while it was being written; record into another folder")
        self._written += len(self._pending)
        self._pending.clear()

    def close(self) -> None:
        """Close the file; what was not flushed is dropped."""
        self._file.close()

    def _what_is_left(self, reason: str | None) -> str:
        if not self._written:
            return f"cannot be written: {reason}; nothing is recorded, choose another file"
        return f"cannot be written any further: {reason}; the first {self._written} bytes are a readable log"

    def _give_up(self) -> None:
        try:
            self._file.truncate(self._written)
        except OSError:
            pass  # then the reader finds where the last whole piece ends
        finally:
            self._file.close()


def metadata_record(metadata: LogMetadata) -> dict[str, str]:
    """The metadata as the text fields of an MCAP metadata record; the start time as ISO 8601 in UTC."""
    return {
        "format_version": str(metadata.format_version),
        "product_version": metadata.product_version,
        "made_by": metadata.made_by,
        "started": datetime.fromtimestamp(metadata.started, UTC).isoformat(),
        "room_file": metadata.room_file,
        "room_text": metadata.room_text,
        "place": metadata.place,
        "board": metadata.board,
    }


def reading_record(reading: Reading) -> dict[str, Any]:
    """The reading as it lies on the channel of decoded readings: degrees, metres, seconds, °C."""
    return {
        "time": reading.time,
        "sweep": reading.sweep,
        "ping": reading.ping,
        "number": reading.number,
        "angle_deg": math.degrees(reading.angle),
        "range_m": reading.range if reading.range is not None and math.isfinite(reading.range) else None,
        "echo_times_s": reading.echo_times,
        "temperature_c": reading.temperature_c,
    }


def _register_channels(writer: Writer) -> dict[str, int]:
    decoded = writer.register_schema("sonarhw.Reading", SchemaEncoding.JSONSchema, json.dumps(_READING_SCHEMA).encode())
    return {
        FRAMES_RECEIVED: writer.register_channel(FRAMES_RECEIVED, _FRAME_ENCODING, schema_id=0),
        FRAMES_SENT: writer.register_channel(FRAMES_SENT, _FRAME_ENCODING, schema_id=0),
        READINGS: writer.register_channel(READINGS, MessageEncoding.JSON, decoded),
        SWEEPS: writer.register_channel(SWEEPS, MessageEncoding.Protobuf, register_schema(writer, LaserScan)),
    }
