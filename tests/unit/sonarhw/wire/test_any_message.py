"""A device answers any message from a host exactly once, and also the next one."""

from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from sonarhw.device.fake_board import FakeBoard
from sonarhw.device.protocol import ProtocolDevice
from sonarhw.device.replayed_log import ReplayDevice
from sonarhw.log import Log, read_log
from sonarhw.wire.frames import Frame, FrameDecoder, encode_frame
from sonarhw.wire.messages import (
    FROM_HOST,
    Accepted,
    AnswerMessage,
    Configure,
    Counted,
    Finished,
    Hello,
    Home,
    Message,
    Outcome,
    Scalar,
    StartScan,
    Stop,
    unpack_message,
)
from tests.fixtures.example_logs import write_example
from tests.fixtures.plain_echoes import PlainEchoes

LIMITS = {"u8": (0, 0xFF), "u16": (0, 0xFFFF), "u32": (0, 0xFFFF_FFFF), "i32": (-(2**31), 2**31 - 1)}


def values(wire: Scalar | Counted) -> st.SearchStrategy[int] | st.SearchStrategy[bytes]:
    """Values of a field, with an emphasis on its limits and small numbers."""
    if isinstance(wire, Counted):
        return st.binary(max_size=70)
    lowest, highest = LIMITS[wire.name]
    return st.sampled_from([lowest, 0, 1, highest]) | st.integers(lowest, highest)


MESSAGES = st.one_of([st.builds(kind, *(values(item.metadata["wire"]) for item in fields(kind))) for kind in FROM_HOST])
ANY_FRAMES = MESSAGES.map(lambda message: (message.TYPE, message.pack())) | st.tuples(
    st.integers(0, 0xFF), st.binary(max_size=20)
)


class Host:
    """Sends frames to a device and collects its messages, on a virtual clock."""

    def __init__(self, device: ProtocolDevice) -> None:
        self.device = device
        self.now = 0.0
        self._sequence = 0

    def send_frame(self, kind: int, payload: bytes) -> list[Message]:
        """Send a frame and return the messages of the device within 1.9 s."""
        self._sequence += 1
        self.device.receive(encode_frame(Frame(kind, self._sequence, 0, payload)), self.now)
        self.now += 1.9  # less than the silence after which the host is gone
        frames = [frame for frame in FrameDecoder().feed(self.device.advance(self.now)) if isinstance(frame, Frame)]
        received = [unpack_message(frame.type, frame.payload) for frame in frames]
        return [message for message in received if message is not None]

    def send(self, message: Message) -> list[Message]:
        """Send a message and return the messages of the device within 1.9 s."""
        return self.send_frame(message.TYPE, message.pack())

    def answers(self, received: list[Message]) -> list[Message]:
        """Return those of the received messages that answer the last frame."""
        return [
            message for message in received if isinstance(message, AnswerMessage) and message.command == self._sequence
        ]


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Log:
    path: Path = tmp_path_factory.mktemp("log") / "scan.mcap"
    write_example(path, 12, trace=True)
    return read_log(path)


DEVICES: dict[str, Callable[[Log], ProtocolDevice]] = {
    "board": lambda log: FakeBoard(PlainEchoes(), seed=2),
    "replay": lambda log: ReplayDevice(log),
    "looping replay": lambda log: ReplayDevice(log, loop=True),
    "replay of a log without settings": lambda log: ReplayDevice(without_settings(log)),
}


def without_settings(log: Log) -> Log:
    """The same log without its Settings; a replay then uses the settings that the host requests."""
    return replace(log, settings=None, scans=tuple(replace(scan, settings=None) for scan in log.scans))


@pytest.mark.parametrize("device", DEVICES.values(), ids=DEVICES.keys())
@given(frames=st.lists(ANY_FRAMES, max_size=8))
@example(frames=[(StartScan.TYPE, StartScan(0, 1, 0xFFFF, 0xFFFF, 0xFF).pack())])
@example(frames=[(kind.TYPE, kind.pack()) for kind in (Configure(65_000, 0, 1, 1), StartScan(0, 1, 1, 1, 1))])
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
def test_every_message_is_answered_once_and_so_is_the_next(
    device: Callable[[Log], ProtocolDevice], log: Log, frames: list[tuple[int, bytes]]
) -> None:
    host = Host(device(log))
    for message in (Hello(1, 0), Home()):
        assert len(host.answers(host.send(message))) == 1
    for kind, payload in frames:
        assert len(host.answers(host.send_frame(kind, payload))) == 1
    assert host.answers(host.send(Stop())) == [Accepted(host._sequence)]


def test_a_reading_that_does_not_fit_its_message_ends_the_scan_with_a_reason(log: Log) -> None:
    # at 1 mm/s the echo of a wall two metres away takes an hour; that many nanoseconds do not fit u32
    host = Host(ReplayDevice(without_settings(log)))
    host.send(Hello(1, 0))
    host.send(Configure(65_000, 0, 0, 1))
    received = host.send(StartScan(0, 1_000_000, 12, 1, 1))
    (finished,) = (message for message in received if isinstance(message, Finished))
    assert (finished.outcome, finished.readings) == (Outcome.FAULT, 0)
    assert "does not fit u32" in finished.text
