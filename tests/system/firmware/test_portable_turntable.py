"""Turntable of the portable part: homing with two switches and with one, approach, cable limits and lost steps."""

import random

import pytest

from sonarhw.wire import messages as msg
from tests.fixtures.portable_board import MICROSTEPS, RAMPED, SLIPPING, PortableBoard

A_DEGREE = MICROSTEPS // 360
CAM_INVERTED, CAM_OPEN, MOTOR_REVERSED, MARK_OPEN, MARK_INVERTED = 1, 2, 4, 8, 16  # enum host_wiring


def put(board: PortableBoard, degrees: float = 0, wiring: int = 0, grain: int = 200) -> None:
    """Put the table there by hand, with this wiring, and greet the board."""
    board.c.host_grain(grain)
    board.c.host_set_position(round(degrees * A_DEGREE))
    board.c.host_wiring(wiring)
    board.ask(msg.Hello(1, 0))


def restart(board: PortableBoard) -> None:
    """Restart the board, and greet it."""
    board.c.host_restart()
    board.ask(msg.Hello(1, 0))


def carry_out(board: PortableBoard, *actions: msg.Message, within: int = 10_000_000) -> None:
    """Send actions one after another, and assert that each is done."""
    assert [board.finish(action, within).outcome for action in actions] == [msg.Outcome.DONE] * len(actions)


def home_board(board: PortableBoard) -> None:
    put(board, grain=50)
    carry_out(board, msg.Home())


def refusal(board: PortableBoard, action: msg.Message) -> msg.Refused:
    """Send an action that is refused, and return the answer."""
    return next(message for message in board.ask(action) if isinstance(message, msg.Refused))


def lost_steps(board: PortableBoard) -> int:
    return next(message.lost_steps for message in board.ask(msg.AskStatistics()) if isinstance(message, msg.Statistics))


def assert_within(travel: list[float], lowest: float, highest: float, beyond: float = 0.0) -> None:
    """Assert that a table stays between two angles, and at most so far `beyond`, degrees."""
    assert lowest - beyond <= min(travel) <= max(travel) <= highest + beyond


STARTS = [-719, -361, -200, -181, -30, -20, -10, -1, 0, 1, 90, 179, 180, 181, 360, 500, 719]
UNPROVEN = 400  # degrees; limit of one Home with wiring that has never worked
CAM = "the cam never changed; check its wire and polarity, and the direction; "
MARK = "the zero mark never came; check its wire and the motor; "


def assert_homes(board: PortableBoard, degrees: int, within: int) -> None:
    """Home from `degrees`, and assert duration (µs) and limits of the cable."""
    board.c.host_set_position(degrees * A_DEGREE)
    _, angles = board.watch(msg.Home(), within)
    assert angles[-1] == 0
    assert_within(angles, min(degrees, -60), max(degrees, 60))


@pytest.mark.parametrize("degrees", STARTS)
def test_home_finds_zero_from_any_angle_and_keeps_the_cable_limits(board: PortableBoard, degrees: int) -> None:
    home_board(board)
    board.c.host_restart()
    put(board, grain=50)
    assert_homes(board, degrees, 20_000_000)
    # the first Home crawls; the following ones take at most 3 s
    assert_homes(board, degrees, 3_000_000)


def test_a_table_far_from_zero_needs_a_second_home_until_its_wiring_has_worked(board: PortableBoard) -> None:
    put(board, 719)
    assert CAM in board.finish(msg.Home(), 40_000_000).text
    carry_out(board, msg.Home(), within=40_000_000)
    assert board.c.host_position() == 0
    board.c.host_restart()
    board.c.host_set_position(719 * A_DEGREE)
    board.ask(msg.Hello(1, 0))
    carry_out(board, msg.Home(), within=40_000_000)


