"""One conversation with a device, from Hello until the device is lost: the driver, and the script that speaks.

Scripts are in `greeting` and `actions`; here is what they are made of: ask, act and wait for the end.
"""

import math
from dataclasses import dataclass
from typing import TypeVar

from sonarhw.errors import DeviceError, InputError, LostSteps, NoAnswer
from sonarhw.host.driver import TRIES, Command, Driver, raise_if_refused
from sonarhw.host.job import Job, Script, Wait
from sonarhw.wire.limits import FIRST_BAUD
from sonarhw.wire.messages import (
    AnswerMessage,
    Capabilities,
    Configure,
    ConfigureTurntable,
    Info,
    Message,
    MessageError,
    Outcome,
    Settings,
    Started,
    Stop,
)

MOVE_WITHIN = 120.0  # s for a home or a turn; the slowest turntable needs less

T = TypeVar("T")


@dataclass
class KnownDevice:
    """What a device has said and what was set on it; kept from one conversation to the next."""

    where: str  # its name in messages
    baud: int = FIRST_BAUD  # the speed that the line is to have now
    info: Info | None = None
    capabilities: Capabilities | None = None
    settings: Settings | None = None  # in force
    configured: Configure | None = None  # to be set again
    turntable: ConfigureTurntable | None = None  # to be set again
    homed: bool = False


class Conversation:
    """One conversation. Times are s on one clock that does not run backwards."""

    def __init__(self, driver: Driver, device: KnownDevice, bauds: bool, now: float) -> None:
        """`bauds` says whether the speed of the line can be set."""
        self.driver = driver
        self.device = device
        self.bauds = bauds
        self.now = now
        self._script: Script[None] | None = None
        self._wait: Wait | None = None

    # the script

    def begin(self, script: Script[None]) -> None:
        """Run `script` from the next `step` on."""
        self._script, self._wait = script, None

    def step(self, now: float) -> None:
        """Go on with the script as far as it goes. Raises what it raises, and has none from then on."""
        self.now = now
        while self._script is not None and (self._wait is None or self._wait.done() or now >= self._wait.until):
            script, self._script = self._script, None
            self._wait = next(script)
            self._script = script

    def next_event(self) -> float:
        """When there is something to do at the latest, s."""
        return min(self.driver.next_event(), self._wait.until if self._script and self._wait else math.inf)

    def end(self) -> None:
        """Drop the script."""
        if self._script:
            self._script.close()
        self._script = None

    # what scripts are made of

    def send(self, message: Message, tries: int = TRIES) -> Command:
        """Send a command. Raises InputError where a value does not fit its field."""
        try:
            return self.driver.command(message, self.now, tries)
        except MessageError as error:
            raise InputError(f"{type(message).__name__} cannot be sent: {error}") from error

    def ask(self, message: Message) -> Script[AnswerMessage]:
        """Ask anything. Raises CommandRefused."""
        command = self.send(message)
        yield settled(command)
        raise_if_refused(command, self.device.where)
        if command.answer is None:
            raise NoAnswer(f"{self.device.where}: no answer to {command.name}")
        return command.answer

    def asked(self, message: Message, expected: type[T]) -> Script[T]:
        """Ask what has an answer of type `expected`. Raises CommandRefused, DeviceError for another answer."""
        answer = yield from self.ask(message)
        if not isinstance(answer, expected):
            raise DeviceError(
                f"{self.device.where}: answered {type(message).__name__} with {type(answer).__name__}; "
                f"expected {expected.__name__}"
            )
        return answer

    def act(self, message: Message, job: Job | None) -> Script[Outcome]:
        """Home, turn or scan to its end, or until it is stopped or enough. Raises LostSteps, DeviceError."""
        command = self.send(message)
        if job:
            job.command = command
        yield settled(command)
        raise_if_refused(command, self.device.where)
        scan = isinstance(command.answer, Started) and job is not None
        if job:
            job.moving = True
        yield from self._follow(command, job, math.inf if scan else self.now + MOVE_WITHIN)
        outcome = self._outcome(command)
        if outcome is Outcome.STOPPED and not scan and not (job and job.stop_wanted):
            # nobody wanted that: it has not heard us for too long
            return (yield from self.act(message, job))
        return outcome

    def _follow(self, command: Command, job: Job | None, deadline: float) -> Script[None]:
        """Until what a command began has ended; it is stopped where that is wanted, or at the deadline."""

        def over() -> bool:
            return command.finished is not None and self.driver.scan_complete

        yield Wait(lambda: over() or self._is_enough(job), deadline)
        if command.finished is None:
            stop = self.send(Stop())
            yield Wait(lambda: over() and stop.settled)
            if self.now >= deadline:
                text = f"{self.device.where}: {command.name} took more than {MOVE_WITHIN:g} s and was stopped"
                raise DeviceError(f"{text}; does something hold the turntable?")

    def _is_enough(self, job: Job | None) -> bool:
        if job is None:
            return False
        info = self.device.info
        older = info is not None and info.minor < 1  # it makes all readings, those that have come too
        return job.stop_wanted or (older and job.progress.total > 0 and job.progress.complete)

    def _outcome(self, command: Command) -> Outcome:
        finished, where = command.finished, self.device.where
        if finished is None or finished.outcome in (Outcome.DONE, Outcome.STOPPED):
            return Outcome.STOPPED if finished is None else Outcome(finished.outcome)
        if finished.outcome == Outcome.LOST_STEPS:
            self.device.homed = False
            raise LostSteps(f"{where}: {finished.text or 'steps were lost'}")
        raise DeviceError(f"{where}: {command.name} failed: {finished.text or 'the board does not say why'}")


def settled(command: Command, until: float = math.inf) -> Wait:
    """Wait until a command has its answer or was given up."""
    return Wait(lambda: command.settled, until)
