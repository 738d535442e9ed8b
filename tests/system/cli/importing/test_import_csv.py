"""`sonarhw import` of CSV files: direction of headings, units, warnings, and input that is refused before writing."""

import math
import os
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


def means_of_five() -> str:
    """Return a file of means of five pings, in whole centimetres: walls at 51 and 214 cm in turn, silence as 255."""
    ranges: list[int] = []
    for wall, following in [(51, 214), (214, 255), (255, 51)] * 4:
        ranges += [wall] * 8 + [((5 - later) * wall + later * following) // 5 for later in (1, 2, 3, 4)]
    return "\n".join(["deg,cm", *(f"{2 * k},{one}" for k, one in enumerate(ranges))])


@pytest.mark.parametrize(("unit", "options"), [("cm", ["--scale", "0.01"]), ("m", [])])
def test_means_of_different_ranges_give_a_warning_and_are_left_out(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], unit: str, options: list[str]
) -> None:
    text, silent = means_of_five(), "255"
    if unit == "m":
        rows = [line.split(",") for line in text.splitlines()[1:]]
        text, silent = "\n".join(["deg,cm", *(f"{deg},{int(cm) / 100}" for deg, cm in rows)]), "2.55"
    options = [*options, "--no-echo", silent]
    assert len(imported(tmp_path, text, *options)) == 144
    err = capsys.readouterr().err
    assert "warning: 44 ranges are likely means of 5 pings with different ranges" in err
    assert "add --mean-of 5" in err
    kept = imported(tmp_path, text, *options, "--mean-of", "5", "--force")
    err = capsys.readouterr().err
    assert "44 means of different ranges left out" in err
    assert "warning" not in err
    assert [one.number for one in kept] == list(range(100))
    # the last four have no wall behind them
    assert {None if one.range is None else round(one.range, 2) for one in kept[:-4]} == {0.51, 2.14, None}


@pytest.mark.skipif(not SCANS.is_dir(), reason="the real scans are not here")
@pytest.mark.parametrize(("scan", "means"), [("K00", 30), ("G00", 0), ("M01", 0)])
def test_one_team_recorded_means_of_five_pings(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], scan: str, means: int
) -> None:
    columns = ["--heading", "turret_deg", "--range", "range_cm", "--scale", "0.01", "--no-echo", "255"]
    file = SCANS / "other_sensors" / f"{scan}.csv"
    assert run(["import", str(file), "--out", str(tmp_path / "out.mcap"), *columns]) == 0
    assert (f"{means} ranges are likely means of 5 pings" in capsys.readouterr().err) == bool(means)


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
        ("0,1.5\n10,1.6\n", [], "columns: 0, 1.5; if the first line is a reading, add a line with names above it"),
        ("deg,cm,cm\n0,1,1\n", [], "line 1: more than one column 'cm'"),
        ("deg,cm\n0,1\n5,far\n", [], "line 3: cm is 'far'; expected a number"),
        ("deg,cm\n\n0,1\n\n,1\n", [], "line 5: deg is ''; expected a number"),
        (
            "deg,cm\n0,nan\n",
            [],
            "line 2: cm is nan; expected a range of 0 or more; if nan means no echo, use",
        ),
        ("deg,cm\nnan,1\n", [], "line 2: deg is nan; expected degrees"),
        ("deg,cm,s\n0,1,nan\n", ["--time", "s"], "line 2: s is nan; expected seconds"),
        ("deg,cm,s\n0,1,\n", ["--time", "s"], "line 2: s is ''; expected a number"),
        ("deg,cm\n0,1\n", ["--time", ""], "line 1: no column ''; columns: deg, cm"),
        ("deg;cm\n0;1\n", [], "line 1: only one column, with semicolons in it; expected commas between columns"),
        ("deg\tcm\n0\t1\n", [], "line 1: only one column, with tabs in it; expected commas between columns"),
        ("deg,cm\ninf,1\n", [], "line 2: deg is inf"),
        (
            "deg,cm\n0,-1\n",
            [],
            "cm is -1; expected a range of 0 or more; if -1 means no echo, use `sonarhw import",
        ),
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
        ("deg,cm\n0,1\n", ["--heading-zero", "3e3"], "--heading-zero 3000: expected degrees between -2147 and 2147"),
        ("deg,cm\n0,1\n", ["--mean-of", "1"], "--mean-of 1: expected 2 to 8 pings"),
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
    monkeypatch.setattr("sonarhw_compare.foreign_csv.MOST_READINGS", 200)  # a thousandth of the limit
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


