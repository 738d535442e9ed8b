"""A wrong room file or profile is rejected with one line that names the key and the expected value."""

import math
from pathlib import Path

import numpy as np
import pytest
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.room.room import Place, load_room, parse_room

from sonarhw.errors import InputError

GOOD = """
name = "r"
[materials.m]
reflectance = 0.9
[[walls]]
name = "w"
points = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]
material = "m"
[[posts]]
name = "p"
center = [5.0, 5.0]
radius = 0.5
material = "m"
[places.here]
position = [0.2, 0.3]
heading_deg = 90.0
"""
TALL = (
    GOOD.replace("radius = 0.5", "radius = 0.5\nheight = [0.0, 0.4]")
    + """height = 0.3
[floor]
height = 0.0
material = "m"
[ceiling]
height = 2.5
material = "m"
"""
)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('name = "w"', 'name = "w"\ncolour = "red"', "walls[0].colour: unknown key"),
        ('material = "m"', 'material = "wood"', "unknown material 'wood' of 'w'; defined: m"),
        (
            "reflectance = 0.9",
            "reflectance = 1.9",
            "m.reflectance: expected less than or equal to 1, got 1.9",
        ),
        ("reflectance = 0.9", "reflectance = nan", "materials.m.reflectance: expected a finite number"),
        ("reflectance = 0.9", 'reflectance = "high"', "materials.m.reflectance: expected a valid number, got 'high'"),
        ("[1.0, 0.0], [1.0, 1.0]]", "[0.0, 0.0]]", "segment 0 of wall 'w'"),
        ("[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]", "[[0.0, 0.0]]", "walls[0].points"),
        ("[1.0, 0.0], [1.0", "[1.0, 0.0, 2.0], [1.0", "walls[0].points[1]: expected 2 values, got 3"),
        ("position = [0.2, 0.3]", "position = [5.1, 5.1]", "place 'here' lies inside post 'p'"),
        ("radius = 0.5", "radius = 0.0", "posts[0].radius: expected greater than 0"),
        ('name = "p"', 'name = "w[0]"', "named 'w[0]'"),
        (
            'material = "m"\n[[posts]]',
            'material = "m"\nedges = ["a"]\n[[posts]]',
            "a name in edges for each of 2 segments",
        ),
        ("position = [0.2, 0.3]", "position = [0.2", "not TOML"),
        ("radius = 0.5", "radius = 0,5", "'radius = 0,5'; write numbers with a point"),
        ("position = [0.2, 0.3]", "", "places.here.position: missing"),
    ],
)
def test_wrong_room_is_rejected_with_key_and_reason(old: str, new: str, message: str) -> None:
    assert old in GOOD
    with pytest.raises(InputError) as refusal:
        parse_room(GOOD.replace(old, new, 1), "bad.toml")
    assert str(refusal.value).startswith("bad.toml: ")
    assert message in str(refusal.value)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("height = [0.0, 0.4]", "height = [0.4, 0.0]", "height of post 'p' must be [lower, upper], got [0.4, 0.0]"),
        ("height = [0.0, 0.4]", "height = 0.4", "posts[0].height: expected a list of numbers"),
        (
            "height = 0.3",
            "height = -0.3",
            "height of place 'here' must lie between floor and ceiling, 0 to 2.5, got -0.3",
        ),
        ("height = 0.3", 'height = "low"', "places.here.height: expected a valid number, got 'low'"),
        ("height = 0.3", "height = nan", "places.here.height: expected a finite number"),
        ("height = 2.5", "height = 0.0", "the floor must lie below the ceiling, got heights 0 and 0"),
        ('height = 2.5\nmaterial = "m"', "height = 2.5", "ceiling.material: missing"),
        (
            'height = 2.5\nmaterial = "m"',
            'height = 2.5\nmaterial = "tin"',
            "unknown material 'tin' of 'ceiling'",
        ),
        ("[floor]\nheight = 0.0", "[floor]\nlevel = 0.0", "floor.level: unknown key"),
        ('name = "p"', 'name = "floor"', "two surfaces are named 'floor'"),
        ("position = [0.2, 0.3]", "position = [5.1, 5.1]", "place 'here' lies inside post 'p'"),
    ],
)
def test_wrong_heights_are_rejected_with_key_and_reason(old: str, new: str, message: str) -> None:
    assert old in TALL
    with pytest.raises(InputError) as refusal:
        parse_room(TALL.replace(old, new, 1), "bad.toml")
    assert str(refusal.value).startswith("bad.toml: ")
    assert message in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_heights_are_read_and_default_to_infinite() -> None:
    room = parse_room(TALL, "tall.toml")
    assert room.names == ("w[0]", "w[1]", "p", "floor", "ceiling")
    assert room.heights.tolist() == [[-math.inf, math.inf]] * 2 + [[0.0, 0.4], [0.0, 0.0], [2.5, 2.5]]
    assert room.place("here").height == 0.3
    assert room.place("0.5,0.25").height is None
    assert parse_room(GOOD, "good.toml").place("here").height is None


