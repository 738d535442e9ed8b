"""The live scanner of the session: starts and stops jobs, and polls for new readings every tick."""

from collections.abc import Callable

from sonarhw.errors import SonarError
from sonarhw.readings import Reading
from sonarhw_gui.live.live_device import LiveDevice
from sonarhw_gui.live.packed_trace import with_packed_trace
from sonarhw_gui.live.scanner_jobs import (
    ConnectJob,
    HomeJob,
    ScanJob,
    ScannerJob,
    ScannerOpener,
    ScanSettings,
    TurnJob,
)
from sonarhw_gui.live.scanner_state import JobState, LinkState, Phase, trouble
from sonarhw_gui.scene.scene import Scene
from sonarhw_gui.shown.notices import Notice, Until

_IDLE = JobState(Phase.DONE)


class LiveFeed:
    """At most one connection with at most one job, and the readings of the last scan."""

    def __init__(self, opener: ScannerOpener | None, scan_settings: ScanSettings, arrived: Callable[[], None]) -> None:
        """`arrived` is called after each reading, in the thread of the scanner."""
        self.scan_settings = scan_settings
        self._arrived = arrived
        self.readings: tuple[Reading, ...] = ()
        self._opener = opener
        self._device: LiveDevice | None = None
        self._connected: LiveDevice | None = None  # the last one that made a connection
        self._has_own_readings = False  # whether the readings came from the current scanner
        self._last_state = _IDLE  # of the job, when its readings were fetched last
        self._end_reported = True

    @property
    def possible(self) -> bool:
        """Whether a scanner was chosen."""
        return self._opener is not None

    @property
    def phase(self) -> Phase | None:
        """The phase of the job; None before the first job, and after a connection that was closed without readings."""
        device = self._device
        if device is None:
            return None
        if device.over and self._last_state.phase is Phase.READY:  # not connected any more
            return Phase.DONE if self.readings else None
        return self._last_state.phase

    @property
    def status(self) -> JobState:
        """The state of the job when its readings were fetched last, so that no reading follows the end."""
        return self._last_state

    @property
    def link(self) -> LinkState | None:
        """The last known state of the connection; None without a connection."""
        return self._device.link if self._device else None

    @property
    def made_readings(self) -> bool:
        """Whether the connected scanner made the readings."""
        return self.link is not None and self._has_own_readings

    @property
    def trouble(self) -> str:
        """The message about a lost connection; empty if the connection works."""
        return trouble(self.link, self.phase)

    @property
    def running(self) -> bool:
        """Whether a job is running."""
        return not self.status.ended

    def use(self, opener: ScannerOpener | None) -> None:
        """Use another scanner from now on, or none."""
        self.disconnect()
        self._has_own_readings = False
        self._opener = opener

    def set_scan_settings(self, scan_settings: ScanSettings) -> None:
        """Set the settings of the next scan."""
        self.scan_settings = scan_settings

    def connect(self) -> None:
        """Connect to the scanner."""
        self._submit(ConnectJob())

    def home(self) -> None:
        """Find the zero of the turntable."""
        self._submit(HomeJob())

    def turn(self, angle: float) -> None:
        """Turn the turntable to `angle`, rad."""
        self._submit(TurnJob(angle))

    def start(self, scene: Scene, takes_board: bool = False) -> None:
        """Start a scan; the readings of the previous scan are dropped. `takes_board`: see `ScanJob`."""
        if self.possible and not self.running:
            self.readings = ()
            self._submit(ScanJob(scene, self.scan_settings, takes_board))

    def stop(self) -> None:
        """Ask the job to stop."""
        if self._device is not None:
            self._device.stop()

    def disconnect(self) -> None:
        """Stop the job and close the port."""
        if self._device is not None:
            self._device.stop()
            self._device.disconnect()

    def close(self) -> None:
        """Disconnect, and wait until the board has stopped and the log is closed."""
        self.disconnect()
        if self._device is not None:
            self._device.join()

    def newly_connected(self) -> bool:
        """Return whether a connection was made since the last call."""
        before, device = self._connected, self._device
        if device is not None and device.link is not None:
            self._connected = device
        return self._connected is not before

    def take(self) -> tuple[int, Notice | None]:
        """Fetch new readings; return their number, and a warning or the error of the job, if any."""
        if self._device is None:
            return 0, None
        status = self._last_state = self._device.status  # before the readings, so that no reading follows the end
        fresh = tuple(self._device.take())
        if fresh:
            self._has_own_readings = True
            self.readings += tuple(map(with_packed_trace, fresh))
        if self._device.warnings:
            return len(fresh), Notice(self._device.warnings.popleft())
        if not status.ended or self._end_reported:
            return len(fresh), None
        self._end_reported = True
        text, until = _error_text(status), Until.CONNECTED if self._device.leaving else None
        return len(fresh), Notice(text, error=True, until=until) if text else None

    def _submit(self, job: ScannerJob) -> None:
        if self._opener is None or self.running:
            return
        self._end_reported = False
        device = self._device
        if device is None or device.over or device.leaving:
            device = self._device = LiveDevice(self._opener, job, self._arrived, device)
            self._last_state = device.status  # before the thread, whose error is reported with a tick
            device.start()
        else:
            self._last_state = device.submit(job)


def _error_text(status: JobState) -> str:
    """Return the message of the job's error, if any. Raises an error that is not a SonarError or OSError."""
    if status.error is None:
        return ""
    if not isinstance(status.error, SonarError | OSError):
        raise status.error
    return str(status.error)
