"""Decoder from device messages to readings, used for live links, logs and replay."""

import math
from collections import deque

import numpy as np

from sonarhw.readings import FloatArray, Origin, Reading, Trace
from sonarhw.wire.codes import TraceKind
from sonarhw.wire.device_clock import DeviceClock
from sonarhw.wire.messages import Finished, Heartbeat, Info, Message, ReadingMessage, Settings, Started, TraceChunk
from sonarhw.wire.origin import origin_of
from sonarhw.wire.units import FULL_SCALE, degrees_c, radians_of, seconds_of_nanoseconds, sound_speed_of

_WIDE = 16  # bits of a two-byte sample; its full scale is 257 × 255
_REMEMBERED = 256  # pings; a device keeps fewer for Resend
_TRACES_HELD = 4  # traces kept without their readings, which may be sent again


class _PartialTrace:
    """The chunks of one trace that have arrived so far."""

    def __init__(self, chunk: TraceChunk) -> None:
        self._period, self._start = seconds_of_nanoseconds(chunk.period_ns), seconds_of_nanoseconds(chunk.start_ns)
        self._carrier = chunk.kind == TraceKind.CARRIER
        self._samples: FloatArray = np.full(chunk.total, np.nan)
        self._arrived = np.zeros(chunk.total, np.bool_)

    @property
    def complete(self) -> bool:
        return bool(self._arrived.all())

    def add(self, chunk: TraceChunk) -> None:
        values = _sample_values(chunk)
        if chunk.offset + len(values) <= len(self._samples):
            self._samples[chunk.offset : chunk.offset + len(values)] = values
            self._arrived[chunk.offset : chunk.offset + len(values)] = True

    def trace(self) -> Trace:
        return Trace(self._samples, 1 / self._period, self._start, self._carrier)


def _sample_values(chunk: TraceChunk) -> FloatArray:
    """Return the samples of a chunk: 0 to 1 for an envelope, −1 to 1 for a carrier."""
    wide = chunk.bits == _WIDE
    whole = len(chunk.samples) // 2 * 2 if wide else len(chunk.samples)
    levels = np.frombuffer(chunk.samples[:whole], "<u2" if wide else "u1").astype(np.float64)
    values: FloatArray = levels / (FULL_SCALE * 257 if wide else FULL_SCALE)
    lost = np.frombuffer(chunk.lost, "u1")
    values[lost[lost < len(values)]] = np.nan
    return 2 * values - 1 if chunk.kind == TraceKind.CARRIER else values


class ReadingAssembler:
    """Assembles readings and their traces from messages in the order of arrival.

    Holds the newest reading until its trace is complete, or until a later message shows that the rest of the trace is
    lost. A ping is identified by the device clock at its start. So a reading that is sent again is returned only once.
    Missing samples of a trace are NaN.
    """

    def __init__(self, clock: DeviceClock | None = None) -> None:
        """`clock` maps device time to host time. It may already contain earlier frames of the device."""
        self.settings: Settings | None = None
        self._clock = clock or DeviceClock()
        self._seen: deque[int] = deque(maxlen=_REMEMBERED)
        self._newest = -1  # device clock of the newest ping, µs
        self._scan = -1  # sequence number of the StartScan
        self._waiting: ReadingMessage | None = None
        self._origin: Origin | None = None
        self._traces: dict[int, _PartialTrace] = {}

    def feed(self, message: Message, sent_us: int | None = None, arrived: float | None = None) -> list[Reading]:
        """Return the readings that this message completes, in the order of their arrival.

        `sent_us` is the device time in the frame, µs; `arrived` is the host time of its arrival, s.
        """
        # the waiting reading was made before the reset, so its time is converted first
        ended: list[Reading] = []
        if isinstance(message, Info):
            ended = self.flush()
            self._clock.set_boot(message.boot)
            self._origin = origin_of("scan", message.firmware, message.serial)
        if sent_us is not None and arrived is not None:
            self._clock.add_frame(sent_us, arrived)
        return ended + self._take(message)

    def _take(self, message: Message) -> list[Reading]:
        match message:
            case Settings():
                self.settings = message
            case Info():
                self._seen.clear()
                self._newest = -1
                return self._begin(scan=-1)
            case Started() if message.command != self._scan:
                return self._begin(scan=message.command)
            case ReadingMessage():
                return self._start(message)
            case TraceChunk():
                return self._add(message)
            case Heartbeat() | Finished():
                # a heartbeat may arrive between two chunks; one after the next ping shows that chunks are lost
                if isinstance(message, Finished) or (self._waiting and message.readings > self._waiting.number + 1):
                    return self.flush()
        return []

    def flush(self) -> list[Reading]:
        """Return the reading that waits for its trace, with the samples received so far."""
        if self._waiting is None:
            return []
        message, self._waiting = self._waiting, None
        return [self._reading(message)]

    def _begin(self, scan: int) -> list[Reading]:
        self._scan = scan
        ended = self.flush()
        self._traces.clear()
        return ended

    def _start(self, message: ReadingMessage) -> list[Reading]:
        if message.fired_us in self._seen:
            return []
        self._seen.append(message.fired_us)
        if message.fired_us < self._newest:  # sent again, without its trace
            return [self._reading(message)]
        self._newest = message.fired_us
        ended = self.flush()
        if self.settings is None or not self.settings.trace:
            return [*ended, self._reading(message)]
        self._waiting = message
        trace = self._traces.get(message.number)
        return [*ended, *self.flush()] if trace and trace.complete else ended

    def _add(self, chunk: TraceChunk) -> list[Reading]:
        if chunk.period_ns == 0:
            return []
        if chunk.number not in self._traces:
            while len(self._traces) >= _TRACES_HELD:
                del self._traces[next(iter(self._traces))]
            self._traces[chunk.number] = _PartialTrace(chunk)
        trace = self._traces[chunk.number]
        trace.add(chunk)
        return self.flush() if self._waiting and self._waiting.number == chunk.number and trace.complete else []

    @property
    def _speed_of_sound(self) -> float:
        # 0 breaks the protocol; every range would be 0
        return (
            sound_speed_of(self.settings.speed_of_sound) if self.settings and self.settings.speed_of_sound else math.nan
        )

    def _reading(self, message: ReadingMessage) -> Reading:
        partial = self._traces.pop(message.number, None)
        time = self._clock.continued(message.fired_us)
        return Reading(
            number=message.number,
            sweep=message.sweep,
            ping=message.ping,
            angle=radians_of(message.angle),
            time=time,
            echo_times=tuple(map(seconds_of_nanoseconds, message.echoes)),
            speed_of_sound=self._speed_of_sound,
            temperature_c=degrees_c(message.temperature),
            trace=partial.trace() if partial else None,
            host_time=self._clock.host_time(time),
            origin=self._origin,
        )
