"""The jobs of a device and their scripts: configure, request, home, turn and scan."""

from dataclasses import replace

from sonarhw.errors import DeviceError, LostSteps, NoAnswer
from sonarhw.harmless_text import counted_are
from sonarhw.host.conversation import Conversation, broken_protocol
from sonarhw.host.job import Job, Script
from sonarhw.lost_steps import MARK_APPROACH, MARK_OVERRUN, lost_steps_clause, nearest_mark, unverified_clause
from sonarhw.readings import FloatArray
from sonarhw.sound_speed import ScanAir
from sonarhw.wire.codes import Feature, Outcome, Zero
from sonarhw.wire.messages import (
    AnswerMessage,
    AskCapabilities,
    Capabilities,
    Configure,
    ConfigureTurntable,
    ConfigureWiring,
    Home,
    Info,
    Message,
    Settings,
    SetZero,
    StartScan,
    Turn,
    WiringSettings,
)
from sonarhw.wire.reading_messages import scan_order
from sonarhw.wire.reading_rules import broken_settings_rule
from sonarhw.wire.units import degrees_c, microdegrees_of, millimetres_per_second_of, radians_of

_MAX_WITHOUT_PROGRESS = 3  # consecutive scan commands without a new reading


# the jobs


def configuring(request: Configure) -> Job:
    """Return the job that sets the ping parameters. Its result is a Settings message."""
    return Job(lambda talk, _: _configure(talk, request))


def configuring_turntable(request: ConfigureTurntable) -> Job:
    """Return the job that sets the turntable parameters. Its result is a TurntableSettings message."""
    return Job(lambda talk, _: _configure_turntable(talk, request))


def requesting(message: Message) -> Job:
    """Return the job that sends a command, which must be safe to repeat. Its result is the answer."""
    return Job(lambda talk, _: talk.request(message))


def homing() -> Job:
    """Return the job that homes the turntable. Its result is an Outcome."""
    return Job(home)


def zeroing() -> Job:
    """Return the job that makes the present angle the zero. Its result is an Outcome."""
    return Job(lambda talk, _: _set_zero(talk))


def configuring_wiring(request: ConfigureWiring) -> Job:
    """Return the job that sets the wiring. Its result is a WiringSettings message."""
    return Job(lambda talk, _: _configure_wiring(talk, request))


def jogging(message: Turn) -> Job:
    """Return the job that turns by a small angle, without homing. Its result is an Outcome."""
    return Job(lambda talk, job: _jog(talk, message, job))


def turning(message: Turn) -> Job:
    """Return the job that turns the turntable, and homes it first if needed. Its result is an Outcome."""
    return Job(lambda talk, job: _turn(talk, message, job))


def scanning(order: StartScan) -> Job:
    """Return the job that scans, and homes first if needed. It collects `readings`; its result is an Outcome."""
    script = _ping_in_place if order.in_place else _scan
    return Job(
        lambda talk, job: script(talk, order, job),
        readings=order.headings * order.sweeps * order.pings,
        moves=not order.in_place,
    )


# the scripts of the jobs


def home(talk: Conversation, job: Job | None) -> Script[Outcome]:
    """Home the turntable."""
    talk.device.zero = Zero.UNKNOWN
    if job:
        job.note_homing()
    outcome = yield from talk.act(Home(), job)
    talk.device.zero = Zero.MARK if outcome is Outcome.DONE else Zero.UNKNOWN
    return outcome


def _set_zero(talk: Conversation) -> Script[Outcome]:
    _require_minor(talk, 2, "a zero that is set by hand")
    yield from talk.request(SetZero())
    talk.device.zero = Zero.HAND
    return Outcome.DONE


def _configure_wiring(talk: Conversation, request: ConfigureWiring) -> Script[WiringSettings]:
    _require_minor(talk, 2, "a setting of the wiring")
    answer = yield from talk.request_typed(request, WiringSettings)
    if request.change:
        talk.device.zero = Zero.UNKNOWN
        # with one switch, the turntable turns less far
        talk.device.capabilities = yield from talk.request_typed(AskCapabilities(), Capabilities)
    return answer


def _jog(talk: Conversation, message: Turn, job: Job) -> Script[Outcome]:
    _require_minor(talk, 2, "a jog")
    return (yield from talk.act(message, job))


def _require_minor(talk: Conversation, minor: int, needs: str) -> None:
    """Raise DeviceError if the protocol of the device is older than 1.`minor`."""
    info = talk.device.info
    if info is None or info.minor < minor:
        has = "an unknown protocol" if info is None else f"protocol {info.major}.{info.minor}"
        raise DeviceError(f"{talk.device.where}: its firmware uses {has}, {needs} needs 1.{minor}; update its firmware")


