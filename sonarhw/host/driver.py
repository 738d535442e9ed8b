"""The host's side of the protocol, without threads, ports or clock.

What the protocol promises is kept here: commands are repeated until answered, missing readings are requested again, the
device gets signs of life, silence and resets are errors. One driver lasts for one conversation: until the next Hello.
"""

import math
from collections import Counter
from collections.abc import Callable

from sonarhw.errors import CommandRefused, DeviceReset, NoAnswer
from sonarhw.link.link_statistics import LinkStatistics, smoothed
from sonarhw.readings import Reading
from sonarhw.wire.arrivals import ReadingArrivals
from sonarhw.wire.assembly import ReadingAssembler
from sonarhw.wire.device_clock import DeviceClock
from sonarhw.wire.frames import DELIMITER, Frame, FrameDecoder, Rejected, decode_block, encode_frame
from sonarhw.wire.limits import KEPT_READINGS, PROTOCOL_MAJOR
from sonarhw.wire.messages import (
    ActionMessage,
    AnswerMessage,
    AskStatistics,
    Capabilities,
    Finished,
    Heartbeat,
    Info,
    Message,
    MessageError,
    ReadingMessage,
    Refusal,
    Refused,
    Resend,
    Started,
    StartScan,
    State,
    Statistics,
    TraceChunk,
    unpack_message,
)
from sonarhw.wire.units import microseconds_of

ANSWER_WITHIN = 0.5  # s, then the command is sent again
TRIES = 6
SILENCE = 0.75  # s without a byte; heartbeats come every 0.25 s
NOTHING_SOUND = 3.0  # s without a message that a scanner sends
SIGN_OF_LIFE = 0.5  # s after which the host says something, so that the device does not let go
ASK_AGAIN = 0.3  # s after a Resend was accepted
ASKS = 20  # for one stretch of readings, or for one Finished


Tap = Callable[[bool, float, bytes], None]  # whether from the device, when, the frame with its delimiter


def _ignore(received: bool, time: float, wire: bytes) -> None:
    """The tap of a driver without one."""


class Command:
    """A command on its way: sent, repeated, answered; for home, turn and scan also finished."""

    def __init__(self, sequence: int, message: Message, wire: bytes, now: float, tries: int = TRIES) -> None:
        self.sequence = sequence
        self.message = message
        self.wire = wire  # the very same bytes go out at every repeat, so that the device knows it
        self.due = now + ANSWER_WITHIN
        self.sent_at = now
        self.sent = 1
        self.tries = tries
        self.given_up = False  # after fewer tries than usual; the caller knows what to do
        self.answer: AnswerMessage | None = None
        self.answered_us = 0  # on the device's clock
        self.finished: Finished | None = None

    @property
    def name(self) -> str:
        """Name of the message."""
        return type(self.message).__name__

    @property
    def settled(self) -> bool:
        """Whether no answer is waited for any longer."""
        return self.answer is not None or self.given_up


