"""`sonarhw import`: direction of headings, units, warnings, and input that is refused before a file is written."""

import math
import os
import struct
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.io import savemat, wavfile
from sonarhw_cli.app import run

from sonarhw.log import read_log
from sonarhw.readings import FloatArray, Reading
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


@pytest.mark.parametrize(
    ("options", "angles"),
    [
        ([], [0, 30, -15]),
        (["--turn", "ccw", "--heading-zero", "90"], [90, 120, 75]),
        (["--turn", "cw"], [0, -30, 15]),
        (["--turn", "cw", "--heading-zero", "90"], [90, 60, 105]),
        (["--turn", "cw", "--heading-zero", "-90"], [-90, -120, -75]),
    ],
)
def test_the_turntable_angle_is_the_heading_zero_plus_or_minus_the_value(
    tmp_path: Path, options: list[str], angles: list[float]
) -> None:
    readings = imported(tmp_path, "deg,cm\n0,1\n30,1\n-15,1\n", *options)
    assert degrees(readings) == pytest.approx(angles, abs=1e-6)


def test_ranges_are_scaled_after_the_comparison_with_no_echo(tmp_path: Path) -> None:
    readings = imported(tmp_path, "deg,cm\n0,122\n3,255\n6,\n9,2.55\n", "--scale", "0.01", "--no-echo", "255")
    assert readings[0].range == pytest.approx(1.22, abs=2e-7)
    assert readings[1].range is None
    assert readings[2].range is None
    assert readings[3].range == pytest.approx(0.0255, abs=2e-7)


@pytest.mark.parametrize("value", ["0", "400"])
def test_a_frequent_range_gives_a_warning_unless_no_echo_is_given(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], value: str
) -> None:
    text = "\n".join(["deg,cm", *(f"{k},{value if k % 4 == 0 else 100 + k}" for k in range(20))])
    assert imported(tmp_path, text, "--scale", "0.01")[0].range == pytest.approx(float(value) / 100, abs=2e-7)
    assert f"5 ranges are {value}; if this means no echo, add --no-echo {value}" in capsys.readouterr().err
    assert imported(tmp_path, text, "--scale", "0.01", "--force", "--no-echo", value)[0].range is None
    assert "warning" not in capsys.readouterr().err


@pytest.mark.parametrize("value", ["inf", "-inf", "nan", "-1"])
def test_no_echo_accepts_any_number(tmp_path: Path, value: str) -> None:
    readings = imported(tmp_path, f"deg,cm\n0,1\n5,{value}\n", "--no-echo", value)
    assert [reading.range is None for reading in readings] == [False, True]


