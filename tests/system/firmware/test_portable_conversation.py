"""Traces, kept readings and the documented conversation of the portable part, beyond what `tests/contract` tests."""

import re

import pytest
from cobs import cobs
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as some

from sonarhw.wire.frames import DELIMITER, Frame, FrameDecoder, encode_frame
from sonarhw.wire.messages import (
    Accepted,
    AskStatistics,
    Capabilities,
    Configure,
    Finished,
    Heartbeat,
    Hello,
    Info,
    Message,
    ReadingMessage,
    Resend,
    Settings,
    Started,
    StartScan,
    TraceChunk,
    unpack_message,
)
from tests.fixtures.portable_board import AT_ONCE, HELD, PortableBoard
from tests.fixtures.protocol_document import block

OF_THE_BOARD = (Info, Capabilities, Settings)  # describe the board, so they differ from those of the fake board
FULL_TRACE = bytes(range(256)) * 19


def documented() -> list[tuple[str, int, bytes]]:
    """Return sender, time (µs) and bytes of each frame in the documented conversation."""
    entries = re.findall(r"^(host  |device)  #\d+ at (\d+) us  .*\n((?:        .*\n)+)", block("conversation"), re.M)
    return [(side.strip(), int(time), bytes.fromhex(wire)) for side, time, wire in entries]


def test_it_repeats_the_documented_conversation_byte_for_byte(board: PortableBoard) -> None:
    board.identity("sonarhw-fake 0.1.0", "FAKE-0031", "")
    board.c.host_temperature(2150)
    board.set_echoes([7_000_000, 14_100_000], bytes.fromhex("0000ff80331a0000"), 2_500_000)
    board.c.host_motor(HELD)
    sent = b""
    for side, time, wire in documented():
        if side == "host":
            sent += board.advance(time)
            board.send(wire)
        elif time == 36_278:  # the fake board homes until then; it settles for 20 ms
            sent += board.advance(time - 20_000)
            board.c.host_motor(AT_ONCE)
    sent += board.advance(355_000)
    expected = [wire for side, _, wire in documented() if side == "device"]
    assert len(expected) == sent.count(DELIMITER)
    for ours, theirs in zip(FrameDecoder().feed(sent), FrameDecoder().feed(b"".join(expected)), strict=True):
        assert isinstance(ours, Frame)
        assert isinstance(theirs, Frame)
        if isinstance(unpack_message(theirs.type, theirs.payload), OF_THE_BOARD):
            assert (ours.type, ours.sequence, ours.time_us) == (theirs.type, theirs.sequence, theirs.time_us)
            assert ours.payload[:2] == theirs.payload[:2]
        else:
            assert encode_frame(ours) == encode_frame(theirs)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=200)
@given(trace=some.binary(min_size=1, max_size=1500))
def test_any_trace_is_transmitted_unchanged(board: PortableBoard, trace: bytes) -> None:
    board.c.host_start()
    board.now = 0
    board.greet_and_home()
    board.set_echoes([7_000_000], trace)
    board.ask(Configure(20_000, 2_380, 1, 343_200))
    received = board.ask(StartScan(0, 1, 1, 1, 1), 100_000)
    chunks = [message for message in received if isinstance(message, TraceChunk)]
    assert [chunk.offset for chunk in chunks] == [*range(0, len(trace), 256)]
    assert b"".join(chunk.samples for chunk in chunks) == trace


def test_pieces_of_about_254_bytes_are_encoded_as_by_the_library(board: PortableBoard) -> None:
    # about 228 samples without a zero give pieces of about the maximum length
    board.greet_and_home()
    board.ask(Configure(20_000, 2_380, 1, 343_200))
    for size in range(215, 257):
        board.set_echoes([], bytes([7]) * size)
        board.send(encode_frame(Frame(StartScan.TYPE, 1000 + size, 0, StartScan(0, 1, 1, 1, 1).pack())))
        for wire in board.advance(board.now + 150_000).split(DELIMITER)[:-1]:
            assert cobs.encode(cobs.decode(wire)) == wire


def scanned(board: PortableBoard, readings: int, echoes: int = 2) -> list[Message]:
    """Return all messages of a scan with so many readings."""
    board.greet_and_home()
    board.set_echoes([3_000_000 + 1_000_000 * echo for echo in range(echoes)])
    board.ask(Configure(62_400, 500, 0, 343_200))
    return board.ask(StartScan(0, 50_000, readings, 1, 1), readings * 100_000 + 200_000)


