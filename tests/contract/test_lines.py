"""Bytes and frames pass every kind of line unchanged and in order, and noise on the line harms nothing."""

import itertools
import random

import pytest

from sonarhw.link import Link
from sonarhw.wire import messages as msg
from sonarhw.wire.frames import Frame, encode_frame
from sonarhw.wire.limits import PROTOCOL_MAJOR
from tests.contract.talk import Talk

DEGREE = 1_000_000  # µdeg
TEN = msg.StartScan(start=10 * DEGREE, step=5 * DEGREE, headings=4, sweeps=2, pings=1)
HELLO = encode_frame(Frame(msg.Hello.TYPE, 4711, 0, msg.Hello(PROTOCOL_MAJOR, 0).pack()))


def test_a_line_test_returns_its_bytes(talk: Talk) -> None:
    for size, data in ((480, bytes(range(64))), (1, b"\0"), (100, b"\xff\x00"), (0, b"x")):
        assert talk.ask(msg.TestLink(size, data), msg.LinkTested).data == (data * size)[:size]


def test_traces_are_complete_and_belong_to_their_readings(talk: Talk) -> None:
    if not talk.capabilities().fastest_trace:
        assert talk.home(trace=1).trace == 0
        return
    settings = talk.home(listen=0.03, trace=1)
    messages = talk.act(TEN)[1]
    traces: dict[int, list[msg.TraceChunk]] = {}
    for message in messages:
        if isinstance(message, msg.TraceChunk):
            traces.setdefault(message.number, []).append(message)
    assert [*traces] == list(range(8))
    for chunks in traces.values():
        check_trace(chunks, settings)


def check_trace(chunks: list[msg.TraceChunk], settings: msg.Settings) -> None:
    """Assert that every sample is present once, at the stated rate, and not later than the end of listening."""
    (total,), (period,) = {chunk.total for chunk in chunks}, {chunk.period_ns for chunk in chunks}
    (start,), (size,) = {chunk.start_ns for chunk in chunks}, {chunk.bits // 8 for chunk in chunks}
    samples = [at for chunk in chunks for at in range(chunk.offset, chunk.offset + len(chunk.samples) // size)]
    assert samples == list(range(total))
    assert all(len(chunk.samples) <= 256 for chunk in chunks)
    assert period == pytest.approx(1e9 / settings.trace_rate, rel=1e-4)
    assert start + (total - 1) * period <= settings.listen_us * 1000
    assert settings.trace_bits == 8 * size


def test_sequence_numbers_increase_and_timestamps_never_decrease(talk: Talk) -> None:
    talk.home(trace=1)
    talk.act(TEN)
    talk.ask(msg.Resend(0, 8), msg.Accepted)
    frames = [item.frame for item in talk.received]
    assert all((b.sequence - a.sequence) % 0x10000 == 1 for a, b in itertools.pairwise(frames))
    assert all(a.time_us <= b.time_us for a, b in itertools.pairwise(frames))
    assert talk.rejected == []


CUT_OFF = HELLO[:9]
DAMAGE = {
    "a block longer than any frame": b"\x55" * 5000,
    "the beginning of a frame": CUT_OFF,
    "a frame with a wrong bit": HELLO[:7] + bytes([HELLO[7] ^ 0x10]) + HELLO[8:],
    "noise of an unconnected input": random.Random(3).randbytes(10_000),
}


def test_noise_is_ignored_and_the_next_command_is_served(talk: Talk) -> None:
    for name, damage in DAMAGE.items():
        since = len(talk.received)
        talk.write(damage)
        talk.ask(msg.AskStatistics(), msg.Statistics)
        others = [one for one in talk.messages(since) if not isinstance(one, msg.Heartbeat | msg.Statistics)]
        assert others == [], name


def test_a_frame_cut_off_by_a_disconnect_does_not_damage_the_next_greeting(free_url: str) -> None:
    with Link(free_url) as link:
        link.write(CUT_OFF)
    with Link(free_url) as link:
        assert isinstance(Talk(link).greet(), msg.Info)
