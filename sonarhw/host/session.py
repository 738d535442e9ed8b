"""A session with one scanner over however many connections: from disconnected to streaming to lost, and on.

    DISCONNECTED -> OPENING -> GREETING -> PREPARING -> READY <-> MOVING, STREAMING
                       ^           ^                                   |
                       |           +-------- silence, reset -----------+
                       +-- LOST <----------- port gone, no answer -----+

Takes what happens to the link, bytes and jobs, each with the time; hands on what is to be done to the link, bytes and
readings. It has no threads, ports or clock. What is said to the device is `dialogue`; here is when: a job is begun as
soon as the device is ready, and begun again after each loss.
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
from sonarhw.host.driver import Driver
from sonarhw.host.recorder import Recorder
from sonarhw.host.scripts import Dialogue, Job, Script, Wait
from sonarhw.link.link_statistics import LinkStatistics
from sonarhw.readings import Reading
from sonarhw.wire.device_clock import DeviceClock
from sonarhw.wire.messages import Configure, ConfigureTurntable, Message, Outcome, StartScan, Turn

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
        self.dialogue = Dialogue(where, self.clock)
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
        self._script: Script[None] | None = None
        self._wait: Wait | None = None
        self._jobs: deque[Job] = deque()  # the first is at work
        self._recorder: Recorder | None = None
        self._recorder_failed: BaseException | None = None

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
        driver = self.dialogue.driver
        books = self._earlier + driver.statistics if driver else self._earlier
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
        if self.dialogue.driver:
            self.dialogue.driver.hold(now)

    def record(self, recorder: Recorder | None) -> None:
        """Hand what passes during jobs to `recorder`, and first the greeting; None: no longer."""
        self._recorder = recorder
        if recorder and self.dialogue.driver:
            for received, time, wire in self.dialogue.driver.greeting:
                recorder.frame(received, time, wire)

    def configuring(self, wish: Configure) -> Job:
        """Set how to ping; results in Settings."""
        return Job(lambda _: self.dialogue.configure(wish))

    def configuring_turntable(self, wish: ConfigureTurntable) -> Job:
        """Set how to turn; results in TurntableSettings."""
        return Job(lambda _: self.dialogue.configure_turntable(wish))

    def asking(self, message: Message) -> Job:
        """Ask anything that does no harm twice; results in its answer."""
        return Job(lambda _: self.dialogue.ask(message))

    def homing(self) -> Job:
        """Find the zero; results in an Outcome."""
        return Job(self.dialogue.home)

    def turning(self, message: Turn) -> Job:
        """Turn, having found the zero; results in an Outcome."""
        return Job(lambda job: self.dialogue.turn(message, job))

    def scanning(self, order: StartScan) -> Job:
        """Scan, having found the zero; `readings` of the job fill, the result is an Outcome."""
        job = Job(lambda job: self.dialogue.scan(order, job))
        job.progress.total = order.headings * order.sweeps * order.pings
        return job

    # the link

    def wants_open(self, now: float) -> bool:
        """Whether the port is to be opened; `opened` or `open_failed` is to follow."""
        return not self._open and self.failed is None and now >= self._next_open

    def opened(self, now: float, quiet: float = 0.0, bauds: bool = False) -> None:
        """The port is open: listen for `quiet` s before greeting; `bauds` tells whether its speed can be set."""
        self._open, self.dialogue.bauds = True, bauds
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
        """Bytes to write, at the speed of `dialogue.baud`."""
        return self.dialogue.driver.outgoing() if self.dialogue.driver else b""

    def receive(self, data: bytes, now: float, arrived: float | None = None) -> None:
        """Take bytes from the device."""
        if self.dialogue.driver:
            driver = self.dialogue.driver
            self._guarded(lambda: driver.receive(data, now, arrived), now)
        self._step(now)

    def advance(self, now: float) -> None:
        """Do what is due; to be called when all bytes that wait have been received."""
        if self.dialogue.driver:
            driver = self.dialogue.driver
            self._guarded(lambda: driver.advance(now), now)
        self._step(now)

    def next_event(self) -> float:
        """When `advance` next has something to do, s."""
        driver = self.dialogue.driver
        due = [driver.next_event() if driver else self._next_open if not self._open else math.inf]
        due += [self._wait.until] if self._wait else []
        due += [self._deadline()] if self._jobs and self._lost_at is not None else []
        return min(due)

    # Recorder: what the driver hands over goes on while a job is at work

    def frame(self, received: bool, time: float, wire: bytes) -> None:
        """Pass a frame on to the recorder."""
        self._recorded(lambda recorder: recorder.frame(received, time, wire))

    def reading(self, reading: Reading) -> None:
        """Nothing: readings are handed on by `_collect`, which knows those that came before."""

    def _recorded(self, hand_on: Callable[[Recorder], None]) -> None:
        if self._recorder is None or not self._jobs:
            return
        try:
            hand_on(self._recorder)
        except BaseException as error:  # noqa: BLE001 - raised again by whoever waits for the job
            # one that failed is let go, so that the device can still be stopped
            self._recorder, self._recorder_failed = None, error

    def _collect(self) -> None:
        if self._jobs:
            self.dialogue.heed_start(self._jobs[0])
        for reading in self.dialogue.driver.readings() if self.dialogue.driver else ():
            if self._jobs and self._jobs[0].take(reading):
                self._jobs[0].fruitless = 0
                self._pass_on(reading)
                # nothing is handed on that could not be recorded
                if self._recorder_failed is None and self._jobs[0].error is None:
                    self._jobs[0].readings.append(reading)

    def _pass_on(self, reading: Reading) -> None:
        self._recorded(lambda recorder: recorder.reading(reading))

    # life of a connection

    def _greet(self, now: float, quiet: float, patience: float) -> None:
        self._phase = Connection.GREETING
        self.dialogue.now = now
        self.dialogue.driver = Driver(self._chance.randrange(0x10000), self, self.dialogue.where, self.clock)
        self._script, self._wait = self._live(quiet, patience), None

    def _live(self, quiet: float, patience: float) -> Script[None]:
        yield from self.dialogue.greet(quiet, patience)
        self._phase = Connection.PREPARING
        yield from self._prepare(self._jobs[0] if self._jobs else None)
        self._phase, self._met = Connection.READY, True
        self._lost_at, self._pauses = None, iter(PAUSES)
        while True:
            yield Wait(lambda: bool(self._jobs))
            yield from self._work(self._jobs[0])

    def _prepare(self, job: Job | None) -> Script[None]:
        try:
            yield from self.dialogue.prepare(job)
        except (NoAnswer, DeviceReset):
            raise
        except DeviceError as error:
            if not self._met:
                raise
            # it is there again, but does not find its zero or no longer takes its settings
            if job:
                self._end(job, error=error)

    def _work(self, job: Job) -> Script[None]:
        if job.stop_wanted:
            self._end(job, Outcome.STOPPED)
            return
        try:
            result = yield from job.script(job)
        except (DeviceError, InputError) as error:
            self._end(job, error=error)
        else:
            self._collect()
            self._end(job, result)

    def _step(self, now: float) -> None:
        """Go on with the script as far as it goes."""
        self.dialogue.now = now
        self._collect()
        self._give_up_recording()
        while self._script is not None and (self._wait is None or self._wait.done() or now >= self._wait.until):
            try:
                self._wait = next(self._script)
            except SonarError as error:
                self._script = None
                self._script_failed(error, now)
        self._complain_of_loss(now)

    def _end(self, job: Job, result: object = None, error: BaseException | None = None) -> None:
        job.end(result, error)
        if self._jobs and self._jobs[0] is job:
            self._jobs.popleft()

    def _give_up_recording(self) -> None:
        error, self._recorder_failed = self._recorder_failed, None
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
        driver = self.dialogue.driver
        if driver:
            driver.flush()
            self._collect()
            self._earlier += driver.statistics
        if self._lost_at is None:
            self._lost_at, self._why = now, error
            self._earlier = self._earlier.more(losses=1)
            self._complain_of_losses(error)
        if self._script:
            self._script.close()
        self._script = self._wait = self.dialogue.driver = None
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
        self._script = self._wait = self.dialogue.driver = None
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
