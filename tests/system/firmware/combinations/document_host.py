"""A host that is written from firmware_protocol.md alone: it reads messages, codes and the CRC table from the document.

It imports nothing of the product, so it finds where product and document differ in the same way on both sides.
"""

import re
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import serial

DOCUMENT = (Path(__file__).parents[4] / "firmware_protocol.md").read_text()
HANG = 60.0  # s
_SIZES = {"u8": 1, "u16": 2, "u32": 4, "u64": 8, "i16": 2, "i32": 4}
_COUNTS = {"text": ("u8", 1), "u32[]": ("u8", 4), "u8[]": ("u16", 1)}


class Field(NamedTuple):
    """A field of a message. `default` is the value if an older sender omits it; None: never omitted."""

    name: str
    kind: str
    default: Any


class Received(NamedTuple):
    """A message from the device."""

    name: str
    fields: dict[str, Any]
    time_us: int


def _messages() -> dict[str, tuple[int, list[Field]]]:
    """Return type and fields of each message of the document, by its name."""
    found = {}
    for name, number, body in re.findall(r"^### (\w+) · 0x(\w\w) · \w+ to \w+\n(.*?)(?=^##)", DOCUMENT, re.M | re.S):
        rows = re.findall(r"^\| `(\w+)` \| (\S+) \| (.*) \|$", body, re.M)
        found[name] = (int(number, 16), [Field(field, kind, _default(meaning, kind)) for field, kind, meaning in rows])
    return found


def _default(meaning: str, kind: str) -> Any:
    omitted = re.search(r" · 1\.\d, else (\w+)$", meaning)
    if omitted is None:
        return None
    return int(omitted[1]) if omitted[1].isdecimal() else {"text": "", "u8[]": b""}[kind]


def codes(title: str) -> dict[str, int]:
    """Return the codes of a table such as `Outcome`, by name."""
    (body,) = re.findall(rf"^### {title} codes\n(.*?)(?=^##)", DOCUMENT, re.M | re.S)
    return {name: int(code) for code, name in re.findall(r"^\| (\d+) \| (\w+) \|", body, re.M)}


MESSAGES = _messages()
_NAMES = {number: name for name, (number, _) in MESSAGES.items()}
_CRC = [int(word, 16) for word in re.findall(r"0x(\w{8})", re.findall(r"```crc table\n(.*?)```", DOCUMENT, re.S)[0])]


def crc(data: bytes) -> int:
    """Return the CRC-32, with the steps that the document describes."""
    value = 0xFFFFFFFF
    for byte in data:
        value ^= byte
        for _ in range(2):
            value = (value >> 4) ^ _CRC[value & 15]
    return value ^ 0xFFFFFFFF


def stuffed(frame: bytes) -> bytes:
    """Return a frame with byte stuffing, and the zero after it."""
    out = b""
    for piece in frame.split(b"\0"):
        for at in range(0, max(1, len(piece)), 254):
            part = piece[at : at + 254]
            out += bytes([len(part) + 1]) + part
    return out + b"\0"


def unstuffed(block: bytes) -> bytes | None:
    """Return the frame in a block without its zero; None if it is damaged."""
    out, at = b"", 0
    while at < len(block):
        end = at + block[at]
        if end > len(block):
            return None
        out += block[at + 1 : end] + (b"\0" if block[at] != 0xFF and end < len(block) else b"")
        at = end
    return out


