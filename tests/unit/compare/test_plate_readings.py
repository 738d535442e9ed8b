"""Calibration with a plate at a known distance finds the given range offset and zero."""

import math

import numpy as np
import pytest
from sonarhw_compare.calibration.plate_readings import faced_plate

from sonarhw.errors import NoPlate
from sonarhw.readings import Reading
from tests.fixtures.plate import BEAM, plate_range

SPEED = 343.2


def scan(distance: float, direction: float, offset: float, *, step: float = 0.5, width: float = 60.0) -> list[Reading]:
    """Return a sector around a plate, measured by a scanner that adds `offset` to each range."""
    degrees = np.arange(-width / 2, width / 2, step)
    return [
        Reading(
            number=number,
            sweep=0,
            ping=0,
            angle=math.radians(angle),
            time=0.1 * number,
            echo_times=() if measured is None else (2 * (measured + offset) / SPEED,),
            speed_of_sound=SPEED,
        )
        for number, angle in enumerate(degrees)
        for measured in [plate_range(math.radians(angle), distance, direction)]
    ]


@pytest.mark.parametrize("offset", [-0.02, 0.0, 0.013])
@pytest.mark.parametrize("degrees", [-3.7, 0.0, 2.3])
def test_offset_and_home_angle_are_found(offset: float, degrees: float) -> None:
    found = faced_plate(scan(1.5, math.radians(degrees), offset), 1.5, 0.0)
    assert found.range_offset == pytest.approx(offset, abs=0.001)
    assert math.degrees(found.home_angle) == pytest.approx(-degrees, abs=0.26)
    assert found.arc == pytest.approx(2 * BEAM, abs=math.radians(1.0))
    assert found.range_spread < 0.002


def readings_of(rows: list[tuple[float, float | None]]) -> list[Reading]:
    """Return readings of headings (degrees) and ranges (m; None: no echo)."""
    return [
        Reading(k, 0, 0, math.radians(degrees), 0.1 * k, () if far is None else (2 * far / SPEED,), SPEED)
        for k, (degrees, far) in enumerate(rows)
    ]


def test_late_detection_at_the_rims_of_the_arc_does_not_change_the_offset() -> None:
    """Ranges are 1.51 m over the middle half of the arc, and up to 20 cm more outside it."""
    rows = [(float(k), 1.51 + 0.02 * max(0, abs(k) - 5) if abs(k) <= 10 else None) for k in range(-20, 21)]
    found = faced_plate(readings_of(rows), 1.5, 0.0)
    assert found.range_offset == pytest.approx(0.01, abs=1e-9)
    assert found.range_spread == pytest.approx(0.0, abs=1e-9)


def test_offset_is_the_median_and_spread_the_standard_deviation_of_the_middle() -> None:
    middle = [1.500, 1.508, 1.502, 1.514, 1.505, 1.501, 1.507]
    rows = [(float(k), middle[k + 3] if abs(k) <= 3 else 1.515 if abs(k) <= 6 else None) for k in range(-10, 11)]
    found = faced_plate(readings_of(rows), 1.5, 0.0)
    assert found.range_offset == pytest.approx(0.005)
    assert found.range_spread == pytest.approx(float(np.std(middle)))


def test_headings_at_the_rims_count_by_the_share_of_their_pings_that_detect_the_plate() -> None:
    """The plate is detected from -5.5° to 5.75°: at 6°, by one ping of four."""
    rows = [
        (float(k), 1.5 if abs(k) <= 5 or (k == 6 and ping == 0) else None) for k in range(-9, 10) for ping in range(4)
    ]
    found = faced_plate(readings_of(rows), 1.5, 0.0)
    assert math.degrees(found.arc) == pytest.approx(11.25)
    assert math.degrees(found.home_angle) == pytest.approx(-0.125, abs=0.01)
    assert found.headings == 12
    # the error of each end is uniform over one step, and the middle is the mean of both ends
    assert math.degrees(found.home_uncertainty) == pytest.approx(1 / math.sqrt(24))


def test_a_plate_at_five_headings_is_enough_and_at_four_too_little() -> None:
    for count, enough in ((5, True), (4, False)):
        rows = [(float(k), 1.5 if 0 <= k < count else None) for k in range(-3, 9)]
        if enough:
            assert faced_plate(readings_of(rows), 1.5, 0.0).headings == count
            continue
        with pytest.raises(NoPlate, match="detected at 4 headings"):
            faced_plate(readings_of(rows), 1.5, 0.0)


@pytest.mark.parametrize("first", [True, False])
def test_a_plate_at_one_end_of_the_sector_is_refused(first: bool) -> None:
    rows = [(float(k), 1.5 if (k < 8 if first else k >= 12) else None) for k in range(20)]
    with pytest.raises(NoPlate, match=f"m reach {0 if first else 19} degrees"):
        faced_plate(readings_of(rows), 1.5, 0.0)


def test_only_ranges_within_the_gate_are_from_the_plate() -> None:
    for far, found in ((1.5 + 0.29, True), (1.5 - 0.29, True), (1.5 + 0.31, False), (1.5 - 0.31, False)):
        rows = [(float(k), far if abs(k) <= 5 else None) for k in range(-9, 10)]
        # within the gate, the error states the distance that was measured
        with pytest.raises(NoPlate, match=f"comes from {far:.3f} m, expected 1.5 m" if found else "0 headings"):
            faced_plate(readings_of(rows), 1.5, 0.0)


def test_ranges_that_depend_on_the_angle_or_scatter_are_refused() -> None:
    for slope, even in ((0.0005, True), (0.002, False), (-0.002, False)):
        rows = [(float(k), 1.5 + slope * k if abs(k) <= 8 else None) for k in range(-12, 13)]
        if even:
            assert faced_plate(readings_of(rows), 1.5, 0.0).headings == 17
            continue
        with pytest.raises(NoPlate, match=r"change by 16\.0 mm from one side to the other"):
            faced_plate(readings_of(rows), 1.5, 0.0)
    rows = [(float(k), 1.5 + 0.012 * (k % 2) if abs(k) <= 8 else None) for k in range(-12, 13) for _ in range(1)]
    assert faced_plate(readings_of(rows), 1.5, 0.0).range_spread == pytest.approx(0.006, abs=1e-4)
    scattered = [
        (float(k), 1.5 + (0.03 if ping == 2 else 0) if abs(k) <= 8 else None)
        for k in range(-12, 13)
        for ping in range(3)
    ]
    with pytest.raises(NoPlate, match=r"standard deviation of 14\.1 mm"):
        faced_plate(readings_of(scattered), 1.5, 0.0)


def test_echoes_of_a_rim_on_one_side_do_not_turn_the_zero() -> None:
    rows = [(float(k), 1.5 if abs(k) <= 10 else 1.55 if 10 < k <= 16 else None) for k in range(-25, 26)]
    found = faced_plate(readings_of(rows), 1.5, 0.0)
    assert found.home_angle == pytest.approx(0.0, abs=1e-9)
    assert math.degrees(found.arc) == pytest.approx(21)
