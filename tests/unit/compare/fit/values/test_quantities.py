"""Quantities of a fit: reading and writing of each, bounds, words, and the temperature of a speed of sound."""

import math
from dataclasses import replace

import numpy as np
import pytest
from sonarhw_compare.fit.parameters import free_parameters, present_value
from sonarhw_compare.fit.quantities import (
    QUANTITIES,
    WORDS,
    BoardQuantity,
    PlaceQuantity,
    nearest_temperature,
    quantity_named,
    reflectance_of,
    words_of,
)
from sonarhw_sim.air import Air
from sonarhw_sim.board.profile import Mount, load_board
from sonarhw_sim.room.room import Place, ReflectanceTable

from sonarhw.errors import InputError
from tests.fixtures.rooms_for_tests import room_of

BOARD = replace(load_board("polaroid-6500"), mount=Mount(ahead=0.05, aside=-0.01), range_offset=0.02)
ROOM = room_of([(-1.0, 0.0, 2.0, 0.5), (2.0, 0.5, 2.0, 3.0)], [(0.0, 4.0, 0.1)], [0.9, 0.8, 0.7])
PLACE = Place("here", (0.3, 0.4), heading=1.0)


@pytest.mark.parametrize("celsius", [-40.0, -10.0, 0.0, 20.0, 36.6, 60.0])
def test_the_temperature_of_a_speed_of_sound_is_the_inverse_of_the_speed(celsius: float) -> None:
    air = Air(celsius)
    assert nearest_temperature(air.speed_of_sound, Air(5.0)) == pytest.approx(celsius, abs=1e-5)


def test_speeds_outside_the_range_have_the_coldest_and_the_warmest_air() -> None:
    assert nearest_temperature(Air(-40.0).speed_of_sound - 1.0, Air()) == -40.0
    assert nearest_temperature(Air(60.0).speed_of_sound + 1.0, Air()) == 60.0


def test_each_quantity_of_place_board_and_air_reads_back_what_was_put() -> None:
    for name, value in {"x": 1.5, "y": -2.0, "heading": 3.0}.items():
        quantity = quantity_named(name)
        assert isinstance(quantity, PlaceQuantity)
        assert quantity.value(quantity.put(PLACE, value)) == value
        others = [one for one in QUANTITIES if isinstance(one, PlaceQuantity) and one is not quantity]
        assert all(one.value(quantity.put(PLACE, value)) == one.value(PLACE) for one in others)
    for name, value in {"ahead": 0.1, "aside": 0.03, "threshold": -30.0, "aperture": 0.017}.items():
        quantity = quantity_named(name)
        assert isinstance(quantity, BoardQuantity)
        assert quantity.value(quantity.put(BOARD, value)) == value
    (speed,) = free_parameters(["speed"], [""], ROOM, BOARD)
    room = replace(ROOM, air=speed.quantity.put(ROOM.air, 350.0))  # type: ignore[attr-defined]
    assert present_value(speed, PLACE, room, BOARD) == pytest.approx(350.0, abs=1e-3)


def test_the_offset_is_a_correction_of_readings_and_subtracted_from_the_profile() -> None:
    offset = quantity_named("offset")
    assert isinstance(offset, BoardQuantity)
    assert offset.value(BOARD) == 0.0
    assert offset.put(BOARD, 0.005).range_offset == pytest.approx(0.015)


@pytest.mark.parametrize(
    ("word", "bounds"),
    [
        ("x", (-1.0, 2.0)),
        ("y", (0.0, 4.0)),
        ("heading", (-math.inf, math.inf)),
        ("temperature", (-10.0, 45.0)),
        ("speed", (Air(-10.0).speed_of_sound, Air(45.0).speed_of_sound)),
        ("threshold", (BOARD.threshold_db - 20.0, min(0.0, BOARD.threshold_db + 20.0))),
        ("aperture", (BOARD.aperture_radius / 2.5, BOARD.aperture_radius * 2.5)),
        ("reflectance:m0", (0.2, 1.0)),
        ("wall:w1", (-0.1, 0.1)),
    ],
)
def test_bounds_are_those_of_the_room_and_the_board(word: str, bounds: tuple[float, float]) -> None:
    (found,) = free_parameters([word], [""], ROOM, BOARD)
    assert (found.lower, found.upper) == pytest.approx(bounds)


