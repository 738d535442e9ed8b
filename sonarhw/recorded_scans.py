"""From recorded frames to scans: follows a recorded conversation the way the driver followed the live one.

Takes frames in the order they were recorded; hands on readings as they become whole, and the scans they belong to.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field

from sonarhw.assembly import ReadingAssembler
from sonarhw.frames import Frame, FrameDecoder
from sonarhw.log_contents import RecordedFrame, RecordedScan
from sonarhw.messages import (
    Finished,
    Hello,
    Info,
    Message,
    MessageError,
    ReadingMessage,
    Refused,
    Settings,
    Started,
    StartScan,
    unpack_message,
)
from sonarhw.readings import Reading


@dataclass
class _OpenScan:
    command: int  # sequence number of its StartScan
    since_us: int  # device clock; what was fired earlier belongs to the scan before
    settings: Settings | None
    started_us: int | None = None
    expected: int | None = None
    readings: dict[int, Reading] = field(default_factory=dict)
    finished: Finished | None = None

    @property
    def answered(self) -> bool:
        return self.started_us is not None or bool(self.readings)

    def ended(self) -> RecordedScan:
        readings = tuple(self.readings[number] for number in sorted(self.readings))
        # where the first Started was lost, the repeated one is younger than the first readings
        known = [reading.time for reading in readings[:1]]
        if self.started_us is not None:
            known.append(self.started_us * 1e-6)
        return RecordedScan(min(known), self.expected, self.settings, readings, self.finished)


class Follower:
    """Sorts what recorded frames say into scans.

    A scan begins with the host's StartScan, or with the device's Started where the log holds no host (imported and
    simulated scans). Either may stand there twice: a command is repeated until its answer comes.
    """

    def __init__(self) -> None:
        self.info: Info | None = None
        self.settings: Settings | None = None
        self._assembler = ReadingAssembler()
        self._scans: list[_OpenScan] = []
        self._hello: int | None = None  # sequence number of the newest
        self._greeted_at = 0  # number of scans when the conversation began
        self._newest_us = 0

    def take(self, recorded: RecordedFrame) -> list[Reading]:
        """The readings that this frame completes. Damaged frames and unknown messages say nothing."""
        completed: list[Reading] = []
        for frame, message in _messages(recorded):
            if recorded.received:
                self._newest_us = frame.time_us
                completed += self._from_device(frame, message)
            else:
                completed += self._from_host(frame, message)
        return completed

    def end(self) -> list[Reading]:
        """The reading still waiting for its trace, when no more frames come."""
        return self._keep(self._assembler.flush())

    def scans(self) -> tuple[RecordedScan, ...]:
        """All scans so far, in the order they began; an order that the device never answered is none."""
        return tuple(scan.ended() for scan in self._scans if scan.answered)

    def _from_host(self, frame: Frame, message: Message) -> list[Reading]:
        if isinstance(message, Hello) and frame.sequence != self._hello:
            self._hello, self._greeted_at = frame.sequence, len(self._scans)
        if isinstance(message, StartScan) and not self._is_current(frame.sequence):
            return self._begin(frame.sequence)
        return []

    def _from_device(self, frame: Frame, message: Message) -> list[Reading]:
        ended: list[Reading] = []
        match message:
            case Info():
                self.info = message
            case Settings():
                self.settings = message
            case Started():
                if not self._is_current(message.command):
                    ended = self._begin(message.command)
                scan = self._scans[-1]
                if scan.started_us is None:
                    scan.started_us, scan.expected = frame.time_us, message.readings
                return ended
            case Refused() if self._is_current(message.command) and not self._scans[-1].answered:
                self._scans.pop()
            case Finished() if self._is_current(message.command):
                self._scans[-1].finished = message
            case ReadingMessage() if self._scans and message.fired_us < self._scans[-1].since_us:
                return []
        return self._keep(self._assembler.feed(message))

    def _is_current(self, command: int) -> bool:
        return len(self._scans) > self._greeted_at and self._scans[-1].command == command

    def _begin(self, command: int) -> list[Reading]:
        # a new scan numbers its readings from 0, which the assembler learns from a Started
        ended = self._keep(self._assembler.feed(Started(command, 0)))
        self._scans.append(_OpenScan(command, self._newest_us, self.settings))
        return ended

    def _keep(self, readings: list[Reading]) -> list[Reading]:
        if not readings:
            return []
        if not self._scans:  # the log begins in the middle of a scan
            self._scans.append(_OpenScan(-1, 0, self.settings))
        fresh = [reading for reading in readings if reading.number not in self._scans[-1].readings]
        self._scans[-1].readings.update((reading.number, reading) for reading in fresh)
        return fresh


def _messages(recorded: RecordedFrame) -> Iterator[tuple[Frame, Message]]:
    for frame in FrameDecoder().feed(recorded.wire):
        if isinstance(frame, Frame):
            try:
                message = unpack_message(frame.type, frame.payload)
            except MessageError:
                continue
            if message is not None:
                yield frame, message
