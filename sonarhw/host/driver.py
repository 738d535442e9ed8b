"""The host side of the protocol for one conversation, without threads, ports or clock.

The driver repeats commands until they are answered, requests missing readings again, and sends signs of life. If the
device is silent or has been reset, the driver raises an error. Each Hello needs a new driver.
"""

import math
from collections import Counter
from collections.abc import Callable

from sonarhw.errors import CommandRefused, DeviceReset, NoAnswer
from sonarhw.link import LinkStatistics, smoothed
from sonarhw.readings import Reading
from sonarhw.wire import messages
from sonarhw.wire.frames import DELIMITER, Frame, FrameDecoder, Rejected, decode_block, encode_frame
from sonarhw.wire.limits import KEPT_READINGS, MOST_READINGS, PROTOCOL_MAJOR
from sonarhw.wire.readings_of_frames import (
    DeviceClock,
    ReadingArrivals,
    ReadingAssembler,
    broken_reading_rule,
    broken_start_rule,
)

ANSWER_WITHIN = 0.5  # s; the command is then sent again
TRIES = 6  # of a command
SILENCE = 0.75  # s without a byte; heartbeats come every 0.25 s
NO_MESSAGE = 3.0  # s without a valid message
SIGN_OF_LIFE = 0.5  # s; longest time between two commands: after HOST_SILENCE the device releases its motor
ASK_AGAIN = 0.3  # s from Accepted to the next Resend
ASKS = 20  # most requests for the same readings, or for one Finished


# called with: whether the frame is from the device, its time, and the frame with its delimiter
Tap = Callable[[bool, float, bytes], None]


def _ignore(received: bool, time: float, wire: bytes) -> None:
    """The default tap, which does nothing."""


class Command:
    """A command that was sent: its repeats, its answer and, for home, turn and scan, its end."""

    def __init__(self, sequence: int, message: messages.Message, wire: bytes, now: float, tries: int = TRIES) -> None:
        self.sequence = sequence
        self.message = message
        self.wire = wire  # every repeat has the same bytes, by which the device recognizes it
        self.due = now + ANSWER_WITHIN
        self.sent_at = now
        self.sent = 1
        self.tries = tries
        self.given_up = False  # unanswered after all tries; the caller handles this if there were fewer than TRIES
        self.answer: messages.AnswerMessage | None = None
        self.answered_us = 0  # time of the answer on the device's clock
        self.finished: messages.Finished | None = None
        self.broken: str | None = None  # clause with the first rule of the protocol that its messages broke

    @property
    def name(self) -> str:
        """Name of the message type."""
        return type(self.message).__name__

    @property
    def settled(self) -> bool:
        """Whether the command is answered or given up."""
        return self.answer is not None or self.given_up


