"""Limits that hold before memory is allocated."""

from typing import Any

import numpy as np
import pytest
from sonarhw_sim.rays import fan as candidate_table
from sonarhw_sim.rays import fan as path_table
from sonarhw_sim.rays import paths
from sonarhw_sim.rays.diffraction import EdgeDiffraction, EdgePaths, join_at_edges
from sonarhw_sim.rays.fan import Fan, follow_fan
from sonarhw_sim.rays.paths import PathSearch, find_paths
from sonarhw_sim.rays.sequences import PartialPaths

from sonarhw.errors import InputError
from tests.fixtures.rooms_for_tests import room_of


def test_too_many_rays_and_reflections_are_refused_before_memory_is_allocated() -> None:
    room = room_of([(0, 0, 2, 0), (2, 0, 2, 2), (2, 2, 0, 2), (0, 2, 0, 0)])
    search = PathSearch(max_length=1.0, wavelength=0.007, rays=1_000_000, max_bounces=1000)
    with pytest.raises(InputError, match="1000000 rays with up to 1000 reflections each: expected at most 100000000"):
        find_paths(room, (1.0, 1.0), search)


def test_too_many_paths_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    corridor = room_of([(-50, 0, 50, 0), (-50, 1, 50, 1)])
    search = PathSearch(max_length=200.0, wavelength=0.007, max_bounces=500, diffraction=False)
    # image sources: k reflections in a corridor 1 m wide give two paths of about k m, one for each first wall
    assert len(find_paths(corridor, (0.0, 0.4), search)) == 400
    monkeypatch.setattr(path_table, "MOST_POINTS", 40 * 42)
    with pytest.raises(
        InputError, match=r"^too many paths: \d+ or more, .* at most 1680 points in all, .*shorter range"
    ):
        find_paths(corridor, (0.0, 0.4), search)


def test_candidates_of_the_fan_are_limited_as_if_all_had_as_many_points_as_the_longest(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    corridor = room_of([(-50, 0, 50, 0), (-50, 1, 50, 1)])
    fans: list[tuple[Any, ...]] = []
    monkeypatch.setattr(paths, "follow_fan", lambda *given: fans.append(given) or follow_fan(*given))
    find_paths(corridor, (0.0, 0.4), PathSearch(max_length=41.0, wavelength=0.007, max_bounces=500, diffraction=False))
    (fan,) = fans
    candidates = follow_fan(*fan).candidates
    count, points = len(candidates), int(candidates[:, 1].max()) + 2
    monkeypatch.setattr(path_table, "MOST_POINTS", count * points)
    assert len(follow_fan(*fan).candidates) == count
    monkeypatch.setattr(path_table, "MOST_POINTS", count * points - 1)
    with pytest.raises(InputError, match=rf"^too many paths: \d+ or more, with up to {points} points each"):
        follow_fan(*fan)


def test_candidates_do_not_depend_on_the_room_that_their_table_has_at_first(monkeypatch: pytest.MonkeyPatch) -> None:
    room = room_of([(0, 0, 2, 0), (2, 0, 2, 2), (2, 2, 0, 2), (0, 2, 0, 0), (0.5, 0.6, 0.9, 0.7)])
    fans: list[Fan] = []
    monkeypatch.setattr(paths, "follow_fan", lambda *given: fans.append(follow_fan(*given)) or fans[-1])
    search = PathSearch(max_length=12.0, wavelength=0.007)
    find_paths(room, (1.1, 1.3), search)
    monkeypatch.setattr(candidate_table, "_ROOM", 4)
    find_paths(room, (1.1, 1.3), search)
    before, after = fans
    assert len(before.candidates) > 256
    assert np.array_equal(before.candidates, after.candidates)
    for ray, bounces, _ in before.candidates:
        assert np.array_equal(before.touched[ray, :bounces], after.touched[ray, :bounces])


def test_a_table_of_too_many_paths_is_refused_before_it_is_joined(monkeypatch: pytest.MonkeyPatch) -> None:
    table = PartialPaths.none()
    surfaces = np.zeros((1, 5), np.int32)
    one = PartialPaths(*np.ones((3, 1)), surfaces, table.edges, table.bends, np.ones((1, 8, 2)))
    monkeypatch.setattr(path_table, "MOST_POINTS", 80)
    assert len(PartialPaths.join([one] * 10)) == 10
    with pytest.raises(InputError, match="11 or more, with up to 8 points each: expected at most 80"):
        PartialPaths.join([one] * 11)


def test_too_many_paths_past_edges_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    corridor = room_of([(-1, 0, 1, 0), (-1, 1, 1, 1)])
    search = PathSearch(max_length=40.0, wavelength=0.007, faintest_diffraction=1e-4)
    found = find_paths(corridor, (0.0, 0.4), search)
    bent, points = int((found.edges >= 0).sum()), found.points.shape[1]
    # with n paths to an edge there are about n² past it, so these are the first to be too many
    assert bent > 5 * (found.edges < 0).sum()
    monkeypatch.setattr(path_table, "MOST_POINTS", bent * points - 1)
    with pytest.raises(InputError, match=rf"^too many paths: \d+ or more, with up to {points} points each"):
        find_paths(corridor, (0.0, 0.4), search)
    monkeypatch.setattr(path_table, "MOST_POINTS", 2 * len(found) * points)
    assert len(find_paths(corridor, (0.0, 0.4), search)) == len(found)


def test_too_many_pairs_of_paths_at_an_edge_are_not_listed(monkeypatch: pytest.MonkeyPatch) -> None:
    edges = room_of([(0, 0, 1, 0)]).edges
    to_edge = EdgePaths(np.zeros(20, np.int32), np.linspace(1, 2, 20), np.ones(20), np.full(20, 0.1), np.zeros(20))
    diffraction = EdgeDiffraction(wavelength=0.007, faintest=0.0)
    # each pair is computed once and listed with its reverse
    once = 20 * 21 // 2
    monkeypatch.setattr(path_table, "MOST_POINTS", 3 * once)
    assert len(join_at_edges(to_edge, to_edge, edges, np.ones((2, 2)), diffraction, 4.0)[0]) == 400
    monkeypatch.setattr(path_table, "MOST_POINTS", 3 * once - 1)
    with pytest.raises(InputError, match="210 or more, with up to 3 points each"):
        join_at_edges(to_edge, to_edge, edges, np.ones((2, 2)), diffraction, 4.0)
