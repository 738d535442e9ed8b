"""A fake scanner: the device side of the protocol, with a simulated turntable and the echoes of an echo source.

It sends the bytes that a real board would send, at the speed of its line. It is a `Device`, without threads, ports or
clock.
"""

import math
import random
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from enum import IntFlag

from sonarhw.device.protocol import ActionError, Line, ProtocolDevice, RefusalError
from sonarhw.errors import InputError
from sonarhw.readings import FAKE_FIRMWARE, EchoSource, Ping, PingResult, ScanOrder, Trace
from sonarhw.wire import messages
from sonarhw.wire.limits import KEPT_READINGS, MAX_ECHOES, PROTOCOL_MAJOR, PROTOCOL_MINOR
from sonarhw.wire.readings_of_frames import scan_order, trace_chunks

# a turntable with a cam that shows on which side of the mark it is, also after a power failure; rad and s


SPEED = math.pi  # rad/s
HOMING_SPEED = 2 * SPEED
SETTLING = 0.020  # s after a move
MISSING = math.radians(5)  # past the position of a mark that has not come
_TOLERANCE = 1e-6  # rad; far less than a microstep


class Turntable:
    """A turntable that turns at constant speed without overshoot. It reports its angle only when it is homed.

    It counts its steps, but cannot detect whether the table follows them. `wedge` and `slip` make steps fail.
    """

    def __init__(self, initial_angle: float) -> None:
        """`initial_angle` is the true angle at power-on, rad. The turntable does not report it."""
        self.zero = messages.Zero.UNKNOWN
        self.speed = SPEED  # rad/s
        self.settling = SETTLING
        self.sign = 1.0  # -1: the table turns clockwise where it counts counter-clockwise
        self.initial = initial_angle
        self.origin = initial_angle  # counted angle where it started, or the last known zero, rad
        self._from = self._to = initial_angle
        self._start = self._arrival = 0.0
        self._slipped = 0.0  # true minus counted angle, rad
        self._stuck: tuple[float, float] | None = None  # angle at which it is blocked, and until when

    def angle(self, now: float) -> float:
        """Return the reported angle, rad from the zero mark; 0 before it is homed."""
        return 0.0 if self.zero is messages.Zero.UNKNOWN else self._position(now)

    def home(self, now: float, mark: float = 0.0) -> float:
        """Turn to the zero mark at that true angle, and return the time of arrival, s. Then call `confirm_home`."""
        self.zero = messages.Zero.UNKNOWN
        self._count_from(self.sign * (self.true_angle(now) - mark), now)
        return self._move(0.0, now, HOMING_SPEED) + SETTLING

    def confirm_home(self, now: float) -> bool:
        """Return whether the zero mark is reached. If so, the table is homed and its angle is 0."""
        self._release_if_due(now)
        if self._stuck is None:
            self.zero, self._slipped, self.origin = messages.Zero.MARK, 0.0, 0.0
        return self.zero is messages.Zero.MARK

    def set_zero(self, now: float) -> None:
        """Call the present angle 0, without moving."""
        self._count_from(0.0, now)
        self.zero, self.origin = messages.Zero.HAND, 0.0

    def turn(self, angle: float, now: float) -> float:
        """Turn to `angle`, and return the time when the table has settled there, s."""
        arrival = self._move(angle, now, self.speed)
        return arrival + self.settling if arrival > now else now

    def turn_to(self, sign: float, now: float) -> None:
        """Turn in this direction, 1 or -1, for a counter-clockwise command from now on."""
        true = self.true_angle(now)
        self.halt(now)
        self.sign = sign
        if self._stuck is None:
            self._slipped = true - sign * self._position(now)

    def jogged(self, angle: float, now: float) -> float:
        """Return the counted angle after turning by `angle`, rad; before a zero is known from an unknown zero."""
        return self._position(now) + angle

    def halt(self, now: float) -> None:
        """Stop at the present angle."""
        self._release_if_due(now)
        self._from = self._to = self._position(now)
        self._start = self._arrival = now

    def error(self, now: float) -> float:
        """Return true minus counted angle, rad; 0 if no step was missed."""
        self._release_if_due(now)
        return self._slipped if self._stuck is None else self._stuck[0] - self.sign * self._position(now)

    def true_angle(self, now: float) -> float:
        """Return the true angle, rad."""
        error = self.error(now)
        return self.sign * self._position(now) + error

    def mark_misplaced(self, now: float) -> bool:
        """Return whether the last move passed the mark, or should have passed it, at a wrong angle.

        A zero that was set by hand is not checked.
        """
        if self.zero is messages.Zero.HAND:
            return False
        error = self.error(now)
        counted = self._from, self._to
        true = self._from + error, self._to + error
        return abs(error) > _TOLERANCE and any(_passes_mark(min(move), max(move)) for move in (counted, true))

    def on_wrong_side(self, now: float, inverted: bool) -> bool:
        """Return whether the mark, perhaps inverted, shows another side of zero than the count within half a turn."""
        counted = self._position(now)
        beside = abs(counted) > MISSING
        return (
            self.zero is messages.Zero.MARK and beside and (marked(self.true_angle(now)) != inverted) != (counted > 0)
        )

    def slip(self, angle: float) -> None:
        """Miss steps: add `angle` (rad) to the difference of true and counted angle."""
        self._slipped += angle

    def wedge(self, now: float, until: float) -> None:
        """Block the table until that time. It counts the steps that it misses."""
        self._stuck = self.true_angle(now), until

    def _count_from(self, angle: float, now: float) -> None:
        """Count on from `angle`, rad, at the present position."""
        self._slipped = self.true_angle(now) - self.sign * angle
        self._from = self._to = angle
        self._start = self._arrival = now

    def _release_if_due(self, now: float) -> None:
        if self._stuck is not None and now >= self._stuck[1]:
            where, until = self._stuck
            self._stuck = None
            self._slipped = where - self.sign * self._position(until)

    def _position(self, now: float) -> float:
        if now >= self._arrival:
            return self._to
        return self._from + (self._to - self._from) * (now - self._start) / (self._arrival - self._start)

    def _move(self, angle: float, now: float, speed: float) -> float:
        self._release_if_due(now)
        self._from, self._to, self._start = self._position(now), angle, now
        self._arrival = now + abs(self._to - self._from) / speed
        return self._arrival


