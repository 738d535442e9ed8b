"""What the fake board does at each command of version 1.1, and when its host falls silent."""

import pytest

from sonarhw.device.fake_board import BoardIdentity, FakeBoard, rearmed
from sonarhw.wire.frames import Frame, FrameDecoder, encode_frame
from sonarhw.wire.limits import BAUD_TIMEOUT, HOST_SILENCE
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
    LinkTested,
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
    """Says things to a board at given times, and hears what it says."""

    def __init__(self, minor: int = 1, identity: BoardIdentity | None = None) -> None:
        self.board = FakeBoard(PlainEchoes(), seed=7, identity=identity)
        self.now = 0.0
        self.sequence = 0
        (self.info,) = self.say(Hello(1, minor))

    def say(self, message: Message, wait: float = 0.01) -> list[Message]:
        """What the board says within `wait` s."""
        self.sequence += 1
        self.board.receive(encode_frame(Frame(message.TYPE, self.sequence, 0, message.pack())), self.now)
        return self.hear(wait)

    def hear(self, wait: float) -> list[Message]:
        """What the board says within `wait` s."""
        self.now += wait
        said = []
        for frame in FrameDecoder().feed(self.board.advance(self.now)):
            assert isinstance(frame, Frame)
            message = unpack_message(frame.type, frame.payload)
            assert message is not None
            said.append(message)
        return said

    def act(self, message: Message) -> list[Message]:
        """What it says until it has done something, with signs of life."""
        said = self.say(message)
        while self.board.busy:
            said += self.say(AskStatistics(), 0.4)
        return said


def test_capabilities_report_the_limits_of_the_board() -> None:
    host = Host()
    (can,) = host.say(AskCapabilities())
    assert isinstance(can, Capabilities)
    assert Feature.THERMOMETER in Feature(can.features)
    host.act(Home())
    for angle in (can.lowest_angle, can.highest_angle):
        assert isinstance(host.act(Turn(angle))[0], Accepted)
        (refused,) = host.say(Turn(angle + (1 if angle > 0 else -1)))
        assert isinstance(refused, Refused)
    (settings,) = host.say(Configure(10**6, 2_380, 0, 343_200))
    assert isinstance(settings, Settings)
    assert settings.listen_us == can.longest_listen_us


def test_motor_and_conversation_end_after_two_seconds_without_the_host() -> None:
    host = Host()
    host.act(Home())
    host.say(StartScan(0, 1_000_000, 300, 1, 1))
    said = host.hear(HOST_SILENCE + 0.5)
    assert host.board.busy is False
    assert not host.board.homed
    stopped = [message for message in said if isinstance(message, Finished)]
    assert [message.outcome for message in stopped] == [Outcome.STOPPED]
    assert host.hear(2.0) == []
    (refused,) = host.say(Turn(0))
    assert isinstance(refused, Refused)
    assert refused.code == Refusal.NO_HELLO


def test_a_keepalive_keeps_motor_and_conversation() -> None:
    host = Host()
    host.act(Home())
    for _ in range(20):
        host.say(AskStatistics(), 0.5)
    assert host.board.homed


def test_a_host_of_version_1_0_may_be_silent() -> None:
    host = Host(minor=0)
    assert any(isinstance(message, Finished) for message in host.say(Home(), 3.0))
    beats = host.hear(10.0)
    assert len(beats) == 40
    assert host.board.homed


def test_statistics_count_frames_noise_and_pings() -> None:
    host = Host()
    host.act(Home())
    host.act(StartScan(0, 1_000_000, 5, 1, 1))
    host.board.receive(b"rubbish\0more\0", host.now)
    (told,) = [message for message in host.say(AskStatistics()) if isinstance(message, Statistics)]
    assert (told.frames, told.rejected, told.pings) == (host.sequence, 2, 5)


