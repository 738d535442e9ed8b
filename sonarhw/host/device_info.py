"""What a device says of itself and what it is set to, in SI units.

Takes the messages; hands on frozen values for whoever uses a `Scanner`.
"""

from dataclasses import dataclass

from sonarhw.wire.messages import Approach, Capabilities, Feature, Info, Settings, TraceKind, TurntableSettings
from sonarhw.wire.units import degrees_c, radians_of, seconds_of, sound_speed_of


@dataclass(frozen=True)
class DeviceCapabilities:
    """What a device can."""

    features: Feature
    lowest_angle: float  # rad; the cable lets it turn no further
    highest_angle: float  # rad
    steps: int  # full steps of the motor in a whole turn; 0: not known
    fastest: float  # rad/s
    hardest: float  # rad/s²; 0: not known
    backlash: float  # rad
    longest_listen: float  # s
    shortest_blanking: float  # s
    shortest_rearm: float  # s from an echo until it hears again
    most_pulses: int  # cycles; 0: not known
    most_echoes: int
    ping_period: float  # s
    fastest_trace: float  # Hz; 0: no traces
    longest_trace: int  # samples
    fastest_baud: int  # 0: its line has no speed of its own
    readings_kept: int  # to be sent again


@dataclass(frozen=True)
class DeviceInfo:
    """Who answers."""

    firmware: str
    protocol: tuple[int, int]  # major, minor
    serial: str
    board: str  # board profile that describes it, empty if unknown
    temperature_c: float | None  # air at the board; None: no thermometer
    trace_rate: float  # Hz; 0: no traces
    microsteps: int  # in a whole turn
    boot: int  # how often it has started; 0: not counted
    capabilities: DeviceCapabilities | None  # None: of an older firmware


@dataclass(frozen=True)
class PingSettings:
    """Settings in force for the pings to come."""

    listen: float  # s
    blanking: float  # s
    trace: bool
    speed_of_sound: float  # m/s
    carrier: bool = False  # traces are of the signal itself
    pulses: int = 0  # cycles; 0: not known
    echoes: int = 0  # at most, of one ping
    rearm: float = 0.0  # s from an echo until it hears again
    trace_rate: float = 0.0  # Hz
    trace_bits: int = 0


@dataclass(frozen=True)
class TurnSettings:
    """How the turntable turns."""

    speed: float  # rad/s
    acceleration: float  # rad/s²; 0: not known
    settling: float  # s
    approach: Approach


def device_info(info: Info, capabilities: Capabilities | None) -> DeviceInfo:
    """Who answers, and what it can."""
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
    """Settings in SI units."""
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
    """How it turns, in SI units."""
    return TurnSettings(
        speed=radians_of(settings.speed),
        acceleration=radians_of(settings.acceleration),
        settling=seconds_of(settings.settle_us),
        approach=Approach(settings.approach),
    )


def _capabilities(said: Capabilities) -> DeviceCapabilities:
    return DeviceCapabilities(
        features=Feature(said.features),
        lowest_angle=radians_of(said.lowest_angle),
        highest_angle=radians_of(said.highest_angle),
        steps=said.steps,
        fastest=radians_of(said.fastest),
        hardest=radians_of(said.hardest),
        backlash=radians_of(said.backlash),
        longest_listen=seconds_of(said.longest_listen_us),
        shortest_blanking=seconds_of(said.shortest_blanking_us),
        shortest_rearm=seconds_of(said.shortest_rearm_us),
        most_pulses=said.most_pulses,
        most_echoes=said.most_echoes,
        ping_period=seconds_of(said.ping_period_us),
        fastest_trace=float(said.fastest_trace),
        longest_trace=said.longest_trace,
        fastest_baud=said.fastest_baud,
        readings_kept=said.readings_kept,
    )
