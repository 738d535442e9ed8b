"""`sonarhw import` of the sonar lines of CARMEN logs."""

from pathlib import Path

import pytest
from sonarhw_cli.app import run

from sonarhw.log import read_log
from tests.system.cli.importing.test_import_csv import degrees

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


def test_a_moving_robot_gives_a_warning(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert carmen(tmp_path, CARMEN.format(x="1.500"), "--no-echo", "5", "--turn", "cw") == 0
    assert "the robot moves by 0.50 m between the readings" in capsys.readouterr().err
    assert degrees(read_log(tmp_path / "out.mcap").readings)[0] == pytest.approx(-90, abs=1e-4)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "the file is empty"),
        ("SONAR 0.5\n", "line 1: expected the cone angle and the number of sonars"),
        ("SONAR 0.5 2 1.0 1.0 0 0 0 0 0 0 1.0 host\n", "line 1: has 12 fields after SONAR; expected 13 for 2 sonars"),
        ("SONAR 0.5 1 x 0 0 0 1.0 host 1.0\n", "line 1: could not convert string to float: 'x'; expected numbers"),
        ("SONAR 0.5 1 inf 0 0 0 1.0 host 1.0\n", "line 1: expected 5 finite numbers"),
        ("SONAR 0.5 1 -1 0 0 0 1.0 host 1.0\n", "line 1: range -1; expected 0 or more"),
        ("SONAR 0.5 999999999999 1 0 0 0 1.0 host 1.0\n", "line 1: expected the cone angle and the number of sonars"),
        ("SONAR " + "1 " * 40000, "line 1: has more than 65536 characters; expected a CARMEN log"),
        ("a\0\n", "no readings were recognised in the text"),
    ],
)
def test_a_wrong_carmen_log_is_refused_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str, message: str
) -> None:
    assert carmen(tmp_path, text) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1
    assert not (tmp_path / "out.mcap").exists()


def test_options_of_csv_files_are_refused_for_other_formats(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert carmen(tmp_path, CARMEN.format(x="1"), "--range", "cm") == 2
    assert "--range: only for CSV files; robot.log has the format CARMEN logs" in capsys.readouterr().err
    (tmp_path / "in.csv").write_text("deg,cm\n0,1\n")
    assert run(["import", str(tmp_path / "in.csv"), "--out", str(tmp_path / "out.mcap"), "--heading", "deg"]) == 2
    message = "in.csv: a CSV file needs --heading COL and --range COL; its columns: deg, cm; "
    assert message in capsys.readouterr().err
