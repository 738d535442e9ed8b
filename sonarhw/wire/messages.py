"""The messages of the wire protocol: the one definition that code, document and tests share.

A message is a frozen dataclass whose fields describe their form on the wire; `pack` and `unpack` follow the fields in
order, little-endian, without padding. A field with a default came with version 1.1: an older sender leaves it out, an
older receiver skips it. `BY_TYPE`, `FROM_HOST` and `FROM_DEVICE` list every message that is defined here.
`firmware/generate.py` writes the C structures and the tables of firmware_protocol.md from this file.
"""

from dataclasses import MISSING, dataclass, field, fields
from enum import Enum, IntEnum, IntFlag
from typing import Any, ClassVar, TypeVar

from sonarhw.wire.fields import I16, I32, U8, U16, U32, U64, Numbers, Samples, Text, Wire
from sonarhw.wire.fields import MessageError as MessageError  # what packing and unpacking raise
from sonarhw.wire.limits import MAX_ECHOES, PROTOCOL_MINOR


def _on_wire(wire: Wire, meaning: str) -> Any:
    return field(metadata={"wire": wire, "meaning": meaning})


def _since_1_1(wire: Wire, meaning: str, default: int) -> Any:
    """A field that senders of 1.0 leave out; `default` is what is meant then."""
    return field(default=default, metadata={"wire": wire, "meaning": f"{meaning} · 1.1, else {default}"})


# the messages


BY_TYPE: "dict[int, type[Message]]" = {}


@dataclass(frozen=True)
class Message:
    """Base of all messages; one with a TYPE is on the wire, from the host below 0x80, from the device above."""

    TYPE: ClassVar[int]

    def __init_subclass__(cls) -> None:
        if "TYPE" in cls.__dict__:
            BY_TYPE[cls.TYPE] = cls

    def pack(self, minor: int = PROTOCOL_MINOR) -> bytes:
        """The payload as version 1.`minor` has it. Raises MessageError where a value does not fit its field."""
        spoken = (item for item in fields(self) if minor >= 1 or item.default is MISSING)
        return b"".join(item.metadata["wire"].pack(getattr(self, item.name)) for item in spoken)

    @classmethod
    def unpack(cls: type["M"], payload: bytes) -> "M":
        """The message in a payload; bytes behind the last field belong to a newer minor version and are ignored.

        A payload that ends before a field with a default comes from an older version. Raises MessageError where it
        ends anywhere else or a text is not UTF-8.
        """
        values, at = [], 0
        for item in fields(cls):
            if at == len(payload) and item.default is not MISSING:
                break
            value, at = item.metadata["wire"].unpack(payload, at)
            values.append(value)
        return cls(*values)


M = TypeVar("M", bound=Message)


class WhenBusy(Enum):
    """What happens to a command while the device homes, turns or scans."""

    ANSWERED = "answered"
    REFUSED = "BUSY"
    STOPS = "stops it"


@dataclass(frozen=True)
class CommandMessage(Message):
    """Base of the messages from the host; a device answers each with an `AnswerMessage`."""

    SINCE: ClassVar[int] = 0  # minor version
    WHEN_BUSY: ClassVar[WhenBusy] = WhenBusy.ANSWERED


@dataclass(frozen=True)
class ActionMessage(CommandMessage):
    """Base of the commands that take time: a Finished follows the answer."""

    WHEN_BUSY = WhenBusy.REFUSED


@dataclass(frozen=True)
class AnswerMessage(Message):
    """Base of the messages that answer a command."""

    command: int = _on_wire(U16, "sequence number of the command")


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
    LOST_STEPS = 3


class Refusal(IntEnum):
    """Why a command was refused."""

    UNKNOWN = 1  # message type not known
    MALFORMED = 2  # payload does not have the shape of its type
    OUT_OF_RANGE = 3  # a value this board cannot do
    BUSY = 4  # homing, turning or scanning: stop first
    NOT_HOMED = 5  # where is zero? home first
    NO_HELLO = 6  # say hello first


class TraceKind(IntEnum):
    """What a trace samples."""

    NONE = 0
    ENVELOPE = 1
    CARRIER = 2


