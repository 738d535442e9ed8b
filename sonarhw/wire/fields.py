"""How a field of a message lies on the wire: numbers, text, arrays; little-endian, without padding.

Takes a value and gives its bytes, and the other way round; `messages` names the fields.
"""

import struct
from dataclasses import dataclass
from typing import Any


class MessageError(ValueError):
    """A payload that does not have the shape of its message type."""


@dataclass(frozen=True)
class Scalar:
    """One number."""

    name: str
    code: str  # of struct

    def pack(self, value: Any) -> bytes:
        """The bytes of one value; raises MessageError where it does not fit."""
        try:
            return struct.pack("<" + self.code, value)
        except struct.error as error:
            raise MessageError(f"{value!r} does not fit {self.name}: {error}") from error

    def unpack(self, payload: bytes, at: int) -> tuple[Any, int]:
        """The value at offset `at` and the offset behind it."""
        try:
            return struct.unpack_from("<" + self.code, payload, at)[0], at + struct.calcsize("<" + self.code)
        except struct.error as error:
            raise MessageError(f"payload of {len(payload)} bytes ends inside {self.name} at {at}") from error


U8, U16, U32, U64 = Scalar("u8", "B"), Scalar("u16", "H"), Scalar("u32", "I"), Scalar("u64", "Q")
I16, I32 = Scalar("i16", "h"), Scalar("i32", "i")


def _take(payload: bytes, at: int, size: int, name: str) -> tuple[bytes, int]:
    if at + size > len(payload):
        raise MessageError(f"payload of {len(payload)} bytes ends inside {name} at {at}")
    return payload[at : at + size], at + size


@dataclass(frozen=True)
class Text:
    """UTF-8 behind its length in bytes (u8)."""

    name: str = "text"

    def pack(self, value: str) -> bytes:
        """The bytes of the text; raises MessageError beyond 255."""
        data = value.encode()
        return U8.pack(len(data)) + data

    def unpack(self, payload: bytes, at: int) -> tuple[str, int]:
        """The text at offset `at` and the offset behind it."""
        size, at = U8.unpack(payload, at)
        data, at = _take(payload, at, size, self.name)
        try:
            return data.decode(), at
        except UnicodeDecodeError as error:
            raise MessageError(f"text at {at - size} is not UTF-8") from error


@dataclass(frozen=True)
class Numbers:
    """u32 values behind their count (u8)."""

    name: str = "u32[]"

    def pack(self, value: tuple[int, ...]) -> bytes:
        """The bytes of all values; raises MessageError beyond 255."""
        return U8.pack(len(value)) + b"".join(map(U32.pack, value))

    def unpack(self, payload: bytes, at: int) -> tuple[tuple[int, ...], int]:
        """The values at offset `at` and the offset behind them."""
        count, at = U8.unpack(payload, at)
        data, at = _take(payload, at, 4 * count, self.name)
        return struct.unpack(f"<{count}I", data), at


@dataclass(frozen=True)
class Samples:
    """Bytes behind their count (u16)."""

    name: str = "u8[]"

    def pack(self, value: bytes) -> bytes:
        """The bytes behind their count."""
        return U16.pack(len(value)) + value

    def unpack(self, payload: bytes, at: int) -> tuple[bytes, int]:
        """The bytes at offset `at` and the offset behind them."""
        count, at = U16.unpack(payload, at)
        return _take(payload, at, count, self.name)


Wire = Scalar | Text | Numbers | Samples
