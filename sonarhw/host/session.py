"""A session with one scanner, over any number of connections, and what a recorder receives of it."""

import math
import random
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from enum import StrEnum
from typing import Protocol, runtime_checkable

from sonarhw import errors
from sonarhw.host.driver import Driver
from sonarhw.host.scripts import Conversation, Job, KnownDevice, Script, Wait, greet, prepare
from sonarhw.link import LinkStatistics
from sonarhw.readings import Reading
from sonarhw.wire.frames import frame_type
from sonarhw.wire.messages import Capabilities, Heartbeat, Hello, Info, Outcome, Settings
from sonarhw.wire.readings_of_frames import DeviceClock


@runtime_checkable
class Recorder(Protocol):
    """Receives frames and readings in order, in the thread that drives the scanner. `LogWriter` writes a file.

    If it has a method `received_bytes(time, data)`, this receives the bytes of a device that sends no frames.
    """

    def frame(self, received: bool, time: float, wire: bytes) -> None:
        """Record the bytes of one undamaged frame as they were on the line, with its delimiter.

        `received` is True for a frame from the device, False for one from the host. `time` is the host's time in
        s since the epoch, from a monotonic clock.
        """

    def reading(self, reading: Reading) -> None:
        """Record one decoded reading, after its frames."""


class JobRecording:
    """Passes frames and readings to a recorder while a job runs. A new recorder receives the greeting first.

    A recorder that raises an error is dropped, so that the device can still be stopped. `failure` is then the error.
    """

    def __init__(self, wanted: Callable[[], bool]) -> None:
        """`wanted` returns True while a job runs."""
        self.failure: BaseException | None = None
        self._wanted = wanted
        self._recorder: Recorder | None = None
        # by message type: the newest Hello, and what the device has answered about itself since
        self._greeting: dict[int, tuple[bool, float, bytes]] = {}

    def use(self, recorder: Recorder | None) -> None:
        """Record with `recorder` from now on. None ends the recording. Raises what `recorder` raises."""
        self._recorder = recorder
        if recorder:
            for received, time, wire in self._greeting.values():
                recorder.frame(received, time, wire)

    def frame(self, received: bool, time: float, wire: bytes) -> None:
        """Record a frame. This is the `Tap` of a driver."""
        kind = frame_type(wire[:-1])
        if kind == Hello.TYPE and not received:
            self._greeting = {}
        if kind in (Hello.TYPE, Info.TYPE, Capabilities.TYPE, Settings.TYPE):
            self._greeting[kind] = received, time, wire
        self._record(lambda recorder: recorder.frame(received, time, wire))

    def reading(self, reading: Reading) -> None:
        """Record a reading, after its frames."""
        self._record(lambda recorder: recorder.reading(reading))

    def received_bytes(self, time: float, data: bytes) -> None:
        """Record bytes of a device that sends no frames, before the frames of their readings."""
        received = getattr(self._recorder, "received_bytes", None)
        if received:
            self._record(lambda _: received(time, data))

    def _record(self, act: Callable[[Recorder], None]) -> None:
        if self._recorder is None or not self._wanted():
            return
        try:
            act(self._recorder)
        except BaseException as error:  # noqa: BLE001 - raised again in the thread that waits for the job
            self._recorder, self.failure = None, error


# states of a connection:
#
#     DISCONNECTED -> OPENING -> GREETING -> PREPARING -> READY <-> MOVING, STREAMING
#                        ^           ^                                   |
#                        |           +-------- silence, reset -----------+
#                        +-- LOST <----------- port gone, no answer -----+


PATIENCE = 10.0  # s for the first greeting; enough for three attempts at each baud rate
GREET_AGAIN = 3.0  # s for a greeting on a port that is still open
RECONNECT = 30.0  # s in which a lost device may come back before the caller gets an error
MAX_GREETINGS = 3  # answered, with the same command after them unanswered; the caller then gets an error
MAX_LOSSES = 10  # losses without a reading in between; the caller then gets an error
PAUSES = (0.25, 0.5, 1.0, 2.0, 4.0)  # s before each attempt to open the port again; the last one is repeated


