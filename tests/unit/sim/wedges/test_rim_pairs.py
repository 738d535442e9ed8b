"""Pairs of halves of paths past rims, against a test of every pair."""

import numpy as np
import pytest
from sonarhw_sim.space.rim_paths import Halves, pairs_of

LONGEST, MOST = 9.0, 8


def random_halves(seed: int) -> Halves:
    """Return halves at three rims, each with up to eight reflections, in the order that `pairs_of` expects."""
    random = np.random.default_rng(seed)
    count = 400
    rims, bounces = random.integers(0, 3, count).astype(np.int32), random.integers(0, MOST + 1, count).astype(np.int32)
    lows, widths = random.uniform(0.0, 1.0, count), random.uniform(0.01, 0.25, count)
    order = np.lexsort((lows, bounces, rims))
    return Halves(
        rims[order],
        random.uniform(-2.0, 3.0, count),
        lows[order],
        (lows + widths)[order],
        random.uniform(0.1, 6.0, count),
        random.uniform(0.0, 4.0, count),
        np.ones(count),
        np.ones(count),
        bounces[order],
        np.arange(count, dtype=np.int32),
        np.zeros(count, np.int32),
    )


@pytest.mark.parametrize("same", [True, False])
def test_pairs_are_those_that_join_within_both_parts_and_both_limits(same: bool) -> None:
    out = random_halves(1)
    back = out if same else random_halves(2)
    first, second, at = pairs_of(out, back, np.full(3, 2.0), (0.007, LONGEST, 0.0, MOST), 0)
    one, other = np.arange(400)[:, None], np.arange(400)
    radial, axial = out.radial[one] + back.radial[other], back.axial[other] - out.axial[one]
    point = out.axial[one] + axial * out.radial[one] / radial
    joins = (out.rims[one] == back.rims[other]) & (np.hypot(radial, axial) <= LONGEST)
    joins &= (np.maximum(out.lows[one], back.lows) <= point) & (point < np.minimum(out.highs[one], back.highs))
    few = out.bounces[one] + back.bounces[other] <= MOST
    expected = set(zip(*(rows.tolist() for rows in np.nonzero(joins & few)), strict=True))
    assert 20 < len(expected) < joins.sum()
    assert set(zip(first.tolist(), second.tolist(), strict=True)) == expected
    assert len(first) == len(expected)
    assert at == pytest.approx(point[first, second])
