"""`sonarhw calibrate LOG…`: from scans of the fake scanner to a profile, and errors of one line."""

import json
from pathlib import Path

import pytest
from sonarhw_cli.app import run
from sonarhw_sim.board.profile import load_board

from tests.fixtures.plate_scans import WALL

# m
PLACES = {"near": 0.25, "middle": 0.5, "far": 1.0}
HIDDEN = {"aperture_radius": 0.0178, "gain_step_db": 3.3, "threshold_db": -36.5, "blanking": 0.0017}


def changed(values: dict[str, float]) -> str:
    """Return the shipped profile with other values."""
    lines = load_board("polaroid-6500").text.splitlines()
    keys = {line.split(" = ")[0]: row for row, line in enumerate(lines)}
    for key, value in values.items():
        lines[keys[key]] = f"{key} = {value}"
    return "\n".join(lines) + "\n"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the start profile, and logs of a wall by a fake scanner with other constants."""
    folder = tmp_path_factory.mktemp("plates")
    places = "".join(f"[places.{name}]\nposition = [{-one}, 0.0]\n" for name, one in PLACES.items())
    (folder / "wall.toml").write_text(WALL + places)
    (folder / "hidden.toml").write_text(changed(HIDDEN))
    (folder / "start.toml").write_text(changed({"blanking": 0.0008}))
    for name in PLACES:
        # with seed 1, the post of the fake is in the beam
        url = f"fake:{folder / 'wall.toml'}?place={name}&board={folder / 'hidden.toml'}&pace=max&seed=2"
        sector = ["--from", "-40", "--to", "40", "--step", "2", "--pings", "3", "--traces"]
        log, start = str(folder / f"{name}.mcap"), str(folder / "start.toml")
        assert run(["scan", url, *sector, "--board", start, "--out", log]) == 0
    return folder


def calibrated(folder: Path, *options: str, names: tuple[str, ...] = tuple(PLACES)) -> int:
    logs = [str(folder / f"{name}.mcap") for name in names]
    distances = [text for name in names for text in ("--distance", str(PLACES[name]))]
    out = ["--board", str(folder / "start.toml"), "--out", str(folder / "mine.toml"), "--force"]
    return run(["calibrate", *logs, *distances, *out, *options])


def test_the_profile_contains_the_constants_of_the_scanner(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert calibrated(folder) == 0
    printed = capsys.readouterr().out
    assert "aperture_radius: 0.017" in printed
    assert "; before: 0.0192" in printed
    found = load_board(str(folder / "mine.toml"))
    assert found.name == "mine"
    assert found.aperture_radius == pytest.approx(HIDDEN["aperture_radius"], rel=0.02)
    assert found.gain_step_db == pytest.approx(HIDDEN["gain_step_db"], abs=0.5)
    assert found.blanking == pytest.approx(HIDDEN["blanking"], abs=20e-6)
    assert found.max_range == load_board("polaroid-6500").max_range
    assert "#   middle.mcap: plate at 0.5 m" in found.text


def test_a_plate_scanned_now_gives_what_a_log_of_the_same_scan_gives(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    board = {"aperture_radius": 0.0178, "threshold_db": -36.5}
    (folder / "louder.toml").write_text(changed(board))
    url = f"fake:{folder / 'wall.toml'}?place=far&board={folder / 'louder.toml'}&pace=max&seed=1"
    sector = ["--from", "-30", "--to", "30", "--step", "0.5", "--pings", "3"]
    log, out = str(folder / "now.mcap"), folder / "now.toml"
    assert run(["scan", url, *sector, "--out", log]) == 0
    capsys.readouterr()
    results = []
    for source in (url, log):
        options = ["--distance", "1", "--board", "polaroid-6500", "--out", str(out), "--force", "--json"]
        assert run(["calibrate", source, *options]) == 0
        results.append(json.loads(capsys.readouterr().out))
    now, later = ({one["key"]: one for one in result["findings"]} for result in results)
    assert results[0]["plate"]["headings"] > 20
    assert now.pop("range_offset")["value"] == pytest.approx(results[0]["plate"]["range_offset"], abs=1e-5)
    assert now.pop("home_angle_deg")["low"] < 0.3
    assert now == later
    assert (
        results[0]["kept"].keys()
        == results[1]["kept"].keys()
        == {"blanking", "rise_cycles", "gain_step_db", "own_burst_db"}
    )
    for key, value in board.items():
        assert now[key]["low"] <= value <= now[key]["high"]


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--distance", "1"), "--distance: expected one for each of 3 logs, got 4; repeat the option"),
        (("--direction", "0", "--direction", "1"), "--direction: expected one for all logs, or 3, got 2"),
        (("--step", "2"), "--step: is for a scan by a scanner; remove it"),
        (("--direction", "nan"), "--direction nan: expected degrees"),
        (("--direction", "1e300"), "--direction 1e+300: expected degrees between -2147 and 2147"),
    ],
)
def test_bad_usage_is_one_line(
    folder: Path, capsys: pytest.CaptureFixture[str], options: tuple[str, ...], said: str
) -> None:
    assert calibrated(folder, *options) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1


def test_a_log_given_twice_and_a_log_beside_a_url_are_refused(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert calibrated(folder, names=("far", "far")) == 2
    assert "is given twice" in capsys.readouterr().err
    both = ["calibrate", str(folder / "far.mcap"), "fake:simple", "--distance", "1", "--distance", "1"]
    assert run([*both, "--out", str(folder / "other.toml")]) == 2
    assert "expected the URL of one scanner, or logs (*.mcap)" in capsys.readouterr().err


def test_logs_of_different_boards_need_one_board(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = str(tmp_path / "other.mcap")
    assert run(["simulate", "simple", "--place", "figure9", "--board", "hc-sr04", "--to", "10", "--out", log]) == 0
    both = ["calibrate", str(folder / "far.mcap"), log, "--distance", "1", "--distance", "1"]
    assert run([*both, "--out", str(tmp_path / "mine.toml")]) == 2
    assert "were recorded with different boards; give one board for both" in capsys.readouterr().err


def test_a_wrong_distance_gives_no_profile(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = folder / "none.toml"
    log = str(folder / "far.mcap")
    assert run(["calibrate", log, "--distance", "2.5", "--out", str(out)]) == 1
    assert "far.mcap: the plate is detected at 0 headings" in capsys.readouterr().err
    assert not out.exists()


def test_logs_that_determine_no_value_give_no_profile(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log, out = str(tmp_path / "plate.mcap"), tmp_path / "mine.toml"
    sector = ["--from", "-40", "--to", "40", "--step", "1"]
    board = ["--board", "hc-sr04"]
    assert run(["simulate", str(folder / "wall.toml"), "--place", "far", *board, *sector, "--out", log]) == 0
    capsys.readouterr()
    # without --board, the calibration begins with the board of the log
    assert run(["calibrate", log, "--distance", "1", "--out", str(out)]) == 1
    printed = capsys.readouterr()
    assert f"aperture_radius: stays {load_board('hc-sr04').aperture_radius:g}" in printed.out
    assert "mine.toml: not written: the logs determine no value" in printed.err
    assert not out.exists()
