"""The live scanner as the session uses it: it starts and stops jobs and polls for new readings every tick."""

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

_IDLE = JobState(Phase.DONE)


class LiveFeed:
    """At most one connection, at most one job on it, and what the last scan has brought."""

    def __init__(self, opener: ScannerOpener | None, scan_settings: ScanSettings) -> None:
        self.scan_settings = scan_settings
        self.readings: tuple[Reading, ...] = ()
        self._opener = opener
        self._device: LiveDevice | None = None
        self._has_own_readings = False  # whether the readings came from the scanner that the way leads to
        self._last_state = _IDLE  # of the job, when its readings were taken last
        self._end_reported = True

    @property
    def possible(self) -> bool:
        """Whether there is a way to a scanner."""
        return self._opener is not None

    @property
    def phase(self) -> Phase | None:
        """How far the job is; None before the first, and where all it did was to connect and hang up again."""
        device = self._device
        if device is None or (device.over and self._last_state.phase is Phase.READY and not self.readings):
            return None
        return self._last_state.phase

    @property
    def status(self) -> JobState:
        """What is known of the job: no more than of its readings, so that none comes after the end."""
        return self._last_state

    @property
    def link(self) -> LinkState | None:
        """The connection as it was seen last; None where there is none."""
        return self._device.link if self._device else None

    @property
    def made_readings(self) -> bool:
        """Whether the scanner that is connected made the readings."""
        return self.link is not None and self._has_own_readings

    @property
    def trouble(self) -> str:
        """What to tell of a scanner that is away; empty where all is well."""
        return trouble(self.link, self.phase)

    @property
    def running(self) -> bool:
        """Whether more is to come."""
        return not self.status.ended

    def use(self, opener: ScannerOpener | None) -> None:
        """From now on go another way to a scanner, or none."""
        self.disconnect()
        self._has_own_readings = False
        self._opener = opener

    def set_scan_settings(self, scan_settings: ScanSettings) -> None:
        """Scan like this from the next time on."""
        self.scan_settings = scan_settings

    def connect(self) -> None:
        """See who answers."""
        self._submit(ConnectJob())

    def home(self) -> None:
        """Find the zero of the turntable."""
        self._submit(HomeJob())

    def turn(self, angle: float) -> None:
        """Turn the turntable to `angle`, rad."""
        self._submit(TurnJob(angle))

    def start(self, scene: Scene) -> None:
        """Begin a scan; what the one before brought is forgotten."""
        if self.possible and not self.running:
            self.readings = ()
            self._submit(ScanJob(scene, self.scan_settings))

    def stop(self) -> None:
        """Ask for the end of the job."""
        if self._device is not None:
            self._device.stop()

    def disconnect(self) -> None:
        """Stop what runs and let go of the port."""
        if self._device is not None:
            self._device.stop()
            self._device.disconnect()

    def close(self) -> None:
        """Stop the board and wait until the log is closed."""
        self.disconnect()
        if self._device is not None:
            self._device.join()

    def take(self) -> tuple[int, str]:
        """How many readings are new, and what to tell: a warning, or an end that was none wanted; else empty."""
        if self._device is None:
            return 0, ""
        status = self._last_state = self._device.status  # before the readings, so that none comes after the end
        fresh = tuple(self._device.take())
        if fresh:
            self._has_own_readings = True
            self.readings += tuple(map(with_packed_trace, fresh))
        if self._device.warnings:
            return len(fresh), self._device.warnings.popleft()
        if not status.ended or self._end_reported:
            return len(fresh), ""
        self._end_reported = True
        return len(fresh), _told(status)

    def _submit(self, job: ScannerJob) -> None:
        if self._opener is None or self.running:
            return
        self._end_reported = False
        device = self._device
        if device is None or device.over or device.leaving:
            device = self._device = LiveDevice(self._opener, job, device)
            device.start()
        else:
            device.submit(job)
        self._last_state = device.status


def _told(status: JobState) -> str:
    """What the person is to know of an error; raises what is a defect."""
    if status.error is None:
        return ""
    if not isinstance(status.error, SonarError | OSError):
        raise status.error
    return str(status.error)