def marked(angle: float) -> bool:
    """Return the level of the mark at this true angle: high from 0 to half a turn."""
    return math.sin(angle + 1e-9) >= 0


def _passes_mark(low: float, high: float) -> bool:
    return math.floor((high + _TOLERANCE) / math.tau) >= math.ceil((low - _TOLERANCE) / math.tau)


# wiring faults, and the wires of a fake board that has them


CAM_ANGLE = math.radians(-20.0)  # edge of the cam
ONE_SWITCH_MOST = math.radians(185)  # limit of one Home by the mark alone
ONE_SWITCH_UNPROVEN = math.radians(60)  # on each side, until a Home has succeeded with the present wiring
HOTTEST = 12_500  # 0.01 °C; measured with a shorted thermistor
NOISE_ECHO = 0.003  # s; time of the false echo of every ping with NOISE_ON_INIT

_BEGIN = "begin within 45 degrees of 0"


class WiringFault(IntFlag):
    """A wrong or broken wire, as in firmware/emulator/emulator.h. Open inputs are high, because of their pull-ups."""

    CAM_INVERTED = 1
    CAM_OPEN = 2
    MOTOR_REVERSED = 4
    MARK_OPEN = 8
    MARK_INVERTED = 16
    MOTOR_OPEN = 32  # the table does not turn
    ECHO_LOW = 64  # ECHO is never high: a broken wire, or no pull-up
    ECHO_HIGH = 128  # ECHO is always high
    NOISE_ON_INIT = 256  # every ping has an echo at NOISE_ECHO
    THERMISTOR_OPEN = 512
    THERMISTOR_SHORTED = 1024
    BLNK_OPEN = 2048  # the board detects one echo of each ping
    INIT_OPEN = 4096  # the board transmits nothing
    # of the emulated board only
    STEPS_DOUBLED = 8192  # a wrong jumper of the driver: the table turns twice as far
    SUPPLY_WEAK = 16384  # every ping restarts the chip
    LINE_NOISY = 32768  # some bytes from the board are damaged


_FAKE = [fault for fault in WiringFault if fault < WiringFault.STEPS_DOUBLED]
FAULT_NAMES = {str(fault.name).lower().replace("_", "-"): fault for fault in _FAKE}


