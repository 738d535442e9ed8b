"""Driver and board joined without ports or threads: time is a number, and the cable does what a schedule says."""

import random
from collections.abc import Callable

from sonarhw.board import Board
from sonarhw.driver import Command, Driver
from sonarhw.frames import Frame, FrameDecoder, encode_frame
from sonarhw.messages import Configure, Hello, Home, Message, StartScan, unpack_message
from sonarhw.readings import Reading
from tests.sonarhw.plain_echoes import PlainEchoes

Cable = Callable[[bytes], bytes]


def sound(data: bytes) -> bytes:
    """A cable that does nothing."""
    return data


def dropping(seed: int, share: float) -> Cable:
    """A cable that loses a share of the bytes."""
    chance = random.Random(seed)
    return lambda data: bytes(byte for byte in data if chance.random() >= share)


def flipping(seed: int, share: float) -> Cable:
    """A cable that flips a bit in a share of the bytes."""
    chance = random.Random(seed)
    return lambda data: bytes(byte ^ (1 << chance.randrange(8)) if chance.random() < share else byte for byte in data)


def cut_every(period: int, length: int) -> Cable:
    """A cable that swallows the last `length` bytes of every `period`."""
    passed = 0

    def cable(data: bytes) -> bytes:
        nonlocal passed
        kept = bytes(byte for at, byte in enumerate(data, passed) if at % period < period - length)
        passed += len(data)
        return kept

    return cable


def without(unwanted: Callable[[Message], bool]) -> Cable:
    """A cable that loses the messages for which `unwanted` says so; whole frames only."""

    def cable(data: bytes) -> bytes:
        kept = b""
        for frame in FrameDecoder().feed(data):
            assert isinstance(frame, Frame)
            message = unpack_message(frame.type, frame.payload)
            if message is None or not unwanted(message):
                kept += encode_frame(frame)
        return kept

    return cable


def the_first(kind: type[Message]) -> Callable[[Message], bool]:
    """Whether a message is the first of its kind."""
    seen: list[Message] = []

    def first(message: Message) -> bool:
        if isinstance(message, kind):
            seen.append(message)
        return isinstance(message, kind) and len(seen) == 1

    return first


class Joined:
    """A driver and a board with a cable between them."""

    def __init__(
        self, board: Board | None = None, down: Cable = sound, up: Cable = sound, driver: Driver | None = None
    ) -> None:
        self.echoes = PlainEchoes()
        self.board = board or Board(self.echoes, seed=7)
        self.driver = driver or Driver(first_sequence=100)
        self.now = 0.0
        self.down, self.up = down, up
        self.readings: list[Reading] = []

    def step(self) -> None:
        """Let time pass until something is to be done, and do it."""
        to_board = self.down(self.driver.outgoing())
        if to_board:
            self.board.receive(to_board, self.now)
        due = [time for time in (self.driver.next_event(), self.board.next_event()) if time is not None]
        self.now = max(self.now, min(due))
        to_driver = self.up(self.board.advance(self.now))
        if to_driver:
            self.driver.receive(to_driver, self.now)
        self.driver.advance(self.now)
        self.readings += self.driver.readings()

    def until(self, done: Callable[[], bool], within: float = 60.0) -> None:
        """Go on until `done`; fails after `within` s of the joined time."""
        end = self.now + within
        while not done():
            assert self.now < end, f"not done within {within} s"
            self.step()

    def ask(self, message: Message) -> Command:
        """Send a command and wait for its answer."""
        command = self.driver.command(message, self.now)
        self.until(lambda: command.answer is not None)
        return command

    def act(self, message: Message) -> Command:
        """Send a command and wait until what it began has ended."""
        command = self.ask(message)
        self.until(lambda: command.finished is not None)
        return command

    def scan(self, order: StartScan) -> list[Reading]:
        """All readings of a scan, in the order they came."""
        self.readings.clear()
        self.act(order)
        self.until(lambda: self.driver.scan_complete)
        self.readings += self.driver.readings()
        return [*self.readings]

    def greet(self, trace: bool = False) -> None:
        """Greet, configure and home."""
        self.ask(Hello(1, 1))
        self.ask(Configure(62_500, 2_380, int(trace), 343_200))
        self.act(Home())
