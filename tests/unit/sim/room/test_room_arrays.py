"""Rooms from arrays and shapes have the walls, posts and places that a room file with the same numbers has."""

import copy
import pickle
from dataclasses import replace
from typing import ClassVar

import numpy as np
import pytest
from sonarhw_sim.room.room import Room, parse_room
from sonarhw_sim.room.room_arrays import room_from_arrays

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


def test_a_room_in_centimetres_is_warned_of() -> None:
    with pytest.warns(UserWarning, match="the room extends over 400 m; if these are centimetres"):
        room_from_arrays(100 * np.array(SQUARE))


def test_rooms_are_values() -> None:
    def made() -> Room:
        return room_from_arrays(SQUARE, [[2, 2, 0.1]], places={"door": (1, 1)})

    room = made()
    assert room == made() == pickle.loads(pickle.dumps(room)) == copy.deepcopy(room)
    assert len({room, made()}) == 1
    assert room != replace(room, walls=room.walls + 0.01)
    assert room != "room"
    assert repr(room) == "Room('room', 4 walls, 1 post, places: door)"
