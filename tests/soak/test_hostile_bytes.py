"""Arbitrary bytes: the host raises only its own errors, invents no reading and its memory does not grow.

A normal run uses 4·10⁵ random bytes and 600 mutated sessions, with `--soak` 10⁸ and 10⁵.
"""

import random
import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace

import numpy as np
import pytest

from sonarhw.device.fake_board import FakeBoard
from sonarhw.errors import SonarError
from sonarhw.host.driver import Driver
from sonarhw.readings import Reading
from sonarhw.wire.frames import Frame, FrameDecoder
from sonarhw.wire.messages import Configure, Hello, Home, Message, StartScan
from tests.conftest import Count
from tests.fixtures.plain_echoes import PlainEchoes

PIECE = 4096  # bytes
FIRST = 100  # sequence number of the host's first command
COMMANDS: tuple[Message, ...] = (Hello(1, 1), Configure(4_000, 2_380, 1, 343_200), Home(), StartScan(0, 10**6, 4, 1, 1))

Bytes = Callable[[random.Random], bytes]
Mutation = Callable[[random.Random, bytes], bytes]


def white(chance: random.Random) -> bytes:
    """Return random bytes, all values equally likely."""
    return chance.randbytes(PIECE)


def full_of_zeros(chance: random.Random) -> bytes:
    """Return short blocks, many of which are valid COBS."""
    return bytes(chance.choice((0, 1, 2, 3, 0xFF, chance.randrange(256))) for _ in range(PIECE))


def without_zeros(chance: random.Random) -> bytes:
    """Return part of a block without an end."""
    return chance.randbytes(PIECE).replace(b"\0", b"\1")


@pytest.mark.parametrize("kind", [white, full_of_zeros, without_zeros], ids=lambda kind: kind.__name__)
def test_random_bytes_give_no_frames_and_no_readings_and_use_little_memory(kind: Bytes, count: Count) -> None:
    chance = random.Random(kind.__name__)
    decoder, driver = FrameDecoder(), greeted(kind)
    # these pieces are slow to make, so they are reused
    pieces = [kind(chance) for _ in range(64)] if kind is full_of_zeros else None
    rounds, sizes = count(4 * 10**5, 10**8 // 3) // PIECE, []
    for number in range(rounds):
        piece = pieces[number % 64] if pieces else kind(chance)
        frames = [item for item in decoder.feed(piece) if isinstance(item, Frame)]
        assert frames == []
        with suppress(SonarError):
            driver.receive(piece, number * 0.01)
        assert driver.readings() == []
        driver.outgoing()
        if number in (rounds // 2, rounds - 1):
            del frames
            sizes.append(sys.getallocatedblocks())
    assert sizes[1] - sizes[0] < 500


def greeted(kind: Bytes) -> Driver:
    """Return a driver in the middle of a scan."""
    session, driver = recorded_session(), Driver(FIRST)
    for message, wire in zip(COMMANDS, session, strict=True):
        driver.command(message, 0.0)
        driver.receive(wire if message is not COMMANDS[-1] else wire[:60], 0.0)
    driver.readings()
    return driver


def test_a_mutated_session_gives_no_invented_reading(count: Count) -> None:
    session = recorded_session()
    expected = {reading.number: reading for reading in decoded(session)}
    assert [*expected] == [0, 1, 2, 3]
    chance = random.Random(17)
    whole = 0
    for _ in range(count(600, 10**5)):
        mutated = [mutate(chance, wire) for wire in session]
        readings = [*decoded(mutated)]
        numbers = [reading.number for reading in readings]
        assert len(set(numbers)) == len(numbers)
        for reading in readings:
            assert_correct(reading, expected[reading.number])
        whole += len(readings) == 4
    assert whole  # some mutations are harmless; this shows that complete sessions are decoded


def recorded_session() -> list[bytes]:
    """Return the bytes that a board sends for each of the commands."""
    board, driver, sent, now = FakeBoard(PlainEchoes(), seed=7), Driver(FIRST), [], 0.0
    for message in COMMANDS:
        command, wire = driver.command(message, now), b""
        while command.answer is None or (not driver.scan_complete and not isinstance(message, Hello | Configure)):
            board.receive(driver.outgoing(), now)
            now = min(now + 0.05, board.next_event() or now)
            piece = board.advance(now)
            driver.receive(piece, now)
            wire += piece
        sent.append(wire)
    return sent


def decoded(session: list[bytes]) -> Iterator[Reading]:
    """Yield the readings that a driver decodes from this session."""
    driver = Driver(FIRST)
    for message, wire in zip(COMMANDS, session, strict=True):
        with suppress(SonarError):
            driver.command(message, 0.0)
            driver.receive(wire, 0.1)
            driver.advance(0.2)
        yield from driver.readings()


def assert_correct(reading: Reading, expected: Reading) -> None:
    """Assert that the reading is as measured; of the trace, compare the samples that arrived."""
    assert replace(reading, trace=None, speed_of_sound=0.0) == replace(expected, trace=None, speed_of_sound=0.0)
    if reading.trace is not None and expected.trace is not None:
        assert (reading.trace.rate, reading.trace.start) == (expected.trace.rate, expected.trace.start)
        arrived = ~np.isnan(reading.trace.samples)
        assert np.array_equal(reading.trace.samples[arrived], expected.trace.samples[arrived])


# mutations


def mutate(chance: random.Random, wire: bytes) -> bytes:
    """Apply one to three kinds of damage at random positions."""
    for damage in chance.choices(MUTATIONS, k=chance.randrange(1, 4)):
        if wire:
            wire = damage(chance, wire)
    return wire


def flip_bits(chance: random.Random, wire: bytes) -> bytes:
    """Flip some bits."""
    data = bytearray(wire)
    for _ in range(chance.randrange(1, 4)):
        data[chance.randrange(len(data))] ^= 1 << chance.randrange(8)
    return bytes(data)


def overwrite(chance: random.Random, wire: bytes) -> bytes:
    """Replace some bytes, many of them by zeros and ones."""
    data = bytearray(wire)
    for _ in range(chance.randrange(1, 6)):
        data[chance.randrange(len(data))] = chance.choice((0, 1, 0xFF, chance.randrange(256)))
    return bytes(data)


def cut_out(chance: random.Random, wire: bytes) -> bytes:
    """Remove a span of bytes."""
    begin, end = span(chance, wire)
    return wire[:begin] + wire[end:]


def repeat(chance: random.Random, wire: bytes) -> bytes:
    """Repeat a span of bytes."""
    begin, end = span(chance, wire)
    return wire[:end] + wire[begin:]


def insert_noise(chance: random.Random, wire: bytes) -> bytes:
    """Insert random bytes."""
    at = chance.randrange(len(wire) + 1)
    return wire[:at] + chance.randbytes(chance.randrange(1, 40)) + wire[at:]


def copy_over(chance: random.Random, wire: bytes) -> bytes:
    """Overwrite a span of bytes with a copy of another one."""
    begin, end = span(chance, wire)
    at = chance.randrange(len(wire))
    return wire[:at] + wire[begin:end] + wire[at + end - begin :]


def span(chance: random.Random, wire: bytes) -> tuple[int, int]:
    """Return the begin and end of a random span."""
    begin, end = sorted(chance.choices(range(len(wire) + 1), k=2))
    return begin, min(end, begin + 400)


MUTATIONS: tuple[Mutation, ...] = (flip_bits, overwrite, cut_out, repeat, insert_noise, copy_over)
