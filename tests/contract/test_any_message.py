"""A device answers any message from a host exactly once, and also the next one."""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import fields, replace

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from sonarhw.device.replayed_log import ReplayDevice
from sonarhw.log import Log, read_log
from sonarhw.wire import messages as msg
from tests.contract.scanners import fake, portable
from tests.contract.talk import DirectLine, Talk
from tests.fixtures.example_logs import write_example
from tests.fixtures.plain_plugin import plain_plugin

LIMITS = {"u8": (0, 0xFF), "u16": (0, 0xFFFF), "u32": (0, 0xFFFF_FFFF), "i32": (-(2**31), 2**31 - 1)}


def values(wire: msg.Scalar | msg.Counted) -> st.SearchStrategy[int] | st.SearchStrategy[bytes]:
    """Values of a field, with an emphasis on its limits and small numbers."""
    if isinstance(wire, msg.Counted):
        return st.binary(max_size=70)
    lowest, highest = LIMITS[wire.name]
    return st.sampled_from([lowest, 0, 1, highest]) | st.integers(lowest, highest)


MESSAGES = st.one_of([st.builds(k, *(values(item.metadata["wire"]) for item in fields(k))) for k in msg.FROM_HOST])
ANY_FRAMES = MESSAGES.map(lambda message: (message.TYPE, message.pack())) | st.tuples(
    st.integers(0, 0xFF), st.binary(max_size=20)
)


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Log:
    path = tmp_path_factory.mktemp("log") / "scan.mcap"
    write_example(path, 12, trace=True)
    return read_log(path)


@contextmanager
def replay(log: Log, loop: bool = False) -> Iterator[DirectLine]:
    yield DirectLine(ReplayDevice(log, loop=loop))


@contextmanager
def plugin() -> Iterator[DirectLine]:
    yield DirectLine(plain_plugin()[0])


def without_settings(log: Log) -> Log:
    """Return the log without its Settings; a replay then uses the settings that the host requests."""
    return replace(log, settings=None, scans=tuple(replace(scan, settings=None) for scan in log.scans))


DEVICES: dict[str, Callable[[Log], AbstractContextManager[DirectLine]]] = {
    "fake": lambda _: fake(),
    "portable firmware": lambda _: portable(),
    "plug-in": lambda _: plugin(),
    "replay": lambda log: replay(log),
    "looping replay": lambda log: replay(log, loop=True),
    "replay of a log without settings": lambda log: replay(without_settings(log)),
}


def answers(talk: Talk, kind: int, payload: bytes) -> list[msg.AnswerMessage]:
    """Send a frame; return its answers within 1.9 s, which is less than the silence after which the host is gone.

    A device that turns by itself states the number of readings in a second Started, at the end of the scan.
    """
    (number,) = talk.send_frames((kind, payload))
    received = talk.quiet(1.9)
    found = [message for message in received if isinstance(message, msg.AnswerMessage) and message.command == number]
    return found[:1] if found and isinstance(found[0], msg.Started) and not found[0].readings else found


@pytest.mark.parametrize("device", DEVICES)
@given(frames=st.lists(ANY_FRAMES, max_size=8))
@example(frames=[(msg.StartScan.TYPE, msg.StartScan(0, 1, 0xFFFF, 0xFFFF, 0xFF).pack())])
@example(frames=[(kind.TYPE, kind.pack()) for kind in (msg.Configure(65_000, 0, 1, 1), msg.StartScan(0, 1, 1, 1, 1))])
@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.too_slow])
def test_every_message_is_answered_once(device: str, log: Log, frames: list[tuple[int, bytes]]) -> None:
    with DEVICES[device](log) as line:
        talk = Talk(line, line.clock)
        for message in (msg.Hello(1, 0), msg.Home()):
            assert len(answers(talk, message.TYPE, message.pack())) == 1
        for kind, payload in frames:
            assert len(answers(talk, kind, payload)) == 1
        assert [type(answer) for answer in answers(talk, msg.Stop.TYPE, b"")] == [msg.Accepted]


def test_a_reading_that_does_not_fit_its_message_ends_the_scan_with_a_reason(log: Log) -> None:
    # at 1 mm/s the echo of a wall two metres away takes an hour; that many nanoseconds do not fit u32
    with replay(without_settings(log)) as line:
        talk = Talk(line, line.clock)
        talk.greet()
        talk.answer(msg.Configure(65_000, 0, 0, 1))
        talk.answer(msg.StartScan(0, 1_000_000, 12, 1, 1))
        (finished,) = [one for one in talk.quiet(1.0) if isinstance(one, msg.Finished)]
    assert (finished.outcome, finished.readings) == (msg.Outcome.FAULT, 0)
    assert "does not fit u32" in finished.text
