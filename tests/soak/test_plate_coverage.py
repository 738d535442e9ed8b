"""Over boards with random constants, the intervals of a calibration with plates contain them at their stated rate."""

import numpy as np
import pytest

from benchmarks.plate import calibrated_boards

LEAST = 0.9  # of intervals that state 95 %


@pytest.mark.soak  # test_plate_calibration.py has three of these boards
@pytest.mark.timeout(36_000)
@pytest.mark.parametrize("traces", [True, False])
def test_intervals_contain_the_constants(traces: bool) -> None:
    held = [held for board in calibrated_boards(60, traces) for _, _, held in board.errors().values()]
    assert np.mean(held) >= LEAST
