"""The messages of the wire protocol: the one definition that code, document and tests share.

A message is a frozen dataclass whose fields say how they lie on the wire; `pack` and `unpack` follow the fields in
order, little-endian, without padding. The tables of firmware_protocol.md are held against this file by a test.
"""

import struct
from dataclasses import dataclass, field, fields
from enum import IntEnum
from typing import Any, ClassVar, TypeVar

PROTOCOL_MAJOR = 1
PROTOCOL_MINOR = 0

NO_TEMPERATURE = -32768  # centidegrees that mean: no thermometer
MAX_ECHOES = 122  # of one reading; more do not fit a payload of 512 bytes


class MessageError(ValueError):
    """A payload that does not have the shape of its message type."""


# how a field lies on the wire


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


def _on_wire(wire: Wire, meaning: str) -> Any:
    return field(metadata={"wire": wire, "meaning": meaning})


# the messages


@dataclass(frozen=True)
class Message:
    """Base of all messages."""

    TYPE: ClassVar[int]

    def pack(self) -> bytes:
        """The payload. Raises MessageError where a value does not fit its field."""
        return b"".join(item.metadata["wire"].pack(getattr(self, item.name)) for item in fields(self))

    @classmethod
    def unpack(cls: type["M"], payload: bytes) -> "M":
        """The message in a payload; bytes behind the last field belong to a newer minor version and are ignored.

        Raises MessageError where the payload is too short or a text is not UTF-8.
        """
        values, at = [], 0
        for item in fields(cls):
            value, at = item.metadata["wire"].unpack(payload, at)
            values.append(value)
        return cls(*values)


M = TypeVar("M", bound=Message)


class State(IntEnum):
    """What the turntable is doing."""

    IDLE = 0
    HOMING = 1
    TURNING = 2
    SCANNING = 3


class Outcome(IntEnum):
    """How a home, turn or scan ended."""

    DONE = 0
    STOPPED = 1
    FAULT = 2


class Refusal(IntEnum):
    """Why a command was refused."""

    UNKNOWN = 1  # message type not known
    MALFORMED = 2  # payload does not have the shape of its type
    OUT_OF_RANGE = 3  # a value this board cannot do
    BUSY = 4  # homing, turning or scanning: stop first
    NOT_HOMED = 5  # where is zero? home first
    NO_HELLO = 6  # say hello first


# host to device


@dataclass(frozen=True)
class Hello(Message):
    """Opens the conversation; stops whatever the device was doing. Answer: Info."""

    TYPE = 0x01
    major: int = _on_wire(U8, "protocol version the host speaks")
    minor: int = _on_wire(U8, "protocol version the host speaks")


@dataclass(frozen=True)
class Configure(Message):
    """Settings for the pings to come. Answer: Settings, with what is in force."""

    TYPE = 0x02
    listen_us: int = _on_wire(U32, "how long to listen after the start of transmission, µs")
    blanking_us: int = _on_wire(U32, "no echo counts before this time, µs")
    trace: int = _on_wire(U8, "1: send the envelope of every ping, 0: echo times only")
    speed_of_sound: int = _on_wire(U32, "mm/s; kept and returned, so that a log alone gives ranges")


@dataclass(frozen=True)
class Home(Message):
    """Find the zero of the turntable. Answers: Accepted, then Finished."""

    TYPE = 0x03


@dataclass(frozen=True)
class Turn(Message):
    """Turn to an angle. Answers: Accepted, then Finished."""

    TYPE = 0x04
    angle: int = _on_wire(I32, "turntable angle, µdeg, counter-clockwise")


@dataclass(frozen=True)
class StartScan(Message):
    """Scan a sector. Answers: Started, readings and traces, then Finished."""

    TYPE = 0x05
    start: int = _on_wire(I32, "first turntable angle, µdeg")
    step: int = _on_wire(I32, "from one heading to the next, µdeg, not 0")
    headings: int = _on_wire(U16, "headings of one sweep, at least 1")
    sweeps: int = _on_wire(U16, "sweeps, at least 1; every second one runs backwards")
    pings: int = _on_wire(U8, "pings at each heading, at least 1")


@dataclass(frozen=True)
class Stop(Message):
    """Stop turning and pinging. Answers: Finished for what was stopped, then Accepted."""

    TYPE = 0x06


@dataclass(frozen=True)
class Resend(Message):
    """Send readings again that did not arrive. Answer: Accepted, then those readings still kept."""

    TYPE = 0x07
    first: int = _on_wire(U32, "number of the first reading wanted")
    count: int = _on_wire(U8, "how many, 1 to 64")


# device to host


