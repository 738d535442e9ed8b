"""What the host says to a device: greeting, actions and jobs, as scripts of one conversation."""

import itertools
import math
import random
from array import array
from collections import deque
from collections.abc import Callable, Generator
from dataclasses import dataclass, replace
from typing import Any, TypeAlias, TypeVar

from sonarhw import errors
from sonarhw.host.driver import TRIES, Command, Driver, raise_if_refused
from sonarhw.readings import (
    MARK_APPROACH,
    MARK_OVERRUN,
    FloatArray,
    Reading,
    lost_steps_clause,
    nearest_mark,
    split_at_homings,
    unverified_clause,
)
from sonarhw.sound_speed import ScanAir
from sonarhw.wire import limits, messages
from sonarhw.wire.readings_of_frames import DeviceClock, Progress, broken_settings_rule, scan_order

# A script is dropped when the device is lost, and starts again when it is back. So it may send a command twice. This is
# safe: settings and angles are absolute, and a scan requests only the missing readings.


T = TypeVar("T")


@dataclass(frozen=True)
class Wait:
    """The condition that a script waits for."""

    done: Callable[[], bool]
    until: float = math.inf  # s; the script continues at this time even if it is not done


Script: TypeAlias = Generator[Wait, None, T]


class Job:
    """A job of the device. When it is `done`, it has a `result` or an `error`."""

    def __init__(self, script: "Callable[[Any, Job], Script[Any]]", readings: int = 0, moves: bool = True) -> None:
        """`script` creates the script from a `Conversation`, again after each loss of the device.

        `readings` is the number of readings in a scan. `moves` is False if the turntable must not home for this job.
        """
        self.script = script
        self.moves = moves
        self.since = 0.0
        self.moving = False  # whether the device homes, turns or scans for this job
        self.command: Command | None = None  # the newest Home, Turn or StartScan
        self.losses_in_a_row = 0  # losses of the device since the last reading
        self.stop_wanted = False
        self.done = False
        self.result: Any = None
        self.error: BaseException | None = None
        # the following are for scans
        self.readings: deque[Reading] = deque()
        self.progress = Progress(readings)
        self.began: float | None = None  # on the clock of `Reading.time`, s
        self.unverified_angles: str | None = None  # clause with the angles that could not be checked for lost steps
        self._times, self._angles = array("d"), array("d")  # of all readings of the scan
        self._homed: list[float] = []  # time of the newest reading before each homing

    def note_start(self, clock: DeviceClock) -> None:
        """Store start and size of the scan from the answer to StartScan. Call this before its readings are taken.

        The script cannot do this. It may run too late, because readings may arrive together with the answer, or because
        the device may be lost after the answer.
        """
        if self.command is None or not isinstance(self.command.answer, messages.Started):
            return
        if self.began is None:
            self.began = clock.continued(self.command.answered_us)
        finished = self.command.finished
        if not self.command.answer.readings:  # a device that turns by itself knows their number at the end
            done = finished is not None and finished.outcome == messages.Outcome.DONE
            self.progress.total = finished.readings if finished and done else limits.MOST_READINGS
        elif not self.progress.received and self.command.broken is None:
            # a replayed log plays its own readings, even if another sector was requested
            self.progress.total = self.command.answer.first + self.command.answer.readings

    @property
    def streaming(self) -> bool:
        """Whether readings arrive. A device that turns by itself first waits for the start of a sweep."""
        return self.began is not None and (self.progress.received > 0 or self.progress.total < limits.MOST_READINGS)

    def take(self, reading: Reading) -> bool:
        """Store a reading. Returns False if it is a duplicate or its number is outside the scan."""
        new = self.progress.take(reading.number)
        if new:
            self._times.append(reading.time)
            self._angles.append(reading.angle)
        return new

    def note_homing(self) -> None:
        """Store that the turntable homes again."""
        if self._times:
            self._homed.append(max(self._times))

    def angles_between_homings(self) -> list[FloatArray]:
        """Return the angles of the readings, rad, split at each homing."""
        return split_at_homings(self._times, self._angles, self._homed)

    def end(self, result: Any = None, error: BaseException | None = None) -> None:
        """Finish the job, unless it is done already."""
        if not self.done:
            self.done, self.result, self.error = True, result, error


