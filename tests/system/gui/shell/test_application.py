"""The command `gui` as a process: signals, invalid arguments, and a missing display."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from sonarhw_cli.app import run
from sonarhw_gui.window.start import WindowStart

from sonarhw.log import read_log
from tests.fixtures.window_scene import ROOM
from tests.hang_guard import HANG, wait_until

COLUMNS = ["--heading", "deg", "--range", "cm", "--scale", "0.01"]
SONARHW = [sys.executable, "-c", "from sonarhw_cli.entry import main; main()"]


def started(tmp_path: Path, *arguments: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [*SONARHW, "gui", *arguments],
        env={**os.environ, "XDG_DATA_HOME": str(tmp_path)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def finished(tmp_path: Path, *arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [*SONARHW, "gui", *arguments],
        env={**os.environ, "XDG_DATA_HOME": str(tmp_path), **environment},
        capture_output=True,
        text=True,
        timeout=HANG,
    )


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGHUP])
def test_a_signal_during_a_scan_closes_window_and_log(tmp_path: Path, number: int) -> None:
    room = tmp_path / "small.toml"
    room.write_text(ROOM.read_text())
    process = started(tmp_path, f"fake:{room}?place=figure9&pace=2")
    recordings = tmp_path / "sonarhw" / "recordings"

    def recorded() -> bool:
        assert process.poll() is None, process.communicate()[1]
        return any(path.stat().st_size > 20_000 for path in recordings.glob("*.mcap"))

    wait_until(recorded)
    process.send_signal(number)
    _, errors = process.communicate(timeout=HANG)
    assert process.returncode == 130
    assert errors == ""
    (recording,) = recordings.glob("*.mcap")
    log = read_log(recording)
    assert log.torn is None
    assert log.readings


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["nowhere.mcap"], "nowhere.mcap: no such file"),
        (["fake:nowhere.toml"], "nowhere.toml"),
        ([f"fake:{ROOM}?place=nowhere"], "no place 'nowhere'"),
        ([f"fake:{ROOM}?place=figure9&pace=never"], "pace never"),
        (["/dev/null", "--place", "figure9"], "--place needs --room"),
        (["/dev/null", "--board", "none"], "unknown board 'none'"),
        (["nowhere.csv"], "nowhere.csv: no such file"),
        (["nowhere.toml"], "nowhere.toml"),
        (
            [__file__],
            "_application.py: expected a log (*.mcap), a scan (*.csv), a room (name or *.toml) or the URL of a scanner",
        ),
        (["/dev/ttyNONE"], "/dev/ttyNONE: there is no such file or port"),
        ([f"{ROOM}l"], f"simple.tomll: there is no such file or port; did you mean '{ROOM}'? expected a log"),
        (["labratory"], "labratory: there is no such file or port; did you mean 'laboratory'? expected a log"),
        (["a.mcap", "b.csv"], "a.mcap b.csv: expected one log, scan or scanner at a time"),
        (["a.toml", "b.toml", "/dev/null"], "a.toml b.toml: expected one room"),
        (["a.toml", "--room", "b.toml"], "a.toml --room b.toml: expected one room"),
    ],
)
def test_invalid_arguments_give_one_line_and_no_window(
    arguments: list[str], message: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("DISPLAY", "")
    assert run(["gui", *arguments]) == 2
    errors = capsys.readouterr().err
    assert message in errors
    assert errors.count("\n") == 1


@pytest.fixture
def starts(monkeypatch: pytest.MonkeyPatch) -> list[WindowStart]:
    """The arguments of `run_window`, which opens no window in these tests."""
    starts: list[WindowStart] = []

    def run_window(start: WindowStart) -> int:
        starts.append(start)
        return 0

    monkeypatch.setattr("sonarhw_gui.window.start.run_window", run_window)
    return starts


def test_a_room_file_alone_is_shown_at_its_first_place_without_a_scanner(starts: list[WindowStart]) -> None:
    assert run(["gui", str(ROOM)]) == 0
    assert run(["gui", str(ROOM), "--place", "figure9"]) == 0
    assert [start.scene.place.name for start in starts] == ["figure7", "figure9"]
    assert [(start.source, start.used) for start in starts] == [(None, (ROOM,))] * 2


@pytest.mark.parametrize("way", [["--room", str(ROOM)], [str(ROOM)]])
def test_a_room_given_with_a_scan_is_the_room_of_the_scan(
    starts: list[WindowStart], tmp_path: Path, way: list[str]
) -> None:
    scan = tmp_path / "turret.CSV"
    scan.write_text("deg,cm\n0,15.4\n90,65.7\n")
    assert run(["gui", str(scan), *way, "--place", "figure9", "--board", "paper"]) == 0
    (start,) = starts
    assert (start.source_file, start.scene.place.name, start.scene.board.name) == (scan, "figure9", "paper")


@pytest.mark.parametrize("name", ["turret.csv", "turret.mcap"])
def test_a_scan_without_a_place_is_shown_at_the_first_place_of_the_room(
    starts: list[WindowStart], tmp_path: Path, name: str
) -> None:
    (tmp_path / "turret.csv").write_text("deg,cm\n0,15.4\n90,65.7\n")
    if name.endswith(".mcap"):
        assert run(["import", str(tmp_path / "turret.csv"), *COLUMNS, "--out", str(tmp_path / name)]) == 0
    assert run(["gui", str(tmp_path / name), str(ROOM)]) == 0
    (start,) = starts
    assert start.scene.place.name == "figure7"


def test_a_csv_file_without_known_columns_is_rejected(
    starts: list[WindowStart], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "odd.csv").write_text("a,b\n1,2\n")
    assert run(["gui", str(tmp_path / "odd.csv")]) == 2
    assert "exactly one column with a name for a heading" in capsys.readouterr().err
    assert not starts


def test_a_fake_scanner_has_the_url_that_was_given(monkeypatch: pytest.MonkeyPatch) -> None:
    urls: list[str] = []

    def run_window(start: WindowStart) -> int:
        with start.source.opener() as scanner:
            urls.append(scanner.url)
        return 0

    monkeypatch.setattr("sonarhw_gui.window.start.run_window", run_window)
    typed = f"fake:{ROOM}?place=figure9&pace=max"
    assert run(["gui", typed]) == 0
    assert urls == [typed]


@pytest.mark.parametrize("display", ["", ":4711"])
def test_a_missing_display_is_reported_with_a_solution(tmp_path: Path, display: str) -> None:
    result = finished(tmp_path, DISPLAY=display, WAYLAND_DISPLAY="", QT_QPA_PLATFORM="")
    assert result.returncode == 1
    assert "no display" in result.stderr
    assert "sonarhw demo --headless" in result.stderr
    assert result.stderr.count("\n") == 1