@pytest.mark.parametrize(
    ("text", "options", "warned"),
    [
        (
            "deg,cm\n0,80\n5,95\n10,120\n",
            [],
            "over 95 m, beyond the range of such a board; if they are centimetres, use",
        ),
        ("deg,cm\n0,80\n5,95\n10,120\n", ["--scale", "0.01"], ""),
        ("deg,cm\n0,1\n5,2\n10,120\n", [], ""),
        ("deg,cm\n0,\n", [], ""),
    ],
)
def test_ranges_that_look_like_centimetres_give_a_warning(
    text: str, options: list[str], warned: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    imported(tmp_path, text, *options)
    err = capsys.readouterr().err
    assert ("warning" in err) == bool(warned)
    assert warned in err


def test_ranges_come_from_the_speed_of_sound_at_20_degrees(tmp_path: Path) -> None:
    (reading,) = imported(tmp_path, "deg,cm\n0,1\n")
    assert reading.speed_of_sound == pytest.approx(343.987, abs=1e-3)
    assert reading.echo_times[0] == pytest.approx(2 / 343.987, abs=2e-9)


def test_readings_without_a_time_are_a_tenth_of_a_second_apart(tmp_path: Path) -> None:
    readings = imported(tmp_path, "deg,cm\n0,1\n1,1\n2,1\n")
    assert [reading.time for reading in readings] == pytest.approx([0, 0.1, 0.2])


def test_times_are_relative_to_the_first_reading(tmp_path: Path) -> None:
    readings = imported(tmp_path, "s,deg,cm\n100.5,0,1\n101.25,1,1\n101.25,2,1\n", "--time", "s")
    assert [reading.time for reading in readings] == pytest.approx([0, 0.75, 0.75], abs=2e-6)


def test_a_single_reading_is_counted_in_the_singular(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    imported(tmp_path, "deg,cm\n0,1\n")
    assert capsys.readouterr() == ("", f"1 reading, 1 with an echo, in {tmp_path / 'out.mcap'}\n")


def test_pings_at_one_heading_are_counted(tmp_path: Path) -> None:
    readings = imported(tmp_path, "deg,cm\n0,1\n0,2\n5,1\n5,2\n5,3\n")
    assert [reading.ping for reading in readings] == [0, 1, 0, 1, 2]


def test_an_export_can_be_imported_again(tmp_path: Path) -> None:
    readings = imported(tmp_path, "deg,cm\n0,1.5\n5,\n10,2.5\n")
    exported = tmp_path / "exported.csv"
    assert run(["log", "export", str(tmp_path / "out.mcap"), "--out", str(exported)]) == 0
    columns = ["--heading", "heading_deg", "--range", "range_m", "--time", "time_s"]
    assert run(["import", str(exported), "--out", str(tmp_path / "again.mcap"), *columns]) == 0
    again = read_log(tmp_path / "again.mcap").readings
    assert degrees(again) == pytest.approx(degrees(readings))
    assert [r.range for r in again] == pytest.approx([r.range for r in readings], abs=2e-7)


@pytest.mark.parametrize(
    ("text", "options", "message"),
    [
        ("", [], "in.csv: the file is empty"),
        ("deg,cm\n", [], "in.csv: no readings"),
        ("angle,cm\n0,1\n", [], "line 1: no column 'deg'; columns: angle, cm"),
        ("deg,cm,cm\n0,1,1\n", [], "line 1: more than one column 'cm'"),
        ("deg,cm\n0,1\n5,far\n", [], "line 3: cm is 'far'; expected a number"),
        ("deg,cm\n\n0,1\n\n,1\n", [], "line 5: deg is ''; expected a number"),
        ("deg,cm\n0,nan\n", [], "line 2: cm is nan; expected a range of 0 or more, or nan as the value for no echo"),
        ("deg,cm\nnan,1\n", [], "line 2: deg is nan; expected degrees"),
        ("deg,cm,s\n0,1,nan\n", ["--time", "s"], "line 2: s is nan; expected seconds"),
        ("deg,cm,s\n0,1,\n", ["--time", "s"], "line 2: s is ''; expected a number"),
        ("deg,cm\n0,1\n", ["--time", ""], "line 1: no column ''; columns: deg, cm"),
        ("deg;cm\n0;1\n", [], "line 1: only one column, with semicolons in it; expected commas between columns"),
        ("deg\tcm\n0\t1\n", [], "line 1: only one column, with tabs in it; expected commas between columns"),
        ("deg,cm\ninf,1\n", [], "line 2: deg is inf"),
        ("deg,cm\n0,-1\n", [], "line 2: cm is -1; expected a range of 0 or more, or -1 as the value for no echo"),
        ("deg,cm\n0,inf\n", [], "line 2: cm is inf"),
        ("deg,cm\n0\n", [], "line 2: has 1 field, but none for column 'cm'"),
        ("deg,cm\n0,1e6\n", [], "line 2: range 1e+06 m"),
        ("deg,cm\n1e6,1\n", [], "line 2: turntable angle 1e+06 degrees"),
        ("deg,cm\n0,1\n", ["--time", "s"], "line 1: no column 's'"),
        ("deg,cm,s\n0,1,2\n1,1,1\n", ["--time", "s"], "line 3: time 1 s is before"),
        ("deg,cm,s\n0,1,2\n1,1,1e300\n", ["--time", "s"], "line 3: time 1e+300 s"),
        (
            "deg,cm\n0,1,5\n",
            [],
            "line 2: has 3 fields; expected 2, as in the header; if its numbers have decimal commas",
        ),
        ("deg,cm\n0,1\n10,5,1,25\n", [], "line 3: has 4 fields; expected 2"),
        ('deg,cm\n0,"1,5"\n', [], "line 2: cm is '1,5'; expected a number; if its numbers have decimal commas, write"),
        ("deg;cm\n0;1,5\n", [], "line 1: only one column, with semicolons in it"),
        ("deg;cm\n0;1,5\n", [], "--decimal-comma"),
        ("deg,cm\n0,1\n", ["--decimal-comma"], "line 1: only one column; with decimal commas, expected semicolons"),
        ("deg;cm\n0;1;2\n", ["--decimal-comma"], "line 2: has 3 fields; expected 2, as in the header"),
        ("deg,cm\n0,1_0\n", [], "line 2: cm is '1_0'; expected a number"),
        ("deg,cm\n0,٣\n", [], "line 2: cm is '٣'; expected a number"),
        ("deg,cm\n0,1\0\n", [], r"line 2: cm is '1\x00'; expected a number"),
        ("deg,cm\n0,0x10\n", [], "line 2: cm is '0x10'; expected a number"),
        ("deg,cm\n0,1\n", ["--range", "deg"], "column 'deg' is given for two quantities; expected one column each"),
        ("deg,cm\n0,1\n", ["--time", "cm"], "column 'cm' is given for two quantities"),
        (
            "deg,cm,s\n0,1,0\n1,1,1e9\n",
            ["--time", "s"],
            "line 3: time 1e+09 s; expected seconds, at most 86400 s",
        ),
        pytest.param(f"deg,cm\n0,{100_000 * '1'}\n", [], "line 2: has more than 65536 characters", id="a long line"),
        ("deg,cm\n0,1\n", ["--scale", "0"], "--scale 0"),
        ("deg,cm\n0,1\n", ["--scale", "nan"], "--scale nan"),
        ("deg,cm\n0,1\n", ["--heading-zero", "inf"], "--heading-zero inf"),
        ("deg,cm\n0,1\n", ["--turn", "left"], "left"),
    ],
)
def test_invalid_input_gives_an_error_of_one_line_and_no_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str, options: list[str], message: str
) -> None:
    (tmp_path / "in.csv").write_text(text)
    assert run(["import", str(tmp_path / "in.csv"), "--out", str(tmp_path / "out.mcap"), *COLUMNS, *options]) == 2
    out, err = capsys.readouterr()
    assert message in err
    assert err.count("\n") == 1
    assert out == ""
    assert not (tmp_path / "out.mcap").exists()


def test_too_many_readings_give_an_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sonarhw_compare.imports.foreign_csv.MOST_READINGS", 200)  # a thousandth of the limit
    (tmp_path / "in.csv").write_text("deg,cm\n" + 201 * "1,1\n")
    assert run(["import", str(tmp_path / "in.csv"), "--out", str(tmp_path / "out.mcap"), *COLUMNS]) == 2
    assert "has more than 200 readings; split it" in capsys.readouterr().err
    assert not (tmp_path / "out.mcap").exists()


@pytest.mark.parametrize("separator", [";", "\t"])
def test_decimal_commas_are_read_with_an_option(tmp_path: Path, separator: str) -> None:
    (tmp_path / "in.csv").write_text("deg;cm\n0,5;1,25\n10;2\n".replace(";", separator))
    out = tmp_path / "out.mcap"
    assert run(["import", str(tmp_path / "in.csv"), "--out", str(out), *COLUMNS, "--decimal-comma"]) == 0
    readings = read_log(out).readings
    assert degrees(readings) == pytest.approx([0.5, 10])
    assert [reading.range for reading in readings] == pytest.approx([1.25, 2], abs=2e-7)


def test_empty_fields_at_the_end_of_a_line_and_a_byte_order_mark_are_harmless(tmp_path: Path) -> None:
    readings = imported(tmp_path, "\ufeffdeg,cm\n0,1.5,,\n5,2,\n")
    assert [reading.range for reading in readings] == pytest.approx([1.5, 2], abs=2e-7)


@pytest.mark.parametrize("kind", ["a pipe", "a device", "UTF-16"])
def test_what_is_not_a_text_file_is_refused_at_once(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], kind: str
) -> None:
    path = tmp_path / "in.csv"
    match kind:
        case "a pipe":
            os.mkfifo(path)
        case "a device":
            path.symlink_to("/dev/zero")
        case "UTF-16":
            path.write_text("deg,cm\n0,1\n", encoding="utf-16")
    assert run(["import", str(path), "--out", str(tmp_path / "out.mcap"), *COLUMNS]) == 2
    expected = "save it as CSV in UTF-8" if kind == "UTF-16" else "is not a file; give the name of a CSV file"
    assert expected in capsys.readouterr().err


