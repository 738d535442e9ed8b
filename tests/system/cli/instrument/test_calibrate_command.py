"""`sonarhw calibrate` with a served board: the written profile is valid and has the simulated offset and angle."""

import json
import math
from pathlib import Path

import pytest
from sonarhw_cli.app import run
from sonarhw_sim.air import speed_of_sound
from sonarhw_sim.board.profile import load_board

from sonarhw.device.endpoint import serve
from sonarhw.device.fake_board import FakeBoard
from tests.checkout import CHECKOUT
from tests.fixtures.plate import Plate

DISTANCE = 1.25


def calibrated(out: Path, *options: str) -> int:
    """Calibrate with a plate 2 degrees to the left of its stated angle, whose ranges are 8 mm too long."""
    board = FakeBoard(Plate(DISTANCE, math.radians(2.0), 0.008, speed_of_sound(20.0)))
    with serve(board, tcp="127.0.0.1:0", pace="max") as endpoint:
        return run(["calibrate", endpoint.url, "--distance", str(DISTANCE), "--out", str(out), *options])


def test_the_profile_contains_offset_and_home_angle_of_the_plate(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "bench.toml"
    assert calibrated(out) == 0
    printed = capsys.readouterr().out
    assert "range offset +8." in printed
    profile, shipped = load_board(str(out)), load_board("polaroid-6500")
    assert profile.name == "bench"
    assert profile.range_offset == pytest.approx(0.008, abs=0.001)
    assert profile.home_angle_deg == pytest.approx(-2.0, abs=0.26)
    assert (profile.frequency, profile.blanking, profile.threshold_db) == (
        shipped.frequency,
        shipped.blanking,
        shipped.threshold_db,
    )
    # again, with the written profile: its keys are replaced, not added
    assert calibrated(out, "--board", str(out), "--force") == 2
    again = tmp_path / "again.toml"
    assert calibrated(again, "--board", str(out)) == 0
    assert load_board(str(again)).range_offset == pytest.approx(profile.range_offset, abs=1e-5)


@pytest.mark.parametrize(
    "options",
    [("--distance", "0.1"), ("--distance", "100"), ("--width", "1"), ("--width", "12", "--step", "2")],
)
def test_bad_usage_is_one_line_and_leaves_no_profile(
    options: tuple[str, ...], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "bench.toml"
    assert run(["calibrate", "socket://127.0.0.1:9", "--distance", "1", "--out", str(out), *options]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1
    assert not out.exists()


def test_a_sector_of_too_few_headings_is_refused_before_the_turntable_moves(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert calibrated(tmp_path / "bench.toml", "--width", "2", "--step", "2") == 2
    assert "--width 2, --step 2: 1 heading; expected at least 7" in capsys.readouterr().err


def test_a_missing_plate_gives_an_error_and_no_profile(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "bench.toml"
    assert calibrated(out, "--distance", "3.0") == 1
    assert "the plate is detected at 0 headings" in capsys.readouterr().err
    assert not out.exists()


def test_offset_and_home_angle_are_used_by_the_prediction(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    room = str(CHECKOUT / "rooms" / "simple.toml")
    profile, log = tmp_path / "bench.toml", tmp_path / "scan.mcap"
    profile.write_text(f"{load_board('polaroid-6500').text}\nrange_offset = 0.01\nhome_angle_deg = 30.0\n")
    ranges = []
    for board in ("polaroid-6500", str(profile)):
        assert run(["simulate", room, "--place", "figure7", "--step", "90", "--board", board]) == 0
        ranges.append([float(line.split(",")[1]) for line in capsys.readouterr().out.splitlines()[1:]])
    assert ranges[1] == pytest.approx([value + 0.01 for value in ranges[0]], abs=1e-8)
    assert run(["simulate", room, "--place", "figure7", "--out", str(log)]) == 0
    capsys.readouterr()
    for board, heading in (("polaroid-6500", 0.0), (str(profile), 30.0)):
        assert run(["compare", str(log), "--room", room, "--place", "figure7", "--board", board, "--json"]) == 0
        assert json.loads(capsys.readouterr().out)["heading_deg"] == pytest.approx(heading)


@pytest.mark.parametrize("temperature", ["900", "nan"])
def test_an_impossible_air_temperature_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], temperature: str
) -> None:
    assert calibrated(tmp_path / "bench.toml", "--temperature", temperature) == 2
    assert "--temperature" in capsys.readouterr().err
