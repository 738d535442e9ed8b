"""A direct conversation with a scanner. Nothing is repeated, and every received frame is kept."""

import random
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TypeVar

from sonarhw.link import Link
from sonarhw.wire.frames import DELIMITER, Frame, FrameDecoder, Rejected, encode_frame
from sonarhw.wire.limits import PROTOCOL_MAJOR, PROTOCOL_MINOR
from sonarhw.wire.messages import (
    Accepted,
    AnswerMessage,
    AskCapabilities,
    AskStatistics,
    Capabilities,
    Configure,
    Finished,
    Hello,
    Home,
    Info,
    Message,
    ReadingMessage,
    Refused,
    Settings,
    Stop,
    unpack_message,
)
from tests.hang_guard import HANG

HELLO_PERIOD = 0.5  # s
KEEPALIVE_PERIOD = 0.5  # s
M = TypeVar("M", bound=Message)


@dataclass(frozen=True)
class ReceivedFrame:
    """One received frame and its message; None if the type is unknown."""

    frame: Frame
    message: Message | None


class Talk:
    """A conversation that keeps everything it receives."""

    def __init__(self, link: Link) -> None:
        self.received: list[ReceivedFrame] = []
        self.rejected: list[Rejected] = []
        self._link = link
        self._decoder = FrameDecoder()
        self._sequence = random.randrange(0x10000)
        self._kept_alive = 0.0

    # sending

    def send(self, *messages: Message) -> list[int]:
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
        self._link.write(data)

    # receiving

    def until(self, wanted: Callable[[list[Message]], bool], since: int = 0, alive: bool = True) -> list[Message]:
        """Receive until `wanted` accepts the messages from index `since` on, and return them; fail after HANG.

        Sends keepalive messages meanwhile if `alive`. Their answers are among the messages.
        """
        deadline = time.monotonic() + HANG
        while not wanted(messages := self.messages(since)):
            assert time.monotonic() < deadline, f"only {messages[-5:]} received within {HANG:g} s"
            if alive and time.monotonic() > self._kept_alive + KEEPALIVE_PERIOD:
                self._kept_alive = time.monotonic()
                self.send(AskStatistics())
            self.listen()
        return messages

    def listen(self) -> None:
        """Read the link once and keep the frames."""
        for item in self._decoder.feed(self._link.read()):
            if isinstance(item, Rejected):
                self.rejected.append(item)
            else:
                self.received.append(ReceivedFrame(item, unpack_message(item.type, item.payload)))

    def messages(self, since: int = 0) -> list[Message]:
        """Return the messages from index `since` on."""
        return [item.message for item in self.received[since:] if item.message is not None]

    # commands

    def answer(self, message: Message) -> Message:
        """Send a message and return its answer."""
        (answer,) = self.answers(message)
        return answer

    def answers(self, *messages: Message) -> list[Message]:
        """Send messages in one piece and return their answers."""
        since = len(self.received)
        numbers = self.send(*messages)
        return [self._answer_to(number, since) for number in numbers]

    def answer_to_frame(self, kind: int, payload: bytes) -> Message:
        """Send a frame and return its answer."""
        since = len(self.received)
        (number,) = self.send_frames((kind, payload))
        return self._answer_to(number, since)

    def ask(self, message: Message, kind: type[M]) -> M:
        """Send a message and return its answer, which must be of that type."""
        answer = self.answer(message)
        assert isinstance(answer, kind)
        return answer

    def act(self, message: Message) -> tuple[Message, list[Message], Finished]:
        """Send Home, Turn or StartScan; return its answer, all messages until its Finished, and the Finished."""
        since = len(self.received)
        (number,) = self.send(message)
        answer = self._answer_to(number, since)
        assert not isinstance(answer, Refused), answer
        messages = self.until(lambda messages: any(True for _ in _finished(messages, number)), since)
        return answer, messages, next(_finished(messages, number))

    def greet(self) -> Info:
        """Send Hello until an Info arrives. Forget the messages of earlier conversations."""
        numbers, deadline = [], time.monotonic() + HANG
        while not any(True for number in numbers for _ in _answers(self.messages(), number)):
            assert time.monotonic() < deadline, f"no Info within {HANG:g} s"
            # a board may be starting, or still use the line speed of an earlier client
            numbers += self.send(Hello(PROTOCOL_MAJOR, PROTOCOL_MINOR))
            next_hello = time.monotonic() + HELLO_PERIOD
            while time.monotonic() < next_hello and not any(True for _ in _answers(self.messages(), numbers[-1])):
                self.listen()
        # a slow device may answer an earlier Hello late, but not after it has answered this command
        self.answer(AskStatistics())
        info = [info for number in numbers for info in _answers(self.messages(), number)][-1]
        assert isinstance(info, Info)
        # a device may still send messages to an earlier client before its Info
        last = max(at for at, item in enumerate(self.received) if item.message is info)
        self.received, self.rejected = self.received[last:], []
        return info

    def home(self, listen: float = 0.02, trace: int = 0) -> Settings:
        """Configure and home; return the active settings."""
        settings = self.ask(Configure(round(listen * 1e6), 2_380, trace, 343_200), Settings)
        finished = self.act(Home())[2]
        assert finished.outcome == 0, finished.text
        return settings

    def stop(self) -> None:
        """Stop the running action."""
        self.ask(Stop(), Accepted)

    def capabilities(self) -> Capabilities:
        """Return the capabilities of the scanner."""
        return self.ask(AskCapabilities(), Capabilities)

    def _answer_to(self, number: int, since: int) -> Message:
        messages = self.until(lambda messages: any(True for _ in _answers(messages, number)), since, alive=False)
        return next(_answers(messages, number))


def readings(messages: list[Message]) -> list[ReadingMessage]:
    """Return the readings among these messages."""
    return [message for message in messages if isinstance(message, ReadingMessage)]


def _answers(messages: list[Message], number: int) -> Iterator[Message]:
    return (message for message in messages if isinstance(message, AnswerMessage) and message.command == number)


def _finished(messages: list[Message], number: int) -> Iterator[Finished]:
    return (message for message in messages if isinstance(message, Finished) and message.command == number)
