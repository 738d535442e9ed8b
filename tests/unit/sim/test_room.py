"""Rooms: from arrays, written and read back, with tables of reflectances, and what is probably a mistake in them."""

import copy
import math
import pickle
from collections.abc import Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sonarhw_sim import check
from sonarhw_sim.air import Air
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.check import check_room, plan_findings, reason_for_silence
from sonarhw_sim.room.room import Place, Room, facets_of, load_room, parse_room, room_names
from sonarhw_sim.room.room import with_material as with_one_material
from sonarhw_sim.room.room_arrays import room_from_arrays
from sonarhw_sim.room.room_writing import materials, with_air, with_place
from sonarhw_sim.room.room_writing import with_material as with_written_material
from sonarhw_sim.room.small_things import clusters_of

from tests.checkout import CHECKOUT

SQUARE = [[0, 0], [4, 0], [4, 3], [0, 3]]


SEGMENTS = [[SQUARE[k], SQUARE[(k + 1) % 4]] for k in range(4)]


WALLS = [[0, 0, 4, 0], [4, 0, 4, 3], [4, 3, 0, 3], [0, 3, 0, 0]]


FILE = """
name = "room"
[materials.hard]
reflectance = 0.95
[[walls]]
name = "wall"
points = [[0, 0], [4, 0], [4, 3], [0, 3]]
closed = true
material = "hard"
[[posts]]
name = "pillar"
center = [2, 2]
radius = 0.1
material = "hard"
[places.door]
position = [1, 1]
heading_deg = 90
"""


class Shape:
    """An object of another library."""

    __geo_interface__: ClassVar = {"type": "Polygon", "coordinates": [[*SQUARE, SQUARE[0]]]}


def test_small_things_of_a_room_without_named_places_are_those_of_the_room_with_one() -> None:
    jamb = [[1.5, 3, 1.5, 2.95], [1.5, 2.95, 1.6, 2.95], [1.6, 2.95, 1.6, 3]]
    box = [[3, 1, 3.02, 1], [3.02, 1, 3.02, 1.02], [3.02, 1.02, 3, 1.02], [3, 1.02, 3, 1]]
    walls = [[0, 0, 4, 0], [4, 0, 4, 3], [4, 3, 0, 3], [0, 3, 0, 0], *jamb, *box]
    named, unnamed = room_from_arrays(walls, places={"here": (2, 1)}), room_from_arrays(walls)
    clusters, others = (clusters_of(room, 0.00695) for room in (named, unnamed))
    assert [cluster.walls for cluster in clusters] == [cluster.walls for cluster in others] == [(4, 5, 6)]


@pytest.mark.parametrize(
    "walls",
    [SQUARE, np.array(SQUARE), [*SQUARE, SQUARE[0]], SEGMENTS, np.array(WALLS), {"wall": SQUARE}, Shape(), [Shape()]],
)
def test_all_forms_of_walls_are_those_of_a_file(walls: object) -> None:
    made = room_from_arrays(walls, {"pillar": [2, 2, 0.1]}, places={"door": (1, 1, np.pi / 2)})
    read = parse_room(FILE, "room.toml")
    for name in ("walls", "posts", "reflectances", "scattered", "heights"):
        assert np.array_equal(getattr(made, name), getattr(read, name))
    assert np.array_equal(made.edges.points, read.edges.points)
    assert made.places == read.places


def test_reflectances_are_one_or_by_segment_or_by_name() -> None:
    assert room_from_arrays(SQUARE, [[1, 1, 0.1]], reflectances=0.5).reflectances.tolist() == [0.5] * 5
    assert room_from_arrays(SQUARE, reflectances=[0.1, 0.2, 0.3, 0.4]).reflectances.tolist() == [0.1, 0.2, 0.3, 0.4]
    by_name = room_from_arrays({"room": SQUARE, "door": [[1, 1], [2, 1]]}, reflectances={"door": 0.2})
    assert by_name.reflectances.tolist() == [0.95] * 4 + [0.2]
    assert by_name.names[-1] == "door"


