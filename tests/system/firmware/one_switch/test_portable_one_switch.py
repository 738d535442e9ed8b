"""Homing by the mark alone on the portable part: from any angle, with wrong wires, and never far with the cable."""

import itertools

import pytest

from sonarhw.wire.messages import (
    AskCapabilities,
    AskStatistics,
    Capabilities,
    ConfigureWiring,
    Feature,
    Heartbeat,
    Hello,
    Home,
    Message,
    Outcome,
    Refusal,
    Refused,
    SetZero,
    StartScan,
    Statistics,
    Stop,
    Turn,
    Wiring,
)
from tests.fixtures.portable_board import RAMPED, SLIPPING, PortableBoard
from tests.system.firmware.test_portable_turntable import (
    A_DEGREE,
    CAM_INVERTED,
    CAM_OPEN,
    MARK_INVERTED,
    MARK_OPEN,
    MOTOR_REVERSED,
)

DIRECTION_OPEN = 32  # enum host_wiring
UNPROVEN = 60  # degrees on each side; limit of one Home with wiring that has never worked
SLOWING = 6  # degrees beyond a limit: the table slows down, and passes the edge of the mark
NO_MARK = "the zero mark never came; check its wire and the motor; begin within 45 degrees of 0; mark "
WRONG_WAY = "moved the wrong way; invert the mark or the motor; begin within 45 degrees of 0; mark "
LIMIT = "homing may wind the cable no further; unwind it by hand and restart the board; mark "


def one_switch(board: PortableBoard, degrees: float, faults: int = 0) -> None:
    """Put the table there by hand, and choose one switch."""
    board.c.host_grain(200)
    board.c.host_set_position(round(degrees * A_DEGREE))
    board.c.host_wiring(faults)
    board.ask(Hello(1, 0))
    board.ask(ConfigureWiring(Wiring.ONE_SWITCH, Wiring.ONE_SWITCH))


def capabilities_of(board: PortableBoard) -> Capabilities:
    (answer,) = [message for message in board.ask(AskCapabilities()) if isinstance(message, Capabilities)]
    return answer


@pytest.mark.parametrize("degrees", range(-45, 46, 5))
def test_a_table_near_zero_homes_by_the_mark(board: PortableBoard, degrees: int) -> None:
    one_switch(board, degrees, CAM_OPEN)
    finished, travel = board.watch(Home())
    assert finished.outcome == Outcome.DONE
    assert board.angle == 0
    assert min(travel) >= min(degrees, -1) - SLOWING
    assert max(travel) <= max(degrees, 1) + SLOWING


@pytest.mark.parametrize("degrees", [-177, -176, -140, -90, -46, -5, -1, -0.05, 0, 0.05, 1, 5, 46, 90, 140, 176, 177])
def test_a_table_homes_from_its_whole_range_after_a_power_failure(board: PortableBoard, degrees: float) -> None:
    one_switch(board, 10, CAM_INVERTED)
    assert board.finish(Home()).outcome == Outcome.DONE
    for _ in range(3):
        board.c.host_restart()
        board.c.host_set_position(round(degrees * A_DEGREE))
        board.ask(Hello(1, 0))
        finished, travel = board.watch(Home())
        assert finished.outcome == Outcome.DONE
        assert board.angle == 0
        assert min(travel) >= min(degrees, 0) - SLOWING
        assert max(travel) <= max(degrees, 0) + SLOWING


@pytest.mark.parametrize("degrees", [-170, -90, 5, 90, 170])
def test_a_second_home_is_fast_and_passes_zero_by_a_few_degrees(board: PortableBoard, degrees: int) -> None:
    one_switch(board, 10)
    assert board.finish(Home()).outcome == Outcome.DONE
    assert board.finish(Turn(degrees * 1_000_000)).outcome == Outcome.DONE
    began = board.now
    finished, travel = board.watch(Home())
    assert finished.outcome == Outcome.DONE
    assert board.angle == 0
    assert board.now - began < 3_000_000
    assert max(-min(travel) + min(degrees, 0), max(travel) - max(degrees, 0)) <= 35


FAULTS = [
    (MARK_OPEN, NO_MARK),
    (MARK_INVERTED, WRONG_WAY),
    (MOTOR_REVERSED, WRONG_WAY),
]


@pytest.mark.parametrize("degrees", [-45, -20, 1, 20, 45])
@pytest.mark.parametrize(("faults", "text"), FAULTS)
def test_a_wrong_wire_is_named_and_the_table_returns(
    board: PortableBoard, degrees: int, faults: int, text: str
) -> None:
    one_switch(board, degrees, faults)
    for _ in range(3):
        finished, travel = board.watch(Home())
        assert finished.outcome == Outcome.FAULT
        assert finished.text.startswith(text)
        assert finished.text.endswith(("mark 0", "mark 1"))
        assert board.angle == degrees
        assert min(travel) >= degrees - UNPROVEN - SLOWING
        assert max(travel) <= degrees + UNPROVEN + SLOWING
    finished, travel = board.watch(Home())
    assert finished.text.startswith(LIMIT)
    assert {*travel} == {degrees}