def _configure(talk: Conversation, request: Configure) -> Script[Settings]:
    settings = yield from talk.request_typed(request, Settings)
    # a replayed log has no capabilities, and answers with its own settings
    if talk.device.capabilities and (rule := broken_settings_rule(request, settings)):
        raise broken_protocol(talk.device.where, rule)
    talk.device.settings, talk.device.configured = settings, request
    return settings


def _default_settings(info: Info | None) -> Configure:
    """Return the settings of a scan without a `Configure` before it."""
    speed = ScanAir().speed_of_sound(None if info is None else degrees_c(info.temperature))
    return Configure(listen_us=62_500, blanking_us=2_380, trace=0, speed_of_sound=millimetres_per_second_of(speed))


def _configure_turntable(talk: Conversation, request: ConfigureTurntable) -> Script[AnswerMessage]:
    answer = yield from talk.request(request)
    talk.device.turntable = request
    return answer


def _turn(talk: Conversation, message: Turn, job: Job) -> Script[Outcome]:
    if talk.device.zero is Zero.UNKNOWN and (outcome := (yield from home(talk, job))) is not Outcome.DONE:
        return outcome
    return (yield from talk.act(message, job))


def _scan(talk: Conversation, order: StartScan, job: Job) -> Script[Outcome]:
    """Scan, then verify the zero mark. Raises LostSteps, after all readings have been received."""
    yield from _configure_if_new(talk)
    if talk.device.zero is Zero.UNKNOWN and (outcome := (yield from home(talk, job))) is not Outcome.DONE:
        return outcome
    try:
        outcome = yield from _make_readings(talk, order, job)
        if outcome is Outcome.DONE and not job.stop_wanted:
            yield from _verify_mark(talk, order, job)
    except LostSteps as error:
        raise _with_wrong_angles(error, job.angles_between_homings()) from error
    job.unverified_angles = unverified_clause(job.angles_between_homings())
    return outcome


def _ping_in_place(talk: Conversation, order: StartScan, job: Job) -> Script[Outcome]:
    """Make pings at the present angle."""
    _require_minor(talk, 2, "a ping without homing")
    yield from _configure_if_new(talk)
    return (yield from _make_readings(talk, order, job))


def _configure_if_new(talk: Conversation) -> Script[None]:
    if talk.device.configured is None:
        yield from _configure(talk, _default_settings(talk.device.info))


def _make_readings(talk: Conversation, order: StartScan, job: Job) -> Script[Outcome]:
    """Send scan commands until all readings have been received."""
    progress, without_progress = job.progress, 0
    while (missing := progress.next_missing()) and without_progress < _MAX_WITHOUT_PROGRESS:
        before = progress.received
        outcome = yield from talk.act(_part(talk, order, missing, job), job)
        if outcome is not Outcome.DONE and job.stop_wanted and not progress.complete:
            return outcome
        without_progress = 0 if progress.received > before else without_progress + 1
    if missing:
        where = talk.device.where
        raise NoAnswer(
            f"{where}: reading {missing[0]} did not arrive after {_MAX_WITHOUT_PROGRESS} scan commands; check the cable"
        )
    return Outcome.DONE


def _part(talk: Conversation, order: StartScan, missing: tuple[int, int], job: Job) -> StartScan:
    """Return the command for a part of a scan. Protocol 1.0 supports only whole scans."""
    info = talk.device.info
    whole = missing == (0, job.progress.total)
    if whole or info is None or info.minor < 1:
        return order
    return replace(order, first=missing[0], count=missing[1])


def _verify_mark(talk: Conversation, order: StartScan, job: Job) -> Script[None]:
    """Turn over the nearest zero mark, so that the device reports steps lost since its last check of the mark."""
    capabilities = talk.device.capabilities
    if capabilities is None or not capabilities.features & Feature.LOST_STEPS or talk.device.zero is Zero.HAND:
        return
    before = MARK_APPROACH + radians_of(capabilities.backlash)
    lowest, highest = (
        radians_of(capabilities.lowest_angle) + before,
        radians_of(capabilities.highest_angle) - MARK_OVERRUN,
    )
    last_angle = scan_order(order).ping_at(job.progress.total - 1)[1]
    mark = nearest_mark(last_angle, lowest, highest)
    for angle in () if mark is None else (mark - before, mark + MARK_OVERRUN):
        if (yield from talk.act(Turn(microdegrees_of(angle)), job)) is not Outcome.DONE:
            return


def _with_wrong_angles(error: LostSteps, runs: list[FloatArray]) -> LostSteps:
    """Add to the error how many readings are kept and which of their angles may be wrong."""
    total = sum(map(len, runs))
    if not total:
        return error
    kept = f"{counted_are(total, 'reading')} kept"
    return LostSteps(f"{error} {'; '.join(filter(None, (kept, lost_steps_clause(runs), unverified_clause(runs))))}")
