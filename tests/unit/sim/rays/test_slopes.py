"""Rays with different slopes in one direction are followed as one until they part."""

from dataclasses import replace

import numpy as np
import pytest
from sonarhw_sim.rays.fan import Targets, all_rays, fan, follow_fan
from sonarhw_sim.rays.passing import Passing
from sonarhw_sim.rays.paths import Paths, PathSearch
from sonarhw_sim.room.room import Place, Room, parse_room
from sonarhw_sim.space.folding import loudest_at
from sonarhw_sim.space.sections import paths_from

from tests.oracles.rooms_with_heights import BOX, room_of, wall

LONGEST = 9.0
ROOM = parse_room(
    """
name = "fences"
[materials.hard]
reflectance = 0.9
[[walls]]
name = "room"
points = [[0, 0], [3, 0], [3, 2], [0, 2]]
closed = true
material = "hard"
[[walls]]
name = "fence"
points = [[0.5, 0.4], [0.9, 1.6]]
height = [0.0, 0.7]
material = "hard"
[[walls]]
name = "panel"
points = [[0.5, 0.4], [0.9, 1.6]]
height = [1.3, 2.0]
material = "hard"
[[posts]]
name = "stump"
center = [2.2, 0.5]
radius = 0.1
height = [0.0, 0.9]
material = "hard"
""",
    "fences",
)


def _found(directions: np.ndarray, passing: Passing) -> set[tuple[int, ...]]:
    """Return the target and the surfaces of all candidates."""
    here, other = np.array([1.4, 0.8]), np.array([2.6, 1.5])
    targets = Targets.at(np.vstack((here, other)), np.full(2, LONGEST))
    limits = all_rays(len(directions), 2)
    found = follow_fan(ROOM, here, directions, targets, 6, limits, passing)
    return {(target, *found.touched[ray, :count].tolist()) for ray, count, target in found.candidates.tolist()}


def test_rays_that_part_find_what_each_finds_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    low = np.isfinite(ROOM.heights).any(axis=1)
    climbs = np.array([-2.2, 2.6, -4.8, 4.8])
    passing = Passing(ROOM.surfaces, ROOM.heights, low, 1.1, 0.0, 2.4, climbs, LONGEST, False)
    directions = fan(360)
    of_each = passing.slopes(directions)
    together = _found(directions, passing)
    alone: set[tuple[int, ...]] = set()
    for slope in np.ascontiguousarray(of_each.T):  # as in a search, so that no kernel is compiled for another layout
        monkeypatch.setattr(Passing, "slopes", lambda *_, slope=slope: slope[:, None])
        alone |= _found(directions, passing)
    assert together == alone
    assert {bool(low[list(surfaces)].any()) for _, *surfaces in alone if surfaces} == {True, False}


def test_a_narrow_beam_omits_only_paths_past_edges_that_it_cannot_hear() -> None:
    text = BOX + wall("fence", (0.6, 0.3), (1.0, 1.6), height=(0.0, 0.5))
    room, place = room_of(text), Place("here", (1.6, 0.7), height=0.9)
    narrow = PathSearch(12.0, 0.00696, ka=8.0, faintest_diffraction=1e-4)
    heard, all_ = (paths_from(room, place, search) for search in (narrow, replace(narrow, ka=None)))
    expected = _same_way_back(all_, room)
    loud = all_.gains[expected] * loudest_at(all_.elevations[expected, 0], narrow) >= 10 * narrow.faintest_diffraction
    found = heard.lengths[_same_way_back(heard, room)]
    assert np.sort(found) == pytest.approx(np.sort(all_.lengths[expected[loud]]))
    assert 5 < len(found) < len(expected)


def _same_way_back(paths: Paths, room: Room) -> np.ndarray:
    """Return the rows of paths out of the horizontal, past an upright edge, that return from where they left."""
    apart = np.abs(np.angle(np.exp(1j * (paths.departures - paths.arrivals))))
    upright = (paths.edges >= 0) & (paths.edges < len(room.edges))
    return np.flatnonzero(upright & (paths.elevations[:, 0] != 0.0) & (apart < 1e-6))
