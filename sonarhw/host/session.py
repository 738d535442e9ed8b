"""A session with one scanner over however many connections: from disconnected to streaming to lost, and on.

    DISCONNECTED -> OPENING -> GREETING -> PREPARING -> READY <-> MOVING, STREAMING
                       ^           ^                                   |
                       |           +-------- silence, reset -----------+
                       +-- LOST <----------- port gone, no answer -----+

It has no threads, ports or clock: its caller opens the link and brings the bytes and the time. A job is begun as soon
as the device is ready, and begun again after each loss; what is said to the device is in `greeting` and `actions`.
"""

import math
import random
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from enum import StrEnum

from sonarhw.errors import (
    DeviceError,
    DeviceReset,
    Incompatible,
    InputError,
    LinkError,
    LinkLost,
    NoAnswer,
    SonarError,
    WrongDevice,
)
from sonarhw.host.conversation import Conversation, KnownDevice
from sonarhw.host.driver import Driver
from sonarhw.host.greeting import greet, prepare
from sonarhw.host.job import Job, Script, Wait
from sonarhw.host.recorder import JobRecording
from sonarhw.link.link_statistics import LinkStatistics
from sonarhw.wire.device_clock import DeviceClock
from sonarhw.wire.messages import Outcome

PATIENCE = 10.0  # s for a first greeting: each speed of the line three times, or fewer where setting it takes its time
GREET_AGAIN = 3.0  # s on a port that is still open
RECONNECT = 30.0  # s in which a lost device may come back before who waits for it is told
FRUITLESS = 10  # losses in a row without a reading in between; then who waits is told, though it always comes back
PAUSES = (0.25, 0.5, 1.0, 2.0, 4.0)  # s before the port is opened again


class Connection(StrEnum):
    """How a session stands with its device."""

    DISCONNECTED = "disconnected"
    OPENING = "opening"
    GREETING = "greeting"
    PREPARING = "preparing"
    READY = "ready"
    MOVING = "moving"
    STREAMING = "streaming"
    LOST = "lost"


