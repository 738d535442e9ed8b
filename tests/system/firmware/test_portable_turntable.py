"""The turntable of the portable part: finds its zero from anywhere, ends its moves on one side, keeps its cable."""

import random

import pytest

from sonarhw.wire.messages import (
    Approach,
    AskStatistics,
    ConfigureTurntable,
    Finished,
    Hello,
    Home,
    Message,
    Outcome,
    Refusal,
    Refused,
    StartScan,
    Statistics,
    Turn,
)
from tests.system.firmware.portable import MICROSTEPS, RAMPED, SLIPPING, PortableBoard

A_DEGREE = MICROSTEPS // 360


def ended(board: PortableBoard, order: Message, within: int = 10_000_000) -> Finished:
    """How an order ended; fails where it has not within that time, µs."""
    said = board.ask(order, within)
    (finished,) = [message for message in said if isinstance(message, Finished)]
    return finished


def homed(board: PortableBoard, stands: int = 0) -> None:
    board.c.host_grain(50)
    board.c.host_stand(stands)
    board.ask(Hello(1, 0))
    assert ended(board, Home()).outcome == Outcome.DONE


@pytest.mark.parametrize("degrees", [-719, -361, -200, -181, -30, -20, -10, -1, 0, 1, 90, 179, 180, 181, 360, 500, 719])
def test_it_finds_its_zero_from_anywhere_within_3_s_and_never_winds_the_cable_further(
    board: PortableBoard, degrees: int
) -> None:
    board.c.host_grain(50)
    board.c.host_stand(degrees * A_DEGREE)
    board.ask(Hello(1, 0))
    board.send(b"")
    lowest = highest = degrees * A_DEGREE
    board.ask(Home(), 1000)
    said: list[Message] = []
    while not any(isinstance(message, Finished) for message in said):
        assert board.now < 3_000_000
        said += [message for _, message in board.says(board.now + 2_000)]
        lowest, highest = min(lowest, board.c.host_stands()), max(highest, board.c.host_stands())
    assert board.c.host_stands() == 0
    assert lowest >= min(degrees, -60) * A_DEGREE
    assert highest <= max(degrees, 60) * A_DEGREE


def test_every_heading_is_come_to_from_the_side_that_was_asked_for(board: PortableBoard) -> None:
    homed(board)
    choice = random.Random(4)
    for approach in Approach:
        board.ask(ConfigureTurntable(0, 0, 20_000, approach))
        for _ in range(5):
            angle = choice.randrange(-14_400, 14_401)
            way = [board.c.host_stands()]
            said = board.ask(Turn(angle * 50_000), 1000)
            while not any(isinstance(message, Finished) for message in said):
                said += [message for _, message in board.says(board.now + 2_000)]
                way.append(board.c.host_stands())
            assert way[-1] == angle
            last_change = next(a - b for a, b in zip(way[::-1], way[-2::-1], strict=False) if a != b)
            asked = {Approach.COUNTER_CLOCKWISE: 1, Approach.CLOCKWISE: -1}.get(approach, 0)
            assert last_change * asked >= 0


def test_a_mark_out_of_its_place_ends_what_runs_and_asks_for_a_home(board: PortableBoard) -> None:
    homed(board)
    board.c.host_grain(50)
    board.ask(Turn(-30_000_000), 2_000_000)
    board.c.host_stand(board.c.host_stands() - 64)
    finished = ended(board, StartScan(-30_000_000, 5_000_000, 12, 1, 1))
    assert finished.outcome == Outcome.LOST_STEPS
    assert "home" in finished.text
    statistics = next(m for m in board.ask(AskStatistics()) if isinstance(m, Statistics))
    assert abs(statistics.lost_steps) == 64
    refused = next(m for m in board.ask(Turn(0)) if isinstance(m, Refused))
    assert refused.code == Refusal.NOT_HOMED
    assert ended(board, Home()).outcome == Outcome.DONE
    assert board.c.host_stands() == 0


@pytest.mark.parametrize("approach", Approach)
@pytest.mark.parametrize("start", [-30, 20, 350])
def test_a_mark_that_does_not_come_ends_what_runs_too(board: PortableBoard, start: int, approach: Approach) -> None:
    homed(board)
    board.ask(ConfigureTurntable(0, 0, 20_000, approach))
    assert ended(board, Turn(start * 1_000_000)).outcome == Outcome.DONE
    board.c.host_motor(SLIPPING)
    mark = 360 if start > 0 else 0
    assert ended(board, Turn(mark * 1_000_000 - 5_000_000)).outcome == Outcome.DONE
    # it stands on the very place, and the next move does not begin anew to wait for the mark
    assert ended(board, Turn(mark * 1_000_000)).outcome == Outcome.DONE
    assert ended(board, Turn(mark * 1_000_000 + 6_000_000)).outcome == Outcome.LOST_STEPS
    statistics = next(m for m in board.ask(AskStatistics()) if isinstance(m, Statistics))
    assert statistics.lost_steps != 0
    board.c.host_motor(RAMPED)
    assert ended(board, Home()).outcome == Outcome.DONE


def test_turning_to_and_fro_over_the_mark_is_no_lost_step(board: PortableBoard) -> None:
    homed(board)
    choice = random.Random(8)
    for approach in Approach:
        board.ask(ConfigureTurntable(0, 0, 1000, approach))
        for _ in range(12):
            turn = choice.choice([-360, 0, 360]) * 1_000_000
            assert ended(board, Turn(turn + choice.randrange(-7_000_000, 7_000_000))).outcome == Outcome.DONE


def test_an_angle_between_two_microsteps_is_told_as_the_nearest(board: PortableBoard) -> None:
    homed(board)
    assert ended(board, Turn(10_030_000)).outcome == Outcome.DONE
    assert board.c.host_stands() == 201
    assert ended(board, Turn(-10_020_000)).outcome == Outcome.DONE
    assert board.c.host_stands() == -200


@pytest.mark.parametrize(("asked", "granted"), [(90_000_000, 90_000_000), (0, 180_000_000), (999_000_000, 180_000_000)])
def test_a_turn_takes_as_long_as_the_speed_says(board: PortableBoard, asked: int, granted: int) -> None:
    homed(board)
    (settings,) = board.ask(ConfigureTurntable(asked, 0, 0, Approach.EITHER))
    assert settings.speed == granted  # type: ignore[attr-defined]
    began = board.now
    board.ask(Turn(180_000_000), 1000)
    while board.c.host_stands() < 180 * A_DEGREE:
        board.says(board.now + 1_000)
    expected = 180_000_000 / granted + granted / 4_000_000_000  # constant speed, and a ramp at each end
    assert (board.now - began) / 1e6 == pytest.approx(expected, rel=0.02)
