"""Scripts that begin a conversation: greet the device, read its capabilities, raise the baud rate of the line."""

import itertools
import random

from sonarhw.errors import DeviceError, Incompatible, LinkBusy, NoAnswer, WrongDevice
from sonarhw.host.actions import home
from sonarhw.host.conversation import Conversation, settled
from sonarhw.host.job import Job, Script, Wait
from sonarhw.wire.codes import Zero
from sonarhw.wire.limits import BAUD_TIMEOUT, FIRST_BAUD, MAX_TEST, MAX_TESTED, PROTOCOL_MAJOR, PROTOCOL_MINOR
from sonarhw.wire.messages import (
    Accepted,
    AskCapabilities,
    AskStatistics,
    Capabilities,
    Hello,
    Info,
    LinkTested,
    SetBaud,
    Settings,
    TestLink,
)

# a device uses the first after a reset, the second with protocol 1.0, and any of them after an earlier conversation
SEEK_BAUDS = (FIRST_BAUD, 1_000_000, 500_000)
LINK_TESTS = 32
_BACK_WITHIN = BAUD_TIMEOUT / 5  # s for the answer of a device that returns to a lower baud rate; it may be damaged


def greet(talk: Conversation, quiet: float, patience: float) -> Script[None]:
    """Wait for `quiet` s, then send Hello until Info arrives. Raises NoAnswer, Incompatible, WrongDevice."""
    device = talk.device
    # a bootloader would interpret bytes as a new program; a device that sends frames has left its bootloader
    yield Wait(lambda: talk.driver.statistics.frames_received > 0, talk.now + quiet)
    deadline = talk.now + patience
    bauds = itertools.cycle(SEEK_BAUDS if talk.bauds else (FIRST_BAUD,))
    frames = talk.driver.statistics.frames_received
    while True:
        if talk.driver.statistics.frames_received == frames:  # else the present rate is right
            device.baud = next(bauds)
        frames = talk.driver.statistics.frames_received
        hello = talk.send(Hello(PROTOCOL_MAJOR, PROTOCOL_MINOR), tries=2)
        yield Wait(lambda sent=hello: sent.settled or talk.driver.busy is not None, deadline)  # type: ignore[misc]
        if talk.driver.busy is not None:
            raise LinkBusy(f"{device.where}: is busy: {talk.driver.busy}")
        if isinstance(hello.answer, Info):
            _check_identity(talk, hello.answer)
            # made at wrong baud rates, by a bootloader or in an earlier conversation: they say nothing about the line
            talk.driver.discard_errors()
            return
        talk.driver.forget(hello)
        if talk.now >= deadline:
            raise NoAnswer(f"{device.where}: no scanner answered within {patience:g} s; {_received_instead(talk)}")


def _received_instead(talk: Conversation) -> str:
    """Return what to do about a device that has not answered."""
    counted = talk.driver.statistics
    if counted.bytes_received and not counted.frames_received:
        return (
            "it sends something else: if it prints text, `Listen for text` in the window (Ctrl+K) or "
            "`sonarhw ports --guess PORT` finds its URL"
        )
    return "check its power and the port"


def _check_identity(talk: Conversation, info: Info) -> None:
    where, known = talk.device.where, talk.device.info
    if info.major != PROTOCOL_MAJOR:
        raise Incompatible(
            f"{where}: {info.firmware} uses protocol {info.major}.{info.minor}, this program "
            f"{PROTOCOL_MAJOR}.{PROTOCOL_MINOR}; update the older of the two"
        )
    if known is not None and info.serial != known.serial:
        raise WrongDevice(
            f"{where}: scanner {info.serial or 'without serial number'} answers; expected scanner "
            f"{known.serial or 'without serial number'}; plug that one in again"
        )


def prepare(talk: Conversation, job: Job | None) -> Script[None]:
    """Read the capabilities, raise the baud rate, restore the settings, and home if the turntable was homed before."""
    device, info = talk.device, talk.driver.info
    known = device.info
    if info is None:
        raise NoAnswer(f"{device.where}: has not sent Info")
    if info.minor >= 1:
        yield from _request_capabilities(talk)
        yield from _speed_up(talk)
    device.info = info
    if device.turntable:
        yield from talk.request(device.turntable)
    if device.configured:
        device.settings = yield from talk.request_typed(device.configured, Settings)
    zero = _kept_zero(info, known)
    if known is None:
        device.zero = zero
    elif device.zero is not Zero.UNKNOWN and zero is Zero.UNKNOWN:
        yield from _restore_zero(talk, job)


def _kept_zero(info: Info, known: Info | None) -> Zero:
    if info.minor < 1 or not info.homed or (known is not None and info.boot != known.boot):
        return Zero.UNKNOWN
    return Zero.HAND if info.homed == Zero.HAND else Zero.MARK


def _restore_zero(talk: Conversation, job: Job | None) -> Script[None]:
    """Home, unless the zero was set by hand or the job does not turn."""
    device = talk.device
    lost, device.zero = device.zero, Zero.UNKNOWN
    if job is not None and not job.moves:
        return
    if lost is Zero.HAND:
        raise DeviceError(f"{device.where}: lost the zero that was set by hand; put the table there and start again")
    yield from home(talk, job)


def _request_capabilities(talk: Conversation) -> Script[None]:
    command = talk.send(AskCapabilities())
    yield settled(command)
    if isinstance(command.answer, Capabilities):  # a replayed log refuses the command
        talk.device.capabilities = command.answer


def _speed_up(talk: Conversation) -> Script[None]:
    """Raise the baud rate to the highest at which all test messages are answered correctly."""
    device = talk.device
    fastest = device.capabilities.fastest_baud if device.capabilities and talk.bauds else 0
    baud = min(fastest, device.most_baud or fastest)
    if device.baud > baud > 0:
        yield from _slow_down(talk, FIRST_BAUD)
    slow = device.baud
    while baud > slow:
        change = talk.send(SetBaud(baud))
        yield settled(change)
        if isinstance(change.answer, Accepted):
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
    change = talk.send(SetBaud(baud), tries=1)
    yield Wait(lambda: change.settled, talk.now + _BACK_WITHIN)
    talk.driver.forget(change)
    talk.device.baud = baud
    # makes the lower rate permanent
    yield settled(talk.send(AskStatistics()))


def _line_is_reliable(talk: Conversation) -> Script[bool]:
    rejected = talk.driver.statistics.rejected_blocks
    for number in range(LINK_TESTS):
        data = random.Random(number).randbytes(MAX_TEST)
        test = talk.send(TestLink(MAX_TESTED, data), tries=1)
        yield settled(test)
        if not isinstance(test.answer, LinkTested) or test.answer.data != (data * 8)[:MAX_TESTED]:
            return False
    return talk.driver.statistics.rejected_blocks == rejected
