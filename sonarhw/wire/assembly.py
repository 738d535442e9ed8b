"""Messages from a device become readings: the one decoder behind the live link, the log and the replay.

Takes messages in the order they came, with their times; hands on each reading once, with its trace where one was sent.
"""

import math
from collections import deque

import numpy as np

from sonarhw.readings import FloatArray, Reading, Trace
from sonarhw.wire.device_clock import DeviceClock
from sonarhw.wire.messages import (
    Finished,
    Heartbeat,
    Info,
    Message,
    ReadingMessage,
    Settings,
    Started,
    TraceChunk,
    TraceKind,
)
from sonarhw.wire.units import FULL_SCALE, degrees_c, fine_seconds_of, radians_of, sound_speed_of

_WIDE = 16  # bits of a sample that takes two bytes; all set is 257 × 255
_REMEMBERED = 256  # pings known by their time; a device sends none again that is older than 64
_TRACES_HELD = 4  # traces whose reading may still be sent again


class _PartialTrace:
    """The chunks of one trace that have come so far."""

    def __init__(self, chunk: TraceChunk) -> None:
        self._period, self._start = fine_seconds_of(chunk.period_ns), fine_seconds_of(chunk.start_ns)
        self._carrier = chunk.kind == TraceKind.CARRIER
        self._samples: FloatArray = np.full(chunk.total, np.nan)

    @property
    def complete(self) -> bool:
        return not np.isnan(self._samples).any()

    def add(self, chunk: TraceChunk) -> None:
        values = _sample_values(chunk)
        if chunk.offset + len(values) <= len(self._samples):
            self._samples[chunk.offset : chunk.offset + len(values)] = values

    def trace(self) -> Trace:
        return Trace(self._samples, 1 / self._period, self._start, self._carrier)


def _sample_values(chunk: TraceChunk) -> FloatArray:
    """Samples of a chunk: an envelope from 0 to 1, a carrier from −1 to 1."""
    wide = chunk.bits == _WIDE
    whole = len(chunk.samples) // 2 * 2 if wide else len(chunk.samples)
    levels = np.frombuffer(chunk.samples[:whole], "<u2" if wide else "u1").astype(np.float64)
    values: FloatArray = levels / (FULL_SCALE * 257 if wide else FULL_SCALE)
    return 2 * values - 1 if chunk.kind == TraceKind.CARRIER else values


class ReadingAssembler:
    """Holds the newest reading until its trace is complete or something later shows that it never will be.

    A ping is known by the device's clock at its start, so a reading sent again, whole or after its scan's Started was
    lost, is handed on once and no more. Samples of a trace that never came are NaN.
    """

    def __init__(self, clock: DeviceClock | None = None) -> None:
        """`clock` maps the device's time to the host's; it may have known the device before."""
        self.settings: Settings | None = None
        self._clock = clock or DeviceClock()
        self._seen: deque[int] = deque(maxlen=_REMEMBERED)
        self._newest = -1  # device clock of the newest ping, µs
        self._scan = -1  # sequence number of the StartScan
        self._waiting: ReadingMessage | None = None
        self._traces: dict[int, _PartialTrace] = {}

    def feed(self, message: Message, sent_us: int | None = None, arrived: float | None = None) -> list[Reading]:
        """The readings that this message completes, in the order they were made known.

        `sent_us` is the device time in its frame, `arrived` the host's time when it came, s.
        """
        # a reading of before a reset has its time from before it
        ended: list[Reading] = []
        if isinstance(message, Info):
            ended = self.flush()
            self._clock.greeted(message.boot)
        if sent_us is not None and arrived is not None:
            self._clock.heard(sent_us, arrived)
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
                # a heartbeat may slip in between two chunks; only one after the next ping tells that they are lost
                if isinstance(message, Finished) or (self._waiting and message.readings > self._waiting.number + 1):
                    return self.flush()
        return []

    def flush(self) -> list[Reading]:
        """The reading still waiting for its trace, with what came of it."""
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
        if message.fired_us < self._newest:  # sent again: its trace has come already or never will
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

    def _reading(self, message: ReadingMessage) -> Reading:
        partial = self._traces.pop(message.number, None)
        time = self._clock.continued(message.fired_us)
        return Reading(
            number=message.number,
            sweep=message.sweep,
            ping=message.ping,
            angle=radians_of(message.angle),
            time=time,
            echo_times=tuple(map(fine_seconds_of, message.echoes)),
            speed_of_sound=sound_speed_of(self.settings.speed_of_sound) if self.settings else math.nan,
            temperature_c=degrees_c(message.temperature),
            trace=partial.trace() if partial else None,
            host_time=self._clock.host_time(time),
        )
