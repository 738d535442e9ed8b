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

import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Protocol, TypeAlias, TypeVar

import numpy as np

from sonarhw import arguments, errors, files
from sonarhw.host import scripts
from sonarhw.host.scripts import turning
from sonarhw.host.session import PATIENCE, RECONNECT, Connection, Recorder, Session
from sonarhw.link import MOST, Link, LinkStatistics, PortFinder
from sonarhw.log import LogWriter
from sonarhw.plugins.plugin_device import PluginLink
from sonarhw.readings import MOST_ANGLE, Reading, ScanOrder, check_order, sector
from sonarhw.scan_check import Reach, check_scan
from sonarhw.sound_speed import ScanAir
from sonarhw.wire import messages
from sonarhw.wire.limits import MAX_ECHOES, MOST_READINGS, MOST_SWEEPS
from sonarhw.wire.readings_of_frames import start_scan

# identity, capabilities and settings of a device, in SI units


@dataclass(frozen=True)
class DeviceCapabilities:
    """The capabilities of a device."""

    features: messages.Feature
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
    approach: messages.Approach


def device_info(info: messages.Info, capabilities: messages.Capabilities | None) -> DeviceInfo:
    """Return identity and capabilities in SI units."""
    return DeviceInfo(
        firmware=info.firmware,
        protocol=(info.major, info.minor),
        serial=info.serial,
        board=info.board,
        temperature_c=messages.degrees_c(info.temperature),
        trace_rate=float(info.trace_rate),
        microsteps=info.microsteps,
        boot=info.boot,
        capabilities=None if capabilities is None else _capabilities(capabilities),
    )


def ping_settings(settings: messages.Settings) -> PingSettings:
    """Return the ping settings in SI units."""
    return PingSettings(
        listen=messages.seconds_of(settings.listen_us),
        blanking=messages.seconds_of(settings.blanking_us),
        trace=bool(settings.trace),
        speed_of_sound=messages.sound_speed_of(settings.speed_of_sound),
        carrier=settings.trace == messages.TraceKind.CARRIER,
        pulses=settings.pulses,
        echoes=settings.echoes,
        rearm=messages.seconds_of(settings.rearm_us),
        trace_rate=float(settings.trace_rate),
        trace_bits=settings.trace_bits,
    )


def turn_settings(settings: messages.TurntableSettings) -> TurnSettings:
    """Return the turntable settings in SI units."""
    return TurnSettings(
        speed=messages.radians_of(settings.speed),
        acceleration=messages.radians_of(settings.acceleration),
        settling=messages.seconds_of(settings.settle_us),
        approach=messages.Approach(settings.approach),
    )


def _capabilities(message: messages.Capabilities) -> DeviceCapabilities:
    return DeviceCapabilities(
        features=messages.Feature(message.features),
        lowest_angle=messages.radians_of(message.lowest_angle),
        highest_angle=messages.radians_of(message.highest_angle),
        steps=message.steps,
        fastest=messages.radians_of(message.fastest),
        hardest=messages.radians_of(message.hardest),
        backlash=messages.radians_of(message.backlash),
        longest_listen=messages.seconds_of(message.longest_listen_us),
        shortest_blanking=messages.seconds_of(message.shortest_blanking_us),
        shortest_rearm=messages.seconds_of(message.shortest_rearm_us),
        most_pulses=message.most_pulses,
        most_echoes=message.most_echoes,
        ping_period=messages.seconds_of(message.ping_period_us),
        fastest_trace=float(message.fastest_trace),
        longest_trace=message.longest_trace,
        fastest_baud=message.fastest_baud,
        readings_kept=message.readings_kept,
        turning=message.turning,
    )


