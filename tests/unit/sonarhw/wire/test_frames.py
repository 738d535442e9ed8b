"""Properties of frames: encoding is reversible, and damage never creates a frame that was not sent."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sonarhw.wire.frames import (
    DELIMITER,
    LONGEST_BLOCK,
    Frame,
    FrameDecoder,
    Rejected,
    decode_block,
    encode_frame,
    frame_payload,
    frame_type,
)
from sonarhw.wire.limits import MAX_PAYLOAD

frames = st.builds(
    Frame,
    type=st.integers(0, 255),
    sequence=st.integers(0, 0xFFFF),
    time_us=st.integers(0, 2**64 - 1),
    payload=st.one_of(st.binary(max_size=MAX_PAYLOAD), st.integers(0, MAX_PAYLOAD).map(bytes)),
)


def chopped(data: bytes, cuts: list[int]) -> list[bytes]:
    """Return the same bytes in pieces."""
    places = sorted({cut % (len(data) + 1) for cut in cuts})
    return [data[a:b] for a, b in zip([0, *places], [*places, len(data)], strict=True)]


@given(frames)
def test_an_encoded_frame_decodes_and_contains_no_zero_but_its_delimiter(frame: Frame) -> None:
    wire = encode_frame(frame)
    assert wire.index(0) == len(wire) - 1
    assert decode_block(wire[:-1]) == frame


@given(st.lists(frames, max_size=6), st.lists(st.integers(0, 10_000), max_size=12))
def test_frames_do_not_depend_on_how_the_stream_is_cut(sent: list[Frame], cuts: list[int]) -> None:
    decoder = FrameDecoder()
    pieces = chopped(b"".join(map(encode_frame, sent)), cuts)
    assert [item for piece in pieces for item in decoder.feed(piece)] == sent


@given(st.lists(frames, min_size=1, max_size=5), st.data())
def test_a_damaged_stream_yields_exactly_the_undamaged_frames(sent: list[Frame], data: st.DataObject) -> None:
    wires = [encode_frame(frame) for frame in sent]
    victim = data.draw(st.integers(0, len(sent) - 1))
    at = data.draw(st.integers(0, len(wires[victim]) - 2))
    damage = data.draw(st.sampled_from(["drop", "flip"]))
    wire = bytearray(wires[victim])
    if damage == "drop":
        del wire[at]
    else:
        wire[at] ^= data.draw(st.integers(1, 255))
    wires[victim] = bytes(wire)
    got = [item for item in FrameDecoder().feed(b"".join(wires)) if isinstance(item, Frame)]
    assert got == sent[:victim] + sent[victim + 1 :]


def test_a_stream_without_delimiters_is_buffered_up_to_one_frame() -> None:
    decoder = FrameDecoder()
    for _ in range(1000):
        assert list(decoder.feed(b"\x55" * 1000)) == []
    (rejected,) = decoder.feed(DELIMITER)
    assert isinstance(rejected, Rejected)
    assert len(rejected.block) < 1000
    assert list(decoder.feed(DELIMITER * 5)) == []


@given(frames, st.binary(max_size=100))
def test_type_and_payload_are_read_without_a_check(frame: Frame, invalid: bytes) -> None:
    block = encode_frame(frame)[:-1]
    assert (frame_type(block), frame_payload(block)) == (frame.type, frame.payload)
    assert frame_type(invalid) is None or isinstance(frame_payload(invalid), bytes)


def test_the_longest_possible_block_is_accepted_and_a_longer_one_is_not() -> None:
    """Byte stuffing adds most to a frame without zeros, in its checksum too."""
    full = (Frame(1, 0x0101, 2**64 - number, b"\xff" * MAX_PAYLOAD) for number in range(1, 250))
    longest = max((encode_frame(frame) for frame in full), key=len)
    assert len(longest) - 1 == LONGEST_BLOCK
    decoder = FrameDecoder()
    assert [type(one) for one in decoder.feed(longest)] == [Frame]
    (rejected,) = decoder.feed(b"\xff" + longest)
    assert isinstance(rejected, Rejected)
    assert "without a delimiter" in rejected.reason


def test_a_payload_too_long_for_a_frame_is_rejected() -> None:
    with pytest.raises(ValueError, match="at most 512"):
        encode_frame(Frame(1, 0, 0, bytes(MAX_PAYLOAD + 1)))