@pytest.mark.parametrize("degrees", [-300, 99])
@pytest.mark.parametrize(
    ("wiring", "text"),
    [
        (CAM_INVERTED, CAM),
        (CAM_OPEN, CAM),
        (MOTOR_REVERSED, CAM),
        (MARK_OPEN, MARK),
        (MARK_INVERTED, "moved the wrong way; invert the mark, or cam and motor; "),
        (CAM_INVERTED | MOTOR_REVERSED, "moved the wrong way; invert the mark, or cam and motor; "),
        (CAM_INVERTED | MOTOR_REVERSED | MARK_INVERTED, "moved the wrong way; invert the mark, or cam and motor; "),
    ],
)
def test_a_wrong_wire_is_named_by_every_home(board: PortableBoard, degrees: int, wiring: int, text: str) -> None:
    put(board, degrees, wiring)
    finished, positions = board.watch(msg.Home())
    assert finished.outcome == msg.Outcome.FAULT
    assert text in finished.text
    assert max(abs(position - degrees) for position in positions) <= UNPROVEN + 1
    if wiring & (MARK_OPEN | MARK_INVERTED):
        # a mark that is high at the edge of the cam is refused there: no crawl back to the mark
        assert max(positions[positions.index(min(positions)) :]) < -15
    for _ in range(4):
        assert board.finish(msg.Home(), 40_000_000).outcome == msg.Outcome.FAULT
        assert abs(board.c.host_position() / A_DEGREE - degrees) <= 751


@pytest.mark.parametrize("degrees", [-600, 500])
def test_a_mark_that_opens_after_a_home_ends_the_next_one(board: PortableBoard, degrees: int) -> None:
    home_board(board)
    put(board, degrees, MARK_OPEN)
    finished, positions = board.watch(msg.Home(), 40_000_000)
    assert MARK in finished.text
    assert 199 < max(abs(position - degrees) for position in positions) < 230  # it slows down within 26 degrees


def test_pings_in_place_switch_no_motor_on_also_after_a_failed_home(board: PortableBoard) -> None:
    board.c.host_grain(200)
    board.ask(msg.Hello(1, 2))
    in_place = msg.StartScan(0, 1, 1, 2, 1, in_place=1)
    carry_out(board, in_place, within=500_000)
    assert not board.c.host_powered()
    board.c.host_wiring(MARK_OPEN)
    board.ask(msg.Hello(1, 0))
    assert board.finish(msg.Home(), 40_000_000).outcome == msg.Outcome.FAULT
    position = board.c.host_position()
    carry_out(board, in_place, within=500_000)
    assert board.c.host_position() == position


def test_a_zero_set_by_hand_needs_no_mark(board: PortableBoard) -> None:
    put(board, 100, MARK_OPEN | CAM_OPEN, grain=50)
    board.ask(msg.SetZero())
    assert not board.c.host_powered()
    carry_out(board, msg.Turn(400_000_000))
    assert board.c.host_position() == 500 * A_DEGREE
    assert refusal(board, msg.Turn(721_000_000)).code == msg.Refusal.OUT_OF_RANGE


@pytest.mark.parametrize("degrees", [-300, 99])
@pytest.mark.parametrize(
    ("faults", "settings"),
    [
        (CAM_INVERTED, msg.Wiring.CAM),
        (MOTOR_REVERSED, msg.Wiring.MOTOR),
        (MARK_INVERTED, msg.Wiring.MARK),
        (CAM_INVERTED | MOTOR_REVERSED | MARK_INVERTED, msg.Wiring.CAM | msg.Wiring.MOTOR | msg.Wiring.MARK),
    ],
)
def test_settings_correct_inverted_wires(board: PortableBoard, degrees: int, faults: int, settings: msg.Wiring) -> None:
    put(board, degrees, faults)
    (answer,) = board.ask(msg.ConfigureWiring(settings, settings))
    assert answer == msg.WiringSettings(answer.command, settings)  # type: ignore[attr-defined]
    for _ in range(2):
        carry_out(board, msg.Home(), within=40_000_000)
        assert board.c.host_position() == 0
        carry_out(board, msg.Turn(50_000_000), within=40_000_000)
        assert board.c.host_position() == 50 * A_DEGREE
        restart(board)
    (answer,) = board.ask(msg.ConfigureWiring(0, 0))
    assert answer.inverted == settings  # type: ignore[attr-defined]


