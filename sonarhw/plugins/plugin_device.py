"""A plug-in as a device behind the wire protocol, so that scans, logs and the window need nothing else for it.

`PluginLink` calls the plug-in in a thread of its own, because `read` may block. `PluginDevice` answers the host as
every device does, and makes readings of the measurements.
"""

import math
import threading
import time
from collections import deque
from collections.abc import Callable, Generator, Iterator
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from sonarhw.device.protocol import ActionError, Line, ProtocolDevice, RefusalError
from sonarhw.errors import DeviceError, LinkError, LinkLost, SonarError
from sonarhw.link import READ_PATIENCE, LinkStatistics
from sonarhw.plugins.device_plugin import CheckedPlugin, Measurement, start_of
from sonarhw.plugins.sweep_tracker import Placed, SweepTracker
from sonarhw.readings import FloatArray, ScanOrder
from sonarhw.scan_check import ENOUGH_MOTION, Doubt, check_motion, jumps
from sonarhw.sound_speed import speed_of_sound
from sonarhw.wire import messages
from sonarhw.wire.limits import MAX_ECHOES, PROTOCOL_MAJOR, PROTOCOL_MINOR
from sonarhw.wire.readings_of_frames import scan_order

MOST_LEAD = 20_000  # readings before the first whole sweep
SILENCE = 10.0  # s without a measurement; a scan then fails
MOST_WAITING = 1024  # reads; while so many wait for a scan, nothing is read
FRESH = 2.0  # s; older arrivals do not belong to a scan that begins now
STILL = 20.0  # s at one angle; a scan then fails
_WATCHED_FROM = 3.0  # s of a scan, after which its angles and ranges are judged
_WATCHED_EACH = 1.0  # s
_WATCHED = 2000  # newest measurements that are judged
_TICK_US = 1  # two pings must not have the same time, because it identifies them
_POLL = 0.05  # s; longest delay until a call from another thread takes effect
END_WITHIN = 0.9  # s for which `close` waits for a plug-in that blocks
_MOST_REASON = 255  # bytes of a text in Finished


@dataclass(frozen=True)
class Arrival:
    """What one read of a plug-in has returned."""

    time: float  # s since the epoch
    data: bytes
    measurements: tuple[Measurement, ...]


