"""The scanner as programs use it: open it, scan, and receive readings one by one.

    from sonarhw import Scanner, sector

    with Scanner.open("/dev/ttyUSB0") as scanner:
        for reading in scanner.scan(sector(0, 360, 5)):
            print(reading.angle, reading.range)

A separate thread, a `LinkThread`, reads, writes, sends signs of life, and reconnects after a loss. Readings wait for
the caller in a queue of MOST_WAITING. While the queue is full, the thread reads nothing. A TCP connection then makes
the device wait. A serial line loses bytes, and the readings in them are requested or measured again. So a slow caller
slows the scan but loses no reading.
"""

import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, suppress
from typing import Any, TypeVar

from sonarhw.errors import DeviceError, LinkLost, NoAnswer, SonarError
from sonarhw.host.actions import (
    configuring,
    configuring_turntable,
    configuring_wiring,
    homing,
    jogging,
    requesting,
    scanning,
    turning,
    zeroing,
)
from sonarhw.host.device_info import DeviceInfo, PingSettings, TurnSettings, device_info, ping_settings, turn_settings
from sonarhw.host.exclusive_use import ExclusiveUse
from sonarhw.host.job import Job
from sonarhw.host.link_thread import TICK, LinkThread
from sonarhw.host.recorder import Recorder
from sonarhw.host.session import PATIENCE, RECONNECT, Connection, Session
from sonarhw.link.link_statistics import LinkStatistics
from sonarhw.link.ports import PortFinder
from sonarhw.readings import Reading, ScanOrder, sector
from sonarhw.sound_speed import ScanAir
from sonarhw.wire.codes import Approach, Feature, Input, Outcome, TraceKind, Wiring
from sonarhw.wire.limits import MAX_ECHOES
from sonarhw.wire.messages import (
    AskStatistics,
    Configure,
    ConfigureTurntable,
    ConfigureWiring,
    Settings,
    Statistics,
    Stop,
    Turn,
    TurntableSettings,
    WiringSettings,
)
from sonarhw.wire.reading_messages import start_scan
from sonarhw.wire.units import microdegrees_of, microseconds_of, millimetres_per_second_of

_STOP_WITHIN = 1.5  # s
_HEARTBEAT_WITHIN = 3.0  # s
_PROBE_WITHIN = 2.5  # s; a board that was reset by the opening of its port needs time to start
T = TypeVar("T")