class ExclusiveUse:
    """Excludes other threads during a sequence of actions, and other actions during an action."""

    def __init__(self, url: str, at_end: Callable[[], None] = lambda: None) -> None:
        """`url` is for errors. `at_end` is called at the end of each sequence, before another one can begin."""
        self.stop_wanted = False  # not an Event: a signal handler may run while the lock of an Event is held
        self._url = url
        self._at_end = at_end
        self._lock = threading.Lock()
        self._sequence_of: int | None = None  # the thread for which the lock is held
        self._acting = False

    @contextmanager
    def sequence(self) -> Iterator[None]:
        """Combine the actions of this thread in a block. Raises DeviceError while another sequence runs."""
        if not self.claim():
            raise self._busy()
        self.stop_wanted, self._sequence_of = False, threading.get_ident()
        try:
            yield
        finally:
            try:
                self._at_end()
            finally:
                self._sequence_of = None
                self.release()

    @contextmanager
    def action(self) -> Iterator[None]:
        """Enclose an action, in a sequence of its own if there is none. Raises DeviceError during another action."""
        with nullcontext() if self._sequence_of == threading.get_ident() else self.sequence():
            if self._acting:
                raise self._busy()
            self._acting = True
            try:
                yield
            finally:
                self._acting = False

    def claim(self) -> bool:
        """Prevent sequences until `release`, and return True; return False if one runs."""
        return self._lock.acquire(blocking=False)

    def release(self) -> None:
        """Allow sequences again."""
        self._lock.release()

    def _busy(self) -> errors.DeviceError:
        return errors.DeviceError(f"{self._url}: is busy; stop it or wait until it has finished")


MOST_WAITING = 1024  # readings; about 100 s at 10 pings a second
TICK = 0.05  # s; longest delay until `close` takes effect
OpenLink: TypeAlias = Link | PluginLink
Clock: TypeAlias = Callable[[], float]  # returns s since the epoch, and never runs backwards
_CLOSED_WITHIN = 5.0  # s
_STOPPED = 0.3  # s; after a longer time between two reads, the system had stopped this process


class LinkThread:
    """The thread that exchanges the bytes of one session: it opens the link, reads, writes, and opens it again.

    It sends signs of life while the caller is busy. It reads nothing while MOST_WAITING readings wait for the caller.
    `changed` guards the session and is notified when the session changes.
    """

    def __init__(self, url: str, session: Session, open_link: Callable[[Clock], OpenLink], use: ExclusiveUse) -> None:
        """Start to connect. `open_link` is called each time."""
        self.changed = threading.Condition()
        self._url = url
        self._session = session
        self._open = open_link
        self._use = use
        # times are s since the epoch on a clock that never runs backwards
        self._epoch = time.time() - time.monotonic()
        self._closing = threading.Event()
        self._defect: BaseException | None = None  # the error that ended the thread
        self._link: OpenLink | None = None
        self._looked = self.now()  # time of the last read
        session.connect(self.now())
        self._thread = threading.Thread(target=self._converse, name=f"converse {url}", daemon=True)
        self._thread.start()

    def now(self) -> float:
        """Return the time on the clock of the session, s since the epoch."""
        return self._epoch + time.monotonic()

    @property
    def closed(self) -> bool:
        """Whether `close` was called."""
        return self._closing.is_set()

    @property
    def alive(self) -> bool:
        """Whether the thread runs."""
        return self._thread.is_alive()

    def wait(self) -> None:
        """Wait until the session changes, at most TICK. The caller holds `changed`. Raises what `check` raises."""
        self.check()
        self.changed.wait(TICK)

    def check(self) -> None:
        """Raise LinkLost after `close`, or the error that ended the thread."""
        if self.closed:
            raise errors.LinkLost(f"{self._url}: the scanner was closed")
        if self._defect:
            raise self._defect

    def wake(self) -> None:
        """End a read that waits for bytes, so that the thread writes at once."""
        if self._link:
            self._link.wake()

    def close(self) -> None:
        """End the thread and close the link. Waits for at most 5 s."""
        self._closing.set()
        with self.changed:
            self.changed.notify_all()
        # a plug-in or a driver may block; the thread then ends with the program
        self._thread.join(_CLOSED_WITHIN)

    def _converse(self) -> None:
        try:
            while not self._closing.is_set():
                self._link = self._exchange(self._link) if self._link else self._open_link()
        except BaseException as defect:  # noqa: BLE001 - raised again in the thread that uses the scanner
            self._defect = defect
        finally:
            link, self._link = self._link, None
            if link:
                link.close()
            with self.changed:
                self.changed.notify_all()

    def _open_link(self) -> OpenLink | None:
        """Return the opened link. None if the session does not need it now, or if it cannot be opened."""
        with self.changed:
            self._session.advance(self.now())
            if not self._session.wants_open(self.now()):
                self._forward_stop()
                self.changed.notify_all()
                self.changed.wait(TICK)
                return None
        try:
            link = self._open(self.now)
        except (errors.LinkError, errors.InputError) as error:
            with self.changed:
                self._session.open_failed(error, self.now())
                self.changed.notify_all()
            return None
        with self.changed:
            self._session.opened(self.now(), link.quiet, link.bauds)
        return link

    def _exchange(self, link: OpenLink) -> OpenLink | None:
        """Write and read once. Return the link, or None if it has been closed."""
        behind = self._caller_is_behind()
        try:
            self._write(link)
            if behind:
                return link
            begun = self.now()
            data = link.read()
        except errors.LinkError as error:
            link.close()
            with self.changed:
                self._session.broke(error, self.now())
                self.changed.notify_all()
            return None
        with self.changed:
            # without data, it is known only that nothing had arrived when the read began: the system may have stopped
            # this process since, while bytes arrived
            now = self.now() if data else begun
            if data:
                self._session.receive(data, now)
            elif self.now() - self._looked > _STOPPED:
                # what runs on the same machine, such as an emulated board, may have been stopped too: this time is no
                # silence of the device
                self._session.keep_alive(self.now())
            self._looked = self.now()
            if len(data) < MOST:  # otherwise more bytes are waiting
                self._session.advance(now)
            self._forward_stop()
            self.changed.notify_all()
            if not self._session.wants_close:
                return link
            self._session.closed()
        link.close()
        return None

    def _write(self, link: OpenLink) -> None:
        with self.changed:
            baud, data = self._session.device.baud, self._session.outgoing()
        link.set_baud(baud)
        if data:
            link.write(data)

    def _caller_is_behind(self) -> bool:
        """Return whether the queue of readings is full, so that nothing may be read. If so, send signs of life only."""
        with self.changed:
            job = self._session.job
            if job is None or len(job.readings) < MOST_WAITING or job.stop_wanted:
                return False
            self._session.keep_alive(self.now())
            self._forward_stop()
            self.changed.wait(TICK)
            return True

    def _forward_stop(self) -> None:
        job = self._session.job
        if self._use.stop_wanted and job is not None and not job.stop_wanted:
            self._session.stop(job, self.now())


