"""The certainty grid of single readings, against the formulas of Moravec and Elfes evaluated cell by cell."""

import math

import numpy as np
import pytest
from sonarhw_compare.fit import PlacedScan
from sonarhw_compare.map import DEPTH, CertaintyGrid, _mark_empty, _mark_occupied, certainty_grid
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.predict.prediction import CONE_HALF_ANGLE
from sonarhw_sim.room.room import Place

from sonarhw.readings import Reading

BOARD = load_board("paper")
SPEED = 344.0


def grid_of(*rows: tuple[float, float], cell: float = 0.01, x: float = 0.3) -> CertaintyGrid:
    """Return the grid of readings of headings (degrees) and ranges (m) at (`x`, 0.1)."""
    readings = [
        Reading(k, 0, 0, math.radians(degrees), 0.0, (2 * far / SPEED,), SPEED) for k, (degrees, far) in enumerate(rows)
    ]
    return certainty_grid([PlacedScan(readings, Place("", (x, 0.1)))], BOARD, [np.ones(len(rows), np.bool_)], cell)


def polar(grid: CertaintyGrid, degrees: float) -> tuple[np.ndarray, np.ndarray]:
    """Return distance from the sensor and angle from the axis of each cell, m and rad."""
    rows, columns = np.indices(grid.empty.shape)
    x = grid.left + (columns + 0.5) * grid.cell - 0.3
    y = grid.bottom + (rows + 0.5) * grid.cell - 0.1
    aside = np.remainder(np.arctan2(y, x) - math.radians(degrees) + math.pi, math.tau) - math.pi
    return np.hypot(x, y), np.abs(aside)


@pytest.mark.parametrize(("degrees", "far"), [(0.0, 0.8), (70.0, 1.3), (200.0, 0.5)])
def test_one_reading_gives_the_printed_profiles(degrees: float, far: float) -> None:
    grid = grid_of((degrees, far))
    away, aside = polar(grid, degrees)
    share = np.where(aside < CONE_HALF_ANGLE, 1 - (aside / CONE_HALF_ANGLE) ** 2, 0.0)
    before = far - DEPTH
    empty = np.where(away < before, share * (1 - (away / before) ** 2), 0.0)
    assert grid.empty == pytest.approx(empty, abs=1e-9)
    occupied = np.where(np.abs(away - far) < DEPTH, share * (1 - ((away - far) / DEPTH) ** 2), 0.0) * (1 - empty)
    # an arc adds 1 in all; the highest certainty of the grid is then 1
    assert grid.occupied == pytest.approx(occupied / occupied.max(), abs=1e-9)
    assert grid.certainty == pytest.approx(np.where(grid.occupied >= empty, grid.occupied, -empty), abs=1e-9)


def test_two_equal_readings_combine_as_independent_probabilities() -> None:
    once, twice = grid_of((30.0, 0.8)), grid_of((30.0, 0.8), (30.0, 0.8))
    assert 1 - twice.empty == pytest.approx((1 - once.empty) ** 2)


def test_a_grid_has_a_margin_of_20_centimetres_and_cells_of_2() -> None:
    readings = [Reading(0, 0, 0, 0.0, 0.0, (2 * 1.0 / SPEED,), SPEED)]
    grid = certainty_grid([PlacedScan(readings, Place("", (0.3, 0.1)))], BOARD, [np.ones(1, np.bool_)])
    left, right, bottom, top = grid.extent
    assert grid.cell == 0.02
    assert (left, bottom) == pytest.approx((0.1, -0.1))
    assert (right, top) == pytest.approx((1.5, 0.3), abs=0.021)
    far = [Reading(0, 0, 0, 0.0, 0.0, (2 * 100.0 / SPEED,), SPEED)]
    huge = certainty_grid([PlacedScan(far, Place("", (0.3, 0.1)))], BOARD, [np.ones(1, np.bool_)])
    assert max(huge.empty.shape) in (1200, 1201)


def test_certainty_outside_the_grid_is_0_and_inside_that_of_the_cell() -> None:
    grid = CertaintyGrid(1.0, 2.0, 0.5, np.zeros((2, 3)), np.array([[0.1, 0.2, 0.3], [0.4, 0.5, 0.6]]))
    points = [
        [1.01, 2.01],
        [2.49, 2.01],
        [1.01, 2.99],
        [2.49, 2.99],
        [0.99, 2.5],
        [2.51, 2.5],
        [1.5, 1.99],
        [1.5, 3.01],
    ]
    assert grid.at(np.array(points)) == pytest.approx([0.1, 0.3, 0.4, 0.6, 0, 0, 0, 0])
    assert grid.extent == (1.0, 2.5, 2.0, 3.0)


@pytest.mark.parametrize(("x", "y"), [(-5.0, 0.5), (0.5, -5.0), (9.0, 0.5), (0.5, 9.0), (-5.0, -5.0)])
def test_a_reading_whose_cone_is_outside_the_grid_changes_nothing(x: float, y: float) -> None:
    empty, occupied = np.full((10, 12), 0.25), np.full((10, 12), 0.5)
    for mark in (_mark_empty, _mark_occupied):
        mark(empty, occupied, 0.1, x, y, 0.3, 1.0)
    assert (empty == 0.25).all()
    assert (occupied == 0.5).all()
