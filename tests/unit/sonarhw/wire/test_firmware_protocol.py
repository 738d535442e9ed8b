"""firmware_protocol.md matches the code: its tables, its bytes and its conversation."""

import importlib
import re
import zlib
from dataclasses import Field, fields
from enum import IntEnum
from typing import Any

import numpy as np
import pytest
from cobs import cobs

from sonarhw.device.fake_board import FakeBoard
from sonarhw.readings import Ping, PingResult, Trace
from sonarhw.wire.frames import DELIMITER, Frame, FrameDecoder, encode_frame
from sonarhw.wire.limits import MAX_TEST
from sonarhw.wire.messages import (
    BY_TYPE,
    FROM_DEVICE,
    FROM_HOST,
    Approach,
    AskCapabilities,
    AskStatistics,
    Configure,
    Feature,
    Hello,
    Home,
    Input,
    Message,
    Outcome,
    Refusal,
    Resend,
    ResetCause,
    StartScan,
    State,
    Stop,
    TraceKind,
    Turn,
    Wiring,
    Zero,
    unpack_message,
)
from tests.fixtures.protocol_document import DOCUMENT, block, rows

TRANSCRIPT_SEED = 31  # the turntable starts close to its zero


class DocumentedRoom:
    """The room of the document's conversation: one wall, and a trace of eight samples."""

    temperature_c = 21.5

    def receive(self, ping: Ping) -> PingResult:
        """Return the echoes of a wall at 1.2 m, 7 ms and 14.1 ms after transmission."""
        samples = np.array([0.0, 0.0, 1.0, 0.5, 0.2, 0.1, 0.0, 0.0])
        return PingResult((0.007, 0.0141), Trace(samples, 400.0, 0.0) if ping.trace else None)


@pytest.mark.parametrize("kind", FROM_HOST + FROM_DEVICE, ids=lambda kind: kind.__name__)
def test_every_message_is_documented_with_its_table(kind: type[Message]) -> None:
    way = "host to device" if kind in FROM_HOST else "device to host"
    table = rows(f"{kind.__name__} · 0x{kind.TYPE:02X} · {way}") if fields(kind) else []
    assert table == [[item.name, item.metadata["wire"].name, item.metadata["meaning"]] for item in fields(kind)]
    assert f"### {kind.__name__} · 0x{kind.TYPE:02X} · {way}\n\n{kind.__doc__}" in DOCUMENT


def test_exactly_the_existing_messages_are_documented() -> None:
    documented = re.findall(r"^### (\w+) · 0x(..) ·", DOCUMENT, re.M)
    assert {int(kind, 16): name for name, kind in documented} == {kind: m.__name__ for kind, m in BY_TYPE.items()}


@pytest.mark.parametrize(
    ("title", "codes"),
    [
        ("State codes", State),
        ("Outcome codes", Outcome),
        ("Zero codes", Zero),
        ("Refusal codes", Refusal),
        ("Trace codes", TraceKind),
        ("Approach codes", Approach),
        ("Reset codes", ResetCause),
        ("Feature codes", Feature),
        ("Input codes", Input),
        ("Wiring codes", Wiring),
    ],
)
def test_tables_of_codes_match_the_code(title: str, codes: type[IntEnum]) -> None:
    assert [(int(row[0]), row[1]) for row in rows(title)] == [(code.value, code.name) for code in codes]


@pytest.mark.parametrize("row", rows("Times and sizes"), ids=lambda row: row[0])
def test_every_time_and_size_matches_its_constant(row: list[str]) -> None:
    _, value, constant = row
    number = float(re.match(r"[\d ]+(\.\d+)?", value)[0].replace(" ", ""))  # type: ignore[index]
    module, _, name = constant.rpartition(".")
    actual = getattr(importlib.import_module(module), name)
    scale = 1000 if re.search(r"\bms\b", value) else 1
    assert number == pytest.approx(actual * scale)


def test_the_documented_checksum_and_its_table_are_correct() -> None:
    assert f"{zlib.crc32(b'123456789'):08X}" == "CBF43926"
    assert "`CBF43926`" in DOCUMENT
    table = [int(word, 16) for word in re.findall(r"0x([0-9A-F]{8})\b", block("crc table"))]
    crc = 0xFFFFFFFF
    for byte in b"123456789":
        crc ^= byte
        crc = (crc >> 4) ^ table[crc & 15]
        crc = (crc >> 4) ^ table[crc & 15]
    assert crc ^ 0xFFFFFFFF == 0xCBF43926


