"""Write imported and simulated scans as logs, with the frames that a scanner would have sent.

So all logs are decoded in the same way. Only their metadata shows whether a scan was recorded, imported or simulated.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from sonarhw.atomic_file import atomic_file
from sonarhw.log.contents import LogMetadata
from sonarhw.log.writer import LogWriter
from sonarhw.readings import Reading
from sonarhw.wire.codes import Outcome
from sonarhw.wire.frames import Frame, encode_frame
from sonarhw.wire.limits import PROTOCOL_MAJOR, PROTOCOL_MINOR
from sonarhw.wire.messages import Finished, Info, Message, Settings, Started
from sonarhw.wire.reading_messages import reading_message, trace_chunks
from sonarhw.wire.units import centidegrees_of, microseconds_of, millimetres_per_second_of, seconds_of

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
