"""Moved paths equal those of a new search, and probabilities of all readings sum to one."""

import math
from dataclasses import replace

import numpy as np
import pytest
from sonarhw_compare.fit import PlacedScan, free_parameters
from sonarhw_compare.fit.likelihood.echo_likelihood import ReadingNoise
from sonarhw_compare.fit.likelihood.echo_paths import displaced, echo_paths, growth_by_wall, moved
from sonarhw_compare.fit.likelihood.objective import Objective, make_problem
from sonarhw_compare.fit.values.free_walls import with_shifted_walls
from sonarhw_sim.board.profile import Board, load_board
from sonarhw_sim.predict.prediction import PredictionOptions, predict_scan, search_for
from sonarhw_sim.rays.paths import Paths, find_paths
from sonarhw_sim.room.model import Place, Room, load_room

from sonarhw.readings import FloatArray, Reading

ARENA = load_room("rooms/arena.toml")
BOARD = load_board("polaroid-6500")
HERE, THERE = (0.9, 0.5), (0.912, 0.491)
BY = (0.012, -0.009)
SEARCH = search_for(ARENA, BOARD, PredictionOptions(max_bounces=5))


def same_paths(some: Paths, others: Paths, there: Room = ARENA) -> list[tuple[int, int]]:
    """Return pairs of rows with the same surfaces and edges; `others` are in the room `there`."""
    rows = [
        {paths.via(row, room): row for row in range(len(paths))} for paths, room in ((some, ARENA), (others, there))
    ]
    return [(row, rows[1][way]) for way, row in rows[0].items() if way in rows[1]]


def test_moved_paths_equal_those_of_a_new_search() -> None:
    here, there = find_paths(ARENA, HERE, SEARCH), find_paths(ARENA, THERE, SEARCH)
    one = echo_paths(here, ARENA, [], [])
    out, back = moved(one.out, one.back, one.turn, one.kind, BY)
    pairs = same_paths(here, there)
    assert len(pairs) > 0.9 * len(there)
    for row, other in pairs:
        assert np.hypot(*out[row]) + np.hypot(*back[row]) == pytest.approx(there.lengths[other], abs=1e-12)
        assert out[row] / np.hypot(*out[row]) == pytest.approx(there.leaving[other], abs=1e-12)


def test_paths_to_a_separate_listener_equal_those_of_a_search() -> None:
    here, aside = find_paths(ARENA, HERE, SEARCH), find_paths(ARENA, HERE, SEARCH, THERE)
    one = echo_paths(here, ARENA, [], [])
    for row, other in same_paths(here, aside):
        x, y, bx, by = displaced(one.out[row], one.back[row], one.turn[row], one.kind[row], (0.0, 0.0), BY)
        assert math.hypot(x, y) + math.hypot(bx, by) == pytest.approx(aside.lengths[other], abs=1e-12)


def test_paths_after_moves_of_walls_equal_those_of_a_new_search() -> None:
    shifts = {"divider": 0.013, "east": -0.021, "south": 0.017}
    room = with_shifted_walls(ARENA, shifts)
    here, there = find_paths(ARENA, HERE, SEARCH), find_paths(room, HERE, SEARCH)
    one, by = echo_paths(here, ARENA, [], list(shifts)), np.array(list(shifts.values()))
    out, back = one.out + one.out_by_wall @ by, one.back + one.back_by_wall @ by
    pairs = same_paths(here, there, room)
    assert len(pairs) > 0.7 * len(there)
    assert {0, 1} <= {int(here.bends[row]) for row, _ in pairs if here.edges[row] >= 0}
    for row, other in pairs:
        assert np.hypot(*out[row]) + np.hypot(*back[row]) == pytest.approx(there.lengths[other], abs=1e-12)
        assert out[row] / np.hypot(*out[row]) == pytest.approx(there.leaving[other], abs=1e-12)


def test_growth_by_wall_equals_the_measured_growth() -> None:
    step = 1e-4
    room = with_shifted_walls(ARENA, {"divider": step})
    here, moved_wall = find_paths(ARENA, HERE, SEARCH), find_paths(room, HERE, SEARCH)
    grown = growth_by_wall(echo_paths(here, ARENA, [], ["divider"]))[:, 0]
    pairs = same_paths(here, moved_wall, room)
    assert np.abs(grown[[row for row, _ in pairs]]).max() > 1
    for row, other in pairs:
        assert (moved_wall.lengths[other] - here.lengths[row]) / step == pytest.approx(grown[row], abs=1e-2)


def test_a_moving_wall_moves_its_corners() -> None:
    room = with_shifted_walls(ARENA, {"south": 0.05})
    before, after = (dict(zip(one.names, one.walls.tolist(), strict=True)) for one in (ARENA, room))
    assert after["south"] != before["south"]
    # the corner of east and south is still one point
    assert after["east"][2:] == after["south"][:2]
    assert after["divider"] == before["divider"]


def objective_of(room: Room, ranges: list[float | None], headings: FloatArray, board: Board = BOARD) -> Objective:
    """Return the objective of readings with these ranges at these headings."""
    speed = room.air.speed_of_sound
    readings = [
        Reading(k, 0, 0, float(heading), 0.0, () if one is None else (2 * one / speed,), speed)
        for k, (one, heading) in enumerate(zip(ranges, headings, strict=True))
    ]
    free = free_parameters(("x",), [""], room, board)
    problem = make_problem([PlacedScan(readings, Place("", HERE))], room, board, free, PredictionOptions(), True)
    return problem.near(problem.start())


NOISE = ReadingNoise(0.004, 1.0, 0.05, 0.02, 0.05)


@pytest.mark.parametrize("heading", [0.0, 0.3, 1.9, 4.0])
def test_probabilities_of_all_ranges_and_of_silence_sum_to_one(heading: float) -> None:
    step = 2e-4
    ranges = np.arange(0.3, BOARD.max_range + 0.05, step)
    objective = objective_of(ARENA, [None, *ranges.tolist()], np.full(len(ranges) + 1, heading))
    chances = np.exp(objective.by_reading(objective.problem.with_noise(np.array([HERE[0]]), NOISE), 0))
    # strays within blanking are impossible, so only ranges after it count
    opens = BOARD.blanked_range(ARENA.air)
    assert chances[0] + chances[1:][ranges > opens].sum() * step == pytest.approx(1.0, abs=0.01)


def test_silence_is_likely_exactly_where_the_model_predicts_it() -> None:
    headings = np.arange(72) * math.tau / 72
    near = replace(BOARD, max_range=1.25)
    ranges = predict_scan(ARENA, Place("", HERE), near, headings).ranges
    objective = objective_of(ARENA, [None] * 72, headings, near)
    values = objective.problem.with_noise(np.array([HERE[0]]), NOISE)
    silences = objective.by_reading(values, 0)
    assert 10 < np.isnan(ranges).sum() < 62
    assert np.median(silences[np.isnan(ranges)]) > np.median(silences[~np.isnan(ranges)]) + 2