class PluginDevice(ProtocolDevice):
    """The device side of the protocol for a plug-in, without threads and clock. `now` is in s since the epoch.

    A scan of a device that turns by itself consists of whole sweeps; the number of its readings is known at its end.
    After a loss of the link, a scan can be continued.
    """

    def __init__(self, plugin: CheckedPlugin, order: Callable[[ScanOrder | None], None]) -> None:
        """`order` makes the plug-in begin a scan, or end it (None)."""
        super().__init__(Line(byte_time=0.0))
        self.speedup = math.inf  # the host shares this process, which the system may stop for any time
        self.failure: SonarError | None = None  # why the newest scan failed
        self.tracker: SweepTracker | None = None  # of the newest scan, unless the device takes orders
        self.warn: Callable[[str], None] = lambda doubt: None  # receives each new doubt about the measurements
        self._plugin = plugin
        self._order = order
        self._settings = messages.Settings(0, 0, 0, 0, 0)
        self._interrupted = False  # whether the link was lost during a scan
        self._arrived: deque[Measurement] = deque()
        self._silent = False
        self._number = 0  # of the next reading
        self._fired_us = 0  # of the newest reading
        self._angle = 0
        self._temperature = messages.NO_TEMPERATURE

    def temperature(self) -> int:
        """Return the temperature in the newest measurement."""
        return self._temperature

    def angle(self, now: float) -> int:
        """Return the angle of the newest reading, µdeg."""
        return self._angle

    def info(self, sequence: int) -> messages.Info:
        """Return the identity. The zero of the turntable is where the device measures 0."""
        about = self._plugin.identity
        texts = about.name, about.serial, about.board
        return messages.Info(
            sequence, PROTOCOL_MAJOR, PROTOCOL_MINOR, *texts, messages.NO_TEMPERATURE, 0, 0, homed=messages.Zero.MARK
        )

    def configure(self, request: messages.Configure, sequence: int) -> messages.Settings:
        """Use the speed of sound, the listening time and the number of echoes for the readings."""
        self._settings = messages.Settings(
            sequence, request.listen_us, request.blanking_us, 0, request.speed_of_sound, echoes=request.echoes
        )
        return self._settings

    def homing(self, now: float) -> Iterator[float]:
        """End at once."""
        return iter(())

    def turning(self, order: messages.Turn, now: float) -> Iterator[float]:
        """Refuse."""
        raise RefusalError(messages.Refusal.UNKNOWN, "this device cannot be turned by a command")

    def scanning(self, order: messages.StartScan, now: float) -> tuple[int, Iterator[float]]:
        """Begin a scan, or continue the one that the loss of the link has interrupted."""
        continued = self._interrupted and (order.first > 0 or order.count > 0)
        self._interrupted, self._silent, self.failure, self._number = False, False, None, order.first
        self._fired_us = max(
            messages.microseconds_of(now), self._fired_us
        )  # the host ignores readings before its order
        if not continued:
            self._begin(order)
        elif self.tracker:
            self.tracker.gap()
        if self.tracker:
            return 0, self._sweeping(self.tracker)
        whole = scan_order(order)
        return whole.readings, self._obeying(whole, order.first + order.count if order.count else whole.readings)

    def halt(self, now: float) -> None:
        """End the scan after a Stop or a failure. After a loss of the link, it can be continued."""
        if self._interrupted:
            return
        if self.tracker and self.tracker.started and not self.tracker.done:
            self._report_all(self.tracker.flush())
        self._order(None)

    def hang_up(self) -> None:
        """Handle the loss of the link."""
        self._interrupted = self._interrupted or self.busy
        super().hang_up()

    # what the plug-in has measured

    def take(self, arrival: Arrival, now: float) -> None:
        """Continue the running scan with new measurements."""
        self._arrived += (replace(item, time=item.time or arrival.time) for item in arrival.measurements)
        self.wake(now)

    def fall_silent(self, now: float) -> None:
        """End the running scan, because no measurements arrive any more."""
        self._silent = True
        self.wake(now)

    def _begin(self, order: messages.StartScan) -> None:
        self._arrived.clear()
        if self._plugin.takes_orders:
            self.tracker = None
            self._order(scan_order(order))
        else:
            self.tracker = SweepTracker()
            self.tracker.want(order.sweeps)
            self._order(ScanOrder(0.0, 1.0, 1))

    def _sweeping(self, tracker: SweepTracker) -> Iterator[float]:
        """Report whole sweeps. A silent device has ended its sweep if it was as long as the one before.

        A scan whose angles do not turn, or turn at random, fails. Its readings are reported all the same.
        """
        watch = _MotionWatch(self.warn)
        while not tracker.done:
            measurement = yield from self._next()
            if measurement and (doubt := watch.add(measurement)):
                raise self._failed(DeviceError(f"{self._plugin.url}: {doubt}"))
            self._report_all(tracker.add(measurement) if measurement else tracker.flush())
            if not (measurement or tracker.done):
                raise self._failed(self._plugin.no_reading(f"for {SILENCE:g} s"))
            if measurement and tracker.waiting > MOST_LEAD:
                raise self._failed(self._never_turned_back(measurement))
        while watch.suspects:  # a few angles in no order look like short sweeps
            measurement = yield from self._next()
            if measurement is None:
                break
            watch.add(measurement)
        self._order(None)
        doubt = watch.verdict()
        if doubt and doubt.kind in ("still", "jumping"):  # a first plug-in may well report one range at all angles
            raise self._failed(DeviceError(f"{self._plugin.url}: {doubt}"))

    def _obeying(self, order: ScanOrder, end: int) -> Iterator[float]:
        """Report one reading for each ping of the order, up to number `end`."""
        while self._number < end:
            measurement = yield from self._next()
            if measurement is None:
                raise self._failed(self._plugin.no_reading(f"for {SILENCE:g} s"))
            sweep, _, ping = order.ping_at(self._number)
            self._report_all([Placed(sweep, ping, measurement)])
        self._order(None)

    def _next(self) -> Generator[float, None, Measurement | None]:
        """Wait for the next measurement. Return None if the device has fallen silent."""
        while not (self._arrived or self._silent):
            yield math.inf
        return self._arrived.popleft() if self._arrived else None

    def _report_all(self, ready: list[Placed]) -> None:
        for placed in ready:
            measured = placed.measurement
            time_us = messages.microseconds_of((measured.time or 0.0) - (self._start_time or 0.0))
            self._fired_us = max(time_us, self._fired_us + _TICK_US)
            self._angle = messages.microdegrees_of(measured.angle)
            self._temperature = messages.centidegrees_of(measured.temperature_c)
            reading = messages.ReadingMessage(
                number=self._number,
                sweep=placed.sweep % 0x10000,
                ping=min(placed.ping, 0xFF),
                angle=self._angle,
                fired_us=self._fired_us,
                temperature=self._temperature,
                echoes=self._echoes(measured),
            )
            self._number += 1
            self.report(reading, (), self._now)

    def _echoes(self, measured: Measurement) -> tuple[int, ...]:
        """Return the times of the echoes within the listening time, ns."""
        speed = self._settings.speed_of_sound * 1e-3
        times = sorted(2 * distance / speed for distance in measured.ranges)
        heard = [
            messages.nanoseconds_of(time) for time in times if 0 < time <= messages.seconds_of(self._settings.listen_us)
        ]
        return tuple(heard[: min(self._settings.echoes, MAX_ECHOES)])

    # failures

    def _failed(self, error: SonarError) -> ActionError:
        self.failure = error
        return ActionError(start_of(str(error).removeprefix(f"{self._plugin.url}: "), _MOST_REASON))

    def _never_turned_back(self, newest: Measurement) -> DeviceError:
        return DeviceError(
            f"{self._plugin.url}: the angle did not turn back in {MOST_LEAD} readings, and is "
            f"{math.degrees(newest.angle):.1f}° now; check that the motor turns"
        )


