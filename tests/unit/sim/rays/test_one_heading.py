"""The compiled appendix A equals the readable one, ray for ray."""

import math
from dataclasses import replace

import pytest
from sonarhw_sim.air import Unit
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.room.room import load_room

from tests.conftest import Count
from tests.oracles import one_heading, reference

PLACES = [("simple", "figure9"), ("simple", "figure7"), ("right_corner", "figure12"), ("arena", "p0")]


@pytest.mark.parametrize("blocking", [False, True])
@pytest.mark.parametrize(("room_name", "place"), PLACES)
def test_compiled_range_equals_the_reference(room_name: str, place: str, blocking: bool, count: Count) -> None:
    room = load_room(f"rooms/{room_name}.toml")
    unit = Unit.BLOCK if blocking else Unit.PASS
    fixed = replace(load_board("hc-sr04"), fixed_gain=True, threshold_db=-24.0)
    for board in (load_board("paper"), load_board("polaroid-6500"), fixed):
        for degrees in range(7, 360, count(93, 31)):
            heading, spacing = math.radians(degrees), math.radians(0.5)
            expected = reference.range_at(room, room.places[place], board, heading, unit, spacing)
            found = one_heading.range_at(room, room.places[place], board, heading, blocking=blocking, spacing=spacing)
            assert found == (None if expected is None else pytest.approx(expected, abs=1e-9))


def test_compiled_range_equals_the_reference_with_posts() -> None:
    room, board = load_room("rooms/laboratory.toml"), load_board("paper")
    for degrees in range(0, 360, 45):
        expected = reference.range_at(room, room.places["bench"], board, math.radians(degrees))
        found = one_heading.range_at(room, room.places["bench"], board, math.radians(degrees))
        assert found == (None if expected is None else pytest.approx(expected, abs=1e-9))
