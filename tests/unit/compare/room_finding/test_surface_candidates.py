"""Candidates for walls, from regions of constant depth."""

import math

import numpy as np
import pytest
from sonarhw_compare.map.arcs import Arc
from sonarhw_compare.room_finding.surface_candidates import wall_candidates

# a wall at x = 1.5 m seen from (1.2, 0.5) m, of which a nearer echo hides the lower half
CUT_OFF = Arc(0, tuple(range(20)), (1.2, 0.5), 0.3, math.radians(22), math.radians(32))
UNEXPLAINED = [np.ones(20)]


def normals(common: float | None) -> list[float]:
    """Return the bearing of each candidate's normal, degrees."""
    found = wall_candidates([CUT_OFF], UNEXPLAINED, 8, common)
    return sorted(math.degrees(math.remainder(wall.angle + math.pi / 2, math.tau)) for wall in found)


def test_a_wall_of_which_one_side_is_hidden_is_tried_at_right_angles_to_the_others() -> None:
    assert normals(None) == pytest.approx([22.0])
    assert normals(math.radians(90.0)) == pytest.approx([0.0, 22.0])
    (square,) = (wall for wall in wall_candidates([CUT_OFF], UNEXPLAINED, 8, math.pi) if abs(wall.along[0]) < 1e-9)
    assert square.middle == pytest.approx((1.5, 0.5))


def test_no_wall_is_tried_at_right_angles_outside_the_arc() -> None:
    # the nearest right angle is 40° from the middle of the arc, which is 32° wide to each side
    assert normals(math.radians(62.0)) == pytest.approx([22.0])
