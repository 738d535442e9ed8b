"""The device's part of every conversation, whoever plays the device: the fake board and the replayed log share it.

Takes bytes from a host; hands on answers, heartbeats and readings, no sooner than a line could carry them. A command
that comes twice is carried out once and answered twice; the last readings are kept to be sent again.
"""

import math
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from sonarhw.device.paced_line import Line
from sonarhw.wire.frames import Frame, FrameDecoder, Rejected
from sonarhw.wire.limits import (
    BAUD_TIMEOUT,
    HEARTBEAT,
    HOST_SILENCE,
    KEPT_READINGS,
    MAX_ECHOES,
    MAX_TEST,
    MAX_TESTED,
    MOST_READINGS,
)
from sonarhw.wire.messages import (
    BY_TYPE,
    Accepted,
    Approach,
    AskCapabilities,
    AskStatistics,
    Capabilities,
    CommandMessage,
    Configure,
    ConfigureTurntable,
    Finished,
    Heartbeat,
    Hello,
    Home,
    Info,
    LinkTested,
    Message,
    MessageError,
    Outcome,
    ReadingMessage,
    Refusal,
    Refused,
    Resend,
    ResetCause,
    SetBaud,
    Settings,
    Started,
    StartScan,
    State,
    Statistics,
    Stop,
    TestLink,
    TraceChunk,
    TraceKind,
    Turn,
    TurntableSettings,
    WhenBusy,
)

BACKLOG = 65_536  # bytes waiting for the line; commands that come on top of that are dropped


class Refusing(Exception):
    """The command at hand is answered with a refusal."""

    def __init__(self, code: Refusal, text: str) -> None:
        super().__init__(text)
        self.code, self.text = code, text


class Failing(Exception):
    """What was begun cannot be ended; the text says why."""

    def __init__(self, text: str, outcome: Outcome = Outcome.FAULT) -> None:
        super().__init__(text)
        self.outcome = outcome


@dataclass
class _Action:
    """A home, turn or scan: running, or the last one that ran."""

    key: tuple[int, int, bytes]  # type, sequence and payload of its command
    accepted: Message
    state: State
    wakes: Iterator[float]  # when it wants to go on, s; ends when it is done
    due: float = 0.0
    finished: Finished | None = None


