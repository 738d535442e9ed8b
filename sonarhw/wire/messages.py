"""Definitions of all messages of the wire protocol. Code, document and tests are derived from them.

A message is a frozen dataclass. The metadata of each field describes its encoding. `pack` and `unpack` process the
fields in order, little-endian, without padding. A field with a default was added after version 1.0. Senders of older
versions omit it, and receivers of older versions ignore it. `BY_TYPE`, `FROM_HOST` and `FROM_DEVICE` contain every
message that is defined here. `firmware/generate.py` writes the C structures from this file, and
`firmware/protocol_tables.py` writes the tables of firmware_protocol.md.
"""

import math
import struct
from collections.abc import Callable
from dataclasses import MISSING, dataclass, field, fields
from enum import IntEnum, IntFlag
from typing import Any, ClassVar, Literal, TypeVar

from sonarhw.wire.limits import MAX_ECHOES, PROTOCOL_MINOR


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

    def unpack(self, payload: bytes, offset: int) -> tuple[Any, int]:
        """Return the value at offset `offset` and the offset after it."""
        try:
            return struct.unpack_from("<" + self.code, payload, offset)[0], offset + struct.calcsize("<" + self.code)
        except struct.error as error:
            text = f"payload of {len(payload)} bytes is too short for {self.name} at offset {offset}"
            raise MessageError(text) from error


U8, U16, U32, U64 = Scalar("u8", "B"), Scalar("u16", "H"), Scalar("u32", "I"), Scalar("u64", "Q")
I16, I32 = Scalar("i16", "h"), Scalar("i32", "i")


