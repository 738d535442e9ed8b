"""Details for JSON: their numbers are those that other changes of the board and the regions themselves give."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from sonarhw_compare.explain import details
from sonarhw_compare.match import compare_readings
from sonarhw_compare.score import assigned_echoes
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.predict.prediction import predict_scan, weigh_paths
from sonarhw_sim.room.room import load_room

from sonarhw.readings import Reading

ROOM = load_room("rooms/arena.toml")
PLACE = replace(ROOM.places["p3"], heading=math.radians(20.0))
BOARD = replace(load_board("lego-nxt"), sum_arrivals=False)  # each echo wins by itself, so margins are exact
ANGLES = np.radians(np.arange(-60.0, 300.0, 4.0))
SCAN = predict_scan(ROOM, PLACE, replace(BOARD, threshold_db=-45.0), ANGLES + PLACE.heading)
EXACT = weigh_paths(ROOM, PLACE, BOARD, ANGLES + PLACE.heading, SCAN.paths).ranges
SPEED = 340.0


def measured(k: int, angle: float) -> Reading:
    """Return an exact reading, with a second echo behind it; every ninth is 20 mm too long, every tenth lacks."""
    distance = float(EXACT[k]) + (0.02 if k % 9 == 0 else 0.0)
    times = () if k % 10 == 5 or math.isnan(distance) else (2 * distance / SPEED, 2 * distance / SPEED + 0.004)
    return Reading(k, 0, 0, angle, 0.1 * k, times, SPEED)


COMPARISON = compare_readings([measured(k, float(angle)) for k, angle in enumerate(ANGLES)], ROOM, PLACE, BOARD)
FOUND = details(COMPARISON)


def range_at(threshold: float, index: int) -> float:
    board, headings = replace(BOARD, threshold_db=threshold), COMPARISON.prediction.headings
    return float(weigh_paths(ROOM, PLACE, board, headings[index : index + 1], SCAN.paths).ranges[0])


def test_details_are_json_with_one_entry_for_each_reading() -> None:
    assert json.loads(json.dumps(FOUND)) == FOUND
    assert len(FOUND["readings"]) == len(ANGLES)
    for row, entry in zip(COMPARISON.rows, FOUND["readings"], strict=True):
        assert entry["turntable_deg"] == pytest.approx(math.degrees(row.reading.angle))
        assert entry["heading_deg"] == pytest.approx((math.degrees(row.reading.angle) + 20.0) % 360.0)
        assert 0 <= entry["heading_deg"] < 360
        assert (entry["measured_m"], entry["predicted_m"]) == (row.measured, row.predicted)
        assert entry["class"] == row.kind.value


def test_echoes_have_their_path_and_level() -> None:
    paths = COMPARISON.prediction.paths
    several = 0
    for index, entry in enumerate(FOUND["readings"]):
        echoes = assigned_echoes(COMPARISON, index)
        several += len(echoes) > 1
        assert [(one["measured_m"], one["predicted_m"], one["level_db"]) for one in entry["echoes"]] == [
            (measured, echo and echo.range, echo and echo.level_db) for measured, echo in echoes
        ]
        assert [one["via"] for one in entry["echoes"]] == [
            None if echo is None else list(paths.via(echo.path, ROOM)) for _, echo in echoes
        ]
    assert several > 10


def test_the_named_echo_wins_just_above_the_margin() -> None:
    checked = 0
    for index, entry in enumerate(FOUND["readings"]):
        higher, margin = entry["with_higher_threshold"], entry["margin_db"]
        if higher is not None and margin is not None:
            assert range_at(BOARD.threshold_db + margin + 1e-6, index) == pytest.approx(higher["range_m"])
            assert higher["level_db"] > BOARD.threshold_db + margin
            checked += 1
        if entry["next"] is not None and entry["predicted_m"] is not None:
            assert entry["next"]["range_m"] - entry["predicted_m"] == pytest.approx(entry["next_behind_m"], abs=1e-9)
    assert checked > 10


def test_pairs_of_regions_state_the_differences_of_their_regions() -> None:
    regions = FOUND["regions"]
    assert len(regions["pairs"]) > 3
    for pair in regions["pairs"]:
        seen, predicted = pair["measured"], pair["predicted"]
        assert pair["farther_m"] == pytest.approx(seen["range_m"] - predicted["range_m"], abs=1e-9)
        assert pair["wider_deg"] == pytest.approx(seen["width_deg"] - predicted["width_deg"], abs=1e-6)
        turned = (seen["bearing_deg"] - predicted["bearing_deg"] + 180) % 360 - 180
        assert pair["turned_deg"] == pytest.approx(turned, abs=1e-6)
        assert seen["readings"] > 0
        assert 0 <= seen["bearing_deg"] < 360