class Scanner:
    """A connected scanner. One thread may use it. Other threads may call `stop` and read its state."""

    takes_orders = True  # the angles of a scan can be chosen

    def __init__(
        self,
        url: str,
        session: Session,
        find: Callable[[], str] | None = None,
        on_close: Callable[[], None] = lambda: None,
    ) -> None:
        """Start to connect. Programs call `open` instead."""
        self.url = url
        self._on_close = on_close
        self._session = session
        self._scan: Job | None = None
        self._use = ExclusiveUse(url)
        self._thread = LinkThread(url, session, find or PortFinder(url), self._use)
        self._changed = self._thread.changed

    @classmethod
    def open(
        cls,
        url: str,
        recorder: Recorder | None = None,
        patience: float = PATIENCE,
        reconnect: float = RECONNECT,
        find: Callable[[], str] | None = None,
        on_close: Callable[[], None] = lambda: None,
    ) -> "Scanner":
        """Open `url`, greet the scanner and stop its running action. It must answer within `patience` s.

        If the scanner is lost later and comes back within `reconnect` s, its job continues. `find` returns the URL to
        open each time; by default a USB device is found again under any port name. `on_close` is called after the link
        is closed, also if this function raises an error. Raises InputError for an invalid URL, LinkError (LinkBusy,
        LinkForbidden, LinkLost), NoAnswer, and Incompatible for another protocol version.
        """
        scanner = cls(url, Session(url, patience, reconnect), find, on_close)
        try:
            with scanner._changed:
                while scanner.state is not Connection.READY:
                    scanner._thread.wait()
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

    # identity and state

    @property
    def state(self) -> Connection:
        """State of the connection."""
        with self._changed:
            return self._session.state

    @property
    def loss(self) -> SonarError | None:
        """Reason of a loss, while the scanner waits for the device; None while it is connected."""
        with self._changed:
            return self._session.loss

    @property
    def info(self) -> DeviceInfo:
        """Identity and capabilities of the device."""
        info = self._session.device.info
        if info is None:
            raise NoAnswer(f"{self.url}: has not sent Info")
        return device_info(info, self._session.device.capabilities)

    @property
    def settings(self) -> PingSettings | None:
        """Ping settings in force; None before `configure`."""
        settings = self._session.device.settings
        return None if settings is None else ping_settings(settings)

    @property
    def baud(self) -> int | None:
        """Baud rate of the line; None if the line has none, as with TCP."""
        return self._session.device.baud if self._session.bauds else None

    @property
    def statistics(self) -> LinkStatistics:
        """Counters of the traffic since the scanner was opened."""
        with self._changed:
            return self._session.statistics

    @property
    def clock_drift(self) -> float:
        """By how much the host's clock runs faster than the device's: 0.001 is 1 ms in 1 s."""
        return self._session.clock.drift

    @property
    def scan_began(self) -> float:
        """Start of the last scan on the clock of `Reading.time`, s; 0 before the first scan."""
        return self._scan.began or 0.0 if self._scan else 0.0

    @property
    def unverified_angles(self) -> str | None:
        """Clause with the angles of the last scan that could not be checked for lost steps; None if there are none.

        After a reset or a long silence of the host during a scan, the device homes again. Its position error before
        that is unknown. Also None if the device cannot detect lost steps.
        """
        return self._scan.unverified_angles if self._scan else None

    def record(self, recorder: Recorder | None) -> None:
        """Pass the greeting and then every frame and reading to `recorder`. None ends the recording.

        Frames are recorded only while a job runs.
        """
        # `stop` in a signal handler must not wait for the thread of the link here, which may wait for the recorder
        claimed = self._use.claim()
        try:
            with self._changed:
                self._session.recording.use(recorder)
        finally:
            if claimed:
                self._use.release()

    # actions

    def configure(
        self,
        listen: float = 0.0625,
        blanking: float = 0.00238,
        trace: bool | TraceKind = False,
        speed_of_sound: float | None = None,
        *,
        pulses: int = 0,
        echoes: int = MAX_ECHOES,
        rearm: float = 0.0,
        trace_rate: float = 0.0,
        trace_bits: int = 0,
    ) -> PingSettings:
        """Set the listening time (s), the blanking (s), whether to send traces, and the speed of sound (m/s).

        By default, the speed of sound is that at the temperature of the scanner's thermometer, or at 20 °C if it has
        none. `pulses` is the number of cycles to transmit. `echoes` is the highest number of echoes to report of a
        ping, at least 1. `rearm` is the time from an echo until the board is armed again (s). `trace_rate` is in Hz.
        For `pulses`, `rearm`, `trace_rate` and `trace_bits`, 0 selects the device's default. Returns the settings in
        force, which may differ from the requested ones. Raises CommandRefused, InputError if a value does not fit the
        protocol, NoAnswer, LinkLost.
        """
        if speed_of_sound is None:
            speed_of_sound = ScanAir().speed_of_sound(self.info.temperature_c)
        request = Configure(
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
        return ping_settings(self._answer(configuring(request), Settings))

    def configure_turntable(
        self,
        speed: float = 0.0,
        acceleration: float = 0.0,
        settling: float = 0.020,
        approach: Approach = Approach.EITHER,
    ) -> TurnSettings:
        """Set speed (rad/s), acceleration (rad/s²), settling time (s) and the side from which to approach an angle.

        A speed or acceleration of 0 selects the device's default. Returns the settings in force. Raises what
        `configure` raises.
        """
        request = ConfigureTurntable(
            microdegrees_of(speed), microdegrees_of(acceleration), microseconds_of(settling), int(approach)
        )
        return turn_settings(self._answer(configuring_turntable(request), TurntableSettings))

    def configure_wiring(self, change: Wiring = Wiring(0), inverted: Wiring = Wiring(0)) -> Wiring:
        """Set what is in `change` and `inverted`, clear the rest of `change`, and return what is set.

        Wiring.ONE_SWITCH chooses homing by the mark alone. The other parts are inverted. The device keeps this over a
        restart. A change makes the zero unknown. Raises DeviceError if the firmware is too old, CommandRefused,
        NoAnswer, LinkLost.
        """
        request = ConfigureWiring(int(change), int(inverted & change))
        return Wiring(self._answer(configuring_wiring(request), WiringSettings).inverted)

    def inputs(self) -> Input | None:
        """Return the inputs whose pins are high now; None if the device does not report them.

        Waits for the next heartbeat. Raises NoAnswer, LinkLost.
        """
        capabilities = self.info.capabilities
        if capabilities is None or Feature.INPUTS not in capabilities.features:
            return None
        with self._changed:
            known = self._session.heartbeat
            until = time.monotonic() + _HEARTBEAT_WITHIN
            while (beat := self._session.heartbeat) is None or beat is known:
                if time.monotonic() > until:
                    raise NoAnswer(f"{self.url}: no heartbeat for {_HEARTBEAT_WITHIN:g} s; check the cable")
                self._thread.wait()
        return Input(beat.inputs)

    def device_statistics(self) -> Statistics:
        """Return the counters of the device since it started. Raises CommandRefused if its firmware is too old."""
        return self._answer(requesting(AskStatistics()), Statistics)

    def home(self, here: bool = False) -> Outcome:
        """Home the turntable, or with `here` make its present angle the zero. Returns DONE, or STOPPED after `stop`.

        Raises DeviceError if homing fails or the firmware is too old for `here`, CommandRefused, NoAnswer, LinkLost.
        """
        return self._outcome(zeroing() if here else homing())

    def turn(self, angle: float) -> Outcome:
        """Turn to `angle`, rad, and home first if needed. Returns and raises what `home` does."""
        return self._outcome(turning(Turn(microdegrees_of(angle))))

    def jog(self, angle: float) -> Outcome:
        """Turn by `angle`, rad, at most 10 degrees, without homing. Returns and raises what `home` does."""
        return self._outcome(jogging(Turn(microdegrees_of(angle), relative=1)))

    def scan(self, order: ScanOrder | None = None) -> Iterator[Reading]:
        """Scan, and yield each reading once when it is complete. A reading that was sent again may be out of order.

        The default order is a whole turn in steps of 5 degrees. Without an earlier `configure`, the settings are its
        defaults. The turntable homes first if needed. If the caller ends the iteration early, the board stops. After
        the last reading the turntable turns over its zero mark. Raises what `home` raises, and LostSteps, after all
        readings, if the mark is misplaced.
        """
        with self._use.action():
            self._scan = job = self._begin(scanning(start_scan(order or sector())))
            try:
                while ready := self._next_readings(job):
                    yield from ready
            finally:
                self._abandon(job)
        _raise_error(job)

    def sequence(self) -> AbstractContextManager[None]:
        """Combine the actions in a block: a `stop` during or between them also ends the later ones as STOPPED.

        Raises DeviceError while another thread uses the scanner.
        """
        return self._use.sequence()

    def stop(self) -> None:
        """Stop the running action, which then ends as STOPPED. Any thread may call this. A scan keeps its readings.

        Raises NoAnswer or LinkLost if no action runs and the device does not answer; at once if it is lost already.
        """
        self._use.stop_wanted = True
        if self._use.claim():  # no action is running
            try:
                self._use.stop_wanted = False
                if (lost := self._session.loss) is not None:
                    raise LinkLost(str(lost))
                self._perform(requesting(Stop()))
            finally:
                self._use.release()

    def close(self) -> None:
        """Stop the running action, end the thread and close the link. A second call does nothing.

        Raises only what `on_close` raises.
        """
        if self._thread.closed:
            return
        with suppress(SonarError), self._changed:
            job = self._session.job
            if job is not None:
                self._abandon(job)
        self._thread.close()
        self._on_close()

    # jobs

    def _answer(self, job: Job, expected: type[T]) -> T:
        with self._use.action():
            answer = self._perform(job)
        if job.stop_wanted or not isinstance(answer, expected):
            raise DeviceError(f"{self.url}: was stopped before it answered; send the request again")
        return answer

    def _outcome(self, job: Job) -> Outcome:
        with self._use.action():
            return Outcome(self._perform(job))

    def _perform(self, job: Job) -> Any:
        self._begin(job)
        try:
            with self._changed:
                while not job.done:
                    self._thread.wait()
        finally:
            self._abandon(job)
        _raise_error(job)
        return job.result

    def _begin(self, job: Job) -> Job:
        with self._changed:
            self._thread.check()
            job.stop_wanted = self._use.stop_wanted  # between two actions of a sequence
            self._session.start(job, self._thread.now())
            if job.stop_wanted:
                self._session.stop(job, self._thread.now())  # ends the job at once if the device is lost
            self._thread.wake()
            return job

    def _next_readings(self, job: Job) -> list[Reading]:
        """Wait for readings and return them. Empty when the scan has ended."""
        with self._changed:
            while not job.readings and not job.done:
                self._thread.wait()
            ready = [*job.readings]
            job.readings.clear()
            self._changed.notify_all()
            return ready

    def _abandon(self, job: Job) -> None:
        """Stop a job that still runs, and wait up to _STOP_WITHIN for its end. Its readings are still recorded."""
        until = time.monotonic() + _STOP_WITHIN
        with self._changed:
            if not job.done:
                self._session.stop(job, self._thread.now())
                self._thread.wake()
            while not job.done and time.monotonic() < until and self._thread.alive:
                self._changed.wait(TICK)


def _raise_error(job: Job) -> None:
    if job.error is not None:
        raise job.error


def probe_port(url: str, patience: float = _PROBE_WITHIN) -> tuple[bool, str]:
    """Return whether a scanner answers at `url` within `patience` s, and its identity or the reason in one line.

    Opening a port may reset the board behind it.
    """
    try:
        with Scanner.open(url, patience=patience) as scanner:
            return True, f"scanner {scanner.info.serial}, {scanner.info.firmware}"
    except SonarError as error:
        return False, f"no scanner: {str(error).removeprefix(f'{url}: ')}"
