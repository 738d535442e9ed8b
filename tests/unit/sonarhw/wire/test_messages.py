"""Messages: packing is reversible, no payload crashes the decoder, and firmware_protocol.md matches the code."""

import importlib
import math
import re
import zlib
from collections.abc import Callable
from dataclasses import MISSING, Field, fields
from enum import IntEnum
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cobs import cobs
from hypothesis import given
from hypothesis import strategies as st

from sonarhw.device.fake_board import FakeBoard
from sonarhw.readings import Ping, PingResult, Trace
from sonarhw.wire import messages as msg
from sonarhw.wire import messages as wire_messages
from sonarhw.wire.frames import DELIMITER, Frame, FrameDecoder, encode_frame
from sonarhw.wire.limits import MAX_ECHOES, MAX_PAYLOAD, MAX_TEST
from tests.fixtures.protocol_document import DOCUMENT, block, rows

RANGES = {
    "B": (0, 2**8),
    "H": (0, 2**16),
    "I": (0, 2**32),
    "Q": (0, 2**64),
    "h": (-(2**15), 2**15),
    "i": (-(2**31), 2**31),
}


def values(wire: msg.Wire) -> st.SearchStrategy[Any]:
    """Values of a field."""
    match wire:
        case msg.Scalar(code=code):
            return st.integers(RANGES[code][0], RANGES[code][1] - 1)
        case msg.Counted(name="text"):
            return st.text(st.characters(exclude_categories=["Cs"]), max_size=60)
        case msg.Counted(name="u32[]"):
            return st.lists(st.integers(0, 2**32 - 1), max_size=MAX_ECHOES).map(tuple)
        case msg.Counted(name="u8[]"):
            return st.binary(max_size=256)


messages = st.one_of(
    [
        st.builds(kind, *(values(item.metadata["wire"]) for item in fields(kind)))
        for kind in msg.FROM_HOST + msg.FROM_DEVICE
    ]
)


@given(messages, st.binary(max_size=20))
def test_packing_is_reversible_and_bytes_after_the_last_field_are_ignored(message: msg.Message, more: bytes) -> None:
    payload = message.pack()
    assert msg.unpack_message(message.TYPE, payload) == msg.unpack_message(message.TYPE, payload + more) == message
    assert len(payload) <= MAX_PAYLOAD or not isinstance(message, msg.ReadingMessage)


@given(messages, st.integers(1, 40))
def test_a_truncated_payload_is_rejected_unless_an_older_version_ends_there(message: msg.Message, missing: int) -> None:
    payload = message.pack()
    cut = payload[: max(0, len(payload) - missing)]
    if not payload:
        return
    try:
        taken = msg.unpack_message(message.TYPE, cut)
    except msg.MessageError:
        return
    # only whole fields at the end are missing, and they have their defaults
    assert len(cut) >= len(message.pack(minor=0))
    assert taken.pack()[: len(cut)] == cut
    left_out = [item for item in fields(message) if getattr(taken, item.name) != getattr(message, item.name)]
    assert all(getattr(taken, item.name) == item.default for item in left_out)


@given(st.integers(0, 255), st.binary(max_size=MAX_PAYLOAD))
def test_any_payload_gives_a_message_or_none_or_a_message_error(kind: int, payload: bytes) -> None:
    try:
        message = msg.unpack_message(kind, payload)
    except msg.MessageError:
        return
    assert (message is None) == (kind not in msg.BY_TYPE)


def test_the_top_bit_distinguishes_host_types_from_device_types() -> None:
    assert len(msg.BY_TYPE) == len(msg.FROM_HOST) + len(msg.FROM_DEVICE)
    assert all(kind.TYPE < 0x80 for kind in msg.FROM_HOST)
    assert all(kind.TYPE >= 0x80 for kind in msg.FROM_DEVICE)


def test_packing_a_value_that_does_not_fit_raises_an_error() -> None:
    with pytest.raises(msg.MessageError, match="does not fit i32"):
        msg.Turn(angle=2**31).pack()


def test_one_echo_more_than_the_limit_does_not_fit_a_frame() -> None:
    def size(echoes: int) -> int:
        return len(msg.ReadingMessage(0, 0, 0, 0, 0, 0, (0,) * echoes).pack())

    assert size(MAX_ECHOES) <= MAX_PAYLOAD < size(MAX_ECHOES + 1)


def documented_defaults() -> list[tuple[int, str, int]]:
    """Return type of message, field and default of each field that version 1.0 does not have, as documented."""
    found, kind = [], 0
    for line in Path("firmware_protocol.md").read_text(encoding="utf-8").splitlines():
        if heading := re.match(r"### \w+ · (0x\w\w) ", line):
            kind = int(heading[1], 16)
        if row := re.match(r"\| `(\w+)` \|.* · 1\.[12], else (\d+) \|", line):
            found.append((kind, row[1], int(row[2])))
    return found