def test_a_change_of_the_wiring_makes_the_zero_unknown_and_the_next_home_crawl(board: PortableBoard) -> None:
    home_board(board)
    board.ask(msg.ConfigureWiring(msg.Wiring.MARK, 0))
    assert refusal(board, msg.Turn(0)).code == msg.Refusal.NOT_HOMED
    board.c.host_set_position(99 * A_DEGREE)
    board.ask(msg.Home(), 1_000_000)
    assert 99 - board.c.host_position() / A_DEGREE == pytest.approx(45, abs=2)


@pytest.mark.parametrize(
    ("wiring", "most"), [(0, 750), (msg.Wiring.ONE_SWITCH, 360)], ids=["two switches", "one switch"]
)
def test_repeated_jogs_wind_the_cable_no_further_than_a_home(board: PortableBoard, wiring: int, most: int) -> None:
    put(board)
    board.ask(msg.ConfigureWiring(wiring, wiring))
    jogs = 0
    while not any(isinstance(m, msg.Refused) for m in board.ask(msg.Turn(10_000_000, relative=1), 500_000)):
        jogs += 1
    assert jogs * 10 == pytest.approx(most, abs=10)


def test_a_limit_of_homing_is_named(board: PortableBoard) -> None:
    put(board, wiring=CAM_OPEN)
    for _ in range(2):
        assert CAM in board.finish(msg.Home(), 40_000_000).text
    finished = board.finish(msg.Home(), 1_000_000)
    assert "homing may wind the cable no further" in finished.text
    assert finished.text.endswith("; mark 0, cam 1")


def test_homes_with_changing_settings_wind_the_cable_no_further(board: PortableBoard) -> None:
    put(board, wiring=CAM_OPEN)
    both = msg.Wiring.CAM | msg.Wiring.MOTOR
    for k in range(4):
        board.finish(msg.Home(), 40_000_000)
        board.ask(msg.ConfigureWiring(both, both if k % 2 == 0 else 0))
        assert abs(board.c.host_position()) <= 760 * A_DEGREE


def test_stop_is_answered_while_the_table_slows_down_and_the_next_turn_begins_at_rest(board: PortableBoard) -> None:
    home_board(board)
    board.ask(msg.Turn(180_000_000), 300_000)
    answers, stopped_at = board.ask(msg.Stop()), board.c.host_position()
    assert [type(answer) for answer in answers] == [msg.Finished, msg.Accepted]
    board.ask(msg.Turn(0), 50_000)
    assert board.c.host_position() > stopped_at
    board.frames_until(board.now + 3_000_000)
    assert board.c.host_position() == 0


def test_every_heading_is_approached_in_the_requested_direction(board: PortableBoard) -> None:
    home_board(board)
    choice = random.Random(4)
    for approach in msg.Approach:
        board.ask(msg.ConfigureTurntable(0, 0, 20_000, approach))
        for _ in range(5):
            angle = choice.randrange(-14_400, 14_401)
            _, path = board.watch(msg.Turn(angle * 50_000))
            assert path[-1] == pytest.approx(angle / A_DEGREE)
            last_change = next(a - b for a, b in zip(path[::-1], path[-2::-1], strict=False) if a != b)
            requested = {msg.Approach.COUNTER_CLOCKWISE: 1, msg.Approach.CLOCKWISE: -1}.get(approach, 0)
            assert last_change * requested >= 0


@pytest.mark.parametrize("steps", [64, 9, 8, -8, -9])  # up to 8 are the tolerance of the edge of the mark
def test_a_displaced_mark_ends_a_scan_with_lost_steps_and_requires_homing(board: PortableBoard, steps: int) -> None:
    home_board(board)
    board.c.host_grain(50)
    board.ask(msg.Turn(-30_000_000), 2_000_000)
    board.c.host_set_position(board.c.host_position() - steps)
    finished = board.finish(msg.StartScan(-30_000_000, 5_000_000, 12, 1, 1))
    if abs(steps) <= 8:
        assert (finished.outcome, lost_steps(board)) == (msg.Outcome.DONE, 0)
        return
    assert finished.outcome == msg.Outcome.LOST_STEPS
    assert "Home" in finished.text
    assert lost_steps(board) == steps
    assert refusal(board, msg.Turn(0)).code == msg.Refusal.NOT_HOMED
    carry_out(board, msg.Home())
    assert board.c.host_position() == 0