_STOP_WITHIN = 1.5  # s
_HEARTBEAT_WITHIN = 3.0  # s
_PROBE_WITHIN = 2.5  # s; a board that was reset by the opening of its port needs time to start
_NO_TURNTABLE = "this device cannot be turned by a command; `scan` records its readings"
T = TypeVar("T")


class Scanner:
    """A connected scanner. One thread may use it. Other threads may call `stop` and read its state."""

    def __init__(
        self,
        url: str,
        session: Session,
        find: Callable[[], str] | None = None,
        on_close: Callable[[], None] = lambda: None,
        plugin: PluginLink | None = None,
    ) -> None:
        """Start to connect. Programs call `open` instead."""
        self.url = url
        self._on_close = on_close
        self._session = session
        self._scan: scripts.Job | None = None
        self._use = ExclusiveUse(url)
        self._plugin = plugin
        if plugin:
            plugin.record = self._record_bytes
            session.device.configured = plugin.settings
            session.device.failure = lambda: plugin.failure
        find_port = find or PortFinder(url)
        self._thread = LinkThread(url, session, plugin.open if plugin else lambda _: Link(find_port()), self._use)
        self._changed = self._thread.changed

    @classmethod
    @arguments.checked(
        url=arguments.text, patience=arguments.number(0.0, unit="s"), reconnect=arguments.number(0.0, unit="s")
    )
    def open(
        cls,
        url: str,
        recorder: Recorder | None = None,
        patience: float = PATIENCE,
        reconnect: float = RECONNECT,
        find: Callable[[], str] | None = None,
        on_close: Callable[[], None] = lambda: None,
        plugin: PluginLink | None = None,
    ) -> "Scanner":
        """Open `url`, greet the scanner and stop its running action. It must answer within `patience` s.

        If the scanner is lost later and comes back within `reconnect` s, its job continues. `find` returns the URL to
        open each time; by default a USB device is found again under any port name. `on_close` is called after the link
        is closed, also if this function raises an error. A `plugin` replaces `find`; its first measurement must arrive
        within `patience` s. Raises InputError for an invalid URL, LinkError (LinkBusy, LinkForbidden, LinkLost),
        NoAnswer, and Incompatible for another protocol version.
        """
        scanner = cls(url, Session(url, PATIENCE if plugin else patience, reconnect), find, on_close, plugin)
        try:
            with scanner._changed:
                while scanner.state is not Connection.READY:
                    scanner._thread.wait()
                    if scanner._session.failed:
                        raise scanner._session.failed
            if scanner._plugin:
                scanner._plugin.await_measurement(patience)
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
    def loss(self) -> errors.SonarError | None:
        """Reason of a loss, while the scanner waits for the device; None while it is connected."""
        with self._changed:
            return self._session.loss

    @property
    def takes_orders(self) -> bool:
        """Whether the angles of a scan can be chosen; else the device turns by itself."""
        return self._plugin is None or self._plugin.takes_orders

    @property
    def info(self) -> DeviceInfo:
        """Identity and capabilities of the device. Protocol 0.0 is that of a plug-in: it does not speak this one."""
        info = self._session.device.info
        if info is None:
            raise errors.NoAnswer(f"{self.url}: has not sent Info")
        stated = device_info(info, self._session.device.capabilities)
        return replace(stated, protocol=(0, 0)) if self._plugin else stated

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
            counted = self._session.statistics
        return self._plugin.statistics(counted) if self._plugin else counted

    def report_doubts(self, warn: Callable[[str], None]) -> None:
        """Pass doubts about a device that turns by itself to `warn` as they arise, in the thread of the link."""
        if self._plugin:
            self._plugin.report_doubts(warn)

    @property
    def notes(self) -> tuple[str, ...]:
        """What a device that does not speak the protocol assumes about its measurements, such as their unit."""
        return self._plugin.notes if self._plugin else ()

    @property
    def ignored(self) -> dict[str, int]:
        """How much that a plug-in received was no reading of the last scan, by kind, without zeros."""
        return self._plugin.ignored if self._plugin else {}

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

    @arguments.checked(
        recorder=arguments.instance((Recorder, type(None)), "None, or an object with methods `frame` and `reading`")
    )
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

    @arguments.checked(
        listen=arguments.number(0.0, unit="s"),
        blanking=arguments.number(0.0, unit="s"),
        trace=arguments.instance((bool, np.bool_, messages.TraceKind), "True, False or a TraceKind"),
        speed_of_sound=arguments.number(0.0, unit="m/s"),
        pulses=arguments.whole(0, 255),
        echoes=arguments.whole(1, 255),
        rearm=arguments.number(0.0, unit="s"),
        trace_rate=arguments.number(0.0, unit="Hz"),
        trace_bits=arguments.whole(0, 255),
    )
    def configure(
        self,
        listen: float = 0.0625,
        blanking: float = 0.00238,
        trace: bool | messages.TraceKind = False,
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
        request = messages.Configure(
            listen_us=messages.microseconds_of(listen),
            blanking_us=messages.microseconds_of(blanking),
            trace=int(trace),
            speed_of_sound=messages.millimetres_per_second_of(speed_of_sound),
            pulses=pulses,
            echoes=echoes,
            rearm_us=messages.microseconds_of(rearm),
            trace_rate=round(trace_rate),
            trace_bits=trace_bits,
        )
        return ping_settings(self._answer(scripts.configuring(request), messages.Settings))

    @arguments.checked(
        speed=arguments.number(0.0, unit="rad/s"),
        acceleration=arguments.number(0.0, unit="rad/s²"),
        settling=arguments.number(0.0, unit="s"),
        approach=arguments.instance(messages.Approach, "an Approach"),
    )
    def configure_turntable(
        self,
        speed: float = 0.0,
        acceleration: float = 0.0,
        settling: float = 0.020,
        approach: messages.Approach = messages.Approach.EITHER,
    ) -> TurnSettings:
        """Set speed (rad/s), acceleration (rad/s²), settling time (s) and the side from which to approach an angle.

        A speed or acceleration of 0 selects the device's default. Returns the settings in force. Raises what
        `configure` raises.
        """
        self._refuse_at_plugin(_NO_TURNTABLE)
        request = messages.ConfigureTurntable(
            messages.microdegrees_of(speed),
            messages.microdegrees_of(acceleration),
            messages.microseconds_of(settling),
            int(approach),
        )
        return turn_settings(self._answer(scripts.configuring_turntable(request), messages.TurntableSettings))

    @arguments.checked(
        change=arguments.instance(messages.Wiring, "a Wiring"), inverted=arguments.instance(messages.Wiring, "a Wiring")
    )
    def configure_wiring(
        self, change: messages.Wiring = messages.Wiring(0), inverted: messages.Wiring = messages.Wiring(0)
    ) -> messages.Wiring:
        """Set what is in `change` and `inverted`, clear the rest of `change`, and return what is set.

        Wiring.ONE_SWITCH chooses homing by the mark alone. The other parts are inverted. The device keeps this over a
        restart. A change makes the zero unknown. Raises DeviceError if the firmware is too old, CommandRefused,
        NoAnswer, LinkLost.
        """
        request = messages.ConfigureWiring(int(change), int(inverted & change))
        return messages.Wiring(self._answer(scripts.configuring_wiring(request), messages.WiringSettings).inverted)

    def inputs(self) -> messages.Input | None:
        """Return the inputs whose pins are high now; None if the device does not report them.

        Waits for the next heartbeat. Raises NoAnswer, LinkLost.
        """
        capabilities = self.info.capabilities
        if capabilities is None or messages.Feature.INPUTS not in capabilities.features:
            return None
        with self._changed:
            newest = self._session.heartbeat
            until = time.monotonic() + _HEARTBEAT_WITHIN
            while (beat := self._session.heartbeat) is None or beat is newest:
                if time.monotonic() > until:
                    raise errors.NoAnswer(f"{self.url}: no heartbeat for {_HEARTBEAT_WITHIN:g} s; check the cable")
                self._thread.wait()
        return messages.Input(beat.inputs)

    def device_statistics(self) -> messages.Statistics:
        """Return the counters of the device since it started. Raises CommandRefused if its firmware is too old."""
        return self._answer(scripts.requesting(messages.AskStatistics()), messages.Statistics)

    @arguments.checked(here=arguments.flag)
    def home(self, here: bool = False) -> messages.Outcome:
        """Home the turntable, or with `here` make its present angle the zero. Returns DONE, or STOPPED after `stop`.

        Raises DeviceError if homing fails or the firmware is too old for `here`, InputError for `here` at a device of a
        plug-in, CommandRefused, NoAnswer, LinkLost.
        """
        if here:
            self._refuse_at_plugin("the zero of this device cannot be set by a command")
        return self._outcome(scripts.zeroing() if here else scripts.homing())

    @arguments.checked(angle=arguments.number(-MOST_ANGLE, MOST_ANGLE, "rad"))
    def turn(self, angle: float) -> messages.Outcome:
        """Turn to `angle`, rad, and home first if needed. Returns and raises what `home` does."""
        self._refuse_at_plugin(_NO_TURNTABLE)
        return self._outcome(turning(messages.Turn(messages.microdegrees_of(angle))))

    @arguments.checked(angle=arguments.number(-MOST_ANGLE, MOST_ANGLE, "rad"))
    def jog(self, angle: float) -> messages.Outcome:
        """Turn by `angle`, rad, at most 10 degrees, without homing. Returns and raises what `home` does."""
        self._refuse_at_plugin(_NO_TURNTABLE)
        return self._outcome(scripts.jogging(messages.Turn(messages.microdegrees_of(angle), relative=1)))

    @arguments.checked(order=arguments.instance(ScanOrder, "a ScanOrder, such as `sonarhw.sector(0, 360, 5)`"))
    def scan(self, order: ScanOrder | None = None) -> Iterator[Reading]:
        """Scan, and yield each reading once when it is complete. A reading that was sent again may be out of order.

        The default order is a whole turn in steps of 5 degrees. Without an earlier `configure`, the settings are its
        defaults. The turntable homes first if needed. If the caller ends the iteration early, the board stops. After
        the last reading the turntable turns over its zero mark. Raises InputError for an order that the protocol cannot
        state, what `home` raises, and LostSteps, after all readings, if the mark is misplaced.
        """
        order = order or sector()
        check_order(order)
        with self._use.action():
            self._scan = job = self._begin(scripts.scanning(start_scan(order)))
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
                    raise errors.LinkLost(str(lost))
                self._perform(scripts.requesting(messages.Stop()))
            finally:
                self._use.release()

    def close(self) -> None:
        """Stop the running action, end the thread and close the link. A second call does nothing.

        Raises only what `on_close` raises.
        """
        if self._thread.closed:
            return
        with suppress(errors.SonarError), self._changed:
            job = self._session.job
            if job is not None:
                self._abandon(job)
        if self._plugin:
            self._plugin.cancel()
        self._thread.close()
        if self._plugin:
            self._plugin.stop()
        self._on_close()

    # the device of a plug-in

    def _refuse_at_plugin(self, reason: str) -> None:
        if self._plugin:
            raise errors.InputError(f"{self.url}: {reason}")

    def _record_bytes(self, time: float, data: bytes) -> None:
        with self._changed:
            self._session.recording.received_bytes(time, data)

    # jobs

    def _answer(self, job: scripts.Job, expected: type[T]) -> T:
        with self._use.action():
            answer = self._perform(job)
        if job.stop_wanted or not isinstance(answer, expected):
            raise errors.DeviceError(f"{self.url}: was stopped before it answered; send the request again")
        return answer

    def _outcome(self, job: scripts.Job) -> messages.Outcome:
        with self._use.action():
            return messages.Outcome(self._perform(job))

    def _perform(self, job: scripts.Job) -> Any:
        self._begin(job)
        try:
            with self._changed:
                while not job.done:
                    self._thread.wait()
        finally:
            self._abandon(job)
        _raise_error(job)
        return job.result

    def _begin(self, job: scripts.Job) -> scripts.Job:
        with self._changed:
            self._thread.check()
            job.stop_wanted = self._use.stop_wanted  # between two actions of a sequence
            self._session.start(job, self._thread.now())
            if job.stop_wanted:
                self._session.stop(job, self._thread.now())  # ends the job at once if the device is lost
            self._thread.wake()
            return job

    def _next_readings(self, job: scripts.Job) -> list[Reading]:
        """Wait for readings and return them. Empty when the scan has ended."""
        with self._changed:
            while not job.readings and not job.done:
                self._thread.wait()
            ready = [*job.readings]
            job.readings.clear()
            self._changed.notify_all()
            return ready

    def _abandon(self, job: scripts.Job) -> None:
        """Stop a job that still runs, and wait up to _STOP_WITHIN for its end. Its readings are still recorded."""
        until = time.monotonic() + _STOP_WITHIN
        with self._changed:
            if not job.done:
                self._session.stop(job, self._thread.now())
                self._thread.wake()
            while not job.done and time.monotonic() < until and self._thread.alive:
                self._changed.wait(TICK)


PluginScanner = Scanner  # deprecated name of a scanner with the device of a plug-in


def _raise_error(job: scripts.Job) -> None:
    if job.error is not None:
        raise job.error


def probe_port(url: str, patience: float = _PROBE_WITHIN) -> tuple[bool, str]:
    """Return whether a scanner answers at `url` within `patience` s, and its identity or the reason in one line.

    Opening a port may reset the board behind it.
    """
    try:
        with Scanner.open(url, patience=patience) as scanner:
            return True, f"scanner {scanner.info.serial}, {scanner.info.firmware}"
    except errors.SonarError as error:
        return False, f"no scanner: {str(error).removeprefix(f'{url}: ')}"


_MOST_CHECKED = 100_000  # newest readings of a scan that are checked at its end


@dataclass(frozen=True)
class ScanPlan:
    """The pings of a scan and how the board listens."""

    order: ScanOrder
    reach: float  # m; range up to which the board listens
    blanking: float  # s; earlier echoes are ignored
    air: ScanAir
    traces: bool = False
    zero_here: bool = False  # zero is where the turntable is now; it is not homed


def until_stopped(order: ScanOrder) -> ScanOrder:
    """Return the order with as many sweeps as a scan can have: it ends when it is stopped."""
    of_sweep = order.headings * order.pings
    return replace(order, sweeps=max(1, min(MOST_SWEEPS, MOST_READINGS // of_sweep)))


class ScanWatcher(Protocol):
    """Receives the progress of a scan, in the thread that called `record_scan`."""

    @property
    def stop_wanted(self) -> bool:
        """Whether the scan should end before its next step. `Scanner.stop` also ends the current step."""

    def homed(self) -> None:
        """Receive the news that the turntable has homed, or that a sweep has begun. Readings follow."""

    def reading(self, reading: Reading) -> None:
        """Receive a new reading."""

    def warn(self, message: str) -> None:
        """Receive a warning that does not end the scan; of a device that turns by itself also in another thread."""


def record_scan(scanner: Scanner, plan: ScanPlan, log: LogWriter | None, watcher: ScanWatcher) -> messages.Outcome:
    """Configure the scanner, home unless the pings are in place, and scan. Record everything in `log`, and close it.

    Returns DONE or STOPPED. What is probably wrong in the readings of a whole scan is a warning, or a DeviceError if
    they are of no use. If the scan ends before its first reading, no log is written, and an existing log is
    not overwritten. Raises what `Scanner.scan` and `LogWriter` raise. If the scanner is lost, the error
    states how many readings are kept. None as `log` records nothing.
    """
    if log is None:
        return _run_scan(scanner, plan, watcher, watcher.reading)
    count, outcome = 0, messages.Outcome.STOPPED

    def deliver(reading: Reading) -> None:
        nonlocal count
        count += 1
        watcher.reading(reading)

    with log:
        scanner.record(log)
        try:
            outcome = _run_scan(scanner, plan, watcher, deliver, log.path)
        except (errors.LinkError, errors.DeviceError, errors.InputError) as error:
            if count and not isinstance(error, errors.LostSteps):  # which is raised after all readings
                error.args = (f"{error}; {errors.counted_are(count, 'reading')} kept in {log.path}",)
            raise
        finally:
            scanner.record(None)
            if scanner.notes:
                log.state_how_read("; ".join(scanner.notes))
            if outcome is messages.Outcome.STOPPED and not count:
                log.drop()
    return outcome


def _run_scan(
    scanner: Scanner,
    plan: ScanPlan,
    watcher: ScanWatcher,
    deliver: Callable[[Reading], None],
    path: Path | None = None,
) -> messages.Outcome:
    speed = plan.air.speed_of_sound(scanner.info.temperature_c)
    scanner.configure(2 * plan.reach / speed, plan.blanking, plan.traces, speed)
    if path is not None:
        _warn_if_disk_is_too_small(scanner, plan, path, watcher)
    scanner.report_doubts(watcher.warn)
    checked = deque[Reading](maxlen=_MOST_CHECKED)
    with scanner.sequence():  # a stop between two steps also ends the later steps
        if watcher.stop_wanted or (
            not plan.order.in_place and scanner.home(plan.zero_here) is messages.Outcome.STOPPED
        ):
            return messages.Outcome.STOPPED
        waiting = not scanner.takes_orders  # for the start of a sweep
        if not waiting:
            watcher.homed()
        for reading in scanner.scan(plan.order):
            if waiting:
                waiting = False
                watcher.homed()
            checked.append(replace(reading, trace=None))
            deliver(reading)
    if scanner.unverified_angles:
        watcher.warn(scanner.unverified_angles)
    if not (watcher.stop_wanted or plan.order.in_place):
        _check_readings(scanner, plan, speed, [*checked], watcher)
    return messages.Outcome.STOPPED if watcher.stop_wanted else messages.Outcome.DONE


def _check_readings(
    scanner: Scanner, plan: ScanPlan, speed: float, readings: Sequence[Reading], watcher: ScanWatcher
) -> None:
    """Report what is probably wrong in the readings. Raises DeviceError if they are of no use."""
    reach = Reach(scanner.info.board, plan.blanking * speed / 2, plan.reach)
    for doubt in check_scan(readings, reach):
        if doubt.spoils:
            raise errors.DeviceError(f"{scanner.url}: {doubt}")
        watcher.warn(str(doubt))


def _warn_if_disk_is_too_small(scanner: Scanner, plan: ScanPlan, path: Path, watcher: ScanWatcher) -> None:
    if plan.order == until_stopped(plan.order):  # its length is not known
        return
    settings = scanner.settings
    samples = settings.listen * scanner.info.trace_rate if settings and settings.trace else 0.0
    need, free = files.log_size(plan.order.readings, samples), files.free_bytes(path)
    if free is not None and free < need:
        watcher.warn(
            f"{path}: the scan needs about {need / 1e6:.1f} MB and its disk has {free / 1e6:.1f} MB free, "
            f"enough for {free / need:.0%} of it; delete other files"
        )
