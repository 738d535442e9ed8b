"""A scanner that is not there: the board's side of the protocol, with a turntable that takes time.

Takes bytes from a host and hears through an echo source; hands on the bytes a real board would send, no sooner than
its line could carry them. It is a `Device`: no thread, no port, no clock of its own.
"""

import math
import random
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from sonarhw.assembly import FULL_SCALE, microdegrees_of, radians_of
from sonarhw.echo_source import EchoSource, Ping
from sonarhw.frames import Frame, FrameDecoder, Rejected, encode_frame
from sonarhw.messages import (
    BY_TYPE,
    FROM_HOST,
    MAX_ECHOES,
    NO_TEMPERATURE,
    PROTOCOL_MAJOR,
    PROTOCOL_MINOR,
    Accepted,
    Configure,
    Finished,
    Heartbeat,
    Hello,
    Home,
    Info,
    Message,
    MessageError,
    Outcome,
    ReadingMessage,
    Refusal,
    Refused,
    Resend,
    Settings,
    Started,
    StartScan,
    State,
    Stop,
    TraceChunk,
    Turn,
)
from sonarhw.readings import ScanOrder, Trace
from sonarhw.turntable import Turntable

HEARTBEAT = 0.250  # s
PING_PERIOD = 0.100  # s, turning and settling within
MAX_LISTEN = 0.065  # s
KEPT_READINGS = 64
CHUNK = 256  # samples
BYTE_TIME = 10 / 1_000_000  # s: eight bits, start and stop at 1 000 000 baud
REACH = 720_000_000  # µdeg either way; the transducer's cable winds no further
BACKLOG = 65_536  # bytes waiting for the line; commands that come on top of that are dropped
_MICROSTEPS = 3200
_PATIENCE = 0.05  # s between two looks whether the echo source is ready


@dataclass(frozen=True)
class BoardIdentity:
    """What the board says of itself."""

    serial: str = "FAKE-0001"
    profile: str = ""  # board profile that describes it
    trace_rate: int = 50_000  # Hz
    firmware: str = "sonarhw-fake 0.1.0"
    major: int = PROTOCOL_MAJOR
    minor: int = PROTOCOL_MINOR


class Refusing(Exception):
    """The command at hand is answered with a refusal."""

    def __init__(self, code: Refusal, text: str) -> None:
        super().__init__(text)
        self.code, self.text = code, text


@dataclass
class _Action:
    """A home, turn or scan: running, or the last one that ran."""

    key: tuple[int, int, bytes]  # type, sequence and payload of its command
    accepted: Message
    state: State
    wakes: Iterator[float]  # when it wants to go on, s; ends when it is done
    due: float = 0.0
    finished: Finished | None = None


class Line:
    """The sending half of a serial line: frames leave one after another, each when its last byte could have."""

    def __init__(self) -> None:
        self._queue: deque[tuple[float, bytes]] = deque()
        self._free = 0.0
        self._sequence = 0
        self.waiting = 0  # bytes

    def send(self, message: Message, now: float) -> None:
        """Queue a message; its frame carries the time it was made."""
        wire = encode_frame(Frame(message.TYPE, self._sequence, round(now * 1e6), message.pack()))
        self._sequence = (self._sequence + 1) % 0x10000
        self._free = max(now, self._free) + len(wire) * BYTE_TIME
        self._queue.append((self._free, wire))
        self.waiting += len(wire)

    def departure(self) -> float | None:
        """When the next frame has left, s."""
        return self._queue[0][0] if self._queue else None

    def depart(self, now: float) -> bytes:
        """The frames that have left by `now`."""
        left = bytearray()
        while self._queue and self._queue[0][0] <= now:
            left += self._queue.popleft()[1]
        self.waiting -= len(left)
        return bytes(left)

    def clear(self) -> None:
        """Forget what has not left yet."""
        self._queue.clear()
        self._free, self.waiting = 0.0, 0