@pytest.mark.parametrize("encoding", ["utf-16", "utf-8-sig", "latin-1"])
def test_other_encodings_are_read(tmp_path: Path, encoding: str) -> None:
    (tmp_path / "in.csv").write_bytes("Winkel °,Abstand (cm)\r\n0,150\r\n5,\r\n10,90\r\n".encode(encoding))
    command = ["import", str(tmp_path / "in.csv"), "--out", str(tmp_path / "out.mcap"), "--scale", "0.01"]
    assert run([*command, "--heading", "Winkel °", "--range", "Abstand (cm)"]) == 0
    assert [reading.range for reading in read_log(tmp_path / "out.mcap").readings] == [
        pytest.approx(1.5, abs=2e-7),
        None,
        pytest.approx(0.9, abs=2e-7),
    ]


@pytest.mark.parametrize("kind", ["a pipe", "a device", "bytes"])
def test_what_is_not_a_text_file_is_refused_at_once(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], kind: str
) -> None:
    path = tmp_path / "in.csv"
    match kind:
        case "a pipe":
            os.mkfifo(path)
        case "a device":
            path.symlink_to("/dev/zero")
        case "bytes":
            path.write_bytes(b"\xff\xfe\xff\xfe\x01" * 20)
    assert run(["import", str(path), "--out", str(tmp_path / "out.mcap"), *COLUMNS]) == 2
    expected = "expected a CSV file in UTF-8" if kind == "bytes" else "not a file; expected a CSV file"
    assert expected in capsys.readouterr().err


@pytest.mark.parametrize("content", [b"\xff\xfe\x00\x01", b"deg,cm\n0,\x00\n" + b"\xe9"])
def test_binary_input_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str], content: bytes) -> None:
    (tmp_path / "in.csv").write_bytes(content)
    assert run(["import", str(tmp_path / "in.csv"), "--out", str(tmp_path / "out.mcap"), *COLUMNS]) == 2
    assert "in.csv" in capsys.readouterr().err
    assert not (tmp_path / "out.mcap").exists()


@pytest.mark.parametrize("columns", [COLUMNS, []])
def test_a_log_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str], columns: list[str]) -> None:
    (log := tmp_path / "in.mcap").write_bytes(b"\x89MCAP0\r\n")
    assert run(["import", str(log), "--out", str(tmp_path / "out.mcap"), *columns]) == 2
    assert capsys.readouterr().err.startswith(f"sonarhw: {log}: is a log already")
    assert list(tmp_path.iterdir()) == [log]


def test_a_missing_file_and_an_existing_log_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["import", str(tmp_path / "in.csv"), "--out", str(tmp_path / "out.mcap"), *COLUMNS]) == 2
    assert "in.csv: no such file; give the name of a CSV file" in capsys.readouterr().err
    (tmp_path / "in.csv").write_text("deg,cm\n0,1\n")
    (tmp_path / "out.mcap").write_text("mine")
    assert run(["import", str(tmp_path / "in.csv"), "--out", str(tmp_path / "out.mcap"), *COLUMNS]) == 2
    assert (tmp_path / "out.mcap").read_text() == "mine"


def test_a_folder_that_is_no_bag_is_refused_as_a_folder(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder := tmp_path / "scans").mkdir()
    assert run(["import", str(folder), "--out", str(tmp_path / "out.mcap")]) == 2
    assert "scans: is a folder without metadata.yaml; give a file" in capsys.readouterr().err


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
