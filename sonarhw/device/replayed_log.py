"""A log as a live scanner. It reports the recorded identity and plays the recorded scans at their recorded times.

It is a `Device`, without threads, ports or clock.
"""

import math
from bisect import bisect_left, bisect_right
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import accumulate, pairwise
from statistics import median

from sonarhw.device.protocol import BYTE_TIME, Line, ProtocolDevice
from sonarhw.errors import InputError
from sonarhw.log.reader import Log, RecordedScan
from sonarhw.readings import Reading
from sonarhw.wire import messages
from sonarhw.wire.limits import MOST_READINGS, PROTOCOL_MAJOR, PROTOCOL_MINOR
from sonarhw.wire.readings_of_frames import reading_message, trace_chunks

_FASTEST_LINE = 1000  # times the usual speed of a line; a faster one would send a long log at once
_TICK = 1e-6  # s
_DEFAULT_SPACING = 0.1  # s; time of a lap of a scan with a single reading
_LONGEST_WAIT = 86400.0  # s, for one reading; a longer one is a damaged time


def _lap(scan: RecordedScan) -> float:
    """Return the time from the beginning of one lap of a scan to that of the next, s."""
    first, last = scan.readings[0].time, scan.readings[-1].time
    gaps = len(scan.readings) - 1
    return last - scan.began + ((last - first) / gaps if gaps else _DEFAULT_SPACING)


def _offset(scan: RecordedScan, number: int) -> float:
    """Return the time of reading `number` from the beginning of the first lap, s."""
    lap, index = divmod(number, len(scan.readings))
    return lap * _lap(scan) + scan.readings[index].time - scan.began


class ReplayDevice(ProtocolDevice):
    """Plays one scan of a log for each StartScan; after the last scan it continues with the first.

    The requested sector is ignored: the recorded readings are sent, numbered from 0 without gaps. With `loop` the scan
    repeats, with continued numbers and sweeps, until the requested number of readings has been sent. Settings are
    acknowledged and ignored; homing and turning take no time. Readings are sent at their recorded times divided by
    `speed` (above 0; infinite: at the speed of the line), counted from the start of the scan, so that nothing drifts.
    Heartbeats keep their rate.
    """

    def __init__(self, log: Log, speed: float = 1.0, loop: bool = False) -> None:
        """Raises InputError for a log without a speed of sound, and for readings more than a day apart."""
        if not speed > 0:
            raise ValueError(f"speed is {speed}; expected a factor above 0")
        if any(math.isnan(reading.speed_of_sound) for reading in log.readings):
            raise InputError(
                "the log has no speed of sound, and so no ranges: it contains neither Settings nor decoded readings"
            )
        super().__init__(Line(BYTE_TIME / min(max(1.0, speed), _FASTEST_LINE)))
        self._log = log
        self._speed = speed
        self._loop = loop
        self._recordings = [scan for scan in log.scans if scan.readings]
        self._check_waits()
        self._next = 0
        self._played: RecordedScan | None = None
        self._angle = 0  # µdeg
        self._temperature = log.info.temperature if log.info else messages.NO_TEMPERATURE
        self._settings = self._recorded_settings()

    def _check_waits(self) -> None:
        for scan in self._recordings:
            for earlier, later in pairwise((scan.began, *(reading.time for reading in scan.readings))):
                if not (later - earlier) / self._speed <= _LONGEST_WAIT:
                    raise InputError(
                        f"the log has a reading {later - earlier:.3g} s after the one before, and a replay would wait "
                        "for it; use another log, or replay it with `sonarhw replay LOG --pace max`"
                    )

    @property
    def boot(self) -> int:
        """The recorded number of starts, as in `info`; another one in a heartbeat would mean a reset."""
        return self._log.info.boot if self._log.info else 0

    def temperature(self) -> int:
        """Return the recorded temperature of the newest reading."""
        return self._temperature

    def angle(self, now: float) -> int:
        """Return the angle of the newest reading, µdeg."""
        return self._angle

    def info(self, sequence: int) -> messages.Info:
        """Return the recorded identity."""
        if self._log.info is not None:
            return replace(self._log.info, command=sequence)
        return messages.Info(
            sequence, PROTOCOL_MAJOR, PROTOCOL_MINOR, "sonarhw replay", "", "", messages.NO_TEMPERATURE, 0, 0
        )

    def configure(self, request: messages.Configure, sequence: int) -> messages.Settings:
        """Return the recorded settings of the next scan. The requested ones are ignored."""
        self._settings = self._recorded_settings() or messages.Settings(
            sequence, request.listen_us, request.blanking_us, request.trace, request.speed_of_sound
        )
        return replace(self._settings, command=sequence)

    def homing(self, now: float) -> Iterator[float]:
        """Home at once."""
        self._angle = 0
        return iter(())

    def turning(self, order: messages.Turn, now: float) -> Iterator[float]:
        """Turn at once."""
        self._angle = order.angle
        return iter(())

    def scanning(self, order: messages.StartScan, now: float) -> tuple[int, Iterator[float]]:
        """Play the next recorded scan; a command for a part of a scan plays a part of the last one."""
        if not self._recordings:
            return 0, iter(())
        part = order.first > 0 or order.count > 0
        if not (part and self._played):
            self._played = self._recordings[self._next]
            self._next = (self._next + 1) % len(self._recordings)
        total = len(self._played.readings)
        if self._loop:
            total = min(max(total, order.headings * order.sweeps * order.pings), MOST_READINGS)
        numbers = range(order.first, order.first + order.count if order.count else total)
        return total, self._play(self._played, numbers, now)

    def halt(self, now: float) -> None:
        """Do nothing, because it never moves."""

    def _play(self, recording: RecordedScan, numbers: range, start: float) -> Iterator[float]:
        settings = self._settings or recording.settings
        speed_of_sound = (
            settings.speed_of_sound
            if settings
            else messages.millimetres_per_second_of(recording.readings[0].speed_of_sound)
        )
        listen = messages.seconds_of(settings.listen_us) if settings else 0.0
        sweeps = recording.readings[-1].sweep + 1
        # a part of a scan starts with its first reading, without waiting
        skipped = _offset(recording, numbers[0]) if numbers and numbers[0] else 0.0
        fired = 0.0
        for number in numbers:
            lap, index = divmod(number, len(recording.readings))
            recorded = recording.readings[index]
            offset = _offset(recording, number) - skipped
            due = start + (offset + listen) / self._speed
            # not before the line is idle, because a Stop would wait for all queued frames
            due = max(due, self.line.idle_from)
            yield due
            # a ping is identified by its time, so two pings must not have the same time
            fired = max(start + offset / self._speed, fired + _TICK)
            sweep = (lap * sweeps + recorded.sweep) % 0x10000
            played = replace(recorded, number=number, sweep=sweep, time=fired)
            message = reading_message(played, speed_of_sound)
            self._angle, self._temperature = message.angle, message.temperature
            self.report(message, trace_chunks(number, recorded.trace) if recorded.trace else (), due)

    def _recorded_settings(self) -> messages.Settings | None:
        if not self._recordings:
            return self._log.settings
        return self._recordings[self._next].settings or self._log.settings


