"""Shifted walls against the corners of rectangles and triangles, and derivatives against finite differences."""

import math
from pathlib import Path

import numpy as np
import pytest
from sonarhw_compare.fit.free_walls import corner_moves, left_normals, with_shifted_walls
from sonarhw_sim.room.room import Room, load_room, parse_room

CORNERS = {"bottom": (0.0, 0.0), "right": (3.0, 0.0), "top": (3.0, 2.0), "left": (0.0, 2.0)}  # first of each wall


def room_of(corners: dict[str, tuple[float, float]]) -> Room:
    """Return a closed room, counter-clockwise, with a wall from each corner to the next."""
    points = list(corners.values())
    walls = "".join(
        f'[[walls]]\nname = "{name}"\npoints = [{list(begin)}, {list(end)}]\nmaterial = "m"\n'
        for name, begin, end in zip(corners, points, points[1:] + points[:1], strict=True)
    )
    return parse_room(f'name = "room"\n[materials.m]\nreflectance = 0.9\n{walls}', "room")


def test_normals_point_to_the_left_of_each_wall() -> None:
    walls = np.array([[0, 0, 2, 0], [0, 0, 0, 3], [1, 1, 0, 0]], dtype=np.float64)
    half = math.sqrt(0.5)
    assert left_normals(walls) == pytest.approx(np.array([[0, 1], [-1, 0], [half, -half]]))


def test_walls_of_a_rectangle_stay_closed_when_two_of_them_move_inwards() -> None:
    moved = with_shifted_walls(room_of(CORNERS), {"bottom[0]": 0.1, "right[0]": 0.25})
    expected = [[0, 0.1, 2.75, 0.1], [2.75, 0.1, 2.75, 2], [2.75, 2, 0, 2], [0, 2, 0, 0.1]]
    assert moved.walls == pytest.approx(np.array(expected))
    again = room_of({"bottom": (0.0, 0.1), "right": (2.75, 0.1), "top": (2.75, 2.0), "left": (0.0, 2.0)})
    assert sorted(moved.edges.names) == sorted(again.edges.names)


def test_an_oblique_wall_moves_along_its_normal_and_slides_along_its_neighbours() -> None:
    """In a right triangle with legs of 2 m, the hypotenuse x + y = 2 moves inwards."""
    triangle = room_of({"bottom": (0.0, 0.0), "slope": (2.0, 0.0), "left": (0.0, 2.0)})
    moved = with_shifted_walls(triangle, {"slope[0]": 0.1})
    cut = 2 - 0.1 * math.sqrt(2)
    assert moved.walls == pytest.approx(np.array([[0, 0, cut, 0], [cut, 0, 0, cut], [0, cut, 0, 0]]))


def test_two_parts_of_one_straight_wall_move_together() -> None:
    corners = {"one": (0.0, 0.0), "two": (1.0, 0.0), "right": (3.0, 0.0), "top": (3.0, 2.0), "left": (0.0, 2.0)}
    moved = with_shifted_walls(room_of(corners), {"one[0]": 0.1, "two[0]": 0.1})
    assert moved.walls[:2] == pytest.approx(np.array([[0, 0.1, 1, 0.1], [1, 0.1, 3, 0.1]]))


@pytest.mark.parametrize("by", [0.01, -0.01])
def test_a_wall_that_ends_on_another_one_still_ends_on_it(by: float) -> None:
    """Otherwise its end is free, and diffracts: the arena had an edge more for a divider that was off."""
    arena, text = load_room("rooms/arena.toml"), Path("rooms/arena.toml").read_text(encoding="utf-8")
    moved = with_shifted_walls(arena, {"divider": by})  # by the left, towards smaller x
    drawn = parse_room(text.replace("0.84, 1.26], [0.84, 2.10", f"{0.84 - by}, 1.26], [{0.84 - by}, 2.10"), "drawn")
    drawn = parse_room(drawn.text.replace("[0.84, 1.68]", f"[{0.84 - by}, 1.68]"), "drawn")
    assert moved.walls == pytest.approx(drawn.walls)
    assert moved.edges.names == drawn.edges.names


def test_edges_where_a_wall_ends_on_another_one_or_crosses_it_follow_both() -> None:
    walls = '[[walls]]\nname = "across"\npoints = [[0, 1], [4, 1]]\nmaterial = "m"\n' + "".join(
        f'[[walls]]\nname = "{name}"\npoints = [[{x}, 0], [{x}, {end}]]\nmaterial = "m"\n'
        for name, x, end in (("ends", 1.0, 1.0), ("crosses", 3.0, 2.0))
    )
    room = parse_room(f'name = "room"\n[materials.m]\nreflectance = 0.9\n{walls}', "room")
    for point in ([1.0, 1.0], [3.0, 1.0]):
        found = corner_moves(room, np.array(point), {0: 0, 1: 1, 2: 2})
        stem = 1 if point[0] == 1.0 else 2
        assert found[:, 0] == pytest.approx([0, 1])
        assert found[:, stem] == pytest.approx([-1, 0])
        assert found[:, 3 - stem] == pytest.approx([0, 0])


@pytest.mark.parametrize("corner", [(0.0, 0.0), (2.0, 0.5), (1.5, 2.0), (-0.3, 1.6)])
def test_derivatives_of_corners_are_those_of_finite_differences(corner: tuple[float, float]) -> None:
    room = room_of({"a": (0.0, 0.0), "b": (2.0, 0.5), "c": (1.5, 2.0), "d": (-0.3, 1.6)})
    columns = {0: 0, 1: 1, 3: 2}  # wall c is fixed
    (row,) = np.flatnonzero((room.walls[:, :2] == corner).all(axis=1))
    found = corner_moves(room, np.array(corner), columns)
    for wall, column in columns.items():
        moved = with_shifted_walls(room, {room.names[wall]: 1e-6}).walls[row, :2]
        assert found[:, column] == pytest.approx((moved - corner) / 1e-6, abs=1e-5)