MOVE_WITHIN = 120.0  # s; limit for a Home or a Turn


@dataclass
class KnownDevice:
    """The state of a device that is kept from one conversation to the next."""

    where: str  # name of the device in error messages
    baud: int = limits.FIRST_BAUD  # current baud rate of the line
    most_baud: int = 0  # highest baud rate to try, after a higher one has failed; 0: that of the device
    info: messages.Info | None = None
    capabilities: messages.Capabilities | None = None
    settings: messages.Settings | None = None  # in force
    configured: messages.Configure | None = None  # sent again in the next conversation
    turntable: messages.ConfigureTurntable | None = None  # sent again in the next conversation
    zero: messages.Zero = messages.Zero.UNKNOWN
    failure: Callable[[], errors.SonarError | None] = lambda: None  # why its newest action failed, if it says so itself


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

    def send(self, message: messages.CommandMessage, tries: int = TRIES) -> Command:
        """Send a command. Raises InputError if a value does not fit its field."""
        try:
            return self.driver.command(message, self.now, tries)
        except messages.MessageError as error:
            raise errors.InputError(f"{type(message).__name__} cannot be sent: {error}") from error

    def request(self, message: messages.CommandMessage) -> Script[messages.AnswerMessage]:
        """Send a command and return its answer. Raises CommandRefused."""
        command = self.send(message)
        yield settled(command)
        raise_if_refused(command, self.device.where)
        if command.answer is None:
            raise errors.NoAnswer(f"{self.device.where}: no answer to {command.name}")
        return command.answer

    def request_typed(self, message: messages.CommandMessage, expected: type[T]) -> Script[T]:
        """Send a command and return its answer. Raises CommandRefused, DeviceError if it is not an `expected`."""
        answer = yield from self.request(message)
        if not isinstance(answer, expected):
            raise errors.DeviceError(
                f"{self.device.where}: answered {type(message).__name__} with {type(answer).__name__}; "
                f"expected {expected.__name__}"
            )
        return answer

    def act(self, message: messages.CommandMessage, job: Job | None) -> Script[messages.Outcome]:
        """Run a Home, Turn or StartScan until it ends or no more readings are needed. Raises LostSteps, DeviceError."""
        command = self.send(message)
        if job:
            job.command = command
        yield settled(command)
        raise_if_refused(command, self.device.where)
        scan = isinstance(command.answer, messages.Started) and job is not None
        if job:
            job.moving = True
        yield from self._follow(command, job, math.inf if scan else self.now + MOVE_WITHIN)
        if command.broken:
            raise broken_protocol(self.device.where, command.broken)
        outcome = self._outcome(command)
        if outcome is messages.Outcome.STOPPED and not scan and not (job and job.stop_wanted):
            # the device stopped by itself, because it received nothing from the host for too long: repeat the command
            return (yield from self.act(message, job))
        return outcome

    def _follow(self, command: Command, job: Job | None, deadline: float) -> Script[None]:
        """Wait until the action of a command has ended. Stop it on request and at the deadline."""

        def over() -> bool:
            return command.finished is not None and self.driver.scan_complete

        yield Wait(lambda: over() or self._is_enough(job) or command.broken is not None, deadline)
        if command.finished is None:
            stop = self.send(messages.Stop())
            yield Wait(lambda: over() and stop.settled)
            if self.now >= deadline:
                text = f"{self.device.where}: {command.name} took more than {MOVE_WITHIN:g} s and was stopped"
                raise errors.DeviceError(f"{text}; check that the turntable can move freely")

    def _is_enough(self, job: Job | None) -> bool:
        if job is None:
            return False
        info = self.device.info
        older = info is not None and info.minor < 1  # would repeat readings that have already been received
        return job.stop_wanted or (older and job.progress.total > 0 and job.progress.complete)

    def _outcome(self, command: Command) -> messages.Outcome:
        finished, where = command.finished, self.device.where
        if finished is None or finished.outcome in (messages.Outcome.DONE, messages.Outcome.STOPPED):
            return messages.Outcome.STOPPED if finished is None else messages.Outcome(finished.outcome)
        if finished.outcome == messages.Outcome.LOST_STEPS:
            self.device.zero = messages.Zero.UNKNOWN
            raise errors.LostSteps(f"{where}: {finished.text or 'steps were lost'}")
        failed = f"{where}: {command.name} failed: {finished.text or 'the board gave no reason'}"
        raise self.device.failure() or errors.DeviceError(failed)


