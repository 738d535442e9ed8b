"""From device messages to readings on the clock of the host, for live links, logs and replay."""

import math
from bisect import bisect_right
from collections import deque
from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from sonarhw.readings import FloatArray, Origin, Reading, ScanOrder, Trace, origin_of
from sonarhw.wire import messages
from sonarhw.wire.limits import CHUNK, KEPT_READINGS, LONGEST_TRACE, MAX_ECHOES


class ReadingArrivals:
    """Arrivals of the readings `first` to `total` − 1 of one StartScan. Stores only the numbers of missing readings."""

    def __init__(self, total: int, first: int = 0, kept: int = KEPT_READINGS) -> None:
        self.total = total
        self.made = first  # the device has made all readings before this number
        self.lost = 0  # number of missing readings that the device no longer keeps
        self._first = first
        self._kept = kept
        self._missing: set[int] = set()
        self._requested: tuple[int, int] | None = None  # by the newest Resend
        self._requests = 0  # for the same readings, one after another

    def arrived(self, number: int) -> bool:
        """Record the arrival of a reading. Return False if it arrived before or has an invalid number."""
        if not self._first <= number < self.total:
            return False
        self.device_made(number + 1)
        if number not in self._missing:
            return False
        self._missing.discard(number)
        return True

    def device_made(self, count: int) -> None:
        """Record that the device has made the readings before `count`, whether they arrived or not."""
        count = min(count, self.total)
        if count > self.made:
            oldest = max(self.made, count - self._kept)
            self.lost += oldest - self.made
            self._missing.update(range(oldest, count))
            self.made = count
        self._give_up({number for number in self._missing if number < self.made - self._kept})

    def next_resend(self) -> tuple[int, int] | None:
        """Return first number and count (1 to `kept`) of the next Resend, or None if no reading is missing."""
        if not self._missing:
            return None
        first = min(self._missing)
        # at most `kept` readings are missing; older ones are lost
        return first, max(self._missing) - first + 1

    def request(self, most: int) -> tuple[int, int] | None:
        """Return what `next_resend` returns, as a request. After `most` for the same readings, they are lost: None."""
        wanted = self.next_resend()
        self._requests = self._requests + 1 if wanted == self._requested else 1
        self._requested = wanted
        if self._requests > most:
            self.give_up()
            return None
        return wanted

    def give_up(self) -> None:
        """Count all missing readings as lost."""
        self._give_up(set(self._missing))

    def _give_up(self, numbers: set[int]) -> None:
        self.lost += len(numbers)
        self._missing -= numbers


class Progress:
    """Progress of a scan of `total` readings over one or more StartScans. Stores the stretches of missing numbers."""

    def __init__(self, total: int) -> None:
        self.total = total
        self.received = 0
        self._next = 0  # one more than the highest number that has arrived
        self._holes: list[range] = []  # missing numbers below _next, in order

    @property
    def complete(self) -> bool:
        """Whether every reading has arrived."""
        return self.received == self.total

    @property
    def missing(self) -> int:
        """Number of missing readings with lower numbers than the highest that has arrived."""
        return self._next - self.received

    def take(self, number: int) -> bool:
        """Record the arrival of a reading. Return False if it arrived before or has an invalid number."""
        if self._next <= number < self.total:
            if number > self._next:
                self._holes.append(range(self._next, number))
            self._next = number + 1
        elif not self._fill(number):
            return False
        self.received += 1
        return True

    def _fill(self, number: int) -> bool:
        index = bisect_right(self._holes, number, key=lambda hole: hole.start) - 1
        if index < 0 or number not in self._holes[index]:
            return False
        hole = self._holes[index]
        rest = range(hole.start, number), range(number + 1, hole.stop)
        self._holes[index : index + 1] = [part for part in rest if part]
        return True

    def next_missing(self) -> tuple[int, int] | None:
        """Return first number and count of the next consecutive missing readings, or None if all have arrived."""
        if not self._holes:
            return (self._next, self.total - self._next) if self._next < self.total else None
        return self._holes[0].start, len(self._holes[0])


