"""A scanner that is not there: the board's side of the protocol, with a turntable that takes time.

Takes bytes from a host and hears through an echo source; hands on the bytes a real board would send, no sooner than
its line could carry them. It is a `Device`: no thread, no port, no clock of its own.
"""

import math
import random
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

from sonarhw.device.device_protocol import Failing, ProtocolDevice, Refusing
from sonarhw.device.paced_line import Line
from sonarhw.device.turntable import SPEED, Turntable
from sonarhw.echo_source import EchoSource, Ping
from sonarhw.readings import ScanOrder
from sonarhw.wire.limits import KEPT_READINGS, MAX_ECHOES, PROTOCOL_MAJOR, PROTOCOL_MINOR
from sonarhw.wire.messages import (
    Capabilities,
    Configure,
    ConfigureTurntable,
    Feature,
    Info,
    Outcome,
    ReadingMessage,
    Refusal,
    Settings,
    StartScan,
    State,
    Statistics,
    TraceKind,
    Turn,
    TurntableSettings,
)
from sonarhw.wire.reading_messages import scan_order, trace_chunks
from sonarhw.wire.units import centidegrees_of, microdegrees_of, microseconds_of, nanoseconds_of, radians_of, seconds_of

PING_PERIOD = 0.100  # s from start to start; turning and settling within
MAX_LISTEN = 0.065  # s
REACH = 720_000_000  # µdeg either way; the transducer's cable winds no further
STEPS = 200
MICROSTEPS = 3200
_PATIENCE = 0.05  # s between two looks whether the echo source is ready


@dataclass(frozen=True)
class BoardIdentity:
    """What the board says of itself."""

    serial: str = "FAKE-0001"
    profile: str = ""  # board profile that describes it
    trace_rate: int = 50_000  # Hz
    firmware: str = "sonarhw-fake 0.1.0"
    major: int = PROTOCOL_MAJOR
    minor: int = PROTOCOL_MINOR
    boot: int = 1  # how often it has been switched on
    bauds: tuple[int, ...] = ()  # speeds of its line; empty: it has none of its own