def test_place_above_a_low_post_is_free() -> None:
    above = TALL.replace("position = [0.2, 0.3]", "position = [5.1, 5.1]").replace("height = 0.3", "height = 0.6")
    assert parse_room(above, "tall.toml").place("here").position == (5.1, 5.1)


def test_room_without_walls_is_rejected() -> None:
    with pytest.raises(InputError, match="at least one"):
        parse_room('name = "empty"', "bad.toml")


def test_missing_file_is_named() -> None:
    with pytest.raises(InputError, match=r"nowhere\.toml: no such file; give the name of a room file"):
        load_room("nowhere.toml")
    with pytest.raises(InputError, match=r"simple\.toml: no such file; the shipped room is 'simple'"):
        load_room("simple.toml")


def test_names_default_to_wall_and_number() -> None:
    assert parse_room(GOOD, "good.toml").names == ("w[0]", "w[1]", "p")


def test_place_by_name_by_numbers_or_alone() -> None:
    room = parse_room(GOOD, "good.toml")
    assert room.place(None) == room.place("here")
    assert room.place("here").heading == pytest.approx(math.pi / 2)
    assert room.place("0.5,0.25") == Place("0.5,0.25", (0.5, 0.25), 0.0)
    assert room.place("0.5,0.25,90") == Place("0.5,0.25,90", (0.5, 0.25), math.pi / 2)
    for pose in ([0.5, 0.25, math.pi / 2], np.array([0.5, 0.25, math.pi / 2])):
        assert room.place(pose) == room.place("0.5,0.25,90")


def test_a_place_at_two_numbers_is_named_in_millimetres_and_keeps_its_position() -> None:
    room = parse_room(GOOD, "good.toml")
    for position, name in (
        ((0.294701487374397, 0.2505910713629), "0.295,0.251"),
        ((1.0, -1e-12), "1,0"),
        ((1234.5678, 0.5), "1234.568,0.5"),
    ):
        place = room.place(position)
        assert (place.name, place.position) == (name, position)


@pytest.mark.parametrize(
    "place",
    [
        "there",
        "1,2,3,4",
        "nan,1",
        "1,2,inf",
        "1,2,x",
        "5.2,5.0",
        (1.0,),
        (1.0, 2.0, 3.0, 4.0),
        [(0.5, 0.25)],
        ("a", "b"),
        1.0,
    ],
)
def test_wrong_place_is_rejected(place: object) -> None:
    with pytest.raises(InputError):
        parse_room(GOOD, "good.toml").place(place)  # type: ignore[arg-type]


def test_place_is_required_if_there_are_several() -> None:
    with pytest.raises(InputError, match="figure7, figure9"):
        load_room("rooms/simple.toml").place(None)


def test_board_file_is_checked(tmp_path: Path) -> None:
    wrong = tmp_path / "board.toml"
    wrong.write_text('name = "x"\nfrequency = 50000.0\n')
    with pytest.raises(InputError, match="aperture_radius: missing"):
        load_board(str(wrong))


def test_room_of_the_readme_loads() -> None:
    import re

    blocks = re.findall(r"```toml\n(.*?)```", Path("README.md").read_text(), flags=re.DOTALL)
    rooms = [parse_room(block, "README") for block in blocks if "[[walls]]" in block]
    assert [room.name for room in rooms] == ["Simple room"]
