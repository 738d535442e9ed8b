"""A direct conversation with a scanner. Nothing is repeated, and every received frame is kept."""

import random
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TypeVar

from sonarhw.device.protocol import Device
from sonarhw.link import Link
from sonarhw.wire import messages as msg
from sonarhw.wire.frames import DELIMITER, Frame, FrameDecoder, Rejected, encode_frame
from sonarhw.wire.limits import PROTOCOL_MAJOR, PROTOCOL_MINOR
from tests.hang_guard import HANG

HELLO_PERIOD = 0.5  # s
KEEPALIVE_PERIOD = 0.5  # s
STEP = 0.02  # s, at most, between two looks at a device without a port
M = TypeVar("M", bound=msg.Message)


class DirectLine:
    """A line to a device without a port. Its clock advances while the host reads."""

    def __init__(self, device: Device, baud: Callable[[], int] = lambda: 0) -> None:
        """`baud` returns the baud rate of the device."""
        self.device, self.baud, self.now = device, baud, 0.0

    def clock(self) -> float:
        """Return the time, s."""
        return self.now

    def write(self, data: bytes) -> None:
        """Pass bytes to the device."""
        self.device.receive(data, self.now)

    def read(self) -> bytes:
        """Advance the clock to the next event of the device, and return what it sends."""
        event = self.device.next_event()
        self.now = self.now + STEP if event is None else max(self.now, min(event, self.now + STEP))
        return self.device.advance(self.now)


@dataclass(frozen=True)
class ReceivedFrame:
    """One received frame and its message; None if the type is unknown."""

    frame: Frame
    message: msg.Message | None