_BUCKET = 1.0  # s
_BUCKETS = 60  # in the fit; one minute is enough to measure a drift of 10⁻⁵ with 0.5 ms of jitter
_FEWEST = 5  # with fewer buckets, a drift of 0 is assumed
MOST_DRIFT = 0.02  # limit of the fitted drift; that of a ceramic resonator is below 0.005
_RAN_BACK = 1.0  # s; frames arrive in order, so a larger step back is a reset

_Sample = tuple[float, float]  # device, host


class DeviceClock:
    """The clock of one device relative to the host's clock. Times in s. It continues across resets of the device.

    Frames arrive with a varying delay, never early. So a straight line is fitted to the frames with the least delay in
    each second.
    """

    def __init__(self) -> None:
        self.resets = 0
        self.drift = 0.0  # s that the host's clock gains per second of device time
        self._boot = 0
        self._restarted = False
        self._before = 0.0  # s added to device time, so that it continues across resets
        self._newest = 0.0  # continued device time of the newest frame, s
        self._best: deque[_Sample] = deque(maxlen=_BUCKETS)
        self._centre = (0.0, 0.0)

    @property
    def known(self) -> bool:
        """Whether any frame has been added."""
        return bool(self._best)

    def set_boot(self, boot: int) -> None:
        """Set the boot count from Info; a changed count means a reset. 0: the device does not count."""
        self._restarted = bool(boot and self._boot and boot != self._boot)
        self._boot = boot

    def add_frame(self, device_us: int, arrived: float) -> None:
        """Add a frame with device time `device_us` that arrived at host time `arrived`."""
        device = messages.seconds_of(device_us)
        if self._restarted or (self.known and self._before + device < self._newest - _RAN_BACK):
            self._restart(device, arrived)
        device += self._before
        self._newest = max(self._newest, device)
        if self._best and device < self._best[-1][0] // _BUCKET * _BUCKET + _BUCKET:
            if arrived - device < self._best[-1][1] - self._best[-1][0]:
                self._best[-1] = (device, arrived)
                self._fit()
        else:
            self._best.append((device, arrived))
            self._fit()

    def continued(self, device_us: int) -> float:
        """Return the device time as if the device had never been reset, s."""
        return self._before + messages.seconds_of(device_us)

    def host_time(self, continued: float) -> float | None:
        """Return the host time at a continued device time, or None before the first frame."""
        device, host = self._centre
        return host + (continued - device) * (1 + self.drift) if self.known else None

    def _restart(self, device: float, arrived: float) -> None:
        self.resets += 1
        self._restarted = False
        centre, host = self._centre
        now = centre + (arrived - host) / (1 + self.drift)
        self._before = max(now, self._newest) - device
        self._newest = self._before + device

    def _fit(self) -> None:
        device, host = np.array(self._best, dtype=np.float64).T
        late = host - device
        if len(self._best) < _FEWEST:
            least = int(np.argmin(late))
            self._centre = (float(device[least]), float(host[least]))
            return
        middle = device - device.mean()
        slope = float(middle @ (late - late.mean()) / (middle @ middle))
        self.drift = min(max(slope, -MOST_DRIFT), MOST_DRIFT)
        self._centre = (float(device.mean()), float(host.mean()))


# readings, traces and scan orders as messages


def reading_message(reading: Reading, speed_of_sound: int) -> messages.ReadingMessage:
    """Return the message of a reading, with echo times that give the same ranges at `speed_of_sound`, mm/s.

    Contains the earliest MAX_ECHOES echoes. Packing raises MessageError if a value does not fit.
    """
    scale = reading.speed_of_sound / (speed_of_sound * 1e-3) * 1e9
    return messages.ReadingMessage(
        number=reading.number,
        sweep=reading.sweep,
        ping=reading.ping,
        angle=messages.microdegrees_of(reading.angle),
        fired_us=messages.microseconds_of(reading.time),
        temperature=messages.centidegrees_of(reading.temperature_c),
        echoes=tuple(round(time * scale) for time in reading.echo_times[:MAX_ECHOES]),
    )


