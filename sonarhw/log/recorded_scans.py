"""Decode recorded frames to readings and scans, as the driver decoded them during the scan.

Only the positions of traces are stored, because the traces of an hour do not fit into memory.
"""

import struct
from dataclasses import dataclass, field, replace

from sonarhw.log.contents import RecordedFrame
from sonarhw.log.reading_columns import ReadingColumns, Span
from sonarhw.readings import Reading
from sonarhw.wire.assembly import ReadingAssembler
from sonarhw.wire.codes import Outcome
from sonarhw.wire.device_clock import DeviceClock
from sonarhw.wire.frames import Frame, decode_block, frame_payload, frame_type
from sonarhw.wire.messages import (
    Accepted,
    Capabilities,
    Finished,
    Hello,
    Home,
    Info,
    Message,
    MessageError,
    ReadingMessage,
    Refused,
    Settings,
    Started,
    StartScan,
    TraceChunk,
    unpack_message,
)
from sonarhw.wire.reading_rules import broken_reading_rule, readings_requested

_NUMBER = struct.Struct("<I")  # first field of a TraceChunk; decoding all fields would double the time to read a log
_TRACES_AHEAD = 4  # traces kept without their readings, which were lost and may be sent again


@dataclass
class DecodedScan:
    """The part of a scan that has been decoded so far."""

    command: int  # sequence number of its newest StartScan
    order: StartScan | None  # None if the log has no frames from a host
    since_us: int  # device time; earlier pings belong to the previous scan
    settings: Settings | None
    started: float | None = None  # s on the clock of the readings
    expected: int | None = None
    readings: ReadingColumns = field(default_factory=ReadingColumns)
    first: Reading | None = None  # reading with the lowest number
    finished: Finished | None = None
    homed: list[float] = field(default_factory=list)  # time of the newest reading before each homing

    @property
    def answered(self) -> bool:
        """Whether the device has answered the command."""
        return self.started is not None or len(self.readings) > 0

    @property
    def began(self) -> float:
        """Start of the scan, s on the clock of its readings."""
        # if the first Started was lost, the repeated one is later than the first readings
        known = [] if self.first is None else [self.first.time]
        return min(known if self.started is None else [*known, self.started])

    def is_continued_by(self, order: StartScan) -> bool:
        """Return whether `order` requests a missing part of this scan, or all of it if there are no readings yet."""
        part = order.first > 0 or order.count > 0
        return self.order is not None and _whole(self.order) == _whole(order) and (part or not self.readings)


def _whole(order: StartScan) -> StartScan:
    return replace(order, first=0, count=0)