class Approach(IntEnum):
    """From which side the turntable comes to an angle."""

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
    """What a device can beyond turning and timing one echo."""

    HOME_MARK = 1
    LOST_STEPS = 2
    THERMOMETER = 4
    BLANKING = 8
    REARM = 16
    PULSES = 32
    ENVELOPE = 64
    CARRIER = 128


# host to device


@dataclass(frozen=True)
class Hello(CommandMessage):
    """Opens the conversation; stops whatever the device was doing. Answer: Info."""

    TYPE = 0x01
    WHEN_BUSY = WhenBusy.STOPS
    major: int = _on_wire(U8, "protocol version the host speaks")
    minor: int = _on_wire(U8, "protocol version the host speaks")


@dataclass(frozen=True)
class Configure(CommandMessage):
    """Settings for the pings to come. Answer: Settings, with what is in force."""

    TYPE = 0x02
    WHEN_BUSY = WhenBusy.REFUSED
    listen_us: int = _on_wire(U32, "how long to listen after the start of transmission, µs")
    blanking_us: int = _on_wire(U32, "no echo counts before this time, µs")
    trace: int = _on_wire(U8, "trace code: what to send of every ping besides its echo times")
    speed_of_sound: int = _on_wire(U32, "mm/s; kept and returned, so that a log alone gives ranges")
    pulses: int = _since_1_1(U8, "cycles to transmit; 0: the board's own", 0)
    echoes: int = _since_1_1(U8, "how many echoes of a ping to report at most, 1 to 122", MAX_ECHOES)
    rearm_us: int = _since_1_1(U16, "from an echo until the board hears again, µs; 0: as soon as it can", 0)
    trace_rate: int = _since_1_1(U32, "samples per second, Hz; 0: the device's own", 0)
    trace_bits: int = _since_1_1(U8, "bits of a sample, 8 or 16; 0: the device's own", 0)


@dataclass(frozen=True)
class Home(ActionMessage):
    """Find the zero of the turntable. Answers: Accepted, then Finished."""

    TYPE = 0x03


@dataclass(frozen=True)
class Turn(ActionMessage):
    """Turn to an angle. Answers: Accepted, then Finished."""

    TYPE = 0x04
    angle: int = _on_wire(I32, "turntable angle, µdeg, counter-clockwise")


@dataclass(frozen=True)
class StartScan(ActionMessage):
    """Scan a sector. Answers: Started, readings and traces, then Finished."""

    TYPE = 0x05
    start: int = _on_wire(I32, "first turntable angle, µdeg")
    step: int = _on_wire(I32, "from one heading to the next, µdeg, not 0")
    headings: int = _on_wire(U16, "headings of one sweep, at least 1")
    sweeps: int = _on_wire(U16, "sweeps, at least 1; every second one runs backwards")
    pings: int = _on_wire(U8, "pings at each heading, at least 1")
    first: int = _since_1_1(U32, "number of the first reading to make; those before it are left out", 0)
    count: int = _since_1_1(U32, "how many readings to make; 0: all from the first on", 0)


@dataclass(frozen=True)
class Stop(CommandMessage):
    """Stop turning and pinging. Answers: Finished for what was stopped, then Accepted."""

    TYPE = 0x06
    WHEN_BUSY = WhenBusy.STOPS


@dataclass(frozen=True)
class Resend(CommandMessage):
    """Send readings again that did not arrive. Answer: Accepted, then those readings still kept."""

    TYPE = 0x07
    first: int = _on_wire(U32, "number of the first reading wanted")
    count: int = _on_wire(U8, "how many, 1 to 64")


@dataclass(frozen=True)
class AskCapabilities(CommandMessage):
    """Ask what the device can. Answer: Capabilities."""

    TYPE = 0x08
    SINCE = 1