def test_every_step_of_the_worked_example_is_correct() -> None:
    steps = dict(re.findall(r"^(\w+) +((?:[0-9A-F]{2} ?)+)", block("worked example"), re.M))
    body, crc, stuffed, wire = (bytes.fromhex(steps[name]) for name in ("body", "crc", "stuffed", "wire"))
    parts = [bytes.fromhex(steps[name]) for name in ("type", "sequence", "time", "payload")]
    assert b"".join(parts) == body
    assert zlib.crc32(body).to_bytes(4, "little") == crc
    assert cobs.encode(body + crc) == stuffed
    assert stuffed + DELIMITER == wire
    (frame,) = FrameDecoder().feed(wire)
    assert unpack_message(frame.type, frame.payload) == Hello(1, 2)


def test_a_last_piece_of_254_bytes_decodes_with_and_without_an_empty_rest() -> None:
    piece = bytes([7]) * 254
    assert cobs.encode(piece) == b"\xff" + piece
    assert cobs.decode(b"\xff" + piece) == cobs.decode(b"\xff" + piece + b"\x01") == piece


def test_the_table_of_commands_is_complete() -> None:
    listed = [(row[0], row[2]) for row in rows("Commands at a glance")]
    assert listed == [(kind.__name__, kind.WHEN_BUSY) for kind in FROM_HOST]


def test_every_command_fits_the_documented_buffer() -> None:
    longest = [kind(**{item.name: widest(item) for item in fields(kind)}) for kind in FROM_HOST]
    assert max(len(message.pack()) for message in longest) <= 80
    blocks = [encode_frame(Frame(message.TYPE, 0xFFFF, 2**64 - 1, message.pack())) for message in longest]
    assert max(map(len, blocks)) <= 96


def widest(item: Field[Any]) -> int | bytes:
    """Return the value of a field with the longest encoding."""
    return bytes(MAX_TEST) if item.metadata["wire"].name == "u8[]" else 1


def test_every_frame_in_the_conversation_decodes_to_the_message_above_it() -> None:
    entries = re.findall(
        r"^(host  |device)  #(\d+) at (\d+) us  (\w+\(.*\))\n((?:        (?:[0-9A-F]{2} ?)+\n)+)",
        block("conversation"),
        re.M,
    )
    assert len(entries) == block("conversation").count(" at ")
    for side, sequence, time, message, wire in entries:
        (frame,) = FrameDecoder().feed(bytes.fromhex(wire))
        assert (frame.sequence, frame.time_us) == (int(sequence), int(time))
        assert repr(unpack_message(frame.type, frame.payload)) == message
        assert (frame.type < 0x80) == (side == "host  ")


def test_the_fake_board_repeats_the_documented_conversation_byte_for_byte() -> None:
    assert block("conversation") == conversation()


def conversation() -> str:
    """Return the conversation with the present fake board; paste it into the document if the protocol has changed."""
    commands = [
        (0.000, Hello(1, 2)),
        (0.001, AskCapabilities()),
        (0.002, Configure(20_000, 2_380, 1, 343_200)),
        (0.004, Home()),
        (0.100, StartScan(0, 10_000_000, 2, 1, 1)),
        (0.340, Resend(1, 1)),
        (0.342, Turn(800_000_000)),
        (0.344, AskStatistics()),
        (0.346, Stop()),
    ]
    board = FakeBoard(DocumentedRoom(), seed=TRANSCRIPT_SEED)
    lines = []
    for sequence, (time, message) in enumerate(commands, start=1):
        lines += frames_sent(board, time)
        frame = Frame(message.TYPE, sequence, round(time * 1e6), message.pack())
        lines += documented_frame("host  ", frame)
        board.receive(encode_frame(frame), time)
    return "".join([*lines, *frames_sent(board, 0.355)])


def frames_sent(board: FakeBoard, until: float) -> list[str]:
    """Return the frames that the board sends until a time, as the document writes them."""
    frames = FrameDecoder().feed(board.advance(until))
    return [line for frame in frames if isinstance(frame, Frame) for line in documented_frame("device", frame)]


def documented_frame(side: str, frame: Frame) -> list[str]:
    """Return a frame as the document writes it."""
    wire = encode_frame(frame).hex(" ").upper().split()
    message = unpack_message(frame.type, frame.payload)
    hex_lines = [f"        {' '.join(wire[at : at + 24])}\n" for at in range(0, len(wire), 24)]
    return [f"{side}  #{frame.sequence} at {frame.time_us} us  {message}\n", *hex_lines]
