"""Warnings about places where no scanner can be: outside the room, and inside an object of walls."""

import pytest
from sonarhw_sim.room.room import parse_room, place_doubts

import sonarhw

ROOM = """
name = "Box"
[materials.board]
reflectance = 0.95
[[walls]]
name = "room"
points = [[0.0, 0.0], [4.0, 0.0], [4.0, 3.0], [0.0, 3.0]]
closed = true
material = "board"
[[walls]]
name = "box"
points = [[1.0, 1.0], [1.5, 1.0], [1.5, 1.5], [1.0, 1.5]]
closed = true
material = "board"
edges = ["south", "east", "north", "west"]
[places.desk]
position = [3.0, 2.0]
"""


@pytest.mark.parametrize(
    ("position", "doubts"),
    [
        ((3.0, 2.0), ()),
        ((1.25, 1.6), ()),  # beside the box
        (
            (1.25, 1.25),
            ("place '1.25,1.25' at 1.25, 1.25 m is inside the object of walls 'south' to 'west' of room 'Box'",),
        ),
        ((5.0, 2.0), ("place '5,2' at 5, 2 m is outside room 'Box'",)),
    ],
)
def test_a_place_outside_the_room_or_inside_a_box_is_doubted(
    position: tuple[float, float], doubts: tuple[str, ...]
) -> None:
    room = parse_room(ROOM, "box.toml")
    assert place_doubts(room, room.place(position)) == doubts


def test_predict_warns_of_a_place_inside_a_box() -> None:
    with pytest.warns(UserWarning, match="is inside the object of walls 'south' to 'west'"):
        sonarhw.predict(parse_room(ROOM, "box.toml"), (1.25, 1.25), headings=0.0)
