"""The refusals of the fake board, and its behaviour at the limits of its settings."""

import pytest

from sonarhw.device.fake_board import BoardIdentity, FakeBoard
from sonarhw.device.protocol import BACKLOG, Line
from sonarhw.host.driver import Driver
from sonarhw.wire.frames import Frame, FrameDecoder, encode_frame
from sonarhw.wire.messages import (
    NO_TEMPERATURE,
    Accepted,
    Configure,
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
    Resend,
    StartScan,
    Stop,
    Turn,
    unpack_message,
)
from tests.fixtures.joined import Joined
from tests.fixtures.plain_echoes import PlainEchoes, echo_time


def refusal(joined: Joined, message: Message) -> Refusal:
    """Return the code with which the board refuses a message."""
    answer = joined.ask(message).answer
    assert isinstance(answer, Refused), answer
    assert answer.text
    return Refusal(answer.code)


def raw_answers(
    board: FakeBoard, kind: int, payload: bytes, sequence: int = 9, at: float = 1.0
) -> list[Message | None]:
    """Return what the board sends within 10 ms after a frame with this type and payload."""
    board.receive(encode_frame(Frame(kind, sequence, 0, payload)), at)
    frames = FrameDecoder().feed(board.advance(at + 0.01))
    return [unpack_message(frame.type, frame.payload) for frame in frames if isinstance(frame, Frame)]


@pytest.fixture
def greeted() -> Joined:
    joined = Joined()
    joined.ask(Hello(1, 0))
    return joined


@pytest.fixture
def homed() -> Joined:
    joined = Joined()
    joined.greet()
    return joined


@pytest.mark.parametrize(
    "message", [Configure(62_500, 2380, 0, 343_200), Home(), Turn(0), StartScan(0, 1, 1, 1, 1), Stop(), Resend(0, 1)]
)
def test_every_command_before_hello_is_refused(message: Message) -> None:
    assert refusal(Joined(), message) is Refusal.NO_HELLO


def test_an_unknown_type_and_a_malformed_payload_are_named_in_the_refusal() -> None:
    board = FakeBoard(PlainEchoes())
    raw_answers(board, Hello.TYPE, Hello(1, 0).pack())
    (unknown,) = raw_answers(board, 0x55, b"")
    (malformed,) = raw_answers(board, Turn.TYPE, b"\1\2")
    (from_device,) = raw_answers(board, Info.TYPE, b"")
    assert isinstance(unknown, Refused)
    assert isinstance(malformed, Refused)
    assert isinstance(from_device, Refused)
    assert (unknown.code, malformed.code, from_device.code) == (Refusal.UNKNOWN, Refusal.MALFORMED, Refusal.UNKNOWN)
    assert "0x55" in unknown.text
    assert "Turn" in malformed.text
    assert unknown.command == 9


def test_echoes_inside_blanking_and_beyond_listening_are_not_reported(homed: Joined) -> None:
    first = echo_time(0.0)  # 15 ms; the second echo takes 30 ms
    for listen, blanking, expected in (
        (62_500, 2_380, 2),
        (62_500, 15_100, 1),
        (29_000, 2_380, 1),
        (29_000, 15_100, 0),
    ):
        homed.ask(Configure(listen, blanking, 0, 343_200))
        (reading,) = homed.scan(StartScan(0, 1_000_000, 1, 1, 1))
        assert len(reading.echo_times) == expected
        assert all(time in (pytest.approx(first), pytest.approx(2 * first)) for time in reading.echo_times)


def test_the_last_sixty_four_readings_are_kept_for_resending(homed: Joined) -> None:
    homed.scan(StartScan(0, 1_000_000, 70, 1, 1))
    sent = encode_frame(Frame(Resend.TYPE, 77, 0, Resend(0, 64).pack()))
    homed.board.receive(sent, homed.now)
    frames = FrameDecoder().feed(homed.board.advance(homed.now + 0.1))
    answers = [unpack_message(frame.type, frame.payload) for frame in frames if isinstance(frame, Frame)]
    assert answers[0] == Accepted(77)
    assert [item.number for item in answers if isinstance(item, ReadingMessage)] == list(range(6, 64))


def test_frames_leave_at_the_rate_of_the_line() -> None:
    line = Line()
    line.send(Accepted(1), 2.0)
    line.send(Accepted(2), 2.0)
    line.send(Accepted(3), 5.0)
    size = len(encode_frame(Frame(Accepted.TYPE, 0, 2_000_000, Accepted(1).pack())))
    departures = []
    while (departure := line.departure()) is not None:
        assert line.depart(departure - 1e-9) == b""
        assert line.depart(departure).count(0) == 1
        departures.append(departure)
    assert departures == pytest.approx([2.0 + size * 1e-5, 2.0 + 2 * size * 1e-5, 5.0 + size * 1e-5], abs=2e-5)
    assert line.waiting == 0


def test_a_host_that_never_reads_does_not_fill_the_memory_of_the_board() -> None:
    board = FakeBoard(PlainEchoes())
    for sequence in range(20_000):
        board.receive(encode_frame(Frame(Hello.TYPE, sequence, 0, Hello(1, 0).pack())), 0.0)
    assert board.line.waiting < BACKLOG + 200


