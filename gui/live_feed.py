"""The live scan as the session sees it: started, stopped, and asked every tick for what is new.

Takes the way to a scanner; hands on readings, how things stand, and once, when a scan has broken, what to tell.
"""

from gui.live_scan import LiveScan, LiveStatus, Phase, ScannerOpener, ScanWish
from gui.scene import Scene
from sonarhw.errors import LogError, SonarError
from sonarhw.readings import Reading

_IDLE = LiveStatus(Phase.DONE)


class LiveFeed:
    """At most one live scan, and what it has brought."""

    def __init__(self, opener: ScannerOpener | None, wish: ScanWish) -> None:
        self.possible = opener is not None
        self.readings: tuple[Reading, ...] = ()
        self._opener = opener
        self._wish = wish
        self._scan: LiveScan | None = None
        self._status = _IDLE
        self._end_told = True

    @property
    def phase(self) -> Phase | None:
        """How far the scan is; None before the first and after `forget`."""
        return self._status.phase if self._scan else None

    @property
    def status(self) -> LiveStatus:
        """What was known of the scan when its readings were last taken: an end is shown with what it brought."""
        return self._status

    @property
    def running(self) -> bool:
        """Whether more is to come."""
        return not self.status.ended

    def start(self, scene: Scene) -> None:
        """Begin a scan; what the one before brought is forgotten."""
        if self._opener is not None:
            self.readings, self._end_told = (), False
            self._scan = LiveScan(self._opener, scene, self._wish)
            self._status = self._scan.status
            self._scan.start()

    def stop(self) -> None:
        """Ask for the end."""
        if self._scan is not None:
            self._scan.stop()

    def forget(self) -> None:
        """Forget the scan that is over; something else is shown now."""
        self._scan, self._status, self.readings, self._end_told = None, _IDLE, (), True

    def close(self) -> None:
        """Stop the board and wait until the log is closed."""
        if self._scan is not None:
            self._scan.stop()
            self._scan.join()

    def take(self) -> tuple[int, str]:
        """How many readings are new, and what to tell: a warning, or an end that was none wanted; else empty."""
        if self._scan is None:
            return 0, ""
        status = self._status = self._scan.status  # before the readings, so that none comes after the end
        fresh = tuple(self._scan.take())
        if fresh:
            self.readings += fresh
        if self._scan.warnings:
            return len(fresh), self._scan.warnings.popleft()
        if not status.ended or self._end_told:
            return len(fresh), ""
        self._end_told = True
        return len(fresh), _told(status)


def _told(status: LiveStatus) -> str:
    """What the person is to know of an error; raises what is a defect."""
    if status.error is None:
        return ""
    if not isinstance(status.error, SonarError | OSError):
        raise status.error
    told = status.recording is None or isinstance(status.error, LogError)
    kept = "" if told else f"; {status.made} readings are kept in {status.recording}"
    return f"{status.error}{kept}"