def read_wiring_faults(text: str) -> WiringFault:
    """Return the faults in a text such as `cam-inverted/motor-reversed`. Raises InputError for an unknown fault."""
    faults = WiringFault(0)
    for name in text.split("/"):
        if name not in FAULT_NAMES:
            raise InputError(f"unknown wire fault {name!r}; expected one of {', '.join(FAULT_NAMES)}, joined with /")
        faults |= FAULT_NAMES[name]
    return faults


class Wires:
    """The wires between a fake board and its turntable, and the settings with which its firmware corrects them.

    They outlast a restart of the board.
    """

    def __init__(self, faults: WiringFault = WiringFault(0)) -> None:
        self.faults = faults
        self.inverted = messages.Wiring(0)  # and ONE_SWITCH
        self.proven = False  # whether a Home has succeeded with these settings

    @property
    def one_switch(self) -> bool:
        """Whether the table homes by the mark alone."""
        return messages.Wiring.ONE_SWITCH in self.inverted

    @property
    def sign(self) -> float:
        """Direction in which the table turns for a counter-clockwise command: 1 or, clockwise, -1."""
        return -1.0 if self._wrong(WiringFault.MOTOR_REVERSED, messages.Wiring.MOTOR) else 1.0

    @property
    def mark_wrong(self) -> bool:
        """Whether the mark is low for the firmware where it should be high."""
        return self._wrong(WiringFault.MARK_INVERTED, messages.Wiring.MARK)

    @property
    def motor_connected(self) -> bool:
        """Whether the table turns."""
        return not self.faults & WiringFault.MOTOR_OPEN

    def temperature(self, celsius: float | None) -> int:
        """Return what the board measures of an air temperature, in the unit of messages; None: no thermometer."""
        if self.faults & WiringFault.THERMISTOR_SHORTED:
            return HOTTEST
        return messages.centidegrees_of(None if self.faults & WiringFault.THERMISTOR_OPEN else celsius)

    def arriving(self, result: PingResult) -> PingResult:
        """Return what arrives of a ping."""
        trace = result.trace
        if trace is not None and self.faults & WiringFault.INIT_OPEN:
            trace = Trace(0 * trace.samples, trace.rate, trace.start)
        return replace(result, echo_times=self._arriving_echoes(result.echo_times), trace=trace)

    def _arriving_echoes(self, times: tuple[float, ...]) -> tuple[float, ...]:
        if self.faults & (WiringFault.ECHO_LOW | WiringFault.ECHO_HIGH | WiringFault.INIT_OPEN):
            return ()
        arrived = (NOISE_ECHO, *times) if self.faults & WiringFault.NOISE_ON_INIT else times
        return arrived[:1] if self.faults & WiringFault.BLNK_OPEN else arrived

    def levels(self, turntable: Turntable, now: float) -> messages.Input:
        """Return the inputs whose pins are high, while the board does not listen."""
        angle = turntable.true_angle(now)
        levels = messages.Input(0)
        if marked(angle) != bool(self.faults & WiringFault.MARK_INVERTED) or self.faults & WiringFault.MARK_OPEN:
            levels |= messages.Input.MARK
        if (angle > CAM_ANGLE) != bool(self.faults & WiringFault.CAM_INVERTED) or self.faults & WiringFault.CAM_OPEN:
            levels |= messages.Input.CAM
        if self.faults & WiringFault.ECHO_HIGH:
            levels |= messages.Input.ECHO
        return levels

    def homing_failure(self) -> str | None:
        """Return why a Home fails with these wires; None if it finds a zero."""
        cam = self._wrong(WiringFault.CAM_INVERTED, messages.Wiring.CAM)
        if self.faults & WiringFault.MARK_OPEN:
            return "the zero mark never came; check its wire and the motor"
        if self.faults & WiringFault.CAM_OPEN or cam != (self.sign < 0):
            return "the cam never changed; check its wire and polarity, and the direction"
        # the mark is high at the edge of the cam, or the table passes the mark on its other side
        if self.mark_wrong or self.sign < 0:
            return "moved the wrong way; invert the mark, or cam and motor"
        return None

    def one_switch_zero(self, angle: float) -> tuple[float, str | None]:
        """Return the true angle of the zero that a Home by the mark alone finds from `angle`, and why it fails.

        A mark opposite to zero counts as a failure.
        """
        way = self.sign * (-1.0 if marked(angle) != self.mark_wrong else 1.0)
        edge = _next_edge(angle, way)
        most = ONE_SWITCH_MOST if self.proven else ONE_SWITCH_UNPROVEN
        if self.faults & WiringFault.MARK_OPEN or (
            abs(edge - angle) > most and (self.proven or abs(_next_edge(angle, -way) - angle) > most)
        ):
            return edge, f"the zero mark never came; check its wire and the motor; {_BEGIN}"
        if abs(edge - angle) > most or round(edge / math.pi) % 2:
            return edge, f"moved the wrong way; invert the mark or the motor; {_BEGIN}"
        return edge, None

    def _wrong(self, fault: WiringFault, setting: messages.Wiring) -> bool:
        return bool(self.faults & fault) != bool(self.inverted & setting)