def broken_protocol(where: str, rule: str) -> errors.DeviceError:
    """Return the error for firmware that breaks a rule of the protocol."""
    return errors.DeviceError(f"{where}: its firmware breaks the protocol: {rule}; see firmware_protocol.md")


def settled(command: Command) -> Wait:
    """Return the wait until a command is answered or given up."""
    return Wait(lambda: command.settled)


_MAX_WITHOUT_PROGRESS = 3  # consecutive scan commands without a new reading


# the jobs


def configuring(request: messages.Configure) -> Job:
    """Return the job that sets the ping parameters. Its result is a Settings message."""
    return Job(lambda talk, _: _configure(talk, request))


def configuring_turntable(request: messages.ConfigureTurntable) -> Job:
    """Return the job that sets the turntable parameters. Its result is a TurntableSettings message."""
    return Job(lambda talk, _: _configure_turntable(talk, request))


def requesting(message: messages.CommandMessage) -> Job:
    """Return the job that sends a command, which must be safe to repeat. Its result is the answer."""
    return Job(lambda talk, _: talk.request(message))


def homing() -> Job:
    """Return the job that homes the turntable. Its result is an Outcome."""
    return Job(home)


def zeroing() -> Job:
    """Return the job that makes the present angle the zero. Its result is an Outcome."""
    return Job(lambda talk, _: _set_zero(talk))


def configuring_wiring(request: messages.ConfigureWiring) -> Job:
    """Return the job that sets the wiring. Its result is a WiringSettings message."""
    return Job(lambda talk, _: _configure_wiring(talk, request))


def jogging(message: messages.Turn) -> Job:
    """Return the job that turns by a small angle, without homing. Its result is an Outcome."""
    return Job(lambda talk, job: _jog(talk, message, job))


def turning(message: messages.Turn) -> Job:
    """Return the job that turns the turntable, and homes it first if needed. Its result is an Outcome."""
    return Job(lambda talk, job: _turn(talk, message, job))


def scanning(order: messages.StartScan) -> Job:
    """Return the job that scans, and homes first if needed. It collects `readings`; its result is an Outcome."""
    script = _ping_in_place if order.in_place else _scan
    return Job(
        lambda talk, job: script(talk, order, job),
        readings=order.headings * order.sweeps * order.pings,
        moves=not order.in_place,
    )


# the scripts of the jobs


def home(talk: Conversation, job: Job | None) -> Script[messages.Outcome]:
    """Home the turntable."""
    talk.device.zero = messages.Zero.UNKNOWN
    if job:
        job.note_homing()
    outcome = yield from talk.act(messages.Home(), job)
    talk.device.zero = messages.Zero.MARK if outcome is messages.Outcome.DONE else messages.Zero.UNKNOWN
    return outcome


def _set_zero(talk: Conversation) -> Script[messages.Outcome]:
    _require_minor(talk, 2, "a zero that is set by hand")
    yield from talk.request(messages.SetZero())
    talk.device.zero = messages.Zero.HAND
    return messages.Outcome.DONE


def _configure_wiring(talk: Conversation, request: messages.ConfigureWiring) -> Script[messages.WiringSettings]:
    _require_minor(talk, 2, "a setting of the wiring")
    answer = yield from talk.request_typed(request, messages.WiringSettings)
    if request.change:
        talk.device.zero = messages.Zero.UNKNOWN
        # with one switch, the turntable turns less far
        talk.device.capabilities = yield from talk.request_typed(messages.AskCapabilities(), messages.Capabilities)
    return answer


def _jog(talk: Conversation, message: messages.Turn, job: Job) -> Script[messages.Outcome]:
    _require_minor(talk, 2, "a jog")
    return (yield from talk.act(message, job))