def test_after_a_disconnect_the_board_is_silent_and_requires_hello(homed: Joined) -> None:
    homed.ask(StartScan(0, 1_000_000, 50, 1, 1))
    homed.board.hang_up()
    assert not homed.board.busy
    assert homed.board.next_event() is None
    assert homed.board.advance(homed.now + 10) == b""
    assert isinstance(raw_answers(homed.board, Stop.TYPE, b"")[0], Refused)


def test_the_seed_determines_the_board() -> None:
    def homing_time(seed: int) -> float:
        joined = Joined(board=FakeBoard(PlainEchoes(), seed=seed))
        joined.ask(Hello(1, 0))
        joined.act(Home())
        return joined.now

    assert homing_time(1) == homing_time(1) != homing_time(2)


def test_a_board_without_a_thermometer_sends_no_temperature() -> None:
    (info,) = raw_answers(FakeBoard(PlainEchoes(temperature_c=None)), Hello.TYPE, Hello(1, 0).pack())
    assert isinstance(info, Info)
    assert info.temperature == NO_TEMPERATURE


def test_a_stop_during_a_turn_keeps_the_angle_reached(homed: Joined) -> None:
    turn = homed.ask(Turn(180_000_000))
    end = homed.now + 0.5
    homed.until(lambda: homed.now >= end)
    homed.ask(Stop())
    assert isinstance(turn.finished, Finished)
    homed.until(lambda: homed.driver.heartbeat is not None and homed.driver.heartbeat.state == 0)
    assert homed.driver.heartbeat is not None
    assert 80_000_000 < homed.driver.heartbeat.angle < 140_000_000


def test_a_board_whose_receivers_are_not_ready_homes_and_turns_but_delays_its_pings() -> None:
    ready = False
    echoes = PlainEchoes()
    joined = Joined(board=FakeBoard(echoes, ready=lambda: ready))
    joined.ask(Hello(1, 0))
    joined.act(Home())
    joined.act(Turn(90_000_000))
    assert joined.now < 3.0
    scan = joined.ask(StartScan(0, 1_000_000, 2, 1, 1))
    joined.until(lambda: joined.now > 10)
    assert (scan.finished, echoes.pings) == (None, [])
    assert not joined.board.busy
    ready = True
    joined.until(lambda: scan.finished is not None, within=2.0)
    assert len(echoes.pings) == 2


@pytest.mark.parametrize("degrees", [-720, -350, 0, 1, 90, 700, 720])
def test_homing_takes_less_than_three_seconds_from_any_angle_within_the_cable_limits(
    homed: Joined, degrees: int
) -> None:
    homed.act(Turn(degrees * 1_000_000))
    began = homed.now
    home = homed.act(Home())
    assert homed.now - began < 3.0
    assert home.finished is not None
    assert home.finished.outcome == Outcome.DONE


def test_homing_after_a_stop_continues_from_the_angle_reached(homed: Joined) -> None:
    homed.act(Turn(720_000_000))
    homed.ask(Home())
    end = homed.now + 1.5
    homed.until(lambda: homed.now >= end)
    homed.ask(Stop())
    assert refusal(homed, Turn(0)) is Refusal.NOT_HOMED
    began = homed.now
    homed.act(Home())
    assert homed.now - began < 0.6  # a quarter of the way remains


def test_hello_keeps_zero_settings_and_readings_and_drops_old_messages(homed: Joined) -> None:
    homed.ask(Configure(62_500, 15_100, 0, 343_200))  # the first of two echoes is blanked
    homed.ask(StartScan(0, 1_000_000, 50, 1, 1))
    homed.until(lambda: len(homed.readings) == 5)
    sent = raw_answers(homed.board, Hello.TYPE, Hello(1, 0).pack(), at=homed.now)
    assert [type(message) for message in sent if not isinstance(message, Heartbeat)] == [Finished, Info]
    sent = raw_answers(homed.board, Resend.TYPE, Resend(0, 64).pack(), sequence=10, at=homed.now)
    assert [item.number for item in sent if isinstance(item, ReadingMessage)][:5] == [0, 1, 2, 3, 4]
    homed.driver = Driver(first_sequence=7000)
    homed.ask(Hello(1, 0))
    (reading,) = homed.scan(StartScan(0, 1_000_000, 1, 1, 1))  # not refused with NOT_HOMED
    assert reading.echo_times == pytest.approx([2 * echo_time(0.0)])


def test_heartbeats_count_the_readings_of_the_last_scan_after_a_turn_too(homed: Joined) -> None:
    homed.scan(StartScan(0, 1_000_000, 5, 1, 1))
    homed.act(Turn(90_000_000))
    end = homed.now + 0.3
    homed.until(lambda: homed.now >= end)
    assert homed.driver.heartbeat is not None
    assert homed.driver.heartbeat.readings == 5


def test_a_board_without_traces_reports_it_in_its_settings_and_sends_none() -> None:
    joined = Joined(board=FakeBoard(PlainEchoes(), identity=BoardIdentity(trace_rate=0)))
    joined.greet(trace=True)
    assert joined.driver.assembler.settings is not None
    assert joined.driver.assembler.settings.trace == 0
    (reading,) = joined.scan(StartScan(0, 1_000_000, 1, 1, 1))
    assert reading.trace is None
