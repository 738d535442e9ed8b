"""Write a log: an uncompressed MCAP file with one chunk per reading.

The file is readable even if the process is killed. During a scan, each reading is written at once, in one chunk with
its frames. Otherwise each frame is written at once. So a killed process loses at most the frames of the current
reading. Closing adds the index, with which a log of an hour opens at once.
"""

import threading
from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from types import TracebackType
from typing import IO, BinaryIO, Self, cast

from mcap.writer import CompressionType, Writer

from sonarhw.disk_space import DiskSpaceMonitor
from sonarhw.errors import LogError
from sonarhw.log.appended_file import LogFile, WholeLogFile
from sonarhw.log.contents import (
    BYTES,
    FRAMES_RECEIVED,
    FRAMES_SENT,
    METADATA_NAME,
    PROFILE,
    SWEEPS,
    TOPICS,
    LogMetadata,
    RecordedFrame,
)
from sonarhw.log.index import MEDIA_TYPE, NAME, index_of, pack_index
from sonarhw.log.recorded_scans import ScanDecoder
from sonarhw.log.viewer.channels import DECODED, reading_messages
from sonarhw.log.viewer.laser_scan import laser_scan
from sonarhw.log.viewer.open_sweeps import OpenSweeps
from sonarhw.readings import Reading
from sonarhw.wire.frames import frame_type
from sonarhw.wire.messages import Finished, Info, Started

_FRAME_ENCODING = "application/x-sonarhw-frame"


class LogWriter:
    """A log being written; a `sonarhw.host.recorder.Recorder` and a context manager.

    Raises LogError if the file exists (unless `overwrite`), or cannot be created or written. The file then keeps
    everything up to the last whole reading. A file to be overwritten is unchanged until the first reading, or `close`.
    Each reading is synced to the disk, so that a removed drive has all readings. `warn` is called with one line when
    the disk is nearly full. Any thread may use the writer.

    An open binary file instead of a path receives a log that is not recorded but written as a whole. The caller closes
    it, and discards it after an error.
    """

    def __init__(
        self,
        file: Path | str | BinaryIO,
        metadata: LogMetadata,
        *,
        overwrite: bool = False,
        warn: Callable[[str], None] | None = None,
    ) -> None:
        self._lock = threading.RLock()  # one thread may close the log while another records
        self._file = LogFile(Path(file), overwrite) if isinstance(file, str | Path) else WholeLogFile(file)
        self._disk_space = DiskSpaceMonitor(self._file.path, warn) if warn else None
        self._scanning = False
        self._scans = 0  # number of scans at the newest Started
        self._decoder = ScanDecoder()
        self._sweeps = OpenSweeps()  # not yet written
        self._time = metadata.started
        self._writer = Writer(cast(IO[bytes], self._file), compression=CompressionType.NONE, enable_data_crcs=True)
        self._writer.start(PROFILE)
        self._writer.add_metadata(METADATA_NAME, metadata_record(metadata))
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
        self.take(RecordedFrame(time, received, wire))

    def take(self, recorded: RecordedFrame) -> list[Reading]:
        """Record a frame, and return the readings, without traces, that it completes. Raises LogError."""
        with self._lock:
            return self._take(recorded)

    def _take(self, recorded: RecordedFrame) -> list[Reading]:
        self._time = recorded.time
        kind = frame_type(recorded.wire[:-1]) if recorded.received else None
        if kind == Started.TYPE:
            self._commit()  # frames of the previous scan
            self._scanning = True
        # the time as it will be read from the file, in whole ns
        placed = replace(recorded, time=round(recorded.time * 1e9) * 1e-9)
        readings = self._decoder.take(placed, self._file.tell())
        self._file.readings += len(readings)
        if kind == Started.TYPE and self._scans != self._decoder.begun:
            self._scans = self._decoder.begun
            self._end_sweeps()
        self._add(FRAMES_RECEIVED if recorded.received else FRAMES_SENT, recorded.wire)
        if kind in (Finished.TYPE, Info.TYPE):
            self._scanning = False
        if not self._scanning:
            self._commit()
        return readings

    def received_bytes(self, time: float, data: bytes) -> None:
        """Record bytes of a device that sends no frames, as received; `time` is in s since the epoch. Raises LogError.

        They are written with the next reading.
        """
        with self._lock:
            self._time = time
            self._add(BYTES, data)

    def reading(self, reading: Reading) -> None:
        """Write one decoded reading, with the frames before it, to disk. Raises LogError."""
        with self._lock:
            self._reading(reading)

    def _reading(self, reading: Reading) -> None:
        for sweep in self._sweeps.add(reading, self._decoder.readings_per_sweep):
            self._end_sweep(sweep)
        for topic, data in reading_messages(reading):
            self._add(topic, data)
        self._file.replace_old_file()
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
            self._file.replace_old_file()
            index = pack_index(index_of(self._decoder), self._file.tell())
            self._writer.add_attachment(0, round(self._time * 1e9), NAME, MEDIA_TYPE, index)
            self._writer.finish()  # type: ignore[no-untyped-call]
            self._file.flush()
        finally:
            self._file.close()

    def drop(self) -> None:
        """Close and remove the log. A file to be overwritten is unchanged."""
        with self._lock:
            self._file.drop()

    def _end_sweeps(self) -> None:
        for sweep in self._sweeps.end():
            self._end_sweep(sweep)

    def _end_sweep(self, readings: list[Reading]) -> None:
        times = [reading.host_time for reading in readings if reading.host_time is not None] or [self._time]
        self._add(SWEEPS, laser_scan(readings, min(times)).SerializeToString(), min(times))

    def _add(self, topic: str, data: bytes, published: float | None = None) -> None:
        if self._file.closed:
            raise LogError(f"{self._file.path}: the log is closed; open a new one")
        logged = round(self._time * 1e9)  # never decreases, as other tools require
        self._writer.add_message(
            self._channels[topic], logged, data, logged if published is None else round(published * 1e9)
        )

    def _commit(self) -> None:
        self._writer.flush()  # type: ignore[no-untyped-call]
        if self._disk_space:
            self._disk_space.written(self._file.tell(), self._time)


def metadata_record(metadata: LogMetadata) -> dict[str, str]:
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
    }
    # the name of a file may contain bytes that are not UTF-8
    return {name: text.encode("utf-8", "backslashreplace").decode() for name, text in fields.items()}


def _register_channels(writer: Writer) -> dict[str, int]:
    encodings = {
        FRAMES_RECEIVED: (_FRAME_ENCODING, 0),
        FRAMES_SENT: (_FRAME_ENCODING, 0),
        BYTES: ("application/octet-stream", 0),
    }
    for topic, channel in DECODED.items():
        schema = writer.register_schema(channel.schema_name, channel.schema_encoding, channel.schema)
        encodings[topic] = (channel.encoding, schema)
    return {topic: writer.register_channel(topic, *encodings[topic]) for topic in TOPICS}
