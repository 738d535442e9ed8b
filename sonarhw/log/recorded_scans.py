"""From recorded frames to scans: follows a recorded conversation the way the driver followed the live one.

Takes frames in the order they were recorded, with where they lie; hands on readings as they become known, and the
scans they belong to. Traces are not put together here, only found: an hour of them is more than a memory holds.
"""

import struct
from dataclasses import dataclass, field, replace

from sonarhw.log.contents import RecordedFrame
from sonarhw.log.reading_columns import ReadingColumns, Span
from sonarhw.readings import Reading
from sonarhw.wire.assembly import ReadingAssembler
from sonarhw.wire.device_clock import DeviceClock
from sonarhw.wire.frames import Frame, decode_block, frame_payload, frame_type
from sonarhw.wire.messages import (
    Accepted,
    Finished,
    Hello,
    Home,
    Info,
    Message,
    MessageError,
    Outcome,
    ReadingMessage,
    Refused,
    Settings,
    Started,
    StartScan,
    TraceChunk,
    unpack_message,
)

_NUMBER = struct.Struct("<I")  # what a TraceChunk begins with; all of it would take as long as the rest of the log
_TRACES_AHEAD = 4  # that may come before their reading, which was lost at first


@dataclass
class FollowedScan:
    """A scan as far as it has been followed."""

    command: int  # sequence number of its newest StartScan
    order: StartScan | None  # None where the log holds no host
    since_us: int  # device clock; what was fired earlier belongs to the scan before
    settings: Settings | None
    started: float | None = None  # s on the clock of the readings
    expected: int | None = None
    readings: ReadingColumns = field(default_factory=ReadingColumns)
    first: Reading | None = None  # the one with the lowest number
    finished: Finished | None = None
    homed: list[float] = field(default_factory=list)  # time of the newest reading when the zero was sought anew

    @property
    def answered(self) -> bool:
        """Whether the device has said anything to the order."""
        return self.started is not None or len(self.readings) > 0

    @property
    def began(self) -> float:
        """When it began, s on the clock of its readings."""
        # where the first Started was lost, the repeated one is younger than the first readings
        known = [] if self.first is None else [self.first.time]
        return min(known if self.started is None else [*known, self.started])

    def goes_on_with(self, order: StartScan) -> bool:
        """Whether that is an order for a part of this scan that is missing, or for all of it where nothing came."""
        part = order.first > 0 or order.count > 0
        return self.order is not None and _whole(self.order) == _whole(order) and (part or not self.readings)


def _whole(order: StartScan) -> StartScan:
    return replace(order, first=0, count=0)


class Follower:
    """Sorts what recorded frames say into scans.

    A scan begins with the host's StartScan, or with the device's Started where the log holds no host (imported and
    simulated scans). Either may stand there twice: a command is repeated until its answer comes. A scan that broke and
    went on is one scan.
    """

    def __init__(self) -> None:
        self.info: Info | None = None
        self.settings: Settings | None = None
        self.frames = 0
        self._clock = DeviceClock()
        self._assembler = ReadingAssembler(self._clock)
        self._scans: list[FollowedScan] = []
        self._hello: int | None = None  # sequence number of the newest
        self._greeted_at = 0  # number of scans when the conversation began
        self._homed = False  # whether the zero was sought since the newest scan was ordered
        self._newest_us = 0
        self._newest: tuple[int, int] | None = None  # number of the newest reading and its place
        self._ahead: dict[int, Span] = {}  # traces whose reading has not come, by number

    def take(self, recorded: RecordedFrame, place: int = 0) -> list[Reading]:
        """The readings, without traces, that this frame tells; `place` is the offset of the chunk it lies in.

        Damaged frames and unknown messages say nothing.
        """
        self.frames += 1
        block = recorded.wire[:-1]
        # most of a log is traces; the chunk that a frame lies in was checked
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
        # an answer to nobody says nothing, its time neither; whether it is one is not known here
        if recorded.received and not isinstance(message, Accepted | Refused):
            self._newest_us = frame.time_us
            self._clock.add_frame(frame.time_us, recorded.time)
        readings = self._from_device(frame, message) if recorded.received else self._from_host(frame, message)
        return self._keep(readings, place)

    @property
    def begun(self) -> int:
        """How many scans have been ordered; one that goes on is none."""
        return len(self._scans)

    def scans(self) -> list[FollowedScan]:
        """All scans so far, in the order they began; an order that the device never answered is none."""
        return [scan for scan in self._scans if scan.answered]

    def _from_host(self, frame: Frame, message: Message) -> list[Reading]:
        if isinstance(message, Hello) and frame.sequence != self._hello:
            self._hello, self._greeted_at = frame.sequence, len(self._scans)
        if isinstance(message, Home):
            self._homed = True
        if isinstance(message, StartScan) and not self._is_current(frame.sequence):
            if self._scans and self._scans[-1].goes_on_with(message):
                self._go_on(frame.sequence)
            else:
                self._begin(frame.sequence, message)
        return []

    def _from_device(self, frame: Frame, message: Message) -> list[Reading]:
        match message:
            case Info():
                self.info = message
            case Settings():
                self.settings = message
                # a reading is then whole without its trace
                message = replace(message, trace=0)
            case Started():
                if not self._is_current(message.command):
                    self._begin(message.command)
                scan = self._scans[-1]
                if scan.started is None:
                    scan.started = self._clock.continued(frame.time_us)
                scan.expected = max(scan.expected or 0, message.first + message.readings)
                return []
            case Refused() if self._is_current(message.command) and not self._scans[-1].answered:
                self._scans.pop()
            case Finished() if self._scans:
                self._finish(self._scans[-1], message)
            case ReadingMessage() if self._scans and message.fired_us < self._scans[-1].since_us:
                return []
        return self._assembler.feed(message)

    def _finish(self, scan: FollowedScan, message: Finished) -> None:
        # what only fills a gap made fewer than the scan has
        if self._is_current(message.command) and (not scan.finished or message.readings >= scan.finished.readings):
            scan.finished = message
        elif scan.finished and message.outcome == Outcome.LOST_STEPS and not self._homed:
            # noticed behind it, on the way over the zero mark
            scan.finished = replace(scan.finished, outcome=Outcome.LOST_STEPS, text=message.text)

    def _is_current(self, command: int) -> bool:
        return len(self._scans) > self._greeted_at and self._scans[-1].command == command

    def _begin(self, command: int, order: StartScan | None = None) -> None:
        self._forget(command)
        self._scans.append(FollowedScan(command, order, self._newest_us, self.settings))

    def _go_on(self, command: int) -> None:
        scan = self._scans[-1]
        if self._homed and scan.readings:
            scan.homed.append(scan.readings.latest)
        self._forget(command)
        scan.command, scan.since_us = command, self._newest_us
        self._greeted_at = len(self._scans) - 1

    def _forget(self, command: int) -> None:
        self._homed = False
        # a new scan numbers its readings anew, which the assembler learns from a Started
        self._assembler.feed(Started(command, 0))
        self._newest, self._ahead = None, {}

    def _keep(self, readings: list[Reading], place: int) -> list[Reading]:
        if not readings:
            return []
        if not self._scans:  # the log begins in the middle of a scan
            self._scans.append(FollowedScan(-1, None, 0, self.settings))
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
        """Note where a part of a trace lies: of the newest reading, or of one whose message is still to come."""
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