@dataclass(frozen=True)
class Info(Message):
    """Who the device is. Answers Hello."""

    TYPE = 0x81
    command: int = _on_wire(U16, "sequence number of the Hello answered")
    major: int = _on_wire(U8, "protocol version the device speaks")
    minor: int = _on_wire(U8, "protocol version the device speaks")
    firmware: str = _on_wire(Text(), "name and version of the firmware")
    serial: str = _on_wire(Text(), "serial number")
    board: str = _on_wire(Text(), "board profile that describes it, empty if unknown")
    temperature: int = _on_wire(I16, "air at the board, 0.01 °C; −32768: no thermometer")
    trace_rate: int = _on_wire(U32, "samples per second of a trace, Hz; 0: no traces")
    microsteps: int = _on_wire(U32, "microsteps in a whole turn")


@dataclass(frozen=True)
class Accepted(Message):
    """The command is understood and begun."""

    TYPE = 0x82
    command: int = _on_wire(U16, "sequence number of the command")


@dataclass(frozen=True)
class Refused(Message):
    """The command is not carried out; nothing changed."""

    TYPE = 0x83
    command: int = _on_wire(U16, "sequence number of the command")
    code: int = _on_wire(U8, "refusal code")
    text: str = _on_wire(Text(), "the reason for a person to read")


@dataclass(frozen=True)
class Settings(Message):
    """The settings in force. Answers Configure; a board that cannot do what was asked says here what it does."""

    TYPE = 0x84
    command: int = _on_wire(U16, "sequence number of the Configure answered")
    listen_us: int = _on_wire(U32, "as in Configure")
    blanking_us: int = _on_wire(U32, "as in Configure")
    trace: int = _on_wire(U8, "as in Configure")
    speed_of_sound: int = _on_wire(U32, "as in Configure")


@dataclass(frozen=True)
class Started(Message):
    """The scan has begun. Numbers of readings count from 0 again."""

    TYPE = 0x85
    command: int = _on_wire(U16, "sequence number of the StartScan answered")
    readings: int = _on_wire(U32, "how many readings will come")


@dataclass(frozen=True)
class Finished(Message):
    """A home, turn or scan has ended."""

    TYPE = 0x86
    command: int = _on_wire(U16, "sequence number of the command that ended")
    outcome: int = _on_wire(U8, "outcome code")
    readings: int = _on_wire(U32, "how many readings were made, 0 but for a scan")
    text: str = _on_wire(Text(), "what went wrong, empty where nothing did")


@dataclass(frozen=True)
class ReadingMessage(Message):
    """What one ping gave."""

    TYPE = 0x87
    number: int = _on_wire(U32, "counts from 0 within the scan")
    sweep: int = _on_wire(U16, "counts from 0")
    ping: int = _on_wire(U8, "counts from 0 at each heading")
    angle: int = _on_wire(I32, "turntable angle, µdeg")
    fired_us: int = _on_wire(U64, "device clock at the start of transmission, µs")
    temperature: int = _on_wire(I16, "air at the board, 0.01 °C; −32768: no thermometer")
    echoes: tuple[int, ...] = _on_wire(Numbers(), "times of flight from the start of transmission, ns, earliest first")


@dataclass(frozen=True)
class TraceChunk(Message):
    """A stretch of one reading's trace. Not sent again when lost."""

    TYPE = 0x88
    number: int = _on_wire(U32, "reading it belongs to")
    offset: int = _on_wire(U16, "index of its first sample in the trace")
    total: int = _on_wire(U16, "samples in the whole trace")
    period_ns: int = _on_wire(U32, "from one sample to the next, ns")
    start_ns: int = _on_wire(U32, "from the start of transmission to sample 0, ns")
    samples: bytes = _on_wire(Samples(), "envelope, 255 is full scale; at most 256 a chunk")


@dataclass(frozen=True)
class Heartbeat(Message):
    """Sent every 250 ms in every state, once greeted."""

    TYPE = 0x89
    state: int = _on_wire(U8, "state code")
    angle: int = _on_wire(I32, "turntable angle, µdeg")
    readings: int = _on_wire(U32, "readings made so far in this or the last scan")
    temperature: int = _on_wire(I16, "air at the board, 0.01 °C; −32768: no thermometer")


FROM_HOST: tuple[type[Message], ...] = (Hello, Configure, Home, Turn, StartScan, Stop, Resend)
FROM_DEVICE: tuple[type[Message], ...] = (
    Info,
    Accepted,
    Refused,
    Settings,
    Started,
    Finished,
    ReadingMessage,
    TraceChunk,
    Heartbeat,
)
BY_TYPE: dict[int, type[Message]] = {kind.TYPE: kind for kind in FROM_HOST + FROM_DEVICE}


def unpack_message(kind: int, payload: bytes) -> Message | None:
    """The message of a frame's type and payload; None for a type this version does not know.

    Raises MessageError where the payload does not have the shape of its type.
    """
    message = BY_TYPE.get(kind)
    return None if message is None else message.unpack(payload)
