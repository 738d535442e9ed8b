"""Calibration with a plate at a known distance finds the given range offset and zero."""

import math

import numpy as np
import pytest

from sonarhw.calibration import calibrate
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
    found = calibrate(scan(1.5, math.radians(degrees), offset), 1.5, 0.0)
    assert found.range_offset == pytest.approx(offset, abs=0.001)
    assert math.degrees(found.home_angle) == pytest.approx(-degrees, abs=0.26)
    assert found.arc == pytest.approx(2 * BEAM, abs=math.radians(1.0))
    assert found.range_spread < 0.002


def test_finer_steps_reduce_the_error_and_the_uncertainty_of_the_zero() -> None:
    for step in (2.0, 0.5, 0.1):
        errors = []
        for degrees in np.linspace(-1.0, 1.0, 21):
            found = calibrate(scan(1.5, math.radians(degrees), 0.0, step=step), 1.5, 0.0)
            errors.append(found.home_angle + math.radians(degrees))
        assert np.std(errors) < 2 * found.home_uncertainty
        assert found.home_uncertainty < math.radians(step)


def test_echoes_of_other_objects_are_left_out() -> None:
    readings = scan(1.5, 0.0, 0.005)
    cluttered = [
        Reading(**{**vars(reading), "echo_times": tuple(sorted((*reading.echo_times, 2 * 2.5 / SPEED)))})
        for reading in readings
    ]
    assert calibrate(cluttered, 1.5, 0.0) == calibrate(readings, 1.5, 0.0)


def test_a_plate_without_echoes_or_filling_the_sector_is_refused() -> None:
    with pytest.raises(NoPlate, match="detected at 0 headings"):
        calibrate(scan(1.5, 0.0, 0.0), 3.0, 0.0)
    with pytest.raises(NoPlate, match="end of the sector"):
        calibrate(scan(1.5, 0.0, 0.0, width=10.0), 1.5, 0.0)
    with pytest.raises(NoPlate, match="detected at 0 headings"):
        calibrate([], 1.5, 0.0)
