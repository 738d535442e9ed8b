"""Predicted readings in random furnished rooms are those of an exhaustive search that shares no code with the product.

`python -m benchmarks.brute_force` compares 50 000 readings, `python -m benchmarks.heights` 8 640 in rooms with heights.
"""

import numpy as np
import pytest

from tests.conftest import Count
from tests.oracles.brute.furnished import THINNEST, compare
from tests.oracles.brute.spatial import compare_in_box, compare_in_l_shape


@pytest.mark.timeout(36_000)
def test_readings_are_those_of_an_exhaustive_search(count: Count) -> None:
    for seed in range(count(2, 100)):
        found = compare(seed, 500)
        assert not found.wrong.any(), f"room {seed}"
        # else the comparison would prove little
        assert found.unsure.mean() < 0.02


@pytest.mark.parametrize(
    ("seed", "thinnest"),
    [
        # sound grazes a post beside a corner: a fan finds only one direction of the path
        (300, THINNEST),
        # sound grazes a thin post on its way to an edge
        (9, 0.001),
    ],
)
def test_sound_that_grazes_a_post_is_not_lost(seed: int, thinnest: float) -> None:
    assert not compare(seed, 500, thinnest).wrong.any()


@pytest.mark.parametrize("seed", [312, 351])
def test_many_paths_far_below_the_threshold_decide_a_reading_together(seed: int) -> None:
    assert not compare(seed, 500).wrong.any()


@pytest.mark.timeout(36_000)
def test_readings_between_floor_and_ceiling_are_those_of_images_in_space(count: Count) -> None:
    boxes = [compare_in_box(seed, 180) for seed in range(count(4, 24))]
    tables = [compare_in_l_shape(seed, 180) for seed in range(count(1, 24))]
    for found in (*boxes, *tables):
        assert not found.wrong.any(), f"room {found.seed}"
    assert not all(np.isnan(found.predicted).all() for found in boxes)
