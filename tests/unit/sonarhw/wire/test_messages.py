"""Properties of messages: packing is reversible, messages fit a frame, and no payload crashes the decoder."""

import math
import re
from collections.abc import Callable
from dataclasses import MISSING, fields
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sonarhw.wire import messages as wire_messages
from sonarhw.wire.limits import MAX_ECHOES, MAX_PAYLOAD
from sonarhw.wire.messages import (
    BY_TYPE,
    FROM_DEVICE,
    FROM_HOST,
    Counted,
    Message,
    MessageError,
    ReadingMessage,
    Scalar,
    Turn,
    Wire,
    unpack_message,
)

RANGES = {
    "B": (0, 2**8),
    "H": (0, 2**16),
    "I": (0, 2**32),
    "Q": (0, 2**64),
    "h": (-(2**15), 2**15),
    "i": (-(2**31), 2**31),
}


def values(wire: Wire) -> st.SearchStrategy[Any]:
    """Values of a field."""
    match wire:
        case Scalar(code=code):
            return st.integers(RANGES[code][0], RANGES[code][1] - 1)
        case Counted(name="text"):
            return st.text(st.characters(exclude_categories=["Cs"]), max_size=60)
        case Counted(name="u32[]"):
            return st.lists(st.integers(0, 2**32 - 1), max_size=MAX_ECHOES).map(tuple)
        case Counted(name="u8[]"):
            return st.binary(max_size=256)


messages = st.one_of(
    [st.builds(kind, *(values(item.metadata["wire"]) for item in fields(kind))) for kind in FROM_HOST + FROM_DEVICE]
)


@given(messages, st.binary(max_size=20))
def test_packing_is_reversible_and_bytes_after_the_last_field_are_ignored(message: Message, more: bytes) -> None:
    payload = message.pack()
    assert unpack_message(message.TYPE, payload) == unpack_message(message.TYPE, payload + more) == message
    assert len(payload) <= MAX_PAYLOAD or not isinstance(message, ReadingMessage)


@given(messages, st.integers(1, 40))
def test_a_truncated_payload_is_rejected_unless_an_older_version_ends_there(message: Message, missing: int) -> None:
    payload = message.pack()
    cut = payload[: max(0, len(payload) - missing)]
    if not payload:
        return
    try:
        taken = unpack_message(message.TYPE, cut)
    except MessageError:
        return
    # only whole fields at the end are missing, and they have their defaults
    assert len(cut) >= len(message.pack(minor=0))
    assert taken.pack()[: len(cut)] == cut
    left_out = [item for item in fields(message) if getattr(taken, item.name) != getattr(message, item.name)]
    assert all(getattr(taken, item.name) == item.default for item in left_out)


@given(st.integers(0, 255), st.binary(max_size=MAX_PAYLOAD))
def test_any_payload_gives_a_message_or_none_or_a_message_error(kind: int, payload: bytes) -> None:
    try:
        message = unpack_message(kind, payload)
    except MessageError:
        return
    assert (message is None) == (kind not in BY_TYPE)


def test_the_top_bit_distinguishes_host_types_from_device_types() -> None:
    assert len(BY_TYPE) == len(FROM_HOST) + len(FROM_DEVICE)
    assert all(kind.TYPE < 0x80 for kind in FROM_HOST)
    assert all(kind.TYPE >= 0x80 for kind in FROM_DEVICE)


def test_packing_a_value_that_does_not_fit_raises_an_error() -> None:
    with pytest.raises(MessageError, match="does not fit i32"):
        Turn(angle=2**31).pack()


def test_one_echo_more_than_the_limit_does_not_fit_a_frame() -> None:
    def size(echoes: int) -> int:
        return len(ReadingMessage(0, 0, 0, 0, 0, 0, (0,) * echoes).pack())

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
        least = BY_TYPE[kind](*(1 for item in fields(BY_TYPE[kind]) if item.default is MISSING))
        if not any(isinstance(item.metadata["wire"], Counted) for item in fields(BY_TYPE[kind])):
            assert getattr(unpack_message(kind, least.pack(minor=0)), name) == default
        assert {item.name: item.default for item in fields(BY_TYPE[kind])}[name] == default


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
