"""The device side of the protocol, shared by the fake board, the replayed log and plug-ins."""

import math
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Protocol

from sonarhw.wire import limits, messages
from sonarhw.wire.frames import Frame, FrameDecoder, Rejected, encode_frame


class RefusalError(Exception):
    """The current command must be answered with a refusal."""

    def __init__(self, code: messages.Refusal, text: str) -> None:
        super().__init__(text)
        self.code, self.text = code, text


def _out_of_limits(command: messages.CommandMessage, bauds: tuple[int, ...]) -> str | None:
    """Return what is out of range in a command for every device, on a line with these `bauds`; None: nothing."""
    match command:
        case messages.Configure() if command.trace not in [*messages.TraceKind]:
            return f"trace is {command.trace}; expected 0, 1 or 2"
        case messages.Configure() if command.trace_bits not in (0, 8, 16):
            return f"trace_bits is {command.trace_bits}; expected 0, 8 or 16"
        case messages.Configure() if not 1 <= command.echoes <= limits.MAX_ECHOES:
            return f"echoes is {command.echoes}; expected 1 to {limits.MAX_ECHOES}"
        case messages.Configure(listen_us=0):
            return "listen_us is 0; expected a time after blanking_us"
        case messages.Configure(speed_of_sound=0):
            return "speed_of_sound is 0; expected mm/s above 0"
        case messages.ConfigureTurntable() if command.approach not in [*messages.Approach]:
            return f"approach is {command.approach}; expected 0, 1 or 2"
        case messages.ConfigureWiring(change=change, inverted=inverted) if (
            change > sum(messages.Wiring) or inverted & ~change
        ):
            return f"change {change}, inverted {inverted}; expected 0 to 15, and none beyond change"
        case messages.Resend(count=count) if not 1 <= count <= limits.KEPT_READINGS:
            return f"{count} readings; expected 1 to {limits.KEPT_READINGS}"
        case messages.SetBaud() if command.baud not in bauds:
            reason = f"expected {', '.join(map(str, bauds))}" if bauds else "the line has no baud rate"
            return f"{command.baud} baud; {reason}"
        case messages.TestLink(data=data, size=size) if (
            not 1 <= len(data) <= limits.MAX_TEST or size > limits.MAX_TESTED
        ):
            text = f"data of {len(data)} bytes, size {size}; expected 1 to {limits.MAX_TEST} bytes"
            return f"{text}, and a size of at most {limits.MAX_TESTED}"
    return None


def readings_to_make(order: messages.StartScan, total: int) -> int:
    """Return the number of readings that a command requests of a scan of `total`; 0: unknown. Raises RefusalError."""
    if total > limits.MOST_READINGS:
        raise _out_of_range(f"{total} readings; expected at most {limits.MOST_READINGS}")
    if total == 0:
        return 0
    if order.first >= total:
        raise _out_of_range(f"first is {order.first}; expected 0 to {total - 1}")
    most = total - order.first
    if order.count > most:
        raise _out_of_range(f"count is {order.count}; expected 0 to {most}")
    return order.count or most


def _out_of_range(text: str) -> RefusalError:
    return RefusalError(messages.Refusal.OUT_OF_RANGE, text)


class Device(Protocol):
    """A device that answers as a scanner, without threads, ports or clock: the caller passes time and bytes."""

    plug: int | None
    """Number of the socket at the host into which the cable is plugged, from 0; None while it is unplugged."""

    speedup: float
    """Ratio of device time to real time. The device allows the host to be silent for this many times its usual limit,
    because the host uses real time. Infinite: any silence is allowed."""

    @property
    def busy(self) -> bool:
        """Whether it homes, turns or scans. An idle device only sends heartbeats."""

    def receive(self, data: bytes, now: float) -> None:
        """Process bytes from the host. `now` is in s on any monotonic clock."""

    def next_event(self) -> float | None:
        """Return the time when `advance` is next needed, s; None if nothing is due until bytes arrive."""

    def advance(self, now: float) -> bytes:
        """Do the work due by `now`, and return the bytes sent to the host since the last call."""

    def hang_up(self) -> None:
        """Handle a host that has disconnected: stop, end the conversation, wait for the next Hello."""


BITS = 10  # per byte on the line: eight data bits, start and stop bit
BYTE_TIME = BITS / 1_000_000  # s