@pytest.mark.parametrize("content", [b"\xff\xfe\x00\x01", b"deg,cm\n0,\x00\n" + b"\xe9"])
def test_binary_input_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str], content: bytes) -> None:
    (tmp_path / "in.csv").write_bytes(content)
    assert run(["import", str(tmp_path / "in.csv"), "--out", str(tmp_path / "out.mcap"), *COLUMNS]) == 2
    assert "in.csv" in capsys.readouterr().err
    assert not (tmp_path / "out.mcap").exists()


def test_a_missing_file_and_an_existing_log_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["import", str(tmp_path / "in.csv"), "--out", str(tmp_path / "out.mcap"), *COLUMNS]) == 2
    assert "cannot be read: No such file" in capsys.readouterr().err
    (tmp_path / "in.csv").write_text("deg,cm\n0,1\n")
    (tmp_path / "out.mcap").write_text("mine")
    assert run(["import", str(tmp_path / "in.csv"), "--out", str(tmp_path / "out.mcap"), *COLUMNS]) == 2
    assert (tmp_path / "out.mcap").read_text() == "mine"


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


def test_room_place_and_board_are_stored_for_later_commands(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    simple = ["--room", "simple", "--board", "paper"]
    imported(tmp_path, "deg,cm\n90,0.657\n180,0.774\n270,0.827\n", *simple, "--place", "figure9")
    capsys.readouterr()
    assert run(["compare", str(tmp_path / "out.mcap")]) == 0
    assert "match        0.827 m at 270.0°" in capsys.readouterr().out
    # the place may be unknown: locate finds it
    imported(tmp_path, "deg,cm\n90,0.657\n", *simple, "--force")
    metadata = read_log(tmp_path / "out.mcap").metadata
    assert (metadata.room_file, metadata.place, metadata.board) == ("simple.toml", "", "paper")


def test_a_place_without_its_room_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "in.csv").write_text("deg,cm\n90,1\n")
    out = tmp_path / "out.mcap"
    assert run(["import", str(tmp_path / "in.csv"), "--out", str(out), *COLUMNS, "--place", "figure9"]) == 2
    assert "--place needs --room" in capsys.readouterr().err
    assert not out.exists()


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
        ("", "has no SONAR line"),
        ("SONAR 0.5\n", "line 1: expected the cone angle and the number of sonars"),
        ("SONAR 0.5 2 1.0 1.0 0 0 0 0 0 0 1.0 host\n", "line 1: has 12 fields after SONAR; expected 13 for 2 sonars"),
        ("SONAR 0.5 1 x 0 0 0 1.0 host 1.0\n", "line 1: could not convert string to float: 'x'; expected numbers"),
        ("SONAR 0.5 1 inf 0 0 0 1.0 host 1.0\n", "line 1: expected 5 finite numbers"),
        ("SONAR 0.5 1 -1 0 0 0 1.0 host 1.0\n", "line 1: range -1; expected 0 or more"),
        ("SONAR 0.5 999999999999 1 0 0 0 1.0 host 1.0\n", "line 1: expected the cone angle and the number of sonars"),
        ("SONAR " + "1 " * 40000, "line 1: has more than 65536 characters; expected a CARMEN log"),
        ("a\0\n", "has no SONAR line"),
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
    assert "--range: a CSV file needs it" in capsys.readouterr().err


