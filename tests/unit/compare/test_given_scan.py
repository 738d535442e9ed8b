"""A scan whose ranges or angles are unknown is refused before anything is computed with it."""

import math
import pickle
from dataclasses import replace

import numpy as np
import pytest
from sonarhw_compare.scans import GivenScan, scan_from_arrays

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


HEADINGS = np.radians([0.0, 90.0, 180.0])


def test_arrays_become_readings_with_silence_pings_echoes_and_a_pose() -> None:
    scan = scan_from_arrays(HEADINGS, [1.0, np.nan, np.inf], pose=(1.0, 2.0, 0.5))
    assert [reading.range for reading in scan.readings] == pytest.approx([1.0, None, None])
    assert [reading.angle for reading in scan.readings] == HEADINGS.tolist()
    assert (scan.pose.position, scan.pose.heading) == ((1.0, 2.0), 0.5)
    ranges = np.array([[[1.0, 2.0], [1.1, np.nan]], [[3.0, 4.0], [np.nan, np.nan]]])
    several = scan_from_arrays([0, 90], ranges, degrees=True, pose=[0, 0, 90], times=[5.0, 6.0])
    assert [reading.echo_ranges for reading in several.readings] == [
        pytest.approx(echoes) for echoes in ((1.0, 2.0), (1.1,), (3.0, 4.0), ())
    ]
    assert [(reading.angle, reading.ping, reading.time) for reading in several.readings] == [
        (0.0, 0, 5.0),
        (0.0, 1, 5.0),
        (math.pi / 2, 0, 6.0),
        (math.pi / 2, 1, 6.0),
    ]
    assert several.pose.heading == math.pi / 2
    masked = np.ma.array([1.0, 2.0, 3.0], mask=[False, True, False])
    assert [reading.range is None for reading in scan_from_arrays(HEADINGS, masked).readings] == [False, True, False]
    assert pickle.loads(pickle.dumps(scan)) == scan


@pytest.mark.parametrize(
    ("headings", "ranges", "warning"),
    [
        (np.arange(0, 360, 5), np.ones(72), "headings: up to 355, taken as radians; if they are degrees"),
        (HEADINGS, [120.0, 340.0, 95.0], "ranges: half of them over 30 m; if they are centimetres"),
    ],
)
def test_probable_degrees_and_centimetres_are_warned_of(headings: object, ranges: object, warning: str) -> None:
    with pytest.warns(UserWarning, match=warning):
        scan_from_arrays(headings, ranges)