@pytest.mark.parametrize(("echoes", "kept"), [(0, 64), (1, 64), (3, 47), (8, 26), (34, 8)])
def test_the_last_readings_are_kept_and_sent_again_unchanged(board: PortableBoard, echoes: int, kept: int) -> None:
    readings = [message for message in scanned(board, 80, echoes) if isinstance(message, ReadingMessage)]
    assert [reading.number for reading in readings] == [*range(80)]
    assert all(len(reading.echoes) == echoes for reading in readings)
    again = board.ask(Resend(16, 64), 100_000)
    assert isinstance(again[0], Accepted)
    assert [*filter(lambda message: not isinstance(message, Heartbeat), again[1:])] == readings[-kept:]


@pytest.mark.parametrize("echoes_ms", [[40], [3, 45], [32.767, 32.768], [1, 33.7675, 62.4], [61, 62]])
def test_echoes_far_apart_are_sent_again_unchanged(board: PortableBoard, echoes_ms: list[float]) -> None:
    board.greet_and_home()
    board.set_echoes([round(time * 1e6) for time in echoes_ms])
    board.ask(Configure(62_400, 500, 0, 343_200))
    readings = [m for m in board.ask(StartScan(0, 1, 3, 1, 1), 500_000) if isinstance(m, ReadingMessage)]
    assert [list(reading.echoes) for reading in readings] == [[round(time * 1e6) for time in echoes_ms]] * 3
    assert [m for m in board.ask(Resend(0, 3), 100_000) if isinstance(m, ReadingMessage)] == readings


@pytest.mark.parametrize("extra", [b"", b"1.3", bytes(58)], ids=["this version", "newer", "longest"])
def test_a_repeated_command_is_carried_out_once(board: PortableBoard, extra: bytes) -> None:
    board.greet_and_home()
    wire = encode_frame(Frame(StartScan.TYPE, 900, 0, StartScan(0, 5_000_000, 2, 1, 1).pack() + extra))
    board.send(wire)
    first = [m for _, m in board.frames_until(board.now + 1_000_000) if not isinstance(m, Heartbeat)]
    board.send(wire)
    second = [m for _, m in board.frames_until(board.now + 1_000_000) if not isinstance(m, Heartbeat)]
    assert [type(m) for m in first] == [Started, ReadingMessage, ReadingMessage, Finished]
    assert second == [first[0], first[-1]]


def test_nothing_is_sent_and_no_motor_steps_while_it_listens(board: PortableBoard) -> None:
    board.greet_and_home()
    board.c.host_motor(0)
    board.set_echoes([7_000_000], FULL_TRACE[:4800])
    board.ask(Configure(62_400, 500, 1, 343_200))
    board.send(encode_frame(Frame(StartScan.TYPE, 70, 0, StartScan(0, 5_000_000, 5, 2, 2).pack())))
    for _ in range(400):
        board.ask(AskStatistics(), 10_000)
    assert board.c.host_violations() == 0


def test_lost_samples_are_marked_in_their_chunks(board: PortableBoard) -> None:
    board.greet_and_home()
    board.set_echoes([7_000_000], FULL_TRACE[:600])
    board.set_lost(0, 255, 256, 599)
    board.ask(Configure(20_000, 2_380, 1, 343_200))
    for _ in range(2):
        received = board.ask(StartScan(0, 1_000_000, 1, 1, 1), 300_000)
        chunks = [message for message in received if isinstance(message, TraceChunk)]
        assert [(chunk.offset, chunk.lost) for chunk in chunks] == [
            (0, bytes([0, 255])),
            (256, bytes([0])),
            (512, bytes([87])),
        ]
        assert b"".join(chunk.samples for chunk in chunks) == FULL_TRACE[:600]


def test_nothing_is_sent_after_the_host_is_gone(board: PortableBoard) -> None:
    scanned(board, 70)
    board.ask(Hello(1, 1))
    board.send(encode_frame(Frame(Resend.TYPE, 7, 0, Resend(0, 64).pack())))
    board.c.host_grain(2_100_000)
    board.frames_until(board.now + 2_100_000)
    board.c.host_grain(100)
    assert board.frames_until(board.now + 1_000_000) == []


def test_the_motor_is_released_two_seconds_after_the_last_frame(board: PortableBoard) -> None:
    board.greet_and_home()
    board.ask(Hello(1, 1))
    last_frame = board.now - 1000
    assert board.frames_until(last_frame + 1_990_000)
    assert board.c.host_powered()
    board.frames_until(last_frame + 2_010_000)
    assert not board.c.host_powered()