@pytest.mark.parametrize("approach", msg.Approach)
@pytest.mark.parametrize("start", [-30, 20, 350])
def test_a_missing_mark_ends_a_turn_with_lost_steps(board: PortableBoard, start: int, approach: msg.Approach) -> None:
    home_board(board)
    board.ask(msg.ConfigureTurntable(0, 0, 20_000, approach))
    carry_out(board, msg.Turn(start * 1_000_000))
    board.c.host_motor(SLIPPING)
    mark = 360 if start > 0 else 0
    carry_out(board, msg.Turn(mark * 1_000_000 - 5_000_000))
    # at the position of the mark, and the next movement does not reset the search for it
    carry_out(board, msg.Turn(mark * 1_000_000))
    assert board.finish(msg.Turn(mark * 1_000_000 + 6_000_000)).outcome == msg.Outcome.LOST_STEPS
    assert lost_steps(board) != 0
    board.c.host_motor(RAMPED)
    carry_out(board, msg.Home())


@pytest.mark.parametrize("then", [10, -1])
@pytest.mark.parametrize("approach", msg.Approach)
def test_a_mark_that_passes_while_settling_counts(board: PortableBoard, approach: msg.Approach, then: int) -> None:
    home_board(board)
    carry_out(board, msg.Turn(-30_000_000))
    board.c.host_set_position(board.c.host_position() - 2)  # the zero is two steps off
    carry_out(board, msg.Turn(0))
    board.c.host_set_position(0)  # the table lags behind the last step
    board.ask(msg.ConfigureTurntable(0, 0, 20_000, approach))
    carry_out(board, msg.Turn(then * 1_000_000), msg.Turn(40_000_000))
    # the next mark is not missed either
    board.c.host_motor(SLIPPING)
    assert board.finish(msg.Turn(370_000_000)).outcome == msg.Outcome.LOST_STEPS


def test_turning_back_and_forth_over_the_mark_reports_no_lost_steps(board: PortableBoard) -> None:
    home_board(board)
    choice = random.Random(8)
    for approach in msg.Approach:
        board.ask(msg.ConfigureTurntable(0, 0, 1000, approach))
        for _ in range(12):
            turn = choice.choice([-360, 0, 360]) * 1_000_000
            carry_out(board, msg.Turn(turn + choice.randrange(-7_000_000, 7_000_000)))


@pytest.mark.parametrize(
    ("requested", "actual"), [(90_000_000, 90_000_000), (0, 180_000_000), (999_000_000, 180_000_000)]
)
def test_the_duration_of_a_turn_matches_its_speed(board: PortableBoard, requested: int, actual: int) -> None:
    home_board(board)
    (settings,) = board.ask(msg.ConfigureTurntable(requested, 0, 0, msg.Approach.EITHER))
    assert settings.speed == actual  # type: ignore[attr-defined]
    began = board.now
    board.ask(msg.Turn(180_000_000), 1000)
    while board.c.host_position() < 180 * A_DEGREE:
        board.frames_until(board.now + 1_000)
    expected = 180_000_000 / actual + actual / 4_000_000_000  # constant speed, and a ramp at each end
    assert (board.now - began) / 1e6 == pytest.approx(expected, rel=0.02)


# homing by the mark alone


DIRECTION_OPEN = 32  # enum host_wiring
MARK_WITHIN = 60  # degrees on each side; limit of one Home with wiring that has never worked
SLOWING = 6  # degrees beyond a limit: the table slows down, and passes the edge of the mark
NO_MARK = "the zero mark never came; check its wire and the motor; begin within 45 degrees of 0; mark "
WRONG_WAY = "moved the wrong way; invert the mark or the motor; begin within 45 degrees of 0; mark "
LIMIT = "homing may wind the cable no further; unwind it by hand and restart the board; mark "