class Board:
    """The fake board. Its clock starts at 0 with the first time it is told; its noise is the echo source's affair."""

    def __init__(
        self,
        echoes: EchoSource,
        seed: int = 0,
        blanking: float = 0.00238,
        identity: BoardIdentity | None = None,
        ready: Callable[[], bool] = lambda: True,
    ) -> None:
        """`ready` tells whether the echo source answers at once by now; until then home and scan take longer."""
        self._echoes = echoes
        self._ready = ready
        self._identity = identity or BoardIdentity(serial=f"FAKE-{seed:04d}")
        self._turntable = Turntable(random.Random(seed).uniform(0, math.tau))
        self._line = Line()
        self._decoder = FrameDecoder()
        self._born: float | None = None  # the caller's clock when this one began
        self._now = 0.0
        self._greeted = False
        self._next_heartbeat = 0.0
        self._settings = Settings(0, round(MAX_LISTEN * 1e6), round(blanking * 1e6), 0, 343_200)
        self._action: _Action | None = None
        self._kept: deque[ReadingMessage] = deque(maxlen=KEPT_READINGS)
        self._made = 0

    # Device

    @property
    def busy(self) -> bool:
        """Whether it homes, turns or scans; not while it waits for its echo source, which needs real time."""
        return self._running is not None and self._ready()

    def receive(self, data: bytes, now: float) -> None:
        """Take bytes from the host."""
        time = self._time(now)
        self._work(time)
        for item in self._decoder.feed(data):
            # the text of a damaged command is not known, so there is nothing to answer; the host sends it again
            if not isinstance(item, Rejected) and self._line.waiting < BACKLOG:
                self._obey(item, time)

    def next_event(self) -> float | None:
        """When `advance` next has something to do, s on the caller's clock."""
        due = [time for time in (self._line.departure(), self._wake()) if time is not None]
        return min(due) + (self._born or 0.0) if due else None

    def advance(self, now: float) -> bytes:
        """Do what is due by `now`; the bytes that have left for the host since the last call."""
        time = self._time(now)
        self._work(time)
        return self._line.depart(time)

    def hang_up(self) -> None:
        """The host has gone: stand still, forget the conversation."""
        self._greeted = False
        self._stop_action(self._now)
        self._action = None
        self._line.clear()
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
        return min(due) if due else None

    def _work(self, now: float) -> None:
        while (due := self._wake()) is not None and due <= now:
            running = self._running
            if running and running.due <= due:
                self._step(running, due)
            else:
                self._beat(due)

    def _beat(self, now: float) -> None:
        state = self._running.state if self._running else State.IDLE
        angle = microdegrees_of(self._turntable.angle(now))
        self._line.send(Heartbeat(state, angle, self._made, self._temperature()), now)
        self._next_heartbeat = now + HEARTBEAT

    def _step(self, action: _Action, now: float) -> None:
        due = next(action.wakes, None)
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
            self._line.send(Refused(frame.sequence, refusal.code, refusal.text), now)

    def _understand(self, frame: Frame) -> Message:
        kind = BY_TYPE.get(frame.type)
        if kind not in FROM_HOST:
            raise Refusing(Refusal.UNKNOWN, f"message type 0x{frame.type:02x} is not known to this firmware")
        try:
            message = kind.unpack(frame.payload)
        except MessageError as error:
            raise Refusing(Refusal.MALFORMED, f"{kind.__name__}: {error}") from error
        if not self._greeted and not isinstance(message, Hello):
            raise Refusing(Refusal.NO_HELLO, "say Hello first")
        return message

    def _carry_out(self, message: Message, key: tuple[int, int, bytes], now: float) -> None:
        sequence = key[1]
        match message:
            case Hello():
                self._greet(sequence, now)
            case Configure():
                self._refuse_when_busy()
                self._configure(message, sequence, now)
            case Home():
                self._refuse_when_busy()
                self._start(_Action(key, Accepted(sequence), State.HOMING, self._homing(now)), now)
            case Turn():
                self._refuse_when_busy()
                self._check_angle(message.angle)
                self._start(_Action(key, Accepted(sequence), State.TURNING, self._turning(message, now)), now)
            case StartScan():
                self._refuse_when_busy()
                self._start_scan(message, key, now)
            case Stop():
                self._stop_action(now)
                self._line.send(Accepted(sequence), now)
            case Resend():
                self._resend(message, sequence, now)

    def _greet(self, sequence: int, now: float) -> None:
        self._stop_action(now)
        self._action = None
        self._greeted, self._next_heartbeat = True, now + HEARTBEAT
        me = self._identity
        self._line.send(
            Info(
                command=sequence,
                major=me.major,
                minor=me.minor,
                firmware=me.firmware,
                serial=me.serial,
                board=me.profile,
                temperature=self._temperature(),
                trace_rate=me.trace_rate,
                microsteps=_MICROSTEPS,
            ),
            now,
        )

    def _configure(self, wish: Configure, sequence: int, now: float) -> None:
        if wish.trace > 1:
            raise Refusing(Refusal.OUT_OF_RANGE, f"trace is {wish.trace}; it is 0 or 1")
        listen = min(wish.listen_us, round(MAX_LISTEN * 1e6))
        if not 0 < listen > wish.blanking_us:
            raise Refusing(
                Refusal.OUT_OF_RANGE,
                f"nothing is heard with {wish.blanking_us} us of blanking in {listen} us of listening",
            )
        if wish.speed_of_sound == 0:
            raise Refusing(Refusal.OUT_OF_RANGE, "speed of sound is 0 mm/s")
        self._settings = Settings(sequence, listen, wish.blanking_us, wish.trace, wish.speed_of_sound)
        self._line.send(self._settings, now)

    def _resend(self, wish: Resend, sequence: int, now: float) -> None:
        if not 1 <= wish.count <= KEPT_READINGS:
            raise Refusing(Refusal.OUT_OF_RANGE, f"{wish.count} readings asked for; 1 to {KEPT_READINGS} can be")
        self._line.send(Accepted(sequence), now)
        for reading in self._kept:
            if wish.first <= reading.number < wish.first + wish.count:
                self._line.send(reading, now)

    def _refuse_when_busy(self) -> None:
        if self._running:
            raise Refusing(Refusal.BUSY, f"{self._running.state.name.lower()}; send Stop first")

    def _check_angle(self, microdegrees: int) -> None:
        if not self._turntable.homed:
            raise Refusing(Refusal.NOT_HOMED, "the turntable does not know its angle; send Home first")
        if abs(microdegrees) > REACH:
            raise Refusing(Refusal.OUT_OF_RANGE, f"{microdegrees} udeg; the cable winds from -{REACH} to {REACH} udeg")

    # home, turn, scan

    def _start(self, action: _Action, now: float) -> None:
        self._action = action
        self._made = 0
        self._line.send(action.accepted, now)
        self._step(action, now)

    def _start_scan(self, order: StartScan, key: tuple[int, int, bytes], now: float) -> None:
        if 0 in (order.step, order.headings, order.sweeps, order.pings):
            raise Refusing(Refusal.OUT_OF_RANGE, "step, headings, sweeps and pings are not 0")
        self._check_angle(order.start)
        self._check_angle(order.start + order.step * (order.headings - 1))
        count = order.headings * order.sweeps * order.pings
        self._kept.clear()
        self._start(_Action(key, Started(key[1], count), State.SCANNING, self._scanning(order, now)), now)

    def _finish(self, action: _Action, outcome: Outcome, now: float) -> None:
        readings = self._made if action.state == State.SCANNING else 0
        action.finished = Finished(action.key[1], outcome, readings, "")
        self._line.send(action.finished, now)

    def _stop_action(self, now: float) -> None:
        if self._running:
            self._turntable.halt(now)
            self._finish(self._running, Outcome.STOPPED, now)

    def _repeat_answers(self, action: _Action, now: float) -> None:
        self._line.send(action.accepted, now)
        if action.finished:
            self._line.send(action.finished, now)

    def _homing(self, now: float) -> Iterator[float]:
        found = self._turntable.home(now)
        yield found
        while not self._ready():
            found += _PATIENCE
            yield found
        self._turntable.found(found)

    def _turning(self, order: Turn, now: float) -> Iterator[float]:
        yield self._turntable.turn(radians_of(order.angle), now)

    def _scanning(self, order: StartScan, now: float) -> Iterator[float]:
        scan = ScanOrder(radians_of(order.start), radians_of(order.step), order.headings, order.sweeps, order.pings)
        while not self._ready():
            now += _PATIENCE
            yield now
        for number in range(scan.readings):
            sweep, angle, ping = scan.ping_at(number)
            fire = self._turntable.turn(angle, now)
            yield fire
            heard = fire + self._settings.listen_us * 1e-6
            yield heard
            self._report(number, Ping(angle, sweep, ping, self._settings.listen_us * 1e-6, False), fire, heard)
            now = max(now + PING_PERIOD, heard)
            if number + 1 < scan.readings:
                yield now

    def _report(self, number: int, ping: Ping, fired: float, now: float) -> None:
        ping = Ping(ping.angle, ping.sweep, ping.index, ping.listen, bool(self._settings.trace))
        heard = self._echoes.hear(ping)
        blanking = self._settings.blanking_us * 1e-6
        echoes = sorted(time for time in heard.echo_times if blanking <= time <= ping.listen)[:MAX_ECHOES]
        reading = ReadingMessage(
            number=number,
            sweep=ping.sweep,
            ping=ping.index,
            angle=microdegrees_of(ping.angle),
            fired_us=round(fired * 1e6),
            temperature=self._temperature(),
            echoes=tuple(round(time * 1e9) for time in echoes),
        )
        self._kept.append(reading)
        self._made = number + 1
        self._line.send(reading, now)
        if heard.trace is not None and ping.trace:
            for chunk in trace_chunks(number, heard.trace):
                self._line.send(chunk, now)

    def _temperature(self) -> int:
        temperature = self._echoes.temperature_c
        return NO_TEMPERATURE if temperature is None else round(temperature * 100)


def trace_chunks(number: int, trace: Trace) -> Iterator[TraceChunk]:
    """The messages that carry the trace of reading `number`, 8 bits a sample; a trace beyond 65 535 samples is cut."""
    levels = np.clip(np.rint(trace.samples[:0xFFFF] * FULL_SCALE), 0, FULL_SCALE).astype(np.uint8)
    period, start = round(1e9 / trace.rate), round(trace.start * 1e9)
    for offset in range(0, len(levels), CHUNK):
        samples = levels[offset : offset + CHUNK].tobytes()
        yield TraceChunk(number, offset, len(levels), period, start, samples)