class _MotionWatch:
    """Judges the angles and ranges of a device that turns by itself, once a second during a scan."""

    def __init__(self, warn: Callable[[str], None]) -> None:
        """`warn` receives each kind of doubt once."""
        self._warn = warn
        self._measured: deque[tuple[float, float, float]] = deque(maxlen=_WATCHED)  # time s, angle rad, range m
        self._began = self._next = math.nan  # s
        self._told: set[str] = set()

    def add(self, measurement: Measurement) -> Doubt | None:
        """Add a measurement. Return a doubt if the scan cannot succeed any more."""
        time = measurement.time or 0.0
        if math.isnan(self._began):
            self._began, self._next = time, time + _WATCHED_FROM
        self._measured.append((time, measurement.angle, min(measurement.ranges, default=math.nan)))
        if time < self._next:
            return None
        self._next = time + _WATCHED_EACH
        doubt = self.verdict()
        if doubt is None:
            return None
        if doubt.kind not in self._told:
            self._told.add(doubt.kind)
            self._warn(str(doubt))
        return doubt if doubt.kind == "still" and time > self._began + STILL else None

    @property
    def suspects(self) -> bool:
        """Whether the angles may be in no order, and more of them are needed to judge this."""
        return len(self._measured) < ENOUGH_MOTION and jumps(self._arrays[0])

    def verdict(self) -> Doubt | None:
        """Return what is wrong with the newest measurements; None if nothing is."""
        return check_motion(*self._arrays)

    @property
    def _arrays(self) -> tuple[FloatArray, FloatArray]:
        """Angles, rad, and ranges, m, NaN for no echo."""
        _, angles, ranges = np.array(self._measured, np.float64).reshape(-1, 3).T
        return angles, ranges


