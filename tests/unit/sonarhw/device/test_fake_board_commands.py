"""The reaction of the fake board to each command of version 1.1 and to a silent host."""

import pytest

from sonarhw.device.fake_board import BoardIdentity, FakeBoard, rearmed
from sonarhw.wire.frames import DELIMITER, Frame, FrameDecoder, encode_frame
from sonarhw.wire.limits import BAUD_TIMEOUT, HOST_SILENCE, RECEIVE_ROOM
from sonarhw.wire.messages import (
    Accepted,
    AskCapabilities,
    AskStatistics,
    Capabilities,
    Configure,
    ConfigureTurntable,
    Feature,
    Finished,
    Heartbeat,
    Hello,
    Home,
    Info,
    Message,
    Outcome,
    ReadingMessage,
    Refusal,
    Refused,
    SetBaud,
    Settings,
    Started,
    StartScan,
    Statistics,
    TestLink,
    Turn,
    TurntableSettings,
    unpack_message,
)
from tests.fixtures.plain_echoes import PlainEchoes, echo_time


class Host:
    """A host that exchanges messages with a board at given times."""

    def __init__(self, minor: int = 1, identity: BoardIdentity | None = None) -> None:
        self.board = FakeBoard(PlainEchoes(), seed=7, identity=identity)
        self.now = 0.0
        self.sequence = 0
        (self.info,) = self.send(Hello(1, minor))

    def send(self, message: Message, wait: float = 0.01) -> list[Message]:
        """Send a message and return what the board sends within `wait` s."""
        self.board.receive(self.frame(message), self.now)
        return self.receive(wait)

    def frame(self, message: Message) -> bytes:
        """Return the bytes of the next message."""
        self.sequence += 1
        return encode_frame(Frame(message.TYPE, self.sequence, 0, message.pack()))

    def receive(self, wait: float) -> list[Message]:
        """Return what the board sends within `wait` s."""
        self.now += wait
        sent = []
        for frame in FrameDecoder().feed(self.board.advance(self.now)):
            assert isinstance(frame, Frame)
            message = unpack_message(frame.type, frame.payload)
            assert message is not None
            sent.append(message)
        return sent

    def act(self, message: Message) -> list[Message]:
        """Send a command and keepalives until the action ends; return what the board sends."""
        sent = self.send(message)
        while self.board.busy:
            sent += self.send(AskStatistics(), 0.4)
        return sent


def test_capabilities_report_the_limits_of_the_board() -> None:
    host = Host()
    (capabilities,) = host.send(AskCapabilities())
    assert isinstance(capabilities, Capabilities)
    assert Feature.THERMOMETER in Feature(capabilities.features)
    host.act(Home())
    for angle in (capabilities.lowest_angle, capabilities.highest_angle):
        assert isinstance(host.act(Turn(angle))[0], Accepted)
        (refused,) = host.send(Turn(angle + (1 if angle > 0 else -1)))
        assert isinstance(refused, Refused)
    (settings,) = host.send(Configure(10**6, 2_380, 0, 343_200))
    assert isinstance(settings, Settings)
    assert settings.listen_us == capabilities.longest_listen_us


def test_motor_and_conversation_end_after_two_seconds_without_the_host() -> None:
    host = Host()
    host.act(Home())
    host.send(StartScan(0, 1_000_000, 300, 1, 1))
    sent = host.receive(HOST_SILENCE + 0.5)
    assert host.board.busy is False
    assert not host.board.zero
    stopped = [message for message in sent if isinstance(message, Finished)]
    assert [message.outcome for message in stopped] == [Outcome.STOPPED]
    assert host.receive(2.0) == []
    (refused,) = host.send(Turn(0))
    assert isinstance(refused, Refused)
    assert refused.code == Refusal.NO_HELLO


def test_a_keepalive_keeps_motor_and_conversation() -> None:
    host = Host()
    host.act(Home())
    for _ in range(20):
        host.send(AskStatistics(), 0.5)
    assert host.board.zero


def test_a_host_of_version_1_0_may_be_silent() -> None:
    host = Host(minor=0)
    assert any(isinstance(message, Finished) for message in host.send(Home(), 3.0))
    beats = host.receive(10.0)
    assert len(beats) == 40
    assert host.board.zero


def test_statistics_count_frames_noise_and_pings() -> None:
    host = Host()
    host.act(Home())
    host.act(StartScan(0, 1_000_000, 5, 1, 1))
    host.board.receive(b"rubbish\0more\0", host.now)
    (statistics,) = [message for message in host.send(AskStatistics()) if isinstance(message, Statistics)]
    assert (statistics.frames, statistics.rejected, statistics.pings) == (host.sequence, 2, 5)


