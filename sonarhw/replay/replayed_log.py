"""A log as a live scanner: what was recorded comes out again on the recorded schedule.

Takes a `Log` and bytes from a host; hands on the bytes of a scanner that answers with the recorded identity and, at
each scan command, plays a recorded scan. It is a `Device`: no thread, no port, no clock of its own.
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

_FASTEST_LINE = 1000  # times the recorded one; beyond that a long log would leave in one piece
_TICK = 1e-6  # s
_USUAL_SPACING = 0.1  # s from the only reading of a scan to the first of the next lap


@dataclass(frozen=True)
class _Recording:
    """The scan that the next scan command plays."""

    began: float  # s, recorded device clock
    settings: Settings | None
    readings: tuple[Reading, ...]

    @property
    def lap(self) -> float:
        """From the beginning of one run through it to that of the next, s."""
        first, last = self.readings[0].time, self.readings[-1].time
        gaps = len(self.readings) - 1
        return last - self.began + ((last - first) / gaps if gaps else _USUAL_SPACING)

    def offset(self, number: int) -> float:
        """When reading `number` was made, from the beginning, lap after lap, s."""
        lap, index = divmod(number, len(self.readings))
        return lap * self.lap + self.readings[index].time - self.began


class ReplayDevice(ProtocolDevice):
    """Plays the scans of a log, one at each scan command and after the last one the first again.

    A scan command's sector is not obeyed: the recorded readings come, numbered from 0 without gaps. With `loop` the
    scan starts over, numbers and sweeps going on, until as many readings have come as the host ordered; so the host's
    count is right, and it ends. Settings are acknowledged and ignored, homing and turning are done at once. Recorded
    times divided by `speed` (above 0; infinite: as fast as the line goes) set when a reading comes, always counted
    from the scan's beginning, so that nothing drifts; heartbeats keep their own pace.
    """

    def __init__(self, log: Log, speed: float = 1.0, loop: bool = False) -> None:
        """Raises InputError for a log of which nobody knows the speed of sound."""
        if not speed > 0:
            raise ValueError(f"speed is {speed}; expected a factor above 0")
        if any(math.isnan(reading.speed_of_sound) for reading in log.readings):
            raise InputError(
                "the log has no speed of sound, so no ranges: it holds neither Settings nor decoded readings"
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
        """The recorded one, as in `info`: another one in a heartbeat would tell of a reset."""
        return self._log.info.boot if self._log.info else 0

    def temperature(self) -> int:
        """As recorded with the newest reading."""
        return self._temperature

    def angle(self, now: float) -> int:
        """Where the newest reading was taken."""
        return self._angle

    def info(self, sequence: int) -> Info:
        """The recorded identity."""
        if self._log.info is not None:
            return replace(self._log.info, command=sequence)
        return Info(sequence, PROTOCOL_MAJOR, PROTOCOL_MINOR, "sonarhw replay", "", "", NO_TEMPERATURE, 0, 0)

    def configure(self, request: Configure, sequence: int) -> Settings:
        """The recorded settings of the scan that comes next, whatever is wished."""
        self._settings = self._recorded_settings() or Settings(
            sequence, request.listen_us, request.blanking_us, request.trace, request.speed_of_sound
        )
        return replace(self._settings, command=sequence)

    def homing(self, now: float) -> Iterator[float]:
        """Done at once."""
        self._angle = 0
        return iter(())

    def turning(self, order: Turn, now: float) -> Iterator[float]:
        """Done at once."""
        self._angle = order.angle
        return iter(())

    def scanning(self, order: StartScan, now: float) -> tuple[int, Iterator[float]]:
        """The next recorded scan; an order for a part is for a part of the one before."""
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
        """It stands still already."""

    def _play(self, recording: _Recording, numbers: range, start: float) -> Iterator[float]:
        settings = self._settings or recording.settings
        speed_of_sound = (
            settings.speed_of_sound if settings else millimetres_per_second_of(recording.readings[0].speed_of_sound)
        )
        listen = seconds_of(settings.listen_us) if settings else 0.0
        sweeps = recording.readings[-1].sweep + 1
        # what comes first in a part comes at once
        skipped = recording.offset(numbers[0]) if numbers and numbers[0] else 0.0
        fired = 0.0
        for number in numbers:
            lap, index = divmod(number, len(recording.readings))
            recorded = recording.readings[index]
            offset = recording.offset(number) - skipped
            due = start + (offset + listen) / self._speed
            # a fast replay goes no faster than its line, or a Stop would wait behind all that is still to be sent
            due = max(due, self.line.idle_from)
            yield due
            # a ping is known by when it was fired; two at one time would be taken for one sent twice
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