def _require_minor(talk: Conversation, minor: int, needs: str) -> None:
    """Raise DeviceError if the protocol of the device is older than 1.`minor`."""
    info = talk.device.info
    if info is None or info.minor < minor:
        has = "an unknown protocol" if info is None else f"protocol {info.major}.{info.minor}"
        raise errors.DeviceError(
            f"{talk.device.where}: its firmware uses {has}, {needs} needs 1.{minor}; update its firmware"
        )


def _configure(talk: Conversation, request: messages.Configure) -> Script[messages.Settings]:
    settings = yield from talk.request_typed(request, messages.Settings)
    # a replayed log has no capabilities, and answers with its own settings
    if talk.device.capabilities and (rule := broken_settings_rule(request, settings)):
        raise broken_protocol(talk.device.where, rule)
    talk.device.settings, talk.device.configured = settings, request
    return settings


def _default_settings(info: messages.Info | None) -> messages.Configure:
    """Return the settings of a scan without a `Configure` before it."""
    speed = ScanAir().speed_of_sound(None if info is None else messages.degrees_c(info.temperature))
    return messages.Configure(
        listen_us=62_500, blanking_us=2_380, trace=0, speed_of_sound=messages.millimetres_per_second_of(speed)
    )


def _configure_turntable(talk: Conversation, request: messages.ConfigureTurntable) -> Script[messages.AnswerMessage]:
    answer = yield from talk.request(request)
    talk.device.turntable = request
    return answer


def _turn(talk: Conversation, message: messages.Turn, job: Job) -> Script[messages.Outcome]:
    if (
        talk.device.zero is messages.Zero.UNKNOWN
        and (outcome := (yield from home(talk, job))) is not messages.Outcome.DONE
    ):
        return outcome
    return (yield from talk.act(message, job))


def _scan(talk: Conversation, order: messages.StartScan, job: Job) -> Script[messages.Outcome]:
    """Scan, then verify the zero mark. Raises LostSteps, after all readings have been received."""
    yield from _configure_if_new(talk)
    if (
        talk.device.zero is messages.Zero.UNKNOWN
        and (outcome := (yield from home(talk, job))) is not messages.Outcome.DONE
    ):
        return outcome
    try:
        outcome = yield from _make_readings(talk, order, job)
        if outcome is messages.Outcome.DONE and not job.stop_wanted:
            yield from _verify_mark(talk, order, job)
    except errors.LostSteps as error:
        raise _with_wrong_angles(error, job.angles_between_homings()) from error
    job.unverified_angles = unverified_clause(job.angles_between_homings())
    return outcome


def _ping_in_place(talk: Conversation, order: messages.StartScan, job: Job) -> Script[messages.Outcome]:
    """Make pings at the present angle."""
    _require_minor(talk, 2, "a ping without homing")
    yield from _configure_if_new(talk)
    return (yield from _make_readings(talk, order, job))


def _configure_if_new(talk: Conversation) -> Script[None]:
    if talk.device.configured is None:
        yield from _configure(talk, _default_settings(talk.device.info))


def _make_readings(talk: Conversation, order: messages.StartScan, job: Job) -> Script[messages.Outcome]:
    """Send scan commands until all readings have been received."""
    progress, without_progress = job.progress, 0
    while (missing := progress.next_missing()) and without_progress < _MAX_WITHOUT_PROGRESS:
        before = progress.received
        outcome = yield from talk.act(_part(talk, order, missing, job), job)
        if outcome is not messages.Outcome.DONE and job.stop_wanted and not progress.complete:
            return outcome
        without_progress = 0 if progress.received > before else without_progress + 1
    if missing:
        where = talk.device.where
        raise errors.NoAnswer(
            f"{where}: reading {missing[0]} did not arrive after {_MAX_WITHOUT_PROGRESS} scan commands; check the cable"
        )
    return messages.Outcome.DONE


def _part(talk: Conversation, order: messages.StartScan, missing: tuple[int, int], job: Job) -> messages.StartScan:
    """Return the command for a part of a scan. Protocol 1.0 supports only whole scans."""
    info = talk.device.info
    whole = missing == (0, job.progress.total)
    if whole or info is None or info.minor < 1:
        return order
    return replace(order, first=missing[0], count=missing[1])