def test_no_threshold_is_over_the_echo_of_a_perfect_wall() -> None:
    (found,) = free_parameters(["threshold"], [""], ROOM, replace(BOARD, threshold_db=-12.0))
    assert (found.lower, found.upper) == (-32.0, 0.0)


def test_bounds_of_the_face_are_as_far_to_both_sides_of_its_present_place() -> None:
    ahead, aside, offset = free_parameters(["ahead", "aside", "offset"], [""], ROOM, BOARD)
    reach = offset.upper
    assert offset.lower == -reach
    assert (ahead.lower, ahead.upper) == pytest.approx((0.05 - reach, 0.05 + reach))
    assert (aside.lower, aside.upper) == pytest.approx((-0.01 - reach, -0.01 + reach))


def test_a_word_frees_its_group_and_a_part_only_itself() -> None:
    def names(*free: str, scans: tuple[str, ...] = ("",)) -> list[str]:
        return [one.name for one in free_parameters(free, scans, ROOM, BOARD)]

    assert names("position", "heading") == ["x", "y", "heading"]
    assert names("position", scans=("A", "B")) == ["x@A", "x@B", "y@A", "y@B"]
    assert names("axis") == ["ahead", "aside"]
    assert names("reflectances") == ["reflectance:m0", "reflectance:m1", "reflectance:m2"]
    assert names("reflectance:m1", "x", "x") == ["reflectance:m1", "x"]
    assert names("walls") == ["wall:w0", "wall:w1"]
    for free, message in (
        (["colour"], "free colour: unknown quantity"),
        (["x:w0"], "free x:w0: x belongs to a scan, not to a part of the room; write x"),
        (["wall:p0"], "unknown wall 'p0'; room 'test room' has w0, w1"),
        (["temperature", "speed"], "each determines the other"),
    ):
        with pytest.raises(InputError, match=message):
            names(*free)


def test_the_help_lists_each_word_with_its_quantities() -> None:
    assert words_of(PlaceQuantity) == "position (x, y), heading"
    every = words_of()
    assert "axis (ahead, aside)" in every
    assert "reflectances (reflectance[:MATERIAL])" in every
    assert all(word.partition("[")[0] in every for word in WORDS)


def test_a_new_reflectance_keeps_the_share_of_scattered_sound() -> None:
    room = replace(ROOM, reflectances=np.array([0.6, 0.8, 0.7]), scattered=np.array([0.3, 0.0, 0.0]))
    assert reflectance_of(room, "m0") == pytest.approx(math.hypot(0.6, 0.3))
    (parameter,) = free_parameters(["reflectance:m0"], [""], room, BOARD)
    changed = parameter.quantity.put(room, {"m0": 0.5})  # type: ignore[attr-defined]
    assert reflectance_of(changed, "m0") == pytest.approx(0.5)
    assert changed.scattered[0] / changed.reflectances[0] == pytest.approx(0.5)
    assert changed.reflectances[1:].tolist() == [0.8, 0.7]


def test_a_material_with_a_table_is_not_free() -> None:
    room = replace(ROOM, tables={"m0": ReflectanceTable(np.zeros(1), np.array([5e4]), np.array([[0.3]]))})
    names = [parameter.name for parameter in free_parameters(["reflectances"], [""], room, BOARD)]
    assert names == ["reflectance:m1", "reflectance:m2"]
    with pytest.raises(InputError, match=r"unknown reflectance 'm0'; room .* has m1, m2"):
        free_parameters(["reflectance:m0"], [""], room, BOARD)
    every = replace(room, tables=dict.fromkeys(room.materials, room.tables["m0"]))
    with pytest.raises(InputError, match=r"free reflectance: room .* has no reflectance that a fit can change"):
        free_parameters(["reflectances"], [""], every, BOARD)