class Driver:
    """One conversation with a device. Times are s on one clock that does not run backwards."""

    def __init__(
        self,
        first_sequence: int = 0,
        where: str = "the device",
        clock: DeviceClock | None = None,
        tap: Tap | None = None,
    ) -> None:
        """`clock` maps the device's time to the host's and may have known the device before.

        `tap` is called with every undamaged frame that passes, as it is on the line.
        """
        self.where = where  # for messages
        self.info: Info | None = None
        self.kept = KEPT_READINGS  # readings the device holds ready to be sent again
        self.device_statistics: Statistics | None = None
        self._counted: Counter[str] = Counter()
        self._round_trip: float | None = None  # s, smoothed
        self._lost_before = 0  # readings lost in earlier scans
        self.heartbeat: Heartbeat | None = None
        self.assembler = ReadingAssembler(clock)
        self._tap = tap or _ignore
        self._decoder = FrameDecoder()
        self._outgoing = bytearray()
        self._sequence = first_sequence % 0x10000
        self._device_sequence: int | None = None
        self._device_time = 0  # µs, of the newest frame
        self._open: dict[int, Command] = {}
        self._action: Command | None = None
        self._action_since = 0  # device time when the running action was ordered, µs
        self._repeats_for_finish = 0
        self._arrivals = ReadingArrivals(0)
        self._asking: Command | None = None
        self._ask_at = 0.0
        self._asks: tuple[tuple[int, int] | None, int] = (None, 0)
        self._readings: list[Reading] = []
        self._heard: float | None = None  # None until the first command: nobody has been asked anything
        self._sound = 0.0  # when the last message came that a scanner sends; answers to nobody are none
        self._spoke = 0.0  # when the last command was sent
        self._arrived = 0.0
        self._newest_beat = 0  # device time of the newest heartbeat, µs

    # what the caller does

    def command(self, message: Message, now: float, tries: int = TRIES) -> Command:
        """Send a command; its `answer` and `finished` fill in as bytes come.

        One of home, turn and scan at a time: the caller waits for the one before, or stops it. With fewer `tries` than
        usual it is `given_up` where no answer comes; otherwise that is an error. Raises MessageError where a value does
        not fit the message.
        """
        frame = Frame(message.TYPE, self._sequence, max(0, microseconds_of(now)), message.pack())
        self._sequence = (self._sequence + 1) % 0x10000
        command = Command(frame.sequence, message, encode_frame(frame), now, tries)
        self._open[command.sequence] = command
        if self._heard is None:
            self._heard = self._sound = now
        if isinstance(message, ActionMessage):
            self._begin(command)
        self._send(command, now)
        return command

    def outgoing(self) -> bytes:
        """The bytes to write to the device, each handed out once."""
        data, self._outgoing = bytes(self._outgoing), bytearray()
        self._count(bytes_sent=len(data))
        return data

    def readings(self) -> list[Reading]:
        """Readings completed since the last call; each reading of a scan is handed out once."""
        ready, self._readings = self._readings, []
        return ready

    @property
    def statistics(self) -> LinkStatistics:
        """What has passed over the link until now."""
        lost = self._lost_before + self._arrivals.lost
        return LinkStatistics(**self._counted, lost_readings=lost, round_trip=self._round_trip)

    @property
    def scan_complete(self) -> bool:
        """Whether the scan has finished and every reading that can still be had is here."""
        action = self._action
        return action is None or (action.finished is not None and self._arrivals.wanted() is None)

    @property
    def running(self) -> bool:
        """Whether a home, turn or scan was ordered and has not finished."""
        return self._action is not None and self._action.finished is None

    def flush(self) -> None:
        """Nothing more will come: complete what waits for its trace."""
        self._readings += self.assembler.flush()

    def forget(self, command: Command) -> None:
        """Wait for a command no longer."""
        self._open.pop(command.sequence, None)
        if self._action is command:
            self._action = None

    # what comes in

    def receive(self, data: bytes, now: float, arrived: float | None = None) -> None:
        """Take bytes from the device; `arrived` is when, where that was before `now`.

        Damaged and unknown frames are counted and dropped. Raises NoAnswer where the device is idle again and does
        not say how what it did has ended, DeviceReset where it has started anew.
        """
        self._heard = now
        self._arrived = now if arrived is None else arrived
        self._count(bytes_received=len(data))
        for block in self._decoder.blocks(data):
            frame = decode_block(block)
            if isinstance(frame, Rejected):
                self._count(rejected_blocks=1)
            else:
                self._take(frame, block + DELIMITER, now)
        self._ask_for_missing(now)

    def advance(self, now: float) -> None:
        """Do what is due: repeat commands, ask for readings. To be called when all bytes that wait have been received.

        Raises NoAnswer where the device stayed silent or left a command unanswered for too long. Where bytes wait that
        nobody takes, `hold` is to be called instead.
        """
        self._complain_of_silence(now)
        for command in [*self._open.values()]:
            if now >= command.due:
                self._repeat(command, now)
        self._ask_for_missing(now)
        self._show_life(now)

    def hold(self, now: float) -> None:
        """Bytes may have come, but nobody takes them for now: only show life."""
        if self._heard is not None:
            self._heard = self._sound = now
        for command in self._open.values():
            command.due = max(command.due, now + ANSWER_WITHIN)
        self._show_life(now)

    def next_event(self) -> float:
        """When `advance` next has something to do, s."""
        due = [command.due for command in self._open.values()]
        if self._heard is not None and self.info is not None:
            due += [self._heard + SILENCE, self._sound + NOTHING_SOUND]
        if self._polite:
            due.append(self._spoke + SIGN_OF_LIFE)
        if self._arrivals.wanted() is not None and self._asking is None:
            due.append(self._ask_at)
        return min(due, default=math.inf)

    @property
    def _polite(self) -> bool:
        """Whether the device wants signs of life."""
        info = self.info
        return info is not None and info.major == PROTOCOL_MAJOR and info.minor >= 1

    def _take(self, frame: Frame, wire: bytes, now: float) -> None:
        self._count_gap(frame.sequence)
        self._device_time = frame.time_us
        # before its Info a device may still say what belongs to a conversation that broke, and is heard by nobody
        if self.info is not None or frame.type == Info.TYPE:
            self._tap(True, self._arrived, wire)
        try:
            message = unpack_message(frame.type, frame.payload)
        except MessageError:
            self._count(rejected_messages=1)
            return
        if message is not None:
            self._handle(message, now)

    def _handle(self, message: Message, now: float) -> None:
        if not isinstance(message, AnswerMessage):
            self._sound = now
        match message:
            case ReadingMessage():
                if not self._expects(message) or not self._arrivals.arrived(message.number):
                    return
            case TraceChunk():
                if self._action is None:
                    return
            case Finished():
                self._finish(message)
            case Heartbeat():
                self.heartbeat = message
                self._check_reset(message)
                self._check_heartbeat(message, now)
            case _:
                if not self._answered(message, now):
                    return
        self._readings += self.assembler.feed(message, self._device_time, self._arrived)

    def _answered(self, message: Message, now: float) -> bool:
        # an answer to a command of an earlier conversation is none
        command = self._open.pop(message.command, None) if isinstance(message, AnswerMessage) else None
        if command is None or not isinstance(message, AnswerMessage):
            return False
        self._sound = now
        command.answer, command.answered_us = message, self._device_time
        match message:
            case Info():
                self.info = message
            case Capabilities():
                self.kept = max(1, min(message.readings_kept, KEPT_READINGS))
            case Statistics():
                self.device_statistics = message
                self._round_trip = smoothed(self._round_trip, now - command.sent_at)
            case Started():
                # a replayed log plays what it holds, whatever was ordered
                self._arrivals.total = message.first + message.readings
            case Refused():
                self._refused(command, message)
        if command is self._asking:
            self._asking, self._ask_at = None, now + ASK_AGAIN
            if isinstance(message, Refused):
                self._arrivals.give_up()
        return True

    def _refused(self, command: Command, message: Refused) -> None:
        if self._action is command:
            self._action = None
        if message.code == Refusal.NO_HELLO and self.info is not None:
            raise DeviceReset(f"{self.where}: was greeted and asks for Hello; it has started anew")

    def _check_reset(self, message: Heartbeat) -> None:
        ran_back = self._device_time < self._newest_beat
        self._newest_beat = self._device_time
        if self.info is not None and (ran_back or message.boot != self.info.boot):
            raise DeviceReset(f"{self.where}: has started anew in mid-conversation; is its supply sound?")

    # home, turn and scan

    def _begin(self, command: Command) -> None:
        self._action, self._action_since, self._repeats_for_finish = command, self._device_time, 0
        order = command.message
        self._lost_before += self._arrivals.lost
        self._arrivals = self._expected(order) if isinstance(order, StartScan) else ReadingArrivals(0)
        if self._asking:
            self.forget(self._asking)
        self._asking, self._asks = None, (None, 0)
        self._readings.clear()

    def _expected(self, order: StartScan) -> ReadingArrivals:
        total = order.headings * order.sweeps * order.pings
        return ReadingArrivals(order.first + order.count if order.count else total, order.first, self.kept)

    def _expects(self, message: ReadingMessage) -> bool:
        # a reading of an earlier scan may still be under way when the next is ordered
        return self._action is not None and message.fired_us >= self._action_since

    def _finish(self, message: Finished) -> None:
        action = self._action
        if action is None or message.command != action.sequence:
            return
        action.finished = message  # where its answer was lost, the command is still repeated until that comes too
        self._arrivals.device_made(message.readings)

    def _check_heartbeat(self, message: Heartbeat, now: float) -> None:
        action = self._action
        if action is None or action.answer is None or action.finished is not None:
            return
        if isinstance(action.message, StartScan):
            self._arrivals.device_made(message.readings)
        if message.state == State.IDLE:  # its Finished was lost; the repeated command brings it again
            self._repeats_for_finish += 1
            if self._repeats_for_finish > ASKS:
                raise NoAnswer(f"{self.where}: idle, but does not say how {action.name} ended; start again")
            self._send(action, now, repeat=True)

    # missing readings

    def _ask_for_missing(self, now: float) -> None:
        wanted = self._arrivals.wanted()
        if wanted is None:
            if self._action and self._action.finished:  # nothing more will come for the last reading's trace
                self._readings += self.assembler.flush()
            return
        if self._asking is not None or now < self._ask_at:
            return
        count = self._asks[1] + 1 if self._asks[0] == wanted else 1
        self._asks = wanted, count
        if count > ASKS:
            self._arrivals.give_up()
            return
        self._count(resends=1)
        self._asking = self.command(Resend(*wanted), now)

    # commands out, silence, books

    def _send(self, command: Command, now: float, repeat: bool = False) -> None:
        # the delimiter in front ends whatever damaged bytes the device still holds
        self._spoke = now
        self._outgoing += DELIMITER + command.wire
        self._count(frames_sent=1, repeated_commands=int(repeat))
        self._tap(False, now, command.wire)

    def _repeat(self, command: Command, now: float) -> None:
        if command is self._asking:  # asked anew instead: a Resend that fails must not end a scan that goes on
            self.forget(command)
            self._asking = None
            return
        if command.sent >= command.tries:
            self.forget(command)
            command.given_up = True
            if command.tries < TRIES:
                return
            raise NoAnswer(f"{self.where}: no answer to {command.name} after {TRIES} tries; is the cable sound?")
        command.sent += 1
        command.due = now + ANSWER_WITHIN
        self._send(command, now, repeat=True)

    def _show_life(self, now: float) -> None:
        if self._polite and now >= self._spoke + SIGN_OF_LIFE:
            self.command(AskStatistics(), now, tries=1)

    def _complain_of_silence(self, now: float) -> None:
        if self._heard is None or self.info is None:  # a device that was not greeted has nothing to say
            return
        if now >= self._heard + SILENCE:
            raise NoAnswer(f"{self.where}: not a byte for {SILENCE:g} s; is the scanner powered and still connected?")
        if now >= self._sound + NOTHING_SOUND:
            raise NoAnswer(f"{self.where}: nothing sensible for {NOTHING_SOUND:g} s; `sonarhw monitor` shows it")

    def _count_gap(self, sequence: int) -> None:
        gap = 0 if self._device_sequence is None else (sequence - self._device_sequence - 1) % 0x10000
        self._device_sequence = sequence
        self._count(frames_received=1, missing_frames=gap if gap < 0x8000 else 0)

    def _count(self, **more: int) -> None:
        self._counted.update(more)


def raise_if_refused(command: Command, where: str) -> None:
    """Raise CommandRefused where the device said no to the command."""
    if isinstance(command.answer, Refused):
        text = command.answer.text
        raise CommandRefused(f"{where}: refused {command.name}: {text}", command.answer.code)