class Talk:
    """A conversation that keeps everything it receives."""

    def __init__(self, line: "Link | DirectLine", clock: Callable[[], float] = time.monotonic) -> None:
        self.clock = clock
        self.received: list[ReceivedFrame] = []
        self.rejected: list[Rejected] = []
        self._line = line
        self._decoder = FrameDecoder()
        self._sequence = random.randrange(0x10000)  # the device may remember the last command of an earlier client
        sys.stdout.write(f"sequence numbers follow {self._sequence}\n")  # pytest shows it if the test fails
        self._kept_alive = 0.0

    # sending

    def send(self, *messages: msg.Message) -> list[int]:
        """Send messages in one piece; return their sequence numbers."""
        return self.send_frames(*((message.TYPE, message.pack()) for message in messages))

    def send_frames(self, *frames: tuple[int, bytes]) -> list[int]:
        """Send frames of type and payload in one piece; return their sequence numbers."""
        wires = [self.wire(kind, payload) for kind, payload in frames]
        self.write(DELIMITER + b"".join(wires))
        return [(self._sequence - back) % 0x10000 for back in range(len(frames) - 1, -1, -1)]

    def wire(self, kind: int, payload: bytes) -> bytes:
        """Return an encoded frame with the next sequence number."""
        self._sequence = (self._sequence + 1) % 0x10000
        return encode_frame(Frame(kind, self._sequence, 0, payload))

    def write(self, data: bytes) -> None:
        """Send bytes unchanged."""
        self._line.write(data)

    # receiving

    def until(
        self, wanted: Callable[[list[msg.Message]], bool], since: int = 0, alive: bool = True
    ) -> list[msg.Message]:
        """Receive until `wanted` accepts the messages from index `since` on, and return them; fail after HANG.

        Sends keepalive messages meanwhile if `alive`. Their answers are among the messages.
        """
        deadline = self.clock() + HANG
        while not wanted(messages := self.messages(since)):
            assert self.clock() < deadline, f"only {messages[-5:]} received within {HANG:g} s"
            if alive and self.clock() > self._kept_alive + KEEPALIVE_PERIOD:
                self._kept_alive = self.clock()
                self.send(msg.AskStatistics())
            self.listen()
        return messages

    def listen(self) -> None:
        """Read the line once and keep the frames."""
        for item in self._decoder.feed(self._line.read()):
            if isinstance(item, Rejected):
                self.rejected.append(item)
            else:
                self.received.append(ReceivedFrame(item, msg.unpack_message(item.type, item.payload)))

    def messages(self, since: int = 0) -> list[msg.Message]:
        """Return the messages from index `since` on."""
        return [item.message for item in self.received[since:] if item.message is not None]

    # commands

    def answer(self, message: msg.Message) -> msg.Message:
        """Send a message and return its answer."""
        (answer,) = self.answers(message)
        return answer

    def answers(self, *messages: msg.Message) -> list[msg.Message]:
        """Send messages in one piece and return their answers."""
        since = len(self.received)
        numbers = self.send(*messages)
        return [self._answer_to(number, since) for number in numbers]

    def answer_to_frame(self, kind: int, payload: bytes) -> msg.Message:
        """Send a frame and return its answer."""
        since = len(self.received)
        (number,) = self.send_frames((kind, payload))
        return self._answer_to(number, since)

    def ask(self, message: msg.Message, kind: type[M]) -> M:
        """Send a message and return its answer, which must be of that type."""
        answer = self.answer(message)
        assert isinstance(answer, kind)
        return answer

    def act(self, message: msg.Message) -> tuple[msg.Message, list[msg.Message], msg.Finished]:
        """Send Home, Turn or StartScan; return its answer, all messages until its Finished, and the Finished."""
        since = len(self.received)
        (number,) = self.send(message)
        answer = self._answer_to(number, since)
        assert not isinstance(answer, msg.Refused), answer
        messages = self.until(lambda messages: any(True for _ in _finished(messages, number)), since)
        return answer, messages, next(_finished(messages, number))

    def greet(self) -> msg.Info:
        """Send Hello until an Info arrives. Forget the messages of earlier conversations."""
        numbers, deadline = [], self.clock() + HANG
        while not any(True for number in numbers for _ in _answers(self.messages(), number)):
            assert self.clock() < deadline, f"no Info within {HANG:g} s"
            # a board may be starting, or still use the line speed of an earlier client
            numbers += self.send(msg.Hello(PROTOCOL_MAJOR, PROTOCOL_MINOR))
            next_hello = self.clock() + HELLO_PERIOD
            while self.clock() < next_hello and not any(True for _ in _answers(self.messages(), numbers[-1])):
                self.listen()
        # a slow device may answer an earlier Hello late, but not after it has answered this command
        self.answer(msg.AskStatistics())
        info = [info for number in numbers for info in _answers(self.messages(), number)][-1]
        assert isinstance(info, msg.Info)
        # a device may still send messages to an earlier client before its Info
        last = max(at for at, item in enumerate(self.received) if item.message is info)
        self.received, self.rejected = self.received[last:], []
        return info

    def home(self, listen: float = 0.02, trace: int = 0, again: bool = False) -> msg.Settings:
        """Configure, and home or, if the zero is known, turn to it; return the active settings."""
        settings = self.ask(msg.Configure(round(listen * 1e6), 2_380, trace, 343_200), msg.Settings)
        homed = not again and self.heartbeat().homed == msg.Zero.MARK
        finished = self.act(msg.Turn(0) if homed else msg.Home())[2]
        assert finished.outcome == 0, finished.text
        return settings

    def heartbeat(self) -> msg.Heartbeat:
        """Return the next heartbeat."""
        beats: list[msg.Heartbeat] = []
        self.until(
            lambda new: bool(beats.extend(one for one in new if isinstance(one, msg.Heartbeat)) or beats),
            len(self.received),
        )
        return beats[0]

    def quiet(self, seconds: float) -> list[msg.Message]:
        """Send nothing for so long, and return what is received."""
        since, end = len(self.received), self.clock() + seconds
        while self.clock() < end:
            self.listen()
        return self.messages(since)

    def stop(self) -> None:
        """Stop the running action."""
        self.ask(msg.Stop(), msg.Accepted)

    def capabilities(self) -> msg.Capabilities:
        """Return the capabilities of the scanner."""
        return self.ask(msg.AskCapabilities(), msg.Capabilities)

    def _answer_to(self, number: int, since: int) -> msg.Message:
        messages = self.until(lambda messages: any(True for _ in _answers(messages, number)), since, alive=False)
        return next(_answers(messages, number))


def readings(messages: list[msg.Message]) -> list[msg.ReadingMessage]:
    """Return the readings among these messages."""
    return [message for message in messages if isinstance(message, msg.ReadingMessage)]


def _answers(messages: list[msg.Message], number: int) -> Iterator[msg.Message]:
    return (message for message in messages if isinstance(message, msg.AnswerMessage) and message.command == number)


def _finished(messages: list[msg.Message], number: int) -> Iterator[msg.Finished]:
    return (message for message in messages if isinstance(message, msg.Finished) and message.command == number)
