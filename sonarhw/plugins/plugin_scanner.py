"""The scanner made of a plug-in: its readings as frames of the wire protocol, in a thread."""

import math
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import dataclass, replace
from enum import Enum
from statistics import median
from types import TracebackType
from typing import Protocol, Self, runtime_checkable

from sonarhw.errors import DeviceError, InputError, LinkError, LinkLost, NoAnswer, SonarError
from sonarhw.host.scanner import DeviceInfo, ExclusiveUse, PingSettings, ping_settings
from sonarhw.host.session import PATIENCE, PAUSES, RECONNECT, Connection, Recorder
from sonarhw.link import LinkStatistics
from sonarhw.plugins.device_plugin import MOST_ANGLE, DeviceIdentity, DevicePlugin, Measurement
from sonarhw.readings import Reading, ScanOrder
from sonarhw.sound_speed import ScanAir, speed_of_sound
from sonarhw.wire.frames import Frame, encode_frame
from sonarhw.wire.messages import (
    MAX_ECHOES,
    MAX_TEXT,
    PROTOCOL_MAJOR,
    PROTOCOL_MINOR,
    Finished,
    Info,
    Message,
    Outcome,
    ReadingMessage,
    Settings,
    Started,
    centidegrees_of,
    microdegrees_of,
    microseconds_of,
    millimetres_per_second_of,
    nanoseconds_of,
    seconds_of,
)
from sonarhw.wire.readings_of_frames import DeviceClock, ReadingAssembler

# The thread that opens, reads and reopens the device of a plug-in, and the queue of what arrives.


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


# Assigns the measurements of a device that turns by itself to sweeps.
#
# A sweep ends where the angle turns back (a servo), jumps back to its start, or completes a turn of 360°. A scan
# starts in the middle of a sweep. This first part is left out, unless its end shows that it was a whole sweep.
#
# Angles are in radians.


_STEPS = 15  # newest steps, of which the median is the usual step
_FEWEST = 5  # steps after which an angle can be recognised as wrong
_JUMP = 3.0  # usual steps
_FAR = 4.0  # usual steps
_FIRST_STEP = math.radians(30)  # largest step over 0° while the usual one is unknown


@dataclass(frozen=True)
class Placed:
    """A measurement, and its place in the scan."""

    sweep: int
    ping: int  # counts from 0 at each heading
    measurement: Measurement


class _Break(Enum):
    """Why a sweep ends before a measurement."""

    TURN = 0  # the angle turns back
    JUMP = 1  # the angle jumps back
    FULL = 2  # a turn of 360° is complete
    RESTART = 3  # the device has restarted
    GAP = 4  # measurements are missing


