"""The background work of the window: `Jobs.run` calls a function in a thread and passes its result to the GUI thread.

The jobs of one lane share a thread and run one after another. A new job replaces a waiting one with the same key.
"""

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from PySide6.QtCore import QObject, Qt, Signal, Slot

from sonarhw.errors import Cancelled, SonarError

_MOST_WAITING = 64  # jobs of a lane; another one is refused
CLOSED_WITHIN = 1.2  # s for what was cancelled; a call of a library may not end
_SAVED_WITHIN = 60.0  # s for jobs that are done at the end too; a disk may not answer


@dataclass(eq=False)
class BackgroundJob:
    """A function with its arguments and its receivers, its progress, and its result; shared by the two threads."""

    key: str
    lane: str
    function: Callable[..., Any]
    args: tuple[Any, ...]
    then: Callable[[Any], None] | None
    failed: Callable[[str], None] | None
    watch: "Callable[[BackgroundJob], None] | None"
    at_close: bool
    share: float = 0.0
    step: str = "beginning"
    part: Any = None  # the newest partial result
    cancelled: bool = False
    result: Any = None
    error: Exception | None = None

    def work(self) -> None:
        """Call the function, and keep its result or its error."""
        try:
            self.result = self.function(*self.args) if self.watch is None else self.function(*self.args, self)
        except Exception as error:  # noqa: BLE001 - reported in the GUI thread
            self.error = error

    # for the function

    def report(self, share: float, step: str = "") -> None:
        """Store the share that is done and the current step. Raises Cancelled."""
        self.share, self.step = share, step
        if self.cancelled:
            raise Cancelled("the job was cancelled")

    def show(self, part: object) -> None:
        """Store a partial result."""
        self.part = part


class _Lane:
    """One thread, and the jobs that wait for it, by their keys."""

    def __init__(self, name: str, done: Callable[[BackgroundJob], None]) -> None:
        """`done` is called in the thread after each job."""
        self._changed = threading.Condition()
        self._waiting: dict[str, BackgroundJob] = {}
        self._closing = False
        self._to_be_done = False  # whether the running job is to be done at the end too
        self._given_up = False  # whether the window was closed before the running job ended
        self._done = done
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    @property
    def is_full(self) -> bool:
        """Whether no further job may wait."""
        return len(self._waiting) >= _MOST_WAITING

    def put(self, job: BackgroundJob) -> None:
        """Let a job wait."""
        with self._changed:
            self._waiting[job.key] = job
            self._changed.notify()

    def drop(self, key: str) -> BackgroundJob | None:
        """Remove and return the waiting job with this key, if any."""
        with self._changed:
            return self._waiting.pop(key, None)

    def begin_to_close(self) -> None:
        """Drop the waiting jobs, except those to be done at the end too."""
        with self._changed:
            self._closing = True
            self._waiting = {key: job for key, job in self._waiting.items() if job.at_close}
            self._changed.notify()

    def join(self, until: float) -> None:
        """Wait for the end of the thread, after its current job, until a monotonic time; longer for files to save.

        A job that ends later is not reported.
        """
        while self._thread.is_alive() and (left := until - time.monotonic() + self._more_time) > 0:
            self._thread.join(min(left, CLOSED_WITHIN))
        with self._changed:
            self._given_up = True

    @property
    def _more_time(self) -> float:
        with self._changed:
            return _SAVED_WITHIN if self._to_be_done or self._waiting else 0.0

    def _run(self) -> None:
        while self._run_next():
            pass

    def _run_next(self) -> bool:
        """Run a job; return False at the end. While it waits, the thread keeps neither jobs nor results."""
        job = self._next()
        if job is None:
            return False
        job.work()
        with self._changed:
            if not self._given_up:
                self._done(job)
            return not self._given_up

    def _next(self) -> BackgroundJob | None:
        with self._changed:
            while not self._waiting and not self._closing:
                self._changed.wait()
            self._to_be_done = False
            if not self._waiting:
                return None
            job = self._waiting.pop(next(iter(self._waiting)))
            self._to_be_done = job.at_close
            return job


class Jobs(QObject):
    """Runs functions in threads. All methods are called in the GUI thread."""

    failed = Signal(str)  # the error of a job that has no receiver of its own
    _done = Signal(object)  # BackgroundJob

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._lanes: dict[str, _Lane] = {}
        # waiting, running, or with a result that was not taken yet; oldest first
        self._pending: dict[BackgroundJob, None] = {}
        self.closed = False  # any thread may look at it
        self._done.connect(self._finish, Qt.ConnectionType.QueuedConnection)

    def run(
        self,
        key: str,
        function: Callable[..., Any],
        *args: Any,
        then: Callable[[Any], None] | None = None,
        failed: Callable[[str], None] | None = None,
        progress: Callable[[BackgroundJob], None] | None = None,
        lane: str = "",
        at_close: bool = False,
    ) -> None:
        """Call `function(*args)` in the thread of the lane, by default that named as the key, and `then(result)` here.

        A waiting job with the same key is dropped. A running one still passes its result on, before the new one.

        `failed`: gets the message of a SonarError, by default the signal of this name. Any other error is a defect: it
        is raised here, after `failed("")`. `progress`: gets the job with each tick; the function gets it as its last
        argument. `at_close`: the job is done even if the window is closed while it waits.
        """
        if self.closed:
            return
        job = BackgroundJob(key, lane or key, function, args, then, failed, progress, at_close)
        self._drop(key)
        place = self._lanes.get(job.lane)
        if place is None:
            place = self._lanes[job.lane] = _Lane(job.lane, self._done.emit)
        if place.is_full:
            (failed or self.failed.emit)(f"{job.lane}: {_MOST_WAITING} jobs are waiting; try again later")
            return
        self._pending[job] = None
        place.put(job)

    def busy(self, lane: str) -> bool:
        """Return whether a job of a lane is waiting or running, or its result was not taken yet."""
        return any(job.lane == lane for job in self._pending)

    def cancel(self, key: str) -> None:
        """Drop the jobs with this key and their results; a function that looks at its progress ends soon."""
        self._drop(key)
        for job in self._pending:
            if job.key == key:
                job.cancelled = True

    def tick(self) -> None:
        """Pass on the progress of all jobs."""
        for job in list(self._pending):
            if job.watch is not None and not job.cancelled:
                job.watch(job)

    def close(self, until: float | None = None) -> None:
        """Cancel all jobs, do those that are to be done in any case, and end the threads.

        A job that has not ended at a monotonic time, by default CLOSED_WITHIN from now, ends with the program.
        """
        until = time.monotonic() + CLOSED_WITHIN if until is None else until
        self.closed = True
        for job in self._pending:
            job.cancelled = not job.at_close
        self._pending.clear()
        for lane in self._lanes.values():
            lane.begin_to_close()
        for lane in self._lanes.values():
            lane.join(until)
        self._lanes.clear()

    def _drop(self, key: str) -> None:
        for lane in self._lanes.values():
            if (job := lane.drop(key)) is not None:
                del self._pending[job]

    @Slot(object)
    def _finish(self, job: BackgroundJob) -> None:
        """Pass on the result or the error of a job."""
        if self.closed:
            return
        del self._pending[job]
        if job.cancelled:
            return
        if job.error is None:
            if job.then is not None:
                job.then(job.result)
        elif isinstance(job.error, SonarError):
            (job.failed or self.failed.emit)(str(job.error))
        else:
            if job.failed is not None:
                job.failed("")
            raise job.error
