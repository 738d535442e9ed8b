"""A fake scanner: the device side of the protocol, with a simulated turntable and the echoes of an echo source.

It sends the bytes that a real board would send, at the speed of its line. It is a `Device`, without threads, ports or
clock.
"""

import math
import random
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

from sonarhw.device.command_checks import RefusalError
from sonarhw.device.device_protocol import ActionError, ProtocolDevice
from sonarhw.device.paced_line import Line
from sonarhw.device.turntable import SPEED, Turntable
from sonarhw.device.wiring_faults import Wires
from sonarhw.echo_source import EchoSource, Ping
from sonarhw.errors import InputError
from sonarhw.readings import ScanOrder
from sonarhw.wire.codes import Feature, Input, Outcome, Refusal, State, TraceKind, Wiring, Zero
from sonarhw.wire.limits import KEPT_READINGS, MAX_ECHOES, PROTOCOL_MAJOR, PROTOCOL_MINOR
from sonarhw.wire.messages import (
    Capabilities,
    Configure,
    ConfigureTurntable,
    Info,
    ReadingMessage,
    Settings,
    StartScan,
    Statistics,
    Turn,
    TurntableSettings,
)
from sonarhw.wire.origin import FAKE_FIRMWARE
from sonarhw.wire.reading_messages import scan_order, trace_chunks
from sonarhw.wire.units import (
    NO_TEMPERATURE,
    microdegrees_of,
    microseconds_of,
    nanoseconds_of,
    radians_of,
    seconds_of,
)

PING_PERIOD = 0.100  # s; shortest time from the start of a ping to the start of the next
MAX_LISTEN = 0.065  # s
REACH = 720_000_000  # µdeg in each direction; limit of the transducer's cable
HOMING_LIMIT = math.radians(750)  # from the angle at the start, while the zero is unknown
ONE_SWITCH_REACH = 175_000_000  # µdeg in each direction; beyond half a turn, the mark would show the wrong side
ONE_SWITCH_LIMIT = math.radians(360)  # as HOMING_LIMIT
ONE_SWITCH_TRIES = 3  # Homes without success
MOST_JOG = 10_000_000  # µdeg
STEPS = 200
MICROSTEPS = 3200
_HOMING_FAILS_AFTER = 2.0  # s
_POLL = 0.05  # s between two checks whether the echo source is ready


@dataclass(frozen=True)
class BoardIdentity:
    """The identity that the board reports."""

    serial: str = "FAKE-0001"
    profile: str = ""  # name of its board profile
    turning: str = "step-dir"
    trace_rate: int = 50_000  # Hz
    firmware: str = f"{FAKE_FIRMWARE} 0.1.0"
    major: int = PROTOCOL_MAJOR
    minor: int = PROTOCOL_MINOR
    boot: int = 1  # number of starts
    bauds: tuple[int, ...] = ()  # baud rates of its line; empty: the line has no baud rate


