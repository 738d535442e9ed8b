"""Export of readings as CSV and NPZ, encoding of readings as a log, and publication for Foxglove."""

import logging
import math
import time
import zipfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, BinaryIO, Self, cast

import numpy as np
from numpy.typing import NDArray

from sonarhw.device.served import host_and_port
from sonarhw.errors import LinkError, MissingExtra, harmless
from sonarhw.files import atomic_file
from sonarhw.log.reader import SWEEPS, LogMetadata
from sonarhw.log.writer import DECODED, LogWriter, laser_scan, reading_messages
from sonarhw.readings import FloatArray, Reading
from sonarhw.wire.frames import Frame, encode_frame
from sonarhw.wire.messages import (
    PROTOCOL_MAJOR,
    PROTOCOL_MINOR,
    Finished,
    Info,
    Message,
    Outcome,
    Settings,
    Started,
    centidegrees_of,
    microseconds_of,
    millimetres_per_second_of,
    seconds_of,
)
from sonarhw.wire.readings_of_frames import reading_message, trace_chunks

if TYPE_CHECKING:
    from sonarhw.log import Log

# Readings as lines of CSV, in degrees and metres: the output of `scan --print` and of `log export`.


_FORMULA = tuple("=+-@＝＋－＠")  # first characters of a formula; a tab and a line break are escaped
HEADER = "time_s,heading_deg,range_m,echoes_s"
_QUOTED = tuple(',"')  # characters in a cell that needs quotes; line breaks are escaped


def row(reading: "Reading", began: float) -> str:
    """Return one line with the columns of HEADER. Echo times are separated by `;`.

    `time_s` counts from `began`, the start of the scan on the clock of `Reading.time`, s. Without an echo, range and
    echo times are empty.
    """
    distance = "" if reading.range is None else number(reading.range)
    echoes = ";".join(map(number, reading.echo_times))
    return f"{number(reading.time - began)},{number(math.degrees(reading.angle))},{distance},{echoes}"


def write_csv(log: "Log", file: BinaryIO, notes: Mapping[int, str]) -> None:
    """Write the readings of all scans to `file`: a header, then one line per reading.

    `notes`: by the place of their reading in the log, from 0. With any, `note` is a fifth column.
    """
    file.write(f"{HEADER}{',note' if notes else ''}\n".encode())
    place = 0
    for scan in log.scans:
        for reading in scan.readings:
            note = f",{_quoted(text_cell(notes.get(place, '')))}" if notes else ""
            file.write(f"{row(reading, scan.began)}{note}\n".encode())
            place += 1


def number(value: float) -> str:
    """Return a number with 9 significant digits, as in every CSV of this project; never `-0`."""
    return f"{value + 0.0:.9g}"


def text_cell(text: str) -> str:
    """Return a name as a CSV cell. No spreadsheet takes it for a formula; control characters are escapes.

    See OWASP, CSV injection: a cell that begins with one of `=+-@` is a formula, and may start a program.
    """
    cell = harmless(text)
    return f"'{cell}" if cell.startswith(_FORMULA) and not _is_number(cell) else cell


def _quoted(cell: str) -> str:
    return '"' + cell.replace('"', '""') + '"' if any(mark in cell for mark in _QUOTED) else cell


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


# Write imported and simulated scans as logs, with the frames that a scanner would have sent.
#
# So all logs are decoded in the same way. Only their metadata shows whether a scan was recorded, imported or
# simulated.


_TICK = 1e-6  # s
_HELLO, _CONFIGURE, _START_SCAN = range(3)  # sequence numbers of the assumed commands


def write_scan(path: Path, metadata: LogMetadata, readings: Sequence[Reading], *, overwrite: bool = False) -> None:
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


def _encode(metadata: LogMetadata, readings: Sequence[Reading]) -> Iterator[tuple[list[_Stamped], Reading | None]]:
    """Yield the frames of a scan in pieces, each with its reading."""
    sender = _Sender()
    settings = _settings(readings)
    greeting = (_info(metadata, readings), settings, Started(_START_SCAN, len(readings)))
    yield [sender.send(message, 0.0) for message in greeting], None
    first = min((reading.time for reading in readings), default=0.0)
    time, fired = 0.0, -_TICK
    for number, reading in enumerate(readings):
        # a ping is identified by its time, so two pings must not have the same time
        fired = max(reading.time - first, fired + _TICK)
        reading = replace(reading, number=number, time=fired)
        time = max(time, reading.time + seconds_of(settings.listen_us))
        frames = [sender.send(reading_message(reading, settings.speed_of_sound), time)]
        if reading.trace is not None:
            frames += [sender.send(chunk, time) for chunk in trace_chunks(number, reading.trace)]
        yield frames, reading
    yield [sender.send(Finished(_START_SCAN, Outcome.DONE, len(readings), ""), time)], None


