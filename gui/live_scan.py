"""One live scan in a thread of its own: opens the scanner, records, homes, scans.

Takes the way to a scanner and what to scan; hands on readings as they come, through a bounded queue from which the
oldest give way: the scan and its log never wait for the window. The thread knows no Qt.
"""

import threading
from collections import deque
from collections.abc import Callable
from contextlib import AbstractContextManager, suppress
from dataclasses import dataclass, replace
from enum import StrEnum
from math import radians
from pathlib import Path
from typing import Any

from gui.recording import start_recording
from gui.scene import Scene
from sim.air import speed_of_sound
from sonarhw.errors import SonarError
from sonarhw.messages import Outcome
from sonarhw.readings import Reading, ScanOrder
from sonarhw.scanner import Scanner

ScannerOpener = Callable[[], AbstractContextManager[Scanner]]
MOST_WAITING = 1024  # readings; over half a minute of the fastest board
DEFAULT_TEMPERATURE = 20.0  # °C
WHOLE_TURN = ScanOrder(0.0, radians(5), 72)


@dataclass(frozen=True)
class ScanWish:
    """What to scan and where to record it."""

    folder: Path
    order: ScanOrder = WHOLE_TURN
    traces: bool = True


class Phase(StrEnum):
    """How far a live scan is."""

    CONNECTING = "connecting"
    HOMING = "homing"
    SCANNING = "scanning"
    DONE = "done"
    STOPPED = "stopped"
    FAILED = "failed"


@dataclass(frozen=True)
class LiveStatus:
    """What is known of a live scan besides its readings; replaced as a whole by its thread."""

    phase: Phase = Phase.CONNECTING
    made: int = 0  # readings
    lost: int = 0  # readings
    temperature_c: float | None = None
    recording: Path | None = None
    error: Exception | None = None

    @property
    def ended(self) -> bool:
        """Whether nothing more will come."""
        return self.phase in (Phase.DONE, Phase.STOPPED, Phase.FAILED)


class LiveScan:
    """A scan that runs from `start` until it is done, stopped or broken; then make another."""

    def __init__(self, opener: ScannerOpener, scene: Scene, wish: ScanWish) -> None:
        self.status = LiveStatus()
        self.warnings: deque[str] = deque()  # to be taken out by who tells them
        self._opener = opener
        self._scene = scene
        self._wish = wish
        self._readings: deque[Reading] = deque(maxlen=MOST_WAITING)
        self._stop_wanted = threading.Event()
        self._scanner: Scanner | None = None
        self._thread = threading.Thread(target=self._run, name="live scan", daemon=True)

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def take(self) -> list[Reading]:
        """The readings since the last call."""
        taken = []
        while self._readings:
            taken.append(self._readings.popleft())
        return taken

    def stop(self) -> None:
        """Ask for the end; it has come when `status.ended`."""
        self._stop_wanted.set()
        scanner = self._scanner
        if scanner is not None and not self.status.ended:
            with suppress(SonarError):  # between two commands; the thread looks at the wish before the next one
                scanner.stop()

    def join(self) -> None:
        """Wait until the board has stopped and the log is closed."""
        self._thread.join()

    # the thread

    def _run(self) -> None:
        try:
            phase = self._converse()
        except Exception as error:  # noqa: BLE001 - told by the window, or raised there if it is a defect
            # whatever breaks while a scan is being stopped belongs to the stopping
            stopping = self._stop_wanted.is_set() and isinstance(error, SonarError)
            phase = Phase.STOPPED if stopping else Phase.FAILED
            self.status = replace(self.status, error=None if stopping else error)
        self.status = replace(self.status, phase=phase)

    def _converse(self) -> Phase:
        with self._opener() as scanner:
            if self._stop_wanted.is_set():
                return Phase.STOPPED
            log, path = start_recording(self._wish.folder, self._scene, self.warnings.append)
            with log:
                self._scanner = scanner
                scanner.record(log)
                self._advance(Phase.HOMING, recording=path, temperature_c=scanner.info.temperature_c)
                return self._scan(scanner)

    def _scan(self, scanner: Scanner) -> Phase:
        board = self._scene.board
        speed = speed_of_sound(self._temperature(scanner))
        scanner.configure(2 * board.max_range / speed, board.listens_from, self._wish.traces, speed)
        if self._stop_wanted.is_set() or scanner.home() is Outcome.STOPPED:
            return Phase.STOPPED
        self._advance(Phase.SCANNING)
        if not self._stop_wanted.is_set():
            for reading in scanner.scan(self._wish.order):
                self._take_in(reading, scanner)
        return Phase.STOPPED if self._stop_wanted.is_set() else Phase.DONE

    def _take_in(self, reading: Reading, scanner: Scanner) -> None:
        self._readings.append(reading)
        warmth = self.status.temperature_c if reading.temperature_c is None else reading.temperature_c
        lost = scanner.statistics.lost_readings
        self._advance(self.status.phase, made=self.status.made + 1, lost=lost, temperature_c=warmth)

    def _temperature(self, scanner: Scanner) -> float:
        own = scanner.info.temperature_c
        if own is not None:
            return own
        return self._scene.room.air.temperature_c if self._scene.room else DEFAULT_TEMPERATURE

    def _advance(self, phase: Phase, **known: Any) -> None:
        self.status = replace(self.status, phase=phase, **known)