def test_fields_that_an_older_peer_does_not_send_have_the_documented_defaults() -> None:
    defaults = documented_defaults()
    assert len(defaults) > 10
    for kind, name, default in defaults:
        least = msg.BY_TYPE[kind](*(1 for item in fields(msg.BY_TYPE[kind]) if item.default is MISSING))
        if not any(isinstance(item.metadata["wire"], msg.Counted) for item in fields(msg.BY_TYPE[kind])):
            assert getattr(msg.unpack_message(kind, least.pack(minor=0)), name) == default
        assert {item.name: item.default for item in fields(msg.BY_TYPE[kind])}[name] == default


@pytest.mark.parametrize(
    ("convert", "unit"),
    [
        (wire_messages.microseconds_of, 1e-6),
        (wire_messages.nanoseconds_of, 1e-9),
        (wire_messages.microdegrees_of, math.radians(1e-6)),
        (wire_messages.millimetres_per_second_of, 1e-3),
        (wire_messages.centidegrees_of, 1e-2),
    ],
)
def test_a_value_is_rounded_to_the_nearest_whole_number(convert: Callable[[float], int], unit: float) -> None:
    for whole in (-3, 0, 7, 21_370):
        for part in (-0.4, 0.0, 0.4):
            assert convert((whole + part) * unit) == whole


# the document: its tables, its bytes and its conversation


TRANSCRIPT_SEED = 31  # the turntable starts close to its zero


class DocumentedRoom:
    """The room of the document's conversation: one wall, and a trace of eight samples."""

    temperature_c = 21.5

    def receive(self, ping: Ping) -> PingResult:
        """Return the echoes of a wall at 1.2 m, 7 ms and 14.1 ms after transmission."""
        samples = np.array([0.0, 0.0, 1.0, 0.5, 0.2, 0.1, 0.0, 0.0])
        return PingResult((0.007, 0.0141), Trace(samples, 400.0, 0.0) if ping.trace else None)


@pytest.mark.parametrize("kind", msg.FROM_HOST + msg.FROM_DEVICE, ids=lambda kind: kind.__name__)
def test_every_message_is_documented_with_its_table(kind: type[msg.Message]) -> None:
    way = "host to device" if kind in msg.FROM_HOST else "device to host"
    table = rows(f"{kind.__name__} · 0x{kind.TYPE:02X} · {way}") if fields(kind) else []
    assert table == [[item.name, item.metadata["wire"].name, item.metadata["meaning"]] for item in fields(kind)]
    assert f"### {kind.__name__} · 0x{kind.TYPE:02X} · {way}\n\n{kind.__doc__}" in DOCUMENT


def test_exactly_the_existing_messages_are_documented() -> None:
    documented = re.findall(r"^### (\w+) · 0x(..) ·", DOCUMENT, re.M)
    assert {int(kind, 16): name for name, kind in documented} == {kind: m.__name__ for kind, m in msg.BY_TYPE.items()}


@pytest.mark.parametrize(
    ("title", "codes"),
    [
        ("State codes", msg.State),
        ("Outcome codes", msg.Outcome),
        ("Zero codes", msg.Zero),
        ("Refusal codes", msg.Refusal),
        ("Trace codes", msg.TraceKind),
        ("Approach codes", msg.Approach),
        ("Reset codes", msg.ResetCause),
        ("Feature codes", msg.Feature),
        ("Input codes", msg.Input),
        ("Wiring codes", msg.Wiring),
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
    assert msg.unpack_message(frame.type, frame.payload) == msg.Hello(1, 2)


def test_a_last_piece_of_254_bytes_decodes_with_and_without_an_empty_rest() -> None:
    piece = bytes([7]) * 254
    assert cobs.encode(piece) == b"\xff" + piece
    assert cobs.decode(b"\xff" + piece) == cobs.decode(b"\xff" + piece + b"\x01") == piece


def test_the_table_of_commands_is_complete() -> None:
    listed = [(row[0], row[2]) for row in rows("Commands at a glance")]
    assert listed == [(kind.__name__, kind.WHEN_BUSY) for kind in msg.FROM_HOST]


def test_every_command_fits_the_documented_buffer() -> None:
    longest = [kind(**{item.name: widest(item) for item in fields(kind)}) for kind in msg.FROM_HOST]
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
        assert repr(msg.unpack_message(frame.type, frame.payload)) == message
        assert (frame.type < 0x80) == (side == "host  ")


def test_the_fake_board_repeats_the_documented_conversation_byte_for_byte() -> None:
    assert block("conversation") == conversation()


def conversation() -> str:
    """Return the conversation with the present fake board; paste it into the document if the protocol has changed."""
    commands = [
        (0.000, msg.Hello(1, 2)),
        (0.001, msg.AskCapabilities()),
        (0.002, msg.Configure(20_000, 2_380, 1, 343_200)),
        (0.004, msg.Home()),
        (0.100, msg.StartScan(0, 10_000_000, 2, 1, 1)),
        (0.340, msg.Resend(1, 1)),
        (0.342, msg.Turn(800_000_000)),
        (0.344, msg.AskStatistics()),
        (0.346, msg.Stop()),
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
    message = msg.unpack_message(frame.type, frame.payload)
    hex_lines = [f"        {' '.join(wire[at : at + 24])}\n" for at in range(0, len(wire), 24)]
    return [f"{side}  #{frame.sequence} at {frame.time_us} us  {message}\n", *hex_lines]
