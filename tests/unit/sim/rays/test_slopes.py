"""Rays with different slopes in one direction are followed as one until they part."""

import numpy as np
import pytest
from sonarhw_sim.rays.detectable import all_rays
from sonarhw_sim.rays.kernel import fan, follow_fan
from sonarhw_sim.rays.passing import Passing
from sonarhw_sim.room.model import parse_room

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
    targets, longest = np.vstack((here, other)), np.full(2, LONGEST)
    limits = all_rays(len(directions), 2)
    found = follow_fan(here, directions, ROOM.surfaces, ROOM.reflectances, targets, longest, 6, limits, passing=passing)
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