def _packed(fields: list[Field], values: dict[str, Any]) -> bytes:
    out = b""
    for field in fields:
        value = values[field.name]
        if field.kind in _COUNTS:
            count, size = _COUNTS[field.kind]
            out += (len(value) // size).to_bytes(_SIZES[count], "little") + value
        else:
            out += value.to_bytes(_SIZES[field.kind], "little", signed=field.kind[0] == "i")
    return out


def _unpacked(fields: list[Field], payload: bytes) -> dict[str, Any]:
    found, at = {}, 0

    def take(kind: str) -> int:
        nonlocal at
        assert at + _SIZES[kind] <= len(payload), "the payload is too short"
        at += _SIZES[kind]
        return int.from_bytes(payload[at - _SIZES[kind] : at], "little", signed=kind[0] == "i")

    for field in fields:
        if at == len(payload) and field.default is not None:
            found[field.name] = field.default
        elif field.kind == "u32[]":
            found[field.name] = [take("u32") for _ in range(take("u8"))]
        elif field.kind in _COUNTS:
            size = take(_COUNTS[field.kind][0])
            found[field.name] = payload[at : at + size].decode() if field.kind == "text" else payload[at : at + size]
            at += size
        else:
            found[field.name] = take(field.kind)
    return found


class DocumentHost:
    """A connection to a device at a serial port."""

    def __init__(self, port: str) -> None:
        self._port = serial.Serial(port, 250_000, timeout=0.01)
        self._waiting = b""
        self._sequence = 77
        self._sent_at = 0.0
        self.received: list[Received] = []

    def close(self) -> None:
        """Close the port."""
        self._port.close()

    def send(self, name: str, **values: Any) -> tuple[int, bytes]:
        """Send a command; return its sequence number and its bytes."""
        self._sequence = (self._sequence + 1) % 0x10000
        number, fields = MESSAGES[name]
        frame = bytes([number]) + self._sequence.to_bytes(2, "little") + bytes(8) + _packed(fields, values)
        wire = b"\0" + stuffed(frame + crc(frame).to_bytes(4, "little"))
        self.send_again(wire)
        return self._sequence, wire

    def send_again(self, wire: bytes) -> None:
        """Send the bytes of an earlier command."""
        self._sent_at = time.monotonic()
        self._port.write(wire)

    def answer(self, name: str, **values: Any) -> Received:
        """Send a command and return its answer."""
        since = len(self.received)
        sequence, _ = self.send(name, **values)
        return self.wait(lambda one: one.name != "Finished" and one.fields.get("command") == sequence, since)

    def act(self, name: str, **values: Any) -> tuple[Received, list[Received], bytes]:
        """Send Home, Turn or StartScan; return its Finished, all messages until then, and the bytes of the command."""
        since = len(self.received)
        sequence, wire = self.send(name, **values)
        end = self.wait(lambda one: one.name == "Finished" and one.fields["command"] == sequence, since)
        return end, self.received[since:], wire

    def wait(self, wanted: Callable[[Received], bool], since: int) -> Received:
        """Return the first message from index `since` on that is wanted. Sends a sign of life every 0.5 s."""
        deadline = time.monotonic() + HANG
        while True:
            for one in self.received[since:]:
                if wanted(one):
                    return one
            assert time.monotonic() < deadline, f"received only {self.received[since:][-5:]}"
            if time.monotonic() > self._sent_at + 0.5:
                self.send("AskStatistics")
            self._listen()

    def greet(self) -> Received:
        """Send Hello until Info arrives."""
        while not any(one.name == "Info" for one in self.received):
            self.send("Hello", major=1, minor=2)
            until = time.monotonic() + 0.5
            while time.monotonic() < until and not any(one.name == "Info" for one in self.received):
                self._listen()
        return next(one for one in self.received if one.name == "Info")

    def use_baud(self, baud: int) -> None:
        """Change the baud rate of the line, and test it."""
        assert self.answer("SetBaud", baud=baud).name == "Accepted"
        self._port.baudrate = baud
        for k in range(32):
            pattern = bytes([k, 0, 255 - k])
            assert self.answer("TestLink", size=100, data=pattern).fields["data"] == (pattern * 34)[:100]

    def _listen(self) -> None:
        self._waiting += self._port.read(4096)
        *blocks, self._waiting = self._waiting.split(b"\0")
        for block in filter(None, blocks):
            frame = unstuffed(block)
            if frame is None or len(frame) < 15 or crc(frame[:-4]) != int.from_bytes(frame[-4:], "little"):
                continue
            if (name := _NAMES.get(frame[0])) is not None:
                fields = _unpacked(MESSAGES[name][1], frame[11:-4])
                self.received.append(Received(name, fields, int.from_bytes(frame[3:11], "little")))