class ProtocolDevice(ABC):
    """A `Device` that speaks the protocol; what it can do is filled in below it.

    Its clock starts at 0 with the first time it is told. Homing, turning and scanning are iterators of the times at
    which they want to go on; they end when they are done, or are dropped when the host says stop.
    """

    def __init__(self, line: Line) -> None:
        self.line = line
        self._decoder = FrameDecoder()
        self._born: float | None = None  # the caller's clock when this one began
        self._now = 0.0
        self._greeted = False
        self._watches = False  # whether the host has promised signs of life
        self._heard = 0.0  # when the last sound frame came
        self._former_baud: int | None = None  # to go back to where nothing is heard at the new one
        self._frames = self._rejected = self._pings = 0
        self._next_heartbeat = 0.0
        self._action: _Action | None = None
        self._kept: deque[ReadingMessage] = deque(maxlen=KEPT_READINGS)
        self._made = 0
        self.plug: int | None = 0
        self.hurry = 1.0

    # what a device fills in; times are s on its own clock

    @abstractmethod
    def temperature(self) -> int:
        """Air at the board, as messages carry it."""

    @abstractmethod
    def angle(self, now: float) -> int:
        """Where the turntable points, µdeg."""

    @abstractmethod
    def info(self, sequence: int) -> Info:
        """Who it is, in answer to the Hello of that sequence number."""

    @abstractmethod
    def configure(self, wish: Configure, sequence: int) -> Settings:
        """The settings from now on in force. Raises Refusing."""

    @abstractmethod
    def homing(self, now: float) -> Iterator[float]:
        """Find the zero of the turntable."""

    @abstractmethod
    def turning(self, order: Turn, now: float) -> Iterator[float]:
        """Turn to an angle. Raises Refusing, at once and not when it is gone through."""

    @abstractmethod
    def scanning(self, order: StartScan, now: float) -> tuple[int, Iterator[float]]:
        """How many readings the whole scan has, and those from `order.first` on as they are made.

        They are handed to `report`. Raises Refusing, at once.
        """

    @abstractmethod
    def halt(self, now: float) -> None:
        """Stand still where it is: what ran was stopped."""

    def capabilities(self, sequence: int) -> Capabilities:
        """What it can. Raises Refusing where nobody knows."""
        raise Refusing(Refusal.UNKNOWN, "what this device can is not known")

    def configure_turntable(self, wish: ConfigureTurntable, sequence: int) -> TurntableSettings:
        """How it turns from now on. Raises Refusing."""
        return TurntableSettings(sequence, wish.speed, wish.acceleration, wish.settle_us, wish.approach)

    @property
    def homed(self) -> bool:
        """Whether it knows its zero."""
        return True

    @property
    def boot(self) -> int:
        """How often it has started; 0: not counted."""
        return 0

    def release(self, now: float) -> None:
        """Let go of the motor: the host is silent."""
        self.halt(now)

    def statistics(self, sequence: int) -> Statistics:
        """What it has counted."""
        return Statistics(sequence, self._frames, self._rejected, 0, self._pings, 0, ResetCause.POWER, 0)

    def report(self, reading: ReadingMessage, trace: Iterable[TraceChunk], now: float) -> None:
        """Send a reading and its trace; it is kept to be sent again. Raises MessageError where it fits no message."""
        self.line.send(reading, now)
        self._kept.append(reading)
        self._made = reading.number + 1
        self._pings += 1
        for chunk in trace:
            self.line.send(chunk, now)

    # Device

    @property
    def busy(self) -> bool:
        """Whether it homes, turns or scans."""
        return self._running is not None

    def receive(self, data: bytes, now: float) -> None:
        """Take bytes from the host."""
        time = self._time(now)
        self._work(time)
        for item in self._decoder.feed(data):
            # the text of a damaged command is not known, so there is nothing to answer; the host sends it again
            if isinstance(item, Rejected):
                self._rejected += 1
            elif self.line.waiting < BACKLOG:
                self._frames += 1
                self._heard, self._former_baud = time, None
                self._obey(item, time)

    def next_event(self) -> float | None:
        """When `advance` next has something to do, s on the caller's clock."""
        due = [time for time in (self.line.departure(), self._wake()) if time is not None]
        if not due:
            return None
        born = self._born or 0.0
        event = min(due) + born
        # rounding must not set it before what is due, or a clock that jumps from event to event would stand still
        return event if event - born >= min(due) else math.nextafter(event, math.inf)

    def advance(self, now: float) -> bytes:
        """Do what is due by `now`; the bytes that have left for the host since the last call."""
        time = self._time(now)
        self._work(time)
        return self.line.depart(time)

    def hang_up(self) -> None:
        """The host has gone: stand still, forget the conversation."""
        self._greeted = False
        self._former_baud = None
        self.line.change(self.line.first_baud)
        self._stop_action(self._now)
        self._action = None
        self.line.clear()
        self._decoder = FrameDecoder()

    # time

    def _time(self, now: float) -> float:
        if self._born is None:
            self._born = now
        self._now = now - self._born
        return self._now

    @property
    def _running(self) -> _Action | None:
        return self._action if self._action and self._action.finished is None else None

    def _wake(self) -> float | None:
        running = self._running
        due = [running.due] if running else []
        if self._greeted:
            due.append(self._next_heartbeat)
        if (deaf := self._deaf_at()) is not None:
            due.append(deaf)
        return min(due) if due else None

    def _deaf_at(self) -> float | None:
        """When the silence of the host has a consequence."""
        if self._former_baud is not None:
            return self._heard + BAUD_TIMEOUT * self.hurry
        return self._heard + HOST_SILENCE * self.hurry if self._greeted and self._watches else None

    def _work(self, now: float) -> None:
        while (due := self._wake()) is not None and due <= now:
            running = self._running
            if due == self._deaf_at():
                self._miss_host(due)
            elif running and running.due <= due:
                self._step(running, due)
            else:
                self._beat(due)

    def _beat(self, now: float) -> None:
        state = self._running.state if self._running else State.IDLE
        beat = Heartbeat(state, self.angle(now), self._made, self.temperature(), self.boot, int(self.homed))
        self.line.send(beat, now)
        self._next_heartbeat = now + HEARTBEAT

    def _miss_host(self, now: float) -> None:
        if self._former_baud is not None:
            self.line.change(self._former_baud)
            self._former_baud, self._heard = None, now
            return
        self._stop_action(now)
        self._greeted, self._action = False, None
        self.line.change(self.line.first_baud)
        self.release(now)

    def _step(self, action: _Action, now: float) -> None:
        try:
            due = next(action.wakes, None)
        except (MessageError, Failing) as error:
            # settings under which a reading fits no message, too: the host hears of it, and the next one is served
            self.halt(now)
            where = f"reading {self._made}: " if isinstance(error, MessageError) else ""
            outcome = error.outcome if isinstance(error, Failing) else Outcome.FAULT
            self._finish(action, outcome, now, f"{where}{error}")
            return
        if due is None:
            self._finish(action, Outcome.DONE, now)
        else:
            action.due = due

    # commands

    def _obey(self, frame: Frame, now: float) -> None:
        key = (frame.type, frame.sequence, frame.payload)
        if self._greeted and self._action and key == self._action.key:
            self._repeat_answers(self._action, now)
            return
        try:
            self._carry_out(self._understand(frame), key, now)
        except Refusing as refusal:
            self.line.send(Refused(frame.sequence, refusal.code, refusal.text), now)

    def _understand(self, frame: Frame) -> CommandMessage:
        kind = BY_TYPE.get(frame.type)
        if kind is None or not issubclass(kind, CommandMessage) or self.line.minor < kind.SINCE:
            raise Refusing(Refusal.UNKNOWN, f"message type 0x{frame.type:02x} is not known to this firmware")
        try:
            message = kind.unpack(frame.payload)
            # older firmware skips what it does not know
            message = kind.unpack(message.pack(self.line.minor))
        except MessageError as error:
            raise Refusing(Refusal.MALFORMED, f"{kind.__name__}: {error}") from error
        if not self._greeted and not isinstance(message, Hello):
            raise Refusing(Refusal.NO_HELLO, "say Hello first")
        return message

    def _carry_out(self, message: CommandMessage, key: tuple[int, int, bytes], now: float) -> None:
        sequence = key[1]
        if message.WHEN_BUSY is WhenBusy.REFUSED and self._running:
            raise Refusing(Refusal.BUSY, f"{self._running.state.name.lower()}; send Stop first")
        match message:
            case Hello():
                self._greet(message, sequence, now)
            case Configure():
                _check_settings(message)
                self.line.send(self.configure(message, sequence), now)
            case ConfigureTurntable():
                if message.approach not in [*Approach]:
                    raise Refusing(Refusal.OUT_OF_RANGE, f"approach is {message.approach}; it is 0, 1 or 2")
                self.line.send(self.configure_turntable(message, sequence), now)
            case Home():
                self._start(_Action(key, Accepted(sequence), State.HOMING, self.homing(now)), now)
            case Turn():
                self._start(_Action(key, Accepted(sequence), State.TURNING, self.turning(message, now)), now)
            case StartScan():
                total, wakes = self.scanning(message, now)
                count = _readings_to_make(message, total)
                self._kept.clear()
                self._made = message.first
                accepted = Started(sequence, count, message.first)
                self._start(_Action(key, accepted, State.SCANNING, wakes), now)
            case Stop():
                self._stop_action(now)
                self.line.send(Accepted(sequence), now)
            case Resend():
                self._resend(message, sequence, now)
            case AskCapabilities():
                self.line.send(self.capabilities(sequence), now)
            case AskStatistics():
                self.line.send(self.statistics(sequence), now)
            case SetBaud():
                self._set_baud(message, sequence, now)
            case TestLink():
                self._test_link(message, sequence, now)

    def _greet(self, hello: Hello, sequence: int, now: float) -> None:
        self._stop_action(now)
        self._watches = (hello.major, hello.minor) >= (1, 1) and self.line.minor >= 1
        self._action = None
        self._greeted, self._next_heartbeat = True, now + HEARTBEAT
        self.line.send(self.info(sequence), now)

    def _resend(self, wish: Resend, sequence: int, now: float) -> None:
        if not 1 <= wish.count <= KEPT_READINGS:
            raise Refusing(Refusal.OUT_OF_RANGE, f"{wish.count} readings asked for; 1 to {KEPT_READINGS} can be")
        self.line.send(Accepted(sequence), now)
        for reading in self._kept:
            if wish.first <= reading.number < wish.first + wish.count:
                self.line.send(reading, now)

    def _set_baud(self, wish: SetBaud, sequence: int, now: float) -> None:
        if wish.baud not in self.line.bauds:
            known = ", ".join(map(str, self.line.bauds)) or "this line has no speed of its own"
            raise Refusing(Refusal.OUT_OF_RANGE, f"{wish.baud} baud; can be: {known}")
        self.line.send(Accepted(sequence), now)
        self._former_baud = self.line.baud
        self.line.change(wish.baud)

    def _test_link(self, wish: TestLink, sequence: int, now: float) -> None:
        if not 1 <= len(wish.data) <= MAX_TEST or wish.size > MAX_TESTED:
            text = f"{len(wish.data)} bytes of which {wish.size} are wanted; 1 to {MAX_TEST}, and up to {MAX_TESTED}"
            raise Refusing(Refusal.OUT_OF_RANGE, text)
        repeats = -(-wish.size // len(wish.data))
        self.line.send(LinkTested(sequence, (wish.data * repeats)[: wish.size]), now)

    # home, turn, scan

    def _start(self, action: _Action, now: float) -> None:
        self._action = action
        self.line.send(action.accepted, now)
        self._step(action, now)

    def _finish(self, action: _Action, outcome: Outcome, now: float, text: str = "") -> None:
        readings = self._made if action.state == State.SCANNING else 0
        action.finished = Finished(action.key[1], outcome, readings, text)
        self.line.send(action.finished, now)

    def _stop_action(self, now: float) -> None:
        if self._running:
            self.halt(now)
            self._finish(self._running, Outcome.STOPPED, now)

    def _repeat_answers(self, action: _Action, now: float) -> None:
        self.line.send(action.accepted, now)
        if action.finished:
            self.line.send(action.finished, now)


def _check_settings(wish: Configure) -> None:
    """Raise Refusing for settings that make no sense on any device."""
    if wish.trace not in [*TraceKind]:
        raise Refusing(Refusal.OUT_OF_RANGE, f"trace is {wish.trace}; it is 0, 1 or 2")
    if wish.trace_bits not in (0, 8, 16):
        raise Refusing(Refusal.OUT_OF_RANGE, f"traces of {wish.trace_bits} bits; it is 8 or 16, or 0")
    if not 1 <= wish.echoes <= MAX_ECHOES:
        raise Refusing(Refusal.OUT_OF_RANGE, f"{wish.echoes} echoes of a ping; it is 1 to {MAX_ECHOES}")
    if wish.listen_us == 0:
        raise Refusing(Refusal.OUT_OF_RANGE, "listen is 0 us; nothing would be heard")
    if wish.speed_of_sound == 0:
        raise Refusing(Refusal.OUT_OF_RANGE, "speed of sound is 0 mm/s")


def _readings_to_make(order: StartScan, total: int) -> int:
    """How many readings an order of a scan of `total` asks for. Raises Refusing."""
    if total > MOST_READINGS:
        raise Refusing(Refusal.OUT_OF_RANGE, f"{total} readings; they are counted up to {MOST_READINGS}")
    count = order.count or total - order.first
    if not 0 <= order.first <= order.first + count <= total or (total and not count):
        raise Refusing(Refusal.OUT_OF_RANGE, f"readings {order.first} and {count} in all; the scan has {total}")
    return count