class Connection(StrEnum):
    """State of the connection to a device."""

    DISCONNECTED = "disconnected"
    OPENING = "opening"
    GREETING = "greeting"
    PREPARING = "preparing"
    READY = "ready"
    MOVING = "moving"
    STREAMING = "streaming"
    LOST = "lost"


class Session:
    """The connection to one device, with a new greeting after each loss. All times are s on one monotonic clock.

    A session has no threads, ports or clock. The caller opens the link, and passes bytes and time. A job starts as soon
    as the device is ready, and starts again after each loss.
    """

    def __init__(
        self,
        where: str,
        patience: float = PATIENCE,
        reconnect: float = RECONNECT,
        rng: random.Random | None = None,
    ) -> None:
        """`where` names the device in error messages. `rng` chooses the first sequence number of each conversation."""
        self.clock = DeviceClock()
        self.device = KnownDevice(where)
        self.bauds = False  # whether the baud rate of the line can be set
        self.recording = JobRecording(wanted=lambda: bool(self._jobs))
        self.failed: errors.SonarError | None = None  # why the first greeting failed
        self.wants_close = False
        self._patience, self._reconnect = patience, reconnect
        self._rng = rng or random.Random()
        self._phase = Connection.DISCONNECTED
        self._greeted_only = 0  # conversations, one after another, in which no command but Hello was answered
        self._was_ready = False  # whether the device has been ready once
        self._open = False
        self._next_open = math.inf
        self._pauses = iter(PAUSES)
        self._lost_at: float | None = None
        self._cause: errors.SonarError = errors.NoAnswer(f"{where}: no scanner has answered yet")  # of the newest loss
        self._earlier = LinkStatistics()  # of earlier connections
        self._conversation: Conversation | None = None
        self._jobs: deque[Job] = deque()  # the first one runs

    # state

    @property
    def state(self) -> Connection:
        """State of the connection."""
        if self._phase is Connection.READY and self._jobs and self._jobs[0].moving:
            return Connection.STREAMING if self._jobs[0].streaming else Connection.MOVING
        return self._phase

    @property
    def statistics(self) -> LinkStatistics:
        """Counters of the traffic over all connections."""
        talk = self._conversation
        counts = self._earlier + talk.driver.statistics if talk else self._earlier
        return replace(counts, resets=self.clock.resets)

    @property
    def heartbeat(self) -> Heartbeat | None:
        """The newest heartbeat of the present connection."""
        return self._conversation.driver.heartbeat if self._conversation else None

    @property
    def loss(self) -> errors.SonarError | None:
        """Reason of the loss; None while the device is connected, and before it was ready for the first time."""
        return None if self._lost_at is None else self._cause

    @property
    def job(self) -> Job | None:
        """The job that runs, or waits for the device to come back."""
        return self._jobs[0] if self._jobs else None

    # requests of the caller

    def connect(self, now: float) -> None:
        """Start to connect."""
        self._phase, self._next_open = Connection.OPENING, now

    def start(self, job: Job, now: float) -> Job:
        """Append a job to the queue. The caller checks its `done`."""
        job.since = now
        self._jobs.append(job)
        self._next_open = min(self._next_open, now)
        self._step(now)
        return job

    def stop(self, job: Job, now: float) -> None:
        """End a job. If the device is lost, it ends at once."""
        job.stop_wanted = True
        if self._phase not in (Connection.READY, Connection.PREPARING):
            self._end(job, Outcome.STOPPED)
        self._step(now)

    def keep_alive(self, now: float) -> None:
        """Send signs of life only, while the caller leaves received bytes unread."""
        if self._conversation:
            self._conversation.driver.keep_alive(now)

    # the link

    def wants_open(self, now: float) -> bool:
        """Whether the caller must open the port now, and then call `opened` or `open_failed`."""
        return not self._open and self.failed is None and now >= self._next_open

    def opened(self, now: float, quiet: float = 0.0, bauds: bool = False) -> None:
        """Greet the device on the open port after `quiet` s. `bauds` is True if the baud rate can be set."""
        self._open, self.bauds = True, bauds
        self._earlier = self._earlier.more(reopened=int(self._was_ready))
        self._greet(now, quiet, GREET_AGAIN if self._was_ready else self._patience)
        self._step(now)

    def open_failed(self, error: errors.SonarError, now: float) -> None:
        """Handle a port that cannot be opened."""
        if self._was_ready and not isinstance(error, errors.InputError):
            self._open_later(now)
            self._step(now)
        else:
            self._fail(error)

    def broke(self, error: errors.LinkError, now: float) -> None:
        """Handle the loss of the open port."""
        self._open = self.wants_close = False
        if not self._was_ready:
            self._fail(error)
            return
        self._lose(error, now)
        self._open_later(now)
        self._step(now)

    def closed(self) -> None:
        """Handle the closing of the port, which the caller does after `wants_close`."""
        self._open = self.wants_close = False

    def outgoing(self) -> bytes:
        """Return the bytes to write, at the baud rate `device.baud`."""
        return self._conversation.driver.outgoing() if self._conversation else b""

    def receive(self, data: bytes, now: float, arrived: float | None = None) -> None:
        """Process bytes from the device."""
        if self._conversation:
            driver = self._conversation.driver
            self._guarded(lambda: driver.receive(data, now, arrived), now)
        self._step(now)

    def advance(self, now: float) -> None:
        """Do the due work. Call this after all waiting bytes have been received."""
        if self._conversation:
            driver = self._conversation.driver
            self._guarded(lambda: driver.advance(now), now)
        self._step(now)

    def next_event(self) -> float:
        """Return the time when `advance` is next needed, s."""
        talk = self._conversation
        due = [talk.next_event() if talk else self._next_open if not self._open else math.inf]
        due += [self._deadline()] if self._jobs and self._lost_at is not None else []
        return min(due)

    # life of a connection

    def _greet(self, now: float, quiet: float, patience: float) -> None:
        self._phase = Connection.GREETING
        driver = Driver(self._rng.randrange(0x10000), self.device.where, self.clock, self.recording.frame)
        self._conversation = Conversation(driver, self.device, self.bauds, now)
        self._conversation.begin(self._converse(self._conversation, quiet, patience))

    def _converse(self, talk: Conversation, quiet: float, patience: float) -> Script[None]:
        yield from greet(talk, quiet, patience)
        self._phase = Connection.PREPARING
        yield from self._prepare(talk, self._jobs[0] if self._jobs else None)
        self._phase, self._was_ready = Connection.READY, True
        self._lost_at, self._pauses = None, iter(PAUSES)
        while True:
            yield Wait(lambda: bool(self._jobs))
            yield from self._run(talk, self._jobs[0])

    def _prepare(self, talk: Conversation, job: Job | None) -> Script[None]:
        try:
            yield from prepare(talk, job)
        except (errors.NoAnswer, errors.DeviceReset):
            raise
        except errors.DeviceError as error:
            if not self._was_ready:
                raise
            # the device is back, but it cannot home or refuses its settings: only the job fails
            if job:
                self._end(job, error=error)

    def _run(self, talk: Conversation, job: Job) -> Script[None]:
        if job.stop_wanted:
            self._end(job, Outcome.STOPPED)
            return
        try:
            result = yield from job.script(talk, job)
            self._greeted_only = 0
        except (errors.DeviceError, errors.InputError) as error:
            self._end(job, error=error)
        else:
            self._collect()
            self._end(job, result)

    def _step(self, now: float) -> None:
        """Run the script until it waits."""
        self._collect()
        self._give_up_recording()
        if self._conversation:
            try:
                self._conversation.step(now)
            except errors.SonarError as error:
                self._script_failed(error, now)
        self._fail_overdue_jobs(now)

    def _collect(self) -> None:
        if self._jobs:
            self._jobs[0].note_start(self.clock)
        for reading in self._conversation.driver.readings() if self._conversation else ():
            if self._jobs and self._jobs[0].take(reading):
                self._jobs[0].losses_in_a_row = self._greeted_only = 0
                self.recording.reading(reading)
                # a reading that could not be recorded is not delivered
                if self.recording.failure is None and self._jobs[0].error is None:
                    self._jobs[0].readings.append(reading)

    def _end(self, job: Job, result: object = None, error: BaseException | None = None) -> None:
        job.end(result, error)
        if self._jobs and self._jobs[0] is job:
            self._jobs.popleft()

    def _give_up_recording(self) -> None:
        error, self.recording.failure = self.recording.failure, None
        if error is not None and self._jobs:
            self._jobs[0].end(error=error)
            self._jobs[0].stop_wanted = True

    # loss of the device

    def _guarded(self, work: Callable[[], None], now: float) -> None:
        try:
            work()
        except (errors.NoAnswer, errors.DeviceReset) as error:
            talk = self._conversation
            if talk and talk.driver.unanswered and talk.driver.info:
                self._greeted_only += 1
                if self._greeted_only >= MAX_GREETINGS:
                    self._end_unanswered(talk.driver.unanswered, now)
                    return
            # the port is still open, so the device may answer a new greeting
            self._lose(error, now)
            self._greet(now, 0.0, GREET_AGAIN)

    def _end_unanswered(self, command: str, now: float) -> None:
        """End what waits for a device that answers Hello again and again, but not the command after it."""
        where = self.device.where
        error = errors.NoAnswer(
            f"{where}: answers Hello, not {command}; `sonarhw doctor URL --protocol` checks its firmware"
        )
        self._greeted_only = 0
        if not self._was_ready:
            self._fail(error)
            return
        if self._jobs:
            self._end(self._jobs[0], error=error)
        self._lose(error, now)
        self._greet(now, 0.0, GREET_AGAIN)

    def _script_failed(self, error: errors.SonarError, now: float) -> None:
        """Close the port of a device that does not answer the greeting or cannot be prepared."""
        self.wants_close = True
        if not self._was_ready:
            self._fail(error)
            return
        self._lose(error, now)
        self._cause = error
        self._open_later(now)

    def _lose(self, error: errors.SonarError, now: float) -> None:
        talk = self._conversation
        if talk:
            talk.driver.flush()
            self._collect()
            self._earlier += talk.driver.statistics
            talk.end()
        if self._lost_at is None:
            self._lost_at, self._cause = now, error
            self._earlier = self._earlier.more(losses=1)
            self._check_losses_in_a_row(error)
        self._conversation = None
        self._phase = Connection.LOST
        for job in [*self._jobs]:
            job.moving = False
            if job.stop_wanted:
                self._end(job, Outcome.STOPPED)

    def _open_later(self, now: float) -> None:
        self._phase = Connection.LOST
        self._next_open = now + next(self._pauses, PAUSES[-1])

    def _fail(self, error: errors.SonarError) -> None:
        self.failed, self.wants_close, self._phase = error, self._open, Connection.DISCONNECTED
        self._conversation = None
        for job in [*self._jobs]:
            self._end(job, error=error)

    def _deadline(self) -> float:
        return max(self._jobs[0].since, self._lost_at or 0.0) + self._reconnect

    def _check_losses_in_a_row(self, error: errors.SonarError) -> None:
        if not self._jobs:
            return
        job = self._jobs[0]
        job.losses_in_a_row += 1
        if job.losses_in_a_row >= MAX_LOSSES:
            text = (
                f"{error}; the scanner was lost {MAX_LOSSES} times in a row without a reading in between; if the cable "
                "is good, `sonarhw doctor URL --protocol` checks its firmware"
            )
            self._end(job, error=errors.LinkLost(text))

    def _fail_overdue_jobs(self, now: float) -> None:
        while self._jobs and self._lost_at is not None and now >= self._deadline():
            back = f"; the scanner did not come back within {self._reconnect:g} s" if self._reconnect else ""
            kind = (
                type(self._cause)
                if isinstance(self._cause, errors.WrongDevice | errors.Incompatible)
                else errors.LinkLost
            )
            self._end(self._jobs[0], error=kind(f"{self._cause}{back}"))