def trace_chunks(number: int, trace: Trace) -> Iterator[messages.TraceChunk]:
    """Yield the messages of the trace of reading `number`, 8 bits per sample, at most 65 535 samples.

    Missing samples (NaN) are marked as lost; chunks without any sample are omitted.
    """
    samples = (trace.samples[:LONGEST_TRACE] + 1) / 2 if trace.carrier else trace.samples[:LONGEST_TRACE]
    levels = np.clip(np.rint(samples * messages.FULL_SCALE), 0, messages.FULL_SCALE)
    kind = messages.TraceKind.CARRIER if trace.carrier else messages.TraceKind.ENVELOPE
    period, start = round(1e9 / trace.rate), messages.nanoseconds_of(trace.start)
    for offset in range(0, len(levels), CHUNK):
        stretch = levels[offset : offset + CHUNK]
        lost = np.isnan(stretch)
        if not lost.all():
            sent, gaps = np.nan_to_num(stretch).astype(np.uint8), np.flatnonzero(lost).astype(np.uint8)
            yield messages.TraceChunk(
                number, offset, len(levels), period, start, sent.tobytes(), kind, lost=gaps.tobytes()
            )


def scan_order(message: messages.StartScan) -> ScanOrder:
    """Return the whole scan of which `message` requests all or a part."""
    return ScanOrder(
        messages.radians_of(message.start),
        messages.radians_of(message.step),
        message.headings,
        message.sweeps,
        message.pings,
        bool(message.in_place),
    )


def start_scan(order: ScanOrder) -> messages.StartScan:
    """Return the message that requests the whole scan. Packing raises MessageError if a value does not fit."""
    return messages.StartScan(
        start=messages.microdegrees_of(order.start),
        step=messages.microdegrees_of(order.step),
        headings=order.headings,
        sweeps=order.sweeps,
        pings=order.pings,
        in_place=int(order.in_place),
    )


# rules of firmware_protocol.md that the host can check; a function returns the clause of a broken rule, or None


_TURN = 360_000_000  # µdeg
_COARSEST = 200  # microsteps per turn; assumed if the device does not report its microsteps
_ROUNDING = 1_000  # ns; the settings are in µs


def readings_requested(order: messages.StartScan) -> int:
    """Return the number of readings that a StartScan requests."""
    return order.count or max(0, order.headings * order.sweeps * order.pings - order.first)


def broken_start_rule(order: messages.StartScan, answer: messages.Started) -> str | None:
    """Return how the answer to a StartScan breaks the protocol; None if it does not."""
    expected = readings_requested(order)
    if (answer.readings, answer.first) == (expected, order.first):
        return None
    return (
        f"Started announces {answer.readings} readings from number {answer.first}; "
        f"StartScan requested {expected} from number {order.first}"
    )


def broken_settings_rule(request: messages.Configure, answer: messages.Settings) -> str | None:
    """Return how the answer to a Configure breaks the protocol; None if it does not."""
    if answer.speed_of_sound == 0:
        return "Settings contains a speed_of_sound of 0; expected the requested one"
    if answer.speed_of_sound != request.speed_of_sound:
        return f"Settings contains speed_of_sound {answer.speed_of_sound}; {request.speed_of_sound} was requested"
    if answer.listen_us == 0 or answer.listen_us > request.listen_us:
        return f"Settings contains listen_us {answer.listen_us}; expected 1 to {request.listen_us}, as requested"
    return None


def broken_reading_rule(
    reading: messages.ReadingMessage, order: messages.StartScan, settings: messages.Settings | None, microsteps: int
) -> str | None:
    """Return how a reading of the scan `order` breaks the protocol; None if it does not.

    `microsteps` per turn round its angle; 0: unknown.
    """
    broken = _broken_place(reading, order, microsteps) or _broken_order(reading.echoes)
    if broken is None and settings is not None:
        broken = _broken_window(reading.echoes, settings)
    return f"reading {reading.number}: {broken}" if broken else None


