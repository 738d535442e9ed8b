"""Frames: how a message becomes bytes on the wire and how bytes become frames again.

    frame = COBS( type u8 · sequence u16 · time u64 · payload · CRC-32 u32 ) · 0x00        little-endian

A zero never occurs inside, so a damaged stream is whole again at the next zero. The CRC is zlib's, over
everything before it.
"""

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass

from cobs import cobs

from sonarhw.wire.limits import MAX_PAYLOAD

DELIMITER = b"\0"
_HEADER = struct.Struct("<BHQ")
_CRC = struct.Struct("<I")
_SHORTEST = _HEADER.size + _CRC.size
# COBS adds one byte for each 254 begun
LONGEST_BLOCK = _SHORTEST + MAX_PAYLOAD + (_SHORTEST + MAX_PAYLOAD) // 254 + 1


@dataclass(frozen=True)
class Frame:
    """One undamaged frame."""

    type: int
    sequence: int  # 0..65535, counts this sender's frames
    time_us: int  # the sender's clock, µs since it started
    payload: bytes


@dataclass(frozen=True)
class Rejected:
    """A stretch of bytes between two delimiters that is no frame."""

    block: bytes
    reason: str


def encode_frame(frame: Frame) -> bytes:
    """Bytes for the wire, delimiter included. Raises ValueError where the payload is longer than MAX_PAYLOAD."""
    if len(frame.payload) > MAX_PAYLOAD:
        raise ValueError(f"payload of {len(frame.payload)} bytes; at most {MAX_PAYLOAD} fit a frame")
    body = _HEADER.pack(frame.type, frame.sequence, frame.time_us) + frame.payload
    stuffed: bytes = cobs.encode(body + _CRC.pack(zlib.crc32(body)))
    return stuffed + DELIMITER


def decode_block(block: bytes) -> Frame | Rejected:
    """The frame in the bytes between two delimiters, or why there is none."""
    if len(block) > LONGEST_BLOCK:
        return Rejected(block, f"{len(block)} bytes without a delimiter")
    try:
        body = cobs.decode(block)
    except cobs.DecodeError as error:
        return Rejected(block, f"byte stuffing broken: {error}")
    if len(body) < _SHORTEST:
        return Rejected(block, f"{len(body)} bytes; a frame has at least {_SHORTEST}")
    if zlib.crc32(body[: -_CRC.size]) != _CRC.unpack(body[-_CRC.size :])[0]:
        return Rejected(block, "CRC-32 does not match")
    kind, sequence, time_us = _HEADER.unpack_from(body)
    return Frame(kind, sequence, time_us, body[_HEADER.size : -_CRC.size])


def frame_type(block: bytes) -> int | None:
    """The type of an undamaged frame, read where stuffing has left it; None where the block is too short for one."""
    if len(block) <= _SHORTEST:
        return None
    return 0 if block[0] == 1 else block[1]


def frame_payload(block: bytes) -> bytes:
    """The payload of a frame that is known to be undamaged; its CRC-32 is not looked at. Empty where it is none."""
    try:
        body: bytes = cobs.decode(block)
    except cobs.DecodeError:
        return b""
    return body[_HEADER.size : -_CRC.size]


class FrameDecoder:
    """Cuts a byte stream into frames. Never raises, whatever comes; holds at most one frame's bytes."""

    def __init__(self) -> None:
        self._block = bytearray()

    def feed(self, data: bytes) -> Iterator[Frame | Rejected]:
        """What the bytes completed, in order."""
        return map(decode_block, self.blocks(data))

    def blocks(self, data: bytes) -> Iterator[bytes]:
        """The blocks that the bytes completed, for `decode_block`; empty ones (doubled delimiters) are left out."""
        *ended, rest = data.split(DELIMITER)
        for piece in ended:
            self._keep(piece)
            block = bytes(self._block)
            self._block.clear()
            if block:
                yield block
        self._keep(rest)

    def _keep(self, piece: bytes) -> None:
        # one byte more than any frame has is enough to be rejected
        self._block += piece[: LONGEST_BLOCK + 1 - len(self._block)]
