"""Closed chains of walls separate only the edges beyond them, and do not change paths."""

import math
from dataclasses import fields, replace

import numpy as np
import pytest
from sonarhw_sim.rays.paths import Paths, PathSearch, find_paths
from sonarhw_sim.room.room import Enclosures, Room, find_enclosures

from tests.fixtures.rooms_for_tests import polygon_room, room_of, star_room

SEARCH = PathSearch(8.0, 0.00696, 6)
BOX = """
[[walls]]
name = "box"
points = [[0.2, 0.3], [0.6, 0.3], [0.6, 0.5], [0.2, 0.5]]
closed = true
material = "hard"
"""
ROOM = polygon_room([(-1.0, -1.0), (1.5, -1.0), (1.5, 1.2), (-1.0, 1.2)], extra=BOX)


def separated_from(room: Room, x: float, y: float) -> set[str]:
    shut = room.enclosures.separated_from(np.array([x, y]))
    return {name for name, gone in zip(room.edges.names, shut, strict=True) if gone}


def test_from_inside_the_room_its_outer_corners_are_unreachable_and_the_boxs_reachable() -> None:
    assert separated_from(ROOM, 0.0, 0.0) == {"w[0]/w[3]", "w[2]/w[3]", "w[0]/w[1]", "w[1]/w[2]"}


def test_from_outside_the_room_its_corners_are_reachable() -> None:
    assert separated_from(ROOM, 5.0, 0.0) == set()


def test_from_inside_the_box_its_outer_corners_are_unreachable() -> None:
    assert {name for name in separated_from(ROOM, 0.4, 0.4) if "box" in name} == {
        "box[0]/box[3]",
        "box[2]/box[3]",
        "box[0]/box[1]",
        "box[1]/box[2]",
    }


def test_from_a_wall_all_edges_are_reachable() -> None:
    assert separated_from(ROOM, 0.0, -1.0) == set()


def test_open_chain_separates_no_edges() -> None:
    gap = polygon_room([(-1.0, -1.0), (1.5, -1.0), (1.5, 1.2), (-1.0, 1.2)], closed=False)
    assert len(find_enclosures(gap.walls, gap.edges).starts) == 0
    assert separated_from(gap, 0.0, 0.0) == set()


def without_enclosures(room: Room) -> Room:
    blind = replace(room)
    nothing = np.empty(0, np.intp)
    blind.__dict__["enclosures"] = Enclosures(
        np.empty((0, 4)), nothing, nothing, nothing, np.empty(0, np.bool_), len(room.edges)
    )
    return blind


def assert_same_paths(one: Paths, other: Paths) -> None:
    for column in fields(Paths):
        np.testing.assert_array_equal(getattr(one, column.name), getattr(other, column.name))


@pytest.mark.parametrize("seed", range(6))
def test_paths_are_the_same_without_enclosures(seed: int) -> None:
    room = star_room(seed, 7, convex=False)
    assert len(room.edges) > 0
    random = np.random.default_rng(seed)
    for distance in (0.3, 4.0):
        angle = random.uniform(0, math.tau)
        position = distance * math.cos(angle), distance * math.sin(angle)
        assert_same_paths(find_paths(room, position, SEARCH), find_paths(without_enclosures(room), position, SEARCH))


def test_chain_with_crossing_walls_separates_only_unreachable_edges() -> None:
    eight = polygon_room([(-1.0, -1.0), (1.0, 1.0), (1.0, -1.0), (-1.0, 1.0)])
    for position in ((0.5, 0.1), (-0.6, 0.0), (0.0, 0.6), (3.0, 0.2)):
        assert_same_paths(find_paths(eight, position, SEARCH), find_paths(without_enclosures(eight), position, SEARCH))


@pytest.mark.parametrize(
    ("point", "outside"),
    [((1.0, 1.0), False), ((5.0, 5.0), True), ((-0.1, 1.0), True), ((0.0, 1.0), False), ((2.9, 2.9), True)],
)
def test_points_that_no_chain_encloses_are_outside(point: tuple[float, float], outside: bool) -> None:
    l_shaped = polygon_room([(0.0, 0.0), (3.0, 0.0), (3.0, 2.0), (2.0, 2.0), (2.0, 3.0), (0.0, 3.0)])
    assert l_shaped.is_outside(point) is outside


def test_open_rooms_have_no_outside() -> None:
    assert not polygon_room([(0.0, 0.0), (3.0, 0.0), (3.0, 2.0)], closed=False).is_outside((9.0, 9.0))
    box = [(1.0, 1.0, 2.0, 1.0), (2.0, 1.0, 2.0, 2.0), (2.0, 2.0, 1.0, 2.0), (1.0, 2.0, 1.0, 1.0)]
    assert not room_of([(0.0, 0.0, 9.0, 0.0), *box]).is_outside((0.5, 0.5))
    assert room_of(box).is_outside((0.5, 0.5))
