"""One scanner in a thread of its own: opened, sent on one errand after another, watched, closed.

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
from sonarhw_gui.live.errands import Errand, ScannerOpener
from sonarhw_gui.live.scanner_state import ErrandState, LinkSeen, Phase

MOST_WAITING = 1024  # readings; over half a minute of the fastest board
_LOOK_EVERY = 0.25  # s; figures that change more often cannot be read


class LiveDevice:
    """A connection from `start` until `hang_up`, or until it breaks; then make another."""

    def __init__(self, opener: ScannerOpener, errand: Errand, after: "LiveDevice | None" = None) -> None:
        """`after` is waited for first: it may still hold the port."""
        self.status = ErrandState()
        self.link: LinkSeen | None = None
        self.warnings: deque[str] = deque()  # to be taken out by who tells them
        self.leaving = False  # whether it takes no more errands
        self._opener = opener
        self._after = after
        self._errands: SimpleQueue[Errand | None] = SimpleQueue()
        self._errands.put(errand)
        self._readings: deque[Reading] = deque(maxlen=MOST_WAITING)
        self._stop_wanted = threading.Event()
        self._look_now = threading.Event()
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run, name="live scanner", daemon=True)

    def start(self) -> None:
        """Begin to connect, for the first errand."""
        self._thread.start()

    @property
    def over(self) -> bool:
        """Whether the connection is closed for good."""
        return self._over.is_set()

    def ask(self, errand: Errand) -> None:
        """Have something done; the errand before it has ended."""
        self._stop_wanted.clear()
        self.status = ErrandState(errand.phase, temperature_c=self.status.temperature_c, angle=self.status.angle)
        self._errands.put(errand)

    def take(self) -> list[Reading]:
        """The readings since the last call."""
        taken = []
        while self._readings:
            taken.append(self._readings.popleft())
        return taken

    def stop(self) -> None:
        """Ask for the end of the errand; it has come when `status.ended`."""
        self._stop_wanted.set()
        self._look_now.set()

    def hang_up(self) -> None:
        """Ask for the end of the connection, once the errand is over."""
        self.leaving = True
        self._errands.put(None)

    def join(self) -> None:
        """Wait until the board has stopped, the log is closed and the port is free."""
        self._thread.join()

    # Report: what an errand tells

    @property
    def stop_wanted(self) -> bool:
        """Whether a person wants the errand to end."""
        return self._stop_wanted.is_set()

    def advance(self, phase: Phase, **known: Any) -> None:
        """The errand has come that far."""
        self.status = replace(self.status, phase=phase, **known)

    def take_in(self, reading: Reading) -> None:
        """The errand has made a reading."""
        self._readings.append(reading)

    def warn(self, message: str) -> None:
        """Something to tell that does not end the errand."""
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
            self.leaving = True  # before the errand is seen to have ended, lest another be asked of it
            self._failed(error)
        finally:
            self.link = None
            self._over.set()

    def _converse(self, scanner: Scanner) -> None:
        hung_up = threading.Event()
        self.link = _seen(scanner)
        self.advance(self.status.phase, temperature_c=scanner.info.temperature_c)
        watcher = threading.Thread(target=self._watch, args=(scanner, hung_up), name="watch the line", daemon=True)
        watcher.start()
        try:
            while (errand := self._errands.get()) is not None:
                self._do(errand, scanner)
        finally:
            hung_up.set()
            self._look_now.set()
            watcher.join()

    def _do(self, errand: Errand, scanner: Scanner) -> None:
        try:
            self.advance(errand.phase)
            outcome = Outcome.STOPPED if self.stop_wanted else errand.run(scanner, self)
        except (LinkError, NoAnswer, WrongDevice, Incompatible):
            raise
        except SonarError as error:  # the scanner is still there
            self._failed(error)
        else:
            self.advance(Phase.STOPPED if outcome is Outcome.STOPPED else errand.done)

    def _failed(self, error: Exception) -> None:
        # whatever breaks while it is being stopped belongs to the stopping
        stopping = self.stop_wanted and isinstance(error, SonarError)
        self.advance(Phase.STOPPED if stopping else Phase.FAILED, error=None if stopping else error)

    def _watch(self, scanner: Scanner, hung_up: threading.Event) -> None:
        """Look at the line now and then, and stop the scanner: neither may hold up the window or the errand."""
        while not hung_up.is_set():
            if self.stop_wanted and not self.status.ended:
                with suppress(SonarError):  # said again until the errand has noticed
                    scanner.stop()
            self.link = _seen(scanner)
            self._look_now.wait(_LOOK_EVERY)
            self._look_now.clear()


def _seen(scanner: Scanner) -> LinkSeen:
    return LinkSeen(
        url=scanner.url,
        device=scanner.info,
        connection=scanner.state,
        statistics=scanner.statistics,
        baud=scanner.baud,
        drift=scanner.clock_drift,
        loss=str(scanner.loss or ""),
    )
