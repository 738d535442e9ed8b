"""The room of the fake scanner: exact on request, always repeatable, and by default a little off the file."""

import math
from dataclasses import replace

import numpy as np
import pytest
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.predict.prediction import predict_scan
from sonarhw_sim.predict.room_echoes import EXACT, MAX_ECHOES, RoomEchoes, with_furniture
from sonarhw_sim.room.room import load_room

from sonarhw.readings import Ping, PingResult
from tests.fixtures.rooms_for_tests import polygon_room

ROOM = load_room("rooms/simple.toml")


PLACE = ROOM.places["figure9"]


BOARD = load_board("paper")


LISTEN = 0.06


def ping(source: RoomEchoes, degrees: float, sweep: int = 0) -> PingResult:
    return source.receive(Ping(math.radians(degrees), sweep, 0, LISTEN, trace=False))


def test_undisturbed_echoes_are_the_prediction() -> None:
    source = RoomEchoes(ROOM, PLACE, BOARD, disturbance=EXACT)
    scan = predict_scan(ROOM, PLACE, BOARD, np.radians(np.arange(0, 360, 15.0)))
    for k, degrees in enumerate(range(0, 360, 15)):
        echoes = ping(source, degrees).echo_times
        assert len(echoes) <= MAX_ECHOES
        assert echoes[0] * ROOM.air.speed_of_sound / 2 == pytest.approx(scan.ranges[k], abs=1e-9)


def test_an_echo_within_the_rearming_time_of_a_reported_one_is_not_reported() -> None:
    board = replace(BOARD, rearm=3e-3, threshold_db=-40.0)
    source = RoomEchoes(ROOM, PLACE, board, disturbance=EXACT)
    scan = predict_scan(ROOM, PLACE, board, np.radians(np.arange(0, 360, 30.0)))
    left_out = 0
    for k, degrees in enumerate(range(0, 360, 30)):
        arrivals = [2 * echo.range / ROOM.air.speed_of_sound for echo in scan.ping(k).echoes]
        expected, since = [], -math.inf
        for arrival in arrivals:
            if arrival >= since + board.rearm:
                expected.append(arrival)
                since = arrival
        left_out += len(arrivals) - len(expected)
        assert ping(source, degrees).echo_times == pytest.approx(expected[:MAX_ECHOES], abs=1e-7)
    assert left_out > 100


def test_echoes_do_not_depend_on_the_order_of_pings() -> None:
    one, other = RoomEchoes(ROOM, PLACE, BOARD, seed=4), RoomEchoes(ROOM, PLACE, BOARD, seed=4)
    forwards = [ping(one, degrees) for degrees in range(0, 360, 60)]
    backwards = [ping(other, degrees) for degrees in reversed(range(0, 360, 60))]
    assert forwards == backwards[::-1]


def test_noise_differs_between_headings_and_repeats_after_a_turn() -> None:
    """Timing alone is disturbed; the error of a reading is its echo minus that of the exact source."""
    exact = RoomEchoes(ROOM, PLACE, BOARD, disturbance=EXACT)
    noisy = RoomEchoes(ROOM, PLACE, BOARD, seed=4, disturbance=replace(EXACT, timing=1e-5))

    def error(degrees: float) -> float:
        return ping(noisy, degrees).echo_times[0] - ping(exact, degrees).echo_times[0]

    errors = [error(degrees) for degrees in range(60, 120, 2)]
    assert len({round(one, 12) for one in errors}) == len(errors)
    assert 3e-6 < np.std(errors) < 3e-5
    assert error(90.0 + 360.0) == pytest.approx(error(90.0), abs=1e-12)


@pytest.mark.parametrize("seed", range(3))
def test_additional_post_stands_free_between_the_scanner_and_a_wall(seed: int) -> None:
    """In a rectangle, the whole post is inside the walls, and the scanner is outside the post."""
    wide, deep, (x, y) = 3.0, 2.0, (0.7, 1.2)
    room = polygon_room([(0.0, 0.0), (wide, 0.0), (wide, deep), (0.0, deep)])
    furnished = with_furniture(room, (x, y), np.random.default_rng(seed))
    ((px, py, radius),) = furnished.posts.tolist()
    assert 0 < radius < min(px, wide - px, py, deep - py)
    far = math.hypot(px - x, py - y)
    assert far > 2 * radius
    # the distance to the wall behind the post, along the ray through its middle
    dx, dy = (px - x) / far, (py - y) / far
    wall = min(((wide if dx > 0 else 0) - x) / dx, ((deep if dy > 0 else 0) - y) / dy)
    assert 0.6 <= far / wall <= 0.8
    assert radius / wall == pytest.approx(0.03)
    assert (
        with_furniture(
            polygon_room([(9.0, 9.0), (9.0, 9.0001)], closed=False), (x, y), np.random.default_rng(seed)
        ).posts.size
        == 0
    )


def test_trace_rises_at_every_loud_echo_and_not_before_the_first() -> None:
    scan = predict_scan(ROOM, PLACE, BOARD, np.radians([90.0]))
    trace = scan.ping(0).signal(LISTEN).envelope()
    threshold = 10 ** (BOARD.threshold_db / 20)
    first = 2 * 0.657 / ROOM.air.speed_of_sound
    quiet = (trace.times > 0.002) & (trace.times < first)
    loud = (trace.times > first) & (trace.times < first + 0.0006)
    assert trace.samples[quiet].max() < threshold
    assert trace.samples[loud].max() > 0.8
    assert trace.samples.max() <= 1.0


def test_turntable_scale_axis_and_clock_of_the_board_affect_its_echoes() -> None:
    off = replace(
        BOARD, home_angle_deg=15.0, turntable_scale=1.25, axis_x=0.02, axis_y=0.01, clock_error=0.03, range_offset=0.02
    )
    # zero is at 15°; a turn of 60° is one of 75°
    turned = math.radians(15.0)
    x = PLACE.position[0] + 0.02 * math.cos(turned) - 0.01 * math.sin(turned)
    y = PLACE.position[1] + 0.02 * math.sin(turned) + 0.01 * math.cos(turned)
    there = replace(PLACE, position=(x, y))
    plain, crooked = RoomEchoes(ROOM, there, BOARD, disturbance=EXACT), RoomEchoes(ROOM, PLACE, off, disturbance=EXACT)
    extra = 2 * 0.02 / ROOM.air.speed_of_sound
    expected = [1.03 * time + extra for time in ping(plain, 90).echo_times]
    assert ping(crooked, 60).echo_times == pytest.approx(expected, rel=1e-9)
