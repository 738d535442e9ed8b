"""Walls of a draft meet where their lines cross, and keep their corners when a wall moves or goes."""

import math
from dataclasses import replace

import numpy as np
from sonarhw_compare.rooms.draft import DraftEnd, DraftPost, DraftWall, RoomDraft, draft_of_room, meeting
from sonarhw_sim.air import Air
from sonarhw_sim.room.room import parse_room

FLAT = DraftWall((1.0, 0.0), 0.0, (DraftEnd(-1.0), DraftEnd(0.5, 1)))
UPRIGHT = DraftWall((2.0, 1.0), math.pi / 2, (DraftEnd(-0.5, 0), DraftEnd(1.0)))
CORNER = RoomDraft((), {0: FLAT, 1: UPRIGHT})


def test_ends_meet_where_the_lines_cross() -> None:
    assert np.allclose(CORNER.segments, [[0, 0, 2, 0], [2, 0, 2, 2]])


def test_a_corner_follows_a_moved_wall() -> None:
    moved = CORNER.with_wall(1, UPRIGHT.moved(0.25, 0.0))  # to its left: towards smaller x
    assert np.allclose(moved.segments, [[0, 0, 1.75, 0], [1.75, 0, 1.75, 2]])


def test_a_turned_wall_turns_about_its_middle() -> None:
    turned = CORNER.with_wall(1, UPRIGHT.moved(0.0, math.radians(45)))
    assert np.allclose(turned.segments[0], [0, 0, 3, 0])


def test_parallel_walls_do_not_meet() -> None:
    assert meeting(FLAT, FLAT.moved(1.0, math.radians(3))) is None


def test_ends_stay_where_they_are_when_the_wall_that_they_met_goes() -> None:
    alone = CORNER.without_wall(1)
    assert np.allclose(alone.segments, [[0, 0, 2, 0]])
    assert alone.is_free(0, 1)


def test_ends_meet_the_twin_of_a_wall_that_goes() -> None:
    twins = CORNER.with_wall(2, UPRIGHT.moved(0.02, 0.0))
    assert twins.without_wall(1).walls[0].ends[1].meets == 2


def test_other_walls_keep_their_length_without_one() -> None:
    # another wall crosses the line 1 cm from the middle of a short one, so that its end could meet it there
    short = DraftWall((2.0, 0.0), 0.0, (DraftEnd(-0.04, 1), DraftEnd(0.0)))
    first = DraftWall((1.96, 0.5), math.pi / 2, (DraftEnd(-0.5), DraftEnd(0.5)))
    draft = RoomDraft((), {0: short, 1: first, 2: first.moved(-0.03, 0.0)})
    assert draft.is_sound
    assert not draft.without_wall(1).is_sound
    assert np.allclose(draft.without_only(1).segments, draft.segments[[0, 2]])


def test_an_end_at_a_wall_that_does_not_reach_it_is_free() -> None:
    short = CORNER.with_wall(1, UPRIGHT.with_end(0, DraftEnd(-0.5)))
    assert short.is_free(0, 1)
    assert not CORNER.is_free(0, 1)


def test_a_gap_divides_a_wall_and_its_corners() -> None:
    divided, behind = CORNER.with_wall(0, FLAT.with_end(1, DraftEnd(-0.2))).with_new_wall(
        FLAT.with_end(0, DraftEnd(0.2))
    )
    opened = divided.with_meeting_moved(0, behind, 0.2)
    assert opened.walls[1].ends[0].meets == behind
    assert np.allclose(opened.segments, [[0, 0, 0.8, 0], [2, 0, 2, 2], [1.2, 0, 2, 0]])


def test_a_draft_is_a_room_with_its_corner() -> None:
    room = CORNER.room(Air())
    assert room.names == ("wall 1", "wall 2")
    assert set(room.reflectances) == {0.9}
    assert "wall 1/wall 2" in room.edges.names


def test_an_edited_room_is_a_draft_with_its_corners() -> None:
    room = replace(CORNER, posts=(DraftPost((1.0, 1.0), 0.1),)).room(Air())
    draft = draft_of_room(room)
    assert np.allclose(draft.segments, room.walls)
    assert draft.posts == (DraftPost((1.0, 1.0), 0.1),)
    assert [[end.meets for end in wall.ends] for wall in draft.walls.values()] == [[None, 1], [0, None]]
    # the corner stays one when a wall moves
    assert np.allclose(draft.with_wall(1, draft.walls[1].moved(0.25, 0.0)).segments[0], [0, 0, 1.75, 0])


def test_walls_on_one_line_have_no_corner() -> None:
    halves = CORNER.with_wall(1, FLAT.moved(0.0, 0.0)).with_wall(0, DraftWall((-1.0, 0.0), 0.0, FLAT.ends))
    draft = draft_of_room(replace(halves, walls={k: _free(wall) for k, wall in halves.walls.items()}).room(Air()))
    assert [end.meets for wall in draft.walls.values() for end in wall.ends] == [None] * 4


def _free(wall: DraftWall) -> DraftWall:
    return replace(wall, ends=(DraftEnd(-1.0), DraftEnd(1.0)))


def test_corners_of_a_draft_are_corners_of_its_room() -> None:
    # the crossing of two lines, computed from either, differs by rounding; two free ends would diffract there
    corners = [(0.1, 0.2), (2.3, 0.5), (2.7, 1.9), (1.1, 2.6), (0.3, 1.7)]
    text = 'name = "r"\n[materials.m]\nreflectance = 0.9\n[[walls]]\nname = "w"\nclosed = true\nmaterial = "m"\n'
    true = parse_room(f"{text}points = {[list(corner) for corner in corners]}", "r")
    drawn = draft_of_room(true)
    moved = replace(drawn, walls={key: wall.moved(0.0, 1e-4 * key) for key, wall in drawn.walls.items()})
    for draft in (drawn, moved):
        assert len(draft.room(Air()).edges) == len(true.edges)
        assert len(np.unique(draft.room(Air()).walls.reshape(-1, 2), axis=0)) == len(corners)