class SweepTracker:
    """Divides a scan into sweeps. It is `done` after as many whole ones as `want` states."""

    def __init__(self) -> None:
        self.left_out = 0  # measurements before the first whole sweep
        self.dropped = 0  # measurements with an angle far from both its neighbours
        self.restarts = 0
        self._wanted: int | None = None  # whole sweeps
        self._whole = 0  # whole sweeps so far
        self._sweep = 0
        self._lead: list[Placed] | None = []  # before the first whole sweep; None after its start
        self._held: Measurement | None = None  # the newest, until the next one confirms it
        self._last: Measurement | None = None  # the newest that was placed
        self._ping = 0
        self._pings = 1  # most pings at a heading within a sweep
        self._steps: deque[float] = deque(maxlen=_STEPS)  # absolute
        self._gap = False
        self._span_before = math.nan  # of the sweep before
        # of the present sweep
        self._first = 0.0
        self._at_boundary = False
        self._direction = 0.0  # 1: counter-clockwise, -1: clockwise, 0: unknown
        self._travel = 0.0
        self._wrapped = False  # whether the angle has passed from 360° to 0° or back

    @property
    def started(self) -> bool:
        """Whether a whole sweep has begun."""
        return self._lead is None

    @property
    def done(self) -> bool:
        """Whether enough whole sweeps are complete."""
        return self._wanted is not None and self._whole >= self._wanted

    @property
    def waiting(self) -> int:
        """Number of measurements so far, before the first whole sweep."""
        return len(self._lead or ())

    def want(self, sweeps: int) -> None:
        """Set the number of whole sweeps."""
        self._wanted = sweeps

    def add(self, measurement: Measurement) -> list[Placed]:
        """Add a measurement. Return those that have become certain, in order."""
        held, self._held = self._held, measurement
        if held is None:
            return []
        if self._is_outlier(held, measurement):
            self.dropped += 1
            return []
        return self._place(held, measurement)

    def gap(self) -> None:
        """Handle a loss of the link: the present sweep is not whole, and the next one may begin anywhere."""
        self._held, self._gap = None, True

    def flush(self) -> list[Placed]:
        """Return what is left at the end of a scan; all of it if there was no whole sweep.

        The last sweep is whole if it is as long as the one before.
        """
        held, self._held = self._held, None
        rest = self._place(held, None) if held is not None and not self.done else []
        self._whole += self._at_boundary and self._travel >= self._span_before - self._usual_step / 2
        if self._lead is not None:
            rest, self._lead = self._lead, None
        return rest

    def _place(self, held: Measurement, following: Measurement | None) -> list[Placed]:
        ready: list[Placed] = []
        delta = self._delta(self._last.angle, held.angle) if self._last else 0.0
        broken = self._break_before(held, following, delta)
        if broken is not None:
            ready = self._end_sweep(broken, held.angle)
            if self.done:
                return ready
        elif self._last is not None:
            self._move(delta)
        else:
            self._first = held.angle
        placed = Placed(self._sweep, self._ping, held)
        self._last = held
        if self._lead is not None:
            self._lead.append(placed)
            return ready
        return [*ready, placed]

    def _move(self, delta: float) -> None:
        if delta == 0:
            self._ping += 1
            return
        self._pings = max(self._pings, self._ping + 1) if self._travel else self._pings
        self._ping = 0
        self._direction = self._direction or math.copysign(1.0, delta)
        self._travel += abs(delta)
        self._steps.append(abs(delta))

    def _break_before(self, held: Measurement, following: Measurement | None, delta: float) -> _Break | None:
        if self._last is None:
            return None
        if self._gap:
            return _Break.GAP
        jump = bool(self._steps) and abs(delta) > _JUMP * self._usual_step
        if held.restarted and jump:
            return _Break.RESTART
        ahead = 0.0 if following is None else self._delta(held.angle, following.angle) * self._direction
        if delta * self._direction < 0 and (jump or ahead <= 0):  # a measured angle may shake
            return _Break.JUMP if jump else _Break.TURN
        # many sketches print the last angle twice, first on the way out and then on the way back
        if delta == 0 and self._pings == 1 and self._ping == 0:
            return _Break.TURN if ahead < 0 else None
        if self._wrapped and self._travel + abs(delta) >= 2 * math.pi - self._usual_step / 2:
            return _Break.FULL
        return None

    def _end_sweep(self, broken: _Break, angle: float) -> list[Placed]:
        """End the sweep before `angle`. Return the readings of the first sweep, if it was whole."""
        whole = self._is_whole(broken, angle)
        self._span_before = self._travel
        self._whole += whole
        self.restarts += broken is _Break.RESTART
        ready: list[Placed] = []
        if self._lead is None or whole:
            self._sweep += 1
            ready, self._lead = self._lead or [], None
        else:
            self.left_out += len(self._lead)
            self._lead = [] if broken is _Break.GAP else None
        back = {_Break.TURN: -self._direction, _Break.JUMP: self._direction, _Break.FULL: self._direction}
        self._start_sweep(angle, at_boundary=broken is not _Break.GAP, direction=back.get(broken, 0.0))
        return ready

    def _start_sweep(self, angle: float, at_boundary: bool, direction: float) -> None:
        self._first = angle
        self._at_boundary = at_boundary
        self._direction = direction
        self._travel = 0.0
        self._wrapped = False
        self._ping = 0
        self._gap = False

    def _is_whole(self, broken: _Break, angle: float) -> bool:
        near = self._usual_step / 2
        if broken is _Break.GAP:
            return False
        if broken is _Break.RESTART:  # some devices print a line of text after each sweep
            return self._at_boundary and abs(self._travel - self._span_before) <= near
        back_at_start = broken is _Break.JUMP and abs(angle - self._first) <= near
        return self._at_boundary or broken is _Break.FULL or back_at_start

    @property
    def _usual_step(self) -> float:
        return median(self._steps) if self._steps else 0.0

    def _delta(self, before: float, after: float) -> float:
        """Return the change of the angle. A step over 360° is as large as the other steps."""
        change = after - before
        wrapped = change - math.copysign(2 * math.pi, change)
        most = 1.5 * self._usual_step if self._steps else _FIRST_STEP
        if abs(change) > math.pi and abs(wrapped) <= most:
            self._wrapped = True
            return wrapped
        return change

    def _is_outlier(self, held: Measurement, following: Measurement) -> bool:
        """Return whether an angle is far from its neighbours, which are near each other: a digit was lost."""
        if self._last is None or len(self._steps) < _FEWEST:
            return False
        far = _FAR * self._usual_step
        before, after = self._last.angle, following.angle
        return _apart(before, held.angle) > far and _apart(held.angle, after) > far and _apart(before, after) <= far


def _apart(one: float, other: float) -> float:
    return abs(math.remainder(one - other, 2 * math.pi))


# The readings of a plug-in as frames of the wire protocol, so that one decoder reads all logs.
#
# Readings are decoded from these frames, so they have the values that the log will have.


