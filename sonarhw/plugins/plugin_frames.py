"""The readings of a plug-in as frames of the wire protocol, so that one decoder reads all logs.

Readings are decoded from these frames, so they have the values that the log will have.
"""

from typing import Protocol, runtime_checkable

from sonarhw.host.recorder import Recorder
from sonarhw.plugins.device_plugin import DeviceIdentity, Measurement
from sonarhw.plugins.sweep_tracker import Placed
from sonarhw.readings import Reading
from sonarhw.sound_speed import speed_of_sound
from sonarhw.wire.assembly import ReadingAssembler
from sonarhw.wire.codes import Outcome
from sonarhw.wire.device_clock import DeviceClock
from sonarhw.wire.frames import Frame, encode_frame
from sonarhw.wire.limits import MAX_ECHOES, MAX_TEXT, PROTOCOL_MAJOR, PROTOCOL_MINOR
from sonarhw.wire.messages import Finished, Info, Message, ReadingMessage, Settings, Started
from sonarhw.wire.units import (
    centidegrees_of,
    microdegrees_of,
    microseconds_of,
    millimetres_per_second_of,
    nanoseconds_of,
    seconds_of,
)

_TICK = 1  # µs; two pings must not have the same time, because it identifies them


@runtime_checkable
class ByteRecorder(Protocol):
    """A recorder that also stores the bytes of a device that sends no frames."""

    def received_bytes(self, time: float, data: bytes) -> None:
        """Record bytes as received. `time` is in s since the epoch."""


class PluginFrames:
    """Makes readings and frames of measurements, and passes them to a recorder. Times are s since the epoch."""

    def __init__(self, identity: DeviceIdentity, now: float) -> None:
        self.settings = _settings(speed_of_sound(), 0.0625, 0.0)
        self._identity = identity
        self._epoch = now  # device time 0
        self._recorder: Recorder | None = None
        self._assembler = ReadingAssembler(DeviceClock())
        self._sequence = 0
        self._command = 0  # number of the scan
        self._number = 0  # of the next reading
        self._fired_us = 0  # of the newest reading
        self._assembler.feed(self._info())
        self._assembler.feed(self.settings)

    def use(self, recorder: Recorder | None, now: float) -> None:
        """Record with `recorder` from now on."""
        self._recorder = recorder
        for message in (self._info(), self.settings) if recorder else ():
            self._send(message, now)

    def configure(self, listen: float, blanking: float, speed: float, now: float) -> None:
        """Use another listening time (s) and speed of sound (m/s)."""
        self.settings = _settings(speed, listen, blanking)
        self._send(self.settings, now)

    def received(self, data: bytes, now: float) -> None:
        """Record bytes of the device."""
        if data and isinstance(self._recorder, ByteRecorder):
            self._recorder.received_bytes(now, data)

    def begin(self, now: float) -> float:
        """Begin a scan, and return its time on the clock of the readings, s."""
        self._command = (self._command + 1) % 0x10000
        self._number = 0
        self._send(Started(self._command, 0), now)  # the number of readings is not known yet
        self._fired_us = max(self._time_us(now), self._fired_us)
        return seconds_of(self._fired_us)

    def reading(self, placed: Placed, now: float) -> Reading:
        """Return the reading of a measurement, after it was recorded."""
        message = self._message(placed, now)
        self._number += 1
        self._send(message, now)
        (reading,) = self._assembler.feed(message)
        if self._recorder:
            self._recorder.reading(reading)
        return reading

    def finish(self, outcome: Outcome, now: float) -> None:
        """End the scan."""
        self._send(Started(self._command, self._number), now)
        self._send(Finished(self._command, outcome, self._number, ""), now)

    def _message(self, placed: Placed, now: float) -> ReadingMessage:
        measured = placed.measurement
        self._fired_us = max(self._time_us(measured.time or now), self._fired_us + _TICK)
        return ReadingMessage(
            number=self._number,
            sweep=placed.sweep % 0x10000,
            ping=min(placed.ping, 0xFF),
            angle=microdegrees_of(measured.angle),
            fired_us=self._fired_us,
            temperature=centidegrees_of(measured.temperature_c),
            echoes=self._echoes(measured),
        )

    def _echoes(self, measured: Measurement) -> tuple[int, ...]:
        """Return the times of the echoes within the listening time, ns."""
        speed = self.settings.speed_of_sound * 1e-3
        times = sorted(2 * distance / speed for distance in measured.ranges)
        heard = [nanoseconds_of(time) for time in times if 0 < time <= seconds_of(self.settings.listen_us)]
        return tuple(heard[:MAX_ECHOES])

    def _send(self, message: Message, now: float) -> None:
        time_us = self._time_us(now)
        frame = Frame(message.TYPE, self._sequence, time_us, message.pack())
        self._sequence = (self._sequence + 1) % 0x10000
        if not isinstance(message, ReadingMessage):  # `reading` needs the result
            self._assembler.feed(message, time_us, now)
        if self._recorder:
            self._recorder.frame(True, now, encode_frame(frame))

    def _time_us(self, now: float) -> int:
        return max(0, microseconds_of(now - self._epoch))

    def _info(self) -> Info:
        identity = self._identity
        return Info(
            command=0,
            major=PROTOCOL_MAJOR,
            minor=PROTOCOL_MINOR,
            firmware=_short(identity.name),
            serial=_short(identity.serial),
            board=_short(identity.board),
            temperature=centidegrees_of(None),
            trace_rate=0,
            microsteps=0,
        )


def _settings(speed: float, listen: float, blanking: float) -> Settings:
    return Settings(0, microseconds_of(listen), microseconds_of(blanking), 0, millimetres_per_second_of(speed))


def _short(text: str) -> str:
    """Return the start of a text, as long as fits into Info."""
    return text.encode()[:MAX_TEXT].decode(errors="ignore")
