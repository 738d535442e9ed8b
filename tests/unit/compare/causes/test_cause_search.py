"""Causes of misfits are found in scans of rooms that differ from the given one in a known way."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from sonarhw_compare.rooms.causes import (
    FoundCauses,
    MovedWall,
    NewPost,
    NewWall,
    OtherReflectance,
    find_causes,
)
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.predict.prediction import predict_scan
from sonarhw_sim.room.room import Place, Room, load_room, parse_room

from sonarhw.errors import InputError
from sonarhw.readings import Reading

YARD = """name = "Yard with a plate"
[materials.board]
reflectance = 0.9
[[walls]]
name = "yard"
points = [[-1.0, -1.0], [3.0, -1.0], [3.0, 3.0], [-1.0, 3.0]]
closed = true
material = "board"
edges = ["south", "east", "north", "west"]
[[walls]]
name = "plate"
points = [[1.0, 1.1], [1.6, 1.1]]
material = "board"
edges = ["plate"]
[places.here]
position = [0.0, 1.1]
"""
GIVEN = parse_room(YARD, "the yard")
HERE = GIVEN.places["here"]
BOARD = load_board("polaroid-6500")
SPEED = 343.2


def scan_of(room: Room, noise: float = 0.01) -> tuple[Reading, ...]:
    """Return a scan of the true room, with normal errors of the ranges."""
    angles = np.radians(np.arange(0.0, 360.0, 5.0))
    ranges = predict_scan(room, HERE, BOARD, angles).ranges + np.random.default_rng(1).normal(0, noise, len(angles))
    times = [() if math.isnan(one) else (2 * one / SPEED,) for one in ranges.tolist()]
    return tuple(Reading(k, 0, 0, float(angles[k]), 0.1 * k, times[k], SPEED) for k in range(len(angles)))


def whole_scan_of(room: Room, place: Place, step: float = 3.0, noise: float = 0.01) -> tuple[Reading, ...]:
    """Return a scan with all echoes of each ping, up to 29, each with an error of range."""
    angles, random = np.radians(np.arange(0.0, 360.0, step)), np.random.default_rng(1)
    predicted = predict_scan(room, place, BOARD, angles)
    pings = [np.array(predicted.ping(k).echo_times()) for k in range(len(angles))]
    times = [np.sort(ping + random.normal(0, 2 * noise / SPEED, len(ping))).tolist() for ping in pings]
    return tuple(Reading(k, 0, 0, float(angles[k]), 0.1 * k, tuple(times[k]), SPEED) for k in range(len(angles)))


def found_in(true: Room) -> FoundCauses:
    return find_causes(scan_of(true), GIVEN, HERE, BOARD)


def test_nothing_is_proposed_where_nothing_differs() -> None:
    found = found_in(GIVEN)
    assert found.causes == ()
    assert found.room is GIVEN


def test_nothing_is_proposed_for_echoes_by_many_reflections() -> None:
    arena = load_room("arena")
    place = arena.places["p1"]
    assert find_causes(whole_scan_of(arena, place), arena, place, BOARD).causes == ()


def test_a_wall_that_faces_no_place_is_found_by_its_edge() -> None:
    room = load_room("kuc_siegel")
    ends = (0.182, 0.306), (0.238, 0.134)
    place = room.places["figure6"]
    cause = find_causes(whole_scan_of(NewWall(*ends).applied(room), place), room, place, BOARD).causes[0]
    assert isinstance(cause.change, NewWall)
    for found, true in zip(sorted([cause.change.start, cause.change.end]), ends, strict=True):
        assert math.dist(found, true) < 0.06


def test_the_leg_of_a_chair_is_a_post_at_its_place() -> None:
    found = found_in(NewPost((0.3, 0.3), 0.03).applied(GIVEN))
    first = found.causes[0]
    assert isinstance(first.change, NewPost)
    # one place does not show how far behind its nearest point the middle of a thin post is
    assert math.dist(first.change.center, (0.3, 0.3)) < 0.06
    to_post = math.degrees(math.atan2(0.3 - 1.1, 0.3)) % 360
    assert any(math.degrees(a) - 1 <= to_post <= math.degrees(b) + 1 for a, b in first.sectors)
    before, after = (one.summary().within_5cm or 0.0 for one in (found.before, found.after))
    assert after > before
    assert after > 0.95
    assert "something near 0.3" in first.text()


def test_a_post_is_found_between_walls_whose_echoes_overlap_its_own() -> None:
    scan = whole_scan_of(NewPost((0.6, 1.0), 0.015).applied(GIVEN), HERE, 10.0, 0.0)
    found = find_causes(scan, GIVEN, HERE, BOARD).causes[0]
    assert isinstance(found.change, NewPost)
    assert math.dist(found.change.center, (0.6, 1.0)) < 0.04  # 6 cm where its arc is


def test_a_post_in_another_one_is_refused() -> None:
    with_post = NewPost((0.5, 0.5), 0.03).applied(GIVEN)
    with pytest.raises(InputError, match=r"a post at 0\.54, 0\.50.* overlaps another one"):
        NewPost((0.54, 0.5), 0.02).applied(with_post)
    assert len(NewPost((0.56, 0.5), 0.02).applied(with_post).posts) == 2


def test_a_wall_that_is_2_cm_farther_is_named_with_its_distance() -> None:
    (cause,) = found_in(MovedWall("west", -0.02, 0.02).applied(GIVEN)).causes
    assert isinstance(cause.change, MovedWall)
    assert (cause.change.wall, cause.change.farther) == ("west", pytest.approx(0.02, abs=0.006))
    assert "wall west is 0.0" in cause.text()
    assert "m farther" in cause.text()


def test_a_wall_is_not_moved_so_far_that_a_short_neighbour_loses_its_length() -> None:
    plank = """[[walls]]
