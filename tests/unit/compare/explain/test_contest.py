"""The changes after which another echo wins are checked by making them."""

import math
from dataclasses import replace

import numpy as np
import pytest
from sonarhw_compare.explain import change_for, contest, explain_reading, steps, wall_change
from sonarhw_compare.fit.free_walls import left_normals, with_shifted_walls
from sonarhw_compare.match import compare_readings
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.predict.prediction import PredictionOptions, predict_scan, weigh_paths
from sonarhw_sim.room.room import Place, load_room

from sonarhw.readings import Reading

ROOM = load_room("rooms/arena.toml")
PLACE = ROOM.places["p3"]
BOARD = replace(load_board("lego-nxt"), sum_arrivals=False)  # each echo wins by itself, so margins are exact
HEADINGS = np.radians(np.arange(0.0, 360.0, 13.0))
SCAN = predict_scan(ROOM, PLACE, replace(BOARD, threshold_db=-40.0), HEADINGS)
_A_LITTLE = 1e-6  # dB


def range_with(threshold: float, index: int) -> float:
    board = replace(BOARD, threshold_db=threshold)
    return float(weigh_paths(ROOM, PLACE, board, HEADINGS[index : index + 1], SCAN.paths).ranges[0])


def test_each_step_wins_between_its_thresholds_only() -> None:
    scan = replace(SCAN, board=BOARD)
    for index in range(len(HEADINGS)):
        found = steps(scan.ping(index))
        assert len(found) >= 1
        for step in found:
            if step.level_db > -38.0:
                assert range_with(step.level_db - _A_LITTLE, index) == pytest.approx(step.range)
            if step.above_db > -38.0:
                assert range_with(step.above_db + _A_LITTLE, index) == pytest.approx(step.range)
        assert math.isnan(range_with(found[-1].level_db + _A_LITTLE, index))


def test_margins_are_the_possible_changes_of_the_threshold() -> None:
    scan = weigh_paths(ROOM, PLACE, BOARD, HEADINGS, SCAN.paths)
    for index in range(len(HEADINGS)):
        found = contest(scan, index)
        if found.winner is not None and found.margin_db is not None:
            assert found.winner.path == scan.winners[index]
            after = range_with(BOARD.threshold_db + found.margin_db + _A_LITTLE, index)
            assert (None if math.isnan(after) else after) == (None if found.louder is None else found.louder.range)
        if found.fainter is not None and found.lacking_db is not None and found.lacking_db < 15:
            assert range_with(BOARD.threshold_db - found.lacking_db - _A_LITTLE, index) == found.fainter.range


def test_the_returned_change_makes_the_model_match() -> None:
    scan = weigh_paths(ROOM, PLACE, BOARD, HEADINGS, SCAN.paths)
    needed = 0
    for index in range(len(HEADINGS)):
        for measured in (*(step.range for step in steps(scan.ping(index))), None):
            change = change_for(scan, index, measured)
            assert change is not None
            if change < -15:
                continue
            needed += change != 0
            after = range_with(BOARD.threshold_db + change + math.copysign(_A_LITTLE, change), index)
            assert math.isnan(after) if measured is None else abs(after - measured) <= 0.05 + 1e-9
    assert needed > len(HEADINGS)


def test_no_threshold_adds_an_echo_without_a_path() -> None:
    assert change_for(weigh_paths(ROOM, PLACE, BOARD, HEADINGS, SCAN.paths), 0, 0.1) is None


@pytest.mark.parametrize("position", [(1.793, 0.3), (0.31, 0.302), (1.38, 1.792), (0.42, 0.4)])
def test_another_echo_wins_exactly_after_the_returned_shift_of_a_wall(position: tuple[float, float]) -> None:
    options, here = PredictionOptions(diffraction=False), Place("", position)
    headings = np.radians(np.arange(0.0, 360.0, 5.0))
    scan = predict_scan(ROOM, here, BOARD, headings, options)
    left = np.sign((left_normals(ROOM.walls) * (np.array(position) - ROOM.walls[:, :2])).sum(axis=1))
    changes = {index: change for index in range(len(headings)) if (change := wall_change(scan, index)) is not None}
    slight = {index: change for index, change in changes.items() if abs(change.nearer) < 0.025}
    assert len(slight) > 0
    for index, change in slight.items():
        for share, winner in ((0.95, int(scan.winners[index])), (1.05, change.echo.path)):
            by = share * change.nearer * float(left[ROOM.names.index(change.wall)])
            moved = with_shifted_walls(ROOM, {change.wall: by})
            after = predict_scan(moved, here, BOARD, headings[index : index + 1], options)
            via = scan.paths.via(winner, ROOM)
            assert after.paths.via(int(after.winners[0]), moved) in (via, via[::-1])


def test_a_sentence_mentions_a_small_shift_of_a_wall() -> None:
    reading = Reading(0, 0, 0, math.radians(320.0), 0.0, (2 * 0.3 / 340.0,), 340.0)
    sentence = explain_reading(compare_readings([reading], ROOM, Place("", (1.805, 0.3)), BOARD), 0)
    assert sentence.startswith("0.300 m at 320.0°: one reflection, east; half of the path is 0.295 m, ")
    assert sentence.endswith(" it would be one reflection, south")
    assert "with east 0.005 m farther" in sentence or "with south 0.005 m nearer" in sentence
