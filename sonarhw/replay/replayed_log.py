"""A log as a live scanner. It reports the recorded identity and plays the recorded scans at their recorded times.

It is a `Device`, without threads, ports or clock.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

from sonarhw.device.device_protocol import ProtocolDevice
from sonarhw.device.paced_line import BYTE_TIME, Line
from sonarhw.errors import InputError
from sonarhw.log.contents import Log
from sonarhw.readings import Reading
from sonarhw.wire.limits import MOST_READINGS, PROTOCOL_MAJOR, PROTOCOL_MINOR
from sonarhw.wire.messages import Configure, Info, Settings, StartScan, Turn
from sonarhw.wire.reading_messages import reading_message, trace_chunks
from sonarhw.wire.units import NO_TEMPERATURE, millimetres_per_second_of, seconds_of

_FASTEST_LINE = 1000  # times the usual speed of a line; a faster one would send a long log at once
_TICK = 1e-6  # s
_DEFAULT_SPACING = 0.1  # s; time of a lap of a scan with a single reading


@dataclass(frozen=True)
class _Recording:
    """The scan that the next scan command plays."""

    began: float  # s, recorded device clock
    settings: Settings | None
    readings: tuple[Reading, ...]

    @property
    def lap(self) -> float:
        """Time from the beginning of one lap to that of the next, s."""
        first, last = self.readings[0].time, self.readings[-1].time
        gaps = len(self.readings) - 1
        return last - self.began + ((last - first) / gaps if gaps else _DEFAULT_SPACING)

    def offset(self, number: int) -> float:
        """Return the time of reading `number` from the beginning of the first lap, s."""
        lap, index = divmod(number, len(self.readings))
        return lap * self.lap + self.readings[index].time - self.began


class ReplayDevice(ProtocolDevice):
    """Plays one scan of a log for each StartScan; after the last scan it continues with the first.

    The requested sector is ignored: the recorded readings are sent, numbered from 0 without gaps. With `loop` the scan
    repeats, with continued numbers and sweeps, until the requested number of readings has been sent. Settings are
    acknowledged and ignored; homing and turning take no time. Readings are sent at their recorded times divided by
    `speed` (above 0; infinite: at the speed of the line), counted from the start of the scan, so that nothing drifts.
    Heartbeats keep their rate.
    """

    def __init__(self, log: Log, speed: float = 1.0, loop: bool = False) -> None:
        """Raises InputError for a log without a speed of sound."""
        if not speed > 0:
            raise ValueError(f"speed is {speed}; expected a factor above 0")
        if any(math.isnan(reading.speed_of_sound) for reading in log.readings):
            raise InputError(
                "the log has no speed of sound, and so no ranges: it contains neither Settings nor decoded readings"
            )
        super().__init__(Line(BYTE_TIME / min(max(1.0, speed), _FASTEST_LINE)))
        self._log = log
        self._speed = speed
        self._loop = loop
        self._recordings = [_Recording(s.began, s.settings, s.readings) for s in log.scans if s.readings]
        self._next = 0
        self._played: _Recording | None = None
        self._angle = 0  # µdeg
        self._temperature = log.info.temperature if log.info else NO_TEMPERATURE
        self._settings = self._recorded_settings()

    @property
    def boot(self) -> int:
        """The recorded number of starts, as in `info`; another one in a heartbeat would mean a reset."""
        return self._log.info.boot if self._log.info else 0

    def temperature(self) -> int:
        """Return the recorded temperature of the newest reading."""
        return self._temperature

    def angle(self, now: float) -> int:
        """Return the angle of the newest reading, µdeg."""
        return self._angle

    def info(self, sequence: int) -> Info:
        """Return the recorded identity."""
        if self._log.info is not None:
            return replace(self._log.info, command=sequence)
        return Info(sequence, PROTOCOL_MAJOR, PROTOCOL_MINOR, "sonarhw replay", "", "", NO_TEMPERATURE, 0, 0)

    def configure(self, request: Configure, sequence: int) -> Settings:
        """Return the recorded settings of the next scan. The requested ones are ignored."""
        self._settings = self._recorded_settings() or Settings(
            sequence, request.listen_us, request.blanking_us, request.trace, request.speed_of_sound
        )
        return replace(self._settings, command=sequence)

    def homing(self, now: float) -> Iterator[float]:
        """Home at once."""
        self._angle = 0
        return iter(())

    def turning(self, order: Turn, now: float) -> Iterator[float]:
        """Turn at once."""
        self._angle = order.angle
        return iter(())

    def scanning(self, order: StartScan, now: float) -> tuple[int, Iterator[float]]:
        """Play the next recorded scan; a command for a part of a scan plays a part of the last one."""
        if not self._recordings:
            return 0, iter(())
        part = order.first > 0 or order.count > 0
        if not (part and self._played):
            self._played = self._recordings[self._next]
            self._next = (self._next + 1) % len(self._recordings)
        total = len(self._played.readings)
        if self._loop:
            total = min(max(total, order.headings * order.sweeps * order.pings), MOST_READINGS)
        numbers = range(order.first, order.first + order.count if order.count else total)
        return total, self._play(self._played, numbers, now)

    def halt(self, now: float) -> None:
        """Do nothing, because it never moves."""

    def _play(self, recording: _Recording, numbers: range, start: float) -> Iterator[float]:
        settings = self._settings or recording.settings
        speed_of_sound = (
            settings.speed_of_sound if settings else millimetres_per_second_of(recording.readings[0].speed_of_sound)
        )
        listen = seconds_of(settings.listen_us) if settings else 0.0
        sweeps = recording.readings[-1].sweep + 1
        # a part of a scan starts with its first reading, without waiting
        skipped = recording.offset(numbers[0]) if numbers and numbers[0] else 0.0
        fired = 0.0
        for number in numbers:
            lap, index = divmod(number, len(recording.readings))
            recorded = recording.readings[index]
            offset = recording.offset(number) - skipped
            due = start + (offset + listen) / self._speed
            # not before the line is idle, because a Stop would wait for all queued frames
            due = max(due, self.line.idle_from)
            yield due
            # a ping is identified by its time, so two pings must not have the same time
            fired = max(start + offset / self._speed, fired + _TICK)
            sweep = (lap * sweeps + recorded.sweep) % 0x10000
            played = replace(recorded, number=number, sweep=sweep, time=fired)
            message = reading_message(played, speed_of_sound)
            self._angle, self._temperature = message.angle, message.temperature
            self.report(message, trace_chunks(number, recorded.trace) if recorded.trace else (), due)

    def _recorded_settings(self) -> Settings | None:
        if not self._recordings:
            return self._log.settings
        return self._recordings[self._next].settings or self._log.settings
