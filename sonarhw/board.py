"""A scanner that is not there: the board's side of the protocol, with a turntable that takes time.

Takes bytes from a host and hears through an echo source; hands on the bytes a real board would send, no sooner than
its line could carry them. It is a `Device`: no thread, no port, no clock of its own.
"""

import math
import random
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

from sonarhw.assembly import microdegrees_of, radians_of
from sonarhw.conversation import Conversation, Failing, Refusing
from sonarhw.echo_source import EchoSource, Ping
from sonarhw.line import Line
from sonarhw.messages import (
    MAX_ECHOES,
    PROTOCOL_MAJOR,
    PROTOCOL_MINOR,
    Configure,
    Info,
    ReadingMessage,
    Refusal,
    Settings,
    StartScan,
    State,
    Turn,
)
from sonarhw.reading_messages import centidegrees_of, trace_chunks
from sonarhw.readings import ScanOrder
from sonarhw.turntable import Turntable

PING_PERIOD = 0.100  # s from start to start; turning and settling within
MAX_LISTEN = 0.065  # s
REACH = 720_000_000  # µdeg either way; the transducer's cable winds no further
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


class Board(Conversation):
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
        super().__init__(Line())
        self._echoes = echoes
        self._ready = ready
        self._identity = identity or BoardIdentity(serial=f"FAKE-{seed:04d}")
        self._turntable = Turntable(random.Random(seed).uniform(0, math.tau))
        self._next_ping = 0.0  # s; not before that, so that the echoes of the last one have died
        self._settings = Settings(0, round(MAX_LISTEN * 1e6), round(blanking * 1e6), 0, 343_200)

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
        )

    def configure(self, wish: Configure, sequence: int) -> Settings:
        """The settings from now on in force: no longer than it can listen, no traces it has not. Raises Refusing."""
        listen = min(wish.listen_us, round(MAX_LISTEN * 1e6))
        if listen <= wish.blanking_us:
            raise Refusing(
                Refusal.OUT_OF_RANGE,
                f"nothing is heard with {wish.blanking_us} us of blanking in {listen} us of listening",
            )
        trace = wish.trace if self._identity.trace_rate else 0
        self._settings = Settings(sequence, listen, wish.blanking_us, trace, wish.speed_of_sound)
        return self._settings

    def homing(self, now: float) -> Iterator[float]:
        """Seek the zero mark; it needs no ears, so it does not wait for them."""
        there = self._turntable.home(now)
        yield there
        if not self._turntable.found(there):
            raise Failing("the zero mark was not found; does something hold the turntable?")

    def turning(self, order: Turn, now: float) -> Iterator[float]:
        """Turn to an angle. Raises Refusing, at once."""
        self._check_angle(order.angle)
        return iter([self._turntable.turn(radians_of(order.angle), now)])

    def scanning(self, order: StartScan, now: float) -> tuple[int, Iterator[float]]:
        """How many readings will come, and the scan. Raises Refusing, at once."""
        if 0 in (order.step, order.headings, order.sweeps, order.pings):
            raise Refusing(Refusal.OUT_OF_RANGE, "step, headings, sweeps and pings are not 0")
        self._check_angle(order.start)
        self._check_angle(order.start + order.step * (order.headings - 1))
        scan = ScanOrder(radians_of(order.start), radians_of(order.step), order.headings, order.sweeps, order.pings)
        return scan.readings, self._scan(scan, now)

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

    def _scan(self, scan: ScanOrder, now: float) -> Iterator[float]:
        while not self._ready():
            now += _PATIENCE
            yield now
        listen = self._settings.listen_us * 1e-6
        for number in range(scan.readings):
            sweep, angle, ping = scan.ping_at(number)
            fire = max(self._turntable.turn(angle, now), self._next_ping)
            yield fire
            # counted from the ping itself, in the whole µs in which it is told, and across scans
            self._next_ping = round(fire, 6) + PING_PERIOD
            now = fire + listen
            yield now
            self._hear(number, Ping(angle, sweep, ping, listen, bool(self._settings.trace)), fire, now)

    def _hear(self, number: int, ping: Ping, fired: float, now: float) -> None:
        heard = self._echoes.hear(replace(ping, angle=ping.angle + self._turntable.error(fired)))
        blanking = self._settings.blanking_us * 1e-6
        echoes = sorted(time for time in heard.echo_times if blanking <= time <= ping.listen)[:MAX_ECHOES]
        reading = ReadingMessage(
            number=number,
            sweep=ping.sweep,
            ping=ping.index,
            angle=microdegrees_of(ping.angle),
            fired_us=round(fired * 1e6),
            temperature=self.temperature(),
            echoes=tuple(round(time * 1e9) for time in echoes),
        )
        self.report(reading, trace_chunks(number, heard.trace) if heard.trace is not None and ping.trace else (), now)
