"""The source of the readings, the live scanner or a replayed log, and the control of a replay."""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

from PySide6.QtCore import QObject, Signal, Slot
from sonarhw_compare.one_call import is_fake

from sonarhw.device.replayed_log import Playback
from sonarhw.log import Log
from sonarhw.readings import Origin, Reading
from sonarhw.wire.readings_of_frames import origin_of
from sonarhw_gui.model.scene import Scene, room_name
from sonarhw_gui.session.notices import Notice
from sonarhw_gui.session.scanner import LiveFeed, ScannerChoice, ScanSettings
from sonarhw_gui.session.status import RateMeter, Source, Status, lost_in

# The controls of a replay: play, pause, step, seek, loop and speed of a `sonarhw.device.replayed_log.Playback`.


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


# The source of the readings, the live scanner or a replayed log, and its status.


@dataclass(frozen=True)
class ReplayedLog:
    """An opened log."""

    log: Log
    name: str
    path: Path | None  # where to open it again

    @cached_property
    def lost(self) -> int:
        """The number of readings missing in its scans."""
        return sum(map(lost_in, self.log.scans))


class RecordedIn(NamedTuple):
    """The setting in which readings were recorded; empty parts are unknown."""

    room_text: str = ""
    room_file: str = ""
    place: str = ""


class ReadingSource:
    """A scanner and a log; a loaded log is shown instead of the scanner's readings."""

    def __init__(
        self,
        scanners: ScannerChoice,
        scan_settings: ScanSettings,
        parent: QObject,
        arrived: Callable[[], None],
    ) -> None:
        """`arrived` is called after each reading of the scanner, in its thread."""
        self._scanners = scanners
        self.live = LiveFeed(scanners.opener, scan_settings, arrived)
        self.replay = ReplayControl(parent)
        self._rate = RateMeter()
        self._opened: ReplayedLog | None = None
        self._played: tuple[Reading, ...] = ()
        self.scan_scene: Scene | None = None  # the scene at the start of the last live scan

    @property
    def readings(self) -> tuple[Reading, ...]:
        """The readings up to the position of the replay, or those of the scanner; the same object while unchanged."""
        return self._up_to_now() if self.replay.loaded else self.live.readings

    @property
    def origin(self) -> Origin:
        """The origin of the readings; without readings, of those that the chosen scanner will make."""
        if self.replayed:
            return self.replayed.log.origin
        if self.live.readings and (made := self.live.readings[0].origin):
            return made
        if self.live.link:
            device = self.live.link.device
            return origin_of("scan", device.firmware, device.serial)
        return Origin.FAKE if is_fake(self._scanners.url) else Origin.MEASURED

    @property
    def all_readings(self) -> tuple[Reading, ...]:
        """All readings of the log, including those after the position of the replay; else those of the scanner."""
        return self.replay.readings or self.live.readings

    @property
    def replayed(self) -> ReplayedLog | None:
        """The log that is replayed; None without a replay."""
        return self._opened if self.replay.loaded else None

    @property
    def recording(self) -> Path | None:
        """The recording of the last live scan; None without readings."""
        return self.live.status.recording if self.live.readings else None

    @property
    def log_file(self) -> str:
        """The file of the readings shown; empty if there is none."""
        path = self.replayed.path if self.replayed else self.recording
        return "" if path is None else str(path.absolute())

    @property
    def recorded(self) -> Log | Path | None:
        """The log of the readings shown, or its file; None if there is none."""
        return self.replayed.log if self.replayed else self.recording

    @property
    def recorded_in(self) -> RecordedIn:
        """The setting of the readings shown; empty without readings."""
        replayed, scene = self.replayed, self.scan_scene
        if not self.all_readings:
            return RecordedIn()
        if replayed is not None:
            metadata = replayed.log.metadata
            return RecordedIn(metadata.room_text, metadata.room_file, metadata.place)
        if scene is None or scene.room is None:
            return RecordedIn()
        return RecordedIn(scene.room.text, scene.room_file, scene.pose.name)

    def doubt_in(self, scene: Scene) -> str:
        """Return a warning if the readings were recorded in another room or at another place than this; else ""."""
        text, name, place = self.recorded_in
        if not text or scene.room is None:
            return ""
        if text != scene.room.text:
            other = f"{'an earlier version of ' if name == scene.room_file else ''}{name or 'another room'}"
            return f"these readings were recorded in {other}; they are now compared with {scene.room_file}"
        if place and place != scene.pose.name:
            return f"these readings were recorded at place {place}; they are now compared from {scene.pose.name}"
        return ""

    def scan(self, scene: Scene, takes_board: bool = False) -> None:
        """Start a live scan; a log is closed. `takes_board`: see `ScanJob`."""
        self.close_log()
        self.scan_scene = scene
        self.live.start(scene, takes_board)

    def load(self, log: Log, name: str, path: Path | None = None) -> None:
        """Show a log, at its end; `path`: its file."""
        self._rate = RateMeter()
        self._opened = ReplayedLog(log, name, path)
        self.replay.load(log)

    def close_log(self) -> None:
        """Show the readings of the scanner again."""
        self._rate = RateMeter()
        self.replay.unload()

    def extend(self, log: Log) -> None:
        """Show the readings that the loaded log has now."""
        if self.replayed is not None:
            self._opened = replace(self.replayed, log=log)
            self.replay.extend(log)

    def stop(self) -> None:
        """Stop the job of the scanner, and pause the replay."""
        self.live.stop()
        self.replay.pause()

    def take(self, now: float) -> tuple[bool, Notice | None]:
        """Return whether the scanner has made readings since the last call, and a message, if any."""
        fresh, notice = self.live.take()
        self._rate.add(fresh, now)
        return bool(fresh), notice

    def status(self, now: float, predicting: bool, room: str = "") -> Status:
        """Return the status; `room` is the name of the room that is shown."""
        live, replayed = self.live.status, self.replayed
        readings = self.readings
        same_room = self.scan_scene is not None and room == room_name(self.scan_scene)
        return Status(
            source=Source.REPLAY if replayed else Source.LIVE if self.live.phase else Source.NONE,
            phase=self.live.phase,
            can_scan=self.live.possible,
            readings=len(readings),
            rate=self._rate.rate(now),
            lost=replayed.lost if replayed else live.lost,
            temperature_c=readings[-1].temperature_c if replayed and readings else live.temperature_c,
            recording=live.recording,
            log_name=replayed.name if replayed else "",
            predicting=predicting,
            scan_settings=self.live.scan_settings,
            link=self.live.link,
            trouble=self.live.trouble,
            angle=live.angle,
            fake=self.origin is Origin.FAKE,
            own_readings=bool(readings) and self.live.made_readings and same_room,
        )

    def _up_to_now(self) -> tuple[Reading, ...]:
        before, count = self._played, self.replay.count
        if len(before) != count or (count and before[-1] is not self.replay.readings[count - 1]):
            self._rate.add(max(0, count - len(before)), time.monotonic())
            self._played = self.replay.readings[:count]
        return self._played
