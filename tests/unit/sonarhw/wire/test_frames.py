"""Laws of frames: what goes in comes out, and damage never makes a frame that was not sent."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sonarhw.wire.frames import (
    DELIMITER,
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
    """The same bytes in pieces."""
    places = sorted({cut % (len(data) + 1) for cut in cuts})
    return [data[a:b] for a, b in zip([0, *places], [*places, len(data)], strict=True)]


@given(frames)
def test_a_frame_survives_the_wire_and_holds_no_zero_but_its_delimiter(frame: Frame) -> None:
    wire = encode_frame(frame)
    assert wire.index(0) == len(wire) - 1
    assert decode_block(wire[:-1]) == frame


@given(st.lists(frames, max_size=6), st.lists(st.integers(0, 10_000), max_size=12))
def test_frames_arrive_the_same_however_the_stream_is_cut(sent: list[Frame], cuts: list[int]) -> None:
    decoder = FrameDecoder()
    pieces = chopped(b"".join(map(encode_frame, sent)), cuts)
    assert [item for piece in pieces for item in decoder.feed(piece)] == sent


@given(st.binary(max_size=3000), st.lists(st.integers(0, 3000), max_size=5), frames)
def test_any_bytes_are_borne_and_the_next_frame_after_a_delimiter_is_whole(
    noise: bytes, cuts: list[int], frame: Frame
) -> None:
    decoder = FrameDecoder()
    for piece in chopped(noise, cuts):
        list(decoder.feed(piece))
    list(decoder.feed(DELIMITER))
    assert list(decoder.feed(encode_frame(frame))) == [frame]


@given(st.lists(frames, min_size=1, max_size=5), st.data())
def test_a_damaged_stream_yields_only_frames_that_were_sent_and_all_undamaged_ones(
    sent: list[Frame], data: st.DataObject
) -> None:
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


@given(frames, st.integers(0, 600), st.integers(0, 7))
def test_one_flipped_bit_in_a_block_is_never_taken_for_a_frame(frame: Frame, at: int, bit: int) -> None:
    block = bytearray(encode_frame(frame)[:-1])
    block[at % len(block)] ^= 1 << bit
    assert isinstance(decode_block(bytes(block)), Rejected)


def test_a_stream_without_delimiters_is_held_to_one_frames_length() -> None:
    decoder = FrameDecoder()
    for _ in range(1000):
        assert list(decoder.feed(b"\x55" * 1000)) == []
    (rejected,) = decoder.feed(DELIMITER)
    assert isinstance(rejected, Rejected)
    assert len(rejected.block) < 1000


@given(frames)
def test_type_and_payload_of_an_undamaged_frame_are_read_without_checking_it(frame: Frame) -> None:
    block = encode_frame(frame)[:-1]
    assert (frame_type(block), frame_payload(block)) == (frame.type, frame.payload)


@given(st.binary(max_size=100))
def test_type_and_payload_of_anything_else_are_not_complained_of(block: bytes) -> None:
    assert frame_type(block) is None or isinstance(frame_payload(block), bytes)


def test_doubled_delimiters_are_silence() -> None:
    assert list(FrameDecoder().feed(DELIMITER * 5)) == []


def test_a_payload_too_long_for_a_frame_is_refused() -> None:
    with pytest.raises(ValueError, match="at most 512"):
        encode_frame(Frame(1, 0, 0, bytes(MAX_PAYLOAD + 1)))
