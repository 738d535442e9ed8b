"""Scans and comparisons as labelled arrays have the values of their readings."""

import math

import numpy as np
from sonarhw_compare.matching.match import compare_readings
from sonarhw_compare.study.labelled_arrays import comparison_dataset, scan_dataset
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.room.model import load_room

from sonarhw.readings import Reading

ROOM, BOARD = load_room("rooms/simple.toml"), load_board("paper")
PLACE = ROOM.places["figure9"]
RANGES = {0.0: (0.5,), 90.0: (0.656, 1.2), 180.0: (), 270.5: (0.1,)}
READINGS = [
    Reading(k, 0, 0, math.radians(degrees), 0.1 * k, tuple(2 * one / 340.0 for one in ranges), 340.0)
    for k, (degrees, ranges) in enumerate(RANGES.items())
]


def test_a_scan_has_ranges_and_numbers_of_echoes_along_its_angles() -> None:
    found = scan_dataset(READINGS)
    assert found.angle_deg.values.tolist() == [*RANGES]
    np.testing.assert_allclose(found.range_m, [0.5, 0.656, np.nan, 0.1])
    assert found.echoes.values.tolist() == [1, 2, 0, 1]


def test_a_comparison_has_residuals_classes_and_paths_along_its_headings() -> None:
    comparison = compare_readings(READINGS, ROOM, PLACE, BOARD, heading=0.0)
    found = comparison_dataset(comparison)
    assert found.heading_deg.values.tolist() == [*RANGES]
    np.testing.assert_allclose(found.measured_m, [0.5, 0.656, np.nan, 0.1])
    np.testing.assert_allclose(found.predicted_m, comparison.prediction.ranges)
    both = found.measured_m - found.predicted_m
    np.testing.assert_allclose(found.residual_m.values[1], both.values[1])
    assert np.isnan(found.residual_m.values[2])
    assert found.kind.values.tolist() == [row.kind.value for row in comparison.rows]
    row = comparison.rows[1]
    assert row.path is not None
    assert found.via.values[1] == ">".join(comparison.prediction.paths.via(row.path, ROOM)) == "top"
