"""A scanner made of a plug-in for a device that does not speak the wire protocol."""

import math
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from dataclasses import replace
from types import TracebackType
from typing import Self

from sonarhw.errors import DeviceError, InputError, LinkError, NoAnswer, SonarError
from sonarhw.host.device_info import DeviceInfo, PingSettings, ping_settings
from sonarhw.host.exclusive_use import ExclusiveUse
from sonarhw.host.recorder import Recorder
from sonarhw.host.session import PATIENCE, RECONNECT, Connection
from sonarhw.link.link_statistics import LinkStatistics
from sonarhw.plugins.device_plugin import DevicePlugin, Measurement
from sonarhw.plugins.plugin_frames import PluginFrames
from sonarhw.plugins.plugin_reader import PluginReader
from sonarhw.plugins.sweep_tracker import Placed, SweepTracker
from sonarhw.readings import Reading, ScanOrder
from sonarhw.sound_speed import ScanAir
from sonarhw.wire.codes import Outcome

MOST_LEAD = 20_000  # readings before the first whole sweep
_ONE_SWEEP = ScanOrder(0.0, 1.0, 1)


class PluginScanner:
    """A connected device of a plug-in, with the interface of `Scanner`.

    One thread may use it. Other threads may call `stop` and read its state.
    """

    def __init__(
        self,
        plugin: DevicePlugin,
        recorder: Recorder | None = None,
        patience: float = PATIENCE,
        reconnect: float = RECONNECT,
        on_close: Callable[[], None] = lambda: None,
    ) -> None:
        """Open the device and wait up to `patience` s for its first measurement.

        If it is lost later and comes back within `reconnect` s, a scan continues. `on_close` is called after the device
        is closed. Raises LinkError, and NoAnswer if no measurement arrives.
        """
        self.url = plugin.url
        self.scan_began = 0.0  # start of the last scan on the clock of `Reading.time`, s
        self.unverified_angles: str | None = None
        self._plugin = plugin
        self._on_close = on_close
        self._epoch = time.time() - time.monotonic()
        self._frames = PluginFrames(plugin.identity, self._now())
        self._reader = PluginReader(plugin, self._now, reconnect)
        self._use = ExclusiveUse(plugin.url, at_end=lambda: self._finish(Outcome.STOPPED))
        self._closed = False
        self._in_scan = False
        self._tracker: SweepTracker | None = None  # of the newest scan
        self._ready: list[Placed] = []  # readings of the scan that `home` has begun
        self._pending: deque[Measurement] = deque()  # arrived, not yet processed
        try:
            self._reader.start(patience)
            self.record(recorder)
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    # identity and state

    @property
    def state(self) -> Connection:
        """State of the connection. MOVING: waits for the start of a whole sweep."""
        if self._reader.loss is not None:
            return Connection.LOST
        if not self._in_scan:
            return Connection.READY
        return Connection.STREAMING if self._tracker is None or self._tracker.started else Connection.MOVING

    @property
    def loss(self) -> SonarError | None:
        """Reason of a loss, while the device is lost."""
        return self._reader.loss

    @property
    def info(self) -> DeviceInfo:
        """Identity of the device. Its protocol version 0 means that it does not speak this protocol."""
        identity = self._plugin.identity
        return DeviceInfo(identity.name, (0, 0), identity.serial, identity.board, None, 0.0, 0, 0, None)

    @property
    def takes_orders(self) -> bool:
        """Whether the angles of a scan can be chosen; else the device turns by itself."""
        return self._plugin.takes_orders

    @property
    def settings(self) -> PingSettings | None:
        """The settings with which readings are made of measurements."""
        return ping_settings(self._frames.settings)

    @property
    def baud(self) -> int | None:
        """None: only the plug-in knows the baud rate."""
        return None

    @property
    def statistics(self) -> LinkStatistics:
        """Counters of the traffic. A frame is a measurement, a rejected block is anything else."""
        restarts = self._tracker.restarts if self._tracker else 0
        ignored = sum(self._plugin.ignored.values())
        return replace(self._reader.statistics, rejected_blocks=ignored, resets=restarts)

    @property
    def clock_drift(self) -> float:
        """0: readings have the host's time."""
        return 0.0

    @property
    def ignored(self) -> dict[str, int]:
        """How much of the received data was no reading of the scan, by kind, without zeros."""
        counts = dict(self._plugin.ignored)
        if self._tracker:
            counts["angles far from their neighbours"] = self._tracker.dropped
            counts["readings before the first whole sweep"] = self._tracker.left_out
        return {kind: count for kind, count in counts.items() if count}

    def record(self, recorder: Recorder | None) -> None:
        """Pass the identity, and then everything received in scans, to `recorder`. None ends the recording."""
        self._frames.use(recorder, self._now())

    # actions

    def configure(
        self,
        listen: float = 0.0625,
        blanking: float = 0.0,
        trace: bool = False,
        speed_of_sound: float | None = None,
    ) -> PingSettings:
        """Set the speed of sound (m/s) of the readings, and the listening time (s). Later echoes are ignored.

        By default, the speed of sound is that at 20 °C. `trace` has no effect. Raises DeviceError during a scan.
        """
        speed = ScanAir().speed_of_sound(None) if speed_of_sound is None else speed_of_sound
        with self._use.action():
            self._frames.configure(listen, blanking, speed, self._now())
        return ping_settings(self._frames.settings)

    def home(self, here: bool = False) -> Outcome:
        """Wait for the start of a sweep, where a scan in the same `sequence` begins.

        Returns DONE, or STOPPED after `stop`. Raises what `scan` raises, and InputError for `here`.
        """
        if here:
            raise InputError(f"{self.url}: the zero of this device cannot be set by a command")
        with self._use.action():
            if not self._plugin.takes_orders:
                self._wait_for_sweep()
            return Outcome.STOPPED if self._use.stop_wanted else Outcome.DONE

    def turn(self, angle: float) -> Outcome:
        """Raise InputError."""
        raise InputError(f"{self.url}: this device cannot be turned by a command; `scan` records its readings")

    def scan(self, order: ScanOrder | None = None) -> Iterator[Reading]:
        """Scan, and yield each reading.

        A device that turns by itself ends after `order.sweeps` whole sweeps, one that takes orders after all readings
        of `order`. Raises NoAnswer if no measurement arrives for 10 s, and LinkLost if the device does not come back.
        """
        order = order or _ONE_SWEEP
        with self._use.action():
            completed = False
            try:
                yield from self._ordered(order) if self._plugin.takes_orders else self._swept(order.sweeps)
                completed = not self._use.stop_wanted
            finally:
                self._finish(Outcome.DONE if completed else Outcome.STOPPED)

    def sequence(self) -> AbstractContextManager[None]:
        """Combine the actions in a block: a `stop` during or between them also ends the later ones.

        Raises DeviceError while another thread uses the scanner.
        """
        return self._use.sequence()

    def stop(self) -> None:
        """End the running scan. Any thread may call this. The scan keeps its readings."""
        self._use.stop_wanted = True

    def close(self) -> None:
        """Close the device. A second call does nothing."""
        if not self._closed:
            self._closed = True
            self._reader.close()
            self._on_close()

    # scans

    def _swept(self, sweeps: int) -> Iterator[Reading]:
        tracker = self._wait_for_sweep()
        tracker.want(sweeps)
        # a whole turn before the start may be all that is wanted; the next reading is then too much
        ready = [placed for placed in self._ready if not tracker.done or placed.sweep < sweeps]
        try:
            yield from self._readings(ready)
            while not tracker.done and (measurement := self._next_measurement()):
                yield from self._readings(tracker.add(measurement))
        except (NoAnswer, LinkError):
            yield from self._readings(tracker.flush())
            if not tracker.done:
                raise
        if not tracker.done:
            yield from self._readings(tracker.flush())

    def _wait_for_sweep(self) -> SweepTracker:
        """Return the tracker of the scan, at the start of a whole sweep or after `stop`."""
        if self._in_scan and self._tracker:  # begun by `home`
            return self._tracker
        self._tracker = tracker = SweepTracker()
        self._begin(_ONE_SWEEP)
        try:
            while not tracker.started and (measurement := self._next_measurement()):
                self._ready += tracker.add(measurement)
                if tracker.waiting > MOST_LEAD:
                    raise self._never_turned_back(measurement)
        except (NoAnswer, LinkError):
            # the device has stopped before its angle turned back: the scan gives what there is, then fails
            self._ready = tracker.flush()
            if not self._ready:
                raise
        return tracker

    def _never_turned_back(self, newest: Measurement) -> DeviceError:
        return DeviceError(
            f"{self.url}: the angle did not turn back in {MOST_LEAD} readings, and is "
            f"{math.degrees(newest.angle):.1f}° now; check that the motor turns"
        )

    def _ordered(self, order: ScanOrder) -> Iterator[Reading]:
        self._tracker = None
        self._begin(order)
        for number in range(order.readings):
            measurement = self._next_measurement()
            if measurement is None:
                return
            sweep, _, ping = order.ping_at(number)
            yield from self._readings([Placed(sweep, ping, measurement)])

    def _readings(self, ready: list[Placed]) -> Iterator[Reading]:
        for placed in ready:
            yield self._frames.reading(placed, self._now())

    def _begin(self, order: ScanOrder) -> None:
        self._reader.begin(order)
        self._in_scan = True
        self._ready = []
        self._pending.clear()
        self.scan_began = self._frames.begin(self._now())

    def _finish(self, outcome: Outcome) -> None:
        if self._in_scan:
            self._in_scan = False
            try:
                self._frames.finish(outcome, self._now())
            finally:
                self._reader.end()

    def _next_measurement(self) -> Measurement | None:
        """Return the next measurement; None after `stop`. Records what has arrived."""
        while not self._pending:
            arrival = self._reader.next(lambda: self._use.stop_wanted)
            if arrival is None:
                return None
            self._frames.received(arrival.data, arrival.time)
            if arrival.gap and self._tracker:
                self._tracker.gap()
            self._pending.extend(replace(one, time=one.time or arrival.time) for one in arrival.measurements)
        return None if self._use.stop_wanted else self._pending.popleft()

    def _now(self) -> float:
        return self._epoch + time.monotonic()
