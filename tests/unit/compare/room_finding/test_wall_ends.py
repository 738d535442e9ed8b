"""A corner at the end of a wall is tried with a wall at right angles, which no place may face."""

import math

import numpy as np
import pytest
from sonarhw_compare.room_finding.draft import DraftEnd, DraftWall, RoomDraft
from sonarhw_compare.room_finding.wall_ends import cornered
from sonarhw_sim.room.model import Place

SOUTH = DraftWall((1.0, 0.0), 0.0, (DraftEnd(-1.0), DraftEnd(1.0)))  # from x = 0 to 2 m


@pytest.mark.parametrize("side", [1, -1])
def test_a_corner_beyond_the_end_of_a_wall_is_made_on_the_side_of_the_places(side: int) -> None:
    draft = RoomDraft((Place("", (0.5, side * 1.0)), Place("", (1.5, side * 0.8))), {0: SOUTH})
    (made,) = cornered(draft, [(2.4, side * 0.03)])
    # the wall is longer by 0.4 m, and the new one begins at its end
    np.testing.assert_allclose(made.segment(0), [0.0, 0.0, 2.4, 0.0], atol=1e-12)
    np.testing.assert_allclose(made.segment(1), [2.4, 0.0, 2.4, side * 0.3], atol=1e-12)
    assert not made.is_free(0, 1)
    assert not made.is_free(1, 0)


def test_the_other_end_of_the_new_wall_is_tried_at_the_next_wall() -> None:
    north = DraftWall((1.0, 1.5), 0.0, (DraftEnd(-1.0), DraftEnd(1.5)))
    draft = RoomDraft((Place("", (0.5, 0.7)),), {0: SOUTH, 1: north})
    made = list(cornered(draft, [(2.4, 0.0)]))
    lengths = [math.dist(one.segment(2)[:2], one.segment(2)[2:]) for one in made]
    assert lengths == pytest.approx([0.3, 1.5])


@pytest.mark.parametrize("point", [(1.0, 0.0), (2.4, 0.3), (6.0, 0.0)])
def test_no_corner_is_made_within_a_wall_or_away_from_its_line_or_far_beyond_its_end(
    point: tuple[float, float],
) -> None:
    assert list(cornered(RoomDraft((Place("", (0.5, 1.0)),), {0: SOUTH}), [point])) == []
