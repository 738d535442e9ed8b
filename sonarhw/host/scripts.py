"""What is said to a device, as scripts: greeting it, making it ready, and every job that can be wanted of it.

A script is a generator that yields what it waits for and returns what came of it; `session` runs it, drops it when the
device is lost and begins it anew when the device is back. So a script says everything again from its beginning, and
all it says does no harm twice: settings and angles are absolute, and a scan asks for what has not come.
"""

import itertools
import math
import random
from array import array
from collections import deque
from collections.abc import Callable, Generator
from dataclasses import dataclass, replace
from typing import Any, TypeAlias, TypeVar

from sonarhw.errors import DeviceError, Incompatible, InputError, LinkLost, LostSteps, NoAnswer, WrongDevice
from sonarhw.host.driver import TRIES, Answer, Command, Driver, raise_if_refused
from sonarhw.readings import FloatArray, Reading
from sonarhw.wire.arrivals import Progress
from sonarhw.wire.device_clock import DeviceClock
from sonarhw.wire.limits import FIRST_BAUD, MAX_TEST, MAX_TESTED, PROTOCOL_MAJOR, PROTOCOL_MINOR, UNHEARD
from sonarhw.wire.messages import (
    Accepted,
    AskCapabilities,
    Capabilities,
    Configure,
    ConfigureTurntable,
    Feature,
    Hello,
    Home,
    Info,
    LinkTested,
    Message,
    MessageError,
    Outcome,
    SetBaud,
    Settings,
    Started,
    StartScan,
    Stop,
    TestLink,
    Turn,
)
from sonarhw.wire.reading_messages import scan_order
from sonarhw.wire.units import microdegrees_of, microseconds_of, radians_of
from sonarhw.zero_mark import BEFORE, BEHIND, legs, lost, nearest_mark, unchecked

SEEK_BAUDS = (FIRST_BAUD, 1_000_000, 500_000)  # where a device may be: fresh, of version 1.0, or left at a higher speed
LINK_TESTS = 32
MOVE_WITHIN = 120.0  # s for a home or a turn; the slowest turntable needs less
_BACK_AT_OLD_BAUD = UNHEARD + 0.1  # s
_FRUITLESS = 3  # orders for readings of which none brought any
_DEFAULTS = Configure(listen_us=62_500, blanking_us=2_380, trace=0, speed_of_sound=343_200)

T = TypeVar("T")


@dataclass(frozen=True)
class Wait:
    """What a script waits for."""

    done: Callable[[], bool]
    until: float = math.inf  # s; then it goes on all the same


Script: TypeAlias = Generator[Wait, None, T]


class Job:
    """Something that is wanted of the device; `done` with a `result` or an `error`."""

    def __init__(self, script: "Callable[[Job], Script[Any]]") -> None:
        """`script` makes the script; it is called again after each loss of the device."""
        self.script = script
        self.since = 0.0
        self.moving = False  # the device homes, turns or scans for it
        self.command: Command | None = None  # the newest home, turn or scan
        self.fruitless = 0  # losses of the device in a row, without a reading in between
        self.stop_wanted = False
        self.done = False
        self.result: Any = None
        self.error: BaseException | None = None
        # of a scan
        self.readings: deque[Reading] = deque()
        self.progress = Progress(0)
        self.began: float | None = None  # on the clock of `Reading.time`, s
        self.unchecked: str | None = None  # a clause: which angles could not be checked for lost steps
        self._times, self._angles = array("d"), array("d")  # of all its readings
        self._homed: list[float] = []  # time of the newest reading when the zero was sought anew

    def take(self, reading: Reading) -> bool:
        """Book a reading; False where it has come before or belongs to no such scan."""
        new = self.progress.take(reading.number)
        if new:
            self._times.append(reading.time)
            self._angles.append(reading.angle)
        return new

    def home(self) -> None:
        """Book that the zero is sought anew."""
        if self._times:
            self._homed.append(max(self._times))

    def legs(self) -> list[FloatArray]:
        """The angles of its readings, rad, apart where the zero was sought anew."""
        return legs(self._times, self._angles, self._homed)

    def end(self, result: Any = None, error: BaseException | None = None) -> None:
        """It is over, where it was not before."""
        if not self.done:
            self.done, self.result, self.error = True, result, error