class FakeBoard(ProtocolDevice):
    """The fake board. Its clock starts at 0 with the first time it is told; its noise is the echo source's affair."""

    def __init__(
        self,
        echoes: EchoSource,
        seed: int = 0,
        blanking: float = 0.00238,
        identity: BoardIdentity | None = None,
        ready: Callable[[], bool] = lambda: True,
    ) -> None:
        """`ready` tells whether the echo source answers at once by now; until then no ping is made."""
        me = identity or BoardIdentity(serial=f"FAKE-{seed:04d}")
        super().__init__(Line(bauds=me.bauds))
        self.line.minor = me.minor if me.major == PROTOCOL_MAJOR else PROTOCOL_MINOR
        self._echoes = echoes
        self._ready = ready
        self._identity = me
        self._turntable = Turntable(random.Random(seed).uniform(0, math.tau))
        self._lost_steps = 0  # microsteps
        self._next_ping = 0.0  # s; not before that, so that the echoes of the last one have died
        self._settings = Settings(0, microseconds_of(MAX_LISTEN), microseconds_of(blanking), 0, 343_200)

    @property
    def busy(self) -> bool:
        """Whether it homes, turns or scans; not while its pings wait for the echo source, which needs real time."""
        running = self._running
        return running is not None and (running.state is not State.SCANNING or self._ready())

    def temperature(self) -> int:
        """Air at the board, as messages carry it."""
        return centidegrees_of(self._echoes.temperature_c)

    def angle(self, now: float) -> int:
        """Where the turntable points, µdeg."""
        return microdegrees_of(self._turntable.angle(now))

    def info(self, sequence: int) -> Info:
        """Who it is, in answer to the Hello of that sequence number."""
        me = self._identity
        return Info(
            command=sequence,
            major=me.major,
            minor=me.minor,
            firmware=me.firmware,
            serial=me.serial,
            board=me.profile,
            temperature=self.temperature(),
            trace_rate=me.trace_rate,
            microsteps=MICROSTEPS,
            boot=me.boot,
            homed=int(self.homed),
        )

    def capabilities(self, sequence: int) -> Capabilities:
        """What it can."""
        rate = self._identity.trace_rate
        features = Feature.HOME_MARK | Feature.LOST_STEPS | Feature.BLANKING | Feature.REARM
        features |= Feature.ENVELOPE if rate else Feature(0)
        features |= Feature(0) if self._echoes.temperature_c is None else Feature.THERMOMETER
        return Capabilities(
            command=sequence,
            features=features,
            lowest_angle=-REACH,
            highest_angle=REACH,
            steps=STEPS,
            fastest=microdegrees_of(SPEED),
            hardest=0,
            backlash=0,
            longest_listen_us=microseconds_of(MAX_LISTEN),
            shortest_blanking_us=0,
            shortest_rearm_us=0,
            most_pulses=0,
            most_echoes=MAX_ECHOES,
            ping_period_us=microseconds_of(PING_PERIOD),
            fastest_trace=rate,
            longest_trace=round(MAX_LISTEN * rate),
            fastest_baud=max(self.line.bauds, default=0),
            readings_kept=KEPT_READINGS,
        )

    @property
    def homed(self) -> bool:
        """Whether it knows its zero."""
        return self._turntable.homed

    @property
    def boot(self) -> int:
        """How often it has been switched on."""
        return self._identity.boot

    def release(self, now: float) -> None:
        """Let go of the motor: a hand may turn the table, so its zero is no longer known."""
        self._turntable.halt(now)
        self._turntable.homed = False

    def configure(self, wish: Configure, sequence: int) -> Settings:
        """The settings from now on in force: no longer than it can listen, no traces it has not. Raises Refusing."""
        listen = min(wish.listen_us, microseconds_of(MAX_LISTEN))
        if listen <= wish.blanking_us:
            raise Refusing(
                Refusal.OUT_OF_RANGE,
                f"nothing is heard with {wish.blanking_us} us of blanking in {listen} us of listening",
            )
        rate = self._identity.trace_rate if wish.trace else 0
        self._settings = Settings(
            sequence,
            listen,
            wish.blanking_us,
            TraceKind.ENVELOPE if rate else TraceKind.NONE,
            wish.speed_of_sound,
            echoes=wish.echoes,
            rearm_us=wish.rearm_us,
            trace_rate=rate,
            trace_bits=8 if rate else 0,
        )
        return self._settings

    def configure_turntable(self, wish: ConfigureTurntable, sequence: int) -> TurntableSettings:
        """How it turns from now on: no faster than it can, at once as fast as that, and without play."""
        self._turntable.speed = min(radians_of(wish.speed) or SPEED, SPEED)
        self._turntable.settling = seconds_of(wish.settle_us)
        return TurntableSettings(sequence, microdegrees_of(self._turntable.speed), 0, wish.settle_us, wish.approach)

    def homing(self, now: float) -> Iterator[float]:
        """Seek the zero mark; it needs no ears, so it does not wait for them."""
        there = self._turntable.home(now)
        yield there
        if not self._turntable.found(there):
            raise Failing("the zero mark was not found; does something hold the turntable?")

    def turning(self, order: Turn, now: float) -> Iterator[float]:
        """Turn to an angle. Raises Refusing, at once."""
        self._check_angle(order.angle)
        return self._turn(radians_of(order.angle), now)

    def scanning(self, order: StartScan, now: float) -> tuple[int, Iterator[float]]:
        """How many readings will come, and the scan. Raises Refusing, at once."""
        if 0 in (order.step, order.headings, order.sweeps, order.pings):
            raise Refusing(Refusal.OUT_OF_RANGE, "step, headings, sweeps and pings are not 0")
        self._check_angle(order.start)
        self._check_angle(order.start + order.step * (order.headings - 1))
        scan = scan_order(order)
        last = order.first + order.count if order.count else scan.readings
        return scan.readings, self._scan(scan, range(order.first, last), now)

    def statistics(self, sequence: int) -> Statistics:
        """What it has counted."""
        return replace(super().statistics(sequence), lost_steps=self._lost_steps)

    def halt(self, now: float) -> None:
        """Stand still where it is."""
        self._turntable.halt(now)

    # what can happen to it

    def wedge(self, seconds: float) -> None:
        """The turntable moves no more for that long, whatever steps it is given."""
        self._turntable.wedge(self._now, self._now + seconds)

    def slip(self, microsteps: float) -> None:
        """The turntable misses that many microsteps of a way forwards."""
        self._turntable.slip(-microsteps * math.tau / MICROSTEPS)

    def _check_angle(self, microdegrees: int) -> None:
        if not self._turntable.homed:
            raise Refusing(Refusal.NOT_HOMED, "the turntable does not know its angle; send Home first")
        if abs(microdegrees) > REACH:
            reach = REACH / 1e6
            raise Refusing(
                Refusal.OUT_OF_RANGE,
                f"{microdegrees / 1e6:.9g} degrees; the cable winds from -{reach:g} to {reach:g} degrees",
            )

    def _turn(self, angle: float, now: float) -> Iterator[float]:
        there = self._turntable.turn(angle, now)
        yield there
        self._check_mark(there)

    def _check_mark(self, now: float) -> None:
        if self._turntable.mark_misplaced(now):
            lost = round(abs(self._turntable.error(now)) * MICROSTEPS / math.tau)
            self._lost_steps += lost
            self._turntable.homed = False
            text = f"the zero mark came {lost} microsteps out of its place; does something hold the turntable?"
            raise Failing(text, Outcome.LOST_STEPS)

    def _scan(self, scan: ScanOrder, numbers: range, now: float) -> Iterator[float]:
        while not self._ready():
            now += _PATIENCE
            yield now
        listen = seconds_of(self._settings.listen_us)
        for number in numbers:
            sweep, angle, ping = scan.ping_at(number)
            fire = max(self._turntable.turn(angle, now), self._next_ping)
            yield fire
            self._check_mark(fire)
            # counted from the ping itself, in the whole µs in which it is told, and across scans
            self._next_ping = round(fire, 6) + PING_PERIOD
            now = fire + listen
            yield now
            self._hear(number, Ping(angle, sweep, ping, listen, bool(self._settings.trace)), fire, now)

    def _hear(self, number: int, ping: Ping, fired: float, now: float) -> None:
        heard = self._echoes.receive(replace(ping, angle=ping.angle + self._turntable.error(fired)))
        blanking = seconds_of(self._settings.blanking_us)
        times = [time for time in heard.echo_times if blanking <= time <= ping.listen]
        echoes = rearmed(times, seconds_of(self._settings.rearm_us))[: self._settings.echoes]
        reading = ReadingMessage(
            number=number,
            sweep=ping.sweep,
            ping=ping.index,
            angle=microdegrees_of(ping.angle),
            fired_us=microseconds_of(fired),
            temperature=self.temperature(),
            echoes=tuple(nanoseconds_of(time) for time in echoes),
        )
        self.report(reading, trace_chunks(number, heard.trace) if heard.trace is not None and ping.trace else (), now)


def rearmed(times: Sequence[float], pause: float) -> list[float]:
    """The echoes that a board hears which is deaf for `pause` s after each, earliest first."""
    heard: list[float] = []
    for time in sorted(times):
        if not heard or time >= heard[-1] + pause:
            heard.append(time)
    return heard
