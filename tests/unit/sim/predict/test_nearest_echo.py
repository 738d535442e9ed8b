"""The echo nearest to a measured range, against a search among all echoes of each heading."""

from dataclasses import replace

import numpy as np
import pytest
from sonarhw_sim.air import Unit
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.predict.predicted_scan import PredictedScan, nearest_paths
from sonarhw_sim.predict.prediction import PredictionOptions, predict_scan
from sonarhw_sim.room.room import load_room, with_material

REACH = 0.05
ROOM, BOARD = load_room("rooms/simple.toml"), load_board("polaroid-6500")
PLACE = ROOM.place("figure9")
HEADINGS = np.radians(np.arange(0.0, 360.0, 15.0))
# turned boards and rough walls have other paths at each heading
OWN_PATHS = predict_scan(ROOM, PLACE, BOARD, HEADINGS, PredictionOptions(Unit.REFLECT, max_bounces=3))
ROUGH = predict_scan(with_material(ROOM, ROOM.materials[0], 0.9, scatter=0.3), PLACE, BOARD, HEADINGS)


def one_by_one(scan: PredictedScan, row: int, measured: float) -> int:
    """Return the path of the nearest of all echoes at a heading; -1: none within REACH."""
    echoes = [echo for echo in scan.ping(row).echoes if abs(echo.range - measured) <= REACH]
    return min(echoes, key=lambda echo: abs(echo.range - measured)).path if echoes else -1


@pytest.mark.parametrize(
    "scan",
    [
        predict_scan(ROOM, PLACE, BOARD, HEADINGS),
        predict_scan(ROOM, PLACE, BOARD, HEADINGS, PredictionOptions(Unit.BLOCK, max_bounces=4)),
        predict_scan(ROOM, PLACE, replace(BOARD, sum_arrivals=False), HEADINGS),
        predict_scan(ROOM, PLACE, replace(BOARD, rounding=0.01), HEADINGS),
        OWN_PATHS,
        ROUGH,
    ],
    ids=["arrivals added", "face blocks", "each path alone", "whole centimetres", "own paths", "rough walls"],
)
def test_the_nearest_echo_is_that_of_a_search_among_all(scan: PredictedScan) -> None:
    rows = np.repeat(np.arange(len(HEADINGS)), 8)
    measured = np.tile(np.linspace(0.45, 1.2, 8), len(HEADINGS)) + 0.01 * np.sin(np.arange(len(rows)))
    expected = [one_by_one(scan, *reading) for reading in zip(rows.tolist(), measured.tolist(), strict=True)]
    assert nearest_paths(scan, rows, measured, REACH).tolist() == expected
    assert max(expected) > -1
    assert min(expected) == -1