class Dialogue:
    """What is known of a device and wished of it, and the scripts that find out and say so."""

    def __init__(self, where: str, clock: DeviceClock) -> None:
        """`where` names the device in messages."""
        self.where = where
        self.clock = clock
        self.now = 0.0  # s, kept by the session
        self.driver: Driver | None = None  # conversation of now, kept by the session
        self.bauds = False  # whether the speed of the line can be set, kept by the session
        self.baud = FIRST_BAUD  # the speed that the line is to have now
        self.info: Info | None = None
        self.capabilities: Capabilities | None = None
        self.settings: Settings | None = None
        self._configured: Configure | None = None
        self._turntable: ConfigureTurntable | None = None
        self._homed = False

    # greeting

    def greet(self, quiet: float, patience: float) -> Script[None]:
        """Listen for `quiet` s, then say Hello until Info comes. Raises NoAnswer, Incompatible, WrongDevice."""
        driver = self._conversation
        # a bootloader would listen; whoever speaks already is none
        yield Wait(lambda: driver.statistics.frames_received > 0, self.now + quiet)
        deadline = self.now + patience
        for baud in itertools.cycle(SEEK_BAUDS if self.bauds else (FIRST_BAUD,)):
            self.baud = baud
            hello = self._send(Hello(PROTOCOL_MAJOR, PROTOCOL_MINOR), tries=2)
            yield Wait(_settled(hello), deadline)
            if isinstance(hello.answer, Info):
                self._check_identity(hello.answer)
                return
            driver.forget(hello)
            if self.now >= deadline:
                raise NoAnswer(
                    f"{self.where}: no scanner answered within {patience:g} s; is it powered, and is this its port?"
                )

    def _check_identity(self, info: Info) -> None:
        if info.major != PROTOCOL_MAJOR:
            raise Incompatible(
                f"{self.where}: {info.firmware} speaks protocol {info.major}.{info.minor}, this program "
                f"{PROTOCOL_MAJOR}.{PROTOCOL_MINOR}; update the older of the two"
            )
        if self.info is not None and info.serial != self.info.serial:
            raise WrongDevice(
                f"{self.where}: scanner {info.serial or 'without serial number'} answers; it was "
                f"{self.info.serial or 'one without'} before; plug that one in again"
            )

    def prepare(self, job: Job | None) -> Script[None]:
        """Find out what it can, speed up the line, set again what was set, find the zero again if it was known."""
        known, info = self.info, self._conversation.info
        if info is None:
            raise NoAnswer(f"{self.where}: has not said who it is")
        if info.minor >= 1:
            yield from self._ask_capabilities()
            yield from self._speed_up()
        self.info = info
        if self._turntable:
            yield from self.ask(self._turntable)
        if self._configured:
            self.settings = yield from self._asked(self._configured, Settings)
        kept_zero = info.minor >= 1 and bool(info.homed) and (known is None or info.boot == known.boot)
        if known is None:
            self._homed = kept_zero
        elif self._homed and not kept_zero:
            yield from self.home(job)

    def _ask_capabilities(self) -> Script[None]:
        command = self._send(AskCapabilities())
        yield Wait(_settled(command))
        if isinstance(command.answer, Capabilities):  # a replayed log refuses
            self.capabilities = command.answer

    def _speed_up(self) -> Script[None]:
        """As fast as device and line can without a wrong byte."""
        slow, baud = self.baud, self.capabilities.fastest_baud if self.capabilities and self.bauds else 0
        while baud > slow:
            change = self._send(SetBaud(baud))
            yield Wait(_settled(change))
            if isinstance(change.answer, Accepted):
                self.baud = baud
                if (yield from self._line_is_sound()):
                    return
                self.baud = slow
                yield Wait(lambda: False, self.now + _BACK_AT_OLD_BAUD)
            baud //= 2

    def _line_is_sound(self) -> Script[bool]:
        driver = self._conversation
        rejected = driver.statistics.rejected_blocks
        for number in range(LINK_TESTS):
            data = random.Random(number).randbytes(MAX_TEST)
            test = self._send(TestLink(MAX_TESTED, data), tries=1)
            yield Wait(_settled(test))
            if not isinstance(test.answer, LinkTested) or test.answer.data != (data * 8)[:MAX_TESTED]:
                return False
        return driver.statistics.rejected_blocks == rejected

    # jobs

    def configure(self, wish: Configure) -> Script[Settings]:
        """Set how to ping."""
        self.settings = yield from self._asked(wish, Settings)
        self._configured = wish
        return self.settings

    def configure_turntable(self, wish: ConfigureTurntable) -> Script[Answer]:
        """Set how to turn."""
        answer = yield from self.ask(wish)
        self._turntable = wish
        return answer

    def home(self, job: Job | None) -> Script[Outcome]:
        """Find the zero."""
        self._homed = False
        if job:
            job.home()
        outcome = yield from self._act(Home(), job)
        self._homed = outcome is Outcome.DONE
        return outcome

    def turn(self, message: Turn, job: Job) -> Script[Outcome]:
        """Turn, having found the zero."""
        if not self._homed and (outcome := (yield from self.home(job))) is not Outcome.DONE:
            return outcome
        return (yield from self._act(message, job))

    def scan(self, order: StartScan, job: Job) -> Script[Outcome]:
        """Scan, having found the zero, and look at the zero mark again. Raises LostSteps, after all readings."""
        if self._configured is None:
            yield from self.configure(_DEFAULTS)
        if not self._homed and (outcome := (yield from self.home(job))) is not Outcome.DONE:
            return outcome
        try:
            outcome = yield from self._make_readings(order, job)
            if outcome is Outcome.DONE and not job.stop_wanted:
                yield from self._see_mark(order, job)
        except LostSteps as error:
            raise _with_doubt(error, job.legs()) from error
        job.unchecked = unchecked(job.legs())
        return outcome

    def _make_readings(self, order: StartScan, job: Job) -> Script[Outcome]:
        """With as many orders to the device as it takes until all readings are here."""
        progress, fruitless = job.progress, 0
        while (stretch := progress.stretch()) and fruitless < _FRUITLESS:
            before = progress.received
            outcome = yield from self._act(self._order(order, stretch, job), job)
            if outcome is not Outcome.DONE and job.stop_wanted and not progress.complete:
                return outcome
            fruitless = 0 if progress.received > before else fruitless + 1
        if stretch:
            raise NoAnswer(f"{self.where}: reading {stretch[0]} does not arrive, however often; is the cable sound?")
        return Outcome.DONE

    def _see_mark(self, order: StartScan, job: Job) -> Script[None]:
        """Turn over the nearest zero mark: a device that lost steps since it saw one says so there."""
        able = self.capabilities
        if able is None or not able.features & Feature.LOST_STEPS:
            return
        before = BEFORE + radians_of(able.backlash)
        lowest, highest = radians_of(able.lowest_angle) + before, radians_of(able.highest_angle) - BEHIND
        stands = scan_order(order).ping_at(job.progress.total - 1)[1]
        mark = nearest_mark(stands, lowest, highest)
        for angle in () if mark is None else (mark - before, mark + BEHIND):
            if (yield from self._act(Turn(microdegrees_of(angle)), job)) is not Outcome.DONE:
                return

    def _order(self, order: StartScan, stretch: tuple[int, int], job: Job) -> StartScan:
        """The order for a stretch of a scan; older firmware knows only whole scans."""
        whole = stretch == (0, job.progress.total)
        if whole or self.info is None or self.info.minor < 1:
            return order
        return replace(order, first=stretch[0], count=stretch[1])

    # pieces of scripts

    @property
    def _conversation(self) -> Driver:
        if self.driver is None:
            raise LinkLost(f"{self.where}: not connected")
        return self.driver

    def _send(self, message: Message, tries: int = TRIES) -> Command:
        try:
            return self._conversation.command(message, self.now, tries)
        except MessageError as error:
            raise InputError(f"{type(message).__name__} cannot be sent: {error}") from error

    def ask(self, message: Message) -> Script[Answer]:
        """Ask anything. Raises CommandRefused."""
        command = self._send(message)
        yield Wait(_settled(command))
        raise_if_refused(command, self.where)
        if command.answer is None:
            raise NoAnswer(f"{self.where}: no answer to {command.name}")
        return command.answer

    def _asked(self, message: Message, expected: type[T]) -> Script[T]:
        answer = yield from self.ask(message)
        if not isinstance(answer, expected):
            raise DeviceError(
                f"{self.where}: answered {type(message).__name__} with {type(answer).__name__}; "
                f"expected {expected.__name__}"
            )
        return answer

    def _act(self, message: Message, job: Job | None) -> Script[Outcome]:
        """Home, turn or scan to its end, or until it is stopped or enough."""
        command = self._send(message)
        if job:
            job.command = command
        yield Wait(_settled(command))
        raise_if_refused(command, self.where)
        scan = job if isinstance(command.answer, Started) else None
        if job:
            job.moving = True
        yield from self._follow(command, job, math.inf if scan else self.now + MOVE_WITHIN)
        outcome = self._outcome(command)
        if outcome is Outcome.STOPPED and not scan and not (job and job.stop_wanted):
            # nobody wanted that: it has not heard us for too long
            return (yield from self._act(message, job))
        return outcome

    def _follow(self, command: Command, job: Job | None, deadline: float) -> Script[None]:
        """Until what a command began has ended; it is stopped where that is wanted, or at the deadline."""
        driver = self._conversation

        def over() -> bool:
            return command.finished is not None and driver.scan_complete

        yield Wait(lambda: over() or self._is_enough(job), deadline)
        if command.finished is None:
            stop = self._send(Stop())
            yield Wait(lambda: over() and stop.settled)
            if self.now >= deadline:
                text = f"{self.where}: {command.name} took more than {MOVE_WITHIN:g} s and was stopped"
                raise DeviceError(f"{text}; does something hold the turntable?")

    def _is_enough(self, job: Job | None) -> bool:
        if job is None:
            return False
        older = self.info is not None and self.info.minor < 1  # it makes all readings, those that have come too
        return job.stop_wanted or (older and job.progress.total > 0 and job.progress.complete)

    def heed_start(self, job: Job) -> None:
        """Book what the device makes of a scan command; to be called before its readings are taken.

        The script may be too late for that: readings come in one piece with the answer, and so may a loss.
        """
        command = job.command
        if command is None or not isinstance(command.answer, Started):
            return
        if job.began is None:
            job.began = self.clock.continued(microseconds_of(command.answered_at))
        if not job.progress.received:
            # a replayed log plays what it holds, whatever was ordered
            job.progress.total = command.answer.first + command.answer.readings

    def _outcome(self, command: Command) -> Outcome:
        finished = command.finished
        if finished is None or finished.outcome in (Outcome.DONE, Outcome.STOPPED):
            return Outcome.STOPPED if finished is None else Outcome(finished.outcome)
        if finished.outcome == Outcome.LOST_STEPS:
            self._homed = False
            raise LostSteps(f"{self.where}: {finished.text or 'steps were lost'}")
        raise DeviceError(f"{self.where}: {command.name} failed: {finished.text or 'the board does not say why'}")


def _settled(command: Command) -> Callable[[], bool]:
    return lambda: command.settled


def _with_doubt(error: LostSteps, legs: list[FloatArray]) -> LostSteps:
    """The error with what it means for the readings of a scan that have come."""
    total = sum(map(len, legs))
    if not total:
        return error
    kept = f"{total} reading{' is' if total == 1 else 's are'} kept"
    return LostSteps(f"{error} {'; '.join(filter(None, (kept, lost(legs), unchecked(legs))))}")
