"""Conversion of readings, traces and scan orders to messages. `assembly` converts messages to readings and traces."""

from collections.abc import Iterator

import numpy as np

from sonarhw.readings import Reading, ScanOrder, Trace
from sonarhw.wire.codes import TraceKind
from sonarhw.wire.limits import CHUNK, MAX_ECHOES
from sonarhw.wire.messages import ReadingMessage, StartScan, TraceChunk
from sonarhw.wire.units import FULL_SCALE, centidegrees_of, microdegrees_of, microseconds_of, nanoseconds_of, radians_of


def reading_message(reading: Reading, speed_of_sound: int) -> ReadingMessage:
    """Return the message of a reading, with echo times that give the same ranges at `speed_of_sound`, mm/s.

    Contains the earliest MAX_ECHOES echoes. Packing raises MessageError if a value does not fit.
    """
    scale = reading.speed_of_sound / (speed_of_sound * 1e-3) * 1e9
    return ReadingMessage(
        number=reading.number,
        sweep=reading.sweep,
        ping=reading.ping,
        angle=microdegrees_of(reading.angle),
        fired_us=microseconds_of(reading.time),
        temperature=centidegrees_of(reading.temperature_c),
        echoes=tuple(round(time * scale) for time in reading.echo_times[:MAX_ECHOES]),
    )


def trace_chunks(number: int, trace: Trace) -> Iterator[TraceChunk]:
    """Yield the messages of the trace of reading `number`, 8 bits per sample, at most 65 535 samples.

    Missing samples (NaN) are marked as lost; chunks without any sample are omitted.
    """
    samples = (trace.samples[:0xFFFF] + 1) / 2 if trace.carrier else trace.samples[:0xFFFF]
    levels = np.clip(np.rint(samples * FULL_SCALE), 0, FULL_SCALE)
    kind = TraceKind.CARRIER if trace.carrier else TraceKind.ENVELOPE
    period, start = round(1e9 / trace.rate), nanoseconds_of(trace.start)
    for offset in range(0, len(levels), CHUNK):
        stretch = levels[offset : offset + CHUNK]
        lost = np.isnan(stretch)
        if not lost.all():
            sent, gaps = np.nan_to_num(stretch).astype(np.uint8), np.flatnonzero(lost).astype(np.uint8)
            yield TraceChunk(number, offset, len(levels), period, start, sent.tobytes(), kind, lost=gaps.tobytes())


def scan_order(message: StartScan) -> ScanOrder:
    """Return the whole scan of which `message` requests all or a part."""
    return ScanOrder(
        radians_of(message.start),
        radians_of(message.step),
        message.headings,
        message.sweeps,
        message.pings,
        bool(message.in_place),
    )


def start_scan(order: ScanOrder) -> StartScan:
    """Return the message that requests the whole scan. Packing raises MessageError if a value does not fit."""
    return StartScan(
        start=microdegrees_of(order.start),
        step=microdegrees_of(order.step),
        headings=order.headings,
        sweeps=order.sweeps,
        pings=order.pings,
        in_place=int(order.in_place),
    )
