"""`sonarhw calibrate` against a served board: the profile it writes is one that loads and says what was put in."""

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
    """Calibrate against a plate 2 degrees to the left of where it should be, told 8 mm too far."""
    board = FakeBoard(Plate(DISTANCE, math.radians(2.0), 0.008, speed_of_sound(20.0)))
    with serve(board, tcp="127.0.0.1:0", pace="max") as endpoint:
        return run(["calibrate", endpoint.url, "--distance", str(DISTANCE), "--out", str(out), *options])


def test_the_profile_says_what_the_plate_has_shown(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "bench.toml"
    assert calibrated(out) == 0
    told = capsys.readouterr().out
    assert "range offset +8." in told
    profile, shipped = load_board(str(out)), load_board("polaroid-6500")
    assert profile.name == "bench"
    assert profile.range_offset == pytest.approx(0.008, abs=0.001)
    assert profile.home_angle_deg == pytest.approx(-2.0, abs=0.26)
    assert (profile.frequency, profile.blanking, profile.threshold_db) == (
        shipped.frequency,
        shipped.blanking,
        shipped.threshold_db,
    )
    # once more, from its own profile: the keys are replaced, not added
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


def test_a_sector_of_too_few_headings_is_refused_before_anything_turns(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert calibrated(tmp_path / "bench.toml", "--width", "2", "--step", "2") == 2
    assert "--width 2, --step 2: 1 heading; expected at least 7" in capsys.readouterr().err


def test_a_missing_plate_is_told_and_leaves_no_profile(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "bench.toml"
    assert calibrated(out, "--distance", "3.0") == 1
    assert "the plate is detected at 0 headings" in capsys.readouterr().err
    assert not out.exists()


def test_what_was_found_is_used_by_the_prediction(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    room = str(CHECKOUT / "rooms" / "simple.toml")
    profile, log = tmp_path / "bench.toml", tmp_path / "scan.mcap"
    profile.write_text(f"{load_board('polaroid-6500').text}\nrange_offset = 0.01\nhome_angle_deg = 30.0\n")
    told = []
    for board in ("polaroid-6500", str(profile)):
        assert run(["simulate", room, "--place", "figure7", "--step", "90", "--board", board]) == 0
        told.append([float(line.split(",")[1]) for line in capsys.readouterr().out.splitlines()[1:]])
    assert told[1] == pytest.approx([value + 0.01 for value in told[0]], abs=1e-8)
    assert run(["simulate", room, "--place", "figure7", "--out", str(log)]) == 0
    capsys.readouterr()
    for board, heading in (("polaroid-6500", 0.0), (str(profile), 30.0)):
        assert run(["compare", str(log), "--room", room, "--place", "figure7", "--board", board, "--json"]) == 0
        assert json.loads(capsys.readouterr().out)["heading_deg"] == pytest.approx(heading)


@pytest.mark.parametrize("temperature", ["900", "nan"])
def test_air_that_no_room_has_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str], temperature: str) -> None:
    assert calibrated(tmp_path / "bench.toml", "--temperature", temperature) == 2
    assert "--temperature" in capsys.readouterr().err