def text_of_qt(text: str) -> bytes:
    content = text.encode("utf-16-be")
    return struct.pack(">I", len(content)) + content


def ping_message(number: int, payload: bytes) -> bytes:
    """A message of the Ping protocol (docs.bluerobotics.com/ping-protocol): BR, length, number, ids, sum of bytes."""
    frame = struct.pack("<2sHHBB", b"BR", len(payload), number, 1, 0) + payload
    return frame + struct.pack("<H", sum(frame) & 0xFFFF)


def profile(gradians: int, samples: bytes, automatic: bool) -> bytes:
    head = struct.pack("<BBHHHH", 1, 0, gradians, 80, 80, 750)  # a sample each 80 · 25 ns = 2 µs
    if automatic:
        return ping_message(2301, head + struct.pack("<HHBBHH", 0, 399, 1, 0, len(samples), len(samples)) + samples)
    return ping_message(2300, head + struct.pack("<HH", len(samples), len(samples)) + samples)


def ping360_log(*messages: tuple[str, bytes]) -> bytes:
    """A log as Ping Viewer writes it: src/link/logsensorstruct.cpp and examples/decode_sensor_binary_log.py."""
    header = text_of_qt("PingViewer sensor log file") + struct.pack(">i", 1)
    header += b"".join(map(text_of_qt, ("a1e1cb2", "2019-09-24", "v2.0.4", "Debian", "12"))) + struct.pack(">ii", 1, 2)
    return header + b"".join(text_of_qt(time) + struct.pack(">I", len(message)) + message for time, message in messages)


