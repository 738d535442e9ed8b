"""Traces, kept readings and the documented conversation of the portable part, beyond what `tests/contract` tests."""

import re

from cobs import cobs
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as some

from sonarhw.wire import messages as msg
from sonarhw.wire.frames import DELIMITER, Frame, FrameDecoder, encode_frame
from tests.fixtures.portable_board import AT_ONCE, HELD, PortableBoard
from tests.fixtures.protocol_document import block

OF_THE_BOARD = (
    msg.Info,
    msg.Capabilities,
    msg.Settings,
)  # describe the board, so they differ from those of the fake board
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
        if isinstance(msg.unpack_message(theirs.type, theirs.payload), OF_THE_BOARD):
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
    board.ask(msg.Configure(20_000, 2_380, 1, 343_200))
    received = board.ask(msg.StartScan(0, 1, 1, 1, 1), 100_000)
    chunks = [message for message in received if isinstance(message, msg.TraceChunk)]
    assert [chunk.offset for chunk in chunks] == [*range(0, len(trace), 256)]
    assert b"".join(chunk.samples for chunk in chunks) == trace


def test_pieces_of_about_254_bytes_are_encoded_as_by_the_library(board: PortableBoard) -> None:
    # about 228 samples without a zero give pieces of about the maximum length
    board.greet_and_home()
    board.ask(msg.Configure(20_000, 2_380, 1, 343_200))
    for size in range(215, 257):
        board.set_echoes([], bytes([7]) * size)
        board.send(encode_frame(Frame(msg.StartScan.TYPE, 1000 + size, 0, msg.StartScan(0, 1, 1, 1, 1).pack())))
        for wire in board.advance(board.now + 150_000).split(DELIMITER)[:-1]:
            assert cobs.encode(cobs.decode(wire)) == wire


def test_nothing_is_sent_and_no_motor_steps_while_it_listens(board: PortableBoard) -> None:
    board.greet_and_home()
    board.c.host_motor(0)
    board.set_echoes([7_000_000], FULL_TRACE[:4800])
    board.ask(msg.Configure(62_400, 500, 1, 343_200))
    board.send(encode_frame(Frame(msg.StartScan.TYPE, 70, 0, msg.StartScan(0, 5_000_000, 5, 2, 2).pack())))
    for _ in range(400):
        board.ask(msg.AskStatistics(), 10_000)
    assert board.c.host_violations() == 0


def test_lost_samples_are_marked_in_their_chunks(board: PortableBoard) -> None:
    board.greet_and_home()
    board.set_echoes([7_000_000], FULL_TRACE[:600])
    board.set_lost(0, 255, 256, 599)
    board.ask(msg.Configure(20_000, 2_380, 1, 343_200))
    for _ in range(2):
        received = board.ask(msg.StartScan(0, 1_000_000, 1, 1, 1), 300_000)
        chunks = [message for message in received if isinstance(message, msg.TraceChunk)]
        assert [(chunk.offset, chunk.lost) for chunk in chunks] == [
            (0, bytes([0, 255])),
            (256, bytes([0])),
            (512, bytes([87])),
        ]
        assert b"".join(chunk.samples for chunk in chunks) == FULL_TRACE[:600]


def test_the_motor_is_released_two_seconds_after_the_last_frame(board: PortableBoard) -> None:
    board.greet_and_home()
    board.ask(msg.Hello(1, 1))
    last_frame = board.now - 1000
    assert board.frames_until(last_frame + 1_990_000)
    assert board.c.host_powered()
    board.frames_until(last_frame + 2_010_000)
    assert not board.c.host_powered()
