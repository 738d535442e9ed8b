"""Encoding of message fields: numbers, text and arrays; little-endian, without padding."""

import struct
from dataclasses import dataclass
from typing import Any


class MessageError(ValueError):
    """A payload does not match its message type, or a value does not fit its field."""


@dataclass(frozen=True)
class Scalar:
    """One number."""

    name: str
    code: str  # format character of struct

    def pack(self, value: Any) -> bytes:
        """Return the bytes of a value. Raises MessageError if it does not fit."""
        try:
            return struct.pack("<" + self.code, value)
        except struct.error as error:
            raise MessageError(f"{value!r} does not fit {self.name}: {error}") from error

    def unpack(self, payload: bytes, at: int) -> tuple[Any, int]:
        """Return the value at offset `at` and the offset after it."""
        try:
            return struct.unpack_from("<" + self.code, payload, at)[0], at + struct.calcsize("<" + self.code)
        except struct.error as error:
            text = f"payload of {len(payload)} bytes is too short for {self.name} at offset {at}"
            raise MessageError(text) from error


U8, U16, U32, U64 = Scalar("u8", "B"), Scalar("u16", "H"), Scalar("u32", "I"), Scalar("u64", "Q")
I16, I32 = Scalar("i16", "h"), Scalar("i32", "i")


def _take(payload: bytes, at: int, size: int, name: str) -> tuple[bytes, int]:
    if at + size > len(payload):
        raise MessageError(f"payload of {len(payload)} bytes is too short for {name} at offset {at}")
    return payload[at : at + size], at + size


@dataclass(frozen=True)
class Text:
    """A length in bytes (u8), then the text in UTF-8."""

    name: str = "text"

    def pack(self, value: str) -> bytes:
        """Return the bytes of the text. Raises MessageError if it has more than 255."""
        data = value.encode()
        return U8.pack(len(data)) + data

    def unpack(self, payload: bytes, at: int) -> tuple[str, int]:
        """Return the text at offset `at` and the offset after it."""
        size, at = U8.unpack(payload, at)
        data, at = _take(payload, at, size, self.name)
        try:
            return data.decode(), at
        except UnicodeDecodeError as error:
            raise MessageError(f"text at offset {at - size} is not UTF-8") from error


@dataclass(frozen=True)
class Numbers:
    """A count (u8), then that many u32 values."""

    name: str = "u32[]"

    def pack(self, value: tuple[int, ...]) -> bytes:
        """Return the bytes of all values. Raises MessageError if there are more than 255."""
        return U8.pack(len(value)) + b"".join(map(U32.pack, value))

    def unpack(self, payload: bytes, at: int) -> tuple[tuple[int, ...], int]:
        """Return the values at offset `at` and the offset after them."""
        count, at = U8.unpack(payload, at)
        data, at = _take(payload, at, 4 * count, self.name)
        return struct.unpack(f"<{count}I", data), at


@dataclass(frozen=True)
class Samples:
    """A count (u16), then that many bytes."""

    name: str = "u8[]"

    def pack(self, value: bytes) -> bytes:
        """Return the count and the bytes."""
        return U16.pack(len(value)) + value

    def unpack(self, payload: bytes, at: int) -> tuple[bytes, int]:
        """Return the bytes at offset `at` and the offset after them."""
        count, at = U16.unpack(payload, at)
        return _take(payload, at, count, self.name)


Wire = Scalar | Text | Numbers | Samples
