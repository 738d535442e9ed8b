"""The beam against the table of a piston in physics.md."""

import math

import numpy as np
import pytest

from sim.transducer import beam_gain


def decibels(angle_deg: float, ka: float) -> float:
    return 20 * math.log10(float(beam_gain(np.array(math.radians(angle_deg)), ka)))


@pytest.mark.parametrize(
    ("ka", "at_3", "at_6", "at_12", "null"), [(14.44, 6.43, 8.82, 11.68, 15.39), (17.33, 5.35, 7.34, 9.71, 12.77)]
)
def test_beam_is_the_pistons(ka: float, at_3: float, at_6: float, at_12: float, null: float) -> None:
    for angle, loss in ((at_3, -3), (at_6, -6), (at_12, -12)):
        assert decibels(angle, ka) == pytest.approx(loss, abs=0.3)
    assert decibels(null, ka) < -45


def test_carrier_two_ways_at_17_degrees_is_minus_36_decibels() -> None:
    assert 2 * decibels(17.2, 17.33) == pytest.approx(-36, abs=0.5)


def test_nothing_leaves_backwards() -> None:
    behind = beam_gain(np.radians([90.0, 120.0, 180.0, 250.0]), 17.33)
    assert behind == pytest.approx(np.zeros(4), abs=1e-12)
    assert beam_gain(np.zeros(1), 17.33)[0] == 1.0