class Line:
    """The sending side of a serial line. A frame leaves when its last byte has been transmitted.

    A line with `bauds` starts at the lowest of them. A line without `bauds` has a fixed speed.
    """

    def __init__(self, byte_time: float = BYTE_TIME, bauds: tuple[int, ...] = ()) -> None:
        self.bauds = bauds
        self.first_baud = self.baud = self._next_baud = min(bauds, default=0)
        self.minor = limits.PROTOCOL_MINOR  # minor protocol version of the messages
        self._byte_time = byte_time  # s, for a line without bauds
        self._queue: deque[tuple[float, bytes]] = deque()
        self._sequence = 0
        self.idle_from = 0.0  # time when the last queued frame leaves, s
        self.waiting = 0  # bytes in the queue

    def send(self, message: messages.Message, now: float) -> None:
        """Queue a message. Its frame contains `now`, s."""
        wire = encode_frame(
            Frame(message.TYPE, self._sequence, messages.microseconds_of(now), message.pack(self.minor))
        )
        self._sequence = (self._sequence + 1) % 0x10000
        self.idle_from = max(now, self.idle_from) + len(wire) * (
            BITS / self._next_baud if self._next_baud else self._byte_time
        )
        self._queue.append((self.idle_from, wire))
        self.waiting += len(wire)

    def change(self, baud: int) -> None:
        """Change the baud rate after all queued frames have left."""
        self._next_baud = baud
        if not self._queue:
            self.baud = baud

    def departure(self) -> float | None:
        """Return the time when the next frame leaves, s; None if the queue is empty."""
        return self._queue[0][0] if self._queue else None

    def depart(self, now: float) -> bytes:
        """Remove and return the frames that have left by `now`."""
        left = bytearray()
        while self._queue and self._queue[0][0] <= now:
            left += self._queue.popleft()[1]
        if not self._queue:
            self.baud = self._next_baud
        self.waiting -= len(left)
        return bytes(left)

    def clear(self) -> None:
        """Drop the frames that have not left yet."""
        self._queue.clear()
        self.idle_from, self.waiting = 0.0, 0
        self.baud = self._next_baud


BACKLOG = 65_536  # bytes; while more are waiting for the line, commands are dropped


class ActionError(Exception):
    """A running action has failed; the text gives the reason."""

    def __init__(self, text: str, outcome: messages.Outcome = messages.Outcome.FAULT) -> None:
        super().__init__(text)
        self.outcome = outcome


@dataclass
class _Action:
    """The running or last Home, Turn or StartScan."""

    key: tuple[int, int, bytes]  # type, sequence and payload of its command
    accepted: messages.Message
    state: messages.State
    wakes: Iterator[float]  # times at which the action continues, s; ends with the action
    due: float = 0.0
    finished: messages.Finished | None = None