class _Sender:
    """Encodes messages like a device that was switched on at the start of the scan."""

    def __init__(self) -> None:
        self._sequence = 0

    def send(self, message: Message, time: float) -> _Stamped:
        """Return `time` (s since the start of the scan) and the frame of a message sent then."""
        frame = Frame(message.TYPE, self._sequence, microseconds_of(time), message.pack())
        self._sequence = (self._sequence + 1) % 0x10000
        return time, encode_frame(frame)


def _speed_of_sound(readings: Sequence[Reading]) -> int:
    speed = readings[0].speed_of_sound if readings else 0.0
    if readings and not (math.isfinite(speed) and speed >= 1):
        raise ValueError(f"reading 0 has a speed of sound of {speed} m/s; expected at least 1 m/s")
    return millimetres_per_second_of(speed)


def _info(metadata: LogMetadata, readings: Sequence[Reading]) -> Info:
    traces = [reading.trace for reading in readings if reading.trace is not None]
    return Info(
        command=_HELLO,
        major=PROTOCOL_MAJOR,
        minor=PROTOCOL_MINOR,
        firmware=f"sonarhw {metadata.made_by} {metadata.product_version}",
        serial="",
        board=metadata.board,
        temperature=centidegrees_of(readings[0].temperature_c if readings else None),
        trace_rate=round(traces[0].rate) if traces else 0,
        microsteps=0,
    )


def _settings(readings: Sequence[Reading]) -> Settings:
    traces = [reading.trace for reading in readings if reading.trace is not None]
    ends = [reading.echo_times[-1] for reading in readings if reading.echo_times]
    ends += [trace.start + len(trace.samples) / trace.rate for trace in traces]
    return Settings(
        command=_CONFIGURE,
        listen_us=math.ceil(max(ends, default=0.0) * 1e6),
        blanking_us=0,
        trace=int(bool(traces)),
        speed_of_sound=_speed_of_sound(readings),
    )


# The file formats in which readings are exported, by `sonarhw log export` and by Export data in the window.
#
# To add a format, write a function `write_x(log, file, notes)` in a new module and add an entry to FORMATS. The
# command, its help, the window's file dialog and its tooltip follow.


@dataclass(frozen=True)
class ExportFormat:
    """One file format."""

    suffix: str  # of the file name, in lower case
    title: str  # in a file dialog
    write: "Callable[[Log, BinaryIO, Mapping[int, str]], None]"  # notes by the place of their reading in the log


def _write_npz(log: "Log", file: BinaryIO, notes: Mapping[int, str]) -> None:

    write_npz(log, file, notes)


# `--out -` writes the first format
FORMATS = (
    ExportFormat(".csv", "Readings", write_csv),
    ExportFormat(".npz", "Readings with traces, for NumPy", _write_npz),
)


def export_suffixes() -> tuple[str, ...]:
    """Return the suffix of every format, in order."""
    return tuple(known.suffix for known in FORMATS)


def export_format(suffix: str) -> ExportFormat:
    """Return the format with this suffix. Raises KeyError for any other."""
    return {known.suffix: known for known in FORMATS}[suffix]


# Export of readings as named arrays in an .npz file, one row per reading.
#
# Traces are written one by one, because the traces of an hour do not fit into memory.


_TRACE_TYPE = np.dtype("<f4")  # represents 16-bit samples exactly
_FAST = 1  # deflate level; the highest level saves less than a tenth and takes many times as long


def write_npz(log: "Log", file: BinaryIO, notes: Mapping[int, str]) -> None:
    """Write the readings of all scans to `file`.

    One row per reading: `scan`, `number`, `sweep`, `ping`; `time_s` since the start of its scan; `heading_deg`, the
    turntable angle; `range_m`, NaN without an echo; `echoes_s` (n, most echoes), padded with NaN; `temperature_c`, NaN
    without a thermometer; `speed_of_sound`. With traces also `traces` (n, longest) float32, padded with NaN,
    `trace_rate_hz` and `trace_start_s`. With `notes`, by the place of their reading in the log, also `notes`, empty for
    readings without one. Raises NotALog if a trace can no longer be read.
    """
    rows = [(index, scan, reading) for index, scan in enumerate(log.scans) for reading in scan.readings]
    readings = [reading for _, _, reading in rows]
    columns = {
        "scan": np.array([index for index, _, _ in rows], np.int64),
        "number": np.array([reading.number for reading in readings], np.int64),
        "sweep": np.array([reading.sweep for reading in readings], np.int64),
        "ping": np.array([reading.ping for reading in readings], np.int64),
        "time_s": np.array([reading.time - scan.began for _, scan, reading in rows], np.float64),
        "heading_deg": np.array([math.degrees(reading.angle) for reading in readings], np.float64),
        "range_m": _floats([reading.range for reading in readings]),
        "echoes_s": _padded([reading.echo_times for reading in readings]),
        "temperature_c": _floats([reading.temperature_c for reading in readings]),
        "speed_of_sound": np.array([reading.speed_of_sound for reading in readings], np.float64),
    }
    if notes:
        columns["notes"] = np.array([notes.get(place, "") for place in range(len(rows))], np.str_)
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED, compresslevel=_FAST) as archive:
        for name, column in columns.items():
            write_array(archive, name, column.shape, column.dtype, [column])
        if any(reading.trace for reading in readings):
            _write_traces(archive, readings)


