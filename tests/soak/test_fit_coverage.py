"""Over many scans with known ground truth, fits are accurate and their credible intervals have the stated coverage."""

from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context

import numpy as np
import pytest

from benchmarks.fit import drawn_fit

STATED = 0.95  # coverage


@pytest.mark.soak  # tests/system/compare/test_fit.py has single scans
@pytest.mark.timeout(36_000)
def test_credible_intervals_contain_the_truth_at_their_stated_rate() -> None:
    with ProcessPoolExecutor(mp_context=get_context("spawn")) as pool:
        drawn = list(pool.map(partial(drawn_fit, samples=8000), range(500)))
    covered = np.array([list(one.covered.values()) for one in drawn])
    assert abs(covered.mean() - STATED) < 0.03
    for name in ("x", "y"):
        assert np.percentile([abs(one.errors[name]) for one in drawn], 95) < 0.002
    headings = [abs(one.errors["heading"]) for one in drawn]
    assert np.degrees(np.median(headings)) < 0.1
