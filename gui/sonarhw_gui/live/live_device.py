"""One scanner in a thread: opens the connection, runs jobs one after another, watches the link, closes it.

Readings wait in a bounded queue that drops the oldest, so the scan and its log never wait for the window.
"""

import threading
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from queue import SimpleQueue
from typing import Any

from sonarhw.errors import Incompatible, LinkError, NoAnswer, SonarError, WrongDevice
from sonarhw.host.scanner import ConnectedScanner
from sonarhw.readings import Reading
from sonarhw.wire.messages import Outcome
from sonarhw_gui.live.scanner_jobs import ScannerJob, ScannerOpener
from sonarhw_gui.live.scanner_state import JobState, LinkState, Phase

MOST_WAITING = 1024  # readings; over half a minute of the fastest board
_POLL_EVERY = 0.25  # s; a person cannot read values that change more often


class LiveDevice:
    """A connection from `start` until `disconnect` or until it breaks. It cannot be started again."""

    def __init__(
        self,
        opener: ScannerOpener,
        job: ScannerJob,
        arrived: Callable[[], None],
        after: "LiveDevice | None" = None,
    ) -> None:
        """`arrived` is called after each reading, in the thread.

        `after`: an earlier connection, which must end first because it may still use the port.
        """
        self.status = JobState()
        self.link: LinkState | None = None
        self.warnings: deque[str] = deque()  # the reader removes them
        self.leaving = False  # True: no more jobs are accepted
        self._opener = opener
        self._after = after
        self._arrived = arrived
        self._jobs: SimpleQueue[ScannerJob | None] = SimpleQueue()
        self._jobs.put(job)
        self._readings: deque[Reading] = deque(maxlen=MOST_WAITING)
        self._stop_wanted = threading.Event()
        self._wake = threading.Event()
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run, name="live scanner", daemon=True)

    def start(self) -> None:
        """Start to connect and to run the first job."""
        self._thread.start()

    @property
    def over(self) -> bool:
        """Whether the connection is closed."""
        return self._over.is_set()

    def submit(self, job: ScannerJob) -> JobState:
        """Queue a job, and return its state before it runs; the previous job must have ended."""
        self._stop_wanted.clear()
        state = self.status = JobState(job.phase, temperature_c=self.status.temperature_c, angle=self.status.angle)
        self._jobs.put(job)
        return state

    def take(self) -> list[Reading]:
        """Return the readings since the last call."""
        taken = []
        while self._readings:
            taken.append(self._readings.popleft())
        return taken

    def stop(self) -> None:
        """Ask the job to stop; it has stopped when `status.ended`."""
        self._stop_wanted.set()
        self._wake.set()

    def disconnect(self) -> None:
        """Close the connection after the current job."""
        self.leaving = True
        self._jobs.put(None)

    def join(self) -> None:
        """Wait until the board has stopped, the log is closed and the port is free."""
        self._thread.join()

    # JobReport

    @property
    def stop_wanted(self) -> bool:
        """Whether the user wants the job to stop."""
        return self._stop_wanted.is_set()

    def advance(self, phase: Phase, **known: Any) -> None:
        """Store the phase of the job, and other values of its state."""
        self.status = replace(self.status, phase=phase, **known)

    def add_reading(self, reading: Reading) -> None:
        """Queue a reading of the job."""
        self._readings.append(reading)
        self._arrived()

    def warn(self, message: str) -> None:
        """Queue a warning; the job continues."""
        self.warnings.append(message)

    # the thread

    def _run(self) -> None:
        if self._after is not None:
            self._after.join()
            self._after = None
        try:
            with self._opener() as scanner:
                self._run_jobs(scanner)
        except Exception as error:  # noqa: BLE001 - the window reports it, or raises it if it is a defect
            self.leaving = True  # before the job is reported as failed, so that no other job is queued
            self._failed(error)
        finally:
            self.link = None
            self._over.set()

    def _run_jobs(self, scanner: ConnectedScanner) -> None:
        closing = threading.Event()
        self.link = _link_state(scanner)
        self.advance(self.status.phase, temperature_c=scanner.info.temperature_c)
        watcher = threading.Thread(target=self._watch, args=(scanner, closing), name="watch the line", daemon=True)
        watcher.start()
        try:
            while (job := self._jobs.get()) is not None:
                self._run_job(job, scanner)
        finally:
            closing.set()
            self._wake.set()
            watcher.join()

    def _run_job(self, job: ScannerJob, scanner: ConnectedScanner) -> None:
        try:
            self.advance(job.phase)
            outcome = Outcome.STOPPED if self.stop_wanted else job.run(scanner, self)
        except (LinkError, NoAnswer, WrongDevice, Incompatible):
            raise
        except SonarError as error:  # the connection still works
            self._failed(error)
        else:
            self.advance(Phase.STOPPED if outcome is Outcome.STOPPED else job.done)

    def _failed(self, error: Exception) -> None:
        # errors while stopping are caused by the stop
        stopping = self.stop_wanted and isinstance(error, SonarError)
        self.advance(Phase.STOPPED if stopping else Phase.FAILED, error=None if stopping else error)

    def _watch(self, scanner: ConnectedScanner, closing: threading.Event) -> None:
        """Poll the state of the link, and send stop commands; neither may delay the window or the job."""
        while not closing.is_set():
            if self.stop_wanted and not self.status.ended:
                with suppress(SonarError):  # repeated until the job has ended
                    scanner.stop()
            self.link = _link_state(scanner)
            self._wake.wait(_POLL_EVERY)
            self._wake.clear()


def _link_state(scanner: ConnectedScanner) -> LinkState:
    return LinkState(
        url=scanner.url,
        device=scanner.info,
        connection=scanner.state,
        statistics=scanner.statistics,
        baud=scanner.baud,
        drift=scanner.clock_drift,
        takes_orders=scanner.takes_orders,
        loss=str(scanner.loss or ""),
    )
