"""Logs of BeeSoft and ARIA are recognised by content, and read with the units that their programs write."""

import math
from pathlib import Path

import pytest
from sonarhw_compare.imports import ImportOptions, import_scan

from sonarhw.errors import InputError

BEESOFT = """
@SENS 24-11-95 23:59:59.500000
#ROBOT 10.000000 20.000000 90.000000

@SENS 24-11-95 23:59:59.900000
#SONAR 4: 100.500000 200.000000 0.000000 50.000000

@SENS 25-11-95 00:00:00.100000
#SONAR 4: 101.000000 199.000000 700.000000 51.000000

"""
ARIA = """LaserOdometryLog
#Created by ARIA's ArLaserLogger
version: 3
sick1pose: 100 0 0.00
sick1conf: -90 90 3
locationTypes: robot robotGlobal

scan1Id: 1
time: 0.50
velocities: 0.00 0.00 0.00
robot: 1000 2000 90.00
scan1: 100 -1500 1100 0 100 800
scan1Id: 2
time: 1.00
robot: 1100 2000 90.00
sick1: 1400 900 0
# End of log
"""


def test_ranges_of_beesoft_are_centimetres_in_directions_that_the_user_states(tmp_path: Path) -> None:
    file = tmp_path / "robot.script"
    file.write_text(BEESOFT)
    with pytest.raises(InputError, match=r"4 ranges without the directions .* step=DEGREES .* 90 or -90"):
        import_scan(file)
    scan = import_scan(file, ImportOptions(step=-90.0, no_echo=700.0))
    assert scan.read_as == ("read as logs of BeeSoft with sonar", "centimetres: by the definition of the format")
    assert [reading.range for reading in scan.readings] == [
        None if metres is None else pytest.approx(metres) for metres in (1.005, 2.0, None, 0.5, 1.01, 1.99, None, 0.51)
    ]
    assert [round(math.degrees(reading.angle)) for reading in scan.readings] == [0, -90, -180, -270] * 2
    assert [reading.sweep for reading in scan.readings] == [0] * 4 + [1] * 4
    assert scan.readings[4].time - scan.readings[0].time == pytest.approx(0.2)  # over midnight


def test_scans_of_aria_have_the_pose_of_their_sensor(tmp_path: Path) -> None:
    file = tmp_path / "map.2d"
    file.write_text(ARIA)
    scan = import_scan(file)
    first, second = scan.readings[:3], scan.readings[3:]
    assert [reading.range for reading in first] == pytest.approx([1.5, 1.0, 0.8])
    assert [math.degrees(reading.angle) for reading in first] == pytest.approx([-90, 0, 90])
    assert first[0].pose == pytest.approx((1.0, 2.1, math.pi / 2))  # the sensor is 0.1 m in front of the robot
    assert second[0].range == pytest.approx(1.4)
    assert second[2].range is None
    assert [math.degrees(reading.angle) for reading in second] == pytest.approx([-90, 0, 90])
    assert second[0].pose == pytest.approx((1.1, 2.1, math.pi / 2))
    assert second[0].time - first[0].time == pytest.approx(0.5)