class Session:
    """One device, greeted again and again. Times are s on one clock that does not run backwards."""

    def __init__(
        self,
        where: str,
        patience: float = PATIENCE,
        reconnect: float = RECONNECT,
        chance: random.Random | None = None,
    ) -> None:
        """`where` names the device in messages; `chance` says where frames begin to count."""
        self.clock = DeviceClock()
        self.device = KnownDevice(where)
        self.bauds = False  # whether the speed of the line can be set
        self.recording = JobRecording(wanted=lambda: bool(self._jobs))
        self.failed: SonarError | None = None  # why it never came to a conversation
        self.wants_close = False
        self._patience, self._reconnect = patience, reconnect
        self._chance = chance or random.Random()
        self._phase = Connection.DISCONNECTED
        self._met = False  # whether it has been ready once
        self._open = False
        self._next_open = math.inf
        self._pauses = iter(PAUSES)
        self._lost_at: float | None = None
        self._why: SonarError = NoAnswer(f"{where}: nobody has answered yet")
        self._earlier = LinkStatistics()  # of former connections
        self._conversation: Conversation | None = None
        self._jobs: deque[Job] = deque()  # the first is at work

    # how it stands

    @property
    def state(self) -> Connection:
        """How it stands with the device."""
        if self._phase is Connection.READY and self._jobs and self._jobs[0].moving:
            return Connection.STREAMING if self._jobs[0].began is not None else Connection.MOVING
        return self._phase

    @property
    def statistics(self) -> LinkStatistics:
        """What has passed over all connections."""
        talk = self._conversation
        books = self._earlier + talk.driver.statistics if talk else self._earlier
        return replace(books, resets=self.clock.resets)

    @property
    def loss(self) -> SonarError | None:
        """Why the device is away; None while it is there, or before it was."""
        return None if self._lost_at is None else self._why

    @property
    def job(self) -> Job | None:
        """What is at work, or waits for the device to come back."""
        return self._jobs[0] if self._jobs else None

    # what is wanted

    def connect(self, now: float) -> None:
        """Begin."""
        self._phase, self._next_open = Connection.OPENING, now

    def start(self, job: Job, now: float) -> Job:
        """Begin a job, behind those that have not ended; whoever waits for it looks at `done`."""
        job.since = now
        self._jobs.append(job)
        self._next_open = min(self._next_open, now)
        self._step(now)
        return job

    def stop(self, job: Job, now: float) -> None:
        """End a job; where the device is lost it ends at once."""
        job.stop_wanted = True
        if self._phase not in (Connection.READY, Connection.PREPARING):
            self._end(job, Outcome.STOPPED)
        self._step(now)

    def hold(self, now: float) -> None:
        """Nobody takes the bytes that come; only show life."""
        if self._conversation:
            self._conversation.driver.hold(now)

    # the link

    def wants_open(self, now: float) -> bool:
        """Whether the port is to be opened; `opened` or `open_failed` is to follow."""
        return not self._open and self.failed is None and now >= self._next_open

    def opened(self, now: float, quiet: float = 0.0, bauds: bool = False) -> None:
        """The port is open: listen for `quiet` s before greeting; `bauds` tells whether its speed can be set."""
        self._open, self.bauds = True, bauds
        self._earlier = self._earlier.more(reopened=int(self._met))
        self._greet(now, quiet, GREET_AGAIN if self._met else self._patience)
        self._step(now)

    def open_failed(self, error: SonarError, now: float) -> None:
        """The port cannot be opened."""
        if self._met and not isinstance(error, InputError):
            self._open_later(now)
            self._step(now)
        else:
            self._fail(error)

    def broke(self, error: LinkError, now: float) -> None:
        """The port is gone."""
        self._open = self.wants_close = False
        if not self._met:
            self._fail(error)
            return
        self._lose(error, now)
        self._open_later(now)
        self._step(now)

    def closed(self) -> None:
        """The port has been closed as wanted."""
        self._open = self.wants_close = False

    def outgoing(self) -> bytes:
        """Bytes to write, at the speed of `device.baud`."""
        return self._conversation.driver.outgoing() if self._conversation else b""

    def receive(self, data: bytes, now: float, arrived: float | None = None) -> None:
        """Take bytes from the device."""
        if self._conversation:
            driver = self._conversation.driver
            self._guarded(lambda: driver.receive(data, now, arrived), now)
        self._step(now)

    def advance(self, now: float) -> None:
        """Do what is due; to be called when all bytes that wait have been received."""
        if self._conversation:
            driver = self._conversation.driver
            self._guarded(lambda: driver.advance(now), now)
        self._step(now)

    def next_event(self) -> float:
        """When `advance` next has something to do, s."""
        talk = self._conversation
        due = [talk.next_event() if talk else self._next_open if not self._open else math.inf]
        due += [self._deadline()] if self._jobs and self._lost_at is not None else []
        return min(due)

    # life of a connection

    def _greet(self, now: float, quiet: float, patience: float) -> None:
        self._phase = Connection.GREETING
        driver = Driver(self._chance.randrange(0x10000), self.device.where, self.clock, self.recording.frame)
        self._conversation = Conversation(driver, self.device, self.bauds, now)
        self._conversation.begin(self._live(self._conversation, quiet, patience))

    def _live(self, talk: Conversation, quiet: float, patience: float) -> Script[None]:
        yield from greet(talk, quiet, patience)
        self._phase = Connection.PREPARING
        yield from self._prepare(talk, self._jobs[0] if self._jobs else None)
        self._phase, self._met = Connection.READY, True
        self._lost_at, self._pauses = None, iter(PAUSES)
        while True:
            yield Wait(lambda: bool(self._jobs))
            yield from self._work(talk, self._jobs[0])

    def _prepare(self, talk: Conversation, job: Job | None) -> Script[None]:
        try:
            yield from prepare(talk, job)
        except (NoAnswer, DeviceReset):
            raise
        except DeviceError as error:
            if not self._met:
                raise
            # it is there again, but does not find its zero or no longer takes its settings
            if job:
                self._end(job, error=error)

    def _work(self, talk: Conversation, job: Job) -> Script[None]:
        if job.stop_wanted:
            self._end(job, Outcome.STOPPED)
            return
        try:
            result = yield from job.script(talk, job)
        except (DeviceError, InputError) as error:
            self._end(job, error=error)
        else:
            self._collect()
            self._end(job, result)

    def _step(self, now: float) -> None:
        """Go on with the script as far as it goes."""
        self._collect()
        self._give_up_recording()
        if self._conversation:
            try:
                self._conversation.step(now)
            except SonarError as error:
                self._script_failed(error, now)
        self._complain_of_loss(now)

    def _collect(self) -> None:
        if self._jobs:
            self._jobs[0].heed_start(self.clock)
        for reading in self._conversation.driver.readings() if self._conversation else ():
            if self._jobs and self._jobs[0].take(reading):
                self._jobs[0].fruitless = 0
                self.recording.reading(reading)
                # nothing is handed on that could not be recorded
                if self.recording.failure is None and self._jobs[0].error is None:
                    self._jobs[0].readings.append(reading)

    def _end(self, job: Job, result: object = None, error: BaseException | None = None) -> None:
        job.end(result, error)
        if self._jobs and self._jobs[0] is job:
            self._jobs.popleft()

    def _give_up_recording(self) -> None:
        error = self.recording.take_failure()
        if error is not None and self._jobs:
            self._jobs[0].end(error=error)
            self._jobs[0].stop_wanted = True

    # losing and finding

    def _guarded(self, work: Callable[[], None], now: float) -> None:
        try:
            work()
        except (NoAnswer, DeviceReset) as error:
            # the port is there, the device may be: ask
            self._lose(error, now)
            self._greet(now, 0.0, GREET_AGAIN)

    def _script_failed(self, error: SonarError, now: float) -> None:
        """It does not answer a greeting, or cannot be made ready."""
        self.wants_close = True
        if not self._met:
            self._fail(error)
            return
        self._lose(error, now)
        self._why = error
        self._open_later(now)

    def _lose(self, error: SonarError, now: float) -> None:
        talk = self._conversation
        if talk:
            talk.driver.flush()
            self._collect()
            self._earlier += talk.driver.statistics
            talk.end()
        if self._lost_at is None:
            self._lost_at, self._why = now, error
            self._earlier = self._earlier.more(losses=1)
            self._complain_of_losses(error)
        self._conversation = None
        self._phase = Connection.LOST
        for job in [*self._jobs]:
            job.moving = False
            if job.stop_wanted:
                self._end(job, Outcome.STOPPED)

    def _open_later(self, now: float) -> None:
        self._phase = Connection.LOST
        self._next_open = now + next(self._pauses, PAUSES[-1])

    def _fail(self, error: SonarError) -> None:
        self.failed, self.wants_close, self._phase = error, self._open, Connection.DISCONNECTED
        self._conversation = None
        for job in [*self._jobs]:
            self._end(job, error=error)

    def _deadline(self) -> float:
        return max(self._jobs[0].since, self._lost_at or 0.0) + self._reconnect

    def _complain_of_losses(self, error: SonarError) -> None:
        if not self._jobs:
            return
        job = self._jobs[0]
        job.fruitless += 1
        if job.fruitless >= FRUITLESS:
            text = f"{error}; it was lost {FRUITLESS} times in a row and came back each time, but nothing came of it"
            self._end(job, error=LinkLost(text))

    def _complain_of_loss(self, now: float) -> None:
        while self._jobs and self._lost_at is not None and now >= self._deadline():
            back = f"; it was not back within {self._reconnect:g} s" if self._reconnect else ""
            kind = type(self._why) if isinstance(self._why, WrongDevice | Incompatible) else LinkLost
            self._end(self._jobs[0], error=kind(f"{self._why}{back}"))
