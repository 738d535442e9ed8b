"""A scanner to work with: open it, home it, scan, and take readings one by one.

    with Scanner.open("/dev/ttyUSB0") as scanner:
        scanner.home()
        for reading in scanner.scan(ScanOrder(start=0.0, step=math.radians(5), headings=72)):
            ...

One thread does nothing but read the link into a bounded queue; all else happens in the caller's thread.
"""

import math
import queue
import random
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass

from sonarhw.assembly import degrees_c, microdegrees_of
from sonarhw.driver import Command, Driver, raise_if_refused
from sonarhw.errors import DeviceError, Incompatible, InputError, LinkError, LinkLost, NoAnswer, SonarError
from sonarhw.link import Link
from sonarhw.link_statistics import LinkStatistics
from sonarhw.messages import (
    PROTOCOL_MAJOR,
    PROTOCOL_MINOR,
    Configure,
    Hello,
    Home,
    Info,
    Message,
    MessageError,
    Outcome,
    Settings,
    StartScan,
    Stop,
    Turn,
)
from sonarhw.readings import Reading, ScanOrder
from sonarhw.recorder import Recorder

_CHUNKS = 256  # of at most 4 KiB; then the reader waits, the system's buffer fills, and the device holds back
_STOP_WITHIN = 1.5  # s
_TICK = 0.05  # s; how soon a stop from another thread is noticed


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


@dataclass(frozen=True)
class PingSettings:
    """Settings in force for the pings to come."""

    listen: float  # s
    blanking: float  # s
    trace: bool
    speed_of_sound: float  # m/s


