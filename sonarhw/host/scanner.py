"""A scanner to work with: open it, scan, and take readings one by one.

    from sonarhw import Scanner, sector

    with Scanner.open("/dev/ttyUSB0") as scanner:
        for reading in scanner.scan(sector(0, 360, 5)):
            print(reading.angle, reading.range)

One thread holds the conversation: it reads, answers, shows the device that somebody is there, and goes on after the
cable was out. Readings wait for the caller in a queue of MOST_WAITING. When that is full nothing more is read: a TCP
line holds the device back; on a serial one bytes are lost, and what was in them is asked for or measured again. So a
slow caller slows the scan and loses no reading.
"""

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext, suppress
from typing import Any, TypeVar

from sonarhw.errors import DeviceError, InputError, LinkError, LinkLost, NoAnswer, SonarError
from sonarhw.host.actions import asking, configuring, configuring_turntable, homing, scanning, turning
from sonarhw.host.device_info import DeviceInfo, PingSettings, TurnSettings, device_info, ping_settings, turn_settings
from sonarhw.host.job import Job
from sonarhw.host.recorder import Recorder
from sonarhw.host.session import PATIENCE, RECONNECT, Connection, Session
from sonarhw.link.link_statistics import LinkStatistics
from sonarhw.link.ports import Whereabouts
from sonarhw.link.serial_link import MOST, Link
from sonarhw.readings import Reading, ScanOrder, sector
from sonarhw.wire.limits import MAX_ECHOES
from sonarhw.wire.messages import (
    Approach,
    AskStatistics,
    Configure,
    ConfigureTurntable,
    Outcome,
    Settings,
    Statistics,
    Stop,
    TraceKind,
    Turn,
    TurntableSettings,
)
from sonarhw.wire.reading_messages import start_scan
from sonarhw.wire.units import microdegrees_of, microseconds_of, millimetres_per_second_of

MOST_WAITING = 1024  # readings; over a minute of the fastest board
_STOP_WITHIN = 1.5  # s
T = TypeVar("T")
_TICK = 0.05  # s; how soon a closing is noticed


