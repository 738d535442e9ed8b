"""What can be wanted of a device, as jobs: configure it, ask, home, turn, scan; and their scripts."""

from dataclasses import replace

from sonarhw.errors import LostSteps, NoAnswer
from sonarhw.host.conversation import Conversation
from sonarhw.host.job import Job, Script
from sonarhw.lost_steps import MARK_APPROACH, MARK_OVERRUN, lost_steps_clause, nearest_mark, unverified_clause
from sonarhw.readings import FloatArray
from sonarhw.wire.messages import (
    AnswerMessage,
    Configure,
    ConfigureTurntable,
    Feature,
    Home,
    Message,
    Outcome,
    Settings,
    StartScan,
    Turn,
)
from sonarhw.wire.reading_messages import scan_order
from sonarhw.wire.units import microdegrees_of, radians_of

_FRUITLESS = 3  # orders for readings of which none brought any
_DEFAULTS = Configure(listen_us=62_500, blanking_us=2_380, trace=0, speed_of_sound=343_200)


# the jobs


def configuring(wish: Configure) -> Job:
    """Set how to ping; results in Settings."""
    return Job(lambda talk, _: _configure(talk, wish))


def configuring_turntable(wish: ConfigureTurntable) -> Job:
    """Set how to turn; results in TurntableSettings."""
    return Job(lambda talk, _: _configure_turntable(talk, wish))


def asking(message: Message) -> Job:
    """Ask anything that does no harm twice; results in its answer."""
    return Job(lambda talk, _: talk.ask(message))


def homing() -> Job:
    """Find the zero; results in an Outcome."""
    return Job(home)


def turning(message: Turn) -> Job:
    """Turn, having found the zero; results in an Outcome."""
    return Job(lambda talk, job: _turn(talk, message, job))


def scanning(order: StartScan) -> Job:
    """Scan, having found the zero; `readings` of the job fill, the result is an Outcome."""
    return Job(lambda talk, job: _scan(talk, order, job), readings=order.headings * order.sweeps * order.pings)


# their scripts


def home(talk: Conversation, job: Job | None) -> Script[Outcome]:
    """Find the zero."""
    talk.device.homed = False
    if job:
        job.home()
    outcome = yield from talk.act(Home(), job)
    talk.device.homed = outcome is Outcome.DONE
    return outcome


def _configure(talk: Conversation, wish: Configure) -> Script[Settings]:
    settings = yield from talk.asked(wish, Settings)
    talk.device.settings, talk.device.configured = settings, wish
    return settings


def _configure_turntable(talk: Conversation, wish: ConfigureTurntable) -> Script[AnswerMessage]:
    answer = yield from talk.ask(wish)
    talk.device.turntable = wish
    return answer


def _turn(talk: Conversation, message: Turn, job: Job) -> Script[Outcome]:
    if not talk.device.homed and (outcome := (yield from home(talk, job))) is not Outcome.DONE:
        return outcome
    return (yield from talk.act(message, job))


def _scan(talk: Conversation, order: StartScan, job: Job) -> Script[Outcome]:
    """Scan, and look at the zero mark again. Raises LostSteps, after all readings."""
    if talk.device.configured is None:
        yield from _configure(talk, _DEFAULTS)
    if not talk.device.homed and (outcome := (yield from home(talk, job))) is not Outcome.DONE:
        return outcome
    try:
        outcome = yield from _make_readings(talk, order, job)
        if outcome is Outcome.DONE and not job.stop_wanted:
            yield from _see_mark(talk, order, job)
    except LostSteps as error:
        raise _with_wrong_angles(error, job.angles_between_homings()) from error
    job.unverified_angles = unverified_clause(job.angles_between_homings())
    return outcome


def _make_readings(talk: Conversation, order: StartScan, job: Job) -> Script[Outcome]:
    """With as many orders to the device as it takes until all readings are here."""
    progress, fruitless = job.progress, 0
    while (stretch := progress.stretch()) and fruitless < _FRUITLESS:
        before = progress.received
        outcome = yield from talk.act(_part(talk, order, stretch, job), job)
        if outcome is not Outcome.DONE and job.stop_wanted and not progress.complete:
            return outcome
        fruitless = 0 if progress.received > before else fruitless + 1
    if stretch:
        where = talk.device.where
        raise NoAnswer(f"{where}: reading {stretch[0]} does not arrive, however often; is the cable sound?")
    return Outcome.DONE


def _part(talk: Conversation, order: StartScan, stretch: tuple[int, int], job: Job) -> StartScan:
    """The order for a stretch of a scan; older firmware knows only whole scans."""
    info = talk.device.info
    whole = stretch == (0, job.progress.total)
    if whole or info is None or info.minor < 1:
        return order
    return replace(order, first=stretch[0], count=stretch[1])


def _see_mark(talk: Conversation, order: StartScan, job: Job) -> Script[None]:
    """Turn over the nearest zero mark: a device that lost steps since it saw one says so there."""
    able = talk.device.capabilities
    if able is None or not able.features & Feature.LOST_STEPS:
        return
    before = MARK_APPROACH + radians_of(able.backlash)
    lowest, highest = radians_of(able.lowest_angle) + before, radians_of(able.highest_angle) - MARK_OVERRUN
    stands = scan_order(order).ping_at(job.progress.total - 1)[1]
    mark = nearest_mark(stands, lowest, highest)
    for angle in () if mark is None else (mark - before, mark + MARK_OVERRUN):
        if (yield from talk.act(Turn(microdegrees_of(angle)), job)) is not Outcome.DONE:
            return


def _with_wrong_angles(error: LostSteps, runs: list[FloatArray]) -> LostSteps:
    """The error with what it means for the readings of a scan that have come."""
    total = sum(map(len, runs))
    if not total:
        return error
    kept = f"{total} reading{' is' if total == 1 else 's are'} kept"
    return LostSteps(f"{error} {'; '.join(filter(None, (kept, lost_steps_clause(runs), unverified_clause(runs))))}")