class PluginLink:
    """The link to a `PluginDevice`. `open` and `close` may alternate; in between, one thread calls the plug-in.

    The thread of the host calls everything but `wake`, `cancel`, `await_measurement` and what describes the device.
    """

    bauds, quiet = False, 0.0

    def __init__(self, plugin: CheckedPlugin) -> None:
        self.record: Callable[[float, bytes], None] = lambda time, data: None  # receives the bytes of the device
        self.takes_orders = plugin.takes_orders
        self._plugin = plugin
        self._device = PluginDevice(self._plugin, self._set_order)
        self.settings = messages.Configure(
            62_500, 0, 0, messages.millimetres_per_second_of(speed_of_sound())
        )  # before `configure`
        self._now: Callable[[], float] = time.time
        self._changed = threading.Condition()  # guards what follows
        self._arrived: deque[Arrival] = deque()
        self._ordered: ScanOrder | None = None  # what the plug-in is to do; None: no scan
        self._begun: ScanOrder | None = None  # what it does
        self._measurements = self._bytes = 0  # so far
        self._is_open = False
        self._failure: BaseException | None = None  # why the thread has ended
        self._in_scan = False
        self._woken = self._cancelled = False
        self._closing = threading.Event()
        self._thread: threading.Thread | None = None
        self._last_measured = 0.0

    # the device

    @property
    def failure(self) -> SonarError | None:
        """Why the newest scan failed."""
        return self._device.failure

    def report_doubts(self, warn: Callable[[str], None]) -> None:
        """Pass doubts about the measurements of a scan to `warn` as they arise, in the thread of the host."""
        self._device.warn = warn

    @property
    def notes(self) -> tuple[str, ...]:
        """What was assumed about the measurements."""
        return self._plugin.notes

    @property
    def ignored(self) -> dict[str, int]:
        """How much of the received data was no reading of the newest scan, by kind, without zeros."""
        counts, tracker = self._plugin.ignored, self._device.tracker
        if tracker:
            counts["angles far from their neighbours"] = tracker.dropped
            counts["readings before the first whole sweep"] = tracker.left_out
        return {kind: count for kind, count in counts.items() if count}

    def statistics(self, of_link: LinkStatistics) -> LinkStatistics:
        """Return the counters of the traffic. A frame is a measurement, a rejected block is anything else."""
        tracker = self._device.tracker
        return LinkStatistics(
            frames_received=self._measurements,
            bytes_received=self._bytes,
            rejected_blocks=sum(self._plugin.ignored.values()),
            losses=of_link.losses,
            reopened=of_link.reopened,
            resets=tracker.restarts if tracker else 0,
        )

    def await_measurement(self, patience: float) -> None:
        """Wait up to `patience` s for the first measurement. Raises NoAnswer."""
        until = time.monotonic() + patience
        with self._changed:
            while not self._measurements:
                if self._failure and not isinstance(self._failure, LinkError):
                    raise self._failure
                if time.monotonic() > until:
                    raise self._plugin.no_reading(f"within {patience:g} s")
                self._changed.wait(_POLL)

    # the link

    def open(self, now: Callable[[], float]) -> Self:
        """Open the device. `now` returns s since the epoch. Raises what the plug-in raises."""
        if self._thread and self._thread.is_alive():
            raise LinkError(f"{self._plugin.url}: the plug-in does not return; start this program again")
        self._now = now
        self._device.hang_up()
        self._arrived.clear()
        self._is_open, self._failure, self._closing = False, None, threading.Event()
        self._last_measured = time.monotonic()
        name = f"read {self._plugin.url}"
        self._thread = threading.Thread(target=self._run, args=(self._closing,), name=name, daemon=True)
        self._thread.start()
        with self._changed:
            while not (self._is_open or self._failure or self._cancelled):
                self._changed.wait(_POLL)
        if self._cancelled:
            self._closing.set()
            raise LinkLost(f"{self._plugin.url}: the scanner was closed")
        if self._failure:
            raise self._failure
        return self

    def set_baud(self, baud: int) -> None:
        """Do nothing."""

    def write(self, data: bytes) -> None:
        """Pass the bytes of the host to the device."""
        self._device.receive(data, self._now())

    def read(self) -> bytes:
        """Return the bytes of the device. Waits for the first one, as `Link.read`. Raises what the plug-in raises."""
        if data := self._exchange():
            return data
        event = self._device.next_event()
        wait = READ_PATIENCE if event is None else min(READ_PATIENCE, max(0.0, event - self._now()))
        with self._changed:
            if not (self._woken or self._failure or self._can_continue):
                self._changed.wait(wait)
            self._woken = False
        return self._exchange()

    def wake(self) -> None:
        """End the wait of `read`."""
        with self._changed:
            self._woken = True
            self._changed.notify_all()

    def cancel(self) -> None:
        """Make a waiting `open` fail."""
        self._cancelled = True

    def close(self) -> None:
        """End the thread, which closes the device. The process of a plug-in that blocks is ended."""
        self._closing.set()
        if self._thread:
            self._thread.join(END_WITHIN)
            if self._thread.is_alive():
                self.stop()

    def stop(self) -> None:
        """End the process of the plug-in, if it has one. A second call does nothing."""
        self._plugin.stop()

    @property
    def _can_continue(self) -> bool:
        """Whether something has arrived for the running scan."""
        return bool(self._arrived) and self._in_scan and self._begun is not None and self._begun is self._ordered

    def _exchange(self) -> bytes:
        now, arrival = self._now(), self._take()
        if arrival:
            if arrival.data:
                self.record(arrival.time, arrival.data)
            self._device.take(arrival, now)
            if arrival.measurements:
                self._last_measured = time.monotonic()
        elif self._in_scan and time.monotonic() > self._last_measured + SILENCE:
            self._device.fall_silent(now)
        data = self._device.advance(now)
        self._in_scan = self._device.busy
        return data

    def _take(self) -> Arrival | None:
        with self._changed:
            if self._can_continue:
                self._changed.notify_all()
                return self._arrived.popleft()
            if self._failure:
                raise self._failure
            return None

    def _set_order(self, order: ScanOrder | None) -> None:
        self._last_measured = time.monotonic()
        with self._changed:
            self._ordered = order

    # the thread

    def _run(self, closing: threading.Event) -> None:
        try:
            self._plugin.open()
            try:
                with self._changed:
                    self._is_open = True
                while not closing.is_set():
                    self._obey()
                    self._read(closing)
                self._obey()
            finally:
                self._plugin.close()
        except BaseException as error:  # noqa: BLE001 - raised again in the thread that reads the link
            self._failure = error
        finally:
            with self._changed:
                self._changed.notify_all()

    def _obey(self) -> None:
        """Begin or end a scan, if this is wanted."""
        ordered = self._ordered
        if ordered is self._begun:
            return
        if self._begun is not None:
            self._begun = None
            self._plugin.end()
        if ordered is None:
            return
        keep = self._plugin.begin(ordered)
        with self._changed:
            fresh = self._now() - FRESH
            self._arrived = deque(arrival for arrival in self._arrived if keep and arrival.time > fresh)
            self._begun = ordered

    def _read(self, closing: threading.Event) -> None:
        data, measurements = self._plugin.read()
        if not (data or measurements):
            return
        with self._changed:
            arrival = Arrival(self._now(), data, measurements)
            self._measurements += len(measurements)
            self._bytes += len(data)
            self._arrived.append(arrival)
            while not self._in_scan and self._arrived[0].time < arrival.time - FRESH:
                self._arrived.popleft()
            self._changed.notify_all()
            while len(self._arrived) >= MOST_WAITING and self._can_continue and not closing.is_set():
                self._changed.wait(_POLL)