def ringing(echo: int) -> bytes:
    samples = np.full(1000, 10, np.uint8)
    samples[:50], samples[echo : echo + 20] = 255, 200
    return samples.tobytes()


LOG_360 = ping360_log(
    ("23:59:59.900", profile(100, ringing(400), automatic=False)),
    ("23:59:59.950", ping_message(4, b"\1\0\0\0\0\0")),
    ("00:00:00.100", profile(101, ringing(500), automatic=True)),
)


def ping360(folder: Path, content: bytes, *options: str) -> int:
    (folder / "sonar.bin").write_bytes(content)
    return run(["import", str(folder / "sonar.bin"), "--out", str(folder / "out.mcap"), *options])


def test_profiles_of_a_ping360_are_traces_with_the_first_loud_sample_as_echo(tmp_path: Path) -> None:
    options = ["--threshold", "0.5", "--blanking", "0.0002", "--speed-of-sound", "1500"]
    assert ping360(tmp_path, LOG_360, *options) == 0
    readings = read_log(tmp_path / "out.mcap").readings
    assert degrees(readings) == pytest.approx([90.0, 90.9], abs=1e-5)
    assert [one.range for one in readings] == [pytest.approx(k * 2e-6 * 750, abs=2e-6) for k in (400, 500)]
    assert readings[1].time - readings[0].time == pytest.approx(0.2, abs=1e-5)
    trace = readings[1].trace
    assert trace is not None
    assert trace.rate == pytest.approx(500_000)
    assert (trace.samples * 255).round().astype(np.uint8).tobytes() == ringing(500)


# messages 2300, 2301 and 4 packed by bluerobotics-ping 0.2.5, in the file of Ping Viewer's encode_sensor_binary_log.py
BY_BLUE_ROBOTICS = """\
0000001a50696e675669657765722073656e736f72206c6f672066696c650000000100000007303235383365310000000a32
3032342d30312d30310000000676322e342e30000000065562756e74750000000532322e303400000002000000020000000c
31323a30303a30302e3235300000002042521600fc0800000101640064006400ee0208000800ff050505dc090505d9050000
000c31323a30303a30312e3235300000002642521c00fd08000001018f0164006400ee0200008f01010008000800ff050505
dc0905059d060000000c31323a30303a30392e3030300000001042520600040000000000000000009e00"""


def test_messages_of_blue_robotics_own_library_are_read(tmp_path: Path) -> None:
    options = ["--threshold", "0.5", "--blanking", "0.000006", "--speed-of-sound", "1500"]
    assert ping360(tmp_path, bytes.fromhex(BY_BLUE_ROBOTICS.replace("\n", "")), *options) == 0
    readings = read_log(tmp_path / "out.mcap").readings
    assert degrees(readings) == pytest.approx([90.0, 359.1], abs=1e-4)
    # the fifth sample, 220, is the first loud one after blanking: 4 periods of 100 · 25 ns
    assert [one.range for one in readings] == [pytest.approx(4 * 100 * 25e-9 * 750, abs=1e-6)] * 2
    assert readings[1].time - readings[0].time == pytest.approx(1.0, abs=1e-5)
    for reading in readings:
        assert reading.trace is not None
        assert (reading.trace.samples * 255).round().tolist() == [255, 5, 5, 5, 220, 9, 5, 5]