@pytest.mark.parametrize("degrees", [-400, -185, -170, -100, 61, 100, 170, 185])
@pytest.mark.parametrize("faults", [0, MARK_OPEN, MARK_INVERTED, MOTOR_REVERSED, DIRECTION_OPEN])
def test_from_elsewhere_the_table_stays_near_or_finds_the_mark_beside_it(
    board: PortableBoard, degrees: int, faults: int
) -> None:
    one_switch(board, degrees, faults)
    travel = [float(degrees)]
    for k in range(8):
        if board.watch(Home())[0].outcome == Outcome.DONE:
            assert abs(board.angle - degrees) <= UNPROVEN + SLOWING
            return
        travel.append(board.angle)
        board.ask(ConfigureWiring(7, k % 8))
    if faults == DIRECTION_OPEN:
        assert max(travel) <= degrees + 3 * 4 * UNPROVEN
    else:
        assert {*travel} == {degrees}


@pytest.mark.parametrize("faults", [MARK_OPEN, MARK_INVERTED, MOTOR_REVERSED])
def test_failed_homes_between_restarts_do_not_add_up(board: PortableBoard, faults: int) -> None:
    one_switch(board, 30)
    assert board.finish(Home()).outcome == Outcome.DONE
    assert board.finish(Turn(40_000_000)).outcome == Outcome.DONE
    board.c.host_wiring(MARK_OPEN)  # after a Home that has succeeded
    for limit in (185, UNPROVEN, UNPROVEN, UNPROVEN):
        board.c.host_restart()
        board.c.host_wiring(faults if limit == UNPROVEN else MARK_OPEN)
        board.ask(Hello(1, 0))
        finished, travel = board.watch(Home())
        assert finished.outcome == Outcome.FAULT
        assert board.angle == 40
        assert min(travel) >= 40 - limit - SLOWING
        assert max(travel) <= 40 + UNPROVEN + SLOWING


def test_homes_that_are_stopped_wind_the_cable_no_further(board: PortableBoard) -> None:
    one_switch(board, 30, MARK_OPEN)
    for _ in range(9):
        board.ask(Home(), 1_200_000)
        board.ask(Stop(), 500_000)
    assert abs(board.angle - 30) <= 3 * UNPROVEN


@pytest.mark.parametrize(("faults", "settings"), [(MARK_INVERTED, Wiring.MARK), (MOTOR_REVERSED, Wiring.MOTOR)])
@pytest.mark.parametrize("degrees", [-40, 40])
def test_the_named_setting_corrects_a_wire_and_outlasts_a_restart(
    board: PortableBoard, degrees: int, faults: int, settings: Wiring
) -> None:
    one_switch(board, degrees, faults)
    assert board.finish(Home(), 15_000_000).text.startswith(WRONG_WAY)
    board.ask(ConfigureWiring(settings, settings))
    for _ in range(2):
        assert board.finish(Home(), 15_000_000).outcome == Outcome.DONE
        assert board.angle == 0
        assert board.finish(Turn(-150_000_000)).outcome == Outcome.DONE
        assert board.angle == -150
        board.c.host_restart()
        board.ask(Hello(1, 0))
    (answer,) = board.ask(ConfigureWiring(0, 0))
    assert answer.inverted == settings | Wiring.ONE_SWITCH  # type: ignore[attr-defined]


def test_mark_and_motor_inverted_home_at_zero_and_turn_the_other_way(board: PortableBoard) -> None:
    one_switch(board, 20, MARK_INVERTED | MOTOR_REVERSED)
    assert board.finish(Home(), 15_000_000).outcome == Outcome.DONE
    assert board.angle == pytest.approx(0, abs=0.1)
    assert board.finish(Turn(50_000_000)).outcome == Outcome.DONE
    assert board.angle == pytest.approx(-50, abs=0.1)


def test_the_reach_is_less_than_half_a_turn_and_told(board: PortableBoard) -> None:
    board.ask(Hello(1, 0))
    assert (capabilities_of(board).highest_angle, capabilities_of(board).features & Feature.ONE_SWITCH) == (
        720_000_000,
        0,
    )
    one_switch(board, 0.5)
    able = capabilities_of(board)
    assert (able.lowest_angle, able.highest_angle) == (-175_000_000, 175_000_000)
    assert able.features & Feature.ONE_SWITCH
    assert board.finish(Home()).outcome == Outcome.DONE
    for beyond in (-175_000_001, 175_000_001):
        refused = next(m for m in board.ask(Turn(beyond)) if isinstance(m, Refused))
        assert refused.code == Refusal.OUT_OF_RANGE
        assert refused.text.endswith("the cable winds from -175 to 175 degrees")
    board.ask(ConfigureWiring(Wiring.ONE_SWITCH, 0))
    assert capabilities_of(board).highest_angle == 720_000_000


