"""Over many scans with known ground truth, fits are accurate and their credible intervals have the stated coverage."""

from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context

import numpy as np
import pytest

from benchmarks.fit import drawn_fit
from tests.conftest import Count

STATED = 0.95  # coverage
FEW = 10  # draws that are not worth the start of other processes


@pytest.mark.timeout(36_000)
def test_credible_intervals_contain_the_truth_at_their_stated_rate(count: Count) -> None:
    draws, drawn_one = count(2, 500), partial(drawn_fit, samples=count(500, 8000))
    if draws < FEW:
        drawn = list(map(drawn_one, range(draws)))
    else:
        with ProcessPoolExecutor(mp_context=get_context("spawn")) as pool:
            drawn = list(pool.map(drawn_one, range(draws)))
    covered = np.array([list(one.covered.values()) for one in drawn])
    # 3 % for 500 draws; four standard deviations for few draws
    allowed = max(0.03, 4 * np.sqrt(STATED * (1 - STATED) / covered.size))
    assert abs(covered.mean() - STATED) < allowed
    for name in ("x", "y"):
        assert np.percentile([abs(one.errors[name]) for one in drawn], 95) < 0.002
    headings = [abs(one.errors["heading"]) for one in drawn]
    assert np.degrees(np.median(headings)) < 0.1
