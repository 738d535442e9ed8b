"""Reflectances that a calibration finds: in the room, in its text, and in the level of one reflection."""

import math

import pytest
from sonarhw_compare.calibration.outcome import CalibratedValue
from sonarhw_compare.calibration.room import RoomCalibration, gained_by_reflection, is_contradicted, with_reflectances
from sonarhw_compare.fit.result import PlacedScan
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.room.room import Room, load_room, parse_room

from sonarhw.errors import InputError

# 3 m of board, 1 m of cloth
TWO = """
name = "two"
[materials.board]
reflectance = 0.9
[materials.cloth]
reflectance = 0.5
[[walls]]
name = "long"
points = [[0.0, 0.0], [3.0, 0.0]]
material = "board"
[[walls]]
name = "short"
points = [[3.0, 1.0], [3.0, 2.0]]
material = "cloth"
[places.a]
position = [1.0, 1.0]
"""


def found(material: str, value: float, before: float) -> CalibratedValue:
    return CalibratedValue(material, value, value - 0.1, value + 0.1, before, "")


def changed() -> tuple[Room, Room]:
    room = parse_room(TWO, "two")
    return room, with_reflectances(room, [found("board", 0.72, 0.9), found("cloth", 0.6, 0.5)])


def test_the_room_and_its_text_have_the_reflectances_found() -> None:
    room, other = changed()
    assert other.reflectances.tolist() == pytest.approx([0.72, 0.6])
    assert parse_room(other.text, "again").reflectances.tolist() == other.reflectances.tolist()
    assert room.reflectances.tolist() == [0.9, 0.5]


def test_one_reflection_is_louder_by_the_mean_along_the_walls() -> None:
    expected = (3 * 20 * math.log10(0.72 / 0.9) + 20 * math.log10(0.6 / 0.5)) / 4
    assert gained_by_reflection(*changed()) == pytest.approx(expected)


def test_the_text_names_profile_and_scans_and_stays_a_room() -> None:
    room, other = changed()
    board, scans = (
        load_board("lego-nxt"),
        [PlacedScan([], room.place("a"), file=name) for name in ("a.mcap", "b\n.mcap")],
    )
    reflectances = (found("board", 0.72, 0.9),)
    result = RoomCalibration(board, board, scans=scans, given=room, room=other, reflectances=reflectances)
    written = result.room_with_header("mine")
    head, _, rest = written.text.partition("\n\n")
    assert "board profile 'mine'" in head
    assert "#   reflectance of 'board': 0.72, 95 % 0.62 to 0.82; before: 0.9" in head
    assert all(line.startswith("#") for line in head.splitlines())
    assert rest == other.text.removeprefix("\n")


@pytest.mark.parametrize(("value", "expected"), [(0.79, True), (0.81, False), (0.99, False)])
def test_a_room_file_is_contradicted_outside_the_interval(value: float, expected: bool) -> None:
    assert is_contradicted(found("board", value, 0.9)) is expected


def test_a_room_without_a_reflectance_to_find_is_refused() -> None:
    with pytest.raises(InputError, match="'Arena': no material has a reflectance that scans can change"):
        with_reflectances(load_room("arena"), [])