@pytest.mark.parametrize(("first", "count"), [(0, 0), (3, 0), (3, 4), (11, 1)])
def test_a_part_of_a_scan_has_the_readings_of_the_whole_scan(first: int, count: int) -> None:
    host = Host()
    host.act(Home())
    whole = StartScan(10_000_000, 2_000_000, 3, 2, 2)
    said = host.act(StartScan(10_000_000, 2_000_000, 3, 2, 2, first, count))
    expected = range(first, first + count if count else 12)
    started = said[0]
    assert isinstance(started, Started)
    assert (started.readings, started.first) == (len(expected), first)
    readings = [message for message in said if isinstance(message, ReadingMessage)]
    assert [reading.number for reading in readings] == [*expected]
    for reading in readings:
        place, ping = divmod(reading.number, whole.pings)
        sweep, index = divmod(place, whole.headings)
        index = 2 - index if sweep else index
        assert (reading.sweep, reading.ping, reading.angle) == (sweep, ping, 10_000_000 + 2_000_000 * index)
    (finished,) = (message for message in said if isinstance(message, Finished))
    assert finished.readings == expected.stop


def test_the_turntable_speed_is_limited_by_settings_and_motor() -> None:
    host = Host()
    host.act(Home())
    (slow,) = host.say(ConfigureTurntable(45_000_000, 0, 100_000, 1))
    assert isinstance(slow, TurntableSettings)
    assert (slow.speed, slow.settle_us, slow.approach) == (45_000_000, 100_000, 1)
    began = host.now
    host.say(Turn(90_000_000))
    while host.board.busy:
        host.say(AskStatistics(), 0.01)
    assert host.now - began == pytest.approx(2.1, abs=0.05)
    (fast,) = host.say(ConfigureTurntable(10**9, 0, 20_000, 0))
    assert isinstance(fast, TurntableSettings)
    assert fast.speed == 180_000_000


def test_echoes_are_limited_in_number_and_spaced_by_the_rearming_time() -> None:
    host = Host()
    host.act(Home())
    heard = []
    for wish in ({"echoes": 1}, {"rearm_us": 20_000}, {}):
        (settings,) = host.say(Configure(62_500, 2_380, 0, 343_200, **wish))
        assert isinstance(settings, Settings)
        said = host.act(StartScan(0, 1_000_000, 1, 1, 1))
        heard.append(next(message.echoes for message in said if isinstance(message, ReadingMessage)))
    first = round(echo_time(0.0) * 1e9)
    assert heard == [(first,), (first,), (first, 2 * first)]


def test_rearming_drops_echoes_too_soon_after_a_detected_echo() -> None:
    assert rearmed([0.010, 0.0101, 0.0109, 0.0111, 0.03], 0.001) == [0.010, 0.0111, 0.03]
    assert rearmed([0.02, 0.01], 0.0) == [0.01, 0.02]


def test_a_line_test_repeats_its_bytes() -> None:
    (back,) = Host().say(TestLink(7, b"abc"))
    assert isinstance(back, LinkTested)
    assert back.data == b"abcabca"


def test_a_new_line_speed_is_reverted_without_a_valid_frame() -> None:
    host = Host(identity=BoardIdentity(bauds=(250_000, 1_000_000)))
    host.say(SetBaud(1_000_000))
    assert host.board.line.baud == 1_000_000
    host.board.receive(b"rubbish\0" * 5, host.now)
    host.hear(BAUD_TIMEOUT + 0.1)
    assert host.board.line.baud == 250_000
    host.say(SetBaud(1_000_000))
    host.say(AskStatistics())
    host.hear(BAUD_TIMEOUT + 0.1)
    assert host.board.line.baud == 1_000_000
    host.hear(HOST_SILENCE)
    assert host.board.line.baud == 250_000


def test_old_firmware_refuses_unknown_commands_and_sends_no_new_messages() -> None:
    host = Host(identity=BoardIdentity(minor=0))
    assert isinstance(host.info, Info)
    assert (host.info.minor, host.info.boot) == (0, 0)
    for message in (AskCapabilities(), AskStatistics(), TestLink(1, b"a"), SetBaud(1_000_000)):
        (refused,) = host.say(message)
        assert isinstance(refused, Refused)
        assert refused.code == Refusal.UNKNOWN
    host.say(Home(), 3.0)
    said = host.say(StartScan(0, 1_000_000, 4, 1, 1, 2, 1), 3.0)
    assert [message.number for message in said if isinstance(message, ReadingMessage)] == [0, 1, 2, 3]
    beats = [message for message in said if isinstance(message, Heartbeat)]
    assert {(beat.boot, beat.homed) for beat in beats} == {(0, 0)}
