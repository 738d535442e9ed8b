"""The jobs of a scanner, as frozen values: connect, home, turn, or scan and record."""

from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from math import radians
from pathlib import Path
from typing import Any, Protocol

from sonarhw_sim.air import Air

from sonarhw.host.scanner import ConnectedScanner, ScanPlan, record_scan
from sonarhw.readings import Reading, ScanAir, ScanOrder
from sonarhw.wire.messages import Outcome
from sonarhw_gui.live.scanner_board import suited_board
from sonarhw_gui.live.scanner_state import JobState, Phase
from sonarhw_gui.scene.scene import Scene
from sonarhw_gui.store.new_recording import start_recording

ScannerOpener = Callable[[], AbstractContextManager[ConnectedScanner]]
WHOLE_TURN = ScanOrder(0.0, radians(5), 72)


@dataclass(frozen=True)
class ScanSettings:
    """What to scan and where to record it."""

    folder: Path
    order: ScanOrder = WHOLE_TURN
    traces: bool = True
    max_range: float | None = None  # m; None: the maximum range of the board


class JobReport(Protocol):
    """Receives the progress of a job."""

    status: JobState

    @property
    def stop_wanted(self) -> bool:
        """Whether the user wants the job to stop."""

    def advance(self, phase: Phase, **known: Any) -> None:
        """Store the phase of the job, and other values of its state."""

    def add_reading(self, reading: Reading) -> None:
        """Add a reading of the job."""

    def warn(self, message: str) -> None:
        """Report a warning; the job continues."""


class ScannerJob(Protocol):
    """A job of a scanner."""

    @property
    def phase(self) -> Phase:
        """The phase at its start."""

    @property
    def done(self) -> Phase:
        """The phase after success."""

    def run(self, scanner: ConnectedScanner, report: JobReport) -> Outcome:
        """Run the job. Raises the errors of the scanner."""


@dataclass(frozen=True)
class ConnectJob:
    """Only connect."""

    phase: Phase = Phase.CONNECTING
    done: Phase = Phase.READY

    def run(self, scanner: ConnectedScanner, report: JobReport) -> Outcome:
        """Return at once: the scanner is already connected."""
        return Outcome.DONE


@dataclass(frozen=True)
class HomeJob:
    """Find the zero of the turntable."""

    phase: Phase = Phase.HOMING
    done: Phase = Phase.READY

    def run(self, scanner: ConnectedScanner, report: JobReport) -> Outcome:
        """Home the turntable."""
        return _at(0.0, scanner.home(), report)


@dataclass(frozen=True)
class TurnJob:
    """Turn to an angle."""

    angle: float  # of the turntable, rad
    phase: Phase = Phase.TURNING
    done: Phase = Phase.READY

    def run(self, scanner: ConnectedScanner, report: JobReport) -> Outcome:
        """Turn; the scanner homes first if necessary."""
        return _at(self.angle, scanner.turn(self.angle), report)


@dataclass(frozen=True)
class ScanJob:
    """Home, scan and record."""

    scene: Scene
    scan_settings: ScanSettings
    takes_board: bool = False  # whether a board profile that the scanner names replaces that of the scene
    phase: Phase = Phase.HOMING
    done: Phase = Phase.DONE

    def run(self, scanner: ConnectedScanner, report: JobReport) -> Outcome:
        """Scan into a new log. Also raises LogError if the log cannot be created."""
        scene = self._scene_of(scanner)
        log, path = start_recording(self.scan_settings.folder, scene, report.warn)
        report.advance(Phase.HOMING, recording=path)
        try:
            return record_scan(scanner, self._plan(scene), log, _ScanReport(report, scanner))
        finally:
            if not path.exists():
                report.advance(report.status.phase, recording=None)

    def _scene_of(self, scanner: ConnectedScanner) -> Scene:
        board = self.scene.board
        return replace(self.scene, board=suited_board(scanner.info.board, board) if self.takes_board else board)

    def _plan(self, scene: Scene) -> ScanPlan:
        board = scene.board
        air = scene.room.air if scene.room else Air()
        return ScanPlan(
            self.scan_settings.order,
            reach=board.max_range if self.scan_settings.max_range is None else self.scan_settings.max_range,
            blanking=board.blanking_end,
            air=ScanAir(air.speed_at, air.temperature_c),
            traces=self.scan_settings.traces,
        )


class _ScanReport:
    """Passes the progress of a scan to the report of its job."""

    def __init__(self, report: JobReport, scanner: ConnectedScanner) -> None:
        self.warn = report.warn
        self._report = report
        self._scanner = scanner
        self._lost_before = scanner.statistics.lost_readings

    @property
    def stop_wanted(self) -> bool:
        return self._report.stop_wanted

    def homed(self) -> None:
        self._report.advance(Phase.SCANNING)

    def reading(self, reading: Reading) -> None:
        report = self._report
        report.add_reading(reading)
        lost = self._scanner.statistics.lost_readings - self._lost_before
        report.advance(Phase.SCANNING, made=report.status.made + 1, lost=lost, angle=reading.angle)
        if reading.temperature_c is not None:
            report.advance(Phase.SCANNING, temperature_c=reading.temperature_c)


def _at(angle: float, outcome: Outcome, report: JobReport) -> Outcome:
    if outcome is not Outcome.STOPPED:
        report.advance(report.status.phase, angle=angle)
    return outcome