def _next_edge(angle: float, way: float) -> float:
    """Return the angle of the next edge of the mark in this direction, 1 or -1."""
    halves = (angle + 1e-9) / math.pi
    return math.pi * (math.ceil(halves) if way > 0 else math.floor(halves))


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
        self.turntable = Turntable(random.Random(seed).uniform(0, math.tau))
        if not self._wires.motor_connected:
            self.turntable.wedge(0.0, math.inf)
        self.turntable.turn_to(self._wires.sign, 0.0)
        self._lost_steps = 0  # microsteps
        self._tries = 0  # Homes by the mark alone since the last one that succeeded
        self._listening = False
        self._next_ping = 0.0  # s; earliest time of the next ping, so that the echoes of the last one have decayed
        self._settings = messages.Settings(
            0, messages.microseconds_of(MAX_LISTEN), messages.microseconds_of(blanking), 0, 343_200
        )

    @property
    def busy(self) -> bool:
        """Whether it homes, turns or scans. False while a scan waits for the echo source, which needs real time."""
        running = self._running
        return running is not None and (running.state is not messages.State.SCANNING or self._ready())

    def temperature(self) -> int:
        """Return the air temperature at the board in the unit of messages."""
        return self._wires.temperature(self._echoes.temperature_c)

    def angle(self, now: float) -> int:
        """Return the angle of the turntable, µdeg."""
        return messages.microdegrees_of(self.turntable.angle(now))

    def info(self, sequence: int) -> messages.Info:
        """Return the answer to the Hello with that sequence number."""
        board = self._identity
        return messages.Info(
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

    def capabilities(self, sequence: int) -> messages.Capabilities:
        """Return the capabilities."""
        rate = self._identity.trace_rate
        features = (
            messages.Feature.HOME_MARK
            | messages.Feature.LOST_STEPS
            | messages.Feature.BLANKING
            | messages.Feature.REARM
        )
        features |= messages.Feature.ENVELOPE if rate else messages.Feature(0)
        features |= (
            messages.Feature(0) if self.temperature() == messages.NO_TEMPERATURE else messages.Feature.THERMOMETER
        )
        features |= messages.Feature.INPUTS | messages.Feature.WIRING if self.line.minor >= 2 else messages.Feature(0)
        features |= messages.Feature.ONE_SWITCH if self._wires.one_switch else messages.Feature(0)
        return messages.Capabilities(
            command=sequence,
            features=features,
            lowest_angle=-self._reach,
            highest_angle=self._reach,
            steps=STEPS,
            fastest=messages.microdegrees_of(SPEED),
            hardest=0,
            backlash=0,
            longest_listen_us=messages.microseconds_of(MAX_LISTEN),
            shortest_blanking_us=0,
            shortest_rearm_us=0,
            most_pulses=0,
            most_echoes=MAX_ECHOES,
            ping_period_us=messages.microseconds_of(PING_PERIOD),
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
    def zero(self) -> messages.Zero:
        """How the zero of the turntable is known."""
        return self.turntable.zero

    def set_zero(self, now: float) -> None:
        """Make the present angle the zero of the turntable."""
        self.turntable.set_zero(now)
        self._wires.proven &= not self._wires.one_switch

    def inputs(self, now: float) -> messages.Input:
        """Return the inputs whose pins are high."""
        return self._wires.levels(self.turntable, now)

    def configure_wiring(self, change: messages.Wiring, inverted: messages.Wiring, now: float) -> messages.Wiring:
        """Set the wiring, and return what is set. A change makes the zero unknown."""
        if change:
            self._wires.proven = False
            self._wires.inverted = self._wires.inverted & ~change | inverted
            self.turntable.zero = messages.Zero.UNKNOWN
            self.turntable.turn_to(self._wires.sign, now)
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
        self.turntable.halt(now)
        self.turntable.zero = messages.Zero.UNKNOWN

    def configure(self, request: messages.Configure, sequence: int) -> messages.Settings:
        """Apply ping settings within the limits of the board, and return those in force. Raises RefusalError."""
        listen = min(request.listen_us, messages.microseconds_of(MAX_LISTEN))
        if listen <= request.blanking_us:
            raise RefusalError(
                messages.Refusal.OUT_OF_RANGE,
                f"blanking_us is {request.blanking_us}; expected less than the listening time, {listen} us",
            )
        rate = self._identity.trace_rate if request.trace else 0
        self._settings = messages.Settings(
            sequence,
            listen,
            request.blanking_us,
            messages.TraceKind.ENVELOPE if rate else messages.TraceKind.NONE,
            request.speed_of_sound,
            echoes=request.echoes,
            rearm_us=request.rearm_us,
            trace_rate=rate,
            trace_bits=8 if rate else 0,
        )
        return self._settings

    def configure_turntable(self, request: messages.ConfigureTurntable, sequence: int) -> messages.TurntableSettings:
        """Apply turntable settings and return those in force. The table has no acceleration phase and no backlash."""
        self.turntable.speed = min(messages.radians_of(request.speed) or SPEED, SPEED)
        self.turntable.settling = messages.seconds_of(request.settle_us)
        return messages.TurntableSettings(
            sequence, messages.microdegrees_of(self.turntable.speed), 0, request.settle_us, request.approach
        )

    def homing(self, now: float) -> Iterator[float]:
        """Home the turntable, without waiting for the echo source."""
        if self._wires.one_switch:
            yield from self._home_by_mark(now)
            return
        if failure := self._wires.homing_failure():
            self.turntable.zero = messages.Zero.UNKNOWN
            yield now + _HOMING_FAILS_AFTER
            raise ActionError(failure)
        arrival = self.turntable.home(now)
        yield arrival
        if not self.turntable.confirm_home(arrival):
            raise ActionError("the zero mark was not found; check what blocks the turntable")

    def _home_by_mark(self, now: float) -> Iterator[float]:
        if self._tries == ONE_SWITCH_TRIES:
            yield now
            raise ActionError("homing may wind the cable no further; unwind it by hand and restart the board")
        self._tries += 1
        mark, failure = self._wires.one_switch_zero(self.turntable.true_angle(now))
        self._wires.proven = False
        if failure:
            self.turntable.zero = messages.Zero.UNKNOWN
            yield now + _HOMING_FAILS_AFTER
            raise ActionError(failure)
        arrival = self.turntable.home(now, mark)
        yield arrival
        if not self.turntable.confirm_home(arrival):
            raise ActionError("the zero mark was not found; check what blocks the turntable")
        self._tries, self._wires.proven = 0, True

    def turning(self, order: messages.Turn, now: float) -> Iterator[float]:
        """Turn to an angle. Raises RefusalError at once."""
        if order.relative > 1:
            raise RefusalError(messages.Refusal.OUT_OF_RANGE, f"relative is {order.relative}; expected 0 or 1")
        if order.relative:
            return self._turn(self._jogged(order.angle, now), now)
        self._check_angle(order.angle)
        return self._turn(messages.radians_of(order.angle), now)

    def scanning(self, order: messages.StartScan, now: float) -> tuple[int, Iterator[float]]:
        """Return the number of readings of the whole scan, and the scan. Raises RefusalError at once."""
        if 0 in (order.step, order.headings, order.sweeps, order.pings):
            raise RefusalError(messages.Refusal.OUT_OF_RANGE, "step, headings, sweeps and pings must not be 0")
        if order.in_place > 1 or (order.in_place and order.headings > 1):
            raise RefusalError(messages.Refusal.OUT_OF_RANGE, "in_place: expected 0, or 1 with one heading")
        if order.in_place:
            order = replace(order, start=self.angle(now))
        else:
            self._check_angle(order.start)
            self._check_angle(order.start + order.step * (order.headings - 1))
        scan = scan_order(order)
        last = order.first + order.count if order.count else scan.readings
        return scan.readings, self._scan(scan, range(order.first, last), now)

    def statistics(self, sequence: int) -> messages.Statistics:
        """Return the counters of the device."""
        return replace(super().statistics(sequence), lost_steps=self._lost_steps)

    def halt(self, now: float) -> None:
        """Stop the turntable where it is, and end a ping."""
        self._listening = False
        self.turntable.halt(now)

    # faults

    def wedge(self, seconds: float) -> None:
        """Block the turntable for some seconds. It counts the steps that it misses."""
        self.turntable.wedge(self._now, self._now + seconds)

    def slip(self, microsteps: float) -> None:
        """Let the turntable miss some microsteps of a forward move, below 0 of a backward move."""
        self.turntable.slip(-microsteps * math.tau / MICROSTEPS)

    def _jogged(self, microdegrees: int, now: float) -> float:
        angle = self.turntable.jogged(messages.radians_of(microdegrees), now)
        homed = self.turntable.zero is not messages.Zero.UNKNOWN
        unknown = ONE_SWITCH_LIMIT if self._wires.one_switch else HOMING_LIMIT
        limit, origin = (messages.radians_of(self._reach), 0.0) if homed else (unknown, self.turntable.origin)
        if abs(microdegrees) > MOST_JOG or abs(angle - origin) > limit:
            text = "a jog of at most 10 degrees, within the limits of the cable, is possible"
            raise RefusalError(messages.Refusal.OUT_OF_RANGE, f"{microdegrees / 1e6:.9g} degrees; {text}")
        return angle

    def _check_angle(self, microdegrees: int) -> None:
        if self.turntable.zero is messages.Zero.UNKNOWN:
            raise RefusalError(messages.Refusal.NOT_HOMED, "the zero of the turntable is unknown; send Home first")
        if abs(microdegrees) > self._reach:
            reach = self._reach / 1e6
            raise RefusalError(
                messages.Refusal.OUT_OF_RANGE,
                f"{microdegrees / 1e6:.9g} degrees; the cable winds from -{reach:g} to {reach:g} degrees",
            )

    def _turn(self, angle: float, now: float) -> Iterator[float]:
        arrival = self.turntable.turn(angle, now)
        yield arrival
        self._check_mark(arrival)

    def _check_mark(self, now: float) -> None:
        wrong_side = self._wires.one_switch and self.turntable.on_wrong_side(now, self._wires.mark_wrong)
        if self.turntable.mark_misplaced(now) or wrong_side:
            self._wires.proven &= not self._wires.one_switch
            lost = round(abs(self.turntable.error(now)) * MICROSTEPS / math.tau)
            self._lost_steps += lost
            self.turntable.zero = messages.Zero.UNKNOWN
            text = f"the zero mark is {lost} microsteps from its place; check what blocks the turntable"
            raise ActionError(text, messages.Outcome.LOST_STEPS)

    def _scan(self, scan: ScanOrder, numbers: range, now: float) -> Iterator[float]:
        while not self._ready():
            now += _POLL
            yield now
        listen = messages.seconds_of(self._settings.listen_us)
        for number in numbers:
            sweep, angle, ping = scan.ping_at(number)
            arrival = now if scan.in_place else self.turntable.turn(angle, now)
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
            result = self._wires.arriving(self._echoes.receive(replace(ping, angle=self.turntable.true_angle(fired))))
        except InputError as error:
            raise ActionError(str(error)) from error
        blanking = messages.seconds_of(self._settings.blanking_us)
        times = [time for time in result.echo_times if blanking <= time <= ping.listen]
        echoes = rearmed(times, messages.seconds_of(self._settings.rearm_us))[: self._settings.echoes]
        reading = messages.ReadingMessage(
            number=number,
            sweep=ping.sweep,
            ping=ping.index,
            angle=messages.microdegrees_of(ping.angle),
            fired_us=messages.microseconds_of(fired),
            temperature=self.temperature(),
            echoes=tuple(messages.nanoseconds_of(time) for time in echoes),
        )
        self.report(reading, trace_chunks(number, result.trace) if result.trace is not None and ping.trace else (), now)


def rearmed(times: Sequence[float], pause: float) -> list[float]:
    """Return the echoes that a board detects if it re-arms `pause` s after each echo, earliest first."""
    detected: list[float] = []
    for time in sorted(times):
        if not detected or time >= detected[-1] + pause:
            detected.append(time)
    return detected