def _write_traces(archive: zipfile.ZipFile, readings: Sequence[Reading]) -> None:
    traces = [reading.trace for reading in readings]
    facts = [(len(trace.samples), trace.rate, trace.start) if trace else (0, math.nan, math.nan) for trace in traces]
    sizes, rates, starts = np.array(facts, np.float64).T
    write_array(archive, "trace_rate_hz", rates.shape, rates.dtype, [rates])
    write_array(archive, "trace_start_s", starts.shape, starts.dtype, [starts])
    longest = int(sizes.max())

    def rows() -> Iterator[NDArray[np.float32]]:
        for trace in traces:
            row = np.full(longest, np.nan, _TRACE_TYPE)
            if trace:
                row[: len(trace.samples)] = trace.samples
            yield row

    write_array(archive, "traces", (len(traces), longest), _TRACE_TYPE, rows())


def write_array(
    archive: zipfile.ZipFile, name: str, shape: tuple[int, ...], kind: np.dtype[Any], pieces: Iterable[NDArray[Any]]
) -> None:
    """Write an array of shape `shape` piece by piece, in the format of `np.savez`."""
    header = {"shape": shape, "fortran_order": False, "descr": np.lib.format.dtype_to_descr(kind)}
    with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
        np.lib.format.write_array_header_2_0(cast(BinaryIO, member), header)
        for piece in pieces:
            member.write(np.ascontiguousarray(piece).tobytes())


def _floats(values: Sequence[float | None]) -> FloatArray:
    return np.array([math.nan if value is None else value for value in values], np.float64)


def _padded(rows: Sequence[Sequence[float]]) -> FloatArray:
    table = np.full((len(rows), max(map(len, rows), default=0)), np.nan)
    for line, row in zip(table, rows, strict=True):
        line[: len(row)] = row
    return table


# Publish readings while they are measured, on the WebSocket of Foxglove, with the channels of a log.


_LAST_SENT_WITHIN = 1.0  # s; the SDK drops what it has not sent when it stops, and does not report when all is sent
PREDICTION = "/prediction"  # a LaserScan for each one of /scan, at the same headings and with the same time


class FoxgloveServer:
    """A WebSocket server for any number of viewers; a context manager.

    The SDK sends in its own threads. It drops the oldest messages of a viewer that reads too slowly.
    """

    def __init__(self, address: str) -> None:
        """Listen on HOST:PORT; port 0 selects a free one. Raises InputError, LinkError and MissingExtra."""
        try:
            import foxglove
        except ImportError as error:
            raise MissingExtra("a server for Foxglove needs its SDK", "foxglove") from error
        logging.getLogger("foxglove").setLevel(logging.CRITICAL)  # a viewer that leaves is no error
        host, port = host_and_port(address)
        self._context = context = foxglove.Context()  # a channel closes without it
        self._channels = {
            topic: foxglove.Channel(
                topic,
                message_encoding=channel.encoding,
                schema=foxglove.Schema(name=channel.schema_name, encoding=channel.schema_encoding, data=channel.schema),
                context=context,
            )
            for topic, channel in {**DECODED, PREDICTION: DECODED[SWEEPS]}.items()
        }
        try:
            self._server = foxglove.start_server(name="sonarhw", host=host, port=port, context=context)
        except RuntimeError as error:
            reason = str(error).rpartition("Failed to bind port: ")[2].partition(" (os error")[0]
            raise LinkError(f"{address}: cannot listen there: {reason}; try 127.0.0.1:0") from error
        self.url = f"ws://{host}:{self._server.port}"

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            if any(channel.has_sinks() for channel in self._channels.values()):
                time.sleep(_LAST_SENT_WITHIN)
        finally:
            self._server.stop()

    def reading(self, reading: Reading) -> None:
        """Publish a reading and its trace."""
        at = time.time() if reading.host_time is None else reading.host_time
        for topic, data in reading_messages(reading):
            self._channels[topic].log(data, log_time=round(at * 1e9))

    def sweep(self, readings: Sequence[Reading], predicted: Sequence[float | None] | None = None) -> None:
        """Publish a sweep, and the predicted ranges of its readings (m; None: no echo) beside it."""
        times = [reading.host_time for reading in readings if reading.host_time is not None]
        began = min(times, default=time.time())
        self._scan(SWEEPS, readings, began)
        if predicted is not None:
            self._scan(PREDICTION, [_at_range(*pair) for pair in zip(readings, predicted, strict=True)], began)

    def _scan(self, topic: str, readings: Sequence[Reading], began: float) -> None:
        self._channels[topic].log(laser_scan(readings, began).SerializeToString(), log_time=time.time_ns())


def _at_range(reading: Reading, distance: float | None) -> Reading:
    """Return the reading with an echo at that range only."""
    echoes = () if distance is None else (2 * distance / reading.speed_of_sound,)
    return replace(reading, echo_times=echoes)