def one_switch(board: PortableBoard, degrees: float, faults: int = 0) -> None:
    """Put the table there by hand, and choose one switch."""
    put(board, degrees, faults)
    board.ask(msg.ConfigureWiring(msg.Wiring.ONE_SWITCH, msg.Wiring.ONE_SWITCH))


def capabilities_of(board: PortableBoard) -> msg.Capabilities:
    (answer,) = [message for message in board.ask(msg.AskCapabilities()) if isinstance(message, msg.Capabilities)]
    return answer


@pytest.mark.parametrize("degrees", range(-45, 46, 5))
def test_a_table_near_zero_homes_by_the_mark(board: PortableBoard, degrees: int) -> None:
    one_switch(board, degrees, CAM_OPEN)
    finished, travel = board.watch(msg.Home())
    assert finished.outcome == msg.Outcome.DONE
    assert board.angle == 0
    assert_within(travel, min(degrees, -1), max(degrees, 1), SLOWING)


@pytest.mark.parametrize("degrees", [-177, -176, -140, -90, -46, -5, -1, -0.05, 0, 0.05, 1, 5, 46, 90, 140, 176, 177])
def test_a_table_homes_from_its_whole_range_after_a_power_failure(board: PortableBoard, degrees: float) -> None:
    one_switch(board, 10, CAM_INVERTED)
    carry_out(board, msg.Home())
    for _ in range(3):
        board.c.host_restart()
        board.c.host_set_position(round(degrees * A_DEGREE))
        board.ask(msg.Hello(1, 0))
        finished, travel = board.watch(msg.Home())
        assert finished.outcome == msg.Outcome.DONE
        assert board.angle == 0
        assert_within(travel, min(degrees, 0), max(degrees, 0), SLOWING)


@pytest.mark.parametrize("degrees", [-170, -90, 5, 90, 170])
def test_a_second_home_is_fast_and_passes_zero_by_a_few_degrees(board: PortableBoard, degrees: int) -> None:
    one_switch(board, 10)
    carry_out(board, msg.Home(), msg.Turn(degrees * 1_000_000))
    began = board.now
    finished, travel = board.watch(msg.Home())
    assert finished.outcome == msg.Outcome.DONE
    assert board.angle == 0
    assert board.now - began < 3_000_000
    assert max(-min(travel) + min(degrees, 0), max(travel) - max(degrees, 0)) <= 35


FAULTS = [(MARK_OPEN, NO_MARK), (MARK_INVERTED, WRONG_WAY), (MOTOR_REVERSED, WRONG_WAY)]


@pytest.mark.parametrize("degrees", [-45, -20, 1, 20, 45])
@pytest.mark.parametrize(("faults", "text"), FAULTS)
def test_a_wrong_wire_is_named(board: PortableBoard, degrees: int, faults: int, text: str) -> None:
    one_switch(board, degrees, faults)
    for _ in range(3):
        finished, travel = board.watch(msg.Home())
        assert finished.outcome == msg.Outcome.FAULT
        assert finished.text.startswith(text)
        assert finished.text.endswith(("mark 0", "mark 1"))
        assert board.angle == degrees
        assert_within(travel, degrees, degrees, MARK_WITHIN + SLOWING)
    finished, travel = board.watch(msg.Home())
    assert finished.text.startswith(LIMIT)
    assert {*travel} == {degrees}


@pytest.mark.parametrize("degrees", [-400, -185, -170, -100, 61, 100, 170, 185])
@pytest.mark.parametrize("faults", [0, MARK_OPEN, MARK_INVERTED, MOTOR_REVERSED, DIRECTION_OPEN])
def test_from_elsewhere_the_table_stays_near_the_mark(board: PortableBoard, degrees: int, faults: int) -> None:
    one_switch(board, degrees, faults)
    travel = [float(degrees)]
    for k in range(8):
        if board.watch(msg.Home())[0].outcome == msg.Outcome.DONE:
            assert abs(board.angle - degrees) <= MARK_WITHIN + SLOWING
            return
        travel.append(board.angle)
        board.ask(msg.ConfigureWiring(7, k % 8))
    if faults == DIRECTION_OPEN:
        assert max(travel) <= degrees + 3 * 4 * MARK_WITHIN
    else:
        assert {*travel} == {degrees}