_TICK = 1  # µs; two pings must not have the same time, because it identifies them


@runtime_checkable
class ByteRecorder(Protocol):
    """A recorder that also stores the bytes of a device that sends no frames."""

    def received_bytes(self, time: float, data: bytes) -> None:
        """Record bytes as received. `time` is in s since the epoch."""


class PluginFrames:
    """Makes readings and frames of measurements, and passes them to a recorder. Times are s since the epoch."""

    def __init__(self, identity: DeviceIdentity, now: float) -> None:
        self.settings = _settings(speed_of_sound(), 0.0625, 0.0)
        self._identity = identity
        self._epoch = now  # device time 0
        self._recorder: Recorder | None = None
        self._assembler = ReadingAssembler(DeviceClock())
        self._sequence = 0
        self._command = 0  # number of the scan
        self._number = 0  # of the next reading
        self._fired_us = 0  # of the newest reading
        self._assembler.feed(self._info())
        self._assembler.feed(self.settings)

    def use(self, recorder: Recorder | None, now: float) -> None:
        """Record with `recorder` from now on."""
        self._recorder = recorder
        for message in (self._info(), self.settings) if recorder else ():
            self._send(message, now)

    def configure(self, listen: float, blanking: float, speed: float, now: float) -> None:
        """Use another listening time (s) and speed of sound (m/s)."""
        self.settings = _settings(speed, listen, blanking)
        self._send(self.settings, now)

    def received(self, data: bytes, now: float) -> None:
        """Record bytes of the device."""
        if data and isinstance(self._recorder, ByteRecorder):
            self._recorder.received_bytes(now, data)

    def begin(self, now: float) -> float:
        """Begin a scan, and return its time on the clock of the readings, s."""
        self._command = (self._command + 1) % 0x10000
        self._number = 0
        self._send(Started(self._command, 0), now)  # the number of readings is not known yet
        self._fired_us = max(self._time_us(now), self._fired_us)
        return seconds_of(self._fired_us)

    def reading(self, placed: Placed, now: float) -> Reading:
        """Return the reading of a measurement, after it was recorded."""
        message = self._message(placed, now)
        self._number += 1
        self._send(message, now)
        (reading,) = self._assembler.feed(message)
        if self._recorder:
            self._recorder.reading(reading)
        return reading

    def finish(self, outcome: Outcome, now: float) -> None:
        """End the scan."""
        self._send(Started(self._command, self._number), now)
        self._send(Finished(self._command, outcome, self._number, ""), now)

    def _message(self, placed: Placed, now: float) -> ReadingMessage:
        measured = placed.measurement
        self._fired_us = max(self._time_us(measured.time or now), self._fired_us + _TICK)
        return ReadingMessage(
            number=self._number,
            sweep=placed.sweep % 0x10000,
            ping=min(placed.ping, 0xFF),
            angle=microdegrees_of(measured.angle),
            fired_us=self._fired_us,
            temperature=centidegrees_of(measured.temperature_c),
            echoes=self._echoes(measured),
        )

    def _echoes(self, measured: Measurement) -> tuple[int, ...]:
        """Return the times of the echoes within the listening time, ns."""
        speed = self.settings.speed_of_sound * 1e-3
        times = sorted(2 * distance / speed for distance in measured.ranges)
        heard = [nanoseconds_of(time) for time in times if 0 < time <= seconds_of(self.settings.listen_us)]
        return tuple(heard[:MAX_ECHOES])

    def _send(self, message: Message, now: float) -> None:
        time_us = self._time_us(now)
        frame = Frame(message.TYPE, self._sequence, time_us, message.pack())
        self._sequence = (self._sequence + 1) % 0x10000
        if not isinstance(message, ReadingMessage):  # `reading` needs the result
            self._assembler.feed(message, time_us, now)
        if self._recorder:
            self._recorder.frame(True, now, encode_frame(frame))

    def _time_us(self, now: float) -> int:
        return max(0, microseconds_of(now - self._epoch))

    def _info(self) -> Info:
        identity = self._identity
        return Info(
            command=0,
            major=PROTOCOL_MAJOR,
            minor=PROTOCOL_MINOR,
            firmware=_short(identity.name),
            serial=_short(identity.serial),
            board=_short(identity.board),
            temperature=centidegrees_of(None),
            trace_rate=0,
            microsteps=0,
        )


def _settings(speed: float, listen: float, blanking: float) -> Settings:
    return Settings(0, microseconds_of(listen), microseconds_of(blanking), 0, millimetres_per_second_of(speed))


def _short(text: str) -> str:
    """Return the start of a text, as long as fits into Info."""
    return text.encode()[:MAX_TEXT].decode(errors="ignore")


# A scanner made of a plug-in for a device that does not speak the wire protocol.


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
