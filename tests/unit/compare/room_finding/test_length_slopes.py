"""First-order changes of paths against a new search for paths in the changed room."""

import math

import pytest
from sonarhw_compare.rooms.draft import DraftEnd, DraftPost, DraftWall, RoomDraft
from sonarhw_compare.rooms.refinement import Move, shifts_of
from sonarhw_sim.air import Air
from sonarhw_sim.rays.paths import Paths, PathSearch, find_paths
from sonarhw_sim.room.room import Room

STANDS = (2.1, 1.0)
SEARCH = PathSearch(max_length=8.0, wavelength=0.007, max_bounces=3, rays=1440)


def draft() -> RoomDraft:
    """Return a rectangle of 4 by 3 m with two walls that stand free, and a post."""
    middles = {0: (4.0, 1.5), 1: (2.0, 3.0), 2: (0.0, 1.5), 3: (2.0, 0.0)}
    walls = {}
    for key, middle in middles.items():
        half = 1.5 if key in (0, 2) else 2.0
        ends = DraftEnd(-half, (key - 1) % 4), DraftEnd(half, (key + 1) % 4)
        walls[key] = DraftWall(middle, (1 + key) * math.pi / 2, ends)
    walls[4] = DraftWall((1.2, 2.2), math.radians(20), (DraftEnd(-0.4), DraftEnd(0.4)))
    walls[5] = DraftWall((3.0, 0.8), math.radians(100), (DraftEnd(-0.5), DraftEnd(0.5)))
    return RoomDraft((), walls, (DraftPost((2.6, 2.3), 0.05),))


STEP = 1e-4  # m or rad
MOVES = [
    *(Move("wall", key, part) for key in range(6) for part in (0, 1)),
    *(Move("wall", key, part) for key in (4, 5) for part in (2, 3)),
    *(Move("post", 0, part) for part in range(3)),
]


def lengths_by_way(paths: Paths, room: Room) -> dict[tuple[str, ...], list[float]]:
    """Return the lengths of all paths by the names of what they touch."""
    found: dict[tuple[str, ...], list[float]] = {}
    for row, length in enumerate(paths.lengths.tolist()):
        found.setdefault(paths.via(row, room), []).append(length)
    return found


@pytest.mark.parametrize("move", MOVES, ids=lambda move: f"{move.what}{move.which}-{move.part}")
def test_a_path_gets_longer_by_what_a_new_search_says(move: Move) -> None:
    room, changed = (move.of(draft(), by).room(Air()) for by in (0.0, STEP))
    paths = find_paths(room, STANDS, SEARCH)
    before, after = lengths_by_way(paths, room), lengths_by_way(find_paths(changed, STANDS, SEARCH), changed)
    slopes = shifts_of(draft(), [move])
    largest, compared = 0.0, 0
    for row in range(len(paths)):
        way = paths.via(row, room)
        if len(before[way]) > 1 or len(after.get(way, [])) != 1:
            continue  # the way exists in one of the rooms only, or twice
        grown = float(slopes.of_length(paths.outline(row))[0]) * STEP
        assert after[way][0] - before[way][0] == pytest.approx(grown, abs=2e-6)
        compared, largest = compared + 1, max(largest, abs(grown))
    assert compared > 20
    assert largest > 0.3 * STEP  # some path touches what is moved