def _verify_mark(talk: Conversation, order: messages.StartScan, job: Job) -> Script[None]:
    """Turn over the nearest zero mark, so that the device reports steps lost since its last check of the mark."""
    capabilities = talk.device.capabilities
    if (
        capabilities is None
        or not capabilities.features & messages.Feature.LOST_STEPS
        or talk.device.zero is messages.Zero.HAND
    ):
        return
    before = MARK_APPROACH + messages.radians_of(capabilities.backlash)
    lowest, highest = (
        messages.radians_of(capabilities.lowest_angle) + before,
        messages.radians_of(capabilities.highest_angle) - MARK_OVERRUN,
    )
    last_angle = scan_order(order).ping_at(job.progress.total - 1)[1]
    mark = nearest_mark(last_angle, lowest, highest)
    for angle in () if mark is None else (mark - before, mark + MARK_OVERRUN):
        if (yield from talk.act(messages.Turn(messages.microdegrees_of(angle)), job)) is not messages.Outcome.DONE:
            return


def _with_wrong_angles(error: errors.LostSteps, runs: list[FloatArray]) -> errors.LostSteps:
    """Add to the error how many readings are kept and which of their angles may be wrong."""
    total = sum(map(len, runs))
    if not total:
        return error
    kept = f"{errors.counted_are(total, 'reading')} kept"
    return errors.LostSteps(
        f"{error} {'; '.join(filter(None, (kept, lost_steps_clause(runs), unverified_clause(runs))))}"
    )


# the scripts that begin a conversation


# a device uses the first after a reset, the second with protocol 1.0, and any of them after an earlier conversation
SEEK_BAUDS = (limits.FIRST_BAUD, 1_000_000, 500_000)
LINK_TESTS = 32
_BACK_WITHIN = (
    limits.BAUD_TIMEOUT / 5
)  # s for the answer of a device that returns to a lower baud rate; it may be damaged


def greet(talk: Conversation, quiet: float, patience: float) -> Script[None]:
    """Wait for `quiet` s, then send Hello until Info arrives. Raises NoAnswer, Incompatible, WrongDevice."""
    device = talk.device
    # a bootloader would interpret bytes as a new program; a device that sends frames has left its bootloader
    yield Wait(lambda: talk.driver.statistics.frames_received > 0, talk.now + quiet)
    deadline = talk.now + patience
    bauds = itertools.cycle(SEEK_BAUDS if talk.bauds else (limits.FIRST_BAUD,))
    frames = talk.driver.statistics.frames_received
    while True:
        if talk.driver.statistics.frames_received == frames:  # else the present rate is right
            device.baud = next(bauds)
        frames = talk.driver.statistics.frames_received
        hello = talk.send(messages.Hello(limits.PROTOCOL_MAJOR, limits.PROTOCOL_MINOR), tries=2)
        yield Wait(lambda sent=hello: sent.settled or talk.driver.busy is not None, deadline)  # type: ignore[misc]
        if talk.driver.busy is not None:
            raise errors.LinkBusy(f"{device.where}: is busy: {talk.driver.busy}")
        if isinstance(hello.answer, messages.Info):
            _check_identity(talk, hello.answer)
            # made at wrong baud rates, by a bootloader or in an earlier conversation: they say nothing about the line
            talk.driver.discard_errors()
            return
        talk.driver.forget(hello)
        if talk.now >= deadline:
            raise errors.NoAnswer(
                f"{device.where}: no scanner answered within {patience:g} s; {_received_instead(talk)}"
            )


def _received_instead(talk: Conversation) -> str:
    """Return what to do about a device that has not answered."""
    counted = talk.driver.statistics
    if counted.bytes_received and not counted.frames_received:
        return (
            "it sends something else: if it prints text, `Listen for text` in the window (Ctrl+K) or "
            "`sonarhw ports --guess PORT` finds its URL"
        )
    return "check its power and the port"


