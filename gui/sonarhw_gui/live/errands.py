"""What a scanner can be sent to do: connect, home, turn, or scan and record. Each is a frozen value."""

from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass
from math import radians
from pathlib import Path
from typing import Any, Protocol

from sonarhw_sim.air import Air

from sonarhw.host.scanner import Scanner
from sonarhw.readings import Reading, ScanOrder
from sonarhw.scan_recording import ScanAir, ScanPlan, record_scan
from sonarhw.wire.messages import Outcome
from sonarhw_gui.live.scanner_state import ErrandState, Phase
from sonarhw_gui.scene.scene import Scene
from sonarhw_gui.store.new_recording import start_recording

ScannerOpener = Callable[[], AbstractContextManager[Scanner]]
WHOLE_TURN = ScanOrder(0.0, radians(5), 72)


@dataclass(frozen=True)
class ScanWish:
    """What to scan and where to record it."""

    folder: Path
    order: ScanOrder = WHOLE_TURN
    traces: bool = True
    max_range: float | None = None  # m; listen no further than this; None: as far as the board hears


class ErrandReport(Protocol):
    """Who is told how an errand goes."""

    status: ErrandState

    @property
    def stop_wanted(self) -> bool:
        """Whether a person wants it to end."""

    def advance(self, phase: Phase, **known: Any) -> None:
        """It has come that far."""

    def take_in(self, reading: Reading) -> None:
        """It has made a reading."""

    def warn(self, message: str) -> None:
        """Something to tell that does not end it."""


class Errand(Protocol):
    """Something to be done with a scanner."""

    @property
    def phase(self) -> Phase:
        """What it begins with."""

    @property
    def done(self) -> Phase:
        """What it ends with, if all goes well."""

    def run(self, scanner: Scanner, report: ErrandReport) -> Outcome:
        """Do it. Raises what the scanner raises."""


@dataclass(frozen=True)
class ConnectErrand:
    """Only see who answers."""

    phase: Phase = Phase.CONNECTING
    done: Phase = Phase.READY

    def run(self, scanner: Scanner, report: ErrandReport) -> Outcome:
        """Nothing is left to do once the scanner is open."""
        return Outcome.DONE


@dataclass(frozen=True)
class HomeErrand:
    """Find the zero of the turntable."""

    phase: Phase = Phase.HOMING
    done: Phase = Phase.READY

    def run(self, scanner: Scanner, report: ErrandReport) -> Outcome:
        """Home."""
        return _at(0.0, scanner.home(), report)


@dataclass(frozen=True)
class TurnErrand:
    """Turn to an angle."""

    angle: float  # of the turntable, rad
    phase: Phase = Phase.TURNING
    done: Phase = Phase.READY

    def run(self, scanner: Scanner, report: ErrandReport) -> Outcome:
        """Turn, having found the zero."""
        return _at(self.angle, scanner.turn(self.angle), report)


@dataclass(frozen=True)
class ScanErrand:
    """Home, scan and record."""

    scene: Scene
    wish: ScanWish
    phase: Phase = Phase.HOMING
    done: Phase = Phase.DONE

    def run(self, scanner: Scanner, report: ErrandReport) -> Outcome:
        """Scan into a new log. Raises LogError where none can be made, too."""
        log, path = start_recording(self.wish.folder, self.scene, report.warn)
        report.advance(Phase.HOMING, recording=path)
        try:
            return record_scan(scanner, self._plan(), log, _ScanReport(report, scanner))
        finally:
            if not path.exists():
                report.advance(report.status.phase, recording=None)

    def _plan(self) -> ScanPlan:
        board = self.scene.board
        air = self.scene.room.air if self.scene.room else Air()
        return ScanPlan(
            self.wish.order,
            reach=board.max_range if self.wish.max_range is None else self.wish.max_range,
            blanking=board.listens_from,
            air=ScanAir(air.speed_at, air.temperature_c),
            traces=self.wish.traces,
        )


class _ScanReport:
    """Passes the progress of a scan to a report."""

    def __init__(self, report: ErrandReport, scanner: Scanner) -> None:
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
        report.take_in(reading)
        lost = self._scanner.statistics.lost_readings - self._lost_before
        report.advance(Phase.SCANNING, made=report.status.made + 1, lost=lost, angle=reading.angle)
        if reading.temperature_c is not None:
            report.advance(Phase.SCANNING, temperature_c=reading.temperature_c)


def _at(angle: float, outcome: Outcome, report: ErrandReport) -> Outcome:
    if outcome is not Outcome.STOPPED:
        report.advance(report.status.phase, angle=angle)
    return outcome
