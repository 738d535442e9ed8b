"""Encoding and decoding of frames.

    frame = COBS( type u8 · sequence u16 · time u64 · payload · CRC-32 u32 ) · 0x00        little-endian

An encoded frame contains no zero, so a receiver is synchronized again at the next zero. The CRC is that of zlib, over
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
# COBS adds one byte for every 254 bytes or part of them
LONGEST_BLOCK = _SHORTEST + MAX_PAYLOAD + (_SHORTEST + MAX_PAYLOAD) // 254 + 1


@dataclass(frozen=True)
class Frame:
    """One valid frame."""

    type: int
    sequence: int  # 0..65535, counts the frames of this sender
    time_us: int  # clock of the sender, µs
    payload: bytes


@dataclass(frozen=True)
class Rejected:
    """Bytes between two delimiters that are not a valid frame."""

    block: bytes
    reason: str


def encode_frame(frame: Frame) -> bytes:
    """Return the encoded frame with its delimiter. Raises ValueError if the payload is longer than MAX_PAYLOAD."""
    if len(frame.payload) > MAX_PAYLOAD:
        raise ValueError(f"payload of {len(frame.payload)} bytes is too long; a frame takes at most {MAX_PAYLOAD}")
    body = _HEADER.pack(frame.type, frame.sequence, frame.time_us) + frame.payload
    stuffed: bytes = cobs.encode(body + _CRC.pack(zlib.crc32(body)))
    return stuffed + DELIMITER


def decode_block(block: bytes) -> Frame | Rejected:
    """Return the frame in the bytes between two delimiters, or the reason why they are rejected."""
    if len(block) > LONGEST_BLOCK:
        return Rejected(block, f"{len(block)} bytes without a delimiter; a block has at most {LONGEST_BLOCK}")
    try:
        body = cobs.decode(block)
    except cobs.DecodeError as error:
        return Rejected(block, f"invalid byte stuffing (COBS): {error}")
    if len(body) < _SHORTEST:
        return Rejected(block, f"{len(body)} bytes; a frame has at least {_SHORTEST}")
    if zlib.crc32(body[: -_CRC.size]) != _CRC.unpack(body[-_CRC.size :])[0]:
        return Rejected(block, "CRC-32 does not match")
    kind, sequence, time_us = _HEADER.unpack_from(body)
    return Frame(kind, sequence, time_us, body[_HEADER.size : -_CRC.size])


def frame_type(block: bytes) -> int | None:
    """Return the type of a valid frame without decoding the block, or None if the block is too short."""
    if len(block) <= _SHORTEST:
        return None
    return 0 if block[0] == 1 else block[1]


def frame_payload(block: bytes) -> bytes:
    """Return the payload of a frame that is known to be valid; the CRC-32 is not checked. Empty if COBS is invalid."""
    try:
        body: bytes = cobs.decode(block)
    except cobs.DecodeError:
        return b""
    return body[_HEADER.size : -_CRC.size]


class FrameDecoder:
    """Splits a byte stream into frames. Never raises, and buffers at most one frame."""

    def __init__(self) -> None:
        self._block = bytearray()

    def feed(self, data: bytes) -> Iterator[Frame | Rejected]:
        """Yield the frames and rejected blocks that these bytes complete, in order."""
        return map(decode_block, self.blocks(data))

    def blocks(self, data: bytes) -> Iterator[bytes]:
        """Yield the blocks that these bytes complete, for `decode_block`. Empty blocks are omitted."""
        *ended, rest = data.split(DELIMITER)
        for piece in ended:
            self._keep(piece)
            block = bytes(self._block)
            self._block.clear()
            if block:
                yield block
        self._keep(rest)

    def _keep(self, piece: bytes) -> None:
        # one byte more than the longest frame is enough for a rejection
        self._block += piece[: LONGEST_BLOCK + 1 - len(self._block)]
