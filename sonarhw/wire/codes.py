"""The codes in messages of the wire protocol, and what each means. `messages` defines the fields that hold them."""

from enum import IntEnum, IntFlag


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