def test_a_scan_of_the_whole_reach_loses_no_steps_and_stays_within_half_a_turn(board: PortableBoard) -> None:
    one_switch(board, -20)
    assert board.finish(Home()).outcome == Outcome.DONE
    finished, travel = board.watch(StartScan(-175_000_000, 10_000_000, 36, 2, 1))
    assert (finished.outcome, finished.readings) == (Outcome.DONE, 72)
    assert min(travel) >= -177
    assert max(travel) <= 175


@pytest.mark.parametrize(("slip", "to"), [(-64, 30), (64, 30), (3000, -20), (-3000, 20), (3000, 30)])
def test_lost_steps_are_detected_and_the_next_home_is_short(board: PortableBoard, slip: int, to: int) -> None:
    one_switch(board, 0.5)
    assert board.finish(Home()).outcome == Outcome.DONE
    assert board.finish(Turn(-30_000_000 if to > 0 else 30_000_000)).outcome == Outcome.DONE
    board.c.host_set_position(board.c.host_position() + slip)
    finished = board.finish(Turn(to * 1_000_000))
    assert finished.outcome == Outcome.LOST_STEPS
    assert finished.text.endswith("send Home; begin within 45 degrees of 0")
    statistics = next(m for m in board.ask(AskStatistics()) if isinstance(m, Statistics))
    assert 0 < abs(statistics.lost_steps) <= abs(slip)
    before = board.angle
    finished, travel = board.watch(Home())
    if abs(slip) == 64:
        assert finished.outcome == Outcome.DONE
        assert board.angle == 0
    assert min(travel) >= before - UNPROVEN - SLOWING
    assert max(travel) <= before + UNPROVEN + SLOWING


@pytest.mark.parametrize("stuck", [170, -170])
def test_a_table_that_was_stuck_far_from_zero_is_not_wound_by_a_turn(board: PortableBoard, stuck: int) -> None:
    one_switch(board, 0.5)
    assert board.finish(Home()).outcome == Outcome.DONE
    assert board.finish(Turn(stuck * 1_000_000)).outcome == Outcome.DONE
    board.c.host_motor(SLIPPING)
    assert board.finish(Turn(stuck // 10 * 1_000_000)).outcome == Outcome.DONE
    board.c.host_motor(RAMPED)
    assert board.finish(Turn(stuck * 1_000_000)).outcome == Outcome.LOST_STEPS
    for _ in range(3):
        assert board.finish(Home(), 15_000_000).outcome == Outcome.FAULT
        assert abs(board.angle) < 190
        board.c.host_restart()
        board.ask(Hello(1, 0))


def test_a_table_that_turns_in_one_direction_only_loses_steps_at_once(board: PortableBoard) -> None:
    one_switch(board, 0.5)
    assert board.finish(Home()).outcome == Outcome.DONE
    board.c.host_wiring(DIRECTION_OPEN)
    assert board.finish(Turn(-90_000_000)).outcome == Outcome.LOST_STEPS
    assert abs(board.angle) < 15
    for k in range(8):
        board.finish(Home(), 15_000_000)
        board.ask(ConfigureWiring(7, k % 8))
    assert board.angle < 720


@pytest.mark.parametrize("degrees", [100, -100])
def test_after_a_zero_by_hand_a_home_is_short_also_after_a_restart(board: PortableBoard, degrees: int) -> None:
    one_switch(board, 0.5)
    assert board.finish(Home()).outcome == Outcome.DONE
    assert board.finish(Turn(degrees * 1_000_000)).outcome == Outcome.DONE
    board.ask(SetZero())
    assert board.finish(Turn(degrees * 1_000_000)).outcome == Outcome.DONE
    board.c.host_restart()
    board.ask(Hello(1, 0))
    finished, travel = board.watch(Home())
    assert finished.outcome == Outcome.FAULT
    assert board.angle == 2 * degrees
    assert min(travel) >= 2 * degrees - UNPROVEN - SLOWING
    assert max(travel) <= 2 * degrees + UNPROVEN + SLOWING


def test_jogs_of_a_table_without_a_zero_are_limited_to_a_turn(board: PortableBoard) -> None:
    one_switch(board, 0)
    jogs = itertools.takewhile(
        lambda _: not any(isinstance(m, Refused) for m in board.ask(Turn(10_000_000, relative=1), 500_000)),
        itertools.count(),
    )
    assert len([*jogs]) * 10 == pytest.approx(360, abs=10)


def test_a_change_to_one_switch_makes_the_zero_unknown(board: PortableBoard) -> None:
    board.c.host_grain(200)
    board.ask(Hello(1, 0))
    assert board.finish(Home()).outcome == Outcome.DONE
    assert board.finish(Turn(300_000_000)).outcome == Outcome.DONE
    board.ask(ConfigureWiring(Wiring.ONE_SWITCH, Wiring.ONE_SWITCH))
    beats: list[Message] = [m for m in board.ask(AskStatistics(), 260_000) if isinstance(m, Heartbeat)]
    assert beats[-1].homed == 0  # type: ignore[attr-defined]
    board.finish(Home(), 15_000_000)
    assert abs(board.angle - 300) <= UNPROVEN + SLOWING