def test_rooms_are_values() -> None:
    def made() -> Room:
        return room_from_arrays(SQUARE, [[2, 2, 0.1]], places={"door": (1, 1)})

    room = made()
    assert room == made() == pickle.loads(pickle.dumps(room)) == copy.deepcopy(room)
    assert len({room, made()}) == 1
    assert room != replace(room, walls=room.walls + 0.01)
    assert room != "room"
    assert repr(room) == "Room('room', 4 walls, 1 post, places: door)"


# Changed and saved rooms.


ROOMS = sorted((CHECKOUT / "rooms").glob("*.toml"))


SHARES = st.floats(0, 1)


def assert_same_rooms(one: Room, other: Room, but: tuple[str, ...] = ()) -> None:
    """Assert that the rooms are equal except for these fields and their text."""
    for field in fields(Room):
        if field.name in (*but, "text"):
            continue
        first, second = getattr(one, field.name), getattr(other, field.name)
        if field.name == "edges":
            assert first.names == second.names
            np.testing.assert_array_equal(first.points, second.points)
        elif isinstance(first, np.ndarray):
            np.testing.assert_array_equal(first, second, err_msg=field.name)
        else:
            assert first == second, field.name


def comments(text: str) -> list[str]:
    return [line.partition("#")[2] for line in text.splitlines() if "#" in line]


@pytest.mark.parametrize("path", ROOMS, ids=lambda path: path.stem)
@settings(max_examples=3, deadline=None)
@given(t=st.floats(-40, 60), h=SHARES, p=st.floats(30, 120), x=st.floats(50, 99), heading=st.floats(-360, 360))
def test_example_rooms_read_back(path: Path, t: float, h: float, p: float, x: float, heading: float) -> None:
    room = load_room(path)
    place = Place("elsewhere", (x, -x), np.radians(heading))
    changed = with_place(with_air(room, Air(t, h, p)), place)
    assert changed.air == Air(t, h, p)
    assert changed.places["elsewhere"].position == place.position
    assert changed.places["elsewhere"].heading == pytest.approx(place.heading, abs=1e-10)
    assert_same_rooms(parse_room(changed.text, "written"), changed)
    assert_same_rooms(changed, room, but=("air", "places"))
    assert {**changed.places, **room.places} == changed.places
    assert comments(changed.text) == comments(room.text)


# Tables of reflectances.


ROWS = """
    { incidence_deg = 60.0, frequency = 50000.0, reflectance = 0.8 },
    { incidence_deg = 0.0, frequency = 50000.0, reflectance = 0.2 },
    { incidence_deg = 0.0, frequency = 60000.0, reflectance = 0.4 },
    { incidence_deg = 60.0, frequency = 60000.0, reflectance = 0.6 },
"""


def room_with(foam: str) -> Room:
    return parse_room(
        f"""
        name = "foam"
        [materials.foam]
        {foam}
        [materials.wood]
        reflectance = 0.9
        [[walls]]
        name = "w"
        points = [[0.0, 1.0], [1.0, 1.0], [1.0, 0.0]]
        material = "foam"
        [[posts]]
        name = "p"
        center = [5.0, 5.0]
        radius = 0.1
        material = "wood"
        """,
        "room.toml",
    )


TABLED = room_with(f"table = [{ROWS}]\nscatter = 0.19")


@pytest.mark.parametrize(
    ("degrees", "frequency", "expected"),
    [
        (0.0, 50e3, 0.2),
        (60.0, 60e3, 0.6),
        (30.0, 50e3, 0.5),
        (0.0, 55e3, 0.3),
        (15.0, 57.5e3, 0.25 * 0.35 + 0.75 * 0.45),  # of the values at 15°: 0.35 at 50 kHz, 0.45 at 60 kHz
        (85.0, 40e3, 0.8),
        (85.0, 90e3, 0.6),
    ],
)
def test_values_are_interpolated(degrees: float, frequency: float, expected: float) -> None:
    at = TABLED.tables["foam"].at(np.radians([degrees]), np.array([frequency]))
    assert at == pytest.approx(np.array([[expected]]))