@pytest.mark.parametrize("faults", [MARK_OPEN, MARK_INVERTED, MOTOR_REVERSED])
def test_failed_homes_between_restarts_do_not_add_up(board: PortableBoard, faults: int) -> None:
    one_switch(board, 30)
    carry_out(board, msg.Home(), msg.Turn(40_000_000))
    board.c.host_wiring(MARK_OPEN)  # after a Home that has succeeded
    for limit in (185, MARK_WITHIN, MARK_WITHIN, MARK_WITHIN):
        board.c.host_restart()
        board.c.host_wiring(faults if limit == MARK_WITHIN else MARK_OPEN)
        board.ask(msg.Hello(1, 0))
        finished, travel = board.watch(msg.Home())
        assert finished.outcome == msg.Outcome.FAULT
        assert board.angle == 40
        assert min(travel) >= 40 - limit - SLOWING
        assert max(travel) <= 40 + MARK_WITHIN + SLOWING


def test_homes_that_are_stopped_wind_the_cable_no_further(board: PortableBoard) -> None:
    one_switch(board, 30, MARK_OPEN)
    for _ in range(9):
        board.ask(msg.Home(), 1_200_000)
        board.ask(msg.Stop(), 500_000)
    assert abs(board.angle - 30) <= 3 * MARK_WITHIN


@pytest.mark.parametrize(("faults", "settings"), [(MARK_INVERTED, msg.Wiring.MARK), (MOTOR_REVERSED, msg.Wiring.MOTOR)])
@pytest.mark.parametrize("degrees", [-40, 40])
def test_the_named_setting_corrects_it(board: PortableBoard, degrees: int, faults: int, settings: msg.Wiring) -> None:
    one_switch(board, degrees, faults)
    assert board.finish(msg.Home(), 15_000_000).text.startswith(WRONG_WAY)
    board.ask(msg.ConfigureWiring(settings, settings))
    for _ in range(2):
        carry_out(board, msg.Home(), within=15_000_000)
        assert board.angle == 0
        carry_out(board, msg.Turn(-150_000_000))
        assert board.angle == -150
        restart(board)
    (answer,) = board.ask(msg.ConfigureWiring(0, 0))
    assert answer.inverted == settings | msg.Wiring.ONE_SWITCH  # type: ignore[attr-defined]


def test_mark_and_motor_inverted_home_at_zero_and_turn_the_other_way(board: PortableBoard) -> None:
    one_switch(board, 20, MARK_INVERTED | MOTOR_REVERSED)
    carry_out(board, msg.Home(), within=15_000_000)
    assert board.angle == pytest.approx(0, abs=0.1)
    carry_out(board, msg.Turn(50_000_000))
    assert board.angle == pytest.approx(-50, abs=0.1)


def test_the_reach_is_less_than_half_a_turn_and_told(board: PortableBoard) -> None:
    board.ask(msg.Hello(1, 0))
    assert (capabilities_of(board).highest_angle, capabilities_of(board).features & msg.Feature.ONE_SWITCH) == (
        720_000_000,
        0,
    )
    one_switch(board, 0.5)
    able = capabilities_of(board)
    assert (able.lowest_angle, able.highest_angle) == (-175_000_000, 175_000_000)
    assert able.features & msg.Feature.ONE_SWITCH
    carry_out(board, msg.Home())
    for beyond in (-175_000_001, 175_000_001):
        refused = refusal(board, msg.Turn(beyond))
        assert refused.code == msg.Refusal.OUT_OF_RANGE
        assert refused.text.endswith("the cable winds from -175 to 175 degrees")
    board.ask(msg.ConfigureWiring(msg.Wiring.ONE_SWITCH, 0))
    assert capabilities_of(board).highest_angle == 720_000_000


