"""Fitted values in room files."""

import math

import pytest
from sonarhw_compare.fit.fitting import fitted_room, with_listed_findings
from sonarhw_compare.fit.parameters import Parameter, free_parameters
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.room.room import Place, load_room, parse_room

ROOM = load_room("rooms/simple.toml")
BOARD = load_board("paper")


def free(*words: str) -> tuple[Parameter, ...]:
    """Return the parameters of words of --free, for one scan."""
    return free_parameters(words, ("scan",), ROOM, BOARD)


def test_a_room_gets_the_fitted_place_temperature_and_reflectance() -> None:
    material = ROOM.materials[0]
    x, y, heading, warm, share = free("position", "heading", "temperature", f"reflectance:{material}")
    values = {x: 0.7, y: 0.1, heading: 0.0, warm: 23.456, share: 0.81}
    place = Place("found", (0.7123456, 0.1), math.radians(-90.0))
    found = fitted_room(ROOM, values, [place])
    again = parse_room(found.text, "again")
    for room in (found, again):
        assert room.air.temperature_c == pytest.approx(23.456, abs=0.06)
        assert room.reflectances[0] == pytest.approx(0.81)
        assert room.places["found"].position == pytest.approx((0.7123456, 0.1), abs=1e-4)
        assert math.degrees(room.places["found"].heading) % 360 == pytest.approx(270.0)
        assert set(room.places) == {*ROOM.places, "found"}


def test_listed_findings_stay_in_comments() -> None:
    found = with_listed_findings(ROOM, ROOM.name, ["reflectance:a\nname = 'other' 0.9"], ["scan"])
    assert found.name == ROOM.name
    assert found.text.splitlines()[1] == r"#   reflectance:a\nname = 'other' 0.9"


def test_without_a_fitted_position_the_room_keeps_its_places() -> None:
    (warm,) = free("temperature")
    assert set(fitted_room(ROOM, {warm: 20.0}, [Place("found", (0.7, 0.1))]).places) == set(ROOM.places)