def test_without_a_threshold_profiles_have_no_echo_and_a_torn_log_gives_those_before(tmp_path: Path) -> None:
    assert ping360(tmp_path, LOG_360[:-100]) == 0
    (reading,) = read_log(tmp_path / "out.mcap").readings
    assert reading.range is None
    assert reading.trace is not None


@pytest.mark.parametrize(
    ("content", "options", "message"),
    [
        (b"", [], "has no header of Ping Viewer"),
        (b"\xff" * 100, [], "has no header of Ping Viewer"),
        (b"\0\0\xff\xff" * 100, [], "has no header of Ping Viewer"),
        (b"\7" * 1000, [], "a text or message of 117901063 bytes; expected a log of Ping Viewer"),
        (ping360_log(), [], "has no profile of a Ping360"),
        (ping360_log(("noon", b"")), [], "message 1: has no time hh:mm:ss.zzz"),
        (ping360_log(("00:00:00.000", b"BR")), [], "message 1: 2 bytes; expected a message of the Ping protocol"),
        (LOG_360[:-1] + b"\0", [], "message 3: start, length or checksum is wrong"),
        (ping360_log(("00:00:00.000", ping_message(2300, b"\0\0"))), [], "message 1: a profile of 2 bytes"),
        (ping360_log(("00:00:00.000", profile(0, b"", False))), [], "message 1: a profile of 0 samples"),
        (LOG_360, ["--threshold", "2"], "--threshold 2: expected a share of full scale"),
        (LOG_360, ["--blanking", "0.1"], "--blanking 0.1: expected 0 to 1 s, and --threshold"),
        (LOG_360, ["--no-echo", "1"], "--no-echo 1: only for formats with ranges"),
        (LOG_360, ["--speed-of-sound", "0"], "--speed-of-sound 0: expected 100 to 10000 m/s"),
    ],
)
def test_a_wrong_ping360_log_is_refused_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], content: bytes, options: list[str], message: str
) -> None:
    assert ping360(tmp_path, content, *options) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1
    assert not (tmp_path / "out.mcap").exists()


def test_more_samples_than_fit_into_memory_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sonarhw_compare.imports.foreign_rows.MOST_SAMPLES", 1500)
    assert ping360(tmp_path, LOG_360) == 2
    assert "traces of more than 1500 samples; split it into several files" in capsys.readouterr().err


def pulses() -> FloatArray:
    """Three pings of 400 samples at 100 kHz, each with a decaying burst of 40 kHz, in 16 bits and in [-1, 1]."""
    times = np.arange(400) / 1e5
    signals = [np.where(times >= at, 0.7 * np.sin(math.tau * 4e4 * (times - at + 5e-6)), 0.0) for at in (1e-3, 2e-3)]
    return np.round(np.array([*signals, np.zeros(400)]) * 32767) / 32768


def raw_file(folder: Path, suffix: str) -> tuple[Path, list[str]]:
    """Write the pulses as a program of each kind does: SciPy for WAV and MAT, NumPy for NPY and text."""
    file, samples = folder / f"raw{suffix}", pulses()
    match suffix:
        case ".wav":
            wavfile.write(file, 100_000, (samples.T * 32768).astype(np.int16))
            return file, []
        case ".npy":
            np.save(file, (samples * 32768).astype(np.int16))
        case ".mat":
            savemat(file, {"echoes": samples, "rate": 1e5}, do_compression=True)
        case _:
            np.savetxt(file, samples, delimiter=",")
    return file, ["--rate", "100000"]


@pytest.mark.parametrize("suffix", [".wav", ".npy", ".mat", ".csv", ".txt"])
def test_raw_traces_are_readings_a_step_apart(tmp_path: Path, suffix: str) -> None:
    file, rate = raw_file(tmp_path, suffix)
    options = [*rate, "--step", "10", "--heading-zero", "45", "--turn", "cw", "--threshold", "0.2"]
    assert run(["import", str(file), "--out", str(tmp_path / "out.mcap"), *options]) == 0
    readings = read_log(tmp_path / "out.mcap").readings
    assert degrees(readings) == pytest.approx([45, 35, 25], abs=1e-5)
    assert [one.echo_times for one in readings] == [
        (pytest.approx(1e-3, abs=1.1e-5),),
        (pytest.approx(2e-3, abs=1.1e-5),),
        (),
    ]
    for reading, samples in zip(readings, pulses(), strict=True):
        assert reading.trace is not None
        assert reading.trace.carrier
        assert reading.trace.rate == pytest.approx(100_000)
        assert reading.trace.samples == pytest.approx(samples, abs=1 / 127)