def test_a_scan_of_the_whole_reach_loses_no_steps_and_stays_within_half_a_turn(board: PortableBoard) -> None:
    one_switch(board, -20)
    carry_out(board, msg.Home())
    finished, travel = board.watch(msg.StartScan(-175_000_000, 10_000_000, 36, 2, 1))
    assert (finished.outcome, finished.readings) == (msg.Outcome.DONE, 72)
    assert_within(travel, -177, 175)


@pytest.mark.parametrize(("slip", "to"), [(-64, 30), (64, 30), (3000, -20), (-3000, 20), (3000, 30)])
def test_lost_steps_are_detected_and_the_next_home_is_short(board: PortableBoard, slip: int, to: int) -> None:
    one_switch(board, 0.5)
    carry_out(board, msg.Home(), msg.Turn(-30_000_000 if to > 0 else 30_000_000))
    board.c.host_set_position(board.c.host_position() + slip)
    finished = board.finish(msg.Turn(to * 1_000_000))
    assert finished.outcome == msg.Outcome.LOST_STEPS
    assert finished.text.endswith("send Home; begin within 45 degrees of 0")
    assert 0 < abs(lost_steps(board)) <= abs(slip)
    before = board.angle
    finished, travel = board.watch(msg.Home())
    if abs(slip) == 64:
        assert finished.outcome == msg.Outcome.DONE
        assert board.angle == 0
    assert_within(travel, before, before, MARK_WITHIN + SLOWING)


@pytest.mark.parametrize("stuck", [170, -170])
def test_a_table_that_was_stuck_far_from_zero_is_not_wound_by_a_turn(board: PortableBoard, stuck: int) -> None:
    one_switch(board, 0.5)
    carry_out(board, msg.Home(), msg.Turn(stuck * 1_000_000))
    board.c.host_motor(SLIPPING)
    carry_out(board, msg.Turn(stuck // 10 * 1_000_000))
    board.c.host_motor(RAMPED)
    assert board.finish(msg.Turn(stuck * 1_000_000)).outcome == msg.Outcome.LOST_STEPS
    for _ in range(3):
        assert board.finish(msg.Home(), 15_000_000).outcome == msg.Outcome.FAULT
        assert abs(board.angle) < 190
        restart(board)


def test_a_table_that_turns_in_one_direction_only_loses_steps_at_once(board: PortableBoard) -> None:
    one_switch(board, 0.5)
    carry_out(board, msg.Home())
    board.c.host_wiring(DIRECTION_OPEN)
    assert board.finish(msg.Turn(-90_000_000)).outcome == msg.Outcome.LOST_STEPS
    assert abs(board.angle) < 15
    for k in range(8):
        board.finish(msg.Home(), 15_000_000)
        board.ask(msg.ConfigureWiring(7, k % 8))
    assert board.angle < 720


@pytest.mark.parametrize("degrees", [100, -100])
def test_after_a_zero_by_hand_a_home_is_short_also_after_a_restart(board: PortableBoard, degrees: int) -> None:
    one_switch(board, 0.5)
    carry_out(board, msg.Home(), msg.Turn(degrees * 1_000_000))
    board.ask(msg.SetZero())
    carry_out(board, msg.Turn(degrees * 1_000_000))
    restart(board)
    finished, travel = board.watch(msg.Home())
    assert finished.outcome == msg.Outcome.FAULT
    assert board.angle == 2 * degrees
    assert_within(travel, 2 * degrees, 2 * degrees, MARK_WITHIN + SLOWING)


def test_a_change_to_one_switch_makes_the_zero_unknown(board: PortableBoard) -> None:
    put(board)
    carry_out(board, msg.Home(), msg.Turn(300_000_000))
    board.ask(msg.ConfigureWiring(msg.Wiring.ONE_SWITCH, msg.Wiring.ONE_SWITCH))
    beats: list[msg.Message] = [m for m in board.ask(msg.AskStatistics(), 260_000) if isinstance(m, msg.Heartbeat)]
    assert beats[-1].homed == 0  # type: ignore[attr-defined]
    board.finish(msg.Home(), 15_000_000)
    assert abs(board.angle - 300) <= MARK_WITHIN + SLOWING