class Scanner:
    """A scanner that has answered. One thread uses it; another may call `stop` and look at how it stands."""

    def __init__(self, url: str, session: Session, find: Callable[[], str] | None = None) -> None:
        """Begin to connect; `open` is the way in."""
        self.url = url
        self._find = find or Whereabouts(url)
        self._session = session
        # driver and recorder live on the epoch, but never run backwards
        self._epoch = time.time() - time.monotonic()
        self._changed = threading.Condition()  # guards the session; told of whenever it has gone on
        self._closing = threading.Event()
        self._stop_wanted = False  # no Event: a signal handler may come while its lock is held
        self._defect: BaseException | None = None  # what ended the thread
        self._scan: Job | None = None
        self._link: Link | None = None
        self._in_use = threading.Lock()
        self._sequence_of: int | None = None  # the thread that `_in_use` is held for
        self._acting = False
        session.connect(self._now())
        self._thread = threading.Thread(target=self._converse, name=f"converse {url}", daemon=True)
        self._thread.start()

    @classmethod
    def open(
        cls,
        url: str,
        recorder: Recorder | None = None,
        patience: float = PATIENCE,
        reconnect: float = RECONNECT,
        find: Callable[[], str] | None = None,
    ) -> "Scanner":
        """Open `url`, greet whoever answers within `patience` s, and stop whatever it was doing.

        A device that is lost later may come back within `reconnect` s, and what was going on goes on. `find` tells what
        to open each time; by default a USB device is found by whatever name its port has then. Raises InputError for a
        URL that leads nowhere, LinkError (LinkBusy, LinkForbidden, LinkLost), NoAnswer, or Incompatible where it speaks
        another protocol version.
        """
        scanner = cls(url, Session(url, patience, reconnect), find)
        try:
            with scanner._changed:
                while scanner.state is not Connection.READY:
                    scanner._wait()
                    if scanner._session.failed:
                        raise scanner._session.failed
            if recorder:
                scanner.record(recorder)
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
    def state(self) -> Connection:
        """How it stands with the device, from disconnected to streaming to lost."""
        with self._changed:
            return self._session.state

    @property
    def loss(self) -> SonarError | None:
        """Why the device is away, while it is waited for; None while it is there."""
        with self._changed:
            return self._session.loss

    @property
    def info(self) -> DeviceInfo:
        """Who answered the greeting, and what it can."""
        info = self._session.device.info
        if info is None:
            raise NoAnswer(f"{self.url}: has not said who it is")
        return device_info(info, self._session.device.capabilities)

    @property
    def settings(self) -> PingSettings | None:
        """Settings in force; None before `configure`."""
        settings = self._session.device.settings
        return None if settings is None else ping_settings(settings)

    @property
    def baud(self) -> int | None:
        """Speed of the line; None where it has none of its own."""
        return self._session.device.baud if self._session.bauds else None

    @property
    def statistics(self) -> LinkStatistics:
        """What has passed over the link since it was opened."""
        with self._changed:
            return self._session.statistics

    @property
    def clock_drift(self) -> float:
        """How much faster the host's clock runs than the device's: 0.001 is a millisecond in a second."""
        return self._session.clock.drift

    @property
    def scan_began(self) -> float:
        """When the last scan began on the clock of `Reading.time`, s; 0 before the first."""
        return self._scan.began or 0.0 if self._scan else 0.0

    @property
    def unverified_angles(self) -> str | None:
        """Which angles of the last scan could not be checked for lost steps, as a clause; None: all were, or none can.

        A device that was reset or left alone in mid-scan finds its zero anew, and where it stood before is not known.
        """
        return self._scan.unverified_angles if self._scan else None

    def record(self, recorder: Recorder | None) -> None:
        """Hand every frame and reading of what is done from now on to `recorder`, and first the greeting.

        What passes while nothing is done is not recorded. None: no longer record.
        """
        with self._changed:
            self._session.recording.use(recorder)

    # what it does

    def configure(
        self,
        listen: float = 0.0625,
        blanking: float = 0.00238,
        trace: bool | TraceKind = False,
        speed_of_sound: float = 343.2,
        *,
        pulses: int = 0,
        echoes: int = MAX_ECHOES,
        rearm: float = 0.0,
        trace_rate: float = 0.0,
        trace_bits: int = 0,
    ) -> PingSettings:
        """Set how long to listen and to be deaf (s), whether to send traces, and the speed of sound (m/s).

        `pulses` is the number of cycles to transmit, `echoes` how many echoes of a ping to report at most, `rearm` the
        time from an echo until the board hears again (s), `trace_rate` in Hz; 0 leaves each to the device. Returns the
        settings in force: a board that cannot do what was asked says what it does. Raises CommandRefused, InputError
        where a value does not fit the protocol, NoAnswer, LinkLost.
        """
        wish = Configure(
            listen_us=microseconds_of(listen),
            blanking_us=microseconds_of(blanking),
            trace=int(trace),
            speed_of_sound=millimetres_per_second_of(speed_of_sound),
            pulses=pulses,
            echoes=echoes,
            rearm_us=microseconds_of(rearm),
            trace_rate=round(trace_rate),
            trace_bits=trace_bits,
        )
        return ping_settings(self._answer(configuring(wish), Settings))

    def configure_turntable(
        self,
        speed: float = 0.0,
        acceleration: float = 0.0,
        settling: float = 0.020,
        approach: Approach = Approach.EITHER,
    ) -> TurnSettings:
        """Set how to turn (rad/s, rad/s², s; 0: the device's own speed) and from which side to come to an angle.

        Returns what is in force. Raises what `configure` does.
        """
        wish = ConfigureTurntable(
            microdegrees_of(speed), microdegrees_of(acceleration), microseconds_of(settling), int(approach)
        )
        return turn_settings(self._answer(configuring_turntable(wish), TurntableSettings))

    def device_statistics(self) -> Statistics:
        """What the device has counted since it started. Raises CommandRefused where its firmware is too old."""
        return self._answer(asking(AskStatistics()), Statistics)

    def home(self) -> Outcome:
        """Find the zero of the turntable; returns how it ended: DONE, or STOPPED by `stop`.

        Raises DeviceError where it fails, CommandRefused, NoAnswer, LinkLost.
        """
        return self._outcome(homing())

    def turn(self, angle: float) -> Outcome:
        """Turn to `angle`, rad, finding the zero first where it is not known; otherwise as `home`."""
        return self._outcome(turning(Turn(microdegrees_of(angle))))

    def scan(self, order: ScanOrder | None = None) -> Iterator[Reading]:
        """Readings as they are completed, each once; one sent again comes later than its number says.

        Without an order: a whole turn in steps of 5 degrees. The zero is found first where it is not known. Stops the
        board when the iteration is given up. Behind the last reading the turntable is turned over its zero mark. Raises
        what `home` does, and LostSteps, after all readings, where the mark was out of its place.
        """
        with self._using():
            self._scan = job = self._begin(scanning(start_scan(order or sector())))
            try:
                while ready := self._next_readings(job):
                    yield from ready
            finally:
                self._abandon(job)
        _raise_error(job)

    @contextmanager
    def sequence(self) -> Iterator[None]:
        """Join several actions: a `stop` during one of them, or between two, also ends those that follow as STOPPED.

        Raises DeviceError where another thread uses the scanner.
        """
        if not self._in_use.acquire(blocking=False):
            raise DeviceError(f"{self.url}: is at work already; stop it or let it finish")
        self._stop_wanted, self._sequence_of = False, threading.get_ident()
        try:
            yield
        finally:
            self._sequence_of = None
            self._in_use.release()

    def stop(self) -> None:
        """Stop what runs; callable from any thread. What runs there ends as STOPPED, a scan with the readings made.

        Raises NoAnswer or LinkLost where nothing ran and the device does not answer.
        """
        self._stop_wanted = True
        if self._in_use.acquire(blocking=False):  # nobody is at work who would notice
            try:
                self._stop_wanted = False
                self._perform(asking(Stop()))
            finally:
                self._in_use.release()

    def close(self) -> None:
        """Stop what runs, end the thread and close the link. Never raises; twice does no harm."""
        if self._closing.is_set():
            return
        with suppress(SonarError), self._changed:
            job = self._session.job
            if job is not None:
                self._abandon(job)
        self._closing.set()
        with self._changed:
            self._changed.notify_all()
        self._thread.join()

    # jobs

    def _answer(self, job: Job, expected: type[T]) -> T:
        with self._using():
            answer = self._perform(job)
        if job.stop_wanted or not isinstance(answer, expected):
            raise DeviceError(f"{self.url}: was stopped before it answered; ask again")
        return answer

    def _outcome(self, job: Job) -> Outcome:
        with self._using():
            return Outcome(self._perform(job))

    def _perform(self, job: Job) -> Any:
        self._begin(job)
        try:
            with self._changed:
                while not job.done:
                    self._wait()
        finally:
            self._abandon(job)
        _raise_error(job)
        return job.result

    def _begin(self, job: Job) -> Job:
        with self._changed:
            self._check_thread()
            job.stop_wanted = self._stop_wanted  # between two actions of a sequence
            self._session.start(job, self._now())
            if job.stop_wanted:
                self._session.stop(job, self._now())  # ends it at once where the device is lost
            self._wake()
            return job

    def _next_readings(self, job: Job) -> list[Reading]:
        """What has come, at least one reading; empty when the scan is over."""
        with self._changed:
            while not job.readings and not job.done:
                self._wait()
            ready = [*job.readings]
            job.readings.clear()
            self._changed.notify_all()
            return ready

    def _abandon(self, job: Job) -> None:
        """End a job that is still at work, and wait briefly for its end; readings still come in."""
        until = time.monotonic() + _STOP_WITHIN
        with self._changed:
            if not job.done:
                self._session.stop(job, self._now())
                self._wake()
            while not job.done and time.monotonic() < until and self._thread.is_alive():
                self._changed.wait(_TICK)

    @contextmanager
    def _using(self) -> Iterator[None]:
        with nullcontext() if self._sequence_of == threading.get_ident() else self.sequence():
            if self._acting:
                raise DeviceError(f"{self.url}: is at work already; stop it or let it finish")
            self._acting = True
            try:
                yield
            finally:
                self._acting = False

    def _wait(self) -> None:
        """Until something has changed, or a moment."""
        self._check_thread()
        self._changed.wait(_TICK)

    def _check_thread(self) -> None:
        if self._closing.is_set():
            raise LinkLost(f"{self.url}: the scanner was closed")
        if self._defect:
            raise self._defect

    def _now(self) -> float:
        return self._epoch + time.monotonic()

    def _wake(self) -> None:
        if self._link:
            self._link.wake()

    # the thread

    def _converse(self) -> None:
        try:
            while not self._closing.is_set():
                self._link = self._exchange(self._link) if self._link else self._dial()
        except BaseException as defect:  # noqa: BLE001 - raised again in the thread that uses the scanner
            self._defect = defect
        finally:
            link, self._link = self._link, None
            if link:
                link.close()
            with self._changed:
                self._changed.notify_all()

    def _dial(self) -> Link | None:
        """The open link, once it is wanted and can be had."""
        with self._changed:
            self._session.advance(self._now())
            if not self._session.wants_open(self._now()):
                self._heed_stop()
                self._changed.notify_all()
                self._changed.wait(_TICK)
                return None
        try:
            link = Link(self._find())
        except (LinkError, InputError) as error:
            with self._changed:
                self._session.open_failed(error, self._now())
                self._changed.notify_all()
            return None
        with self._changed:
            self._session.opened(self._now(), link.quiet, link.bauds)
        return link

    def _exchange(self, link: Link) -> Link | None:
        """Write what is to be written, read what has come; the link, where it is to stay open."""
        held_back = self._hold_back()
        try:
            self._write(link)
            if held_back:
                return link
            data = link.read()
        except LinkError as error:
            link.close()
            with self._changed:
                self._session.broke(error, self._now())
                self._changed.notify_all()
            return None
        with self._changed:
            if data:
                self._session.receive(data, self._now())
            if len(data) < MOST:  # else more is waiting
                self._session.advance(self._now())
            self._heed_stop()
            self._changed.notify_all()
            if not self._session.wants_close:
                return link
            self._session.closed()
        link.close()
        return None

    def _write(self, link: Link) -> None:
        with self._changed:
            baud, data = self._session.device.baud, self._session.outgoing()
        link.set_baud(baud)
        if data:
            link.write(data)

    def _hold_back(self) -> bool:
        """Whether the caller has so much to take that nothing more is read; the device still sees signs of life."""
        with self._changed:
            job = self._session.job
            if job is None or len(job.readings) < MOST_WAITING or job.stop_wanted:
                return False
            self._session.hold(self._now())
            self._heed_stop()
            self._changed.wait(_TICK)
            return True

    def _heed_stop(self) -> None:
        job = self._session.job
        if self._stop_wanted and job is not None and not job.stop_wanted:
            self._session.stop(job, self._now())


def _raise_error(job: Job) -> None:
    if job.error is not None:
        raise job.error
