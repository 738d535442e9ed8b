"""The fake board beyond the protocol, which `tests/contract` tests: its echoes, its line, its age and its limits."""

import pytest

from sonarhw.device.fake_board import FakeBoard, rearmed
from sonarhw.device.protocol import BACKLOG, Line
from sonarhw.wire import messages as msg
from sonarhw.wire.frames import DELIMITER, Frame, encode_frame
from sonarhw.wire.limits import RECEIVE_ROOM
from tests.contract.talk import DirectLine, Talk, readings
from tests.fixtures.plain_echoes import PlainEchoes

ONE = msg.StartScan(0, 1_000_000, 1, 1, 1)


def talk_to(board: FakeBoard, minor: int = 2) -> Talk:
    """Return a conversation with the board, after Hello."""
    line = DirectLine(board)
    talk = Talk(line, line.clock)
    talk.ask(msg.Hello(1, minor), msg.Info)
    return talk


@pytest.fixture
def board() -> FakeBoard:
    return FakeBoard(PlainEchoes(), seed=7)


@pytest.fixture
def talk(board: FakeBoard) -> Talk:
    """Return a conversation with the board, which is homed."""
    talk = talk_to(board)
    talk.act(msg.Home())
    return talk


def test_rearming_drops_echoes_too_soon_after_a_detected_echo() -> None:
    assert rearmed([0.010, 0.0101, 0.0109, 0.0111, 0.03], 0.001) == [0.010, 0.0111, 0.03]
    assert rearmed([0.02, 0.01], 0.0) == [0.01, 0.02]


def test_frames_leave_at_the_rate_of_the_line() -> None:
    line = Line()
    for number, time in enumerate((2.0, 2.0, 5.0)):
        line.send(msg.Accepted(number + 1), time)
    size = len(encode_frame(Frame(msg.Accepted.TYPE, 0, 2_000_000, msg.Accepted(1).pack())))
    departures = []
    while (departure := line.departure()) is not None:
        assert line.depart(departure - 1e-9) == b""
        assert line.depart(departure).count(0) == 1
        departures.append(departure)
    assert departures == pytest.approx([2.0 + size * 1e-5, 2.0 + 2 * size * 1e-5, 5.0 + size * 1e-5], abs=2e-5)
    assert line.waiting == 0


def test_a_host_that_never_reads_does_not_fill_the_memory_of_the_board(board: FakeBoard) -> None:
    for sequence in range(20_000):
        board.receive(encode_frame(Frame(msg.Hello.TYPE, sequence, 0, msg.Hello(1, 0).pack())), 0.0)
    assert board.line.waiting < BACKLOG + 200


def test_a_board_whose_receivers_are_not_ready_homes_and_turns_but_delays_its_pings() -> None:
    ready, echoes = False, PlainEchoes()
    board = FakeBoard(echoes, ready=lambda: ready)
    talk = talk_to(board)
    talk.act(msg.Home())
    talk.act(msg.Turn(90_000_000))
    assert talk.clock() < 3.0
    talk.ask(ONE, msg.Started)
    messages = talk.until(lambda _: talk.clock() > 10)
    assert not any(isinstance(message, msg.Finished) and message.readings for message in messages)
    assert (echoes.pings, board.busy) == ([], False)
    ready = True
    talk.until(lambda received: len(readings(received)) == 1)
    assert talk.clock() < 12


def test_while_it_listens_it_answers_nothing_and_keeps_as_many_bytes_as_documented(talk: Talk) -> None:
    talk.ask(msg.Configure(60_000, 0, 0, 343_200), msg.Settings)
    talk.ask(msg.StartScan(0, 1_000_000, 5, 1, 1), msg.Started)
    commands = [talk.wire(msg.AskStatistics.TYPE, b"") for _ in range(10)]
    for command in commands:
        talk.write(command)
    kept = RECEIVE_ROOM // len(commands[0])

    def others(messages: list[msg.Message]) -> list[type[msg.Message]]:
        return [type(message) for message in messages if not isinstance(message, msg.Heartbeat)]

    assert others(talk.quiet(0.045)) == []
    assert others(talk.quiet(0.02)) == [msg.ReadingMessage, *[msg.Statistics] * kept]
    talk.quiet(0.03)
    talk.write(DELIMITER)  # ends the frame that was cut off
    talk.until(lambda messages: others(messages).count(msg.Statistics) > kept, alive=True)
    overruns = talk.ask(msg.AskStatistics(), msg.Statistics).overruns
    assert overruns == sum(map(len, commands)) - RECEIVE_ROOM