def test_surfaces_have_the_largest_value() -> None:
    assert TABLED.reflectances == pytest.approx([0.8 * 0.9, 0.8 * 0.9, 0.9])
    assert np.hypot(TABLED.reflectances, TABLED.scattered) == pytest.approx([0.8, 0.8, 0.9])
    assert list(TABLED.tables) == ["foam"]


def test_a_new_reflectance_replaces_the_table_and_a_new_scatter_keeps_it() -> None:
    for changed in (with_one_material(TABLED, "foam", 0.5, 0.36), with_written_material(TABLED, "foam", 0.5, 0.36)):
        assert not changed.tables
        assert changed.reflectances[0] == pytest.approx(0.5 * 0.8)
    for changed in (with_one_material(TABLED, "foam", None, 0.36), with_written_material(TABLED, "foam", None, 0.36)):
        assert changed.tables.keys() == {"foam"}
        assert changed.reflectances[0] == pytest.approx(0.8 * 0.8)
        assert changed.scattered[0] == pytest.approx(0.8 * 0.6)
    assert materials(with_written_material(TABLED, "foam", None, 0.36))["foam"].scatter == 0.36


# The rooms of the documents.


# Probable mistakes.


BOX = """
name = "box"
[materials.m]
reflectance = 0.9
[[walls]]
name = "w"
points = [[0.0, 0.0], [4.0, 0.0], [4.0, 3.0], [0.0, 3.0]]
closed = true
material = "m"
[[posts]]
name = "p"
center = [1.0, 1.0]
radius = 0.1
material = "m"
[places.here]
position = [2.0, 1.2]
"""


WALL = '[[walls]]\nname = "v"\nmaterial = "m"\npoints = '


def lines(text: str) -> list[str]:
    return [finding.line for finding in check_room(parse_room(text, "own.toml"), load_board("polaroid-6500"))]


@pytest.mark.parametrize("name", sorted(set(room_names()) - {"figure2a"}))
def test_the_plans_of_shipped_rooms_have_no_findings(name: str) -> None:
    assert list(plan_findings(load_room(name))) == []


@pytest.mark.parametrize(
    ("more", "line"),
    [
        (f"{WALL}[[2.0, 2.0], [3.995, 2.0]]", "walls 'v[0]' and 'w[1]': have a gap of 5 mm at 3.995, 2 m; sound"),
        (f"{WALL}[[4.0, 3.0], [4.0, 0.0]]", "walls 'w[1]' and 'v[0]': coincide; remove one of them"),
        (f"{WALL}[[4.0, 1.0], [4.0, 1.5]]", "walls 'w[1]' and 'v[0]': overlap over 500 mm; shorten one of them"),
        (f"{WALL}[[1.0, 2.0], [1.0005, 2.0]]", "wall 'v[0]': is only 0.5 mm long; remove one of its points"),
        ('[places.out]\nposition = [5.0, 1.0]', "place 'out': is outside the room, at 5, 1 m; move it into the room"),
        ('[places.in]\nposition = [3.998, 1.0]', "place 'in': is 2 mm from wall 'w[1]', at 3.998, 1 m; move it away"),
        (
            '[[posts]]\nname = "q"\nradius = 0.2\nmaterial = "m"\ncenter = [3.9, 1.0]',
            "post 'q': overlaps wall 'w[1]' by 100 mm; move the post, or make it smaller",
        ),
        (
            '[[posts]]\nname = "q"\nradius = 0.2\nmaterial = "m"\ncenter = [9.0, 1.0]',
            "post 'q': is outside the room, at 9, 1 m; move it into the room, or remove it",
        ),
        (
            f"{WALL}[[0.0, 1.0], [0.03, 1.0], [0.03, 2.0]]",
            "wall 'v[0]': has edges too near to others for sound of 6.96 mm, at 0.015, 1 m; the levels of their",
        ),
        (
            f"{WALL}[[3.88, 1.97], [3.86, 1.97], [3.86, 2.03], [3.88, 2.03]]",
            "walls 'v[0]' to 'v[2]': are too near to wall 'w[1]' for sound of 6.96 mm, at 3.87, 1.97 m; sound that",
        ),
        (
            f"{WALL}[[2.0, 0.03], [2.8, 0.03], [2.8, 0.5], [2.0, 0.5]]\nclosed = true",
            "walls 'w[0]' and 'v[0]': have a slit too narrow for sound of 6.96 mm, at 2, 0.015 m; the levels of sound",
        ),
        ("[materials.n]\nreflectance = 0.5", "material 'n': no wall, post, floor or ceiling has it; use it"),
    ],
)  # fmt: skip
def test_each_mistake_is_found_once(more: str, line: str) -> None:
    (found,) = lines(BOX + more)
    assert found.startswith(line)


