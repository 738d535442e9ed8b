"""A conversation with a scanner by hand: messages out, frames in, nothing repeated and nothing hidden."""

import random
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TypeVar

from sonarhw.link.serial_link import Link
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

HELLO_AGAIN = 0.5  # s
SIGN_OF_LIFE = 0.5  # s from one to the next
M = TypeVar("M", bound=Message)


@dataclass(frozen=True)
class Heard:
    """One message of the scanner."""

    frame: Frame
    message: Message | None


class Talk:
    """Everything heard is kept, so that a test can look at all of it."""

    def __init__(self, link: Link) -> None:
        self.heard: list[Heard] = []
        self.rejected: list[Rejected] = []
        self._link = link
        self._decoder = FrameDecoder()
        self._sequence = random.randrange(0x10000)
        self._alive = 0.0

    # out

    def send(self, *messages: Message) -> list[int]:
        """Send messages in one piece; their sequence numbers."""
        return self.send_frames(*((message.TYPE, message.pack()) for message in messages))

    def send_frames(self, *frames: tuple[int, bytes]) -> list[int]:
        """Send frames of type and payload in one piece; their sequence numbers."""
        wires = [self.wire(kind, payload) for kind, payload in frames]
        self.write(DELIMITER + b"".join(wires))
        return [(self._sequence - back) % 0x10000 for back in range(len(frames) - 1, -1, -1)]

    def wire(self, kind: int, payload: bytes) -> bytes:
        """A frame with the next sequence number."""
        self._sequence = (self._sequence + 1) % 0x10000
        return encode_frame(Frame(kind, self._sequence, 0, payload))

    def write(self, data: bytes) -> None:
        """Send bytes as they are."""
        self._link.write(data)

    # in

    def until(self, wanted: Callable[[list[Message]], bool], since: int = 0, alive: bool = True) -> list[Message]:
        """The messages from number `since` on, as soon as they are what is `wanted`; fails after HANG.

        Gives signs of life meanwhile, unless not `alive`; their answers are not among the messages.
        """
        deadline = time.monotonic() + HANG
        while not wanted(messages := self.messages(since)):
            assert time.monotonic() < deadline, f"heard {messages[-5:]}, and no more within {HANG:g} s"
            if alive and time.monotonic() > self._alive + SIGN_OF_LIFE:
                self._alive = time.monotonic()
                self.send(AskStatistics())
            self.listen()
        return messages

    def listen(self) -> None:
        """Take what comes within a moment."""
        for item in self._decoder.feed(self._link.read()):
            if isinstance(item, Rejected):
                self.rejected.append(item)
            else:
                self.heard.append(Heard(item, unpack_message(item.type, item.payload)))

    def messages(self, since: int = 0) -> list[Message]:
        """Messages from number `since` on."""
        return [heard.message for heard in self.heard[since:] if heard.message is not None]

    # both

    def answer(self, message: Message) -> Message:
        """Send a message; its answer."""
        (answer,) = self.answers(message)
        return answer

    def answers(self, *messages: Message) -> list[Message]:
        """Send messages in one piece; their answers."""
        since = len(self.heard)
        numbers = self.send(*messages)
        return [self._answer_to(number, since) for number in numbers]

    def answer_to_frame(self, kind: int, payload: bytes) -> Message:
        """Send a frame; its answer."""
        since = len(self.heard)
        (number,) = self.send_frames((kind, payload))
        return self._answer_to(number, since)

    def ask(self, message: Message, kind: type[M]) -> M:
        """Send a message; its answer, which has to be of that kind."""
        answer = self.answer(message)
        assert isinstance(answer, kind)
        return answer

    def act(self, message: Message) -> tuple[Message, list[Message], Finished]:
        """Send a home, turn or scan; its answer, all messages until it ended, and how it did."""
        since = len(self.heard)
        (number,) = self.send(message)
        answer = self._answer_to(number, since)
        assert not isinstance(answer, Refused), answer
        messages = self.until(lambda heard: any(True for _ in _finished(heard, number)), since)
        return answer, messages, next(_finished(messages, number))

    def greet(self) -> Info:
        """Say Hello until there is an Info. What belonged to an earlier conversation is forgotten."""
        numbers, deadline = [], time.monotonic() + HANG
        while not any(True for number in numbers for _ in _answers(self.messages(), number)):
            assert time.monotonic() < deadline, f"no Info within {HANG:g} s"
            # a board may be starting, or still be at the speed of the line that somebody else has set
            numbers += self.send(Hello(PROTOCOL_MAJOR, PROTOCOL_MINOR))
            again = time.monotonic() + HELLO_AGAIN
            while time.monotonic() < again and not any(True for _ in _answers(self.messages(), numbers[-1])):
                self.listen()
        # a slow device may answer an earlier Hello late; nothing of that comes after this answer
        self.answer(AskStatistics())
        info = [info for number in numbers for info in _answers(self.messages(), number)][-1]
        assert isinstance(info, Info)
        # before its Info a device may still send what it had to say to somebody else
        last = max(at for at, heard in enumerate(self.heard) if heard.message is info)
        self.heard, self.rejected = self.heard[last:], []
        return info

    def home(self, listen: float = 0.02, trace: int = 0) -> Settings:
        """Configure and home; the settings in force."""
        settings = self.ask(Configure(round(listen * 1e6), 2_380, trace, 343_200), Settings)
        assert self.act(Home())[2].outcome == 0
        return settings

    def stop(self) -> None:
        """End what runs."""
        self.ask(Stop(), Accepted)

    def capabilities(self) -> Capabilities:
        """What the scanner can."""
        return self.ask(AskCapabilities(), Capabilities)

    def _answer_to(self, number: int, since: int) -> Message:
        messages = self.until(lambda heard: any(True for _ in _answers(heard, number)), since, alive=False)
        return next(_answers(messages, number))


def readings(messages: list[Message]) -> list[ReadingMessage]:
    """The readings among messages."""
    return [message for message in messages if isinstance(message, ReadingMessage)]


def _answers(messages: list[Message], number: int) -> Iterator[Message]:
    return (message for message in messages if isinstance(message, AnswerMessage) and message.command == number)


def _finished(messages: list[Message], number: int) -> Iterator[Finished]:
    return (message for message in messages if isinstance(message, Finished) and message.command == number)
