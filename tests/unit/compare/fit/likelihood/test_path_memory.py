"""Paths at a point are searched once, and again wherever anything that they depend on differs."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from sonarhw_compare.fit import PlacedScan, free_parameters
from sonarhw_compare.fit.objective import MODERATE, Problem, make_problem
from sonarhw_compare.fit.parameters import Parameter
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.predict.prediction import PredictionOptions
from sonarhw_sim.rays.paths import Paths
from sonarhw_sim.room.room import Place, Room, load_room
from sonarhw_sim.space.sections import paths_from

from sonarhw.readings import Reading

ARENA, BOARD = load_room("rooms/arena.toml"), load_board("polaroid-6500")
PLACE = Place("", (0.9, 0.5))
ONE_BOUNCE = PredictionOptions(max_bounces=1, rays=720)


def problem_of(*free: str) -> Problem:
    """Return the problem of a scan with four echoes, one reading without one, and parameters with a prior."""
    times = [(4e-3,), (5e-3,), (), (7e-3,), (8e-3,)]
    readings = [Reading(k, 0, 0, 1.2 * k, 0.1 * k, one, 343.0) for k, one in enumerate(times)]
    parameters: list[Parameter] = list(free_parameters(free, [""], ARENA, BOARD))
    return make_problem([PlacedScan(readings, PLACE)], ARENA, BOARD, parameters, ONE_BOUNCE, all_echoes=False)


@pytest.fixture
def searches(monkeypatch: pytest.MonkeyPatch) -> list[Place]:
    """Return a list that grows with each search of paths."""
    found: list[Place] = []

    def counted(room: Room, place: Place, *others: Any) -> Paths:
        found.append(place)
        return paths_from(room, place, *others)

    monkeypatch.setattr("sonarhw_compare.fit.objective.paths_from", counted)
    return found


def test_paths_at_the_same_point_are_searched_once_whatever_the_noise(searches: list[Place]) -> None:
    problem = problem_of("position", "threshold")
    start = problem.start()
    other_noise = problem.with_noise(start, MODERATE._replace(range=0.002))
    first = problem.near(start).paths
    assert problem.near(other_noise).paths is first
    assert replace(problem, redundancies=(3.0,)).near(start).paths is first
    assert len(searches) == 1


def test_paths_are_searched_again_where_anything_differs_that_they_depend_on(searches: list[Place]) -> None:
    problem = problem_of("position", "threshold")
    start = problem.start()
    problem.near(start)
    moved, deafer = start + np.eye(len(start))[0] * 1e-6, start + np.eye(len(start))[2]
    problem.near(moved)
    problem.near(deafer)
    problem.near(start, replace(ONE_BOUNCE, max_bounces=2))
    replace(problem, room=replace(ARENA, reflectances=ARENA.reflectances * 0.9)).near(start)
    replace(problem, places=(replace(PLACE, position=(1.0, 0.6)),)).near(start)
    assert len(searches) == 6


def test_several_vectors_at_once_have_the_values_of_each_alone() -> None:
    problem = problem_of("position", "heading", "threshold", "reflectance", "wall:east", "temperature")
    start = problem.start()
    random = np.random.default_rng(3)
    vectors = start + problem.steps * random.normal(0.0, 0.5, (21, len(start)))
    vectors[4, problem.size - 1] = 99.0  # outside its bound
    here = problem.near(start)
    alone = [here(one) for one in vectors]
    assert here.many(vectors) == pytest.approx(alone, rel=1e-12)
    assert alone[4] == -math.inf
    assert sum(map(math.isfinite, alone)) >= 15
    assert len({round(one, 6) for one in alone}) > 15
