"""The controls of a replay: play, pause, step, seek, loop and speed of a `sonarhw.device.replayed_log.Playback`."""

import math
from dataclasses import dataclass, replace

from PySide6.QtCore import QObject, Signal, Slot

from sonarhw.device.replayed_log import Playback
from sonarhw.log import Log
from sonarhw.readings import Reading

SPEEDS = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, math.inf)
_SAME = 1e-3  # s; a scan that starts within this time of the position is the current one


@dataclass(frozen=True)
class ReplayState:
    """State of a replay."""

    position: float  # s
    duration: float  # s
    playing: bool
    speed: float
    loop: bool
    skip_gaps: bool
    count: int  # readings up to the position
    total: int  # readings
    scans: tuple[float, ...]  # start of each scan, s


class ReplayControl(QObject):
    """Replays at most one log."""

    changed = Signal(object)  # ReplayState; None without a log
    broken = Signal(str)  # why its traces cannot be read

    def __init__(self, parent: QObject) -> None:
        super().__init__(parent)
        self._playback: Playback | None = None
        self._readings: tuple[Reading, ...] = ()
        self._scans: tuple[float, ...] = ()

    @property
    def loaded(self) -> bool:
        """Whether a log is loaded."""
        return self._playback is not None

    @property
    def readings(self) -> tuple[Reading, ...]:
        """All readings of the log."""
        return self._readings

    @property
    def count(self) -> int:
        """The number of readings up to the position."""
        return self._playback.count if self._playback else 0

    @property
    def state(self) -> ReplayState | None:
        """The state of the replay; None without a log."""
        playback = self._playback
        if playback is None:
            return None
        return ReplayState(
            position=playback.position,
            duration=playback.duration,
            playing=playback.playing,
            speed=playback.speed,
            loop=playback.loop,
            skip_gaps=playback.skip_gaps,
            count=playback.count,
            total=len(self._readings),
            scans=self._scans,
        )

    def load(self, log: Log) -> None:
        """Load a log, at its end, so that all readings are shown."""
        self._playback = Playback(log)
        self._readings, self._scans = self._playback.readings, self._playback.scan_starts
        self._emit()

    def extend(self, log: Log) -> None:
        """Replay the same log with the readings that it has now. A replay at the end stays at the end."""
        before, known = self._playback, self._readings
        if before is None:
            return
        self._playback = now = Playback(log)
        now.speed, now.loop, now.skip_gaps = before.speed, before.loop, before.skip_gaps
        if before.position < before.duration:
            now.seek(before.position)
        if before.playing:
            now.play()
        # the same objects as before, so that views draw only what is new
        is_longer = len(now.readings) >= len(known) and not (known and _differ(now.readings[len(known) - 1], known[-1]))
        self._readings = (*known, *now.readings[len(known) :]) if is_longer else now.readings
        self._scans = now.scan_starts
        self._emit()

    def unload(self) -> None:
        """Close the log."""
        self._playback = None
        self._readings = self._scans = ()
        self._emit()

    def advance(self, elapsed: float) -> None:
        """Play for `elapsed` s."""
        if self._playback is not None and self._playback.advance(elapsed):
            self._emit()

    def drop_traces(self, why: str) -> None:
        """Pause, and show the readings without traces, because the log can no longer be read; its drive may be gone."""
        if self._playback is not None:
            self._playback.pause()
            self._readings = tuple(replace(reading, trace=None) for reading in self._readings)
            self.broken.emit(f"{why}. The replay is paused; readings are shown without traces")
            self._emit()

    @Slot()
    def toggle(self) -> None:
        """Play, or pause."""
        if self._playback is not None:
            if self._playback.playing:
                self._playback.pause()
            else:
                self._playback.play()
            self._emit()

    @Slot()
    def pause(self) -> None:
        """Pause."""
        if self._playback is not None:
            self._playback.pause()
            self._emit()

    @Slot()
    def step_forward(self) -> None:
        """Pause at the next reading."""
        self._step(1)

    @Slot()
    def step_back(self) -> None:
        """Pause at the previous reading."""
        self._step(-1)

    def _step(self, by: int) -> None:
        if self._playback is not None:
            self._playback.step(by)
            self._emit()

    @Slot(float)
    def seek(self, position: float) -> None:
        """Go to `position`, s from the start."""
        if self._playback is not None:
            self._playback.seek(position)
            self._emit()

    def seek_reading(self, index: int) -> None:
        """Go to the time of a reading. Raises IndexError if there is none."""
        if self._playback is not None:
            self._playback.seek_reading(index)
            self._emit()

    @Slot()
    def next_scan(self) -> None:
        """Go to the start of the next scan, or to the end of the log."""
        if self._playback is not None:
            position = self._playback.position
            self.seek(next((start for start in self._scans if start > position + _SAME), self._playback.duration))

    @Slot()
    def previous_scan(self) -> None:
        """Go back to the start of this scan; from there to the start of the previous one."""
        if self._playback is not None:
            position = self._playback.position
            self.seek(max((start for start in self._scans if start < position - _SAME), default=0.0))

    @Slot(float)
    def set_speed(self, speed: float) -> None:
        """Set the speed, relative to the recording; inf: all at once."""
        if self._playback is not None:
            self._playback.speed = speed
            self._emit()

    @Slot(bool)
    def set_loop(self, loop: bool) -> None:
        """Set whether the replay restarts at its end."""
        if self._playback is not None:
            self._playback.loop = loop
            self._emit()

    @Slot(bool)
    def set_skip_gaps(self, skip: bool) -> None:
        """Set whether long waits between readings are skipped."""
        if self._playback is not None:
            self._playback.skip_gaps = skip
            self._scans = self._playback.scan_starts
            self._emit()

    def _emit(self) -> None:
        self.changed.emit(self.state)


def _differ(one: Reading, other: Reading) -> bool:
    """Return whether two readings are different pings. Stored traces are never equal."""
    return (one.time, one.angle, one.echo_times) != (other.time, other.angle, other.echo_times)