name = "plank"
points = [[0.5, -1.0], [0.5, -0.98], [1.5, -0.98], [1.5, -1.0]]
material = "board"
edges = ["plank-left", "plank", "plank-right"]
[places.here]"""
    with_plank = parse_room(YARD.replace("[places.here]", plank), "the yard with a plank")
    assert find_causes(scan_of(with_plank), with_plank, HERE, BOARD).causes == ()


def test_an_edge_that_is_weaker_is_named() -> None:
    (cause,) = found_in(OtherReflectance("plate", 0.9, 0.1).applied(GIVEN)).causes
    assert isinstance(cause.change, OtherReflectance)
    assert cause.change.reflectance < 0.5
    assert "edge plate/ is weaker than assumed" in cause.text()


@pytest.mark.parametrize(
    "change",
    [
        lambda room: NewPost((0.5, 0.5), 0.1).applied(room),
        lambda room: NewWall((0.5, 0.5), (0.7, 0.5)).applied(room),
        lambda room: MovedWall("east", 0.05, -0.05).applied(room),
        lambda room: OtherReflectance("north", 0.9, 0.4).applied(room),
    ],
)
def test_a_changed_room_is_the_room_of_its_text(change: Callable[[Room], Room]) -> None:
    changed = change(GIVEN)
    again = parse_room(changed.text, "again")
    assert np.array_equal(again.walls, changed.walls)
    assert np.array_equal(again.posts, changed.posts)
    assert np.array_equal(again.reflectances, changed.reflectances)
    assert changed.text != GIVEN.text


def test_a_moved_wall_stretches_its_neighbours() -> None:
    moved = MovedWall("east", 0.05, -0.05).applied(GIVEN)
    assert moved.walls[moved.names.index("east")].tolist() == [2.95, -1.0, 2.95, 3.0]
    assert moved.walls[moved.names.index("south")].tolist() == [-1.0, -1.0, 2.95, -1.0]