def test_the_turntable_speed_is_limited_by_settings_and_motor() -> None:
    host = Host()
    host.act(Home())
    (slow,) = host.send(ConfigureTurntable(45_000_000, 0, 100_000, 1))
    assert isinstance(slow, TurntableSettings)
    assert (slow.speed, slow.settle_us, slow.approach) == (45_000_000, 100_000, 1)
    began = host.now
    host.send(Turn(90_000_000))
    while host.board.busy:
        host.send(AskStatistics(), 0.01)
    assert host.now - began == pytest.approx(2.1, abs=0.05)
    (fast,) = host.send(ConfigureTurntable(10**9, 0, 20_000, 0))
    assert isinstance(fast, TurntableSettings)
    assert fast.speed == 180_000_000


def test_echoes_are_limited_in_number_and_spaced_by_the_rearming_time() -> None:
    host = Host()
    host.act(Home())
    received = []
    for request in ({"echoes": 1}, {"rearm_us": 20_000}, {}):
        (settings,) = host.send(Configure(62_500, 2_380, 0, 343_200, **request))
        assert isinstance(settings, Settings)
        sent = host.act(StartScan(0, 1_000_000, 1, 1, 1))
        received.append(next(message.echoes for message in sent if isinstance(message, ReadingMessage)))
    first = round(echo_time(0.0) * 1e9)
    assert received == [(first,), (first,), (first, 2 * first)]


def test_rearming_drops_echoes_too_soon_after_a_detected_echo() -> None:
    assert rearmed([0.010, 0.0101, 0.0109, 0.0111, 0.03], 0.001) == [0.010, 0.0111, 0.03]
    assert rearmed([0.02, 0.01], 0.0) == [0.01, 0.02]


def test_a_new_line_speed_is_reverted_without_a_valid_frame() -> None:
    host = Host(identity=BoardIdentity(bauds=(250_000, 1_000_000)))
    host.send(SetBaud(1_000_000))
    assert host.board.line.baud == 1_000_000
    host.board.receive(b"rubbish\0" * 5, host.now)
    host.receive(BAUD_TIMEOUT + 0.1)
    assert host.board.line.baud == 250_000
    host.send(SetBaud(1_000_000))
    host.send(AskStatistics())
    host.receive(BAUD_TIMEOUT + 0.1)
    assert host.board.line.baud == 1_000_000
    host.receive(HOST_SILENCE)
    assert host.board.line.baud == 250_000


def test_old_firmware_refuses_unknown_commands_and_sends_no_new_messages() -> None:
    host = Host(identity=BoardIdentity(minor=0))
    assert isinstance(host.info, Info)
    assert (host.info.minor, host.info.boot) == (0, 0)
    for message in (AskCapabilities(), AskStatistics(), TestLink(1, b"a"), SetBaud(1_000_000)):
        (refused,) = host.send(message)
        assert isinstance(refused, Refused)
        assert refused.code == Refusal.UNKNOWN
    host.send(Home(), 3.0)
    sent = host.send(StartScan(0, 1_000_000, 4, 1, 1, 2, 1), 3.0)
    assert [message.number for message in sent if isinstance(message, ReadingMessage)] == [0, 1, 2, 3]
    beats = [message for message in sent if isinstance(message, Heartbeat)]
    assert {(beat.boot, beat.homed) for beat in beats} == {(0, 0)}


def test_while_it_listens_it_answers_nothing_and_keeps_as_many_bytes_as_documented() -> None:
    host = Host()
    host.send(Configure(60_000, 0, 0, 343_200))
    host.act(Home())
    (started,) = host.send(StartScan(0, 1_000_000, 5, 1, 1))
    assert isinstance(started, Started)
    commands = [host.frame(AskStatistics()) for _ in range(10)]
    kept = RECEIVE_ROOM // len(commands[0])
    for command in commands:
        host.board.receive(command, host.now)
    assert host.receive(0.045) == []
    reading, *answers = [one for one in host.receive(0.02) if not isinstance(one, Heartbeat)]
    assert isinstance(reading, ReadingMessage)
    assert [type(answer) for answer in answers] == [Statistics] * kept
    host.receive(0.03)
    host.board.receive(DELIMITER, host.now)  # ends the frame that was cut off
    (statistics,) = [one for one in host.send(AskStatistics(), 0.1) if isinstance(one, Statistics)]
    assert statistics.overruns == sum(map(len, commands)) - RECEIVE_ROOM
