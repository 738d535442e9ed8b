"""Scan a room and record the scan, for `sonarhw scan` and the window's Scan button.

from sonarhw import LogMetadata, LogWriter, sector
from sonarhw.scanning.scan_recording import ScanPlan, record_scan
from sonarhw.sound_speed import ScanAir

plan = ScanPlan(sector(0, 360, 5), reach=5.0, blanking=0.00238, air=ScanAir())
record_scan(scanner, plan, LogWriter(path, LogMetadata("scan", time.time())), watcher)
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from sonarhw import disk_space
from sonarhw.errors import Incompatible, LinkError, NoAnswer, WrongDevice
from sonarhw.harmless_text import counted_are
from sonarhw.host.connected_scanner import ConnectedScanner
from sonarhw.log import LogWriter
from sonarhw.readings import Reading, ScanOrder
from sonarhw.sound_speed import ScanAir
from sonarhw.wire.codes import Outcome


@dataclass(frozen=True)
class ScanPlan:
    """The pings of a scan and how the board listens."""

    order: ScanOrder
    reach: float  # m; range up to which the board listens
    blanking: float  # s; earlier echoes are ignored
    air: ScanAir
    traces: bool = False
    zero_here: bool = False  # zero is where the turntable is now; it is not homed


class ScanWatcher(Protocol):
    """Receives the progress of a scan, in the thread that called `record_scan`."""

    @property
    def stop_wanted(self) -> bool:
        """Whether the scan should end before its next step. `Scanner.stop` also ends the current step."""

    def homed(self) -> None:
        """Receive the news that the turntable has homed, or that a sweep has begun. Readings follow."""

    def reading(self, reading: Reading) -> None:
        """Receive a new reading."""

    def warn(self, message: str) -> None:
        """Receive a warning that does not end the scan."""


def record_scan(scanner: ConnectedScanner, plan: ScanPlan, log: LogWriter, watcher: ScanWatcher) -> Outcome:
    """Configure the scanner, home, scan, record everything in `log`, and close it.

    Returns DONE or STOPPED. If the scan ends before its first reading, no log is written, and an existing log is
    not overwritten. Raises what `Scanner.scan` and `LogWriter` raise. If the scanner is lost, the error
    states how many readings are kept.
    """
    progress = _Progress(watcher)
    outcome = Outcome.STOPPED
    with log:
        scanner.record(log)
        try:
            outcome = run_scan(scanner, plan, progress, log.path)
        except (LinkError, NoAnswer, WrongDevice, Incompatible) as error:
            kept = f"; {counted_are(progress.count, 'reading')} kept in {log.path}" if progress.count else ""
            raise type(error)(f"{error}{kept}") from error
        finally:
            scanner.record(None)
            if outcome is Outcome.STOPPED and not progress.count:
                log.drop()
    return outcome


@dataclass
class _Progress:
    """A watcher that counts the readings and passes everything to another one."""

    watcher: ScanWatcher
    count: int = 0

    @property
    def stop_wanted(self) -> bool:
        return self.watcher.stop_wanted

    def homed(self) -> None:
        self.watcher.homed()

    def reading(self, reading: Reading) -> None:
        self.count += 1
        self.watcher.reading(reading)

    def warn(self, message: str) -> None:
        self.watcher.warn(message)


def run_scan(scanner: ConnectedScanner, plan: ScanPlan, watcher: ScanWatcher, path: Path | None = None) -> Outcome:
    """Configure the scanner, home unless the pings are in place, and scan. `path` is the log, if there is one.

    Returns DONE or STOPPED. Raises what `Scanner.scan` raises.
    """
    speed = plan.air.speed_of_sound(scanner.info.temperature_c)
    scanner.configure(2 * plan.reach / speed, plan.blanking, plan.traces, speed)
    if path is not None:
        _warn_if_disk_is_too_small(scanner, plan, path, watcher)
    with scanner.sequence():  # a stop between two steps also ends the later steps
        if watcher.stop_wanted or (not plan.order.in_place and scanner.home(plan.zero_here) is Outcome.STOPPED):
            return Outcome.STOPPED
        watcher.homed()
        for reading in scanner.scan(plan.order):
            watcher.reading(reading)
    if scanner.unverified_angles:
        watcher.warn(scanner.unverified_angles)
    return Outcome.STOPPED if watcher.stop_wanted else Outcome.DONE


def _warn_if_disk_is_too_small(scanner: ConnectedScanner, plan: ScanPlan, path: Path, watcher: ScanWatcher) -> None:
    settings = scanner.settings
    samples = settings.listen * scanner.info.trace_rate if settings and settings.trace else 0.0
    need, free = disk_space.log_size(plan.order.readings, samples), disk_space.free_bytes(path)
    if free is not None and free < need:
        watcher.warn(
            f"{path}: the scan needs about {need / 1e6:.1f} MB and its disk has {free / 1e6:.1f} MB free, "
            f"enough for {free / need:.0%} of it; delete other files"
        )