@dataclass(frozen=True)
class ConfigureTurntable(CommandMessage):
    """How to turn from now on. Answer: TurntableSettings, with what is in force."""

    TYPE = 0x09
    SINCE = 1
    WHEN_BUSY = WhenBusy.REFUSED
    speed: int = _on_wire(U32, "µdeg/s; 0: the device's own")
    acceleration: int = _on_wire(U32, "µdeg/s²; 0: the device's own")
    settle_us: int = _on_wire(U32, "from standing still to the next ping, µs")
    approach: int = _on_wire(U8, "approach code: from which side to come to an angle, against backlash")


@dataclass(frozen=True)
class AskStatistics(CommandMessage):
    """Ask what the device has counted; the host's sign of life. Answer: Statistics."""

    TYPE = 0x0A
    SINCE = 1


@dataclass(frozen=True)
class SetBaud(CommandMessage):
    """Change the speed of the line. Answer: Accepted at the old speed, everything behind it at the new one."""

    TYPE = 0x0B
    SINCE = 1
    WHEN_BUSY = WhenBusy.REFUSED
    baud: int = _on_wire(U32, "bits per second")


@dataclass(frozen=True)
class TestLink(CommandMessage):
    """Ask for bytes back, to try the line. Answer: LinkTested."""

    __test__ = False  # pytest: no test of ours
    TYPE = 0x0C
    SINCE = 1
    size: int = _on_wire(U16, "how many bytes to send back, at most 480")
    data: bytes = _on_wire(Samples(), "1 to 64 bytes")


# device to host


@dataclass(frozen=True)
class Info(AnswerMessage):
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
    boot: int = _since_1_1(U32, "how often the device has started; 0: not counted", 0)
    homed: int = _since_1_1(U8, "1: the turntable knows its zero, 0: it does not", 0)


@dataclass(frozen=True)
class Accepted(AnswerMessage):
    """The command is understood and begun."""

    TYPE = 0x82


@dataclass(frozen=True)
class Refused(AnswerMessage):
    """The command is not carried out; nothing changed."""

    TYPE = 0x83
    code: int = _on_wire(U8, "refusal code")
    text: str = _on_wire(Text(), "the reason for a person to read")


@dataclass(frozen=True)
class Settings(AnswerMessage):
    """The settings in force. Answers Configure; a board that cannot do what was asked says here what it does."""

    TYPE = 0x84
    command: int = _on_wire(U16, "sequence number of the Configure answered")
    listen_us: int = _on_wire(U32, "as in Configure")
    blanking_us: int = _on_wire(U32, "as in Configure")
    trace: int = _on_wire(U8, "as in Configure")
    speed_of_sound: int = _on_wire(U32, "as in Configure")
    pulses: int = _since_1_1(U8, "as in Configure, but never 0 where the device knows", 0)
    echoes: int = _since_1_1(U8, "as in Configure", MAX_ECHOES)
    rearm_us: int = _since_1_1(U16, "as in Configure", 0)
    trace_rate: int = _since_1_1(U32, "as in Configure, but never 0 where traces are sent", 0)
    trace_bits: int = _since_1_1(U8, "as in Configure, but never 0 where traces are sent", 0)


@dataclass(frozen=True)
class Started(AnswerMessage):
    """The scan has begun; readings of the one before are no longer kept."""

    TYPE = 0x85
    command: int = _on_wire(U16, "sequence number of the StartScan answered")
    readings: int = _on_wire(U32, "how many readings will come")
    first: int = _since_1_1(U32, "number of the first one", 0)


@dataclass(frozen=True)
class Finished(Message):
    """A home, turn or scan has ended."""

    TYPE = 0x86
    command: int = _on_wire(U16, "sequence number of the command that ended")
    outcome: int = _on_wire(U8, "outcome code")
    readings: int = _on_wire(U32, "the number that the next reading would have had; 0 but for a scan")
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
    samples: bytes = _on_wire(Samples(), "at most 256 bytes a chunk; samples of 16 bits are little-endian")
    kind: int = _since_1_1(U8, "trace code: 1 the envelope, 2 the carrier, which rests at half of full scale", 1)
    bits: int = _since_1_1(U8, "bits of a sample, 8 or 16; all of them set is full scale", 8)