@dataclass(frozen=True)
class Counted:
    """A count, then that many elements."""

    name: str
    count: Scalar
    size: int  # bytes of an element
    encode: Callable[[Any], bytes]
    decode: Callable[[bytes], Any]

    def pack(self, value: Any) -> bytes:
        """Return the bytes of a value. Raises MessageError if it has too many elements, or one does not fit."""
        data = self.encode(value)
        return self.count.pack(len(data) // self.size) + data

    def unpack(self, payload: bytes, offset: int) -> tuple[Any, int]:
        """Return the value at offset `offset` and the offset after it."""
        count, start = self.count.unpack(payload, offset)
        end = start + self.size * count
        if end > len(payload):
            raise MessageError(f"payload of {len(payload)} bytes is too short for {self.name} at offset {start}")
        try:
            return self.decode(payload[start:end]), end
        except UnicodeDecodeError as error:
            raise MessageError(f"{self.name} at offset {start} is not UTF-8") from error


def _pack_numbers(values: tuple[int, ...]) -> bytes:
    return b"".join(map(U32.pack, values))


def _unpack_numbers(data: bytes) -> tuple[int, ...]:
    return struct.unpack(f"<{len(data) // 4}I", data)


TEXT = Counted("text", U8, 1, str.encode, bytes.decode)  # UTF-8
NUMBERS = Counted("u32[]", U8, 4, _pack_numbers, _unpack_numbers)
SAMPLES = Counted("u8[]", U16, 1, bytes, bytes)

Wire = Scalar | Counted


# codes in messages, and what each means


class State(IntEnum):
    """What the device is doing."""

    IDLE = 0
    HOMING = 1
    TURNING = 2
    SCANNING = 3


class Outcome(IntEnum):
    """How a home, turn or scan ended."""

    DONE = 0
    STOPPED = 1
    FAULT = 2
    LOST_STEPS = 3


class Refusal(IntEnum):
    """Why a command was refused."""

    UNKNOWN = 1  # unknown message type, or a type that only devices send
    MALFORMED = 2  # the payload does not match its type
    OUT_OF_RANGE = 3  # a value that the device does not support
    BUSY = 4  # homing, turning or scanning; send Stop first
    NOT_HOMED = 5  # the zero is unknown; send Home first
    NO_HELLO = 6  # no conversation yet; send Hello first


class TraceKind(IntEnum):
    """What a trace samples."""

    NONE = 0
    ENVELOPE = 1
    CARRIER = 2


class Zero(IntEnum):
    """How the zero of the turntable is known."""

    UNKNOWN = 0
    MARK = 1
    HAND = 2


class Approach(IntEnum):
    """Direction in which the turntable approaches an angle."""

    EITHER = 0
    COUNTER_CLOCKWISE = 1
    CLOCKWISE = 2


class ResetCause(IntEnum):
    """Why the device started."""

    UNKNOWN = 0
    POWER = 1
    BUTTON = 2
    BROWNOUT = 3
    WATCHDOG = 4
    SOFTWARE = 5


class Feature(IntFlag):
    """What a device supports besides turning and timing one echo."""

    HOME_MARK = 1
    LOST_STEPS = 2
    THERMOMETER = 4
    BLANKING = 8
    REARM = 16
    PULSES = 32
    ENVELOPE = 64
    CARRIER = 128
    INPUTS = 256
    WIRING = 512
    ONE_SWITCH = 1024


class Input(IntFlag):
    """The inputs of a device, each with the code of its level."""

    MARK = 1
    CAM = 2
    ECHO = 4


class Wiring(IntFlag):
    """What a device can invert, so that it works with other switches and another motor, and whether it has a cam."""

    MARK = 1
    CAM = 2
    MOTOR = 4
    ONE_SWITCH = 8


def _on_wire(wire: Wire, meaning: str) -> Any:
    return field(metadata={"wire": wire, "meaning": meaning, "since": 0})


def _since_1_1(wire: Wire, meaning: str, default: int) -> Any:
    return _since(1, wire, meaning, default)


def _since_1_2(wire: Wire, meaning: str, default: int | bytes | str) -> Any:
    return _since(2, wire, meaning, default)


def _since(minor: int, wire: Wire, meaning: str, default: int | bytes | str) -> Any:
    """A field that senders of versions below 1.`minor` omit; receivers then use `default`."""
    meaning = f"{meaning} · 1.{minor}, else {default if isinstance(default, int) else 'none'}"
    return field(default=default, metadata={"wire": wire, "meaning": meaning, "since": minor})


BY_TYPE: "dict[int, type[Message]]" = {}


@dataclass(frozen=True)
class Message:
    """Base of all messages. A class with a TYPE can be sent: by the host below 0x80, by the device from 0x80 on."""

    TYPE: ClassVar[int]

    def __init_subclass__(cls) -> None:
        if "TYPE" in cls.__dict__:
            BY_TYPE[cls.TYPE] = cls

    def pack(self, minor: int = PROTOCOL_MINOR) -> bytes:
        """Return the payload for version 1.`minor`. Raises MessageError if a value does not fit its field."""
        sent = (item for item in fields(self) if minor >= item.metadata["since"])
        return b"".join(item.metadata["wire"].pack(getattr(self, item.name)) for item in sent)

    @classmethod
    def unpack(cls: type["M"], payload: bytes) -> "M":
        """Return the message in a payload. Bytes after the last field belong to a newer minor version and are ignored.

        A payload that ends before a field with a default comes from an older version. Raises MessageError if the
        payload ends anywhere else, or if a text is not UTF-8.
        """
        values, offset = [], 0
        for item in fields(cls):
            if offset == len(payload) and item.default is not MISSING:
                break
            value, offset = item.metadata["wire"].unpack(payload, offset)
            values.append(value)
        return cls(*values)


M = TypeVar("M", bound=Message)


@dataclass(frozen=True)
class CommandMessage(Message):
    """Base of the messages from the host. A device answers each with an `AnswerMessage`."""

    SINCE: ClassVar[int] = 0  # minor version
    # what happens to it while the device homes, turns or scans; BUSY: it is refused
    WHEN_BUSY: ClassVar[Literal["answered", "BUSY", "stops it"]] = "answered"
    TAKES_TIME: ClassVar[bool] = False  # whether the device sends Finished when it has ended


@dataclass(frozen=True)
class AnswerMessage(Message):
    """Base of the messages that answer a command."""

    command: int = _on_wire(U16, "sequence number of the answered command")


# host to device


@dataclass(frozen=True)
class Hello(CommandMessage):
    """Start a conversation, and stop the running command. Answer: Info."""

    TYPE = 0x01
    WHEN_BUSY = "stops it"
    major: int = _on_wire(U8, "major protocol version of the host")
    minor: int = _on_wire(U8, "minor protocol version of the host")


@dataclass(frozen=True)
class Configure(CommandMessage):
    """Set how the next pings are made. Answer: Settings, with the values in force."""

    TYPE = 0x02
    WHEN_BUSY = "BUSY"
    listen_us: int = _on_wire(U32, "how long to listen, from the start of transmission, µs")
    blanking_us: int = _on_wire(U32, "echoes before this time are ignored, from the start of transmission, µs")
    trace: int = _on_wire(U8, "trace code: what to send of each ping besides its echo times")
    speed_of_sound: int = _on_wire(U32, "mm/s; the device only stores and returns it, for the ranges in logs")
    pulses: int = _since_1_1(U8, "cycles to transmit; 0: the board's default", 0)
    echoes: int = _since_1_1(U8, "maximum number of echoes to report of a ping, 1 to 122", MAX_ECHOES)
    rearm_us: int = _since_1_1(U16, "time from an echo to re-arming the receiver, µs; 0: as short as possible", 0)
    trace_rate: int = _since_1_1(U32, "sample rate of traces, Hz; 0: the device's default", 0)
    trace_bits: int = _since_1_1(U8, "bits per sample of traces, 8 or 16; 0: the device's default", 0)


@dataclass(frozen=True)
class Home(CommandMessage):
    """Find the zero of the turntable. Answers: Accepted, then Finished."""

    TYPE = 0x03
    WHEN_BUSY = "BUSY"
    TAKES_TIME = True


@dataclass(frozen=True)
class Turn(CommandMessage):
    """Turn to an angle. Answers: Accepted, then Finished."""

    TYPE = 0x04
    WHEN_BUSY = "BUSY"
    TAKES_TIME = True
    angle: int = _on_wire(I32, "turntable angle, µdeg, counter-clockwise")
    relative: int = _since_1_2(U8, "1: a jog: turn by `angle`, at most 10 degrees, also while the zero is unknown", 0)


@dataclass(frozen=True)
class StartScan(CommandMessage):
    """Scan a sector. Answers: Started, readings and traces, then Finished."""

    TYPE = 0x05
    WHEN_BUSY = "BUSY"
    TAKES_TIME = True
    start: int = _on_wire(I32, "first turntable angle, µdeg")
    step: int = _on_wire(I32, "angle from one heading to the next, µdeg; not 0")
    headings: int = _on_wire(U16, "number of headings in a sweep, at least 1")
    sweeps: int = _on_wire(U16, "number of sweeps, at least 1; every second sweep runs backwards")
    pings: int = _on_wire(U8, "number of pings at each heading, at least 1")
    first: int = _since_1_1(U32, "number of the first reading to make; earlier readings are skipped", 0)
    count: int = _since_1_1(U32, "number of readings to make; 0: all from `first` to the end", 0)
    in_place: int = _since_1_2(U8, "1: ping at the present angle; `start` is ignored, `headings` is 1", 0)


@dataclass(frozen=True)
class Stop(CommandMessage):
    """Stop turning and pinging. Answers: Finished for the stopped command, then Accepted."""

    TYPE = 0x06
    WHEN_BUSY = "stops it"


@dataclass(frozen=True)
class Resend(CommandMessage):
    """Send lost readings again. Answer: Accepted, then the requested readings that the device still keeps."""

    TYPE = 0x07
    first: int = _on_wire(U32, "number of the first reading to send")
    count: int = _on_wire(U8, "number of readings to send, 1 to 64")


@dataclass(frozen=True)
class AskCapabilities(CommandMessage):
    """Request the limits and features of the device. Answer: Capabilities."""

    TYPE = 0x08
    SINCE = 1


@dataclass(frozen=True)
class ConfigureTurntable(CommandMessage):
    """Set how the turntable turns. Answer: TurntableSettings, with the values in force."""

    TYPE = 0x09
    SINCE = 1
    WHEN_BUSY = "BUSY"
    speed: int = _on_wire(U32, "highest speed, µdeg/s; 0: the device's default")
    acceleration: int = _on_wire(U32, "acceleration, µdeg/s²; 0: the device's default")
    settle_us: int = _on_wire(U32, "pause between the end of a movement and the next ping, µs")
    approach: int = _on_wire(U8, "approach code: direction in which to approach an angle, against backlash")


@dataclass(frozen=True)
class AskStatistics(CommandMessage):
    """Request the device's counters; also keeps the connection alive. Answer: Statistics."""

    TYPE = 0x0A
    SINCE = 1


@dataclass(frozen=True)
class SetBaud(CommandMessage):
    """Change the baud rate of the line. Answer: Accepted at the old baud rate; everything after it at the new one."""

    TYPE = 0x0B
    SINCE = 1
    WHEN_BUSY = "BUSY"
    baud: int = _on_wire(U32, "bits per second")


@dataclass(frozen=True)
class TestLink(CommandMessage):
    """Request bytes back, to test the line. Answer: LinkTested."""

    __test__ = False  # not a test: pytest collects classes named Test*
    TYPE = 0x0C
    SINCE = 1
    size: int = _on_wire(U16, "number of bytes to send back, at most 480")
    data: bytes = _on_wire(SAMPLES, "pattern to repeat, 1 to 64 bytes")


@dataclass(frozen=True)
class SetZero(CommandMessage):
    """Make the present angle the zero of the turntable, without moving. Answer: Accepted."""

    TYPE = 0x0D
    SINCE = 2
    WHEN_BUSY = "BUSY"


@dataclass(frozen=True)
class ConfigureWiring(CommandMessage):
    """Invert a switch or the motor, or home by one switch. Answer: WiringSettings, with the values in force."""

    TYPE = 0x0E
    SINCE = 2
    WHEN_BUSY = "BUSY"
    change: int = _on_wire(U8, "sum of the wiring codes to set; the others keep their value")
    inverted: int = _on_wire(U8, "sum of those wiring codes in `change` that are to be in force")


# device to host


@dataclass(frozen=True)
class Info(AnswerMessage):
    """Identity and state of the device. Answers Hello."""

    TYPE = 0x81
    command: int = _on_wire(U16, "sequence number of the answered Hello")
    major: int = _on_wire(U8, "major protocol version of the device")
    minor: int = _on_wire(U8, "minor protocol version of the device")
    firmware: str = _on_wire(TEXT, "name and version of the firmware")
    serial: str = _on_wire(TEXT, "serial number")
    board: str = _on_wire(TEXT, "name of the board profile that describes the device; empty if unknown")
    temperature: int = _on_wire(I16, "air temperature at the board, 0.01 °C; −32768: no thermometer")
    trace_rate: int = _on_wire(U32, "sample rate of traces, Hz; 0: no traces")
    microsteps: int = _on_wire(U32, "microsteps per turn of the table")
    boot: int = _since_1_1(U32, "how many times the device has started; 0: not counted", 0)
    homed: int = _since_1_1(U8, "zero code: how the zero of the turntable is known", 0)


@dataclass(frozen=True)
class Accepted(AnswerMessage):
    """The command is valid and has been carried out or begun."""

    TYPE = 0x82


@dataclass(frozen=True)
class Refused(AnswerMessage):
    """The command is rejected; nothing has changed."""

    TYPE = 0x83
    code: int = _on_wire(U8, "refusal code")
    text: str = _on_wire(TEXT, "the reason, as text for the user")


@dataclass(frozen=True)
class Settings(AnswerMessage):
    """The settings in force. Answers Configure. Values may differ from those requested."""

    TYPE = 0x84
    command: int = _on_wire(U16, "sequence number of the answered Configure")
    listen_us: int = _on_wire(U32, "as in Configure")
    blanking_us: int = _on_wire(U32, "as in Configure")
    trace: int = _on_wire(U8, "as in Configure")
    speed_of_sound: int = _on_wire(U32, "as in Configure")
    pulses: int = _since_1_1(U8, "as in Configure; 0 only if unknown", 0)
    echoes: int = _since_1_1(U8, "as in Configure", MAX_ECHOES)
    rearm_us: int = _since_1_1(U16, "as in Configure", 0)
    trace_rate: int = _since_1_1(U32, "as in Configure; 0 only if no traces are sent", 0)
    trace_bits: int = _since_1_1(U8, "as in Configure; 0 only if no traces are sent", 0)


@dataclass(frozen=True)
class Started(AnswerMessage):
    """The scan has begun. Readings of the previous scan are no longer kept. Answers StartScan."""

    TYPE = 0x85
    command: int = _on_wire(U16, "sequence number of the answered StartScan")
    readings: int = _on_wire(U32, "number of readings that will follow")
    first: int = _since_1_1(U32, "number of the first of these readings", 0)


@dataclass(frozen=True)
class Finished(Message):
    """A Home, Turn or StartScan has ended."""

    TYPE = 0x86
    command: int = _on_wire(U16, "sequence number of the command that has ended")
    outcome: int = _on_wire(U8, "outcome code")
    readings: int = _on_wire(U32, "scan: number of the first reading not made; otherwise 0")
    text: str = _on_wire(TEXT, "reason of a failure, as text for the user; empty on success")


@dataclass(frozen=True)
class ReadingMessage(Message):
    """The result of one ping."""

    TYPE = 0x87
    number: int = _on_wire(U32, "number of the reading in its scan, from 0")
    sweep: int = _on_wire(U16, "number of the sweep, from 0")
    ping: int = _on_wire(U8, "number of the ping at its heading, from 0")
    angle: int = _on_wire(I32, "turntable angle, µdeg")
    fired_us: int = _on_wire(U64, "device clock at the start of transmission, µs")
    temperature: int = _on_wire(I16, "air temperature at the board, 0.01 °C; −32768: no thermometer")
    echoes: tuple[int, ...] = _on_wire(NUMBERS, "times of flight from the start of transmission, ns, earliest first")


@dataclass(frozen=True)
class TraceChunk(Message):
    """Part of the trace of one reading. Not sent again if lost."""

    TYPE = 0x88
    number: int = _on_wire(U32, "number of the reading")
    offset: int = _on_wire(U16, "index of the chunk's first sample in the trace")
    total: int = _on_wire(U16, "number of samples in the whole trace")
    period_ns: int = _on_wire(U32, "sample period, ns")
    start_ns: int = _on_wire(U32, "time from the start of transmission to sample 0, ns")
    samples: bytes = _on_wire(SAMPLES, "at most 256 bytes; 16-bit samples are little-endian")
    kind: int = _since_1_1(U8, "trace code: 1 envelope; 2 carrier, whose zero is half of full scale", 1)
    bits: int = _since_1_1(U8, "bits per sample, 8 or 16; full scale is all bits set", 8)
    lost: bytes = _since_1_2(SAMPLES, "indices, in this chunk, of samples that were not measured", b"")


@dataclass(frozen=True)
class Heartbeat(Message):
    """State of the device. Sent every 250 ms in every state, from Info on."""

    TYPE = 0x89
    state: int = _on_wire(U8, "state code")
    angle: int = _on_wire(I32, "turntable angle, µdeg; 0 while the zero is unknown")
    readings: int = _on_wire(U32, "number of the next reading of this or the last scan")
    temperature: int = _on_wire(I16, "air temperature at the board, 0.01 °C; −32768: no thermometer")
    boot: int = _since_1_1(U32, "as in Info; a different number means that the device was reset", 0)
    homed: int = _since_1_1(U8, "as in Info", 0)
    inputs: int = _since_1_2(U8, "sum of the input codes whose pin is high", 0)


@dataclass(frozen=True)
class Capabilities(AnswerMessage):
    """Limits and features of the device. Answers AskCapabilities."""

    TYPE = 0x8A
    features: int = _on_wire(U32, "sum of the codes of the supported features")
    lowest_angle: int = _on_wire(I32, "clockwise limit of the cable, µdeg")
    highest_angle: int = _on_wire(I32, "counter-clockwise limit of the cable, µdeg")
    steps: int = _on_wire(U16, "full motor steps per turn of the table; 0: unknown")
    fastest: int = _on_wire(U32, "highest speed, µdeg/s")
    hardest: int = _on_wire(U32, "highest acceleration, µdeg/s²; 0: unknown")
    backlash: int = _on_wire(U32, "backlash of the gear, µdeg; 0: none or unknown")
    longest_listen_us: int = _on_wire(U32, "longest listening time, µs")
    shortest_blanking_us: int = _on_wire(U32, "shortest blanking, µs")
    shortest_rearm_us: int = _on_wire(U16, "shortest `rearm_us`, µs")
    most_pulses: int = _on_wire(U8, "highest number of transmitted cycles; 0: unknown")
    most_echoes: int = _on_wire(U8, "highest number of echoes in a reading")
    ping_period_us: int = _on_wire(U32, "shortest time from the start of one ping to the start of the next, µs")
    fastest_trace: int = _on_wire(U32, "highest sample rate of traces, Hz; 0: no traces")
    longest_trace: int = _on_wire(U16, "highest number of samples in a trace")
    fastest_baud: int = _on_wire(U32, "highest baud rate of the line; 0: the line has no baud rate (TCP, USB CDC)")
    readings_kept: int = _on_wire(U16, "number of readings that the device keeps for Resend")
    turning: str = _since_1_2(TEXT, "what turns the table: `step-dir`, `28byj`, `servo`; empty if unknown", "")


@dataclass(frozen=True)
class TurntableSettings(AnswerMessage):
    """Turntable settings in force. Answers ConfigureTurntable. Values may differ from those requested."""

    TYPE = 0x8B
    speed: int = _on_wire(U32, "highest speed, µdeg/s; never 0")
    acceleration: int = _on_wire(U32, "acceleration, µdeg/s²; 0: unknown")
    settle_us: int = _on_wire(U32, "as in ConfigureTurntable")
    approach: int = _on_wire(U8, "as in ConfigureTurntable")


@dataclass(frozen=True)
class Statistics(AnswerMessage):
    """The device's counters since its start. Answers AskStatistics."""

    TYPE = 0x8C
    frames: int = _on_wire(U32, "valid frames received from the host")
    rejected: int = _on_wire(U32, "blocks between two zeros that were not valid frames")
    overruns: int = _on_wire(U32, "bytes lost because the receive buffer was full")
    pings: int = _on_wire(U32, "pings made")
    lost_steps: int = _on_wire(I32, "sum of the microsteps that were missing at the zero mark")
    reset_cause: int = _on_wire(U8, "reset code: cause of the last start")
    stack_free: int = _on_wire(U16, "bytes of stack never used; 0: not measured")


@dataclass(frozen=True)
class LinkTested(AnswerMessage):
    """The requested bytes. Answers TestLink."""

    TYPE = 0x8D
    data: bytes = _on_wire(SAMPLES, "the pattern of the TestLink, repeated to the requested size")


@dataclass(frozen=True)
class WiringSettings(AnswerMessage):
    """The settings of the wiring. Answers ConfigureWiring."""

    TYPE = 0x8E
    inverted: int = _on_wire(U8, "sum of the wiring codes in force")


FROM_HOST = tuple(kind for _, kind in sorted(BY_TYPE.items()) if issubclass(kind, CommandMessage))
FROM_DEVICE = tuple(kind for _, kind in sorted(BY_TYPE.items()) if not issubclass(kind, CommandMessage))


def unpack_message(kind: int, payload: bytes) -> Message | None:
    """Return the message of a frame type and payload, or None for an unknown type.

    Raises MessageError if the payload does not match its type.
    """
    message = BY_TYPE.get(kind)
    return None if message is None else message.unpack(payload)


# units of message fields and SI units; temperatures are in °C


NO_TEMPERATURE = -32768  # 0.01 °C; means no thermometer
MOST_DEGREES = 2147  # the largest angle of a message, an i32 of µdeg
FULL_SCALE = 255  # of an 8-bit trace sample; that of a 16-bit sample is 257 times as large


def seconds_of(microseconds: int) -> float:
    """Return the time of a message in s."""
    return microseconds * 1e-6


def microseconds_of(seconds: float) -> int:
    """Return the time for a message, µs."""
    return round(seconds * 1e6)


def seconds_of_nanoseconds(nanoseconds: int) -> float:
    """Return the time of flight or trace time of a message in s."""
    return nanoseconds * 1e-9


def nanoseconds_of(seconds: float) -> int:
    """Return the time of flight or trace time for a message, ns."""
    return round(seconds * 1e9)


def radians_of(microdegrees: int) -> float:
    """Return the angle, angular speed or acceleration of a message in rad, rad/s or rad/s²."""
    return math.radians(microdegrees / 1e6)


def microdegrees_of(angle: float) -> int:
    """Return the angle, angular speed or acceleration for a message, µdeg, µdeg/s or µdeg/s²."""
    return round(math.degrees(angle) * 1e6)


def sound_speed_of(millimetres_per_second: int) -> float:
    """Return the speed of sound of a message in m/s."""
    return millimetres_per_second / 1000


def millimetres_per_second_of(sound_speed: float) -> int:
    """Return the speed of sound for a message, mm/s."""
    return round(sound_speed * 1000)


def degrees_c(centidegrees: int) -> float | None:
    """Return the temperature of a message in °C, or None if the device has no thermometer."""
    return None if centidegrees == NO_TEMPERATURE else centidegrees / 100


def centidegrees_of(temperature_c: float | None) -> int:
    """Return the temperature for a message, 0.01 °C; None means no thermometer."""
    return NO_TEMPERATURE if temperature_c is None else round(temperature_c * 100)
