"""The figures of one scan of a study."""

import math

import numpy as np
from sonarhw_compare.study import ScanColumns, figures_of

NONE = math.nan


def test_figures_are_shares_of_the_echoes() -> None:
    # direct, two reflections, an edge, an edge after a reflection, and a heading without an echo
    found = figures_of(
        ScanColumns(
            heading_deg=np.arange(5.0),
            range_m=np.array([1.0, 2.0, 1.5, 2.5, NONE]),
            path_m=np.array([2.0, 4.0, 3.0, 5.0, NONE]),
            level_db=np.zeros(5),
            bounces=np.array([1.0, 2.0, 0.0, 1.0, NONE]),
            bent=np.array([0.0, 0.0, 1.0, 1.0, NONE]),
            axis_m=np.array([1.04, 1.94, 1.5, NONE, 3.0]),
        )
    )
    assert found == {
        "n": 5,
        "n_echo": 4,
        "by_several": 0.5,
        "by_edge": 0.5,
        "within_5cm_of_axis": 0.5,  # 4 cm, 6 cm, 0, and no wall ahead
        "median_abs_error_m": np.median(np.abs([1.0 - 1.04, 2.0 - 1.94, 0.0])),
    }


def test_a_scan_without_echoes_has_no_shares() -> None:
    nothing = np.full(3, NONE)
    found = figures_of(ScanColumns(np.arange(3.0), *(nothing,) * 6))
    assert (found.pop("n"), found.pop("n_echo")) == (3, 0)
    assert all(math.isnan(value) for value in found.values())