def _broken_place(reading: messages.ReadingMessage, order: messages.StartScan, microsteps: int) -> str | None:
    heading, ping = divmod(reading.number, order.pings)
    sweep, index = divmod(heading, order.headings)
    if (reading.sweep, reading.ping) != (sweep, ping):
        return f"sweep {reading.sweep}, ping {reading.ping}; its number means sweep {sweep}, ping {ping}"
    angle = order.start + order.step * (order.headings - 1 - index if sweep % 2 else index)
    if not order.in_place and abs(reading.angle - angle) > _TURN / (microsteps or _COARSEST):
        return f"angle {reading.angle / 1e6:g} degrees; its number means {angle / 1e6:g} degrees"
    return None


def _broken_order(echoes: tuple[int, ...]) -> str | None:
    for earlier, later in pairwise(echoes):
        if later < earlier:
            return f"an echo at {earlier / 1e6:g} ms is before one at {later / 1e6:g} ms; the earliest must be first"
    return None


def _broken_window(echoes: tuple[int, ...], settings: messages.Settings) -> str | None:
    if len(echoes) > settings.echoes:
        return f"{len(echoes)} echoes; Settings allows {settings.echoes}"
    if echoes and echoes[0] < settings.blanking_us * 1000 - _ROUNDING:
        return f"an echo at {echoes[0] / 1e6:g} ms, before the end of blanking at {settings.blanking_us / 1000:g} ms"
    if echoes and echoes[-1] > settings.listen_us * 1000 + _ROUNDING:
        return f"an echo at {echoes[-1] / 1e6:g} ms, after the end of listening at {settings.listen_us / 1000:g} ms"
    return None


# from messages to readings, for live links, logs and replay


_WIDE = 16  # bits of a two-byte sample; its full scale is 257 × 255
_REMEMBERED = 256  # pings; a device keeps fewer for Resend
_TRACES_HELD = 4  # traces kept without their readings, which may be sent again


class _PartialTrace:
    """The chunks of one trace that have arrived so far."""

    def __init__(self, chunk: messages.TraceChunk) -> None:
        self._period, self._start = (
            messages.seconds_of_nanoseconds(chunk.period_ns),
            messages.seconds_of_nanoseconds(chunk.start_ns),
        )
        self._carrier = chunk.kind == messages.TraceKind.CARRIER
        self._samples: FloatArray = np.full(chunk.total, np.nan)
        self._arrived = np.zeros(chunk.total, np.bool_)

    @property
    def complete(self) -> bool:
        return bool(self._arrived.all())

    def add(self, chunk: messages.TraceChunk) -> None:
        values = _sample_values(chunk)
        if chunk.offset + len(values) <= len(self._samples):
            self._samples[chunk.offset : chunk.offset + len(values)] = values
            self._arrived[chunk.offset : chunk.offset + len(values)] = True

    def trace(self) -> Trace:
        return Trace(self._samples, 1 / self._period, self._start, self._carrier)


def _sample_values(chunk: messages.TraceChunk) -> FloatArray:
    """Return the samples of a chunk: 0 to 1 for an envelope, −1 to 1 for a carrier."""
    wide = chunk.bits == _WIDE
    whole = len(chunk.samples) // 2 * 2 if wide else len(chunk.samples)
    levels = np.frombuffer(chunk.samples[:whole], "<u2" if wide else "u1").astype(np.float64)
    values: FloatArray = levels / (messages.FULL_SCALE * 257 if wide else messages.FULL_SCALE)
    lost = np.frombuffer(chunk.lost, "u1")
    values[lost[lost < len(values)]] = np.nan
    return 2 * values - 1 if chunk.kind == messages.TraceKind.CARRIER else values


