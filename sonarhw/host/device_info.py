"""Identity, capabilities and settings of a device, in SI units."""

from dataclasses import dataclass

from sonarhw.wire.codes import Approach, Feature, TraceKind
from sonarhw.wire.messages import Capabilities, Info, Settings, TurntableSettings
from sonarhw.wire.units import degrees_c, radians_of, seconds_of, sound_speed_of


@dataclass(frozen=True)
class DeviceCapabilities:
    """The capabilities of a device."""

    features: Feature
    lowest_angle: float  # rad; limit of the cable
    highest_angle: float  # rad
    steps: int  # full motor steps per turn of the table; 0: unknown
    fastest: float  # highest speed, rad/s
    hardest: float  # highest acceleration, rad/s²; 0: unknown
    backlash: float  # rad
    longest_listen: float  # s
    shortest_blanking: float  # s
    shortest_rearm: float  # s from an echo until the board can detect the next echo
    most_pulses: int  # cycles; 0: unknown
    most_echoes: int
    ping_period: float  # s; shortest time from the start of one ping to the start of the next
    fastest_trace: float  # Hz; 0: no traces
    longest_trace: int  # samples
    fastest_baud: int  # 0: the line has no baud rate
    readings_kept: int  # number of newest readings that the device keeps for Resend
    turning: str  # what turns the table: step-dir, 28byj, servo or another word; empty if unknown


@dataclass(frozen=True)
class DeviceInfo:
    """The identity of a device."""

    firmware: str
    protocol: tuple[int, int]  # major, minor
    serial: str
    board: str  # name of the board profile, empty if unknown
    temperature_c: float | None  # air at the board; None: no thermometer
    trace_rate: float  # Hz; 0: no traces
    microsteps: int  # per turn of the table
    boot: int  # number of starts; 0: not counted
    capabilities: DeviceCapabilities | None  # None: the firmware is too old to report them


@dataclass(frozen=True)
class PingSettings:
    """Settings in force for the next pings."""

    listen: float  # s
    blanking: float  # s
    trace: bool
    speed_of_sound: float  # m/s
    carrier: bool = False  # traces contain the carrier, not its envelope
    pulses: int = 0  # cycles; 0: unknown
    echoes: int = 0  # most echoes of one ping
    rearm: float = 0.0  # s from an echo until the board can detect the next echo
    trace_rate: float = 0.0  # Hz
    trace_bits: int = 0


@dataclass(frozen=True)
class TurnSettings:
    """Settings of the turntable in force."""

    speed: float  # rad/s
    acceleration: float  # rad/s²; 0: unknown
    settling: float  # s
    approach: Approach


def device_info(info: Info, capabilities: Capabilities | None) -> DeviceInfo:
    """Return identity and capabilities in SI units."""
    return DeviceInfo(
        firmware=info.firmware,
        protocol=(info.major, info.minor),
        serial=info.serial,
        board=info.board,
        temperature_c=degrees_c(info.temperature),
        trace_rate=float(info.trace_rate),
        microsteps=info.microsteps,
        boot=info.boot,
        capabilities=None if capabilities is None else _capabilities(capabilities),
    )


def ping_settings(settings: Settings) -> PingSettings:
    """Return the ping settings in SI units."""
    return PingSettings(
        listen=seconds_of(settings.listen_us),
        blanking=seconds_of(settings.blanking_us),
        trace=bool(settings.trace),
        speed_of_sound=sound_speed_of(settings.speed_of_sound),
        carrier=settings.trace == TraceKind.CARRIER,
        pulses=settings.pulses,
        echoes=settings.echoes,
        rearm=seconds_of(settings.rearm_us),
        trace_rate=float(settings.trace_rate),
        trace_bits=settings.trace_bits,
    )


def turn_settings(settings: TurntableSettings) -> TurnSettings:
    """Return the turntable settings in SI units."""
    return TurnSettings(
        speed=radians_of(settings.speed),
        acceleration=radians_of(settings.acceleration),
        settling=seconds_of(settings.settle_us),
        approach=Approach(settings.approach),
    )


def _capabilities(message: Capabilities) -> DeviceCapabilities:
    return DeviceCapabilities(
        features=Feature(message.features),
        lowest_angle=radians_of(message.lowest_angle),
        highest_angle=radians_of(message.highest_angle),
        steps=message.steps,
        fastest=radians_of(message.fastest),
        hardest=radians_of(message.hardest),
        backlash=radians_of(message.backlash),
        longest_listen=seconds_of(message.longest_listen_us),
        shortest_blanking=seconds_of(message.shortest_blanking_us),
        shortest_rearm=seconds_of(message.shortest_rearm_us),
        most_pulses=message.most_pulses,
        most_echoes=message.most_echoes,
        ping_period=seconds_of(message.ping_period_us),
        fastest_trace=float(message.fastest_trace),
        longest_trace=message.longest_trace,
        fastest_baud=message.fastest_baud,
        readings_kept=message.readings_kept,
        turning=message.turning,
    )