def test_levels_of_a_tray_in_the_open_and_of_a_cabinet_on_a_wall_are_no_guesses() -> None:
    tray = "[[3.0, 1.4], [3.02, 1.4], [3.02, 1.46], [3.0, 1.46]]"
    partition = "[[0.0, 2.0], [0.5, 2.0], [0.5, 2.4], [0.0, 2.4]]"
    assert lines(f"{BOX}{WALL}{tray}\n{WALL.replace('v', 'u')}{partition}") == []


def test_a_room_in_centimetres_is_found_and_silent() -> None:
    large = BOX.replace("4.0", "400.0").replace("3.0", "300.0").replace("[2.0, 1.2]", "[200.0, 120.0]")
    unit, silence = lines(large.replace("[1.0, 1.0]", "[100.0, 100.0]").replace("0.1", "10.0"))
    assert unit == (
        "room: is 400 m wide and 300 m deep; are these centimetres (4 by 3 m) or millimetres (0.4 by 0.3 m)? "
        "expected metres"
    )
    assert "the nearest wall is 92 m away, and board 'polaroid-6500' reports at most 10.7 m; are the coord" in silence


POST = '[[posts]]\nname = "q"\nmaterial = "m"\ncenter = '


def silence(text: str) -> str:
    room = parse_room(text, "own.toml")
    return reason_for_silence(room, room.places["here"], load_board("polaroid-6500"))


def test_the_distances_that_explain_silence_include_posts() -> None:
    """From the place to the centre it is √(20² + 170²) = 171 mm in the first room, 20 m in the second."""
    small = f'name = "r"\n[materials.m]\nreflectance = 0.9\n{WALL}[[0.0, 0.0], [0.05, 0.0]]\n'
    small += f"{POST}[0.0, 0.2]\nradius = 0.03\n[places.here]\nposition = [0.02, 0.03]\n"
    assert "the farthest wall is 0.201 m away" in silence(small)
    large = small.replace("[[0.0, 0.0], [0.05, 0.0]]", "[[30.0, 0.0], [31.0, 0.0]]")
    assert "the nearest wall is 20 m away" in silence(large.replace("[0.0, 0.2]", "[0.02, 20.03]"))


CRATE = f"{WALL}[[2.5, 0.5], [3.1, 0.5], [3.1, 1.0], [2.5, 1.0]]\nclosed = true\n"


@pytest.mark.parametrize(
    "walls",
    ["[[2.5, 0.5], [3.1, 0.5], [3.1, 1.0], [2.5, 1.0]]", "[[2.0, 0.2], [3.8, 0.2], [3.8, 2.2], [2.0, 2.2]]"],
    ids=["narrow", "wide as a room"],
)
def test_paths_of_a_place_in_a_closed_box_are_not_searched(monkeypatch: pytest.MonkeyPatch, walls: str) -> None:
    """In a box with lids, of strongly reflecting walls, a search takes a minute and ends with too many paths."""
    levels = '[floor]\nheight = 0.0\nmaterial = "m"\n[ceiling]\nheight = 2.5\nmaterial = "m"\n'
    inside = BOX.replace("[2.0, 1.2]", "[2.8, 0.7]\nheight = 0.3")
    monkeypatch.setattr(check, "predict_readings", lambda *_: pytest.fail("a prediction"))
    box = walls.replace("]]", "]]\nclosed = true\nheight = [0.0, 0.5]\nlids = true")
    (found,) = lines(f"{inside}{WALL}{box}\n{levels}")
    assert found.startswith("place 'here': is inside the object of walls 'v[0]' to 'v[3]', at 2.8, 0.7 m")