def _check_identity(talk: Conversation, info: messages.Info) -> None:
    where, before = talk.device.where, talk.device.info
    if info.major != limits.PROTOCOL_MAJOR:
        raise errors.Incompatible(
            f"{where}: {info.firmware} uses protocol {info.major}.{info.minor}, this program "
            f"{limits.PROTOCOL_MAJOR}.{limits.PROTOCOL_MINOR}; update the older of the two"
        )
    if before is not None and info.serial != before.serial:
        raise errors.WrongDevice(
            f"{where}: scanner {info.serial or 'without serial number'} answers; expected scanner "
            f"{before.serial or 'without serial number'}; plug that one in again"
        )


def prepare(talk: Conversation, job: Job | None) -> Script[None]:
    """Read the capabilities, raise the baud rate, restore the settings, and home if the turntable was homed before."""
    device, info = talk.device, talk.driver.info
    before = device.info
    if info is None:
        raise errors.NoAnswer(f"{device.where}: has not sent Info")
    if info.minor >= 1:
        yield from _request_capabilities(talk)
        yield from _speed_up(talk)
    device.info = info
    if device.turntable:
        yield from talk.request(device.turntable)
    if device.configured:
        device.settings = yield from talk.request_typed(device.configured, messages.Settings)
    zero = _kept_zero(info, before)
    if before is None:
        device.zero = zero
    elif device.zero is not messages.Zero.UNKNOWN and zero is messages.Zero.UNKNOWN:
        yield from _restore_zero(talk, job)


def _kept_zero(info: messages.Info, before: messages.Info | None) -> messages.Zero:
    if info.minor < 1 or not info.homed or (before is not None and info.boot != before.boot):
        return messages.Zero.UNKNOWN
    return messages.Zero.HAND if info.homed == messages.Zero.HAND else messages.Zero.MARK


def _restore_zero(talk: Conversation, job: Job | None) -> Script[None]:
    """Home, unless the zero was set by hand or the job does not turn."""
    device = talk.device
    lost, device.zero = device.zero, messages.Zero.UNKNOWN
    if job is not None and not job.moves:
        return
    if lost is messages.Zero.HAND:
        raise errors.DeviceError(
            f"{device.where}: lost the zero that was set by hand; put the table there and start again"
        )
    yield from home(talk, job)


def _request_capabilities(talk: Conversation) -> Script[None]:
    command = talk.send(messages.AskCapabilities())
    yield settled(command)
    if isinstance(command.answer, messages.Capabilities):  # a replayed log refuses the command
        talk.device.capabilities = command.answer


def _speed_up(talk: Conversation) -> Script[None]:
    """Raise the baud rate to the highest at which all test messages are answered correctly."""
    device = talk.device
    fastest = device.capabilities.fastest_baud if device.capabilities and talk.bauds else 0
    baud = min(fastest, device.most_baud or fastest)
    if device.baud > baud > 0:
        yield from _slow_down(talk, limits.FIRST_BAUD)
    slow = device.baud
    while baud > slow:
        change = talk.send(messages.SetBaud(baud))
        yield settled(change)
        if isinstance(change.answer, messages.Accepted):
            device.baud = baud
            if (yield from _line_is_reliable(talk)):
                return
            device.most_baud = baud // 2
            yield from _slow_down(talk, slow)
        baud //= 2


def _slow_down(talk: Conversation, baud: int) -> Script[None]:
    """Return to a lower baud rate.

    A device that has received a valid frame at the present rate keeps it until it is asked, even if its own frames
    arrive damaged. One that has received none returns by itself.
    """
    change = talk.send(messages.SetBaud(baud), tries=1)
    yield Wait(lambda: change.settled, talk.now + _BACK_WITHIN)
    talk.driver.forget(change)
    talk.device.baud = baud
    # makes the lower rate permanent
    yield settled(talk.send(messages.AskStatistics()))


def _line_is_reliable(talk: Conversation) -> Script[bool]:
    rejected = talk.driver.statistics.rejected_blocks
    for number in range(LINK_TESTS):
        data = random.Random(number).randbytes(limits.MAX_TEST)
        test = talk.send(messages.TestLink(limits.MAX_TESTED, data), tries=1)
        yield settled(test)
        if not isinstance(test.answer, messages.LinkTested) or test.answer.data != (data * 8)[: limits.MAX_TESTED]:
            return False
    return talk.driver.statistics.rejected_blocks == rejected