class ProtocolDevice(ABC):
    """A `Device` that implements the protocol; subclasses implement its actions.

    Answers, heartbeats and readings are sent at the speed of the line. A repeated command is carried out once and
    answered each time. The last readings are kept so that they can be sent again.

    Its clock starts at 0 at the first `now` that it receives. Homing, turning and scanning are iterators, which yield
    the times at which they continue. An iterator is dropped after Stop.
    """

    def __init__(self, line: Line) -> None:
        self.line = line
        self._decoder = FrameDecoder()
        self._held = bytearray()  # received while it listened
        self._done_until = 0.0  # time of the newest event
        self._overruns = 0  # bytes lost because `_held` was full
        self._start_time: float | None = None  # the caller's time when the device's clock started
        self._now = 0.0
        self._greeted = False
        self._expects_signs_of_life = False  # True for hosts of protocol 1.1 or newer
        self._last_frame = 0.0  # time of the last valid frame
        self._former_baud: int | None = None  # restored if no valid frame arrives at the new baud rate
        self._frames = self._rejected = self._pings = 0
        self._next_heartbeat = 0.0
        self._action: _Action | None = None
        self._kept: deque[messages.ReadingMessage] = deque(maxlen=limits.KEPT_READINGS)
        self._made = 0  # number of the next reading
        self.plug: int | None = 0
        self.speedup = 1.0

    # implemented by subclasses; times are s on the device's clock

    @abstractmethod
    def temperature(self) -> int:
        """Return the air temperature at the board in the unit of messages."""

    @abstractmethod
    def angle(self, now: float) -> int:
        """Return the angle of the turntable, µdeg."""

    @abstractmethod
    def info(self, sequence: int) -> messages.Info:
        """Return the answer to the Hello with that sequence number."""

    @abstractmethod
    def configure(self, request: messages.Configure, sequence: int) -> messages.Settings:
        """Apply ping settings and return those in force. Raises RefusalError."""

    @abstractmethod
    def homing(self, now: float) -> Iterator[float]:
        """Home the turntable."""

    @abstractmethod
    def turning(self, order: messages.Turn, now: float) -> Iterator[float]:
        """Turn to an angle. Raises RefusalError at once, not during the iteration."""

    @abstractmethod
    def scanning(self, order: messages.StartScan, now: float) -> tuple[int, Iterator[float]]:
        """Return the number of readings of the whole scan, and the action that makes the requested readings.

        It is 0 if it is known only at the end. The action passes the readings to `report`. Raises RefusalError at once,
        not during the iteration.
        """

    @abstractmethod
    def halt(self, now: float) -> None:
        """Stop the turntable where it is, after an action was stopped."""

    def capabilities(self, sequence: int) -> messages.Capabilities:
        """Return the capabilities. Raises RefusalError if they are unknown."""
        raise RefusalError(messages.Refusal.UNKNOWN, "the capabilities of this device are unknown")

    def configure_turntable(self, request: messages.ConfigureTurntable, sequence: int) -> messages.TurntableSettings:
        """Apply turntable settings and return those in force. Raises RefusalError."""
        return messages.TurntableSettings(
            sequence, request.speed, request.acceleration, request.settle_us, request.approach
        )

    @property
    def zero(self) -> messages.Zero:
        """How the zero of the turntable is known."""
        return messages.Zero.MARK

    def set_zero(self, now: float) -> None:
        """Make the present angle the zero of the turntable. Raises RefusalError."""
        raise RefusalError(messages.Refusal.UNKNOWN, "this device has no turntable")

    def inputs(self, now: float) -> messages.Input:
        """Return the inputs whose pins are high."""
        return messages.Input(0)

    def configure_wiring(self, change: messages.Wiring, inverted: messages.Wiring, now: float) -> messages.Wiring:
        """Invert switches or motor, and return what is inverted. Raises RefusalError."""
        raise RefusalError(messages.Refusal.UNKNOWN, "this device has no turntable")

    @property
    def listening(self) -> bool:
        """Whether it listens for echoes. It then sends nothing, and keeps received bytes for later."""
        return False

    @property
    def boot(self) -> int:
        """Number of starts; 0: not counted."""
        return 0

    def release(self, now: float) -> None:
        """Release the motor, because the host is silent."""
        self.halt(now)

    def statistics(self, sequence: int) -> messages.Statistics:
        """Return the counters of the device."""
        return messages.Statistics(
            sequence, self._frames, self._rejected, self._overruns, self._pings, 0, messages.ResetCause.POWER, 0
        )

    def report(self, reading: messages.ReadingMessage, trace: Iterable[messages.TraceChunk], now: float) -> None:
        """Send a reading and its trace, and keep the reading. Raises MessageError if a value does not fit its field."""
        self.line.send(reading, now)
        self._kept.append(reading)
        self._made = reading.number + 1
        self._pings += 1
        for chunk in trace:
            self.line.send(chunk, now)

    def wake(self, now: float) -> None:
        """Continue the running action at once. `now` is the caller's time."""
        if self._running:
            self._running.due = self._time(now)

    # Device

    @property
    def busy(self) -> bool:
        """Whether it homes, turns or scans."""
        return self._running is not None

    def receive(self, data: bytes, now: float) -> None:
        """Process bytes from the host."""
        time = self._time(now)
        self._do_due(time)
        if self.listening:
            room = limits.RECEIVE_ROOM - len(self._held)
            self._overruns += max(0, len(data) - room)
            self._held += data[:room]
        else:
            self._process(data, time)

    def _process(self, data: bytes, time: float) -> None:
        for item in self._decoder.feed(data):
            # a damaged command cannot be answered, because its sequence number is unknown; the host repeats it
            if isinstance(item, Rejected):
                self._rejected += 1
            elif self.line.waiting < BACKLOG:
                self._frames += 1
                self._last_frame, self._former_baud = time, None
                self._handle_frame(item, time)

    def next_event(self) -> float | None:
        """Return the time when `advance` is next needed, s on the caller's clock."""
        due = [time for time in (self.line.departure(), self._wake()) if time is not None]
        if not due:
            return None
        start = self._start_time or 0.0
        event = min(due) + start
        # rounding must not make the event earlier than the due time: a clock that jumps to events would never reach it
        return event if event - start >= min(due) else math.nextafter(event, math.inf)

    def advance(self, now: float) -> bytes:
        """Do the work due by `now`, and return the bytes sent to the host since the last call."""
        time = self._time(now)
        self._do_due(time)
        return self.line.depart(time)

    def hang_up(self) -> None:
        """Handle a host that has disconnected: stop, and end the conversation."""
        self._greeted = False
        self._former_baud = None
        self.line.change(self.line.first_baud)
        self._stop_action(self._now)
        self._action = None
        self.line.clear()
        self._decoder = FrameDecoder()
        self._held.clear()

    # time

    def _time(self, now: float) -> float:
        if self._start_time is None:
            self._start_time = now
        self._now = now - self._start_time
        return self._now

    @property
    def _running(self) -> _Action | None:
        return self._action if self._action and self._action.finished is None else None

    def _wake(self) -> float | None:
        running = self._running
        due = [running.due] if running else []
        if self.listening:
            return min(due)
        if self._greeted:
            due.append(self._next_heartbeat)
        if (deadline := self._silence_deadline()) is not None:
            due.append(deadline)
        return min(due) if due else None

    def _silence_deadline(self) -> float | None:
        """Return the time until which the host may be silent, s; None if its silence is not limited."""
        if self._former_baud is not None:
            return self._last_frame + limits.BAUD_TIMEOUT * self.speedup
        return (
            self._last_frame + limits.HOST_SILENCE * self.speedup
            if self._greeted and self._expects_signs_of_life
            else None
        )

    def _do_due(self, now: float) -> None:
        while (due := self._wake()) is not None and due <= now:
            running = self._running
            # what became due while it listened is done afterwards
            self._done_until = time = max(due, self._done_until)
            if not self.listening and due == self._silence_deadline():
                self._handle_silence(time)
            elif running and running.due <= due:
                self._step(running, time)
            else:
                self._send_heartbeat(time)

    def _send_heartbeat(self, now: float) -> None:
        state = self._running.state if self._running else messages.State.IDLE
        beat = messages.Heartbeat(
            state, self.angle(now), self._made, self.temperature(), self.boot, self.zero, self.inputs(now)
        )
        self.line.send(beat, now)
        self._next_heartbeat = now + limits.HEARTBEAT

    def _handle_silence(self, now: float) -> None:
        if self._former_baud is not None:
            self.line.change(self._former_baud)
            self._former_baud, self._last_frame = None, now
            return
        self._stop_action(now)
        self._greeted, self._action = False, None
        self.line.change(self.line.first_baud)
        self.release(now)

    def _step(self, action: _Action, now: float) -> None:
        try:
            due = next(action.wakes, None)
        except (messages.MessageError, ActionError) as error:
            # a MessageError means that a value does not fit its message, for example because of the settings
            self.halt(now)
            where = f"reading {self._made}: " if isinstance(error, messages.MessageError) else ""
            outcome = error.outcome if isinstance(error, ActionError) else messages.Outcome.FAULT
            self._finish(action, outcome, now, f"{where}{error}")
            return
        if due is None:
            self._finish(action, messages.Outcome.DONE, now)
        else:
            action.due = due
        if self._held and not self.listening:
            held, self._held = bytes(self._held), bytearray()
            self._process(held, now)

    # commands

    def _handle_frame(self, frame: Frame, now: float) -> None:
        key = (frame.type, frame.sequence, frame.payload)
        if self._greeted and self._action and key == self._action.key:
            self._repeat_answers(self._action, now)
            return
        try:
            self._carry_out(self._parse(frame), key, now)
        except RefusalError as refusal:
            self.line.send(messages.Refused(frame.sequence, refusal.code, refusal.text), now)

    def _parse(self, frame: Frame) -> messages.CommandMessage:
        kind = messages.BY_TYPE.get(frame.type)
        if kind is None or not issubclass(kind, messages.CommandMessage) or self.line.minor < kind.SINCE:
            raise RefusalError(messages.Refusal.UNKNOWN, f"message type 0x{frame.type:02x} is unknown to this firmware")
        try:
            message = kind.unpack(frame.payload)
            # older firmware ignores fields that its version does not have
            message = kind.unpack(message.pack(self.line.minor))
        except messages.MessageError as error:
            raise RefusalError(messages.Refusal.MALFORMED, f"{kind.__name__}: {error}") from error
        if not self._greeted and not isinstance(message, messages.Hello):
            raise RefusalError(messages.Refusal.NO_HELLO, "send Hello first")
        return message

    def _carry_out(self, message: messages.CommandMessage, key: tuple[int, int, bytes], now: float) -> None:
        sequence = key[1]
        if message.WHEN_BUSY == "BUSY" and self._running:
            raise RefusalError(messages.Refusal.BUSY, f"{self._running.state.name.lower()}; send Stop first")
        if limit := _out_of_limits(message, self.line.bauds):
            raise _out_of_range(limit)
        match message:
            case messages.Hello():
                self._greet(message, sequence, now)
            case messages.Configure():
                self.line.send(self.configure(message, sequence), now)
            case messages.ConfigureTurntable():
                self.line.send(self.configure_turntable(message, sequence), now)
            case messages.Home():
                self._start(_Action(key, messages.Accepted(sequence), messages.State.HOMING, self.homing(now)), now)
            case messages.Turn():
                self._start(
                    _Action(key, messages.Accepted(sequence), messages.State.TURNING, self.turning(message, now)), now
                )
            case messages.StartScan():
                total, wakes = self.scanning(message, now)
                count = readings_to_make(message, total)
                self._kept.clear()
                self._made = message.first
                accepted = messages.Started(sequence, count, message.first)
                self._start(_Action(key, accepted, messages.State.SCANNING, wakes), now)
            case messages.Stop():
                self._stop_action(now)
                self.line.send(messages.Accepted(sequence), now)
            case messages.Resend():
                self._resend(message, sequence, now)
            case messages.SetZero():
                self.set_zero(now)
                self.line.send(messages.Accepted(sequence), now)
            case messages.ConfigureWiring():
                inverted = self.configure_wiring(
                    messages.Wiring(message.change), messages.Wiring(message.inverted), now
                )
                self.line.send(messages.WiringSettings(sequence, inverted), now)
            case messages.AskCapabilities():
                self.line.send(self.capabilities(sequence), now)
            case messages.AskStatistics():
                self.line.send(self.statistics(sequence), now)
            case messages.SetBaud():
                self._set_baud(message, sequence, now)
            case messages.TestLink():
                self._test_link(message, sequence, now)

    def _greet(self, hello: messages.Hello, sequence: int, now: float) -> None:
        self._stop_action(now)
        self._expects_signs_of_life = (hello.major, hello.minor) >= (1, 1) and self.line.minor >= 1
        self._action = None
        self._greeted, self._next_heartbeat = True, now + limits.HEARTBEAT
        self.line.send(self.info(sequence), now)

    def _resend(self, request: messages.Resend, sequence: int, now: float) -> None:
        self.line.send(messages.Accepted(sequence), now)
        for reading in self._kept:
            if request.first <= reading.number < request.first + request.count:
                self.line.send(reading, now)

    def _set_baud(self, request: messages.SetBaud, sequence: int, now: float) -> None:
        self.line.send(messages.Accepted(sequence), now)
        self._former_baud = self.line.baud
        self.line.change(request.baud)

    def _test_link(self, request: messages.TestLink, sequence: int, now: float) -> None:
        repeats = -(-request.size // len(request.data))
        self.line.send(messages.LinkTested(sequence, (request.data * repeats)[: request.size]), now)

    # home, turn, scan

    def _start(self, action: _Action, now: float) -> None:
        self._action = action
        self.line.send(action.accepted, now)
        self._step(action, now)

    def _finish(self, action: _Action, outcome: messages.Outcome, now: float, text: str = "") -> None:
        readings = self._made if action.state == messages.State.SCANNING else 0
        if (
            isinstance(action.accepted, messages.Started) and not action.accepted.readings
        ):  # their number is known only now
            self.line.send(replace(action.accepted, readings=readings - action.accepted.first), now)
        action.finished = messages.Finished(action.key[1], outcome, readings, text)
        self.line.send(action.finished, now)

    def _stop_action(self, now: float) -> None:
        if self._running:
            self.halt(now)
            self._finish(self._running, messages.Outcome.STOPPED, now)

    def _repeat_answers(self, action: _Action, now: float) -> None:
        self.line.send(action.accepted, now)
        if action.finished:
            self.line.send(action.finished, now)
