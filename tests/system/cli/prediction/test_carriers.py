"""Mounts, rings, units and models on the command line: simulate, scan with a fake scanner, compare."""

import csv
import io
import json
import math
from pathlib import Path

import pytest
from sonarhw_cli.app import run

ROOM = "rooms/simple.toml"
PROFILE = """
name = "mine"
aperture_radius = 0.0192
frequency = 49400.0
transmit_cycles = 16
blanking = 0.00238
max_range = 3.0
threshold_db = -35.0
absorption = false
"""


def profile(folder: Path, lines: str) -> str:
    path = folder / "mine.toml"
    path.write_text(PROFILE + lines)
    return str(path)


def simulated(capsys: pytest.CaptureFixture[str], *arguments: str) -> list[dict[str, str]]:
    assert run(["simulate", ROOM, *arguments]) == 0
    return list(csv.DictReader(io.StringIO(capsys.readouterr().out)))


def refused(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    assert run([*arguments]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1
    return captured.err


def test_reflecting_unit_reads_minimum_range_beside_the_wall_of_figure_7(capsys: pytest.CaptureFixture[str]) -> None:
    options = ("--place", "figure7", "--board", "paper", "--from", "0", "--to", "1")
    readings = {
        unit: simulated(capsys, *options, "--unit", unit)[0]["range_m"] for unit in ("block", "pass", "reflect")
    }
    assert readings["reflect"] == "0.47"
    assert readings["pass"] == "1.022"
    assert readings["block"] != "1.022"


def test_face_beyond_a_wall_gives_a_warning_with_the_number_of_headings(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    # figure9 is 85 mm from the bottom and 154 mm from the right
    board = profile(tmp_path, "[mount]\nahead = 0.1\n")
    assert run(["simulate", ROOM, "--place", "figure9", "--board", board, "--step", "90"]) == 0
    assert "at 1 heading of 4 board 'mine' has its face outside room" in capsys.readouterr().err
    assert run(["simulate", ROOM, "--place", "figure9", "--board", board, "--to", "200", "--step", "90"]) == 0
    assert "outside" not in capsys.readouterr().err


def test_model_without_directivity_has_levels_of_0_db(capsys: pytest.CaptureFixture[str]) -> None:
    assert {row["level_db"] for row in simulated(capsys, "--place", "figure7", "--model", "cone")} == {"0"}


def test_face_ahead_of_the_axis_is_nearer_to_the_wall(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    board = profile(tmp_path, "[mount]\nahead = 0.05\n")
    rows = simulated(capsys, "--place", "figure9", "--board", board, "--from", "90", "--to", "180", "--step", "90")
    assert float(rows[0]["range_m"]) == pytest.approx(0.657 - 0.05)


def test_ring_has_one_row_for_each_sensor(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    board = profile(tmp_path, "[ring]\nsensors = 4\nradius = 0.05\ninterval = 0.1\n")
    rows = simulated(capsys, "--place", "0.4,0.3", "--board", board)
    assert [row["heading_deg"] for row in rows] == ["0", "90", "180", "270"]
    assert float(rows[0]["range_m"]) == pytest.approx(0.528 - 0.05)
    message = refused(capsys, "simulate", ROOM, "--place", "0.4,0.3", "--board", board, "--step", "10")
    assert "ring of 4 sensors" in message


def test_seed_adds_random_errors_to_the_nearest_wall(capsys: pytest.CaptureFixture[str]) -> None:
    options = ("--place", "figure9", "--model", "nearest", "--step", "90")
    exact, one, again, other = (
        [float(row["range_m"]) for row in simulated(capsys, *options, *seed)]
        for seed in ((), ("--seed", "1"), ("--seed", "1"), ("--seed", "2"))
    )
    assert exact == pytest.approx([0.154, 0.657, 0.774, 0.085])
    assert one == again != other
    assert max(abs(a - b) for a, b in zip(exact, one, strict=True)) < 0.2
    assert not any(math.isclose(a, b) for a, b in zip(exact, one, strict=True))


@pytest.mark.parametrize(
    ("lines", "step"),
    [("[mount]\nahead = 0.05\n", "45"), ("[ring]\nsensors = 4\nradius = 0.05\ninterval = 0.1\n", "90")],
)
def test_fake_scanner_and_comparison_use_the_mount_of_the_profile(
    lines: str, step: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    board, log = profile(tmp_path, lines), str(tmp_path / "scan.mcap")
    fake = f"fake:{ROOM}?place=figure9&board={board}&seed=1&pace=max"
    assert (
        run(["scan", fake, "--room", ROOM, "--place", "figure9", "--board", board, "--step", step, "--out", log]) == 0
    )
    capsys.readouterr()
    assert run(["compare", log, "--room", ROOM, "--place", "figure9", "--board", board, "--json"]) == 0
    mounted = json.loads(capsys.readouterr().out)
    assert run(["compare", log, "--room", ROOM, "--place", "figure9", "--board", "paper", "--json"]) == 0
    on_axis = json.loads(capsys.readouterr().out)
    assert mounted["n"] == 360 / int(step)
    assert mounted["median_abs_error_m"] < 0.02
    assert mounted["matched"] > on_axis["matched"] or on_axis["median_abs_error_m"] > 0.03


def test_ring_is_not_fitted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    board, log = profile(tmp_path, "[ring]\nsensors = 4\nradius = 0.05\n"), str(tmp_path / "scan.mcap")
    simulated(capsys, "--place", "0.4,0.3", "--board", "paper", "--step", "90")
    assert run(["simulate", ROOM, "--place", "0.4,0.3", "--board", board, "--out", log]) == 0
    capsys.readouterr()
    message = refused(capsys, "compare", log, "--place", "0.4,0.3", "--board", board, "--fit", "heading")
    assert "has no turntable to fit" in message
