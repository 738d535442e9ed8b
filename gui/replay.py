"""The replay as the window works it: a playback, told to play, pause, seek and change its speed.

Takes a log and a person's wishes; tells by a signal how it stands. Session and replay bar both listen.
"""

from dataclasses import dataclass

from PySide6.QtCore import QObject, Signal, Slot

from gui.playback import Playback
from sonarhw.log import Log
from sonarhw.readings import Reading


@dataclass(frozen=True)
class ReplayState:
    """How a replay stands."""

    position: float  # s
    duration: float  # s
    playing: bool
    speed: float


class Replay(QObject):
    """At most one log being played back."""

    changed = Signal(object)  # ReplayState; None without a log

    def __init__(self, parent: QObject) -> None:
        super().__init__(parent)
        self._playback: Playback | None = None

    @property
    def loaded(self) -> bool:
        """Whether there is a log."""
        return self._playback is not None

    @property
    def readings(self) -> tuple[Reading, ...]:
        """All readings of the log."""
        return self._playback.readings if self._playback else ()

    @property
    def count(self) -> int:
        """How many of them have been made at this position."""
        return self._playback.count if self._playback else 0

    @property
    def state(self) -> ReplayState | None:
        """How it stands; None without a log."""
        playback = self._playback
        if playback is None:
            return None
        return ReplayState(playback.position, playback.duration, playback.playing, playback.speed)

    def load(self, log: Log) -> None:
        """Take a log, at its end, so that all of it is seen."""
        self._playback = Playback(log)
        self._tell()

    def unload(self) -> None:
        """Put the log away."""
        self._playback = None
        self._tell()

    def advance(self, elapsed: float) -> None:
        """Let `elapsed` s pass."""
        if self._playback is not None and self._playback.advance(elapsed):
            self._tell()

    @Slot()
    def toggle(self) -> None:
        """Play, or pause."""
        if self._playback is not None:
            if self._playback.playing:
                self._playback.pause()
            else:
                self._playback.play()
            self._tell()

    @Slot()
    def pause(self) -> None:
        """Stand still."""
        if self._playback is not None:
            self._playback.pause()
            self._tell()

    @Slot(float)
    def seek(self, position: float) -> None:
        """Go to `position`, s from the beginning."""
        if self._playback is not None:
            self._playback.seek(position)
            self._tell()

    @Slot(float)
    def set_speed(self, speed: float) -> None:
        """Play that many times as fast as recorded; inf: all at once."""
        if self._playback is not None:
            self._playback.speed = speed
            self._tell()

    def _tell(self) -> None:
        self.changed.emit(self.state)