class Scanner:
    """A scanner that has answered. One thread uses it; only `stop` may be called from another."""

    def __init__(self, link: Link, driver: Driver) -> None:
        """Take an open link; `open` is the way in."""
        self._link = link
        self._driver = driver
        # driver and recorder live on the epoch, but never run backwards
        self._epoch = time.time() - time.monotonic()
        self._chunks: queue.Queue[tuple[float, bytes | LinkError]] = queue.Queue(maxsize=_CHUNKS)
        self._lost: LinkError | None = None
        self._closing = threading.Event()
        self._stop_wanted = threading.Event()
        self._scan: Command | None = None
        self._in_use = threading.Lock()
        self._thread = threading.Thread(target=self._read, name=f"read {link.url}", daemon=True)
        self._thread.start()

    @classmethod
    def open(cls, url: str, recorder: Recorder | None = None, patience: float = 5.0) -> "Scanner":
        """Open `url`, greet whoever answers within `patience` s, and stop whatever it was doing.

        Raises LinkError (LinkBusy, LinkLost), NoAnswer, or Incompatible where it speaks another protocol version.
        """
        # a random start keeps answers to an earlier conversation apart from those to this one
        driver = Driver(random.randrange(0x10000), recorder, where=url)
        scanner = cls(Link(url), driver)
        try:
            scanner._greet(patience)
        except BaseException:
            scanner.close()
            raise
        return scanner

    def __enter__(self) -> "Scanner":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    # who and how

    @property
    def url(self) -> str:
        """Where the scanner was opened."""
        return self._link.url

    @property
    def info(self) -> DeviceInfo:
        """Who answered the greeting."""
        info = self._driver.info
        if info is None:
            raise NoAnswer(f"{self.url}: has not said who it is")
        return DeviceInfo(
            firmware=info.firmware,
            protocol=(info.major, info.minor),
            serial=info.serial,
            board=info.board,
            temperature_c=degrees_c(info.temperature),
            trace_rate=float(info.trace_rate),
            microsteps=info.microsteps,
        )

    @property
    def settings(self) -> PingSettings | None:
        """Settings in force; None before `configure`."""
        settings = self._driver.assembler.settings
        return None if settings is None else _domain(settings)

    @property
    def statistics(self) -> LinkStatistics:
        """What has passed over the link until now."""
        return self._driver.statistics

    @property
    def scan_began(self) -> float:
        """When the last scan began on the clock of `Reading.time`, s; 0 before the first."""
        return self._scan.answered_at if self._scan else 0.0

    def record(self, recorder: Recorder) -> None:
        """Hand every frame and reading from now on to `recorder`, and first the greeting."""
        self._driver.record(recorder)

    # what it does

    def configure(
        self,
        listen: float = 0.0625,
        blanking: float = 0.00238,
        trace: bool = False,
        speed_of_sound: float = 343.2,
    ) -> PingSettings:
        """Set how long to listen and to be deaf (s), whether to send traces, and the speed of sound (m/s).

        Returns the settings in force: a board that cannot do what was asked says what it does. Raises CommandRefused,
        InputError where a value does not fit the protocol, NoAnswer, LinkLost.
        """
        wish = Configure(round(listen * 1e6), round(blanking * 1e6), int(trace), round(speed_of_sound * 1000))
        with self._using():
            answer = self._ask(wish).answer
        if not isinstance(answer, Settings):
            raise DeviceError(f"{self.url}: answered Configure with {type(answer).__name__}; expected Settings")
        return _domain(answer)

    def home(self) -> Outcome:
        """Find the zero of the turntable; returns how it ended: DONE, or STOPPED by `stop`.

        Raises DeviceError where it fails, CommandRefused, NoAnswer, LinkLost.
        """
        return self._act(Home())

    def turn(self, angle: float) -> Outcome:
        """Turn to `angle`, rad; otherwise as `home`."""
        return self._act(Turn(microdegrees_of(angle)))

    def scan(self, order: ScanOrder) -> Iterator[Reading]:
        """Readings as they are completed, each once; one sent again comes later than its number says.

        Stops the board when the iteration is given up. Raises what `home` does.
        """
        with self._using():
            if self.settings is None:
                self._ask(_DEFAULTS)
            self._scan = command = self._ask(_start_scan(order))
            try:
                while not self._driver.scan_complete:
                    self._pump()
                    yield from self._driver.readings()
                yield from self._driver.readings()
            finally:
                self._halt()
        self._raise_fault(command)

    def stop(self) -> None:
        """Stop what runs; callable from any thread. What runs there ends as STOPPED, a scan with the readings made.

        Raises NoAnswer or LinkLost where nothing ran and the device does not answer.
        """
        self._stop_wanted.set()
        if self._in_use.acquire(blocking=False):  # nobody is at work who would notice
            try:
                self._stop_wanted.clear()
                self._ask(Stop())
            finally:
                self._in_use.release()

    def close(self) -> None:
        """Stop what runs, end the reader thread and close the link. Never raises; twice does no harm."""
        if self._closing.is_set():
            return
        with suppress(SonarError):
            self._halt()
        self._closing.set()
        self._thread.join()
        self._link.close()

    # conversation

    def _greet(self, patience: float) -> None:
        with self._using():
            try:
                self._ask(Hello(PROTOCOL_MAJOR, PROTOCOL_MINOR), patience)
            except NoAnswer as error:
                raise NoAnswer(
                    f"{self.url}: no scanner answered within {patience:g} s; is it powered, and is this its port?"
                ) from error
        info = self._driver.info
        if isinstance(info, Info) and info.major != PROTOCOL_MAJOR:
            raise Incompatible(
                f"{self.url}: {info.firmware} speaks protocol {info.major}.{info.minor}, this program "
                f"{PROTOCOL_MAJOR}.{PROTOCOL_MINOR}; update the older of the two"
            )

    def _act(self, message: Message) -> Outcome:
        with self._using():
            command = self._ask(message)
            try:
                while command.finished is None:
                    self._pump()
            finally:
                self._halt()
        return self._raise_fault(command)

    def _ask(self, message: Message, patience: float = math.inf) -> Command:
        try:
            command = self._driver.command(message, self._now())
        except MessageError as error:
            raise InputError(f"{type(message).__name__} cannot be sent: {error}") from error
        until = time.monotonic() + patience
        try:
            while command.answer is None:
                self._pump()
                if time.monotonic() >= until and command.answer is None:
                    raise NoAnswer(f"{self.url}: no answer to {command.name} within {patience:g} s")
        except BaseException:
            if not isinstance(message, StartScan | Home | Turn):
                self._driver.forget(command)
            raise
        raise_if_refused(command, self.url)
        return command

    def _pump(self) -> None:
        """Send what is to be sent, take what has come; waits a moment where nothing has."""
        if self._closing.is_set():
            raise LinkLost(f"{self.url}: the scanner was closed")
        if self._stop_wanted.is_set() and self._driver.running:
            self._stop_wanted.clear()
            self._driver.command(Stop(), self._now())
        self._write()
        wait = min(_TICK, max(0.0, self._driver.next_event() - self._now()))
        try:
            arrived, data = self._chunks.get(timeout=wait) if wait else self._chunks.get_nowait()
        except queue.Empty:
            if self._lost:
                raise self._lost from None
            self._driver.advance(self._now())
        else:
            if isinstance(data, LinkError):
                self._lost = data
                raise data
            self._driver.receive(data, self._now(), arrived)
        self._write()

    def _write(self) -> None:
        data = self._driver.outgoing()
        if data:
            self._link.write(data)

    def _halt(self) -> None:
        """Stop a home, turn or scan that still runs and wait briefly for its end; readings still come in."""
        if self._closing.is_set() or self._lost or not self._driver.running:
            return
        until = time.monotonic() + _STOP_WITHIN
        try:
            stop = self._driver.command(Stop(), self._now())
            while (self._driver.running or stop.answer is None) and time.monotonic() < until:
                self._pump()
            self._driver.forget(stop)
        except SonarError:
            # what made us stop is the error to tell of; a link that is gone has stopped already
            return

    def _raise_fault(self, command: Command) -> Outcome:
        finished = command.finished
        if finished is None:
            return Outcome.STOPPED
        if finished.outcome == Outcome.FAULT:
            raise DeviceError(f"{self.url}: {command.name} failed: {finished.text or 'the board does not say why'}")
        return Outcome(finished.outcome)

    @contextmanager
    def _using(self) -> Iterator[None]:
        if not self._in_use.acquire(blocking=False):
            raise DeviceError(f"{self.url}: is at work already; stop it or let it finish")
        self._stop_wanted.clear()
        try:
            yield
        finally:
            self._in_use.release()

    def _now(self) -> float:
        return self._epoch + time.monotonic()

    # the reader's thread

    def _read(self) -> None:
        try:
            while not self._closing.is_set():
                data = self._link.read()
                if data:
                    self._hand_on(data)
        except LinkError as error:
            self._hand_on(error)

    def _hand_on(self, item: bytes | LinkError) -> None:
        arrived = self._now()
        while not self._closing.is_set():
            try:
                self._chunks.put((arrived, item), timeout=_TICK)
                return
            except queue.Full:
                continue


def _domain(settings: Settings) -> PingSettings:
    return PingSettings(
        listen=settings.listen_us * 1e-6,
        blanking=settings.blanking_us * 1e-6,
        trace=bool(settings.trace),
        speed_of_sound=settings.speed_of_sound / 1000,
    )


_DEFAULTS = Configure(listen_us=62_500, blanking_us=2_380, trace=0, speed_of_sound=343_200)


def _start_scan(order: ScanOrder) -> StartScan:
    return StartScan(
        start=microdegrees_of(order.start),
        step=microdegrees_of(order.step),
        headings=order.headings,
        sweeps=order.sweeps,
        pings=order.pings,
    )
