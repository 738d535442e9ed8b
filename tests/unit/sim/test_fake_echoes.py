"""The room of the fake scanner: exact on request, always repeatable, and by default a little off the file."""

import math
from dataclasses import replace

import numpy as np
import pytest
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.predict.room_echoes import EXACT, RoomEchoes, with_furniture
from sonarhw_sim.room.room import load_room

from sonarhw.readings import Ping, PingResult
from tests.fixtures.rooms_for_tests import polygon_room

ROOM = load_room("rooms/simple.toml")


PLACE = ROOM.places["figure9"]


BOARD = load_board("paper")


LISTEN = 0.06


def ping(source: RoomEchoes, degrees: float, sweep: int = 0) -> PingResult:
    return source.receive(Ping(math.radians(degrees), sweep, 0, LISTEN, trace=False))


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