@dataclass(frozen=True)
class Heartbeat(Message):
    """Sent every 250 ms in every state, once greeted."""

    TYPE = 0x89
    state: int = _on_wire(U8, "state code")
    angle: int = _on_wire(I32, "turntable angle, µdeg")
    readings: int = _on_wire(U32, "the number that the next reading of this or the last scan would have")
    temperature: int = _on_wire(I16, "air at the board, 0.01 °C; −32768: no thermometer")
    boot: int = _since_1_1(U32, "as in Info: another number than there tells of a reset", 0)
    homed: int = _since_1_1(U8, "as in Info", 0)


@dataclass(frozen=True)
class Capabilities(AnswerMessage):
    """What the device can. Answers AskCapabilities."""

    TYPE = 0x8A
    features: int = _on_wire(U32, "sum of the feature codes that hold")
    lowest_angle: int = _on_wire(I32, "how far the cable lets it turn clockwise, µdeg")
    highest_angle: int = _on_wire(I32, "how far the cable lets it turn counter-clockwise, µdeg")
    steps: int = _on_wire(U16, "full steps of the motor in a whole turn of the table; 0: not known")
    fastest: int = _on_wire(U32, "highest speed, µdeg/s")
    hardest: int = _on_wire(U32, "highest acceleration, µdeg/s²; 0: not known")
    backlash: int = _on_wire(U32, "play of the gear, µdeg; 0: none or not known")
    longest_listen_us: int = _on_wire(U32, "how long it can listen, µs")
    shortest_blanking_us: int = _on_wire(U32, "µs")
    shortest_rearm_us: int = _on_wire(U16, "µs")
    most_pulses: int = _on_wire(U8, "cycles it can transmit; 0: not known")
    most_echoes: int = _on_wire(U8, "echoes it can report of one ping")
    ping_period_us: int = _on_wire(U32, "from the start of one ping to the next, at least, µs")
    fastest_trace: int = _on_wire(U32, "Hz; 0: no traces")
    longest_trace: int = _on_wire(U16, "samples")
    fastest_baud: int = _on_wire(U32, "highest speed of its line; 0: the line has none of its own (TCP, USB CDC)")
    readings_kept: int = _on_wire(U16, "how many readings it keeps to send again")


@dataclass(frozen=True)
class TurntableSettings(AnswerMessage):
    """How it turns. Answers ConfigureTurntable; where the device cannot do what was asked it says what it does."""

    TYPE = 0x8B
    speed: int = _on_wire(U32, "µdeg/s, never 0")
    acceleration: int = _on_wire(U32, "µdeg/s²; 0: not known")
    settle_us: int = _on_wire(U32, "as in ConfigureTurntable")
    approach: int = _on_wire(U8, "as in ConfigureTurntable")


@dataclass(frozen=True)
class Statistics(AnswerMessage):
    """What the device has counted since it started. Answers AskStatistics."""

    TYPE = 0x8C
    frames: int = _on_wire(U32, "sound frames that came from the host")
    rejected: int = _on_wire(U32, "blocks between two zeros that were no frame")
    overruns: int = _on_wire(U32, "bytes that came faster than they were taken")
    pings: int = _on_wire(U32, "pings made")
    lost_steps: int = _on_wire(I32, "microsteps found missing at the zero mark, all together")
    reset_cause: int = _on_wire(U8, "reset code: why it started last")
    stack_free: int = _on_wire(U16, "bytes of the stack never used; 0: not measured")


@dataclass(frozen=True)
class LinkTested(AnswerMessage):
    """Bytes back. Answers TestLink."""

    TYPE = 0x8D
    data: bytes = _on_wire(Samples(), "those of the TestLink over and over, as many as it asked for")


FROM_HOST = tuple(kind for _, kind in sorted(BY_TYPE.items()) if issubclass(kind, CommandMessage))
FROM_DEVICE = tuple(kind for _, kind in sorted(BY_TYPE.items()) if not issubclass(kind, CommandMessage))


def unpack_message(kind: int, payload: bytes) -> Message | None:
    """The message of a frame's type and payload; None for a type this version does not know.

    Raises MessageError where the payload does not have the shape of its type.
    """
    message = BY_TYPE.get(kind)
    return None if message is None else message.unpack(payload)