class Driver:
    """One conversation with a device. All times are s on one monotonic clock."""

    def __init__(
        self,
        first_sequence: int = 0,
        where: str = "the device",
        clock: DeviceClock | None = None,
        tap: Tap | None = None,
    ) -> None:
        """Start with sequence number `first_sequence`.

        `clock` converts the device's time to the host's. It may come from an earlier conversation. `tap` is called with
        the bytes of every undamaged frame.
        """
        self.where = where  # for error messages
        self.assembler = ReadingAssembler(clock)
        self._tap = tap or _ignore
        # what the device has sent about itself
        self.info: messages.Info | None = None
        self.busy: str | None = None  # reason why the device serves only another host
        self.kept = KEPT_READINGS  # newest readings that the device can send again
        self.unanswered: str | None = None  # name of the command that was given up
        self.heartbeat: messages.Heartbeat | None = None  # the newest
        self.device_statistics: messages.Statistics | None = None
        # bytes and frames
        self._decoder = FrameDecoder()
        self._outgoing = bytearray()
        self._sequence = first_sequence % 0x10000
        self._device_sequence: int | None = None
        self._device_time = 0  # µs, of the newest frame
        self._newest_beat = 0  # device time of the newest heartbeat, µs
        # unanswered commands, and the newest Home, Turn or StartScan
        self._open: dict[int, Command] = {}
        self._action: Command | None = None
        self._action_since = 0  # device time when it was requested, µs
        self._repeats_for_finish = 0
        # readings of the newest scan
        self._readings: list[Reading] = []
        self._arrivals = ReadingArrivals(0)
        self._resend: Command | None = None  # the unanswered one
        self._resend_at = 0.0  # earliest time of the next one
        self._fired: tuple[int, int] | None = None  # device time (µs) and number of the newest reading
        self._checked = False  # whether orders and readings must agree; a replayed log plays another scan
        # times at the host
        self._last_byte: float | None = None  # time of the last byte received; None until the first command
        self._last_message = 0.0  # time of the last valid message; unmatched answers do not count
        self._last_sent = 0.0  # time of the last command sent
        self._arrived = 0.0  # time of arrival of the newest bytes
        # counts
        self._counted: Counter[str] = Counter()
        self._lost_before = 0  # readings lost in earlier scans
        self._round_trip: float | None = None  # s, smoothed

    # interface for the caller

    def command(self, message: messages.CommandMessage, now: float, tries: int = TRIES) -> Command:
        """Send a command. Its `answer` and `finished` are set when they arrive.

        Only one Home, Turn or StartScan may run at a time: the caller waits for its end or stops it. A command that is
        not answered after `tries` is `given_up`. If `tries` is TRIES, `advance` also raises NoAnswer. Raises
        MessageError if a value does not fit the message.
        """
        frame = Frame(message.TYPE, self._sequence, max(0, messages.microseconds_of(now)), message.pack())
        self._sequence = (self._sequence + 1) % 0x10000
        command = Command(frame.sequence, message, encode_frame(frame), now, tries)
        self._open[command.sequence] = command
        if self._last_byte is None:
            self._last_byte = self._last_message = now
        if message.TAKES_TIME:
            self._begin(command)
        self._send(command, now)
        return command

    def outgoing(self) -> bytes:
        """Return the new bytes to write to the device."""
        data, self._outgoing = bytes(self._outgoing), bytearray()
        self._count(bytes_sent=len(data))
        return data

    def readings(self) -> list[Reading]:
        """Return the readings completed since the last call. Each reading of a scan is returned once."""
        ready, self._readings = self._readings, []
        return ready

    @property
    def statistics(self) -> LinkStatistics:
        """Counters of the traffic until now."""
        lost = self._lost_before + self._arrivals.lost
        return LinkStatistics(**self._counted, lost_readings=lost, round_trip=self._round_trip)

    @property
    def scan_complete(self) -> bool:
        """Whether the scan has finished and every reading that the device can still send has been received."""
        action = self._action
        return action is None or (action.finished is not None and self._arrivals.next_resend() is None)

    def flush(self) -> None:
        """Complete the reading that waits for its trace, because nothing more will arrive."""
        self._readings += self.assembler.flush()

    def forget(self, command: Command) -> None:
        """Stop waiting for the answer of a command."""
        self._open.pop(command.sequence, None)
        if self._action is command:
            self._action = None

    def discard_errors(self) -> None:
        """Set the counts of errors to zero, as at the begin of a conversation."""
        for name in ("rejected_blocks", "missing_frames", "repeated_commands"):
            self._counted.pop(name, None)

    # received bytes

    def receive(self, data: bytes, now: float, arrived: float | None = None) -> None:
        """Process bytes from the device. `arrived` is their time of arrival, if before `now`.

        Damaged and unknown frames are counted and dropped. Raises NoAnswer if the device is idle again but does not
        send the Finished of its action, DeviceReset if it has restarted.
        """
        self._last_byte = now
        self._arrived = now if arrived is None else arrived
        self._count(bytes_received=len(data))
        for block in self._decoder.blocks(data):
            frame = decode_block(block)
            if isinstance(frame, Rejected):
                self._count(rejected_blocks=1)
            else:
                self._take(frame, block + DELIMITER, now)
        self._request_missing(now)

    def advance(self, now: float) -> None:
        """Repeat commands and request missing readings as due. Call this after all waiting bytes have been received.

        Raises NoAnswer if the device was silent or left a command unanswered for too long. While the caller leaves
        bytes unread, call `keep_alive` instead.
        """
        self._check_silence(now)
        for command in [*self._open.values()]:
            if now >= command.due:
                self._repeat(command, now)
        self._request_missing(now)
        self._send_sign_of_life(now)

    def keep_alive(self, now: float) -> None:
        """Send signs of life only, while the caller leaves received bytes unread. This time is not silence."""
        if self._last_byte is not None:
            self._last_byte = self._last_message = now
        for command in self._open.values():
            command.due = max(command.due, now + ANSWER_WITHIN)
        self._send_sign_of_life(now)

    def next_event(self) -> float:
        """Return the time when `advance` is next needed, s."""
        due = [command.due for command in self._open.values()]
        if self._last_byte is not None and self.info is not None:
            due += [self._last_byte + SILENCE, self._last_message + NO_MESSAGE]
        if self._needs_signs_of_life:
            due.append(self._last_sent + SIGN_OF_LIFE)
        if self._arrivals.next_resend() is not None and self._resend is None:
            due.append(self._resend_at)
        return min(due, default=math.inf)

    @property
    def _needs_signs_of_life(self) -> bool:
        """Whether the device expects signs of life, as devices do since protocol 1.1."""
        info = self.info
        return info is not None and info.major == PROTOCOL_MAJOR and info.minor >= 1

    def _take(self, frame: Frame, wire: bytes, now: float) -> None:
        self._count_gap(frame.sequence)
        self._device_time = frame.time_us
        # before its Info a device may still send frames of an earlier conversation, which are ignored
        if self.info is not None or frame.type == messages.Info.TYPE:
            self._tap(True, self._arrived, wire)
        try:
            message = messages.unpack_message(frame.type, frame.payload)
        except messages.MessageError:
            self._count(rejected_messages=1)
            return
        if message is not None:
            self._handle(message, now)

    def _handle(self, message: messages.Message, now: float) -> None:
        if not isinstance(message, messages.AnswerMessage):
            self._last_message = now
        match message:
            case messages.ReadingMessage():
                # a reading of an earlier scan may arrive after the next scan was requested; it is ignored
                expected = self._action is not None and message.fired_us >= self._action_since
                if not expected or not self._arrivals.arrived(message.number) or self._breaks_rules(message):
                    return
            case messages.TraceChunk():
                if self._action is None:
                    return
            case messages.Finished():
                self._finish(message)
            case messages.Heartbeat():
                self.heartbeat = message
                self._check_reset(message)
                self._check_heartbeat(message, now)
            case _:
                if not self._answered(message, now):
                    return
        self._readings += self.assembler.feed(message, self._device_time, self._arrived)

    def _answered(self, message: messages.Message, now: float) -> bool:
        if self.info is None and isinstance(message, messages.Refused) and message.code == messages.Refusal.BUSY:
            self.busy = message.text
        # unmatched answers, such as those to commands of an earlier conversation, are ignored
        command = self._open.pop(message.command, None) if isinstance(message, messages.AnswerMessage) else None
        if command is None or not isinstance(message, messages.AnswerMessage):
            return False
        self._last_message = now
        command.answer, command.answered_us = message, self._device_time
        match message:
            case messages.Info():
                self.info = message
            case messages.Capabilities():
                self.kept = max(1, min(message.readings_kept, KEPT_READINGS))
                self._checked = True
            case messages.Statistics():
                self.device_statistics = message
                self._round_trip = smoothed(self._round_trip, now - command.sent_at)
            case messages.Started():
                self._started(command, message)
            case messages.Refused():
                self._refused(command, message)
        if command is self._resend:
            self._resend, self._resend_at = None, now + ASK_AGAIN
            if isinstance(message, messages.Refused):
                self._arrivals.give_up()
        return True

    def _started(self, command: Command, message: messages.Started) -> None:
        if self._checked and isinstance(command.message, messages.StartScan):
            command.broken = command.broken or broken_start_rule(command.message, message)
        else:  # a replayed log plays its own readings, even if another sector was requested
            self._arrivals.total = message.first + message.readings if message.readings else MOST_READINGS

    def _breaks_rules(self, message: messages.ReadingMessage) -> bool:
        """Check a reading. The first broken rule is stored in the command, which the caller must then end."""
        action, fired, broken = self._action, self._fired, None
        self._fired = message.fired_us, message.number
        if fired and fired[0] == message.fired_us and fired[1] != message.number:
            broken = f"readings {fired[1]} and {message.number} have the same fired_us; the device clock must not stop"
        elif self._checked and action and isinstance(action.message, messages.StartScan) and self.info:
            broken = broken_reading_rule(message, action.message, self.assembler.settings, self.info.microsteps)
        if action and broken:
            action.broken = action.broken or broken
        return broken is not None

    def _refused(self, command: Command, message: messages.Refused) -> None:
        if self._action is command:
            self._action = None
        if message.code == messages.Refusal.NO_HELLO and self.info is not None:
            raise DeviceReset(f"{self.where}: refuses commands until Hello; it has restarted")

    def _check_reset(self, message: messages.Heartbeat) -> None:
        ran_back = self._device_time < self._newest_beat
        self._newest_beat = self._device_time
        if self.info is not None and (ran_back or message.boot != self.info.boot):
            raise DeviceReset(f"{self.where}: restarted during the conversation; check its power supply")

    # home, turn and scan

    def _begin(self, command: Command) -> None:
        self._action, self._action_since, self._repeats_for_finish = command, self._device_time, 0
        order = command.message
        self._lost_before += self._arrivals.lost
        self._arrivals = self._expected(order) if isinstance(order, messages.StartScan) else ReadingArrivals(0)
        self._fired = None
        if self._resend:
            self.forget(self._resend)
        self._resend = None
        self._readings.clear()

    def _expected(self, order: messages.StartScan) -> ReadingArrivals:
        total = order.headings * order.sweeps * order.pings
        return ReadingArrivals(order.first + order.count if order.count else total, order.first, self.kept)

    def _finish(self, message: messages.Finished) -> None:
        action = self._action
        if action is None or message.command != action.sequence:
            return
        action.finished = message  # if its answer was lost, the command is still repeated until the answer arrives
        self._arrivals.device_made(message.readings)

    def _check_heartbeat(self, message: messages.Heartbeat, now: float) -> None:
        action = self._action
        if action is None or action.answer is None or action.finished is not None:
            return
        if isinstance(action.message, messages.StartScan):
            self._arrivals.device_made(message.readings)
        if (
            message.state == messages.State.IDLE
        ):  # Finished was lost; the device sends it again when the command is repeated
            self._repeats_for_finish += 1
            if self._repeats_for_finish > ASKS:
                raise NoAnswer(f"{self.where}: is idle but sends no Finished for {action.name}; start it again")
            self._send(action, now, repeat=True)

    # missing readings

    def _request_missing(self, now: float) -> None:
        if self._arrivals.next_resend() is None:
            if self._action and self._action.finished:  # no more trace chunks of the last reading will arrive
                self._readings += self.assembler.flush()
            return
        if self._resend is None and now >= self._resend_at and (wanted := self._arrivals.request(ASKS)):
            self._count(resends=1)
            self._resend = self.command(messages.Resend(*wanted), now)

    # sent commands, silence, counts

    def _send(self, command: Command, now: float, repeat: bool = False) -> None:
        # the first delimiter ends a damaged frame that the device may have received
        self._last_sent = now
        self._outgoing += DELIMITER + command.wire
        self._count(frames_sent=1, repeated_commands=int(repeat))
        self._tap(False, now, command.wire)

    def _repeat(self, command: Command, now: float) -> None:
        if command is self._resend:  # an unanswered Resend must not end a running scan; a new one follows
            self.forget(command)
            self._resend = None
            return
        if command.sent >= command.tries:
            self.forget(command)
            command.given_up = True
            if command.tries < TRIES:
                return
            self.unanswered = command.name
            raise NoAnswer(f"{self.where}: no answer to {command.name} after {TRIES} tries; check the cable")
        command.sent += 1
        command.due = now + ANSWER_WITHIN
        self._send(command, now, repeat=True)

    def _send_sign_of_life(self, now: float) -> None:
        if self._needs_signs_of_life and now >= self._last_sent + SIGN_OF_LIFE:
            self.command(messages.AskStatistics(), now, tries=1)

    def _check_silence(self, now: float) -> None:
        if self._last_byte is None or self.info is None:  # a device sends nothing before Hello
            return
        if now < min(self._last_byte + SILENCE, self._last_message + NO_MESSAGE):
            return
        # a sign of life is sent once, and open whenever the device restarts
        self.unanswered = next((command.name for command in self._open.values() if command.tries == TRIES), None)
        if now >= self._last_byte + SILENCE:
            raise NoAnswer(f"{self.where}: no byte received for {SILENCE:g} s; check the scanner's power and its cable")
        raise NoAnswer(
            f"{self.where}: no valid message for {NO_MESSAGE:g} s; `sonarhw monitor` shows the received bytes"
        )

    def _count_gap(self, sequence: int) -> None:
        gap = 0 if self._device_sequence is None else (sequence - self._device_sequence - 1) % 0x10000
        self._device_sequence = sequence
        self._count(frames_received=1, missing_frames=gap if gap < 0x8000 else 0)

    def _count(self, **more: int) -> None:
        self._counted.update(more)


def raise_if_refused(command: Command, where: str) -> None:
    """Raise CommandRefused if the device refused the command."""
    if isinstance(command.answer, messages.Refused):
        text = command.answer.text
        raise CommandRefused(f"{where}: refused {command.name}: {text}", command.answer.code)