def test_a_place_above_an_object_or_in_an_inner_room_has_no_finding() -> None:
    above = BOX.replace("[2.0, 1.2]", "[2.8, 0.7]\nheight = 0.8")
    assert lines(f"{above}{CRATE}height = [0.0, 0.5]\n") == []
    inner_room = f"{WALL}[[1.5, 0.5], [3.5, 0.5], [3.5, 2.5], [1.5, 2.5]]\nclosed = true\n"
    assert lines(BOX + inner_room) == []


# Pillars of many walls.


Points = Sequence[tuple[float, float]]


RECTANGLE = [(0.0, 0.0), (4.0, 0.0), (4.0, 3.0), (0.0, 3.0)]


MIDDLE, RADIUS = (2.0, 1.5), 0.15


def circle(walls: int, radius: float = RADIUS, middle: tuple[float, float] = MIDDLE) -> list[tuple[float, float]]:
    turns = [math.tau * k / walls for k in range(walls)]
    return [(middle[0] + radius * math.cos(turn), middle[1] + radius * math.sin(turn)) for turn in turns]


def room_text(*chains: Points, place: tuple[float, float] | None = (1.0, 1.4), more: str = "") -> str:
    walls = [
        f'[[walls]]\nname = "w{k}"\npoints = {[list(point) for point in chain]}\nclosed = true\nmaterial = "m"'
        for k, chain in enumerate(chains)
    ]
    stands = [] if place is None else [f"[places.p]\nposition = {list(place)}"]
    return "\n".join(('name = "Drawn"', "[materials.m]\nreflectance = 0.95", *walls, *stands, more))


def drawn(*chains: Points, place: tuple[float, float] | None = (1.0, 1.4), more: str = "") -> Room:
    return parse_room(room_text(*chains, place=place, more=more), "drawn")


STAR = [point for k in range(16) for point in (circle(32, 0.2)[2 * k], circle(32, 0.15)[2 * k + 1])]


STAIRS = [(0.1 * (k // 2 + k % 2), 0.1 * (k // 2)) for k in range(30)] + [(0.0, 1.4)]


@pytest.mark.parametrize(
    "chains",
    [
        (RECTANGLE, circle(8)),
        (RECTANGLE, circle(64)[:40]),
        (RECTANGLE, STAR),
        (RECTANGLE, STAIRS),
        (RECTANGLE, [(x, 1.5 + (y - 1.5) / 2) for x, y in circle(64)]),
        (RECTANGLE, [circle(17)[5 * k % 17] for k in range(17)]),
        (circle(64, 3.0),),
        (circle(64, 3.0), [(0.5, 0.5), (1.0, 0.5), (0.7, 0.8)]),
    ],
    ids=["octagon", "round bay", "star", "stairs", "ellipse", "chords", "round room", "round room, furnished"],
)
def test_other_chains_are_not_circles(chains: Sequence[Points]) -> None:
    assert facets_of(drawn(*chains)) == ()


# Places where no scanner can be.


@pytest.mark.parametrize("pillar", [circle(12), circle(64), circle(64)[::-1]], ids=["12", "64", "clockwise"])
def test_a_pillar_of_many_walls_is_a_circle_with_centre_and_radius(pillar: Points) -> None:
    (found,) = facets_of(drawn(RECTANGLE, pillar))
    assert found.walls == range(4, 4 + len(pillar))
    assert found.middle == pytest.approx(MIDDLE)
    assert found.radius == pytest.approx(RADIUS)
