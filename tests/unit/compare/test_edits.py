"""Edits of a room change what they should, and nothing else."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sonarhw_compare.edits import (
    add_post,
    add_wall,
    corners,
    move_corner,
    move_post,
    move_wall,
    remove_surface,
    resize_post,
    set_material,
    split_wall,
)
from sonarhw_sim.air import Air
from sonarhw_sim.room.room import Place, Room, load_room, parse_room
from sonarhw_sim.room.room_writing import with_air, with_material, with_place

from sonarhw.errors import InputError
from tests.checkout import CHECKOUT
from tests.unit.sim.test_room import assert_same_rooms, comments

FOLDER = CHECKOUT / "rooms"


SIMPLE, DOORSTEP = load_room(FOLDER / "simple.toml"), load_room(FOLDER / "doorstep.toml")


COMMENTED = """# my lab
name = "lab"

# ==== materials ====

# guessed
[materials.m]
reflectance = 0.9  # guess

[materials.n]
reflectance = 0.5

# the outer walls
[[walls]]
name = "outer"
points = [
    # from the door
    [0.0, 0.0],  # door
    [4.0, 0.0],
    [4.0, 3.0],  # window
    [0.0, 3.0],
    # and back
]
closed = true  # all round
material = "m"

# ==== furniture ====

# the bench
[[walls]]
name = "bench"
points = [[1.0, 1.0], [2.0, 1.0]]
material = "m"

# the pillar
[[posts]]
name = "pillar"
center = [3.0, 2.0]
radius = 0.1
material = "m"

# where it stands
[places.here]
position = [1.0, 2.0]  # to 1 cm
# the end
"""


LAB = parse_room(COMMENTED, "the lab")


Edit = Callable[[Room], Room]


COORDINATES = st.floats(-20, 20).map(lambda x: round(x, 3))


POINTS = st.tuples(COORDINATES, COORDINATES)


def wall(room: Room, name: str) -> list[float]:
    return room.walls[room.names.index(name)].tolist()


def test_moving_a_wall_moves_the_ends_of_its_neighbours() -> None:
    room = move_wall(SIMPLE, SIMPLE.names.index("top"), (0.0, 0.1))
    np.testing.assert_allclose(wall(room, "top"), [0.928, 0.842, 0.0, 0.842])
    np.testing.assert_allclose(wall(room, "right"), [0.928, 0.0, 0.928, 0.842])
    assert corners(room)[0] == (0.0, 0.0)


def test_the_last_wall_and_the_floor_cannot_be_removed() -> None:
    room = load_room(FOLDER / "figure2b.toml")
    with pytest.raises(InputError, match="last wall"):
        remove_surface(room, 0)
    with pytest.raises(InputError, match="floor cannot be removed"):
        remove_surface(DOORSTEP, DOORSTEP.levels.start)


def test_a_post_is_added_moved_resized_and_removed() -> None:
    room = add_post(SIMPLE, (0.3, 0.5), 0.05, "shelving")
    post = room.names.index("post 1")
    room = resize_post(move_post(room, post, (0.4, 0.5)), post, 0.08)
    np.testing.assert_array_equal(room.posts, [[0.4, 0.5, 0.08]])
    assert remove_surface(room, post).text.strip() == SIMPLE.text.strip()


@pytest.mark.parametrize(
    ("click", "corner"), [((2.0, 0.03), (2.0, 0.0)), ((2.0004, -0.05), (2.0, 0.0)), ((4.02, 1.5), (4.0, 1.5))]
)
def test_a_new_corner_lies_on_its_wall(click: tuple[float, float], corner: tuple[float, float]) -> None:
    number = 0 if corner[1] == 0 else 1
    assert split_wall(LAB, number, click).walls[number, 2:].tolist() == list(corner)


@settings(max_examples=40, deadline=None)
@given(data=st.data())
def test_any_edit_can_be_read_back_and_changes_nothing_else(data: st.DataObject) -> None:
    room = data.draw(st.sampled_from([SIMPLE, DOORSTEP]))
    for _ in range(data.draw(st.integers(1, 5))):
        surface = data.draw(st.integers(0, len(room.names) - 1))
        number = data.draw(st.integers(0, len(room.walls) - 1))
        material = data.draw(st.sampled_from(sorted(set(room.materials))))
        one, other, radius = data.draw(POINTS), data.draw(POINTS), data.draw(st.floats(0.001, 3))
        edits: list[Edit] = [
            lambda room, one=one, number=number: move_corner(room, tuple(room.walls[number, :2].tolist()), one),
            lambda room, one=one, number=number: move_wall(room, number, one),
            lambda room, one=one, number=number: split_wall(room, number, one),
            lambda room, one=one, other=other, material=material: add_wall(room, one, other, material),
            lambda room, one=one, radius=radius, material=material: add_post(room, one, radius, material),
            lambda room, surface=surface: remove_surface(room, surface),
            lambda room, surface=surface, material=material: set_material(room, surface, material),
        ]
        try:
            after = data.draw(st.sampled_from(edits))(room)
        except InputError:
            continue
        assert_same_rooms(parse_room(after.text, "again"), after)
        assert after.places == room.places
        assert after.air == room.air
        assert len(set(room.names) - set(after.names)) <= 1
        assert math.isfinite(np.abs(after.walls).max())
        room = after


def above(room: Room, line: str, occurrence: int = 0) -> str:
    """Return the line above a line of the room's text, without empty lines."""
    lines = [text for text in room.text.splitlines() if text.strip()]
    return lines[[k for k, text in enumerate(lines) if text == line][occurrence] - 1]


@pytest.mark.parametrize(
    "edit",
    [
        lambda room: split_wall(room, 0, (2.0, 0.0)),
        lambda room: remove_surface(room, room.names.index("outer[1]")),
        lambda room: set_material(room, room.names.index("outer[1]"), "n"),
        lambda room: add_wall(room, (1.0, 0.5), (2.0, 0.5), "n"),
        lambda room: add_post(room, (1.0, 0.5), 0.1, "n"),
        lambda room: with_material(room, "n", 0.4, 0.1),
        lambda room: with_material(room, "foam", 0.1, 0.0),
        lambda room: with_place(room, Place("here", (1.5, 2.0), 0.5)),
        lambda room: with_place(room, Place("there", (1.5, 2.0))),
        lambda room: with_air(room, Air(5.0)),
    ],
)
def test_an_edit_keeps_every_comment_above_the_table_that_it_describes(edit: Edit) -> None:
    room = edit(LAB)
    assert {one.strip() for one in comments(COMMENTED)} <= {one.strip() for one in comments(room.text)}
    for occurrence, line in enumerate(("# the outer walls", "# the bench")):
        assert above(room, "[[walls]]", occurrence) == line
    for table, line in (("[materials.m]", "# guessed"), ("[places.here]", "# where it stands")):
        assert above(room, table) == line
    assert above(room, "[[posts]]") == "# the pillar"


@pytest.mark.parametrize(("name", "own"), [("bench[0]", "the bench"), ("pillar", "the pillar")])
def test_a_removed_object_takes_its_own_comment_along_and_no_other(name: str, own: str) -> None:
    room = remove_surface(LAB, LAB.names.index(name))
    kept = [one.strip() for one in comments(COMMENTED) if one.strip() != own]
    assert [one.strip() for one in comments(room.text)] == kept