def test_text_has_room_for_the_longest_traces_and_not_for_longer_ones(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, out = tmp_path / "raw.csv", tmp_path / "out.mcap"
    command = ["import", str(file), "--out", str(out), "--rate", "1e6"]
    for count, status in ((65_535, 0), (75_000, 2)):
        np.savetxt(file, -0.123456789 * np.ones((2, count)), delimiter=",")
        assert run([*command, "--force"]) == status
    assert "has more than" in capsys.readouterr().err
    assert [len(one.trace.samples) for one in read_log(out).readings if one.trace is not None] == [65_535] * 2


@pytest.mark.parametrize(
    ("name", "content", "options", "message"),
    [
        ("a.wav", b"RIFF1234WAVE", [], "is not a WAV file"),
        ("a.wav", b"no", [], "is not a WAV file"),
        ("a.wav", b"", ["--rate", "1e5"], "--rate 100000: a WAV file has its own"),
        ("a.npy", b"", ["--rate", "1e5"], "is not an array of NumPy"),
        ("a.npy", b"0.1 0.2\n", ["--rate", "1e5"], "This file contains pickled (object) data\n"),
        ("a.npy", b"\x93NUMPY\1\0", ["--rate", "1e5"], "is not an array of NumPy"),
        ("a.npy", b"", [], "needs --rate, Hz"),
        ("a.mat", b"", ["--rate", "1e5"], "is not a MAT file"),
        ("a.mat", b"MATLAB 5.0 MAT-file" * 20, ["--rate", "1e5"], "is not a MAT file"),
        ("a.csv", b"", ["--rate", "1e5"], "the file is empty"),
        ("a.csv", b"0.1,x\n", ["--rate", "1e5"], "line 1: could not convert string to float: 'x'"),
        ("a.csv", b"0.1,0.2\n0.1\n", ["--rate", "1e5"], "line 2: 1 samples; expected 2, as above"),
        ("a.csv", b"0.1,2.5\n", ["--rate", "1e5"], "a sample of 2.5; expected shares of full scale"),
        ("a.csv", b"0.1,nan\n", ["--rate", "1e5"], "a sample of nan; expected shares of full scale"),
        ("a.csv", b"0.1,0.2\n", ["--rate", "5"], "a sampling rate of 5.0 Hz; expected 1000 to 1e+07 Hz"),
        ("a.csv", b"0.1,0.2\n", ["--rate", "1e5", "--heading", "a"], "--heading: only for CSV files"),
        ("a.csv", b"0.1,0.2\n", ["--rate", "1e5", "--step", "999"], "--step 999: expected -360 to 360 degrees"),
        ("a.log", b"", ["--step", "9"], "--step 9: only for raw traces and ROS bags"),
    ],
)
def test_wrong_raw_traces_are_refused_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str, content: bytes, options: list[str], message: str
) -> None:
    (tmp_path / name).write_bytes(content)
    assert run(["import", str(tmp_path / name), "--out", str(tmp_path / "out.mcap"), *options]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1
    assert not (tmp_path / "out.mcap").exists()


@pytest.mark.parametrize(
    ("table", "message"),
    [
        (np.zeros((2, 3, 4)), "an array of shape (2, 3, 4)"),
        (np.zeros((2, 70_000), np.int8), "traces of 70000 samples; expected 2 to 65535"),
        (np.array(["a", "b"]), "and type <U1; expected numbers"),
    ],
)
def test_an_array_of_another_shape_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], table: NDArray[np.generic], message: str
) -> None:
    np.save(tmp_path / "a.npy", table)
    command = ["import", str(tmp_path / "a.npy"), "--out", str(tmp_path / "out.mcap"), "--rate", "1e5"]
    assert run(command) == 2
    assert message in capsys.readouterr().err
