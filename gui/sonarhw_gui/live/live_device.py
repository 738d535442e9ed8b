"""One scanner in a thread of its own: opened, sent on one job after another, watched, closed.

Readings wait in a bounded queue that drops the oldest, so the scan and its log never wait for the window.
"""

import threading
from collections import deque
from contextlib import suppress
from dataclasses import replace
from queue import SimpleQueue
from typing import Any

from sonarhw.errors import Incompatible, LinkError, NoAnswer, SonarError, WrongDevice
from sonarhw.host.scanner import Scanner
from sonarhw.readings import Reading
from sonarhw.wire.messages import Outcome
from sonarhw_gui.live.scanner_jobs import ScannerJob, ScannerOpener
from sonarhw_gui.live.scanner_state import JobState, LinkState, Phase

MOST_WAITING = 1024  # readings; over half a minute of the fastest board
_LOOK_EVERY = 0.25  # s; figures that change more often cannot be read


class LiveDevice:
    """A connection from `start` until `disconnect`, or until it breaks; then make another."""

    def __init__(self, opener: ScannerOpener, job: ScannerJob, after: "LiveDevice | None" = None) -> None:
        """`after` is waited for first: it may still hold the port."""
        self.status = JobState()
        self.link: LinkState | None = None
        self.warnings: deque[str] = deque()  # to be taken out by who tells them
        self.leaving = False  # whether it takes no more jobs
        self._opener = opener
        self._after = after
        self._jobs: SimpleQueue[ScannerJob | None] = SimpleQueue()
        self._jobs.put(job)
        self._readings: deque[Reading] = deque(maxlen=MOST_WAITING)
        self._stop_wanted = threading.Event()
        self._look_now = threading.Event()
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run, name="live scanner", daemon=True)

    def start(self) -> None:
        """Begin to connect, for the first job."""
        self._thread.start()

    @property
    def over(self) -> bool:
        """Whether the connection is closed for good."""
        return self._over.is_set()

    def submit(self, job: ScannerJob) -> None:
        """Have something done; the job before it has ended."""
        self._stop_wanted.clear()
        self.status = JobState(job.phase, temperature_c=self.status.temperature_c, angle=self.status.angle)
        self._jobs.put(job)

    def take(self) -> list[Reading]:
        """The readings since the last call."""
        taken = []
        while self._readings:
            taken.append(self._readings.popleft())
        return taken

    def stop(self) -> None:
        """Ask for the end of the job; it has come when `status.ended`."""
        self._stop_wanted.set()
        self._look_now.set()

    def disconnect(self) -> None:
        """Ask for the end of the connection, once the job is over."""
        self.leaving = True
        self._jobs.put(None)

    def join(self) -> None:
        """Wait until the board has stopped, the log is closed and the port is free."""
        self._thread.join()

    # Report: what an job tells

    @property
    def stop_wanted(self) -> bool:
        """Whether a person wants the job to end."""
        return self._stop_wanted.is_set()

    def advance(self, phase: Phase, **known: Any) -> None:
        """The job has come that far."""
        self.status = replace(self.status, phase=phase, **known)

    def take_in(self, reading: Reading) -> None:
        """The job has made a reading."""
        self._readings.append(reading)

    def warn(self, message: str) -> None:
        """Something to tell that does not end the job."""
        self.warnings.append(message)

    # the thread

    def _run(self) -> None:
        if self._after is not None:
            self._after.join()
            self._after = None
        try:
            with self._opener() as scanner:
                self._converse(scanner)
        except Exception as error:  # noqa: BLE001 - told by the window, or raised there if it is a defect
            self.leaving = True  # before the job is seen to have ended, lest another be asked of it
            self._failed(error)
        finally:
            self.link = None
            self._over.set()

    def _converse(self, scanner: Scanner) -> None:
        closing = threading.Event()
        self.link = _link_state(scanner)
        self.advance(self.status.phase, temperature_c=scanner.info.temperature_c)
        watcher = threading.Thread(target=self._watch, args=(scanner, closing), name="watch the line", daemon=True)
        watcher.start()
        try:
            while (job := self._jobs.get()) is not None:
                self._do(job, scanner)
        finally:
            closing.set()
            self._look_now.set()
            watcher.join()

    def _do(self, job: ScannerJob, scanner: Scanner) -> None:
        try:
            self.advance(job.phase)
            outcome = Outcome.STOPPED if self.stop_wanted else job.run(scanner, self)
        except (LinkError, NoAnswer, WrongDevice, Incompatible):
            raise
        except SonarError as error:  # the scanner is still there
            self._failed(error)
        else:
            self.advance(Phase.STOPPED if outcome is Outcome.STOPPED else job.done)

    def _failed(self, error: Exception) -> None:
        # whatever breaks while it is being stopped belongs to the stopping
        stopping = self.stop_wanted and isinstance(error, SonarError)
        self.advance(Phase.STOPPED if stopping else Phase.FAILED, error=None if stopping else error)

    def _watch(self, scanner: Scanner, closing: threading.Event) -> None:
        """Look at the line now and then, and stop the scanner: neither may hold up the window or the job."""
        while not closing.is_set():
            if self.stop_wanted and not self.status.ended:
                with suppress(SonarError):  # said again until the job has noticed
                    scanner.stop()
            self.link = _link_state(scanner)
            self._look_now.wait(_LOOK_EVERY)
            self._look_now.clear()


def _link_state(scanner: Scanner) -> LinkState:
    return LinkState(
        url=scanner.url,
        device=scanner.info,
        connection=scanner.state,
        statistics=scanner.statistics,
        baud=scanner.baud,
        drift=scanner.clock_drift,
        loss=str(scanner.loss or ""),
    )
