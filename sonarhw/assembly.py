"""Messages from a device become readings: the one decoder behind the live link, the log and the replay.

Takes messages in the order they came; hands on each reading once, with its trace where one was sent.
"""

import math

import numpy as np

from sonarhw.messages import (
    NO_TEMPERATURE,
    Finished,
    Heartbeat,
    Message,
    ReadingMessage,
    Settings,
    Started,
    TraceChunk,
)
from sonarhw.readings import FloatArray, Reading, Trace

FULL_SCALE = 255


def degrees_c(centidegrees: int) -> float | None:
    """Temperature of a message in °C; None where the device has no thermometer."""
    return None if centidegrees == NO_TEMPERATURE else centidegrees / 100


def radians_of(microdegrees: int) -> float:
    """Angle of a message in rad."""
    return math.radians(microdegrees / 1e6)


def microdegrees_of(angle: float) -> int:
    """Angle for a message, µdeg."""
    return round(math.degrees(angle) * 1e6)


class ReadingAssembler:
    """Holds the newest reading until its trace is complete or something later shows that it never will be."""

    def __init__(self) -> None:
        self.settings: Settings | None = None
        self._seen: set[int] = set()
        self._waiting: ReadingMessage | None = None
        self._samples: FloatArray | None = None
        self._timing: tuple[float, float] = (0.0, 0.0)  # period, start; s

    def feed(self, message: Message) -> list[Reading]:
        """The readings that this message completes, in the order they were made known."""
        match message:
            case Settings():
                self.settings = message
            case Started():
                ended = self.flush()
                self._seen.clear()
                return ended
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
        trace = None
        if self._samples is not None:
            period, start = self._timing
            trace, self._samples = Trace(self._samples, 1 / period, start), None
        return [self._reading(message, trace)]

    def _start(self, message: ReadingMessage) -> list[Reading]:
        if message.number in self._seen:
            return []
        self._seen.add(message.number)
        ended = self.flush()
        if self.settings is not None and self.settings.trace:
            self._waiting = message
            return ended
        return [*ended, self._reading(message, None)]

    def _add(self, chunk: TraceChunk) -> list[Reading]:
        if self._waiting is None or chunk.number != self._waiting.number or chunk.period_ns == 0:
            return []
        if self._samples is None:
            self._samples = np.full(chunk.total, np.nan)
            self._timing = chunk.period_ns * 1e-9, chunk.start_ns * 1e-9
        values = np.frombuffer(chunk.samples, np.uint8) / FULL_SCALE
        if chunk.offset + len(values) > len(self._samples):
            return []
        self._samples[chunk.offset : chunk.offset + len(values)] = values
        return [] if np.isnan(self._samples).any() else self.flush()

    def _reading(self, message: ReadingMessage, trace: Trace | None) -> Reading:
        return Reading(
            number=message.number,
            sweep=message.sweep,
            ping=message.ping,
            angle=radians_of(message.angle),
            time=message.fired_us * 1e-6,
            echo_times=tuple(nanoseconds * 1e-9 for nanoseconds in message.echoes),
            speed_of_sound=self.settings.speed_of_sound / 1000 if self.settings else math.nan,
            temperature_c=degrees_c(message.temperature),
            trace=trace,
        )
