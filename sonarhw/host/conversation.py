"""One conversation with a device, from Hello until the device is lost.

A conversation runs one script at a time on a driver. The scripts are in `greeting` and `actions`. Their building blocks
are here: send a command, wait for its answer, and wait until an action has ended.
"""

import math
from dataclasses import dataclass
from typing import TypeVar

from sonarhw.errors import DeviceError, InputError, LostSteps, NoAnswer
from sonarhw.host.driver import TRIES, Command, Driver, raise_if_refused
from sonarhw.host.job import Job, Script, Wait
from sonarhw.wire.codes import Outcome, Zero
from sonarhw.wire.limits import FIRST_BAUD
from sonarhw.wire.messages import (
    AnswerMessage,
    Capabilities,
    Configure,
    ConfigureTurntable,
    Info,
    Message,
    MessageError,
    Settings,
    Started,
    Stop,
)

MOVE_WITHIN = 120.0  # s; limit for a Home or a Turn

T = TypeVar("T")


@dataclass
class KnownDevice:
    """The state of a device that is kept from one conversation to the next."""

    where: str  # name of the device in error messages
    baud: int = FIRST_BAUD  # current baud rate of the line
    most_baud: int = 0  # highest baud rate to try, after a higher one has failed; 0: that of the device
    info: Info | None = None
    capabilities: Capabilities | None = None
    settings: Settings | None = None  # in force
    configured: Configure | None = None  # sent again in the next conversation
    turntable: ConfigureTurntable | None = None  # sent again in the next conversation
    zero: Zero = Zero.UNKNOWN


class Conversation:
    """One conversation. All times are s on one monotonic clock."""

    def __init__(self, driver: Driver, device: KnownDevice, bauds: bool, now: float) -> None:
        """Use `driver`. `bauds` is True if the baud rate of the line can be set."""
        self.driver = driver
        self.device = device
        self.bauds = bauds
        self.now = now
        self._script: Script[None] | None = None
        self._wait: Wait | None = None

    # the script

    def begin(self, script: Script[None]) -> None:
        """Run `script` from the next call of `step`."""
        self._script, self._wait = script, None

    def step(self, now: float) -> None:
        """Run the script until it waits. If the script raises an error, `step` raises it and drops the script."""
        self.now = now
        while self._script is not None and (self._wait is None or self._wait.done() or now >= self._wait.until):
            script, self._script = self._script, None
            self._wait = next(script)
            self._script = script

    def next_event(self) -> float:
        """Return the time of the next due work, s."""
        return min(self.driver.next_event(), self._wait.until if self._script and self._wait else math.inf)

    def end(self) -> None:
        """Drop the script."""
        if self._script:
            self._script.close()
        self._script = None

    # building blocks of scripts

    def send(self, message: Message, tries: int = TRIES) -> Command:
        """Send a command. Raises InputError if a value does not fit its field."""
        try:
            return self.driver.command(message, self.now, tries)
        except MessageError as error:
            raise InputError(f"{type(message).__name__} cannot be sent: {error}") from error

    def request(self, message: Message) -> Script[AnswerMessage]:
        """Send a command and return its answer. Raises CommandRefused."""
        command = self.send(message)
        yield settled(command)
        raise_if_refused(command, self.device.where)
        if command.answer is None:
            raise NoAnswer(f"{self.device.where}: no answer to {command.name}")
        return command.answer

    def request_typed(self, message: Message, expected: type[T]) -> Script[T]:
        """Send a command and return its answer. Raises CommandRefused, DeviceError if it is not an `expected`."""
        answer = yield from self.request(message)
        if not isinstance(answer, expected):
            raise DeviceError(
                f"{self.device.where}: answered {type(message).__name__} with {type(answer).__name__}; "
                f"expected {expected.__name__}"
            )
        return answer

    def act(self, message: Message, job: Job | None) -> Script[Outcome]:
        """Run a Home, Turn or StartScan until it ends or no more readings are needed. Raises LostSteps, DeviceError."""
        command = self.send(message)
        if job:
            job.command = command
        yield settled(command)
        raise_if_refused(command, self.device.where)
        scan = isinstance(command.answer, Started) and job is not None
        if job:
            job.moving = True
        yield from self._follow(command, job, math.inf if scan else self.now + MOVE_WITHIN)
        if command.broken:
            raise broken_protocol(self.device.where, command.broken)
        outcome = self._outcome(command)
        if outcome is Outcome.STOPPED and not scan and not (job and job.stop_wanted):
            # the device stopped by itself, because it received nothing from the host for too long: repeat the command
            return (yield from self.act(message, job))
        return outcome

    def _follow(self, command: Command, job: Job | None, deadline: float) -> Script[None]:
        """Wait until the action of a command has ended. Stop it on request and at the deadline."""

        def over() -> bool:
            return command.finished is not None and self.driver.scan_complete

        yield Wait(lambda: over() or self._is_enough(job) or command.broken is not None, deadline)
        if command.finished is None:
            stop = self.send(Stop())
            yield Wait(lambda: over() and stop.settled)
            if self.now >= deadline:
                text = f"{self.device.where}: {command.name} took more than {MOVE_WITHIN:g} s and was stopped"
                raise DeviceError(f"{text}; check that the turntable can move freely")

    def _is_enough(self, job: Job | None) -> bool:
        if job is None:
            return False
        info = self.device.info
        older = info is not None and info.minor < 1  # would repeat readings that have already been received
        return job.stop_wanted or (older and job.progress.total > 0 and job.progress.complete)

    def _outcome(self, command: Command) -> Outcome:
        finished, where = command.finished, self.device.where
        if finished is None or finished.outcome in (Outcome.DONE, Outcome.STOPPED):
            return Outcome.STOPPED if finished is None else Outcome(finished.outcome)
        if finished.outcome == Outcome.LOST_STEPS:
            self.device.zero = Zero.UNKNOWN
            raise LostSteps(f"{where}: {finished.text or 'steps were lost'}")
        raise DeviceError(f"{where}: {command.name} failed: {finished.text or 'the board gave no reason'}")


def broken_protocol(where: str, rule: str) -> DeviceError:
    """Return the error for firmware that breaks a rule of the protocol."""
    return DeviceError(f"{where}: its firmware breaks the protocol: {rule}; see firmware_protocol.md")


def settled(command: Command, until: float = math.inf) -> Wait:
    """Return the wait until a command is answered or given up."""
    return Wait(lambda: command.settled, until)
