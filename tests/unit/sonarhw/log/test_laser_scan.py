"""LaserScan messages have equal steps, and one range for each heading."""

import math

import pytest

from sonarhw.log.writer import laser_scan
from sonarhw.readings import Reading

SPEED = 340.0


def readings(*rows: tuple[float, float]) -> list[Reading]:
    """Return readings of headings (degrees) and ranges (m; inf: no echo), in order of time."""
    return [
        Reading(k, 0, 0, math.radians(degrees), 0.1 * k, () if math.isinf(far) else (2 * far / SPEED,), SPEED)
        for k, (degrees, far) in enumerate(rows)
    ]


def test_of_several_pings_the_median_range_is_used() -> None:
    scan = laser_scan(readings((0, 1.0), (0, 9.0), (0, 2.0), (5, 3.0), (5, math.inf), (10, math.inf)), 0.0)
    # of two values, the smaller is the median that was measured
    assert [*scan.ranges] == pytest.approx([2.0, 3.0, math.inf])


def test_a_heading_without_a_reading_is_nan_and_one_without_an_echo_infinite() -> None:
    scan = laser_scan(readings((2, 1.0), (1, math.inf), (5, 4.0), (-1, 3.0)), 12.5)
    assert [*scan.ranges] == pytest.approx([3.0, math.nan, math.inf, 1.0, math.nan, math.nan, 4.0], nan_ok=True)
    assert (scan.start_angle, scan.end_angle) == pytest.approx((math.radians(-1), math.radians(5)))
    assert (scan.timestamp.seconds, scan.timestamp.nanos) == (12, 500_000_000)


def test_every_reading_of_a_fine_scan_is_at_its_own_heading() -> None:
    scan = laser_scan(readings(*((0.1 * k, 1.0 + k) for k in range(3600))), 0.0)
    assert [*scan.ranges] == pytest.approx([1.0 + k for k in range(3600)])


def test_headings_that_nearly_coincide_do_not_make_the_grid_huge() -> None:
    scan = laser_scan(readings((0, 1.0), (0.0001, 2.0), (360, 3.0)), 0.0)
    assert len(scan.ranges) == 36_001


def test_a_single_reading_is_a_scan_of_one_range() -> None:
    scan = laser_scan(readings((30, 2.0)), 0.0)
    assert [*scan.ranges] == pytest.approx([2.0])
    assert scan.start_angle == scan.end_angle == pytest.approx(math.radians(30))


def test_headings_are_about_the_vertical_axis_of_the_turntable() -> None:
    """The pose of the frame is the identity, a unit quaternion."""
    pose = laser_scan(readings((0, 1.0)), 0.0).pose
    assert (pose.orientation.x, pose.orientation.y, pose.orientation.z, pose.orientation.w) == (0, 0, 0, 1)
    assert (pose.position.x, pose.position.y, pose.position.z) == (0, 0, 0)