class ReadingAssembler:
    """Assembles readings and their traces from messages in the order of arrival.

    Holds the newest reading until its trace is complete, or until a later message shows that the rest of the trace is
    lost. A ping is identified by the device clock at its start. So a reading that is sent again is returned only once.
    Missing samples of a trace are NaN.
    """

    def __init__(self, clock: DeviceClock | None = None) -> None:
        """`clock` maps device time to host time. It may already contain earlier frames of the device."""
        self.settings: messages.Settings | None = None
        self._clock = clock or DeviceClock()
        self._seen: deque[int] = deque(maxlen=_REMEMBERED)
        self._newest = -1  # device clock of the newest ping, µs
        self._scan = -1  # sequence number of the StartScan
        self._waiting: messages.ReadingMessage | None = None
        self._origin: Origin | None = None
        self._traces: dict[int, _PartialTrace] = {}

    def feed(
        self, message: messages.Message, sent_us: int | None = None, arrived: float | None = None
    ) -> list[Reading]:
        """Return the readings that this message completes, in the order of their arrival.

        `sent_us` is the device time in the frame, µs; `arrived` is the host time of its arrival, s.
        """
        # the waiting reading was made before the reset, so its time is converted first
        ended: list[Reading] = []
        if isinstance(message, messages.Info):
            ended = self.flush()
            self._clock.set_boot(message.boot)
            self._origin = origin_of("scan", message.firmware, message.serial)
        if sent_us is not None and arrived is not None:
            self._clock.add_frame(sent_us, arrived)
        return ended + self._take(message)

    def _take(self, message: messages.Message) -> list[Reading]:
        match message:
            case messages.Settings():
                self.settings = message
            case messages.Info():
                self._seen.clear()
                self._newest = -1
                return self._begin(scan=-1)
            case messages.Started() if message.command != self._scan:
                return self._begin(scan=message.command)
            case messages.ReadingMessage():
                return self._start(message)
            case messages.TraceChunk():
                return self._add(message)
            case messages.Heartbeat() | messages.Finished():
                # a heartbeat may arrive between two chunks; one after the next ping shows that chunks are lost
                if isinstance(message, messages.Finished) or (
                    self._waiting and message.readings > self._waiting.number + 1
                ):
                    return self.flush()
        return []

    def flush(self) -> list[Reading]:
        """Return the reading that waits for its trace, with the samples received so far."""
        if self._waiting is None:
            return []
        message, self._waiting = self._waiting, None
        return [self._reading(message)]

    def _begin(self, scan: int) -> list[Reading]:
        self._scan = scan
        ended = self.flush()
        self._traces.clear()
        return ended

    def _start(self, message: messages.ReadingMessage) -> list[Reading]:
        if message.fired_us in self._seen:
            return []
        self._seen.append(message.fired_us)
        if message.fired_us < self._newest:  # sent again, without its trace
            return [self._reading(message)]
        self._newest = message.fired_us
        ended = self.flush()
        if self.settings is None or not self.settings.trace:
            return [*ended, self._reading(message)]
        self._waiting = message
        trace = self._traces.get(message.number)
        return [*ended, *self.flush()] if trace and trace.complete else ended

    def _add(self, chunk: messages.TraceChunk) -> list[Reading]:
        if chunk.period_ns == 0:
            return []
        if chunk.number not in self._traces:
            while len(self._traces) >= _TRACES_HELD:
                del self._traces[next(iter(self._traces))]
            self._traces[chunk.number] = _PartialTrace(chunk)
        trace = self._traces[chunk.number]
        trace.add(chunk)
        return self.flush() if self._waiting and self._waiting.number == chunk.number and trace.complete else []

    @property
    def _speed_of_sound(self) -> float:
        # 0 breaks the protocol; every range would be 0
        return (
            messages.sound_speed_of(self.settings.speed_of_sound)
            if self.settings and self.settings.speed_of_sound
            else math.nan
        )

    def _reading(self, message: messages.ReadingMessage) -> Reading:
        partial = self._traces.pop(message.number, None)
        time = self._clock.continued(message.fired_us)
        return Reading(
            number=message.number,
            sweep=message.sweep,
            ping=message.ping,
            angle=messages.radians_of(message.angle),
            time=time,
            echo_times=tuple(map(messages.seconds_of_nanoseconds, message.echoes)),
            speed_of_sound=self._speed_of_sound,
            temperature_c=messages.degrees_c(message.temperature),
            trace=partial.trace() if partial else None,
            host_time=self._clock.host_time(time),
            origin=self._origin,
        )
