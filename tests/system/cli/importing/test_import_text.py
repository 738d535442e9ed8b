"""`sonarhw import` of CSV files and CARMEN logs: means of several pings, real scans, sweeps and times of a robot."""

import json
import math
from pathlib import Path

import pytest
from sonarhw_cli.app import run

from sonarhw.log import read_log
from sonarhw.readings import Reading
from tests.checkout import CHECKOUT

SCANS = CHECKOUT.parent / "shared" / "real_scans"
COLUMNS = ["--heading", "deg", "--range", "cm"]


def imported(folder: Path, text: str, *options: str) -> tuple[Reading, ...]:
    (folder / "in.csv").write_text(text)
    assert run(["import", str(folder / "in.csv"), "--out", str(folder / "out.mcap"), *COLUMNS, *options]) == 0
    log = read_log(folder / "out.mcap")
    assert log.torn is None
    assert log.metadata.made_by == "import"
    return log.readings


def degrees(readings: tuple[Reading, ...]) -> list[float]:
    return [math.degrees(reading.angle) for reading in readings]


def means_of_five() -> str:
    """Return a file of means of five pings, in whole centimetres: walls at 51 and 214 cm in turn, silence as 255."""
    ranges: list[int] = []
    for wall, following in [(51, 214), (214, 255), (255, 51)] * 4:
        ranges += [wall] * 8 + [((5 - later) * wall + later * following) // 5 for later in (1, 2, 3, 4)]
    return "\n".join(["deg,cm", *(f"{2 * k},{one}" for k, one in enumerate(ranges))])


@pytest.mark.parametrize(("unit", "options"), [("cm", ["--scale", "0.01"]), ("m", ["--scale", "1"])])
def test_mixed_means_are_out(tmp_path: Path, capsys: pytest.CaptureFixture[str], unit: str, options: list[str]) -> None:
    text, silent = means_of_five(), "255"
    if unit == "m":
        rows = [line.split(",") for line in text.splitlines()[1:]]
        text, silent = "\n".join(["deg,cm", *(f"{deg},{int(cm) / 100}" for deg, cm in rows)]), "2.55"
    options = [*options, "--no-echo", silent]
    assert len(imported(tmp_path, text, *options)) == 144
    err = capsys.readouterr().err
    assert "warning: 44 ranges are likely means of 5 pings with different ranges" in err
    assert "`sonarhw import FILE --mean-of 5` leaves them out" in err
    kept = imported(tmp_path, text, *options, "--mean-of", "5", "--force")
    err = capsys.readouterr().err
    assert "44 means of different ranges left out" in err
    assert "warning" not in err
    assert [one.number for one in kept] == list(range(100))
    # the last four have no wall behind them
    assert {None if one.range is None else round(one.range, 2) for one in kept[:-4]} == {0.51, 2.14, None}


@pytest.mark.skipif(not SCANS.is_dir(), reason="the real scans are not here")
@pytest.mark.parametrize(("scan", "means"), [("K00", 30), ("G00", 0), ("M01", 0)])
def test_one_team_recorded_means(tmp_path: Path, capsys: pytest.CaptureFixture[str], scan: str, means: int) -> None:
    columns = ["--heading", "turret_deg", "--range", "range_cm", "--scale", "0.01", "--no-echo", "255"]
    file = SCANS / "other_sensors" / f"{scan}.csv"
    assert run(["import", str(file), "--out", str(tmp_path / "out.mcap"), *columns]) == 0
    assert (f"{means} ranges are likely means of 5 pings" in capsys.readouterr().err) == bool(means)


def test_ranges_come_from_the_speed_of_sound_at_20_degrees(tmp_path: Path) -> None:
    (reading,) = imported(tmp_path, "deg,cm\n0,1\n", "--scale", "1")
    assert reading.speed_of_sound == pytest.approx(343.987, abs=1e-3)
    assert reading.echo_times[0] == pytest.approx(2 / 343.987, abs=2e-9)


def test_pings_at_one_heading_are_counted(tmp_path: Path) -> None:
    readings = imported(tmp_path, "deg,cm\n0,1\n0,2\n5,1\n5,2\n5,3\n")
    assert [reading.ping for reading in readings] == [0, 1, 0, 1, 2]


@pytest.mark.skipif(not SCANS.is_dir(), reason="the recorded scans are not part of the repository")
@pytest.mark.parametrize("name", ["A00", "A01", "A02", "A03", "A04", "B01", "B02", "B03", "B04"])
def test_the_real_scans_become_logs(tmp_path: Path, name: str) -> None:
    columns = ["--heading", "turret_deg", "--range", "range_cm", "--scale", "0.01", "--turn", "cw", "--no-echo", "255"]
    assert run(["import", str(SCANS / f"{name}.csv"), "--out", str(tmp_path / "out.mcap"), *columns]) == 0
    rows = [line.split(",") for line in (SCANS / f"{name}.csv").read_text().split()[1:]]
    readings = read_log(tmp_path / "out.mcap").readings
    assert degrees(readings) == pytest.approx([-float(turret) for turret, _ in rows])
    expected = [None if distance == "255" else float(distance) / 100 for _, distance in rows]
    assert [reading.range for reading in readings] == pytest.approx(expected, abs=2e-7)


# two sweeps of four sonars of a Pioneer, as CARMEN's logger writes them: loggerlib/writelog.c of CARMEN 0.7,
# carmen_logwrite_write_base_sonar: "SONAR cone_angle num_sonars [ranges] [x y theta] ipc_timestamp host timestamp"
CARMEN = """# CARMEN Logfile
# message_name [message contents] ipc_timestamp ipc_hostname logger_timestamp
PARAM robot_length 0.5 nohost 0.000000
ODOM 1.000 2.000 0.100000 0.000 0.000 0.000 1005000000.000000 pioneer 0.010000
SONAR 0.523599 4 1.20 0.85 5.00 2.40 0.069 0.136 1.570796 0.114 0.119 0.872665 0.148 0.078 0.523599 0.166 0.027 \
0.174533 1005000000.100000 pioneer 0.110000
ODOM {x} 2.000 0.100000 0.000 0.000 0.000 1005000000.150000 pioneer 0.160000
SONAR 0.523599 4 1.21 0.86 5.00 2.41 0.069 0.136 1.570796 0.114 0.119 0.872665 0.148 0.078 0.523599 0.166 0.027 \
0.174533 1005000000.300000 pioneer 0.310000
SYNC end 1005000000.400000 pioneer 0.410000
"""


def carmen(folder: Path, text: str, *options: str) -> int:
    (folder / "robot.log").write_text(text)
    return run(["import", str(folder / "robot.log"), "--out", str(folder / "out.mcap"), *options])


def test_sonar_lines_of_a_carmen_log_are_sweeps(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert carmen(tmp_path, CARMEN.format(x="1.001"), "--no-echo", "5") == 0
    assert "warning" not in capsys.readouterr().err
    readings = read_log(tmp_path / "out.mcap").readings
    assert degrees(readings) == pytest.approx([90, 50, 30, 10] * 2, abs=1e-4)
    expected = [1.2, 0.85, None, 2.4, 1.21, 0.86, None, 2.41]
    assert [one.range for one in readings] == [one and pytest.approx(one, abs=1e-6) for one in expected]
    assert [one.sweep for one in readings] == [0, 0, 0, 0, 1, 1, 1, 1]
    assert readings[4].time - readings[0].time == pytest.approx(0.2, abs=1e-4)


def test_each_reading_of_a_carmen_log_has_the_pose_of_the_odometry_at_its_time(tmp_path: Path) -> None:
    """The first sweep is 0.1 s after the first of two poses that are 0.15 s apart, the second after both."""
    assert carmen(tmp_path, CARMEN.format(x="1.600"), "--no-echo", "5", "--turn", "cw") == 0
    readings = read_log(tmp_path / "out.mcap").readings
    assert degrees(readings)[0] == pytest.approx(-90, abs=1e-4)
    for reading, x in zip(readings, [1.4] * 4 + [1.6] * 4, strict=True):
        assert reading.pose == pytest.approx((x, 2.0, 0.1), abs=1e-6)


def test_a_log_of_a_moving_robot_is_compared(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert carmen(tmp_path, CARMEN.format(x="1.600"), "--no-echo", "5", "--room", "simple") == 0
    assert run(["compare", str(tmp_path / "out.mcap"), "--board", "hc-sr04", "--json", "--explain"]) == 0
    rows = json.loads(capsys.readouterr().out)["readings"]
    assert [(row["x_m"], row["yaw_deg"]) for row in rows] == [(x, 5.729578) for x in [1.4] * 4 + [1.6] * 4]