class FakeBoard(ProtocolDevice):
    """The fake board. Its clock starts at 0 at the first `now` that it receives. The echo source adds the noise."""

    def __init__(
        self,
        echoes: EchoSource,
        seed: int = 0,
        blanking: float = 0.00238,
        identity: BoardIdentity | None = None,
        ready: Callable[[], bool] = lambda: True,
        wires: Wires | None = None,
    ) -> None:
        """`ready` returns True when the echo source can answer at once. Until then no ping is made.

        `wires` has its wiring faults, and settings that outlast a restart.
        """
        board = identity or BoardIdentity(serial=f"FAKE-{seed:04d}")
        super().__init__(Line(bauds=board.bauds))
        self.line.minor = board.minor if board.major == PROTOCOL_MAJOR else PROTOCOL_MINOR
        self._echoes = echoes
        self._ready = ready
        self._identity = board
        self._wires = wires or Wires()
        self._turntable = Turntable(random.Random(seed).uniform(0, math.tau))
        if not self._wires.motor_connected:
            self._turntable.wedge(0.0, math.inf)
        self._turntable.turn_to(self._wires.sign, 0.0)
        self._lost_steps = 0  # microsteps
        self._tries = 0  # Homes by the mark alone since the last one that succeeded
        self._listening = False
        self._next_ping = 0.0  # s; earliest time of the next ping, so that the echoes of the last one have decayed
        self._settings = Settings(0, microseconds_of(MAX_LISTEN), microseconds_of(blanking), 0, 343_200)

    @property
    def busy(self) -> bool:
        """Whether it homes, turns or scans. False while a scan waits for the echo source, which needs real time."""
        running = self._running
        return running is not None and (running.state is not State.SCANNING or self._ready())

    def temperature(self) -> int:
        """Return the air temperature at the board in the unit of messages."""
        return self._wires.temperature(self._echoes.temperature_c)

    def angle(self, now: float) -> int:
        """Return the angle of the turntable, µdeg."""
        return microdegrees_of(self._turntable.angle(now))

    def info(self, sequence: int) -> Info:
        """Return the answer to the Hello with that sequence number."""
        board = self._identity
        return Info(
            command=sequence,
            major=board.major,
            minor=board.minor,
            firmware=board.firmware,
            serial=board.serial,
            board=board.profile,
            temperature=self.temperature(),
            trace_rate=board.trace_rate,
            microsteps=MICROSTEPS,
            boot=board.boot,
            homed=self.zero,
        )

    def capabilities(self, sequence: int) -> Capabilities:
        """Return the capabilities."""
        rate = self._identity.trace_rate
        features = Feature.HOME_MARK | Feature.LOST_STEPS | Feature.BLANKING | Feature.REARM
        features |= Feature.ENVELOPE if rate else Feature(0)
        features |= Feature(0) if self.temperature() == NO_TEMPERATURE else Feature.THERMOMETER
        features |= Feature.INPUTS | Feature.WIRING if self.line.minor >= 2 else Feature(0)
        features |= Feature.ONE_SWITCH if self._wires.one_switch else Feature(0)
        return Capabilities(
            command=sequence,
            features=features,
            lowest_angle=-self._reach,
            highest_angle=self._reach,
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
            turning=self._identity.turning,
        )

    @property
    def _reach(self) -> int:
        """The limit of the cable in each direction, µdeg."""
        return ONE_SWITCH_REACH if self._wires.one_switch else REACH

    @property
    def zero(self) -> Zero:
        """How the zero of the turntable is known."""
        return self._turntable.zero

    def set_zero(self, now: float) -> None:
        """Make the present angle the zero of the turntable."""
        self._turntable.set_zero(now)
        self._wires.proven &= not self._wires.one_switch

    def inputs(self, now: float) -> Input:
        """Return the inputs whose pins are high."""
        return self._wires.levels(self._turntable, now)

    def configure_wiring(self, change: Wiring, inverted: Wiring, now: float) -> Wiring:
        """Set the wiring, and return what is set. A change makes the zero unknown."""
        if change:
            self._wires.proven = False
            self._wires.inverted = self._wires.inverted & ~change | inverted
            self._turntable.zero = Zero.UNKNOWN
            self._turntable.turn_to(self._wires.sign, now)
        return self._wires.inverted

    @property
    def listening(self) -> bool:
        """Whether it listens for echoes."""
        return self._listening and self._running is not None

    @property
    def boot(self) -> int:
        """Number of starts."""
        return self._identity.boot

    def release(self, now: float) -> None:
        """Release the motor. The turntable can then be moved from outside, so it is no longer homed."""
        self._turntable.halt(now)
        self._turntable.zero = Zero.UNKNOWN

    def configure(self, request: Configure, sequence: int) -> Settings:
        """Apply ping settings within the limits of the board, and return those in force. Raises RefusalError."""
        listen = min(request.listen_us, microseconds_of(MAX_LISTEN))
        if listen <= request.blanking_us:
            raise RefusalError(
                Refusal.OUT_OF_RANGE,
                f"blanking_us is {request.blanking_us}; expected less than the listening time, {listen} us",
            )
        rate = self._identity.trace_rate if request.trace else 0
        self._settings = Settings(
            sequence,
            listen,
            request.blanking_us,
            TraceKind.ENVELOPE if rate else TraceKind.NONE,
            request.speed_of_sound,
            echoes=request.echoes,
            rearm_us=request.rearm_us,
            trace_rate=rate,
            trace_bits=8 if rate else 0,
        )
        return self._settings

    def configure_turntable(self, request: ConfigureTurntable, sequence: int) -> TurntableSettings:
        """Apply turntable settings and return those in force. The table has no acceleration phase and no backlash."""
        self._turntable.speed = min(radians_of(request.speed) or SPEED, SPEED)
        self._turntable.settling = seconds_of(request.settle_us)
        return TurntableSettings(
            sequence, microdegrees_of(self._turntable.speed), 0, request.settle_us, request.approach
        )

    def homing(self, now: float) -> Iterator[float]:
        """Home the turntable, without waiting for the echo source."""
        if self._wires.one_switch:
            yield from self._home_by_mark(now)
            return
        if failure := self._wires.homing_failure():
            self._turntable.zero = Zero.UNKNOWN
            yield now + _HOMING_FAILS_AFTER
            raise ActionError(failure)
        arrival = self._turntable.home(now)
        yield arrival
        if not self._turntable.confirm_home(arrival):
            raise ActionError("the zero mark was not found; check what blocks the turntable")

    def _home_by_mark(self, now: float) -> Iterator[float]:
        if self._tries == ONE_SWITCH_TRIES:
            yield now
            raise ActionError("homing may wind the cable no further; unwind it by hand and restart the board")
        self._tries += 1
        mark, failure = self._wires.one_switch_zero(self._turntable.true_angle(now))
        self._wires.proven = False
        if failure:
            self._turntable.zero = Zero.UNKNOWN
            yield now + _HOMING_FAILS_AFTER
            raise ActionError(failure)
        arrival = self._turntable.home(now, mark)
        yield arrival
        if not self._turntable.confirm_home(arrival):
            raise ActionError("the zero mark was not found; check what blocks the turntable")
        self._tries, self._wires.proven = 0, True

    def turning(self, order: Turn, now: float) -> Iterator[float]:
        """Turn to an angle. Raises RefusalError at once."""
        if order.relative > 1:
            raise RefusalError(Refusal.OUT_OF_RANGE, f"relative is {order.relative}; expected 0 or 1")
        if order.relative:
            return self._turn(self._jogged(order.angle, now), now)
        self._check_angle(order.angle)
        return self._turn(radians_of(order.angle), now)

    def scanning(self, order: StartScan, now: float) -> tuple[int, Iterator[float]]:
        """Return the number of readings of the whole scan, and the scan. Raises RefusalError at once."""
        if 0 in (order.step, order.headings, order.sweeps, order.pings):
            raise RefusalError(Refusal.OUT_OF_RANGE, "step, headings, sweeps and pings must not be 0")
        if order.in_place > 1 or (order.in_place and order.headings > 1):
            raise RefusalError(Refusal.OUT_OF_RANGE, "in_place: expected 0, or 1 with one heading")
        if order.in_place:
            order = replace(order, start=self.angle(now))
        else:
            self._check_angle(order.start)
            self._check_angle(order.start + order.step * (order.headings - 1))
        scan = scan_order(order)
        last = order.first + order.count if order.count else scan.readings
        return scan.readings, self._scan(scan, range(order.first, last), now)

    def statistics(self, sequence: int) -> Statistics:
        """Return the counters of the device."""
        return replace(super().statistics(sequence), lost_steps=self._lost_steps)

    def halt(self, now: float) -> None:
        """Stop the turntable where it is, and end a ping."""
        self._listening = False
        self._turntable.halt(now)

    # faults

    def wedge(self, seconds: float) -> None:
        """Block the turntable for some seconds. It counts the steps that it misses."""
        self._turntable.wedge(self._now, self._now + seconds)

    def slip(self, microsteps: float) -> None:
        """Let the turntable miss some microsteps of a forward move, below 0 of a backward move."""
        self._turntable.slip(-microsteps * math.tau / MICROSTEPS)

    def _jogged(self, microdegrees: int, now: float) -> float:
        angle = self._turntable.jogged(radians_of(microdegrees), now)
        homed = self._turntable.zero is not Zero.UNKNOWN
        unknown = ONE_SWITCH_LIMIT if self._wires.one_switch else HOMING_LIMIT
        limit, origin = (radians_of(self._reach), 0.0) if homed else (unknown, self._turntable.origin)
        if abs(microdegrees) > MOST_JOG or abs(angle - origin) > limit:
            text = "a jog of at most 10 degrees, within the limits of the cable, is possible"
            raise RefusalError(Refusal.OUT_OF_RANGE, f"{microdegrees / 1e6:.9g} degrees; {text}")
        return angle

    def _check_angle(self, microdegrees: int) -> None:
        if self._turntable.zero is Zero.UNKNOWN:
            raise RefusalError(Refusal.NOT_HOMED, "the zero of the turntable is unknown; send Home first")
        if abs(microdegrees) > self._reach:
            reach = self._reach / 1e6
            raise RefusalError(
                Refusal.OUT_OF_RANGE,
                f"{microdegrees / 1e6:.9g} degrees; the cable winds from -{reach:g} to {reach:g} degrees",
            )

    def _turn(self, angle: float, now: float) -> Iterator[float]:
        arrival = self._turntable.turn(angle, now)
        yield arrival
        self._check_mark(arrival)

    def _check_mark(self, now: float) -> None:
        wrong_side = self._wires.one_switch and self._turntable.on_wrong_side(now, self._wires.mark_wrong)
        if self._turntable.mark_misplaced(now) or wrong_side:
            self._wires.proven &= not self._wires.one_switch
            lost = round(abs(self._turntable.error(now)) * MICROSTEPS / math.tau)
            self._lost_steps += lost
            self._turntable.zero = Zero.UNKNOWN
            text = f"the zero mark is {lost} microsteps from its place; check what blocks the turntable"
            raise ActionError(text, Outcome.LOST_STEPS)

    def _scan(self, scan: ScanOrder, numbers: range, now: float) -> Iterator[float]:
        while not self._ready():
            now += _POLL
            yield now
        listen = seconds_of(self._settings.listen_us)
        for number in numbers:
            sweep, angle, ping = scan.ping_at(number)
            arrival = now if scan.in_place else self._turntable.turn(angle, now)
            fire = max(arrival, self._next_ping)
            yield fire
            if not scan.in_place:
                self._check_mark(fire)
            # from the reported start of this ping, in whole µs; also applies to the first ping of the next scan
            self._next_ping = round(fire, 6) + PING_PERIOD
            now = fire + listen
            self._listening = True
            yield now
            self._listening = False
            self._report_ping(number, Ping(angle, sweep, ping, listen, bool(self._settings.trace)), fire, now)

    def _report_ping(self, number: int, ping: Ping, fired: float, now: float) -> None:
        try:
            result = self._wires.arriving(self._echoes.receive(replace(ping, angle=self._turntable.true_angle(fired))))
        except InputError as error:
            raise ActionError(str(error)) from error
        blanking = seconds_of(self._settings.blanking_us)
        times = [time for time in result.echo_times if blanking <= time <= ping.listen]
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
        self.report(reading, trace_chunks(number, result.trace) if result.trace is not None and ping.trace else (), now)


def rearmed(times: Sequence[float], pause: float) -> list[float]:
    """Return the echoes that a board detects if it re-arms `pause` s after each echo, earliest first."""
    detected: list[float] = []
    for time in sorted(times):
        if not detected or time >= detected[-1] + pause:
            detected.append(time)
    return detected
