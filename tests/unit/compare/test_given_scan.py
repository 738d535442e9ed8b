"""A scan whose ranges or angles are unknown is refused before anything is computed with it."""

import math
from dataclasses import replace

import pytest
from sonarhw_compare.scans import GivenScan

from sonarhw.errors import InputError
from tests.fixtures.example_logs import example_reading


@pytest.mark.parametrize("change", [{"speed_of_sound": math.nan}, {"angle": math.nan}, {"echo_times": (math.inf,)}])
def test_readings_without_range_or_angle_are_refused(change: dict[str, float]) -> None:
    readings = [example_reading(number) for number in range(4)]
    assert GivenScan("scan.mcap", tuple(readings)).readings == tuple(readings)
    readings[1] = replace(readings[1], **change)
    with pytest.raises(InputError, match=r"scan\.mcap: the range or angle of reading 1 is unknown; .* log export"):
        GivenScan("scan.mcap", tuple(readings))


def test_silence_needs_no_speed_of_sound() -> None:
    silent = replace(example_reading(2), speed_of_sound=math.nan)
    assert GivenScan("scan.mcap", (silent,)).readings == (silent,)
