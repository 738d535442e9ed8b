"""The ROC area of silence equals a count of pairs, and levels over the threshold are those of echoes."""

import math

import numpy as np
import pytest
from sonarhw_compare.match import roc_area
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.predict.prediction import predict_scan
from sonarhw_sim.room.room import load_room


def test_area_is_the_share_of_correctly_ordered_pairs() -> None:
    random = np.random.default_rng(3)
    scores, sounding = random.integers(0, 6, 60).astype(np.float64), random.random(60) < 0.7
    scores[:5] = -math.inf
    pairs = [(a > b) + 0.5 * (a == b) for a in scores[sounding] for b in scores[~sounding]]
    assert roc_area(scores, sounding.tolist()) == pytest.approx(np.mean(pairs))


def test_area_is_one_for_a_perfect_prediction_and_none_if_a_class_is_empty() -> None:
    assert roc_area(np.array([3.0, 2.0, -1.0]), [True, True, False]) == 1.0
    assert roc_area(np.array([3.0, 2.0]), [True, True]) is None
    assert roc_area(np.array([3.0, 2.0]), [False, False]) is None


@pytest.mark.parametrize("board_name", ["lego-nxt", "paper-b12"])  # one search for all headings, and one for each
def test_a_heading_has_an_echo_if_its_loudest_path_is_over_the_threshold(board_name: str) -> None:
    room, board = load_room("rooms/arena.toml"), load_board(board_name)
    scan = predict_scan(room, room.places["p1"], board, np.radians(np.arange(0, 360, 10.0)))
    assert ((scan.over_threshold >= 0) == ~np.isnan(scan.ranges)).all()
    loudest = [max(echo.level_db for echo in scan.ping(k).echoes) for k in np.flatnonzero(scan.over_threshold >= 0)]
    assert scan.over_threshold[scan.over_threshold >= 0] + board.threshold_db == pytest.approx(loudest)
