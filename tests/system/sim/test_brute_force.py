"""Predicted readings in random furnished rooms are those of an exhaustive search that shares no code with the product.

`python -m benchmarks.brute_force` compares 50 000 readings.
"""

import pytest

from tests.conftest import Count
from tests.oracles.brute.furnished import compare


@pytest.mark.timeout(36_000)
def test_readings_are_those_of_an_exhaustive_search(count: Count) -> None:
    for seed in range(count(2, 100)):
        found = compare(seed, 500)
        assert not found.wrong.any(), f"room {seed}"
        # else the comparison would prove little
        assert found.unsure.mean() < 0.02