# playback of a log for a viewer, which passes the elapsed time


_TOLERANCE = 1e-6  # s; without it, rounding could exclude a reading
_PAUSE = 1.0  # s between two scans of a log; replaces the recorded pause
_SAME = 1e-3  # s; a scan that starts within this time of the position is the current one
_GAP = 5.0  # a wait is a gap if it is longer than _PAUSE and than this multiple of the median wait


class Playback:
    """A position in the time of a log, which determines the readings made. It starts at the end: all are visible."""

    def __init__(self, log: Log, changed: "Callable[[Playback], None] | None" = None) -> None:
        """`changed` is called with the playback after each change."""
        self.log = log
        self.readings = log.readings
        self._changed = changed
        self._loop = False
        self.playing = False
        self._recorded = _schedule(log)
        self._skip_gaps = False
        self._set_times()
        self._speed = 1.0
        self._watched = 0.0  # s; sum of the elapsed times that the viewer has passed
        self._anchor = (0.0, self.duration)  # value of `_watched`, and position at that time

    @property
    def position(self) -> float:
        """Current position, s from the beginning."""
        since, position = self._anchor
        if not self.playing or self._watched <= since:
            return position
        if math.isinf(self._speed):
            return self.duration
        # computed from the anchor, so that rounding errors do not add up
        ahead = position + (self._watched - since) * self._speed
        return ahead % self._lap if self._loop else min(ahead, self.duration)

    @property
    def speed(self) -> float:
        """Speed relative to the recording, above 0; infinite: all at once."""
        return self._speed

    @speed.setter
    def speed(self, speed: float) -> None:
        if not speed > 0:
            raise ValueError(f"speed is {speed}; expected a factor above 0")
        self._go(self.position)
        self._speed = speed
        self._emit()

    @property
    def loop(self) -> bool:
        """Whether it restarts at the end."""
        return self._loop

    @loop.setter
    def loop(self, loop: bool) -> None:
        self._loop = loop
        self._emit()

    @property
    def skip_gaps(self) -> bool:
        """Whether long gaps between two readings are removed from the time of the log."""
        return self._skip_gaps

    @skip_gaps.setter
    def skip_gaps(self, skip: bool) -> None:
        made = self.count
        self._skip_gaps = skip
        self._set_times()
        self._go(self._times[made - 1] if made else 0.0)
        self._emit()

    @property
    def count(self) -> int:
        """Number of readings made up to the current position."""
        return bisect_right(self._times, self.position + _TOLERANCE)

    def play(self) -> None:
        """Play from the current position, or from the beginning if it is at the end."""
        position = self.position
        self._go(0.0 if position >= self.duration else position)
        self.playing = True
        self._emit()

    def pause(self) -> None:
        """Pause at the current position."""
        self._pause()
        self._emit()

    def toggle(self) -> None:
        """Play, or pause."""
        if self.playing:
            self.pause()
        else:
            self.play()

    def advance(self, elapsed: float) -> bool:
        """Let `elapsed` s of the viewer's time pass. Return whether the position has moved."""
        self._watched += elapsed
        if not self.playing:
            return False
        if not self._loop and self.position >= self.duration:
            self._pause()
        self._emit()
        return True

    def drop_traces(self) -> None:
        """Pause, and show the readings without traces, because the log can no longer be read."""
        self.readings = tuple(replace(reading, trace=None) for reading in self.readings)
        self.pause()

    def extend(self, log: Log) -> None:
        """Play the same log with the readings that it has now. A playback at the end stays at the end."""
        position, at_end, before = self.position, self.position >= self.duration, self.readings
        self.log, self._recorded = log, _schedule(log)
        self._set_times()
        self._go(self.duration if at_end else position)
        # the same objects as before, so that views draw only what is new
        same = len(log.readings) >= len(before) and not (before and _differ(log.readings[len(before) - 1], before[-1]))
        self.readings = (*before, *log.readings[len(before) :]) if same else log.readings
        self._emit()

    # seeking

    def seek(self, position: float) -> None:
        """Go to `position`, s from the beginning. Playing continues from there."""
        self._go(position)
        self._emit()

    def seek_reading(self, index: int) -> None:
        """Go to the time of that reading of the log. Raises IndexError if there is none."""
        self.seek(self._times[range(len(self._times))[index]])

    def seek_scan(self, scan: int) -> None:
        """Go to the first reading of a scan, counted from 0. Raises IndexError if there is none."""
        self.seek_reading(self._first_of(scan))

    def next_scan(self) -> None:
        """Go to the start of the next scan, or to the end of the log."""
        later = (start for start in self.scan_starts if start > self.position + _SAME)
        self.seek(next(later, self.duration))

    def previous_scan(self) -> None:
        """Go back to the start of this scan; from there to the start of the previous one."""
        earlier = (start for start in self.scan_starts if start < self.position - _SAME)
        self.seek(max(earlier, default=0.0))

    def seek_sweep(self, scan: int, sweep: int) -> None:
        """Go to the first reading of a sweep, or of the next one with readings. Raises IndexError if there is none."""
        readings = self.log.scans[scan].readings
        first = bisect_left(readings, sweep, key=lambda reading: reading.sweep)
        self.seek_reading(self._first_of(scan) + range(len(readings))[first])

    def step(self, by: int) -> None:
        """Pause `by` readings after the current one, or before it if negative. Wraps around only with `loop`."""
        self._pause()
        if self._times:
            wanted = self.count - 1 + by
            last = len(self._times) - 1
            self._go(self._times[wanted % (last + 1) if self._loop else min(max(wanted, 0), last)])
        self._emit()

    def _set_times(self) -> None:
        """Set the time of each reading, and of the first reading of each scan that has readings, s."""
        self._times = _without_gaps(self._recorded) if self._skip_gaps else self._recorded
        self.duration = self._times[-1] if self._times else 0.0
        sizes = [len(scan.readings) for scan in self.log.scans]
        firsts = accumulate(sizes, initial=0)
        self.scan_starts = tuple(self._times[first] for first, size in zip(firsts, sizes, strict=False) if size)

    def _go(self, position: float) -> None:
        self._anchor = (self._watched, min(max(position, 0.0), self.duration))

    def _pause(self) -> None:
        self._go(self.position)
        self.playing = False

    def _emit(self) -> None:
        if self._changed is not None:
            self._changed(self)

    @property
    def _lap(self) -> float:
        """Time from the beginning of one run to that of the next, s."""
        gaps = len(self._times) - 1
        return self.duration + (self.duration / gaps if gaps > 0 and self.duration else _PAUSE)

    def _first_of(self, scan: int) -> int:
        return sum(len(before.readings) for before in self.log.scans[: range(len(self.log.scans))[scan]])


def _differ(reading: Reading, other: Reading) -> bool:
    """Return whether two readings are different pings, or only one has its pose. Stored traces are never equal."""
    parts = ((one.time, one.angle, one.echo_times, one.pose) for one in (reading, other))
    return next(parts) != next(parts)


def _schedule(log: Log) -> list[float]:
    """Return the time of each reading of the log, s from the beginning, with a short pause between scans."""
    times: list[float] = []
    began = 0.0
    for scan in log.scans:
        latest = began
        for reading in scan.readings:
            latest = max(latest, began + reading.time - scan.began)
            times.append(latest)
        began = latest + _PAUSE
    return times


def _without_gaps(times: list[float]) -> list[float]:
    """Return the schedule with every gap shortened to the median wait. It begins with the first reading."""
    waits = [later - earlier for earlier, later in pairwise(times)]
    usual = median(waits) if waits else 0.0
    longest = max(_GAP * usual, _PAUSE) + _TOLERANCE
    shortened = [0.0] if times else []
    for wait in waits:
        shortened.append(shortened[-1] + (usual if wait > longest else wait))
    return shortened
