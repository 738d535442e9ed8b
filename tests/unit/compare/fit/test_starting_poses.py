"""Starting poses of a fit: the searched range of headings, equal poses, and the true pose of an exact scan."""

import math
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from sonarhw_compare.fit import PlacedScan, free_parameters
from sonarhw_compare.fit.objective import Problem, make_problem
from sonarhw_compare.fit.parameters import Parameter
from sonarhw_compare.fit.quantities import HEADING, WORDS, X, Y
from sonarhw_compare.fit.starting import Scores, _span, _within, is_same, starting_poses
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.predict.prediction import PredictionOptions, predict_scan
from sonarhw_sim.room.room import Place

from sonarhw.readings import FloatArray, Reading
from tests.fixtures.rooms_for_tests import polygon_room

BOARD = load_board("lego-nxt")
ROOM = polygon_room([(0.0, 0.0), (0.9, 0.0), (0.9, 0.4), (0.6, 0.7), (0.0, 0.7)])
(OFFSET,) = WORDS["offset"]


def scores(bins: int) -> Scores:
    """Return equal scores of one position at every heading."""
    return Scores(np.zeros((1, 2)), math.tau / bins * np.arange(bins), np.zeros((1, bins)), 0.1)


@pytest.mark.parametrize("turns", [-1, 0, 2])
def test_headings_within_the_range_and_half_a_step_beyond_are_searched(turns: int) -> None:
    """Of headings every 10°, those of 94° to 126°; 90° and 130° are nearest to headings of the range."""
    lower, upper = np.radians([94.0, 126.0]) + math.tau * turns
    found = _within(scores(36), Parameter(HEADING, lower=lower, upper=upper), 0.0)
    allowed = np.isfinite(found.scores[0])
    assert np.flatnonzero(allowed).tolist() == [9, 10, 11, 12, 13]
    degrees = np.degrees(found.headings[allowed] - math.tau * turns)
    assert degrees == pytest.approx([94.0, 100.0, 110.0, 120.0, 126.0])


def test_a_range_across_north_and_a_given_heading() -> None:
    across = _within(scores(36), Parameter(HEADING, lower=math.radians(-14.0), upper=math.radians(14.0)), 0.0)
    assert np.flatnonzero(np.isfinite(across.scores[0])).tolist() == [0, 1, 35]
    assert np.degrees(across.headings[[35, 0, 1]]) == pytest.approx([-10.0, 0.0, 10.0])
    given = _within(scores(36), None, math.radians(203.0))
    assert np.flatnonzero(np.isfinite(given.scores[0])).tolist() == [20]
    assert np.degrees(given.headings[20]) == pytest.approx(203.0)
    free = Parameter(HEADING)
    assert _within(scores(36), free, 0.0).scores.tolist() == scores(36).scores.tolist()


def test_four_deviations_of_a_prior_are_searched_within_the_bounds() -> None:
    assert _span(Parameter(X, lower=0.0, upper=2.0)) == (0.0, 2.0)
    assert _span(Parameter(X, lower=0.0, upper=2.0, expected=1.0, deviation=0.1)) == pytest.approx((0.6, 1.4))
    assert _span(Parameter(X, lower=0.0, upper=2.0, expected=0.1, deviation=0.1)) == pytest.approx((0.0, 0.5))
    assert _span(Parameter(X, lower=0.0, upper=2.0, expected=1.9, deviation=0.1)) == pytest.approx((1.5, 2.0))


@pytest.mark.parametrize(
    ("other", "same"),
    [
        ((0.019, -0.019, math.radians(2.9), 5.0), True),
        ((0.0, 0.0, math.radians(357.1), 0.0), True),
        ((0.021, 0.0, 0.0, 0.0), False),
        ((0.0, -0.021, 0.0, 0.0), False),
        ((0.0, 0.0, math.radians(-3.1), 0.0), False),
        ((0.0, 0.0, math.radians(363.1), 0.0), False),
    ],
)
def test_poses_within_2_centimetres_and_3_degrees_are_the_same(other: tuple[float, ...], same: bool) -> None:
    parameters = tuple(Parameter(quantity) for quantity in (X, Y, HEADING, OFFSET))
    problem = cast(Problem, SimpleNamespace(parameters=parameters))
    assert is_same(problem, np.zeros(4), np.array(other)) is same
    assert is_same(problem, np.array(other), np.zeros(4)) is same


def exact_scan(x: float, y: float, degrees: float) -> PlacedScan:
    """Return a scan that is exactly the prediction from there. It is given another place."""
    turns = np.radians(np.arange(0.0, 360.0, 15.0))
    ranges: FloatArray = predict_scan(ROOM, Place("", (x, y)), BOARD, turns + math.radians(degrees)).ranges
    speed = ROOM.air.speed_of_sound
    readings = [
        Reading(k, 0, 0, float(turn), 0.1 * k, () if math.isnan(one) else (2 * one / speed,), speed)
        for k, (turn, one) in enumerate(zip(turns, ranges, strict=True))
    ]
    return PlacedScan(readings, Place("", (0.5, 0.4)))


def problem_at(x: float, y: float, degrees: float, free: tuple[str, ...]) -> Problem:
    parameters = free_parameters(free, [""], ROOM, BOARD)
    return make_problem([exact_scan(x, y, degrees)], ROOM, BOARD, parameters, PredictionOptions(), all_echoes=False)


def test_the_best_of_several_different_poses_is_that_of_an_exact_scan() -> None:
    shares: list[float] = []
    problem = problem_at(0.3, 0.2, 50.0, ("position", "heading"))
    found = starting_poses(problem, 0, shares.append)
    x, y, heading = found[0].values[:3]
    assert (x, y) == pytest.approx((0.3, 0.2), abs=0.02)
    assert math.degrees(math.remainder(heading - math.radians(50.0), math.tau)) == pytest.approx(0.0, abs=3.0)
    assert [one.score for one in found] == sorted((one.score for one in found), reverse=True)
    assert not any(is_same(problem, a.values, b.values) for k, a in enumerate(found) for b in found[:k])
    # the lattice takes about half of the progress
    assert shares == sorted(shares)
    assert shares[0] == 0.0
    assert 0.9 < shares[-1] < 1.0


def test_without_a_free_pose_the_start_is_the_only_one() -> None:
    problem = problem_at(0.3, 0.2, 0.0, ("threshold",))
    (only,) = starting_poses(problem, 0, lambda _: None)
    assert only.values.tolist() == problem.start().tolist()
