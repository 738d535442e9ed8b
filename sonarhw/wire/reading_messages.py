"""Readings and traces as the messages that carry them; `assembly` does the reverse.

Takes the plain values; hands on messages, rounded to what the wire carries.
"""

from collections.abc import Iterator

import numpy as np

from sonarhw.readings import Reading, Trace
from sonarhw.wire.assembly import FULL_SCALE, microdegrees_of
from sonarhw.wire.messages import MAX_ECHOES, NO_TEMPERATURE, ReadingMessage, TraceChunk, TraceKind

CHUNK = 256  # samples


def reading_message(reading: Reading, speed_of_sound: int) -> ReadingMessage:
    """The message of a reading where the settings in force carry `speed_of_sound`, mm/s: the same ranges.

    Of more than MAX_ECHOES echoes it has the earliest. Packing it raises MessageError where a value does not fit.
    """
    scale = reading.speed_of_sound / (speed_of_sound * 1e-3) * 1e9
    return ReadingMessage(
        number=reading.number,
        sweep=reading.sweep,
        ping=reading.ping,
        angle=microdegrees_of(reading.angle),
        fired_us=round(reading.time * 1e6),
        temperature=centidegrees_of(reading.temperature_c),
        echoes=tuple(round(time * scale) for time in reading.echo_times[:MAX_ECHOES]),
    )


def trace_chunks(number: int, trace: Trace) -> Iterator[TraceChunk]:
    """The messages that carry the trace of reading `number`, 8 bits a sample; a trace beyond 65 535 samples is cut.

    A stretch that was lost on a line before (NaN) stays lost.
    """
    samples = (trace.samples[:0xFFFF] + 1) / 2 if trace.carrier else trace.samples[:0xFFFF]
    levels = np.clip(np.rint(samples * FULL_SCALE), 0, FULL_SCALE)
    kind = TraceKind.CARRIER if trace.carrier else TraceKind.ENVELOPE
    period, start = round(1e9 / trace.rate), round(trace.start * 1e9)
    for offset in range(0, len(levels), CHUNK):
        stretch = levels[offset : offset + CHUNK]
        if not np.isnan(stretch).any():
            yield TraceChunk(number, offset, len(levels), period, start, stretch.astype(np.uint8).tobytes(), kind)


def centidegrees_of(temperature_c: float | None) -> int:
    """Temperature for a message."""
    return NO_TEMPERATURE if temperature_c is None else round(temperature_c * 100)
