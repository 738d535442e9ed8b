"""The thread that opens, reads and reopens the device of a plug-in, and the queue of what arrives."""

import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass

from sonarhw.errors import DeviceError, LinkError, LinkLost, NoAnswer, SonarError
from sonarhw.host.session import PAUSES
from sonarhw.link.link_statistics import LinkStatistics
from sonarhw.plugins.device_plugin import MOST_ANGLE, DevicePlugin, Measurement
from sonarhw.readings import ScanOrder

SILENCE = 10.0  # s without a measurement; a scan then fails
MOST_WAITING = 1024  # reads; while so many wait for a scan, nothing is read
FRESH = 2.0  # s; older arrivals do not belong to a scan that begins now
TICK = 0.05  # s; longest delay until `stop` and `close` take effect


@dataclass(frozen=True)
class Arrival:
    """What one read of the device has returned."""

    time: float  # s since the epoch
    data: bytes
    measurements: tuple[Measurement, ...]
    gap: bool = False  # the device was lost before it


class PluginReader:
    """Reads a device from `start` to `close`. It is opened again after a loss."""

    def __init__(self, plugin: DevicePlugin, now: Callable[[], float], reconnect: float) -> None:
        """`now` returns s since the epoch. A device that does not come back within `reconnect` s is lost."""
        self.loss: SonarError | None = None  # while the device is lost
        self.statistics = LinkStatistics()
        self._plugin = plugin
        self._now = now
        self._reconnect = reconnect
        self._changed = threading.Condition()  # guards what follows
        self._arrived: deque[Arrival] = deque()
        self._in_scan = False
        self._wanted: Callable[[], None] | None = None  # to be called in the thread
        self._failure: BaseException | None = None  # why the thread has ended
        self._closing = threading.Event()
        self._last_measured = 0.0
        self._bytes = bytearray()  # of the present read
        plugin.on_bytes = self._bytes.extend
        self._thread = threading.Thread(target=self._run, name=f"read {plugin.url}", daemon=True)

    def start(self, patience: float) -> None:
        """Open the device, and wait up to `patience` s for a measurement. Raises LinkError, NoAnswer."""
        with self._defects_reported():
            self._plugin.open()
        self._thread.start()
        until = time.monotonic() + patience
        with self._changed:
            while not self.statistics.frames_received:
                self._check_thread()
                if time.monotonic() > until:
                    raise self._no_reading(f"within {patience:g} s")
                self._changed.wait(TICK)

    def begin(self, order: ScanOrder) -> None:
        """Begin a scan. Raises LinkLost."""

        def begin() -> None:
            keep = self._plugin.begin(order)
            fresh = self._now() - FRESH
            self._arrived = deque(one for one in self._arrived if keep and one.time > fresh)
            self._in_scan = True

        self._last_measured = time.monotonic()
        self._call(begin)

    def end(self) -> None:
        """End the scan."""
        self._in_scan = False
        with suppress(SonarError):
            self._call(self._plugin.end)

    def next(self, stop_wanted: Callable[[], bool]) -> Arrival | None:
        """Return the next arrival of the scan; None if `stop_wanted`. Raises NoAnswer after SILENCE, LinkLost."""
        with self._changed:
            while not self._arrived:
                if stop_wanted():
                    return None
                self._check_thread()
                if self.loss is None and time.monotonic() > self._last_measured + SILENCE:
                    raise self._no_reading(f"for {SILENCE:g} s")
                self._changed.wait(TICK)
            arrival = self._arrived.popleft()
            self._changed.notify_all()
        if arrival.measurements or arrival.gap:
            self._last_measured = time.monotonic()
        return arrival

    def close(self) -> None:
        """End the thread and close the device. A second call does nothing."""
        self._closing.set()
        if self._thread.is_alive():
            self._thread.join()
        self._plugin.close()

    def _no_reading(self, when: str) -> NoAnswer:
        return NoAnswer(f"{self._plugin.url}: no reading {when}; {self._plugin.diagnosis}")

    def _check_thread(self) -> None:
        if self._closing.is_set():
            raise LinkLost(f"{self._plugin.url}: the device was closed")
        if self._failure:
            raise self._failure

    def _call(self, function: Callable[[], None]) -> None:
        """Call a function in the thread, between two reads. Raises LinkLost if the thread has ended."""
        with self._changed:
            self._wanted = function
            while self._wanted is not None:
                self._check_thread()
                self._changed.wait(TICK)

    # the thread

    def _run(self) -> None:
        try:
            while not self._closing.is_set():
                with self._defects_reported():
                    self._serve_call()
                    self._read()
        except BaseException as error:  # noqa: BLE001 - raised again in the thread that uses the device
            with self._changed:
                self._failure = error
                self._changed.notify_all()

    @contextmanager
    def _defects_reported(self) -> Iterator[None]:
        """Raise DeviceError for any error that a plug-in must not raise."""
        try:
            yield
        except SonarError:
            raise
        except Exception as error:
            what = f"{type(error).__name__}: {error}"
            raise DeviceError(
                f"{self._plugin.url}: the plug-in has a defect: {what}; report it to its author"
            ) from error

    def _serve_call(self) -> None:
        with self._changed:
            if self._wanted is not None:
                self._wanted()
                self._wanted = None
                self._changed.notify_all()

    def _read(self) -> None:
        try:
            measurements = self._plugin.read()
        except LinkError as error:
            self._reopen(error)
            return
        data = bytes(self._bytes)
        self._bytes.clear()
        if not data and not measurements:
            return
        if any(not one.is_possible for one in measurements):
            raise ValueError(f"{measurements}: expected finite numbers, and an angle within {MOST_ANGLE:g} rad")
        with self._changed:
            self.statistics = self.statistics.more(frames_received=len(measurements), bytes_received=len(data))
            self._add(Arrival(self._now(), data, tuple(measurements)))
            while len(self._arrived) >= MOST_WAITING and self._in_scan and not self._closing.is_set():
                self._changed.wait(TICK)

    def _add(self, arrival: Arrival) -> None:
        self._arrived.append(arrival)
        while not self._in_scan and self._arrived[0].time < arrival.time - FRESH:
            self._arrived.popleft()
        self._changed.notify_all()

    def _reopen(self, error: LinkError) -> None:
        """Open the device again. Raises LinkLost if it does not come back in time."""
        self._plugin.close()
        self.loss = error
        until, pauses = time.monotonic() + self._reconnect, iter(PAUSES)
        while not self._closing.wait(next(pauses, PAUSES[-1])):
            try:
                self._plugin.open()
                break
            except LinkError:
                if time.monotonic() > until:
                    text = f"{error}; the device did not come back within {self._reconnect:g} s"
                    raise LinkLost(text) from error
        with self._changed:
            self.statistics = self.statistics.more(losses=1, reopened=1)
            self.loss = None
            self._add(Arrival(self._now(), b"", (), gap=True))
