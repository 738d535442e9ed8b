"""Ends of walls are tried at corners, with a wall at right angles that no place may face, and at other walls."""

import math
from collections.abc import Iterable
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from sonarhw_compare.rooms import candidates
from sonarhw_compare.rooms.candidates import (
    Touches,
    continued,
    cornered,
    trimmed,
    with_better_ends,
    with_free_ends_moved,
)
from sonarhw_compare.rooms.draft import DraftEnd, DraftWall, RoomDraft
from sonarhw_compare.rooms.evidence import Evidence, Scored
from sonarhw_sim.room.room import Place

SOUTH = DraftWall((1.0, 0.0), 0.0, (DraftEnd(-1.0), DraftEnd(1.0)))  # from x = 0 to 2 m


def test_a_corner_beyond_the_end_of_a_wall_is_tried_alone_and_with_a_wall_on_either_side() -> None:
    draft = RoomDraft((Place("", (0.5, 1.0)),), {0: SOUTH})
    made = list(cornered(draft, [(2.4, 0.03)]))
    # the wall is longer by 0.4 m, and the new one begins at its end
    for one in made:
        np.testing.assert_allclose(one.segment(0), [0.0, 0.0, 2.4, 0.0], atol=1e-12)
    new = [one.segment(1) for one in made if 1 in one.walls]
    np.testing.assert_allclose(new, [[2.4, 0.0, 2.4, 0.3], [2.4, 0.0, 2.4, -0.3]], atol=1e-12)
    assert len(made) == 3
    assert all(not one.is_free(0, 1) and not one.is_free(1, 0) for one in made if 1 in one.walls)


def test_the_other_end_of_the_new_wall_is_tried_at_the_next_wall() -> None:
    north = DraftWall((1.0, 1.5), 0.0, (DraftEnd(-1.0), DraftEnd(1.5)))
    draft = RoomDraft((Place("", (0.5, 0.7)),), {0: SOUTH, 1: north})
    made = [one for one in cornered(draft, [(2.4, 0.0)]) if 2 in one.walls]
    lengths = [math.dist(one.segment(2)[:2], one.segment(2)[2:]) for one in made]
    assert lengths == pytest.approx([0.3, 1.5, 0.3])


def test_a_wall_at_right_angles_is_tried_at_each_free_end_on_either_side() -> None:
    west = DraftWall((0.0, 0.5), math.pi / 2, (DraftEnd(-0.5, 0), DraftEnd(0.5)))
    draft = RoomDraft((Place("", (0.5, 1.0)),), {0: SOUTH.with_end(0, DraftEnd(-1.0, 1)), 1: west})
    begun = {tuple(one.segment(2).round(6).tolist()) for one in continued(draft)}
    # the ends at the corner of both are not free
    assert begun == {(2, 0, 2, 0.3), (2, 0, 2, -0.3), (0, 1, 0.3, 1), (0, 1, -0.3, 1)}


@pytest.mark.parametrize("point", [(1.0, 0.0), (2.4, 0.3), (6.0, 0.0)])
def test_no_corner_is_made_within_a_wall_or_away_from_its_line_or_far_beyond_its_end(
    point: tuple[float, float],
) -> None:
    assert list(cornered(RoomDraft((Place("", (0.5, 1.0)),), {0: SOUTH}), [point])) == []


def test_a_corner_that_no_place_sees_ends_at_the_outermost_touch() -> None:
    # a wall from x = 1.4 to 1.6 m hides the corner at x = 2 m from the place on its left, not from the one above
    east = DraftWall((2.0, 0.5), math.pi / 2, (DraftEnd(-0.5, 0), DraftEnd(0.5)))
    screen = DraftWall((1.5, 0.25), math.pi / 2, (DraftEnd(-0.24), DraftEnd(0.25)))
    south = SOUTH.with_end(1, DraftEnd(1.0, 1))
    touched = {0: np.array([-0.9, 0.2]), 1: np.array([0.3, 0.4]), 2: np.array([-0.1, 0.1])}
    ends = []
    for at in ((0.5, 0.3), (1.9, 1.0)):
        draft = RoomDraft((Place("", at),), {0: south, 1: east, 2: screen})
        cut = trimmed(draft, Touches(touched, (), (0,), (0,)), RoomDraft(draft.places))
        ends.append(cut.segment(0)[[0, 2]])
    np.testing.assert_allclose(ends, [[0.1, 1.2], [0.1, 2.0]], atol=1e-9)


def test_an_end_moves_to_another_wall_alone_where_the_scans_contradict_a_corner(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # the lines of both walls cross beyond an end of each
    east = DraftWall((2.4, 0.9), math.pi / 2, (DraftEnd(-0.7), DraftEnd(0.5)))
    draft = RoomDraft((Place("", (0.5, 1.0)),), {0: SOUTH, 1: east})

    def all_scored(_evidence: object, drafts: Iterable[RoomDraft]) -> list[Scored]:
        return [Scored(tried, 0.0 if tried.segment(1)[1] > 0.1 else -50.0) for tried in drafts]

    monkeypatch.setattr(candidates, "all_scored", all_scored)
    evidence = cast(Evidence, None)  # the drafts alone decide here
    moved = with_better_ends(evidence, Scored(draft, 0.0)).draft
    np.testing.assert_allclose(moved.segment(0), [0.0, 0.0, 2.4, 0.0], atol=1e-9)
    np.testing.assert_allclose(moved.segment(1), [2.4, 0.2, 2.4, 1.4], atol=1e-9)


@pytest.mark.parametrize(("per_metre", "expected"), [(30.0, 1.4), (10.0, 2.0)])
def test_a_free_end_far_from_its_place_moves_there_if_this_is_worth_a_wall(
    per_metre: float, expected: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    draft = RoomDraft((Place("", (0.5, 1.0)),), {0: SOUTH})

    def all_scored(_evidence: object, drafts: Iterable[RoomDraft]) -> list[Scored]:
        ends = [tried.segment(0)[[0, 2]] for tried in drafts]
        return [
            Scored(tried, -per_metre * (abs(x) + abs(x2 - 1.4))) for tried, (x, x2) in zip(drafts, ends, strict=True)
        ]

    monkeypatch.setattr(candidates, "all_scored", all_scored)
    evidence = cast(Evidence, SimpleNamespace(first=RoomDraft(())))
    moved = with_free_ends_moved(evidence, Scored(draft, -per_metre * 0.6)).draft
    np.testing.assert_allclose(moved.segment(0), [0.0, 0.0, expected, 0.0], atol=0.03)


def test_an_end_of_a_wall_at_which_the_search_began_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    draft = RoomDraft((Place("", (0.5, 1.0)),), {0: SOUTH})
    monkeypatch.setattr(candidates, "all_scored", lambda _, drafts: [Scored(draft, 1000.0) for draft in drafts])
    best = Scored(draft, 0.0)
    assert with_free_ends_moved(cast(Evidence, SimpleNamespace(first=draft)), best) is best