class ScanDecoder:
    """Decodes recorded frames, and assigns their readings to scans.

    A scan begins with the StartScan of the host. Logs of imported and simulated scans contain no frames from a host; a
    scan then begins with Started. Both may occur twice, because a command is repeated until it is answered. An
    interrupted and continued scan is one scan.
    """

    def __init__(self) -> None:
        self.info: Info | None = None
        self.settings: Settings | None = None
        self.frames = 0
        self._checked = False  # whether readings must agree with their order; a replayed log plays another scan
        self._clock = DeviceClock()
        self._assembler = ReadingAssembler(self._clock)
        self._scans: list[DecodedScan] = []
        self._hello: int | None = None  # sequence number of the newest Hello
        self._greeted_at = 0  # number of scans when the conversation began
        self._homed = False  # whether the turntable has homed since the newest scan was requested
        self._newest_us = 0
        self._newest: tuple[int, int] | None = None  # number and chunk offset of the newest reading
        self._ahead: dict[int, Span] = {}  # traces without their reading, by number

    def take(self, recorded: RecordedFrame, place: int = 0) -> list[Reading]:
        """Process a frame and return the readings that it completes, without traces.

        `place` is the offset of its chunk. Damaged frames and unknown messages are ignored.
        """
        self.frames += 1
        block = recorded.wire[:-1]
        # fast path: most of a log is traces, and the CRC-32 of the chunk has been checked
        if recorded.received and frame_type(block) == TraceChunk.TYPE:
            self._find_trace(frame_payload(block), place)
            return []
        frame = decode_block(block)
        if not isinstance(frame, Frame):
            return []
        try:
            message = unpack_message(frame.type, frame.payload)
        except MessageError:
            return []
        if message is None:
            return []
        if not recorded.received:
            self._from_host(frame.sequence, message)
            return []
        # Accepted and Refused may be unmatched answers; their times must be ignored
        if not isinstance(message, Accepted | Refused):
            self._newest_us = frame.time_us
            self._clock.add_frame(frame.time_us, recorded.time)
        return self._keep(self._from_device(frame, message), place)

    @property
    def begun(self) -> int:
        """Number of scans requested; a continued scan counts once."""
        return len(self._scans)

    @property
    def readings_per_sweep(self) -> int | None:
        """Number of readings of each sweep of the newest scan; None if unknown."""
        order = self._scans[-1].order if self._scans and self._checked else None
        return order.headings * order.pings if order else None

    def scans(self) -> list[DecodedScan]:
        """Return all scans so far, in order, without those that the device never answered."""
        return [scan for scan in self._scans if scan.answered]

    def _from_host(self, sequence: int, message: Message) -> None:
        if isinstance(message, Hello) and sequence != self._hello:
            self._hello, self._greeted_at = sequence, len(self._scans)
        if isinstance(message, Home):
            self._homed = True
        if isinstance(message, StartScan) and not self._is_current(sequence):
            if self._scans and self._scans[-1].is_continued_by(message):
                self._continue(sequence)
            else:
                self._begin(sequence, message)

    def _from_device(self, frame: Frame, message: Message) -> list[Reading]:
        match message:
            case Info():
                self.info, self._checked = message, False
            case Capabilities():
                self._checked = True
            case Settings():
                self.settings = message
                # the assembler then completes a reading without its trace
                message = replace(message, trace=0)
            case Started():
                if not self._is_current(message.command):
                    self._begin(message.command)
                scan = self._scans[-1]
                if scan.started is None:
                    scan.started = self._clock.continued(frame.time_us)
                if self._checked and scan.order:
                    scan.expected = readings_requested(_whole(scan.order))
                else:
                    scan.expected = max(scan.expected or 0, message.first + message.readings)
                return []
            case Refused() if self._is_current(message.command) and not self._scans[-1].answered:
                self._scans.pop()
            case Finished() if self._scans:
                self._finish(self._scans[-1], message)
            case ReadingMessage() if self._scans and message.fired_us < self._scans[-1].since_us:
                return []
            case ReadingMessage() if self._breaks_rules(message):
                return []
        return self._assembler.feed(message)

    def _breaks_rules(self, message: ReadingMessage) -> bool:
        order = self._scans[-1].order if self._scans else None
        if not self._checked or order is None or self.info is None:
            return False
        return broken_reading_rule(message, order, self.settings, self.info.microsteps) is not None

    def _finish(self, scan: DecodedScan, message: Finished) -> None:
        # a command for a missing part has fewer readings than the whole scan
        if self._is_current(message.command) and (not scan.finished or message.readings >= scan.finished.readings):
            scan.finished = message
        elif scan.finished and message.outcome == Outcome.LOST_STEPS and not self._homed:
            # detected after the scan, when the turntable turned over the zero mark
            scan.finished = replace(scan.finished, outcome=Outcome.LOST_STEPS, text=message.text)

    def _is_current(self, command: int) -> bool:
        return len(self._scans) > self._greeted_at and self._scans[-1].command == command

    def _begin(self, command: int, order: StartScan | None = None) -> None:
        self._forget(command)
        self._scans.append(DecodedScan(command, order, self._newest_us, self.settings))

    def _continue(self, command: int) -> None:
        scan = self._scans[-1]
        if self._homed and scan.readings:
            scan.homed.append(scan.readings.latest)
        self._forget(command)
        scan.command, scan.since_us = command, self._newest_us
        self._greeted_at = len(self._scans) - 1

    def _forget(self, command: int) -> None:
        self._homed = False
        # the numbers of readings start again at 0; a Started resets the assembler
        self._assembler.feed(Started(command, 0))
        self._newest, self._ahead = None, {}

    def _keep(self, readings: list[Reading], place: int) -> list[Reading]:
        if not readings:
            return []
        if not self._scans:  # the log begins in the middle of a scan
            self._scans.append(DecodedScan(-1, None, 0, self.settings))
        scan = self._scans[-1]
        fresh = [reading for reading in readings if reading.number not in scan.readings]
        for reading in fresh:
            if scan.first is None or reading.number < scan.first.number:
                scan.first = reading
            ahead = self._ahead.pop(reading.number, None)
            scan.readings.add(reading, (ahead[0], place) if ahead else None)
            self._newest = reading.number, place
        return fresh

    def _find_trace(self, payload: bytes, place: int) -> None:
        """Store the position of a part of a trace, which belongs to the newest or to a later reading."""
        if len(payload) < _NUMBER.size:
            return
        (number,) = _NUMBER.unpack_from(payload)
        if self._newest and self._newest[0] == number:
            self._scans[-1].readings.extend_trace(number, self._newest[1], place)
        elif not self._scans or number not in self._scans[-1].readings:
            first, _ = self._ahead.get(number, (place, place))
            self._ahead[number] = first, place
            while len(self._ahead) > _TRACES_AHEAD:
                del self._ahead[next(iter(self._ahead))]
